//! Is the room open to a sky that nobody describes? Rays from its fronts tell. None is invented: all that is outside is black, and
//! that is said.

use super::eyes::{Eyes, Met};
use crate::geometry::sampling::{Pcg, cosine_direction, triangle_weights};

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
    let mesh = &eyes.mesh;
    let mut sums = Vec::with_capacity(mesh.faces.len());
    let mut area = 0.0;
    for face in &mesh.faces {
        area += mesh.area[face.triangle as usize];
        sums.push(area);
    }
    let mut random = Pcg::new(0x0be7);
    let mut away = 0;
    for k in 0..RAYS {
        let target = (k as f64 + random.f64()) / RAYS as f64 * area;
        let entry = sums.partition_point(|&sum| sum <= target);
        let Some(face) = mesh.faces.get(entry.min(sums.len().saturating_sub(1))) else {
            return 0.0;
        };
        let [a, b, c] = mesh.corners(*face);
        let w = triangle_weights([random.f64(), random.f64()]);
        let from = a * w[0] + b * w[1] + c * w[2] + mesh.centre;
        let direction = cosine_direction(mesh.face_normal(*face), [random.f64(), random.f64()]);
        let plane = mesh.plane[face.triangle as usize];
        away += usize::from(eyes.look(from, direction, plane) == Met::Nothing);
    }
    away as f64 / RAYS as f64
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
