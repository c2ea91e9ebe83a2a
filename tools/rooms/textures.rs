//! Procedural textures, as PNG.

use image::{ImageFormat, Rgba, RgbaImage};
use std::io::Cursor;

/// Pixels along a side.
const SIDE: u32 = 64;

/// Planks of wood, four to the side; tiles.
pub(crate) fn planks() -> Vec<u8> {
    png(|x, y| {
        let plank = y / 16;
        let grain = noise(x / 6, y) / 2 + noise(x / 16 + 91, y / 2) / 2;
        let tone = 96 + i32::from(noise(plank, 7)) / 8 + i32::from(grain) / 8;
        let joint = y % 16 == 0 || x == plank * 23 % 64;
        let tone = if joint { tone / 2 } else { tone };
        [tone + 24, tone * 4 / 5, tone / 2, 255]
    })
}

/// A woven check; tiles.
pub(crate) fn check() -> Vec<u8> {
    png(|x, y| {
        let weave = i32::from(noise(x, y)) / 24;
        match (x / 16 % 2, y / 16 % 2) {
            (0, 0) => [150 + weave, 40, 40, 255],
            (1, 1) => [210 + weave, 200, 170, 255],
            _ => [60, 70 + weave, 110, 255],
        }
    })
}

/// A picture: sky, sun, hills.
pub(crate) fn landscape() -> Vec<u8> {
    png(|x, y| {
        let (fx, fy) = (f64::from(x) / 64.0, f64::from(y) / 64.0);
        let near = 0.72 + 0.08 * (fx * 7.0).sin();
        let far = 0.55 + 0.07 * (fx * 11.0 + 2.0).sin();
        let sun = (fx - 0.7).hypot(fy - 0.22) < 0.09;
        match () {
            () if fy > near => [60, 110, 50, 255],
            () if fy > far => [80, 100, 130, 255],
            () if sun => [250, 220, 120, 255],
            () => [
                120 + (fy * 120.0) as i32,
                170 + (fy * 60.0) as i32,
                220,
                255,
            ],
        }
    })
}

/// A screen: colour bars over a grey ramp.
pub(crate) fn screen() -> Vec<u8> {
    const BARS: [[i32; 3]; 8] = [
        [235, 235, 235],
        [235, 235, 16],
        [16, 235, 235],
        [16, 235, 16],
        [235, 16, 235],
        [235, 16, 16],
        [16, 16, 235],
        [16, 16, 16],
    ];
    png(|x, y| {
        let [r, g, b] = if y < 44 {
            BARS[x as usize / 8]
        } else {
            [x as i32 * 4; 3]
        };
        [r, g, b, 255]
    })
}

/// A leaf: opaque inside of its outline, holes around.
pub(crate) fn leaf() -> Vec<u8> {
    png(|x, y| {
        let (fx, fy) = (f64::from(x) / 63.0 * 2.0 - 1.0, f64::from(y) / 63.0);
        let inside = fx.abs() < 0.9 * (fy * std::f64::consts::PI).sin().powf(0.8);
        let vein = fx.abs() < 0.05;
        let green = if vein {
            150
        } else {
            105 + i32::from(noise(x, y)) / 16
        };
        [40, green, 35, if inside { 255 } else { 0 }]
    })
}

fn png(pixel: impl Fn(u32, u32) -> [i32; 4]) -> Vec<u8> {
    // Clamped, so that the conversion is exact.
    let image = RgbaImage::from_fn(SIDE, SIDE, |x, y| {
        Rgba(pixel(x, y).map(|v| v.clamp(0, 255) as u8))
    });
    let mut out = Cursor::new(Vec::new());
    image
        .write_to(&mut out, ImageFormat::Png)
        .expect("writing to memory does not fail");
    out.into_inner()
}

/// A number of the pixel, the same in every run.
fn noise(x: u32, y: u32) -> u8 {
    let mut h = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    (h >> 24) as u8
}
