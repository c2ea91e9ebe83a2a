//! Lamps that emit from a surface by a profile: their irradiance at a point, near and far.
//!
//! `E(p) = Phi int i(p - x, n(x)) cos / r^2 V dA`, with `i` the intensity over flux and area of an element
//! ([`Luminaire::per_area`](crate::scene::luminaires::Luminaire::per_area)). The surface is divided until no part is near the point; each
//! part has a rule of seven points, or three where it is far. Where little stands between, the visible part is the surface less its shadows,
//! exactly; else rays to parts chosen by their irradiance find the visible share.

use super::gatherer::{Gatherer, Memory};
use super::receiver::Receiver;
use crate::geometry::sampling::{hash, sequence02, triangle_weights};
use crate::geometry::{NO_PLANE, Segment, lambert_polygon, quarters};
use crate::light::Passage;
use crate::link::{PIECES, Visibility, open_weight};
use crate::scene::PunctualLight;
use crate::scene::luminaires::Luminaire;
use glam::DVec3;

/// A part nearer than this many of its radii is divided: the rule of seven points then errs by less than .01 % for a
/// square panel.
const NEAR: f64 = 2.0;
/// Beyond this many of its radii three points (a rule of degree 2) are as good.
const FAR: f64 = 8.0;
/// Parts of a triangle at the most.
const PARTS: usize = 64;
/// Lamps of more triangles are seen by rays alone.
const FEW: usize = 16;
/// Distance before the surface at which rays end, share of the room's half size: f32 positions are off by 1e-7 of that.
const BEFORE: f64 = 1e-5;

/// Points of a triangle and their weights, exact to degree 5 (Radon 1948; Cowper 1973).
const SEVEN: [([f64; 3], f64); 7] = {
    const THIRD: f64 = 1.0 / 3.0;
    const A: f64 = 0.470_142_064_105_115;
    const B: f64 = 0.101_286_507_323_456;
    const W: [f64; 3] = [0.225, 0.132_394_152_788_506, 0.125_939_180_544_827];
    [
        ([THIRD; 3], W[0]),
        ([1.0 - 2.0 * A, A, A], W[1]),
        ([A, 1.0 - 2.0 * A, A], W[1]),
        ([A, A, 1.0 - 2.0 * A], W[1]),
        ([1.0 - 2.0 * B, B, B], W[2]),
        ([B, 1.0 - 2.0 * B, B], W[2]),
        ([B, B, 1.0 - 2.0 * B], W[2]),
    ]
};
/// Three points and their weights, exact to degree 2 (Cowper 1973).
const THREE: [([f64; 3], f64); 3] = {
    const A: f64 = 1.0 / 6.0;
    const B: f64 = 2.0 / 3.0;
    [
        ([B, A, A], 1.0 / 3.0),
        ([A, B, A], 1.0 / 3.0),
        ([A, A, B], 1.0 / 3.0),
    ]
};

/// A part of a lamp, not near the point, and the factor from the lamp's flux to the irradiance by the part.
#[derive(Debug, Clone, Copy)]
struct Part {
    corners: [DVec3; 3],
    normal: DVec3,
    brings: f64,
}

impl Part {
    /// A random point of the part, and its weight: 1 in the mean.
    fn point(&self, luminaire: &Luminaire, to: &Receiver, uv: [f64; 2]) -> (DVec3, f64) {
        let [a, b, c] = self.corners;
        let at = mix(&self.corners, triangle_weights(uv));
        let area = 0.5 * (b - a).cross(c - a).length();
        (
            at,
            area * density(luminaire, at, self.normal, to) / self.brings,
        )
    }
}

fn mix(&[a, b, c]: &[DVec3; 3], w: [f64; 3]) -> DVec3 {
    a * w[0] + b * w[1] + c * w[2]
}

/// Irradiance by a place of a lamp, per area; 0 if it is turned away.
fn density(luminaire: &Luminaire, at: DVec3, normal: DVec3, to: &Receiver) -> f64 {
    let way = to.point - at;
    let square = way.length_squared();
    let cosine = -to.normal.dot(way) / square.sqrt();
    if cosine <= 0.0 || cosine.is_nan() {
        return 0.0;
    }
    luminaire.per_area(way / square.sqrt(), normal) * cosine / square
}

/// [`density`] of a place that is equally bright from all directions: cosines over the square of the distance.
fn even(at: DVec3, normal: DVec3, to: &Receiver) -> f64 {
    let way = to.point - at;
    let square = way.length_squared();
    let cosines = [-to.normal.dot(way), normal.dot(way)].map(|x| x.max(0.0));
    cosines[0] * cosines[1] / square.powi(2).max(f64::MIN_POSITIVE)
}

/// Triangles of a lamp that face a point and lie above its horizon, lifted off their surface, with their normals.
fn facing(
    lamp: &PunctualLight,
    luminaire: &Luminaire,
    to: &Receiver,
    half_size: f64,
) -> Vec<([DVec3; 3], DVec3)> {
    let lift = BEFORE * half_size;
    let lifted = luminaire.triangles().iter().filter_map(|&[a, b, c]| {
        let normal = (b - a).cross(c - a).try_normalize()?;
        let corners = [a, b, c].map(|p| p + lamp.position + lift * normal);
        let faces = normal.dot(to.point - corners[0]) > 0.0;
        let above = |p: &DVec3| (*p - to.point).dot(to.normal) > 0.0;
        (faces && corners.iter().any(above)).then_some((corners, normal))
    });
    lifted.collect()
}

/// Divides a triangle, the nearest part first, until no part is near or there are [`PARTS`], and adds the parts that bring
/// something. Near ones use the exact form factor, so that only the variation of the profile over a part is left to the rule.
fn split(
    luminaire: &Luminaire,
    (triangle, normal): ([DVec3; 3], DVec3),
    to: &Receiver,
    out: &mut Vec<Part>,
) {
    // Distance of a part in its radii.
    let away = |corners: &[DVec3; 3]| {
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = corners.map(|p| p.distance(middle));
        middle.distance(to.point) / radius.into_iter().fold(f64::MIN_POSITIVE, f64::max)
    };
    let mut parts = vec![(away(&triangle), triangle)];
    while parts.len() + 3 <= PARTS {
        let nearest = (0..parts.len()).min_by(|&j, &k| parts[j].0.total_cmp(&parts[k].0));
        let Some(nearest) = nearest.filter(|&k| parts[k].0 < NEAR) else {
            break;
        };
        let (_, corners) = parts.swap_remove(nearest);
        parts.extend(quarters(corners).map(|corners| (away(&corners), corners)));
    }
    for (away, corners) in parts {
        let rule = match away < FAR {
            true => &SEVEN[..],
            false => &THREE[..],
        };
        let [a, b, c] = corners;
        let area = 0.5 * (b - a).cross(c - a).length();
        let at = |w: &[f64; 3]| density(luminaire, mix(&corners, *w), normal, to);
        let mut brings = area * rule.iter().map(|(w, weight)| weight * at(w)).sum::<f64>();
        if away < NEAR {
            let even = |w: &[f64; 3]| even(mix(&corners, *w), normal, to);
            let by_rule = area * rule.iter().map(|(w, weight)| weight * even(w)).sum::<f64>();
            let exact = std::f64::consts::PI * lambert_polygon(to.point, to.normal, &corners);
            // A part that no point of the rule sees brings next to nothing.
            brings *= if by_rule > 0.0 { exact / by_rule } else { 0.0 };
        }
        if brings > 0.0 && brings.is_finite() {
            out.push(Part {
                corners,
                normal,
                brings,
            });
        }
    }
}

/// The part that a number in [0, 1) selects by the irradiance of parts, and the rest of the number.
fn choose(parts: &[Part], all: f64, u: f64) -> Option<(&Part, f64)> {
    let mut left = u * all;
    let mut chosen = None;
    for part in parts {
        chosen = Some((part, (left / part.brings).clamp(0.0, 1.0 - f64::EPSILON)));
        if left < part.brings {
            break;
        }
        left -= part.brings;
    }
    chosen
}

/// Unblocked factor from the flux of a lamp with an extent to irradiance, and a point of the lamp that two numbers in [0, 1)
/// select by irradiance.
pub(super) fn whole(
    lamp: &PunctualLight,
    to: &Receiver,
    half_size: f64,
    [u, v]: [f64; 2],
) -> Option<(f64, DVec3)> {
    let luminaire = lamp.luminaire.as_deref()?;
    let mut parts = Vec::new();
    for triangle in facing(lamp, luminaire, to, half_size) {
        split(luminaire, triangle, to, &mut parts);
    }
    let all = parts.iter().map(|part| part.brings).sum();
    let (part, left) = choose(&parts, all, u)?;
    Some((all, part.point(luminaire, to, [left, v]).0))
}

impl Gatherer<'_> {
    /// Factor from the flux of a lamp with an extent to irradiance, past blockers, and what panes leave of its light. `bright`: the
    /// lamp's flux, share of white.
    pub(super) fn of_surface(
        &self,
        to: &Receiver,
        lamp: &PunctualLight,
        bright: f64,
        memory: &mut Memory,
    ) -> (f64, Option<Passage>) {
        let Some(luminaire) = lamp.luminaire.as_deref() else {
            return (0.0, None);
        };
        let (mut seen, mut parts) = (0.0, Vec::new());
        // Panes need rays.
        let by_rays = self.sight.occlusion || self.glass.is_some();
        let exact = self.shafts && self.is_plain() && luminaire.triangles().len() <= FEW;
        for triangle in facing(lamp, luminaire, to, self.light.half_size) {
            let known = match by_rays {
                true if exact => self.past_blockers(luminaire, triangle, to, memory),
                true => None,
                false => {
                    let mut whole = Vec::new();
                    split(luminaire, triangle, to, &mut whole);
                    Some(whole.iter().map(|part| part.brings).sum())
                }
            };
            match known {
                Some(known) => seen += known,
                None => split(luminaire, triangle, to, &mut parts),
            }
        }
        if parts.is_empty() {
            return (seen, None);
        }
        let (more, noise) = self.by_lamp_rays(luminaire, &parts, to, bright, memory);
        let passage = self.tint(memory);
        memory.noise += noise * self.left_by(passage.as_ref()).powi(2);
        (seen + more, passage)
    }

    /// Irradiance by a triangle of a lamp, less the shadows of blockers; none where there are too many.
    fn past_blockers(
        &self,
        luminaire: &Luminaire,
        (corners, normal): ([DVec3; 3], DVec3),
        to: &Receiver,
        memory: &mut Memory,
    ) -> Option<f64> {
        let planes = [to.plane, NO_PLANE];
        let mut parts = Vec::new();
        match self.sight.view_from(to.point, to.normal, &corners, planes) {
            Visibility::Clear => split(luminaire, (corners, normal), to, &mut parts),
            Visibility::Crowded => return None,
            Visibility::Listed(list) => {
                memory.clipper.begin(to.point, &corners);
                for blocker in self.sight.blockers(&list, planes)? {
                    let outline = || self.sight.mesh.outline(blocker);
                    let shadow = memory.shadows.of(to.point, blocker, outline);
                    if !memory.clipper.clip(shadow, PIECES) {
                        return None;
                    }
                }
                // Less than this is rounding: hidden lamps are exactly dark.
                if memory.clipper.factor(to.normal, 1.0) <= 0.0 {
                    return Some(0.0);
                }
                for piece in memory.clipper.visible() {
                    for two in piece[1..].windows(2) {
                        let fan = [piece[0], two[0], two[1]].map(|p| p + to.point);
                        split(luminaire, (fan, normal), to, &mut parts);
                    }
                }
            }
        }
        Some(parts.iter().map(|part| part.brings).sum())
    }

    /// The part of their irradiance that rays to the parts of a lamp find, and the variance of its brightness.
    fn by_lamp_rays(
        &self,
        luminaire: &Luminaire,
        parts: &[Part],
        to: &Receiver,
        bright: f64,
        memory: &mut Memory,
    ) -> (f64, f64) {
        let all: f64 = parts.iter().map(|part| part.brings).sum();
        let count = self.rays_to_lamps(to, bright * all);
        let turn = hash(to.seed, 0x6c);
        memory.segments.clear();
        memory.weights.clear();
        for k in 0..count as u32 {
            let [u, v] = sequence02(k, turn);
            let Some((part, left)) = choose(parts, all, u) else {
                break;
            };
            let (end, weight) = part.point(luminaire, to, [left, v]);
            memory
                .segments
                .push(Segment::new(to.point, end, [to.plane, NO_PLANE]));
            memory.weights.push(weight);
        }
        self.blocked(&memory.segments, &mut memory.blocked);
        memory.rays += memory.segments.len() as u64;
        let total: f64 = memory.weights.iter().sum();
        if total <= 0.0 {
            return (0.0, 0.0);
        }
        let seen = open_weight(&memory.weights, &memory.blocked) / total;
        let noise = (bright * all).powi(2) * seen * (1.0 - seen) / (count as f64).powf(1.5);
        (all * seen, noise)
    }
}
