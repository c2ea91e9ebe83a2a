//! Where light goes in a room: paths from its lamps, and which places they end at.

use crate::geometry::sampling::{
    around, cosine_direction, hash, on_triangle, sequence02, sphere_direction, tangents,
};
use crate::geometry::{NO_PLANE, RayIndex};
use crate::hierarchy::alpha::is_hole;
use crate::hierarchy::{Face, Mesh};
use crate::scene::{LightKind, Scene, Sides};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashSet;

/// Paths from lamps: 12 k rays, some hundredths of a second in a room of 100,000 triangles.
const PATHS: u32 = 3072;
const BOUNCES: u32 = 3;
/// Directions that stand for half a sky.
const DOME: u32 = 32;
/// Fewer segments than this are few.
pub(super) const FEW: usize = 96;
/// Cells that are lit or not: this many to half the room's diagonal.
const CELLS: f64 = 12.0;
/// Backs that a ray passes at the most.
const PASSED: usize = 8;

/// What a ray meets.
#[derive(Debug, Clone, Copy)]
pub(super) struct PathHit {
    pub(super) direction: DVec3,
    pub(super) distance: f64,
    pub(super) point: DVec3,
    /// Out of the side that was met.
    pub(super) normal: DVec3,
    pub(super) surface: u32,
    pub(super) plane: u32,
    pub(super) lamp: bool,
}

/// The ends of a segment of light's path.
pub(super) type Leg = [DVec3; 2];

/// A room, with what is known of its light.
pub(super) struct LitRoom<'a> {
    pub(super) scene: &'a Scene,
    pub(super) mesh: Mesh,
    pub(super) rays: RayIndex,
    /// Cells in which paths ended; empty: everything counts as lit.
    lit: HashSet<[i64; 4]>,
    /// The first end in each cell.
    pub(super) places: Vec<PathHit>,
    /// Free path.
    pub(super) path: f64,
}

impl<'a> LitRoom<'a> {
    /// Follows light through a room; returns segments that it runs along, see [`Self::explore`].
    pub(super) fn new(scene: &'a Scene) -> (Self, Vec<Leg>) {
        let mesh = Mesh::new(scene);
        let rays = mesh.index(scene);
        let mut room = Self {
            scene,
            mesh,
            rays,
            lit: HashSet::new(),
            places: Vec::new(),
            path: 1.0,
        };
        let legs = room.explore();
        (room, legs)
    }

    fn sides(&self, triangle: u32) -> Sides {
        self.scene
            .sides(self.mesh.origin[triangle as usize].0 as usize)
    }

    /// The first side that is drawn, and whether a back was met before.
    pub(super) fn see(&self, from: DVec3, direction: DVec3, plane: u32) -> (Option<PathHit>, bool) {
        let solid =
            |t: u32, u: f32, v: f32| !is_hole(self.scene, &self.mesh, t, [1.0 - u - v, u, v]);
        let reach = from.length() + 2.0 * self.mesh.half_size;
        let (mut gone, mut plane, mut backs) = (0.0, plane, false);
        for _ in 0..PASSED {
            let start = from + direction * gone;
            let hit = self.rays.closest_with(
                start.as_vec3(),
                direction.as_vec3(),
                (reach - gone) as f32,
                plane,
                &solid,
            );
            let Some(hit) = hit else { break };
            let t = hit.triangle as usize;
            gone += f64::from(hit.t);
            if hit.from_behind && self.sides(hit.triangle) == Sides::Front {
                backs = true;
                plane = self.mesh.plane[t];
                continue;
            }
            let normal = self.mesh.normal[t];
            let surface = self.mesh.origin[t].0;
            let material = self.mesh.material[t] as usize;
            let met = PathHit {
                direction,
                distance: gone,
                point: from + direction * gone,
                normal: if hit.from_behind { -normal } else { normal },
                surface,
                plane: self.mesh.plane[t],
                lamp: self.scene.materials[material].emission.is_some(),
            };
            return (Some(met), backs);
        }
        (None, backs)
    }

    /// Follows light; returns segments that it runs along, starts of suns' left out: those that end where none did before,
    /// so that small and dim spaces have theirs, unless these are few.
    fn explore(&mut self) -> Vec<Leg> {
        let starts = self.starts();
        let lamps = !starts.is_empty();
        let starts = if lamps { starts } else { self.anywhere() };
        let paths: Vec<Vec<(Option<Leg>, PathHit)>> = (0..PATHS)
            .into_par_iter()
            .filter(|_| !starts.is_empty())
            .map(|k| self.follow(&starts, k))
            .collect();
        let (mut all, mut first) = (Vec::new(), Vec::new());
        for (leg, met) in paths.into_iter().flatten() {
            all.extend(leg);
            if self.lit.insert(self.cell(&met)) {
                self.places.push(met);
                first.extend(leg);
            }
        }
        if !lamps {
            self.lit.clear();
        }
        let mut lengths: Vec<f64> = all.iter().map(|[a, b]| a.distance(*b)).collect();
        lengths.sort_by(f64::total_cmp);
        if let Some(length) = lengths.get(lengths.len() / 2) {
            self.path = length.max(f64::MIN_POSITIVE);
        }
        if first.len() >= FEW { first } else { all }
    }

    fn follow(&self, starts: &[Start], k: u32) -> Vec<(Option<Leg>, PathHit)> {
        let (turn, which) = (k / starts.len() as u32, k as usize % starts.len());
        let start = starts[which];
        let mut ends = Vec::new();
        let (mut from, mut direction, mut plane) = start.ray(self, turn, which as u64);
        for bounce in 0..=BOUNCES {
            let (Some(met), false) = self.see(from, direction, plane) else {
                break;
            };
            let has_leg = bounce > 0 || !start.is_sun();
            ends.push((has_leg.then_some([from, met.point]), met));
            let square = sequence02(k, hash(u64::from(bounce) + 1, 0x5eed));
            (from, plane) = (met.point, met.plane);
            direction = cosine_direction(met.normal, square);
        }
        ends
    }

    /// Where light starts: every emitting triangle and light. Suns take turns with the rest.
    fn starts(&self) -> Vec<Start> {
        let mesh = &self.mesh;
        let emits = |&&face: &&Face| {
            let material = mesh.material[face.triangle as usize] as usize;
            self.scene.materials[material].emission.is_some()
        };
        let faces: Vec<_> = mesh.faces.iter().filter(emits).copied().collect();
        let whole: f64 = faces.iter().map(|f| mesh.area[f.triangle as usize]).sum();
        let (mut suns, mut near) = (Vec::new(), Vec::new());
        for light in &self.scene.lights {
            let place = light.position - mesh.centre;
            match light.kind {
                LightKind::Directional | LightKind::Sun => suns.push(Start::Sun(light.direction)),
                LightKind::Sky(_) => suns.extend(dome(DVec3::Y)),
                LightKind::Ground(_) => suns.extend(dome(DVec3::NEG_Y)),
                LightKind::Point | LightKind::Profile => near.push(Start::Lamp(place)),
                // Its faces are among those that emit.
                LightKind::Surface => {}
                LightKind::Spot { outer, .. } => {
                    near.push(Start::Spot(place, light.direction, outer.cos()));
                }
            }
        }
        // As many starts as paths at the most: of emitting faces every n-th by area.
        let count = faces.len().min(PATHS as usize / 2);
        let (mut k, mut passed) = (0, 0.0);
        for n in 0..count {
            let wanted = whole * (n as f64 + 0.5) / count as f64;
            let area = |k: usize| mesh.area[faces[k].triangle as usize];
            while k + 1 < faces.len() && passed + area(k) < wanted {
                passed += area(k);
                k += 1;
            }
            near.push(Start::Face(faces[k]));
        }
        match (suns.len(), near.len()) {
            (0, _) => near,
            (_, 0) => suns,
            (s, n) => (0..2 * s.max(n))
                .map(|k| match k % 2 {
                    0 => suns[k / 2 % s],
                    _ => near[k / 2 % n],
                })
                .collect(),
        }
    }

    /// Starts where no lamp is known: all faces, by area.
    fn anywhere(&self) -> Vec<Start> {
        let mesh = &self.mesh;
        let area = |k: usize| mesh.area[mesh.faces[k].triangle as usize];
        let whole: f64 = (0..mesh.faces.len()).map(area).sum();
        let (mut k, mut passed, mut starts) = (0, 0.0, Vec::new());
        for n in 0..PATHS.min(1024) {
            let wanted = whole * (f64::from(n) + 0.5) / 1024.0;
            while k + 1 < mesh.faces.len() && passed + area(k) < wanted {
                passed += area(k);
                k += 1;
            }
            starts.extend(mesh.faces.get(k).copied().map(Start::Face));
        }
        starts
    }

    /// The cell of an end: its place and which way it looks.
    fn cell(&self, met: &PathHit) -> [i64; 4] {
        let size = (self.mesh.half_size / CELLS).max(f64::MIN_POSITIVE);
        let [x, y, z] = (met.point / size).to_array().map(|c| c.floor() as i64);
        [x, y, z, axis(met.normal)]
    }

    pub(super) fn is_lit(&self, met: &PathHit) -> bool {
        self.lit.is_empty() || self.lit.contains(&self.cell(met))
    }
}

/// Light from all over the half of directions about `pole`, as from so many suns.
fn dome(pole: DVec3) -> impl Iterator<Item = Start> {
    (0..DOME).map(move |k| Start::Sun(-cosine_direction(pole, sequence02(k, 0))))
}

/// Which way a normal looks, of six.
pub(super) fn axis(normal: DVec3) -> i64 {
    let a = normal.abs();
    let (k, component) = if a.x >= a.y && a.x >= a.z {
        (0, normal.x)
    } else if a.y >= a.z {
        (1, normal.y)
    } else {
        (2, normal.z)
    };
    2 * k + i64::from(component < 0.0)
}

/// Where a path starts.
#[derive(Debug, Clone, Copy)]
enum Start {
    Face(Face),
    Lamp(DVec3),
    /// Place, direction, cosine of the half angle.
    Spot(DVec3, DVec3, f64),
    /// Direction.
    Sun(DVec3),
}

impl Start {
    fn is_sun(&self) -> bool {
        matches!(self, Self::Sun(_))
    }

    /// From, direction, plane that is left.
    fn ray(&self, room: &LitRoom, k: u32, seed: u64) -> (DVec3, DVec3, u32) {
        let [u, v] = [0, 1].map(|turn| sequence02(k, hash(seed, turn)));
        match *self {
            Self::Face(face) => {
                let triangle = face.triangle as usize;
                let from = on_triangle(&room.mesh.corners(face), u);
                let direction = cosine_direction(room.mesh.face_normal(face), v);
                (from, direction, room.mesh.plane[triangle])
            }
            Self::Lamp(from) => (from, sphere_direction(u), NO_PLANE),
            Self::Spot(from, axis, cosine) => {
                let cosine = 1.0 - u[0] * (1.0 - cosine);
                (from, around(axis, cosine, u[1]), NO_PLANE)
            }
            Self::Sun(direction) => {
                let [a, b] = tangents(direction);
                let [x, y] = u.map(|x| (2.0 * x - 1.0) * room.mesh.half_size);
                let from = a * x + b * y - direction * (2.0 * room.mesh.half_size);
                (from, direction, NO_PLANE)
            }
        }
    }
}
