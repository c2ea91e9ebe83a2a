//! Which faces share a space: light can pass between them, straight or over other faces.
//!
//! Random rays join the face that they leave with the face that they meet. A closed room and its surroundings turn out to
//! be two spaces; a cluster with faces of both would take light from one into the other. Rays join nothing between which
//! light cannot pass. They may fail to join all parts of a space, which only makes the cluster tree a little worse.
//!
//! A triangle that others meet is tested part by part ([`super::cut`]): parts in different spaces must not share a patch.
//! Parts whose rays mostly meet black backs lie under or in something solid, and belong to no space.

use super::cut::Cut;
use super::mesh::Mesh;
use crate::geometry::RayIndex;
use crate::geometry::sampling::{cosine_direction, hash, on_triangle, sequence02};
use crate::scene::sets::{join, root};
use glam::DVec3;
use rayon::prelude::*;

/// Rays of a face in one pass.
const RAYS: u32 = 8;
/// Rays of the first pass, for all faces together: a fraction of a second.
const FIRST_PASS: usize = 1_000_000;
/// Passes over the faces that are not yet in the largest space.
const PASSES: u64 = 4;
/// No face.
const NONE: u32 = u32::MAX;
/// Rays leave a part this share of the way from its border to its middle, and those that meet a part nearer to its
/// border than this share of the scene's half size tell nothing: single precision might take them through a wall.
const CLEAR_OF_BORDER: [f64; 2] = [0.02, 1e-5];
/// Parts narrower than this share of the scene's half size send no rays, for the same reason.
const NARROW: f64 = 1e-4;

/// Spaces, and the cuts that separate them.
#[derive(Debug, Clone)]
pub struct Spaces {
    /// Space of each face of the mesh, numbered in order of the first face. Faces that no ray joins to anything are
    /// added to the largest space: they see nothing whose light could be taken elsewhere.
    pub of_face: Vec<u32>,
    /// Indices of the cuts whose parts belong to different spaces.
    pub parted: Vec<usize>,
}

/// Finds the spaces of `mesh`, given some triangles in parts.
pub fn spaces(mesh: &Mesh, rays: &RayIndex, cuts: &[Cut], seed: u64) -> Spaces {
    let rooms = Rooms::new(mesh, rays, cuts);
    let (faces, count) = (mesh.faces.len(), rooms.count());
    let mut above: Vec<u32> = (0..count as u32).collect();
    let takes_part = |k: u32| {
        let whole = |face| rooms.cut_of[mesh.faces[face as usize].triangle as usize] == NONE;
        match (k as usize).checked_sub(faces) {
            None => whole(k),
            Some(part) => !rooms.narrow(part),
        }
    };
    // For each part the number of rays that met fronts, less those that met backs.
    let mut fronts = vec![0_i32; count - faces];
    let mut open: Vec<u32> = (0..count as u32).filter(|&k| takes_part(k)).collect();
    for pass in 0..PASSES {
        let wanted = if pass == 0 {
            (FIRST_PASS / count.max(1)).clamp(1, RAYS as usize) as u32
        } else {
            RAYS
        };
        let met: Vec<(u32, SpaceHit)> = open
            .par_iter()
            .flat_map_iter(|&id| {
                let seed = hash(hash(seed, pass), u64::from(id));
                let rooms = &rooms;
                (0..wanted).map(move |k| (id, rooms.meet(id, k, seed)))
            })
            .collect();
        for (a, meets) in met {
            let part = (a as usize).checked_sub(faces);
            match meets {
                SpaceHit::Front(b) => {
                    join(&mut above, a, b);
                    part.into_iter().for_each(|part| fronts[part] += 1);
                }
                SpaceHit::Back => part.into_iter().for_each(|part| fronts[part] -= 1),
                SpaceHit::Nothing => {}
            }
        }
        let largest = largest(&mut above);
        open.retain(|&k| root(&mut above, k) != largest);
        if open.is_empty() {
            break;
        }
    }
    // A face in parts belongs to the space of the first part that belongs to any.
    let roots: Vec<u32> = (0..count as u32).map(|k| root(&mut above, k)).collect();
    let mut parted = Vec::new();
    for (c, part) in rooms.parts.iter().enumerate() {
        let mut apart = false;
        for side in (0..2).filter(|&side| part.first[side] != NONE) {
            let first = part.first[side] as usize;
            let mut somewhere = (first..first + part.polygons.len())
                .filter(|&id| fronts[id - faces] > 0)
                .map(|id| roots[id]);
            if let Some(root) = somewhere.next() {
                apart |= somewhere.any(|other| other != root);
                let face = rooms.sides[part.triangle as usize][side];
                join(&mut above, face, root);
            }
        }
        if apart {
            parted.push(c);
        }
    }
    // The least member of a set represents it: parts come after all faces.
    above.truncate(faces);
    Spaces {
        of_face: numbered(above),
        parted,
    }
}

/// What a ray meets.
enum SpaceHit {
    /// A face or part.
    Front(u32),
    /// The black back of something.
    Back,
    /// Nothing, or a place too near to the border of a part to tell.
    Nothing,
}

/// A cut triangle: its parts in space, and the id of the first part on each side.
struct Parts {
    triangle: u32,
    polygons: Vec<Vec<DVec3>>,
    first: [u32; 2],
}

/// Faces, then parts of faces: the nodes that rays join.
struct Rooms<'a> {
    mesh: &'a Mesh,
    rays: &'a RayIndex,
    parts: Vec<Parts>,
    /// Face of each side of each triangle, and the cut of each triangle.
    sides: Vec<[u32; 2]>,
    cut_of: Vec<u32>,
    /// Cut, polygon and side of each id after the faces.
    which: Vec<(u32, u32, bool)>,
}

impl<'a> Rooms<'a> {
    fn new(mesh: &'a Mesh, rays: &'a RayIndex, cuts: &[Cut]) -> Self {
        let mut rooms = Self {
            mesh,
            rays,
            parts: Vec::new(),
            sides: vec![[NONE; 2]; mesh.triangles.len()],
            cut_of: vec![NONE; mesh.triangles.len()],
            which: Vec::new(),
        };
        for (k, face) in mesh.faces.iter().enumerate() {
            rooms.sides[face.triangle as usize][usize::from(face.back)] = k as u32;
        }
        for (c, cut) in cuts.iter().enumerate() {
            let polygons = cut.polygons(mesh);
            let mut first = [NONE; 2];
            for back in [false, true] {
                let side = usize::from(back);
                if rooms.sides[cut.triangle as usize][side] != NONE {
                    first[side] = rooms.count() as u32;
                    let ids = (0..polygons.len() as u32).map(|p| (c as u32, p, back));
                    rooms.which.extend(ids);
                }
            }
            rooms.cut_of[cut.triangle as usize] = c as u32;
            rooms.parts.push(Parts {
                triangle: cut.triangle,
                polygons,
                first,
            });
        }
        rooms
    }

    fn count(&self) -> usize {
        self.mesh.faces.len() + self.which.len()
    }

    /// Is a part too narrow to send rays from?
    fn narrow(&self, part: usize) -> bool {
        let (cut, polygon, _) = self.which[part];
        let corners = &self.parts[cut as usize].polygons[polygon as usize];
        let (mut area, mut border) = (DVec3::ZERO, 0.0);
        for (k, &a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            area += 0.5 * (a - corners[0]).cross(b - corners[0]);
            border += a.distance(b);
        }
        // Twice the area over the border: half the width of a strip, the radius of a circle.
        2.0 * area.length() < NARROW * self.mesh.half_size * border
    }

    /// What ray `k` of a face or part meets.
    fn meet(&self, id: u32, k: u32, seed: u64) -> SpaceHit {
        let mesh = self.mesh;
        let (triangle, back, from) = match mesh.faces.get(id as usize) {
            Some(&face) => {
                let from = on_triangle(&mesh.corners(face), sequence02(k, seed));
                (face.triangle, face.back, from)
            }
            None => {
                let (cut, polygon, back) = self.which[id as usize - mesh.faces.len()];
                let part = &self.parts[cut as usize];
                let from = on_polygon(&part.polygons[polygon as usize], k, seed);
                (part.triangle, back, from)
            }
        };
        let normal = mesh.normal[triangle as usize] * if back { -1.0 } else { 1.0 };
        let direction = cosine_direction(normal, sequence02(k, !seed));
        let reach = (4.0 * mesh.reach) as f32;
        let plane = mesh.plane[triangle as usize];
        let (from32, direction32) = (from.as_vec3(), direction.as_vec3());
        let Some(hit) = self.rays.closest(from32, direction32, reach, plane) else {
            return SpaceHit::Nothing;
        };
        let (triangle, side) = (hit.triangle as usize, usize::from(hit.from_behind));
        if self.sides[triangle][side] == NONE {
            return SpaceHit::Back;
        }
        if self.cut_of[triangle] == NONE {
            return SpaceHit::Front(self.sides[triangle][side]);
        }
        let part = &self.parts[self.cut_of[triangle] as usize];
        let at = from + direction * f64::from(hit.t);
        let mut polygons = part.polygons.iter();
        match polygons.position(|p| self.holds(p, part.triangle, at)) {
            Some(polygon) => SpaceHit::Front(part.first[side] + polygon as u32),
            None => SpaceHit::Nothing,
        }
    }

    /// Does a point of a triangle's plane lie inside a polygon on the triangle, clear of the border?
    fn holds(&self, polygon: &[DVec3], triangle: u32, at: DVec3) -> bool {
        let normal = self.mesh.normal[triangle as usize];
        let clear = CLEAR_OF_BORDER[1] * self.mesh.half_size;
        (0..polygon.len()).all(|k| {
            let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
            normal.cross((b - a).normalize_or_zero()).dot(at - a) > clear
        })
    }
}

/// Point `k` of [`RAYS`] of a convex polygon.
fn on_polygon(polygon: &[DVec3], k: u32, seed: u64) -> DVec3 {
    let fan = |j: usize| [polygon[0], polygon[j], polygon[j + 1]];
    let area = |j: usize| {
        let [a, b, c] = fan(j);
        (b - a).cross(c - a).length()
    };
    let last = polygon.len() - 2;
    let total: f64 = (1..=last).map(area).sum();
    let mut target = total * (f64::from(k % RAYS) + 0.5) / f64::from(RAYS);
    let mut j = 1;
    while j < last && target > area(j) {
        target -= area(j);
        j += 1;
    }
    let point = on_triangle(&fan(j), sequence02(k, seed));
    let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
    point.lerp(middle, CLEAR_OF_BORDER[0])
}

/// Representative of the set of most faces; the lowest of equals.
fn largest(above: &mut [u32]) -> u32 {
    let mut sizes = vec![0_u32; above.len()];
    for k in 0..above.len() as u32 {
        sizes[root(above, k) as usize] += 1;
    }
    (0..sizes.len())
        .max_by_key(|&k| (sizes[k], std::cmp::Reverse(k)))
        .unwrap_or(0) as u32
}

/// Sets numbered in order of their first faces; sets of one face are added to the largest.
fn numbered(mut above: Vec<u32>) -> Vec<u32> {
    let count = above.len();
    let main = largest(&mut above);
    let mut sizes = vec![0_u32; count];
    let roots: Vec<u32> = (0..count as u32).map(|k| root(&mut above, k)).collect();
    for &root in &roots {
        sizes[root as usize] += 1;
    }
    let mut number = vec![NONE; count];
    let mut next = 0;
    roots
        .into_iter()
        .map(|root| {
            let root = if sizes[root as usize] == 1 {
                main
            } else {
                root
            } as usize;
            if number[root] == NONE {
                number[root] = next;
                next += 1;
            }
            number[root]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_joined_and_numbered() {
        let mut above: Vec<u32> = (0..7).collect();
        for (a, b) in [(5, 2), (2, 6), (1, 4)] {
            join(&mut above, a, b);
        }
        assert_eq!(largest(&mut above), 2);
        // 0 and 3 are single and go with 2, 5, 6.
        assert_eq!(numbered(above), [0, 1, 0, 0, 1, 0, 0]);
        assert_eq!(numbered(Vec::new()), Vec::<u32>::new());
    }
}
