//! Light on the leaves to second order: a link lights its receiver unevenly, and its source is not evenly bright; where
//! these are elements with children, both are linear functions.
//!
//! Links carry means. That keeps the operator symmetric, but errs to first order in the size of the elements, and always
//! in the same direction: the middle of a wall comes out too dark, its corners too bright. So after the solve, two more
//! passes over the links find the light on the leaves anew.
//!
//! The form factor of the other end at three points half-way from an element's middle to its corners gives shares 1 +
//! s_k, the s_k summing to 0; the linear function through them is 1 + 2 sum over k of s_k w_k at barycentric weights w.
//! A child at corner k has the mean 1 + s_k and half the slope, the middle child the mean 1 and minus half the slope. A
//! source with shares 1 + t_k whose corner children have radiosities C_k sends B + sum of t_k C_k / 3.
//! (Linear elements: Zatz 1993, Galerkin radiosity, without its second order in the exchange of slopes for slopes.)
//!
//! With slopes the rows of leaves sum to their targets within a few per cent, without them within 20 near edges; each row
//! is scaled to make up the rest. At last each lane is scaled so that all light that is sent arrives.

use super::operator::{Vector, add, load, pull, scaled, store};
use crate::hierarchy::{NONE, Node, Sample, Tree};
use crate::light::rows::Rows;
use crate::link::{LinkRows, Scratch, point_factors};
use fearless_simd::{Level, dispatch, f32x4, f32x8, f32x16, prelude::*};
use rayon::prelude::*;

/// Passes: the second includes the light that the first found. More change points of a white cube by less than .02 %.
pub(super) const PASSES: usize = 2;
/// Nodes that a task looks at.
const CHUNK: usize = 64;
/// Points that stand for a large cluster.
const POINTS: usize = 8;
/// Shares are stored as multiples of one over this.
const FINE: f64 = 8192.0;
/// A row is scaled up by this much at the most: a patch that sees next to nothing must not be blown up.
const GREATEST: f32 = 2.0;

/// Shares of a link's ends, less 1, in units of 1 / [`FINE`]: at two corners of the receiver and two of the source. The
/// third makes the sum 0; all are 0 where an end has no children.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct CornerShares {
    receiver: [i16; 2],
    source: [i16; 2],
}

/// The links, with the slopes of the light they bring.
#[derive(Debug)]
pub(crate) struct Slopes<'a> {
    tree: &'a Tree,
    links: &'a LinkRows,
    areas: &'a [f64],
    leaves: &'a [u32],
    /// Elements with children, ascending.
    inner: Vec<u32>,
    /// For each node its place among leaves or `inner`.
    place: Vec<u32>,
    /// For each entry of the rows of links.
    shares: Vec<CornerShares>,
    /// For each leaf what its row must sum to.
    target: Vec<f32>,
    /// For each leaf what its row is scaled by to sum to that.
    scale: Vec<f32>,
}

impl<'a> Slopes<'a> {
    /// Finds the slopes of all links. `target` holds what the row of each leaf node must sum to.
    pub(crate) fn new(
        tree: &'a Tree,
        links: &'a LinkRows,
        areas: &'a [f64],
        leaves: &'a [u32],
        target: &[f64],
    ) -> Self {
        let nodes: Vec<u32> = (0..tree.nodes.len() as u32).collect();
        let parted = |&k: &u32| tree.node(k).element != NONE && !tree.node(k).is_leaf();
        let inner: Vec<u32> = nodes.iter().copied().filter(parted).collect();
        let mut place = vec![NONE; nodes.len()];
        for list in [leaves, &inner] {
            for (k, &node) in list.iter().enumerate() {
                place[node as usize] = k as u32;
            }
        }
        let shares = nodes
            .par_chunks(CHUNK)
            .flat_map_iter(|some| {
                let mut scratch = Scratch::default();
                let rows = some.iter().map(|&node| {
                    let shares = |&(source, _): &(u32, f32)| CornerShares {
                        receiver: shares(tree, node, source, &mut scratch),
                        source: shares(tree, source, node, &mut scratch),
                    };
                    let row = links.row(node as usize).iter();
                    row.map(shares).collect::<Vec<_>>()
                });
                rows.flatten().collect::<Vec<_>>()
            })
            .collect();
        let mut slopes = Self {
            tree,
            links,
            areas,
            leaves,
            inner,
            place,
            shares,
            target: (leaves.iter())
                .map(|&leaf| target[leaf as usize] as f32)
                .collect(),
            scale: vec![1.0; leaves.len()],
        };
        // Irradiance by a radiosity of 1: form factors.
        let mut one = Rows::zero(leaves.len(), 4);
        one.all_mut::<4>().fill([1.0; 4]);
        let sums = slopes.unscaled::<4>(&one);
        slopes.scale = (slopes.target.iter().zip(sums.all::<4>()))
            .map(|(target, &[sum, ..])| {
                if sum > 0.0 {
                    (target / sum).min(GREATEST)
                } else {
                    0.0
                }
            })
            .collect();
        slopes
    }

    /// The irradiance that `radiosity` causes on the leaves, both by leaf.
    pub(super) fn irradiance<const L: usize>(&self, radiosity: &Rows) -> Rows {
        let mut seen = self.unscaled::<L>(radiosity);
        for (row, scale) in seen.all_mut::<L>().iter_mut().zip(&self.scale) {
            *row = row.map(|x| x * scale);
        }
        seen
    }

    /// By what `seen`, the irradiance by reflected light, must be scaled, lane by lane, so that all light that does not
    /// leave the room arrives. With the first bounce `first` of direct light and the next bounce `second` of `seen`
    /// (all by leaf) that is the k of `k sum A seen = sum A target (first + k second)`. Returned: the sum of all terms
    /// with k, and of those without.
    pub(super) fn balance<const L: usize>(
        &self,
        seen: &Rows,
        first: &Rows,
        second: &Rows,
    ) -> [[f64; L]; 2] {
        let mut sums = [[0.0_f64; L]; 2];
        let rows = (seen.all::<L>().iter())
            .zip(first.all::<L>())
            .zip(second.all::<L>());
        for (k, ((seen, first), second)) in rows.enumerate() {
            let area = self.areas[self.leaves[k] as usize];
            let target = f64::from(self.target[k]);
            for l in 0..L {
                sums[0][l] += area * (f64::from(seen[l]) - target * f64::from(second[l]));
                sums[1][l] += area * target * f64::from(first[l]);
            }
        }
        sums
    }

    fn unscaled<const L: usize>(&self, radiosity: &Rows) -> Rows {
        let mut out = Rows::zero(self.leaves.len(), L);
        dispatch!(Level::new(), simd => match L {
            4 => self.pass::<_, f32x4<_>, 4, 1>(simd, radiosity, &mut out),
            8 => self.pass::<_, f32x8<_>, 8, 1>(simd, radiosity, &mut out),
            16 => self.pass::<_, f32x16<_>, 16, 1>(simd, radiosity, &mut out),
            32 => self.pass::<_, f32x16<_>, 32, 2>(simd, radiosity, &mut out),
            _ => self.pass::<_, f32x16<_>, 64, 4>(simd, radiosity, &mut out),
        });
        out
    }

    /// Pull, gather over the links, push, with slopes.
    #[inline(always)]
    fn pass<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
        &self,
        simd: S,
        radiosity: &Rows,
        out: &mut Rows,
    ) {
        let tree = self.tree;
        let mut means = Rows::zero(tree.nodes.len(), L);
        let rows = means.all_mut::<L>();
        for (row, &leaf) in radiosity.all::<L>().iter().zip(self.leaves) {
            rows[leaf as usize] = *row;
        }
        pull::<S, V, L>(simd, tree, self.areas, rows);
        let means: &[[f32; L]] = rows;
        let mut even = Rows::zero(tree.nodes.len(), L);
        let even = even.all_mut::<L>();
        even.par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(chunk, rows)| {
                simd.vectorize(
                    #[inline(always)]
                    || {
                        for (k, row) in rows.iter_mut().enumerate() {
                            let sum = self.even::<S, V, L, N>(simd, chunk * CHUNK + k, means);
                            store(&sum, row);
                        }
                    },
                );
            });
        let mut slope: Vec<[[V; N]; 3]> = (self.inner.par_chunks(CHUNK))
            .flat_map_iter(|some| {
                simd.vectorize(
                    #[inline(always)]
                    || {
                        let mut slopes = Vec::with_capacity(some.len());
                        for &node in some {
                            slopes.push(self.slope::<S, V, L, N>(simd, node, means));
                        }
                        slopes
                    },
                )
            })
            .collect();
        let out = out.all_mut::<L>();
        for (k, node) in tree.nodes.iter().enumerate() {
            let place = self.place[k] as usize;
            let above = even[k];
            if node.is_leaf() {
                out[place] = above;
                continue;
            }
            let from = (node.element != NONE).then(|| slope[place]);
            for (part, child) in node.child_range().map(|c| c as usize).enumerate() {
                let mut sum: [V; N] = load(simd, &even[child]);
                add(&mut sum, 1.0, &above);
                if let Some(corner) = from.as_ref().and_then(|from| from.get(part)) {
                    tilt(&mut sum, 1.0, corner);
                }
                store(&sum, &mut even[child]);
                if let Some(from) = from.filter(|_| !tree.nodes[child].is_leaf()) {
                    let turn = if part < 3 { 0.5 } else { -0.5 };
                    for (to, from) in slope[self.place[child] as usize].iter_mut().zip(&from) {
                        tilt(to, turn, from);
                    }
                }
            }
        }
    }

    /// Mean irradiance that the links of a node bring.
    #[inline(always)]
    fn even<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
        &self,
        simd: S,
        node: usize,
        means: &[[f32; L]],
    ) -> [V; N] {
        let mut sum = [V::splat(simd, 0.0); N];
        for (&(source, exchange), shares) in self.row(node) {
            add(&mut sum, exchange, &means[source as usize]);
            if shares.source != [0; 2] {
                let first = self.tree.node(source).child as usize;
                for (k, t) in thirds(shares.source).into_iter().enumerate() {
                    add(&mut sum, exchange * t / 3.0, &means[first + k]);
                }
            }
        }
        scaled(&sum, (1.0 / self.areas[node]) as f32)
    }

    /// By how much the irradiance at its corners differs from that mean.
    #[inline(always)]
    fn slope<S: Simd, V: Vector<S>, const L: usize, const N: usize>(
        &self,
        simd: S,
        node: u32,
        means: &[[f32; L]],
    ) -> [[V; N]; 3] {
        let mut sums = [[V::splat(simd, 0.0); N]; 3];
        for (&(source, exchange), shares) in self.row(node as usize) {
            if shares.receiver != [0; 2] {
                for (sum, s) in sums.iter_mut().zip(thirds(shares.receiver)) {
                    add(sum, exchange * s, &means[source as usize]);
                }
            }
        }
        let inverse = (1.0 / self.areas[node as usize]) as f32;
        let [a, b, c] = &sums;
        [scaled(a, inverse), scaled(b, inverse), scaled(c, inverse)]
    }

    fn row(&self, node: usize) -> impl Iterator<Item = (&(u32, f32), &CornerShares)> {
        let shares = &self.shares[self.links.range(node)];
        self.links.row(node).iter().zip(shares)
    }
}

/// Adds a slope to a row.
#[inline(always)]
fn tilt<S: Simd, V: Vector<S>, const N: usize>(sum: &mut [V; N], factor: f32, slope: &[V; N]) {
    for (s, x) in sum.iter_mut().zip(slope) {
        *s += *x * factor;
    }
}

/// The k of [`Slopes::balance`]; 1 where there is no light, or none that comes back.
pub(super) fn amplitude(over: f64, without: f64) -> f64 {
    let k = without / over;
    if k.is_finite() && k > 0.0 { k } else { 1.0 }
}

/// All three shares.
fn thirds([a, b]: [i16; 2]) -> [f32; 3] {
    [a, b, -(a + b)].map(|x| f32::from(x) / FINE as f32)
}

/// Three points of an element half-way to its corners.
fn points(tree: &Tree, node: &Node) -> Option<[Sample; 3]> {
    let element = tree.element(node)?;
    let face = element.face as usize;
    Some([0, 1, 2].map(|k| {
        let mut w = [1.0 / 6.0; 3];
        w[k] = 2.0 / 3.0;
        Sample {
            point: element.at(w),
            normal: tree.face_normal[face],
            plane: tree.face_plane[face],
            area: 0.0,
        }
    }))
}

/// Shares of `other` at the corners of `node`; 0 where `node` has no children.
fn shares(tree: &Tree, node: u32, other: u32, scratch: &mut Scratch) -> [i16; 2] {
    let (node, from) = (tree.node(node), tree.node(other));
    let Some(points) = points(tree, node).filter(|_| !node.is_leaf()) else {
        return [0; 2];
    };
    tree.samples(other, POINTS, [0.5; 2], &mut scratch.b);
    point_factors(tree, &points, from, &scratch.b, &mut scratch.factors);
    let factors = [0, 1, 2].map(|k| scratch.factors[k]);
    let mean = factors.iter().sum::<f64>() / 3.0;
    if mean <= 0.0 {
        return [0; 2];
    }
    let shares = factors.map(|f| f / mean - 1.0);
    // At least one half at these points, so that the linear function is nowhere negative.
    let least = shares.iter().copied().fold(0.0, f64::min);
    let scale = (0.5 / -least).min(1.0);
    [0, 1].map(|k| (FINE * scale * shares[k]).round() as i16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lambert_polygon;
    use crate::hierarchy::Mesh;
    use crate::link::{Link, Occlusion};
    use crate::scene::{Options, Scene};
    use std::path::Path;

    /// A convex room, its first face quartered twice and linked to one other face only.
    fn one_link() -> (Tree, LinkRows, u32, u32) {
        let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/convex.glb");
        let scene = Scene::load(room, &Options::default()).unwrap();
        let mesh = Mesh::new(&scene);
        let mut tree = Tree::new(&mesh, &vec![0; mesh.faces.len()]);
        let to = tree.face_node[0];
        let across = |&k: &u32| tree.node(k).normal.dot(tree.node(to).normal) < -0.9;
        let from = tree.face_node.iter().copied().find(across).unwrap();
        tree.subdivide(to);
        let parts: Vec<u32> = tree.node(to).child_range().collect();
        parts.into_iter().for_each(|k| tree.subdivide(k));
        let link = Link {
            a: to,
            b: from,
            exchange: 0.2,
            open_exchange: 0.2,
            variation: 1.0,
            occlusion: Occlusion::Clear,
        };
        let links = LinkRows::new(tree.nodes.len(), &[link]);
        (tree, links, to, from)
    }

    #[test]
    fn parts_get_what_they_see() {
        let (tree, links, to, from) = one_link();
        let leaves: Vec<u32> = tree.leaves().collect();
        let areas: Vec<f64> = tree.nodes.iter().map(|n| n.area).collect();
        // The row sums are arbitrary here: no row is corrected.
        let mut slopes = Slopes::new(&tree, &links, &areas, &leaves, &vec![1.0; areas.len()]);
        slopes.scale.fill(1.0);
        let mut light = Rows::zero(leaves.len(), 8);
        let source = leaves.iter().position(|&k| k == from).unwrap();
        light.row_mut(source).fill(3.0);
        let seen = slopes.irradiance::<8>(&light);
        let corners = tree.elements[tree.node(from).element as usize].corners;
        let normal = tree.node(to).normal;
        let (mut even, mut linear, mut sums) = (0.0_f64, 0.0_f64, [0.0; 3]);
        let below: Vec<usize> = (0..leaves.len())
            .filter(|&k| tree.element(tree.node(leaves[k])).unwrap().depth == 2)
            .collect();
        assert_eq!(below.len(), 16);
        let seen_from = |leaf: u32| {
            let element = tree.element(tree.node(leaf)).unwrap();
            lambert_polygon(element.at([1.0 / 3.0; 3]), normal, &corners)
        };
        for &k in &below {
            let area = areas[leaves[k] as usize];
            let got = f64::from(seen.row(k)[5]);
            sums[0] += area * got;
            sums[1] += area * seen_from(leaves[k]);
            sums[2] += area;
        }
        // The link's energy is kept, whatever the slope.
        assert!((sums[0] / (3.0 * 0.2) - 1.0).abs() < 1e-5, "{sums:?}");
        for &k in &below {
            let truth = seen_from(leaves[k]) * sums[2] / sums[1];
            let got = f64::from(seen.row(k)[5]) * sums[2] / sums[0];
            even += (1.0 - truth).powi(2);
            linear += (got - truth).powi(2);
        }
        // What is left is of second order in the size of the element.
        assert!(linear < 0.25 * even, "{linear} {even}");
    }

    #[test]
    fn rows_sum_to_their_targets_and_all_light_arrives() {
        let (tree, links, to, from) = one_link();
        let leaves: Vec<u32> = tree.leaves().collect();
        let areas: Vec<f64> = tree.nodes.iter().map(|n| n.area).collect();
        // Both ends pass nine tenths of the link.
        let mut target = vec![0.18 / areas[to as usize]; areas.len()];
        target[from as usize] = 0.18 / areas[from as usize];
        let slopes = Slopes::new(&tree, &links, &areas, &leaves, &target);
        let mut light = Rows::zero(leaves.len(), 4);
        light.all_mut::<4>().fill([1.0; 4]);
        let seen = slopes.irradiance::<4>(&light);
        let below = |leaf: u32| tree.node(tree.node(leaf).parent).parent == to || leaf == from;
        let (mut arrives, mut given) = (0.0, 0.0);
        for (k, &leaf) in leaves.iter().enumerate() {
            let (got, want) = (f64::from(seen.row(k)[0]), target[leaf as usize]);
            let want = if below(leaf) { want } else { 0.0 };
            assert!((got - want).abs() <= 1e-4 * want, "{leaf}: {got} {want}");
            arrives += areas[leaf as usize] * got;
            given += areas[leaf as usize] * want;
        }
        assert!((arrives / given - 1.0).abs() < 1e-4);
        // Half of what arrives is passed on: k arrives = stays + k again.
        let mut half = seen.clone();
        for row in half.all_mut::<4>() {
            *row = row.map(|x| 0.5 * x);
        }
        let stays = |row: &dyn Fn(usize) -> f32| -> f64 {
            (leaves.iter().enumerate())
                .map(|(k, &leaf)| f64::from(row(k)) * target[leaf as usize] * areas[leaf as usize])
                .sum()
        };
        let [over, without] = slopes.balance::<4>(&seen, &light, &half);
        let k = amplitude(over[0], without[0]);
        let want = stays(&|_| 1.0) / (arrives - stays(&|k| half.row(k)[0]));
        assert!((k / want - 1.0).abs() < 1e-5, "{k} {want}");
    }
}
