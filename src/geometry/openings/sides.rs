//! The box around a room, and what is known of where rays leave it.

use super::boxes::OpeningBox;
use glam::DVec3;

/// Rays from a point.
pub(crate) const BEAM: usize = 16;
/// Cells along a side of the box, by which rays are aimed: each that was met as often as any other.
pub(super) const CELLS: usize = 32;
/// Places fall into so many cells along a side of the box.
pub(super) const PLACES: usize = 8;
pub(super) const KINDS: usize = 6 * PLACES.pow(3);
/// The box is larger than the room by this share of its half size, and so thick is what is flat: a few gaps of the ray index, so that it
/// lies close upon openings in the outermost walls. With .001 what is seen through a roof at a low angle leaves the box beside its opening.
pub(super) const MARGIN: f64 = 2e-5;

/// A point of a surface that rays start from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayStart {
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
    pub(super) parts: Vec<OpeningBox>,
    /// Share of each part that is open, seen from each kind of place.
    pub(super) shown: Vec<f32>,
    /// Of rays all over the hemispheres of the surfaces.
    pub(super) share: f64,
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

    /// How far away a ray from within the box leaves it, and across which axis.
    pub(super) fn leaves(&self, from: DVec3, direction: DVec3) -> (f64, usize) {
        let mut exit = (f64::INFINITY, 0);
        for axis in 0..3 {
            let d = direction[axis];
            let end = if d > 0.0 { self.high } else { self.low };
            let t = (end[axis] - from[axis]) / d;
            if d != 0.0 && t < exit.0 {
                exit = (t.max(0.0), axis);
            }
        }
        exit
    }

    /// What kind of place a point is: where it lies, by cells along a side, and which way it looks.
    pub(super) fn place(&self, point: DVec3, normal: DVec3) -> usize {
        let share = (point - self.low) / (self.high - self.low) * PLACES as f64;
        let [x, y, z] = share.to_array().map(|s| (s as usize).min(PLACES - 1));
        let axis = normal.abs().max_position();
        let side = axis + if normal[axis] > 0.0 { 3 } else { 0 };
        ((side * PLACES + x) * PLACES + y) * PLACES + z
    }

    /// Size of a cell.
    pub(super) fn cell(&self) -> DVec3 {
        (self.high - self.low) / CELLS as f64
    }
}
