//! Reads accessors (glTF 2.0, sections 3.6.2 and 5.1): every component type, strides, sparse values, normalised
//! integers (also as KHR_mesh_quantization allows them).
//!
//! Every bound is checked against the bytes that are there before anything is allocated.

use crate::scene::buffers::{Buffers, Span, Views, size};
use crate::scene::check::Check;
use crate::scene::components::{self, to_vectors};
use crate::scene::json;
use gltf::json::Index;
use gltf::json::accessor::sparse::Sparse;
use gltf::json::accessor::{
    Accessor, ComponentType, GenericComponentType, IndexComponentType, Type,
};
use gltf::json::buffer::View;
use gltf::json::validation::{Checked::Valid, USize64};
use serde_json::Value;

/// Elements that an accessor without bytes (all zeros) may have even in a small file.
const FREE_ZEROS: usize = 65_536;
const AGAIN: &str = "export the file again";

/// What an accessor holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct AccessorLayout {
    pub(crate) component: ComponentType,
    /// Components of an element: 1 to 4.
    pub(crate) width: usize,
    /// Elements.
    pub(crate) count: usize,
    pub(crate) normalized: bool,
}

/// An accessor that a document has.
#[derive(Debug)]
pub(crate) struct DocumentAccessor {
    accessor: Accessor,
    /// Does it name no view at all?
    pub(crate) is_bare: bool,
    place: String,
}

impl AccessorLayout {
    fn element(self) -> usize {
        self.component.size() * self.width
    }
}

/// Reads the accessors of one document.
#[derive(Debug)]
pub(crate) struct Accessors<'a> {
    json: &'a Value,
    /// Bytes of all buffers together.
    total: usize,
    /// Where the bytes come from.
    pub(crate) views: Views<'a>,
}

impl<'a> Accessors<'a> {
    pub(crate) fn new(json: &'a Value, buffers: &'a Buffers) -> Self {
        Self {
            json,
            total: buffers.total(),
            views: Views::new(json, buffers),
        }
    }

    /// Accessor `index`, used at `place`, and what it holds.
    pub(crate) fn layout(
        &self,
        index: usize,
        place: &str,
        check: &mut Check,
    ) -> Option<(DocumentAccessor, AccessorLayout)> {
        let mut item = json::referred(self.json, "accessors", "accessor", index, place, check)?;
        item.place = format!("{place}, {}", item.place);
        let accessor = item.read::<Accessor>(check)?;
        let Valid(GenericComponentType(component)) = accessor.component_type else {
            let what = "has no componentType of the standard";
            check.problem(&item.place, what, AGAIN);
            return None;
        };
        let width = match accessor.type_ {
            Valid(Type::Scalar) => 1,
            Valid(Type::Vec2) => 2,
            Valid(Type::Vec3) => 3,
            Valid(Type::Vec4) => 4,
            _ => {
                let what = format!("has the type '{}'", item.said("type"));
                check.problem(&item.place, what, AGAIN);
                return None;
            }
        };
        let layout = AccessorLayout {
            component,
            width,
            count: size(accessor.count),
            normalized: accessor.normalized,
        };
        // A view that is named wrongly is no absent one.
        let is_bare = !item.has("bufferView");
        let place = item.place;
        Some((
            DocumentAccessor {
                accessor,
                is_bare,
                place,
            },
            layout,
        ))
    }

    /// Vectors of `N` components; another number of them than `count` is a problem, found before they are read.
    pub(crate) fn vectors<const N: usize>(
        &mut self,
        index: usize,
        count: Option<usize>,
        place: &str,
        check: &mut Check,
    ) -> Option<Vec<[f32; N]>> {
        let (found, layout) = self.layout(index, place, check)?;
        if layout.width != N {
            let what = format!("has {} components an element, not {N}", layout.width);
            check.problem(&found.place, what, AGAIN);
            return None;
        }
        if let Some(count) = count.filter(|&count| count != layout.count) {
            let what = format!("has {} elements for {count} vertices", layout.count);
            check.problem(&found.place, what, AGAIN);
            return None;
        }
        let bytes = self.elements(&found, layout, check)?;
        Some(to_vectors(&bytes, layout.component, layout.normalized))
    }

    /// Vertex indices.
    pub(crate) fn indices(
        &mut self,
        index: usize,
        place: &str,
        check: &mut Check,
    ) -> Option<Vec<u32>> {
        let (found, layout) = self.layout(index, place, check)?;
        let unsigned = matches!(
            layout.component,
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32
        );
        if layout.width != 1 || !unsigned || layout.normalized {
            let what = "holds indices, but not as unsigned whole scalars";
            check.problem(&found.place, what, AGAIN);
            return None;
        }
        let bytes = self.elements(&found, layout, check)?;
        let each = bytes.chunks_exact(layout.component.size());
        each.map(|bytes| components::index(layout.component, bytes))
            .collect()
    }

    /// All elements, tightly packed, with the sparse ones put in.
    fn elements(
        &mut self,
        found: &DocumentAccessor,
        layout: AccessorLayout,
        check: &mut Check,
    ) -> Option<Vec<u8>> {
        let (accessor, at) = (&found.accessor, &found.place);
        let mut bytes = match accessor.buffer_view {
            Some(view) => {
                let span = self.views.view(view.value(), at, check)?;
                let offset = size(accessor.byte_offset.unwrap_or_default());
                packed(&span, offset, layout, true)
                    .map_err(|what| check.problem(at, what, AGAIN))
                    .ok()?
            }
            None if !found.is_bare => return None,
            None => {
                if layout.count > self.total.max(FREE_ZEROS) {
                    let what = format!("claims {} elements, but has no bytes", layout.count);
                    check.problem(at, what, AGAIN);
                    return None;
                }
                // No overflow: the count is at most that of bytes in memory, or small.
                vec![0; layout.count.checked_mul(layout.element())?]
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let at = format!("{at}, sparse");
            self.put_sparse(sparse, &at, layout, &mut bytes, check)?;
        }
        Some(bytes)
    }

    /// Replaces the elements that `sparse` lists.
    fn put_sparse(
        &mut self,
        sparse: &Sparse,
        at: &str,
        layout: AccessorLayout,
        bytes: &mut [u8],
        check: &mut Check,
    ) -> Option<()> {
        let (count, indices, values) = (size(sparse.count), &sparse.indices, &sparse.values);
        if count > layout.count {
            let what = format!("lists {count} of {} elements", layout.count);
            check.problem(at, what, AGAIN);
            return None;
        }
        let Valid(IndexComponentType(component)) = indices.component_type else {
            let what = "has indices that are not unsigned whole numbers";
            check.problem(at, what, AGAIN);
            return None;
        };
        let index_layout = AccessorLayout {
            component,
            width: 1,
            count,
            normalized: false,
        };
        let value_layout = AccessorLayout { count, ..layout };
        let mut part = |view: Index<View>, offset: USize64, layout: AccessorLayout| {
            let span = self.views.view(view.value(), at, check)?;
            packed(&span, size(offset), layout, false)
                .map_err(|what| check.problem(at, what, AGAIN))
                .ok()
        };
        let indices = part(indices.buffer_view, indices.byte_offset, index_layout)?;
        let values = part(values.buffer_view, values.byte_offset, value_layout)?;
        let indices = indices.chunks_exact(component.size());
        for (index, value) in indices.zip(values.chunks_exact(layout.element())) {
            let target = components::index(component, index)
                .and_then(|i| usize::try_from(i).ok()?.checked_mul(layout.element()))
                .and_then(|start| bytes.get_mut(start..start.checked_add(layout.element())?));
            let Some(target) = target else {
                let what = "has an index beyond the accessor's count, or of a wrong type";
                check.problem(at, what, AGAIN);
                return None;
            };
            target.copy_from_slice(value);
        }
        Some(())
    }
}

/// Elements of a span, tightly packed; `strided`: the span's stride holds (it does not for sparse parts).
fn packed(
    span: &Span,
    offset: usize,
    layout: AccessorLayout,
    strided: bool,
) -> Result<Vec<u8>, String> {
    let element = layout.element();
    let stride = span.stride.filter(|_| strided).unwrap_or(element);
    if stride < element {
        return Err(format!(
            "has a byteStride of {stride}, but its elements take {element} bytes"
        ));
    }
    if layout.count == 0 {
        return Ok(Vec::new());
    }
    let bytes = span.bytes();
    let last = (layout.count - 1).checked_mul(stride);
    let end = last.and_then(|last| last.checked_add(offset)?.checked_add(element));
    if end.is_none_or(|end| end > bytes.len()) {
        return Err(format!(
            "needs {} elements of {element} bytes every {stride} bytes from byte {offset}, but its bufferView has {} bytes",
            layout.count,
            bytes.len()
        ));
    }
    // The last element ends inside `bytes`, so the product is at most their length.
    let mut out = Vec::with_capacity(layout.count * element);
    for chunk in bytes[offset..].chunks(stride).take(layout.count) {
        out.extend_from_slice(&chunk[..element]);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Reads accessor 0 of `json` over one buffer as vectors; the problems' text if there are any.
    fn vectors<const N: usize>(json: &Value, buffer: &[u8]) -> Result<Vec<[f32; N]>, String> {
        read(json, buffer, |a, check| {
            a.vectors::<N>(0, None, "here", check)
        })
    }

    fn indices(json: &Value, buffer: &[u8]) -> Result<Vec<u32>, String> {
        read(json, buffer, |a, check| a.indices(0, "here", check))
    }

    fn read<T>(
        json: &Value,
        buffer: &[u8],
        with: impl Fn(&mut Accessors<'_>, &mut Check) -> Option<T>,
    ) -> Result<T, String> {
        let buffers = Buffers::sound(vec![buffer.into()]);
        let mut check = Check::new("f");
        let got = with(&mut Accessors::new(json, &buffers), &mut check);
        let (problems, _) = check.into_parts();
        assert_eq!(got.is_some(), problems.is_empty(), "{problems:?}");
        got.ok_or_else(|| problems[0].to_string())
    }

    fn one(view: Value, accessor: Value) -> Value {
        json!({"bufferViews": [view], "accessors": [accessor]})
    }

    #[test]
    fn every_component_type_and_its_normalised_form() {
        let bytes = [0x80, 0x7F, 0xFF, 0xFF, 0x00, 0x00, 0x80, 0x3F];
        let get = |code: u32, normalized: bool, count: usize| {
            let json = one(
                json!({"buffer": 0, "byteLength": 8}),
                json!({"bufferView": 0, "componentType": code, "type": "SCALAR", "count": count, "normalized": normalized}),
            );
            let got = vectors::<1>(&json, &bytes).unwrap();
            got.into_iter().map(|[x]| x).collect::<Vec<f32>>()
        };
        assert_eq!(get(5120, false, 2), [-128.0, 127.0]);
        assert_eq!(get(5120, true, 2), [-1.0, 1.0]);
        assert_eq!(get(5121, true, 3), [128.0 / 255.0, 127.0 / 255.0, 1.0]);
        assert_eq!(get(5122, false, 2), [32640.0, -1.0]);
        assert_eq!(get(5122, true, 2), [32640.0 / 32767.0, -1.0 / 32767.0]);
        assert_eq!(get(5123, true, 2), [32640.0 / 65535.0, 1.0]);
        assert_eq!(get(5125, false, 1), [4_294_934_400.0]);
        assert_eq!(get(5126, false, 2)[1], 1.0);
    }

    #[test]
    fn strides_offsets_and_sparse_values() {
        let bytes: Vec<u8> = (0..32).collect();
        let view = json!({"buffer": 0, "byteOffset": 2, "byteLength": 30, "byteStride": 4});
        let json = one(
            view,
            json!({"bufferView": 0, "byteOffset": 1, "componentType": 5121, "type": "VEC2", "count": 3}),
        );
        assert_eq!(
            vectors::<2>(&json, &bytes).unwrap(),
            [[3.0, 4.0], [7.0, 8.0], [11.0, 12.0]]
        );
        let json = json!({
            "bufferViews": [{"buffer": 0, "byteLength": 32}],
            "accessors": [{"componentType": 5121, "type": "VEC2", "count": 4, "sparse": {"count": 2,
                "indices": {"bufferView": 0, "byteOffset": 1, "componentType": 5121},
                "values": {"bufferView": 0, "byteOffset": 10}}}]
        });
        assert_eq!(
            vectors::<2>(&json, &bytes).unwrap(),
            [[0.0, 0.0], [10.0, 11.0], [12.0, 13.0], [0.0, 0.0]]
        );
    }

    #[test]
    fn the_last_element_may_touch_the_end_but_not_cross_it() {
        let json = |count: u64| {
            one(
                json!({"buffer": 0, "byteLength": 20, "byteStride": 8}),
                json!({"bufferView": 0, "componentType": 5126, "type": "SCALAR", "count": count}),
            )
        };
        assert_eq!(vectors::<1>(&json(3), &[0; 20]).unwrap().len(), 3);
        assert!(vectors::<1>(&json(0), &[0; 20]).unwrap().is_empty());
        for count in [4, 1 << 40, u64::MAX / 8, u64::MAX] {
            let text = vectors::<1>(&json(count), &[0; 20]).unwrap_err();
            assert!(text.contains("here, accessor 0"), "{text}");
        }
    }

    #[test]
    fn nothing_is_believed() {
        let good = json!({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 1});
        let bytes = [0; 12];
        let with = |view: Value, key: &str, value: Value| {
            let mut accessor = good.clone();
            accessor[key] = value;
            vectors::<3>(&one(view, accessor), &bytes).unwrap_err()
        };
        let view = json!({"buffer": 0, "byteLength": 12});
        assert!(with(json!({"buffer": 0, "byteLength": 13}), "x", json!(0)).contains("has 12"));
        assert!(with(json!({"buffer": 1, "byteLength": 1}), "x", json!(0)).contains("buffer 1"));
        let huge = json!({"buffer": 0, "byteOffset": u64::MAX, "byteLength": 12});
        assert!(with(huge, "x", json!(0)).contains("reaches"));
        let narrow = json!({"buffer": 0, "byteLength": 12, "byteStride": 4});
        assert!(with(narrow, "x", json!(0)).contains("byteStride of 4"));
        let zero = json!({"buffer": 0, "byteLength": 12, "byteStride": 0});
        assert!(with(zero, "x", json!(0)).contains("byteStride of 0"));
        assert!(with(view.clone(), "bufferView", json!(9)).contains("bufferView 9"));
        assert!(with(view.clone(), "componentType", json!(5124)).contains("componentType"));
        assert!(with(view.clone(), "type", json!("MAT4")).contains("MAT4"));
        assert!(with(view.clone(), "type", json!("VEC2")).contains("2 components"));
        assert!(with(view.clone(), "byteOffset", json!(1)).contains("needs"));
        assert!(with(view, "count", json!(1.5)).contains("whole number"));
        let empty =
            json!({"accessors": [{"componentType": 5126, "type": "VEC3", "count": 1u64 << 40}]});
        assert!(vectors::<3>(&empty, &[]).unwrap_err().contains("no bytes"));
    }

    #[test]
    fn indices_are_unsigned_whole_numbers() {
        let bytes = [1, 0, 2, 0];
        let json = |code: u32| {
            one(
                json!({"buffer": 0, "byteLength": 4}),
                json!({"bufferView": 0, "componentType": code, "type": "SCALAR", "count": 1}),
            )
        };
        assert_eq!(indices(&json(5121), &bytes).unwrap(), [1]);
        assert_eq!(indices(&json(5123), &bytes).unwrap(), [1]);
        assert_eq!(indices(&json(5125), &bytes).unwrap(), [0x2_0001]);
        for code in [5120, 5122, 5126] {
            assert!(
                indices(&json(code), &bytes)
                    .unwrap_err()
                    .contains("unsigned")
            );
        }
    }

    #[test]
    fn sparse_bounds() {
        let json = |count: u64, from: u64| {
            json!({
                "bufferViews": [{"buffer": 0, "byteLength": 8}],
                "accessors": [{"componentType": 5121, "type": "SCALAR", "count": 2, "sparse": {"count": count,
                    "indices": {"bufferView": 0, "byteOffset": from, "componentType": 5121},
                    "values": {"bufferView": 0}}}]
            })
        };
        let bytes = [0, 1, 2, 3, 0, 0, 0, 0];
        assert!(vectors::<1>(&json(2, 0), &bytes).is_ok());
        assert!(
            vectors::<1>(&json(2, 1), &bytes)
                .unwrap_err()
                .contains("beyond")
        );
        assert!(
            vectors::<1>(&json(3, 0), &bytes)
                .unwrap_err()
                .contains("3 of 2")
        );
        assert!(
            vectors::<1>(&json(2, 7), &bytes)
                .unwrap_err()
                .contains("needs")
        );
    }
}
