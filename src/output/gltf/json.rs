//! Elements of glTF documents as JSON values.

use serde_json::{Map, Value};

/// glTF forbids empty lists: they are left out.
pub(super) fn put_list(json: &mut Map<String, Value>, key: &str, list: Vec<Value>) {
    if list.is_empty() {
        json.shift_remove(key);
    } else {
        json.insert(key.into(), Value::Array(list));
    }
}

/// The elements of a top-level list, or none.
pub(super) fn list<'j>(json: &'j Value, key: &str) -> &'j [Value] {
    json.get(key)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

/// A non-negative integer field.
pub(super) fn index(json: &Value, key: &str) -> Option<usize> {
    json.get(key)
        .and_then(Value::as_u64)
        .and_then(|i| usize::try_from(i).ok())
}

/// An extension's object.
pub(super) fn extension<'j>(json: &'j Value, name: &str) -> Option<&'j Value> {
    json.get("extensions").and_then(|e| e.get(name))
}

/// Takes an extension (or other key below `key`) away, and the holder with it when that was the last.
pub(super) fn remove_below(json: &mut Value, key: &str, name: &str) {
    let Some(object) = json.as_object_mut() else {
        return;
    };
    let Some(holder) = object.get_mut(key).and_then(Value::as_object_mut) else {
        return;
    };
    holder.shift_remove(name);
    if holder.is_empty() {
        object.shift_remove(key);
    }
}
