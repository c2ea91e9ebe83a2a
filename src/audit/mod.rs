//! An independent answer: unbiased Monte Carlo in all 64 leaves, with confidence intervals.
//!
//! It shares the scene, the welded triangles and the ray index with the solver, and nothing else: no links, no lanes,
//! no form factors, no balance.

mod compare;
mod path;
mod report;

pub use compare::{Comparison, Mean, compare};
pub use path::{Answer, Audit, BATCHES};
pub use report::{HONEST, Honesty, Measured, Report, Seen, Spread, Truth};
