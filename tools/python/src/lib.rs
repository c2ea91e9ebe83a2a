//! haarlight as a Python module: `haarlight._native`, which the package `haarlight` shows to its users.
//!
//! | file | what |
//! |---|---|
//! | `arrays` | what comes in as points and goes out as NumPy arrays |
//! | `errors` | the library's messages as Python exceptions |
//! | `work` | work on a thread of its own, while Python listens for Ctrl-C |
//! | `records` | records as dictionaries |
//! | `room` | `load`, `Room` |
//! | `bake` | `Room.bake`: rounds, news of them, an end before the error |
//! | `light` | what a bake or a relit bake knows |
//! | `result` | `Result` |
//! | `maps` | light maps
//! | `relight` | the same room under other lamps |
//! | `spectra` | spectra by name |
//!
//! Nothing here computes light. Work holds no lock of the interpreter, and no panic leaves it.

mod arrays;
mod bake;
mod data;
mod errors;
mod light;
mod maps;
mod records;
mod relight;
mod result;
mod room;
mod spectra;
mod work;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("PROGRAM", haarlight::PROGRAM)?;
    module.add_class::<data::Room>()?;
    module.add_class::<result::Lit>()?;
    module.add_function(wrap_pyfunction!(room::load, module)?)?;
    module.add_function(wrap_pyfunction!(spectra::spectra, module)?)?;
    module.add_function(wrap_pyfunction!(work::_panic, module)?)
}
