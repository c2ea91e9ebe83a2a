//! The coarse step of the solve: some tens of large aggregates of patches, each treated as a whole.
//!
//! Conjugate gradients on `(1 - K) y = b` are slow where light spreads slowly: in long rooms and behind doors, with
//! bright walls. There the error is nearly constant on large patches. So with `z_a = root` on the leaves of an
//! aggregate (constant irradiance on it) and the Galerkin matrix `E_ab = z_a . (1 - K) z_b` of each lane,
//!
//! ```text
//! M^-1 = 1 + Z (E^-1 - W^-1) Z^T,    W = Z^T Z (diagonal)
//! ```
//!
//! solves that part at once and leaves what is orthogonal to it unchanged: symmetric, positive definite, no application
//! of the operator (two-level additive Schwarz; Dryja and Widlund 1987, Nicolaides 1987 for the coarse space). The
//! matrix takes one pass over the links: a link between nodes inside aggregates carries what their leaves reflect on
//! average; a link of a node that lies above is shared out among the aggregates below.
//!
//! In a corridor of 40 x 3 x 2 m and albedo .99, 24 iterations become 8, in a room of 4 x 3 x 5 m 12 become 7. A matrix
//! costs as much as 3 to 10 iterations, the more the fewer lanes there are.
//!
//! Aggregates hold only leaves that exchange light, however indirectly: what is dark stays exactly dark.

use super::operator::{Operator, pull};
use super::sums::add_products;
use crate::hierarchy::{NONE, Tree};
use crate::light::rows::Rows;
use crate::link::LinkRows;
use glam::DVec3;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Aggregates at the most.
const MOST: usize = 64;
/// Nodes of the cut for each aggregate, at the most.
const PIECES: usize = 8;

/// Aggregates and their solved matrices.
pub(crate) struct Aggregates {
    /// Positions of the leaves of each aggregate.
    members: Vec<Vec<u32>>,
    /// By lane; none where nothing is reflected.
    lanes: Vec<Option<Lane>>,
}

/// The coarse system of one lane, each aggregate scaled to `W = 1`.
struct Lane {
    /// Aggregates that reflect.
    some: Vec<usize>,
    /// `1 / sqrt(W)` of those aggregates.
    scale: Vec<f64>,
    solved: Cholesky<f64, Dyn>,
}

impl Aggregates {
    /// Chooses aggregates and builds their matrices. `root` is `sqrt(rho A)`.
    pub(crate) fn new<const L: usize>(
        operator: &Operator,
        reflectance: &Rows,
        root: &Rows,
        scratch: &mut Rows,
    ) -> Self {
        let tree = operator.tree;
        // Solving the matrices should not cost more than a few passes over the links.
        let most = ((3 * operator.links.len()) as f64).cbrt() as usize;
        let parts = Parts::new(tree, operator.links, most.min(MOST));
        let count = parts.count;
        if count == 0 {
            return Self {
                members: Vec::new(),
                lanes: Vec::new(),
            };
        }
        let mut members = vec![Vec::new(); count];
        for (place, &leaf) in operator.leaves.iter().enumerate() {
            let of = parts.of[leaf as usize] as usize;
            if of < count {
                members[of].push(place as u32);
            }
        }
        let matrix = operator.aggregate::<L>(&parts, reflectance, scratch);
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

/// The hierarchy divided among aggregates: each holds some nodes of a cut, close together.
pub(crate) struct Parts {
    /// How many aggregates.
    pub count: usize,
    /// Nodes above the cut, ascending.
    pub above: Vec<u32>,
    /// For each node its aggregate; [`NONE`] above the cut, and for nodes in no aggregate.
    pub of: Vec<u32>,
}

impl Parts {
    /// Cuts the hierarchy, then bisects the nodes of the cut along their longest extent. Aggregates need not be nodes:
    /// a long triangle has long children, but children beside each other make up a short piece of a corridor.
    pub(crate) fn new(tree: &Tree, links: &LinkRows, most: usize) -> Self {
        let groups = groups(tree, links);
        let mut open = std::collections::BinaryHeap::new();
        // Positive numbers sort by their bits. Nodes whose leaves do not all exchange light are opened first.
        let key = |id: u32| {
            let apart = groups[id as usize] == NONE;
            (apart, tree.node(id).radius.to_bits(), Reverse(id))
        };
        open.push(key(0));
        let (mut pieces, mut above) = (Vec::new(), Vec::new());
        let mut count = 1;
        while let Some((apart, _, Reverse(id))) = open.pop() {
            let children = tree.node(id).child_range();
            if !children.is_empty() && count + children.len() - 1 <= PIECES * most {
                count += children.len() - 1;
                above.push(id);
                open.extend(children.map(key));
            } else if !apart {
                pieces.push(id);
            }
        }
        above.sort_unstable();
        pieces.sort_unstable_by_key(|&id| (groups[id as usize], id));
        let mut parts: Vec<Part> = pieces
            .chunk_by(|&a, &b| groups[a as usize] == groups[b as usize])
            .map(|ids| Part::new(tree, ids.to_vec()))
            .collect();
        parts.sort_by(|a, b| b.area.total_cmp(&a.area));
        parts.truncate(most);
        while parts.len() < most {
            let Some(longest) = (0..parts.len())
                .filter(|&k| parts[k].pieces.len() > 1)
                .max_by(|&a, &b| parts[a].length.total_cmp(&parts[b].length))
            else {
                break;
            };
            let [one, other] = parts.swap_remove(longest).halves(tree);
            parts.extend([one, other]);
        }
        let mut of = vec![NONE; tree.nodes.len()];
        for (k, part) in parts.iter().enumerate() {
            for &id in &part.pieces {
                of[id as usize] = k as u32;
            }
        }
        tree.inherit(&mut of);
        Self {
            count: parts.len(),
            above,
            of,
        }
    }
}

/// Nodes close together.
struct Part {
    pieces: Vec<u32>,
    area: f64,
    /// Longest extent of the centres of these nodes, and its axis.
    length: f64,
    axis: usize,
}

impl Part {
    pub(crate) fn new(tree: &Tree, pieces: Vec<u32>) -> Self {
        let centres = || pieces.iter().map(|&id| tree.node(id).centre);
        let low = centres().fold(DVec3::INFINITY, DVec3::min);
        let high = centres().fold(DVec3::NEG_INFINITY, DVec3::max);
        let axis = (high - low).max_position();
        Self {
            area: pieces.iter().map(|&id| tree.node(id).area).sum(),
            length: (high - low)[axis],
            axis,
            pieces,
        }
    }

    /// Two parts of about the same area, each of one node at least.
    fn halves(mut self, tree: &Tree) -> [Self; 2] {
        let place = |&id: &u32| tree.node(id).centre[self.axis];
        self.pieces
            .sort_by(|a, b| place(a).total_cmp(&place(b)).then(a.cmp(b)));
        let mut sum = 0.0;
        let first = self.pieces.iter().take_while(|&&id| {
            sum += tree.node(id).area;
            sum <= 0.5 * self.area
        });
        let middle = first.count().clamp(1, self.pieces.len() - 1);
        let other = self.pieces.split_off(middle);
        [Self::new(tree, self.pieces), Self::new(tree, other)]
    }
}

/// For each node the lowest node with which its leaves exchange light, however indirectly; [`NONE`] if its leaves do not
/// all exchange light.
fn groups(tree: &Tree, links: &LinkRows) -> Vec<u32> {
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
        linked[k] = !row.is_empty() || (k > 0 && linked[nodes[k].parent as usize]);
        let children = if linked[k] {
            nodes[k].child_range()
        } else {
            0..0
        };
        let others = row.iter().map(|e| e.0).filter(|&other| other as usize > k);
        for other in children.chain(others) {
            let (a, b) = (find(&mut parent, k as u32), find(&mut parent, other));
            // The lesser node stands for both.
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut group: Vec<u32> = (0..nodes.len() as u32)
        .map(|k| find(&mut parent, k))
        .collect();
    for k in (0..nodes.len()).rev() {
        let mut children = nodes[k].child_range();
        if let Some(first) = children.next() {
            let of = group[first as usize];
            let same = children.all(|c| group[c as usize] == of);
            group[k] = if same { of } else { NONE };
        }
    }
    group
}

impl Operator<'_> {
    /// `Z^T K Z` of the aggregates, row by row, each entry a row of lanes.
    fn aggregate<const L: usize>(
        &self,
        parts: &Parts,
        reflectance: &Rows,
        scratch: &mut Rows,
    ) -> Vec<f64> {
        let (tree, areas) = (self.tree, self.areas);
        // What a leaf reflects at irradiance 1, balanced.
        let mean = scratch.all_mut::<L>();
        for (rho, &leaf) in reflectance.all::<L>().iter().zip(self.leaves) {
            let factor = self.factor[leaf as usize];
            mean[leaf as usize] = rho.map(|x| factor * x);
        }
        pull::<f32, L>(tree, areas, mean);
        let mean: &[[f32; L]] = mean;
        let shares = Shares::new::<L>(tree, areas, parts, mean);
        let size = parts.count * L;
        let mut members = vec![Vec::new(); parts.count];
        for (id, &of) in parts.of.iter().enumerate() {
            if of != NONE {
                members[of as usize].push(id);
            }
        }
        let mut matrix = vec![0.0; parts.count * size];
        matrix
            .par_chunks_mut(size)
            .zip(&members)
            .for_each(|(sums, members)| {
                for &id in members {
                    self.add_row::<L>(id, parts, mean, &shares, &mean[id], sums);
                }
            });
        // What the nodes above gather goes to all aggregates below in proportion.
        let mut gathered = vec![0.0; size];
        for (place, &id) in parts.above.iter().enumerate() {
            if self.links.row(id as usize).is_empty() {
                continue;
            }
            gathered.fill(0.0);
            self.add_row::<L>(id as usize, parts, mean, &shares, &[1.0; L], &mut gathered);
            for (part, share) in shares.of(place) {
                let row = &mut matrix[part * size..(part + 1) * size];
                for (sum, from) in row.chunks_mut(L).zip(gathered.chunks(L)) {
                    add_scaled(sum, share, from);
                }
            }
        }
        matrix
    }

    /// Adds what a node of radiosity `reflected` exchanges with each aggregate.
    fn add_row<const L: usize>(
        &self,
        id: usize,
        parts: &Parts,
        mean: &[[f32; L]],
        shares: &Shares,
        reflected: &[f32],
        sums: &mut [f64],
    ) {
        for &(source, exchange) in self.links.row(id) {
            let part = parts.of[source as usize] as usize;
            if part < parts.count {
                let sum = &mut sums[part * L..(part + 1) * L];
                add_exchange(sum, exchange, reflected, &mean[source as usize]);
            } else if let Ok(place) = parts.above.binary_search(&source) {
                for (part, share) in shares.of(place) {
                    let sum = &mut sums[part * L..(part + 1) * L];
                    add_shared(sum, exchange, reflected, share);
                }
            }
        }
    }
}

/// Contribution of each aggregate below a node above the cut to that node's mean: rows of lanes.
struct Shares {
    lanes: usize,
    /// For each node of [`Parts::above`], its aggregates and where their rows are.
    lists: Vec<Vec<(usize, usize)>>,
    rows: Vec<f64>,
}

impl Shares {
    /// From the means of nodes as their parents see them.
    pub(crate) fn new<const L: usize>(
        tree: &Tree,
        areas: &[f64],
        parts: &Parts,
        mean: &[[f32; L]],
    ) -> Self {
        let mut shares = Self {
            lanes: L,
            lists: vec![Vec::new(); parts.above.len()],
            rows: Vec::new(),
        };
        for place in (0..parts.above.len()).rev() {
            let id = parts.above[place];
            let mut list: BTreeMap<usize, [f64; L]> = BTreeMap::new();
            for child in tree.node(id).child_range() {
                let share = areas[child as usize] / areas[id as usize];
                let part = parts.of[child as usize] as usize;
                if part < parts.count {
                    let sum = list.entry(part).or_insert([0.0; L]);
                    for (s, m) in sum.iter_mut().zip(&mean[child as usize]) {
                        *s += share * f64::from(*m);
                    }
                } else if let Ok(below) = parts.above.binary_search(&child) {
                    for (part, row) in shares.of(below) {
                        add_scaled(list.entry(part).or_insert([0.0; L]), &[share; L], row);
                    }
                }
            }
            for (part, row) in list {
                shares.lists[place].push((part, shares.rows.len()));
                shares.rows.extend(row);
            }
        }
        shares
    }

    /// Aggregates below a node, and their rows.
    fn of(&self, place: usize) -> impl Iterator<Item = (usize, &[f64])> {
        self.lists[place]
            .iter()
            .map(|&(part, at)| (part, &self.rows[at..at + self.lanes]))
    }
}

/// `sum += g x y`.
#[inline(never)]
fn add_exchange(sum: &mut [f64], g: f32, x: &[f32], y: &[f32]) {
    for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
        *s += f64::from(g * x * y);
    }
}

/// `sum += g x y`, y in f64.
#[inline(never)]
fn add_shared(sum: &mut [f64], g: f32, x: &[f32], y: &[f64]) {
    for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
        *s += f64::from(g * x) * y;
    }
}

/// `sum += x y`.
#[inline(never)]
fn add_scaled(sum: &mut [f64], x: &[f64], y: &[f64]) {
    for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
        *s += x * y;
    }
}
