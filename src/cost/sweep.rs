//! All bakes of a room against one reference: the path tracer's answer at random points, traced once.

use super::held::{HeldRun, held};
use super::knob::{KnobComparison, Pair, balance, pairs};
use super::run::{Run, Task, settings};
use crate::audit::PathReference;
use crate::scene::Scene;
use crate::solve::{Bake, Representation};

/// Paths a point at the most.
const MOST_PATHS: usize = 65_536;
/// Distinguishes the reference's random numbers from the solver's.
const TRUTH_SEED: u64 = 0x5eed_c057;
/// Runs above so many CPU seconds are not repeated: noise is a small share of them.
const LONG_S: f64 = 8.0;

/// What is to be tried.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// Errors asked for, mean CIEDE2000.
    pub errors: Vec<f64>,
    /// Ways to carry spectra.
    pub representations: Vec<Representation>,
    /// Random points of the reference.
    pub points: usize,
    /// How often each bake is run; the fastest counts.
    pub repeats: usize,
    /// Try fixed combinations of geometric and spectral tolerance as well?
    pub knob: Knob,
    /// Seed of all sampling patterns.
    pub seed: u64,
}

/// Is the balance of geometry and spectrum looked at?
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Knob {
    /// Yes.
    Tried,
    /// No.
    LeftOut,
}

/// Everything that was found.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Study {
    /// Bakes, by representation as asked for and by falling error.
    pub runs: Vec<Run>,
    /// The same links with other lanes.
    pub held: Vec<HeldRun>,
    /// Elements and links of the held solution.
    pub held_on: [usize; 2],
    /// Fixed combinations of tolerances beside the automatic one; empty if not asked for.
    pub balance: Vec<KnobComparison>,
    /// Points of the reference.
    pub points: usize,
    /// Irradiance of the adaptation white, tristimulus.
    pub white: [f64; 3],
}

impl Sweep {
    /// Runs everything; `progress` is told what is done, of how much, and what comes next.
    pub fn run(&self, scene: &Scene, progress: &dyn Fn(usize, usize, &str)) -> Study {
        let repeats = self.repeats.max(1);
        let mut errors = self.errors.clone();
        errors.sort_by(|a, b| b.total_cmp(a));
        let tasks: Vec<Task> = self
            .representations
            .iter()
            .flat_map(|&representation| {
                errors.iter().map(move |&error| Task {
                    representation,
                    error,
                    spectrum: None,
                })
            })
            .collect();
        let pairs: Vec<Pair> = match self.knob {
            Knob::Tried => pairs(&errors),
            Knob::LeftOut => Vec::new(),
        };
        let least = errors.last().copied().unwrap_or(0.5);
        let steps = 2 + repeats * (tasks.len() + pairs.len());
        progress(0, steps, "reference");
        let (truth, white) = self.reference(scene, least);

        // Repeats go through all tasks, so that what disturbs the machine for a while disturbs no task alone.
        let all: Vec<Task> = tasks
            .iter()
            .copied()
            .chain(pairs.iter().map(Pair::task))
            .collect();
        let mut runs: Vec<Run> = Vec::with_capacity(all.len());
        for pass in 0..repeats {
            for (k, &task) in all.iter().enumerate() {
                let done = 1 + pass * all.len() + k;
                progress(
                    done,
                    steps,
                    &format!("{} {}", task.representation, task.error),
                );
                if pass == 0 {
                    runs.push(Run::new(scene.clone(), task, &truth, white, self.seed));
                } else if runs[k].cpu_s < LONG_S {
                    let again = Run::new(scene.clone(), task, &truth, white, self.seed);
                    runs[k].faster_of(&again);
                }
            }
        }
        progress(steps - 1, steps, "held links");
        let middle = errors.get(errors.len() / 2).copied().unwrap_or(least);
        let (held, held_on) = self.held(scene, middle, white);
        progress(steps, steps, "");
        let fixed = runs.split_off(tasks.len());
        Study {
            balance: balance(&runs, &fixed),
            runs,
            held,
            held_on,
            points: self.points,
            white,
        }
    }

    /// The path tracer's answer, its noise brought to a share of the least error asked for, and the white of the room.
    fn reference(&self, scene: &Scene, least: f64) -> (PathReference, [f64; 3]) {
        let mut first = Bake::new(scene.clone(), settings(adaptive(least), None, self.seed));
        first.step();
        let truth = PathReference::new(&first, self.points, MOST_PATHS, self.seed ^ TRUTH_SEED);
        let n = truth.truth.len().max(1) as f64;
        let white = truth.truth.iter().fold([0.0; 3], |sum, xyz| {
            std::array::from_fn(|c| sum[c] + 2.0 * xyz[c] / n)
        });
        (truth, white)
    }

    /// Other lanes on the links of a bake for `error`, and the elements and links of that.
    fn held(&self, scene: &Scene, error: f64, white: [f64; 3]) -> (Vec<HeldRun>, [usize; 2]) {
        let settings = settings(adaptive(error), Some(white), self.seed);
        let mut bake = Bake::new(scene.clone(), settings);
        bake.run();
        let last = bake.rounds().last();
        let held_on = [last.map_or(0, |r| r.elements), last.map_or(0, |r| r.links)];
        (held(&mut bake, white), held_on)
    }
}

/// A bake with adaptive lanes.
fn adaptive(error: f64) -> Task {
    Task {
        representation: Representation::Adaptive,
        error,
        spectrum: None,
    }
}
