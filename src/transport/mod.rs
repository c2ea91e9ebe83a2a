//! Light at a point: lamps, patches by exact polygons, and all else by rays over the hemisphere.
//!
//! | file | what |
//! |---|---|
//! | `point` | a receiver, and everything that it gets |
//! | `patches`, `slope`, `shadows` | patches of few faces with their exact factors, past what blocks them |
//! | `lamp` | parts of lamps near a point, and lamps chosen by chance |
//! | `luminaire` | lamps that shine from a surface by a profile |
//! | `hemisphere`, `sweep` | beams of rays that find the patches they end on |
//! | `nearby` | short paths where rays end close by |
//! | `openings`, `sky` | where rays leave the room, and what comes in there: sky, ground, the sun's disc |
//! | `trace` | what a point gets its light from, kept for relighting |

pub mod hemisphere;
mod lamp;
mod luminaire;
mod nearby;
pub(crate) mod openings;
mod patches;
pub mod point;
mod shadows;
pub(crate) mod sky;
mod slope;
mod sweep;
pub(crate) mod trace;
