//! Lamps of many faces, such as a glass bulb of hundreds of triangles, as points with a normal and an area.
//!
//! From several of their sizes away such faces are no more than that, and summing their light takes less time than descending
//! the hierarchy to each.

use crate::hierarchy::{Element, Mesh, Tree};
use fearless_simd::{Level, dispatch, f64x8, prelude::*};
use glam::DVec3;
use std::ops::Range;

/// Parts of a lamp whose exitance differs by no more than this share emit alike: means of equal numbers differ by rounding.
const ALIKE: f32 = 1e-5;

/// The emitting faces, in the order of the hierarchy.
#[derive(Debug, Clone, Default)]
pub struct Fixtures {
    /// The elements of these faces.
    elements: Vec<u32>,
    /// Middle, and normal times area over pi: coordinate by coordinate.
    columns: [Vec<f64>; 6],
    /// For each entry of [`Tree::faces`] the number of emitting faces before it, and at the end that of all.
    before: Vec<u32>,
    /// For each node the radius of its largest emitting face, if all that emit belong to one surface and emit alike; else
    /// infinite.
    grain: Vec<f32>,
}

impl Fixtures {
    /// The emitting faces of a hierarchy whose nodes have these brightnesses.
    pub(crate) fn new(tree: &Tree, mesh: &Mesh, emitted: &[f32]) -> Self {
        let mut out = Self {
            grain: vec![0.0; tree.nodes.len()],
            before: vec![0],
            ..Self::default()
        };
        for &id in &tree.face_node {
            let element = tree.element(tree.node(id));
            if let Some(element) = element.filter(|_| emitted[id as usize] > 0.0) {
                let [a, b, c] = element.corners;
                let middle = middle(element);
                let normal = (b - a).cross(c - a) / (2.0 * std::f64::consts::PI);
                let both = middle.to_array().into_iter().chain(normal.to_array());
                for (column, x) in out.columns.iter_mut().zip(both) {
                    column.push(x);
                }
                out.elements.push(id);
            }
            out.before.push(out.elements.len() as u32);
        }
        // For each node below which everything emits alike: the surface and its brightness.
        let mut shines: Vec<Option<(u32, f32)>> = vec![None; emitted.len()];
        for k in (0..emitted.len()).rev().filter(|&k| emitted[k] > 0.0) {
            let node = &tree.nodes[k];
            let below = node.child_range().map(|c| c as usize);
            out.grain[k] = below.clone().map(|c| out.grain[c]).fold(0.0, f32::max);
            if let Some(element) = tree.element(node) {
                let triangle = tree.faces[element.face as usize].triangle;
                shines[k] = Some((mesh.origin[triangle as usize].0, emitted[k]));
                let even = below.clone().all(|c| alike(emitted[c], emitted[k]));
                let radius = if even { radius(element) } else { f32::INFINITY };
                out.grain[k] = radius.max(out.grain[k]);
                continue;
            }
            let mut parts = below.filter_map(|c| shines[c]);
            let first = parts.next();
            let differs = |part: (u32, f32)| {
                first.is_some_and(|one| part.0 != one.0 || !alike(part.1, one.1))
            };
            if parts.any(differs) {
                out.grain[k] = f32::INFINITY;
            }
            shines[k] = first;
        }
        out
    }

    /// As if every lamp had few faces.
    #[cfg(test)]
    pub(crate) fn none(tree: &Tree) -> Self {
        Self {
            before: vec![0; tree.faces.len() + 1],
            grain: vec![f32::INFINITY; tree.nodes.len()],
            ..Self::default()
        }
    }

    /// Radius of the largest emitting face below a node, if all of them emit alike; else infinite.
    pub(crate) fn grain(&self, node: u32) -> f64 {
        f64::from(self.grain[node as usize])
    }

    /// The emitting faces below a node.
    pub(crate) fn below(&self, tree: &Tree, node: u32) -> Range<usize> {
        let (first, count) = tree.node(node).faces;
        let place = |entry: u32| self.before[entry as usize] as usize;
        place(first)..place(first + count)
    }

    /// The element of a face.
    pub(crate) fn element(&self, face: usize) -> u32 {
        self.elements[face]
    }

    /// Adds form factors of faces far from a point, as those of their middles, to `out`; returns their sum.
    pub(crate) fn factors(
        &self,
        faces: Range<usize>,
        point: DVec3,
        normal: DVec3,
        out: &mut Vec<f64>,
    ) -> f64 {
        let begin = out.len();
        dispatch!(Level::new(), simd => self.push_factors(simd, faces, point, normal, out));
        out[begin..].iter().sum()
    }

    #[inline(always)]
    fn push_factors<S: Simd>(
        &self,
        simd: S,
        faces: Range<usize>,
        point: DVec3,
        normal: DVec3,
        out: &mut Vec<f64>,
    ) {
        for first in faces.clone().step_by(8) {
            let count = (faces.end - first).min(8);
            let lanes = |column: usize| {
                let mut lanes = [0.0; 8];
                lanes[..count].copy_from_slice(&self.columns[column][first..first + count]);
                f64x8::simd_from(simd, lanes)
            };
            let way = [lanes(0) - point.x, lanes(1) - point.y, lanes(2) - point.z];
            let square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
            let here = way[0] * normal.x + way[1] * normal.y + way[2] * normal.z;
            let there = lanes(3) * way[0] + lanes(4) * way[1] + lanes(5) * way[2];
            let factors = here.max(0.0) * (-there).max(0.0) / (square * square);
            out.extend_from_slice(&factors.to_array()[..count]);
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        4 * (self.elements.len() + self.before.len() + self.grain.len())
            + self
                .columns
                .iter()
                .map(|column| 8 * column.len())
                .sum::<usize>()
    }
}

fn middle(element: &Element) -> DVec3 {
    let [a, b, c] = element.corners;
    (a + b + c) / 3.0
}

/// Distance of the furthest corner from the middle.
fn radius(element: &Element) -> f32 {
    let middle = middle(element);
    let corners = element.corners.map(|p| p.distance(middle));
    corners.into_iter().fold(0.0, f64::max) as f32
}

fn alike(a: f32, b: f32) -> bool {
    (a - b).abs() <= ALIKE * a.max(b)
}
