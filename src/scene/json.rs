//! Typed views of the document's JSON: a missing key is an absence, a wrong type is a problem with a place.
//!
//! Nothing here panics or trusts a number: indices are checked by whoever looks them up.

use crate::scene::check::Check;
use serde_json::{Map, Value};

/// An object of the document with the words for its place.
#[derive(Debug, Clone)]
pub(crate) struct Item<'a> {
    /// The object.
    pub(crate) map: &'a Map<String, Value>,
    /// `mesh 3 'chair'`.
    pub(crate) place: String,
}

/// How many items the top-level array `key` has.
pub(crate) fn len(json: &Value, key: &str) -> usize {
    json.get(key).and_then(Value::as_array).map_or(0, Vec::len)
}

/// Item `index` of the top-level array `key`, called `kind` in messages; none if it is not an object.
pub(crate) fn item<'a>(json: &'a Value, key: &str, kind: &str, index: usize) -> Option<Item<'a>> {
    let map = json.get(key)?.get(index)?.as_object()?;
    let place = match map.get("name").and_then(Value::as_str) {
        Some(name) if !name.is_empty() => format!("{kind} {index} '{}'", short(name)),
        _ => format!("{kind} {index}"),
    };
    Some(Item { map, place })
}

/// Item `index` as referred to by `place`: a missing one is a problem there.
pub(crate) fn referred<'a>(
    json: &'a Value,
    key: &str,
    kind: &str,
    index: usize,
    place: &str,
    check: &mut Check,
) -> Option<Item<'a>> {
    let found = item(json, key, kind, index);
    if found.is_none() {
        let what = format!(
            "refers to {kind} {index}, which the document does not have (it has {})",
            len(json, key)
        );
        check.problem(place, what, "export the file again");
    }
    found
}

/// Names from a file may be long; messages are not.
pub(crate) fn short(name: &str) -> String {
    const LONGEST: usize = 60;
    if name.chars().count() <= LONGEST {
        name.to_owned()
    } else {
        format!("{}...", name.chars().take(LONGEST).collect::<String>())
    }
}

impl<'a> Item<'a> {
    /// The item's name; empty if it has none.
    pub(crate) fn name(&self) -> &'a str {
        self.map.get("name").and_then(Value::as_str).unwrap_or("")
    }

    /// A non-negative whole number.
    pub(crate) fn index(&self, key: &str, check: &mut Check) -> Option<usize> {
        let value = self.map.get(key)?;
        let index = whole(value);
        if index.is_none() {
            self.wrong(key, "a non-negative whole number", check);
        }
        index
    }

    /// A finite number.
    pub(crate) fn number(&self, key: &str, check: &mut Check) -> Option<f64> {
        let value = self.map.get(key)?;
        let number = value.as_f64().filter(|x| x.is_finite());
        if number.is_none() {
            self.wrong(key, "a finite number", check);
        }
        number
    }

    /// A list of exactly `N` finite numbers.
    pub(crate) fn numbers<const N: usize>(&self, key: &str, check: &mut Check) -> Option<[f64; N]> {
        let value = self.map.get(key)?;
        let mut numbers = [0.0; N];
        let list = value.as_array().filter(|list| list.len() == N);
        let all = list.is_some_and(|list| {
            list.iter().zip(&mut numbers).all(|(value, slot)| {
                *slot = value.as_f64().unwrap_or(f64::NAN);
                slot.is_finite()
            })
        });
        if all {
            Some(numbers)
        } else {
            self.wrong(key, &format!("a list of {N} finite numbers"), check);
            None
        }
    }

    /// A string.
    pub(crate) fn text(&self, key: &str, check: &mut Check) -> Option<&'a str> {
        let value = self.map.get(key)?;
        let text = value.as_str();
        if text.is_none() {
            self.wrong(key, "a string", check);
        }
        text
    }

    /// A boolean; false where it is missing.
    pub(crate) fn flag(&self, key: &str, check: &mut Check) -> bool {
        let Some(value) = self.map.get(key) else {
            return false;
        };
        value.as_bool().unwrap_or_else(|| {
            self.wrong(key, "true or false", check);
            false
        })
    }

    /// A list; empty where it is missing.
    pub(crate) fn list(&self, key: &str, check: &mut Check) -> &'a [Value] {
        let Some(value) = self.map.get(key) else {
            return &[];
        };
        value.as_array().map_or_else(
            || {
                self.wrong(key, "a list", check);
                &[][..]
            },
            Vec::as_slice,
        )
    }

    /// An object inside this one; it keeps this one's place.
    pub(crate) fn child(&self, key: &str, check: &mut Check) -> Option<Item<'a>> {
        let value = self.map.get(key)?;
        let map = value.as_object();
        if map.is_none() {
            self.wrong(key, "an object", check);
        }
        Some(Item {
            map: map?,
            place: self.place.clone(),
        })
    }

    /// The object of an extension on this item.
    pub(crate) fn extension(&self, name: &str, check: &mut Check) -> Option<Item<'a>> {
        let extensions = self.child("extensions", check)?;
        extensions.child(name, check)
    }

    /// Names of all extensions on this item, sorted.
    pub(crate) fn extension_names(&self) -> Vec<String> {
        let map = self.map.get("extensions").and_then(Value::as_object);
        let mut names: Vec<String> = map.map_or_else(Vec::new, |m| m.keys().cloned().collect());
        names.sort();
        names
    }

    fn wrong(&self, key: &str, wanted: &str, check: &mut Check) {
        let what = format!("'{key}' is not {wanted}");
        check.problem(&self.place, what, "export the file again");
    }
}

/// A non-negative whole number below 2^53; glTF allows `3.0` for 3.
pub(crate) fn whole(value: &Value) -> Option<usize> {
    const LARGEST: f64 = 9_007_199_254_740_992.0;
    if let Some(index) = value.as_u64() {
        return usize::try_from(index).ok();
    }
    let number = value.as_f64()?;
    // The range check makes the conversion exact.
    (number >= 0.0 && number < LARGEST && number.fract() == 0.0).then_some(number as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn wrong_types_are_problems_and_missing_keys_are_not() {
        let json = json!({"nodes": [{"name": "a", "mesh": -1, "scale": [1, 2], "matrix": "x", "camera": 2.0}, 5]});
        let mut check = Check::new("f");
        let node = item(&json, "nodes", "node", 0).unwrap();
        assert_eq!(node.place, "node 0 'a'");
        assert_eq!(node.index("skin", &mut check), None);
        assert_eq!(node.index("camera", &mut check), Some(2));
        assert!(!check.has_problems());
        assert_eq!(node.index("mesh", &mut check), None);
        assert_eq!(node.numbers::<3>("scale", &mut check), None);
        assert_eq!(node.numbers::<16>("matrix", &mut check), None);
        assert!(item(&json, "nodes", "node", 1).is_none());
        assert!(referred(&json, "nodes", "node", 2, "scene 0", &mut check).is_none());
        let (problems, _) = check.into_parts();
        assert_eq!(problems.len(), 4);
        assert!(problems[3].what.contains("node 2"));
    }

    #[test]
    fn whole_numbers_only() {
        assert_eq!(whole(&json!(7)), Some(7));
        assert_eq!(whole(&json!(7.0)), Some(7));
        assert_eq!(whole(&json!(7.5)), None);
        assert_eq!(whole(&json!(-1)), None);
        assert_eq!(whole(&json!(1e300)), None);
        assert_eq!(whole(&json!("7")), None);
    }
}
