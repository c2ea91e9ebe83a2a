//! The transport operator on rows: pull, gather over the links, push.
//!
//! With `R = rho H` the reflected radiosity, `d` the balance factors and `y = sqrt(A / rho) R`, the radiosity equation
//! `R = rho F (E + R)` becomes `(1 - K) y = b` with the symmetric `K = root F root / A`, `root = d sqrt(rho A)`.
//! One pass costs one multiply-add a link, direction and lane.

use super::rows::Rows;
use crate::hierarchy::Tree;
use crate::link::LinkRows;
use rayon::prelude::*;

/// Nodes that a task gathers; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 256;

/// What the operator needs to know of the patches.
#[derive(Debug)]
pub(super) struct Operator<'a> {
    /// The hierarchy.
    pub tree: &'a Tree,
    /// The links.
    pub links: &'a LinkRows,
    /// Leaves of the hierarchy, ascending.
    pub leaves: &'a [u32],
    /// Area of each node that takes part.
    pub areas: &'a [f64],
    /// Balance factors by node.
    pub factor: &'a [f32],
}

impl Operator<'_> {
    /// Irradiance on the leaves (by leaf) from radiosity on the leaves (by leaf), both balanced.
    /// `nodes` and `gathered` are scratch with a row a node; `nodes` holds every patch's mean radiosity afterwards.
    pub(super) fn irradiance<const L: usize>(
        &self,
        radiosity: &Rows,
        nodes: &mut Rows,
        gathered: &mut Rows,
        out: &mut Rows,
    ) {
        let (from, mean) = (radiosity.all::<L>(), nodes.all_mut::<L>());
        for (row, &leaf) in from.iter().zip(self.leaves) {
            let d = self.factor[leaf as usize];
            mean[leaf as usize] = row.map(|x| d * x);
        }
        pull(self.tree, self.areas, mean);
        let mean = nodes.all::<L>();
        gathered
            .all_mut::<L>()
            .par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(chunk, rows)| {
                for (k, row) in rows.iter_mut().enumerate() {
                    let node = chunk * CHUNK + k;
                    let mut sum = [0.0_f32; L];
                    for &(source, exchange) in self.links.row(node) {
                        let b = &mean[source as usize];
                        for lane in 0..L {
                            sum[lane] += exchange * b[lane];
                        }
                    }
                    let inverse = (1.0 / self.areas[node]) as f32;
                    *row = sum.map(|x| x * inverse);
                }
            });
        push(self.tree, gathered.all_mut::<L>());
        let gathered = gathered.all::<L>();
        for (row, &leaf) in out.all_mut::<L>().iter_mut().zip(self.leaves) {
            let d = self.factor[leaf as usize];
            *row = gathered[leaf as usize].map(|x| d * x);
        }
    }
}

/// Area-weighted means from the leaves to the root.
pub(super) fn pull<const L: usize>(tree: &Tree, areas: &[f64], rows: &mut [[f32; L]]) {
    for (k, node) in tree.nodes.iter().enumerate().rev() {
        if node.is_leaf() {
            continue;
        }
        let mut mean = [0.0_f32; L];
        for child in node.child_range() {
            let share = (areas[child as usize] / areas[k]) as f32;
            for (m, x) in mean.iter_mut().zip(&rows[child as usize]) {
                *m += share * x;
            }
        }
        rows[k] = mean;
    }
}

/// Adds what each patch got to everything below it.
fn push<const L: usize>(tree: &Tree, rows: &mut [[f32; L]]) {
    for k in 1..tree.nodes.len() {
        let above = rows[tree.nodes[k].parent as usize];
        for (x, a) in rows[k].iter_mut().zip(above) {
            *x += a;
        }
    }
}
