//! The spectra that rooms may name.

use crate::errors;
use haarlight::data::{TableKind, named, names, nearest};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Spectra by name, a dictionary in the order of the publications.
///
/// Args:
///     pattern: only names that hold this, letter case free; or one name, as `blackbody/2700`.
///
/// Returns:
///     `{name: Spectrum(kind, wavelengths, values)}`: kind `light` or `reflectance`, wavelengths (N,) in nm, values (N,),
///     relative power or reflectance in [0, 1].
///
/// Raises:
///     InputError: no name holds the pattern; the nearest ones are named.
#[pyfunction]
#[pyo3(signature = (pattern = ""))]
pub(crate) fn spectra<'py>(py: Python<'py>, pattern: &str) -> PyResult<Bound<'py, PyDict>> {
    let wanted = pattern.to_lowercase();
    let mut found = names();
    found.retain(|name| name.to_lowercase().contains(&wanted));
    if found.is_empty() {
        found.push(pattern.to_owned());
    }
    let class = py.import("haarlight._types")?.getattr("Spectrum")?;
    let out = PyDict::new(py);
    for name in found {
        let Some(spectrum) = named(&name) else {
            continue;
        };
        let kind = match spectrum.kind {
            TableKind::Illuminant => "light",
            TableKind::Reflectance => "reflectance",
        };
        let wavelengths = spectrum.table.wavelengths().to_vec().into_pyarray(py);
        let values = spectrum.table.values().to_vec().into_pyarray(py);
        out.set_item(name, class.call1((kind, wavelengths, values))?)?;
    }
    if out.is_empty() {
        let next = format!("the nearest names are {}", nearest(pattern).join(", "));
        return Err(errors::wrong(
            py,
            "spectra",
            format!("no name holds '{pattern}'"),
            &next,
        ));
    }
    Ok(out)
}
