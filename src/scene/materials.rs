//! Materials: glTF's metallic-roughness model taken as Lambertian, with measured spectra where there are some.
//!
//! `reflectance(band) = min(upsample(base colour factor), 0.999)`, or the measured table. Metals reflect by their base
//! colour as albedo, unlit materials are painted with it; each is said in a warning.
//! Emission: luminance = emissive strength (nits) times Y of the linear emissive factor, unless a side file says more.
//! No gloss, but for mirrors, see [`mirror`]. What lets light through is a pane, see [`pane`].

use super::check::{Check, listed};
use super::fluorescing;
use super::json::short;
use super::known::MaterialSpectra;
use super::lamp_spectra::{LampSpectra, ScaledSpectrum, bearable};
use super::luminaires::ProfileWish;
use super::mirror;
use super::pane;
use super::raw::{AlphaMode, RawMaterial};
use super::reader::Sampled;
use super::sheets;
use super::spectra_file::SpectraFile;
use super::{Alpha, Emission, GREATEST_ALBEDO, Image, Material, Sides};
use crate::color::Upsampler;
use crate::data::Grid;
use std::path::Path;
use std::sync::Arc;

/// From here on a material counts as a metal in warnings.
const METALLIC: f32 = 0.5;

/// What the warnings name materials for.
#[derive(Default)]
struct MaterialNotes {
    metals: Vec<String>,
    metals_by_texture: Vec<String>,
    unlit: Vec<String>,
    panes: pane::PaneNotes,
    sheets: sheets::SheetNotes,
    mirrors: mirror::MirrorNotes,
    bright: Vec<String>,
}

/// The materials of a document, in its order. `tinted[i]`: vertex colours darken material i wherever it is used.
#[expect(
    clippy::too_many_arguments,
    reason = "one call; each is a different thing"
)]
pub(crate) fn materials(
    raw: &[RawMaterial],
    tinted: &[bool],
    images: &[Image],
    file: &SpectraFile,
    room: &Path,
    grid: &Grid,
    upsampler: &Upsampler,
    lamps: &mut LampSpectra,
    check: &mut Check,
) -> (Vec<Material>, Vec<Option<ProfileWish>>) {
    let mut said = MaterialNotes::default();
    let made = raw
        .iter()
        .zip(tinted)
        .map(|(raw, tinted)| {
            let name = name_of(raw);
            let place = format!("material '{}'", short(&name));
            let mut spectra = file.material(&name, raw.extras.as_ref(), room, grid, check);
            let raw = &checked(raw, &place, check);
            let measured = spectra.reflectance.as_ref();
            let (mut material, bright) = paint(raw, &name, measured, upsampler);
            material.emission = match &spectra.profile {
                Some(wish) => shining(raw, wish, spectra.emission.as_ref(), &place, lamps, check),
                None => emission(raw, &spectra, &place, lamps, check),
            };
            let emits = material.emission.is_some();
            let through = spectra.transmittance.as_ref();
            let panes = &mut said.panes;
            let metallic = mirror::metalness(raw, images);
            let of = (raw, metallic);
            material.pane = panes.pane(of, &name, through, emits, &place, upsampler, check);
            let rho = &mut material.reflectance;
            let textured = *tinted || raw.base_color_texture.is_some();
            let raw_sheet = (raw, textured, metallic);
            let sheet = sheets::sheet(raw_sheet, &spectra, rho, &place, grid, upsampler, check);
            if sheet.is_some() {
                said.sheets.hear(raw, &name, material.pane.is_some(), emits);
            }
            material.sheet = sheet.filter(|_| material.pane.is_none());
            let is_sheet = material.sheet.is_some();
            if is_sheet {
                material.sides = Sides::Both;
            }
            material.mirror = {
                let passes = material.pane.is_some() || is_sheet;
                let rho = &material.reflectance;
                let (wanted, not) = (spectra.mirror, [passes, emits]);
                (said.mirrors).mirror((raw, &name), wanted, not, rho, images)
            };
            if let Some(wish) = &spectra.fluorescence {
                let measured = spectra.reflectance.as_ref().map(|r| r.from.as_str());
                let excited = &mut lamps.excited;
                fluorescing::fluoresce(&mut material, wish, measured, &place, grid, excited, check);
            }
            if material.pane.is_none() {
                // A factor of 1 under a texture or vertex colours is the rule and says nothing of the albedo.
                let plain = !tinted && raw.base_color_texture.is_none();
                let bright = bright && !is_sheet;
                let is_mirror = material.mirror.is_some();
                said.hear(
                    raw,
                    &name,
                    bright && (measured.is_some() || plain),
                    is_mirror,
                );
            }
            (material, spectra.profile.take())
        })
        .unzip();
    said.warn(check);
    made
}

/// The material's name, or what a nameless one is called in messages and side files.
pub(crate) fn name_of(raw: &RawMaterial) -> String {
    match raw.index {
        _ if !raw.name.is_empty() => raw.name.clone(),
        Some(index) => format!("material {index}"),
        None => "default material".into(),
    }
}

/// The raw material with its numbers in range; what is not a number or below 0 is a problem.
fn checked(raw: &RawMaterial, place: &str, check: &mut Check) -> RawMaterial {
    let mut raw = raw.clone();
    let mut sound = |value: &mut f32, what: &str| {
        if !value.is_finite() || *value < 0.0 {
            let what = format!("{what} is {value}");
            check.problem(place, what, "give a finite number of at least 0");
            *value = 0.0;
        }
    };
    raw.base_color_factor
        .iter_mut()
        .for_each(|v| sound(v, "a component of baseColorFactor"));
    raw.emissive_factor
        .iter_mut()
        .for_each(|v| sound(v, "a component of emissiveFactor"));
    sound(&mut raw.emissive_strength, "emissiveStrength");
    sound(&mut raw.alpha_cutoff, "alphaCutoff");
    raw
}

/// The material without its emission, and whether its albedo had to be brought down.
fn paint(
    raw: &RawMaterial,
    name: &str,
    measured: Option<&Sampled>,
    upsampler: &Upsampler,
) -> (Material, bool) {
    let [r, g, b, alpha] = raw.base_color_factor;
    let base_color = [r, g, b].map(|c| c.min(1.0));
    let (reflectance, from) = match measured {
        Some(measured) => (measured.spectrum, measured.from.clone()),
        None => (
            upsampler.reflectance(base_color),
            format!("colour {r:.3} {g:.3} {b:.3}, upsampled"),
        ),
    };
    let bright = reflectance.iter().any(|v| *v > GREATEST_ALBEDO);
    let material = Material {
        name: name.into(),
        index: raw.index,
        sides: if raw.double_sided {
            Sides::Both
        } else {
            Sides::Front
        },
        reflectance: reflectance.map(|v| v.min(GREATEST_ALBEDO)),
        reflectance_from: from,
        base_color: if measured.is_some() {
            [1.0; 3]
        } else {
            base_color
        },
        paint: raw
            .base_color_texture
            .clone()
            .filter(|_| measured.is_none()),
        vertex_paint: measured.is_none(),
        emission: None,
        pane: None,
        sheet: None,
        mirror: None,
        fluorescence: None,
        alpha: match raw.alpha_mode {
            AlphaMode::Mask => Alpha::Mask {
                cutoff: raw.alpha_cutoff,
                factor: alpha,
                texture: raw.base_color_texture.clone(),
            },
            AlphaMode::Opaque | AlphaMode::Blend => Alpha::Opaque,
        },
    };
    (material, bright)
}

fn emission(
    raw: &RawMaterial,
    spectra: &MaterialSpectra,
    place: &str,
    lamps: &mut LampSpectra,
    check: &mut Check,
) -> Option<Emission> {
    let nits = f64::from(raw.emissive_strength) * lamps.luminance(raw.emissive_factor);
    let lamp: ScaledSpectrum = match &spectra.emission {
        Some((spectrum, luminance)) => {
            let size = match luminance {
                Some(luminance) => Some(*luminance),
                None if spectrum.is_csv => None,
                None => Some(nits),
            };
            if size == Some(0.0) {
                if luminance.is_none() {
                    let what = format!(
                        "'{}' has no luminance, and the material emits nothing by itself",
                        spectrum.from
                    );
                    check.problem(place, what, "add \"luminance_cd_m2\" to its emission");
                }
                return None;
            }
            let bright = size.unwrap_or_else(|| lamps.own_size(spectrum));
            if !bearable(bright, "cd/m2", place, check) {
                return None;
            }
            lamps.by_spectrum(spectrum, size)
        }
        None if nits > 0.0 => {
            if !bearable(nits, "cd/m2", place, check) {
                return None;
            }
            lamps.by_colour(raw.emissive_factor, f64::from(raw.emissive_strength))
        }
        None => return None,
    };
    Some(Emission {
        light: lamp.light,
        shape: lamp.shape,
        texture: raw.emissive_texture.clone(),
        color: lamp.color,
        scale: lamp.scale,
        from: lamp.from,
        profile: None,
    })
}

/// The emission of a surface that shines by a profile, of luminance 1 until it is known how large the surface is.
fn shining(
    raw: &RawMaterial,
    wish: &ProfileWish,
    spectrum: Option<&(Sampled, Option<f64>)>,
    place: &str,
    lamps: &mut LampSpectra,
    check: &mut Check,
) -> Option<Emission> {
    if spectrum.is_some_and(|(_, luminance)| luminance.is_some()) {
        let what = "has a luminance and a profile, which says how bright it is";
        check.problem(place, what, "take out \"luminance_cd_m2\", or the profile");
    }
    if raw.emissive_texture.is_some() {
        check.warn(format!(
            "{place}: its emissive texture is passed over, it shines by its profile"
        ));
    }
    let own = lamps.luminance(raw.emissive_factor);
    let lamp = match spectrum {
        _ if wish.flux <= 0.0 => {
            check.warn(format!("{place}: gives no light (its flux is 0)"));
            return None;
        }
        Some((spectrum, _)) => lamps.by_spectrum(spectrum, Some(1.0)),
        None if own > 0.0 => lamps.by_colour(raw.emissive_factor, 1.0 / own),
        None => {
            let what = "has a profile, but neither a spectrum nor an emissive colour";
            check.problem(place, what, "name a spectrum: \"name\": \"cie/LED-B3\"");
            return None;
        }
    };
    Some(Emission {
        light: lamp.light,
        shape: lamp.shape,
        texture: None,
        color: lamp.color,
        scale: lamp.scale,
        from: lamp.from,
        profile: Some(Arc::clone(&wish.profile)),
    })
}

impl MaterialNotes {
    fn hear(&mut self, raw: &RawMaterial, name: &str, bright: bool, is_mirror: bool) {
        if bright {
            self.bright.push(name.into());
        }
        // glTF's default material is a metal on paper only.
        if raw.metallic > METALLIC && raw.index.is_some() && !is_mirror {
            match raw.has_metal_texture {
                true => self.metals_by_texture.push(name.into()),
                false => self.metals.push(name.into()),
            }
        }
        if raw.unlit {
            self.unlit.push(name.into());
        }
    }

    fn warn(&self, check: &mut Check) {
        let warnings = [
            (
                &self.metals,
                "metallic: matt, with the base colour as albedo",
            ),
            (
                &self.metals_by_texture,
                "where it is a metal and how rough is said by a metallicRoughnessTexture, which is not used: matt everywhere, with the base \
                 colour as albedo",
            ),
            (
                &self.unlit,
                "KHR_materials_unlit: lit all the same, as paint of the base colour",
            ),
            (&self.bright, "albedo above 0.999: brought down to 0.999"),
        ];
        for (names, what) in warnings {
            if !names.is_empty() {
                let names: Vec<String> = names.iter().map(|n| format!("'{}'", short(n))).collect();
                check.warn(format!("{what} ({})", listed(&names)));
            }
        }
        self.panes.warn(check);
        self.sheets.warn(check);
        self.mirrors.warn(check);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{KM, Observer};
    use crate::data::BANDS;
    use crate::scene::LightSpectrum;
    use serde_json::json;

    fn raw(name: &str, color: [f32; 3]) -> RawMaterial {
        let [r, g, b] = color;
        RawMaterial {
            index: Some(0),
            name: name.into(),
            base_color_factor: [r, g, b, 1.0],
            metallic: 0.0,
            ..RawMaterial::default()
        }
    }

    fn made(raw: &[RawMaterial]) -> (Vec<Material>, Vec<LightSpectrum>, Vec<String>, Vec<String>) {
        let grid = Grid::default();
        let upsampler = Upsampler::new(&grid);
        let mut lamps = LampSpectra::new(&grid, &upsampler);
        let mut check = Check::new("room.glb");
        let room = Path::new("room.glb");
        let file = SpectraFile::default();
        let (mut made, _) = materials(
            raw,
            &vec![false; raw.len()],
            &[],
            &file,
            room,
            &grid,
            &upsampler,
            &mut lamps,
            &mut check,
        );
        let spectra = lamps.finish(&mut made, &mut []);
        let (problems, warnings) = check.into_parts();
        (
            made,
            spectra,
            problems.iter().map(ToString::to_string).collect(),
            warnings,
        )
    }

    /// Luminance, cd/m2, by the definition.
    fn luminance(material: &Material, spectra: &[LightSpectrum]) -> f64 {
        let y = Observer::cie1931().weights(&Grid::default())[1];
        let emission = material.emission.as_ref().unwrap();
        (0..BANDS)
            .map(|i| KM * spectra[emission.light].power[i] * emission.shape[i] * y[i])
            .sum()
    }

    #[test]
    fn greys_are_flat_and_white_is_brought_down() {
        let (materials, _, problems, warnings) =
            made(&[raw("grey", [0.5; 3]), raw("white", [1.0; 3])]);
        assert_eq!(materials[0].reflectance, [0.5; BANDS]);
        assert_eq!(materials[1].reflectance, [GREATEST_ALBEDO; BANDS]);
        assert_eq!(problems, Vec::<String>::new());
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].contains("0.999 ('white')"), "{warnings:?}");
    }

    #[test]
    fn emissive_luminance_is_strength_times_y() {
        let mut lamp = raw("lamp", [0.8; 3]);
        lamp.emissive_factor = [1.0, 0.5, 0.25];
        lamp.emissive_strength = 2000.0;
        let mut dark = lamp.clone();
        dark.emissive_factor = [0.0; 3];
        let mut cool = lamp.clone();
        cool.emissive_factor = [0.2, 0.4, 0.8];
        let (materials, spectra, ..) = made(&[lamp, dark, cool]);
        let y = |c: [f64; 3]| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
        assert!(
            (luminance(&materials[0], &spectra) / (2000.0 * y([1.0, 0.5, 0.25])) - 1.0).abs()
                < 1e-3
        );
        assert!(materials[1].emission.is_none());
        assert!(
            (luminance(&materials[2], &spectra) / (2000.0 * y([0.2, 0.4, 0.8])) - 1.0).abs() < 1e-3
        );
        assert_eq!(spectra.len(), 1);
        // Who works out a texel does it as scale * upsample(color * texel): at a white texel it is the shape.
        let emission = materials[0].emission.as_ref().unwrap();
        let upsampler = Upsampler::new(&Grid::default());
        let texel = upsampler
            .reflectance(emission.color)
            .map(|r| r * emission.scale);
        for (a, b) in texel.iter().zip(&emission.shape) {
            assert!((a / b - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn emission_by_name_and_by_table() {
        let folder = tempfile::tempdir().unwrap();
        // 0.01 W/m2/sr/nm from 300 to 800 nm.
        std::fs::write(folder.path().join("tube.csv"), "300,0.01\n800,0.01\n").unwrap();
        let with = |extras| RawMaterial {
            extras: Some(extras),
            ..raw("lamp", [0.8; 3])
        };
        let mut keeps = with(json!({"emission": {"name": "cie/F2"}}));
        keeps.emissive_factor = [1.0; 3];
        keeps.emissive_strength = 300.0;
        let raws = [
            with(json!({"emission": {"name": "cie/F2", "luminance_cd_m2": 5000}})),
            with(json!({"emission": {"csv": "tube.csv"}})),
            with(json!({"emission": {"csv": "tube.csv", "luminance_cd_m2": 70}})),
            keeps,
            with(json!({"emission": {"name": "cie/F2"}})),
        ];
        let grid = Grid::default();
        let upsampler = Upsampler::new(&grid);
        let mut lamps = LampSpectra::new(&grid, &upsampler);
        let mut check = Check::new("room.glb");
        let room = folder.path().join("room.glb");
        let file = SpectraFile::default();
        let (mut made, _) = materials(
            &raws,
            &[false; 5],
            &[],
            &file,
            &room,
            &grid,
            &upsampler,
            &mut lamps,
            &mut check,
        );
        let spectra = lamps.finish(&mut made, &mut []);
        assert_eq!(spectra.len(), 2, "equal spectra are one");
        assert!((luminance(&made[0], &spectra) - 5000.0).abs() < 1e-6);
        // The integral of y_bar is 106.857 nm, less than 0.01 nm of it beyond 380 to 780 nm.
        assert!((luminance(&made[1], &spectra) - 683.0 * 106.857 * 0.01).abs() < 0.1);
        let band = Grid::default().band_of(555.0).unwrap();
        let radiance = spectra[1].power[band] * made[1].emission.as_ref().unwrap().shape[band];
        assert!((radiance - 0.01).abs() < 1e-12);
        assert!((luminance(&made[2], &spectra) - 70.0).abs() < 1e-9);
        assert!((luminance(&made[3], &spectra) - 300.0).abs() < 1e-9);
        assert!(made[4].emission.is_none());
        let (problems, _) = check.into_parts();
        assert_eq!(problems.len(), 1);
        assert!(problems[0].what.contains("no luminance"), "{problems:?}");
    }

    #[test]
    fn a_measured_reflectance_takes_the_place_of_colour_texture_and_vertex_colour() {
        let texture = super::super::Texture {
            image: 0,
            texcoord: 0,
            transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            wrap: [super::super::Wrap::Repeat; 2],
        };
        let mut wall = raw("wall", [0.2, 0.3, 0.4]);
        wall.base_color_texture = Some(texture);
        let mut measured = wall.clone();
        measured.extras = Some(json!({"reflectance": {"name": "cornell/red"}}));
        let (materials, ..) = made(&[wall, measured]);
        assert!(materials[0].paint.is_some() && materials[0].vertex_paint);
        assert!(materials[1].paint.is_none() && !materials[1].vertex_paint);
        assert_eq!(materials[1].base_color, [1.0; 3]);
        assert_eq!(materials[1].reflectance_from, "cornell/red");
        assert!(materials[1].reflectance[50] > 5.0 * materials[1].reflectance[10]);
        let upsampler = Upsampler::new(&Grid::default());
        let paint = [0.5, 0.25, 1.0];
        assert_eq!(
            materials[1].reflectance_at(paint, &upsampler),
            materials[1].reflectance
        );
        let painted = upsampler.rgb(&materials[0].reflectance_at(paint, &upsampler));
        for (seen, wanted) in painted.into_iter().zip([0.1, 0.075, 0.4]) {
            assert!((seen - wanted).abs() < 1e-4, "{seen} {wanted}");
        }
    }

    #[test]
    fn warnings_and_problems_name_the_material() {
        let mut steel = raw("steel", [0.6; 3]);
        steel.metallic = 1.0;
        let mut glass = raw("glass", [0.9; 3]);
        glass.alpha_mode = AlphaMode::Blend;
        let mut sign = raw("sign", [0.9; 3]);
        sign.unlit = true;
        let mut bad = raw("bad", [f32::NAN, -1.0, 0.5]);
        bad.emissive_strength = f32::INFINITY;
        let nameless = RawMaterial {
            index: Some(7),
            ..raw("", [0.1; 3])
        };
        let (materials, _, problems, warnings) = made(&[steel, glass, sign, bad, nameless]);
        for name in ["metallic", "'steel'", "BLEND", "'glass'", "unlit", "'sign'"] {
            assert!(warnings.join("\n").contains(name), "{name}");
        }
        assert_eq!(problems.len(), 3, "{problems:?}");
        assert!(problems.iter().all(|p| p.contains("material 'bad'")));
        assert!(materials[1].pane.is_some() && materials[0].pane.is_none());
        assert_eq!(materials[4].name, "material 7");
        assert!(
            materials
                .iter()
                .all(|m| m.reflectance.iter().all(|r| (0.0..=0.999).contains(r)))
        );
    }
}
