//! Where a camera of our own stands: in the largest lit space, with a view over it, and in further spaces beside that.
//!
//! A few thousand paths from the lamps, of [`BOUNCES`] reflections, tell where light goes: places where they end are lit, and
//! what lies between two ends is open space that light fills, never a cavity and never the inside of a solid. Candidates
//! stand on such segments, at the height of eyes above the floor there. Each looks around by rays; a view is worth the mean,
//! over the picture, of what its rays meet: lit fronts count, far ones more, what stands right before the lens counts
//! against it. All lengths are in free paths of light (the median segment), so that the extent of the file and its unit do
//! not matter. Further views are added while they show much that no view before shows.
//!
//! One-sided backs are not drawn, so rays pass them; a candidate from which much looks like backs stands outside of what it
//! sees. Everything follows from fixed sequences: the same room has the same views.

use super::lit_space::{FEW, Leg, LitRoom, PathHit, axis};
use crate::geometry::sampling::{sequence02, sphere_direction};
use crate::geometry::{NO_PLANE, Segment};
use crate::scene::Scene;
use glam::DVec3;
use rayon::prelude::*;

/// Candidates, rays of each in the first look, and of the best in the second.
const CANDIDATES: usize = FEW;
const GLANCE: u32 = 256;
const FINALISTS: usize = 24;
const GAZE: u32 = 1536;
/// Directions of views: around, and down by these angles, radians.
const YAWS: u32 = 24;
const PITCHES: [f64; 2] = [0.08, 0.22];
/// Height of eyes, m; and as a share of the room's, at least and at the most.
const EYES: f64 = 1.6;
const EYES_SHARE: [f64; 2] = [0.25, 0.6];
/// Nearer than the first a thing stands in the way, beyond the second it is a view, and up to the third farther is better;
/// in free paths.
const NEAR: f64 = 0.35;
const CLEAR: f64 = 0.9;
const FAR: f64 = 2.5;
/// What is met so soon behind the bounds of the room is its outer hull, in free paths.
const HULL: f64 = 0.02;
/// What a ray is worth that meets a front nobody lights, against one that meets a lit one.
const UNLIT: f64 = 0.1;
/// A candidate that sees more backs than this, share of its rays, stands outside.
const BACKS: f64 = 0.1;
/// With so many candidates that see no more of the open than this, the others are outdoors and left out.
const ENCLOSED: (usize, f64) = (8, 0.2);
/// With as many that see less of the open than this, nobody need look in from outside.
const CLOSED: f64 = 0.05;
/// What differs in kind makes a view better: worth for each nat of entropy of the surfaces seen.
const VARIETY: f64 = 0.1;
/// Views at the most, places that tell what they show, and the share of these that a further view must add.
const VIEWS: usize = 3;
const PLACES: usize = 256;
const ADDS: f64 = 0.2;
/// Proportions of a picture.
const ASPECT: f64 = 4.0 / 3.0;
/// Stands for the surface of a ray that meets none.
const NOTHING: u32 = u32::MAX;
/// A view from outside shows the whole room: worth of its score.
const OUTSIDE: f64 = 1.3;

/// A view of our own.
#[derive(Debug, Clone, Copy)]
pub(super) struct DefaultView {
    /// World space.
    pub(super) eye: DVec3,
    pub(super) target: DVec3,
    /// Vertical field of view, radians.
    pub(super) angle: f64,
}

/// A place to stand and what is seen from there.
struct Candidate {
    eye: DVec3,
    angle: f64,
    /// What rays meet in all directions.
    seen: Vec<PathHit>,
    /// From outside, the distance to the room's bounds, which does not count.
    skip: f64,
    /// Share of rays that meet nothing.
    open: f64,
    /// The only direction to look into; none: any.
    given: Option<DVec3>,
    score: f64,
    toward: DVec3,
}

/// Views of a room with this field of view, best first; `others` are tried as well. None if nothing is seen from anywhere.
pub(super) fn views(scene: &Scene, angle: f64, others: &[DefaultView]) -> Vec<DefaultView> {
    let (room, legs) = LitRoom::new(scene);
    let mut pool: Vec<Candidate> = room.stand(&legs, angle, others);
    pool.par_iter_mut().for_each(|c| room.judge(c, GLANCE));
    pool.retain(|c| c.score > 0.0);
    pool.sort_by(|a, b| b.score.total_cmp(&a.score));
    let finalists = FINALISTS.min(pool.len());
    pool[..finalists]
        .par_iter_mut()
        .for_each(|c| room.judge(c, GAZE));
    room.choose(pool)
        .into_iter()
        .map(|c| DefaultView {
            eye: c.eye + room.mesh.centre,
            target: c.eye + room.mesh.centre + c.toward * room.path,
            angle: c.angle,
        })
        .collect()
}

impl LitRoom<'_> {
    /// Candidates: along the legs of light, at eyes' height, and the others.
    fn stand(&self, legs: &[Leg], angle: f64, others: &[DefaultView]) -> Vec<Candidate> {
        let candidate = |eye, angle, skip| Candidate {
            eye,
            angle,
            seen: Vec::new(),
            skip,
            open: 0.0,
            given: None,
            score: 0.0,
            toward: DVec3::NEG_Z,
        };
        let count = CANDIDATES.min(legs.len());
        let mut pool: Vec<Candidate> = (0..count)
            .into_par_iter()
            .filter_map(|k| {
                let [a, b] = legs[k * legs.len() / count];
                // Any share of the way but its ends, spread evenly.
                let share = 0.15 + 0.7 * sequence02(k as u32, 0)[0];
                Some(candidate(self.at_eyes(a.lerp(b, share))?, angle, 0.0))
            })
            .collect();
        let offset = self.mesh.centre;
        pool.extend(others.iter().map(|other| {
            let eye = other.eye - offset;
            let skip = self.entry(eye, other.target - offset);
            Candidate {
                given: (other.target - other.eye).try_normalize(),
                ..candidate(eye, other.angle, skip)
            }
        }));
        pool.retain_mut(|c| {
            let (mut backs, mut open) = (0_u32, 0_u32);
            for k in 0..GLANCE / 4 {
                let direction = sphere_direction(sequence02(k, 0));
                let (met, back) = self.see(c.eye, direction, NO_PLANE);
                backs += u32::from(back);
                open += u32::from(met.is_none());
            }
            let all = f64::from(GLANCE / 4);
            c.open = f64::from(open) / all;
            c.skip > 0.0 || f64::from(backs) <= BACKS * all
        });
        let (least, most) = ENCLOSED;
        let closed = |c: &&Candidate| c.skip == 0.0 && c.open <= CLOSED;
        if pool.iter().filter(closed).count() >= least {
            pool.retain(|c| c.skip == 0.0);
        }
        if pool.iter().filter(|c| c.open <= most).count() >= least {
            pool.retain(|c| c.open <= most || c.skip > 0.0);
        }
        pool
    }

    /// The same place at the height of a person's eyes; none if there is nothing to stand on.
    fn at_eyes(&self, place: DVec3) -> Option<DVec3> {
        let below = self.see(place, DVec3::NEG_Y, NO_PLANE).0?.distance;
        let above = self.see(place, DVec3::Y, NO_PLANE).0;
        let height = below + above.map_or(2.0 * self.path, |met| met.distance);
        let [least, most] = EYES_SHARE.map(|share| share * height);
        let eyes = EYES.max(least).min(most);
        Some(place + DVec3::Y * (eyes - below))
    }

    /// Distance from `eye`, on the way to `target`, of the room's bounds; 0 from inside.
    fn entry(&self, eye: DVec3, target: DVec3) -> f64 {
        let [low, high] = self.rays.bounds().map(|corner| corner.as_dvec3());
        let way = (target - eye).normalize_or(DVec3::NEG_Z);
        let (a, b) = ((low - eye) / way, (high - eye) / way);
        let near = a.min(b).to_array().into_iter().fold(0.0, f64::max);
        let inside = eye.cmpge(low).all() && eye.cmple(high).all();
        if inside { 0.0 } else { near }
    }

    /// Looks around and finds the best direction.
    fn judge(&self, c: &mut Candidate, rays: u32) {
        let look = |k| {
            let direction = sphere_direction(sequence02(k, 0));
            let met = self.see(c.eye, direction, NO_PLANE).0;
            // Rays that meet nothing matter, too: they are background.
            met.unwrap_or(PathHit {
                direction,
                distance: f64::INFINITY,
                point: DVec3::ZERO,
                normal: DVec3::ZERO,
                surface: NOTHING,
                plane: NO_PLANE,
                lamp: false,
            })
        };
        c.seen = (0..rays).map(look).collect();
        let worth: Vec<f64> = c.seen.iter().map(|m| self.worth(m, c.skip)).collect();
        (c.score, c.toward) = (0.0, DVec3::NEG_Z);
        let turned = |(yaw, pitch): (u32, f64)| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(yaw) / f64::from(YAWS)).sin_cos();
            DVec3::new(sin * pitch.cos(), -pitch.sin(), -cos * pitch.cos())
        };
        let all = (0..YAWS).flat_map(|yaw| PITCHES.map(|pitch| turned((yaw, pitch))));
        let directions: Vec<DVec3> = c.given.map_or_else(|| all.collect(), |given| vec![given]);
        let outside = if c.skip > 0.0 { OUTSIDE } else { 1.0 };
        for toward in directions {
            let score = outside * view_score(c, &worth, toward);
            if score > c.score {
                (c.score, c.toward) = (score, toward);
            }
        }
    }

    /// What a ray adds to a view.
    fn worth(&self, met: &PathHit, skip: f64) -> f64 {
        if met.surface == NOTHING {
            return 0.0;
        }
        let far = (met.distance - skip) / self.path;
        // From outside nothing of the room is in the way but its hull.
        let outside = skip > 0.0;
        if far < if outside { HULL } else { NEAR } {
            return -1.0;
        }
        let lit = if met.lamp || self.is_lit(met) {
            1.0
        } else {
            UNLIT
        };
        if far < CLEAR && !outside {
            // From being in the way to being part of the view.
            let share = (far - NEAR) / (CLEAR - NEAR);
            return share * 0.5 * lit - (1.0 - share);
        }
        lit * (0.5 + 0.5 * (far / FAR).min(1.0))
    }

    /// The best view, and those that show much besides.
    fn choose(&self, mut pool: Vec<Candidate>) -> Vec<Candidate> {
        let count = PLACES.min(self.places.len());
        let every = |k: usize| self.places[k * self.places.len() / count];
        let places: Vec<PathHit> = (0..count).map(every).collect();
        pool.sort_by(|a, b| b.score.total_cmp(&a.score));
        let shows: Vec<Vec<bool>> = pool
            .par_iter()
            .map(|c| places.iter().map(|m| self.shows(c.eye, m)).collect())
            .collect();
        // Places that nobody can show do not count.
        let whole = (0..count)
            .filter(|&m| shows.iter().any(|s| s[m]))
            .count()
            .max(1);
        let mut known = vec![false; places.len()];
        let mut chosen: Vec<usize> = Vec::new();
        while chosen.len() < VIEWS {
            let adds = |k: usize| {
                let new = shows[k].iter().zip(&known).filter(|(s, k)| **s && !**k);
                new.count() as f64 / whole as f64
            };
            let best = if chosen.is_empty() {
                (!pool.is_empty()).then_some(0)
            } else {
                let good = (0..pool.len()).filter(|&k| adds(k) >= ADDS);
                let value = |k: usize| pool[k].score * adds(k);
                good.reduce(|a, b| if value(b) > value(a) { b } else { a })
            };
            let Some(best) = best else { break };
            for (known, shown) in known.iter_mut().zip(&shows[best]) {
                *known |= shown;
            }
            chosen.push(best);
        }
        let mut pool: Vec<Option<Candidate>> = pool.into_iter().map(Some).collect();
        chosen.iter().filter_map(|&k| pool[k].take()).collect()
    }

    fn shows(&self, eye: DVec3, met: &PathHit) -> bool {
        let segment = Segment::new(eye, met.point, [NO_PLANE, met.plane]);
        met.normal.dot(eye - met.point) > 0.0 && !self.rays.occluded(&segment)
    }
}

/// Mean worth of a picture's rays, and more for views of many things.
fn view_score(c: &Candidate, worth: &[f64], toward: DVec3) -> f64 {
    let high = (0.5 * c.angle).tan();
    let wide = ASPECT * high;
    let right = toward.cross(DVec3::Y).normalize_or(DVec3::X);
    let up = right.cross(toward);
    let (mut sum, mut weight) = (0.0, 0.0);
    let mut kinds: Vec<(u32, f64)> = Vec::new();
    for (met, worth) in c.seen.iter().zip(worth) {
        let depth = met.direction.dot(toward);
        let across = |axis: DVec3, half: f64| met.direction.dot(axis).abs() <= half * depth;
        if depth <= 0.0 || !across(right, wide) || !across(up, high) {
            continue;
        }
        // Solid angle to pixels.
        let pixels = depth.powi(-3);
        sum += pixels * worth;
        weight += pixels;
        if met.surface != NOTHING {
            let kind = met.surface * 6 + axis(met.normal) as u32;
            match kinds.iter_mut().find(|(k, _)| *k == kind) {
                Some((_, share)) => *share += pixels,
                None => kinds.push((kind, pixels)),
            }
        }
    }
    if weight <= 0.0 {
        return 0.0;
    }
    let entropy = |share: f64| -share * share.ln();
    let variety: f64 = kinds
        .iter()
        .map(|(_, pixels)| entropy(pixels / weight))
        .sum();
    sum / weight * (1.0 + VARIETY * variety)
}
