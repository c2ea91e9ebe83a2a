//! Objects of the document's JSON as types: fields that a type names are looked up, and nothing else of the object is looked at, so
//! that the cost does not depend on what else a file puts there. What is wrong is told, with its path, and the rest read without it.

use super::check::Check;
use serde::de::value::{MapDeserializer, SeqDeserializer};
use serde::de::{
    DeserializeOwned, Deserializer, Error, Expected, IntoDeserializer, Unexpected, Visitor,
};
use serde_json::{Map, Value};
use std::fmt;

/// Fields of the types that nobody here asks for, so that nothing can be wrong with them; and what is read by itself: names, extras
/// and extensions, and textures, which may have extensions.
fn is_passed_over(key: &str) -> bool {
    const KEYS: [&str; 14] = [
        "extensions",
        "extras",
        "glossinessFactor",
        "magFilter",
        "max",
        "mimeType",
        "min",
        "minFilter",
        "name",
        "skin",
        "specularFactor",
        "target",
        "targets",
        "weights",
    ];
    KEYS.contains(&key) || key.ends_with("Texture")
}

/// Keys of numbers of bytes or elements, which may be above 2^32.
const LARGE: [&str; 3] = ["byteLength", "byteOffset", "count"];
/// Wrong keys of an object that are looked for: more are not told in any case.
const MOST_WRONG: usize = 50;
const AGAIN: &str = "export the file again";

/// An object at `place` as a type; none where something that it cannot be without is missing or wrong. Keys are told with
/// `prefix` before them.
pub(crate) fn read<T: DeserializeOwned>(
    map: &Map<String, Value>,
    place: &str,
    prefix: &str,
    check: &mut Check,
) -> Option<T> {
    let (mut without, mut told) = (Vec::new(), Vec::<String>::new());
    while told.len() < MOST_WRONG {
        let part = Part {
            what: Json::Object(map),
            at: At::Root,
            without: &without,
        };
        let wrong = match T::deserialize(part) {
            Ok(read) => return Some(read),
            Err(wrong) => wrong,
        };
        let path = wrong.path;
        // A list that is too short without a wrong entry is not told again.
        let is_around = |told: &String| {
            let inner = told.strip_prefix(&path);
            inner.is_some_and(|inner| inner.starts_with(['.', '[']))
        };
        match wrong.what {
            What::Missing(key) => {
                let (of, dot) = match path.is_empty() {
                    true => (prefix.trim_end_matches('.').to_owned(), ""),
                    false => (format!("'{prefix}{path}'"), "."),
                };
                // One that is there, and wrong, was told.
                if !told.contains(&format!("{path}{dot}{key}")) {
                    let what = format!("{of} has no {key}");
                    check.problem(place, what.trim_start(), AGAIN);
                }
            }
            What::Wanted(wanted) if !told.iter().any(is_around) => {
                let what = format!("'{prefix}{path}' is not {}", words(&wanted));
                check.problem(place, what, AGAIN);
            }
            _ => {}
        }
        told.push(path);
        without.push(wrong.at?);
    }
    None
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
        _ => {
            let long = wanted.strip_prefix("an array of length ");
            match long.or(wanted.strip_suffix(" elements in sequence")) {
                Some(n) => format!("a list of {n} finite numbers"),
                None => wanted.into(),
            }
        }
    }
}

/// A non-negative whole number below 2^53; glTF allows `3.0` for 3.
fn whole(value: &Value) -> Option<u64> {
    const LARGEST: f64 = 9_007_199_254_740_992.0;
    let number = value.as_f64()?;
    // The range check makes the conversion exact; -0 stays what it is.
    let sound = (0.0..LARGEST).contains(&number) && number.fract() == 0.0;
    let sound = sound && number.is_sign_positive();
    value.as_u64().or(sound.then_some(number as u64))
}

/// A piece of JSON that is read.
#[derive(Clone, Copy)]
struct Part<'a> {
    what: Json<'a>,
    at: At<'a>,
    /// What it is read without.
    without: &'a [*const Value],
}

#[derive(Clone, Copy)]
enum Json<'a> {
    Object(&'a Map<String, Value>),
    Value(&'a Value),
}

/// Where in the piece around it.
#[derive(Clone, Copy)]
enum At<'a> {
    Root,
    Key(&'a str),
    Index(usize),
}

impl<'de> Part<'de> {
    fn inside(self, value: &'de Value, at: At<'de>) -> Option<Self> {
        let what = Json::Value(value);
        let is_seen = !self.without.contains(&std::ptr::from_ref(value));
        is_seen.then_some(Self { what, at, ..self })
    }

    /// What may be seen of an object.
    fn fields<V: Visitor<'de>>(
        self,
        map: &'de Map<String, Value>,
        keys: impl Iterator<Item = &'de str>,
        visitor: V,
    ) -> Result<V::Value, Wrong> {
        let seen = keys.filter(|key| !is_passed_over(key));
        let each = seen.filter_map(|key| Some((key, self.inside(map.get(key)?, At::Key(key))?)));
        visitor.visit_map(MapDeserializer::new(each))
    }

    fn elements<V: Visitor<'de>>(self, list: &'de [Value], visitor: V) -> Result<V::Value, Wrong> {
        let each = list.iter().enumerate();
        let each = each.filter_map(|(i, value)| self.inside(value, At::Index(i)));
        let mut list = SeqDeserializer::new(each);
        let read = visitor.visit_seq(&mut list)?;
        list.end().map(|()| read)
    }

    /// Whole numbers as such, whatever they are written as; where an index of 32 bits would cut one short, as what no index is.
    fn number<V: Visitor<'de>>(self, value: &Value, visitor: V) -> Result<V::Value, Wrong> {
        let is = |keys: &[&str]| matches!(self.at, At::Key(key) if keys.contains(&key));
        match whole(value) {
            Some(n) if u32::try_from(n).is_ok() || is(&LARGE) => visitor.visit_u64(n),
            // A set of coordinates is no index: that there are not so many is said where it is looked for.
            Some(_) if is(&["texCoord"]) => visitor.visit_u64(u32::MAX.into()),
            _ => visitor.visit_f64(value.as_f64().unwrap_or(f64::NAN)),
        }
    }
}

impl<'de> IntoDeserializer<'de, Wrong> for Part<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Part<'de> {
    type Error = Wrong;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Wrong> {
        let read = match self.what {
            Json::Object(map) | Json::Value(Value::Object(map)) => {
                self.fields(map, map.keys().map(String::as_str), visitor)
            }
            Json::Value(Value::Array(list)) => self.elements(list, visitor),
            Json::Value(number @ Value::Number(_)) => self.number(number, visitor),
            Json::Value(Value::String(text)) => visitor.visit_borrowed_str(text),
            Json::Value(Value::Bool(flag)) => visitor.visit_bool(*flag),
            Json::Value(Value::Null) => visitor.visit_unit(),
        };
        read.map_err(|wrong| wrong.inside(self))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Wrong> {
        match self.what {
            Json::Object(map) | Json::Value(Value::Object(map)) => self
                .fields(map, fields.iter().copied(), visitor)
                .map_err(|wrong| wrong.inside(self)),
            Json::Value(_) => self.deserialize_any(visitor),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Wrong> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Wrong> {
        visitor.visit_newtype_struct(self)
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map enum identifier ignored_any
    }
}

/// What is wrong, and where.
#[derive(Debug)]
struct Wrong {
    what: What,
    path: String,
    /// The innermost value that it could be read without.
    at: Option<*const Value>,
}

#[derive(Debug)]
enum What {
    Missing(&'static str),
    Wanted(String),
}

impl Wrong {
    fn new(what: What) -> Self {
        Self {
            what,
            path: String::new(),
            at: None,
        }
    }

    fn inside(mut self, part: Part<'_>) -> Self {
        if let Json::Value(value) = part.what {
            self.at.get_or_insert(value);
        }
        let rest = &self.path;
        self.path = match part.at {
            At::Root => return self,
            At::Index(index) => format!("[{index}]{rest}"),
            At::Key(key) if rest.is_empty() || rest.starts_with('[') => format!("{key}{rest}"),
            At::Key(key) => format!("{key}.{rest}"),
        };
        self
    }
}

impl Error for Wrong {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self::new(What::Wanted(message.to_string()))
    }

    fn missing_field(field: &'static str) -> Self {
        Self::new(What::Missing(field))
    }

    fn invalid_type(_: Unexpected, wanted: &dyn Expected) -> Self {
        Self::custom(wanted)
    }

    fn invalid_value(_: Unexpected, wanted: &dyn Expected) -> Self {
        Self::custom(wanted)
    }

    fn invalid_length(_: usize, wanted: &dyn Expected) -> Self {
        Self::custom(wanted)
    }
}

impl std::error::Error for Wrong {}

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gltf::json::texture::Info;
    use gltf::json::{Accessor, buffer::View};
    use serde_json::json;

    fn told<T: DeserializeOwned>(value: &Value) -> (Option<T>, Vec<String>) {
        let mut check = Check::new("f");
        let read = read(value.as_object().unwrap(), "", "", &mut check);
        let problems = check.into_parts().0.into_iter();
        (read, problems.map(|p| p.what).collect())
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

    #[test]
    fn numbers_of_bytes_may_be_large_and_indices_may_not() {
        let huge = 1u64 << 40;
        let view = json!({"buffer": 1.0, "byteLength": huge, "byteOffset": u64::MAX});
        let (view, problems) = told::<View>(&view);
        let view = view.unwrap();
        assert_eq!((view.buffer.value(), view.byte_length.0), (1, huge));
        assert_eq!((view.byte_offset.unwrap().0, problems.len()), (u64::MAX, 0));
        let (view, problems) = told::<View>(&json!({"buffer": huge, "byteLength": 1}));
        assert!(view.is_none());
        assert_eq!(problems, ["'buffer' is not a non-negative whole number"]);
        let info = told::<Info>(&json!({"index": 0, "texCoord": huge})).0;
        assert_eq!(info.unwrap().tex_coord, u32::MAX);
    }

    #[test]
    fn what_is_wrong_inside_is_told_with_its_path() {
        let (read, problems) =
            told::<Accessor>(&json!({"count": 3, "componentType": 5126, "type": "VEC3",
            "normalized": "x", "bufferView": null, "sparse": {"count": 1, "indices": 7}}));
        assert!(read.unwrap().sparse.is_none());
        let wanted = [
            "'bufferView' is not a non-negative whole number",
            "'normalized' is not true or false",
            "'sparse.indices' is not an object",
        ];
        assert_eq!(problems, wanted);
    }

    /// What else a file puts beside the fields does not count.
    #[test]
    fn strangers_cost_nothing() {
        let mut map = json!({"buffer": 0, "byteLength": 1});
        for k in 0..1_000_000 {
            map[format!("x{k}")] = json!(k);
        }
        let start = std::time::Instant::now();
        for _ in 0..1000 {
            assert!(told::<View>(&map).0.is_some());
        }
        assert!(start.elapsed().as_secs_f64() < 1.0);
    }
}
