//! What patches carry after a round: lists (paper 3.1.1), chosen by the paper's control (3.2) under perceptual errors.
//!
//! Rows of all patches share the working partition, because that is what a gather streams through. A patch by itself is content
//! with fewer intervals: its list starts on the cut of the patch before it, is refined while its error exceeds the patch's share
//! of what spectra may cause, and merged while it is less than a quarter of that. What patches send is these lists, expanded: to
//! watched points and vertices, and, from a checkpoint or a cache, to the next solve. What they lose is looked up by a sweep of the
//! difference, and counted with the lanes' error.

use super::solving::Lit;
use super::{Bake, Representation, SPECTRUM_SHARE};
use crate::color::{KM, luv_jacobian};
use crate::light::lanes::Lanes;
use crate::light::{Joints, Rows, cuts_of};
use crate::link::LinkRows;
use crate::scene::LightSpectrum;
use crate::spectrum::{
    CmfTree, Control, Leaves, Metric, Partition, Path, SpectralList, SpectralTree, control,
};
use rayon::prelude::*;
use std::ops::Range;

/// What a list may lose of the colour of its own patch, share of what spectra may cause.
const LIST_SHARE: f64 = 1.0;
/// What is left to lanes, to whose error that of lists adds as a square: a quarter is for lists. What many patches lose together is
/// less than what each loses.
pub(super) const LANES_SHARE: f64 = 0.968;
/// Errors below this share of the limit are merged away, as in the paper's tests (4.2: "a ratio around 4").
const MERGED_BELOW: f64 = 0.25;
/// Patches that a task lists one after the other; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 256;
/// Leaves whose lists are counted after a round.
const LISTED_LEAVES: usize = 4096;

/// One list for each light.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
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

/// The lanes of one light.
struct Part {
    lanes: Range<usize>,
    cut: Partition,
    cmf: CmfTree,
}

/// Turns rows into lists that are within a limit of them.
pub(crate) struct Lister {
    parts: Vec<Part>,
    xyz: Vec<[f64; 3]>,
    white: [f64; 3],
    rules: Control,
}

impl Lister {
    /// Lists within a colour difference (CIELUV) of the rows; none where lanes are no ratios to lights.
    fn new(
        lanes: &Lanes,
        spectra: &[LightSpectrum],
        weights: &[Leaves; 3],
        white: [f64; 3],
        limit: f64,
    ) -> Option<Self> {
        let cmf = CmfTree::new(*weights);
        let mut first = 0;
        let cuts = lanes.cuts()?;
        let part = |(cut, light): (&Partition, &LightSpectrum)| {
            let start = first;
            first += cut.count();
            Part {
                lanes: start..first,
                cut: *cut,
                cmf: cmf.under(&light.power),
            }
        };
        let parts: Vec<Part> = cuts.iter().zip(spectra).map(part).collect();
        // Lights share what is allowed.
        let limit = limit / parts.len().max(1) as f64;
        Some(Self {
            parts,
            xyz: lanes.xyz().iter().map(|x| x.map(|x| x / KM)).collect(),
            white: white.map(|x| x / KM),
            rules: Control {
                eps_min: MERGED_BELOW * limit,
                ..Control::within(limit)
            },
        })
    }

    /// The cuts that lists start on where none is known.
    fn finest(&self) -> Vec<Partition> {
        self.parts.iter().map(|part| part.cut).collect()
    }

    /// Makes a row that of its list; `cuts` are those to start on, and then its own.
    fn list(&self, row: &mut [f32], cuts: &mut [Partition]) {
        let colour = self.xyz.iter().zip(&*row).fold([0.0; 3], |sum, (xyz, x)| {
            std::array::from_fn(|c| sum[c] + xyz[c] * f64::from(*x))
        });
        // What is black is so on any cut.
        if colour.iter().sum::<f64>() <= 0.0 {
            return;
        }
        let metric = Metric::Luv(luv_jacobian(colour, self.white));
        for (part, cut) in self.parts.iter().zip(cuts) {
            let own = &mut row[part.lanes.clone()];
            // Exactly flat stays exactly flat, and tells the next patch nothing.
            if own.iter().all(|x| *x == own[0]) {
                continue;
            }
            let mut values = [0.0; crate::spectrum::LEAVES];
            for (value, x) in values.iter_mut().zip(&*own) {
                *value = f64::from(*x);
            }
            let tree = SpectralTree::on(part.cut, &values[..own.len()], &part.cmf);
            let mut list = SpectralList::new(&tree, *cut);
            let path = Path {
                source: &tree,
                reflections: &[],
            };
            control(&mut list, &path, &part.cmf, &metric, &self.rules);
            *cut = list.partition();
            let leaves = list.leaves();
            for (x, (first, _)) in own.iter_mut().zip(part.cut.iter()) {
                *x = leaves[first] as f32;
            }
        }
    }

    /// Makes rows those of their lists.
    pub(super) fn list_all(&self, rows: &mut Rows) {
        let width = rows.width();
        rows.parts_mut(CHUNK).for_each(|rows| {
            let mut cuts = self.finest();
            for row in rows.chunks_mut(width) {
                self.list(row, &mut cuts);
            }
        });
    }
}

impl Bake {
    /// What makes lists of rows; none where the way of carrying spectra is no adaptive one (others are there to be compared
    /// with), or where light counts for more than is seen of it.
    pub(super) fn lister(&self) -> Option<Lister> {
        let (room, solution) = (&self.room, &self.solution);
        let seen_only = solution.lanes.excites().is_none();
        let adaptive = room.settings.representation == Representation::Adaptive;
        let white = solution.light.white;
        (adaptive && seen_only && white != [0.0; 3])
            .then(|| {
                Lister::new(
                    &solution.lanes,
                    &room.scene.spectra,
                    &room.weights,
                    white,
                    LIST_SHARE * self.spectrum_share(),
                )
            })
            .flatten()
    }

    /// Colour difference (CIELUV) that spectra may cause.
    pub(super) fn spectrum_share(&self) -> f64 {
        let share = SPECTRUM_SHARE * self.room.settings.error;
        self.room.settings.spectrum.unwrap_or(share)
    }

    /// What leaves send as lists, and the mean colour difference (CIELUV) that this makes to the `irradiance` of leaves.
    pub(super) fn listed<const L: usize>(
        &self,
        lister: &Lister,
        (lit, rows): (&Lit, &LinkRows),
        sent: &Rows,
        irradiance: &Rows,
    ) -> (Rows, f64) {
        let mut lists = sent.clone();
        lister.list_all(&mut lists);
        let mut lost = lists.clone();
        for (lost, sent) in lost.all_mut::<L>().iter_mut().zip(sent.all::<L>()) {
            *lost = std::array::from_fn(|l| lost[l] - sent[l]);
        }
        let lost = self.received::<L>(lit, rows, &lost);
        let lanes = &self.solution.lanes;
        let white = self.solution.light.white.map(|x| x / KM);
        let colour = |row: &[f32]| lanes.tristimulus(row).map(|x| x / KM);
        let (mut sum, mut area) = (0.0, 0.0);
        for (k, &leaf) in lit.leaves.iter().enumerate() {
            let metric = Metric::Luv(luv_jacobian(colour(irradiance.row(k)), white));
            let a = self.refinement.areas[leaf as usize];
            sum += a * metric.size(colour(lost.row(k)), [0.0; 3]);
            area += a;
        }
        (lists, if area > 0.0 { sum / area } else { 0.0 })
    }

    /// Mean number of intervals of the lists of patches, over evenly chosen leaves.
    pub(super) fn intervals_mean(&self) -> f64 {
        let leaves = self.solution.light.leaves.len();
        let lists = self.lists(leaves.div_ceil(LISTED_LEAVES).max(1));
        let sum: usize = lists.iter().map(PatchList::intervals).sum();
        if lists.is_empty() {
            0.0
        } else {
            sum as f64 / lists.len() as f64
        }
    }

    /// The interval lists in which every `step`-th leaf of the hierarchy carries what it reflects, in order of
    /// [`Light::leaves`](crate::light::Light::leaves); empty where the rows hold the 64 leaves.
    pub fn lists(&self, step: usize) -> Vec<PatchList> {
        let lanes = &self.solution.lanes;
        if !lanes.is_ratio() {
            return Vec::new();
        }
        let joints = Joints::new(lanes);
        let leaves = self.solution.light.leaves.iter().step_by(step.max(1));
        let list = |&leaf: &u32| {
            let row = self.sent(leaf);
            PatchList {
                lights: cuts_of(lanes.lanes(), joints.mask(row), row),
            }
        };
        leaves.map(list).collect()
    }

    /// What a leaf reflects; what mirrors are read as stands apart.
    pub(super) fn sent(&self, leaf: u32) -> &[f32] {
        let light = &self.solution.light;
        match self.is_mirror(leaf) {
            true => light.mirrors.row(leaf as usize),
            false => light.reflected.row(leaf as usize),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{Observer, de_luv};
    use crate::light::padded;
    use crate::scene::{Options, Scene};
    use crate::solve::Settings;
    use crate::spectrum::Grid;
    use crate::spectrum::testing::{any_cut, patch};
    use proptest::prelude::*;

    proptest! {
        /// Lists of two lights keep the colour of their rows within the limit, whatever cuts they start on.
        #[test]
        fn lists_are_within_their_limit(
            lights in prop::collection::vec((patch(), any_cut()), 1..3),
            ratios in prop::collection::vec(patch(), 1..8),
            limit in 0.0..2.0f64,
        ) {
            let weights = Observer::cie1931().weights(&Grid::default());
            let spectra: Vec<LightSpectrum> = (lights.iter())
                .map(|(power, _)| LightSpectrum { name: String::new(), power: *power })
                .collect();
            let cuts: Vec<Partition> = lights.iter().map(|(_, cut)| *cut).collect();
            let lanes = Lanes::ratio(&spectra, &cuts, &weights);
            let mut white = vec![1.0; lanes.len()];
            white.resize(64, 0.0);
            let white = lanes.tristimulus(&white.iter().map(|x| *x as f32).collect::<Vec<_>>());
            let Some(lister) = Lister::new(&lanes, &spectra, &weights, white, limit) else {
                // Both lights together have more lanes than rows hold.
                return Ok(());
            };
            prop_assume!(white.iter().all(|&x| x > 0.0));
            let mut rows = Rows::zero(ratios.len(), padded(lanes.len()));
            for (k, ratio) in ratios.iter().enumerate() {
                for (l, lane) in lanes.lanes().iter().enumerate() {
                    rows.row_mut(k)[l] = ratio[lane.first] as f32;
                }
            }
            let before = rows.clone();
            lister.list_all(&mut rows);
            let joints = Joints::new(&lanes);
            for k in 0..rows.len() {
                let [then, now] = [&before, &rows].map(|rows| lanes.tristimulus(rows.row(k)).map(|x| x / KM));
                if then.iter().sum::<f64>() == 0.0 {
                    continue;
                }
                let metric = Metric::Luv(luv_jacobian(then, white.map(|x| x / KM)));
                let lost = metric.size([0, 1, 2].map(|c| now[c] - then[c]), [0.0; 3]);
                // Rows are f32.
                prop_assert!(lost <= limit + 1e-3, "{lost} {limit}");
                let mask = joints.mask(rows.row(k));
                prop_assert!(mask.count_ones() <= joints.mask(before.row(k)).count_ones());
            }
        }
    }

    /// What lanes and lists together lose of the light at the watched points, beside all 64 leaves on the same links, is what
    /// the record says.
    #[test]
    fn lists_lose_what_the_record_says() {
        for (name, rounds) in [("cornell-f2", 2), ("two-rooms", 2)] {
            let path = format!("{}/scenes/{name}.glb", env!("CARGO_MANIFEST_DIR"));
            let room = Scene::load(path, &Options::default()).unwrap();
            let settings = Settings {
                error: 1.0,
                ..Settings::default()
            };
            let mut bake = Bake::new(room, settings);
            for _ in 0..rounds {
                bake.step();
            }
            let record = bake.rounds()[rounds - 1].clone();
            let working = record.intervals_working as f64;
            assert!(
                record.intervals_mean < 0.9 * working,
                "{name}: {}",
                record.intervals_mean
            );
            let stated = record.error.spectrum_de_luv.value.unwrap();
            let solve = record.error.convergence_de_luv.value.unwrap();
            let by_lists = bake.solution.lost_by_lists;
            assert!(
                by_lists > 0.0 && by_lists < 0.25 * bake.spectrum_share(),
                "{name}: {by_lists}"
            );
            let seen = bake.solution.seen.clone();
            bake.hold(Representation::Dense, 1.0).unwrap();
            bake.light_arrives();
            let to = bake
                .room
                .probes
                .receivers(&bake.refinement.tree, rounds - 1);
            let truth = bake.gather(&to);
            let white = bake.solution.light.white;
            let colours = truth
                .iter()
                .map(|g| bake.solution.lanes.tristimulus(&g.irradiance));
            let mean = colours
                .zip(&seen)
                .map(|(a, b)| de_luv(a, *b, white))
                .sum::<f64>()
                / seen.len() as f64;
            println!(
                "{name}: stated {stated} (lists {by_lists}), measured {mean}, solve {solve}, {} of {working}",
                record.intervals_mean
            );
            assert!(
                mean <= 1.5 * stated + solve,
                "{name}: {mean} {stated} {solve}"
            );
        }
    }
}
