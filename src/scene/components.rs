//! Components of accessors, byte by byte. A normalised integer c means c / max, for signed types max(c / max, -1) (glTF 2.0,
//! section 3.6.2.2).

use gltf::json::accessor::ComponentType;

/// One little-endian component; `bytes` has its size.
fn value(component: ComponentType, bytes: &[u8], normalized: bool) -> f32 {
    let scaled = |value: f32, max: f32| {
        if normalized {
            (value / max).max(-1.0)
        } else {
            value
        }
    };
    match (component, bytes) {
        (ComponentType::I8, &[a]) => scaled(f32::from(i8::from_le_bytes([a])), 127.0),
        (ComponentType::U8, &[a]) => scaled(f32::from(a), 255.0),
        (ComponentType::I16, &[a, b]) => scaled(f32::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U16, &[a, b]) => scaled(f32::from(u16::from_le_bytes([a, b])), 65535.0),
        (ComponentType::U32, &[a, b, c, d]) => {
            let value = f64::from(u32::from_le_bytes([a, b, c, d]));
            let max = if normalized { f64::from(u32::MAX) } else { 1.0 };
            (value / max) as f32
        }
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        // Callers cut the bytes by the size.
        _ => f32::NAN,
    }
}

/// One little-endian index; none for types that are no indices.
pub(crate) fn index(component: ComponentType, bytes: &[u8]) -> Option<u32> {
    match (component, bytes) {
        (ComponentType::U8, &[a]) => Some(u32::from(a)),
        (ComponentType::U16, &[a, b]) => Some(u32::from(u16::from_le_bytes([a, b]))),
        (ComponentType::U32, &[a, b, c, d]) => Some(u32::from_le_bytes([a, b, c, d])),
        _ => None,
    }
}

/// Elements of tightly packed bytes as vectors of `N` components.
pub(crate) fn to_vectors<const N: usize>(
    bytes: &[u8],
    component: ComponentType,
    normalized: bool,
) -> Vec<[f32; N]> {
    let size = component.size();
    let each = bytes.chunks_exact(size * N);
    each.map(|element| {
        let mut parts = element.chunks_exact(size);
        std::array::from_fn(|_| {
            parts
                .next()
                .map_or(0.0, |p| value(component, p, normalized))
        })
    })
    .collect()
}
