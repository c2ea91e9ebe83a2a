//! Shared by solver and transport: lanes, rows of lanes, and the solution on the patches.

mod descent;
mod filters;
mod fixtures;
mod fluorescent;
pub mod lanes;
pub(crate) mod passed;
pub(crate) mod rows;
mod solution;
mod through;
mod tilts;

pub use descent::Descent;
pub(crate) use descent::close_by;
pub use filters::{Filter, Filters, Glass};
pub(crate) use filters::{Passage, Tint, accumulate};
pub use fixtures::Fixtures;
pub use fluorescent::Fluorescent;
pub(crate) use fluorescent::{balance, guide};
pub use rows::{Rows, padded};
pub use solution::{Light, Neighbours};
pub(crate) use solution::{brightness, lightness_sensitivity, weighed};
pub use through::Through;
pub(crate) use through::mixed;
pub(crate) use tilts::{Place, Tilts, place};
