//! Which sides of triangles form one visible surface: where they meet, they must have the same vertices, or the
//! background would shine through.
//!
//! Sides meet over an edge if they run along it in opposite senses. The two sides of one sheet do not: each may be as
//! fine as its own light needs.

use crate::hierarchy::Mesh;
use crate::scene::{Scene, Sides};
use rayon::prelude::*;

/// Sides in sets; side 2 t is the front of triangle t, 2 t + 1 its back.
pub(super) struct Skins {
    parent: Vec<u32>,
}

impl Skins {
    pub(super) fn new(scene: &Scene, mesh: &Mesh) -> Self {
        let count = 2 * mesh.triangles.len() as u32;
        let mut skins = Self {
            parent: (0..count).collect(),
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
                    skins.join(side, other);
                }
            }
        }
        skins
    }

    fn root(&mut self, mut side: u32) -> u32 {
        while self.parent[side as usize] != side {
            let up = self.parent[self.parent[side as usize] as usize];
            self.parent[side as usize] = up;
            side = up;
        }
        side
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// The set of a side.
    pub(super) fn of(&mut self, triangle: u32, back: bool) -> u32 {
        self.root(2 * triangle + u32::from(back))
    }
}
