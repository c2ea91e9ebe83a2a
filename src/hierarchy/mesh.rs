//! All surfaces of a scene as one welded mesh of triangles, and the faces (sides) that light leaves and meets.
//!
//! Positions are recentred on the middle of the scene, f64, in the file's units. Welding joins vertices at equal
//! positions, so that neighbours know each other across surfaces.

use crate::geometry::{RayIndex, plane_ids};
use crate::scene::{Alpha, Scene, Sides};
use glam::{DVec3, Vec3};
use std::collections::{HashMap, HashSet};

/// In [`Mesh::part`]: the triangle is a whole one.
pub(super) const WHOLE: u32 = u32::MAX;

/// One side of a triangle: it emits, reflects and receives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Face {
    /// Index of the triangle.
    pub triangle: u32,
    /// Is this the back of a two-sided triangle?
    pub back: bool,
}

/// A surface that lies in the plane of another.
#[derive(Debug, Clone, PartialEq)]
pub struct Raised {
    /// The surface that is raised, and the one in which it lies.
    pub surfaces: [usize; 2],
    /// The area that they have in common.
    pub area: f64,
    /// How far the first is raised.
    pub height: f64,
}

/// Displacements of vertices of surfaces.
pub(super) type Moves = HashMap<(u32, u32), DVec3>;

/// The welded triangles of a scene.
#[derive(Debug)]
pub struct Mesh {
    /// What was subtracted from world positions.
    pub centre: DVec3,
    /// Half the diagonal of the box around the part of the room that counts, see `Frame`: lengths are given as shares
    /// of this.
    pub half_size: f64,
    /// No corner is farther from the centre.
    pub reach: f64,
    /// Distinct positions, recentred.
    pub positions: Vec<DVec3>,
    /// Corners, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Surface and triangle in it that each triangle came from.
    pub origin: Vec<(u32, u32)>,
    /// Material of each triangle.
    pub material: Vec<u32>,
    /// Plane of each triangle: equal for triangles in one plane, whichever way they face.
    pub plane: Vec<u32>,
    /// The other half of the convex quadrilateral that each triangle is part of; [`NONE`](super::NONE) where there is
    /// none.
    pub(super) half: Vec<u32>,
    /// Unit normal of the front of each triangle.
    pub normal: Vec<DVec3>,
    /// Area of each triangle.
    pub area: Vec<f64>,
    /// All sides that take part.
    pub faces: Vec<Face>,
    /// Materials that are diffuse sheets: light passes between the two faces of their triangles. Empty without sheets.
    pub(super) sheets: Vec<u32>,
    /// First triangle of each surface, and the end of the last: triangles of a surface are contiguous, in its own
    /// order.
    pub first_triangle: Vec<u32>,
    /// For each triangle that is a part of its origin, its entry in `within`.
    pub(super) part: Vec<u32>,
    /// Corners of parts, as weights of the corners of the origin.
    pub(super) within: Vec<[[f64; 3]; 3]>,
    /// Surfaces that lie in others.
    pub raised: Vec<Raised>,
}

/// The extent of what counts of a room: lengths below which things coincide follow from this, and not from the rest of the
/// file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    /// Middle, world space.
    pub(crate) centre: DVec3,
    /// Half the diagonal.
    pub(crate) half_size: f64,
}

impl Frame {
    /// The frame of a box.
    pub(crate) fn of(low: DVec3, high: DVec3) -> Self {
        Self {
            centre: 0.5 * (low + high),
            half_size: 0.5 * (high - low).length(),
        }
    }

    /// The frame as numbers for a file.
    pub(crate) fn numbers(self) -> [f64; 4] {
        self.centre.extend(self.half_size).to_array()
    }

    /// The frame of such numbers.
    pub(crate) fn of_numbers([x, y, z, half_size]: [f64; 4]) -> Self {
        let centre = DVec3::new(x, y, z);
        Self { centre, half_size }
    }
}

impl Mesh {
    /// Welds the surfaces of `scene`; those that lie in others are raised. Everything counts.
    pub fn new(scene: &Scene) -> Self {
        Self::framed(scene, None)
    }

    /// [`Mesh::new`] where only what lies in a frame counts.
    pub(crate) fn framed(scene: &Scene, frame: Option<Frame>) -> Self {
        let mesh = Self::welded(scene, &Moves::new(), frame);
        let input: Vec<&[[u32; 3]]> = scene.surfaces.iter().map(|s| &*s.triangles).collect();
        let (raised, moves) = mesh.lying(&input);
        if raised.is_empty() {
            return mesh;
        }
        Self {
            raised,
            ..Self::welded(scene, &moves, frame)
        }
    }

    fn welded(scene: &Scene, moves: &Moves, frame: Option<Frame>) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in scene.surfaces.iter().flat_map(|s| &s.positions) {
            low = low.min(*p);
            high = high.max(*p);
        }
        if low.x > high.x {
            (low, high) = (DVec3::ZERO, DVec3::ZERO);
        }
        let whole = Frame::of(low, high);
        let Frame { centre, half_size } = frame.unwrap_or(whole);
        let mut mesh = Self {
            centre,
            half_size,
            reach: whole.centre.distance(centre) + whole.half_size,
            sheets: (0_u32..)
                .zip(&scene.materials)
                .filter_map(|(k, m)| m.sheet.as_ref().map(|_| k))
                .collect(),
            ..Self::empty()
        };
        let mut welded: HashMap<[u64; 3], u32> = HashMap::new();
        // Sides found so far: corners in their order, starting with the least.
        let mut known: HashSet<[u32; 3]> = HashSet::new();
        for (s, surface) in scene.surfaces.iter().enumerate() {
            let ids: Vec<u32> = surface
                .positions
                .iter()
                .zip(0_u32..)
                .map(|(p, vertex)| {
                    let moved = moves.get(&(s as u32, vertex));
                    let q = *p - centre + moved.copied().unwrap_or_default();
                    // Adding zero turns -0 into +0, so that both weld.
                    let key = (q + DVec3::ZERO).to_array().map(f64::to_bits);
                    *welded.entry(key).or_insert_with(|| {
                        mesh.positions.push(q);
                        mesh.positions.len() as u32 - 1
                    })
                })
                .collect();
            let both = scene.sides(s) == Sides::Both;
            for (t, corners) in surface.triangles.iter().enumerate() {
                let corners = corners.map(|c| ids[c as usize]);
                let [a, b, c] = corners.map(|c| mesh.positions[c as usize]);
                let cross = (b - a).cross(c - a);
                let triangle = mesh.triangles.len() as u32;
                mesh.triangles.push(corners);
                mesh.origin.push((s as u32, t as u32));
                mesh.material.push(surface.material as u32);
                mesh.normal.push(cross.normalize_or_zero());
                mesh.area.push(0.5 * cross.length());
                // A triangle without area blocks nothing and receives nothing; it stays only in the output. So does a
                // repeated triangle: light would meet the place twice.
                if cross.length_squared() > 0.0 {
                    if known.insert(turned_to_least(corners)) {
                        mesh.faces.push(Face {
                            triangle,
                            back: false,
                        });
                    }
                    let [a, b, c] = corners;
                    if both && known.insert(turned_to_least([a, c, b])) {
                        mesh.faces.push(Face {
                            triangle,
                            back: true,
                        });
                    }
                }
            }
            mesh.first_triangle.push(mesh.triangles.len() as u32);
        }
        mesh.plane = plane_ids(&mesh.positions, &mesh.triangles);
        mesh.half = mesh.paired();
        mesh.part = vec![WHOLE; mesh.triangles.len()];
        mesh
    }

    pub(super) fn empty() -> Self {
        Self {
            centre: DVec3::ZERO,
            half_size: 0.0,
            reach: 0.0,
            positions: Vec::new(),
            triangles: Vec::new(),
            origin: Vec::new(),
            material: Vec::new(),
            plane: Vec::new(),
            half: Vec::new(),
            normal: Vec::new(),
            area: Vec::new(),
            faces: Vec::new(),
            sheets: Vec::new(),
            first_triangle: vec![0],
            part: Vec::new(),
            within: Vec::new(),
            raised: Vec::new(),
        }
    }

    /// What blocks rays.
    pub fn index(&self, scene: &Scene) -> RayIndex {
        let positions: Vec<Vec3> = self.positions.iter().map(|p| p.as_vec3()).collect();
        let masks = |m: &u32| matches!(scene.materials[*m as usize].alpha, Alpha::Mask { .. });
        let masked: Vec<bool> = self.material.iter().map(masks).collect();
        RayIndex::build(&positions, &self.triangles, &self.plane, &masked)
            .for_room(self.half_size as f32)
    }

    /// A point of a triangle by its barycentric weights, recentred.
    pub fn at(&self, triangle: usize, [u, v, w]: [f64; 3]) -> DVec3 {
        let [a, b, c] = self.triangles[triangle].map(|v| self.positions[v as usize]);
        a * u + b * v + c * w
    }

    /// Barycentric weights on the input triangle, from those on a triangle of the mesh.
    pub fn on_origin(&self, triangle: usize, weights: [f64; 3]) -> [f64; 3] {
        match self.within.get(self.part[triangle] as usize) {
            None => weights,
            Some(corners) => std::array::from_fn(|k| {
                // Two products at the most where a point lies on an edge of the input: their order does not matter.
                corners.iter().zip(weights).map(|(c, w)| c[k] * w).sum()
            }),
        }
    }

    /// The corner of the input triangle that is corner `k` of a triangle of the mesh.
    pub fn input_corner(&self, triangle: usize, k: usize) -> Option<usize> {
        match self.within.get(self.part[triangle] as usize) {
            None => Some(k),
            Some(corners) => corners[k].iter().position(|&w| w == 1.0),
        }
    }

    /// Of the triangles that were cut from the same triangle of the input as one, that in which a point lies.
    pub fn part_at(&self, triangle: u32, point: DVec3) -> u32 {
        let depth = |t: u32| self.distance_to_border(t as usize, point);
        if self.part[triangle as usize] == WHOLE || depth(triangle) >= 0.0 {
            return triangle;
        }
        let origin = self.origin[triangle as usize];
        let first = self.origin.partition_point(|other| *other < origin);
        let parts = (first..).take_while(|t| self.origin.get(*t) == Some(&origin));
        let deepest = (parts.map(|t| t as u32)).max_by(|a, b| depth(*a).total_cmp(&depth(*b)));
        deepest.unwrap_or(triangle)
    }

    /// [`Self::on_origin`] in single precision, for textures.
    pub fn on_origin_f32(&self, triangle: usize, weights: [f32; 3]) -> [f32; 3] {
        match self.part[triangle] {
            WHOLE => weights,
            _ => self
                .on_origin(triangle, weights.map(f64::from))
                .map(|w| w as f32),
        }
    }

    /// How far a point on a triangle is from its nearest edge.
    pub(super) fn distance_to_border(&self, triangle: usize, at: DVec3) -> f64 {
        let corners = self.triangles[triangle].map(|v| self.positions[v as usize]);
        let to_edge = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let inward = self.normal[triangle].cross((b - a).normalize_or_zero());
            inward.dot(at - a)
        };
        to_edge(0).min(to_edge(1)).min(to_edge(2))
    }

    /// Corners of a face, counter-clockwise seen from that side.
    pub fn corners(&self, face: Face) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[face.triangle as usize].map(|v| self.positions[v as usize]);
        if face.back { [a, c, b] } else { [a, b, c] }
    }

    /// Unit normal of a face, on its own side.
    pub fn face_normal(&self, face: Face) -> DVec3 {
        let n = self.normal[face.triangle as usize];
        if face.back { -n } else { n }
    }
}

/// The same corners in the same sense, starting with the least: equal for equal sides.
fn turned_to_least(mut corners: [u32; 3]) -> [u32; 3] {
    while corners[0] > corners[1] || corners[0] > corners[2] {
        corners.rotate_left(1);
    }
    corners
}
