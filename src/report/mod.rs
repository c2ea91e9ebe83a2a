//! What a person reads: the log, tables, charts, the page.

mod axis;
pub mod bars;
pub mod line_chart;
pub mod log;
pub mod page;
pub mod plan;
pub mod polar;
mod svg;
pub mod table;

pub use axis::Scale;
pub use bars::Bars;
pub use line_chart::{LineChart, Series};
pub use log::Log;
pub use table::{Align, TextTable};
