//! What lamps and skies bring to points and patches of the reference, straight.

use super::patch::{Patch, add, point, radon};
use super::ways::Ways;
use crate::geometry::sampling::{cosine_direction, hash, sequence02, triangle_weights};
use crate::hierarchy::Mesh;
use crate::scene::{LightKind, PunctualLight, Scene};
use crate::spectrum::{LEAVES, Leaves};
use glam::DVec3;
use std::f64::consts::PI;

/// Points of a triangle of a lamp with a profile: where a shadow's edge crosses it they are off by about .3 %.
const SHINING_POINTS: u32 = 1024;
/// Rays for the sky of a point: .1 % of open ground's.
const DOME_RAYS: u32 = 1024;

/// Mean irradiance of a patch from punctual lights.
pub(super) fn punctual(scene: &Scene, mesh: &Mesh, ways: &Ways<'_>, patch: &Patch) -> Leaves {
    let mut sum = [0.0; LEAVES];
    for (w, at) in radon() {
        add(
            &mut sum,
            &punctual_at(
                scene,
                mesh,
                ways,
                point(patch, at),
                patch.normal,
                patch.plane,
            ),
            w,
        );
    }
    sum
}

/// Irradiance at a point from punctual lights: `I cos / r^2`.
pub(super) fn punctual_at(
    scene: &Scene,
    mesh: &Mesh,
    ways: &Ways<'_>,
    at: DVec3,
    normal: DVec3,
    plane: u32,
) -> Leaves {
    let mut sum = [0.0; LEAVES];
    for light in &scene.lights {
        let brought = match light.kind {
            LightKind::Sky(_) | LightKind::Ground(_) => {
                dome_at(scene, mesh, ways, at, normal, plane, light.kind.place())
            }
            LightKind::Surface => shining_at(light, mesh, ways, at, normal, plane),
            _ => from_a_place(light, mesh, ways, at, normal, plane),
        };
        let power = &scene.spectra[light.light].power;
        for l in 0..LEAVES {
            sum[l] += brought[l] * power[l] * light.shape[l];
        }
    }
    sum
}

/// What a light without extent brings for a unit of what it gives out.
fn from_a_place(
    light: &PunctualLight,
    mesh: &Mesh,
    ways: &Ways<'_>,
    at: DVec3,
    normal: DVec3,
    plane: u32,
) -> Leaves {
    let parallel = light.kind.is_parallel();
    let end = match parallel {
        true => at - light.direction * (4.0 * mesh.half_size),
        false => light.position - mesh.centre,
    };
    let toward = (end - at).normalize_or_zero();
    let spread = match light.kind {
        LightKind::Profile => {
            let spread = light.luminaire.as_ref();
            spread.map_or(0.0, |l| l.per_lumen(-toward))
        }
        LightKind::Spot { inner, outer } => {
            let (cos, i, o) = (-light.direction.dot(toward), inner.cos(), outer.cos());
            ((cos - o) / (i - o).max(1e-3)).clamp(0.0, 1.0).powi(2)
        }
        _ => 1.0,
    };
    let square = if parallel {
        1.0
    } else {
        end.distance_squared(at)
    };
    let factor = normal.dot(toward) * spread / square;
    let mut sum = [0.0; LEAVES];
    if factor > 0.0 && factor.is_finite() {
        ways.bring(&mut sum, factor, at, end, plane);
    }
    sum
}

/// What turns the flux of a lamp with an extent into irradiance: many points, a ray to each.
fn shining_at(
    light: &PunctualLight,
    mesh: &Mesh,
    ways: &Ways<'_>,
    at: DVec3,
    normal: DVec3,
    plane: u32,
) -> Leaves {
    let mut sum = [0.0; LEAVES];
    let Some(luminaire) = &light.luminaire else {
        return sum;
    };
    for (k, &[a, b, c]) in luminaire.triangles().iter().enumerate() {
        let cross = (b - a).cross(c - a);
        let own = cross.normalize_or_zero();
        let shift = hash(k as u64, 0);
        for n in 0..SHINING_POINTS {
            let w = triangle_weights(sequence02(n, shift));
            let from = a * w[0] + b * w[1] + c * w[2] + light.position - mesh.centre;
            let (way, r2) = ((from - at).normalize_or_zero(), from.distance_squared(at));
            let sent = luminaire.per_area(-way, own) * normal.dot(way).max(0.0) / r2;
            let before = from + own * (1e-5 * mesh.half_size);
            if sent > 0.0 {
                let part = sent * 0.5 * cross.length() / f64::from(SHINING_POINTS);
                ways.bring(&mut sum, part, at, before, plane);
            }
        }
    }
    sum
}

/// Irradiance of a point by a sky that gives open level ground 1, or by ground that sends out 1: the mean over many directions.
fn dome_at(
    scene: &Scene,
    mesh: &Mesh,
    ways: &Ways<'_>,
    at: DVec3,
    normal: DVec3,
    plane: u32,
    place: Option<usize>,
) -> Leaves {
    let mut sum = [0.0; LEAVES];
    let Some(sky) = &scene.sky else { return sum };
    for k in 0..DOME_RAYS {
        let d = cosine_direction(normal, sequence02(k, 0));
        if let Some(radiance) = sky.part(place, d) {
            let end = at + d * (4.0 * mesh.half_size);
            let part = PI * radiance / f64::from(DOME_RAYS);
            ways.bring(&mut sum, part, at, end, plane);
        }
    }
    sum
}
