//! Rays from lamps, distributed as the lamps send light.

use super::room::Room;
use crate::geometry::NO_PLANE;
use crate::geometry::sampling::{
    Pcg, around, cosine_direction, hash, sequence02, sphere_direction, triangle_weights,
};
use crate::hierarchy::Tree;
use crate::light::lanes::Lanes;
use crate::scene::{LightKind, PunctualLight};
use glam::DVec3;

/// Distance before a surface at which rays start, share of the room's half size.
const OFF: f64 = 1e-5;

impl Room {
    /// Lamps with their tristimulus flux, except those that shine from far away.
    pub(super) fn sending(&self, tree: &Tree, lanes: &Lanes) -> Vec<([f64; 3], LampSource<'_>)> {
        let exitance: Vec<[f64; 3]> = (self.scene.materials.iter())
            .map(|m| lanes.exitance(m.even_emission()))
            .collect();
        let faces = (0..tree.faces.len()).filter_map(|entry| {
            let triangle = tree.faces[entry].triangle as usize;
            let exitance = exitance[self.mesh.material[triangle] as usize];
            let flux = exitance.map(|x| x * self.mesh.area[triangle]);
            (flux[1] > 0.0).then_some((flux, LampSource::Face(entry)))
        });
        let mut lamps: Vec<_> = faces.collect();
        for light in &self.scene.lights {
            let Some(solid) = super::punctual::solid_angle(light.kind) else {
                continue;
            };
            let flux = lanes.emission(light.light, &light.shape, solid);
            if flux[1] > 0.0 {
                lamps.push((flux, LampSource::Punctual(light)));
            }
        }
        lamps
    }
}

/// A source of light.
#[derive(Clone, Copy)]
pub(super) enum LampSource<'a> {
    /// An entry of the hierarchy's faces.
    Face(usize),
    Punctual(&'a PunctualLight),
}

impl LampSource<'_> {
    /// Start, direction and plane of the `k`-th ray, and its weight: 1 in the mean.
    pub(super) fn ray(self, room: &Room, tree: &Tree, k: u32) -> (DVec3, DVec3, u32, f64) {
        // Two shifts of one sequence are correlated.
        let mut random = Pcg::new(hash(13, u64::from(k)));
        let (u, v) = (sequence02(k, 11), [random.f64(), random.f64()]);
        match self {
            LampSource::Face(entry) => {
                let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
                let direction = cosine_direction(tree.face_normal[entry], v);
                (
                    element.at(triangle_weights(u)),
                    direction,
                    tree.face_plane[entry],
                    1.0,
                )
            }
            LampSource::Punctual(light) => {
                let place = light.position - room.mesh.centre;
                if let Some(luminaire) = &light.luminaire {
                    let ray = luminaire.ray(u, v);
                    let (start, direction, weight) = ray.unwrap_or((DVec3::ZERO, DVec3::Y, 0.0));
                    // Start off the surface, so that the ray does not meet it.
                    let start = start + direction * (OFF * room.mesh.half_size);
                    return (place + start, direction, NO_PLANE, weight);
                }
                let direction = match light.kind {
                    LightKind::Spot { inner, outer } => {
                        around(light.direction, cosine_of_spot(inner, outer, v[0]), v[1])
                    }
                    _ => sphere_direction(v),
                };
                (place, direction, NO_PLANE, 1.0)
            }
        }
    }
}

/// Cosine of the angle within which a spot sends the share 1 - `u` of its flux. The intensity is 1 up to the inner angle and
/// falls with `((c - c_o) / (c_i - c_o))^2` to the outer one (KHR_lights_punctual).
fn cosine_of_spot(inner: f64, outer: f64, u: f64) -> f64 {
    let (inner, outer) = (inner.cos(), outer.cos());
    let core = 1.0 - inner;
    let rim = (inner - outer) / 3.0;
    let left = u * (core + rim);
    if left < rim {
        outer + (inner - outer) * (left / rim).cbrt()
    } else {
        inner + (left - rim).min(core)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_of_a_spot_lie_as_its_intensity_does() {
        let (inner, outer) = (0.4_f64, 0.9_f64);
        let (c_i, c_o) = (inner.cos(), outer.cos());
        let total = (1.0 - c_i) + (c_i - c_o) / 3.0;
        for (to, flux) in [
            (c_i, (c_i - c_o) / 3.0 / total),
            (0.5 * (c_i + c_o), (c_i - c_o) / 24.0 / total),
        ] {
            let below = (0..1000)
                .filter(|&k| cosine_of_spot(inner, outer, (f64::from(k) + 0.5) / 1000.0) < to);
            assert!((below.count() as f64 / 1000.0 - flux).abs() < 2e-3);
        }
    }
}
