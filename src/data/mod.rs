//! Published tables (CIE observer, illuminants, measured reflectances), readers of spectra, and the bands they are held on.

mod blackbody;
mod daylight;
mod grid;
mod nearest;
mod registry;
mod skylight;
mod table;

pub use blackbody::{SECOND_RADIATION_CONSTANT, blackbody};
pub use daylight::daylight;
pub use grid::{BANDS, Grid, Spectrum};
pub use registry::{Named, TableKind, named, names, nearest};
pub use table::{CsvProblem, Outside, Table};

pub(crate) use nearest::nearest_of;
pub(crate) use registry::{alpha_opic, cmf_1931, cmf_1964, colour_evaluation, test_colours};
pub(crate) use skylight::{SKYLIGHT_NM, TERMS, TURBIDITY, WAVES, skylight};
