//! Packed geometry: EXT_meshopt_compression (and KHR_meshopt_compression) and KHR_draco_mesh_compression.
//!
//! The claims of a packed stream are compared with its size before memory is given to it, since both codecs can turn
//! a few bytes into millions of vertices.

use gltf::json::accessor::ComponentType as Component;

/// The names under which meshopt's codec goes in glTF.
pub(crate) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
/// Draco's name in glTF.
pub(crate) const DRACO: &str = "KHR_draco_mesh_compression";

/// Is the codec of this extension built in?
pub(crate) fn is_built_in(extension: &str) -> bool {
    (cfg!(feature = "meshopt") && MESHOPT.contains(&extension))
        || (cfg!(feature = "draco") && extension == DRACO)
}

/// What one vertex attribute of a Draco stream unpacks to.
#[derive(Debug, Clone)]
pub(crate) struct Unpacked {
    pub(crate) component: Component,
    /// Components of an element.
    pub(crate) width: usize,
    pub(crate) normalized: bool,
    /// Tightly packed elements.
    pub(crate) bytes: Vec<u8>,
}

/// A Draco stream, unpacked: attributes by semantic, and a triangle list.
#[derive(Debug, Clone)]
pub(crate) struct DracoMesh {
    pub(crate) attributes: Vec<(String, Unpacked)>,
    pub(crate) indices: Vec<u32>,
}

/// The bytes of a buffer view that meshopt packed, or one sentence on why not.
#[cfg(feature = "meshopt")]
pub(crate) fn unpack_meshopt(
    packed: &[u8],
    stride: usize,
    count: usize,
    mode: &str,
    filter: &str,
) -> Result<Vec<u8>, String> {
    meshopt_codec::unpack(packed, stride, count, mode, filter)
}

/// Without the feature there is no decoder.
#[cfg(not(feature = "meshopt"))]
pub(crate) fn unpack_meshopt(
    _packed: &[u8],
    _stride: usize,
    _count: usize,
    _mode: &str,
    _filter: &str,
) -> Result<Vec<u8>, String> {
    Err("is packed, and this build has no meshopt decoder".into())
}

#[cfg(feature = "meshopt")]
mod meshopt_codec {
    /// The codec's limits on a vertex, bytes.
    const MAX_STRIDE: usize = 256;
    /// The most bytes that one packed byte can become: a run of equal vertices takes 2 bits for each of their bytes and
    /// block, and a block holds up to 8 kB in all (codec version 1), so 256 vertices of 32 bytes come from 8 bytes.
    const MAX_RATIO: usize = 1024;

    /// A vertex of `N` bytes, for the decoder, which takes its stride from the type.
    #[derive(Clone)]
    struct Vertex<const N: usize>([u8; N]);

    impl<const N: usize> Default for Vertex<N> {
        fn default() -> Self {
            Self([0; N])
        }
    }

    pub(super) fn unpack(
        packed: &[u8],
        stride: usize,
        count: usize,
        mode: &str,
        filter: &str,
    ) -> Result<Vec<u8>, String> {
        let size = count.checked_mul(stride);
        let believable = packed.len().saturating_mul(MAX_RATIO);
        if size.is_none_or(|size| size > believable) {
            return Err(format!(
                "claims {count} elements of {stride} bytes from {} packed bytes",
                packed.len()
            ));
        }
        if count == 0 {
            return Ok(Vec::new());
        }
        // The decoder asserts what is checked here.
        let mut bytes = match mode {
            "ATTRIBUTES" if stride.is_multiple_of(4) && (4..=MAX_STRIDE).contains(&stride) => {
                vertices(packed, stride, count)?
            }
            "TRIANGLES" if count.is_multiple_of(3) && stride == 2 => {
                shorts(&failed(::meshopt::decode_index_buffer(packed, count))?)
            }
            "TRIANGLES" if count.is_multiple_of(3) && stride == 4 => {
                longs(&failed(::meshopt::decode_index_buffer(packed, count))?)
            }
            "INDICES" if stride == 2 => {
                shorts(&failed(::meshopt::decode_index_sequence(packed, count))?)
            }
            "INDICES" if stride == 4 => {
                longs(&failed(::meshopt::decode_index_sequence(packed, count))?)
            }
            _ => {
                return Err(format!(
                    "has the mode '{}' with {count} elements of {stride} bytes, which the codec does not know",
                    crate::scene::json::short(mode)
                ));
            }
        };
        unfilter(&mut bytes, stride, mode, filter)?;
        Ok(bytes)
    }

    fn failed<T>(decoded: Result<T, ::meshopt::Error>) -> Result<T, String> {
        decoded.map_err(|e| format!("is not a sound meshopt stream ({e})"))
    }

    fn shorts(indices: &[u16]) -> Vec<u8> {
        indices.iter().flat_map(|i| i.to_le_bytes()).collect()
    }

    fn longs(indices: &[u32]) -> Vec<u8> {
        indices.iter().flat_map(|i| i.to_le_bytes()).collect()
    }

    fn vertices(packed: &[u8], stride: usize, count: usize) -> Result<Vec<u8>, String> {
        fn of<const N: usize>(packed: &[u8], count: usize) -> Result<Vec<u8>, String> {
            let decoded = failed(::meshopt::decode_vertex_buffer::<Vertex<N>>(packed, count))?;
            Ok(decoded.iter().flat_map(|vertex| vertex.0).collect())
        }
        macro_rules! by_stride {
            ($($n:literal)*) => {
                match stride {
                    $($n => of::<$n>(packed, count),)*
                    _ => Err(format!("has a byteStride of {stride}")),
                }
            };
        }
        by_stride!(4 8 12 16 20 24 28 32 36 40 44 48 52 56 60 64 68 72 76 80 84 88 92 96 100 104 108 112 116 120 124 128
            132 136 140 144 148 152 156 160 164 168 172 176 180 184 188 192 196 200 204 208 212 216 220 224 228 232 236
            240 244 248 252 256)
    }

    /// Turns filtered attributes into plain ones, in place.
    fn unfilter(
        bytes: &mut Vec<u8>,
        stride: usize,
        mode: &str,
        filter: &str,
    ) -> Result<(), String> {
        match (filter, stride) {
            ("NONE", _) => {}
            _ if mode != "ATTRIBUTES" => return Err(format!("has a filter on {mode}")),
            ("OCTAHEDRAL", 4) => {
                let mut data: Vec<[i8; 4]> = fours(bytes, |[b]: [u8; 1]| i8::from_le_bytes([b]));
                ::meshopt::decode_filter_oct(&mut data);
                *bytes = data
                    .into_iter()
                    .flatten()
                    .flat_map(i8::to_le_bytes)
                    .collect();
            }
            ("OCTAHEDRAL", 8) => {
                let mut data: Vec<[i16; 4]> = fours(bytes, i16::from_le_bytes);
                ::meshopt::decode_filter_oct(&mut data);
                *bytes = data
                    .into_iter()
                    .flatten()
                    .flat_map(i16::to_le_bytes)
                    .collect();
            }
            ("QUATERNION", 8) => {
                let mut data: Vec<[i16; 4]> = fours(bytes, i16::from_le_bytes);
                ::meshopt::decode_filter_quat(&mut data);
                *bytes = data
                    .into_iter()
                    .flatten()
                    .flat_map(i16::to_le_bytes)
                    .collect();
            }
            ("EXPONENTIAL", _) => {
                let words = bytes.chunks_exact(4);
                let mut data: Vec<[u32; 1]> = words
                    .map(|w| [u32::from_le_bytes([w[0], w[1], w[2], w[3]])])
                    .collect();
                ::meshopt::decode_filter_exp(&mut data);
                *bytes = data
                    .into_iter()
                    .flatten()
                    .flat_map(u32::to_le_bytes)
                    .collect();
            }
            ("COLOR", 4) => {
                let mut data: Vec<[u8; 4]> = fours(bytes, |[b]: [u8; 1]| b);
                ::meshopt::decode_filter_color(&mut data);
                *bytes = data.into_iter().flatten().collect();
            }
            ("COLOR", 8) => {
                let mut data: Vec<[u16; 4]> = fours(bytes, u16::from_le_bytes);
                ::meshopt::decode_filter_color(&mut data);
                *bytes = data
                    .into_iter()
                    .flatten()
                    .flat_map(u16::to_le_bytes)
                    .collect();
            }
            _ => {
                return Err(format!(
                    "has the filter '{}' on elements of {stride} bytes, which the codec does not know",
                    crate::scene::json::short(filter)
                ));
            }
        }
        Ok(())
    }

    /// Bytes as vectors of four components of `N` bytes.
    fn fours<T: Copy, const N: usize>(
        bytes: &[u8],
        component: impl Fn([u8; N]) -> T,
    ) -> Vec<[T; 4]> {
        let each = bytes.chunks_exact(4 * N);
        each.map(|four| {
            std::array::from_fn(|i| component(std::array::from_fn(|k| four[i * N + k])))
        })
        .collect()
    }
}

/// Unpacks a primitive's Draco stream; `extension` is the primitive's extension object, `counts` what its accessors
/// declare: semantic, count, normalized. No more than `most` vertices or triangles are made.
#[cfg(feature = "draco")]
pub(crate) fn unpack_draco(
    packed: &[u8],
    extension: &serde_json::Value,
    counts: &[(String, usize, bool)],
    most: usize,
) -> Result<DracoMesh, String> {
    // The decoder is plain Rust without unsafe code and owns all it works on, so a panic in it can leave nothing of ours
    // half-changed; caught here, a malformed stream that trips it is an input problem like any other.
    std::panic::catch_unwind(|| draco_codec::unpack(packed, extension, counts, most))
        .unwrap_or_else(|_| Err("is not a sound Draco stream (the decoder gave up)".into()))
}

/// Without the feature there is no decoder.
#[cfg(not(feature = "draco"))]
pub(crate) fn unpack_draco(
    _packed: &[u8],
    _extension: &serde_json::Value,
    _counts: &[(String, usize, bool)],
    _most: usize,
) -> Result<DracoMesh, String> {
    Err("is packed, and this build has no Draco decoder".into())
}

#[cfg(feature = "draco")]
mod draco_codec {
    use super::{Component, DracoMesh, Unpacked};
    use crate::scene::components;
    use draco_gltf::{
        ComponentType, DecodeLimits, DracoPrimitiveContract, DracoPrimitiveExtension, JsonValue,
    };

    /// Elements that one packed byte may become, and what even the smallest stream may make.
    const MAX_RATIO: usize = 1024;
    const FREE: usize = 65_536;
    /// Bytes that a vertex with all attributes may take.
    const MAX_VERTEX: u64 = 256;

    pub(super) fn unpack(
        packed: &[u8],
        extension: &serde_json::Value,
        counts: &[(String, usize, bool)],
        most: usize,
    ) -> Result<DracoMesh, String> {
        let text = extension.to_string();
        let bad = |e: draco_gltf::Error| format!("is not a sound Draco stream ({e})");
        let json = JsonValue::parse(text.as_bytes()).map_err(|e| format!("is malformed ({e})"))?;
        let extension = DracoPrimitiveExtension::from_json(&json).map_err(bad)?;
        let believable = packed.len().saturating_mul(MAX_RATIO).saturating_add(FREE);
        let elements = believable.min(most) as u64;
        let limits = DecodeLimits::default()
            .with_max_points(elements)
            .with_max_faces(elements)
            .with_max_decoded_bytes(elements.saturating_mul(MAX_VERTEX));
        let mut contract = DracoPrimitiveContract::new().with_limits(limits);
        for (semantic, count, normalized) in counts {
            contract = contract.with_attribute(semantic.clone(), *count as u64, *normalized);
        }
        let geometry = extension.decode(packed, &contract).map_err(bad)?;
        let mut attributes = Vec::new();
        for attribute in geometry.attributes() {
            let component = component(attribute.component_type())
                .ok_or("unpacks to a component type that glTF does not have")?;
            let unpacked = Unpacked {
                component,
                width: usize::from(attribute.components()),
                normalized: attribute.normalized(),
                bytes: attribute.bytes().to_vec(),
            };
            attributes.push((attribute.semantic().to_owned(), unpacked));
        }
        let indices = geometry.indices().ok_or("unpacks to no triangles")?;
        let kind = component(indices.component_type()).ok_or("has indices of an unknown type")?;
        let each = indices.bytes().chunks_exact(kind.size());
        let indices: Option<Vec<u32>> = each.map(|bytes| components::index(kind, bytes)).collect();
        Ok(DracoMesh {
            attributes,
            indices: indices.ok_or("has indices that are not unsigned")?,
        })
    }

    fn component(kind: ComponentType) -> Option<Component> {
        match kind {
            ComponentType::I8 => Some(Component::I8),
            ComponentType::U8 => Some(Component::U8),
            ComponentType::I16 => Some(Component::I16),
            ComponentType::U16 => Some(Component::U16),
            ComponentType::U32 => Some(Component::U32),
            ComponentType::F32 => Some(Component::F32),
            _ => None,
        }
    }
}
