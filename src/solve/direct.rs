//! Light straight from lamps, of any kind, on the hierarchy: gathered exactly at points of every leaf, never linked.
//!
//! Leaves over which direct light varies are split, which is where shadow boundaries and hot spots are; links then only
//! carry reflected light, which is smooth. The direct light of a leaf stays known in later rounds.
//!
//! In rooms of few triangles a quadrature rule finds the mean over a leaf, and covered points are left out. Where leaves
//! look for themselves the points are random, weighted by their openness (a leaf counts as far as others see it, see
//! `leaf_rays`): without bias whatever lies across the leaf, from two points upwards. Leaves that matter more get more
//! points.

mod mean;

use super::landed::Landed;
use crate::geometry::sampling::{hash, sequence02, triangle_weights};
use crate::hierarchy::{NONE, Tree, stratified};
use crate::light::weighed;
use crate::link::{Demand, MAX_DEPTH};
use crate::team::{Interrupt, Interrupted, Team};
use crate::transport::{Memory, Receiver};
use mean::{LeafSamples, Mean, UNSEEN};
use std::ops::Range;

/// Points of a leaf, each with its weight: exact for polynomials of degree 4 (Cowper 1973; Dunavant 1985, table II, p = 4).
/// With the three points of degree 2, the mean over a large leaf near a lamp was off by up to 2.5 %.
const POINTS: [([f64; 3], f64); 6] = {
    const A: f64 = 0.445_948_490_915_965;
    const B: f64 = 0.091_576_213_509_771;
    const WEIGHTS: [f64; 2] = [0.223_381_589_678_011, 0.109_951_743_655_322];
    [
        ([1.0 - 2.0 * A, A, A], WEIGHTS[0]),
        ([A, 1.0 - 2.0 * A, A], WEIGHTS[0]),
        ([A, A, 1.0 - 2.0 * A], WEIGHTS[0]),
        ([1.0 - 2.0 * B, B, B], WEIGHTS[1]),
        ([B, 1.0 - 2.0 * B, B], WEIGHTS[1]),
        ([B, B, 1.0 - 2.0 * B], WEIGHTS[1]),
    ]
};
const MIDDLE: [([f64; 3], f64); 1] = [([1.0 / 3.0; 3], 1.0)];
/// Leaves below this share of the counted area are gathered at one point, or as few as possible.
const TINY: f64 = 1e-5;
/// Area that does not count has this share, so that nothing is divided by zero.
const LEAST_SHARE: f64 = 1e-30;
/// Further points that are tried where some are covered.
const MORE_POINTS: usize = 8;
/// Error allowed to a leaf's direct light, as a share of the variation that would split the leaf.
const NOISE: f64 = 0.1;
/// Random points of a leaf that nothing can split yet, of one that may be split, and at the most.
const RANDOM: [usize; 3] = [2, 8, 256];
/// Points beyond those that tell whether light is even, at the most.
const DECIDING: usize = 64;
/// Light and shadow that these points miss may vary by this many times what splits a leaf, at the worst. With eight points for all leaves the
/// shadow on a sunlit floor of 6 m2 was missed with half of the seeds, and a wall beside it was lit by 2.3 times its light. With this factor and
/// that most, and with 1 in its place and up to 256 points, points at the default are off by 2.35, 1.41 and 2.44, 1.55 % in this room (7.72 with the
/// second seed before), by 2.63, 2.28 and 2.50 in a garage, by 2.85, 2.03 and 2.89 in a home theatre and by 2.63 and 1.76 in a canteen (root mean
/// square beside Mitsuba, seeds 0 and 1, or 0; while near paths took the mean of even leaves), in 1.0 and 1.5 times the garage's and the canteen's time.
const MISSED: f64 = 3.0;
/// Rough share of all direct light that a leaf may misplace by too few points. With this a garage's leaves receive from
/// the first round on what its lamp sends, within a per cent.
const FLUX_SHARE: f64 = 2e-4;
/// Leaves that a task looks at.
const CHUNK: usize = 32;

/// Direct irradiance of nodes that are or were leaves.
#[derive(Debug, Clone, Default)]
pub(crate) struct Direct {
    /// Lanes of a row.
    width: usize,
    /// Place of each node's row; [`NONE`] where it is not known.
    place: Vec<u32>,
    /// Rows by place.
    rows: Vec<f32>,
    /// Places whose rows are no longer needed.
    free: Vec<u32>,
    /// Half the range of brightness over a leaf's points; if not measured, minus a bound of it.
    half_range: Vec<f32>,
    /// Mean brightness of the whole leaf over that of the part others see.
    whole: Vec<f32>,
    /// Covariance of brightness with openness (does a ray end further away than close by?), over mean brightness.
    with_openness: Vec<f32>,
    /// Where each leaf's light comes from: a range of `bytes`; empty unless kept. The traces of leaves that were split stay
    /// among the bytes: each level below takes four times as many.
    traces: Vec<Range<usize>>,
    bytes: Vec<u8>,
    /// Rays cast so far.
    pub(super) rays: u64,
}

impl Direct {
    /// What is known of `leaves`, as read from a file: a row of `width` lanes and three figures each, see
    /// [`figures`](Self::figures).
    pub(super) fn known(
        leaves: &[u32],
        nodes: usize,
        width: usize,
        rows: &[f32],
        figures: &[[f32; 3]],
    ) -> Self {
        let mut known = Self {
            width,
            place: vec![NONE; nodes],
            rows: rows.to_vec(),
            half_range: vec![0.0; nodes],
            whole: vec![1.0; nodes],
            with_openness: vec![0.0; nodes],
            ..Self::default()
        };
        for (k, &leaf) in leaves.iter().enumerate() {
            known.place[leaf as usize] = k as u32;
            known.put_figures(leaf, figures[k]);
        }
        known
    }

    /// What is known of a leaf besides its row.
    pub(super) fn figures(&self, leaf: u32) -> [f32; 3] {
        [&self.half_range, &self.whole, &self.with_openness].map(|list| list[leaf as usize])
    }

    fn put_figures(&mut self, leaf: u32, figures: [f32; 3]) {
        let lists = [
            &mut self.half_range,
            &mut self.whole,
            &mut self.with_openness,
        ];
        for (list, figure) in lists.into_iter().zip(figures) {
            list[leaf as usize] = figure;
        }
    }

    /// Where the light of leaves comes from, as read from a file.
    pub(super) fn keep(&mut self, leaves: &[u32], traces: Vec<Option<Box<[u8]>>>) {
        for (trace, &leaf) in traces.into_iter().zip(leaves) {
            self.keep_trace(leaf, trace.as_deref());
        }
    }

    fn keep_trace(&mut self, leaf: u32, trace: Option<&[u8]>) {
        let Some(trace) = trace else { return };
        self.traces.resize(self.place.len(), 0..0);
        let start = self.bytes.len();
        self.bytes.extend_from_slice(trace);
        self.traces[leaf as usize] = start..self.bytes.len();
    }

    /// Where a leaf's light comes from (see `gather::trace`), if kept.
    pub(crate) fn trace(&self, leaf: u32) -> Option<&[u8]> {
        let stretch = self.traces.get(leaf as usize)?.clone();
        (!stretch.is_empty()).then(|| &self.bytes[stretch])
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.place.as_slice())
            + size_of_val(self.rows.as_slice())
            + size_of_val(self.free.as_slice())
            + size_of_val(self.half_range.as_slice())
            + size_of_val(self.whole.as_slice())
            + size_of_val(self.with_openness.as_slice())
            + size_of_val(self.traces.as_slice())
            + self.bytes.len()
    }

    /// Mean brightness of the whole leaf over that of the part others see.
    pub(super) fn whole(&self, leaf: u32) -> f32 {
        // Unknown where light was replayed: then leaves count as even.
        self.whole.get(leaf as usize).copied().unwrap_or(1.0)
    }

    /// Covariance of brightness with openness over a leaf, over mean brightness.
    pub(super) fn with_openness(&self, leaf: u32) -> f32 {
        self.with_openness
            .get(leaf as usize)
            .copied()
            .unwrap_or(0.0)
    }

    /// Direct irradiance of a leaf by lane.
    pub(super) fn row(&self, leaf: u32) -> &[f32] {
        let first = match self.place[leaf as usize] {
            NONE => return &[],
            place => place as usize * self.width,
        };
        &self.rows[first..first + self.width]
    }

    /// Puts a row in a free place.
    fn put(&mut self, leaf: u32, row: &[f32], figures: [f32; 3]) {
        self.forget(leaf as usize);
        let place = match self.free.pop() {
            Some(place) => {
                let first = place as usize * self.width;
                self.rows[first..first + self.width].copy_from_slice(row);
                place
            }
            None => {
                self.rows.extend_from_slice(row);
                (self.rows.len() / self.width.max(1)) as u32 - 1
            }
        };
        self.place[leaf as usize] = place;
        self.put_figures(leaf, figures);
    }

    /// Frees the row of a node that is a leaf no longer.
    fn forget(&mut self, node: usize) {
        let place = std::mem::replace(&mut self.place[node], NONE);
        self.free.extend(Some(place).filter(|&place| place != NONE));
        if let Some(trace) = self.traces.get_mut(node) {
            *trace = 0..0;
        }
    }

    /// Puts rows on other lanes: each new lane takes the value of the old lane at its place.
    pub(super) fn relabel(&mut self, places: &[usize]) {
        if self.width > 0 {
            let rows = self.rows.chunks(self.width);
            self.rows = rows
                .flat_map(|row| places.iter().map(|&k| row[k]))
                .collect();
            self.width = places.len();
        }
    }

    /// Does direct light vary too much over a leaf, by its points or by the rays that landed on it?
    fn is_uneven(
        &self,
        (tree, leaf): (&Tree, u32),
        demand: &Demand,
        look: &impl LeafSampler,
        landed: &Landed,
    ) -> bool {
        let stake = Stake::new(tree, leaf, demand);
        let found = weighed(self.row(leaf), look.weights()) * f64::from(self.whole(leaf));
        let missing = landed.missing(leaf, tree.node(leaf).area, found);
        let half_range = f64::from(self.half_range[leaf as usize]).max(missing);
        half_range * stake.split > 1.0 && stake.may_split
    }

    /// Gathers at all new leaves, each rank of the team at its own, and splits them until direct light varies less than the demand allows.
    /// By a quadrature rule, no patch may misplace more than `coarsest` (share of white) of a leaf's light, however small the leaf: all
    /// small leaves would err alike.
    pub(super) fn refine(
        &mut self,
        tree: &mut Tree,
        demand: &Demand,
        coarsest: f64,
        look: &impl LeafSampler,
        (team, interrupt): (Team, &Interrupt),
    ) -> Result<(), Interrupted> {
        let mut open: Vec<u32> = tree.leaves().collect();
        self.width = look.weights().len();
        for k in 0..self.place.len() {
            if !tree.nodes[k].is_leaf() {
                self.forget(k);
            }
        }
        while !open.is_empty() {
            self.place.resize(tree.nodes.len(), NONE);
            self.half_range.resize(tree.nodes.len(), 0.0);
            self.whole.resize(tree.nodes.len(), 1.0);
            self.with_openness.resize(tree.nodes.len(), 0.0);
            let landed = look.landed(tree);
            let stake = |leaf: u32| {
                let stake = Stake::new(tree, leaf, demand);
                let tiny = stake.tiny && !landed.matters(leaf);
                Stake { tiny, ..stake }
            };
            let fresh: Vec<(u32, Stake)> = (open.iter())
                .map(|&leaf| (leaf, stake(leaf)))
                .filter(|(leaf, stake)| {
                    let k = *leaf as usize;
                    self.place[k] == NONE || f64::from(-self.half_range[k]) * stake.split > 1.0
                })
                .collect();
            let chunks: Vec<&[(u32, Stake)]> = fresh.chunks(CHUNK).collect();
            let gather = |memory: &mut Memory, chunk: &&[(u32, Stake)]| {
                let (mut found, before) = (LeafSamples::default(), memory.rays);
                for &(leaf, ref stake) in *chunk {
                    let mean = if look.by_chance() {
                        by_chance(tree, leaf, look, stake, memory)
                    } else {
                        let tolerance = stake.tolerance.min(coarsest);
                        by_rule(tree, leaf, look, tolerance, stake.tiny, memory)
                    };
                    mean.end(&mut found, look.weights().len());
                }
                found.rays = memory.rays - before;
                found
            };
            let parts = team.map_unless(interrupt, &chunks, Memory::default, gather)?;
            for (part, leaves) in parts.iter().zip(fresh.chunks(CHUNK)) {
                self.rays += part.rays;
                for (k, &(leaf, _)) in leaves.iter().enumerate() {
                    let row = &part.rows[k * self.width..(k + 1) * self.width];
                    let figures = [part.half_range[k], part.whole[k], part.with_openness[k]];
                    self.put(leaf, row, figures);
                    self.keep_trace(leaf, part.traces[k].as_deref());
                }
            }
            let split: Vec<u32> = (open.into_iter())
                .filter(|&leaf| self.is_uneven((tree, leaf), demand, look, &landed))
                .collect();
            open = Vec::new();
            for leaf in split {
                // The leaf on the other side of a sheet is split together with this one.
                if !tree.node(leaf).is_leaf() {
                    continue;
                }
                tree.subdivide(leaf);
                for node in [leaf, tree.behind(leaf)] {
                    if node != NONE {
                        self.forget(node as usize);
                        open.extend(tree.node(node).child_range());
                    }
                }
            }
        }
        Ok(())
    }
}

/// What a leaf's direct light matters for.
struct Stake {
    /// A range of one white, as a multiple of the range that splits the leaf.
    split: f64,
    /// One white on the leaf, as a multiple of what it may misplace of all light.
    flux: f64,
    /// What a patch may misplace at a point, share of white: enough to tell whether the leaf should be split.
    tolerance: f64,
    /// Is the leaf large enough to be split?
    may_split: bool,
    /// Is the leaf next to nothing of the room?
    tiny: bool,
}

impl Stake {
    pub(crate) fn new(tree: &Tree, leaf: u32, demand: &Demand) -> Self {
        let node = tree.node(leaf);
        let sensitivity = demand
            .sensitivity
            .get(leaf as usize)
            .copied()
            .unwrap_or(1.0);
        let share = tree.share(leaf).max(LEAST_SHARE);
        let depth = tree.elements[node.element as usize].depth;
        Self {
            split: f64::from(sensitivity) * share.sqrt() / demand.threshold,
            // The white is twice the mean.
            flux: share / (0.5 * FLUX_SHARE),
            tolerance: NOISE * demand.threshold / share.sqrt(),
            may_split: node.area > demand.least_area && depth < MAX_DEPTH,
            tiny: share < TINY,
        }
    }

    /// How many points tell whether light is even on a leaf of which no place is brighter than `most`: what they miss covers less of the leaf
    /// than one of them stands for.
    fn deciding(&self, most: f64) -> usize {
        let wanted = 3.0 * (most * self.split / MISSED).powi(2);
        let wanted = (wanted as usize).clamp(RANDOM[1], DECIDING);
        wanted.next_power_of_two()
    }
}

/// How direct light is gathered at points of leaves.
pub(crate) trait LeafSampler: Sync {
    /// What turns a row into brightness, share of white.
    fn weights(&self) -> &[f64];
    /// Direct light at a point; none where something covers it.
    fn direct(
        &self,
        tree: &Tree,
        to: &Receiver,
        tolerance: f64,
        memory: &mut Memory,
    ) -> Option<[f32; 64]>;
    /// Rough greatest brightness of direct light on a leaf if nothing were in its way, share of white.
    fn unshadowed(&self, tree: &Tree, leaf: u32, tolerance: f64) -> f64;
    /// Where rays from lamps land on the leaves.
    fn landed(&self, tree: &Tree) -> Landed;
    /// Are leaves gathered at random points and weighted by openness?
    fn by_chance(&self) -> bool;
    /// How open a point of a leaf is, found from a few rays: the share of them that meet fronts, and of those that do so further away
    /// than close by.
    fn openness(&self, tree: &Tree, to: &Receiver, memory: &mut Memory) -> [f32; 2];
}

/// A point of a leaf.
pub(super) fn receiver(tree: &Tree, leaf: u32, at: [f64; 3], seed: u64) -> Receiver {
    let element = &tree.elements[tree.node(leaf).element as usize];
    let entry = element.face as usize;
    Receiver {
        point: element.at(at),
        normal: tree.face_normal[entry],
        plane: tree.face_plane[entry],
        leaf: Some(leaf),
        seed,
    }
}

/// Mean over the points of a quadrature rule; where one is covered, others until enough are found or the leaf counts as
/// covered. A face that is next to nothing of the room (`tiny`) has one point: it is never split, and its pattern is not
/// seen.
fn by_rule(
    tree: &Tree,
    leaf: u32,
    look: &impl LeafSampler,
    tolerance: f64,
    tiny: bool,
    memory: &mut Memory,
) -> Mean {
    let mut mean = Mean::new();
    let wanted = if tiny { 1 } else { POINTS.len() };
    let first = if tiny { &MIDDLE } else { &POINTS[..] };
    let more = (0..MORE_POINTS).map(|k| {
        let at = stratified(k, MORE_POINTS, [0.5, 0.5]);
        (at, 1.0 / POINTS.len() as f64)
    });
    for (k, (at, weight)) in first.iter().copied().chain(more).enumerate() {
        if mean.points == wanted {
            break;
        }
        let to = receiver(tree, leaf, at, u64::from(leaf) << 4 | k as u64);
        if let Some(row) = look.direct(tree, &to, tolerance, memory) {
            mean.add(&row, [weight as f32; 2], look.weights(), memory);
        }
    }
    mean.half_range = mean.half_range();
    // By the rule, the whole leaf is as bright as its uncovered points.
    mean.bright[1] = mean.bright[0] / f64::from(mean.total.max(f32::MIN_POSITIVE));
    mean.points = 1;
    mean
}

/// Mean over random points, each weighted by how `open` it is.
///
/// Their number follows from the light without shadows: were more taken where the first are bright, places that are bright
/// here and there would come out too dark. For the same reason the points that decide whether the leaf is split are left out
/// of the mean: leaves that stay would be those on which few points found light to be even.
fn by_chance(
    tree: &Tree,
    leaf: u32,
    look: &impl LeafSampler,
    stake: &Stake,
    memory: &mut Memory,
) -> Mean {
    let shift = hash(u64::from(leaf), 3);
    // The tolerance, also for what would be a share of all light that matters.
    let tolerance = stake.tolerance.min(1.0 / stake.flux);
    let mut gather = |mean: &mut Mean, points: Range<usize>| {
        for k in points {
            let at = triangle_weights(sequence02(k as u32, shift));
            let to = receiver(tree, leaf, at, u64::from(leaf) << 9 | k as u64);
            if let Some(row) = look.direct(tree, &to, tolerance, memory) {
                let [open, far] = look.openness(tree, &to, memory);
                let weights = [open.max(UNSEEN), far];
                mean.add(&row, weights, look.weights(), memory);
            }
        }
    };
    let mut mean = Mean::new();
    if stake.tiny {
        // It is never split.
        gather(&mut mean, 0..RANDOM[0]);
        return mean;
    }
    let most = look.unshadowed(tree, leaf, tolerance);
    // Errors fall with the power 3/4 of the number of points.
    let enough = (most * stake.flux).powf(4.0 / 3.0).ceil() as usize;
    let count = enough.clamp(RANDOM[0], RANDOM[2]).next_power_of_two();
    if most * stake.split <= 1.0 {
        gather(&mut mean, 0..count);
        return mean.ranging(-most, most);
    }
    // Points beyond those that the mean may use: as many again for as long as they find light to be even.
    let (wanted, mut decide) = (stake.deciding(most), Mean::new());
    let mut points = 0..RANDOM[1];
    while points.start < wanted {
        gather(
            &mut decide,
            RANDOM[2] + points.start..RANDOM[2] + points.end,
        );
        // Half the range of a uniform distribution of this variance.
        decide.half_range = (3.0 * decide.variance()).sqrt();
        if stake.may_split && decide.half_range * stake.split > 1.0 {
            return decide;
        }
        points = points.end..2 * points.end;
    }
    gather(&mut mean, 0..count.max(RANDOM[1]));
    mean.ranging(decide.half_range, most)
}

#[cfg(test)]
mod tests;
