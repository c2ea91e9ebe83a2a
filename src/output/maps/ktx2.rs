//! KTX 2.0 of a page, or of slices: R16G16B16A16_SFLOAT or R32G32B32A32_SFLOAT, one level, not compressed (KTX File Format Specification 2.0.4,
//! sections 3 and 5).

use super::{Precision, texels};
use crate::PROGRAM;
use crate::lightmap::MapPage;
use exr::prelude::f16;

/// The file begins with this (section 3.1).
const IDENTIFIER: [u8; 12] = [
    0xab, b'K', b'T', b'X', b' ', b'2', b'0', 0xbb, b'\r', b'\n', 0x1a, b'\n',
];
/// Bytes of header and index, and of the one level's entry.
const HEADER: u32 = 80;
const LEVEL: u32 = 24;
/// Numbers of a texel.
const CHANNELS: u32 = 4;

impl Precision {
    /// VK_FORMAT_R16G16B16A16_SFLOAT, VK_FORMAT_R32G32B32A32_SFLOAT.
    fn format(self) -> u32 {
        match self {
            Self::Half => 97,
            Self::Single => 109,
        }
    }

    /// Bytes of a number.
    fn bytes(self) -> u32 {
        match self {
            Self::Half => 2,
            Self::Single => 4,
        }
    }
}

/// The file's bytes; alpha is 1. See the module above for the numbers.
pub fn to_ktx2(page: &MapPage, lux_per_unit: f64, precision: Precision) -> Vec<u8> {
    let size = [page.width, page.height, 0];
    ktx2(size, &texels(page, lux_per_unit), precision)
}

/// A file of texels in rows and slices; a depth of 0 is a flat texture's.
pub(crate) fn ktx2(
    [width, height, depth]: [usize; 3],
    texels: &[[f32; 3]],
    precision: Precision,
) -> Vec<u8> {
    let descriptor = descriptor(precision);
    let texel = CHANNELS * precision.bytes();
    let values = key_value("KTXwriter", PROGRAM);
    let at = HEADER + LEVEL;
    let values_at = at + descriptor.len() as u32;
    // A level begins on a multiple of a texel, which is one of 4 as well.
    let level_at = (values_at + values.len() as u32).next_multiple_of(texel);
    let level = texels.len() as u64 * u64::from(texel);
    let mut out = IDENTIFIER.to_vec();
    // Format, size of a number, width, height, depth, layers, faces, levels, supercompression.
    let header = [
        precision.format(),
        precision.bytes(),
        width as u32,
        height as u32,
        depth as u32,
        0,
        1,
        1,
        0,
    ];
    let index = [at, descriptor.len() as u32, values_at, values.len() as u32];
    out.extend(header.into_iter().chain(index).flat_map(u32::to_le_bytes));
    // No supercompression data; then the level: where, how long, how long unpacked.
    out.extend(
        [0, 0, u64::from(level_at), level, level]
            .into_iter()
            .flat_map(u64::to_le_bytes),
    );
    out.extend(descriptor);
    out.extend(values);
    out.resize(level_at as usize, 0);
    let numbers = texels.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0]);
    match precision {
        Precision::Half => out.extend(numbers.flat_map(|c| f16::from_f32(c).to_le_bytes())),
        Precision::Single => out.extend(numbers.flat_map(f32::to_le_bytes)),
    }
    out
}

/// Basic data format descriptor (Khronos Data Format Specification 1.3, section 5): linear, BT.709 primaries, four signed
/// floats.
fn descriptor(precision: Precision) -> Vec<u8> {
    let samples = [0_u32, 1, 2, 15];
    let bits = 8 * precision.bytes();
    let block = 24 + 16 * CHANNELS;
    // Size; vendor and type 0; version 2 and the block's size; model RGBSDA, primaries BT709, linear; texel block 1 x 1 x 1 x 1; bytes a
    // plane.
    let mut words = vec![
        4 + block,
        0,
        2 | (block << 16),
        1 | (1 << 8) | (1 << 16),
        0,
        CHANNELS * precision.bytes(),
        0,
    ];
    for (k, channel) in (0..).zip(samples) {
        // Offset, length less 1, channel with the flags signed and float; position; -1 and 1 as floats.
        let kind: u32 = channel | 0x80 | 0x40;
        words.extend([
            (bits * k) | ((bits - 1) << 16) | (kind << 24),
            0,
            (-1.0_f32).to_bits(),
            1.0_f32.to_bits(),
        ]);
    }
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// An entry of the key and value data, padded to a multiple of four (section 3.11).
fn key_value(key: &str, value: &str) -> Vec<u8> {
    let mut out = Vec::new();
    let length = (key.len() + value.len() + 2) as u32;
    out.extend(length.to_le_bytes());
    for text in [key, value] {
        out.extend(text.as_bytes());
        out.push(0);
    }
    out.resize(out.len().next_multiple_of(4), 0);
    out
}
