//! The punctual lights of a document, with their spectra and profiles.
//!
//! KHR_lights_punctual's `range` is a cut-off of renderers, not of light: it is passed over with a warning.

use super::check::Check;
use super::json::short;
use super::lamp_spectra::{LampSpectra, bearable};
use super::luminaires::{IesNode, LampWish, Luminaire, ProfileWish, tilt_share};
use super::profile::Profile;
use super::raw::{RawLight, RawLightKind};
use super::reader::Sampled;
use super::spectra_file::SpectraFile;
use super::{LightKind, PunctualLight};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;

/// The punctual lights of a document.
pub(crate) fn punctual(
    raw: &[RawLight],
    profiles: &[Option<Arc<Profile>>],
    file: &SpectraFile,
    room: &Path,
    lamps: &mut LampSpectra,
    check: &mut Check,
) -> Vec<PunctualLight> {
    let grid = lamps.grid;
    raw.iter()
        .filter_map(|light| {
            let name = name_of(light);
            let place = format!("node {}, light '{}'", light.node, short(&name));
            let values = light.color.iter().chain([&light.intensity]);
            if values.clone().any(|v| !v.is_finite() || *v < 0.0) {
                let what = "has a colour or intensity that is negative or not a number";
                check.problem(&place, what, "give numbers of at least 0");
                return None;
            }
            let (position, direction) = placed(light, &place, check)?;
            if light.range.is_some() {
                check.warn(format!("{place}: 'range' is passed over, light has none"));
            }
            let size = f64::from(light.intensity) * lamps.luminance(light.color);
            // Read before the light is passed over for being dark, so that what is wrong in it is said.
            let said = file.light(&name, light.extras.as_ref(), room, grid, check);
            let LampWish { spectrum, profile } = said.unwrap_or_default();
            if let Some(wish) = profile_of(light, profile, profiles) {
                let lamp = measured(light, &wish, spectrum.as_ref(), &place, lamps, check)?;
                return Some(PunctualLight {
                    name,
                    node: Some(light.node),
                    position,
                    ..lamp
                });
            }
            if light.kind == RawLightKind::Profile {
                // Why there is none was said.
                return None;
            }
            if size == 0.0 {
                check.warn(format!(
                    "{place}: gives no light (its colour or intensity is 0)"
                ));
                return None;
            }
            if !bearable(size, unit(light.kind), &place, check) {
                return None;
            }
            let lamp = match spectrum {
                Some(spectrum) => lamps.by_spectrum(&spectrum, Some(size)),
                None => lamps.by_colour(light.color, f64::from(light.intensity)),
            };
            let kind = match light.kind {
                RawLightKind::Point | RawLightKind::Profile => LightKind::Point,
                RawLightKind::Spot => LightKind::Spot {
                    inner: f64::from(light.inner),
                    outer: f64::from(light.outer),
                },
                RawLightKind::Directional => LightKind::Directional,
            };
            Some(PunctualLight {
                name,
                kind,
                node: Some(light.node),
                position,
                direction,
                light: lamp.light,
                shape: lamp.shape,
                luminaire: None,
            })
        })
        .collect()
}

/// Where a light stands and which way it shines; none where it cannot, which is said.
fn placed(light: &RawLight, place: &str, check: &mut Check) -> Option<(DVec3, DVec3)> {
    let position = light.to_world.transform_point3(DVec3::ZERO);
    let direction = light
        .to_world
        .transform_vector3(DVec3::NEG_Z)
        .try_normalize();
    let direction = match (light.kind, direction) {
        (_, Some(direction)) => direction,
        (RawLightKind::Point, None) => DVec3::NEG_Z,
        (_, None) => {
            let what = "its node is scaled to nothing, so that it shines nowhere";
            check.problem(place, what, "give the node a scale that is not zero");
            return None;
        }
    };
    if !position.is_finite() {
        check.problem(place, "stands at no finite place", "mend the node's matrix");
        return None;
    }
    Some((position, direction))
}

/// The profile of a light: the side file's, or its node's.
fn profile_of(
    light: &RawLight,
    wish: Option<ProfileWish>,
    profiles: &[Option<Arc<Profile>>],
) -> Option<ProfileWish> {
    let own = |ies: &IesNode| {
        let profile = profiles.get(ies.light)?.clone()?;
        Some(ProfileWish {
            flux: profile.flux() * ies.multiplier,
            profile,
            turn_deg: 0.0,
        })
    };
    wish.or_else(|| light.ies.as_ref().and_then(own))
}

/// A light that shines by a profile, at no place yet. Its spectrum says nothing of how bright it is; a colour of
/// EXT_lights_ies takes of the profile's light, one of KHR_lights_punctual only tints it.
fn measured(
    light: &RawLight,
    wish: &ProfileWish,
    spectrum: Option<&Sampled>,
    place: &str,
    lamps: &mut LampSpectra,
    check: &mut Check,
) -> Option<PunctualLight> {
    if light.kind == RawLightKind::Directional {
        let what = "is parallel light, which a profile cannot spread";
        check.problem(place, what, "make it a point or a spot");
        return None;
    }
    let profile = Arc::clone(&wish.profile);
    let Some(luminaire) = Luminaire::at_node(profile, &light.to_world, wish.turn_deg) else {
        let what = "its node is scaled to nothing, so that its profile has no direction";
        check.problem(place, what, "give the node a scale that is not zero");
        return None;
    };
    let tint = light.ies.as_ref().map_or([1.0; 3], |ies| ies.color);
    let own = lamps.luminance(light.color);
    let flux = wish.flux * tilt_share(&luminaire) * lamps.luminance(tint);
    if flux == 0.0 || own == 0.0 {
        check.warn(format!(
            "{place}: gives no light (its flux or its colour is 0)"
        ));
        return None;
    }
    if !bearable(flux, "lm", place, check) {
        return None;
    }
    let color: [f32; 3] = std::array::from_fn(|k| light.color[k] * tint[k]);
    let lamp = match spectrum {
        Some(spectrum) => lamps.by_spectrum(spectrum, Some(flux)),
        None if lamps.luminance(color) > 0.0 => {
            lamps.by_colour(color, flux / lamps.luminance(color))
        }
        None => lamps.by_colour([1.0; 3], flux),
    };
    Some(PunctualLight {
        name: String::new(),
        kind: LightKind::Profile,
        node: None,
        position: DVec3::ZERO,
        direction: luminaire.nadir(),
        light: lamp.light,
        shape: lamp.shape,
        luminaire: Some(Arc::new(luminaire)),
    })
}

/// What a light's intensity is given in.
fn unit(kind: RawLightKind) -> &'static str {
    match kind {
        RawLightKind::Directional => "lx",
        RawLightKind::Point | RawLightKind::Spot | RawLightKind::Profile => "cd",
    }
}

/// The light's name, or what a nameless one is called in messages and side files.
pub(crate) fn name_of(light: &RawLight) -> String {
    if light.name.is_empty() {
        format!("light of node {}", light.node)
    } else {
        light.name.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::super::LightSpectrum;
    use super::*;
    use crate::color::{Observer, Upsampler};
    use crate::data::{BANDS, Grid};
    use glam::DMat4;
    use serde_json::json;

    fn raw(kind: RawLightKind, color: [f32; 3], intensity: f32) -> RawLight {
        RawLight {
            name: "lamp".into(),
            kind,
            color,
            intensity,
            range: None,
            inner: 0.2,
            outer: 0.5,
            extras: None,
            node: 3,
            to_world: DMat4::from_translation(glam::dvec3(1.0, 2.0, 3.0)),
            ies: None,
        }
    }

    fn made(
        raw: &[RawLight],
    ) -> (
        Vec<PunctualLight>,
        Vec<LightSpectrum>,
        Vec<String>,
        Vec<String>,
    ) {
        let grid = Grid::default();
        let upsampler = Upsampler::new(&grid);
        let mut lamps = LampSpectra::new(&grid, &upsampler);
        let mut check = Check::new("room.glb");
        let room = Path::new("room.glb");
        let mut lights = punctual(
            raw,
            &[],
            &SpectraFile::default(),
            room,
            &mut lamps,
            &mut check,
        );
        let spectra = lamps.finish(&mut [], &mut lights);
        let (problems, warnings) = check.into_parts();
        (
            lights,
            spectra,
            problems.iter().map(ToString::to_string).collect(),
            warnings,
        )
    }

    /// Luminous size by the definition: 683 lm/W times the integral with y_bar.
    fn size(light: &PunctualLight, spectra: &[LightSpectrum]) -> f64 {
        let y = Observer::cie1931().weights(&Grid::default())[1];
        let power = &spectra[light.light].power;
        (0..BANDS)
            .map(|i| 683.0 * power[i] * light.shape[i] * y[i])
            .sum()
    }

    #[test]
    fn a_white_lamp_has_its_candela_and_one_flat_shape() {
        let (lights, spectra, ..) = made(&[raw(RawLightKind::Point, [1.0; 3], 100.0)]);
        assert!((size(&lights[0], &spectra) - 100.0).abs() < 1e-9);
        assert_eq!(lights[0].shape, [lights[0].shape[0]; BANDS]);
        assert_eq!((spectra.len(), spectra[0].name.as_str()), (1, "cie/D65"));
        assert_eq!(lights[0].position, glam::dvec3(1.0, 2.0, 3.0));
        assert_eq!(lights[0].direction, DVec3::NEG_Z);
    }

    #[test]
    fn a_coloured_lamp_has_intensity_times_y_of_its_colour() {
        let color = [1.0, 0.6, 0.2];
        let y = 0.2126 + 0.7152 * 0.6 + 0.0722 * 0.2;
        // The same lamp, its brightness moved between colour and intensity.
        for (color, intensity) in [(color, 50.0), (color.map(|c| c / 4.0), 200.0)] {
            let (lights, spectra, ..) = made(&[raw(RawLightKind::Spot, color, intensity)]);
            assert!((size(&lights[0], &spectra) - 50.0 * y).abs() < 0.01);
            assert_eq!(
                lights[0].kind,
                LightKind::Spot {
                    inner: f64::from(0.2f32),
                    outer: 0.5
                }
            );
        }
    }

    #[test]
    fn lamps_of_one_colour_share_it_and_lamps_of_two_do_not() {
        let warm = [1.0, 0.8, 0.6];
        let (lights, spectra, ..) = made(&[
            raw(RawLightKind::Point, warm, 10.0),
            raw(RawLightKind::Spot, warm, 30.0),
        ]);
        assert_eq!(spectra.len(), 1);
        assert_eq!(spectra[0].name, "cie/D65 in one colour");
        assert!(lights.iter().all(|l| l.shape == [l.shape[0]; BANDS]));
        assert!((size(&lights[1], &spectra) / size(&lights[0], &spectra) - 3.0).abs() < 1e-12);

        let (lights, spectra, ..) = made(&[
            raw(RawLightKind::Point, warm, 10.0),
            raw(RawLightKind::Point, [0.6, 0.8, 1.0], 10.0),
        ]);
        assert_eq!((spectra.len(), spectra[0].name.as_str()), (1, "cie/D65"));
        assert!(lights.iter().all(|l| l.shape != [l.shape[0]; BANDS]));
    }

    #[test]
    fn named_spectra_keep_the_brightness_and_equal_ones_are_one() {
        let mut a = raw(RawLightKind::Point, [1.0; 3], 10.0);
        a.extras = Some(json!({"name": "cie/F2"}));
        let mut b = raw(RawLightKind::Directional, [0.5; 3], 700.0);
        b.extras = Some(json!({"name": "cie/FL2"}));
        let (lights, spectra, problems, _) = made(&[a, b]);
        assert_eq!(problems, Vec::<String>::new());
        assert_eq!((spectra.len(), spectra[0].name.as_str()), (1, "cie/F2"));
        assert!((size(&lights[0], &spectra) - 10.0).abs() < 1e-9);
        assert!((size(&lights[1], &spectra) - 350.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_wrong_is_told_together() {
        let mut flat = raw(RawLightKind::Spot, [1.0; 3], 1.0);
        flat.to_world = DMat4::from_scale(DVec3::ZERO);
        let mut ranged = raw(RawLightKind::Point, [1.0; 3], 1.0);
        ranged.range = Some(4.0);
        let (lights, _, problems, warnings) = made(&[
            raw(RawLightKind::Point, [1.0; 3], -1.0),
            raw(RawLightKind::Point, [f32::NAN; 3], 1.0),
            raw(RawLightKind::Point, [1.0; 3], 0.0),
            flat,
            ranged,
        ]);
        assert_eq!(lights.len(), 1);
        // The first two are told in the same words at the same place, hence once.
        assert_eq!(problems.len(), 2, "{problems:?}");
        assert!(warnings.iter().any(|w| w.contains("gives no light")));
        assert!(warnings.iter().any(|w| w.contains("'range'")));
    }
}
