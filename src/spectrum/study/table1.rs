//! Table 1 (paper 4.1): intervals, errors and operations, measured beside printed.

use super::colour_chart::{ColourChart, UnitLight};
use super::walk::{WalkStart, WalkStep, sample};
use crate::color::de_luv;
use crate::spectrum::{Control, Estimate, Metric, Operation, control, represent};
use serde::Serialize;

/// "Refinement of S".
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SourceRefinement {
    /// Number of intervals.
    pub intervals: usize,
    /// Length of the error in XYZ, Y of the source = 1.
    pub xyz_error: f64,
    /// dE*uv.
    pub luv_error: f64,
}

/// One level of reflections. Shares in percent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Level {
    /// Average number of intervals.
    pub intervals_mean: f64,
    /// Its standard deviation.
    pub intervals_sd: f64,
    /// Average dE*uv.
    pub luv_mean: f64,
    /// Greatest dE*uv.
    pub luv_max: f64,
    /// Standard deviation of dE*uv.
    pub luv_sd: f64,
    /// Share of products left as they are.
    pub none: f64,
    /// Share that only split.
    pub refinement: f64,
    /// Share that only merged.
    pub merge: f64,
    /// Share that did both.
    pub fluctuation: f64,
    /// Share whose true error is above eps_max.
    pub measure_error: f64,
}

/// One column of Table 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Column {
    /// Refinement of the source.
    pub source: SourceRefinement,
    /// 24 reflections.
    pub primary: Level,
    /// 24^2 reflections.
    pub secondary: Level,
    /// 24^3 reflections.
    pub tertiary: Level,
}

impl Level {
    /// Statistics of a level; a product counts as measure error if its true error in XYZ is above `eps_max`.
    pub fn new(samples: &[WalkStep], eps_max: f64) -> Self {
        let mean = |f: &dyn Fn(&WalkStep) -> f64| {
            samples.iter().map(f).sum::<f64>() / samples.len() as f64
        };
        let deviation = |f: &dyn Fn(&WalkStep) -> f64| {
            let middle = mean(f);
            mean(&|s| (f(s) - middle).powi(2)).sqrt()
        };
        let share = |f: &dyn Fn(&WalkStep) -> bool| 100.0 * mean(&|s| f64::from(u8::from(f(s))));
        Self {
            intervals_mean: mean(&|s| s.intervals as f64),
            intervals_sd: deviation(&|s| s.intervals as f64),
            luv_mean: mean(&|s| s.luv_error),
            luv_max: samples.iter().fold(0.0, |m, s| s.luv_error.max(m)),
            luv_sd: deviation(&|s| s.luv_error),
            none: share(&|s| s.operation == Operation::None),
            refinement: share(&|s| s.operation == Operation::Refinement),
            merge: share(&|s| s.operation == Operation::Merge),
            fluctuation: share(&|s| s.operation == Operation::Fluctuation),
            measure_error: share(&|s| s.xyz_error > eps_max),
        }
    }
}

impl Column {
    /// Runs the paper's tests for one light with the paper's control.
    pub fn measure(chart: &ColourChart, light: &UnitLight) -> Self {
        let start = WalkStart::<Estimate>::new(chart, light);
        let list = represent(
            start.source(),
            &chart.cmf,
            &Metric::Xyz,
            Control::PAPER.eps_max,
        );
        let source = SourceRefinement {
            intervals: list.partition().count(),
            xyz_error: Metric::Xyz.size(list.error(), list.radius()),
            luv_error: de_luv(list.xyz(&chart.cmf), light.white, light.white),
        };
        let levels = sample(&start, &list, |list, path| {
            control(list, path, &chart.cmf, &Metric::Xyz, &Control::PAPER)
        });
        let [primary, secondary, tertiary] =
            levels.map(|samples| Level::new(&samples, Control::PAPER.eps_max));
        Self {
            source,
            primary,
            secondary,
            tertiary,
        }
    }

    /// The three levels.
    pub fn levels(&self) -> [&Level; 3] {
        [&self.primary, &self.secondary, &self.tertiary]
    }
}

/// The columns C, D65 (the paper's D6500) and F2 as printed.
pub const PRINTED: [Column; 3] = [
    Column {
        source: SourceRefinement {
            intervals: 8,
            xyz_error: 0.0014,
            luv_error: 0.26,
        },
        primary: level([
            8.42, 1.63, 0.91, 2.34, 0.53, 41.70, 45.80, 12.50, 0.00, 29.17,
        ]),
        secondary: level([
            7.15, 2.03, 1.31, 5.95, 0.84, 46.35, 4.51, 46.70, 2.43, 11.63,
        ]),
        tertiary: level([5.25, 1.94, 1.53, 8.07, 1.07, 26.92, 0.52, 68.81, 3.75, 6.27]),
    },
    Column {
        source: SourceRefinement {
            intervals: 7,
            xyz_error: 0.0013,
            luv_error: 0.33,
        },
        primary: level([
            7.83, 1.79, 0.88, 1.69, 0.41, 25.00, 58.33, 16.67, 0.00, 29.17,
        ]),
        secondary: level([
            6.91, 2.00, 1.33, 6.62, 0.93, 47.22, 9.72, 39.76, 3.30, 10.76,
        ]),
        tertiary: level([5.16, 1.88, 1.57, 8.12, 1.15, 29.72, 1.08, 65.14, 4.06, 6.00]),
    },
    Column {
        source: SourceRefinement {
            intervals: 11,
            xyz_error: 0.0015,
            luv_error: 0.27,
        },
        primary: level([
            10.17, 1.91, 0.84, 1.87, 0.49, 50.00, 12.50, 37.50, 0.00, 41.67,
        ]),
        secondary: level([
            7.33, 2.66, 1.22, 6.27, 0.95, 27.78, 0.87, 67.71, 3.65, 13.54,
        ]),
        tertiary: level([
            4.96, 1.99, 1.51, 10.79, 1.28, 22.08, 0.05, 73.21, 4.67, 7.21,
        ]),
    },
];

/// The rows of a level in the order of the table.
const fn level(rows: [f64; 10]) -> Level {
    let [
        intervals_mean,
        intervals_sd,
        luv_mean,
        luv_max,
        luv_sd,
        none,
        refinement,
        merge,
        fluctuation,
        measure_error,
    ] = rows;
    Level {
        intervals_mean,
        intervals_sd,
        luv_mean,
        luv_max,
        luv_sd,
        none,
        refinement,
        merge,
        fluctuation,
        measure_error,
    }
}

/// Names of the rows of a level, in order.
pub const ROWS: [&str; 10] = [
    "intervals mean",
    "intervals sd",
    "Luv mean",
    "Luv max",
    "Luv sd",
    "none",
    "refinement",
    "merge",
    "fluctuation",
    "measure error",
];

impl Level {
    /// The rows of the level in the order of the table.
    pub fn rows(&self) -> [f64; 10] {
        [
            self.intervals_mean,
            self.intervals_sd,
            self.luv_mean,
            self.luv_max,
            self.luv_sd,
            self.none,
            self.refinement,
            self.merge,
            self.fluctuation,
            self.measure_error,
        ]
    }
}

/// For each row, the mean over lights and levels of |measured - printed|.
pub fn mean_differences(measured: &[Column; 3]) -> [f64; 10] {
    let mut sums = [0.0; 10];
    for (ours, printed) in measured.iter().zip(&PRINTED) {
        for (a, b) in ours.levels().into_iter().zip(printed.levels()) {
            for (sum, (a, b)) in sums.iter_mut().zip(a.rows().into_iter().zip(b.rows())) {
                *sum += (a - b).abs() / 9.0;
            }
        }
    }
    sums
}
