//! The interval list that a patch needs for itself: the coarsening of its row that its error allows (paper 3.2, merge,
//! under perceptual control).
//!
//! Rows of all patches share the working partition, because that is what a gather streams through. A patch by itself
//! needs fewer intervals: siblings are merged while the colour of its irradiance under the adaptation white moves by no
//! more than the limit (CIELUV). The union of the lists is what the room needs.

use super::{Bake, SPECTRUM_SHARE};
use crate::color::{KM, luv_jacobian};
use crate::light::lanes::Lanes;
use crate::scene::LightSpectrum;
use crate::spectrum::{CmfTree, Control, Metric, Partition, SpectralList, Spectrum, coarsen};
use rayon::prelude::*;

/// One list for each light.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchList {
    /// Partition and values: where bit k is set, an interval starts at band k; values are ratios to the
    /// light's power.
    pub lights: Vec<(Partition, Vec<f64>)>,
}

impl PatchList {
    /// Number of intervals, all lights together.
    pub fn intervals(&self) -> usize {
        self.lights.iter().map(|(cut, _)| cut.count()).sum()
    }
}

/// Coarsens rows.
pub(crate) struct Lister<'a> {
    lanes: &'a Lanes,
    trees: Vec<CmfTree>,
    white: [f64; 3],
    limit: f64,
}

impl<'a> Lister<'a> {
    pub(crate) fn new(
        lanes: &'a Lanes,
        spectra: &[LightSpectrum],
        weights: &[Spectrum; 3],
        white: [f64; 3],
        limit: f64,
    ) -> Self {
        let cmf = CmfTree::new(*weights);
        let trees = spectra.iter().map(|s| cmf.under(&s.power)).collect();
        Self {
            lanes,
            trees,
            white: white.map(|x| x / KM),
            limit,
        }
    }

    /// The list of a row. A row of the 64 bands stays as it is: they belong to no one light.
    pub(super) fn list(&self, row: &[f32]) -> PatchList {
        let xyz = self.lanes.tristimulus(row).map(|x| x / KM);
        let metric = Metric::Luv(luv_jacobian(xyz, self.white));
        // Lights share the limit.
        let limit = self.limit / self.trees.len().max(1) as f64;
        let mut lights = Vec::with_capacity(self.trees.len());
        for (light, cmf) in self.trees.iter().enumerate() {
            let own = || {
                self.lanes
                    .lanes()
                    .iter()
                    .zip(row)
                    .filter(move |(lane, _)| lane.light == Some(light))
            };
            let bits = own().fold(0_u64, |bits, (lane, _)| bits | 1 << lane.first);
            let Some(cut) = Partition::new(bits) else {
                continue;
            };
            let values: Vec<f64> = own().map(|(_, &x)| f64::from(x)).collect();
            let mut list = SpectralList::from_values(cut, &values);
            coarsen(&mut list, cmf, &metric, &Control::within(limit));
            let spectrum = list.spectrum();
            let values = list
                .partition()
                .iter()
                .map(|(first, _)| spectrum[first])
                .collect();
            lights.push((list.partition(), values));
        }
        PatchList { lights }
    }
}

/// Leaves whose lists are looked at after a round.
const LISTED_LEAVES: usize = 4096;

impl Bake {
    /// Mean number of intervals that a patch needs, over evenly chosen leaves.
    pub(super) fn intervals_mean(&self) -> f64 {
        let lists = self.lists(
            self.solution
                .light
                .leaves
                .len()
                .div_ceil(LISTED_LEAVES)
                .max(1),
        );
        let sum: usize = lists.iter().map(PatchList::intervals).sum();
        if lists.is_empty() {
            0.0
        } else {
            sum as f64 / lists.len() as f64
        }
    }

    /// The interval lists that every `step`-th leaf of the hierarchy needs for its irradiance, in order of
    /// [`Light::leaves`](crate::light::Light::leaves); empty where the rows hold the 64 bands.
    pub fn lists(&self, step: usize) -> Vec<PatchList> {
        if !self.solution.lanes.is_ratio() {
            return Vec::new();
        }
        let limit = SPECTRUM_SHARE * self.room.settings.error;
        let lister = Lister::new(
            &self.solution.lanes,
            &self.room.scene.spectra,
            &self.room.weights,
            self.solution.light.white,
            limit,
        );
        let rows: Vec<usize> = (0..self.solution.light.leaves.len())
            .step_by(step.max(1))
            .collect();
        rows.into_par_iter()
            .map(|k| lister.list(self.solution.light.irradiance.row(k)))
            .collect()
    }
}
