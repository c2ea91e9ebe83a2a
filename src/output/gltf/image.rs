//! Images of the output: all inside the file, so that it shows wherever it is put.

use super::buffer::Use;
use super::json::list;
use super::writer::Writer;
use serde_json::{Value, json};

/// The sRGB bytes nearest to the linear 0.5 that a scene takes for an image it cannot read.
const NEUTRAL: [u8; 4] = [188, 188, 188, 255];

impl Writer<'_> {
    /// Takes images from other files and data URIs into the buffer. What cannot be read becomes one grey pixel, with a warning.
    pub(super) fn images(&mut self) {
        let mut images = self
            .json
            .get("images")
            .and_then(Value::as_array)
            .cloned()
            .unwrap_or_default();
        for (i, image) in images.iter_mut().enumerate() {
            if image.get("uri").is_none() {
                continue;
            }
            let bytes = self.scene.source.image_bytes(i).unwrap_or_else(|problem| {
                self.warnings
                    .push(format!("{problem}; the baked room has a grey pixel for it"));
                png(&[NEUTRAL], 1, 1)
            });
            image["mimeType"] = json!(mime(&bytes));
            image["bufferView"] = json!(self.bin.view(&bytes, Use::Data));
            if let Some(image) = image.as_object_mut() {
                image.shift_remove("uri");
            }
        }
        super::json::put_list(&mut self.json, "images", images);
    }

    /// A texture reference like `texture`, to a white image with the alpha of a scene image.
    pub(super) fn white_with_alpha(&mut self, image: usize, mut texture: Value) -> Value {
        let Some(image) = self.scene.images.get(image) else {
            return texture;
        };
        let alpha = |p: &[f32; 4]| (p[3].clamp(0.0, 1.0) * 255.0).round() as u8;
        let pixels: Vec<[u8; 4]> = image
            .pixels
            .iter()
            .map(|p| [255, 255, 255, alpha(p)])
            .collect();
        let bytes = png(&pixels, image.width, image.height);
        let view = self.bin.view(&bytes, Use::Data);
        let name = format!("{} (alpha)", image.name);
        let new_image = json!({ "name": name, "bufferView": view, "mimeType": "image/png" });
        let old = super::json::index(&texture, "index")
            .and_then(|t| list(&self.scene.source.json, "textures").get(t));
        let mut new_texture = json!({});
        if let Some(sampler) = old.and_then(|t| t.get("sampler")) {
            new_texture["sampler"] = sampler.clone();
        }
        new_texture["source"] = json!(self.append("images", new_image));
        texture["index"] = json!(self.append("textures", new_texture));
        texture
    }

    pub(super) fn append(&mut self, key: &str, value: Value) -> usize {
        let Some(list) = self
            .json
            .entry(key)
            .or_insert_with(|| json!([]))
            .as_array_mut()
        else {
            return 0;
        };
        list.push(value);
        list.len() - 1
    }
}

fn png(pixels: &[[u8; 4]], width: usize, height: usize) -> Vec<u8> {
    use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
    let mut bytes = Vec::new();
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let encoder = PngEncoder::new(&mut bytes);
    // Writing into memory fails only for sizes that no decoded image has.
    let _ = encoder.write_image(
        pixels.as_flattened(),
        size(width),
        size(height),
        ExtendedColorType::Rgba8,
    );
    bytes
}

/// Image type by its first bytes.
fn mime(bytes: &[u8]) -> &'static str {
    match bytes {
        [0xff, 0xd8, 0xff, ..] => "image/jpeg",
        [0xab, b'K', b'T', b'X', ..] => "image/ktx2",
        [
            b'R',
            b'I',
            b'F',
            b'F',
            _,
            _,
            _,
            _,
            b'W',
            b'E',
            b'B',
            b'P',
            ..,
        ] => "image/webp",
        _ => "image/png",
    }
}
