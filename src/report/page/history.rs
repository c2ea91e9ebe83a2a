//! The light of every round at the vertices of the finished mesh.
//!
//! Only the last round has vertices. Of the others the light on the patches is kept, 16 bytes a leaf: the hierarchy only
//! grows, so every point of the room still knows which leaf it was on. A vertex shows the mean, by area, of what its triangles
//! say a third of the way in: what classical radiosity draws. Contact shadows finer than the patches are therefore those
//! of the round and not of the file.

use crate::gather::Baked;
use crate::gather::refined::position;
use crate::hierarchy::{Face, NONE, Tree};
use crate::solve::{Bake, weights_of};
use glam::DVec3;

/// The light on the leaves, round by round.
#[derive(Debug, Default)]
pub struct History {
    rounds: Vec<RoundLight>,
}

/// A round's leaves with their tristimulus irradiance, lm/m2.
#[derive(Debug)]
struct RoundLight {
    round: usize,
    leaves: Vec<u32>,
    light: Vec<[f32; 3]>,
}

/// A corner of a triangle of the output: vertex, leaf of the finished hierarchy there, area that it speaks for.
pub(super) struct OutputCorner {
    pub(super) vertex: usize,
    leaf: u32,
    pub(super) area: f64,
}

impl History {
    /// Keeps the light of the round that a bake has just done.
    pub fn note(&mut self, bake: &Bake) {
        let light = bake.light();
        let count = light.leaves.len().min(light.irradiance.len());
        let xyz = |k| bake.lanes().tristimulus(light.irradiance.row(k));
        self.rounds.push(RoundLight {
            round: bake.rounds().len(),
            leaves: light.leaves[..count].to_vec(),
            light: (0..count).map(|k| xyz(k).map(|x| x as f32)).collect(),
        });
    }

    /// Forgets all but the last rounds.
    #[cfg(feature = "cli")]
    pub(crate) fn keep_last(&mut self, rounds: usize) {
        let gone = self.rounds.len().saturating_sub(rounds);
        self.rounds.drain(..gone);
    }

    /// Tristimulus irradiance of `count` vertices in each round that was kept, with the number of the round.
    pub(super) fn at(
        &self,
        tree: &Tree,
        corners: &[OutputCorner],
        count: usize,
    ) -> Vec<(usize, Vec<[f32; 3]>)> {
        let round = |held: &RoundLight| {
            let mut place = vec![NONE; tree.nodes.len()];
            for (k, &leaf) in held.leaves.iter().enumerate() {
                place[leaf as usize] = k as u32;
            }
            tree.inherit(&mut place);
            let mut sums = vec![([0.0; 3], 0.0); count];
            for corner in corners {
                let Some(xyz) = place
                    .get(corner.leaf as usize)
                    .and_then(|&k| held.light.get(k as usize))
                else {
                    continue;
                };
                let (sum, area) = &mut sums[corner.vertex];
                *sum = std::array::from_fn(|c| sum[c] + corner.area * f64::from(xyz[c]));
                *area += corner.area;
            }
            let mean = |(sum, area): ([f64; 3], f64)| match area > 0.0 {
                true => sum.map(|x| (x / area) as f32),
                false => [0.0; 3],
            };
            (held.round, sums.into_iter().map(mean).collect())
        };
        self.rounds.iter().map(round).collect()
    }
}

/// The corners of all triangles, three each, of some surfaces of a baked mesh; vertices count on from surface to surface.
pub(super) fn corners(bake: &Bake, baked: &Baked, order: &[usize]) -> Vec<OutputCorner> {
    let (mesh, tree) = (bake.mesh(), bake.tree());
    let mut out = Vec::new();
    let mut first = 0;
    for &k in order {
        let part = &baked.surfaces[k];
        let surface = &bake.scene().surfaces[part.surface];
        let of = baked.of.get(k).map_or(&[][..], Vec::as_slice);
        for (triangle, &of) in part.triangles.iter().zip(of) {
            let places = triangle.map(|v| position(surface, &part.vertices[v as usize]));
            let [a, b, c] = places.map(|p| p - mesh.centre);
            let area = (b - a).cross(c - a).length() / 6.0;
            for (i, &vertex) in triangle.iter().enumerate() {
                let mut weights = [1.0 / 6.0; 3];
                weights[i] = 2.0 / 3.0;
                let point: DVec3 = a * weights[0] + b * weights[1] + c * weights[2];
                let face = Face {
                    triangle: mesh.part_at(of, point),
                    back: part.back,
                };
                let [p, q, r] = mesh.corners(face);
                let leaf = match tree.entry[face.triangle as usize][usize::from(face.back)] {
                    NONE => NONE,
                    entry => tree.leaf_at(entry, weights_of(point, p, q, r)),
                };
                out.push(OutputCorner {
                    vertex: first + vertex as usize,
                    leaf,
                    area,
                });
            }
        }
        first += part.vertices.len();
    }
    out
}
