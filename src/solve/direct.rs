//! Light straight from lamps, of any kind, on the hierarchy: gathered exactly at points of every leaf, never linked.
//!
//! Leaves over which direct light varies are split, which is where shadow boundaries and hot spots are; links then only
//! carry reflected light, which is smooth. What a leaf got stays known for the rounds after.

use crate::gather::point::{Memory, Receiver};
use crate::gather::trace::Trace;
use crate::hierarchy::{NONE, Tree, stratified};
use crate::link::{Demand, MAX_DEPTH};
use rayon::prelude::*;
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
/// Leaves below this share of all area are looked at from one point.
const TINY: f64 = 1e-5;
/// Further points that are tried where some are covered.
const MORE_POINTS: usize = 8;
/// Error of a leaf's direct light, in what would split the leaf.
const NOISE: f64 = 0.1;
/// Leaves that a task looks at.
const CHUNK: usize = 32;

/// What was found at some leaves, in order.
#[derive(Debug, Default)]
struct Found {
    /// Mean rows.
    rows: Vec<f32>,
    /// Half the range of brightness over a leaf's points.
    spread: Vec<f32>,
    /// Where the light comes from, if that is kept.
    traces: Vec<Option<Box<[u8]>>>,
    rays: u64,
}

/// Direct irradiance of nodes that are or were leaves.
#[derive(Debug, Clone, Default)]
pub(super) struct Direct {
    /// Lanes of a row.
    width: usize,
    /// Place of each node's row; [`NONE`] where it is not known.
    place: Vec<u32>,
    /// Rows by place.
    rows: Vec<f32>,
    /// Places whose rows are not asked for any more.
    free: Vec<u32>,
    /// Half the range of brightness over a leaf's points.
    spread: Vec<f32>,
    /// Where each leaf's light comes from: a stretch of `bytes`; empty unless it is kept. What belonged to leaves that were
    /// split stays among the bytes: each level below is four times as many.
    traces: Vec<Range<usize>>,
    bytes: Vec<u8>,
    /// Rays cast so far.
    pub(super) rays: u64,
}

impl Direct {
    /// What is known of `leaves`, as it was before it was written down: a row of `width` lanes and a spread each.
    pub(super) fn known(
        leaves: &[u32],
        nodes: usize,
        width: usize,
        rows: &[f32],
        spread: &[f32],
    ) -> Self {
        let mut known = Self {
            width,
            place: vec![NONE; nodes],
            rows: rows.to_vec(),
            spread: vec![0.0; nodes],
            ..Self::default()
        };
        for (k, &leaf) in leaves.iter().enumerate() {
            known.place[leaf as usize] = k as u32;
            known.spread[leaf as usize] = spread[k];
        }
        known
    }

    /// Where the light of leaves comes from, as it was before it was written down.
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

    /// Where a leaf's light comes from (see `gather::trace`), if that is kept.
    pub(super) fn trace(&self, leaf: u32) -> Option<&[u8]> {
        let stretch = self.traces.get(leaf as usize)?.clone();
        (!stretch.is_empty()).then(|| &self.bytes[stretch])
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.place.as_slice())
            + size_of_val(self.rows.as_slice())
            + size_of_val(self.free.as_slice())
            + size_of_val(self.spread.as_slice())
            + size_of_val(self.traces.as_slice())
            + self.bytes.len()
    }

    /// Half the range of brightness over a leaf's points.
    pub(super) fn spread(&self, leaf: u32) -> f32 {
        self.spread[leaf as usize]
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
    fn put(&mut self, leaf: u32, row: &[f32], spread: f32) {
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
        self.spread[leaf as usize] = spread;
    }

    /// What was a leaf and is none any more asks for no memory.
    fn forget(&mut self, node: usize) {
        let place = std::mem::replace(&mut self.place[node], NONE);
        self.free.extend(Some(place).filter(|&place| place != NONE));
        if let Some(trace) = self.traces.get_mut(node) {
            *trace = 0..0;
        }
    }

    /// Rows on other lanes: each new lane takes what the lane at its place held.
    pub(super) fn relabel(&mut self, places: &[usize]) {
        if self.width > 0 {
            let rows = self.rows.chunks(self.width);
            self.rows = rows
                .flat_map(|row| places.iter().map(|&k| row[k]))
                .collect();
            self.width = places.len();
        }
    }

    /// Gathers at all new leaves and splits them until direct light varies less than the demand allows.
    /// No patch may misplace more than `coarsest` (share of white) of a leaf's light, however small the leaf: all small
    /// leaves would err alike. `weights` turn a row into brightness, share of white; `gather` gives none for a point that something covers.
    pub(super) fn refine(
        &mut self,
        tree: &mut Tree,
        demand: &Demand,
        weights: &[f64],
        coarsest: f64,
        gather: &(impl Fn(&Tree, &Receiver, f64, &mut Memory) -> Option<[f32; 64]> + Sync),
    ) {
        let mut open: Vec<u32> = tree.leaves().collect();
        self.width = weights.len();
        for k in 0..self.place.len() {
            if !tree.nodes[k].is_leaf() {
                self.forget(k);
            }
        }
        while !open.is_empty() {
            self.place.resize(tree.nodes.len(), NONE);
            self.spread.resize(tree.nodes.len(), 0.0);
            let fresh: Vec<u32> = open
                .iter()
                .copied()
                .filter(|&k| self.place[k as usize] == NONE)
                .collect();
            let parts: Vec<Found> = fresh
                .par_chunks(CHUNK)
                .map(|chunk| {
                    let (mut memory, mut found) = (Memory::default(), Found::default());
                    for &leaf in chunk {
                        // What would split the leaf is what it has to be told from.
                        let share = (tree.node(leaf).area / demand.total_area).sqrt();
                        at_leaf(
                            tree,
                            leaf,
                            weights,
                            (NOISE * demand.threshold / share).min(coarsest),
                            share * share < TINY,
                            gather,
                            &mut memory,
                            &mut found,
                        );
                    }
                    found.rays = memory.rays;
                    found
                })
                .collect();
            for (part, leaves) in parts.iter().zip(fresh.chunks(CHUNK)) {
                self.rays += part.rays;
                for (k, &leaf) in leaves.iter().enumerate() {
                    let row = &part.rows[k * self.width..(k + 1) * self.width];
                    self.put(leaf, row, part.spread[k]);
                    self.keep_trace(leaf, part.traces[k].as_deref());
                }
            }
            let mut children = Vec::new();
            for leaf in open {
                let node = tree.node(leaf);
                let depth = tree.elements[node.element as usize].depth;
                let keen = demand.keen.get(leaf as usize).copied().unwrap_or(1.0);
                let error = f64::from(self.spread[leaf as usize] * keen)
                    * (node.area / demand.total_area).sqrt();
                if error > demand.threshold && node.area > demand.least_area && depth < MAX_DEPTH {
                    tree.subdivide(leaf);
                    self.forget(leaf as usize);
                    children.extend(tree.node(leaf).child_range());
                }
            }
            open = children;
        }
    }
}

/// Finds the mean row over the points of a leaf, and half the range of brightness.
#[expect(clippy::too_many_arguments, reason = "one caller")]
fn at_leaf(
    tree: &Tree,
    leaf: u32,
    weights: &[f64],
    tolerance: f64,
    tiny: bool,
    gather: &(impl Fn(&Tree, &Receiver, f64, &mut Memory) -> Option<[f32; 64]> + Sync),
    memory: &mut Memory,
    found: &mut Found,
) {
    let element = &tree.elements[tree.node(leaf).element as usize];
    let entry = element.face as usize;
    let mut mean = [0.0_f32; 64];
    let mean = &mut mean[..weights.len()];
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    let mut bare = 0;
    // A face that is next to nothing of the room is looked at once: it is never split, and its pattern is not seen.
    let wanted = if tiny { 1 } else { POINTS.len() };
    let first = if tiny { &MIDDLE } else { &POINTS[..] };
    // The points of the rule; where one is covered, others until enough are found or the leaf counts as covered.
    let more = (0..MORE_POINTS).map(|k| {
        (
            stratified(k, MORE_POINTS, [0.5, 0.5]),
            1.0 / POINTS.len() as f64,
        )
    });
    let mut total = 0.0_f32;
    let mut kept: Option<Trace> = None;
    for (k, (at, weight)) in first.iter().copied().chain(more).enumerate() {
        if bare == wanted {
            break;
        }
        let to = Receiver {
            point: element.at(at),
            normal: tree.face_normal[entry],
            plane: tree.face_plane[entry],
            leaf: Some(leaf),
            seed: u64::from(leaf) << 4 | k as u64,
        };
        let Some(row) = gather(tree, &to, tolerance, memory) else {
            continue;
        };
        bare += 1;
        total += weight as f32;
        if let Some(trace) = memory.trace.take() {
            kept.get_or_insert_with(Trace::new)
                .absorb(&trace, weight as f32);
        }
        let mut bright = 0.0;
        for ((m, x), w) in mean.iter_mut().zip(row).zip(weights) {
            *m += weight as f32 * x;
            bright += f64::from(x) * w;
        }
        least = least.min(bright);
        most = most.max(bright);
    }
    if total > 0.0 {
        for m in &mut *mean {
            *m /= total;
        }
    }
    found.rows.extend_from_slice(mean);
    found.spread.push((0.5 * (most - least).max(0.0)) as f32);
    found
        .traces
        .push(kept.map(|trace| trace.times(1.0 / total).pack()));
}
