//! The library's messages as exceptions of `haarlight._errors`, with file, node, mesh, material and light as attributes.

use haarlight::{Error, Problem};
use pyo3::prelude::*;

/// An exception for an error of the library.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    match make(py, error) {
        Ok(exception) => PyErr::from_value(exception),
        Err(fault) => fault,
    }
}

/// An exception for an argument that cannot be used.
pub(crate) fn wrong(py: Python<'_>, place: &str, what: impl Into<String>, next: &str) -> PyErr {
    raised(py, &Error::input(place, what, next))
}

fn make<'py>(py: Python<'py>, error: &Error) -> PyResult<Bound<'py, PyAny>> {
    let module = py.import("haarlight._errors")?;
    let text = error.to_string();
    match error {
        Error::Input(problems) => {
            let class = module.getattr("Problem")?;
            let problems: PyResult<Vec<_>> = problems.iter().map(|p| told(&class, p)).collect();
            module.getattr("InputError")?.call1((text, problems?))
        }
        Error::Io { path, source } => {
            let number = source.raw_os_error();
            module.call_method1("_file_error", (text, path, number))
        }
        _ => module.getattr("InternalError")?.call1((text,)),
    }
}

fn told<'py>(class: &Bound<'py, PyAny>, problem: &Problem) -> PyResult<Bound<'py, PyAny>> {
    let named = |kind: &str| problem.named(kind);
    class.call1((
        &problem.place,
        &problem.what,
        &problem.next,
        problem.file(),
        named("node"),
        named("mesh"),
        named("material"),
        named("light"),
    ))
}

/// Says what the user should know as Python warnings.
pub(crate) fn warn(py: Python<'_>, warnings: &[String]) -> PyResult<()> {
    if warnings.is_empty() {
        return Ok(());
    }
    let category = py.import("haarlight._errors")?.getattr("RoomWarning")?;
    let warn = py.import("warnings")?.getattr("warn")?;
    for text in warnings {
        warn.call1((text, &category))?;
    }
    Ok(())
}
