//! How wrong a bake is, *measured*: its light against the path tracer's at random points of its surfaces.
//!
//! The path tracer's own noise does not count as error of the bake (see [`ErrorSummary`]). Colour differences are CIEDE2000 of
//! a white surface's light under the bake's adaptation white.

use super::reference::PathReference;
use super::summary::{ErrorSummary, Measured};
use crate::color::de2000;
use crate::gather::Baked;
use crate::lightmap::LightMaps;
use crate::solve::{Bake, GatherQuality};
use glam::DVec3;
use serde::Serialize;

/// Illuminances below this share of the white's count as this: the relative error of darkness means nothing.
const DARK: f64 = 1e-4;
/// Estimates and errors below this share of the asked-for one are not told apart.
const NEGLIGIBLE: f64 = 0.02;
/// An estimate is honest between these multiples of the measured error.
pub const HONEST: [f64; 2] = [0.7, 3.0];

/// Was the solver's estimate honest?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Honesty {
    /// Between [`HONEST`] times the measured error, as far as its interval tells.
    Honest,
    /// Too low: the bake is worse than it says.
    TooLow,
    /// Too high: the bake is better than it says.
    TooHigh,
    /// There is no estimate yet.
    NoEstimate,
}

/// Points that are named as the worst.
const WORST: usize = 5;

/// The outcome of an audit.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Always `audit`.
    pub record: &'static str,
    /// Points that were compared.
    pub points: usize,
    /// Random points that something solid covers or, of what a file shows, that lie inside of something: left out.
    pub covered: usize,
    /// Paths traced.
    pub paths: u64,
    /// Seed of points and paths.
    pub seed: u64,
    /// CIEDE2000.
    pub de2000: ErrorSummary,
    /// Relative error of illuminance, without sign.
    pub relative: ErrorSummary,
    /// Error of the mean illuminance, with sign: bake less truth, over truth. Points in the dark weigh as little as their light.
    pub bias: Measured,
    /// Mean standard error of the audit itself, CIEDE2000: what the figures cannot see below.
    pub noise_de2000: f64,
    /// The solver's own estimate of the mean CIEDE2000.
    pub estimate_de2000: Option<f64>,
    /// The judgement on it.
    pub honesty: Honesty,
    /// The points with the largest colour differences, the worst first.
    pub worst: Vec<WorstPoint>,
    /// What was seen at each point.
    #[serde(skip)]
    pub seen: Vec<AuditedPoint>,
}

/// One of the worst points of an audit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct WorstPoint {
    /// World space, m.
    pub at: [f64; 3],
    /// Unit normal.
    pub normal: [f64; 3],
    /// Illuminance by the bake, lx.
    pub baked_lux: f64,
    /// The same by the path tracer.
    pub traced_lux: f64,
    /// CIEDE2000 between the two, noise included.
    pub de2000: f64,
}

/// The worst points, the worst first.
fn worst(seen: &[AuditedPoint]) -> Vec<WorstPoint> {
    let mut order: Vec<&AuditedPoint> = seen.iter().collect();
    order.sort_by(|a, b| b.de2000[0].total_cmp(&a.de2000[0]));
    let named = order.into_iter().take(WORST).map(|point| WorstPoint {
        at: point.point.to_array(),
        normal: point.normal.to_array(),
        baked_lux: point.baked[1],
        traced_lux: point.traced[1],
        de2000: point.de2000[0],
    });
    named.collect()
}

/// One point of an audit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct AuditedPoint {
    /// World space.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Tristimulus irradiance by the bake, lx for Y.
    pub baked: [f64; 3],
    /// The same by the path tracer.
    pub traced: [f64; 3],
    /// CIEDE2000 between the two, noise included, and the standard error of the path tracer in it.
    pub de2000: [f64; 2],
    /// Relative illuminance error with sign, and its standard error.
    pub relative: [f64; 2],
}

impl Report {
    /// Compares a bake with the path tracer at `points` random points, by area; `most_paths` paths a point at the most.
    /// The same numbers for the same seed at any number of threads.
    ///
    /// ```
    /// use haarlight::{audit, scene::{Options, Scene}, solve::{Bake, Settings}};
    /// let room = Scene::load("scenes/convex.glb", &Options::default())?;
    /// let mut bake = Bake::new(room, Settings { error: 1.0, ..Settings::default() });
    /// bake.run();
    /// let report = audit::Report::new(&bake, 16, 4096, 1);
    /// assert!(report.de2000.mean.value < 3.0);
    /// # Ok::<(), haarlight::Error>(())
    /// ```
    pub fn new(bake: &Bake, points: usize, most_paths: usize, seed: u64) -> Self {
        Self::against(bake, &PathReference::new(bake, points, most_paths, seed))
    }

    /// Compares a bake with a reference of the same room: light gathered at the points as at watched ones, of which the estimate speaks.
    pub fn against(bake: &Bake, reference: &PathReference) -> Self {
        let gathered = bake.gather_with(&reference.receivers(bake), GatherQuality::Watched);
        let light = gathered.iter();
        let light = light.map(|g| Some(bake.lanes().tristimulus(&g.irradiance)));
        let last = bake.rounds().last();
        let estimate = last.and_then(|r| r.error.total_de2000.value);
        Self::of(bake, reference, light.collect(), estimate)
    }

    /// Compares a baked mesh with a reference of the same room: light as a viewer draws it, interpolated between vertices.
    pub fn of_file(bake: &Bake, baked: &Baked, reference: &PathReference) -> Self {
        let reference = &*reference.as_shown();
        let points = reference.points.iter();
        let places: Vec<_> = points.map(|p| (p.face, p.point)).collect();
        let light = bake.drawn(baked, &places);
        Self::drawn(bake, reference, light, bake.error_of(baked))
    }

    /// Compares light maps with a reference of the same room: light as a bilinear look-up has it.
    pub fn of_maps(bake: &Bake, maps: &LightMaps, reference: &PathReference) -> Self {
        let reference = &*reference.as_shown();
        let points = reference.points.iter();
        let places: Vec<_> = points
            .map(|p| (p.face, p.point - bake.mesh().centre))
            .collect();
        let light = maps.drawn(bake.mesh(), &places);
        Self::drawn(bake, reference, light, bake.error_of(&maps.baked))
    }

    /// Compares what is drawn at the points, save those inside of something, which count as covered.
    fn drawn(
        bake: &Bake,
        reference: &PathReference,
        light: Vec<Option<[f64; 3]>>,
        estimate: Option<f64>,
    ) -> Self {
        let light = light.into_iter().zip(&reference.inside);
        let light = light.map(|(light, inside)| (!inside).then(|| light.unwrap_or_default()));
        Self::of(bake, reference, light.collect(), estimate)
    }

    /// Compares light at the points; those without are left out.
    fn of(
        bake: &Bake,
        reference: &PathReference,
        light: Vec<Option<[f64; 3]>>,
        estimate: Option<f64>,
    ) -> Self {
        let white = bake.light().white;
        let seen: Vec<AuditedPoint> = light
            .iter()
            .enumerate()
            .filter_map(|(k, baked)| {
                let baked = (*baked)?;
                let (place, traced) = (&reference.points[k], reference.truth[k]);
                let scale = traced[1].max(DARK * white[1]).max(f64::MIN_POSITIVE);
                Some(AuditedPoint {
                    point: place.point,
                    normal: place.normal,
                    baked,
                    traced,
                    de2000: [
                        de2000(baked, traced, white),
                        reference.noise_de2000(k, white),
                    ],
                    relative: [
                        (baked[1] - traced[1]) / scale,
                        reference.standard_error(k) / scale,
                    ],
                })
            })
            .collect();
        let colour: Vec<[f64; 2]> = seen.iter().map(|s| s.de2000).collect();
        let relative: Vec<[f64; 2]> = seen.iter().map(|s| s.relative).collect();
        let lux: Vec<[f64; 2]> = seen.iter().map(|s| [s.baked[1], s.traced[1]]).collect();
        let de2000 = ErrorSummary::of(&colour);
        Self {
            record: "audit",
            points: seen.len(),
            covered: reference.covered + light.len() - seen.len(),
            paths: reference.paths,
            seed: reference.seed,
            relative: ErrorSummary::of(&relative),
            bias: Measured::excess(&lux),
            noise_de2000: colour.iter().map(|c| c[1]).sum::<f64>() / colour.len().max(1) as f64,
            estimate_de2000: estimate,
            honesty: judge(estimate, &de2000.mean, NEGLIGIBLE * bake.settings().error),
            de2000,
            worst: worst(&seen),
            seen,
        }
    }
}

fn judge(estimate: Option<f64>, measured: &Measured, negligible: f64) -> Honesty {
    match estimate {
        None => Honesty::NoEstimate,
        Some(e) if e.max(negligible) < HONEST[0] * measured.low => Honesty::TooLow,
        Some(e) if e > HONEST[1] * measured.high.max(negligible) => Honesty::TooHigh,
        Some(_) => Honesty::Honest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_are_judged_as_far_as_the_interval_tells() {
        let measured = Measured {
            value: 1.0,
            low: 0.9,
            high: 1.2,
        };
        for (estimate, honesty) in [
            (None, Honesty::NoEstimate),
            (Some(0.62), Honesty::TooLow),
            (Some(0.64), Honesty::Honest),
            (Some(3.5), Honesty::Honest),
            (Some(3.7), Honesty::TooHigh),
        ] {
            assert_eq!(judge(estimate, &measured, 0.01), honesty, "{estimate:?}");
        }
        // Both are as good as nothing.
        let nothing = Measured {
            value: 1e-9,
            low: 0.0,
            high: 1e-8,
        };
        assert_eq!(judge(Some(0.01), &nothing, 0.01), Honesty::Honest);
    }
}
