//! Where the light of lamps goes first, by rays from the lamps themselves: onto fronts, onto black backs, into panes, or out of the
//! room. No receiver takes part, so that the light found at leaves can be compared with this.
//!
//! Where it lands tells what points of leaves may have missed: the points of a large leaf may all lie beside the pool of a narrow spot,
//! or of the sun through a small hole, and find the leaf evenly dark; nothing would ever split it. Rays from the lamp cannot miss that
//! pool. They decide only what is split; light on leaves is found at points.

use super::flux::{Closed, Sent};
use super::landed::Landing;
use super::room::Room;
use crate::geometry::sampling::{sequence02, tangents};
use crate::geometry::{Hit, NO_PLANE};
use crate::hierarchy::{NONE, Tree};
use crate::light::lanes::Lanes;
use crate::light::{Filters, Glass};
use crate::link::Sight;
use crate::team::Interrupted;
use glam::{DVec3, Vec3};

/// Rays from lamps: an error of about .1 % of the flux.
const RAYS: u32 = 32_768;
/// Rays cast together.
const TOGETHER: usize = 16;
/// Cells across the room, as seen from the direction of parallel light. Half as many rays as those of lamps go again into the cells
/// where light gets in: a hole of a hundredth of the room is seen.
const CELLS: usize = 256;
/// Parts of a cell along each side, at the most.
const PARTS: usize = 16;

/// A ray from a lamp: start, direction, and the flux it carries.
type Ray = (DVec3, DVec3, [f64; 3]);

/// Where a ray from a lamp ended.
struct LampRayEnd {
    /// What the ray met; none if it left the room.
    hit: Option<Hit>,
    /// Entry of the hierarchy's faces that the ray met; [`NONE`] for a black back or nothing.
    entry: u32,
    /// Share of the ray's light that panes let through.
    through: f64,
}

impl LampRayEnd {
    /// The landing of a ray of `flux`, if it met a front.
    fn landing(&self, flux: [f64; 3]) -> Option<Landing> {
        let hit = self.hit.filter(|_| self.entry != NONE)?;
        let [u, v] = hit.uv;
        Some(Landing {
            entry: self.entry,
            weights: if hit.from_behind { [v, u] } else { [u, v] },
            flux: flux.map(|x| (x * self.through) as f32),
        })
    }
}

/// Follows rays to where they end.
struct Follower<'a> {
    tree: &'a Tree,
    sight: &'a Sight<'a>,
    glass: Option<Glass<'a>>,
    /// Longer than the room.
    reach: f32,
}

impl Follower<'_> {
    /// Where rays that start in one plane end.
    fn follow(&self, rays: &[Ray], plane: u32) -> Vec<LampRayEnd> {
        let mut ends = Vec::with_capacity(rays.len());
        for rays in rays.chunks(TOGETHER) {
            // The last packet is filled up with its first ray.
            let ray = |k: usize| rays.get(k).unwrap_or(&rays[0]);
            let from: [Vec3; TOGETHER] = std::array::from_fn(|k| ray(k).0.as_vec3());
            let directions: [Vec3; TOGETHER] = std::array::from_fn(|k| ray(k).1.as_vec3());
            let mut hits = [None; TOGETHER];
            self.sight.meet(&from, &directions, plane, &mut hits);
            ends.extend((0..rays.len()).map(|k| {
                let hit = hits[k];
                let reach = hit.map_or(self.reach, |hit| hit.t.min(self.reach));
                let end = from[k] + reach * directions[k];
                LampRayEnd {
                    hit,
                    entry: hit.map_or(NONE, |hit| self.tree.met(&hit)),
                    through: (self.glass).map_or(1.0, |glass| glass.brightness(from[k], end)),
                }
            }));
        }
        ends
    }

    /// Where parallel light lands, given its irradiance across its direction: by a grid of cells, refined where light gets in.
    fn parallel(&self, direction: DVec3, irradiance: [f64; 3], radius: f64) -> Vec<Landing> {
        let [across, up] = tangents(direction);
        let side = 2.0 * radius / CELLS as f64;
        let rays = |cells: &[usize], parts: usize| -> Vec<Ray> {
            let part = side / parts as f64;
            let flux = irradiance.map(|e| e * part * part);
            let within = |&cell: &usize| {
                (0..parts * parts).map(move |k| {
                    let [u, v] = sequence02((cell * parts * parts + k) as u32, 17);
                    let x = (cell % CELLS) as f64 * side + ((k % parts) as f64 + u) * part;
                    let y = (cell / CELLS) as f64 * side + ((k / parts) as f64 + v) * part;
                    let place = across * (x - radius) + up * (y - radius);
                    (place - direction * (2.0 * radius), direction, flux)
                })
            };
            cells.iter().flat_map(within).collect()
        };
        let landings = |rays: &[Ray], ends: &[LampRayEnd]| {
            let landed = rays
                .iter()
                .zip(ends)
                .filter_map(|(ray, end)| end.landing(ray.2));
            landed.collect()
        };
        let all: Vec<usize> = (0..CELLS * CELLS).collect();
        let coarse = rays(&all, 1);
        let ends = self.follow(&coarse, NO_PLANE);
        // Cells where light gets in, and their neighbours.
        let near = |&cell: &usize| {
            let (x, y) = (cell % CELLS, cell / CELLS);
            let rows = y.saturating_sub(1)..(y + 2).min(CELLS);
            rows.into_iter().any(|y| {
                let mut columns = x.saturating_sub(1)..(x + 2).min(CELLS);
                columns.any(|x| ends[y * CELLS + x].entry != NONE)
            })
        };
        let cells: Vec<usize> = all.into_iter().filter(near).collect();
        let parts = (RAYS as usize / 2 / cells.len().max(1)).isqrt().min(PARTS);
        if parts <= 1 {
            return landings(&coarse, &ends);
        }
        let fine = rays(&cells, parts);
        landings(&fine, &self.follow(&fine, NO_PLANE))
    }
}

impl Room {
    /// The white of a room, at least that of the landed light: reflected light adds to that. Before any point has found such light,
    /// the white is less.
    pub(super) fn landed_white(&self, tree: &Tree, white: [f64; 3]) -> [f64; 3] {
        let landed = self
            .landings
            .iter()
            .fold([0.0; 3], |sum: [f64; 3], landing| {
                std::array::from_fn(|k| sum[k] + f64::from(landing.flux[k]))
            });
        let area = tree.counted();
        let landed = landed.map(|x| 2.0 * x / area.max(f64::MIN_POSITIVE));
        match white[1] < landed[1] {
            true => landed,
            false => white,
        }
    }

    /// Follows the light of lamps: where all of it goes, and where it lands on fronts.
    pub(super) fn follow_lamps(
        &self,
        tree: &Tree,
        lanes: &Lanes,
        filters: &Filters,
        sight: &Sight,
    ) -> Result<(Sent, Vec<Landing>), Interrupted> {
        let follower = Follower {
            tree,
            sight,
            glass: (sight.panes).map(|glazing| Glass { glazing, filters }),
            reach: 4.0 * self.mesh.reach as f32,
        };
        let lamps = self.sending(tree, lanes);
        let all: f64 = lamps.iter().map(|lamp| lamp.0[1]).sum();
        let (mut sent, mut landings) = (Sent::default(), Vec::new());
        sent.lamps_lm = all;
        let mut first = 0;
        for (flux, lamp) in lamps {
            self.interrupt.check()?;
            // At least a packet, so that every lamp has rays.
            let count = (f64::from(RAYS) * flux[1] / all).ceil() as usize;
            let count = count.next_multiple_of(TOGETHER);
            let rays: Vec<_> = (first..first + count)
                .map(|k| lamp.ray(self, tree, k as u32))
                .collect();
            let plane = rays[0].2;
            let weights: f64 = rays.iter().map(|ray| ray.3).sum();
            let each = |weight: f64| flux.map(|x| x * weight / weights.max(f64::MIN_POSITIVE));
            let rays: Vec<Ray> = (rays.into_iter())
                .map(|(from, direction, _, weight)| (from, direction, each(weight)))
                .collect();
            for (ray, end) in rays.iter().zip(follower.follow(&rays, plane)) {
                let share = ray.2[1] / all;
                let to = match end.hit {
                    None => &mut sent.outside,
                    Some(_) if end.entry == NONE => &mut sent.to_backs,
                    Some(_) => &mut sent.to_fronts,
                };
                *to += share * end.through;
                sent.in_panes += share * (1.0 - end.through);
                landings.extend(end.landing(ray.2));
            }
            first += count;
        }
        if all > 0.0 && self.closed == Closed::Yes && sight.panes.is_none() {
            (sent.to_fronts, sent.to_backs, sent.outside) = (1.0, 0.0, 0.0);
        }
        for light in &self.scene.lights {
            if light.kind.is_parallel() {
                self.interrupt.check()?;
                let irradiance = lanes.emission(light.light, &light.shape, 1.0);
                landings.extend(follower.parallel(
                    light.direction,
                    irradiance,
                    self.mesh.half_size,
                ));
            }
        }
        Ok((sent, landings))
    }
}
