//! Bakes light into glTF rooms in full spectrum, by progressive hierarchical radiosity.

pub mod audit;
pub mod cli;
pub mod color;
pub mod data;
pub mod error;
pub mod gather;
pub mod geometry;
pub mod hierarchy;
pub mod link;
pub mod output;
pub mod report;
pub mod scene;
pub mod solve;
pub mod spectrum;

pub use error::{Error, Problem, Result};
