//! Adaptive spectral interval lists (Rougeron and Péroche 1997).

mod grid;
mod partition;

pub use grid::{Grid, LEAVES, Leaves};
pub use partition::{Intervals, Partition};
