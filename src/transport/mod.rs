//! Light at a point: lamps, patches by exact polygons, and all else by rays over the hemisphere.
//!
//! | file | what |
//! |---|---|
//! | `receiver`, `gatherer` | a point, what it gets, and what gathering looks at |
//! | `point` | everything that a point gets |
//! | `patches`, `slope`, `shadows` | patches of few faces with their exact factors, past what blocks them |
//! | `lamp` | parts of lamps near a point, and lamps chosen by chance |
//! | `punctual`, `luminaire` | lights without extent, and lamps that shine from a surface by a profile |
//! | `hemisphere`, `sweep` | beams of rays that find the patches they end on |
//! | `via`, `mirrored` | the same lamps and patches by way of mirrors |
//! | `nearby` | short paths where rays end close by |
//! | `outside`, `clipped_sky`, `sky` | what comes in where rays leave the room: sky, ground, the sun's disc |
//! | `ways` | what is on ways from there |
//! | `trace` | what a point gets its light from, kept for relighting |

mod clipped_sky;
mod fixture;
mod gatherer;
pub mod hemisphere;
mod lamp;
mod luminaire;
mod mirrored;
mod nearby;
mod outside;
mod patches;
mod point;
mod punctual;
mod receiver;
mod shadows;
mod sky;
mod slope;
mod sweep;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod trace;
mod via;
mod ways;

pub use gatherer::{Gatherer, Memory};
pub(crate) use outside::{Look, Outside, find_openings};
pub use punctual::punctual_factor;
pub use receiver::{Gathered, MOSTLY, Receiver};
