//! Which sides of triangles form one visible surface: where they meet, they must have the same vertices, or the
//! background would shine through.
//!
//! Sides meet over an edge if they run along it in opposite senses. The two sides of one sheet do not: each may be as
//! fine as its own light needs.

use crate::hierarchy::Mesh;
use crate::scene::sets::{join, root};
use crate::scene::{Scene, Sides};
use rayon::prelude::*;

/// Sides in sets; side 2 t is the front of triangle t, 2 t + 1 its back.
pub(super) struct Skins {
    above: Vec<u32>,
}

impl Skins {
    pub(super) fn new(scene: &Scene, mesh: &Mesh) -> Self {
        let count = 2 * mesh.triangles.len() as u32;
        let mut skins = Self {
            above: (0..count).collect(),
        };
        // Sides by the edge that they run along, in its sense; sorted, as one list for each of a million edges would be slow
        // to make.
        let mut along: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * mesh.triangles.len());
        for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let both = scene.sides(mesh.origin[t].0 as usize) == Sides::Both;
            for [p, q] in [[a, b], [b, c], [c, a]] {
                let front = 2 * t as u32;
                along.push(([p, q], front));
                if both {
                    along.push(([q, p], front + 1));
                }
            }
        }
        along.par_sort_unstable();
        let of = |edge: [u32; 2]| {
            let first = along.partition_point(|(other, _)| *other < edge);
            let same = along[first..].iter();
            same.take_while(move |(other, _)| *other == edge)
        };
        // The order does not matter: the least side of a set stands for it.
        for &([p, q], side) in along.iter().filter(|([p, q], _)| p <= q) {
            for &(_, other) in of([q, p]) {
                // The two sides of one triangle are never seen together.
                if side / 2 != other / 2 {
                    join(&mut skins.above, side, other);
                }
            }
        }
        skins
    }

    /// The set of a side.
    pub(super) fn of(&mut self, triangle: u32, back: bool) -> u32 {
        root(&mut self.above, 2 * triangle + u32::from(back))
    }
}
