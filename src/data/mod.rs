//! Published tables (CIE observer, illuminants, measured reflectances) and readers of spectra.

mod blackbody;
mod daylight;
mod nearest;
mod registry;
mod table;

pub use blackbody::{SECOND_RADIATION_CONSTANT, blackbody};
pub use daylight::daylight;
pub use registry::{Kind, Named, named, names, nearest};
pub use table::{CsvProblem, Outside, Table};

pub(crate) use nearest::nearest_of;
pub(crate) use registry::{alpha_opic, cmf_1931, cmf_1964, colour_evaluation, test_colours};
