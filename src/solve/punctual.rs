//! Punctual lights on the hierarchy: gathered at points of every element, with shadows; never linked.

use crate::geometry::{NO_PLANE, Segment};
use crate::hierarchy::{Mesh, Sample, Tree};
use crate::light::lanes::Lanes;
use crate::link::{Sight, Visibility};
use crate::scene::sky::PLACES;
use crate::scene::{LightKind, PunctualLight, Scene};
use crate::team::{Interrupt, Interrupted, Team};
use crate::transport::{Receiver, punctual_factor};
use crate::transport::{SkyScratch, Surroundings};
use std::f64::consts::PI;

/// Points of an element at which a light is gathered.
const POINTS: usize = 4;
/// Leaves below this share of the counted area are left out of the choice of lanes.
const SLIGHT: f64 = 1e-5;
/// Elements that a task looks at.
const CHUNK: usize = 64;

/// Lights that reach a leaf, and the mean factor of each.
type Factors = Vec<(u32, f32)>;

/// For each leaf, the lights that reach it and the mean factor from intensity to irradiance.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shadowed {
    /// (light, factor) lists by leaf.
    pub by_leaf: Vec<Vec<(u32, f32)>>,
    /// Rays cast.
    pub rays: u64,
}

/// Lights of the scene, recentred, with their rows.
pub(crate) fn lamps(scene: &Scene, mesh: &Mesh, lanes: &Lanes) -> Vec<(PunctualLight, Vec<f32>)> {
    scene
        .lights
        .iter()
        .map(|light| {
            let mut row = vec![0.0; lanes.len()];
            lanes.add_emission(light.light, &light.shape, 1.0, &mut row);
            (
                PunctualLight {
                    position: light.position - mesh.centre,
                    ..light.clone()
                },
                row,
            )
        })
        .collect()
}

/// Lights of the scene, recentred.
fn recentred(scene: &Scene, mesh: &Mesh) -> Vec<PunctualLight> {
    scene
        .lights
        .iter()
        .map(|l| PunctualLight {
            position: l.position - mesh.centre,
            ..l.clone()
        })
        .collect()
}

/// Factor of each light at each sample of a leaf; 0 in shadow.
fn at_samples(
    tree: &Tree,
    leaf: u32,
    lights: &[PunctualLight],
    sight: &Sight,
    half_size: f64,
    outside: Option<&Surroundings>,
    look: &mut SkyScratch,
) -> Vec<[f64; POINTS]> {
    let mut samples: Vec<Sample> = Vec::with_capacity(POINTS);
    let corners = tree.elements[tree.node(leaf).element as usize].corners;
    let entry = tree.elements[tree.node(leaf).element as usize].face as usize;
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    // Middle and the corners of a triangle of equal second moments: exact for quadratic variation.
    for p in [
        middle,
        corners[0].lerp(middle, 0.4),
        corners[1].lerp(middle, 0.4),
        corners[2].lerp(middle, 0.4),
    ] {
        samples.push(Sample {
            point: p,
            normal: tree.face_normal[entry],
            plane: tree.face_plane[entry],
            area: 0.0,
        });
    }
    let mut blocked = Vec::new();
    // Sky light changes slowly: its value at the middle stands for the leaf.
    let middle = Receiver {
        point: samples[0].point,
        normal: samples[0].normal,
        plane: samples[0].plane,
        leaf: None,
        seed: u64::from(leaf),
    };
    let dome = outside.map_or([0.0; PLACES], |o| o.lightly(sight, &middle, look));
    lights
        .iter()
        .map(|light| {
            if let Some(place) = light.kind.place() {
                return [dome[place]; POINTS];
            }
            let mut factors = [0.0; POINTS];
            let mut segments = Vec::with_capacity(POINTS);
            let mut which = Vec::with_capacity(POINTS);
            for (k, s) in samples.iter().enumerate() {
                let to = Receiver {
                    point: s.point,
                    normal: s.normal,
                    plane: s.plane,
                    leaf: None,
                    seed: 0,
                };
                if let Some((factor, end)) = punctual_factor(light, &to, half_size) {
                    factors[k] = factor;
                    segments.push(Segment::new(s.point, end, [s.plane, NO_PLANE]));
                    which.push(k);
                }
            }
            if sight.occlusion && !segments.is_empty() {
                sight.blocked(&segments, &Visibility::Crowded, &mut blocked);
                look.rays += segments.len() as u64;
                for (&k, &b) in which.iter().zip(&blocked) {
                    if b {
                        factors[k] = 0.0;
                    }
                }
            }
            factors
        })
        .collect()
}

/// Mean factors for all leaves.
pub(super) fn factors(
    tree: &Tree,
    leaves: &[u32],
    sight: &Sight,
    scene: &Scene,
    mesh: &Mesh,
    outside: Option<&Surroundings>,
    (team, interrupt): (Team, &Interrupt),
) -> Result<Shadowed, Interrupted> {
    let lights = recentred(scene, mesh);
    if lights.is_empty() {
        return Ok(Shadowed {
            by_leaf: vec![Vec::new(); leaves.len()],
            rays: 0,
        });
    }
    let chunks: Vec<&[u32]> = leaves.chunks(CHUNK).collect();
    let parts: Vec<(Vec<Factors>, u64)> = team.map_unless(
        interrupt,
        &chunks,
        || (),
        |(), chunk| {
            let mut look = SkyScratch::default();
            let lists = chunk
                .iter()
                .map(|&leaf| {
                    if tree.share(leaf) < SLIGHT {
                        return Vec::new();
                    }
                    let half = mesh.half_size;
                    at_samples(tree, leaf, &lights, sight, half, outside, &mut look)
                        .iter()
                        .enumerate()
                        .map(|(l, f)| (l as u32, (f.iter().sum::<f64>() / POINTS as f64) as f32))
                        .filter(|&(_, f)| f > 0.0)
                        .collect()
                })
                .collect();
            (lists, look.rays)
        },
    )?;
    let mut out = Shadowed::default();
    for (lists, rays) in parts {
        out.by_leaf.extend(lists);
        out.rays += rays;
    }
    Ok(out)
}

/// Integral of a light's angular distribution: flux is intensity times this (1 where the flux itself is given); none for directional
/// light.
pub(super) fn solid_angle(kind: LightKind) -> Option<f64> {
    match kind {
        LightKind::Point => Some(4.0 * PI),
        // 2 pi integral over the cosine of ((c - c_o) / (c_i - c_o))^2 between the angles, and of 1 inside.
        LightKind::Spot { inner, outer } => {
            Some(2.0 * PI * ((1.0 - inner.cos()) + (inner.cos() - outer.cos()) / 3.0))
        }
        LightKind::Profile | LightKind::Surface => Some(1.0),
        LightKind::Directional | LightKind::Sun | LightKind::Sky(_) | LightKind::Ground(_) => None,
    }
}
