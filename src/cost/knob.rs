//! One knob: does `--error` spend time where it buys most error?
//!
//! The automatic balance gives spectra a share of the error asked for. Beside it stand fixed pairs of a geometric and a
//! spectral tolerance. The automatic run of each error is compared with the fastest pair that is measured to be as
//! accurate or better: what the knob costs is the ratio of the two times.

use super::run::{Run, Task};
use crate::solve::Representation;
use serde::Serialize;

/// Spectral tolerances (mean CIELUV) that are tried beside each geometric one, shares of it.
const SHARES: [f64; 6] = [0.05, 0.15, 0.35, 0.7, 1.4, 3.0];
/// A pair counts as accurate as the automatic run up to this factor: the points are the same, so their noise is too.
const AS_GOOD: f64 = 1.02;

/// A fixed pair of tolerances.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Pair {
    /// Mean CIEDE2000.
    pub geometry: f64,
    /// Mean CIELUV.
    pub spectrum: f64,
}

impl Pair {
    pub(super) fn task(&self) -> Task {
        Task {
            representation: Representation::Adaptive,
            error: self.geometry,
            spectrum: Some(self.spectrum),
        }
    }
}

/// The automatic run of an error beside the best fixed pair.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct KnobComparison {
    /// The automatic run.
    pub automatic: Run,
    /// The fastest pair that is as accurate; none if no pair is.
    pub best: Option<Run>,
    /// CPU time of the automatic run over that of the best; 1 where it is the best itself.
    pub ratio: f64,
}

/// The pairs beside the errors of a sweep.
pub fn pairs(errors: &[f64]) -> Vec<Pair> {
    errors
        .iter()
        .flat_map(|&geometry| {
            SHARES.map(|share| Pair {
                geometry,
                spectrum: share * geometry,
            })
        })
        .collect()
}

/// Compares the automatic runs among `runs` with runs of fixed pairs.
pub fn balance(runs: &[Run], fixed: &[Run]) -> Vec<KnobComparison> {
    if fixed.is_empty() {
        return Vec::new();
    }
    runs.iter()
        .filter(|r| r.representation == Representation::Adaptive)
        .map(|automatic| {
            let best = fixed
                .iter()
                .filter(|f| f.de2000.value <= AS_GOOD * automatic.de2000.value)
                .min_by(|a, b| a.cpu_s.total_cmp(&b.cpu_s))
                .cloned();
            KnobComparison {
                automatic: automatic.clone(),
                ratio: best
                    .as_ref()
                    .map_or(1.0, |b| (automatic.cpu_s / b.cpu_s).max(1.0)),
                best,
            }
        })
        .collect()
}
