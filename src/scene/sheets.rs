//! Which materials are diffuse sheets: KHR_materials_diffuse_transmission, and what side files say of them.
//!
//! More light than meets a sheet must not leave it: where a reflectance and a transmission that are given come to 1 or more, at whatever
//! wavelength, that is a problem.

use super::GREATEST_ALBEDO;
use super::check::{Check, listed};
use super::json::short;
use super::known::MaterialSpectra;
use super::raw::{METAL, RawMaterial};
use super::sheet::{Sheet, bounded};
use crate::color::Upsampler;
use crate::data::{BANDS, Grid, Spectrum};

/// The sheet that a material is, if it is one; what both sides reflect goes into `reflectance`, which holds the whole base colour or
/// what was measured. `textured`: is the base colour multiplied by a texture or by vertex colours? `metallic`: the share of it that is a
/// metal, which lets nothing through.
pub(super) fn sheet(
    (raw, textured, metallic): (&RawMaterial, bool, f64),
    spectra: &MaterialSpectra,
    reflectance: &mut Spectrum,
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
    if metallic >= f64::from(METAL) && measured.is_none() {
        let what = "is a metal and lets light through: KHR_materials_diffuse_transmission counts times 1 - metallic, which is 0";
        let next = "set its metallicFactor to 0, take the extension out, or give a \"transmission\" in the side file";
        check.problem(place, what, next);
        return None;
    }
    let strength = given.map_or(0.0, |given| f64::from(given.strength) * (1.0 - metallic));
    let color = given.map_or([1.0; 3], |given| given.color);
    if spectra.reflectance.is_none() {
        *reflectance = reflectance.map(|r| (1.0 - strength) * r);
    }
    let transmittance = match measured {
        Some(measured) => measured.spectrum,
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
    let other = back.map(|b| (&b.spectrum, Some(b), "back"));
    // Under a texture or vertex colours a base colour says nothing of the albedo; what they come to is bounded place by place.
    let front = Some(front).filter(|_| spectra.reflectance.is_some() || !textured);
    for (rho, known, side) in [front, other].into_iter().flatten() {
        let of = known.map_or("its base colour", |known| known.from.as_str());
        exceeds([rho, &transmittance], [of, &from], side, place, grid, check);
    }
    *reflectance = bounded(*reflectance, &transmittance);
    let plain = measured.is_none();
    Some(Sheet {
        transmittance: transmittance.map(|t| t.min(GREATEST_ALBEDO)),
        back: back.map(|back| bounded(back.spectrum, &transmittance)),
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
    [rho, tau]: [&Spectrum; 2],
    [of, through]: [&str; 2],
    side: &str,
    place: &str,
    grid: &Grid,
    check: &mut Check,
) {
    let sum = |k: usize| rho[k] + tau[k];
    let over: Vec<usize> = (0..BANDS).filter(|&k| sum(k) >= 1.0).collect();
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
pub(super) struct SheetNotes {
    panes: Vec<String>,
    glowing: Vec<String>,
    thick: Vec<String>,
}

impl SheetNotes {
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
