//! What is said over a file of spectra: objects laid one over the other; rows of numbers in place of a CSV's name.

use super::uri;
use serde_json::{Value, json};
use std::path::Path;

/// The file's JSON with what was said over it; none if there is neither. What is no object is left for the reader to name.
pub(super) fn over(file: Option<Value>, said: Option<&Value>) -> Option<Value> {
    match (file, said) {
        (file, None) => file,
        (None, Some(said)) => Some(said.clone()),
        (Some(mut file), Some(said)) if file.is_object() => {
            merge(&mut file, said);
            Some(file)
        }
        (Some(file), Some(_)) => Some(file),
    }
}

/// Lays a patch over a file of spectra (RFC 7396). One difference: the name of a spectrum takes the place of a CSV, and a CSV
/// that of a name.
fn merge(file: &mut Value, patch: &Value) {
    let Some(patch) = patch.as_object() else {
        *file = patch.clone();
        return;
    };
    if !file.is_object() {
        *file = json!({});
    }
    let Some(file) = file.as_object_mut() else {
        return;
    };
    for (one, other) in [("name", "csv"), ("csv", "name")] {
        if patch.get(one).is_some_and(Value::is_string) {
            file.shift_remove(other);
        }
    }
    for (key, value) in patch {
        if value.is_null() {
            file.shift_remove(key);
        } else {
            merge(file.entry(key.as_str()).or_insert(Value::Null), value);
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
    // Editors on Windows put a byte order mark first.
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&text);
    serde_json::from_slice(text)
        .map_err(|why| (format!("is not valid JSON ({why})"), "mend the file"))
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn changes_are_laid_over_the_file() {
        let mut file = json!({ "materials": { "a": { "emission": { "csv": "a.csv", "luminance_cd_m2": 5 } }, "b": {} } });
        let patch = json!({ "materials": { "a": { "emission": { "name": "cie/A" } }, "b": null }, "lights": { "c": { "name": "cie/A" } } });
        merge(&mut file, &patch);
        let wanted = json!({
            "materials": { "a": { "emission": { "luminance_cd_m2": 5, "name": "cie/A" } } },
            "lights": { "c": { "name": "cie/A" } },
        });
        assert_eq!(file, wanted);
    }
}
