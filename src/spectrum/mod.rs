//! Adaptive spectral interval lists (Rougeron and Péroche 1997).

// Tristimulus components are indexed in step through several arrays; iterators would hide the formula.
#![allow(clippy::needless_range_loop)]

mod bound;
mod control;
mod grid;
mod interval;
mod list;
pub mod methods;
mod partition;
mod product;
mod source;
pub mod study;
mod sum;
mod tree;

#[cfg(test)]
pub(crate) mod testing;

pub use bound::Bounded;
pub use control::{Control, Metric, Operation, Overshoot, Pairs, coarsen, control};
pub use grid::{Grid, LEAVES, Leaves};
/// The list that patches carry: values, errors with the free part of the neglected term.
pub type SpectralList = List<Moment>;
/// The tree that goes with [`SpectralList`].
pub type SpectralTree = Tree<Moment>;

pub use interval::{Cmf, Estimate, Interval, Moment, Representative};
pub use list::List;
pub use partition::{Intervals, Partition};
pub use product::Path;
pub use source::represent;
pub use tree::{CmfTree, NODES, Tree, node, span};
