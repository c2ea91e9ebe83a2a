//! Adaptive spectral interval lists (Rougeron and Péroche 1997).

mod control;
mod grid;
mod interval;
mod list;
mod partition;
mod product;
mod source;
pub mod study;
mod tree;

#[cfg(test)]
pub(crate) mod testing;

pub use control::{Control, Metric, Operation, Overshoot, Pairs, control};
pub use grid::{Grid, LEAVES, Leaves};
pub use interval::{Cmf, Estimate, Interval, Moment, Representative};
pub use list::List;
pub use partition::{Intervals, Partition};
pub use product::Path;
pub use source::represent;
pub use tree::{CmfTree, NODES, Tree, node, span};
