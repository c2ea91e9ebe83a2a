//! Geometry held fixed: the links of one bake, solved again with other lanes.
//!
//! The truth here is the solution on all 64 bands of the same links, so that what is left is what the lanes do.
//! Differences are of the irradiance of the elements, area-weighted means.

use crate::color::{de_luv, de2000};
use crate::solve::{Bake, Representation};
use serde::Serialize;

/// What perceptual, guaranteed and paper control and lists are asked for, mean CIEDE2000.
const ASKED: [f64; 7] = [8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.1];
/// Numbers of intervals and vectors that are tried.
const COUNTS: [u8; 10] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32];

/// One solution on held links.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct HeldRun {
    /// How spectra are carried.
    pub representation: Representation,
    /// Error the lanes were chosen for, mean CIEDE2000; 0 where they are given.
    pub asked: f64,
    /// Numbers that hold a spectrum: lanes in use, or the mean length of lists.
    pub lanes: f64,
    /// Choice of lanes and solve, wall time, s.
    pub seconds: f64,
    /// What the choice believed to cost, mean CIELUV: an estimate, under guaranteed control a bound.
    pub believed: Option<f64>,
    /// Mean difference from the 64 bands, CIELUV.
    pub de_luv: f64,
    /// The same, CIEDE2000.
    pub de2000: f64,
    /// Greatest, CIEDE2000.
    pub greatest: f64,
}

/// All ways on the links of a bake that has been run; `white` is the adaptation white.
pub fn held(bake: &mut Bake, white: [f64; 3]) -> Vec<HeldRun> {
    let mut runs = Vec::new();
    if bake.hold(Representation::Dense, 0.5).is_none() {
        return runs;
    }
    let truth = bake.leaf_colours();
    let controlled = [
        Representation::Adaptive,
        Representation::Guaranteed,
        Representation::Paper,
        Representation::Lists,
    ]
    .into_iter()
    .flat_map(|r| ASKED.map(|e| (r, e)));
    let given = [
        Representation::Uniform as fn(u8) -> _,
        Representation::Characteristic,
    ]
    .into_iter()
    .flat_map(|r| COUNTS.map(|n| (r(n), 0.0)));
    let all = controlled
        .chain(given)
        .chain([(Representation::Rgb, 0.0), (Representation::Dense, 0.0)]);
    for (representation, asked) in all {
        let error = if asked > 0.0 { asked } else { 0.5 };
        let Some(held) = bake.hold(representation, error) else {
            continue;
        };
        let (mut luv, mut mean, mut greatest, mut area) = (0.0, 0.0, 0.0_f64, 0.0);
        for ((is, a), (ought, _)) in bake.leaf_colours().iter().zip(&truth) {
            let difference = de2000(*is, *ought, white);
            luv += a * de_luv(*is, *ought, white);
            mean += a * difference;
            area += a;
            greatest = greatest.max(difference);
        }
        let area = if area > 0.0 { area } else { 1.0 };
        runs.push(HeldRun {
            representation,
            asked,
            lanes: held.lanes,
            seconds: held.seconds,
            believed: held.spectrum_de_luv,
            de_luv: luv / area,
            de2000: mean / area,
            greatest,
        });
    }
    runs
}
