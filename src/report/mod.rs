//! What a person reads: the log, tables, charts, the page.

mod axis;
pub mod bars;
pub mod chart;
pub mod log;
pub mod page;
pub mod plan;
pub mod polar;
mod svg;
pub mod table;

pub use axis::Scale;
pub use bars::Bars;
pub use chart::{Chart, Series};
pub use log::Log;
pub use table::{Align, Table};
