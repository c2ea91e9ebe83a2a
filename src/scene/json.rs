//! The document's JSON, element by element, as the types of [`gltf::json`]: a missing key is an absence, a wrong type is a problem with
//! a place, and the element is read on without it, so that all its problems are told together.
//!
//! Nothing here panics or trusts a number: indices are checked by whoever looks them up. The types hold single precision; where
//! things stand is read in double ([`nodes`](super::nodes)).

use crate::scene::check::Check;
use crate::scene::typed::read;
use gltf::json::Root;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

const AGAIN: &str = "export the file again";

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
        check.problem(place, what, AGAIN);
    }
    found
}

/// The document without its elements, which are read one by one, and its asset, which is asked for first of all.
pub(crate) fn root(json: &Value, check: &mut Check) -> Root {
    let keys = ["extensionsRequired", "extensionsUsed", "scene"];
    let said = keys.map(|key| Some((key.to_owned(), json.get(key)?.clone())));
    let mut map: Map<String, Value> = said.into_iter().flatten().collect();
    map.insert("asset".into(), serde_json::json!({"version": "2.0"}));
    read(&map, "", "", check).unwrap_or_default()
}

/// Names from a file may be long; messages are not.
pub(crate) fn short(name: &str) -> String {
    const LONGEST: usize = 60;
    match name.char_indices().nth(LONGEST) {
        None => name.to_owned(),
        Some((end, _)) => format!("{}...", &name[..end]),
    }
}

impl<'a> Item<'a> {
    /// The item's name; empty if it has none.
    pub(crate) fn name(&self) -> &'a str {
        self.map.get("name").and_then(Value::as_str).unwrap_or("")
    }

    /// Is there such a key?
    pub(crate) fn has(&self, key: &str) -> bool {
        self.map.contains_key(key)
    }

    /// What stands at a key, for messages.
    pub(crate) fn said(&self, key: &str) -> String {
        match self.map.get(key) {
            Some(Value::String(text)) => short(text),
            Some(other) => short(&other.to_string()),
            None => String::new(),
        }
    }

    /// The object as a type; none where something that it cannot be without is missing or wrong. All that is wrong is told.
    pub(crate) fn read<T: DeserializeOwned>(&self, check: &mut Check) -> Option<T> {
        read(self.map, &self.place, "", check)
    }

    /// An extension on this item, as a type.
    pub(crate) fn extension<T: DeserializeOwned>(
        &self,
        name: &str,
        check: &mut Check,
    ) -> Option<T> {
        let item = self.extended(name, check)?;
        read(item.map, &self.place, &format!("{name}."), check)
    }

    /// The object of an extension on this item.
    pub(crate) fn extended(&self, name: &str, check: &mut Check) -> Option<Item<'a>> {
        self.child("extensions", check)?.child(name, check)
    }

    /// A list; empty where it is missing.
    pub(crate) fn list(&self, key: &str, check: &mut Check) -> &'a [Value] {
        let Some(value) = self.map.get(key) else {
            return &[];
        };
        value.as_array().map_or_else(
            || {
                wrong(&self.place, key, "a list", check);
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
            wrong(&self.place, key, "an object", check);
        }
        Some(Item {
            map: map?,
            place: self.place.clone(),
        })
    }

    /// Names of all extensions on this item, sorted.
    pub(crate) fn extension_names(&self) -> Vec<String> {
        let map = self.map.get("extensions").and_then(Value::as_object);
        let mut names: Vec<String> = map.map_or_else(Vec::new, |m| m.keys().cloned().collect());
        names.sort();
        names
    }
}

fn wrong(place: &str, key: &str, wanted: &str, check: &mut Check) {
    check.problem(place, format!("'{key}' is not {wanted}"), AGAIN);
}

/// A number of single precision as it was written, as far as its seven digits tell: .004 is .004.
pub(crate) fn double(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gltf::json::{Index, Node, buffer::View};
    use serde_json::json;

    /// Node 0 of a list, and what is wrong with it.
    fn node(node: Value) -> (Option<Node>, Vec<String>) {
        let json = json!({"nodes": [node]});
        let mut check = Check::new("f");
        let read = item(&json, "nodes", "node", 0).unwrap().read(&mut check);
        let problems = check.into_parts().0;
        (read, problems.into_iter().map(|p| p.what).collect())
    }

    #[test]
    fn missing_keys_and_unseen_ones_are_no_problems() {
        let (read, problems) =
            node(json!({"camera": 2.0, "extras": 5, "name": 5, "weights": "x", "other": [null]}));
        assert_eq!(read.unwrap().camera, Some(Index::new(2)));
        assert_eq!(problems, Vec::<String>::new());
        let json = json!({"nodes": [{"name": "a"}, 5]});
        assert_eq!(item(&json, "nodes", "node", 0).unwrap().place, "node 0 'a'");
        assert!(item(&json, "nodes", "node", 1).is_none());
        let mut check = Check::new("f");
        assert!(referred(&json, "nodes", "node", 2, "scene 0", &mut check).is_none());
        assert!(check.into_parts().0[0].what.contains("node 2"));
    }

    #[test]
    fn all_that_is_wrong_is_told_and_the_rest_is_read() {
        let (read, problems) = node(
            json!({"mesh": -1, "camera": 3, "scale": [1, 2, 3, 4], "matrix": [1],
            "children": [4, "y", 5, 1u64 << 32], "translation": [1, "z", 3]}),
        );
        let read = read.unwrap();
        assert_eq!((read.mesh, read.camera), (None, Some(Index::new(3))));
        assert_eq!(read.children, Some(vec![Index::new(4), Index::new(5)]));
        let whole = "is not a non-negative whole number";
        assert_eq!(
            problems,
            [
                format!("'children[1]' {whole}"),
                format!("'children[3]' {whole}"),
                "'matrix' is not a list of 16 finite numbers".into(),
                format!("'mesh' {whole}"),
                "'scale' is not a list of 3 finite numbers".into(),
                "'translation[1]' is not a finite number".into(),
            ]
        );
    }

    #[test]
    fn what_an_element_cannot_be_without_is_named() {
        let view = |value: Value| {
            let json = json!({"bufferViews": [value]});
            let mut check = Check::new("f");
            let item = item(&json, "bufferViews", "bufferView", 0).unwrap();
            assert!(item.read::<View>(&mut check).is_none());
            let problems = check.into_parts().0.into_iter();
            problems.map(|p| p.what).collect::<Vec<_>>()
        };
        assert_eq!(view(json!({"buffer": 0})), ["has no byteLength"]);
        let wrong = "'byteLength' is not a non-negative whole number";
        assert_eq!(view(json!({"byteLength": -1, "buffer": 0})), [wrong]);
    }
}
