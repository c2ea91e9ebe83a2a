//! Decodes the images that materials use (PNG and JPEG) into linear light.
//!
//! Base colour and emissive images are sRGB-encoded (glTF 2.0, section 3.9.2): C = (E / 12.92) below 0.04045, else
//! ((E + 0.055) / 1.055)^2.4 (IEC 61966-2-1); alpha is linear. Profiles inside the files are not looked at, as the
//! standard says.
//!
//! Large images are shrunk by whole factors with a box filter, in linear light: what the solver needs are means over
//! elements. So the memory for images is bounded: [`MAX_TEXELS`] in all.

use super::running::Running;
use image::{DynamicImage, GenericImageView, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use std::sync::OnceLock;

/// Texels of all images together (16 bytes each).
const MAX_TEXELS: usize = 1 << 26;
/// Texels of one image: 2048 x 2048.
const MAX_IMAGE: usize = 1 << 22;
/// Pixels of all images in the files together: a minute of decoding.
pub(crate) const MAX_PIXELS: u64 = 1 << 32;
/// Pixels across or down in one file, and in all of it.
const MAX_SIDE: u32 = 16_384;
const MAX_FILE_PIXELS: u64 = 1 << 27;
/// Bytes that decoding one image may take.
const MAX_DECODE: u64 = 1 << 30;
/// The most that one byte of a file can become: deflate (RFC 1951) reaches 1032 bytes; JPEG needs at least a bit for each
/// block of 64 pixels and plane, so stays below 512 pixels.
const MAX_PNG_RATIO: u64 = 1032;
const MAX_JPEG_RATIO: u64 = 512;

/// A decoded image: linear light, alpha as is.
#[derive(Debug, Clone)]
pub struct Image {
    /// For messages.
    pub name: String,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Linear RGBA, row by row from the top.
    pub pixels: Vec<[f32; 4]>,
    /// Made when they are first asked for.
    running: OnceLock<Running>,
}

impl Image {
    /// An image with rows of `width` pixels, linear RGBA from the top left; of what is too few for a row nothing is left.
    pub fn new(name: &str, width: usize, mut pixels: Vec<[f32; 4]>) -> Self {
        let height = pixels.len() / width.max(1);
        pixels.truncate(width * height);
        Self {
            name: name.to_owned(),
            width,
            height,
            pixels,
            running: OnceLock::new(),
        }
    }

    /// Running sums of the pixels, which must not change any more.
    pub(super) fn running(&self) -> &Running {
        let make = || Running::new(self.width, &self.pixels);
        self.running.get_or_init(make)
    }

    /// Mean of all texels; white of none.
    pub(crate) fn mean(&self) -> [f32; 4] {
        if self.pixels.is_empty() {
            return [1.0; 4];
        }
        let mut sum = [0.0_f64; 4];
        for pixel in &self.pixels {
            sum = std::array::from_fn(|c| sum[c] + f64::from(pixel[c]));
        }
        sum.map(|s| (s / self.pixels.len() as f64) as f32)
    }
}

/// What stands in for an image that cannot be read: a grey that neither brightens nor darkens much.
pub(crate) fn neutral(name: &str) -> Image {
    Image::new(name, 1, vec![[0.5, 0.5, 0.5, 1.0]])
}

/// Decodes one of `count` images, or says why not; `room` is how many pixels may still be decoded.
pub(crate) fn decode(
    name: &str,
    bytes: &[u8],
    count: usize,
    room: &mut u64,
) -> Result<Image, String> {
    let bad = |e: image::ImageError| e.to_string();
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_DECODE);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    let Some(format) = reader.format() else {
        return Err("it is neither PNG nor JPEG".into());
    };
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(bad)?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 {
        return Err("it has no pixels".into());
    }
    let size = bytes.len() as u64;
    let believable = if format == ImageFormat::Jpeg {
        pixels <= size.saturating_mul(MAX_JPEG_RATIO)
    } else {
        pixels * stored_bits(bytes) / 8 <= size.saturating_mul(MAX_PNG_RATIO)
    };
    if !believable || pixels > MAX_FILE_PIXELS {
        return Err(format!(
            "it claims {width} x {height} pixels in {size} bytes"
        ));
    }
    if pixels > *room {
        return Err("there are too many pixels in all images together".into());
    }
    *room -= pixels;
    let decoded = DynamicImage::from_decoder(decoder).map_err(bad)?;
    let budget = (MAX_TEXELS / count.max(1)).clamp(1, MAX_IMAGE);
    Ok(linear(name, &decoded, budget))
}

/// Bits of a pixel in a PNG, from its header: a palette holds as little as one, where the decoder tells of the three or
/// four bytes that it unfolds to.
fn stored_bits(bytes: &[u8]) -> u64 {
    // PNG, third edition, section 11.2.1: bit depth and colour type stand at 24 and 25.
    let &[depth, kind] = bytes.get(24..26).unwrap_or(&[8, 6]) else {
        return 32;
    };
    let channels = match kind {
        0 | 3 => 1,
        4 => 2,
        2 => 3,
        _ => 4,
    };
    u64::from(depth) * channels
}

/// In linear light, shrunk to at most `budget` texels.
fn linear(name: &str, decoded: &DynamicImage, budget: usize) -> Image {
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let mut shrink = 1;
    while width.div_ceil(shrink) * height.div_ceil(shrink) > budget {
        shrink += 1;
    }
    let deep = matches!(
        decoded.color(),
        image::ColorType::L16
            | image::ColorType::La16
            | image::ColorType::Rgb16
            | image::ColorType::Rgba16
    );
    let pixels = if deep {
        let wide = decoded.to_rgba16();
        let of = |raw: u16| f32::from(raw) / 65535.0;
        boxed(width, height, shrink, |x, y| {
            let [r, g, b, a] = wide.get_pixel(x, y).0.map(of);
            [from_srgb(r), from_srgb(g), from_srgb(b), a]
        })
    } else {
        let table: Vec<f32> = (0..=255u8)
            .map(|e| from_srgb(f32::from(e) / 255.0))
            .collect();
        let of = |raw: u8| table[usize::from(raw)];
        boxed(width, height, shrink, |x, y| {
            let [r, g, b, a] = decoded.get_pixel(x, y).0;
            [of(r), of(g), of(b), f32::from(a) / 255.0]
        })
    };
    Image::new(name, width.div_ceil(shrink), pixels)
}

/// Means over blocks of `shrink` x `shrink` pixels; blocks at the right and lower edge may be smaller.
fn boxed(
    width: usize,
    height: usize,
    shrink: usize,
    pixel: impl Fn(u32, u32) -> [f32; 4],
) -> Vec<[f32; 4]> {
    let mut out = Vec::with_capacity(width.div_ceil(shrink) * height.div_ceil(shrink));
    for top in (0..height).step_by(shrink) {
        for left in (0..width).step_by(shrink) {
            let (bottom, right) = ((top + shrink).min(height), (left + shrink).min(width));
            let mut sum = [0.0f32; 4];
            for y in top..bottom {
                for x in left..right {
                    // Both are below the limit on a side.
                    let value = pixel(x as u32, y as u32);
                    for (sum, value) in sum.iter_mut().zip(value) {
                        *sum += value;
                    }
                }
            }
            let count = ((bottom - top) * (right - left)) as f32;
            out.push(sum.map(|x| x / count));
        }
    }
    out
}

fn from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage, Rgba, RgbaImage};

    fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn colour_is_linearised_and_alpha_is_not() {
        let bytes = png(RgbaImage::from_pixel(3, 2, Rgba([188, 0, 255, 128])));
        let image = decode("a", &bytes, 1, &mut { MAX_PIXELS }).unwrap();
        assert_eq!((image.width, image.height, image.pixels.len()), (3, 2, 6));
        let [r, g, b, a] = image.pixels[5];
        // sRGB 188 is 0.5029 of linear light.
        assert!((r - 0.5029).abs() < 1e-4 && g == 0.0 && (b - 1.0).abs() < 1e-6);
        assert_eq!(a, 128.0 / 255.0);
    }

    #[test]
    fn jpeg_and_16_bit_png() {
        let mut bytes = Cursor::new(Vec::new());
        let grey = RgbImage::from_pixel(8, 8, Rgb([128; 3]));
        grey.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        let image = decode("a", bytes.get_ref(), 1, &mut { MAX_PIXELS }).unwrap();
        assert!((image.pixels[0][0] - 0.2159).abs() < 0.01);
        let deep =
            image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(2, 2, image::Luma([0x8000]));
        let image = decode("a", &png(deep), 1, &mut { MAX_PIXELS }).unwrap();
        assert!((image.pixels[0][0] - 0.214_06).abs() < 1e-4);
    }

    #[test]
    fn shrinking_keeps_the_mean() {
        let ramp = RgbaImage::from_fn(40, 30, |x, y| {
            Rgba([(x * 6) as u8, (y * 8) as u8, 7, (x + y) as u8])
        });
        let decoded = DynamicImage::from(ramp);
        let (whole, small) = (linear("a", &decoded, 1200), linear("a", &decoded, 12));
        assert_eq!((small.width, small.height), (4, 3));
        for k in 0..4 {
            let mean =
                |i: &Image| i.pixels.iter().map(|p| p[k]).sum::<f32>() / i.pixels.len() as f32;
            assert!((mean(&whole) - mean(&small)).abs() < 1e-5);
        }
    }

    #[test]
    fn small_files_cannot_claim_large_images() {
        let mut bytes = png(RgbImage::new(4, 4));
        // The header chunk: width and height at 16 and 20, its checksum at 29.
        bytes[16..24].copy_from_slice(&[0, 0, 0x3F, 0xFF, 0, 0, 0x3F, 0xFF]);
        let sum = crc(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&sum.to_be_bytes());
        let why = decode("a", &bytes, 1, &mut { MAX_PIXELS }).unwrap_err();
        assert!(why.contains("claims 16383 x 16383"), "{why}");
        assert!(decode("a", b"", 1, &mut { MAX_PIXELS }).is_err());
        assert!(decode("a", b"RIFF....WEBP", 1, &mut { MAX_PIXELS }).is_err());
        let good = png(RgbImage::new(4, 4));
        for end in 0..good.len() - 12 {
            assert!(
                decode("a", &good[..end], 1, &mut { MAX_PIXELS }).is_err(),
                "{end}"
            );
        }
    }

    /// The checksum of PNG chunks (ISO 3309).
    fn crc(bytes: &[u8]) -> u32 {
        let mut crc = u32::MAX;
        for &byte in bytes {
            crc ^= u32::from(byte);
            for _ in 0..8 {
                crc = if crc & 1 == 1 {
                    (crc >> 1) ^ 0xEDB8_8320
                } else {
                    crc >> 1
                };
            }
        }
        !crc
    }
}
