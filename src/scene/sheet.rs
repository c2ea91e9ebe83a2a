//! Diffuse sheets: curtains, paper, lamp shades and opal covers, which reflect a part of the light that meets them evenly to all sides,
//! and send another part evenly out of their other side.
//!
//! `exitance(front) = rho_front E(front) + tau E(back)`, and the same with front and back exchanged, band by band. What makes a
//! material a sheet is KHR_materials_diffuse_transmission, whose strength f and colour c beside the base colour b mean
//! `rho = (1 - f) b`, `tau = f c` (the extension's section "Implementation", without its specular layer), or `"transmission"` in a side
//! file, which is tau itself. A sheet has two sides whatever the file says, and no thickness.

use super::{GREATEST_ALBEDO, Image, Texture};
use crate::color::Upsampler;
use crate::data::Spectrum;

/// What a material lets through, evenly to all sides.
#[derive(Debug, Clone)]
pub struct Sheet {
    /// Share of light that leaves on the other side, on the grid's bands, where textures are white: tau.
    pub transmittance: Spectrum,
    /// Reflectance of the back, if it is not that of the front.
    pub back: Option<Spectrum>,
    /// Share of light that is not reflected but let through, by KHR_materials_diffuse_transmission, in [0, 1].
    pub strength: f64,
    /// Multiplies the strength (alpha channel).
    pub strength_texture: Option<Texture>,
    /// Linear colour of what is let through; none where the transmittance is measured.
    pub color: Option<[f32; 3]>,
    /// Multiplies the colour.
    pub color_texture: Option<Texture>,
    /// Does what is let through go from the base colour? Not where the reflectance is measured.
    pub shares: bool,
    /// Where the transmittance comes from, for `inspect`.
    pub from: String,
}

/// The values of a sheet's textures at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weave {
    /// Of the strength's.
    pub strength: f32,
    /// Of the colour's, linear.
    pub color: [f32; 3],
}

impl Weave {
    /// White textures.
    pub const PLAIN: Self = Self {
        strength: 1.0,
        color: [1.0; 3],
    };
}

/// What a sheet is in the mean of its textures.
#[derive(Debug, Clone)]
pub struct SheetMeans {
    /// Base colour, linear; none where it has no texture.
    pub color: Option<[f32; 3]>,
    /// Share of light that leaves on the other side.
    pub transmittance: Spectrum,
    /// Share of the base colour that is reflected.
    pub left: f64,
    /// What leaves the side that reflects more, of the same light on both sides: reflectance and transmittance together. The light of
    /// both sides is shown by it.
    pub shown: Spectrum,
}

impl Sheet {
    /// Transmittance where textures have these values, each in [0, 0.999].
    pub fn transmittance_at(&self, weave: Weave, upsampler: &Upsampler) -> Spectrum {
        let (Some(color), true) = (self.color, weave != Weave::PLAIN) else {
            return self.transmittance;
        };
        let strength = self.strength * f64::from(weave.strength);
        let color = std::array::from_fn(|k| color[k] * weave.color[k]);
        (upsampler.reflectance_fast(color)).map(|t| strength * t.min(GREATEST_ALBEDO))
    }

    /// Share of the base colour that is reflected where textures have these values.
    pub(crate) fn left(&self, weave: Weave) -> f64 {
        if self.shares {
            1.0 - self.strength * f64::from(weave.strength)
        } else {
            1.0
        }
    }

    /// The values of its textures, each found by `texel`.
    pub fn weave(&self, texel: impl Fn(&Texture) -> [f32; 4]) -> Weave {
        let [strength, color] = [&self.strength_texture, &self.color_texture];
        Weave {
            strength: strength.as_ref().map_or(1.0, |t| texel(t)[3]),
            color: color.as_ref().map_or([1.0; 3], |t| {
                let [r, g, b, _] = texel(t);
                [r, g, b]
            }),
        }
    }

    /// Means of its textures.
    pub(crate) fn mean_weave(&self, images: &[Image]) -> Weave {
        self.weave(|texture| images.get(texture.image).map_or([1.0; 4], Image::mean))
    }

    /// Are there textures?
    pub fn is_textured(&self) -> bool {
        self.strength_texture.is_some() || self.color_texture.is_some()
    }
}

/// What one side reflects of a sheet whose front reflects `front`, painted or not: no more than the transmittance leaves of
/// [`GREATEST_ALBEDO`].
pub(crate) fn bounded(front: Spectrum, transmittance: &Spectrum) -> Spectrum {
    std::array::from_fn(|k| front[k].min(GREATEST_ALBEDO - transmittance[k]).max(0.0))
}
