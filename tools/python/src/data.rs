//! What a room is on this side of Python: the scene, with what it was read by.

use crate::errors::wrong;
use haarlight::Error;
use haarlight::scene::{Options, Scene};
use haarlight::survey::{SurveyOptions, advise};
use pyo3::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// A room with what it was read by.
#[derive(Clone)]
pub(crate) struct Data {
    pub(crate) path: PathBuf,
    pub(crate) options: Options,
    pub(crate) wishes: SurveyOptions,
    pub(crate) scene: Scene,
    /// Lamps whose light was multiplied since the room was read, and by what.
    pub(crate) dimmed: BTreeMap<String, f64>,
}

impl Data {
    /// Reads a room and looks it over.
    pub(crate) fn read(
        path: PathBuf,
        options: Options,
        wishes: SurveyOptions,
    ) -> haarlight::Result<Self> {
        let mut scene = Scene::load(&path, &options)?;
        let problems = advise(&mut scene, wishes);
        if !problems.is_empty() {
            return Err(Error::Input(problems));
        }
        Ok(Self {
            path,
            options,
            wishes,
            scene,
            dimmed: BTreeMap::new(),
        })
    }
}

/// A room, read and checked. Made by `load`.
#[pyclass(frozen, module = "haarlight")]
pub(crate) struct Room {
    pub(crate) data: Arc<Data>,
}

/// A dictionary in the words of a file of spectra.
pub(crate) fn json_of(given: &Bound<'_, PyAny>, name: &str) -> PyResult<Value> {
    let py = given.py();
    let text = py
        .import("haarlight._types")?
        .call_method1("_json", (given,));
    let next = "give a dictionary as in a file of spectra";
    let text: String = text
        .and_then(|text| text.extract())
        .map_err(|problem| wrong(py, name, problem.value(py).to_string(), next))?;
    serde_json::from_str(&text).map_err(|problem| wrong(py, name, problem.to_string(), next))
}
