//! The interval list that a patch needs for itself: the coarsening of its row that its error allows (paper 3.2, merge,
//! under perceptual control).
//!
//! Rows of all patches share the working partition, because that is what a gather streams through. A patch by itself
//! is content with fewer intervals: siblings are merged while the colour of its irradiance under the adaptation white
//! moves by no more than the limit (CIELUV). The union of the lists is what the room needs.

use crate::light::lanes::Lanes;
use crate::color::{KM, luv_jacobian};
use crate::scene::LightSpectrum;
use crate::spectrum::{CmfTree, Control, Leaves, Metric, Partition, SpectralList, coarsen};

/// One list for each light.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchList {
    /// Mask and values: bit k set, an interval starts at leaf k; values are ratios to the light's power.
    pub lights: Vec<(Partition, Vec<f64>)>,
}

impl PatchList {
    /// Number of intervals, all lights together.
    pub fn intervals(&self) -> usize {
        self.lights.iter().map(|(cut, _)| cut.count()).sum()
    }
}

/// Coarsens rows.
pub(super) struct Lister<'a> {
    lanes: &'a Lanes,
    trees: Vec<CmfTree>,
    white: [f64; 3],
    limit: f64,
}

impl<'a> Lister<'a> {
    pub(crate) fn new(
        lanes: &'a Lanes,
        spectra: &[LightSpectrum],
        weights: &[Leaves; 3],
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

    /// The list of a row; the 64 leaves themselves are left as they are (they belong to no one light).
    pub(super) fn list(&self, row: &[f32]) -> PatchList {
        let xyz = self.lanes.tristimulus(row).map(|x| x / KM);
        let metric = Metric::Luv(luv_jacobian(xyz, self.white));
        // Lights share what is allowed.
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
            let leaves = list.leaves();
            let values = list
                .partition()
                .iter()
                .map(|(first, _)| leaves[first])
                .collect();
            lights.push((list.partition(), values));
        }
        PatchList { lights }
    }
}
