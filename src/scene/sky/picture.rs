//! Reads a picture of all directions: Radiance RGBE (`.hdr`) or OpenEXR, linear sRGB, twice as wide as high.
//!
//! Large ones are shrunk by means over blocks: a texel then spans .18 degrees, a third of the sun.

use crate::scene::uri;
use image::codecs::{hdr::HdrDecoder, openexr::OpenExrDecoder};
use image::{DynamicImage, ImageDecoder, ImageResult, Limits};
use std::io::{Cursor, Read};
use std::path::Path;

/// Texels across that are kept.
const WIDTH: usize = 2048;
/// Texels of a file at the most, 8192 x 4096, which take 12 bytes each while they are decoded.
const MOST: u64 = 1 << 25;
/// Texels that a byte of a file can stand for at the most: deflate (RFC 1951) makes no more than 1032 bytes of one, run lengths of
/// RGBE 16 texels.
const RATIO: u64 = 1032;
/// What to do about a part of one.
const WHOLE: &str = "copy or download the whole file again";
/// First bytes of the formats. Some write the second in the place of the first, which the decoder wants.
const RADIANCE: &[u8] = b"#?RADIANCE";
const RGBE: &[u8] = b"#?RGBE";
const OPEN_EXR: &[u8] = &[0x76, 0x2f, 0x31, 0x01];
/// Chromaticities of red, green and blue (ITU-R BT.709), and how far off others may be that are still the same.
const CHROMATICITIES: [[f32; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];
const SAME: f32 = 0.005;

/// A picture of all directions, row by row from the top.
#[derive(Debug)]
pub(super) struct SkyPicture {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Red, green, blue: linear, finite, not negative.
    pub(super) texels: Vec<[f32; 3]>,
    /// How wide it was in the file.
    pub(super) file_width: usize,
    pub(super) warnings: Vec<String>,
}

impl SkyPicture {
    /// Reads a file.
    ///
    /// # Errors
    /// In words: what is wrong, and what to do.
    pub(super) fn read(path: &Path) -> Result<Self, (String, &'static str)> {
        let next = "give an equirectangular map as .hdr or .exr";
        let bytes = uri::read_file(path).map_err(|why| (why, next))?;
        let bad = |e: image::ImageError| match is_cut_short(&e) {
            true => (
                "is cut short: it ends before its last texel".to_owned(),
                WHOLE,
            ),
            false => (format!("cannot be read: {e}"), next),
        };
        let named = [RADIANCE, RGBE]
            .iter()
            .find_map(|name| bytes.strip_prefix(*name));
        let ([width, height], numbers) = if let Some(rest) = named {
            let decoder = HdrDecoder::new(RADIANCE.chain(rest)).map_err(bad)?;
            checked(&decoder, bytes.len())?;
            decoded(decoder).map_err(bad)?
        } else if bytes.starts_with(OPEN_EXR) {
            let cursor = Cursor::new(&bytes);
            let decoder = OpenExrDecoder::with_alpha_preference(cursor, Some(false));
            let decoder = decoder.map_err(bad)?;
            checked(&decoder, bytes.len())?;
            decoded(decoder).map_err(bad)?
        } else {
            return Err(("is neither Radiance RGBE nor OpenEXR".into(), next));
        };
        let mut texels: Vec<[f32; 3]> = bytemuck::allocation::cast_vec(numbers);
        if let Some(k) = texels.iter().position(|t| t.iter().any(|x| !x.is_finite())) {
            let what = format!(
                "texel {}, {} is {:?}: its light has no end",
                k % width,
                k / width,
                texels[k]
            );
            return Err((
                what,
                "write finite numbers, or half the range of the format",
            ));
        }
        let mut warnings = Vec::new();
        let negative = |t: &&mut [f32; 3]| t.iter().any(|&x| x < 0.0);
        let mut count = 0;
        for texel in texels.iter_mut().filter(negative) {
            *texel = texel.map(|x| x.max(0.0));
            count += 1;
        }
        if count > 0 {
            warnings.push(format!("{count} texels have negative numbers, taken as 0"));
        }
        if has_other_primaries(&bytes) {
            warnings.push("has other primaries than sRGB: its numbers are taken as sRGB".into());
        }
        Ok(Self {
            file_width: width,
            warnings,
            ..Self::shrunk(width, height, texels)
        })
    }

    /// Of no more texels than are kept.
    pub(super) fn shrunk(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Self {
        let kept = [width.min(WIDTH), height.min(WIDTH / 2)];
        let picture = |texels| Self {
            width: kept[0],
            height: kept[1],
            texels,
            file_width: width,
            warnings: Vec::new(),
        };
        if kept == [width, height] {
            return picture(texels);
        }
        let block = |k: usize, of: usize, from: usize| k * from / of..(k + 1) * from / of;
        let mean = |x: usize, y: usize| {
            let (columns, rows) = (block(x, kept[0], width), block(y, kept[1], height));
            let count = (columns.len() * rows.len()) as f64;
            let mut sum = [0.0_f64; 3];
            for row in rows {
                for texel in &texels[row * width..][columns.clone()] {
                    sum = std::array::from_fn(|c| sum[c] + f64::from(texel[c]));
                }
            }
            sum.map(|s| (s / count) as f32)
        };
        let places = (0..kept[1]).flat_map(|y| (0..kept[0]).map(move |x| (x, y)));
        picture(places.map(|(x, y)| mean(x, y)).collect())
    }
}

/// Did the file end before the decoder had all? That of OpenEXR says so in words alone.
fn is_cut_short(error: &image::ImageError) -> bool {
    match error {
        image::ImageError::IoError(error) => error.kind() == std::io::ErrorKind::UnexpectedEof,
        other => other.to_string().contains("missing bytes"),
    }
}

/// Is the size that a file claims one of a map, and one that it can hold?
fn checked(decoder: &impl ImageDecoder, bytes: usize) -> Result<(), (String, &'static str)> {
    let (width, height) = decoder.dimensions();
    let texels = u64::from(width) * u64::from(height);
    if texels > MOST {
        let what = format!("has {width} x {height} texels");
        return Err((what, "scale it down to 8192 x 4096 or less"));
    }
    if texels > (bytes as u64).saturating_mul(RATIO) {
        let what = format!("claims {width} x {height} texels in {bytes} bytes");
        return Err((what, WHOLE));
    }
    if height == 0 || u64::from(width) != 2 * u64::from(height) {
        let what = format!("has {width} x {height} texels");
        let next = "give an equirectangular map: twice as wide as high";
        return Err((what, next));
    }
    Ok(())
}

/// Width and height, and three numbers a texel.
fn decoded(mut decoder: impl ImageDecoder) -> ImageResult<([usize; 2], Vec<f32>)> {
    let mut limits = Limits::default();
    limits.max_alloc = Some(12 * MOST);
    decoder.set_limits(limits)?;
    let picture = DynamicImage::from_decoder(decoder)?.into_rgb32f();
    let size = [picture.width() as usize, picture.height() as usize];
    Ok((size, picture.into_raw()))
}

/// Does an OpenEXR file name chromaticities other than those of sRGB?
fn has_other_primaries(bytes: &[u8]) -> bool {
    let meta = exr::meta::MetaData::read_from_buffered(bytes, false).ok();
    let named = meta.and_then(|meta| meta.headers.first()?.shared_attributes.chromaticities);
    named.is_some_and(|c| {
        let own = [c.red, c.green, c.blue].map(|xy| [xy.x(), xy.y()]);
        let pairs = own.iter().flatten().zip(CHROMATICITIES.iter().flatten());
        pairs.into_iter().any(|(a, b)| (a - b).abs() > SAME)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_keep_their_mean() {
        let (width, height) = (5000, 2500);
        let texels: Vec<[f32; 3]> = (0..width * height)
            .map(|k| [(k % 7) as f32, (k / width) as f32, 1.0])
            .collect();
        let mean = |texels: &[[f32; 3]], c: usize| {
            texels.iter().map(|t| f64::from(t[c])).sum::<f64>() / texels.len() as f64
        };
        let small = SkyPicture::shrunk(width, height, texels.clone());
        assert_eq!((small.width, small.height), (2048, 1024));
        for c in 0..3 {
            let [a, b] = [mean(&texels, c), mean(&small.texels, c)];
            assert!((a / b - 1.0).abs() < 1e-2, "{c}: {a} {b}");
        }
        assert_eq!(small.texels[0][2], 1.0);
    }
}
