//! Directions toward openings: chosen by what each piece of them may bring to a point, with their density.

use super::sides::{MARGIN, Openings, PLACES};
use crate::geometry::cover::Rectangle;
use glam::DVec3;
use std::f64::consts::PI;
use std::ops::Range;

/// Where a place has parts of its own they take most of its rays. The others go where rays from elsewhere left, too.
const OWN_RAYS: f64 = 0.75;
/// A part is weighed in pieces that are no longer than this share of their distance, at most so many along its side and so many in all.
const LENGTH: f64 = 0.5;
const ALONG: f64 = 16.0;
const PIECES: usize = 256;
/// From so many rays on a part counts in full: one that a few rays touched is mostly wall.
const FILLED: usize = 16;
/// A piece that seems edge-on from its middle still counts as if it were turned by this cosine.
const LEAST_COSINE: f64 = 0.1;

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

impl Openings {
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
        // Of the small place if it has any.
        let own = [1, 0].into_iter().find_map(|k| {
            let kind = self.kind(point, normal, PLACES << k);
            let ends = self.own[k].get(kind..kind + 2)?;
            (ends[0] < ends[1]).then_some(ends[0] as usize..ends[1] as usize)
        });
        let own = own.unwrap_or_default();
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
                sum += toward.map_or(0.0, |(ways, factor)| {
                    factor * ways.map(&brightness).iter().sum::<f64>()
                });
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
            let pieces = self.pieces(k, point, LENGTH, 0);
            let part = &self.parts[k];
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
