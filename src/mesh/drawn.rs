//! Light as a viewer draws it: interpolated between the vertices of the file.

use crate::gather::Baked;
use crate::gather::refined::position;
use crate::hierarchy::Face;
use crate::solve::{Bake, weights_of};
use glam::DVec3;
use std::collections::HashMap;

impl Bake {
    /// Tristimulus irradiance that a baked mesh shows at points of faces, world space; none where there is no triangle.
    pub fn drawn(&self, baked: &Baked, places: &[(Face, DVec3)]) -> Vec<Option<[f64; 3]>> {
        // By triangle of the input: where it was cut, triangles of the output may lie in several parts.
        let input = |triangle: u32| self.mesh().origin[triangle as usize];
        let mut wanted: HashMap<((u32, u32), bool), Vec<usize>> = HashMap::new();
        for (k, (face, _)) in places.iter().enumerate() {
            let here = wanted.entry((input(face.triangle), face.back));
            here.or_default().push(k);
        }
        // The least weight of each place in the triangle that it lies in best, and the light there.
        let mut best = vec![(f64::NEG_INFINITY, None); places.len()];
        for (part, of) in baked.surfaces.iter().zip(&baked.of) {
            let surface = &self.scene().surfaces[part.surface];
            for (triangle, of) in part.triangles.iter().zip(of) {
                let Some(here) = wanted.get(&(input(*of), part.back)) else {
                    continue;
                };
                let corners = triangle.map(|v| &part.vertices[v as usize]);
                let [a, b, c] = corners.map(|v| position(surface, v));
                if (b - a).cross(c - a).length_squared() <= 0.0 {
                    continue;
                }
                for &k in here {
                    let w = weights_of(places[k].1, a, b, c);
                    let least = w.into_iter().fold(f64::INFINITY, f64::min);
                    if least > best[k].0 {
                        let mix = |i: usize| {
                            let at = |j: usize| w[j] * f64::from(corners[j].irradiance[i]);
                            at(0) + at(1) + at(2)
                        };
                        best[k] = (least, Some([mix(0), mix(1), mix(2)]));
                    }
                }
            }
        }
        best.into_iter().map(|(_, light)| light).collect()
    }
}
