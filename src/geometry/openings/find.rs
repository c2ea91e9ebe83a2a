//! Finds openings: rays all over the hemispheres first, then rays that are aimed.

use super::aim::Aim;
use super::boxes::enclose;
use super::gaps::{Exit, Gap};
use super::sides::{BEAM, KINDS, MARGIN, Openings, RayStart, Wall};
use crate::geometry::sampling::{Pcg, cosine_direction, hash, sequence02};
use glam::DVec3;
use rayon::prelude::*;

/// Points that rays start from, [`BEAM`] each: an opening through which one ray in ten thousand leaves is met by 52.
const POINTS: usize = 32_768;
/// Points that a task looks from.
const CHUNK: usize = 256;
/// Of so many of the rays that leave each place, each time, it is asked where their way is narrowest.
const ASKED: usize = 8;
/// So many times rays are aimed from each place that knows fewer gaps than [`ENOUGH`], after the first time if it knows any. A slit of .02
/// m x 2 m at the end of a room of 12 m is met by 110 of the first rays, in 20 places of 1 cm: without aim points were 6 to 12 % too dark.
const ROUNDS: u64 = 3;
const ENOUGH: usize = 32;
/// An opening that is a rectangle takes one box.
const PARTS: usize = 64;

impl Openings {
    /// Looks for them in the box around the points of a room. `start`: a point of its surface by area, for a number in [0,1) and a point of
    /// the unit square; `meet`: what rays from a point of a surface meet.
    pub(crate) fn find(
        points: &[DVec3],
        start: impl Fn(f64, [f64; 2]) -> Option<RayStart> + Sync,
        meet: impl Fn(&RayStart, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync,
        seed: u64,
    ) -> Self {
        let mut openings = Self::around(points);
        let starts: Vec<RayStart> = (0..POINTS)
            .filter_map(|k| {
                let mut random = Pcg::new(hash(seed ^ 0x0be7, k as u64));
                let share = (k as f64 + random.f64()) / POINTS as f64;
                start(share, [random.f64(), random.f64()])
            })
            .collect();
        let wide = |k: usize| -> [DVec3; BEAM] {
            let shift = hash(seed, k as u64);
            let normal = starts[k].normal;
            std::array::from_fn(|j| cosine_direction(normal, sequence02(j as u32, shift)))
        };
        let all: Vec<usize> = (0..starts.len()).collect();
        let places: Vec<usize> = starts
            .iter()
            .map(|start| openings.place(start.point, start.normal))
            .collect();
        let exits = self::exits((&starts, &places, &all), &meet, wide);
        openings.share = exits.len() as f64 / (BEAM * starts.len().max(1)) as f64;
        let mut gaps = openings.gaps(&starts, &exits, &meet, hash(seed, 0));
        for round in 1..=ROUNDS {
            if gaps.is_empty() {
                break;
            }
            let mut found = vec![0; KINDS];
            gaps.iter().for_each(|gap| found[gap.place] += 1);
            let is_short = |&k: &usize| {
                let found = found[places[k]];
                found < ENOUGH && (round == 1 || found > 0)
            };
            let short: Vec<usize> = all.iter().copied().filter(is_short).collect();
            let aim = Aim::new(&openings, &gaps);
            let aimed = |k: usize| -> [DVec3; BEAM] {
                let mut random = Pcg::new(hash(hash(seed, round), k as u64));
                std::array::from_fn(|j| {
                    let target = aim.at(&openings, places[k], j, &mut random);
                    (target - starts[k].point).normalize_or_zero()
                })
            };
            let more = self::exits((&starts, &places, &short), &meet, aimed);
            let more = openings.gaps(&starts, &more, &meet, hash(seed, round));
            gaps.extend(more);
        }
        let flat = DVec3::splat(0.5 * MARGIN * (openings.high - openings.low).length());
        let widths = [openings.cell(), flat];
        openings.parts = enclose(&mut gaps, [openings.low, openings.high], widths, PARTS);
        openings.look_at_parts((&starts, &places), &meet, hash(seed, ROUNDS + 1));
        openings
    }

    /// Gaps on the ways of some of the rays that left each place, spread over these.
    fn gaps(
        &self,
        starts: &[RayStart],
        exits: &[Exit],
        meet: &(impl Fn(&RayStart, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync),
        seed: u64,
    ) -> Vec<Gap> {
        let [mut left, mut seen] = [vec![0_usize; KINDS], vec![0_usize; KINDS]];
        exits.iter().for_each(|exit| left[exit.place] += 1);
        let is_asked = |exit: &&Exit| {
            let k = seen[exit.place];
            seen[exit.place] += 1;
            k % left[exit.place].div_ceil(ASKED) == 0
        };
        let asked: Vec<&Exit> = exits.iter().filter(is_asked).collect();
        let gap = |(k, exit): (usize, &&Exit)| {
            self.gap(&starts[exit.start], exit, meet, hash(seed, k as u64))
        };
        asked.par_iter().enumerate().map(gap).collect()
    }
}

/// The rays that leave from some of the points.
fn exits(
    (starts, places, some): (&[RayStart], &[usize], &[usize]),
    meet: &(impl Fn(&RayStart, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync),
    ways: impl Fn(usize) -> [DVec3; BEAM] + Sync,
) -> Vec<Exit> {
    let from_chunk = |chunk: &[usize]| {
        let mut found = Vec::new();
        for &k in chunk {
            let (start, ways) = (&starts[k], ways(k));
            let place = places[k];
            let met = meet(start, &ways);
            for (way, _) in ways.into_iter().zip(met).filter(|(_, met)| met.is_none()) {
                if start.normal.dot(way) > 0.0 {
                    let start = k;
                    found.push(Exit { start, place, way });
                }
            }
        }
        found
    };
    some.par_chunks(CHUNK).flat_map_iter(from_chunk).collect()
}
