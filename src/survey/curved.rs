//! How much light goes straight onto curved mirrors. From there it goes on as a caustic, which is found only where rays from the points
//! that receive it meet the lamp: not that of lights without extent, of the sun, and of surfaces that shine by a profile.

use super::eyes::Eyes;
use super::lamps::ray_of;
use crate::geometry::NO_PLANE;
use crate::hierarchy::Mirrors;
use crate::scene::{PunctualLight, listed, short};
use std::collections::BTreeSet;

/// Rays of a light: a share of 1 % is found within a tenth of itself.
const RAYS: u32 = 8192;
/// Less than this share of a light is not worth a word: it is below what `--error 1` leaves open.
const LEAST: f64 = 1e-3;

/// What to say of curved mirrors that lights shine on.
pub(super) fn hint(eyes: &Eyes) -> Option<String> {
    let mirrors = Mirrors::new(eyes.scene, &eyes.mesh).filter(Mirrors::has_curved)?;
    let mut materials = BTreeSet::new();
    let lights = eyes.scene.lights.iter().filter(|l| !l.kind.is_dome());
    let said: Vec<String> = lights
        .filter_map(|light| {
            let share = share(eyes, &mirrors, light, &mut materials);
            let per_cent = 100.0 * share;
            (share >= LEAST).then(|| format!("{per_cent:.1} % of '{}'", short(&light.name)))
        })
        .collect();
    let named = |m: usize| format!("'{}'", short(&eyes.scene.materials[m].name));
    let names: Vec<String> = materials.into_iter().map(named).collect();
    (!said.is_empty()).then(|| {
        format!(
            "light goes straight onto curved mirrors ({}): {}; the caustics that it makes from there are left out, and the room is darker \
             by them; \"mirror\": false in the side file makes them matt and keeps the light",
            listed(&names),
            listed(&said)
        )
    })
}

/// Share of a light's rays that meet curved mirrors, of those that meet anything; the mirrors' materials go into `met`.
fn share(eyes: &Eyes, mirrors: &Mirrors, light: &PunctualLight, met: &mut BTreeSet<usize>) -> f64 {
    let (mut curved, mut all) = (0.0, 0.0);
    for k in 0..RAYS {
        let (from, direction, weight) = ray_of(eyes, light, k);
        let Some(hit) = eyes.hit(from, direction, NO_PLANE) else {
            continue;
        };
        all += weight;
        if mirrors.is_curved(&hit) {
            curved += weight;
            met.insert(eyes.mesh.material[hit.triangle as usize] as usize);
        }
    }
    if all > 0.0 { curved / all } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LightKind, Options, Scene};
    use glam::DVec3;

    /// The ball of the room, 1.2 m before a point light, takes its solid angle of the sphere.
    #[test]
    fn the_share_is_that_of_the_solid_angle() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        let load = |name: &str| Scene::load(folder.join(name), &Options::default()).unwrap();
        let mut room = load("mirrored.glb");
        let ball = (room.surfaces.iter())
            .find(|s| room.materials[s.material].name == "chrome")
            .unwrap();
        let low = ball
            .positions
            .iter()
            .fold(DVec3::INFINITY, |a, p| a.min(*p));
        let high = ball
            .positions
            .iter()
            .fold(-DVec3::INFINITY, |a, p| a.max(*p));
        let (middle, radius) = (0.5 * (low + high), 0.5 * (high.y - low.y));
        let away = 3.0 * radius;
        room.lights.truncate(1);
        room.lights[0].kind = LightKind::Point;
        room.lights[0].position = middle + away * DVec3::Y;
        let eyes = Eyes::new(&room);
        let mirrors = Mirrors::new(&room, &eyes.mesh).unwrap();
        let found = share(&eyes, &mirrors, &room.lights[0], &mut BTreeSet::new());
        let want = 0.5 * (1.0 - (1.0 - (radius / away).powi(2)).sqrt());
        // The ball is of facets, which lie within it.
        assert!((found / want - 1.0).abs() < 0.05, "{found} for {want}");
        let said = hint(&eyes).unwrap();
        assert!(
            said.contains("'chrome'") && said.contains("'spot'"),
            "{said}"
        );
        assert!(said.contains(&format!("{:.1} %", 100.0 * found)), "{said}");
        assert_eq!(hint(&Eyes::new(&load("daylit.glb"))), None);
    }
}
