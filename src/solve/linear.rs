//! Light on the leaves to second order: what a link brings is not even over its receiver, nor is its source evenly bright;
//! where these are elements with parts, both are linear functions.
//!
//! Links carry means. That keeps the operator symmetric, but errs to first order in the size of the elements, and always
//! the same way: the middle of a wall comes out too dark, its corners too bright. So after the solve two more passes
//! over the links find the light on the leaves anew.
//!
//! The factor of the other end at three points that halve the ways from an element's middle to its corners gives shares
//! 1 + s_k, the s_k summing to 0; the linear function through them is 1 + 2 sum over k of s_k w_k at barycentric weights
//! w. A child at corner k has the mean 1 + s_k and half the slope, the middle child the mean 1 and minus half the slope.
//! A source whose corner children have radiosities C_k sends B + sum of t_k C_k / 3 where it shows shares 1 + t_k.
//! (Linear elements: Zatz 1993, Galerkin radiosity, without its second order in the exchange of slopes for slopes.)
//!
//! With slopes the rows of leaves sum to what they must within a few per cent, without them within 20 near edges. The
//! links to blame for what is left are those above a leaf that vary: each is in doubt by the sum of s_k^2, and the row is
//! corrected in proportion to that. The energy of each lane is kept.

use super::operator::{Vector, add, pull, scaled};
use super::rows::Rows;
use crate::hierarchy::{NONE, Node, Sample, Tree};
use crate::link::{LinkRows, point_factor};
use rayon::prelude::*;
use wide::{f32x4, f32x8, f32x16};

/// Passes: the second takes in the light that the first found. More change points of a white cube by less than .02 %.
pub(super) const PASSES: usize = 2;
/// Nodes that a task looks at.
const CHUNK: usize = 64;
/// Points that stand for a large cluster.
const POINTS: usize = 8;
/// Shares are kept as multiples of one over this.
const FINE: f64 = 8192.0;
/// A row is scaled up by this much at the most: a patch that sees next to nothing must not be blown up.
const GREATEST: f32 = 2.0;

/// Shares of a link's ends, less 1, in units of 1 / [`FINE`]: at two corners of the receiver and two of the source. The
/// third makes the sum 0; all are 0 where an end has no parts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Shares {
    receiver: [i16; 2],
    source: [i16; 2],
}

/// The links with the slopes of what they bring.
#[derive(Debug)]
pub(super) struct Slopes<'a> {
    tree: &'a Tree,
    links: &'a LinkRows,
    areas: &'a [f64],
    leaves: &'a [u32],
    /// Elements with parts, ascending.
    inner: Vec<u32>,
    /// For each node its place among leaves or `inner`.
    place: Vec<u32>,
    /// For each entry of the rows of links.
    shares: Vec<Shares>,
    /// For each leaf what its row must sum to.
    target: Vec<f32>,
    /// For each leaf how much of what is in doubt is added to its row, and what the row is then scaled by, to do so.
    trust: Vec<[f32; 2]>,
}

/// What links bring to the corners of an element beyond the mean, and how much is in doubt.
#[derive(Debug, Clone, Copy)]
struct Uneven<V, const N: usize> {
    slope: [[V; N]; 3],
    doubt: [V; N],
}

impl<'a> Slopes<'a> {
    /// Finds the slopes of all links. `target` holds what the row of each leaf node must sum to.
    pub(super) fn new(
        tree: &'a Tree,
        links: &'a LinkRows,
        areas: &'a [f64],
        leaves: &'a [u32],
        target: &[f32],
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
                let mut samples = Vec::new();
                let rows = some.iter().map(|&node| {
                    let shares = |&(source, _): &(u32, f32)| Shares {
                        receiver: shares(tree, node, source, &mut samples),
                        source: shares(tree, source, node, &mut samples),
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
            target: (leaves.iter()).map(|&leaf| target[leaf as usize]).collect(),
            trust: vec![[0.0, 1.0]; leaves.len()],
        };
        // What comes of a radiosity of 1: form factors.
        let mut one = Rows::zero(leaves.len(), 4);
        one.all_mut::<4>().fill([1.0; 4]);
        let (mut sums, mut doubts) = (one.clone(), one.clone());
        slopes.pass::<f32x4, 1>(&one, &mut sums, &mut doubts);
        slopes.trust = (slopes
            .target
            .iter()
            .zip(sums.all::<4>())
            .zip(doubts.all::<4>()))
        .map(|((target, &[sum, ..]), &[doubt, ..])| {
            let more = if doubt > 0.0 {
                ((target - sum) / doubt).clamp(-1.0, 1.0)
            } else {
                0.0
            };
            let sum = sum + more * doubt;
            let scale = if sum > 0.0 {
                (target / sum).min(GREATEST)
            } else {
                0.0
            };
            [more, scale]
        })
        .collect();
        slopes
    }

    /// The irradiance that `radiosity` causes on the leaves, both by leaf. All that does not leave the room arrives.
    pub(super) fn irradiance<const L: usize>(&self, radiosity: &Rows) -> Rows {
        let (mut seen, mut doubts) = (radiosity.clone(), radiosity.clone());
        match L {
            4 => self.pass::<f32x4, 1>(radiosity, &mut seen, &mut doubts),
            8 => self.pass::<f32x8, 1>(radiosity, &mut seen, &mut doubts),
            16 => self.pass::<f32x16, 1>(radiosity, &mut seen, &mut doubts),
            32 => self.pass::<f32x16, 2>(radiosity, &mut seen, &mut doubts),
            _ => self.pass::<f32x16, 4>(radiosity, &mut seen, &mut doubts),
        }
        for ((row, doubt), [more, scale]) in (seen.all_mut::<L>().iter_mut())
            .zip(doubts.all::<L>())
            .zip(&self.trust)
        {
            // A sum of many may fall below nothing by rounding.
            *row = std::array::from_fn(|l| ((row[l] + more * doubt[l]) * scale).max(0.0));
        }
        let (mut given, mut received) = ([0.0_f64; L], [0.0_f64; L]);
        let rows = radiosity.all::<L>().iter().zip(seen.all::<L>());
        for (k, (b, h)) in rows.enumerate() {
            let area = self.areas[self.leaves[k] as usize];
            for l in 0..L {
                given[l] += area * f64::from(self.target[k] * b[l]);
                received[l] += area * f64::from(h[l]);
            }
        }
        let keep: [f32; L] = std::array::from_fn(|l| {
            if received[l] > 0.0 {
                (given[l] / received[l]) as f32
            } else {
                0.0
            }
        });
        for row in seen.all_mut::<L>() {
            *row = std::array::from_fn(|l| row[l] * keep[l]);
        }
        seen
    }

    /// Irradiance on the leaves, and the part of it that is in doubt.
    fn pass<V: Vector, const N: usize>(&self, radiosity: &Rows, out: &mut Rows, doubts: &mut Rows) {
        let tree = self.tree;
        let width = radiosity.width();
        let mut means = Rows::zero(tree.nodes.len(), width);
        let rows = means.vectors_mut::<V, N>();
        for (row, &leaf) in radiosity.vectors::<V, N>().iter().zip(self.leaves) {
            rows[leaf as usize] = *row;
        }
        pull(tree, self.areas, rows);
        let means: &[[V; N]] = rows;
        let mut even = Rows::zero(tree.nodes.len(), width);
        let even = even.vectors_mut::<V, N>();
        even.par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(chunk, rows)| {
                for (k, row) in rows.iter_mut().enumerate() {
                    *row = self.even(chunk * CHUNK + k, means);
                }
            });
        let mut uneven: Vec<Uneven<V, N>> = (self.inner.par_chunks(CHUNK))
            .flat_map_iter(|some| some.iter().map(|&node| self.uneven(node as usize, means)))
            .collect();
        let out = out.vectors_mut::<V, N>();
        let doubts = doubts.vectors_mut::<V, N>();
        doubts.fill([V::zeroed(); N]);
        for (k, node) in tree.nodes.iter().enumerate() {
            let place = self.place[k] as usize;
            if node.is_leaf() {
                out[place] = even[k];
                continue;
            }
            let from = (node.element != NONE).then(|| uneven[place]);
            let above = even[k];
            for (part, child) in node.child_range().map(|c| c as usize).enumerate() {
                add(&mut even[child], 1.0, &above);
                let Some(from) = &from else { continue };
                if let Some(corner) = from.slope.get(part) {
                    add(&mut even[child], 1.0, corner);
                }
                let at = self.place[child] as usize;
                if tree.nodes[child].is_leaf() {
                    doubts[at] = from.doubt;
                    continue;
                }
                let turn = if part < 3 { 0.5 } else { -0.5 };
                for (to, from) in uneven[at].slope.iter_mut().zip(&from.slope) {
                    add(to, turn, from);
                }
                add(&mut uneven[at].doubt, 1.0, &from.doubt);
            }
        }
    }

    /// What the links of a node bring in the mean.
    fn even<V: Vector, const N: usize>(&self, node: usize, means: &[[V; N]]) -> [V; N] {
        let mut sum = [V::zeroed(); N];
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

    /// What they bring to the corners beyond that.
    fn uneven<V: Vector, const N: usize>(&self, node: usize, means: &[[V; N]]) -> Uneven<V, N> {
        let mut sums = Uneven {
            slope: [[V::zeroed(); N]; 3],
            doubt: [V::zeroed(); N],
        };
        for (&(source, exchange), shares) in self.row(node) {
            if shares.receiver != [0; 2] {
                let (row, shares) = (&means[source as usize], thirds(shares.receiver));
                for (sum, s) in sums.slope.iter_mut().zip(shares) {
                    add(sum, exchange * s, row);
                }
                let doubt: f32 = shares.iter().map(|s| s * s).sum();
                add(&mut sums.doubt, exchange * doubt, row);
            }
        }
        let inverse = (1.0 / self.areas[node]) as f32;
        Uneven {
            slope: sums.slope.map(|sum| scaled(&sum, inverse)),
            doubt: scaled(&sums.doubt, inverse),
        }
    }

    fn row(&self, node: usize) -> impl Iterator<Item = (&(u32, f32), &Shares)> {
        let shares = &self.shares[self.links.range(node)];
        self.links.row(node).iter().zip(shares)
    }
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

/// Shares of `other` at the corners of `node`; 0 where that has no parts.
fn shares(tree: &Tree, node: u32, other: u32, samples: &mut Vec<Sample>) -> [i16; 2] {
    let (node, from) = (tree.node(node), tree.node(other));
    let Some(points) = points(tree, node).filter(|_| !node.is_leaf()) else {
        return [0; 2];
    };
    tree.samples(other, POINTS, [0.5; 2], samples);
    let factors = points.map(|p| point_factor(tree, &p, from, samples));
    let mean = factors.iter().sum::<f64>() / 3.0;
    if mean <= 0.0 {
        return [0; 2];
    }
    let shares = factors.map(|f| f / mean - 1.0);
    // Nowhere below zero.
    let least = shares.iter().copied().fold(0.0, f64::min);
    let scale = (0.5 / -least).min(1.0);
    [0, 1].map(|k| (FINE * scale * shares[k]).round() as i16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lambert_polygon;
    use crate::hierarchy::Mesh;
    use crate::link::{Link, Way};
    use crate::scene::{Options, Scene};
    use std::path::Path;

    /// A convex room, its first face quartered twice and linked to another face only.
    fn one_link() -> (Tree, LinkRows, u32, u32) {
        let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/convex.glb");
        let scene = Scene::load(room, &Options::default()).unwrap();
        let mesh = Mesh::new(&scene);
        let mut tree = Tree::new(&mesh, &vec![0; mesh.faces.len()]);
        let to = tree.face_node[0];
        let across = |&k: &u32| tree.node(k).normal.dot(tree.node(to).normal).abs() < 0.1;
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
            way: Way::Clear,
        };
        let links = LinkRows::new(tree.nodes.len(), &[link]);
        (tree, links, to, from)
    }

    #[test]
    fn parts_get_what_they_see() {
        let (tree, links, to, from) = one_link();
        let leaves: Vec<u32> = tree.leaves().collect();
        let areas: Vec<f64> = tree.nodes.iter().map(|n| n.area).collect();
        // Rows that sum to nothing in particular: no row is corrected.
        let mut slopes = Slopes::new(&tree, &links, &areas, &leaves, &vec![1.0; areas.len()]);
        slopes.trust.fill([0.0, 1.0]);
        let mut light = Rows::zero(leaves.len(), 8);
        let source = leaves.iter().position(|&k| k == from).unwrap();
        light.row_mut(source).fill(3.0);
        let (mut seen, mut doubt) = (light.clone(), light.clone());
        slopes.pass::<f32x8, 1>(&light, &mut seen, &mut doubt);
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
        assert!(linear < 0.1 * even, "{linear} {even}");
    }

    #[test]
    fn rows_sum_to_their_targets_and_energy_is_kept() {
        let (tree, links, to, from) = one_link();
        let leaves: Vec<u32> = tree.leaves().collect();
        let areas: Vec<f64> = tree.nodes.iter().map(|n| n.area).collect();
        let target = vec![0.1; areas.len()];
        let slopes = Slopes::new(&tree, &links, &areas, &leaves, &target);
        let mut light = Rows::zero(leaves.len(), 4);
        light.all_mut::<4>().fill([1.0; 4]);
        let seen = slopes.irradiance::<4>(&light);
        let below = |leaf: u32| tree.node(tree.node(leaf).parent).parent == to || leaf == from;
        let (mut given, mut received) = (0.0, 0.0);
        for (k, &leaf) in leaves.iter().enumerate() {
            let got = f64::from(seen.row(k)[0]);
            given += 0.1 * areas[leaf as usize];
            received += areas[leaf as usize] * got;
            assert_eq!(got > 0.0, below(leaf), "{leaf}");
        }
        assert!((received / given - 1.0).abs() < 1e-5);
        let first = leaves.iter().position(|&k| k == from).unwrap();
        for (k, _) in leaves.iter().enumerate().filter(|(_, l)| below(**l)) {
            let ratio = seen.row(k)[0] / seen.row(first)[0];
            assert!((ratio - 1.0).abs() < 1e-4, "{ratio}");
        }
    }
}
