//! Directions toward openings: chosen by what each piece of them may bring to a point, with their density.

use super::sides::{MARGIN, Openings, PLACES};
use crate::geometry::cover::{Edges, Rectangle, Spot};
use glam::DVec3;
use std::f64::consts::PI;
use std::ops::Range;

/// Where a place has parts of its own they take most of its rays, and so do those of a point of what is left by its place. The others go
/// where rays from elsewhere left, too.
const OWN_RAYS: f64 = 0.75;
/// A part is weighed in pieces that are no longer than this share of their distance, at most so many along its side and so many in all.
const LENGTH: f64 = 0.5;
const ALONG: f64 = 16.0;
const PIECES: usize = 256;
/// From so many rays on a part counts in full: one that a few rays touched is mostly wall.
const FILLED: usize = 16;
/// A piece that seems edge-on from its middle still counts as if it were turned by this cosine.
const LEAST_COSINE: f64 = 0.1;
/// Directions that lead out from a point tell of openings from this number on, and make so many parts.
const TELLING: usize = 4;
const POINT_PARTS: usize = 6;

/// Parts of all places, of a place, and of a point.
const LISTS: usize = 3;

/// What the parts of the openings may bring to a point, summed up piece by piece.
#[derive(Debug, Default)]
pub(crate) struct Choice {
    parts: Vec<Pieces>,
    sums: Vec<f64>,
    /// Where the lists of parts and pieces end, and what share of the rays each has.
    ends: [[usize; 2]; LISTS],
    shares: [f64; LISTS],
    /// Parts of the point alone; their numbers go on where those of the openings end.
    found: Vec<Rectangle>,
}

/// A part in pieces: as many along either axis, and the number of the first.
#[derive(Debug, Clone, Copy)]
struct Pieces {
    part: u32,
    along: [u32; 2],
    first: u32,
}

impl Openings {
    /// What each part may bring to a point that looks along a normal: about its form factor times `brightness` of its direction.
    pub(crate) fn weigh(
        &self,
        point: DVec3,
        normal: DVec3,
        brightness: impl Fn(DVec3) -> f64,
        choice: &mut Choice,
    ) {
        choice.clear();
        // Of the small place if it has any.
        let own = [1, 0].into_iter().find_map(|k| {
            let kind = self.kind(point, normal, PLACES << k);
            let ends = self.own[k].get(kind..kind + 2)?;
            (ends[0] < ends[1]).then_some(ends[0] as usize..ends[1] as usize)
        });
        let lists = [0..self.shared, own.unwrap_or_default()];
        let mut length = LENGTH;
        for (list, parts) in lists.into_iter().enumerate() {
            length = self.piece_together(parts, point, length, choice);
            self.sum_up((point, normal), &brightness, list, choice);
        }
    }

    /// Are there places with parts of their own? Then a point sees something else than its neighbours do.
    pub(super) fn differ(&self) -> bool {
        self.parts.len() > self.shared
    }

    /// Where a ray through a gap leaves the box; `k`: any number.
    pub(crate) fn beyond_gap(&self, point: DVec3, k: usize) -> DVec3 {
        let direction = (self.gaps[k % self.gaps.len()] - point).normalize_or_zero();
        point + direction * self.leaves(point, direction).1.min(f64::MAX)
    }

    /// Adds parts of the point alone, about directions that are known to lead out from there.
    pub(crate) fn aim(
        &self,
        (point, normal): (DVec3, DVec3),
        brightness: impl Fn(DVec3) -> f64,
        open: &[DVec3],
        choice: &mut Choice,
    ) {
        if open.len() < TELLING {
            return;
        }
        let mut spots: Vec<Spot> = open.iter().map(|&d| self.leaves(point, d).0).collect();
        choice.forget_point();
        choice.found = self.cover(&mut spots, Edges::Told, |_| [0.0; 2], POINT_PARTS);
        let list = self.parts.len()..self.parts.len() + choice.found.len();
        self.piece_together(list, point, LENGTH, choice);
        self.sum_up((point, normal), brightness, LISTS - 1, choice);
    }

    /// Weighs the pieces that a list has got.
    fn sum_up(
        &self,
        (point, normal): (DVec3, DVec3),
        brightness: impl Fn(DVec3) -> f64,
        list: usize,
        choice: &mut Choice,
    ) {
        let mut sum = choice.sums.last().copied().unwrap_or(0.0);
        for k in choice.list(list).start..choice.parts.len() {
            let pieces = choice.parts[k];
            let part = self.part(choice, pieces.part as usize);
            for at in pieces.all() {
                let toward = self.toward(&part, &pieces, at, point, normal);
                sum += toward.map_or(0.0, |(ways, factor)| {
                    factor * ways.map(&brightness).iter().sum::<f64>()
                });
                choice.sums.push(sum);
            }
        }
        choice.ends[list..].fill([choice.parts.len(), choice.sums.len()]);
        choice.share_out();
    }

    /// A part by its number.
    fn part(&self, choice: &Choice, k: usize) -> Rectangle {
        let known = self.parts.get(k).copied();
        known.unwrap_or_else(|| choice.found[k - self.parts.len()])
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
                let pieces = self.pieces((k, &self.part(choice, k)), point, length, first);
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
    fn pieces(
        &self,
        (part, of): (usize, &Rectangle),
        point: DVec3,
        length: f64,
        first: usize,
    ) -> Pieces {
        let [low, high] = [of.low, of.high].map(|at| self.point(of.plane, at));
        // Never none: a point on the box would have no end of pieces.
        let distance = (point.clamp(low, high) - point).length();
        let distance = distance.max(MARGIN * (self.high - self.low).length());
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

    /// The directions of a piece's middle and of two corners, and about its form factor for each; none if it is behind. By the middle alone
    /// a slit across the horizon, half of it above black ground, was never looked through.
    fn toward(
        &self,
        part: &Rectangle,
        pieces: &Pieces,
        at: [u32; 2],
        point: DVec3,
        normal: DVec3,
    ) -> Option<([DVec3; 3], f64)> {
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
        let factor = filled * area * here * there / (PI * r2 + area);
        let ends = [corner(0.0, 0.0), corner(1.0, 1.0)].map(DVec3::normalize_or_zero);
        Some(([direction, ends[0], ends[1]], factor / 3.0))
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
            let part = &self.parts[k];
            let pieces = self.pieces((k, part), point, LENGTH, 0);
            for at in pieces.all() {
                if let Some((ways, factor)) = self.toward(part, &pieces, at, point, normal) {
                    for each in ways.map(&brightness) {
                        sum = std::array::from_fn(|k| sum[k] + factor * each[k]);
                    }
                }
            }
        }
        sum
    }

    /// A place on a part, chosen by what the parts may bring.
    pub(crate) fn choose(&self, choice: &Choice, [u, v]: [f64; 2]) -> Option<DVec3> {
        let mut rest = u;
        let list = (0..LISTS).rev().find(|&list| {
            let within = rest < choice.shares[list];
            rest -= if within { 0.0 } else { choice.shares[list] };
            within
        })?;
        let sums = choice.pieces(list);
        let before = choice.before(sums.start);
        let target = before + rest / choice.shares[list] * choice.total(list);
        let all = &choice.sums[sums.clone()];
        let k = all.partition_point(|&sum| sum <= target).min(all.len() - 1) + sums.start;
        let rest = ((target - choice.before(k)) / choice.of(k)).clamp(0.0, 1.0);
        let piece = k as u32;
        let pieces = choice.parts[choice.parts.partition_point(|p| p.first <= piece) - 1];
        let part = self.part(choice, pieces.part as usize);
        let number = piece - pieces.first;
        let [low, size] = pieces.place(&part, [number / pieces.along[1], number % pieces.along[1]]);
        Some(self.point(part.plane, [low[0] + rest * size[0], low[1] + v * size[1]]))
    }

    /// Density, by solid angle, with which [`choose`](Self::choose) finds a direction of unit length.
    pub(crate) fn density(&self, choice: &Choice, from: DVec3, direction: DVec3) -> f64 {
        let (spot, t) = self.leaves(from, direction);
        if !t.is_finite() {
            return 0.0;
        }
        let by_area: f64 = (0..LISTS)
            .filter(|&list| choice.shares[list] > 0.0)
            .map(|list| {
                let parts = choice.parts[choice.list(list)].iter();
                let mut parts =
                    parts.map(|&pieces| (pieces, self.part(choice, pieces.part as usize)));
                let held = parts.find(|(_, part)| part.holds(spot.plane, spot.at));
                held.map_or(0.0, |(pieces, part)| {
                    let count = f64::from(pieces.count());
                    let piece = choice.of(pieces.at(&part, spot.at));
                    choice.shares[list] * piece / choice.total(list) * count
                        / part.area().max(1e-300)
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
    fn clear(&mut self) {
        self.parts.clear();
        self.sums.clear();
        self.found.clear();
        self.ends = Default::default();
    }

    /// Takes out the parts of the point alone.
    fn forget_point(&mut self) {
        let [parts, pieces] = self.ends[LISTS - 2];
        self.parts.truncate(parts);
        self.sums.truncate(pieces);
    }

    /// Most rays to the parts that are known best, of what is left most to the next.
    fn share_out(&mut self) {
        let mut left = 1.0;
        self.shares = [0.0; LISTS];
        for list in (0..LISTS).rev() {
            if self.total(list) > 0.0 {
                self.shares[list] = if list > 0 { OWN_RAYS * left } else { left };
                left -= self.shares[list];
            }
        }
        let all: f64 = self.shares.iter().sum();
        self.shares.iter_mut().for_each(|s| *s /= all.max(1e-300));
    }

    /// The parts of a list.
    fn list(&self, list: usize) -> Range<usize> {
        let first = if list > 0 { self.ends[list - 1][0] } else { 0 };
        first..self.ends[list][0]
    }

    /// Its pieces.
    fn pieces(&self, list: usize) -> Range<usize> {
        let first = if list > 0 { self.ends[list - 1][1] } else { 0 };
        first..self.ends[list][1]
    }

    fn total(&self, list: usize) -> f64 {
        let pieces = self.pieces(list);
        self.before(pieces.end) - self.before(pieces.start)
    }

    /// Of all pieces before the `k`-th.
    fn before(&self, k: usize) -> f64 {
        if k > 0 { self.sums[k - 1] } else { 0.0 }
    }

    /// Of the `k`-th piece.
    fn of(&self, k: usize) -> f64 {
        self.sums[k] - self.before(k)
    }
}
