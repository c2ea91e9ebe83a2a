//! Light spectra and punctual lights.
//!
//! A lamp is `power(leaf) * shape(leaf)`: `power` is shared by all lamps of one kind ([`LightSpectrum`], here always of
//! luminous size 1: `683 lm/W * sum power * y_bar = 1`), `shape` is the lamp's own. A lamp with a measured or named
//! spectrum has a constant shape, its luminance (cd/m2), intensity (cd) or illuminance (lx). A lamp given by a colour
//! is D65 shaped by the upsampled colour; its luminous size is glTF's strength or intensity times the luminance Y of
//! the linear colour, so that a lamp keeps its brightness when it gets a spectrum instead. If all lamps given by
//! colour have one and the same colour, the colour goes into the shared power: one kind of lamp, one light spectrum.
//!
//! KHR_lights_punctual's `range` is a cut-off of renderers, not of light: it is passed over with a warning.

use super::check::Check;
use super::json::short;
use super::known::Sampled;
use super::luminaires::{IesNode, LampWish, Luminaire, ProfileWish, tilt_share};
use super::profile::Profile;
use super::raw::{RawLight, RawLightKind};
use super::spectra_file::SpectraFile;
use super::{LightKind, LightSpectrum, Material, PunctualLight};
use crate::color::{KM, Observer, Upsampler};
use crate::data::{Grid, LEAVES, Leaves};
use crate::data::{Outside, named};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;

/// Name of the spectrum of all lamps that are given by colour.
const BY_COLOUR: &str = "cie/D65";

/// Greatest component of a lamp's colour before it is upsampled. An emission has no bound of 1, and darker colours have
/// smoother spectra: at 1 a saturated lamp would come out as a box.
const LAMP_BRIGHTNESS: f64 = 0.5;

/// Brighter lamps (cd/m2, cd, lx) are an input fault. Light is carried in f32, up to 3e38; squares of it are summed, and
/// near a lamp, or where an albedo of .999 holds the light, it is a thousand times as strong. The sun has 2e9 cd/m2.
pub(crate) const GREATEST_SIZE: f64 = 1e15;

/// Says so where a lamp's luminous size is not one that can be carried; true where it is.
pub(crate) fn bearable(size: f64, unit: &str, place: &str, check: &mut Check) -> bool {
    // Written so that NaN fails.
    let bears = size <= GREATEST_SIZE;
    if !bears {
        let what = format!("gives out {size:.3e} {unit}, more than can be reckoned with");
        let next = format!("give at most {GREATEST_SIZE:e} {unit} (the sun has 2e9 cd/m2)");
        check.problem(place, what, next);
    }
    bears
}

/// Shapes of one colour differ by no more than this, relative.
const SAME_SHAPE: f64 = 1e-9;

/// A lamp's part: which spectrum, and what to multiply it by.
#[derive(Debug, Clone)]
pub(crate) struct Lamp {
    /// Index in [`Lamps::spectra`].
    pub(crate) light: usize,
    /// Multiplier for each leaf.
    pub(crate) shape: Leaves,
    /// The colour that was upsampled, greatest component 0.5.
    pub(crate) color: [f32; 3],
    /// Multiplier of the upsampled `color`.
    pub(crate) scale: f64,
    /// In words.
    pub(crate) from: String,
}

/// The distinct light spectra of a room, in order of first use.
pub(crate) struct Lamps<'a> {
    grid: &'a Grid,
    upsampler: &'a Upsampler,
    /// KM times the nm-integrals of y_bar.
    luminous: Leaves,
    spectra: Vec<LightSpectrum>,
}

impl<'a> Lamps<'a> {
    /// None yet.
    pub(crate) fn new(grid: &'a Grid, upsampler: &'a Upsampler) -> Self {
        let luminous = Observer::cie1931().weights(grid)[1].map(|y| KM * y);
        Self {
            grid,
            upsampler,
            luminous,
            spectra: Vec::new(),
        }
    }

    /// A lamp of a linear colour (components at least 0, one above) and a luminous size for (1, 1, 1).
    pub(crate) fn by_colour(&mut self, color: [f32; 3], size: f64) -> Lamp {
        let brightest = color.iter().fold(0.0f32, |m, &c| m.max(c));
        let scale = f64::from(brightest) / LAMP_BRIGHTNESS;
        let color = color.map(|c| (f64::from(c) / scale) as f32);
        let scale = scale * size;
        let d65 = named(BY_COLOUR).expect("D65 is built in").table;
        let (light, _) = self.add(BY_COLOUR, self.grid.means(&d65, Outside::Hold));
        let shape = self.upsampler.reflectance(color).map(|r| r * scale);
        let [r, g, b] = color.map(|c| c / LAMP_BRIGHTNESS as f32);
        Lamp {
            light,
            shape,
            color,
            scale,
            from: format!("colour {r:.3} {g:.3} {b:.3} of {BY_COLOUR}"),
        }
    }

    /// A lamp of a known spectrum and luminous size; none: the size of the spectrum itself.
    pub(crate) fn by_spectrum(&mut self, spectrum: &Sampled, size: Option<f64>) -> Lamp {
        let (light, own) = self.add(&spectrum.from, spectrum.leaves);
        let size = size.unwrap_or(own);
        let color = [LAMP_BRIGHTNESS as f32; 3];
        Lamp {
            light,
            shape: [size; LEAVES],
            color,
            scale: size / LAMP_BRIGHTNESS,
            from: spectrum.from.clone(),
        }
    }

    /// The luminous size that a spectrum has by itself.
    pub(crate) fn own_size(&self, spectrum: &Sampled) -> f64 {
        self.size_of(&spectrum.leaves)
    }

    fn size_of(&self, power: &Leaves) -> f64 {
        power.iter().zip(&self.luminous).map(|(p, y)| p * y).sum()
    }

    /// Shares `power`, brought to luminous size 1, among the lamps of the same spectrum; returns the size it had.
    fn add(&mut self, name: &str, power: Leaves) -> (usize, f64) {
        let size = self.size_of(&power);
        let unit = power.map(|p| p / size);
        let same = self.spectra.iter().position(|s| s.power == unit);
        let light = same.unwrap_or_else(|| {
            self.spectra.push(LightSpectrum {
                name: name.into(),
                power: unit,
            });
            self.spectra.len() - 1
        });
        (light, size)
    }

    /// Luminance Y of a linear colour, (1, 1, 1) has 1.
    pub(crate) fn luminance(&self, color: [f32; 3]) -> f64 {
        self.upsampler.luminance(color.map(f64::from))
    }

    /// The spectra, when all lamps are known. Where all that are given by colour have one colour, it becomes part of
    /// the spectrum and their shapes become constants.
    pub(crate) fn finish(
        mut self,
        materials: &mut [Material],
        lights: &mut [PunctualLight],
    ) -> Vec<LightSpectrum> {
        let Some(light) = self.spectra.iter().position(|s| s.name == BY_COLOUR) else {
            return self.spectra;
        };
        let emissions = || {
            materials
                .iter()
                .filter_map(|m| m.emission.as_ref())
                .filter(|e| e.light == light)
        };
        if emissions().any(|e| e.texture.is_some()) {
            return self.spectra;
        }
        let shapes: Vec<Leaves> = emissions()
            .map(|e| e.shape)
            .chain(lights.iter().filter(|l| l.light == light).map(|l| l.shape))
            .collect();
        let Some(first) = shapes.first() else {
            return self.spectra;
        };
        let one = self.luminous_size(light, first);
        let unit = first.map(|s| s / one);
        let alike = |shape: &Leaves, size: f64| {
            shape
                .iter()
                .zip(&unit)
                .all(|(s, u)| (s - u * size).abs() <= SAME_SHAPE * size * u)
        };
        let sizes: Vec<f64> = shapes
            .iter()
            .map(|s| self.luminous_size(light, s))
            .collect();
        if shapes
            .iter()
            .zip(&sizes)
            .any(|(shape, size)| !alike(shape, *size))
        {
            return self.spectra;
        }
        let mut sizes = sizes.into_iter();
        for emission in materials
            .iter_mut()
            .filter_map(|m| m.emission.as_mut())
            .filter(|e| e.light == light)
        {
            let size = sizes.next().expect("one size for each lamp");
            emission.shape = [size; LEAVES];
            emission.color = [LAMP_BRIGHTNESS as f32; 3];
            emission.scale = size / LAMP_BRIGHTNESS;
        }
        for (lamp, size) in lights.iter_mut().filter(|l| l.light == light).zip(sizes) {
            lamp.shape = [size; LEAVES];
        }
        if unit.iter().any(|u| *u != unit[0]) {
            self.spectra[light].name = format!("{BY_COLOUR} in one colour");
        }
        self.spectra[light]
            .power
            .iter_mut()
            .zip(unit)
            .for_each(|(p, u)| *p *= u);
        self.spectra
    }

    /// Tells the luminous size of a finished spectrum under a shape.
    pub(crate) fn luminous(&self) -> impl Fn(&LightSpectrum, &Leaves) -> f64 + use<> {
        let luminous = self.luminous;
        move |spectrum, shape| {
            let leaves = spectrum.power.iter().zip(shape).zip(&luminous);
            leaves.map(|((p, s), y)| p * s * y).sum()
        }
    }

    /// Luminous size of a spectrum under a shape.
    fn luminous_size(&self, light: usize, shape: &Leaves) -> f64 {
        let power = &self.spectra[light].power;
        (0..LEAVES)
            .map(|leaf| power[leaf] * shape[leaf] * self.luminous[leaf])
            .sum()
    }
}

/// The punctual lights of a document.
pub(crate) fn punctual(
    raw: &[RawLight],
    profiles: &[Option<Arc<Profile>>],
    file: &SpectraFile,
    room: &Path,
    lamps: &mut Lamps,
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
    lamps: &mut Lamps,
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
    use super::*;
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
        let mut lamps = Lamps::new(&grid, &upsampler);
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
        (0..LEAVES)
            .map(|i| 683.0 * power[i] * light.shape[i] * y[i])
            .sum()
    }

    #[test]
    fn a_white_lamp_has_its_candela_and_one_flat_shape() {
        let (lights, spectra, ..) = made(&[raw(RawLightKind::Point, [1.0; 3], 100.0)]);
        assert!((size(&lights[0], &spectra) - 100.0).abs() < 1e-9);
        assert_eq!(lights[0].shape, [lights[0].shape[0]; LEAVES]);
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
        assert!(lights.iter().all(|l| l.shape == [l.shape[0]; LEAVES]));
        assert!((size(&lights[1], &spectra) / size(&lights[0], &spectra) - 3.0).abs() < 1e-12);

        let (lights, spectra, ..) = made(&[
            raw(RawLightKind::Point, warm, 10.0),
            raw(RawLightKind::Point, [0.6, 0.8, 1.0], 10.0),
        ]);
        assert_eq!((spectra.len(), spectra[0].name.as_str()), (1, "cie/D65"));
        assert!(lights.iter().all(|l| l.shape != [l.shape[0]; LEAVES]));
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
