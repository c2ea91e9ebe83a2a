//! Adaptive spectral interval lists (Rougeron and Péroche 1997).

mod grid;
pub use grid::{Grid, LEAVES, Leaves};
