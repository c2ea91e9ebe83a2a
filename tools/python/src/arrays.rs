//! What comes in as points and goes out as NumPy arrays.
//!
//! In: lists, tuples and arrays of whole numbers or any kind of float, copied into f64. Out: arrays that own what was
//! computed, not copied, and cannot be written to, as every caller gets the same one.

use crate::errors::{raised, wrong};
use glam::DVec3;
use haarlight::Error;
use numpy::ndarray::{Array2, ShapeError};
use numpy::{Element, IntoPyArray, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Points that are listed one by one in a message.
const LISTED: usize = 3;

/// Numbers with their shape.
struct Numbers {
    shape: Vec<usize>,
    values: Vec<f64>,
}

/// The numbers of an argument.
fn numbers(given: &Bound<'_, PyAny>, name: &str) -> PyResult<Numbers> {
    let py = given.py();
    let numpy = py.import("numpy")?;
    let next = "give a list, a tuple or an array of numbers";
    let array = numpy.call_method1("asarray", (given,)).map_err(|problem| {
        let said = problem.value(py).to_string();
        wrong(py, name, format!("is no array of numbers ({said})"), next)
    })?;
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    let empty: usize = array.getattr("size")?.extract()?;
    if !(["f", "i", "u"].contains(&kind.as_str()) || empty == 0 && kind != "c") {
        let what = format!("holds values of type {dtype}, not numbers");
        return Err(wrong(py, name, what, next));
    }
    let array = array.call_method1("astype", ("float64", "C"))?;
    let array: PyReadonlyArrayDyn<'_, f64> = array.extract()?;
    Ok(Numbers {
        shape: array.shape().to_vec(),
        values: array.as_slice()?.to_vec(),
    })
}

fn shown(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        many => {
            let sizes: Vec<String> = many.iter().map(usize::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}

/// Triples of finite numbers, shape (N, 3).
fn triples(given: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<DVec3>> {
    let Numbers { shape, values } = numbers(given, name)?;
    let py = given.py();
    match shape[..] {
        [_, 3] | [0] => {}
        [3] => {
            let what = "has the shape (3,), not (N, 3)";
            return Err(wrong(py, name, what, "write one point as [[x, y, z]]"));
        }
        _ => {
            let what = format!("has the shape {}, not (N, 3)", shown(&shape));
            return Err(wrong(py, name, what, "give x, y, z of each in a row"));
        }
    }
    let rows = values.chunks_exact(3).map(DVec3::from_slice);
    let rows: Vec<DVec3> = rows.collect();
    refuse(py, name, &rows, "hold values that are not finite", |p| {
        !p.is_finite()
    })?;
    Ok(rows)
}

/// Names the rows that something is wrong with.
fn refuse(
    py: Python<'_>,
    name: &str,
    rows: &[DVec3],
    what: &str,
    is_wrong: impl Fn(&DVec3) -> bool,
) -> PyResult<()> {
    let found: Vec<usize> = (0..rows.len()).filter(|&k| is_wrong(&rows[k])).collect();
    if found.is_empty() {
        return Ok(());
    }
    let listed: Vec<String> = found.iter().take(LISTED).map(usize::to_string).collect();
    let rest = if found.len() > LISTED { " ..." } else { "" };
    let what = format!("{} rows {what}: {}{rest}", found.len(), listed.join(", "));
    Err(wrong(py, name, what, "correct or remove them"))
}

/// Points with unit normals: (N, 3) each, or one normal (3,) for all points. Normals may have any length but none.
pub(crate) fn points(
    points: &Bound<'_, PyAny>,
    normals: &Bound<'_, PyAny>,
) -> PyResult<Vec<(DVec3, DVec3)>> {
    let py = points.py();
    let places = triples(points, "points")?;
    let one = numbers(normals, "normals")?;
    let directions = if one.shape == [3] && one.values.iter().all(|x| x.is_finite()) {
        vec![DVec3::from_slice(&one.values); places.len()]
    } else {
        triples(normals, "normals")?
    };
    if directions.len() != places.len() {
        let what = format!(
            "are {}, and there are {} points",
            directions.len(),
            places.len()
        );
        return Err(wrong(
            py,
            "normals",
            what,
            "give one for each point, or one (3,) for all",
        ));
    }
    // Scaled first: squares of very large or small numbers leave the range of f64.
    let unit = |n: &DVec3| (*n / n.abs().max_element()).try_normalize();
    refuse(py, "normals", &directions, "have no length", |n| {
        unit(n).is_none()
    })?;
    let pairs = places.into_iter().zip(&directions);
    Ok(pairs.filter_map(|(p, n)| Some((p, unit(n)?))).collect())
}

/// Wavelengths, (K,), nm.
pub(crate) fn wavelengths(given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let Numbers { shape, values } = numbers(given, "wavelengths")?;
    if shape.len() != 1 {
        let what = format!("has the shape {}, not (K,)", shown(&shape));
        return Err(wrong(
            given.py(),
            "wavelengths",
            what,
            "give a list of wavelengths in nm",
        ));
    }
    Ok(values)
}

/// A row of what was computed, (N,); cannot be written to.
pub(crate) fn line<T: Element>(py: Python<'_>, values: Vec<T>) -> PyResult<Py<PyAny>> {
    sealed(values.into_pyarray(py).as_any())
}

/// Rows of what was computed, (N, `width`).
pub(crate) fn rows<T: Element>(
    py: Python<'_>,
    values: Vec<T>,
    width: usize,
) -> PyResult<Py<PyAny>> {
    let array = Array2::from_shape_vec([values.len() / width, width], values);
    let fault = |problem: ShapeError| Error::Internal(format!("rows: {problem}"));
    let array = array.map_err(|problem| raised(py, &fault(problem)))?;
    sealed(array.into_pyarray(py).as_any())
}

/// The array, not to be written to.
pub(crate) fn sealed(array: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
    array.call_method1("setflags", (false,))?;
    Ok(array.clone().unbind())
}
