//! A material: what a surface reflects, gives out and lets through.

use super::fluorescence::Fluorescence;
use super::mirror::Mirror;
use super::pane::Pane;
use super::profile::Profile;
use super::sheet::{Sheet, SheetMeans, Weave, bounded};
use super::{GREATEST_ALBEDO, Image, Sides, Texture};
use crate::color::Upsampler;
use crate::data::Spectrum;
use std::sync::Arc;

/// A Lambertian material, one- or two-sided.
#[derive(Debug, Clone)]
pub struct Material {
    /// For messages and side files.
    pub name: String,
    /// Index in the document; none for glTF's default material.
    pub index: Option<usize>,
    /// Does the back reflect and emit too?
    pub sides: Sides,
    /// Albedo of the base colour factor (or the measured reflectance) on the grid's bands, each in [0, 0.999].
    pub reflectance: Spectrum,
    /// Where the reflectance comes from, for `inspect`.
    pub reflectance_from: String,
    /// Linear base colour factor; [1, 1, 1] where the reflectance is measured.
    pub base_color: [f32; 3],
    /// Texture that multiplies the base colour; none where the reflectance is measured.
    pub paint: Option<Texture>,
    /// Do vertex colours of a surface multiply the base colour? False where the reflectance is measured.
    pub vertex_paint: bool,
    /// What the surface gives out.
    pub emission: Option<Emission>,
    /// Holes.
    pub alpha: Alpha,
    /// What it lets straight through; then its surfaces stand in [`Scene::panes`](crate::scene::Scene::panes).
    pub pane: Option<Pane>,
    /// What it lets through diffusely; then [`reflectance`](Self::reflectance) is what is left of the base colour.
    pub sheet: Option<Sheet>,
    /// How it mirrors; then it reflects nothing diffusely.
    pub mirror: Option<Mirror>,
    /// What it gives out again at other wavelengths; then [`reflectance`](Self::reflectance) leaves room for it.
    pub fluorescence: Option<Fluorescence>,
}

/// Coverage.
#[derive(Debug, Clone)]
pub enum Alpha {
    /// No holes.
    Opaque,
    /// A point is a hole where `factor * texture alpha * vertex alpha < cutoff`.
    Mask {
        /// Threshold.
        cutoff: f32,
        /// Base colour factor's alpha.
        factor: f32,
        /// Base colour texture.
        texture: Option<Texture>,
    },
}

/// Lambertian emission: `radiance(band) = spectra[light].power[band] * shape[band]`, W/m2/sr/nm; where there is a
/// texture the shape differs from point to point ([`Emission::shape_at`]).
#[derive(Debug, Clone)]
pub struct Emission {
    /// Index in [`Scene::spectra`](crate::scene::Scene::spectra).
    pub light: usize,
    /// Multiplier of the light's power per band, at the emissive factor.
    pub shape: Spectrum,
    /// Emissive texture; then the shape of a point is `scale * upsample(factor * texel)`.
    pub texture: Option<Texture>,
    /// Linear emissive factor.
    pub color: [f32; 3],
    /// For textured emission: multiplier of the upsampled `color * texel` (both brought into [0, 1] first).
    pub scale: f64,
    /// Where the spectrum comes from, for `inspect`.
    pub from: String,
    /// How the light is spread, if not evenly: then `shape` only says how bright the surface is shown, and what it sends out is a
    /// light of [`LightKind::Surface`](crate::scene::LightKind::Surface).
    pub profile: Option<Arc<Profile>>,
}

impl Material {
    /// What the surface sends out evenly to all sides; none where a profile says how it shines.
    pub fn even_emission(&self) -> Option<&Emission> {
        self.emission.as_ref().filter(|e| e.profile.is_none())
    }
}

impl Material {
    /// The reflectance where paint (texel times vertex colour, linear) multiplies the base colour; `[1, 1, 1]`, and any
    /// paint on a measured material, leave [`Material::reflectance`]. Greys come out exactly flat.
    pub fn reflectance_at(&self, paint: [f32; 3], upsampler: &Upsampler) -> Spectrum {
        if paint == [1.0; 3] || self.paint.is_none() && !self.vertex_paint {
            return self.reflectance;
        }
        let rgb = std::array::from_fn(|i| self.base_color[i] * paint[i]);
        self.bounded(upsampler.reflectance_fast(rgb))
    }
}

impl Material {
    /// What one side of a surface reflects and lets through, `sheet` being that of this material, where its textures have the values of
    /// `weave` and the base colour is `color`, which none leaves as it is.
    pub fn scatters(
        &self,
        sheet: &Sheet,
        color: Option<[f32; 3]>,
        weave: Weave,
        back: bool,
        upsampler: &Upsampler,
    ) -> [Spectrum; 2] {
        let through = sheet.transmittance_at(weave, upsampler);
        let own = sheet.back.filter(|_| back);
        let reflected = match (own, color) {
            (Some(own), _) => own,
            (None, None) if weave == Weave::PLAIN || !sheet.shares => self.reflectance,
            (None, color) => {
                let left = sheet.left(weave);
                let color = color.unwrap_or(self.base_color);
                upsampler.reflectance_fast(color).map(|r| left * r)
            }
        };
        [bounded(reflected, &through), through]
    }

    /// What the material is as a sheet, in the mean of its textures; none of what is no sheet.
    pub fn sheet_means(&self, images: &[Image], upsampler: &Upsampler) -> Option<SheetMeans> {
        let sheet = self.sheet.as_ref()?;
        let color = self.mean_color(images);
        let weave = sheet.mean_weave(images);
        let side = |back| self.scatters(sheet, color, weave, back, upsampler);
        let ([front, transmittance], [back, _]) = (side(false), side(true));
        Some(SheetMeans {
            color,
            transmittance,
            left: sheet.left(weave),
            shown: std::array::from_fn(|k| front[k].max(back[k]) + transmittance[k]),
        })
    }

    /// A mirror under a texture reflects by its mean.
    pub(super) fn tint_mirror(&mut self, images: &[Image], upsampler: &Upsampler) {
        let mean = self.mean_color(images);
        if let (Some(mirror), Some(mean)) = (&mut self.mirror, mean) {
            let tint = upsampler.reflectance(mean);
            mirror.reflectance = tint.map(|r| r.min(GREATEST_ALBEDO));
        }
    }

    /// Mean of the texture that multiplies the base colour, linear; none where there is none.
    pub(crate) fn mean_paint(&self, images: &[Image]) -> Option<[f32; 3]> {
        let [r, g, b, _] = images.get(self.paint.as_ref()?.image)?.mean();
        Some([r, g, b].map(|x| x.max(DARKEST_PAINT)))
    }

    /// The base colour with it.
    pub(crate) fn mean_color(&self, images: &[Image]) -> Option<[f32; 3]> {
        let mean = self.mean_paint(images)?;
        Some(std::array::from_fn(|c| self.base_color[c] * mean[c]))
    }
}

impl Material {
    /// A reflectance brought down to what the albedo may be, beside what fluoresces.
    pub(crate) fn bounded(&self, reflectance: Spectrum) -> Spectrum {
        match &self.fluorescence {
            None => reflectance.map(|r| r.min(GREATEST_ALBEDO)),
            Some(fluorescence) => {
                let out = fluorescence.efficiency();
                std::array::from_fn(|k| reflectance[k].min(GREATEST_ALBEDO - out[k]).max(0.0))
            }
        }
    }

    /// Light spectra that it gives out, as lamp or excited.
    pub(crate) fn lights_mut(&mut self) -> impl Iterator<Item = &mut usize> {
        let own = self.emission.as_mut().map(|e| &mut e.light);
        let excited = self.fluorescence.as_mut().map(|f| f.terms.iter_mut());
        own.into_iter()
            .chain(excited.into_iter().flatten().map(|t| &mut t.light))
    }

    /// The same, to be looked at.
    pub(crate) fn lights(&self) -> impl Iterator<Item = usize> {
        let own = self.emission.as_ref().map(|e| e.light);
        let excited = self.fluorescence.as_ref().map(|f| f.terms.iter());
        own.into_iter()
            .chain(excited.into_iter().flatten().map(|t| t.light))
    }
}

/// Textures count as no darker than this in the mean, so that light may be divided by it.
pub(crate) const DARKEST_PAINT: f32 = 1e-3;

impl Emission {
    /// The shape at a point whose emissive texture has this linear value; `[1, 1, 1]` gives [`Emission::shape`].
    pub fn shape_at(&self, texel: [f32; 3], upsampler: &Upsampler) -> Spectrum {
        if texel == [1.0; 3] {
            return self.shape;
        }
        let rgb = std::array::from_fn(|i| self.color[i] * texel[i]);
        upsampler.reflectance_fast(rgb).map(|s| s * self.scale)
    }
}
