//! The commands, one a file.

pub mod inspect;
pub mod paper;
