//! The one binary buffer of the output, with its views and accessors (glTF 2.0, sections 3.6.1 and 3.6.2).

use serde_json::{Value, json};

/// ARRAY_BUFFER.
const VERTICES: u32 = 34962;
/// ELEMENT_ARRAY_BUFFER.
const INDICES: u32 = 34963;
/// FLOAT.
const FLOAT: u32 = 5126;
/// UNSIGNED_SHORT.
const U16: u32 = 5123;
/// UNSIGNED_INT.
const U32: u32 = 5125;

/// What a view is bound to on the graphics side.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    /// Vertex attributes with this many bytes from element to element.
    Vertices { stride: usize },
    /// Triangle indices.
    Indices,
    /// Anything else: images, key frames.
    Data,
}

/// Bytes, and the JSON that describes them. Every view begins on a multiple of four.
#[derive(Default)]
pub(super) struct Bin {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Bin {
    /// Adds a view; returns its index.
    pub(super) fn view(&mut self, bytes: &[u8], purpose: Use) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view =
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        match purpose {
            Use::Vertices { stride } => {
                view["byteStride"] = json!(stride);
                view["target"] = json!(VERTICES);
            }
            Use::Indices => view["target"] = json!(INDICES),
            Use::Data => {}
        }
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Adds an accessor as it is; returns its index.
    pub(super) fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds vertex data of `N` floats each.
    pub(super) fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let kind = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            _ => "VEC4",
        };
        let bytes: Vec<u8> = values
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let view = self.view(&bytes, Use::Vertices { stride: 4 * N });
        self.accessor(json!({ "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind }))
    }

    /// Adds positions, with the bounds that glTF asks for.
    pub(super) fn positions(&mut self, values: &[[f32; 3]]) -> usize {
        let accessor = self.floats(values);
        let bound = |pick: fn(f32, f32) -> f32, start: f32| -> Value {
            let bound = values
                .iter()
                .fold([start; 3], |b, p| std::array::from_fn(|i| pick(b[i], p[i])));
            json!(bound)
        };
        self.accessors[accessor]["min"] = bound(f32::min, f32::INFINITY);
        self.accessors[accessor]["max"] = bound(f32::max, f32::NEG_INFINITY);
        accessor
    }

    /// Adds triangles over `vertices` vertices, as u16 where they fit. The largest index of a type is reserved by glTF.
    pub(super) fn triangles(&mut self, triangles: &[[u32; 3]], vertices: usize) -> usize {
        let indices = triangles.iter().flatten();
        let (bytes, kind): (Vec<u8>, u32) = if vertices <= usize::from(u16::MAX) {
            (
                indices.flat_map(|&i| (i as u16).to_le_bytes()).collect(),
                U16,
            )
        } else {
            (indices.flat_map(|&i| i.to_le_bytes()).collect(), U32)
        };
        let view = self.view(&bytes, Use::Indices);
        self.accessor(
            json!({ "bufferView": view, "componentType": kind, "count": 3 * triangles.len(), "type": "SCALAR" }),
        )
    }

    /// (bytes, views, accessors).
    pub(super) fn finish(&mut self) -> (Vec<u8>, Vec<Value>, Vec<Value>) {
        (
            std::mem::take(&mut self.bytes),
            std::mem::take(&mut self.views),
            std::mem::take(&mut self.accessors),
        )
    }
}
