//! What `haarlight bake` is asked for.

use super::maps::Mapping;
use super::options::{Reading, Showing, Solving, Storing, positive};
use super::parting::Parting;
use super::paths;
use crate::solve::Representation;
use crate::team::Team;
use std::path::PathBuf;

/// Arguments of `bake`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  haarlight bake room.glb
  haarlight bake room.gltf -o lit.glb --error 0.3 --spectra measured.spectra.json
  haarlight bake room.glb --snapshots pictures --log bake.jsonl --audit 200
  haarlight bake room.glb --checkpoint room.state      stop it at any time; the same command goes on
  haarlight bake room.glb --report                     and a page, room.report.html, to look at the light in a browser
  haarlight bake room.glb --cache                      then change lamps or paints: haarlight relight room.glb")]
#[non_exhaustive]
pub struct BakeArgs {
    /// The room, .glb or .gltf.
    pub room: PathBuf,
    /// The baked room [default: ROOM's name with .baked.glb, beside it].
    #[arg(short, long, value_name = "OUT.glb")]
    pub output: Option<PathBuf>,
    /// What to read.
    #[command(flatten)]
    pub reading: Reading,
    /// When to stop.
    #[command(flatten)]
    pub solving: Solving,
    /// How it is shown.
    #[command(flatten)]
    pub showing: Showing,
    /// How it is stored.
    #[command(flatten)]
    pub storing: Storing,
    /// In vertices or in maps.
    #[command(flatten)]
    pub mapping: Mapping,
    /// What is written beside it.
    #[command(flatten)]
    pub parting: Parting,
    /// The baked room has this many vertices at the most, but never fewer than the room itself.
    #[arg(long, value_name = "N")]
    pub vertices: Option<usize>,
    /// The baked room takes about this many megabytes (1e6 bytes) at the most, but never fewer than the room itself.
    #[arg(long, value_name = "MB", value_parser = positive)]
    pub megabytes: Option<f64>,
    /// JSON lines: plan, rounds, verdict.
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// A PNG from each camera after every round, while that takes less than a tenth of the time, and of the result; an EXR of
    /// the result.
    #[arg(long, value_name = "DIR")]
    pub snapshots: Option<PathBuf>,
    /// Positions, normals and spectra of all vertices for NumPy.
    #[arg(long, value_name = "FILE")]
    pub npz: Option<PathBuf>,
    /// Measure the error at N random points by Monte Carlo.
    #[arg(long, value_name = "N")]
    pub audit: Option<usize>,
    /// Keep the state of the bake here after every round; if the file is there already, go on from it.
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Keep here what `haarlight relight` needs to change lamps and paints without casting a ray [without a value: ROOM's
    /// name with .cache, beside it, where `relight` looks].
    #[arg(long, value_name = "FILE")]
    pub cache: Option<Option<PathBuf>>,
    /// Write a page that shows the room with its light, its errors and what they took: one HTML file that needs no network
    /// [without a value: ROOM's name with .report.html, beside it].
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<Option<PathBuf>>,
    /// The cache may take this much, MB.
    #[arg(long, value_name = "MB", default_value_t = 2048)]
    pub cache_limit: u64,
    /// How spectra are carried: perceptual, guaranteed (bounds instead of estimates), paper, lists, uniform:N,
    /// characteristic:N, dense (all 64 bands) or rgb.
    #[arg(long, value_name = "HOW", default_value_t, hide_short_help = true)]
    pub spectrum: Representation,
    /// Print the verdict as one JSON object.
    #[arg(long)]
    pub json: bool,
}

impl BakeArgs {
    /// The same with a report, named or not.
    pub(super) fn with_report(mut self) -> Self {
        self.report.get_or_insert(None);
        self
    }

    /// What a rank is to do: but for the first, it writes nothing that others need no part of.
    pub(super) fn of_rank(&self, team: Team) -> Self {
        let mut args = self.clone();
        if !team.is_first() {
            (args.log, args.npz, args.report) = (None, None, None);
            args.json = false;
        }
        args
    }

    pub(super) fn report(&self) -> Option<PathBuf> {
        let named = self.report.clone()?;
        Some(named.unwrap_or_else(|| paths::report_of(&self.room)))
    }
}
