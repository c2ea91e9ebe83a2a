//! Where rays leave a room: parts of the box around it, found once by rays from all surfaces. Where these are many, as where a house
//! stands in the open, places that lie near each other and look the same way share the parts that rays from there found.
//!
//! A point that looks for the sky sends rays to these parts, in proportion to what they may bring, besides rays all over its
//! hemisphere. Both together are without bias, whatever was overlooked here: parts only decide where it pays to look.

use crate::geometry::sampling::{Pcg, cosine_direction, hash, sequence02, triangle_weights};
use crate::hierarchy::{Mesh, Tree};
use crate::link::Sight;
use crate::scene::sky;
use crate::transport::hemisphere::BEAM;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Points that rays start from, [`BEAM`] each: an opening through which one ray in ten thousand leaves is met by 52.
const POINTS: usize = 32_768;
/// Points that a task looks from.
const CHUNK: usize = 256;
/// Cells along a side of the box: the finest and the coarsest, powers of two.
const CELLS: [usize; 2] = [32, 16];
/// Parts at the most that a point weighs, all of them, before it looks: a side that is open as a whole has 256 of the coarsest, and
/// 64 at its edges. Where it learned them place by place, points missed some, and what few rays brought was off by up to 5 %.
const PARTS: usize = 384;
/// Where there are more, places fall into so many cells along a side of the box.
const PLACES: usize = 8;
/// From this many rays on the part of a cell is the rectangle that they fill, and from so many on it counts in full: a cell that a few rays
/// touched is mostly wall.
const FILLED: [usize; 2] = [4, 16];
/// The box is larger than the room by this share of its half size: a few gaps of the ray index, so that it lies close upon openings in the
/// outermost walls. With .001 what is seen through a roof at a low angle leaves the box beside its opening.
const MARGIN: f64 = 2e-5;
/// A part that seems edge-on from its middle still counts as if it were turned by this cosine.
const LEAST_COSINE: f64 = 0.1;

/// A rectangle on a side of the box.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Axis that the side stands across.
    axis: usize,
    low: DVec3,
    high: DVec3,
    area: f64,
    /// How far it counts.
    filled: f64,
}

/// Where rays leave a room.
#[derive(Debug, Clone, Default)]
pub(crate) struct Openings {
    low: DVec3,
    high: DVec3,
    parts: Vec<Part>,
    /// Cells along a side, and the part of each cell, side by side; none: `u32::MAX`.
    cells: usize,
    of_cell: Vec<u32>,
    /// First of the parts that each kind of place found, one more at the end, and these parts, ascending; none: all find all.
    places: Vec<u32>,
    found: Vec<u32>,
}

/// A ray that left: from which kind of place, through which side and where.
type Exit = (usize, usize, DVec3);

/// What the parts of the openings may bring to a point, summed up part by part.
#[derive(Debug, Default)]
pub(crate) struct Choice {
    parts: Vec<u32>,
    sums: Vec<f64>,
}

impl Choice {
    fn all(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Of the `k`-th of them.
    fn of(&self, k: usize) -> f64 {
        self.sums[k] - k.checked_sub(1).map_or(0.0, |k| self.sums[k])
    }
}

/// Directions other than `axis`.
fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

impl Openings {
    /// Looks for them.
    pub(crate) fn find(mesh: &Mesh, tree: &Tree, sight: &Sight, seed: u64) -> Self {
        let [low, high] = mesh
            .positions
            .iter()
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], &p| {
                [low.min(p), high.max(p)]
            });
        let margin = DVec3::splat(MARGIN * mesh.half_size);
        let (low, high) = (low - margin, high + margin);
        let mut openings = Self {
            low,
            high,
            parts: Vec::new(),
            cells: CELLS[0],
            of_cell: Vec::new(),
            places: Vec::new(),
            found: Vec::new(),
        };
        if tree.nodes.is_empty() {
            openings.divide(&[]);
            return openings;
        }
        let chunks: Vec<usize> = (0..POINTS).step_by(CHUNK).collect();
        let exits: Vec<Exit> = chunks
            .into_par_iter()
            .flat_map_iter(|first| openings.exits(tree, sight, first..first + CHUNK, seed))
            .collect();
        while openings.divide(&exits) > PARTS {
            if openings.cells == CELLS[1] {
                openings.tell_apart(&exits);
                break;
            }
            openings.cells /= 2;
        }
        openings
    }

    /// Does no ray leave the room?
    pub(crate) fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Sides and places at which rays from some of the points leave.
    fn exits(
        &self,
        tree: &Tree,
        sight: &Sight,
        points: std::ops::Range<usize>,
        seed: u64,
    ) -> Vec<Exit> {
        let area = tree.nodes.first().map_or(0.0, |root| root.area);
        let mut found = Vec::new();
        for k in points {
            let mut random = Pcg::new(hash(seed ^ 0x0be7, k as u64));
            let entry = tree.entry_at((k as f64 + random.f64()) / POINTS as f64 * area);
            let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
            let from = element.at(triangle_weights([random.f64(), random.f64()]));
            let shift = hash(seed, k as u64);
            let directions: [DVec3; BEAM] = std::array::from_fn(|j| {
                cosine_direction(tree.face_normal[entry], sequence02(j as u32, shift))
            });
            let mut hits = [None; BEAM];
            let plane = tree.face_plane[entry];
            sight.meet(
                &[from.as_vec3(); BEAM],
                &directions.map(|d| d.as_vec3()),
                plane,
                &mut hits,
            );
            let open = directions.iter().zip(hits).filter(|(_, hit)| hit.is_none());
            let place = self.place(from, tree.face_normal[entry]);
            found.extend(open.map(|(&d, _)| {
                let (side, t) = self.exit(from, d);
                (place, side, from + d * t)
            }));
        }
        found
    }

    /// Which side a ray from within the box leaves through, and how far away: sides 0 to 2 are the low ones.
    fn exit(&self, from: DVec3, direction: DVec3) -> (usize, f64) {
        let mut exit = (0, f64::INFINITY);
        for axis in 0..3 {
            let d = direction[axis];
            let end = if d > 0.0 { self.high } else { self.low };
            let t = (end[axis] - from[axis]) / d;
            if d != 0.0 && t < exit.1 {
                exit = (axis + if d > 0.0 { 3 } else { 0 }, t.max(0.0));
            }
        }
        exit
    }

    /// What kind of place a point is: where it lies, and which way it looks.
    fn place(&self, point: DVec3, normal: DVec3) -> usize {
        let share = (point - self.low) / (self.high - self.low) * PLACES as f64;
        let [x, y, z] = share.to_array().map(|s| (s as usize).min(PLACES - 1));
        let axis = normal.abs().max_position();
        let side = axis + if normal[axis] > 0.0 { 3 } else { 0 };
        ((side * PLACES + x) * PLACES + y) * PLACES + z
    }

    /// Notes which parts each kind of place found.
    fn tell_apart(&mut self, exits: &[Exit]) {
        let mut found: Vec<(usize, u32)> = exits
            .iter()
            .map(|&(place, side, at)| (place, self.of_cell[self.cell(side, at)]))
            .collect();
        found.sort_unstable();
        found.dedup();
        let kinds = 6 * PLACES * PLACES * PLACES;
        let first = |kind: usize| found.partition_point(|f| f.0 < kind) as u32;
        self.places = (0..=kinds).map(first).collect();
        self.found = found.into_iter().map(|f| f.1).collect();
    }

    /// The cell of a place on a side.
    fn cell(&self, side: usize, at: DVec3) -> usize {
        let size = self.high - self.low;
        let [u, v] = across(side % 3).map(|axis| {
            let share = (at[axis] - self.low[axis]) / size[axis];
            ((share * self.cells as f64) as usize).min(self.cells - 1)
        });
        (side * self.cells + u) * self.cells + v
    }

    /// Makes the parts for the present cells; how many there are.
    fn divide(&mut self, exits: &[Exit]) -> usize {
        let mut by_cell: Vec<(usize, DVec3)> = exits
            .iter()
            .map(|&(_, side, at)| (self.cell(side, at), at))
            .collect();
        by_cell.sort_by_key(|e| e.0);
        self.of_cell = vec![u32::MAX; 6 * self.cells * self.cells];
        self.parts.clear();
        for group in by_cell.chunk_by(|a, b| a.0 == b.0) {
            self.of_cell[group[0].0] = self.parts.len() as u32;
            let part = self.part(group[0].0, group);
            self.parts.push(part);
        }
        self.parts.len()
    }

    /// The rectangle of a cell that rays fill.
    fn part(&self, cell: usize, exits: &[(usize, DVec3)]) -> Part {
        let n = self.cells;
        let (side, u, v) = (cell / (n * n), cell / n % n, cell % n);
        let axis = side % 3;
        let size = (self.high - self.low) / n as f64;
        let (mut low, mut high) = (self.low, self.high);
        for (axis, k) in across(axis).into_iter().zip([u, v]) {
            low[axis] = self.low[axis] + size[axis] * k as f64;
            high[axis] = low[axis] + size[axis];
        }
        if exits.len() >= FILLED[0] {
            let [least, most] = exits
                .iter()
                .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[l, h], &(_, p)| {
                    [l.min(p), h.max(p)]
                });
            // The outermost of n rays lie about an n-th of the width from the edge; further than k of them with probability e^-k.
            // With 4 one part in fourteen lost a sliver, which single rays of the hemisphere then stood for: 1.6 % at a point of CIE
            // 171 5.10.
            let more = (most - least) * (12.0 / exits.len() as f64);
            (low, high) = (low.max(least - more), high.min(most + more));
        }
        let end = if side < 3 { self.low } else { self.high };
        (low[axis], high[axis]) = (end[axis], end[axis]);
        let [u, v] = across(axis).map(|axis| high[axis] - low[axis]);
        Part {
            axis,
            low,
            high,
            area: u * v,
            filled: (exits.len() as f64 / FILLED[1] as f64).min(1.0),
        }
    }

    /// What each part may bring to a point that looks along a normal: about its form factor times `brightness` of its direction.
    pub(crate) fn weigh(
        &self,
        point: DVec3,
        normal: DVec3,
        brightness: impl Fn(DVec3) -> f64,
        choice: &mut Choice,
    ) -> f64 {
        choice.sums.clear();
        choice.parts.clear();
        if self.places.is_empty() {
            choice.parts.extend(0..self.parts.len() as u32);
        } else {
            let place = self.place(point, normal);
            let [first, end] = [0, 1].map(|k| self.places[place + k] as usize);
            choice.parts.extend_from_slice(&self.found[first..end]);
        }
        let mut sum = 0.0;
        for &part in &choice.parts {
            let toward = self.parts[part as usize].toward(point, normal);
            sum += toward.map_or(0.0, |(direction, factor)| factor * brightness(direction));
            choice.sums.push(sum);
        }
        sum
    }

    /// What all parts may bring, found from here or not, if nothing stands in the way.
    pub(crate) fn most(
        &self,
        point: DVec3,
        normal: DVec3,
        brightness: impl Fn(DVec3) -> [f64; sky::PLACES],
    ) -> [f64; sky::PLACES] {
        let mut sum = [0.0; sky::PLACES];
        for part in &self.parts {
            if let Some((direction, factor)) = part.toward(point, normal) {
                let each = brightness(direction);
                sum = std::array::from_fn(|k| sum[k] + factor * each[k]);
            }
        }
        sum
    }

    /// A place on a part, chosen by what the parts may bring.
    pub(crate) fn choose(&self, choice: &Choice, [u, v]: [f64; 2]) -> Option<DVec3> {
        let all = choice.all();
        if all <= 0.0 {
            return None;
        }
        let target = u * all;
        let k = choice.sums.partition_point(|&sum| sum <= target);
        let k = k.min(choice.parts.len() - 1);
        let worth = choice.of(k);
        let rest = ((target - (choice.sums[k] - worth)) / worth).clamp(0.0, 1.0);
        let part = &self.parts[choice.parts[k] as usize];
        let size = part.high - part.low;
        let mut at = part.low;
        for (axis, share) in across(part.axis).into_iter().zip([rest, v]) {
            at[axis] += size[axis] * share;
        }
        Some(at)
    }

    /// Density, by solid angle, with which [`choose`](Self::choose) finds a direction of unit length.
    pub(crate) fn density(&self, choice: &Choice, from: DVec3, direction: DVec3) -> f64 {
        let (side, t) = self.exit(from, direction);
        if !t.is_finite() || choice.all() <= 0.0 {
            return 0.0;
        }
        let at = from + direction * t;
        let part = self.of_cell[self.cell(side, at)];
        let Ok(k) = choice.parts.binary_search(&part) else {
            return 0.0;
        };
        let part = &self.parts[part as usize];
        let within = |axis: usize| part.low[axis] <= at[axis] && at[axis] <= part.high[axis];
        if !across(part.axis).into_iter().all(within) {
            return 0.0;
        }
        let chance = choice.of(k) / choice.all();
        chance * t * t / (part.area * direction[part.axis].abs().max(1e-12))
    }
}

impl Part {
    /// The direction of its middle, and about its form factor; none if it is behind.
    fn toward(&self, point: DVec3, normal: DVec3) -> Option<(DVec3, f64)> {
        // Nothing of it in front?
        let [u, v] = across(self.axis);
        let behind = |a: DVec3, b: DVec3| {
            let mut corner = self.low;
            (corner[u], corner[v]) = (a[u], b[v]);
            normal.dot(corner - point) <= 0.0
        };
        let ends = [self.low, self.high];
        if ends.iter().all(|&a| ends.iter().all(|&b| behind(a, b))) {
            return None;
        }
        let way = 0.5 * (self.low + self.high) - point;
        let r2 = way.length_squared();
        let direction = way / r2.sqrt().max(1e-300);
        let here = normal.dot(direction).max(LEAST_COSINE);
        let there = direction[self.axis].abs().max(LEAST_COSINE);
        let factor = self.area * here * there / (PI * r2 + self.area);
        Some((direction, self.filled * factor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A floor of 4 m x 4 m in a box of which the lid is open by one rectangle.
    fn openings() -> Openings {
        let mut openings = Openings {
            low: DVec3::new(-2.0, 0.0, -2.0),
            high: DVec3::new(2.0, 3.0, 2.0),
            parts: Vec::new(),
            cells: 8,
            of_cell: Vec::new(),
            places: Vec::new(),
            found: Vec::new(),
        };
        let exits: Vec<Exit> = (0..4000_u32)
            .map(|k| {
                let [x, z] = sequence02(k, 9);
                (0, 4, DVec3::new(x - 0.5, 3.0, 1.5 * z - 0.2))
            })
            .collect();
        assert!(openings.divide(&exits) > 6);
        openings
    }

    /// The chosen directions have the density that is said of them: the mean of f / density is the integral of f.
    #[test]
    fn directions_have_their_density() {
        let openings = openings();
        let (point, normal) = (DVec3::new(0.7, 0.2, -0.4), DVec3::Y);
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
