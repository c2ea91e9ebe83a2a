//! Reading accessors of the input document: as numbers (for interpolation) and as bytes (to carry them over).
//!
//! Every offset is checked: what does not fit its buffer reads as none. Normalised integers become
//! c / 255, max(c / 127, -1) and so on (glTF 2.0, section 3.11).

use super::json::{extension, index, list};
use crate::scene::Source;
use crate::scene::buffers::{Buffers, Span, Views};
use crate::scene::check::Check;
use serde_json::Value;

/// Vertex data as numbers: `components` values for each element.
pub(super) struct AttributeTable {
    pub(super) components: usize,
    /// glTF component type that the numbers were read from.
    pub(super) component: u64,
    pub(super) values: Vec<f64>,
}

impl AttributeTable {
    /// One element.
    pub(super) fn row(&self, element: usize) -> &[f64] {
        &self.values[element * self.components..][..self.components]
    }
}

/// How the elements of an accessor are laid out.
#[derive(Clone, Copy)]
pub(super) struct ElementLayout {
    /// glTF component type: 5120 i8, 5121 u8, 5122 i16, 5123 u16, 5125 u32, 5126 f32.
    pub(super) component: u64,
    components: usize,
    /// Bytes of an element, with the padding of matrix columns.
    pub(super) size: usize,
    normalized: bool,
}

impl ElementLayout {
    pub(super) fn of(accessor: &Value) -> Option<Self> {
        let component = accessor.get("componentType")?.as_u64()?;
        let width = component_width(component)?;
        let (columns, rows) = match accessor.get("type")?.as_str()? {
            "SCALAR" => (1, 1),
            "VEC2" => (1, 2),
            "VEC3" => (1, 3),
            "VEC4" => (1, 4),
            "MAT2" => (2, 2),
            "MAT3" => (3, 3),
            "MAT4" => (4, 4),
            _ => return None,
        };
        // Columns of a matrix begin on multiples of four (section 3.6.2.4).
        let column = if columns > 1 {
            (rows * width).next_multiple_of(4)
        } else {
            rows * width
        };
        let normalized = accessor
            .get("normalized")
            .and_then(Value::as_bool)
            .unwrap_or(false);
        Some(Self {
            component,
            components: columns * rows,
            size: columns * column,
            normalized,
        })
    }
}

fn component_width(component: u64) -> Option<usize> {
    match component {
        5120 | 5121 => Some(1),
        5122 | 5123 => Some(2),
        5125 | 5126 => Some(4),
        _ => None,
    }
}

/// The input's data.
pub(super) struct Data<'a> {
    source: &'a Source,
    views: Views<'a>,
    /// What is wrong was reported when the room was read; here it only makes a read come out as none.
    check: Check,
}

impl<'a> Data<'a> {
    /// `buffers` are the source's own.
    pub(super) fn new(source: &'a Source, buffers: &'a Buffers) -> Self {
        Self {
            source,
            views: Views::new(&source.json, buffers),
            check: Check::new(""),
        }
    }

    /// A buffer view, unpacked.
    pub(super) fn view(&mut self, view: usize) -> Option<Span> {
        self.views.view(view, "", &mut self.check)
    }

    /// The bytes of `count` elements of `size` bytes without gaps; none if they do not lie inside their view.
    pub(super) fn packed(
        &mut self,
        view: usize,
        offset: usize,
        size: usize,
        count: usize,
    ) -> Option<Vec<u8>> {
        let view = self.view(view)?;
        let stride = view.stride.unwrap_or(size);
        let bytes = view.bytes().get(offset..)?;
        if count == 0 {
            return Some(Vec::new());
        }
        let needed = (count - 1).checked_mul(stride)?.checked_add(size)?;
        if stride < size || needed > bytes.len() {
            return None;
        }
        Some(
            bytes
                .chunks(stride)
                .take(count)
                .flat_map(|element| &element[..size])
                .copied()
                .collect(),
        )
    }

    /// Reads an accessor of exactly `count` scalars or vectors. None: another count, a matrix, or out of bounds.
    pub(super) fn read(&mut self, accessor: usize, count: usize) -> Option<AttributeTable> {
        let accessor = list(&self.source.json, "accessors").get(accessor)?;
        let layout = ElementLayout::of(accessor)?;
        if index(accessor, "count")? != count || layout.components > 4 {
            return None;
        }
        let mut values = match index(accessor, "bufferView") {
            Some(view) => {
                let offset = index(accessor, "byteOffset").unwrap_or(0);
                numbers(&self.packed(view, offset, layout.size, count)?, layout)
            }
            None => vec![0.0; count.checked_mul(layout.components)?],
        };
        if let Some(sparse) = accessor.get("sparse") {
            let (places, replaced) = self.sparse(sparse, layout)?;
            for (place, element) in places.iter().zip(replaced.chunks(layout.components)) {
                let start = place.checked_mul(layout.components)?;
                values
                    .get_mut(start..start.checked_add(layout.components)?)?
                    .copy_from_slice(element);
            }
        }
        Some(AttributeTable {
            components: layout.components,
            component: layout.component,
            values,
        })
    }

    /// (element numbers, their values) of a sparse accessor (section 3.6.2.3).
    fn sparse(&mut self, sparse: &Value, layout: ElementLayout) -> Option<(Vec<usize>, Vec<f64>)> {
        let count = index(sparse, "count")?;
        let mut part = |part: &Value, size: usize| {
            self.packed(
                index(part, "bufferView")?,
                index(part, "byteOffset").unwrap_or(0),
                size,
                count,
            )
        };
        let places = sparse.get("indices")?;
        let component = places.get("componentType")?.as_u64()?;
        let scalar = ElementLayout {
            component,
            components: 1,
            size: component_width(component)?,
            normalized: false,
        };
        let places = numbers(&part(places, scalar.size)?, scalar);
        let values = numbers(&part(sparse.get("values")?, layout.size)?, layout);
        // Index types are unsigned integers, so the numbers are whole and not negative.
        Some((places.into_iter().map(|p| p as usize).collect(), values))
    }
}

fn numbers(bytes: &[u8], layout: ElementLayout) -> Vec<f64> {
    let scale = |value: f64, full: f64| {
        if layout.normalized {
            (value / full).max(-1.0)
        } else {
            value
        }
    };
    let two = |c: &[u8]| [c[0], c[1]];
    let four = |c: &[u8]| [c[0], c[1], c[2], c[3]];
    match layout.component {
        5120 => bytes
            .iter()
            .map(|&c| scale(f64::from(c as i8), 127.0))
            .collect(),
        5121 => bytes.iter().map(|&c| scale(f64::from(c), 255.0)).collect(),
        5122 => bytes
            .chunks_exact(2)
            .map(|c| scale(f64::from(i16::from_le_bytes(two(c))), 32767.0))
            .collect(),
        5123 => bytes
            .chunks_exact(2)
            .map(|c| scale(f64::from(u16::from_le_bytes(two(c))), 65535.0))
            .collect(),
        5125 => bytes
            .chunks_exact(4)
            .map(|c| f64::from(u32::from_le_bytes(four(c))))
            .collect(),
        _ => bytes
            .chunks_exact(4)
            .map(|c| f64::from(f32::from_le_bytes(four(c))))
            .collect(),
    }
}

/// Is this attribute's data not in the buffers but inside a Draco stream?
pub(super) fn is_draco(primitive: &Value) -> bool {
    extension(primitive, "KHR_draco_mesh_compression").is_some()
}

/// Is an attribute stored in a type that only KHR_mesh_quantization allows?
pub(super) fn is_quantized(source: &Source, name: &str, accessor: usize) -> bool {
    let Some(layout) = list(&source.json, "accessors")
        .get(accessor)
        .and_then(ElementLayout::of)
    else {
        return false;
    };
    match name {
        "POSITION" | "NORMAL" | "TANGENT" => layout.component != 5126,
        // Core allows floats and normalised unsigned integers.
        _ if name.starts_with("TEXCOORD_") => {
            layout.component != 5126
                && !(layout.normalized && matches!(layout.component, 5121 | 5123))
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read(source: &Source, accessor: usize, count: usize) -> Option<AttributeTable> {
        let buffers = Buffers::sound(source.buffers.clone());
        Data::new(source, &buffers).read(accessor, count)
    }

    fn source(json: Value, bytes: &[u8]) -> Source {
        Source {
            path: "room.gltf".into(),
            json,
            buffers: vec![bytes.into()],
        }
    }

    #[test]
    fn normalised_bytes_with_a_stride() {
        let json = json!({
            "bufferViews": [{ "buffer": 0, "byteOffset": 1, "byteLength": 7, "byteStride": 4 }],
            "accessors": [{ "bufferView": 0, "componentType": 5120, "normalized": true, "count": 2, "type": "VEC3" }],
        });
        let source = source(json, &[99, 127, 0, 129, 99, 128, 1, 0]);
        let table = read(&source, 0, 2).unwrap();
        assert_eq!(table.row(0), [1.0, 0.0, -1.0]);
        assert_eq!(table.row(1), [-1.0, 1.0 / 127.0, 0.0]);
        assert!(read(&source, 0, 3).is_none());
    }

    #[test]
    fn sparse_elements_replace_zeros() {
        let json = json!({
            "bufferViews": [{ "buffer": 0, "byteLength": 1 }, { "buffer": 0, "byteOffset": 4, "byteLength": 4 }],
            "accessors": [{ "componentType": 5126, "count": 3, "type": "SCALAR", "sparse": { "count": 1,
                "indices": { "bufferView": 0, "componentType": 5121 }, "values": { "bufferView": 1 } } }],
        });
        let mut bytes = vec![2, 0, 0, 0];
        bytes.extend(1.5f32.to_le_bytes());
        assert_eq!(
            read(&source(json, &bytes), 0, 3).unwrap().values,
            [0.0, 0.0, 1.5]
        );
    }

    #[test]
    fn views_beyond_the_buffer_read_as_none() {
        let json = json!({
            "bufferViews": [{ "buffer": 0, "byteLength": 16 }, { "buffer": 0, "byteLength": 8 }],
            "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR" },
                { "bufferView": 1, "componentType": 5126, "count": 3, "type": "SCALAR" }],
        });
        let source = source(json, &[0; 8]);
        assert!(read(&source, 0, 2).is_none());
        assert!(read(&source, 1, 3).is_none());
    }
}
