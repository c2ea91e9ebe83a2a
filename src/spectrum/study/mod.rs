//! The paper's tests (section 4) as measurements that anyone can repeat.

pub mod bounds;
mod chart;
pub mod compare;
pub mod covariance;
pub mod cuts;
mod lanes;
pub mod modes;
pub mod table1;
pub mod table2;
mod walk;

pub use chart::{Chart, Light, Reflectances};
pub use walk::{Extent, LEVELS, Sample, Start, sample, walk};
