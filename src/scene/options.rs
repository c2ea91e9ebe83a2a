//! How a room is to be read.

use super::said;
use super::sky::SkyWish;
use crate::data::Grid;
use std::path::PathBuf;

/// How to read a room.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The wavelengths to work on; 380 to 780 nm by default.
    pub grid: Grid,
    /// The file of spectra; none: `room.spectra.json` beside `room.glb`, if there is one.
    pub spectra: Option<PathBuf>,
    /// What is said over the file of spectra: an object of the same form, laid over it as RFC 7396 has it (`null` takes out), where the
    /// name of a spectrum takes the place of a CSV, and a CSV that of a name.
    pub said: Option<serde_json::Value>,
    /// Only warn of keys and names in the file of spectra that mean nothing.
    pub lenient: bool,
    /// Metres for each unit of the file; none: 1, as glTF has it.
    pub scale: Option<f64>,
    /// Sky and sun; what is not said here the file of spectra may say.
    pub sky: SkyWish,
}

impl Options {
    /// Says more, over what was said: see [`Options::said`].
    pub fn say(&mut self, more: serde_json::Value) {
        self.said = said::over(self.said.take(), Some(&more));
    }
}
