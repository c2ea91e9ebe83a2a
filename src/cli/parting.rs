//! `bake --layers` and `--probes`: the light of each group of lamps, and light in the air.

use super::bake::BakeArgs;
use super::options::positive;
use super::talk::Talk;
use crate::error::{Problem, Result};
use crate::scene::Scene;
use crate::solve::Representation;

/// What is written beside the light of surfaces.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct Parting {
    /// Write the light of each lamp, or group of lamps ("layers" in the file of spectra), by itself as well, so that it can be
    /// dimmed: as COLOR_1, COLOR_2, ... or, with --light maps, as further pages.
    #[arg(long)]
    pub layers: bool,
    /// Write light in the air, in a grid of points so far apart (in the file's unit), for objects that move.
    #[arg(long, value_name = "SPACING", value_parser = positive)]
    pub probes: Option<f64>,
}

impl Parting {
    /// Parts the lamps of a room, if that was asked for.
    pub(super) fn part(self, scene: &mut Scene, talk: &Talk) -> Result<()> {
        if !self.layers {
            return Ok(());
        }
        scene.part_lamps()?;
        match &scene.changes.layers {
            Some(layers) => talk.say(&format!("layers: {}", layers.names.join(", "))),
            None => talk.warn("--layers: no lamp lights the room, there are none"),
        }
        Ok(())
    }
}

/// Options that do not go together.
pub(super) fn problems(args: &BakeArgs) -> Vec<Problem> {
    if !args.parting.layers {
        return Vec::new();
    }
    let other = args.spectrum != Representation::Adaptive;
    let refused = [
        (
            "--spectrum",
            other,
            "does not hold the light of each lamp by itself",
        ),
        (
            "--cache",
            args.cache.is_some(),
            "is for changing lamps without layers: `relight` knows none",
        ),
    ];
    let given = refused.into_iter().filter(|(_, given, _)| *given);
    given
        .map(|(option, _, what)| Problem::new(option, what, "leave it out, or leave --layers out"))
        .collect()
}
