//! Bakes light into glTF rooms in full spectrum, by progressive hierarchical radiosity.

pub mod cli;
pub mod color;
pub mod data;
pub mod error;
pub mod gather;
pub mod geometry;
pub mod output;
pub mod report;
pub mod scene;
pub mod spectrum;

pub use error::{Error, Problem, Result};
