//! How a point looks into mirrors, and what rays meet by way of them.

use crate::light::Passage;
use glam::DVec3;

/// By which mirrors a receiver looks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Via {
    pub(super) image: u32,
    /// Where the true receiver is, and on which plane.
    pub(super) point: DVec3,
    pub(super) plane: u32,
}

/// What a ray met by way of mirrors.
#[derive(Debug, Clone)]
pub(super) struct Arrived {
    pub(super) end: End,
    /// None where nothing has an image.
    pub(super) image: Option<u32>,
    pub(super) passage: Box<Passage>,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum End {
    Leaf(u32),
    /// One mirror too many: it is read as a matt surface.
    Mirror(u32),
    /// It left the room in this direction.
    Outside(DVec3),
}

impl Arrived {
    /// In which direction it left the room, if it did.
    pub(super) fn outside(&self) -> Option<DVec3> {
        match self.end {
            End::Outside(direction) => Some(direction),
            _ => None,
        }
    }
}
