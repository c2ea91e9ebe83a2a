//! Images of the output: all inside the file, so that it shows wherever it is put.

use super::{Writer, buffer::Use, list};
use serde_json::{Value, json};
use std::path::{Component, Path, PathBuf};

/// Largest image file that is taken in, bytes.
const LIMIT: u64 = 1 << 30;

/// The sRGB bytes nearest to the linear 0.5 that a scene takes for an image it cannot read.
const NEUTRAL: [u8; 4] = [188, 188, 188, 255];

impl Writer<'_> {
    /// Takes external images into the buffer. What cannot be read becomes one grey pixel, with a warning.
    pub(super) fn images(&mut self) {
        let mut images = self
            .json
            .get("images")
            .and_then(Value::as_array)
            .cloned()
            .unwrap_or_default();
        for (i, image) in images.iter_mut().enumerate() {
            let Some(uri) = image.get("uri").and_then(Value::as_str).map(str::to_owned) else {
                continue;
            };
            if uri.starts_with("data:") {
                continue;
            }
            let bytes = external(&self.scene.source.path, &uri).unwrap_or_else(|| {
                self.warnings.push(format!(
                    "image {i} '{uri}' cannot be read; the baked room has a grey pixel for it"
                ));
                png(&[NEUTRAL], 1, 1)
            });
            image["mimeType"] = json!(mime(&bytes));
            image["bufferView"] = json!(self.bin.view(&bytes, Use::Data));
            if let Some(image) = image.as_object_mut() {
                image.shift_remove("uri");
            }
        }
        super::put_list(&mut self.json, "images", images);
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
        let old = super::index(&texture, "index")
            .and_then(|t| list(&self.scene.source.json, "textures").get(t));
        let mut new_texture = json!({});
        if let Some(sampler) = old.and_then(|t| t.get("sampler")) {
            new_texture["sampler"] = sampler.clone();
        }
        new_texture["source"] = json!(self.append("images", new_image));
        texture["index"] = json!(self.append("textures", new_texture));
        texture
    }

    fn append(&mut self, key: &str, value: Value) -> usize {
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

/// The bytes of an image file below the room's folder; none for anything else.
fn external(room: &Path, uri: &str) -> Option<Vec<u8>> {
    let relative = PathBuf::from(percent_decoded(uri)?);
    if uri.contains(':')
        || !relative
            .components()
            .all(|c| matches!(c, Component::Normal(_) | Component::CurDir))
    {
        return None;
    }
    let folder = room.parent()?;
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    }
    .canonicalize()
    .ok()?;
    let path = folder.join(relative).canonicalize().ok()?;
    let facts = std::fs::metadata(&path).ok()?;
    let fit = path.starts_with(&folder) && facts.is_file() && facts.len() <= LIMIT;
    if fit { std::fs::read(path).ok() } else { None }
}

fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.bytes();
    while let Some(byte) = rest.next() {
        let digit = |b: Option<u8>| b.and_then(|b| char::from(b).to_digit(16));
        match byte {
            b'%' => bytes.push((digit(rest.next())? * 16 + digit(rest.next())?) as u8),
            _ => bytes.push(byte),
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_below_the_room_are_read() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("outside.png"), b"x").unwrap();
        std::fs::create_dir_all(folder.path().join("room/my textures")).unwrap();
        std::fs::write(folder.path().join("room/my textures/a.png"), b"a").unwrap();
        let room = folder.path().join("room/room.gltf");
        assert_eq!(external(&room, "my%20textures/a.png").unwrap(), b"a");
        assert!(external(&room, "../outside.png").is_none());
        assert!(external(&room, "%2e%2e/outside.png").is_none());
        assert!(external(&room, "/etc/hostname").is_none());
        assert!(external(&room, "file:///etc/hostname").is_none());
        assert!(external(&room, "my textures").is_none());
    }
}
