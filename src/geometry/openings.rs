//! Where rays leave a room: rectangles on the box around it, found once by rays from all surfaces. Rays all over the hemispheres find the
//! large ones; rays that are aimed near where others left find the extent of small ones. What opens further inside than the box is seen
//! elsewhere on it from each place: places that lie near each other and look the same way have rectangles of their own where these are
//! smaller.
//!
//! A point that looks for the sky sends rays to these parts, in proportion to what they may bring, besides rays all over its
//! hemisphere. Both together are without bias, whatever was overlooked here: parts only decide where it pays to look.

use super::cover::{Rectangle, Spot, cover};
use super::sampling::{Pcg, cosine_direction, hash, sequence02};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::Range;

/// Points that rays start from, [`BEAM`] each: an opening through which one ray in ten thousand leaves is met by 52.
const POINTS: usize = 32_768;
/// Rays from a point.
pub(crate) const BEAM: usize = 16;
/// Points that a task looks from.
const CHUNK: usize = 256;
/// So many times rays are aimed from each place of which fewer rays left than are asked for, if any left near it. A slit of .02 m x 2 m at
/// the end of a room of 12 m is met by 110 of the first rays, in 20 places of 1 cm: without aim points were 6 to 12 % too dark.
const ROUNDS: u64 = 3;
const ENOUGH: usize = 128;
/// Cells along a side of the box, by which rays are aimed: each that was met as often as any other.
const CELLS: usize = 32;
/// Rays are aimed beside a place by so many cells, as often by each power of two.
const BESIDE: [f64; 2] = [0.0625, 2.0];
/// Places fall into so many cells along a side of the box.
const PLACES: usize = 8;
const KINDS: usize = 6 * PLACES.pow(3);
/// Rectangles of all places together, and of one. An opening that is a rectangle takes one.
const PARTS: [usize; 2] = [64, 24];
/// Rays that a place's own rectangles take, and the share that they have at the most of the area that all places' have there. Such places
/// also send a quarter of their rays where rays from others left.
const OWN: (usize, f64) = (ENOUGH / 2, 0.5);
const OWN_RAYS: f64 = 0.75;
/// A part is weighed in pieces that are no longer than this share of their distance, at most so many along its side and so many in all.
const LENGTH: f64 = 0.5;
const ALONG: f64 = 16.0;
const PIECES: usize = 512;
/// From so many rays on a part counts in full: one that a few rays touched is mostly wall.
const FILLED: usize = 16;
/// The box is larger than the room by this share of its half size: a few gaps of the ray index, so that it lies close upon openings in the
/// outermost walls. With .001 what is seen through a roof at a low angle leaves the box beside its opening.
const MARGIN: f64 = 2e-5;
/// A piece that seems edge-on from its middle still counts as if it were turned by this cosine.
const LEAST_COSINE: f64 = 0.1;

/// A point of a surface that rays start from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    pub(crate) point: DVec3,
    pub(crate) normal: DVec3,
    pub(crate) plane: u32,
}

/// Where rays leave a room.
#[derive(Debug, Clone, Default)]
pub(crate) struct Openings {
    low: DVec3,
    high: DVec3,
    /// Those of all places first, then those of each.
    parts: Vec<Rectangle>,
    /// Of all places.
    shared: usize,
    /// First of the parts of each kind of place, one more at the end.
    own: Vec<u32>,
}

/// A ray that left: from which kind of place, and where.
#[derive(Debug, Clone, Copy)]
struct Exit {
    place: usize,
    spot: Spot,
}

/// What the parts of the openings may bring to a point, summed up piece by piece.
#[derive(Debug, Default)]
pub(crate) struct Choice {
    parts: Vec<Pieces>,
    sums: Vec<f64>,
    /// Where the lists of parts and pieces of all places end, and what share of the rays those of the place have.
    shared: [usize; 2],
    own: f64,
}

/// A part in pieces: as many along either axis, and the number of the first.
#[derive(Debug, Clone, Copy)]
struct Pieces {
    part: u32,
    along: [u32; 2],
    first: u32,
}

/// Directions other than `axis`.
fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

impl Openings {
    /// Looks for them in the box around the points of a room. `start`: a point of its surface by area, for a number in [0,1) and a point of
    /// the unit square; `free`: which rays from there meet nothing.
    pub(crate) fn find(
        points: &[DVec3],
        start: impl Fn(f64, [f64; 2]) -> Option<Start> + Sync,
        free: impl Fn(&Start, &[DVec3; BEAM]) -> [bool; BEAM] + Sync,
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
        let mut exits = openings.exits(&starts, &free, |k, start| {
            let shift = hash(seed, k as u64);
            std::array::from_fn(|j| cosine_direction(start.normal, sequence02(j as u32, shift)))
        });
        for round in 1..=ROUNDS {
            if exits.is_empty() {
                break;
            }
            let aim = Aim::new(&openings, &exits);
            let place = |start: &Start| openings.place(start.point, start.normal);
            let short: Vec<Start> = starts
                .iter()
                .filter(|start| aim.falls_short(place(start)))
                .copied()
                .collect();
            let more = openings.exits(&short, &free, |k, start| {
                let mut random = Pcg::new(hash(hash(seed, round), k as u64));
                let place = place(start);
                std::array::from_fn(|j| {
                    let at = aim.at(&openings, (place, j), &mut random);
                    (at - start.point).normalize_or_zero()
                })
            });
            exits.extend(more);
        }
        openings.divide(&exits);
        openings
    }

    /// The box, nothing open.
    fn around(points: &[DVec3]) -> Self {
        let [low, high] = points
            .iter()
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], &p| {
                [low.min(p), high.max(p)]
            });
        let margin = DVec3::splat(0.5 * MARGIN * (high - low).length());
        Self {
            low: low - margin,
            high: high + margin,
            ..Self::default()
        }
    }

    /// Does no ray leave the room?
    pub(crate) fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Where rays in these directions from all points leave.
    fn exits(
        &self,
        starts: &[Start],
        free: &(impl Fn(&Start, &[DVec3; BEAM]) -> [bool; BEAM] + Sync),
        directions: impl Fn(usize, &Start) -> [DVec3; BEAM] + Sync,
    ) -> Vec<Exit> {
        let chunks: Vec<usize> = (0..starts.len()).step_by(CHUNK).collect();
        let from_some = |first: usize| {
            let mut found = Vec::new();
            for (k, start) in starts.iter().enumerate().skip(first).take(CHUNK) {
                let ways = directions(k, start);
                let place = self.place(start.point, start.normal);
                for (d, free) in ways.into_iter().zip(free(start, &ways)) {
                    if free && start.normal.dot(d) > 0.0 {
                        let spot = self.leaves(start.point, d).0;
                        found.push(Exit { place, spot });
                    }
                }
            }
            found
        };
        chunks.into_par_iter().flat_map_iter(from_some).collect()
    }

    /// Where a ray from within the box leaves it, and how far away: sides 0 to 2 are the low ones.
    fn leaves(&self, from: DVec3, direction: DVec3) -> (Spot, f64) {
        let mut exit = (0, f64::INFINITY);
        for axis in 0..3 {
            let d = direction[axis];
            let end = if d > 0.0 { self.high } else { self.low };
            let t = (end[axis] - from[axis]) / d;
            if d != 0.0 && t < exit.1 {
                exit = (axis + if d > 0.0 { 3 } else { 0 }, t.max(0.0));
            }
        }
        let (side, t) = exit;
        let at = from + direction * t;
        let spot = Spot {
            plane: side as u8,
            at: across(side % 3).map(|axis| at[axis]),
        };
        (spot, t)
    }

    /// A point of a side.
    fn point(&self, side: u8, at: [f64; 2]) -> DVec3 {
        let axis = usize::from(side) % 3;
        let mut point = if side < 3 { self.low } else { self.high };
        for (axis, x) in across(axis).into_iter().zip(at) {
            point[axis] = x;
        }
        point
    }

    /// A side as a whole.
    fn side(&self, side: u8) -> Rectangle {
        let axes = across(usize::from(side) % 3);
        Rectangle {
            low: axes.map(|axis| self.low[axis]),
            high: axes.map(|axis| self.high[axis]),
            plane: side,
            count: 0,
        }
    }

    /// What kind of place a point is: where it lies, and which way it looks.
    fn place(&self, point: DVec3, normal: DVec3) -> usize {
        let share = (point - self.low) / (self.high - self.low) * PLACES as f64;
        let [x, y, z] = share.to_array().map(|s| (s as usize).min(PLACES - 1));
        let axis = normal.abs().max_position();
        let side = axis + if normal[axis] > 0.0 { 3 } else { 0 };
        ((side * PLACES + x) * PLACES + y) * PLACES + z
    }

    /// Makes the parts.
    fn divide(&mut self, exits: &[Exit]) {
        let sides: Vec<Rectangle> = (0..6).map(|side| self.side(side)).collect();
        let cell = |side: u8| sides[usize::from(side)].size().map(|s| s / CELLS as f64);
        let mut spots: Vec<Spot> = exits.iter().map(|e| e.spot).collect();
        self.parts = cover(&mut spots, &sides, cell, PARTS[0]);
        self.shared = self.parts.len();
        let mut sorted = exits.to_vec();
        sorted.sort_by_key(|e| e.place);
        let groups: Vec<&[Exit]> = sorted.chunk_by(|a, b| a.place == b.place).collect();
        let own = |group: &&[Exit]| {
            let mut spots: Vec<Spot> = group.iter().map(|e| e.spot).collect();
            // What of all places' parts is seen from here.
            let mut seen: Vec<usize> = spots
                .iter()
                .filter_map(|s| self.parts.iter().position(|p| p.holds(s.plane, s.at)))
                .collect();
            seen.sort_unstable();
            seen.dedup();
            let all: f64 = seen.into_iter().map(|k| self.parts[k].area()).sum();
            let parts = match spots.len() >= OWN.0 {
                true => cover(&mut spots, &sides, cell, PARTS[1]),
                false => Vec::new(),
            };
            let area: f64 = parts.iter().map(Rectangle::area).sum();
            (
                group[0].place,
                if area < OWN.1 * all {
                    parts
                } else {
                    Vec::new()
                },
            )
        };
        let own: Vec<(usize, Vec<Rectangle>)> = groups.par_iter().map(own).collect();
        self.own = vec![0; KINDS + 1];
        for (place, parts) in own {
            self.own[place + 1] = parts.len() as u32;
            self.parts.extend(parts);
        }
        let mut end = self.shared as u32;
        for first in &mut self.own {
            end += *first;
            *first = end;
        }
    }

    /// What each part may bring to a point that looks along a normal: about its form factor times `brightness` of its direction.
    pub(crate) fn weigh(
        &self,
        point: DVec3,
        normal: DVec3,
        brightness: impl Fn(DVec3) -> f64,
        choice: &mut Choice,
    ) {
        choice.parts.clear();
        choice.sums.clear();
        let place = self.place(point, normal);
        let own = match self.own.get(place..place + 2) {
            Some(ends) => ends[0] as usize..ends[1] as usize,
            None => 0..0,
        };
        let length = self.piece_together(0..self.shared, point, LENGTH, choice);
        choice.shared[0] = choice.parts.len();
        self.piece_together(own, point, length, choice);
        for k in 0..choice.parts.len() {
            if k == choice.shared[0] {
                choice.shared[1] = choice.sums.len();
            }
            let pieces = choice.parts[k];
            let part = &self.parts[pieces.part as usize];
            let starts = k == 0 || k == choice.shared[0];
            let mut sum = match starts {
                true => 0.0,
                false => choice.sums.last().copied().unwrap_or(0.0),
            };
            for at in pieces.all() {
                let toward = self.toward(part, &pieces, at, point, normal);
                sum += toward.map_or(0.0, |(direction, factor)| factor * brightness(direction));
                choice.sums.push(sum);
            }
        }
        if choice.shared[0] == choice.parts.len() {
            choice.shared[1] = choice.sums.len();
        }
        let [all, own] = choice.totals();
        choice.own = match (all > 0.0, own > 0.0) {
            (true, true) => OWN_RAYS,
            (_, own) => f64::from(u8::from(own)),
        };
    }

    /// Adds parts in pieces, coarser ones where they were too many; how long they are for their distance.
    fn piece_together(
        &self,
        list: Range<usize>,
        point: DVec3,
        mut length: f64,
        choice: &mut Choice,
    ) -> f64 {
        let start = choice.parts.len();
        loop {
            choice.parts.truncate(start);
            let before = match choice.parts.last() {
                Some(last) => (last.first + last.count()) as usize,
                None => 0,
            };
            let mut first = before;
            for k in list.clone() {
                let pieces = self.pieces(k, point, length, first);
                first += pieces.count() as usize;
                choice.parts.push(pieces);
            }
            if first - before <= PIECES.max(list.len()) {
                return length;
            }
            length *= 1.5;
        }
    }

    /// A part in pieces no longer than this for their distance.
    fn pieces(&self, part: usize, point: DVec3, length: f64, first: usize) -> Pieces {
        let of = &self.parts[part];
        let [low, high] = [of.low, of.high].map(|at| self.point(of.plane, at));
        let distance = (point.clamp(low, high) - point).length();
        let along = of.size().map(|size| {
            (size / (length * distance).max(1e-300))
                .ceil()
                .clamp(1.0, ALONG) as u32
        });
        Pieces {
            part: part as u32,
            along,
            first: first as u32,
        }
    }

    /// The direction of a piece's middle, and about its form factor; none if it is behind.
    fn toward(
        &self,
        part: &Rectangle,
        pieces: &Pieces,
        at: [u32; 2],
        point: DVec3,
        normal: DVec3,
    ) -> Option<(DVec3, f64)> {
        let [low, size] = pieces.place(part, at);
        let corner = |u: f64, v: f64| {
            let at = [low[0] + u * size[0], low[1] + v * size[1]];
            self.point(part.plane, at) - point
        };
        let ends = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]];
        if ends.iter().all(|&[u, v]| normal.dot(corner(u, v)) <= 0.0) {
            return None;
        }
        let way = corner(0.5, 0.5);
        let r2 = way.length_squared();
        let direction = way / r2.sqrt().max(1e-300);
        let here = normal.dot(direction).max(LEAST_COSINE);
        let there = direction[usize::from(part.plane) % 3]
            .abs()
            .max(LEAST_COSINE);
        let area = size[0] * size[1];
        let filled = (part.count as f64 / FILLED as f64).min(1.0);
        Some((direction, filled * area * here * there / (PI * r2 + area)))
    }

    /// What all parts may bring if nothing stands in the way.
    pub(crate) fn most<const N: usize>(
        &self,
        point: DVec3,
        normal: DVec3,
        brightness: impl Fn(DVec3) -> [f64; N],
    ) -> [f64; N] {
        let mut sum = [0.0; N];
        for k in 0..self.shared {
            let pieces = self.pieces(k, point, LENGTH, 0);
            let part = &self.parts[k];
            for at in pieces.all() {
                if let Some((direction, factor)) = self.toward(part, &pieces, at, point, normal) {
                    let each = brightness(direction);
                    sum = std::array::from_fn(|k| sum[k] + factor * each[k]);
                }
            }
        }
        sum
    }

    /// A place on a part, chosen by what the parts may bring.
    pub(crate) fn choose(&self, choice: &Choice, [u, v]: [f64; 2]) -> Option<DVec3> {
        let totals = choice.totals();
        let own = u < choice.own;
        let (list, share) = match own {
            true => (1, u / choice.own),
            false => (0, (u - choice.own) / (1.0 - choice.own)),
        };
        if totals[list] <= 0.0 {
            return None;
        }
        let (parts, sums) = choice.lists()[list].clone();
        let target = share * totals[list];
        let all = &choice.sums[sums.clone()];
        let k = all.partition_point(|&sum| sum <= target).min(all.len() - 1);
        let worth = choice.of(sums.start + k);
        let rest = ((target - (all[k] - worth)) / worth).clamp(0.0, 1.0);
        let piece = (sums.start + k) as u32;
        let parts = &choice.parts[parts];
        let pieces = &parts[parts.partition_point(|p| p.first <= piece) - 1];
        let part = &self.parts[pieces.part as usize];
        let number = piece - pieces.first;
        let [low, size] = pieces.place(part, [number / pieces.along[1], number % pieces.along[1]]);
        Some(self.point(part.plane, [low[0] + rest * size[0], low[1] + v * size[1]]))
    }

    /// Density, by solid angle, with which [`choose`](Self::choose) finds a direction of unit length.
    pub(crate) fn density(&self, choice: &Choice, from: DVec3, direction: DVec3) -> f64 {
        let (spot, t) = self.leaves(from, direction);
        if !t.is_finite() {
            return 0.0;
        }
        let by_area: f64 = [1.0 - choice.own, choice.own]
            .into_iter()
            .zip(choice.lists())
            .zip(choice.totals())
            .filter(|((share, _), total)| *share > 0.0 && *total > 0.0)
            .map(|((share, (parts, _)), total)| {
                let mut parts = choice.parts[parts].iter();
                let holds = |p: &&Pieces| self.parts[p.part as usize].holds(spot.plane, spot.at);
                parts.find(holds).map_or(0.0, |pieces| {
                    let part = &self.parts[pieces.part as usize];
                    let count = f64::from(pieces.count());
                    let piece = choice.of(pieces.at(part, spot.at));
                    share * piece / total * count / part.area().max(1e-300)
                })
            })
            .sum();
        by_area * t * t / direction[usize::from(spot.plane) % 3].abs().max(1e-12)
    }
}

impl Pieces {
    fn count(&self) -> u32 {
        self.along[0] * self.along[1]
    }

    /// All of them.
    fn all(self) -> impl Iterator<Item = [u32; 2]> {
        let [n, m] = self.along;
        (0..n).flat_map(move |i| (0..m).map(move |j| [i, j]))
    }

    /// Corner and size of one.
    fn place(&self, part: &Rectangle, at: [u32; 2]) -> [[f64; 2]; 2] {
        let whole = part.size();
        let size = [0, 1].map(|k| whole[k] / f64::from(self.along[k]));
        let low = [0, 1].map(|k| part.low[k] + f64::from(at[k]) * size[k]);
        [low, size]
    }

    /// Number of the one that holds a point of the part.
    fn at(&self, part: &Rectangle, at: [f64; 2]) -> usize {
        let size = part.size();
        let [i, j] = [0, 1].map(|k| {
            let share = (at[k] - part.low[k]) / size[k].max(1e-300);
            ((share * f64::from(self.along[k])) as u32).min(self.along[k] - 1)
        });
        (self.first + i * self.along[1] + j) as usize
    }
}

impl Choice {
    /// Parts and pieces of all places, and of the point's own.
    fn lists(&self) -> [(Range<usize>, Range<usize>); 2] {
        let [parts, pieces] = self.shared;
        [
            (0..parts, 0..pieces),
            (parts..self.parts.len(), pieces..self.sums.len()),
        ]
    }

    fn totals(&self) -> [f64; 2] {
        self.lists()
            .map(|(_, pieces)| self.sums[pieces].last().copied().unwrap_or(0.0))
    }

    /// Of the `k`-th piece.
    fn of(&self, k: usize) -> f64 {
        let first = k == 0 || k == self.shared[1];
        self.sums[k] - if first { 0.0 } else { self.sums[k - 1] }
    }
}

/// Where rays are aimed: beside where others left.
struct Aim<'a> {
    exits: &'a [Exit],
    /// Numbers of exits, cell by cell of the sides, and where each cell that was met starts, one more at the end.
    by_cell: Vec<u32>,
    cells: Vec<u32>,
    /// The same place by place, where each of all starts.
    by_place: Vec<u32>,
    places: Vec<u32>,
}

impl<'a> Aim<'a> {
    fn new(openings: &Openings, exits: &'a [Exit]) -> Self {
        let cell = |e: &Exit| {
            let side = openings.side(e.spot.plane);
            let [u, v] = [0, 1].map(|k| {
                let share = (e.spot.at[k] - side.low[k]) / side.size()[k].max(1e-300);
                ((share * CELLS as f64) as usize).min(CELLS - 1)
            });
            (usize::from(e.spot.plane) * CELLS + u) * CELLS + v
        };
        let numbers = || (0..exits.len() as u32).collect::<Vec<u32>>();
        let (mut by_cell, mut by_place) = (numbers(), numbers());
        by_cell.sort_by_cached_key(|&k| cell(&exits[k as usize]));
        by_place.sort_by_key(|&k| exits[k as usize].place);
        let same = |a: &u32, b: &u32| cell(&exits[*a as usize]) == cell(&exits[*b as usize]);
        let mut cells = vec![0];
        for group in by_cell.chunk_by(same) {
            cells.push(cells[cells.len() - 1] + group.len() as u32);
        }
        let place = |kind: usize| by_place.partition_point(|&k| exits[k as usize].place < kind);
        let places = (0..=KINDS).map(|kind| place(kind) as u32).collect();
        Self {
            exits,
            by_cell,
            cells,
            by_place,
            places,
        }
    }

    /// The exits that a kind of place found.
    fn of(&self, place: usize) -> &[u32] {
        &self.by_place[self.places[place] as usize..self.places[place + 1] as usize]
    }

    /// Are there too few exits from a place, and some from beside it?
    fn falls_short(&self, place: usize) -> bool {
        self.of(place).len() < ENOUGH && beside(place).any(|k| !self.of(k).is_empty())
    }

    /// A point on the box beside where a ray left from this place, from one beside it, or from anywhere, each cell as often: by turns.
    fn at(&self, openings: &Openings, (place, turn): (usize, usize), random: &mut Pcg) -> DVec3 {
        let mut among = match turn % 4 {
            0 => &[],
            1 => {
                let met = beside(place).filter(|&k| !self.of(k).is_empty());
                let met: Vec<usize> = met.collect();
                match met.len() {
                    0 => &[],
                    n => self.of(met[random.below(n as u32) as usize]),
                }
            }
            _ => self.of(place),
        };
        if among.is_empty() {
            let cell = random.below(self.cells.len() as u32 - 1) as usize;
            among = &self.by_cell[self.cells[cell] as usize..self.cells[cell + 1] as usize];
        }
        let spot = self.exits[among[random.below(among.len() as u32) as usize] as usize].spot;
        let side = openings.side(spot.plane);
        let at = [0, 1].map(|k| {
            let [least, most] = BESIDE.map(f64::log2);
            let cells = (least + (most - least) * random.f64()).exp2();
            let beside = (2.0 * random.f64() - 1.0) * cells * side.size()[k] / CELLS as f64;
            (spot.at[k] + beside).clamp(side.low[k], side.high[k])
        });
        openings.point(spot.plane, at)
    }
}

/// Places beside one, whichever way they look, itself too.
fn beside(place: usize) -> impl Iterator<Item = usize> {
    let n = PLACES as i64;
    let at = (place % PLACES.pow(3)) as i64;
    let [x, y, z] = [at / (n * n), at / n % n, at % n];
    let near = move |c: i64| (c - 1).max(0)..=(c + 1).min(n - 1);
    (0..6).flat_map(move |side| {
        near(x).flat_map(move |x| {
            near(y).flat_map(move |y| {
                near(z).map(move |z| (((side * n + x) * n + y) * n + z) as usize)
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A floor of 4 m x 4 m in a box of which the lid is open by one rectangle; some places have parts of their own.
    fn openings() -> Openings {
        let mut openings =
            Openings::around(&[DVec3::new(-2.0, 0.0, -2.0), DVec3::new(2.0, 3.0, 2.0)]);
        let here = openings.place(DVec3::new(0.7, 0.2, -0.4), DVec3::Y);
        let exit = |place: usize, x: f64, z: f64| {
            let plane = 4;
            // Across y are z and x.
            let spot = Spot { plane, at: [z, x] };
            Exit { place, spot }
        };
        let mut exits: Vec<Exit> = (0..4000_u32)
            .map(|k| {
                let [x, z] = sequence02(k, 9);
                exit(0, x - 0.5, 1.5 * z - 0.2)
            })
            .collect();
        exits.extend((0..500_u32).map(|k| {
            let [x, z] = sequence02(k, 10);
            exit(here, 0.3 * x - 0.1, 0.4 * z)
        }));
        openings.divide(&exits);
        assert_eq!((openings.shared, openings.parts.len()), (1, 2));
        openings
    }

    /// The chosen directions have the density that is said of them: the mean of f / density is the integral of f.
    #[test]
    fn directions_have_their_density() {
        let openings = openings();
        for point in [DVec3::new(0.7, 0.2, -0.4), DVec3::new(0.1, 2.6, 0.3)] {
            let normal = DVec3::Y;
            let mut choice = Choice::default();
            openings.weigh(point, normal, |_| 1.0, &mut choice);
            let n = 1 << 16;
            let f = |d: DVec3| d.y / PI;
            let chosen: f64 = (0..n)
                .filter_map(|k| openings.choose(&choice, sequence02(k, 3)))
                // Parts reach a little beyond the rectangle, where the lid is.
                .filter(|at| (-0.5..=0.5).contains(&at.x) && (-0.2..=1.3).contains(&at.z))
                .map(|at| (at - point).normalize())
                .map(|d| f(d) / openings.density(&choice, point, d))
                .sum();
            // The rectangle from below, by plain quadrature.
            let m = 400;
            let mut plain = 0.0;
            for j in 0..m {
                for i in 0..m {
                    let at = |k: i32| (f64::from(k) + 0.5) / f64::from(m);
                    let d = DVec3::new(at(i) - 0.5, 3.0, 1.5 * at(j) - 0.2) - point;
                    plain += d.y * d.y / (PI * d.length_squared().powi(2)) * 1.5 / f64::from(m * m);
                }
            }
            let ratio = chosen / f64::from(n) / plain;
            assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
        }
    }

    /// A slit of 2 cm in a wall is found to its edges from 4 m to 16 m away, though few rays all over the hemispheres leave.
    #[test]
    fn slits_are_found_to_their_edges() {
        let open = |p: DVec3| (p.x - 0.3).abs() < 0.01 && (p.y - 1.5).abs() < 1.0;
        let corners = [DVec3::new(-2.0, 0.0, 0.0), DVec3::new(2.0, 3.0, 16.0)];
        let start = |share: f64, [u, _]: [f64; 2]| {
            Some(Start {
                point: DVec3::new(4.0 * u - 2.0, 0.0, 4.0 + 12.0 * share),
                normal: DVec3::Y,
                plane: 0,
            })
        };
        let free = |start: &Start, ways: &[DVec3; BEAM]| {
            ways.map(|d| d.z < 0.0 && open(start.point - d * (start.point.z / d.z)))
        };
        let openings = Openings::find(&corners, start, free, 1);
        let n = 10_000;
        let inside = (0..n).filter(|&k| {
            let [u, v] = sequence02(k, 2);
            let at = [0.29 + 0.02 * u, 0.5 + 2.0 * v];
            openings.parts[..openings.shared]
                .iter()
                .any(|p| p.holds(2, at))
        });
        assert!(inside.count() as u32 > n - n / 200);
        let area: f64 = openings.parts[..openings.shared]
            .iter()
            .map(Rectangle::area)
            .sum();
        assert!(area < 2.0 * 0.04, "{area}");
    }
}
