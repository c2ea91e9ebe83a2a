//! A picture of the baked room: radiance = light * texture * vertex colour / pi, smooth over the refined mesh.
//!
//! Radiance is in cd/m2 (linear sRGB primaries, and XYZ). The PNG is exposed, brought into the display by the curve of
//! [`curve`], averaged over the samples of a pixel after that (so that edges of lamps stay smooth), and
//! encoded by the sRGB curve.

use super::camera::View;
use super::curve;
use super::exposure::Exposure;
use super::raster::{self, Fragment, RefinedMesh};
use super::sky_background::SkyBackground;
use crate::color::{self, LinearSrgb};
use crate::error::{Error, Result};
use crate::gather::BakedSurface;
use crate::gather::refined;
use crate::scene::{Camera, Scene};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Linear display value where the picture shows no surface, and no sky is described.
const BACKGROUND: f64 = 0.02;

/// Size and smoothness of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Format {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Samples along each side of a pixel, 1 to 8.
    pub grid: usize,
}

impl Default for Format {
    /// 960 by 720 pixels of 4 by 4 samples.
    fn default() -> Self {
        Self {
            width: 960,
            height: 720,
            grid: 4,
        }
    }
}

/// One pixel: means over its samples.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Pixel {
    /// Radiance in linear sRGB, cd/m2; where there is no surface that of the sky, or 0.
    pub rgb: [f32; 3],
    /// Tristimulus radiance, Y in cd/m2.
    pub xyz: [f32; 3],
    /// Share of the pixel that shows a surface.
    pub coverage: f32,
    /// Exposed and through the curve, linear, in [0, 1], over sky or background.
    pub shown: [f32; 3],
}

impl Pixel {
    /// What is seen beside the surfaces in it.
    fn lay_over(&mut self, beyond: Shade) {
        let share = 1.0 - self.coverage;
        let all = [&mut self.rgb, &mut self.xyz, &mut self.shown];
        for (of_surfaces, beyond) in all.into_iter().zip(beyond) {
            for (c, more) in of_surfaces.iter_mut().zip(beyond) {
                *c += share * more as f32;
            }
        }
    }
}

/// A drawn picture, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width * height` pixels.
    pub pixels: Vec<Pixel>,
}

impl Picture {
    /// Draws the room.
    ///
    /// # Errors
    /// The refined mesh is broken (internal fault), or the format is empty or beyond 16384 pixels a side.
    pub fn draw(
        scene: &Scene,
        surfaces: &[BakedSurface],
        camera: &Camera,
        look: &Exposure,
        format: Format,
    ) -> Result<Self> {
        let Format {
            width,
            height,
            grid,
        } = format;
        let side = 1..=16384;
        if !side.contains(&width) || !side.contains(&height) || !(1..=8).contains(&grid) {
            return Err(Error::input(
                "picture",
                format!("{width} by {height} pixels of {grid} by {grid} samples cannot be drawn"),
                "ask for 1 to 16384 pixels a side and 1 to 8 samples",
            ));
        }
        refined::check(scene, surfaces)?;
        let meshes = RefinedMesh { scene, surfaces };
        let srgb = LinearSrgb::standard();
        let shade = |hit: &Fragment| shade(&meshes, &srgb, look, hit);
        let view = View::new(scene, camera, width, height);
        let mut pixels = raster::draw(&meshes, &view, [width, height], grid, |samples| {
            (0..width)
                .map(|x| pixel(&meshes, samples, [x, width, grid], &shade))
                .collect()
        });
        let outside = SkyBackground::new(scene);
        let beyond = |(k, pixel): (usize, &mut Pixel)| {
            let place = [k % width, k / width].map(|k| k as f64 + 0.5);
            let seen = outside.as_ref().map(|o| o.radiance(view.direction(place)));
            pixel.lay_over(seen.map_or([[0.0; 3], [0.0; 3], [BACKGROUND; 3]], |xyz| {
                let rgb = srgb.from_xyz(xyz);
                [
                    rgb,
                    xyz,
                    curve::into_display(look.shown(rgb.map(|c| c * PI))),
                ]
            }));
        };
        let bare = pixels.par_iter_mut().enumerate();
        bare.filter(|(_, p)| p.coverage < 1.0).for_each(beyond);
        Ok(Self {
            width,
            height,
            pixels,
        })
    }

    /// As PNG, 8 bits a channel, sRGB.
    ///
    /// # Errors
    /// An internal fault of the encoder.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        use image::{ExtendedColorType, ImageEncoder, codecs::png};
        let bytes: Vec<u8> = self
            .pixels
            .iter()
            .flat_map(|p| p.shown.map(|c| color::encode_byte(f64::from(c))))
            .collect();
        let mut out = Vec::new();
        let encoder = png::PngEncoder::new_with_quality(
            &mut out,
            png::CompressionType::Default,
            png::FilterType::Adaptive,
        );
        encoder
            // Sides are at most 16384.
            .write_image(
                &bytes,
                self.width as u32,
                self.height as u32,
                ExtendedColorType::Rgb8,
            )
            .map_err(|problem| Error::Internal(format!("PNG: {problem}")))?;
        Ok(out)
    }
}

/// Triangles of each surface of the input that some of the pictures show: what light on the way to them must be known for.
pub fn seen(scene: &Scene, pictures: &[(&Camera, Format)]) -> Vec<Vec<bool>> {
    let mut all: Vec<Vec<bool>> = (scene.surfaces.iter())
        .map(|surface| vec![false; surface.triangles.len()])
        .collect();
    for (camera, format) in pictures {
        let view = View::new(scene, camera, format.width, format.height);
        let some = raster::seen(scene, &view, [format.width, format.height], format.grid);
        for (all, some) in all.iter_mut().flatten().zip(some.iter().flatten()) {
            *all |= some;
        }
    }
    all
}

/// What one sample shows, in f64: rgb and xyz radiance in cd/m2, then the display value.
type Shade = [[f64; 3]; 3];

fn shade(meshes: &RefinedMesh, srgb: &LinearSrgb, look: &Exposure, hit: &Fragment) -> Shade {
    let (surface, corners) = meshes.at(hit);
    let material = &meshes.scene.materials[surface.material];
    let mix = |value: &dyn Fn(usize) -> [f32; 3]| -> [f64; 3] {
        let [a, b, c] = [value(0), value(1), value(2)];
        let [u, v, w] = hit.weights;
        std::array::from_fn(|i| u * f64::from(a[i]) + v * f64::from(b[i]) + w * f64::from(c[i]))
    };
    let mut rgb = mix(&|k| corners[k].light);
    // White balance is of light, not of paint.
    let mut shown = look.shown(rgb);
    let mut painted_by = |paint: [f64; 3]| {
        rgb = std::array::from_fn(|i| rgb[i] * paint[i]);
        shown = std::array::from_fn(|i| shown[i] * paint[i]);
    };
    if let Some(paint) = &material.paint {
        let texel = paint.sample(
            &meshes.scene.images,
            meshes.uv(surface, corners, hit.weights, paint.texcoord),
        );
        painted_by([texel[0], texel[1], texel[2]].map(f64::from));
    }
    let vertex_paint = material.vertex_paint && surface.colors.is_some();
    if vertex_paint {
        let color = mix(&|k| {
            let [r, g, b, _] = refined::vertex_color(surface, corners[k]);
            [r, g, b]
        });
        painted_by(color);
    }
    // Without paint the tristimulus radiosity is at hand; with it the texel's colour is all there is.
    let painted = vertex_paint || material.paint.is_some();
    let xyz = if painted {
        srgb.to_xyz(rgb)
    } else {
        mix(&|k| corners[k].radiosity)
    };
    [
        rgb.map(|c| c / PI),
        xyz.map(|c| c / PI),
        curve::into_display(shown),
    ]
}

/// Mean over the samples of column `x` of a pixel row.
///
/// Light is linear over a triangle: its samples in a pixel are shaded once, at their mean place. Texels are not:
/// a textured triangle is shaded at every sample.
fn pixel(
    meshes: &RefinedMesh,
    samples: &[Option<Fragment>],
    place: [usize; 3],
    shade: &impl Fn(&Fragment) -> Shade,
) -> Pixel {
    let [x, width, grid] = place;
    // (triangle, with the sum of its samples' weights; number of samples)
    let mut groups: Vec<(Fragment, f64)> = Vec::new();
    for row in samples.chunks(width * grid) {
        for hit in row[x * grid..][..grid].iter().flatten() {
            let same = |(other, _): &&mut (Fragment, f64)| {
                other.mesh == hit.mesh && other.triangle == hit.triangle
            };
            match groups.iter_mut().rev().find(same) {
                Some((group, count)) if !meshes.is_textured(hit) => {
                    *count += 1.0;
                    group.weights = std::array::from_fn(|i| group.weights[i] + hit.weights[i]);
                }
                _ => groups.push((*hit, 1.0)),
            }
        }
    }
    let mut sums = [[0.0; 3]; 3];
    let mut covered = 0.0;
    for (mut hit, count) in groups {
        hit.weights = hit.weights.map(|w| w / count);
        covered += count;
        for (sum, value) in sums
            .as_flattened_mut()
            .iter_mut()
            .zip(shade(&hit).as_flattened())
        {
            *sum += count * value;
        }
    }
    let count = (grid * grid) as f64;
    let coverage = (covered / count) as f32;
    let [rgb, xyz, shown] = sums.map(|sum| sum.map(|c| (c / count) as f32));
    Pixel {
        rgb,
        xyz,
        coverage,
        shown,
    }
}
