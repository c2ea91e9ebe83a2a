//! Light at a point: lamps, patches by exact polygons, and all else by rays over the hemisphere.
//!
//! | file | what |
//! |---|---|
//! | `receiver`, `gatherer` | a point, its light, and what a gather works with |
//! | `point` | all light at a point |
//! | `patches`, `slope`, `shadows` | patches of few faces with their exact factors, past what blocks them |
//! | `lamp`, `fixture` | parts of lamps near a point, lamps of many faces from afar |
//! | `chance` | lamps chosen at random |
//! | `punctual`, `luminaire` | lights without extent, and lamps that emit from a surface by a profile |
//! | `hemisphere`, `sweep` | beams of rays that find the patches they end on |
//! | `via`, `mirrored` | the same lamps and patches by way of mirrors |
//! | `nearby` | short paths where rays end near the point |
//! | `outside`, `clipped_sky`, `sky` | what comes in where rays leave the room: sky, ground, the sun's disc |
//! | `ways` | what light from outside meets on its way |
//! | `trace` | where a point's light comes from, kept for relighting |

mod chance;
mod clipped_sky;
mod fixture;
mod gatherer;
pub mod hemisphere;
mod lamp;
mod luminaire;
mod mirrored;
mod nearby;
mod obstacles;
mod patches;
mod point;
mod punctual;
mod receiver;
mod shadows;
mod sky;
mod slope;
mod surroundings;
mod sweep;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod trace;
mod via;

pub(crate) use gatherer::AllowedNoise;
pub use gatherer::{Gatherer, Memory};
pub use punctual::punctual_factor;
pub use receiver::{Gathered, MOSTLY, Receiver};
pub(crate) use surroundings::{SkyScratch, Surroundings, find_openings};
