//! The paper's tests (section 4) as measurements that anyone can repeat.

mod chart;
pub mod table1;
mod walk;

pub use chart::{Chart, Light, Reflectances};
pub use walk::{LEVELS, Sample, walk};
