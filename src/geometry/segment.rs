//! The segment that a visibility query asks about.

use glam::{DVec3, Vec3};

/// Stands for "no plane" in [`Segment::planes`] and in `RayIndex::closest`.
pub const NO_PLANE: u32 = u32::MAX;

/// The open segment between two points, usually on two surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Segment {
    /// One end, in the space of the index.
    pub from: Vec3,
    /// The other end.
    pub to: Vec3,
    /// Ids of the planes that the ends lie on; triangles of these planes never block the segment.
    /// [`NO_PLANE`] for an end in free space.
    pub planes: [u32; 2],
}

impl Segment {
    /// The segment between two points, rounded, that lie on two planes.
    pub fn new(from: DVec3, to: DVec3, planes: [u32; 2]) -> Self {
        Self {
            from: from.as_vec3(),
            to: to.as_vec3(),
            planes,
        }
    }
}
