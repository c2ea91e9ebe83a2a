//! Diffuse sheets: curtains, paper, lamp shades and opal covers, which reflect a part of the light that meets them evenly to all sides,
//! and send another part evenly out of their other side.
//!
//! `exitance(front) = rho_front E(front) + tau E(back)`, and the same with front and back exchanged, leaf by leaf. What makes a
//! material a sheet is KHR_materials_diffuse_transmission, whose strength f and colour c beside the base colour b mean
//! `rho = (1 - f) b`, `tau = f c` (the extension's section "Implementation", without its specular layer), or `"transmission"` in a side
//! file, which is tau itself. A sheet has two sides whatever the file says, and no thickness.

use super::check::{Check, listed};
use super::json::short;
use super::known::MaterialSpectra;
use super::raw::RawMaterial;
use super::{GREATEST_ALBEDO, Image, Material, Texture};
use crate::color::Upsampler;
use crate::data::{Grid, LEAVES, Leaves};

/// What a material lets through, evenly to all sides.
#[derive(Debug, Clone)]
pub struct Sheet {
    /// Share of light that leaves on the other side, on the grid's leaves, where textures are white: tau.
    pub transmittance: Leaves,
    /// Reflectance of the back, if it is not that of the front.
    pub back: Option<Leaves>,
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

impl Sheet {
    /// Transmittance where textures have these values, each in [0, 0.999].
    pub fn transmittance_at(&self, weave: Weave, upsampler: &Upsampler) -> Leaves {
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

    /// What one side of a material with this sheet reflects and lets through, where its textures have these values and its base colour
    /// is `color`, which none leaves as it is.
    pub fn scatters(
        &self,
        material: &Material,
        color: Option<[f32; 3]>,
        weave: Weave,
        back: bool,
        upsampler: &Upsampler,
    ) -> [Leaves; 2] {
        let through = self.transmittance_at(weave, upsampler);
        let own = self.back.filter(|_| back);
        let reflected = match (own, color) {
            (Some(own), _) => own,
            (None, None) if weave == Weave::PLAIN || !self.shares => material.reflectance,
            (None, color) => {
                let left = self.left(weave);
                let color = color.unwrap_or(material.base_color);
                upsampler.reflectance_fast(color).map(|r| left * r)
            }
        };
        [bounded(reflected, &through), through]
    }

    /// What leaves the side that reflects more, of the same light on both sides: reflectance and transmittance together. The light of
    /// vertices is given as a share of it.
    pub fn shown(
        &self,
        material: &Material,
        color: Option<[f32; 3]>,
        weave: Weave,
        upsampler: &Upsampler,
    ) -> Leaves {
        let side = |back| self.scatters(material, color, weave, back, upsampler);
        let ([front, through], [back, _]) = (side(false), side(true));
        std::array::from_fn(|k| front[k].max(back[k]) + through[k])
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
pub(crate) fn bounded(front: Leaves, transmittance: &Leaves) -> Leaves {
    std::array::from_fn(|k| front[k].min(GREATEST_ALBEDO - transmittance[k]).max(0.0))
}

/// The sheet that a material is, if it is one; what both sides reflect goes into `reflectance`, which holds the whole base colour or
/// what was measured.
pub(super) fn of(
    raw: &RawMaterial,
    spectra: &MaterialSpectra,
    reflectance: &mut Leaves,
    place: &str,
    grid: &Grid,
    upsampler: &Upsampler,
    check: &mut Check,
) -> Option<Sheet> {
    let given = raw.sheet.as_ref();
    let measured = spectra.transmission.as_ref();
    if given.is_none_or(|given| given.strength <= 0.0) && measured.is_none() {
        if spectra.back.is_some() {
            let next = "give a \"transmission\" beside it, or take it out";
            check.problem(place, "has a back_reflectance, but is no sheet", next);
        }
        return None;
    }
    let strength = given.map_or(0.0, |given| f64::from(given.strength));
    let color = given.map_or([1.0; 3], |given| given.color);
    if spectra.reflectance.is_none() {
        *reflectance = reflectance.map(|r| (1.0 - strength) * r);
    }
    let transmittance = match measured {
        Some(measured) => measured.leaves,
        None => (upsampler.reflectance(color)).map(|t| strength * t.min(GREATEST_ALBEDO)),
    };
    let back = spectra.back.as_ref();
    let from = match measured {
        Some(measured) => measured.from.clone(),
        None => {
            let [r, g, b] = color;
            format!("diffuse transmission {strength:.3} of {r:.3} {g:.3} {b:.3}, upsampled")
        }
    };
    let front = (&*reflectance, spectra.reflectance.as_ref(), "front");
    let other = back.map(|b| (&b.leaves, Some(b), "back"));
    for (rho, known, side) in [Some(front), other].into_iter().flatten() {
        let of = known.map_or("its base colour", |known| known.from.as_str());
        exceeds([rho, &transmittance], [of, &from], side, place, grid, check);
    }
    *reflectance = bounded(*reflectance, &transmittance);
    let plain = measured.is_none();
    Some(Sheet {
        transmittance: transmittance.map(|t| t.min(GREATEST_ALBEDO)),
        back: back.map(|back| bounded(back.leaves, &transmittance)),
        strength,
        shares: spectra.reflectance.is_none(),
        strength_texture: given.and_then(|given| given.strength_texture.clone()),
        color: plain.then_some(color),
        color_texture: given
            .filter(|_| plain)
            .and_then(|given| given.color_texture.clone()),
        from,
    })
}

/// Says where more light would leave a sheet than meets it.
fn exceeds(
    [rho, tau]: [&Leaves; 2],
    [of, through]: [&str; 2],
    side: &str,
    place: &str,
    grid: &Grid,
    check: &mut Check,
) {
    let sum = |k: usize| rho[k] + tau[k];
    let over: Vec<usize> = (0..LEAVES).filter(|&k| sum(k) >= 1.0).collect();
    let (Some(first), Some(last)) = (over.first(), over.last()) else {
        return;
    };
    let most = over.iter().map(|&k| sum(k)).fold(0.0, f64::max);
    let what = format!(
        "reflectance ({}) and transmission ({}) of its {side} come to {most:.3} between {:.0} and {:.0} nm",
        short(of),
        short(through),
        grid.left(*first),
        grid.left(*last) + grid.width()
    );
    check.problem(place, what, "lower one of them: their sum stays below 1");
}

/// What is said once about all sheets.
#[derive(Default)]
pub(super) struct Said {
    panes: Vec<String>,
    glowing: Vec<String>,
    thick: Vec<String>,
}

impl Said {
    pub(super) fn hear(&mut self, raw: &RawMaterial, name: &str, is_pane: bool, emits: bool) {
        if is_pane {
            self.panes.push(name.into());
            return;
        }
        if emits && !raw.double_sided {
            self.glowing.push(name.into());
        }
        if raw.volume.is_some_and(|v| v.thickness > 0.0) {
            self.thick.push(name.into());
        }
    }

    pub(super) fn warn(&self, check: &mut Check) {
        let warnings = [
            (
                &self.panes,
                "a pane that also lets light through diffusely: taken as a pane, the diffuse part is left out",
            ),
            (
                &self.glowing,
                "a sheet that lets light through has two sides, and shines from both",
            ),
            (
                &self.thick,
                "KHR_materials_volume on a diffuse sheet: its surface is a sheet without a volume",
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
