//! The box around a room, and what is known of where rays leave it.

use crate::geometry::cover::{Rectangle, Spot};
use glam::DVec3;

/// Rays from a point.
pub(crate) const BEAM: usize = 16;
/// Cells along a side of the box, by which rays are aimed: each that was met as often as any other.
pub(super) const CELLS: usize = 32;
/// Places fall into so many cells along a side of the box; small ones are half as long.
pub(super) const PLACES: usize = 8;
pub(super) const KINDS: usize = 6 * PLACES.pow(3);
/// The box is larger than the room by this share of its half size: a few gaps of the ray index, so that it lies close upon openings in the
/// outermost walls. With .001 what is seen through a roof at a low angle leaves the box beside its opening.
pub(super) const MARGIN: f64 = 2e-5;

/// A point of a surface that rays start from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    pub(crate) point: DVec3,
    pub(crate) normal: DVec3,
    pub(crate) plane: u32,
}

/// What a ray meets: how far away, and which way that looks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wall {
    pub(crate) distance: f64,
    pub(crate) normal: DVec3,
}

/// Where rays leave a room.
#[derive(Debug, Clone, Default)]
pub(crate) struct Openings {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    /// Those of all places first, then those of each.
    pub(super) parts: Vec<Rectangle>,
    /// Of all places.
    pub(super) shared: usize,
    /// Of rays all over the hemispheres of the surfaces.
    pub(super) share: f64,
    /// First of the parts of each kind of place, one more at the end; and of small ones.
    pub(super) own: [Vec<u32>; 2],
}

/// A ray that left: from which kind of place, and where.
#[derive(Debug, Clone, Copy)]
pub(super) struct Exit {
    pub(super) place: usize,
    pub(super) small: usize,
    /// Number of the point.
    pub(super) start: usize,
    pub(super) spot: Spot,
}

/// Where the way of a ray from a kind of place is narrowest, and the axis that most nearly stands upright on that.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gap {
    pub(super) place: usize,
    pub(super) at: DVec3,
    pub(super) axis: usize,
}

/// Rays that left: each with the number of the point that it started from and its own among the rays from there.
pub(super) type Left = Vec<([usize; 2], Exit)>;

/// Directions other than `axis`.
pub(super) fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

impl Openings {
    /// The box, nothing open.
    pub(super) fn around(points: &[DVec3]) -> Self {
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

    /// How much of the light from the surfaces of the room leaves it.
    pub(crate) fn share(&self) -> f64 {
        self.share
    }

    /// Where a ray from within the box leaves it, and how far away: sides 0 to 2 are the low ones.
    pub(super) fn leaves(&self, from: DVec3, direction: DVec3) -> (Spot, f64) {
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
    pub(super) fn point(&self, side: u8, at: [f64; 2]) -> DVec3 {
        let axis = usize::from(side) % 3;
        let mut point = if side < 3 { self.low } else { self.high };
        for (axis, x) in across(axis).into_iter().zip(at) {
            point[axis] = x;
        }
        point
    }

    /// A side as a whole.
    pub(super) fn side(&self, side: u8) -> Rectangle {
        let axes = across(usize::from(side) % 3);
        Rectangle {
            low: axes.map(|axis| self.low[axis]),
            high: axes.map(|axis| self.high[axis]),
            plane: side,
            count: 0,
        }
    }

    /// What kind of place a point is: where it lies, by cells along a side, and which way it looks.
    pub(super) fn kind(&self, point: DVec3, normal: DVec3, cells: usize) -> usize {
        let share = (point - self.low) / (self.high - self.low) * cells as f64;
        let [x, y, z] = share.to_array().map(|s| (s as usize).min(cells - 1));
        let axis = normal.abs().max_position();
        let side = axis + if normal[axis] > 0.0 { 3 } else { 0 };
        ((side * cells + x) * cells + y) * cells + z
    }

    pub(super) fn place(&self, point: DVec3, normal: DVec3) -> usize {
        self.kind(point, normal, PLACES)
    }

    /// Size of a cell.
    pub(super) fn cell(&self) -> DVec3 {
        (self.high - self.low) / CELLS as f64
    }
}
