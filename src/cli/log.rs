//! The log of a bake (`--log FILE`): JSON lines, one record a line, each written out at once.
//!
//! Figures of error are objects `{"value": ..., "kind": ...}` with kind `bound` (cannot be exceeded), `estimate` or
//! `measured` (compared with an independent answer). Numbers that are not known (or not finite) are `null`. Colour
//! differences are means over random points of the room's surfaces, by the area that counts (`averages`), of the irradiance they get, under the
//! adaptation white. Seconds are wall time.
//!
//! First `{"record": "plan", ...}` ([`PlanRecord`]):
//!
//! | field | what |
//! |---|---|
//! | `version` | of this format: 1. Raised when a field changes its meaning or goes; new fields do not raise it |
//! | `program` | name and version of the program |
//! | `effects` | list of `name`, `runs`, `lacking` (asked for by the scene and not in the program), `reason` |
//! | `facts` | the room: see [`Facts`], units in the names |
//! | `settings` | see [`SettingsRecord`] |
//! | `warnings` | what the user should know of the room, sentences |
//! | `averages` | what errors are averaged over: `over` in words, `counted_m2` of `area_m2` (see [`Averages`]). Area counts in full where light of the lamps, followed from surface to surface, lands at least a fiftieth as densely as usual, in proportion where less, and where none lands not at all. Of that counts all where at least an eighth of what the area faces is an eighth as far away as things in the room usually are from each other, or further, and in proportion where less: nobody looks into a gap |
//!
//! Then for each round `{"record": "round", ...}` ([`Round`]):
//!
//! | field | unit | what |
//! |---|---|---|
//! | `round` | | number, from 1 |
//! | `elapsed_s` | s | since the room was read |
//! | `round_s`, `phases_s` | s | of this round, and by phase: `links`, `spectrum`, `direct`, `balance`, `solve`, `estimate` |
//! | `next_round_s`, `remaining_s` | s | expected for the next round, and for all rounds until the bake ends (see [`forecast`](crate::solve::forecast)); the latter `null` if the error is not known or no end is in sight |
//! | `remaining_rounds` | | expected rounds, `null` likewise |
//! | `to_end_s` | s | expected until the file is there: these rounds and its mesh, no more than what is left of `--time`; `null` if that is not known, as of light maps, and of rounds before a checkpoint |
//! | `look_s` | s | of a look at a point, with all threads at work |
//! | `threshold` | share of white | greatest error that a link keeps, weighted by the root of the receiver's share of area |
//! | `rays` | | visibility rays cast in this round for links, direct light and openness |
//! | `opening_rays` | | rays by which the openings of a room under a sky were looked for before the first round, of a closed room always as many; 0 without a sky and in later rounds |
//! | `links_evaluated`, `links_capped` | | links looked at; those that wanted refinement but had the least size |
//! | `elements`, `nodes`, `links`, `links_clear` | | leaves of the hierarchy, all patches, links, links proved free of blockers |
//! | `intervals_working`, `intervals_mean` | | wavelength intervals of the working partition (all lights), and mean over patches |
//! | `memory_bytes` | B | hierarchy, links and rows |
//! | `row_bytes` | B | of these, what the rays of leaves met where leaves look for themselves; of several ranks, the first rank's |
//! | `bytes_per_link` | B | of these, for each link: 28 for itself, 4 for each blocker, 16 in the rows of the solve and 32 in those of the gather |
//! | `bytes_per_element` | B | of these, for each leaf of the hierarchy: patches, rows of light, direct light |
//! | `iterations` | | operator applications of the solve |
//! | `fluorescence_rounds` | | how often all bounces were found, until what fluoresces changed no more; 0 where nothing does |
//! | `error.total_de2000`, `.total_de_luv` | dE00, dE*uv | all sources; `null` in the first round, as two are compared |
//! | `error.total_relative` | 1 | root mean square relative error of illuminance |
//! | `error.total_xyz` | lm/m2 | root mean square error of tristimulus irradiance |
//! | `error.noise_de2000` | dE00 | of the error, the noise of a gather, which finer elements do not lessen: an estimate, from two gathers of each watched point; `null` where light goes along links, which have next to none |
//! | `error.geometry_chromaticity` | 1 | root mean square error of chromaticity by hierarchy, links and visibility, distance in the CIE 1960 (u, v) diagram |
//! | `error.geometry_de_luv`, `.spectrum_de_luv`, `.convergence_de_luv` | dE*uv | by source |
//! | `error.convergence` | 1 | of the solve, relative, in the solver's norm |
//! | `flux.emitted_lm`, `.received_lm` | lm | given out by surfaces; what fronts receive straight from lamps of any kind |
//! | `flux.absorbed_lm`, `.escaped_lm` | lm | absorbed by fronts; left the room or met a black back |
//! | `flux.fluoresced_lm` | lm | given out at other wavelengths than excite it; of the flux that is absorbed |
//! | `flux.worst_band` | 1 | worst relative difference of received (with what is fluoresced) and absorbed + escaped light over all bands |
//! | `flux.sent` | 1 | where the light of lamps goes first, by rays from them: `to_fronts`, `to_backs`, `outside`, `in_panes` (absorbed or reflected by panes), shares (estimates, to .1 %) of `lamps_lm`, the flux of all but directional lamps, lm |
//! | `flux.scaled` | 1 | what light on leaves was multiplied by so that none goes missing, `direct` and `reflected`; 1: nothing was |
//! | `row_sum_defect`, `row_sum_defect_after` | 1 | distance of row sums from what each leaf looks out on: mean by area and greatest, before and after balancing |
//!
//! After a round with `--snapshots` (left out where pictures would take more than a tenth of the time), `{"record": "snapshots", ...}` ([`SnapshotsRecord`]): `round`, `files`,
//! `exposure`, metered in this round: `scale` (display value for each lm/m2), `balance` (white balance, a matrix on linear
//! sRGB), `compressed` (share of what the cameras see, lamps left out, that the curve towards white makes darker).
//!
//! With `--audit N`, `{"record": "audit", ...}` ([`Report`](crate::audit::Report)), of light as a viewer draws it, interpolated
//! between vertices:
//!
//! | field | unit | what |
//! |---|---|---|
//! | `points`, `covered` | | random points compared; those left out, as something solid covers them or, of what a file shows, they lie inside of something |
//! | `paths`, `seed` | | paths traced in all; seed of points and paths |
//! | `de2000` | dE00 | colour difference of irradiance: `mean`, `rms`, `p95`, `max`, each with `value`, `low`, `high` (interval of 95 %), the audit's noise taken out |
//! | `relative` | 1 | error of illuminance without sign, the same |
//! | `bias` | 1 | error of the mean illuminance with sign, bake less truth over truth: `value`, `low`, `high` |
//! | `noise_de2000` | dE00 | mean standard error of the audit itself |
//! | `worst` | | the five points that are furthest off: `at` (m), `normal`, `baked_lux`, `traced_lux`, `de2000` |
//! | `estimate_de2000` | dE00 | what is estimated of the file: light of the last round, and between vertices |
//! | `honesty` | | `honest`: estimate within 0.7 and 3 times `de2000.mean`, as far as its interval tells; `too_low`, `too_high`, `no_estimate` |
//!
//! Last `{"record": "verdict", ...}` ([`VerdictRecord`]), which `--json` prints too.

use crate::PROGRAM;
use crate::gather::{Baked, Interpolation};
use crate::output::{BakedGlb, Exposure};
use crate::scene::effects::Plan;
use crate::scene::facts::Facts;
use crate::solve::record::{Figure, FigureKind, LOG_VERSION};
use crate::solve::{Averages, Bake, Representation, Round, Verdict};
use serde::Serialize;

/// What was asked for.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct SettingsRecord {
    /// Mean CIEDE2000 at which to stop.
    pub error_de2000: f64,
    /// Limit of time, s.
    pub time_s: Option<f64>,
    /// Rounds at the most.
    pub rounds: usize,
    /// `adaptive` or `dense`.
    pub representation: Representation,
    /// First and last wavelength, nm.
    pub range_nm: [f64; 2],
    /// Tristimulus irradiance of the adaptation white, lm/m2; none: twice the mean irradiance of the room.
    pub white: Option<[f64; 3]>,
    /// Seed of all sampling patterns.
    pub seed: u64,
    /// Threads, of each rank.
    pub threads: usize,
    /// Ranks that bake the room together.
    pub ranks: usize,
}

impl SettingsRecord {
    /// The settings of a bake.
    pub fn of(bake: &Bake, time_s: Option<f64>) -> Self {
        let (settings, grid) = (bake.settings(), &bake.scene().grid);
        Self {
            error_de2000: settings.error,
            time_s,
            rounds: settings.rounds,
            representation: settings.representation,
            range_nm: [grid.start(), grid.end()],
            white: settings.white,
            seed: settings.seed,
            threads: rayon::current_num_threads(),
            ranks: bake.team().ranks(),
        }
    }
}

/// The first line.
#[derive(Debug, Clone, Serialize)]
pub struct PlanRecord<'a> {
    record: &'static str,
    /// Version of the format.
    pub version: u32,
    /// Name and version of the program.
    pub program: &'static str,
    /// What runs, what does not, and why.
    pub effects: &'a Plan,
    /// The room.
    pub facts: Facts,
    /// What was asked for.
    pub settings: SettingsRecord,
    /// Warnings about the room.
    pub warnings: &'a [String],
    /// What errors are averaged over.
    pub averages: Averages,
}

impl<'a> PlanRecord<'a> {
    /// The record of a bake that begins.
    pub fn new(bake: &'a Bake, time_s: Option<f64>) -> Self {
        Self {
            record: "plan",
            version: LOG_VERSION,
            program: PROGRAM,
            effects: bake.plan(),
            facts: Facts::of(bake.scene()),
            settings: SettingsRecord::of(bake, time_s),
            warnings: &bake.scene().warnings,
            averages: bake.averages(),
        }
    }
}

/// A round.
#[derive(Debug, Clone, Serialize)]
pub struct RoundRecord<'a> {
    /// What was measured.
    #[serde(flatten)]
    pub round: &'a Round,
    /// Seconds expected from here to the end of the bake.
    pub to_end_s: Option<f64>,
}

/// Pictures of a round.
#[derive(Debug, Clone, Serialize)]
pub struct SnapshotsRecord<'a> {
    record: &'static str,
    /// Number of the round.
    pub round: usize,
    /// Paths.
    pub files: &'a [String],
    /// Exposure of the pictures.
    pub exposure: Exposure,
}

impl<'a> SnapshotsRecord<'a> {
    /// The record.
    pub fn new(round: usize, files: &'a [String], exposure: Exposure) -> Self {
        Self {
            record: "snapshots",
            round,
            files,
            exposure,
        }
    }
}

/// Files written.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct Outputs {
    /// The baked room.
    pub glb: String,
    /// Arrays.
    pub npz: Option<String>,
    /// The log.
    pub log: Option<String>,
    /// What relighting needs.
    pub cache: Option<String>,
    /// The page that shows the room.
    pub report: Option<String>,
    /// The index of light maps, and their pages.
    pub maps: Vec<String>,
    /// Light in the air: the list of probes, and their texture.
    pub probes: Vec<String>,
    /// Pictures of all rounds.
    pub pictures: Vec<String>,
    /// High dynamic range pictures of the result.
    pub exr: Vec<String>,
}

/// A layer of lamps.
#[derive(Debug, Clone, Serialize)]
pub struct LayerRecord {
    /// Its name.
    pub name: String,
    /// Of its light at points between vertices: mean CIEDE2000, measured.
    pub interpolation_de2000: Figure,
}

impl LayerRecord {
    fn of(bake: &Bake, baked: &Baked) -> Vec<Self> {
        let names = bake.layers().into_iter().flat_map(|layers| &layers.names);
        let one = |(name, found): (&String, &Interpolation)| Self {
            name: name.clone(),
            interpolation_de2000: Figure {
                value: Some(found.mean),
                kind: FigureKind::Measured,
            },
        };
        names.zip(&baked.layers).map(one).collect()
    }
}

/// Seconds of the parts of a bake, wall time.
#[derive(Debug, Clone, Copy, Default, Serialize)]
#[non_exhaustive]
pub struct Seconds {
    /// Reading the room.
    pub load: f64,
    /// Cameras, hierarchy and ray index.
    pub prepare: f64,
    /// Rounds, with one that was taken back.
    pub solve: f64,
    /// Gather at the vertices of the output.
    pub gather: f64,
    /// Pictures of rounds, and the gathers for all but the last of them.
    pub snapshots: f64,
    /// Monte Carlo.
    pub audit: f64,
    /// Encoding and writing.
    pub write: f64,
    /// From the start of the command to the verdict.
    pub total: f64,
}

/// The last line.
#[derive(Debug, Clone, Serialize)]
pub struct VerdictRecord {
    record: &'static str,
    /// Version of the format.
    pub version: u32,
    /// `reached`, `out_of_time`, `interrupted`, `out_of_rounds` or `exhausted`.
    pub verdict: Verdict,
    /// Exit code of the command: 0 if the error was reached, else 1.
    pub exit_code: u8,
    /// Rounds done.
    pub rounds: usize,
    /// Seconds of a further round that was not done when the bake had to end, and was taken back; none if there was none.
    pub taken_back_s: Option<f64>,
    /// Mean CIEDE2000 asked for.
    pub asked_de2000: f64,
    /// Error of the file, CIEDE2000: light at points and straight lines between vertices, whose squares add.
    pub error_de2000: Figure,
    /// Of which light at points: total of the last round.
    pub light_de2000: Figure,
    /// Of which straight lines between vertices: mean, measured.
    pub interpolation_de2000: Figure,
    /// How that was measured, and what it may be.
    pub interpolation: Option<Interpolation>,
    /// How far light between vertices is from what looking there shows, layer by layer, under the adaptation white of the whole; none
    /// without `--layers`, and of maps.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<LayerRecord>,
    /// Files.
    pub outputs: Outputs,
    /// Vertices written.
    pub vertices: usize,
    /// Triangles written.
    pub triangles: usize,
    /// Vertices that something solid covers: they got their neighbours' light.
    pub covered: usize,
    /// Triangles that wanted to be finer when the limits were met.
    pub capped: usize,
    /// Vertices that were beyond white or outside of sRGB before the curve.
    pub clipped: usize,
    /// Vertices that the curve towards white made darker.
    pub compressed: usize,
    /// Exposure value of COLOR_0 for ISO 100.
    pub ev100: f64,
    /// Exposure of COLOR_0 and of the last pictures.
    pub exposure: Exposure,
    /// Tristimulus irradiance of the adaptation white, lm/m2.
    pub white: [f64; 3],
    /// Illuminance, colour temperature, rendering, fidelity and alpha-opic daylight of the mean light on all surfaces, each with the range
    /// that the error of light at points allows; names as of `probe --metrics`. In a log, a report and by `--json` also the illuminance, its
    /// uniformity and daylight factors on the working plane, and glare as the cameras see it.
    pub metrics: serde_json::Value,
    /// Visibility rays of all rounds and of the gather.
    pub rays: u64,
    /// Rays a second, in rounds and gather.
    pub rays_per_s: f64,
    /// Links evaluated a second, in the phase that makes them.
    pub links_per_s: f64,
    /// Seconds by part.
    pub seconds: Seconds,
    /// What could not be carried over to the output.
    pub warnings: Vec<String>,
    /// These and those of the plan.
    pub warning_count: usize,
}

/// Everything that the last line tells of.
pub(super) struct FinalRecord<'a> {
    pub(super) bake: &'a Bake,
    pub(super) verdict: Verdict,
    pub(super) baked: &'a Baked,
    pub(super) glb: &'a BakedGlb,
    pub(super) exposure: Exposure,
    pub(super) outputs: Outputs,
    pub(super) metrics: serde_json::Value,
    pub(super) seconds: Seconds,
    pub(super) warned: usize,
}

impl VerdictRecord {
    pub(super) fn new(end: FinalRecord) -> Self {
        let rounds = end.bake.rounds();
        let links_s: f64 = rounds
            .iter()
            .filter_map(|r| r.phases_s.get("links")?.as_f64())
            .sum();
        let links: u64 = rounds.iter().map(|r| r.links_evaluated).sum();
        let rays = rounds.iter().map(|r| r.rays).sum::<u64>() + end.baked.rays;
        let rate = |count: u64, seconds: f64| {
            if seconds > 0.0 {
                count as f64 / seconds
            } else {
                0.0
            }
        };
        let unknown = Figure::estimate(None);
        Self {
            record: "verdict",
            version: LOG_VERSION,
            verdict: end.verdict,
            exit_code: exit_code(end.verdict),
            rounds: rounds.len(),
            taken_back_s: end.bake.taken_back_s(),
            asked_de2000: end.bake.settings().error,
            error_de2000: Figure::estimate(end.bake.error_of(end.baked)),
            light_de2000: rounds.last().map_or(unknown, |r| r.error.total_de2000),
            interpolation_de2000: Figure {
                value: end.baked.interpolation.map(|i| i.mean),
                kind: FigureKind::Measured,
            },
            interpolation: end.baked.interpolation,
            layers: LayerRecord::of(end.bake, end.baked),
            outputs: end.outputs,
            vertices: end.glb.vertices,
            triangles: end.glb.triangles,
            covered: end.baked.covered,
            capped: end.baked.capped,
            clipped: end.glb.clipped,
            compressed: end.glb.compressed,
            ev100: end.exposure.ev(),
            exposure: end.exposure,
            white: end.bake.light().white,
            metrics: end.metrics,
            rays,
            rays_per_s: rate(rays, end.seconds.solve + end.seconds.gather),
            links_per_s: rate(links, links_s),
            seconds: end.seconds,
            warnings: end.glb.warnings.clone(),
            warning_count: end.warned,
        }
    }
}

/// 0 if the error was reached, 1 if the bake stopped before.
pub fn exit_code(verdict: Verdict) -> u8 {
    u8::from(verdict != Verdict::Reached)
}
