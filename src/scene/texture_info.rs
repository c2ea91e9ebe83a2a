//! Texture references of materials: which image, which coordinates, sampler, KHR_texture_transform.
//!
//! Only images that some material uses get a slot (an index in `Scene::images`), and images from the same bytes share
//! one, so that a file cannot ask for one image to be decoded a thousand times.

use crate::scene::check::Check;
use crate::scene::json::{self, Item, double};
use crate::scene::{Texture, Wrap};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::texture::{self, Info, Sampler, WrappingMode};
use gltf::json::validation::Checked::{Invalid, Valid};
use serde_json::Value;
use std::collections::BTreeMap;

/// The images in use.
#[derive(Debug, Default)]
pub(crate) struct Slots {
    /// For each slot the image in the document; none: a texture without an image.
    pub(crate) images: Vec<Option<usize>>,
    by_image: BTreeMap<Option<usize>, usize>,
    by_source: BTreeMap<String, usize>,
}

impl Slots {
    /// The texture at a key of an object, if there is one; none also where it refers to nothing (which is reported).
    pub(crate) fn texture(
        &mut self,
        json: &Value,
        of: &Item<'_>,
        key: &str,
        check: &mut Check,
    ) -> Option<Texture> {
        let item = of.child(key, check)?;
        let info = item.read::<Info>(check)?;
        let index = info.index.value();
        let found = json::referred(json, "textures", "texture", index, &item.place, check)?;
        let texture = found.read::<texture::Texture>(check)?;
        let source = texture.source.value();
        let image = if found.has("source") {
            // What gltf has in its place where it is wrong, which was told.
            let source = Some(source).filter(|&image| image != u32::MAX as usize)?;
            json::referred(json, "images", "image", source, &found.place, check)?;
            Some(source)
        } else {
            let named = found.extension_names();
            let named = json::short(&named[..named.len().min(3)].join(", "));
            let why = match named.is_empty() {
                true => "no image".to_owned(),
                false => format!("an image only by {named}, which is not read"),
            };
            check.warn(format!("{}: has {why}; grey stands in", found.place));
            None
        };
        let moved = item.extension::<TextureTransform>("KHR_texture_transform", check);
        let moved = moved.unwrap_or_default();
        Some(Texture {
            image: self.slot(json, image),
            texcoord: moved.tex_coord.unwrap_or(info.tex_coord) as usize,
            transform: matrix(&moved),
            wrap: wrap(json, &texture, &found.place, check),
        })
    }

    fn slot(&mut self, json: &Value, image: Option<usize>) -> usize {
        if let Some(&slot) = self.by_image.get(&image) {
            return slot;
        }
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
        self.by_image.insert(image, slot);
        slot
    }
}

/// Offset * rotation * scale. A positive rotation turns the coordinates counter-clockwise as seen on the image, whose v
/// runs down, so sin stands in the first row with a plus.
fn matrix(moved: &TextureTransform) -> [[f32; 3]; 2] {
    let [x, y] = moved.offset.0.map(double);
    let [sx, sy] = moved.scale.0.map(double);
    let (sin, cos) = double(moved.rotation.0).sin_cos();
    let rows = [[cos * sx, sin * sy, x], [-sin * sx, cos * sy, y]];
    rows.map(|row| row.map(|value| value as f32))
}

fn wrap(json: &Value, texture: &texture::Texture, place: &str, check: &mut Check) -> [Wrap; 2] {
    let found = texture
        .sampler
        .and_then(|index| json::referred(json, "samplers", "sampler", index.value(), place, check));
    let read = found.and_then(|item| Some((item.read::<Sampler>(check)?, item)));
    let Some((sampler, item)) = read else {
        return [Wrap::Repeat; 2];
    };
    [("wrapS", sampler.wrap_s), ("wrapT", sampler.wrap_t)].map(|(key, mode)| match mode {
        Valid(WrappingMode::Repeat) => Wrap::Repeat,
        Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Invalid => {
            let (place, other) = (&item.place, item.said(key));
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
        let material = json!({"emissiveTexture": info});
        let item = Item {
            map: material.as_object().unwrap(),
            place: "material 0".into(),
        };
        let texture = slots.texture(json, &item, "emissiveTexture", &mut check);
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
                let material = json!({"t": {"index": index}});
                let map = material.as_object().unwrap();
                let place = String::new();
                let item = Item { map, place };
                let texture = slots.texture(&json, &item, "t", &mut check);
                texture.unwrap().image
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
