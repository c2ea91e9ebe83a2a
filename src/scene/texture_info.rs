//! Texture references of materials: which image, which coordinates, sampler, KHR_texture_transform.
//!
//! Only images that some material uses get a slot (an index in `Scene::images`), and images from the same bytes share
//! one, so that a file cannot ask for one image to be decoded a thousand times.

use crate::scene::check::Check;
use crate::scene::json::{self, Item};
use crate::scene::{Texture, Wrap};
use serde_json::Value;
use std::collections::BTreeMap;

/// The images in use.
#[derive(Debug, Default)]
pub(crate) struct Slots {
    /// For each slot the image in the document; none: a texture without an image.
    pub(crate) images: Vec<Option<usize>>,
    by_source: BTreeMap<String, usize>,
}

impl Slots {
    /// Reads a `textureInfo`; none only where it refers to nothing (which is reported).
    pub(crate) fn texture(
        &mut self,
        json: &Value,
        info: &Item<'_>,
        check: &mut Check,
    ) -> Option<Texture> {
        let Some(index) = info.index("index", check) else {
            check.problem(
                &info.place,
                "has a texture without an index",
                "export again",
            );
            return None;
        };
        let texture = json::referred(json, "textures", "texture", index, &info.place, check)?;
        let image = match texture.index("source", check) {
            Some(image) => {
                json::referred(json, "images", "image", image, &texture.place, check)?;
                Some(image)
            }
            None => {
                let named = texture.extension_names().join(", ");
                let why = if named.is_empty() {
                    "no image".to_owned()
                } else {
                    format!("an image only by {named}, which is not read")
                };
                check.warn(format!("{}: has {why}; grey stands in", texture.place));
                None
            }
        };
        let mut texcoord = info.index("texCoord", check).unwrap_or(0);
        let mut transform = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        if let Some(moved) = info.extension("KHR_texture_transform", check) {
            transform = matrix(&moved, check);
            texcoord = moved.index("texCoord", check).unwrap_or(texcoord);
        }
        Some(Texture {
            image: self.slot(json, image),
            texcoord,
            transform,
            wrap: wrap(json, &texture, check),
        })
    }

    fn slot(&mut self, json: &Value, image: Option<usize>) -> usize {
        let source = match image {
            None => String::new(),
            Some(index) => {
                let image = &json["images"][index];
                match (image.get("uri"), image.get("bufferView")) {
                    (Some(Value::String(uri)), _) => format!("uri {uri}"),
                    (_, Some(view)) => format!("view {view}"),
                    _ => format!("image {index}"),
                }
            }
        };
        let next = self.images.len();
        let slot = *self.by_source.entry(source).or_insert(next);
        if slot == next {
            self.images.push(image);
        }
        slot
    }
}

/// Offset * rotation * scale. A positive rotation turns the coordinates counter-clockwise as seen on the image, whose v
/// runs down, so sin stands in the first row with a plus.
fn matrix(moved: &Item<'_>, check: &mut Check) -> [[f32; 3]; 2] {
    let [x, y] = moved.numbers::<2>("offset", check).unwrap_or([0.0; 2]);
    let [sx, sy] = moved.numbers::<2>("scale", check).unwrap_or([1.0; 2]);
    let (sin, cos) = moved.number("rotation", check).unwrap_or(0.0).sin_cos();
    let rows = [[cos * sx, sin * sy, x], [-sin * sx, cos * sy, y]];
    rows.map(|row| row.map(|value| value as f32))
}

fn wrap(json: &Value, texture: &Item<'_>, check: &mut Check) -> [Wrap; 2] {
    let Some(index) = texture.index("sampler", check) else {
        return [Wrap::Repeat; 2];
    };
    let sampler = json::referred(json, "samplers", "sampler", index, &texture.place, check);
    let Some(sampler) = sampler else {
        return [Wrap::Repeat; 2];
    };
    ["wrapS", "wrapT"].map(|key| match sampler.index(key, check) {
        None | Some(10497) => Wrap::Repeat,
        Some(33648) => Wrap::Mirror,
        Some(33071) => Wrap::Clamp,
        Some(other) => {
            let place = &sampler.place;
            check.warn(format!(
                "{place}: {key} {other} is unknown, taken as repeating"
            ));
            Wrap::Repeat
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read(json: &Value, info: Value) -> (Option<Texture>, Slots, Check) {
        let (mut slots, mut check) = (Slots::default(), Check::new("f"));
        let item = Item {
            map: info.as_object().unwrap(),
            place: "material 0".into(),
        };
        let texture = slots.texture(json, &item, &mut check);
        (texture, slots, check)
    }

    #[test]
    fn the_example_of_the_standard_uses_the_lower_left_quarter_turned() {
        let json = json!({"textures": [{"source": 0}], "images": [{"uri": "a.png"}]});
        let (texture, _, _) = read(
            &json,
            json!({"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": {
                "offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5], "texCoord": 2}}}),
        );
        let texture = texture.unwrap();
        assert_eq!(texture.texcoord, 2);
        let at = |u: f32, v: f32| {
            let [x, y] = texture.transform.map(|[a, b, c]| a * u + b * v + c);
            [x, y].map(|x| (x * 100.0).round() / 100.0)
        };
        // v runs down, so the lower left quarter is u in [0, 1/2], v in [1/2, 1].
        assert_eq!([at(0.0, 0.0), at(1.0, 0.0)], [[0.0, 1.0], [0.0, 0.5]]);
        assert_eq!([at(0.0, 1.0), at(1.0, 1.0)], [[0.5, 1.0], [0.5, 0.5]]);
    }

    #[test]
    fn images_of_the_same_bytes_share_a_slot() {
        let json = json!({
            "samplers": [{"wrapS": 33071, "wrapT": 33648}],
            "textures": [{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2}, {"extensions": {"EXT_texture_webp": {}}}],
            "images": [{"bufferView": 4}, {"bufferView": 4}, {"uri": "b.png"}]
        });
        let (mut slots, mut check) = (Slots::default(), Check::new("f"));
        let used: Vec<usize> = (0..4)
            .map(|index| {
                let info = json!({"index": index});
                let map = info.as_object().unwrap();
                let item = Item {
                    map,
                    place: String::new(),
                };
                slots.texture(&json, &item, &mut check).unwrap().image
            })
            .collect();
        assert_eq!(used, [0, 0, 1, 2]);
        assert_eq!(slots.images, [Some(0), Some(2), None]);
        assert!(check.into_parts().1[0].contains("EXT_texture_webp"));
        let (texture, _, _) = read(&json, json!({"index": 0}));
        assert_eq!(texture.unwrap().wrap, [Wrap::Clamp, Wrap::Mirror]);
    }

    #[test]
    fn references_to_nothing_are_problems() {
        let json =
            json!({"textures": [{"source": 3}, {"source": 0, "sampler": 9}], "images": [{}]});
        for info in [
            json!({"index": 5}),
            json!({"index": 0}),
            json!({}),
            json!({"index": "x"}),
        ] {
            let (texture, _, check) = read(&json, info);
            assert!(texture.is_none() && check.has_problems());
        }
        assert!(read(&json, json!({"index": 1})).2.has_problems());
    }
}
