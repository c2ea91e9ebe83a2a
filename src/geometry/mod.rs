//! Rays, planes, shafts and polygons: everything that asks where a surface is and nothing that asks what light it carries.
//!
//! | file | what |
//! |---|---|
//! | [`plane`] | ids for planes: which triangles lie in one plane |
//! | [`segment`] | the segment that a ray query asks about |
//! | `triangle` | the watertight segment-triangle test, for one triangle, 8 triangles or 16 segments |
//! | `tree`, `walk` | the eight-wide tree over the triangles |
//! | [`index`] | [`RayIndex`]: is a segment blocked, what does a ray hit |
//! | `packet` | sixteen segments at once |
//! | [`shaft`] | the space between two patches |
//! | [`blockers`] | which triangles of the index reach into a shaft |
//! | [`hidden`] | is a pair hidden as a whole |
//! | [`clip`] | the visible part of a polygon from a point |
//! | [`polygon`] | form factor from an element of surface to a polygon |
//! | [`lanes`] | the same for eight pairs at once |
//! | [`sampling`] | repeatable points on triangles and directions in a hemisphere |

pub mod blockers;
pub mod clip;
pub mod hidden;
pub mod index;
pub mod lanes;
mod packet;
pub mod plane;
pub mod polygon;
pub mod sampling;
pub mod segment;
pub mod shaft;
mod tree;
mod triangle;
mod walk;

pub use blockers::ShaftContents;
pub use clip::{lambert_visible, visible_part};
pub use index::{Hit, RayIndex};
pub use lanes::{lambert_points_x8, lambert_triangles_x8};
pub use plane::plane_ids;
pub use polygon::lambert_polygon;
pub use segment::{NO_PLANE, Segment};
pub use shaft::{Patch, Shaft};
