//! One bake of a room: what it cost, phase by phase, and how wrong it is by the path tracer.
//!
//! Times are CPU seconds (`clock`). A bake ends with the light at the vertices of the refined mesh; comparing it is not
//! counted. `memory` is what hierarchy, links and rows hold, without the room itself and its ray index.

use super::clock;
use crate::audit::{Measured, PathReference, Report};
use crate::scene::Scene;
use crate::solve::{Bake, Representation, Round, Settings};
use serde::Serialize;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Phases in the order in which they happen.
pub(super) const PHASES: [&str; 8] = [
    "prepare", "links", "spectrum", "direct", "balance", "solve", "estimate", "vertices",
];

/// What is to be baked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task {
    /// How spectra are carried.
    pub representation: Representation,
    /// Error asked for, mean CIEDE2000.
    pub error: f64,
    /// Error that spectra may cause, mean CIELUV, if it is not to be a share of `error`. Rounds then go on until
    /// geometry alone meets `error`.
    pub spectrum: Option<f64>,
}

/// What came of it.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Run {
    /// How spectra were carried.
    pub representation: Representation,
    /// Error asked for, mean CIEDE2000.
    pub asked: f64,
    /// Error asked of spectra alone, mean CIELUV; none: a share of `asked`.
    pub asked_spectrum: Option<f64>,
    /// Wall time, s.
    pub wall_s: f64,
    /// CPU time, s.
    pub cpu_s: f64,
    /// CPU time by phase, s: `prepare`, the phases of the rounds, `vertices`.
    pub phases_s: Vec<(&'static str, f64)>,
    /// Rounds.
    pub rounds: usize,
    /// Elements.
    pub elements: usize,
    /// Links.
    pub links: usize,
    /// Vertices of the refined mesh.
    pub vertices: usize,
    /// Visibility rays for links, direct light and balance.
    pub rays: u64,
    /// Lanes in use.
    pub intervals: usize,
    /// Bytes in hierarchy, links and rows.
    pub memory: usize,
    /// The bake's own estimate, mean CIEDE2000.
    pub estimate: Option<f64>,
    /// What it believes spectra to cost, mean CIELUV.
    pub estimate_spectrum: Option<f64>,
    /// Measured error, mean CIEDE2000, interval of 95 %.
    #[serde(serialize_with = "ends")]
    pub de2000: Measured,
    /// The value that 95 % of the points do not exceed, CIEDE2000.
    pub de2000_p95: f64,
    /// Root mean square of the relative error of illuminance.
    pub relative_rms: f64,
}

fn ends<S: serde::Serializer>(m: &Measured, serializer: S) -> Result<S::Ok, S::Error> {
    [m.value, m.low, m.high].serialize(serializer)
}

impl Run {
    /// Bakes `scene` and compares. `white` is the irradiance of the adaptation white.
    pub fn new(
        scene: Scene,
        task: Task,
        truth: &PathReference,
        white: [f64; 3],
        seed: u64,
    ) -> Self {
        let (cpu, wall) = (clock::seconds(), Instant::now());
        let laps = Arc::new(Mutex::new((cpu, Vec::<(&'static str, f64)>::new())));
        let lap = {
            let laps = Arc::clone(&laps);
            move |name: &'static str| {
                // A lock is poisoned by a panic only, and then nothing here matters.
                let mut laps = laps.lock().unwrap_or_else(|e| e.into_inner());
                let now = clock::seconds();
                let spent = now - laps.0;
                laps.0 = now;
                match laps.1.iter_mut().find(|(n, _)| *n == name) {
                    Some((_, sum)) => *sum += spent,
                    None => laps.1.push((name, spent)),
                }
            }
        };
        let mut bake = Bake::new(scene, settings(task, Some(white), seed));
        lap("prepare");
        bake.watch(Arc::new(lap.clone()));
        bake_to_the_end(&mut bake, task);
        let baked = bake.baked(&|_, _| {});
        lap("vertices");
        let (cpu_s, wall_s) = (clock::seconds() - cpu, wall.elapsed().as_secs_f64());
        let report = Report::against(&bake, truth);
        let last = bake.rounds().last();
        let laps = laps.lock().unwrap_or_else(|e| e.into_inner());
        Self {
            representation: task.representation,
            asked: task.error,
            asked_spectrum: task.spectrum,
            wall_s,
            cpu_s,
            phases_s: laps.1.clone(),
            rounds: bake.rounds().len(),
            elements: last.map_or(0, |r| r.elements),
            links: last.map_or(0, |r| r.links),
            vertices: baked.surfaces.iter().map(|s| s.vertices.len()).sum(),
            rays: bake.rounds().iter().map(|r| r.rays).sum(),
            intervals: bake.lanes().len(),
            memory: last.map_or(0, |r| r.memory_bytes),
            estimate: last.and_then(|r| r.error.total_de2000.value),
            estimate_spectrum: last.and_then(|r| r.error.spectrum_de_luv.value),
            de2000: report.de2000.mean,
            de2000_p95: report.de2000.p95.value,
            relative_rms: report.relative.rms.value,
        }
    }

    /// CPU time of a phase, s.
    pub fn phase(&self, name: &str) -> f64 {
        let found = self.phases_s.iter().find(|(n, _)| *n == name);
        found.map_or(0.0, |(_, s)| *s)
    }

    /// Takes the times of another run of the same task if it was faster: what disturbs a run only ever slows it.
    pub fn faster_of(&mut self, other: &Self) {
        if other.cpu_s < self.cpu_s {
            self.cpu_s = other.cpu_s;
            self.phases_s.clone_from(&other.phases_s);
        }
        self.wall_s = self.wall_s.min(other.wall_s);
    }
}

pub(super) fn settings(task: Task, white: Option<[f64; 3]>, seed: u64) -> Settings {
    Settings {
        error: task.error,
        spectrum: task.spectrum,
        representation: task.representation,
        white,
        seed,
        ..Settings::default()
    }
}

/// Rounds until the error is reached; where spectra have a tolerance of their own, until geometry meets its.
fn bake_to_the_end(bake: &mut Bake, task: Task) {
    if task.spectrum.is_none() {
        bake.run();
        return;
    }
    loop {
        let round = bake.step();
        if without_spectrum(round).is_some_and(|e| e <= task.error) || bake.verdict().is_some() {
            return;
        }
    }
}

/// The estimate of a round without what spectra cause; squares add.
fn without_spectrum(round: &Round) -> Option<f64> {
    let (all, own) = (
        round.error.total_de2000.value?,
        round.error.spectrum_de_luv.value.unwrap_or(0.0),
    );
    Some((all * all - own * own).max(0.0).sqrt())
}
