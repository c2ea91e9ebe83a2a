//! An independent answer: unbiased Monte Carlo in all 64 bands, with confidence intervals.
//!
//! It shares the scene, the welded triangles and the ray index with the solver, and nothing else: no links, no lanes,
//! no form factors, no balance.

mod fluorescence;
mod mirrors;
mod outside;
mod path;
mod rays;
mod reference;
mod report;
mod summary;

pub use path::{Answer, Audit, BATCHES};
pub use reference::{FacePoint, PathReference};
pub use report::{AuditedPoint, HONEST, Honesty, Report, WorstPoint};
pub use summary::{ErrorSummary, Measured};
