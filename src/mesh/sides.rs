//! The sides of edges of shadows: which vertex a triangle has there, and where its light is looked at.

use super::cells::{Cell, Cells};
use super::divided::between;
use super::edges::SHARP;
use super::lines::Sharp;
use super::shades::{Shades, each};
use crate::link::Sight;

/// Distance from an edge of a shadow at which the light of a side is looked at, a share of the room's half diagonal; up to [`SHARP`] where
/// that still lies in half shadow.
const BESIDE: f64 = 1e-3;
/// But no further than this share of the way into the triangle.
const INTO: f64 = 0.75;
/// A way straight up from an edge runs this share of it towards the middle, so that it stays inside.
const ASIDE: f64 = 0.1;

/// Lamps that light a side of a corner, and a place there with its distance from the corner: infinite if it lies in half shadow or nearer
/// to an edge than [`BESIDE`].
type Side = (u64, ([f64; 3], f64));

impl Cells {
    /// Gives corners on edges of shadows the vertices of their sides, in new cells and at points that were not on such edges
    /// before; returns all of these cells.
    pub(super) fn take_sides(&mut self, shades: &Shades, mut fresh: Vec<usize>) -> Vec<usize> {
        let corners = self.sharp_corners(&fresh);
        let half_size = shades.bake().mesh().half_size;
        let cells = &*self;
        let sides: Vec<Side> = shades.bake().room.with_sight(|sight| {
            let side = |(): &mut (), sharp: &Sharp| cells.side(shades, sight, half_size, *sharp);
            shades.bake().team().map(&corners, || (), side)
        });
        // Of all cells on a side the first says where its light is looked at.
        let mut best: Vec<(Sharp, Side)> = corners.into_iter().zip(sides).collect();
        best.sort_by(|(_, (_, a)), (_, (_, b))| a.1.total_cmp(&b.1));
        for (corner, (lit, (beside, _))) in best {
            self.take_side(corner, lit, beside);
            fresh.push(corner.0);
        }
        fresh.sort_unstable();
        fresh.dedup();
        fresh
    }

    /// The side of a corner that a cell lies on.
    fn side(
        &self,
        shades: &Shades,
        sight: &Sight,
        half_size: f64,
        (k, corner, lamps): Sharp,
    ) -> Side {
        let cell = &self.all[k];
        let from = cell.corners[corner].weights;
        let (target, distance) = self.away(cell, corner, lamps);
        let mut step = (BESIDE * half_size / distance).min(INTO);
        let place = |step: f64| between(from, target, step);
        let first = shades.place(self, cell, place(step));
        let lit = each(lamps)
            .filter(|&lamp| shades.lit(sight, lamp, &first))
            .fold(0, |all, lamp| all | lamp);
        let wholly = |step: f64| {
            let to = shades.place(self, cell, place(step));
            let expected = |lamp: u64| Some(lit & lamp != 0);
            each(lamps).all(|lamp| shades.wholly(sight, lamp, &to) == expected(lamp))
        };
        let mut is_clear = wholly(step);
        while !is_clear && 2.0 * step <= INTO && step * distance < SHARP * half_size {
            step *= 2.0;
            is_clear = wholly(step);
        }
        let at = |weights| shades.place(self, cell, weights).point;
        let far = match is_clear && step < INTO {
            true => at(from).distance(at(place(step))),
            false => f64::INFINITY,
        };
        (lit, (place(step), far))
    }

    /// Where a way into a cell from a corner leads that soon leaves the edges along which light of lamps ends, and how far from them
    /// that is: away from a single one as straight as the cell allows, else to the middle.
    fn away(&self, cell: &Cell, corner: usize, lamps: u64) -> ([f64; 3], f64) {
        let edges = [corner, (corner + 2) % 3];
        let middle: [f64; 3] = std::array::from_fn(|k| {
            let own = |at: usize| cell.corners[at].weights[k] / 3.0;
            own(0) + own(1) + own(2)
        });
        let height = |e: usize| 2.0 * cell.area / self.edges[cell.edges[e] as usize].length;
        let ends = |e: usize| self.sharp_along(cell, e) & lamps != 0;
        let [next, last] = [1, 2].map(|k| (corner + k) % 3);
        // The line runs from this corner, p, to q; r is the corner beside it.
        let (e, q, r) = match edges.map(ends) {
            [true, false] => (corner, next, last),
            [false, true] => (last, last, next),
            _ => {
                let near = edges.map(|e| height(e) / 3.0);
                return (middle, near[0].min(near[1]));
            }
        };
        let at = |k: usize| self.points[cell.corners[k].point as usize];
        let [line, beside] = [q, r].map(|k| at(k) - at(corner));
        let along = beside.dot(line) / line.length();
        // Straight up from p the opposite edge is met here, at r if that leans over the line.
        let share = match along < 0.0 {
            true => line.length() / (line.length() - along),
            false => 1.0,
        };
        let [q, r] = [q, r].map(|k| cell.corners[k].weights);
        let target = between(between(q, r, share), middle, ASIDE);
        let distance = ((1.0 - ASIDE) * share + ASIDE / 3.0) * height(e);
        (target, distance)
    }
}
