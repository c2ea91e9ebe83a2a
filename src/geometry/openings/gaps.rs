//! Gaps: points of openings.

use glam::DVec3;

/// A point of an opening: where a ray from a kind of place passed it, and the axis that most nearly stands upright on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gap {
    pub(super) place: usize,
    pub(super) at: DVec3,
    pub(super) axis: usize,
}

/// A ray that left: the number of the point that it started from, the place of that, and its direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Exit {
    pub(super) start: usize,
    pub(super) place: usize,
    pub(super) way: DVec3,
}

/// Directions other than `axis`.
pub(super) fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}
