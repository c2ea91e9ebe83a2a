//! The paper's way in a room: light goes from patch to patch as lists (3.2), bounce after bounce (3.4), and every receiver refines or merges
//! what it sends on.
//!
//! The first list of a patch is that of its direct light (3.1.3) after a product with its reflectance, under the paper's control along the two.
//! From then on a patch receives sums of lists, on the union of their cuts, and reflects them by [`reflect_sum`]. With each bounce lists become
//! shorter, as the light that is left over becomes fainter and flatter. Each reflection may err by its bounce's share of the limit, in CIELUV
//! under the adaptation white at the light that the patch has; a bounce of the k-th order has the share `(1 - q) q^k` of it, q being the share
//! of light that a bounce leaves. The sums go to the 64 bands of rows, from which light is gathered.

use super::leaf_rays::LeafRays;
use super::operator::Operator;
use super::reflection::Reflection;
use super::solver::{Carried, Convergence, MOST, System, is_near, worst};
use crate::color::{KM, luv_jacobian, tristimulus};
use crate::hierarchy::NONE;
use crate::light::{Rows, weighed};
use crate::spectrum::{
    BANDS, CmfTree, Control, ListTable, Metric, Moment, Path, SpectralList, SpectralTree, Spectrum,
    control, reflect_sum, represent,
};
use rayon::prelude::*;
use std::collections::HashMap;

/// Patches that a task works on; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 256;
/// A bounce leaves this share of its light at the most, as far as shares of the limit go: no bounce has to be exact.
const MOST_LEFT: f64 = 0.95;

/// From whom patches receive.
pub(super) enum Senders<'a> {
    /// By links.
    Links(Operator<'a>),
    /// By their own rays: how leaves look out, and the leaves, ascending.
    Rays(&'a LeafRays, &'a [u32]),
}

impl Senders<'_> {
    /// Sums of lists that leaves receive of what leaves send.
    fn received(
        &self,
        sent: &ListTable<Moment>,
        leaves: usize,
        cmf: &CmfTree,
    ) -> ListTable<Moment> {
        match self {
            Senders::Links(operator) => operator.received_lists(sent, cmf),
            Senders::Rays(rays, all) => table(leaves, |k| {
                let (met, fronts) = rays.met(all[k]);
                let mut ends: Vec<(u32, f32)> = met.collect();
                ends.sort_by_key(|end| end.0);
                let (mut sum, mut one) = (SpectralList::black(), SpectralList::black());
                for same in ends.chunk_by(|a, b| a.0 == b.0) {
                    // Rays end on leaves.
                    let place = all.binary_search(&same[0].0).ok()?;
                    if sent.get(place, &mut one) {
                        let rays: f64 = same.iter().map(|end| f64::from(end.1)).sum();
                        sum.add_scaled(rays / f64::from(fronts), &one, cmf);
                    }
                }
                Some(sum)
            }),
        }
    }
}

/// Light on its way as lists.
pub(super) struct ListBounces<'a> {
    /// The 64 bands of the leaves: how they reflect, and their areas.
    pub(super) system: &'a System<'a>,
    pub(super) senders: Senders<'a>,
    /// Colour matching functions on the bands.
    pub(super) weights: &'a [Spectrum; 3],
    /// Irradiance of the adaptation white, tristimulus.
    pub(super) white: [f64; 3],
    /// Colour difference, CIELUV, that lists may make at a patch.
    pub(super) limit: f64,
}

impl ListBounces<'_> {
    /// Reflected radiosity by direct irradiance, and irradiance by reflected light, by leaf, as [`System::solve`].
    pub(super) fn solve(
        &self,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
    ) -> (Convergence, Rows) {
        let leaves = first.len();
        let cmf = CmfTree::new(*self.weights);
        let paints = Paints::new(self.system.reflection, &cmf);
        let greatest = self.system.reflection.greatest::<BANDS>();
        let tails = greatest.map(|s| s / (1.0 - s));
        let left = self.left_by_a_bounce(first);
        let (mut seen, mut lacks) = (Rows::zero(leaves, BANDS), vec![[0.0; 3]; leaves]);
        *reflected = Rows::zero(leaves, BANDS);
        let (mut done, mut counts, mut share) = (Convergence::default(), [0; 2], 1.0 - left);
        let (mut sent, mut list) = (ListTable::dark(leaves), SpectralList::black());
        loop {
            let limit = share * self.limit;
            let arrived = self.senders.received(&sent, leaves, &cmf);
            add(&mut seen, &expanded(&arrived, leaves));
            for (k, sum) in lacks.iter_mut().enumerate() {
                if arrived.get(k, &mut list) {
                    *sum = std::array::from_fn(|c| sum[c] + list.error()[c]);
                }
            }
            sent = match done.iterations {
                0 => self.first_sent(first, &paints, &cmf, limit),
                _ => self.sent_on(&arrived, [first, &seen], &paints, &cmf, limit),
            };
            let change = expanded(&sent, leaves);
            add(reflected, &change);
            counts = std::array::from_fn(|k| counts[k] + sent.counts()[k]);
            done.iterations += 1;
            share *= left;
            let moved = self.system.products::<BANDS>(&change, &change);
            let whole = self.system.products::<BANDS>(reflected, reflected);
            done.residual = worst(&moved, &whole, &[1.0; BANDS]);
            done.bound = worst(&moved, &whole, &tails);
            let ended = done.iterations >= MOST || self.system.interrupt.is_raised();
            if ended || is_near(&moved, &whole, &tails, tolerance) {
                done.carried = Some(Carried {
                    intervals: counts[1] as f64 / counts[0].max(1) as f64,
                    de_luv: self.mean_error([first, &seen], &lacks),
                });
                return (done, seen);
            }
        }
    }

    /// What leaves send of the light of the lamps: the paper's own loop.
    fn first_sent(
        &self,
        first: &Rows,
        paints: &Paints,
        cmf: &CmfTree,
        limit: f64,
    ) -> ListTable<Moment> {
        table(first.len(), |k| {
            let light = spectrum_of([first], k);
            if light == [0.0; BANDS] {
                return None;
            }
            let source = SpectralTree::new(&light, cmf);
            let metric = self.metric(&light);
            let list = represent(&source, cmf, &metric, limit);
            let (paint, mut sent) = (paints.of(k), SpectralList::black());
            list.reflect(paint, cmf, &mut sent);
            let path = Path {
                source: &source,
                reflections: &[paint],
            };
            control(&mut sent, &path, cmf, &metric, &Control::within(limit));
            Some(sent)
        })
    }

    /// What leaves send of the light that arrived; `all`: all light that they have had so far.
    fn sent_on(
        &self,
        arrived: &ListTable<Moment>,
        all: [&Rows; 2],
        paints: &Paints,
        cmf: &CmfTree,
        limit: f64,
    ) -> ListTable<Moment> {
        table(all[0].len(), |k| {
            let mut light = SpectralList::black();
            arrived.get(k, &mut light).then(|| {
                let metric = self.metric(&spectrum_of(all, k));
                reflect_sum(&light, paints.of(k), cmf, &metric, limit)
            })
        })
    }

    /// Share of light that a reflection leaves: all that direct light leaves of itself, by area.
    fn left_by_a_bounce(&self, first: &Rows) -> f64 {
        let again = self.system.reflection.of::<BANDS>(first);
        let flux = |rows: &Rows| -> f64 {
            let each = (0..rows.len())
                .map(|k| self.system.areas[k] * weighed(rows.row(k), &self.weights[1]));
            each.sum()
        };
        let (before, after) = (flux(first), flux(&again));
        if before > 0.0 {
            (after / before).min(MOST_LEFT)
        } else {
            0.0
        }
    }

    /// Colour difference as seen at a patch with this light.
    fn metric(&self, light: &Spectrum) -> Metric {
        let white = self.white.map(|x| x / KM);
        Metric::Luv(luv_jacobian(tristimulus(light, self.weights), white))
    }

    /// Mean over the leaves of what their light lacks, CIELUV.
    fn mean_error(&self, light: [&Rows; 2], lacks: &[[f64; 3]]) -> f64 {
        let area: f64 = self.system.areas.iter().sum();
        // Where there is no light there is no white, either.
        let lacking = lacks.iter().enumerate().filter(|(_, e)| **e != [0.0; 3]);
        let sum: f64 = lacking
            .map(|(k, lacks)| {
                let metric = self.metric(&spectrum_of(light, k));
                self.system.areas[k] * metric.size(*lacks, [0.0; 3])
            })
            .sum();
        if area > 0.0 { sum / area } else { 0.0 }
    }
}

impl Operator<'_> {
    /// [`Operator::received`] for lists.
    fn received_lists(&self, sent: &ListTable<Moment>, cmf: &CmfTree) -> ListTable<Moment> {
        let nodes = self.tree.nodes.len();
        let mut means = ListTable::dark(nodes);
        let mut one = SpectralList::black();
        for (k, &leaf) in self.leaves.iter().enumerate() {
            if sent.get(k, &mut one) {
                let mut list = SpectralList::black();
                list.add_scaled(f64::from(self.factor[leaf as usize]), &one, cmf);
                means.set(leaf as usize, &list);
            }
        }
        // Children come after their parents.
        for k in (0..nodes).rev().filter(|&k| !self.tree.nodes[k].is_leaf()) {
            let mut mean = SpectralList::black();
            for child in self.tree.nodes[k].child_range().map(|c| c as usize) {
                if means.get(child, &mut one) {
                    mean.add_scaled(self.share_of(child), &one, cmf);
                }
            }
            means.set(k, &mean);
        }
        let gathered = table(nodes, |k| {
            let (mut sum, mut one) = (SpectralList::black(), SpectralList::black());
            for &(source, exchange) in self.links.row(k) {
                if means.get(source as usize, &mut one) {
                    sum.add_scaled(f64::from(exchange) * self.inverse_area(k), &one, cmf);
                }
            }
            Some(sum)
        });
        table(self.leaves.len(), |k| {
            let (mut sum, mut one) = (SpectralList::black(), SpectralList::black());
            let factor = f64::from(self.factor[self.leaves[k] as usize]);
            let mut id = self.leaves[k];
            while id != NONE {
                if gathered.get(id as usize, &mut one) {
                    sum.add_scaled(factor, &one, cmf);
                }
                id = self.tree.node(id).parent;
            }
            Some(sum)
        })
    }
}

/// A table of `count` lists.
fn table(count: usize, list: impl Fn(usize) -> Option<SpectralList> + Sync) -> ListTable<Moment> {
    let parts = (0..count.div_ceil(CHUNK)).into_par_iter().map(|part| {
        let (first, end) = (part * CHUNK, count.min((part + 1) * CHUNK));
        let mut table = ListTable::dark(end - first);
        for k in first..end {
            if let Some(list) = list(k) {
                table.set(k - first, &list);
            }
        }
        table
    });
    ListTable::joined(parts.collect::<Vec<_>>())
}

/// Lists on the 64 bands.
fn expanded(lists: &ListTable<Moment>, count: usize) -> Rows {
    let mut rows = Rows::zero(count, BANDS);
    let each = rows.all_mut::<BANDS>().par_iter_mut().enumerate();
    each.for_each(|(k, row)| {
        let mut list = SpectralList::black();
        if lists.get(k, &mut list) {
            *row = list.spectrum().map(|x| x as f32);
        }
    });
    rows
}

fn add(rows: &mut Rows, more: &Rows) {
    super::solver::step::<BANDS>(rows, more, [1.0; BANDS]);
}

/// The sum of rows of a leaf.
fn spectrum_of<const N: usize>(rows: [&Rows; N], leaf: usize) -> Spectrum {
    std::array::from_fn(|band| rows.iter().map(|r| f64::from(r.row(leaf)[band])).sum())
}

/// A tree for each reflectance.
struct Paints {
    trees: Vec<SpectralTree>,
    of: Vec<u32>,
}

impl Paints {
    fn new(reflection: &Reflection, cmf: &CmfTree) -> Self {
        let (mut known, mut trees) = (HashMap::new(), Vec::new());
        let of = reflection.rows.all::<BANDS>().iter().map(|row| {
            *known.entry(row.map(f32::to_bits)).or_insert_with(|| {
                trees.push(SpectralTree::new(&row.map(f64::from), cmf));
                trees.len() as u32 - 1
            })
        });
        let of = of.collect();
        Self { trees, of }
    }

    fn of(&self, leaf: usize) -> &SpectralTree {
        &self.trees[self.of[leaf] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Partition;
    use crate::transport::tests::baked;

    /// Along links and by rays: a part in a hundred less anywhere would fail.
    #[test]
    fn lists_arrive_as_rows_do() {
        for room in ["cornell.glb", "furnished.glb"] {
            let bake = baked(room, 1);
            let (links, leaves) = (bake.refinement.link_rows(), bake.refinement.leaves());
            let count = leaves.len();
            let (mut radiosity, mut sent) = (Rows::zero(count, BANDS), ListTable::dark(count));
            for k in 0..count {
                let row: Spectrum = std::array::from_fn(|b| 1.0 + ((7 * k + b) % 5) as f64);
                radiosity.row_mut(k).copy_from_slice(&row.map(|x| x as f32));
                sent.set(k, &SpectralList::from_values(Partition::uniform(6), &row));
            }
            let ought = bake.receive::<BANDS>(&links, &leaves)(&radiosity);
            let cmf = CmfTree::new(bake.room.weights);
            let senders = bake.senders(&links, &leaves);
            let is = expanded(&senders.received(&sent, count, &cmf), count);
            for k in 0..count {
                for (is, ought) in is.row(k).iter().zip(ought.row(k)) {
                    assert!(
                        (is - ought).abs() < 1e-4 * (1.0 + ought),
                        "{room} {k}: {is} {ought}"
                    );
                }
            }
        }
    }
}
