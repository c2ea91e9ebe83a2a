//! The one binary buffer of the output, with its views and accessors (glTF 2.0, sections 3.6.1 and 3.6.2).

use super::packing::{self, Mode, Packing, QuantizationGrid};
use crate::error::Result;
use serde_json::{Value, json};

/// ARRAY_BUFFER.
const VERTICES: u32 = 34962;
/// ELEMENT_ARRAY_BUFFER.
const INDICES: u32 = 34963;
/// FLOAT.
const FLOAT: u32 = 5126;
/// BYTE.
const I8: u32 = 5120;
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
pub(super) struct Bin {
    packing: Packing,
    bytes: Vec<u8>,
    views: Vec<Value>,
    /// How each view can be packed, if it can.
    modes: Vec<Option<Mode>>,
    accessors: Vec<Value>,
    quantized: bool,
}

/// Bytes, buffers, views and accessors.
type Finished = (Vec<u8>, Vec<Value>, Vec<Value>, Vec<Value>);

impl Bin {
    pub(super) fn new(packing: Packing) -> Self {
        Self {
            packing,
            bytes: Vec::new(),
            views: Vec::new(),
            modes: Vec::new(),
            accessors: Vec::new(),
            quantized: false,
        }
    }

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
        self.modes.push(match purpose {
            Use::Vertices { stride } if !bytes.is_empty() && [4, 8, 12, 16].contains(&stride) => {
                Some(Mode::Attributes { stride })
            }
            _ => None,
        });
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
        let bytes: Vec<u8> = values
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let view = self.view(&bytes, Use::Vertices { stride: 4 * N });
        self.accessor(json!({ "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind(N) }))
    }

    /// Adds shares of 1 (colours, texture coordinates), as normalised u16 if numbers are packed and all lie in [0, 1].
    pub(super) fn shares<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let inside = values.iter().flatten().all(|v| (0.0..=1.0).contains(v));
        if self.packing == Packing::Floats || !inside {
            return self.floats(values);
        }
        let accessor = self.short(values, |v| (v * 65535.0).round() as u16);
        self.accessors[accessor]["normalized"] = json!(true);
        accessor
    }

    /// Adds unit vectors, as normalised i8 if numbers are packed.
    pub(super) fn units<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        if self.packing == Packing::Floats {
            return self.floats(values);
        }
        self.quantized = true;
        let mut bytes = Vec::with_capacity(4 * values.len());
        for value in values {
            // In [-127, 127]: components of unit vectors.
            bytes.extend(value.map(|v| ((v * 127.0).round() as i8).to_le_bytes()[0]));
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        let view = self.view(&bytes, Use::Vertices { stride: 4 });
        self.accessor(json!({ "bufferView": view, "componentType": I8, "normalized": true, "count": values.len(), "type": kind(N) }))
    }

    /// Adds positions as whole steps of a grid.
    pub(super) fn on_grid(&mut self, grid: &QuantizationGrid, values: &[[f32; 3]]) -> usize {
        self.quantized = true;
        let steps: Vec<[f32; 3]> = values.iter().map(|p| grid.steps(*p)).collect();
        let accessor = self.short(&steps, |v| v as u16);
        self.bound(accessor, &steps);
        accessor
    }

    /// Adds numbers as u16.
    fn short<const N: usize>(&mut self, values: &[[f32; N]], to: impl Fn(f32) -> u16) -> usize {
        let stride = (2 * N).next_multiple_of(4);
        let mut bytes = Vec::with_capacity(stride * values.len());
        for value in values {
            bytes.extend(value.iter().flat_map(|v| to(*v).to_le_bytes()));
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        let view = self.view(&bytes, Use::Vertices { stride });
        self.accessor(json!({ "bufferView": view, "componentType": U16, "count": values.len(), "type": kind(N) }))
    }

    /// Adds positions, with the bounds that glTF asks for.
    pub(super) fn positions(&mut self, values: &[[f32; 3]]) -> usize {
        let accessor = self.floats(values);
        self.bound(accessor, values);
        accessor
    }

    fn bound(&mut self, accessor: usize, values: &[[f32; 3]]) {
        let bound = |pick: fn(f32, f32) -> f32, start: f32| -> Value {
            let bound = values
                .iter()
                .fold([start; 3], |b, p| std::array::from_fn(|i| pick(b[i], p[i])));
            json!(bound)
        };
        self.accessors[accessor]["min"] = bound(f32::min, f32::INFINITY);
        self.accessors[accessor]["max"] = bound(f32::max, f32::NEG_INFINITY);
    }

    /// Adds triangles over `vertices` vertices, as u16 where they fit. The largest index of a type is reserved by glTF.
    pub(super) fn triangles(&mut self, triangles: &[[u32; 3]], vertices: usize) -> usize {
        let mut flat: Vec<u32> = triangles.iter().flatten().copied().collect();
        if self.packing == Packing::Meshopt {
            flat = packing::in_order(flat, vertices);
        }
        let indices = flat.iter();
        let (bytes, kind): (Vec<u8>, u32) = if vertices <= usize::from(u16::MAX) {
            (
                indices.flat_map(|&i| (i as u16).to_le_bytes()).collect(),
                U16,
            )
        } else {
            (indices.flat_map(|&i| i.to_le_bytes()).collect(), U32)
        };
        let view = self.view(&bytes, Use::Indices);
        self.modes[view] = (!flat.is_empty()).then_some(Mode::Triangles {
            size: if kind == U16 { 2 } else { 4 },
            vertices,
        });
        self.accessor(
            json!({ "bufferView": view, "componentType": kind, "count": 3 * triangles.len(), "type": "SCALAR" }),
        )
    }

    /// Extensions that readers must know.
    pub(super) fn extensions(&self) -> Vec<&'static str> {
        let packed = self.packing == Packing::Meshopt;
        let meshopt = packed.then_some(packing::MESHOPT);
        let quantized = self.quantized.then_some("KHR_mesh_quantization");
        quantized.into_iter().chain(meshopt).collect()
    }

    /// What goes into the file.
    ///
    /// # Errors
    /// Packing fails (internal fault), or is not built in.
    pub(super) fn finish(&mut self) -> Result<Finished> {
        let (mut bytes, mut views) = (
            std::mem::take(&mut self.bytes),
            std::mem::take(&mut self.views),
        );
        let mut buffers = Vec::new();
        if self.packing == Packing::Meshopt && !bytes.is_empty() {
            let whole = bytes.len();
            bytes = packing::packed(&bytes, &mut views, &self.modes)?;
            buffers.push(json!({ "byteLength": bytes.len() }));
            // Where readers put what they unpack.
            buffers.push(json!({ "byteLength": whole, "extensions": { packing::MESHOPT: { "fallback": true } } }));
        } else if !bytes.is_empty() {
            buffers.push(json!({ "byteLength": bytes.len() }));
        }
        Ok((bytes, buffers, views, std::mem::take(&mut self.accessors)))
    }
}

/// glTF's name for elements of so many components.
fn kind(components: usize) -> &'static str {
    match components {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        _ => "VEC4",
    }
}
