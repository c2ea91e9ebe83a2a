//! Builds small glTF files in memory.

pub(crate) mod built;
pub(crate) mod daylit;
pub(crate) mod desk;
pub(crate) mod every_effect;
pub(crate) mod garbled;
pub(crate) mod traced;

use haarlight::scene::document::Document;
use haarlight::scene::geometry::Geometry;
use serde_json::{Value, json};
use std::path::Path;

/// Component types of the standard.
pub(crate) const U8: u32 = 5121;
pub(crate) const U16: u32 = 5123;
pub(crate) const F32: u32 = 5126;

/// A document in the making: its JSON, and the bytes of its only buffer.
#[derive(Clone)]
pub(crate) struct Room {
    pub(crate) json: Value,
    pub(crate) bin: Vec<u8>,
}

impl Room {
    /// A node without a mesh.
    pub(crate) fn empty() -> Self {
        let json = json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{}],
            "buffers": [{"byteLength": 0}], "bufferViews": [], "accessors": []});
        Self {
            json,
            bin: Vec::new(),
        }
    }

    /// The triangle (0,0,0), (1,0,0), (0,1,0) with indices, at a node called "n" of a mesh called "m".
    pub(crate) fn triangle() -> Self {
        let mut room = Self::empty();
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let position = room.vectors(&corners);
        let indices = room.accessor(&[0, 1, 2], U8, "SCALAR", 3);
        room.json["nodes"] = json!([{"name": "n", "mesh": 0}]);
        room.json["meshes"] = json!([{"name": "m", "primitives": [{"attributes": {"POSITION": position}, "indices": indices}]}]);
        room
    }

    /// Appends bytes as a buffer view; returns its index.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.bin.len());
        push(&mut self.json["bufferViews"], view)
    }

    /// Appends an accessor with its bytes; returns its index.
    pub(crate) fn accessor(
        &mut self,
        bytes: &[u8],
        component: u32,
        kind: &str,
        count: usize,
    ) -> usize {
        let view = self.view(bytes);
        let accessor =
            json!({"bufferView": view, "componentType": component, "type": kind, "count": count});
        push(&mut self.json["accessors"], accessor)
    }

    /// Appends an accessor of float vectors; returns its index.
    pub(crate) fn vectors<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values
            .iter()
            .flatten()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        self.accessor(&bytes, F32, kind, values.len())
    }

    /// The first primitive.
    pub(crate) fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// As a GLB file.
    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut text = self.json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        container(&[(*b"JSON", &text), (*b"BIN\0", &bin)])
    }

    /// Reads the room as far as it goes.
    pub(crate) fn load(&self) -> haarlight::Result<(Document, Geometry)> {
        load(&self.glb())
    }
}

/// A GLB of these chunks.
pub(crate) fn container(chunks: &[([u8; 4], &[u8])]) -> Vec<u8> {
    let size = |bytes: usize| u32::try_from(bytes).unwrap().to_le_bytes();
    let mut body = Vec::new();
    for (kind, bytes) in chunks {
        body.extend(size(bytes.len()));
        body.extend(kind);
        body.extend(*bytes);
    }
    [
        b"glTF".as_slice(),
        &2u32.to_le_bytes(),
        &size(12 + body.len()),
        &body,
    ]
    .concat()
}

/// Opens the bytes of a file called `room.glb` in the corpus folder and reads all of it.
pub(crate) fn load(bytes: &[u8]) -> haarlight::Result<(Document, Geometry)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    let document = Document::from_bytes(&folder.join("room.glb"), bytes)?;
    let geometry = document.load_geometry().check()?;
    Ok((document, geometry))
}

/// Appends to a JSON list (made if need be); returns the index.
pub(crate) fn push(list: &mut Value, value: Value) -> usize {
    if list.is_null() {
        *list = json!([]);
    }
    let list = list.as_array_mut().unwrap();
    list.push(value);
    list.len() - 1
}

/// A PNG of these RGBA pixels.
pub(crate) fn png(width: u32, height: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
    let image = image::RgbaImage::from_vec(width, height, pixels.concat()).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}
