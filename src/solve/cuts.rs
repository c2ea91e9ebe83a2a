//! The choice of a cut for each light spectrum on the model of the room (`coarse`), by the loss of lanes against all 64
//! bands.

use super::coarse::Coarse;
use crate::color::luv_jacobian;
use crate::light::lanes::Lanes;
use crate::light::rows::{Rows, padded};
use crate::scene::LightSpectrum;
use crate::spectrum::{BANDS, Partition, Spectrum};

/// One lane in this many is split at a time.
const BATCH: usize = 3;
/// Rounding and the residual of the model's solve may look like a colour difference of this size, CIELUV: no lane is split for less.
const UNSEEN: f64 = 1e-3;

/// What a choice of cuts does.
#[derive(Debug, Clone)]
pub(crate) struct CutChoice {
    /// One cut per light.
    pub cuts: Vec<Partition>,
    /// Mean CIELUV difference of irradiance that they cause on the model.
    pub error: f64,
}

impl Coarse {
    /// Splits intervals, the most harmful first, until the mean difference meets `tolerance`; then fills the lanes that
    /// padding would waste. `known` cuts are kept if they are good enough, and one for each light: a lamp with a new
    /// spectrum may have changed the number of lights. `copies`: how many lights of each spectrum rows hold, which must
    /// not become wider than rows can be; none: one of each, and bands in place of more than 64 lanes.
    pub(super) fn choose(
        &self,
        spectra: &[LightSpectrum],
        (weights, guide): (&[Spectrum; 3], Option<&[Spectrum; 3]>),
        white: [f64; 3],
        tolerance: f64,
        known: Option<Vec<Partition>>,
        copies: Option<&[usize]>,
    ) -> CutChoice {
        let count = self.leaves.len();
        let guided = |lanes: Lanes| match guide {
            Some(guide) => lanes.guided(guide, 1.0),
            None => lanes,
        };
        let references: Vec<(Lanes, Rows)> = (0..spectra.len())
            .map(|light| {
                let lanes = guided(Lanes::only(spectra, light, weights));
                let rows = self.irradiance(&lanes);
                (lanes, rows)
            })
            .collect();
        let truth: Vec<[f64; 3]> = (0..count)
            .map(|k| {
                references.iter().fold([0.0; 3], |sum, (lanes, rows)| {
                    plus(sum, lanes.tristimulus(rows.row(k)))
                })
            })
            .collect();
        let jacobians: Vec<[[f64; 3]; 3]> = truth.iter().map(|&t| luv_jacobian(t, white)).collect();
        let total: f64 = self.leaves.iter().map(|&l| self.tree.node(l).counted).sum();
        let tolerance = tolerance.max(UNSEEN);
        if let Some(cuts) = known.filter(|cuts| cuts.len() == spectra.len()) {
            let lanes = guided(Lanes::ratio(spectra, &cuts, weights));
            let (error, _) = self.loss(&lanes, &references, &jacobians, total);
            if error <= tolerance {
                return CutChoice { cuts, error };
            }
        }
        let mut cuts = vec![Partition::ROOT; spectra.len()];
        loop {
            let lanes = guided(Lanes::ratio(spectra, &cuts, weights));
            let (error, mut worst) = self.loss(&lanes, &references, &jacobians, total);
            let of = |light: usize| copies.map_or(1, |copies| copies[light]);
            let mut size: usize = (0..cuts.len()).map(|l| of(l) * cuts[l].count()).sum();
            let full = size == padded(size);
            let good = error <= tolerance;
            // Below a hundredth of the tolerance, spare lanes would carry nothing.
            if (good && (full || error < 0.01 * tolerance))
                || worst.is_empty()
                || lanes.lanes()[0].light.is_none()
            {
                return CutChoice { cuts, error };
            }
            // Split several at once: each split costs a solve, and rows hold 4, 8 or 16 lanes. When padding is being
            // filled, no more than fit.
            let (most, room) = match (good, copies) {
                (true, _) => (padded(size), padded(size) - size),
                (false, None) => (usize::MAX, lanes.len().div_ceil(BATCH)),
                (false, Some(_)) => (BANDS, lanes.len().div_ceil(BATCH)),
            };
            worst.truncate(room.max(1));
            let before = size;
            for lane in worst.into_iter().map(|l| lanes.lanes()[l]) {
                if let Some(light) = lane.light.filter(|&l| size + of(l) <= most) {
                    cuts[light] = cuts[light].split(lane.first).unwrap_or(cuts[light]);
                    size += of(light);
                }
            }
            if size == before {
                return CutChoice { cuts, error };
            }
        }
    }

    /// Mean difference that the lanes cause, and the lanes (of more than one band) by their share of it, the
    /// worst first.
    fn loss(
        &self,
        lanes: &Lanes,
        references: &[(Lanes, Rows)],
        jacobians: &[[[f64; 3]; 3]],
        total: f64,
    ) -> (f64, Vec<usize>) {
        let rows = self.irradiance(lanes);
        let mut harm = vec![0.0; lanes.len()];
        let mut mean = 0.0;
        for (k, jacobian) in jacobians.iter().enumerate() {
            let area = self.tree.node(self.leaves[k]).counted / total;
            let (mut all, mut excited) = ([0.0; 3], [0.0; 3]);
            for (l, lane) in lanes.lanes().iter().enumerate() {
                // Lanes of a single band are exact.
                let Some(light) = lane.light else { continue };
                let (fine, reference) = &references[light];
                let lost = |xyz: &[[f64; 3]]| {
                    let bands = lane.first..lane.first + lane.count;
                    bands.fold([0.0; 3], |lost, band| {
                        let difference = f64::from(reference.row(k)[band] - rows.row(k)[l]);
                        plus(lost, xyz[band].map(|w| w * difference))
                    })
                };
                let seen = lost(fine.xyz());
                harm[l] += area * length(jacobian, seen);
                all = plus(all, seen);
                // Lost excitation shows on other surfaces than light lost to the eye: one does not make up for the other.
                if let Some(excites) = fine.excites() {
                    let lost = lost(excites);
                    harm[l] += area * length(jacobian, lost);
                    excited = plus(excited, lost);
                }
            }
            mean += area * (length(jacobian, all) + length(jacobian, excited));
        }
        let mut worst: Vec<usize> = (0..harm.len())
            .filter(|&l| lanes.lanes()[l].count > 1 && harm[l] > 0.0)
            .collect();
        worst.sort_by(|&a, &b| harm[b].total_cmp(&harm[a]));
        (mean, worst)
    }
}

/// Splits a share of the intervals (light, first band), those first in the list, several at once: each step
/// costs a solve.
pub(super) fn split_worst(cuts: &mut [Partition], worst: Vec<(usize, usize)>, count: usize) {
    let most = count.div_ceil(BATCH).max(1);
    for (light, first) in worst.into_iter().take(most) {
        cuts[light] = cuts[light].split(first).unwrap_or(cuts[light]);
    }
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn length(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> f64 {
    matrix
        .iter()
        .map(|row| (row[0] * v[0] + row[1] * v[1] + row[2] * v[2]).powi(2))
        .sum::<f64>()
        .sqrt()
}
