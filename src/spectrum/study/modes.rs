//! The open questions as modes of one loop: what controls the error, and what that buys at equal interval count.
//!
//! Modes: the paper's control; the guarantee (the bound, not the estimate, must be at most eps_max); perceptual control
//! (Jacobian of XYZ -> L*u*v* at the current colour, any sibling pair); perceptual control of the bound; and the last three
//! on the ratio to the light, which is in the weights of eq. 3, so that its lines cost no interval. All are measured
//! twice: with the list's tristimulus values, and with the estimated error added back ("corrected").

use super::colour_chart::{ColourChart, UnitLight};
use super::walk::{Extent, LEVELS, WalkStart, WalkStep, sample, walk};
use crate::color::{Xyz, luv_jacobian};
use crate::spectrum::{
    BANDS, Bounded, Control, Estimate, Interval, List, Metric, Moment, Operation, Path, control,
    represent,
};
use serde::Serialize;

/// Steps of the search for the limit that gives a wanted interval count, for each level: to about 1 % of the limit.
const SEARCH_STEPS: [usize; 3] = [14, 10, 8];
/// Comparisons count intervals on one in so many tertiary products: within 1 % of the whole count.
const STRIDE: usize = 4;
/// The limit of the primary reflections is looked for in this range of dE*uv.
const SEARCH_RANGE: [f64; 2] = [1e-3, 1e2];

/// One light, mode and level.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ModesRow {
    /// Name of the light, with the adaptation white if it is not the light's own.
    pub light: String,
    /// Name of the mode.
    pub mode: &'static str,
    /// Name of the level.
    pub level: &'static str,
    /// eps_max, in XYZ or dE*uv.
    pub limit: f64,
    /// Average number of intervals.
    pub intervals_mean: f64,
    /// Share of products whose true error in XYZ is above the paper's eps_max, percent.
    pub above_eps_max: f64,
    /// Error of the list's tristimulus values, dE*uv.
    pub luv: DifferenceSummary,
    /// The same, CIEDE2000.
    pub de2000: DifferenceSummary,
    /// With the estimated error added back, dE*uv.
    pub corrected_luv: DifferenceSummary,
    /// The same, CIEDE2000.
    pub corrected_de2000: DifferenceSummary,
}

/// Mean, 95th percentile and greatest of a colour difference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DifferenceSummary {
    /// Mean.
    pub mean: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Greatest.
    pub max: f64,
}

impl DifferenceSummary {
    /// Of any numbers.
    pub fn new(mut values: Vec<f64>) -> Self {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        Self {
            mean,
            p95: percentile(&mut values, 95.0),
            max: values.last().copied().unwrap_or(0.0),
        }
    }
}

/// A percentile (in 0..=100) by nearest rank; sorts the values. 0 for none.
pub fn percentile(values: &mut [f64], percent: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let rank = (percent / 100.0 * values.len() as f64).ceil() as usize;
    values.get(rank.max(1) - 1).copied().unwrap_or(0.0)
}

/// Runs all modes for one light, which carries its adaptation white.
pub fn measure(chart: &ColourChart, light: &UnitLight, name: &str) -> Vec<ModesRow> {
    let mut rows = Vec::new();
    let mut record = |mode, limits: [f64; 3], samples: [Vec<WalkStep>; 3]| {
        rows.extend((0..3).map(|level| row(name, mode, level, limits[level], &samples[level])));
    };
    let eps = Control::PAPER.eps_max;

    let paper = fixed::<Estimate>(chart, light, eps, &Control::PAPER);
    let wanted = paper.each_ref().map(|samples| {
        samples.iter().map(|s| s.intervals as f64).sum::<f64>() / samples.len() as f64
    });
    record("paper", [eps; 3], paper);

    record(
        "guarantee",
        [eps; 3],
        fixed::<Bounded>(chart, light, eps, &Control::within(eps)),
    );

    let luv = |colour: Xyz| Metric::Luv(luv_jacobian(colour, light.white));
    let (limits, samples) = at_equal_count::<Moment>(chart, light, wanted, 1, &luv);
    record("perceptual", limits, samples);
    let (limits, samples) = at_equal_count::<Bounded>(chart, light, wanted, 1, &luv);
    record("perceptual bound", limits, samples);

    let (under, one) = ratio(chart, light);
    record(
        "guarantee, ratio",
        [eps; 3],
        fixed::<Bounded>(&under, &one, eps, &Control::within(eps)),
    );
    let (limits, samples) = at_equal_count::<Moment>(&under, &one, wanted, 1, &luv);
    record("perceptual, ratio", limits, samples);
    let (limits, samples) = at_equal_count::<Bounded>(&under, &one, wanted, 1, &luv);
    record("perceptual bound, ratio", limits, samples);
    rows
}

/// The same work with the light in the weights: lists hold the ratio to the light, which begins as 1 everywhere.
pub(super) fn ratio(chart: &ColourChart, light: &UnitLight) -> (ColourChart, UnitLight) {
    let under = ColourChart {
        cmf: chart.cmf.under(&light.power),
        reflectances: chart.reflectances.clone(),
    };
    (
        under,
        UnitLight {
            power: [1.0; BANDS],
            ..light.clone()
        },
    )
}

/// The tests with one limit in XYZ for all levels.
fn fixed<I: Interval>(
    chart: &ColourChart,
    light: &UnitLight,
    limit: f64,
    settings: &Control,
) -> [Vec<WalkStep>; 3] {
    ModeTest {
        start: WalkStart::<I>::new(chart, light),
        chart,
        light,
        metric: &|_| Metric::Xyz,
        settings,
    }
    .samples(&[limit; 3])
}

/// dE*uv of all reflections with perceptual control of the estimate, of the same corrected, and of the corrected lists
/// under control of the bound, where each level needs `count` intervals on average.
pub(super) fn adaptive_at_count(
    chart: &ColourChart,
    light: &UnitLight,
    count: usize,
) -> [(&'static str, [Vec<f64>; 3]); 3] {
    let luv = |colour: Xyz| Metric::Luv(luv_jacobian(colour, light.white));
    let wanted = [count as f64; 3];
    let (_, estimate) = at_equal_count::<Moment>(chart, light, wanted, STRIDE, &luv);
    let (_, bound) = at_equal_count::<Bounded>(chart, light, wanted, STRIDE, &luv);
    let pick = |samples: &[Vec<WalkStep>; 3], f: fn(&WalkStep) -> f64| {
        samples
            .each_ref()
            .map(|level| level.iter().map(f).collect())
    };
    [
        ("adaptive", pick(&estimate, |s| s.luv_error)),
        ("adaptive, corrected", pick(&estimate, |s| s.corrected_luv)),
        (
            "adaptive bound, corrected",
            pick(&bound, |s| s.corrected_luv),
        ),
    ]
}

/// One limit for each level, chosen one after the other so that each level needs `wanted` intervals on average, counted on
/// one in `stride` tertiary products.
fn at_equal_count<I: Interval>(
    chart: &ColourChart,
    light: &UnitLight,
    wanted: [f64; 3],
    stride: usize,
    metric: &dyn Fn(Xyz) -> Metric,
) -> ([f64; 3], [Vec<WalkStep>; 3]) {
    let settings = Control::within(1.0);
    let run = ModeTest {
        start: WalkStart::<I>::new(chart, light),
        chart,
        light,
        metric,
        settings: &settings,
    };
    let mut limits = [1.0; 3];
    for level in 0..3 {
        // The limit of a level is near that of the level before.
        let [mut low, mut high] = if level == 0 {
            SEARCH_RANGE
        } else {
            [limits[level - 1] / 8.0, limits[level - 1] * 8.0]
        };
        for _ in 0..SEARCH_STEPS[level] {
            limits[level] = f64::sqrt(low * high);
            if run.intervals(&limits, level, stride) > wanted[level] {
                low = limits[level]
            } else {
                high = limits[level]
            }
        }
        // The side that needs no more intervals than wanted.
        limits[level] = high;
    }
    (limits, run.samples(&limits))
}

/// The tests with a metric that may depend on the colour.
struct ModeTest<'a, I> {
    start: WalkStart<'a, I>,
    chart: &'a ColourChart,
    light: &'a UnitLight,
    metric: &'a dyn Fn(Xyz) -> Metric,
    settings: &'a Control,
}

impl<I: Interval> ModeTest<'_, I> {
    /// Control of one product; eps_min keeps its ratio to eps_max.
    fn step(&self, list: &mut List<I>, path: &Path<'_, I>, limits: &[f64; 3]) -> Operation {
        let eps_max = limits[path.reflections.len() - 1];
        let scaled = Control {
            eps_min: self.settings.eps_min / self.settings.eps_max * eps_max,
            eps_max,
            ..*self.settings
        };
        let colour = list.corrected_xyz(&self.chart.cmf);
        control(list, path, &self.chart.cmf, &(self.metric)(colour), &scaled)
    }

    fn source(&self, limits: &[f64; 3]) -> List<I> {
        represent(
            self.start.source(),
            &self.chart.cmf,
            &(self.metric)(self.light.white),
            limits[0],
        )
    }

    fn samples(&self, limits: &[f64; 3]) -> [Vec<WalkStep>; 3] {
        sample(&self.start, &self.source(limits), |list, path| {
            self.step(list, path, limits)
        })
    }

    /// Average number of intervals at a level, of one in `stride` tertiary products.
    fn intervals(&self, limits: &[f64; 3], level: usize, stride: usize) -> f64 {
        let (mut sum, mut count) = (0, 0);
        walk(
            &self.start,
            &self.source(limits),
            Extent::Part {
                levels: level + 1,
                stride,
            },
            |list, path, _| {
                self.step(list, path, limits);
                if path.reflections.len() == level + 1 {
                    sum += list.partition().count();
                    count += 1;
                }
            },
        );
        sum as f64 / f64::from(count)
    }
}

fn row(
    light: &str,
    mode: &'static str,
    level: usize,
    limit: f64,
    samples: &[WalkStep],
) -> ModesRow {
    let summary =
        |f: &dyn Fn(&WalkStep) -> f64| DifferenceSummary::new(samples.iter().map(f).collect());
    let above = samples
        .iter()
        .filter(|s| s.xyz_error > Control::PAPER.eps_max)
        .count();
    ModesRow {
        light: light.to_owned(),
        mode,
        level: LEVELS[level],
        limit,
        intervals_mean: samples.iter().map(|s| s.intervals as f64).sum::<f64>()
            / samples.len() as f64,
        above_eps_max: 100.0 * above as f64 / samples.len() as f64,
        luv: summary(&|s| s.luv_error),
        de2000: summary(&|s| s.de2000),
        corrected_luv: summary(&|s| s.corrected_luv),
        corrected_de2000: summary(&|s| s.corrected_de2000),
    }
}
