//! OpenEXR of a page: channels R, G, B as half floats, ZIP-compressed.

use super::super::exr::encoded;
use super::texels;
use crate::error::Result;
use crate::lightmap::MapPage;
use exr::prelude::*;

/// The file's bytes; see the module above for the numbers.
///
/// # Errors
/// An internal fault of the encoder.
pub fn to_exr(page: &MapPage, lux_per_unit: f64) -> Result<Vec<u8>> {
    let texels = texels(page, lux_per_unit);
    let channels = ["R", "G", "B"]
        .into_iter()
        .enumerate()
        .map(|(c, name)| {
            let plane = texels.iter().map(|t| f16::from_f32(t[c])).collect();
            AnyChannel::new(name, FlatSamples::F16(plane))
        })
        .collect();
    encoded((page.width, page.height), channels)
}
