//! The paper's tests (section 4) as measurements that anyone can repeat.

pub mod bounds;
mod colour_chart;
pub mod compare;
pub mod covariance;
pub mod cuts;
mod lanes;
pub mod modes;
pub mod table1;
pub mod table2;
mod walk;

pub use colour_chart::{ColourChart, Reflectances, UnitLight};
pub use walk::{Extent, LEVELS, WalkStart, WalkStep, sample, walk};
