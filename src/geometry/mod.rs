//! Rays, planes, shafts and polygons: everything that asks where a surface is and nothing that asks what light it carries.
//!
//! | file | what |
//! |---|---|
//! | [`plane`] | ids for planes: which triangles lie in one plane |
//! | `vectors` | what vectors need, whatever the processor |
//! | [`segment`] | the segment that a ray query asks about |
//! | `triangle` | the watertight segment-triangle test, for one triangle, 8 triangles or 16 segments |
//! | `tree`, `walk` | the eight-wide tree over the triangles |
//! | [`index`] | [`RayIndex`]: is a segment blocked, what does a ray hit |
//! | `overlap` | which triangles may touch a box |
//! | `packet` | sixteen segments at once |
//! | `beam` | what up to sixteen rays from one point hit first |
//! | [`shaft`] | the space between two patches |
//! | [`blockers`] | which triangles of the index reach into a shaft |
//! | [`clip`] | the visible part of a polygon from a point |
//! | [`polygon`] | form factor from an element of surface to a polygon |
//! | [`nearest`] | the point of a triangle that is nearest to some point |
//! | [`lanes`] | the same for eight pairs at once |
//! | `openings` | where rays leave a room, in boxes that rays can be sent to |
//! | [`sampling`] | repeatable points on triangles and directions in a hemisphere |
//!
//! Measured with `cargo bench --bench rays` (21 November 2026, one core of an AMD EPYC of family 26 with AVX-512, best of 200 runs), in millions a
//! second. Cornell box: 34 triangles, elements of up to 1 m in a room of 5.6 m, 28 % of the rays blocked. Canteen: 346 892 triangles, elements of up
//! to 0.3 m in a room of 20 m by 12 m, 47 % blocked.
//!
//! | | Cornell box | canteen |
//! |---|---|---|
//! | 16 rays between two elements, `occluded_many` | 65 | 12 |
//! | the same, `occluded` one by one | 26 | 7.2 |
//! | the same, `obvhs` 0.4 CWBVH one by one, same triangle test | 15 | 3.8 |
//! | 64 rays from a point to an element, `occluded_many` | 80 | 28 |
//! | random pairs of points, `occluded_many` / `occluded` / `obvhs` | 33 / 27 / 10 | 6.2 / 6.6 / 3.0 |
//! | 16 rays by the shaft's list, `occluded_by` | 290 | 160 |
//! | nearest hit, `closest` | 15 | 3.9 |
//! | shafts with their lists (at most 16), `blockers` | 1.4 | 0.29 |
//! | exact visible part of the light from a point: shaft, list, clip, factor | 1.8 | |
//! | form factors to a triangle, `lambert_x8` / `lambert_edges_x8` / `lambert_polygon` | 152 / 17 / 11 | |
//!
//! The canteen's index takes 86 bytes a triangle and 0.17 s to build, its planes 0.19 s.

mod beam;
pub mod blockers;
mod bvh;
pub mod clip;
pub mod index;
pub mod lanes;
pub mod nearest;
pub(crate) mod openings;
mod overlap;
mod packet;
pub mod plane;
pub mod polygon;
pub mod sampling;
pub mod segment;
pub mod shaft;
mod triangle;
pub(crate) mod vectors;
mod walk;

pub use blockers::ShaftContents;
pub use clip::{Clipper, Shadow, lambert_visible, visible_part};
pub use index::{Hit, RayIndex};
pub use lanes::{lambert_edges_x8, lambert_triangles_x8};
pub use nearest::nearest_point;
pub use plane::plane_ids;
pub use polygon::lambert_polygon;
pub(crate) use polygon::quarters;
pub use segment::{NO_PLANE, Segment};
pub use shaft::{Shaft, ShaftEnd};
