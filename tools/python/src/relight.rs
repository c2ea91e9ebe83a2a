//! What `Result.relight` is given: another room, or what is to be changed in this one.

use crate::data::{Data, Room, json_of};
use crate::errors::wrong;
use haarlight::Result;
use pyo3::prelude::*;
use pyo3::types::PyMapping;
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// What is to be changed.
pub(crate) enum Change {
    /// Another room of the same shape.
    Room(Arc<Data>),
    /// Factors of lamps, and what is said of spectra.
    Parts {
        factors: Vec<(String, f64)>,
        said: Map<String, Value>,
    },
}

impl Change {
    /// Reads the argument.
    pub(crate) fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = given.py();
        if let Ok(room) = given.cast::<Room>() {
            return Ok(Self::Room(Arc::clone(&room.get().data)));
        }
        let next = "give {\"lamp\": 0.5}, {\"lamp\": {...}} as in a file of spectra, or a Room";
        let Ok(given) = given.cast::<PyMapping>() else {
            return Err(wrong(py, "relight", "is no dictionary and no room", next));
        };
        let (mut factors, mut said) = (Vec::new(), Map::new());
        for item in given.items()?.iter() {
            let (name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
            let Ok(name) = name.extract::<String>() else {
                return Err(wrong(py, "relight", format!("{name} is no name"), next));
            };
            if let Ok(factor) = value.extract::<f64>() {
                factors.push((name, factor));
                continue;
            }
            let place = format!("relight '{name}'");
            if value.cast::<PyMapping>().is_err() {
                return Err(wrong(py, &place, "is no number and no dictionary", next));
            }
            let entry = json_of(&value, &place)?;
            let is_material = ["reflectance", "emission"]
                .iter()
                .any(|key| entry.get(key).is_some());
            let list = if is_material { "materials" } else { "lights" };
            said.entry(list).or_insert_with(|| json!({}))[&name] = entry;
        }
        Ok(Self::Parts { factors, said })
    }

    /// The room as it is changed. Factors are of the lamps as they are in `data`; where spectra change the file is read again.
    pub(crate) fn apply(self, data: &Data) -> Result<Arc<Data>> {
        let (factors, said) = match self {
            Self::Room(room) => return Ok(room),
            Self::Parts { factors, said } => (factors, said),
        };
        let mut dimmed = data.dimmed.clone();
        let mut out = if said.is_empty() {
            data.clone()
        } else {
            let mut options = data.options.clone();
            options.say(Value::Object(said));
            let mut fresh = Data::read(data.path.clone(), options, data.wishes)?;
            for (name, factor) in &data.dimmed {
                fresh.scene.dim(name, *factor)?;
            }
            fresh
        };
        for (name, factor) in factors {
            out.scene.dim(&name, factor)?;
            *dimmed.entry(name).or_insert(1.0) *= factor;
        }
        out.dimmed = dimmed;
        Ok(Arc::new(out))
    }
}
