//! Where the light of lamps lands, by rays from the lamps themselves: what points of leaves may have missed.
//!
//! Points of a large leaf pass by the pool of a narrow spot, or the sun that a small hole lets in, and find the leaf evenly dark: nothing
//! would ever split it. Rays from the lamp cannot miss it. They decide only what is split; what leaves receive is found at points.

use super::landed::Landing;
use super::room::Room;
use super::sent::TOGETHER;
use crate::geometry::NO_PLANE;
use crate::geometry::sampling::{sequence02, tangents};
use crate::hierarchy::{NONE, Tree};
use crate::light::lanes::Lanes;
use crate::light::{Filters, Glass};
use crate::link::Sight;
use glam::{DVec3, Vec3};

/// Rays from lamps: a leaf that is to be split for it receives at least .06 % of all their light.
const RAYS: u32 = 16_384;
/// Cells across the room, seen from where parallel light comes from, and as many rays again into those where it gets in: a
/// hole of a hundredth of the room is seen.
const CELLS: usize = 256;
/// The most parts of a cell along each side.
const PARTS: usize = 16;
/// What follows rays to where they land.
struct Follower<'a> {
    tree: &'a Tree,
    sight: &'a Sight<'a>,
    glass: Option<Glass<'a>>,
    reach: f32,
    found: Vec<Landing>,
}

impl Follower<'_> {
    /// Rays of one lamp: start, direction, and what flux they stand for. Says which met a front.
    fn follow(&mut self, rays: &[(DVec3, DVec3, [f64; 3])], plane: u32, met: &mut Vec<bool>) {
        for rays in rays.chunks(TOGETHER) {
            // The last packet is filled up with its first ray.
            let ray = |k: usize| rays.get(k).unwrap_or(&rays[0]);
            let from: [Vec3; TOGETHER] = std::array::from_fn(|k| ray(k).0.as_vec3());
            let directions: [Vec3; TOGETHER] = std::array::from_fn(|k| ray(k).1.as_vec3());
            let mut hits = [None; TOGETHER];
            self.sight.meet(&from, &directions, plane, &mut hits);
            for (k, &(_, _, flux)) in rays.iter().enumerate() {
                let hit = hits[k].map(|hit| (hit, self.tree.met(&hit)));
                let Some((hit, entry)) = hit.filter(|hit| hit.1 != NONE) else {
                    met.push(false);
                    continue;
                };
                met.push(true);
                let end = from[k] + hit.t.min(self.reach) * directions[k];
                let through = self
                    .glass
                    .map_or(1.0, |glass| glass.brightness(from[k], end));
                let [u, v] = hit.uv;
                self.found.push(Landing {
                    entry,
                    weights: if hit.from_behind { [v, u] } else { [u, v] },
                    flux: flux.map(|x| (x * through) as f32),
                });
            }
        }
    }

    /// Parallel light of an irradiance across its rays: by a grid of cells, and once more by finer ones where it gets in.
    fn parallel(&mut self, direction: DVec3, irradiance: [f64; 3], radius: f64) {
        let [across, up] = tangents(direction);
        let side = 2.0 * radius / CELLS as f64;
        let rays = |cells: &[usize], parts: usize| -> Vec<_> {
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
        let (before, mut met) = (self.found.len(), Vec::new());
        let all: Vec<usize> = (0..CELLS * CELLS).collect();
        self.follow(&rays(&all, 1), NO_PLANE, &mut met);
        // Where light gets in or a cell beside gets some.
        let near = |&cell: &usize| {
            let (x, y) = (cell % CELLS, cell / CELLS);
            let rows = y.saturating_sub(1)..(y + 2).min(CELLS);
            rows.into_iter().any(|y| {
                let mut columns = x.saturating_sub(1)..(x + 2).min(CELLS);
                columns.any(|x| met[y * CELLS + x])
            })
        };
        let cells: Vec<usize> = all.into_iter().filter(near).collect();
        let parts = (RAYS as usize / cells.len().max(1)).isqrt().min(PARTS);
        if parts > 1 {
            self.found.truncate(before);
            self.follow(&rays(&cells, parts), NO_PLANE, &mut Vec::new());
        }
    }
}

/// How far the white must fall short of what landed to be that of a room whose light was not found.
const DIM: f64 = 0.5;

impl Room {
    /// The white of a room in which most light of lamps was not found yet: that of what landed, which is at least something.
    pub(super) fn landed_white(&self, white: [f64; 3]) -> [f64; 3] {
        let total: f64 = (self.mesh.faces.iter())
            .map(|face| self.mesh.area[face.triangle as usize])
            .sum();
        let flux = self
            .landings
            .iter()
            .fold([0.0; 3], |sum: [f64; 3], landing| {
                std::array::from_fn(|k| sum[k] + f64::from(landing.flux[k]))
            });
        let landed = flux.map(|x| 2.0 * x / total.max(f64::MIN_POSITIVE));
        if white[1] < DIM * landed[1] {
            landed
        } else {
            white
        }
    }

    /// Follows the light of lamps to where it lands.
    pub(super) fn landings(
        &self,
        tree: &Tree,
        lanes: &Lanes,
        filters: &Filters,
        sight: &Sight,
    ) -> Vec<Landing> {
        let mut follower = Follower {
            tree,
            sight,
            glass: (sight.panes).map(|glazing| Glass { glazing, filters }),
            reach: 4.0 * self.mesh.half_size as f32,
            found: Vec::new(),
        };
        let lamps = self.sending(tree, lanes);
        let all: f64 = lamps.iter().map(|lamp| lamp.0[1]).sum();
        let mut first = 0;
        for (flux, lamp) in lamps {
            let count = (f64::from(RAYS) * flux[1] / all).ceil() as u32;
            let rays: Vec<_> = (first..first + count)
                .map(|k| lamp.ray(self, tree, k))
                .collect();
            let plane = rays[0].2;
            let weights: f64 = rays.iter().map(|ray| ray.3).sum();
            let each = |weight: f64| flux.map(|x| x * weight / weights.max(f64::MIN_POSITIVE));
            let rays: Vec<_> = (rays.into_iter())
                .map(|(from, direction, _, weight)| (from, direction, each(weight)))
                .collect();
            follower.follow(&rays, plane, &mut Vec::new());
            first += count;
        }
        for light in &self.scene.lights {
            if light.kind.is_parallel() {
                let irradiance = lanes.emission(light.light, &light.shape, 1.0);
                follower.parallel(light.direction, irradiance, self.mesh.half_size);
            }
        }
        follower.found
    }
}
