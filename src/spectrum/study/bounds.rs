//! How good the bound of the neglected term is: violations (there must be none) and looseness.
//!
//! Lists come from the guaranteed control of the tests; for every product the bound of the estimator's error is held
//! against its true error from the 64 bands.

use super::colour_chart::{ColourChart, UnitLight};
use super::modes::percentile;
use super::walk::{LEVELS, WalkStart, sample};
use crate::color::tristimulus;
use crate::spectrum::{Bounded, Control, Metric, control, represent};
use serde::Serialize;

/// Slack for the rounding of sums of 64 products, relative to the light's Y of 1.
const ROUNDING: f64 = 1e-12;

/// One light and level.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BoundsRow {
    /// Name of the light.
    pub light: &'static str,
    /// Name of the level.
    pub level: &'static str,
    /// Number of products.
    pub products: usize,
    /// Products one of whose three true errors leaves its radius.
    pub violations: usize,
    /// Bound over true error of the estimator, both as lengths in XYZ: median.
    pub looseness_median: f64,
    /// The same, 95th percentile.
    pub looseness_p95: f64,
    /// True error of the estimator, length in XYZ: mean.
    pub estimator_error_mean: f64,
    /// Share of products whose true error is above eps_max, percent.
    pub above_eps_max: f64,
}

/// Checks every product of one light, 24 + 24^2 + 24^3.
pub fn measure(chart: &ColourChart, light: &UnitLight) -> Vec<BoundsRow> {
    let start = WalkStart::<Bounded>::new(chart, light);
    let settings = Control {
        overshoot: crate::spectrum::Overshoot::TakeBack,
        ..Control::PAPER
    };
    let list = represent(start.source(), &chart.cmf, &Metric::Xyz, settings.eps_max);
    let mut loose = [const { Vec::new() }; 3];
    let mut errors = [0.0; 3];
    let mut violations = [0; 3];
    let samples = sample(&start, &list, |list, path| {
        let level = path.reflections.len() - 1;
        let operation = control(list, path, &chart.cmf, &Metric::Xyz, &settings);
        let truth = tristimulus(&path.spectrum(), chart.cmf.weights());
        let (told, radius) = (list.corrected_xyz(&chart.cmf), list.radius());
        let off: [f64; 3] = std::array::from_fn(|a| (truth[a] - told[a]).abs());
        violations[level] += usize::from((0..3).any(|a| off[a] > radius[a] + ROUNDING));
        let (error, bound) = (
            Metric::Xyz.size(off, [0.0; 3]),
            Metric::Xyz.size([0.0; 3], radius),
        );
        // A product on bands alone has no error and no radius.
        if error > ROUNDING {
            loose[level].push(bound / error);
        }
        errors[level] += error;
        operation
    });
    (0..3)
        .map(|level| {
            let products = samples[level].len();
            let above = samples[level]
                .iter()
                .filter(|s| s.xyz_error > settings.eps_max)
                .count();
            BoundsRow {
                light: light.name,
                level: LEVELS[level],
                products,
                violations: violations[level],
                looseness_median: percentile(&mut loose[level], 50.0),
                looseness_p95: percentile(&mut loose[level], 95.0),
                estimator_error_mean: errors[level] / products as f64,
                above_eps_max: 100.0 * above as f64 / products as f64,
            }
        })
        .collect()
}
