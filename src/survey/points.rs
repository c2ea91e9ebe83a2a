//! Where a point lies: in the room, inside something solid, or outside.
//!
//! Rays tell, in all directions from a point just above the given one (a sensor lies on a desk, not in it): a point that
//! mostly sees black backs and hardly a way out is inside something; one that sees neither backs nor fronts to speak of,
//! or as much of nothing as of backs (below the floor), is outside. Surfaces whose both sides take part show no back, so
//! a solid made of them cannot be told from a room.

use super::eyes::{Eyes, SurveyHit};
use crate::geometry::sampling::{sequence02, sphere_direction};
use crate::scene::Scene;
use glam::DVec3;

/// Rays a point: in each half of any cut through the sphere there are about half of them.
const RAYS: u32 = 64;
/// Eighths of the rays that meet fronts in a room: on a floor without walls it is half of them, but for noise.
const ROOM: u32 = 3;
/// How far above its plane a point is looked from, as a share of half the room's diagonal: some millimetres.
const ABOVE: f64 = 1e-4;

/// Where a point is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointLocation {
    /// Where light may come.
    Room,
    /// Its rays meet backs.
    Inside,
    /// Its rays meet nothing, or faces that look away.
    Outside,
}

impl PointLocation {
    /// `room`, `inside`, `outside`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Room => "room",
            Self::Inside => "inside",
            Self::Outside => "outside",
        }
    }
}

/// Where points (world space, with unit normals) are.
pub fn places(scene: &Scene, points: &[(DVec3, DVec3)]) -> Vec<PointLocation> {
    let eyes = Eyes::new(scene);
    let step = ABOVE * eyes.mesh.half_size;
    let of = |&(point, normal): &(DVec3, DVec3)| {
        let from = point + step * normal;
        let (mut backs, mut escapes) = (0, 0);
        for k in 0..RAYS {
            match eyes.look_around(from, sphere_direction(sequence02(k, 0))) {
                SurveyHit::Back(_) => backs += 1,
                SurveyHit::Nothing => escapes += 1,
                SurveyHit::Front(_) | SurveyHit::Behind(_) => {}
            }
        }
        let fronts = RAYS - backs - escapes;
        let enclosed = 2 * escapes < backs;
        if 2 * backs > RAYS && enclosed {
            PointLocation::Inside
        } else if 8 * fronts >= ROOM * RAYS {
            PointLocation::Room
        } else if enclosed {
            PointLocation::Inside
        } else {
            PointLocation::Outside
        }
    };
    points.iter().map(of).collect()
}
