//! Glare at a viewpoint: luminaires as an eye sees them, before the background that the light of the room makes.
//!
//! Lamps are divided until their parts look small, and a ray tells of each part whether it is visible; luminances are those
//! of the lamps themselves, which are known. The background is the light that reaches the eye from other surfaces, and from
//! the sky, over pi.

use crate::color::{Bright, position_index, unified_glare_rating};
use crate::geometry::{NO_PLANE, Segment, quarters};
use crate::hierarchy::Node;
use crate::link::Sight;
use crate::scene::effects::EffectKind;
use crate::scene::{LightKind, PunctualLight};
use crate::solve::Bake;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Size of parts as seen by the eye, radians: position indices of neighbours then differ by 2 % at the most.
const PART: f64 = 0.02;
/// Divisions at the most: a lamp right before the eye ends in 4^6 parts.
const SPLITS: u32 = 6;
/// Distance before a lamp at which rays end, share of the room's half size: f32 positions are off by 1e-7 of that.
const BEFORE: f64 = 1e-5;

/// Glare at a viewpoint.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Glare {
    /// Luminance of the background, cd/m2.
    pub background: f64,
    /// Visible luminaires, by the names of their nodes or lights.
    pub luminaires: Vec<(String, Bright)>,
    /// The unified glare rating; none where the background is black, negative infinity where no luminaire is seen.
    pub rating: Option<f64>,
    /// What the rating leaves out: lights without extent, which have no luminance; the sun; the sky where its light is not kept
    /// apart; what panes absorb; what mirrors show.
    pub left_out: Vec<String>,
}

/// An eye.
struct Eye<'a> {
    sight: &'a Sight<'a>,
    /// Position, recentred.
    at: DVec3,
    forward: DVec3,
    up: DVec3,
    lift: f64,
}

impl Eye<'_> {
    fn sees(&self, place: DVec3) -> bool {
        let ahead = (place - self.at).dot(self.forward) > 0.0;
        ahead
            && !self
                .sight
                .blocks_one(&Segment::new(self.at, place, [NO_PLANE; 2]))
    }

    /// Adds the visible part of a triangle whose luminance is known for any unit direction towards the eye.
    fn add(&self, triangle: [DVec3; 3], luminance: &impl Fn(DVec3) -> f64, out: &mut Bright) {
        let [a, b, c] = triangle;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal.dot(self.at - a) <= 0.0 {
            return;
        }
        let mut left = vec![(triangle.map(|p| p + self.lift * normal), 0)];
        while let Some((corners, splits)) = left.pop() {
            let [a, b, c] = corners.map(|p| p - self.at);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let middle = (a + b + c) / 3.0;
            if longest > PART * middle.length() && splits < SPLITS {
                left.extend(quarters(corners).map(|part| (part, splits + 1)));
            } else if self.sees(self.at + middle) {
                let position = position_index(self.forward, self.up, middle);
                out.add(
                    luminance(-middle.normalize_or_zero()),
                    solid_angle([a, b, c]),
                    position,
                );
            }
        }
    }
}

/// Solid angle of a triangle seen from the origin, sr (Van Oosterom & Strackee 1983).
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (x, y, z) = (a.length(), b.length(), c.length());
    let below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
    2.0 * a.dot(b.cross(c)).abs().atan2(below)
}

impl Bake {
    /// Glare for an eye in world space that looks in a direction; both as points and normals for `probe`. Heads are upright (+Y);
    /// the top of one that looks straight up or down points to -Z.
    pub fn glare(&self, eye: DVec3, direction: DVec3) -> Glare {
        let forward = direction.normalize_or_zero();
        let across = |up: DVec3| (up - forward * forward.dot(up)).try_normalize();
        let up = across(DVec3::Y).filter(|_| forward.y.abs() < 1.0 - 1e-9);
        let up = up.or_else(|| across(DVec3::NEG_Z)).unwrap_or(DVec3::Y);
        let mut left_out = Vec::new();
        let background = self.background(eye, forward, &mut left_out);
        let luminaires = self.room.with_sight(|sight| {
            let eye = Eye {
                sight,
                at: eye - self.mesh().centre,
                forward,
                up,
                lift: BEFORE * self.mesh().half_size,
            };
            let mut seen = self.surfaces_seen(&eye);
            seen.extend(self.lights_seen(&eye, &mut left_out));
            seen
        });
        let bright: Vec<Bright> = luminaires.iter().map(|(_, bright)| *bright).collect();
        Glare {
            background,
            rating: unified_glare_rating(background, &bright),
            luminaires,
            left_out,
        }
    }

    /// Luminance of the background, cd/m2.
    fn background(&self, eye: DVec3, forward: DVec3, left_out: &mut Vec<String>) -> f64 {
        let gathered = self.gather_at(&[(eye, forward)]).swap_remove(0);
        let lights = &self.scene().lights;
        let sky = lights.iter().find(|l| matches!(l.kind, LightKind::Sky(_)));
        // Rows separate spectra, not lamps: a lamp with the sky's spectrum cannot be told from the sky.
        let own = |sky: &&PunctualLight| {
            let mut others = lights
                .iter()
                .filter(|l| l.name != sky.name && !l.kind.is_dome());
            self.lanes().is_ratio() && !others.any(|l| l.light == sky.light)
        };
        let apart = sky.filter(own);
        if sky.is_some() && apart.is_none() {
            left_out.push("the sky as far as the eye sees it: its light is not kept apart".into());
        }
        if lights.iter().any(|l| l.kind.is_parallel()) {
            left_out.push("the sun, and ground that it lights as far as the eye sees it".into());
        }
        if self.scene().materials.iter().any(|m| m.sheet.is_some()) {
            left_out.push("sheets that lamps shine through, as what is bright".into());
        }
        if !self.scene().panes.is_empty() {
            left_out.push("what panes take from lamps behind them".into());
        }
        if self.plan().runs(EffectKind::Mirrors) {
            left_out.push("lamps as mirrors show them".into());
        }
        let lanes = self.lanes().lanes();
        let mut row = gathered.irradiance;
        for (l, (all, direct)) in row.iter_mut().zip(gathered.direct).enumerate() {
            let light = lanes.get(l).and_then(|lane| lane.light);
            let of_sky = apart.is_some_and(|sky| light == Some(sky.light));
            if !of_sky {
                *all = (*all - direct).max(0.0);
            }
        }
        self.lanes().tristimulus(&row)[1] / PI
    }

    /// Surfaces that emit evenly in all directions.
    fn surfaces_seen(&self, eye: &Eye) -> Vec<(String, Bright)> {
        let (tree, mesh, light) = (self.tree(), self.mesh(), self.light());
        if light.emitted.is_empty() {
            return Vec::new();
        }
        let mut found: BTreeMap<u32, Bright> = BTreeMap::new();
        for leaf in tree
            .leaves()
            .filter(|&leaf| light.bright_emitted[leaf as usize] > 0.0)
        {
            let luminance = self.lanes().tristimulus(light.emitted.row(leaf as usize))[1] / PI;
            let node: &Node = tree.node(leaf);
            if let Some(element) = tree.element(node).filter(|_| luminance > 0.0) {
                let face = tree.faces[element.face as usize];
                let surface = mesh.origin[face.triangle as usize].0;
                let bright = found.entry(surface).or_insert(Bright::NONE);
                eye.add(element.corners, &|_| luminance, bright);
            }
        }
        let name = |surface: u32| self.scene().surfaces[surface as usize].name.clone();
        let seen = found.into_iter().filter(|(_, b)| b.solid_angle > 0.0);
        seen.map(|(surface, bright)| (name(surface), bright))
            .collect()
    }

    /// Lights with an extent; the names of those without are noted.
    fn lights_seen(&self, eye: &Eye, left_out: &mut Vec<String>) -> Vec<(String, Bright)> {
        let mut found = Vec::new();
        for (lamp, row) in self.lamps() {
            let flux = self.lanes().tristimulus(row)[1];
            if flux <= 0.0 {
                continue;
            }
            if let (Some(luminaire), LightKind::Surface) = (&lamp.luminaire, lamp.kind) {
                let mut bright = Bright::NONE;
                for triangle in luminaire.triangles() {
                    let corners = triangle.map(|p| p + lamp.position);
                    let [a, b, c] = corners;
                    let normal = (b - a).cross(c - a).normalize_or_zero();
                    let towards = |way: DVec3| {
                        let cosine = normal.dot(way).max(f64::MIN_POSITIVE);
                        flux * luminaire.per_area(way, normal) / cosine
                    };
                    eye.add(corners, &towards, &mut bright);
                }
                if bright.solid_angle > 0.0 {
                    found.push((lamp.name.clone(), bright));
                }
            } else if !lamp.kind.is_parallel() && !lamp.kind.is_dome() && eye.sees(lamp.position) {
                left_out.push(format!("{}: it has no extent", lamp.name));
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn an_octant_is_an_eighth_of_the_sphere() {
        let all = [DVec3::X, DVec3::Y, DVec3::Z];
        assert!((solid_angle(all) - 0.5 * PI).abs() < 1e-12);
        let small = [
            dvec3(0.0, 0.0, -10.0),
            dvec3(0.1, 0.0, -10.0),
            dvec3(0.0, 0.1, -10.0),
        ];
        assert!((solid_angle(small) / 5e-5 - 1.0).abs() < 1e-3);
    }
}
