//! Hinges of a mesh: edges at which two triangles of a plane meet. Straight light is right in one with the plane through the other.

use super::cells::Cell;
use super::grow::MeshGrowth;
use super::smooth::{Hinge, evened};
use glam::DVec3;
use std::collections::HashMap;

/// Triangles of which these normals are further apart lie on an edge of the room.
const FLAT: f64 = 0.99;

impl MeshGrowth<'_> {
    /// Illuminance of every look, lx, without most of what chance makes of it.
    pub(super) fn smoothed(&self) -> Vec<f64> {
        evened(&self.looks, (self.noise, self.white[1]), |errors| {
            self.hinges(errors)
        })
    }

    /// The edges at which two triangles of a plane meet, all of whose corners are seen, and over which no shadow ends.
    fn hinges(&self, errors: &[f64]) -> Vec<Hinge> {
        let mut first: HashMap<(u32, u32), (usize, usize)> = HashMap::new();
        let mut hinges = Vec::new();
        for (k, cell) in self.cells.all.iter().enumerate() {
            for e in 0..3 {
                let edge = cell.edges[e];
                if self.cells.edges[edge as usize].sharp != 0 {
                    continue;
                }
                match first.remove(&(cell.sheet, edge)) {
                    None => {
                        first.insert((cell.sheet, edge), (k, e));
                    }
                    Some(other) => hinges.extend(self.hinge(other, (k, e), errors)),
                }
            }
        }
        hinges
    }

    /// Two triangles and the edges of them that are one.
    fn hinge(&self, one: (usize, usize), other: (usize, usize), errors: &[f64]) -> Option<Hinge> {
        let [one, other] = [one, other].map(|(k, e)| (&self.cells.all[k], e));
        let look = |cell: &Cell, c: usize| {
            let look = self.look(cell.sheet as usize, cell.corners[c].vertex)?;
            (self.looks.at(look)?.xyz[1] > 0.0).then_some(look)
        };
        let at = |cell: &Cell, c: usize| self.cells.points[cell.corners[c].point as usize];
        let [a, b, c] = [0, 1, 2].map(|k| (one.1 + k) % 3);
        let d = (other.1 + 2) % 3;
        let looks = [
            look(one.0, a)?,
            look(one.0, b)?,
            look(one.0, c)?,
            look(other.0, d)?,
        ];
        // The same looks on both sides, or light ends there.
        let ends = [look(other.0, other.1)?, look(other.0, (other.1 + 1) % 3)?];
        if !(ends.contains(&looks[0]) && ends.contains(&looks[1])) {
            return None;
        }
        let corners = [at(one.0, a), at(one.0, b), at(one.0, c)];
        let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).normalize_or_zero();
        let up = normal(corners);
        let of_other = normal([0, 1, 2].map(|k| at(other.0, k)));
        if up.dot(of_other) < FLAT {
            return None;
        }
        let [p, q, r] = corners.map(|corner| corner - at(other.0, d));
        let parts = [q.cross(r).dot(up), r.cross(p).dot(up), p.cross(q).dot(up)];
        let whole: f64 = parts.iter().sum();
        let weights = [parts[0] / whole, parts[1] / whole, parts[2] / whole, -1.0];
        Hinge::new(looks, weights, errors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::looks::tests::off;
    use crate::mesh::measure::summed;
    use crate::solve::{Effort, GatherQuality};
    use crate::transport::tests::baked;

    #[test]
    fn evened_light_is_nearer_to_the_truth() {
        let bake = baked("furnished.glb", 2);
        let mut growth = bake.growth(GatherQuality::Vertex(Effort::default()), &|| false);
        growth.begin(&|_, _| {});
        let settled = bake.settled(&growth);
        let noise = summed(
            &growth.measured(bake, &settled, 0, &|_, _| {}),
            [1.0; 2],
            None,
        )
        .noise;
        growth.noise = noise * noise;
        growth.grow(4.0 * growth.seen_area(), &|_, _| {});
        let light = growth.smoothed();
        let own = |look| growth.looks.at(look).map_or(0.0, |seen| seen.xyz[1]);
        let [seen, evened] = off(&growth.looks, |look| light[look as usize] / own(look));
        assert!(evened < seen, "{evened} {seen}");
    }

    /// In the triangles of a room, whatever their shapes.
    #[test]
    fn straight_light_bends_over_no_hinge() {
        let bake = baked("cornell.glb", 1);
        let mut growth = bake.growth(GatherQuality::Vertex(Effort::default()), &|| false);
        growth.begin(&|_, _| {});
        let mut light = vec![0.0; growth.looks.len()];
        for cell in &growth.cells.all {
            for corner in cell.corners {
                let look = growth.look(cell.sheet as usize, corner.vertex);
                let at = growth.cells.points[corner.point as usize];
                light[look.unwrap() as usize] = 5.0 + at.dot(DVec3::new(3.0, -2.0, 7.0));
            }
        }
        let hinges = growth.hinges(&vec![1.0; light.len()]);
        assert!(hinges.len() > 10, "{}", hinges.len());
        let far = light.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        for hinge in hinges {
            assert!(hinge.bend(&light).abs() < 1e-6 * far);
        }
    }
}
