//! Smaller files: numbers of 8 and 16 bits (KHR_mesh_quantization), packed with meshopt's codec (EXT_meshopt_compression).
//!
//! Positions become whole steps of a grid of 65,536 steps along the longest side of each mesh (.15 mm in a room of 10 m);
//! a node of its own undoes the grid. Directions get 8 bits a component, light and texture coordinates in [0, 1] 16.

use crate::error::{Error, Result};
use glam::Vec3;
use serde_json::{Value, json};
use std::fmt;
use std::str::FromStr;

/// The extension's name.
pub(super) const MESHOPT: &str = "EXT_meshopt_compression";
/// Steps of a grid.
const STEPS: f32 = 65535.0;

/// How numbers are stored. Written `none`, `quantize` or `meshopt`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Packing {
    /// As floats, which every reader knows.
    #[default]
    Floats,
    /// As whole numbers of 8 and 16 bits.
    Quantized,
    /// These, packed with meshopt's codec.
    Meshopt,
}

impl FromStr for Packing {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "none" => Ok(Self::Floats),
            "quantize" => Ok(Self::Quantized),
            "meshopt" if cfg!(feature = "meshopt") => Ok(Self::Meshopt),
            "meshopt" => Err("this program was built without the feature meshopt".into()),
            _ => Err("none, quantize or meshopt is wanted".into()),
        }
    }
}

impl fmt::Display for Packing {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Floats => "none",
            Self::Quantized => "quantize",
            Self::Meshopt => "meshopt",
        })
    }
}

/// Whole steps that stand for positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct QuantizationGrid {
    low: Vec3,
    /// Of one step; alike in all directions, so that normals stay what they are.
    size: f32,
}

impl QuantizationGrid {
    /// The grid around some positions; none if there are none, or all lie in one place.
    pub(super) fn around(positions: &[[f32; 3]]) -> Option<Self> {
        let places = || positions.iter().map(|p| Vec3::from(*p));
        let low = places().fold(Vec3::INFINITY, Vec3::min);
        let high = places().fold(Vec3::NEG_INFINITY, Vec3::max);
        let size = (high - low).max_element() / STEPS;
        (size > 0.0 && size.is_finite()).then_some(Self { low, size })
    }

    /// A position in steps, 0 to 65535.
    pub(super) fn steps(&self, position: [f32; 3]) -> [f32; 3] {
        let steps = (Vec3::from(position) - self.low) / self.size;
        steps.to_array().map(|s| s.round().clamp(0.0, STEPS))
    }

    /// The node that undoes the grid.
    pub(super) fn node(&self) -> Value {
        json!({ "translation": self.low.to_array(), "scale": [self.size, self.size, self.size] })
    }
}

/// How a view can be packed.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(
    not(feature = "meshopt"),
    expect(dead_code, reason = "only the codec asks for all of it")
)]
pub(super) enum Mode {
    Attributes { stride: usize },
    Triangles { size: usize, vertices: usize },
}

/// Triangles in an order that packs well.
#[cfg(feature = "meshopt")]
pub(super) fn in_order(indices: Vec<u32>, vertices: usize) -> Vec<u32> {
    meshopt::optimize_vertex_cache(&indices, vertices)
}

/// Without the feature nothing asks for it.
#[cfg(not(feature = "meshopt"))]
pub(super) fn in_order(indices: Vec<u32>, _vertices: usize) -> Vec<u32> {
    indices
}

/// The views of `bytes` one after the other, packed where they can be; `views` then say so.
pub(super) fn packed(bytes: &[u8], views: &mut [Value], modes: &[Option<Mode>]) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    for (view, mode) in views.iter_mut().zip(modes) {
        let number = |key: &str| super::json::index(view, key).unwrap_or(0);
        let (start, length) = (number("byteOffset"), number("byteLength"));
        let plain = bytes.get(start..start + length).unwrap_or_default();
        let part = match mode {
            Some(mode) => encoded(plain, *mode)?,
            None => plain.to_vec(),
        };
        out.resize(out.len().next_multiple_of(4), 0);
        match mode {
            None => view["byteOffset"] = json!(out.len()),
            Some(mode) => {
                let (name, stride) = match mode {
                    Mode::Attributes { stride } => ("ATTRIBUTES", *stride),
                    Mode::Triangles { size, .. } => ("TRIANGLES", *size),
                };
                view["buffer"] = json!(1);
                view["extensions"] = json!({ MESHOPT: {
                    "buffer": 0, "byteOffset": out.len(), "byteLength": part.len(),
                    "byteStride": stride, "count": length / stride, "mode": name,
                } });
            }
        }
        out.extend(part);
    }
    Ok(out)
}

#[cfg(feature = "meshopt")]
fn encoded(plain: &[u8], mode: Mode) -> Result<Vec<u8>> {
    // Version 0 of the vertex format: the extension knows no other.
    fn vertices<const N: usize>(plain: &[u8]) -> meshopt::Result<Vec<u8>> {
        let (elements, _) = plain.as_chunks::<N>();
        meshopt::encoding::encode_vertex_buffer_level(elements, 0, Some(0))
    }
    let done = match mode {
        Mode::Attributes { stride: 4 } => vertices::<4>(plain),
        Mode::Attributes { stride: 8 } => vertices::<8>(plain),
        Mode::Attributes { stride: 12 } => vertices::<12>(plain),
        Mode::Attributes { stride: 16 } => vertices::<16>(plain),
        Mode::Attributes { stride } => {
            return Err(Error::Internal(format!("meshopt: a stride of {stride}")));
        }
        Mode::Triangles { size, vertices } => {
            let index = |bytes: &[u8]| bytes.iter().rev().fold(0, |i, b| i << 8 | u32::from(*b));
            let indices: Vec<u32> = plain.chunks(size).map(index).collect();
            meshopt::encoding::encode_index_buffer(&indices, vertices)
        }
    };
    done.map_err(|problem| Error::Internal(format!("meshopt: {problem}")))
}

/// Without the feature there is no encoder.
#[cfg(not(feature = "meshopt"))]
fn encoded(_plain: &[u8], _mode: Mode) -> Result<Vec<u8>> {
    Err(Error::Internal("meshopt is not built in".into()))
}
