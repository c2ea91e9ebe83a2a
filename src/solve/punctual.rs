//! Punctual lights on the hierarchy: never linked, but gathered at points of every element, with shadows.

use super::lanes::Lanes;
use super::rows::Rows;
use crate::gather::point::{Receiver, punctual_factor};
use crate::geometry::Segment;
use crate::hierarchy::{Mesh, Sample, Tree};
use crate::link::{Closed, Demand, Sight, View};
use crate::scene::{LightKind, PunctualLight, Scene};
use crate::spectrum::Leaves;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Points of an element that a light is looked at from.
const POINTS: usize = 4;
/// Elements that a task looks at.
const CHUNK: usize = 64;

/// For each leaf, the lights that reach it and the mean factor from intensity to irradiance.
#[derive(Debug, Clone, Default)]
pub struct Shadowed {
    /// (light, factor) lists by leaf.
    pub by_leaf: Vec<Vec<(u32, f32)>>,
    /// Rays cast.
    pub rays: u64,
}

impl Shadowed {
    /// Adds the lights' rows to irradiance rows (by leaf).
    pub fn add_to(&self, lamps: &[(PunctualLight, Vec<f32>)], rows: &mut Rows) {
        for (k, list) in self.by_leaf.iter().enumerate() {
            for &(lamp, factor) in list {
                for (x, r) in rows.row_mut(k).iter_mut().zip(&lamps[lamp as usize].1) {
                    *x += factor * r;
                }
            }
        }
    }
}

/// Lights of the scene, recentred, with their rows.
pub fn lamps(scene: &Scene, mesh: &Mesh, lanes: &Lanes) -> Vec<(PunctualLight, Vec<f32>)> {
    scene
        .lights
        .iter()
        .map(|light| {
            let mut row = vec![0.0; lanes.len()];
            lanes.add_emission(light.light, &light.shape, 1.0, &mut row);
            (PunctualLight { position: light.position - mesh.centre, ..light.clone() }, row)
        })
        .collect()
}

/// Lights of the scene, recentred.
fn recentred(scene: &Scene, mesh: &Mesh) -> Vec<PunctualLight> {
    scene.lights.iter().map(|l| PunctualLight { position: l.position - mesh.centre, ..l.clone() }).collect()
}

/// Factor of each light at each sample of a leaf; 0 in shadow.
fn at_samples(tree: &Tree, leaf: u32, lights: &[PunctualLight], sight: &Sight, half_size: f64, rays: &mut u64) -> Vec<[f64; POINTS]> {
    let mut samples: Vec<Sample> = Vec::with_capacity(POINTS);
    let corners = tree.elements[tree.node(leaf).element as usize].corners;
    let entry = tree.elements[tree.node(leaf).element as usize].face as usize;
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    // Middle and the corners of a triangle of equal second moments: exact for quadratic variation.
    for p in [middle, corners[0].lerp(middle, 0.4), corners[1].lerp(middle, 0.4), corners[2].lerp(middle, 0.4)] {
        samples.push(Sample { point: p, normal: tree.face_normal[entry], plane: tree.face_plane[entry], area: 0.0 });
    }
    let mut blocked = Vec::new();
    lights
        .iter()
        .map(|light| {
            let mut factors = [0.0; POINTS];
            let mut segments = Vec::with_capacity(POINTS);
            let mut which = Vec::with_capacity(POINTS);
            for (k, s) in samples.iter().enumerate() {
                let to = Receiver { point: s.point, normal: s.normal, plane: s.plane, leaf: None, seed: 0 };
                if let Some((factor, end)) = punctual_factor(light, &to, half_size) {
                    factors[k] = factor;
                    segments.push(Segment { from: s.point.as_vec3(), to: end.as_vec3(), planes: [s.plane, u32::MAX] });
                    which.push(k);
                }
            }
            if sight.occlusion && !segments.is_empty() {
                sight.blocked(&segments, &View::Crowded, &mut blocked);
                *rays += segments.len() as u64;
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

/// Mean factors for all leaves. In a closed room every light's factors are scaled to its whole flux, if they miss it by
/// less than a fifth (more means that it stands outside or in a fixture).
pub fn factors(tree: &Tree, leaves: &[u32], sight: &Sight, scene: &Scene, mesh: &Mesh, closed: Closed) -> Shadowed {
    let lights = recentred(scene, mesh);
    if lights.is_empty() {
        return Shadowed { by_leaf: vec![Vec::new(); leaves.len()], rays: 0 };
    }
    let parts: Vec<(Vec<Vec<(u32, f32)>>, u64)> = leaves
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut rays = 0;
            let lists = chunk
                .iter()
                .map(|&leaf| {
                    at_samples(tree, leaf, &lights, sight, mesh.half_size, &mut rays)
                        .iter()
                        .enumerate()
                        .map(|(l, f)| (l as u32, (f.iter().sum::<f64>() / POINTS as f64) as f32))
                        .filter(|&(_, f)| f > 0.0)
                        .collect()
                })
                .collect();
            (lists, rays)
        })
        .collect();
    let mut out = Shadowed::default();
    for (lists, rays) in parts {
        out.by_leaf.extend(lists);
        out.rays += rays;
    }
    if closed == Closed::Yes {
        let mut received = vec![0.0; lights.len()];
        for (list, &leaf) in out.by_leaf.iter().zip(leaves) {
            for &(l, f) in list {
                received[l as usize] += f64::from(f) * tree.node(leaf).area;
            }
        }
        let scale: Vec<f32> = lights
            .iter()
            .zip(received)
            .map(|(light, got)| match solid_angle(light.kind) {
                Some(whole) if (got / whole - 1.0).abs() < 0.2 => (whole / got) as f32,
                _ => 1.0,
            })
            .collect();
        for (l, f) in out.by_leaf.iter_mut().flatten() {
            *f *= scale[*l as usize];
        }
    }
    out
}

/// Integral of a light's angular distribution, so that flux is intensity times this; none for directional light.
pub fn solid_angle(kind: LightKind) -> Option<f64> {
    match kind {
        LightKind::Point => Some(4.0 * PI),
        // 2 pi integral over the cosine of ((c - c_o) / (c_i - c_o))^2 between the angles, and of 1 inside.
        LightKind::Spot { inner, outer } => Some(2.0 * PI * ((1.0 - inner.cos()) + (inner.cos() - outer.cos()) / 3.0)),
        LightKind::Directional => None,
    }
}

/// Splits elements over which the punctual lights vary by more than the demand allows.
pub fn refine(tree: &mut Tree, sight: &Sight, scene: &Scene, mesh: &Mesh, demand: &Demand, white: [f64; 3], weights: &[Leaves; 3]) {
    let lights = recentred(scene, mesh);
    if lights.is_empty() {
        return;
    }
    let lanes = Lanes::dense(&scene.spectra, weights);
    let bright: Vec<f64> = self::lamps(scene, mesh, &lanes)
        .iter()
        .map(|(_, row)| super::light::brightness(lanes.tristimulus(row), white))
        .collect();
    let mut open: Vec<u32> = (0..tree.nodes.len() as u32).filter(|&k| tree.node(k).is_leaf()).collect();
    while !open.is_empty() {
        let split: Vec<bool> = open
            .par_iter()
            .map(|&leaf| {
                let node = tree.node(leaf);
                let depth = tree.elements[node.element as usize].depth;
                if node.area <= demand.least_area || depth >= crate::link::MAX_DEPTH {
                    return false;
                }
                let mut total = [0.0; POINTS];
                for (f, b) in at_samples(tree, leaf, &lights, sight, mesh.half_size, &mut 0).iter().zip(&bright) {
                    for (t, f) in total.iter_mut().zip(f) {
                        *t += f * b;
                    }
                }
                let (least, most) = total.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), &t| (l.min(t), m.max(t)));
                0.5 * (most - least) * (node.area / demand.total_area).sqrt() > demand.threshold
            })
            .collect();
        let mut next = Vec::new();
        for (leaf, split) in open.into_iter().zip(split) {
            if split {
                tree.subdivide(leaf);
                next.extend(tree.node(leaf).child_range());
            }
        }
        open = next;
    }
}
