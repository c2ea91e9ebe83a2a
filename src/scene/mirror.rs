//! Mirrors: materials that send light on in one direction.
//!
//! Two things make a mirror: `"mirror": true` of the side file, and a metal (metallic 1) with a roughness below .1. A
//! metallicRoughnessTexture multiplies both factors (glTF 2.0, section 3.9.2): its green can make a smooth material smoother only, its blue
//! can say that it is no metal. So a smooth metal is a mirror if the texture says metal everywhere: of all its texels no more than
//! `STRAYS` may say otherwise. A texture that makes a rough factor smooth is not looked at.
//!
//! At normal incidence it reflects the material's reflectance, at an angle `F = F0 + (1 - F0) (1 - cos)^5` of it (Schlick, An
//! inexpensive BRDF model for physically-based rendering, 1994, eq. 15), wavelength by wavelength. Roughness below the limit counts
//! as none.

use super::check::{Check, listed};
use super::json::short;
use super::raw::RawMaterial;
use super::{GREATEST_ALBEDO, Image};
use crate::color::encode;
use crate::data::Spectrum;

/// Metallic from here on a texel is a metal: it may have been through JPEG.
const METAL_TEXEL: f64 = 0.95;
/// Share of a texture's texels that may be no metal, as those at the edge of a picture.
const STRAYS: f64 = 0.01;

/// The picture that says where a material is a metal.
fn metal_image<'a>(raw: &RawMaterial, images: &'a [Image]) -> Option<&'a Image> {
    images.get(raw.metal_texture.as_ref()?.image)
}

/// Share of a material that is a metal, its texture taken by its mean.
pub(super) fn metalness(raw: &RawMaterial, images: &[Image]) -> f64 {
    let mean = metal_image(raw, images).map_or(1.0, |image| {
        let blue = image.pixels.iter().map(|p| encode(f64::from(p[2])));
        blue.sum::<f64>() / image.pixels.len().max(1) as f64
    });
    f64::from(raw.metallic) * mean
}

/// Does the material's texture, if it has one, say that it is a metal everywhere?
fn is_metal_everywhere(raw: &RawMaterial, images: &[Image]) -> bool {
    metal_image(raw, images).is_none_or(|image| {
        // Images are decoded as colours, and numbers are linear.
        let is_metal = |blue: f32| encode(f64::from(blue)) >= METAL_TEXEL;
        let strays = image.pixels.iter().filter(|p| !is_metal(p[2])).count();
        strays as f64 <= STRAYS * image.pixels.len() as f64
    })
}

/// How a material mirrors.
#[derive(Debug, Clone)]
pub struct Mirror {
    /// Reflectance at normal incidence, in [0, 0.999].
    pub reflectance: Spectrum,
    /// What makes it a mirror, for `inspect`.
    pub from: String,
}

impl Mirror {
    /// What is reflected at a cosine of incidence, `normal` being that at normal incidence. Never all, so that light ends.
    pub fn reflects(normal: f64, cosine: f64) -> f64 {
        let more = (1.0 - normal) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5);
        (normal + more).min(GREATEST_ALBEDO)
    }

    /// What of diffuse light is reflected: the mean of [`reflects`](Self::reflects) over the cosine, `2 int F cos dcos`.
    pub fn overall(&self) -> Spectrum {
        let mean = |r: f64| r + (1.0 - r) / 21.0;
        self.reflectance.map(|r| mean(r).min(GREATEST_ALBEDO))
    }

    /// Does it reflect all wavelengths alike?
    pub fn is_neutral(&self) -> bool {
        self.reflectance.iter().all(|x| *x == self.reflectance[0])
    }
}

/// What is said once about all mirrors.
#[derive(Default)]
pub(super) struct MirrorNotes {
    mirrors: Vec<String>,
    other: Vec<String>,
    glowing: Vec<String>,
    textured: Vec<String>,
}

impl MirrorNotes {
    /// The mirror that a material of a reflectance is, if it is one. `wanted`: what the side file says; does it let light through, does
    /// it emit?
    pub(super) fn mirror(
        &mut self,
        (raw, name): (&RawMaterial, &str),
        wanted: Option<bool>,
        [passes, emits]: [bool; 2],
        reflectance: &Spectrum,
        images: &[Image],
    ) -> Option<Mirror> {
        let rough = raw.roughness.unwrap_or(1.0);
        let mut mirrors = wanted.unwrap_or(raw.is_smooth_metal() && !raw.unlit);
        if mirrors && wanted.is_none() && !is_metal_everywhere(raw, images) {
            self.textured.push(name.into());
            mirrors = false;
        }
        if !mirrors {
            return None;
        }
        if passes {
            self.other.push(name.into());
            return None;
        }
        if emits {
            self.glowing.push(name.into());
            return None;
        }
        self.mirrors.push(name.into());
        let from = match wanted {
            Some(_) => "side file".into(),
            None => format!("metallic, roughness {rough:.3}"),
        };
        Some(Mirror {
            reflectance: *reflectance,
            from,
        })
    }

    pub(super) fn warn(&self, check: &mut Check) {
        let warnings = [
            (
                &self.mirrors,
                "mirrors: light is followed by way of them; as seen in the output they are matt, with the light that falls on them",
            ),
            (
                &self.other,
                "a mirror that lets light through: taken for what it lets through, no mirror",
            ),
            (&self.glowing, "a mirror that emits: a lamp, no mirror"),
            (
                &self.textured,
                "a smooth metal whose metallicRoughnessTexture says no metal in places: matt; \"mirror\": true in the side file makes \
                 it a mirror",
            ),
        ];
        for (names, what) in warnings {
            if !names.is_empty() {
                let names: Vec<String> = names.iter().map(|n| format!("'{}'", short(n))).collect();
                check.warn(format!("{what} ({})", listed(&names)));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::BANDS;

    /// By plain quadrature.
    #[test]
    fn diffuse_light_is_reflected_by_the_mean_over_angles() {
        for normal in [0.0, 0.04, 0.5, 0.9] {
            let mirror = Mirror {
                reflectance: [normal; BANDS],
                from: String::new(),
            };
            let n = 10_000;
            let cosine = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
            let at = |k| 2.0 * cosine(k) * Mirror::reflects(normal, cosine(k)) / f64::from(n);
            let mean: f64 = (0..n).map(at).sum();
            assert!((mean - mirror.overall()[0]).abs() < 1e-6, "{normal}");
        }
    }
}
