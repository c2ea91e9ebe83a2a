//! The transport operator on rows: pull, gather over the links, push.
//!
//! One pass costs one multiply-add for each link, direction and lane.
//!
//! A gather waits for rows that lie anywhere in memory, so what counts is how many loads are under way at once: four
//! sums go on side by side, none waiting for another, and everything else a pass touches is compact (`Shape` in place
//! of the nodes). The links of a row are sorted by source. Vectors are explicit: from loops over arrays of 16 and 32
//! lanes the compiler made scalar code, eight times as slow. A row of L lanes is N vectors V.

use crate::hierarchy::{NONE, Tree};
use crate::light::rows::Rows;
use crate::link::LinkRows;
use fearless_simd::{Level, dispatch, f32x4, f32x8, f32x16, prelude::*};
use rayon::prelude::*;

/// Nodes that a task gathers; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 256;
/// Sums that go on side by side.
const SUMS: usize = 4;

/// What the operator needs to know of the patches.
#[derive(Debug)]
pub struct Operator<'a> {
    /// The hierarchy.
    pub(super) tree: &'a Tree,
    /// The links.
    pub(super) links: &'a LinkRows,
    /// Leaves of the hierarchy, ascending.
    pub(super) leaves: &'a [u32],
    /// Balance factors by node.
    pub(super) factor: &'a [f32],
    shape: Shape,
}

/// The part of the hierarchy that pull and push need.
#[derive(Debug)]
struct Shape {
    /// Nodes with children, ascending: node, first child, end of children.
    inner: Vec<[u32; 3]>,
    /// For each node its share of its parent's area.
    share: Vec<f32>,
    /// For each node one over its area.
    inverse: Vec<f32>,
    /// For each node its place among the leaves; [`NONE`] for nodes with children.
    place: Vec<u32>,
}

impl Shape {
    pub(crate) fn new(tree: &Tree, leaves: &[u32], areas: &[f64]) -> Self {
        let nodes = &tree.nodes;
        let mut place = vec![NONE; nodes.len()];
        for (k, &leaf) in leaves.iter().enumerate() {
            place[leaf as usize] = k as u32;
        }
        let inner = (0..nodes.len() as u32)
            .filter(|&k| !tree.node(k).is_leaf())
            .map(|k| {
                let children = tree.node(k).child_range();
                [k, children.start, children.end]
            })
            .collect();
        let share = nodes
            .iter()
            .zip(areas)
            .map(|(node, area)| {
                if node.parent == NONE {
                    1.0
                } else {
                    (area / areas[node.parent as usize]) as f32
                }
            })
            .collect();
        Self {
            inner,
            share,
            inverse: areas.iter().map(|a| (1.0 / a) as f32).collect(),
            place,
        }
    }
}

impl<'a> Operator<'a> {
    /// The operator of a hierarchy: `leaves` ascending, `areas` and balance `factor` by node.
    pub fn new(
        tree: &'a Tree,
        links: &'a LinkRows,
        leaves: &'a [u32],
        areas: &'a [f64],
        factor: &'a [f32],
    ) -> Self {
        Self {
            tree,
            links,
            leaves,
            factor,
            shape: Shape::new(tree, leaves, areas),
        }
    }

    /// A node's share of its parent's area.
    pub(super) fn share_of(&self, node: usize) -> f64 {
        f64::from(self.shape.share[node])
    }

    /// One over a node's area.
    pub(super) fn inverse_area(&self, node: usize) -> f64 {
        f64::from(self.shape.inverse[node])
    }

    /// Irradiance on the leaves (by leaf) from radiosity on the leaves (by leaf), both balanced.
    pub fn received<const L: usize>(&self, radiosity: &Rows) -> Rows {
        let nodes = self.tree.nodes.len();
        let (mut means, mut gathered) = (Rows::zero(nodes, L), Rows::zero(nodes, L));
        let mut seen = Rows::zero(self.leaves.len(), L);
        self.irradiance::<L>(radiosity, &mut means, &mut gathered, &mut seen);
        seen
    }

    /// [`Self::received`] into `out`: `nodes` and `gathered` are scratch with a row a node; `nodes` then holds the mean radiosity of every
    /// node.
    pub fn irradiance<const L: usize>(
        &self,
        radiosity: &Rows,
        nodes: &mut Rows,
        gathered: &mut Rows,
        out: &mut Rows,
    ) {
        // Lanes of a row, vectors of it. Every width sums in the same order, so that a lane has the same value in all.
        dispatch!(Level::new(), simd => match L {
            4 => self.pass::<_, f32x4<_>, 4, 1>(simd, radiosity, nodes, gathered, out),
            8 => self.pass::<_, f32x8<_>, 8, 1>(simd, radiosity, nodes, gathered, out),
            16 => self.pass::<_, f32x16<_>, 16, 1>(simd, radiosity, nodes, gathered, out),
            32 => self.pass::<_, f32x16<_>, 32, 2>(simd, radiosity, nodes, gathered, out),
            _ => self.pass::<_, f32x16<_>, 64, 4>(simd, radiosity, nodes, gathered, out),
        });
    }

    #[inline(always)]
    fn pass<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
        &self,
        simd: S,
        radiosity: &Rows,
        nodes: &mut Rows,
        gathered: &mut Rows,
        out: &mut Rows,
    ) {
        let mean = nodes.all_mut::<L>();
        for (row, &leaf) in radiosity.all::<L>().iter().zip(self.leaves) {
            let row: [V; N] = load(simd, row);
            store(
                &scaled(&row, self.factor[leaf as usize]),
                &mut mean[leaf as usize],
            );
        }
        self.pull::<S, V, L, N>(simd, mean);
        let mean: &[[f32; L]] = mean;
        gathered
            .all_mut::<L>()
            .par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(chunk, rows)| {
                simd.vectorize(
                    #[inline(always)]
                    || {
                        for (k, row) in rows.iter_mut().enumerate() {
                            let node = chunk * CHUNK + k;
                            let sum = gather::<S, V, L, N>(simd, self.links.row(node), mean);
                            store(&scaled(&sum, self.shape.inverse[node]), row);
                        }
                    },
                );
            });
        self.push::<S, V, L, N>(simd, gathered.all_mut::<L>(), out.all_mut::<L>());
    }

    /// Area-weighted means from the leaves to the root.
    #[inline(always)]
    fn pull<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
        &self,
        simd: S,
        rows: &mut [[f32; L]],
    ) {
        for &[node, first, end] in self.shape.inner.iter().rev() {
            let mut mean = [V::splat(simd, 0.0); N];
            let children = first as usize..end as usize;
            for (row, share) in rows[children.clone()]
                .iter()
                .zip(&self.shape.share[children])
            {
                add(&mut mean, *share, row);
            }
            store(&mean, &mut rows[node as usize]);
        }
    }

    /// Adds what each node gathered to everything below it; the leaves' sums are balanced and written by leaf.
    #[inline(always)]
    fn push<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
        &self,
        simd: S,
        rows: &mut [[f32; L]],
        out: &mut [[f32; L]],
    ) {
        let shape = &self.shape;
        if shape.inner.is_empty()
            && let (Some(row), Some(to)) = (rows.first(), out.first_mut())
        {
            let row: [V; N] = load(simd, row);
            store(&scaled(&row, self.factor[0]), to);
        }
        for &[node, first, end] in &shape.inner {
            let above = rows[node as usize];
            let children = first as usize..end as usize;
            for (row, child) in rows[children.clone()].iter_mut().zip(children) {
                let mut sum: [V; N] = load(simd, row);
                add(&mut sum, 1.0, &above);
                store(&sum, row);
                if shape.place[child] != NONE {
                    let sum = scaled(&sum, self.factor[child]);
                    store(&sum, &mut out[shape.place[child] as usize]);
                }
            }
        }
    }
}

/// A vector of f32.
pub(crate) trait Vector<S: Simd>: SimdFloat<S, Element = f32> {}
impl<S: Simd, V: SimdFloat<S, Element = f32>> Vector<S> for V {}

/// A row as vectors.
#[inline(always)]
pub(super) fn load<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
    simd: S,
    row: &[f32; L],
) -> [V; N] {
    let mut out = [V::splat(simd, 0.0); N];
    for (to, x) in out.iter_mut().zip(row.chunks_exact(V::LEN)) {
        *to = V::from_slice(simd, x);
    }
    out
}

/// Vectors as a row.
#[inline(always)]
pub(super) fn store<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
    from: &[V; N],
    row: &mut [f32; L],
) {
    for (x, to) in from.iter().zip(row.chunks_exact_mut(V::LEN)) {
        x.store_slice(to);
    }
}

#[inline(always)]
pub(super) fn scaled<S: Simd, V: Vector<S>, const N: usize>(row: &[V; N], by: f32) -> [V; N] {
    let mut out = *row;
    for x in &mut out {
        *x *= by;
    }
    out
}

#[inline(always)]
pub(super) fn add<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
    sum: &mut [V; N],
    factor: f32,
    row: &[f32; L],
) {
    for (s, x) in sum.iter_mut().zip(row.chunks_exact(V::LEN)) {
        *s += V::from_slice(s.token(), x) * factor;
    }
}

/// `sum of exchange * row` over the links of a node, in several sums.
#[inline(always)]
fn gather<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
    simd: S,
    links: &[(u32, f32)],
    rows: &[[f32; L]],
) -> [V; N] {
    let mut sums = [[V::splat(simd, 0.0); N]; SUMS];
    let (several, rest) = links.as_chunks::<SUMS>();
    for some in several {
        for (sum, &(source, exchange)) in sums.iter_mut().zip(some) {
            add(sum, exchange, &rows[source as usize]);
        }
    }
    for (sum, &(source, exchange)) in sums.iter_mut().zip(rest) {
        add(sum, exchange, &rows[source as usize]);
    }
    let (first, others) = sums.split_at_mut(1);
    for other in others {
        for (s, x) in first[0].iter_mut().zip(other) {
            *s += *x;
        }
    }
    first[0]
}

/// Area-weighted means from the leaves to the root.
#[inline(always)]
pub(super) fn pull<S: Simd, V: Vector<S>, const L: usize>(
    simd: S,
    tree: &Tree,
    areas: &[f64],
    rows: &mut [[f32; L]],
) {
    for (k, node) in tree.nodes.iter().enumerate().rev() {
        if node.is_leaf() {
            continue;
        }
        let children = node.child_range().map(|c| c as usize);
        for lanes in (0..L).step_by(V::LEN).map(|first| first..first + V::LEN) {
            let mut mean = V::splat(simd, 0.0);
            for child in children.clone() {
                let share = (areas[child] / areas[k]) as f32;
                mean += V::from_slice(simd, &rows[child][lanes.clone()]) * share;
            }
            mean.store_slice(&mut rows[k][lanes]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;
    use crate::link::{Link, Occlusion};

    /// Nodes by their parents; leaves of area 1 and 2 in turn.
    fn tree(parents: &[u32]) -> (Tree, Vec<f64>, Vec<u32>) {
        let mut tree = Tree::default();
        for (k, &parent) in parents.iter().enumerate() {
            let area = 1.0 + (k % 2) as f64;
            tree.nodes.push(crate::hierarchy::Node::bare(parent, area));
            if let Some(p) = tree.nodes.get_mut(parent as usize) {
                p.child = p.child.min(k as u32);
                p.children += 1;
            }
        }
        for k in (0..parents.len()).rev() {
            if !tree.nodes[k].is_leaf() {
                let children = tree.nodes[k].child_range();
                tree.nodes[k].area = children.map(|c| tree.nodes[c as usize].area).sum();
            }
        }
        let areas = tree.nodes.iter().map(|n| n.area).collect();
        let leaves = (0..parents.len() as u32)
            .filter(|&k| tree.node(k).is_leaf())
            .collect();
        (tree, areas, leaves)
    }

    /// The operator in f64, every link written out between leaves.
    fn plainly(
        tree: &Tree,
        links: &[Link],
        leaves: &[u32],
        areas: &[f64],
        factor: &[f32],
        radiosity: &dyn Fn(usize) -> f64,
    ) -> Vec<f64> {
        let below = |id: u32, mut leaf: u32| {
            while leaf != NONE && leaf != id {
                leaf = tree.node(leaf).parent;
            }
            leaf == id
        };
        let mean = |id: u32| {
            let sum: f64 = leaves
                .iter()
                .enumerate()
                .filter(|(_, l)| below(id, **l))
                .map(|(k, &l)| areas[l as usize] * f64::from(factor[l as usize]) * radiosity(k))
                .sum();
            sum / areas[id as usize]
        };
        leaves
            .iter()
            .map(|&leaf| {
                let mut sum = 0.0;
                for link in links {
                    for (end, other) in [(link.a, link.b), (link.b, link.a)] {
                        if below(end, leaf) {
                            sum += f64::from(link.exchange) / areas[end as usize] * mean(other);
                        }
                    }
                }
                f64::from(factor[leaf as usize]) * sum
            })
            .collect()
    }

    #[test]
    fn it_is_the_sum_over_all_links() {
        let parents = [NONE, 0, 0, 1, 1, 1, 1, 2, 2, 4, 4, 4, 4];
        let (tree, areas, leaves) = tree(&parents);
        let mut rng = Pcg::new(3);
        let mut links = Vec::new();
        // Some nodes have more links than sums go on side by side, and numbers of links that leave a rest.
        for a in 1..parents.len() as u32 {
            for b in a + 1..parents.len() as u32 {
                if rng.f64() < 0.7 {
                    links.push(Link {
                        a,
                        b,
                        exchange: rng.f32(),
                        open_exchange: 1.0,
                        variation: 0.0,
                        occlusion: Occlusion::Clear,
                    });
                }
            }
        }
        let factor: Vec<f32> = (0..parents.len()).map(|_| 0.5 + rng.f32()).collect();
        let rows = LinkRows::new(parents.len(), &links);
        let operator = Operator::new(&tree, &rows, &leaves, &areas, &factor);
        let (mut nodes, mut gathered) =
            (Rows::zero(parents.len(), 8), Rows::zero(parents.len(), 8));
        let (mut from, mut out) = (Rows::zero(leaves.len(), 8), Rows::zero(leaves.len(), 8));
        for k in 0..leaves.len() {
            from.row_mut(k)
                .iter_mut()
                .enumerate()
                .for_each(|(l, x)| *x = (l + 1) as f32 / (k + 1) as f32);
        }
        operator.irradiance::<8>(&from, &mut nodes, &mut gathered, &mut out);
        for lane in [0, 7] {
            let b = |k: usize| (lane + 1) as f64 / (k + 1) as f64;
            let expected = plainly(&tree, &links, &leaves, &areas, &factor, &b);
            for (k, expected) in expected.iter().enumerate() {
                let found = f64::from(out.row(k)[lane]);
                assert!(
                    (found / expected - 1.0).abs() < 1e-5,
                    "{k} {lane}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_lone_leaf_gets_what_it_gives_itself() {
        let (tree, areas, leaves) = tree(&[NONE]);
        let rows = LinkRows::new(1, &[]);
        let operator = Operator::new(&tree, &rows, &leaves, &areas, &[1.0]);
        let (mut nodes, mut gathered, mut out) =
            (Rows::zero(1, 4), Rows::zero(1, 4), Rows::zero(1, 4));
        operator.irradiance::<4>(&Rows::zero(1, 4), &mut nodes, &mut gathered, &mut out);
        assert_eq!(out.row(0), [0.0; 4]);
    }
}
