//! What sweeps over all leaves would find slowly, found on few patches: the two-grid method for equations of the second
//! kind (Atkinson 1976; Hackbusch, Multi-Grid Methods and Applications, 1985, chapter 16).
//!
//! A sweep turns R into `G(R) = rho (f + K R)` and leaves the error e, `e = d + A e` with the change `d = G(R) - R` and
//! `A = rho K`. So the solution is `G(R) + A e`, and of `A e = rho (K e)` the part in brackets is smooth: it is worked out
//! on a cut of the hierarchy, `u = K_c e_c`, `e_c = d_c + rho_c u` (means over patches, K_c from the same rays), and every
//! leaf reflects its patch's u. What the cut gets wrong the next sweep finds; the sweeps alone say when it is enough.

use super::outlook::Outlook;
use super::rows::Rows;
use crate::hierarchy::{NONE, Tree};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Patches of the cut at the most.
const PATCHES: usize = 512;
/// Sweeps over the cut at the most, and the relative change after which no more are worth while: the cut errs by more.
const SWEEPS: usize = 100;
const ENOUGH: f64 = 0.02;

/// The cut, and who sees whom on it.
pub(super) struct TwoGrid {
    /// Patch of each leaf, by leaf.
    patch: Vec<u32>,
    /// Bare area of each patch.
    areas: Vec<f64>,
    /// For each patch, which patches its rays met and their shares.
    seen: Vec<Vec<(u32, f32)>>,
}

impl TwoGrid {
    /// Sums what the rays of the leaves met.
    pub(super) fn new(tree: &Tree, outlook: &Outlook, leaves: &[u32], areas: &[f64]) -> Self {
        let of_node = cut(tree, PATCHES);
        let patch: Vec<u32> = leaves.iter().map(|&k| of_node[k as usize]).collect();
        let count = patch.iter().map(|&p| p as usize + 1).max().unwrap_or(0);
        let mut members = vec![Vec::new(); count];
        for (&leaf, &p) in leaves.iter().zip(&patch) {
            members[p as usize].push(leaf);
        }
        let (areas, seen) = members
            .par_iter()
            .map(|members| {
                let (mut sums, mut area) = (vec![0.0_f64; count], 0.0);
                for &leaf in members {
                    let (met, bare) = outlook.met(leaf);
                    area += areas[leaf as usize];
                    let each = areas[leaf as usize] / f64::from(bare);
                    for &node in met.iter().filter(|&&node| node != NONE) {
                        if let Some(sum) = sums.get_mut(of_node[node as usize] as usize) {
                            *sum += each;
                        }
                    }
                }
                let row = (0_u32..).zip(sums).filter(|&(_, sum)| sum > 0.0);
                let row = row.map(|(k, sum)| (k, (sum / area) as f32)).collect();
                (area, row)
            })
            .unzip();
        Self { patch, areas, seen }
    }

    /// A sum for each patch, of nothing yet.
    pub(super) fn sums<const L: usize>(&self) -> Vec<[f64; L]> {
        vec![[0.0; L]; self.areas.len()]
    }

    /// Adds the row of the `k`-th leaf, times its area.
    pub(super) fn add<const L: usize>(
        &self,
        k: usize,
        area: f64,
        row: &[f32; L],
        sums: &mut [[f64; L]],
    ) {
        for (s, x) in sums[self.patch[k] as usize].iter_mut().zip(row) {
            *s += area * f64::from(*x);
        }
    }

    /// Means over the patches.
    pub(super) fn means<const L: usize>(&self, sums: &[[f64; L]]) -> Rows {
        let mut means = Rows::zero(self.areas.len(), L);
        let rows = means.all_mut::<L>().iter_mut();
        for ((mean, sum), area) in rows.zip(sums).zip(&self.areas) {
            *mean = sum.map(|s| (s / area) as f32);
        }
        means
    }

    /// Adds to what leaves reflect what the error after a sweep sends them. `change` is the mean change by the sweep,
    /// `mean_reflectance` that of each patch, `fair` what each lane's irradiance is multiplied by.
    pub(super) fn correct<const L: usize>(
        &self,
        change: &Rows,
        mean_reflectance: &Rows,
        fair: &[f32; L],
        reflectance: &Rows,
        reflected: &mut Rows,
    ) {
        let mut error = change.clone();
        let mut sent = Rows::zero(self.areas.len(), L);
        for _ in 0..SWEEPS {
            let (mut moved, mut total) = ([0.0_f64; L], [0.0_f64; L]);
            for (k, row) in self.seen.iter().enumerate() {
                let mut sum = [0.0_f32; L];
                let from = error.all::<L>();
                for &(source, share) in row {
                    for (s, x) in sum.iter_mut().zip(&from[source as usize]) {
                        *s += share * x;
                    }
                }
                let (d, rho) = (&change.all::<L>()[k], &mean_reflectance.all::<L>()[k]);
                let e = &mut error.all_mut::<L>()[k];
                let u = &mut sent.all_mut::<L>()[k];
                for l in 0..L {
                    u[l] = fair[l] * sum[l];
                    let next = d[l] + rho[l] * u[l];
                    moved[l] += self.areas[k] * f64::from((next - e[l]).abs());
                    total[l] += self.areas[k] * f64::from(next.abs());
                    e[l] = next;
                }
            }
            if (0..L).all(|l| moved[l] <= ENOUGH * total[l]) {
                break;
            }
        }
        let sent = sent.all::<L>();
        reflected
            .all_mut::<L>()
            .par_iter_mut()
            .zip(reflectance.all::<L>())
            .zip(&self.patch)
            .for_each(|((r, rho), &p)| {
                for ((r, rho), u) in r.iter_mut().zip(rho).zip(&sent[p as usize]) {
                    // Too much of a correction must not make light negative.
                    *r = (*r + rho * u).max(0.0);
                }
            });
    }
}

/// Patch of each node at and below the cut; [`NONE`] above. Clusters of several planes are opened first, then what is
/// largest.
fn cut(tree: &Tree, patches: usize) -> Vec<u32> {
    let key = |id: u32| {
        let node = tree.node(id);
        // Areas are positive: their bits stand in their order.
        (!node.flat, node.area.to_bits(), Reverse(id))
    };
    let mut open = BinaryHeap::from([(key(0), 0)]);
    let mut patch = vec![NONE; tree.nodes.len()];
    let mut count = 0;
    while let Some((_, id)) = open.pop() {
        let children = tree.node(id).child_range();
        if children.is_empty() || count + open.len() + children.len() > patches {
            patch[id as usize] = count as u32;
            count += 1;
        } else {
            open.extend(children.map(|child| (key(child), child)));
        }
    }
    for id in 1..patch.len() {
        if patch[id] == NONE {
            patch[id] = patch[tree.nodes[id].parent as usize];
        }
    }
    patch
}
