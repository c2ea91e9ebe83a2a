//! What is said over a file of spectra: objects laid one over the other; rows of numbers in place of a CSV's name.
//!
//! `materials` are laid over each other name by name and there key by key, `lights` name by name, `sky` key by key.

use super::uri;
use serde_json::{Map, Value};
use std::path::Path;

/// How deep the members of a file's key are laid over each other.
fn depth(key: &str) -> usize {
    match key {
        "materials" => 2,
        _ => 1,
    }
}

/// The file's JSON with what was said over it; none if there is neither. What is no object is left for the reader to name.
pub(super) fn over(file: Option<Value>, said: Option<&Value>) -> Option<Value> {
    match (file, said) {
        (file, None) => file,
        (None, Some(said)) => Some(said.clone()),
        (Some(Value::Object(mut file)), Some(Value::Object(said))) => {
            for (key, value) in said {
                lay(&mut file, key, value, depth(key));
            }
            Some(Value::Object(file))
        }
        (Some(Value::Object(_)), Some(said)) => Some(said.clone()),
        (Some(file), Some(_)) => Some(file),
    }
}

fn lay(below: &mut Map<String, Value>, key: &str, value: &Value, depth: usize) {
    match (below.get_mut(key), value) {
        (Some(Value::Object(below)), Value::Object(members)) if depth > 0 => {
            for (key, value) in members {
                lay(below, key, value, depth - 1);
            }
        }
        _ => {
            below.insert(key.to_owned(), value.clone());
        }
    }
}

/// Is a CSV given by its rows, and not by the name of a file?
pub(super) fn is_rows(csv: &str) -> bool {
    csv.contains('\n')
}

/// What a CSV is called.
pub(super) fn called(csv: &str) -> String {
    if is_rows(csv) {
        "rows of numbers".into()
    } else {
        csv.to_owned()
    }
}

/// The JSON of a file; otherwise what is wrong and what to do.
pub(super) fn json_of(path: &Path) -> Result<Value, (String, &'static str)> {
    let text = uri::read_file(path).map_err(|why| (why, "name a spectra file that can be read"))?;
    serde_json::from_slice(&text)
        .map_err(|why| (format!("is not valid JSON ({why})"), "mend the file"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_said_replaces_spectra_and_lights_as_wholes() {
        let file = json!({
            "materials": {"wall": {"reflectance": {"csv": "wall.csv"}, "emission": {"name": "cie/A"}}},
            "lights": {"Spot": {"csv": "spot.csv"}, "Lamp": {"name": "cie/F2"}},
            "sky": {"type": "clear", "cct_k": 12000},
        });
        let said = json!({
            "materials": {"wall": {"reflectance": {"name": "macbeth/white"}}, "floor": {}},
            "lights": {"Spot": {"name": "cie/A"}},
            "sky": {"type": "overcast"},
        });
        let all = json!({
            "materials": {"wall": {"reflectance": {"name": "macbeth/white"}, "emission": {"name": "cie/A"}}, "floor": {}},
            "lights": {"Spot": {"name": "cie/A"}, "Lamp": {"name": "cie/F2"}},
            "sky": {"type": "overcast", "cct_k": 12000},
        });
        assert_eq!(over(Some(file.clone()), Some(&said)), Some(all));
        assert_eq!(over(Some(file.clone()), None), Some(file.clone()));
        assert_eq!(over(None, Some(&said)), Some(said));
        assert_eq!(over(None, None), None);
        assert_eq!(over(Some(file), Some(&json!([1]))), Some(json!([1])));
        assert_eq!(over(Some(json!(7)), Some(&json!({}))), Some(json!(7)));
    }
}
