//! What a ray meets in a room: a front that takes light, a back that does not, or nothing.

use crate::geometry::{Hit, NO_PLANE, RayIndex};
use crate::hierarchy::Mesh;
use crate::hierarchy::alpha::is_hole;
use crate::scene::{Scene, Sides};
use glam::DVec3;

/// What was met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SurveyHit {
    /// A side of this surface that takes part.
    Front(usize),
    /// The black back of this surface.
    Back(usize),
    /// Both sides of this surface take part: met from behind.
    Behind(usize),
    /// The ray leaves the room.
    Nothing,
}

/// Rays in a room.
pub(super) struct Eyes<'a> {
    pub(super) scene: &'a Scene,
    pub(super) mesh: Mesh,
    rays: RayIndex,
}

impl<'a> Eyes<'a> {
    pub(super) fn new(scene: &'a Scene) -> Self {
        let mesh = Mesh::new(scene);
        let rays = mesh.index(scene);
        Self { scene, mesh, rays }
    }

    /// Looks from a point (world space) into a direction; what lies in `plane` is passed over.
    pub(super) fn look(&self, from: DVec3, direction: DVec3, plane: u32) -> SurveyHit {
        let Some(hit) = self.hit(from, direction, plane) else {
            return SurveyHit::Nothing;
        };
        let surface = self.mesh.origin[hit.triangle as usize].0 as usize;
        match (hit.from_behind, self.scene.sides(surface)) {
            (false, _) => SurveyHit::Front(surface),
            (true, Sides::Both) => SurveyHit::Behind(surface),
            (true, Sides::Front) => SurveyHit::Back(surface),
        }
    }

    /// The same, and which triangle that is.
    pub(super) fn hit(&self, from: DVec3, direction: DVec3, plane: u32) -> Option<Hit> {
        let from = from - self.mesh.centre;
        // Past all of the room, from wherever the point is.
        let reach = (from.length() + 2.0 * self.mesh.half_size) as f32;
        let solid =
            |t: u32, u: f32, v: f32| !is_hole(self.scene, &self.mesh, t, [1.0 - u - v, u, v]);
        let (from, direction) = (from.as_vec3(), direction.as_vec3());
        self.rays
            .closest_with(from, direction, reach, plane, &solid)
    }

    /// The same from a point in the air.
    pub(super) fn look_around(&self, from: DVec3, direction: DVec3) -> SurveyHit {
        self.look(from, direction, NO_PLANE)
    }
}
