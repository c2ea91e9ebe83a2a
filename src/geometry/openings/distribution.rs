//! Directions toward openings: chosen by what each piece of them may bring to a point, with their density.

use super::boxes::OpeningBox;
use super::gaps::across;
use super::sides::{MARGIN, Openings};
use crate::geometry::sampling::hash;
use glam::DVec3;
use std::f64::consts::PI;

/// A part is weighed in pieces that are no longer than this share of their distance, at most so many along its side and so many in all.
const LENGTH: f64 = 0.5;
const ALONG: f64 = 16.0;
const PIECES: usize = 256;
/// [`LENGTH`] of what they bring at the most, which need be known only roughly: leaves take from it how many points they look at. With [`LENGTH`] a curtained room
/// (`--error 4`) takes 16.3 CPU s for 10.7, and one with panes 19.3 for 15.6; by either their leaves take as many points within a seventh.
const ROUGH: f64 = 2.0;
/// Pieces along a side at least, if there are few parts, where one corner is so many times as bright as another: of a window that is half
/// below the horizon each is above it or not. With one, points that see a strip of sky above black ground were 4 % off; with so many
/// everywhere, rays lie less evenly, and points are off by .3 % that are else by .1.
const FEWEST: usize = 4;
const UNEVEN: f64 = 2.0;
/// So many rays go to the parts as if all were open, for each that goes by what a place sees of them: a place is larger than its points. None
/// stands for more than ten then; without, the file of a house in a garden was off by 3.2 dE00 in root mean square, with it by .8 to 1.3.
const BLINDLY: f64 = 0.1;
/// Parts that would take less than this of a ray are left out, and a ray chooses among so many pieces.
const NOTHING: f64 = 0.05;
const EACH: f64 = 4.0;
/// A piece that seems edge-on from its middle still counts as if it were turned by this cosine.
const LEAST_COSINE: f64 = 0.1;

/// What the parts of the openings may bring to a point, summed up piece by piece.
#[derive(Debug, Default)]
pub(crate) struct OpeningDistribution {
    parts: Vec<Pieces>,
    sums: Vec<f64>,
}

/// A part in pieces.
#[derive(Debug, Clone, Copy, Default)]
struct Pieces {
    part: u32,
    /// Do its corners differ in brightness? Its brightness, if they do not and it is small.
    is_uneven: bool,
    even: Option<f64>,
    /// Pieces along either axis across it, and the number of the first.
    along: [u32; 2],
    first: u32,
}

impl Openings {
    /// What each part may bring to a point that looks along a normal: about its form factor, as far as it is seen from there, times
    /// `brightness` of its direction. Of so many rays, parts that would take next to none are left to rays over the hemisphere.
    pub(crate) fn weigh(
        &self,
        rays: f64,
        (point, normal): (DVec3, DVec3),
        brightness: impl Fn(DVec3) -> f64,
        choice: &mut OpeningDistribution,
    ) {
        let least = NOTHING / rays;
        choice.sums.clear();
        choice.parts.clear();
        let shown = self.place(point, normal) * self.parts.len();
        let shown = |part: usize| f64::from(self.shown[shown + part]);
        let rough = |k: usize| self.parts[k].factor_at_most(point, normal);
        let parts = || 0..self.parts.len();
        let all: f64 = parts().map(|k| shown(k) * rough(k)).sum();
        let blindly = BLINDLY * all / parts().map(rough).sum::<f64>().max(1e-300);
        let kept = parts().filter(|&k| (shown(k) + blindly) * rough(k) > least * all);
        choice.parts.extend(kept.map(|k| {
            let mut pieces = Pieces {
                part: k as u32,
                ..Pieces::default()
            };
            let corners = self.parts[k].corners();
            let each = corners.map(|at| brightness((at - point).normalize_or_zero()));
            let most = each.into_iter().fold(0.0, f64::max);
            pieces.is_uneven = each.into_iter().any(|b| UNEVEN * b < most);
            // Inside of a large one anything may be.
            if !pieces.is_uneven && self.along(k, point, [LENGTH, 1.0]) == [1, 1] {
                pieces.even = Some(each.iter().sum::<f64>() / 4.0);
            }
            pieces
        }));
        let most = (EACH * rays).min(PIECES as f64) as usize;
        self.divide(point, most, choice);
        let [mut open, mut blind] = [0.0; 2];
        for pieces in &choice.parts {
            let part = &self.parts[pieces.part as usize];
            for at in pieces.all() {
                let toward = toward(part, pieces, at, point, normal);
                let brings = toward.map_or(0.0, |(ways, factor)| {
                    let mean = || ways.map(&brightness).iter().sum::<f64>() / 3.0;
                    factor * pieces.even.unwrap_or_else(mean)
                });
                open += shown(pieces.part as usize) * brings;
                blind += brings;
                choice.sums.push(brings);
            }
        }
        let blindly = BLINDLY * open / f64::max(blind, 1e-300);
        let mut sum = 0.0;
        for pieces in &choice.parts {
            let share = shown(pieces.part as usize) + blindly;
            for piece in &mut choice.sums[pieces.first as usize..][..pieces.count() as usize] {
                sum += share * *piece;
                *piece = sum;
            }
        }
    }

    /// Divides parts into pieces, coarser ones where they were more than this.
    fn divide(&self, point: DVec3, most: usize, choice: &mut OpeningDistribution) {
        let (mut length, parts) = (LENGTH, choice.parts.len().max(1));
        let fewest = (most / parts).isqrt().clamp(1, FEWEST);
        loop {
            let mut first = 0;
            for pieces in &mut choice.parts {
                let fewest = if pieces.is_uneven { fewest as f64 } else { 1.0 };
                pieces.along = self.along(pieces.part as usize, point, [length, fewest]);
                pieces.first = first;
                first += pieces.count();
            }
            if first as usize <= most.max(parts * fewest * fewest) {
                return;
            }
            length *= 1.5;
        }
    }

    /// How many pieces along either side of a part are no longer than this for their distance, so many at least.
    fn along(&self, part: usize, point: DVec3, [length, fewest]: [f64; 2]) -> [u32; 2] {
        let of = &self.parts[part];
        // Never none: a point on the box would have no end of pieces.
        let distance = of.distance(point);
        let distance = distance.max(MARGIN * (self.high - self.low).length());
        let axes = across(of.axis);
        let longest = axes
            .map(|axis| of.size()[axis])
            .into_iter()
            .fold(0.0, f64::max);
        axes.map(|axis| {
            let size = of.size()[axis];
            let fewest = (fewest * size / longest).ceil().max(1.0);
            (size / (length * distance).max(1e-300))
                .ceil()
                .clamp(fewest, ALONG) as u32
        })
    }

    /// What all parts may bring if nothing stands in the way but what hides them from the whole place.
    pub(crate) fn most<const N: usize>(
        &self,
        point: DVec3,
        normal: DVec3,
        brightness: impl Fn(DVec3) -> [f64; N],
    ) -> [f64; N] {
        let mut sum = [0.0; N];
        let shown = self.place(point, normal) * self.parts.len();
        for (k, part) in self.parts.iter().enumerate() {
            let pieces = Pieces {
                along: self.along(k, point, [ROUGH, 1.0]),
                ..Pieces::default()
            };
            let shown = f64::from(self.shown[shown + k]);
            for at in pieces.all() {
                if let Some((ways, factor)) = toward(part, &pieces, at, point, normal) {
                    for each in ways.map(&brightness) {
                        sum = std::array::from_fn(|k| sum[k] + shown * factor * each[k] / 3.0);
                    }
                }
            }
        }
        sum
    }

    /// A place in a part, chosen by what the parts may bring.
    pub(crate) fn choose(&self, choice: &OpeningDistribution, [u, v]: [f64; 2]) -> Option<DVec3> {
        let total = choice.total();
        if total <= 0.0 {
            return None;
        }
        let target = u * total;
        let sums = &choice.sums;
        let k = sums
            .partition_point(|&sum| sum <= target)
            .min(sums.len() - 1);
        let rest = ((target - (sums[k] - choice.of(k))) / choice.of(k)).clamp(0.0, 1.0);
        let piece = k as u32;
        let pieces = &choice.parts[choice.parts.partition_point(|p| p.first <= piece) - 1];
        let part = &self.parts[pieces.part as usize];
        let inner = piece - pieces.first;
        let [low, size] = pieces.place(part, [inner / pieces.along[1], inner % pieces.along[1]]);
        let mut at = low;
        let [first, second] = across(part.axis);
        at[first] += rest * size[first];
        at[second] += v * size[second];
        // A number of its own for what is not flat: digits of the others repeat in sequences of few points.
        let depth = hash(u.to_bits(), v.to_bits()) as f64 / u64::MAX as f64;
        at[part.axis] += depth * size[part.axis];
        Some(at)
    }

    /// Density, by solid angle, with which [`choose`](Self::choose) finds a direction of unit length.
    pub(crate) fn density(
        &self,
        choice: &OpeningDistribution,
        from: DVec3,
        direction: DVec3,
    ) -> f64 {
        let total = choice.total();
        let mut sum = 0.0;
        if total > 0.0 {
            self.crossed(choice, from, direction, |_, density| sum += density);
            sum /= total;
        }
        sum
    }

    /// The parts that a direction leads through, and for each its density times what the part may bring.
    ///
    /// Of points that lie evenly in a box of volume V those in a direction have density (b^3 - a^3) / 3V, if that enters it at a distance
    /// a and leaves it at b.
    pub(super) fn crossed(
        &self,
        choice: &OpeningDistribution,
        from: DVec3,
        direction: DVec3,
        mut each: impl FnMut(usize, f64),
    ) {
        let inverse = direction.recip();
        for pieces in &choice.parts {
            let part = &self.parts[pieces.part as usize];
            let Some(range) = crossed(&part.ends(), from, inverse) else {
                continue;
            };
            let ends = range.map(|t| pieces.holding(part, from + direction * t));
            let [rows, columns] = [0, 1].map(|k| {
                let (a, b) = (ends[0][k], ends[1][k]);
                a.min(b)..=a.max(b)
            });
            let mut density = 0.0;
            for at in rows.flat_map(|i| columns.clone().map(move |j| [i, j])) {
                let worth = choice.of(pieces.number(at));
                let [low, size] = pieces.place(part, at);
                if let Some([a, b]) = crossed(&[low, low + size], from, inverse) {
                    let volume = size.x * size.y * size.z;
                    let cubes = (b - a) * (a * a + a * b + b * b);
                    density += worth * cubes / (3.0 * volume);
                }
            }
            if density > 0.0 {
                each(pieces.part as usize, density);
            }
        }
    }
}

/// Where a ray of a direction with these reciprocals enters and leaves a box before it.
fn crossed([low, high]: &[DVec3; 2], from: DVec3, inverse: DVec3) -> Option<[f64; 2]> {
    let (a, b) = ((*low - from) * inverse, (*high - from) * inverse);
    // Where it runs along a side that it lies on, 0 times infinity: it does not enter there.
    let near = a.min(b).max_element().max(0.0);
    let far = a.max(b).min_element();
    (near < far).then_some([near, far])
}

/// The directions of a piece's middle and of two corners, and about its form factor; none if it is behind. By the middle alone a
/// slit across the horizon, half of it above black ground, was never looked through.
fn toward(
    part: &OpeningBox,
    pieces: &Pieces,
    at: [u32; 2],
    point: DVec3,
    normal: DVec3,
) -> Option<([DVec3; 3], f64)> {
    let [low, size] = pieces.place(part, at);
    // The farthest corner along the normal.
    let farthest = DVec3::select(normal.cmpgt(DVec3::ZERO), low + size, low);
    if normal.dot(farthest - point) <= 0.0 {
        return None;
    }
    let way = low + 0.5 * size - point;
    let r2 = way.length_squared();
    let direction = way / r2.sqrt().max(1e-300);
    let here = normal.dot(direction).max(LEAST_COSINE);
    let there = direction.abs().max(DVec3::splat(LEAST_COSINE));
    let area = DVec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
    let factor = there.dot(area) * here / (PI * r2 + area.element_sum());
    let ends = [low, low + size].map(|at| (at - point).normalize_or_zero());
    Some(([direction, ends[0], ends[1]], factor))
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
    fn place(&self, part: &OpeningBox, at: [u32; 2]) -> [DVec3; 2] {
        let (mut low, mut size) = (part.low, part.size());
        for (k, axis) in across(part.axis).into_iter().enumerate() {
            size[axis] /= f64::from(self.along[k]);
            low[axis] += f64::from(at[k]) * size[axis];
        }
        [low, size]
    }

    /// The one that holds a point of the part.
    fn holding(&self, part: &OpeningBox, at: DVec3) -> [u32; 2] {
        let axes = across(part.axis);
        [0, 1].map(|k| {
            let share = (at - part.low)[axes[k]] / part.size()[axes[k]].max(1e-300);
            ((share * f64::from(self.along[k])) as u32).min(self.along[k] - 1)
        })
    }

    /// Its number among those of all parts.
    fn number(&self, [i, j]: [u32; 2]) -> usize {
        (self.first + i * self.along[1] + j) as usize
    }
}

impl OpeningDistribution {
    /// The parts, and what each may bring.
    pub(super) fn worths(&self) -> impl Iterator<Item = (usize, f64)> {
        let sum = |piece: u32| match piece {
            0 => 0.0,
            k => self.sums[k as usize - 1],
        };
        let worth = move |p: &Pieces| (p.part as usize, sum(p.first + p.count()) - sum(p.first));
        self.parts.iter().map(worth)
    }

    pub(crate) fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Of the `k`-th piece.
    fn of(&self, k: usize) -> f64 {
        self.sums[k] - if k == 0 { 0.0 } else { self.sums[k - 1] }
    }
}
