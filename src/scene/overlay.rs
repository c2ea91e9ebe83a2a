//! Changes laid over a file of spectra.

use serde_json::{Value, json};

/// Lays a patch over a file of spectra (RFC 7396). One difference: the name of a spectrum takes the place of a CSV, and a CSV
/// that of a name.
pub(super) fn merge(file: &mut Value, patch: &Value) {
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

#[cfg(test)]
mod tests {
    use super::*;

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
