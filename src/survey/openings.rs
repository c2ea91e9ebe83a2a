//! Is the room open to a sky that nobody describes? Rays from its fronts tell. None is invented: all that is outside is black, and
//! that is said.

use super::eyes::{Eyes, SurveyHit};
use crate::geometry::sampling::{Pcg, cosine_direction, triangle_weights};
use glam::DVec3;

/// Rays: a share of .1 % is found within a third of itself.
const RAYS: usize = 8192;
/// Less than this share is a gap between walls, not an opening.
const LEAST: f64 = 1e-3;

/// What to say of a room with openings and without a sky.
pub(super) fn hint(eyes: &Eyes) -> Option<String> {
    if eyes.scene.sky.is_some() {
        return None;
    }
    let share = share(eyes);
    (share >= LEAST).then(|| {
        let per_cent = 100.0 * share;
        format!(
            "{per_cent:.1} % of the light from its surfaces leaves it: the room is open to a sky that the file does not describe, \
             and stays dark there; --sky overcast lights it"
        )
    })
}

/// Share of the rays from fronts that leave the room.
fn share(eyes: &Eyes) -> f64 {
    let fronts = Fronts::new(eyes);
    let leaves = |ray: &FrontRay| fronts.leaves(ray, ray.direction);
    let away = fronts.rays(RAYS).filter(leaves).count();
    away as f64 / RAYS as f64
}

/// A ray from a front: where it starts, its direction, and the plane that it starts from.
pub(super) struct FrontRay {
    from: DVec3,
    pub(super) direction: DVec3,
    pub(super) normal: DVec3,
    plane: u32,
}

/// The sides of a room that take light.
pub(super) struct Fronts<'a> {
    eyes: &'a Eyes<'a>,
    /// Area of the faces up to each.
    sums: Vec<f64>,
}

impl<'a> Fronts<'a> {
    pub(super) fn new(eyes: &'a Eyes) -> Self {
        let mesh = &eyes.mesh;
        let mut area = 0.0;
        let sums = mesh.faces.iter().map(|face| {
            area += mesh.area[face.triangle as usize];
            area
        });
        let sums = sums.collect();
        Self { eyes, sums }
    }

    /// Rays from points evenly over the fronts, in directions as they send light.
    pub(super) fn rays(&self, count: usize) -> impl Iterator<Item = FrontRay> {
        let mesh = &self.eyes.mesh;
        let mut random = Pcg::new(0x0be7);
        let area = self.sums.last().copied().unwrap_or(0.0);
        (0..count).filter_map(move |k| {
            let target = (k as f64 + random.f64()) / count as f64 * area;
            let entry = self.sums.partition_point(|&sum| sum <= target);
            let face = mesh
                .faces
                .get(entry.min(self.sums.len().saturating_sub(1)))?;
            let [a, b, c] = mesh.corners(*face);
            let w = triangle_weights([random.f64(), random.f64()]);
            let normal = mesh.face_normal(*face);
            Some(FrontRay {
                from: a * w[0] + b * w[1] + c * w[2] + mesh.centre,
                direction: cosine_direction(normal, [random.f64(), random.f64()]),
                normal,
                plane: mesh.plane[face.triangle as usize],
            })
        })
    }

    /// Does it leave the room if it goes in this direction?
    pub(super) fn leaves(&self, ray: &FrontRay, direction: DVec3) -> bool {
        self.eyes.look(ray.from, direction, ray.plane) == SurveyHit::Nothing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Options, Scene};

    #[test]
    fn openings_are_told_with_their_share() {
        let room = |name: &str| {
            let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
            Scene::load(folder.join("scenes").join(name), &Options::default()).unwrap()
        };
        let open = hint(&Eyes::new(&room("cornell.glb"))).unwrap();
        assert!(open.contains("--sky overcast"), "{open}");
        assert_eq!(hint(&Eyes::new(&room("cornell-closed.glb"))), None);
        assert_eq!(hint(&Eyes::new(&room("convex.glb"))), None);
    }
}
