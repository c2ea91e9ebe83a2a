//! How a point sees by way of mirrors, and what its rays meet by way of them.

use crate::light::Passage;
use glam::DVec3;

/// The mirror image by which a receiver sees.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Via {
    pub(super) image: u32,
    /// Position of the true receiver, and its plane.
    pub(super) point: DVec3,
    pub(super) plane: u32,
}

/// What a ray met by way of mirrors.
#[derive(Debug, Clone)]
pub(super) struct Arrived {
    pub(super) end: PathEnd,
    /// The image that the ray went by; none where things have none.
    pub(super) image: Option<u32>,
    pub(super) passage: Box<Passage>,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum PathEnd {
    Leaf(u32),
    /// One mirror too many: it is taken for a matt surface.
    Mirror(u32),
    /// The ray left the room in this direction.
    Outside(DVec3),
}

impl Arrived {
    /// The direction in which the ray left the room, if it did.
    pub(super) fn outside(&self) -> Option<DVec3> {
        match self.end {
            PathEnd::Outside(direction) => Some(direction),
            _ => None,
        }
    }
}
