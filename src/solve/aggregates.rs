//! The coarse step of the solve: some tens of large patches that take part as wholes.
//!
//! Conjugate gradients on `(1 - K) y = b` are slow where light finds its level slowly: in long rooms and behind doors,
//! with bright walls. There the error is nearly constant on large patches. So with `z_a = root` on the leaves of an
//! aggregate (constant irradiance on it) and the Galerkin matrix `E_ab = z_a . (1 - K) z_b` of each lane,
//!
//! ```text
//! M^-1 = 1 + Z (E^-1 - W^-1) Z^T,    W = Z^T Z (diagonal)
//! ```
//!
//! solves that part at once and leaves alone what is at right angles to it: symmetric, positive definite, no application
//! of the operator (two-level additive Schwarz; Dryja and Widlund 1987, Nicolaides 1987 for the coarse space). The
//! matrix takes one pass over the links: a link inside two aggregates carries the mean of what their leaves reflect, one
//! that lies above them is shared out among those below.
//!
//! Aggregates hold only leaves that exchange light, over whatever detours: what is dark stays exactly dark.

use super::operator::Operator;
use super::rows::Rows;
use crate::hierarchy::{NONE, Tree};
use crate::link::LinkRows;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// Aggregates at the most.
const MOST: usize = 64;

/// Aggregates and their solved matrices.
pub(super) struct Aggregates {
    /// Places of the leaves of each aggregate.
    members: Vec<Vec<u32>>,
    /// By lane; none where nothing is reflected.
    lanes: Vec<Option<Lane>>,
}

/// The coarse system of one lane, each aggregate scaled to `W = 1`.
struct Lane {
    /// Aggregates that reflect.
    some: Vec<usize>,
    /// `1 / sqrt(W)`, of those.
    scale: Vec<f64>,
    solved: Cholesky<f64, Dyn>,
}

impl Aggregates {
    /// Chooses aggregates and builds their matrices. `root` is `sqrt(rho A)`.
    pub(super) fn new<const L: usize>(
        operator: &Operator,
        reflectance: &Rows,
        root: &Rows,
        scratch: &mut Rows,
    ) -> Self {
        let tree = operator.tree;
        // Solving the matrices should not cost more than a few passes over the links.
        let most = ((3 * operator.links.len()) as f64).cbrt() as usize;
        let cut = Cut::new(tree, operator.links, most.min(MOST));
        let count = cut.aggregates.len();
        let mut members = vec![Vec::new(); count];
        for (place, &leaf) in operator.leaves.iter().enumerate() {
            let of = cut.of[leaf as usize];
            if (of as usize) < count {
                members[of as usize].push(place as u32);
            }
        }
        let matrix = operator.aggregate::<L>(&cut, reflectance, scratch);
        let norms: Vec<[f64; L]> = members
            .par_iter()
            .map(|members| {
                let mut sum = [0.0; L];
                for &k in members {
                    let row = root.row(k as usize);
                    for (s, r) in sum.iter_mut().zip(row) {
                        *s += f64::from(*r) * f64::from(*r);
                    }
                }
                sum
            })
            .collect();
        let lanes = (0..L)
            .into_par_iter()
            .map(|l| {
                let some: Vec<usize> = (0..count).filter(|&a| norms[a][l] > 0.0).collect();
                let scale: Vec<f64> = some.iter().map(|&a| 1.0 / norms[a][l].sqrt()).collect();
                let matrix = DMatrix::from_fn(some.len(), some.len(), |i, j| {
                    let one = if i == j { 1.0 } else { 0.0 };
                    one - scale[i] * scale[j] * matrix[(some[i] * count + some[j]) * L + l]
                });
                (!some.is_empty())
                    .then(|| Cholesky::new(matrix))
                    .flatten()
                    .map(|solved| Lane {
                        some,
                        scale,
                        solved,
                    })
            })
            .collect();
        Self { members, lanes }
    }

    /// `z = M^-1 r`.
    pub(super) fn precondition<const L: usize>(&self, root: &Rows, r: &Rows, z: &mut Rows) {
        let sums: Vec<[f64; L]> = self
            .members
            .par_iter()
            .map(|members| {
                let mut sum = [0.0; L];
                for &k in members {
                    add_products(&mut sum, root.row(k as usize), r.row(k as usize));
                }
                sum
            })
            .collect();
        let mut shift = vec![[0.0_f32; L]; sums.len()];
        for (l, lane) in self.lanes.iter().enumerate() {
            let Some(lane) = lane else { continue };
            let before = DVector::from_fn(lane.some.len(), |i, _| {
                lane.scale[i] * sums[lane.some[i]][l]
            });
            let after = lane.solved.solve(&before);
            for (i, &a) in lane.some.iter().enumerate() {
                shift[a][l] = (lane.scale[i] * (after[i] - before[i])) as f32;
            }
        }
        z.clone_from(r);
        for (members, shift) in self.members.iter().zip(&shift) {
            for &k in members {
                let root = root.row(k as usize);
                for ((z, r), s) in z.row_mut(k as usize).iter_mut().zip(root).zip(shift) {
                    *z += r * s;
                }
            }
        }
    }
}

/// `sum += x y`, of slices: of arrays the compiler makes single numbers.
#[inline(never)]
fn add_products(sum: &mut [f64], x: &[f32], y: &[f32]) {
    for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
        *s += f64::from(*x) * f64::from(*y);
    }
}

/// A cut through the hierarchy: aggregates, and the nodes above them.
pub(super) struct Cut {
    /// Nodes that are aggregates, ascending.
    pub aggregates: Vec<u32>,
    /// Nodes above them, ascending.
    pub above: Vec<u32>,
    /// For each node its place in `aggregates` followed by `above`; of nodes below an aggregate, that of the aggregate.
    /// [`NONE`] for what is in no aggregate.
    pub of: Vec<u32>,
}

impl Cut {
    /// Opens the largest node, and every node that holds leaves that have nothing to do with each other.
    fn new(tree: &Tree, links: &LinkRows, most: usize) -> Self {
        let together = together(tree, links);
        let mut open = std::collections::BinaryHeap::new();
        let key = |id: u32| {
            let node = tree.node(id);
            // Positive numbers are in the order of their bits.
            let apart = !together[id as usize];
            (apart, node.area.to_bits(), std::cmp::Reverse(id))
        };
        let (mut aggregates, mut above) = (Vec::new(), Vec::new());
        if most > 0 && !tree.nodes.is_empty() {
            open.push(key(0));
        }
        let mut count = open.len();
        while let Some((apart, _, std::cmp::Reverse(id))) = open.pop() {
            let node = tree.node(id);
            if !node.is_leaf() && count + node.child_range().len() - 1 <= most {
                count += node.child_range().len() - 1;
                above.push(id);
                open.extend(node.child_range().map(key));
            } else if !apart {
                aggregates.push(id);
            }
        }
        aggregates.sort_unstable();
        above.sort_unstable();
        let mut of = vec![NONE; tree.nodes.len()];
        for (k, &id) in aggregates.iter().chain(&above).enumerate() {
            of[id as usize] = k as u32;
        }
        let inside = aggregates.len() as u32;
        for id in 1..of.len() {
            let parent = of[tree.nodes[id].parent as usize];
            if of[id] == NONE && parent < inside {
                of[id] = parent;
            }
        }
        Self {
            aggregates,
            above,
            of,
        }
    }
}

/// Does light get from every leaf of a node to every other, over whatever detours?
fn together(tree: &Tree, links: &LinkRows) -> Vec<bool> {
    let nodes = &tree.nodes;
    let mut parent: Vec<u32> = (0..nodes.len() as u32).collect();
    let find = |parent: &mut [u32], mut k: u32| {
        while parent[k as usize] != k {
            parent[k as usize] = parent[parent[k as usize] as usize];
            k = parent[k as usize];
        }
        k
    };
    let mut linked = vec![false; nodes.len()];
    for k in 0..nodes.len() {
        let row = links.row(k);
        linked[k] =
            !row.is_empty() || (k > 0 && linked[nodes[k].parent as usize]);
        let children = if linked[k] {
            nodes[k].child_range()
        } else {
            0..0
        };
        let others = row.iter().map(|e| e.0).filter(|&other| other as usize > k);
        for other in children.chain(others) {
            let (a, b) = (find(&mut parent, k as u32), find(&mut parent, other));
            // The lesser one stands for both.
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut group: Vec<Option<u32>> = (0..nodes.len() as u32)
        .map(|k| Some(find(&mut parent, k)))
        .collect();
    for k in (0..nodes.len()).rev() {
        let mut children = nodes[k].child_range();
        if let Some(first) = children.next() {
            let of = group[first as usize];
            group[k] = of.filter(|_| children.all(|c| group[c as usize] == of));
        }
    }
    group.iter().map(Option::is_some).collect()
}

impl Operator<'_> {
    /// `Z^T K Z` of the aggregates of a cut, row by row, each entry a row of lanes.
    fn aggregate<const L: usize>(
        &self,
        cut: &Cut,
        reflectance: &Rows,
        scratch: &mut Rows,
    ) -> Vec<f64> {
        let (tree, areas) = (self.tree, self.areas);
        // What a leaf reflects of irradiance 1, as its own links see it and as those of the nodes above do.
        let own = |leaf: u32| self.factor[leaf as usize];
        let seen_above = |leaf: u32| self.factor[leaf as usize];
        let fill = |rows: &mut [[f32; L]], factor: &dyn Fn(u32) -> f32| {
            for (rho, &leaf) in reflectance.all::<L>().iter().zip(self.leaves) {
                let f = factor(leaf);
                rows[leaf as usize] = rho.map(|x| f * x);
            }
        };
        let mean = scratch.all_mut::<L>();
        fill(mean, &seen_above);
        super::operator::pull::<L>(tree, areas, mean);
        // The share that aggregate `a` takes in a link of a node above it.
        let count = cut.aggregates.len();
        let weight: Vec<[f64; L]> = cut
            .aggregates
            .iter()
            .map(|&a| mean[a as usize].map(|m| areas[a as usize] * f64::from(m)))
            .collect();
        fill(mean, &own);
        // Nodes above aggregates reflect as they are shared out below.
        for &id in &cut.above {
            mean[id as usize] = [1.0; L];
        }
        let mean: &[[f32; L]] = mean;
        let all = count + cut.above.len();
        let mut nodes = vec![Vec::new(); all];
        for (id, &of) in cut.of.iter().enumerate() {
            if of != NONE {
                nodes[of as usize].push(id);
            }
        }
        let rows: Vec<Vec<f64>> = nodes
            .par_iter()
            .map(|nodes| {
                let mut sums = vec![0.0; all * L];
                for &id in nodes {
                    for &(source, exchange) in self.links.row(id) {
                        let of = cut.of[source as usize];
                        if of == NONE {
                            continue;
                        }
                        let to = &mut sums[of as usize * L..(of as usize + 1) * L];
                        add_exchange(to, exchange, &mean[id], &mean[source as usize]);
                    }
                }
                sums
            })
            .collect();
        // Each aggregate's shares: itself whole, every node above it in proportion.
        let shares: Vec<Vec<(usize, [f64; L])>> = (0..count)
            .map(|a| {
                let mut list = vec![(a, [1.0; L])];
                let mut id = tree.node(cut.aggregates[a]).parent;
                while id != NONE {
                    let area = areas[id as usize];
                    list.push((cut.of[id as usize] as usize, weight[a].map(|w| w / area)));
                    id = tree.node(id).parent;
                }
                list
            })
            .collect();
        // First the columns, then the rows.
        let half: Vec<Vec<f64>> = rows
            .par_iter()
            .map(|row| {
                let mut out = vec![0.0; count * L];
                for (out, shares) in out.chunks_mut(L).zip(&shares) {
                    for (v, share) in shares {
                        add_scaled(out, share, &row[v * L..(v + 1) * L]);
                    }
                }
                out
            })
            .collect();
        let mut matrix = vec![0.0; count * count * L];
        matrix
            .par_chunks_mut(count * L)
            .zip(&shares)
            .for_each(|(row, shares)| {
                for (v, share) in shares {
                    for (out, from) in row.chunks_mut(L).zip(half[*v].chunks(L)) {
                        add_scaled(out, share, from);
                    }
                }
            });
        matrix
    }
}

/// `sum += g x y`.
#[inline(never)]
fn add_exchange(sum: &mut [f64], g: f32, x: &[f32], y: &[f32]) {
    for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
        *s += f64::from(g * x * y);
    }
}

/// `sum += x y`.
#[inline(never)]
fn add_scaled(sum: &mut [f64], x: &[f64], y: &[f64]) {
    for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
        *s += x * y;
    }
}
