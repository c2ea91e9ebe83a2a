//! Vertices right below something: the edge of what stands on a surface runs through the triangles around them.
//!
//! The mesh does not follow that edge. A triangle with corners on both sides of it shows the dark that lies below out in
//! the open, as teeth along the edge. So a dark vertex with something above it, nearer than its triangles are long, or inside
//! something that is black from there, takes over what its nearest brighter neighbour in the open has: the teeth then lie
//! below.

use super::cells::Sheet;
use crate::hierarchy::NONE;
use crate::solve::Bake;
use std::collections::BTreeMap;

/// A vertex is dark if it has less than this share of a neighbour's light.
const DARK: f64 = 0.5;

impl Bake {
    /// For vertices of a sheet that are dark because of something right above them, the neighbours in the open that they
    /// are to be like: (vertex, neighbour), ascending.
    pub(super) fn below(
        &self,
        sheet: &Sheet,
        triangles: &[[u32; 3]],
        rows: &[Option<[f32; 64]>],
    ) -> Vec<(u32, u32)> {
        let light: Vec<Option<f64>> = rows
            .iter()
            .map(|row| row.map(|row| self.lanes().tristimulus(&row)[1]))
            .collect();
        let point = |v: u32| self.place_of(&sheet.vertices[v as usize]);
        let mut brighter: BTreeMap<u32, Vec<(f64, u32)>> = BTreeMap::new();
        for t in triangles {
            for (v, n) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let length = point(v).distance(point(n));
                for (v, n) in [(v, n), (n, v)] {
                    let pair = light[v as usize].zip(light[n as usize]);
                    if pair.is_some_and(|(v, n)| v < DARK * n) {
                        brighter.entry(v).or_default().push((length, n));
                    }
                }
            }
        }
        let is_below = |v: u32| {
            let vertex = &sheet.vertices[v as usize];
            let from = self.receiver(vertex, sheet.surface, sheet.back);
            let up = self.mesh().normal[vertex.triangle as usize];
            let up = if sheet.back { -up } else { up };
            let (from, up, plane) = (from.point.as_vec3(), up.as_vec3(), from.plane);
            let hit = self.rays().closest(from, up, f32::MAX, plane);
            hit.is_some_and(|hit| self.tree().met(&hit) == NONE)
        };
        let mut found = Vec::new();
        for (v, mut lit) in brighter {
            if is_below(v) {
                lit.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                let open = lit.iter().find(|&&(_, n)| !is_below(n));
                found.extend(open.map(|&(_, n)| (v, n)));
            }
        }
        found
    }
}
