//! OpenEXR of a page: channels R, G, B as floats of 16 or 32 bits, ZIP-compressed.

use super::super::exr::encoded;
use super::{Precision, texels};
use crate::error::Result;
use crate::lightmap::MapPage;
use exr::prelude::*;

/// The file's bytes; see the module above for the numbers.
///
/// # Errors
/// An internal fault of the encoder.
pub fn to_exr(page: &MapPage, lux_per_unit: f64, precision: Precision) -> Result<Vec<u8>> {
    let texels = texels(page, lux_per_unit);
    let channels = ["R", "G", "B"]
        .into_iter()
        .enumerate()
        .map(|(c, name)| {
            let plane = texels.iter().map(|t| t[c]);
            let samples = match precision {
                Precision::Half => FlatSamples::F16(plane.map(f16::from_f32).collect()),
                Precision::Single => FlatSamples::F32(plane.collect()),
            };
            AnyChannel::new(name, samples)
        })
        .collect();
    encoded((page.width, page.height), channels)
}
