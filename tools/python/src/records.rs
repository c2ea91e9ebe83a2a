//! Records as dictionaries of plain values.

use haarlight::Error;
use pyo3::prelude::*;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::errors;

/// A record as Python objects: dictionaries, lists, numbers, texts.
pub(crate) fn plain(py: Python<'_>, record: &impl Serialize) -> PyResult<Py<PyAny>> {
    let fault = |problem| Error::Internal(format!("record: {problem}"));
    let text = serde_json::to_string(record).map_err(|e| errors::raised(py, &fault(e)))?;
    Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
}

/// A record as one dictionary without dictionaries in it: `error.total_de2000`, and `error.total_de2000.kind` (`bound`,
/// `estimate` or `measured`) beside every figure of error.
pub(crate) fn flat(py: Python<'_>, record: &impl Serialize) -> PyResult<Py<PyAny>> {
    let fault = |problem| Error::Internal(format!("record: {problem}"));
    let record = serde_json::to_value(record).map_err(|e| errors::raised(py, &fault(e)))?;
    let mut row = Map::new();
    flatten("", record, &mut row);
    plain(py, &row)
}

fn flatten(name: &str, value: Value, row: &mut Map<String, Value>) {
    let Value::Object(members) = value else {
        row.insert(name.to_owned(), value);
        return;
    };
    let is_figure =
        members.len() == 2 && members.contains_key("value") && members.contains_key("kind");
    for (key, value) in members {
        let name = match (name, key.as_str()) {
            ("", _) => key,
            (_, "value") if is_figure => name.to_owned(),
            _ => format!("{name}.{key}"),
        };
        flatten(&name, value, row);
    }
}
