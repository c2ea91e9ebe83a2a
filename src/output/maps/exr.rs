//! OpenEXR of a page: channels R, G, B as half floats, ZIP-compressed.

use super::texels;
use crate::error::{Error, Result};
use crate::lightmap::Page;
use exr::prelude::*;

/// The file's bytes; see the module above for the numbers.
///
/// # Errors
/// An internal fault of the encoder.
pub fn to_exr(page: &Page, lux_per_unit: f64) -> Result<Vec<u8>> {
    let texels = texels(page, lux_per_unit);
    let channels: SmallVec<[_; 4]> = ["R", "G", "B"]
        .into_iter()
        .enumerate()
        .map(|(c, name)| {
            let plane = texels.iter().map(|t| f16::from_f32(t[c])).collect();
            AnyChannel::new(name, FlatSamples::F16(plane))
        })
        .collect();
    let layer = Layer::new(
        (page.width, page.height),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels),
    );
    let mut out = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        // One thread: the same bytes whatever the machine.
        .non_parallel()
        .to_buffered(&mut out)
        .map_err(|problem| Error::Internal(format!("EXR: {problem}")))?;
    Ok(out.into_inner())
}
