//! The document's JSON, element by element, as the types of [`gltf::json`]: a missing key is an absence, a wrong type is a problem with
//! a place, and the element is read on without it, so that all its problems are told together.
//!
//! Nothing here panics or trusts a number: indices are checked by whoever looks them up. The types hold single precision; where
//! things stand is read in double ([`nodes`](super::nodes)).

use crate::scene::check::Check;
use gltf::json::Root;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use serde_path_to_error::{Path, Segment};

/// Keys that the types know and nobody here asks for, so that nothing can be wrong with them; and what is read by itself:
/// names, extras, extensions, textures, which may have extensions, and primitives, which have places of their own.
const PASSED_OVER: [&str; 24] = [
    "baseColorTexture",
    "diffuseTexture",
    "emissiveTexture",
    "extensions",
    "extras",
    "glossinessFactor",
    "magFilter",
    "max",
    "metallicRoughnessTexture",
    "mimeType",
    "min",
    "minFilter",
    "name",
    "normalTexture",
    "occlusionTexture",
    "primitives",
    "skin",
    "specularFactor",
    "specularGlossinessTexture",
    "target",
    "targets",
    "thicknessTexture",
    "transmissionTexture",
    "weights",
];
/// Keys of numbers of bytes or elements, which may be above 2^32.
const LARGE: [&str; 3] = ["byteLength", "byteOffset", "count"];
/// Wrong keys of an element that are looked for: more are not told in any case.
const MOST_WRONG: usize = 50;
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
    read(plain(&map), "", "", check).unwrap_or_default()
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
        read(plain(self.map), &self.place, "", check)
    }

    /// An extension on this item, as a type.
    pub(crate) fn extension<T: DeserializeOwned>(
        &self,
        name: &str,
        check: &mut Check,
    ) -> Option<T> {
        let item = self.extended(name, check)?;
        read(plain(item.map), &self.place, &format!("{name}."), check)
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

/// What of an object a type may see.
fn plain(map: &Map<String, Value>) -> Value {
    let seen = map
        .iter()
        .filter(|(key, _)| !PASSED_OVER.contains(&key.as_str()));
    let each = seen.map(|(key, value)| (key.clone(), plain_value(key, value)));
    Value::Object(each.collect())
}

/// Whole numbers as such, whatever they are written as; where an index of 32 bits would cut one short, as what no index is.
fn plain_value(key: &str, value: &Value) -> Value {
    match value {
        Value::Object(map) => plain(map),
        Value::Array(list) => list.iter().map(|value| plain_value(key, value)).collect(),
        Value::Number(number) => match whole(value) {
            Some(index) if index <= u32::MAX as usize || LARGE.contains(&key) => index.into(),
            // A set of coordinates is no index: that there are not so many is said where it is looked for.
            Some(_) if key == "texCoord" => u32::MAX.into(),
            _ => number.as_f64().into(),
        },
        other => other.clone(),
    }
}

fn read<T: DeserializeOwned>(
    mut value: Value,
    place: &str,
    prefix: &str,
    check: &mut Check,
) -> Option<T> {
    let mut told: Vec<String> = Vec::new();
    while told.len() < MOST_WRONG {
        let error = match serde_path_to_error::deserialize::<_, T>(&value) {
            Ok(read) => return Some(read),
            Err(error) => error,
        };
        let (path, text) = (error.path(), error.inner().to_string());
        if let Some(missing) = text.strip_prefix("missing field `") {
            let missing = missing.trim_end_matches('`');
            if !told.iter().any(|told| told == missing) {
                let of = match path.iter().next() {
                    Some(_) => format!("'{prefix}{path}' "),
                    None => prefix.trim_end_matches('.').to_owned() + " ",
                };
                let what = format!("{}has no {missing}", of.trim_start());
                check.problem(place, what, AGAIN);
            }
        } else if !told.iter().any(|told| told.starts_with(&path.to_string())) {
            // A list that is too short once a wrong entry was taken out of it is not told again.
            let wanted = text.rsplit_once(", expected ").map_or(&*text, |(_, w)| w);
            wrong(place, &format!("{prefix}{path}"), &words(wanted), check);
        }
        told.push(path.to_string());
        take_out(&mut value, path)?;
    }
    None
}

/// Takes out what stands at a path; none if that is all there is.
fn take_out(value: &mut Value, path: &Path) -> Option<()> {
    let segments: Vec<&Segment> = path.iter().collect();
    let (last, before) = segments.split_last()?;
    let mut at = value;
    for segment in before {
        at = match segment {
            Segment::Map { key } => at.get_mut(key)?,
            Segment::Seq { index } => at.get_mut(index)?,
            _ => return None,
        };
    }
    match (last, at) {
        (Segment::Map { key }, Value::Object(map)) => map.shift_remove(key).map(|_| ()),
        (Segment::Seq { index }, Value::Array(list)) => (*index < list.len()).then(|| {
            list.remove(*index);
        }),
        _ => None,
    }
}

/// What a type expects, in words.
fn words(wanted: &str) -> String {
    match wanted {
        "f32" | "f64" => "a finite number".into(),
        "u32" | "u64" | "usize" | "index into child of root" => {
            "a non-negative whole number".into()
        }
        "a boolean" => "true or false".into(),
        "a sequence" => "a list".into(),
        "a map" => "an object".into(),
        _ if wanted.starts_with("struct ") => "an object".into(),
        _ => wanted.strip_prefix("an array of length ").map_or_else(
            || wanted.into(),
            |n| format!("a list of {n} finite numbers"),
        ),
    }
}

fn wrong(place: &str, key: &str, wanted: &str, check: &mut Check) {
    check.problem(place, format!("'{key}' is not {wanted}"), AGAIN);
}

/// A number of single precision as it was written, as far as its seven digits tell: .004 is .004.
pub(crate) fn double(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}

/// A non-negative whole number below 2^53; glTF allows `3.0` for 3.
fn whole(value: &Value) -> Option<usize> {
    const LARGEST: f64 = 9_007_199_254_740_992.0;
    if let Some(index) = value.as_u64() {
        return usize::try_from(index).ok();
    }
    let number = value.as_f64()?;
    // The range check makes the conversion exact; -0 stays what it is.
    let sound =
        (0.0..LARGEST).contains(&number) && number.fract() == 0.0 && number.is_sign_positive();
    sound.then_some(number as usize)
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
            json!({"mesh": -1, "camera": 3, "scale": [1, 2], "matrix": "x",
            "children": [4, "y", 5, 1u64 << 32], "translation": [1, "z", 3]}),
        );
        let read = read.unwrap();
        assert_eq!((read.mesh, read.camera), (None, Some(Index::new(3))));
        assert_eq!(read.children, Some(vec![Index::new(4), Index::new(5)]));
        let whole = "is not a non-negative whole number";
        assert_eq!(
            problems,
            [
                format!("'mesh' {whole}"),
                "'scale' is not a list of 3 finite numbers".into(),
                "'matrix' is not a list of 16 finite numbers".into(),
                format!("'children[1]' {whole}"),
                format!("'children[2]' {whole}"),
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

    #[test]
    fn numbers_of_bytes_may_be_large_and_indices_may_not() {
        let huge = 1u64 << 40;
        let map = json!({"byteLength": huge, "buffer": huge, "x": {"texCoord": huge}});
        let seen = plain(map.as_object().unwrap());
        let wanted =
            json!({"byteLength": huge, "buffer": huge as f64, "x": {"texCoord": u32::MAX}});
        assert_eq!(seen, wanted);
        assert_eq!(double(0.004), 0.004);
        assert_eq!(double(f32::INFINITY), f64::INFINITY);
    }

    #[test]
    fn whole_numbers_only() {
        assert_eq!(whole(&json!(7)), Some(7));
        assert_eq!(whole(&json!(7.0)), Some(7));
        assert_eq!(whole(&json!(7.5)), None);
        assert_eq!(whole(&json!(-0.0)), None);
        assert_eq!(whole(&json!(-1)), None);
        assert_eq!(whole(&json!(1e300)), None);
        assert_eq!(whole(&json!("7")), None);
    }
}
