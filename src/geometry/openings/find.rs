//! Finds openings: rays all over the hemispheres first, then rays that are aimed.

use super::aim::Aim;
use super::sides::{BEAM, CELLS, Exit, Gap, KINDS, Left, Openings, PLACES, Start, Wall};
use crate::geometry::cover::{Edges, Rectangle, Spot, cover};
use crate::geometry::sampling::{Pcg, around, cosine_direction, hash, sequence02};
use glam::DVec3;
use rayon::prelude::*;

/// Points that rays start from, [`BEAM`] each: an opening through which one ray in ten thousand leaves is met by 52.
const POINTS: usize = 32_768;
/// Points that a task looks from.
const CHUNK: usize = 256;
/// Of so many of the rays that leave each place it is asked where their way is narrowest.
const ASKED: usize = 4;
/// Angles that the rays about them keep, as many by each power of two, radians: what stands 45 degrees away makes nothing narrow.
const ANGLES: [f64; 2] = [0.0005, 0.8];
/// So many times rays are aimed from each place of which fewer than [`ENOUGH`] left, after the first time if any did. A slit of .02 m x
/// 2 m at the end of a room of 12 m is met by 110 of the first rays, in 20 places of 1 cm: without aim points were 6 to 12 % too dark.
const ROUNDS: u64 = 3;
const ENOUGH: usize = 128;
/// Rays that are aimed tell of openings if they leave through the box at this cosine: those along its side leave it beside the opening. A
/// slit of .02 m in the outermost wall was .6 m wide by them.
const STEEP: f64 = 0.05;
/// Rectangles of all places together, and of one. An opening that is a rectangle takes one.
const PARTS: [usize; 2] = [64, 6];
/// Rays that must have left a place, or a small one, for rectangles of its own.
const OWN: [usize; 2] = [8, 64];
/// A place has rectangles of its own where these have less than this share of the area that all places' have there, and no larger share of
/// rays to those is free.
const SMALLER: f64 = 0.5;

impl Openings {
    /// Looks for them in the box around the points of a room. `start`: a point of its surface by area, for a number in [0,1) and a point of
    /// the unit square; `meet`: what rays from a point of a surface meet.
    pub(crate) fn find(
        points: &[DVec3],
        start: impl Fn(f64, [f64; 2]) -> Option<Start> + Sync,
        meet: impl Fn(&Start, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync,
        seed: u64,
    ) -> Self {
        let mut openings = Self::around(points);
        let starts: Vec<Start> = (0..POINTS)
            .filter_map(|k| {
                let mut random = Pcg::new(hash(seed ^ 0x0be7, k as u64));
                let share = (k as f64 + random.f64()) / POINTS as f64;
                start(share, [random.f64(), random.f64()])
            })
            .collect();
        let all: Vec<usize> = (0..starts.len()).collect();
        let wide = |k: usize| -> [DVec3; BEAM] {
            let shift = hash(seed, k as u64);
            let normal = starts[k].normal;
            std::array::from_fn(|j| cosine_direction(normal, sequence02(j as u32, shift)))
        };
        let mut exits = openings.exits((&starts, &all), 0.0, &meet, wide);
        openings.share = exits.len() as f64 / (BEAM * starts.len().max(1)) as f64;
        let places: Vec<usize> = starts
            .iter()
            .map(|start| openings.place(start.point, start.normal))
            .collect();
        let mut gaps = openings.gaps(&starts, &exits, |[k, j]| wide(k)[j], &meet, seed);
        for round in 1..=ROUNDS {
            if exits.is_empty() {
                break;
            }
            let mut found = vec![0; KINDS];
            exits.iter().for_each(|(_, exit)| found[exit.place] += 1);
            let short = |&k: &usize| {
                let found = found[places[k]];
                found < ENOUGH && (round == 1 || found > 0)
            };
            let short: Vec<usize> = all.iter().copied().filter(short).collect();
            let aim = Aim::new(&openings, &gaps);
            let aimed = |k: usize| -> [Gap; BEAM] {
                let mut random = Pcg::new(hash(hash(seed, round), k as u64));
                std::array::from_fn(|j| aim.at(&openings, places[k], j, &mut random))
            };
            let way = |k: usize, gap: Gap| (gap.at - starts[k].point).normalize_or_zero();
            let more = openings.exits((&starts, &short), STEEP, &meet, |k| {
                aimed(k).map(|gap| way(k, gap))
            });
            let new: Vec<Gap> = more.iter().map(|&([k, j], _)| aimed(k)[j]).collect();
            gaps.extend(new);
            exits.extend(more);
        }
        let exits = exits.into_iter().map(|(_, exit)| exit).collect();
        openings.divide(exits, |k, targets| {
            let way = |at: DVec3| (at - starts[k].point).normalize_or_zero();
            meet(&starts[k], &targets.map(way)).map(|met| met.is_none())
        });
        openings
    }

    /// Where rays from some of the points leave; only those as steep as this to the side that they leave through, a cosine.
    fn exits(
        &self,
        (starts, some): (&[Start], &[usize]),
        steep: f64,
        meet: &(impl Fn(&Start, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync),
        ways: impl Fn(usize) -> [DVec3; BEAM] + Sync,
    ) -> Left {
        let from_chunk = |chunk: &[usize]| {
            let mut found = Vec::new();
            for &k in chunk {
                let (start, ways) = (&starts[k], ways(k));
                let [place, small] =
                    [PLACES, 2 * PLACES].map(|cells| self.kind(start.point, start.normal, cells));
                let met = meet(start, &ways);
                for j in (0..BEAM).filter(|&j| met[j].is_none()) {
                    if start.normal.dot(ways[j]) > 0.0 {
                        let spot = self.leaves(start.point, ways[j]).0;
                        if ways[j][usize::from(spot.plane) % 3].abs() < steep {
                            continue;
                        }
                        let start = k;
                        found.push((
                            [k, j],
                            Exit {
                                place,
                                small,
                                start,
                                spot,
                            },
                        ));
                    }
                }
            }
            found
        };
        some.par_chunks(CHUNK).flat_map_iter(from_chunk).collect()
    }

    /// Gaps on the ways of some of the rays that left.
    fn gaps(
        &self,
        starts: &[Start],
        exits: &Left,
        way: impl Fn([usize; 2]) -> DVec3 + Sync,
        meet: &(impl Fn(&Start, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync),
        seed: u64,
    ) -> Vec<Gap> {
        let mut asked = vec![0; KINDS];
        let some: Vec<&([usize; 2], Exit)> = exits
            .iter()
            .filter(|(_, exit)| {
                asked[exit.place] += 1;
                asked[exit.place] <= ASKED
            })
            .collect();
        let narrowest = |&&(ray, Exit { place, .. }): &&([usize; 2], Exit)| {
            let (start, way) = (&starts[ray[0]], way(ray));
            let mut random = Pcg::new(hash(hash(seed ^ 0x9a9, ray[0] as u64), ray[1] as u64));
            let [least, most] = ANGLES.map(f64::log2);
            let angles: [f64; BEAM] = std::array::from_fn(|k| {
                let share = (k as f64 + random.f64()) / BEAM as f64;
                (least + (most - least) * share).exp2()
            });
            let ways = angles.map(|angle| around(way, angle.cos(), random.f64()));
            let met = meet(start, &ways);
            // What is nearest, and what faces the ray before what lies along it, as the sides of a deep window do.
            let beside = (0..BEAM).filter_map(|k| {
                let wall = met[k].filter(|_| start.normal.dot(ways[k]) > 0.0)?;
                let facing = wall.normal.dot(way).abs().max(1e-6);
                Some((angles[k] / facing, k, wall))
            });
            let (spot, mut far) = self.leaves(start.point, way);
            let mut axis = usize::from(spot.plane) % 3;
            if let Some((_, k, wall)) = beside.min_by(|a, b| a.0.total_cmp(&b.0)) {
                let straight = wall.distance * angles[k].cos();
                let by_plane = wall.distance * wall.normal.dot(ways[k]) / wall.normal.dot(way);
                let is_near = by_plane > 0.5 * straight && by_plane < 2.0 * straight;
                let gap = if is_near { by_plane } else { straight };
                if gap < far {
                    (far, axis) = (gap, wall.normal.abs().max_position());
                }
            }
            let at = start.point + way * far;
            Gap { place, at, axis }
        };
        some.par_iter().map(narrowest).collect()
    }

    /// Makes the parts. `free`: which of these points are seen from the start of a number.
    pub(super) fn divide(
        &mut self,
        mut exits: Vec<Exit>,
        free: impl Fn(usize, [DVec3; BEAM]) -> [bool; BEAM] + Sync,
    ) {
        let mut spots: Vec<Spot> = exits.iter().map(|e| e.spot).collect();
        self.parts = self.cover(&mut spots, Edges::Sharp, PARTS[0]);
        self.shared = self.parts.len();
        let kinds: [fn(&Exit) -> usize; 2] = [|e| e.place, |e| e.small];
        self.own = [0, 1].map(|k| {
            exits.sort_by_key(kinds[k]);
            let groups = exits.chunk_by(|a, b| kinds[k](a) == kinds[k](b));
            let many: Vec<&[Exit]> = groups.filter(|g| g.len() >= OWN[k]).collect();
            let own: Vec<Vec<Rectangle>> =
                many.par_iter().map(|g| self.own_parts(g, &free)).collect();
            let mut first = vec![0; KINDS * [1, 8][k] + 1];
            for (group, parts) in many.iter().zip(own) {
                first[kinds[k](&group[0]) + 1] = parts.len() as u32;
                self.parts.extend(parts);
            }
            first[0] = (self.parts.len() - first.iter().sum::<u32>() as usize) as u32;
            for k in 1..first.len() {
                first[k] += first[k - 1];
            }
            first
        });
    }

    fn cover(&self, spots: &mut [Spot], edges: Edges, most: usize) -> Vec<Rectangle> {
        let sides: [Rectangle; 6] = std::array::from_fn(|side| self.side(side as u8));
        let cell = |side: u8| sides[usize::from(side)].size().map(|s| s / CELLS as f64);
        cover(spots, &sides, edges, cell, most)
    }

    /// The parts of a place alone, if they are smaller than those of all places that are seen from there, and these mostly hidden.
    fn own_parts(
        &self,
        exits: &[Exit],
        free: &impl Fn(usize, [DVec3; BEAM]) -> [bool; BEAM],
    ) -> Vec<Rectangle> {
        let mut spots: Vec<Spot> = exits.iter().map(|e| e.spot).collect();
        let shared = &self.parts[..self.shared];
        let mut seen: Vec<usize> = spots
            .iter()
            .filter_map(|s| shared.iter().position(|p| p.holds(s.plane, s.at)))
            .collect();
        seen.sort_unstable();
        seen.dedup();
        let mut all = 0.0;
        let upto = |&k: &usize| {
            all += shared[k].area();
            all
        };
        let upto: Vec<f64> = seen.iter().map(upto).collect();
        let parts = self.cover(&mut spots, Edges::Blurred, PARTS[1]);
        if parts.iter().map(Rectangle::area).sum::<f64>() >= SMALLER * all {
            return Vec::new();
        }
        let asked = exits.iter().step_by(exits.len().div_ceil(ASKED));
        let (mut open, mut rays) = (0, 0);
        for (k, exit) in asked.enumerate() {
            let mut random = Pcg::new(hash(exit.start as u64, k as u64));
            let seen = free(
                exit.start,
                std::array::from_fn(|_| {
                    let target = random.f64() * all;
                    let k = upto
                        .partition_point(|&upto| upto <= target)
                        .min(seen.len() - 1);
                    let (part, [u, v]) = (&shared[seen[k]], [random.f64(), random.f64()]);
                    let size = part.size();
                    self.point(
                        part.plane,
                        [part.low[0] + u * size[0], part.low[1] + v * size[1]],
                    )
                }),
            );
            open += seen.into_iter().filter(|&seen| seen).count();
            rays += BEAM;
        }
        match (open as f64) < SMALLER * rays as f64 {
            true => parts,
            false => Vec::new(),
        }
    }
}
