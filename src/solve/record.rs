//! What is written down after every round: the lines of the log.

use super::estimate::EstimatedError;
use super::flux::FluxBalance;
use super::solver::Convergence;
use crate::link::Refined;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Version of the log's format. Raised when a field changes its meaning or goes.
pub const LOG_VERSION: u32 = 1;

/// Called at the end of every phase, with its name.
pub type Watch = std::sync::Arc<dyn Fn(&'static str) + Send + Sync>;

/// Wall time of the phases of a round, seconds.
#[derive(Clone)]
pub struct Clock {
    start: Instant,
    last: Instant,
    laps: Vec<(&'static str, f64)>,
    watch: Option<Watch>,
}

impl Clock {
    /// Starts the first phase.
    pub fn start(watch: Option<Watch>) -> Self {
        let now = Instant::now();
        Self {
            start: now,
            last: now,
            laps: Vec::new(),
            watch,
        }
    }

    /// Ends a phase.
    pub fn lap(&mut self, name: &'static str) {
        let now = Instant::now();
        self.laps.push((name, (now - self.last).as_secs_f64()));
        self.last = now;
        if let Some(watch) = &self.watch {
            watch(name);
        }
    }

    /// Phases in order.
    pub fn laps(&self) -> &[(&'static str, f64)] {
        &self.laps
    }

    /// Seconds of the last phase.
    pub(super) fn last(&self) -> f64 {
        self.laps.last().map_or(0.0, |lap| lap.1)
    }

    pub(super) fn total(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}

/// A figure and what it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// The value; none if not known yet.
    pub value: Option<f64>,
    /// `bound`, `estimate` or `measured`.
    pub kind: FigureKind,
}

impl Figure {
    /// An estimate; a value that is not finite means not known.
    pub fn estimate(value: Option<f64>) -> Self {
        Self {
            value: value.filter(|v| v.is_finite()),
            kind: FigureKind::Estimate,
        }
    }
}

/// What an error figure is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FigureKind {
    /// Cannot be exceeded.
    Bound,
    /// Our best guess.
    Estimate,
    /// Compared with a reference.
    Measured,
}

/// Errors of a round by source; colour differences are means over random points of the room, under the adaptation white.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Errors {
    /// All sources, CIEDE2000.
    pub total_de2000: Figure,
    /// Of these the noise of a gather, which finer patches do not lessen: CIEDE2000; none where light goes along links.
    #[serde(default = "unknown")]
    pub noise_de2000: Figure,
    /// All sources, CIELUV.
    pub total_de_luv: Figure,
    /// Root mean square relative error of illuminance.
    pub total_relative: Figure,
    /// Root mean square error of chromaticity by hierarchy, links and visibility, distance in (u, v) of the CIE 1960 diagram.
    #[serde(default = "unknown")]
    pub geometry_chromaticity: Figure,
    /// Hierarchy, links, visibility: CIELUV.
    pub geometry_de_luv: Figure,
    /// Working partition: CIELUV; none where nothing is known (uniform intervals, sRGB and the like). A bound under
    /// guaranteed control.
    pub spectrum_de_luv: Figure,
    /// Unfinished solve: relative, in the norm of the solver.
    pub convergence: Figure,
    /// Unfinished solve, CIELUV.
    pub convergence_de_luv: Figure,
    /// Root mean square error of tristimulus irradiance X, Y, Z by all sources, lm/m2.
    pub total_xyz: Figure,
}

fn unknown() -> Figure {
    Figure::estimate(None)
}

fn round() -> &'static str {
    "round"
}

/// One round.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Round {
    /// Always `round`.
    #[serde(skip_deserializing, default = "round")]
    pub record: &'static str,
    /// Counted from 1.
    pub round: usize,
    /// Seconds since the room was read.
    pub elapsed_s: f64,
    /// Seconds in this round.
    pub round_s: f64,
    /// Expected seconds of the next round, from the growth so far.
    #[serde(default)]
    pub next_round_s: f64,
    /// Expected rounds until the bake ends, an estimate from the rounds so far; none if the error is not known or no end is in sight.
    #[serde(default)]
    pub remaining_rounds: Option<usize>,
    /// Expected seconds of these rounds (the gather for the output comes on top).
    #[serde(default)]
    pub remaining_s: Option<f64>,
    /// Seconds of a gather at a watched point, with all threads at work.
    #[serde(default)]
    pub look_s: f64,
    /// Seconds by phase.
    pub phases_s: serde_json::Map<String, serde_json::Value>,
    /// Greatest error that a link may keep: share of white, weighted by the root of the receiver's share of area.
    pub threshold: f64,
    /// Visibility rays cast for links and punctual lights in this round.
    pub rays: u64,
    /// Rays that looked for the openings of a room under a sky before the first round; 0 in other rounds.
    #[serde(default)]
    pub opening_rays: u64,
    /// Links evaluated in this round.
    pub links_evaluated: u64,
    /// Links that wanted refinement when their ends were as small as allowed.
    pub links_capped: u64,
    /// Leaves of the hierarchy.
    pub elements: usize,
    /// All patches.
    pub nodes: usize,
    /// Links.
    pub links: usize,
    /// Links proved free of blockers.
    pub links_clear: usize,
    /// Intervals of the working partition (lanes), all lights together.
    pub intervals_working: usize,
    /// Mean number of intervals that patches need for themselves.
    pub intervals_mean: f64,
    /// Bytes in hierarchy, links and rows.
    pub memory_bytes: usize,
    /// Bytes of these for the rows of leaves that look for themselves: of several ranks, those of the first.
    #[serde(default)]
    pub row_bytes: usize,
    /// Bytes for each link: the link with its blockers, two entries of its rows, two for the gather.
    #[serde(default)]
    pub bytes_per_link: f64,
    /// Bytes for each element: its patches, their rows and direct light.
    #[serde(default)]
    pub bytes_per_element: f64,
    /// Operator applications of the solve.
    pub iterations: usize,
    /// How often all bounces were found until fluorescence settled; 0 where nothing fluoresces.
    #[serde(default)]
    pub fluorescence_rounds: usize,
    /// Errors by source.
    pub error: Errors,
    /// Where the light went.
    pub flux: FluxBalance,
    /// Distance of row sums from 1 before balancing: area-weighted mean and greatest.
    pub row_sum_defect: [f64; 2],
    /// The same distances after balancing.
    pub row_sum_defect_after: [f64; 2],
}

/// The end of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The estimate meets the asked-for error.
    Reached,
    /// Time ran out.
    OutOfTime,
    /// The user stopped the bake.
    Interrupted,
    /// No more rounds allowed.
    OutOfRounds,
    /// Refining no longer pays: the limit of links is met, or the error no longer falls.
    Exhausted,
}

/// What a round measured, before it is written down.
pub(crate) struct RoundMeasurements<'a> {
    pub(super) threshold: f64,
    pub(super) refined: &'a Refined,
    pub(super) convergence: &'a Convergence,
    pub(super) estimate: Option<EstimatedError>,
    pub(super) flux: FluxBalance,
    pub(super) link_bytes: usize,
    pub(super) rays: u64,
    pub(super) clock: &'a Clock,
}
