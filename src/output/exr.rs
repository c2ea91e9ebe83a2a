//! OpenEXR of a picture: channels R, G, B (linear sRGB, cd/m2), A (coverage) and xyz.X, xyz.Y, xyz.Z (tristimulus
//! radiance, Y in cd/m2), 32-bit floats, ZIP-compressed without loss. Not exposed and not clipped.

use super::picture::Picture;
use crate::error::{Error, Result};
use exr::prelude::*;

/// The file's bytes.
///
/// # Errors
/// An internal fault of the encoder.
pub fn to_exr(picture: &Picture) -> Result<Vec<u8>> {
    let plane = |name: &str, value: &dyn Fn(&super::picture::Pixel) -> f32| {
        AnyChannel::new(
            name,
            FlatSamples::F32(picture.pixels.iter().map(value).collect()),
        )
    };
    let mut channels = vec![plane("A", &|p| p.coverage)];
    for (i, name) in ["R", "G", "B"].into_iter().enumerate() {
        channels.push(plane(name, &|p| p.rgb[i]));
    }
    for (i, name) in ["xyz.X", "xyz.Y", "xyz.Z"].into_iter().enumerate() {
        channels.push(plane(name, &|p| p.xyz[i]));
    }
    encoded((picture.width, picture.height), channels)
}

/// The bytes of a file with some channels.
pub(super) fn encoded(
    size: (usize, usize),
    channels: Vec<AnyChannel<FlatSamples>>,
) -> Result<Vec<u8>> {
    let layer = Layer::new(
        size,
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.into()),
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
