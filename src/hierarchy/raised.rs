//! Faces that lie in others: a carpet in the plane of its floor, a panel in that of its wall, a lamp in that of its ceiling.
//!
//! Which of two such faces is visible would be chance, and unchanged both would receive the same light: a floor that is there
//! twice reflects twice. So the one that covers less is raised by next to nothing, and hides the part that it covers.

use super::mesh::{Face, Mesh, Moves, Raised};
use crate::geometry::sampling::tangents;
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// Height, share of the room's diagonal: .5 mm in a room of 10 m. Well above the distance within which rays ignore surfaces
/// (`END_GAP`), and below what anybody models.
const RAISED: f64 = 5e-5;
/// A common area counts from this share of the smaller triangle on: neighbours have their edges in common.
const COMMON: f64 = 1e-3;

/// A face in its plane.
struct PlanarFace {
    surface: u32,
    triangle: u32,
    /// Does the face look along the normal of the plane?
    along: bool,
    corners: [DVec2; 3],
    low: DVec2,
    high: DVec2,
    area: f64,
}

/// Common areas of surfaces, by their numbers and by whether they look along the normal.
type SharedAreas = BTreeMap<(u32, u32, bool), f64>;

impl Mesh {
    /// The surfaces that lie in others, and the displacements of their vertices.
    pub(super) fn lying(&self, input: &[&[[u32; 3]]]) -> (Vec<Raised>, Moves) {
        let mut order: Vec<Face> = self.faces.clone();
        order.sort_by_key(|face| (self.plane[face.triangle as usize], face.triangle, face.back));
        let (mut raised, mut moves) = (Vec::new(), Moves::new());
        let same =
            |a: &Face, b: &Face| self.plane[a.triangle as usize] == self.plane[b.triangle as usize];
        for faces in order.chunk_by(same) {
            let surface = |face: &Face| self.origin[face.triangle as usize].0;
            if faces.iter().all(|face| surface(face) == surface(&faces[0])) {
                continue;
            }
            let normal = self.normal[faces[0].triangle as usize];
            let mut flat: Vec<PlanarFace> =
                faces.iter().map(|face| self.flat(face, normal)).collect();
            flat.sort_by(|a, b| a.low.x.total_cmp(&b.low.x));
            let common = common(&flat);
            if !common.is_empty() {
                self.raise(&flat, &common, normal, input, (&mut raised, &mut moves));
            }
        }
        (raised, moves)
    }

    /// How far the surface of a triangle was raised at the most.
    pub fn raised_by(&self, triangle: u32) -> f64 {
        let surface = self.origin[triangle as usize].0 as usize;
        let raised = (self.raised.iter()).filter(|raised| raised.surfaces[0] == surface);
        raised.map(|raised| raised.height).fold(0.0, f64::max)
    }

    fn flat(&self, face: &Face, normal: DVec3) -> PlanarFace {
        let [right, up] = tangents(normal);
        let flat = |p: DVec3| DVec2::new(p.dot(right), p.dot(up));
        let corners = self
            .corners(Face {
                back: false,
                ..*face
            })
            .map(flat);
        let [a, b, c] = corners;
        PlanarFace {
            surface: self.origin[face.triangle as usize].0,
            triangle: face.triangle,
            along: self.face_normal(*face).dot(normal) > 0.0,
            corners,
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            area: self.area[face.triangle as usize],
        }
    }

    /// Stacks the surfaces of a plane, those that cover most of it first.
    fn raise(
        &self,
        flat: &[PlanarFace],
        common: &SharedAreas,
        normal: DVec3,
        input: &[&[[u32; 3]]],
        (raised, moves): (&mut Vec<Raised>, &mut Moves),
    ) {
        let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
        for face in flat {
            *areas.entry(face.surface).or_default() += face.area;
        }
        let mut order: Vec<(u32, f64)> = areas.into_iter().collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut levels: BTreeMap<u32, u32> = BTreeMap::new();
        for (surface, _) in order {
            let below = common.iter().filter_map(|(&(a, b, along), &area)| {
                let other = if a == surface { b } else { a };
                let level = levels
                    .get(&other)
                    .filter(|_| a == surface || b == surface)?;
                Some((*level, other, along, area))
            });
            let Some((level, other, along, area)) = below.max_by_key(|found| found.0) else {
                levels.insert(surface, 0);
                continue;
            };
            levels.insert(surface, level + 1);
            let height = RAISED * 2.0 * self.half_size * f64::from(level + 1);
            let out = if along { normal } else { -normal };
            let own = flat.iter().filter(|face| face.surface == surface);
            let vertices: BTreeSet<u32> = own
                .flat_map(|face| {
                    let (s, t) = self.origin[face.triangle as usize];
                    input[s as usize][t as usize]
                })
                .collect();
            for vertex in vertices {
                *moves.entry((surface, vertex)).or_default() += out * height;
            }
            raised.push(Raised {
                surfaces: [surface as usize, other as usize],
                area,
                height,
            });
        }
    }
}

/// Common areas of faces of different surfaces that look the same way; faces are sorted from the left.
fn common(faces: &[PlanarFace]) -> SharedAreas {
    let mut found = SharedAreas::new();
    let mut open: Vec<&PlanarFace> = Vec::new();
    for face in faces {
        open.retain(|other| other.high.x > face.low.x);
        for other in &open {
            let apart = other.low.y >= face.high.y || other.high.y <= face.low.y;
            if apart || other.surface == face.surface || other.along != face.along {
                continue;
            }
            let area = overlap(face.corners, other.corners);
            if area > COMMON * face.area.min(other.area) {
                let [a, b] = [face, other].map(|f| f.surface);
                *found.entry((a.min(b), a.max(b), face.along)).or_default() += area;
            }
        }
        open.push(face);
    }
    found
}

/// Area that two triangles have in common (Sutherland and Hodgman 1974).
fn overlap(one: [DVec2; 3], mut other: [DVec2; 3]) -> f64 {
    if (other[1] - other[0]).perp_dot(other[2] - other[0]) < 0.0 {
        other.swap(1, 2);
    }
    let (mut polygon, mut cut) = (one.to_vec(), Vec::new());
    for k in 0..3 {
        let (from, way) = (other[k], other[(k + 1) % 3] - other[k]);
        cut.clear();
        for i in 0..polygon.len() {
            let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            let [a, b] = [p, q].map(|x| way.perp_dot(x - from));
            if a >= 0.0 {
                cut.push(p);
            }
            if (a >= 0.0) != (b >= 0.0) {
                cut.push(p + (q - p) * (a / (a - b)));
            }
        }
        std::mem::swap(&mut polygon, &mut cut);
    }
    let fan = polygon
        .windows(2)
        .map(|w| (w[0] - polygon[0]).perp_dot(w[1] - polygon[0]));
    0.5 * fan.sum::<f64>().abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_triangles_have_in_common() {
        let t = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| [a, b, c].map(DVec2::from);
        let half = t([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]);
        let rest = t([1.0, 0.0], [1.0, 1.0], [0.0, 1.0]);
        assert!((overlap(half, half) - 0.5).abs() < 1e-15);
        assert!(overlap(half, rest).abs() < 1e-15);
        let small = t([0.1, 0.1], [0.1, 0.3], [0.3, 0.1]);
        assert!((overlap(half, small) - 0.02).abs() < 1e-15);
        assert!((overlap(small, half) - 0.02).abs() < 1e-15);
        let far = t([5.0, 5.0], [6.0, 5.0], [5.0, 6.0]);
        assert_eq!(overlap(half, far), 0.0);
        let wide = t([-1.0, 0.5], [2.0, 0.5], [2.0, 2.0]);
        // The half above y = .5 lies wholly below y = .5 + (x + 1) / 2.
        assert!((overlap(half, wide) - 0.125).abs() < 1e-15);
    }
}
