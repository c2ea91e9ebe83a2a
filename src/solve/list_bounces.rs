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
use crate::color::{KM, luv_jacobian};
use crate::hierarchy::NONE;
use crate::light::Rows;
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

/// A bounce: what every leaf receives, and sends on.
struct Bounce {
    received: Rows,
    sent: ListTable<Moment>,
    /// What the light received lacks, tristimulus over [`KM`], by leaf.
    lacks: Vec<[f64; 3]>,
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
        let mut sent = ListTable::dark(leaves);
        loop {
            let limit = share * self.limit;
            let bounce = match done.iterations {
                0 => self.first_bounce(first, &paints, &cmf, limit),
                _ => self.next_bounce(&sent, [first, &seen], &paints, &cmf, limit),
            };
            sent = bounce.sent;
            add(&mut seen, &bounce.received);
            for (sum, more) in lacks.iter_mut().zip(bounce.lacks) {
                *sum = std::array::from_fn(|c| sum[c] + more[c]);
            }
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

    /// Light of the lamps, on its first reflection: the paper's own loop.
    fn first_bounce(&self, first: &Rows, paints: &Paints, cmf: &CmfTree, limit: f64) -> Bounce {
        let each = |k: usize| {
            let row = first.row(k);
            if row.iter().all(|&x| x == 0.0) {
                return None;
            }
            let source = SpectralTree::new(&std::array::from_fn(|b| f64::from(row[b])), cmf);
            let metric = self.metric(xyz(source.spectrum(), self.weights));
            let list = represent(&source, cmf, &metric, limit);
            let (paint, mut sent) = (paints.of(k), SpectralList::black());
            list.reflect(paint, cmf, &mut sent);
            let path = Path {
                source: &source,
                reflections: &[paint],
            };
            control(&mut sent, &path, cmf, &metric, &Control::within(limit));
            Some(sent)
        };
        Bounce {
            received: Rows::zero(first.len(), BANDS),
            sent: table(first.len(), each),
            lacks: vec![[0.0; 3]; first.len()],
        }
    }

    /// What the last bounce sent is received and sent on. `known`: the light that leaves have had so far.
    fn next_bounce(
        &self,
        sent: &ListTable<Moment>,
        known: [&Rows; 2],
        paints: &Paints,
        cmf: &CmfTree,
        limit: f64,
    ) -> Bounce {
        let leaves = known[0].len();
        let arrived = self.gathered(sent, leaves, cmf);
        let reflect = |k: usize| {
            let mut light = SpectralList::black();
            if !arrived.get(k, &mut light) {
                return None;
            }
            let now = light.spectrum();
            let all: Spectrum = std::array::from_fn(|b| {
                now[b]
                    + known
                        .iter()
                        .map(|rows| f64::from(rows.row(k)[b]))
                        .sum::<f64>()
            });
            let metric = self.metric(xyz(&all, self.weights));
            Some(reflect_sum(&light, paints.of(k), cmf, &metric, limit))
        };
        let lacks = |k: usize| {
            let mut light = SpectralList::black();
            arrived.get(k, &mut light);
            light.error()
        };
        Bounce {
            received: expanded(&arrived, leaves),
            sent: table(leaves, reflect),
            lacks: (0..leaves).into_par_iter().map(lacks).collect(),
        }
    }

    /// Sums of lists that leaves receive of what leaves send.
    fn gathered(
        &self,
        sent: &ListTable<Moment>,
        leaves: usize,
        cmf: &CmfTree,
    ) -> ListTable<Moment> {
        match &self.senders {
            Senders::Links(operator) => operator.received_lists(sent, cmf),
            Senders::Rays(rays, all) => table(leaves, |k| {
                let (met, fronts) = rays.met(all[k]);
                let mut ends: Vec<u32> = met.collect();
                ends.sort_unstable();
                let (mut sum, mut one) = (SpectralList::black(), SpectralList::black());
                for same in ends.chunk_by(|a, b| a == b) {
                    // Rays end on leaves.
                    let place = all.binary_search(&same[0]).ok()?;
                    if sent.get(place, &mut one) {
                        sum.add_scaled(same.len() as f64 / f64::from(fronts), &one, cmf);
                    }
                }
                Some(sum)
            }),
        }
    }

    /// Share of light that a reflection leaves: all that direct light leaves of itself, by area.
    fn left_by_a_bounce(&self, first: &Rows) -> f64 {
        let again = self.system.reflection.of::<BANDS>(first);
        let flux = |rows: &Rows| -> f64 {
            let each = (0..rows.len())
                .map(|k| self.system.areas[k] * bright(rows.row(k), &self.weights[1]));
            each.sum()
        };
        let (before, after) = (flux(first), flux(&again));
        if before > 0.0 {
            (after / before).min(MOST_LEFT)
        } else {
            0.0
        }
    }

    /// Colour difference as seen at a patch with this light, tristimulus over [`KM`].
    fn metric(&self, light: [f64; 3]) -> Metric {
        Metric::Luv(luv_jacobian(light, self.white.map(|x| x / KM)))
    }

    /// Mean over the leaves of what their light lacks, CIELUV.
    fn mean_error(&self, light: [&Rows; 2], lacks: &[[f64; 3]]) -> f64 {
        let (mut sum, mut area) = (0.0, 0.0);
        for (k, lacks) in lacks.iter().enumerate() {
            let all =
                std::array::from_fn(|b| light.iter().map(|rows| f64::from(rows.row(k)[b])).sum());
            let size = self.metric(xyz(&all, self.weights)).size(*lacks, [0.0; 3]);
            sum += self.system.areas[k] * size;
            area += self.system.areas[k];
        }
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

fn bright(row: &[f32], weights: &Spectrum) -> f64 {
    row.iter()
        .zip(weights)
        .map(|(x, w)| f64::from(*x) * w)
        .sum()
}

fn xyz(light: &Spectrum, weights: &[Spectrum; 3]) -> [f64; 3] {
    std::array::from_fn(|c| light.iter().zip(&weights[c]).map(|(x, w)| x * w).sum())
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
