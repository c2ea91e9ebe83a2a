//! The lamps that a sky makes.

use super::sun::{angles, direction, position};
use super::wish::{Brightness, SkyType, SkyWish, SunPlace};
use super::{Distribution, Sky};
use crate::color::{KM, Observer};
use crate::data::{Grid, LEAVES, Outside, daylight, nearest_of};
use crate::scene::check::Check;
use crate::scene::json::short;
use crate::scene::{LightKind, LightSpectrum, PunctualLight};
use glam::{DQuat, DVec3};

/// Illuminance of open ground under a sky of which nothing more is said, not even where the sun stands: an overcast day, lx.
const USUAL_LUX: f64 = 10_000.0;
/// Reflectance of open ground, of which nothing more is said: grass, earth and asphalt mixed, as daylight calculations take it.
const USUAL_GROUND: f64 = 0.2;
/// Correlated colour temperature of sunlight, K.
const SUN_KELVIN: f64 = 5500.0;
/// Name of a sun that is no light of the file.
const SUN_NAME: &str = "sun";
/// What the ground is called as far as the sun lights it.
pub(in crate::scene) const LIT_GROUND: &str = "ground in the sun";

/// Adds the lamps of the sky that is wished for to those of the file. `nodes`: names of nodes with the names of their lights.
pub(crate) fn join(
    wish: &SkyWish,
    nodes: &[(String, String)],
    grid: &Grid,
    lights: &mut Vec<PunctualLight>,
    spectra: &mut Vec<LightSpectrum>,
    check: &mut Check,
) -> Option<Sky> {
    if wish.is_empty() {
        return None;
    }
    let (kind, sun) = asked(wish, nodes, lights, check)?;
    let dome = Distribution::new(kind.0, sun.as_ref().map_or(DVec3::Y, |sun| sun.toward));
    let [elevation, azimuth] = angles(dome.sun());
    let azimuth = (azimuth - wish.north.unwrap_or(0.0)).rem_euclid(360.0);
    let usual = usual(kind, sun.as_ref().map(|_| elevation));
    let lux = match wish.brightness {
        Some(Brightness::Illuminance(lux)) => lux,
        Some(Brightness::Luminance(zenith)) => zenith / dome.zenith(),
        None => usual[0],
    };
    let kelvin = wish.kelvin.unwrap_or(usual_kelvin(kind));
    let ground = wish.ground.unwrap_or(USUAL_GROUND);
    let mut makes = Makes {
        grid,
        lights,
        spectra,
    };
    let light = makes.spectrum(kelvin);
    let sun_lux = sun.as_ref().map_or(0.0, |sun| {
        let own = sun.light.map(|k| makes.size_of(k));
        wish.sun.illuminance.or(own).unwrap_or(usual[1])
    });
    let mut sky = Sky {
        dome,
        said: format!(
            "CIE {} ({}), {lux:.0} lx on open ground, {kelvin:.0} K; ground {ground}",
            kind.0,
            kind.name()
        ),
        sun_said: None,
        sun_of_file: sun.as_ref().is_some_and(|sun| sun.light.is_some()),
    };
    makes.lamp("sky", LightKind::Sky, DVec3::NEG_Y, light, lux);
    makes.lamp("ground", LightKind::Ground, DVec3::Y, light, ground * lux);
    if sun_lux <= 0.0
        && let Some(Sun { light: Some(k), .. }) = sun
    {
        // A sun of the file without light is none.
        makes.lights.remove(k);
        sky.sun_of_file = false;
    }
    if let Some(sun) = sun.filter(|_| sun_lux > 0.0) {
        let kelvin = wish.sun.kelvin.unwrap_or(SUN_KELVIN);
        if let (Some(k), None) = (sun.light, wish.sun.kelvin) {
            let name = short(&makes.lights[k].name);
            check.warn(format!(
                "light '{name}' is the sun: its colour gives way to daylight of {kelvin:.0} K (\"cct_k\" sets another)"
            ));
        }
        makes.sun(&sun, sun_lux, kelvin, ground);
        sky.sun_said = Some(format!(
            "{elevation:.1} deg high, azimuth {azimuth:.1} deg, {sun_lux:.0} lx across its rays, {kelvin:.0} K"
        ));
    }
    Some(sky)
}

/// What kind of sky is asked for, and its sun; none where what is said does not go together, which is told.
fn asked(
    wish: &SkyWish,
    nodes: &[(String, String)],
    lights: &[PunctualLight],
    check: &mut Check,
) -> Option<(SkyType, Option<Sun>)> {
    let Some(kind) = wish.kind else {
        let what = "something is said of sky or sun, but not what the sky is like";
        let next = "give --sky clear, or \"type\" in the file of spectra";
        check.problem("sky", what, next);
        return None;
    };
    let sun = sun_of(wish, nodes, lights, check).ok()?;
    if sun.is_none() && Distribution::follows_sun(kind.0) {
        let what = format!("a sky that is {} is brightest about the sun", kind.name());
        let next =
            "say where the sun stands: --sun ELEVATION,AZIMUTH or \"sun\" in the file of spectra";
        check.problem("sky", what, next);
        return None;
    }
    Some((kind, sun))
}

/// Where the sun stands, and which light of the file it is.
struct Sun {
    toward: DVec3,
    light: Option<usize>,
}

fn sun_of(
    wish: &SkyWish,
    nodes: &[(String, String)],
    lights: &[PunctualLight],
    check: &mut Check,
) -> Result<Option<Sun>, ()> {
    let Some(place) = &wish.sun.place else {
        return Ok(None);
    };
    let north = DQuat::from_rotation_y(-wish.north.unwrap_or(0.0).to_radians());
    let (toward, light) = match place {
        &SunPlace::Angles { elevation, azimuth } => (north * direction(elevation, azimuth), None),
        SunPlace::Clock {
            latitude,
            longitude,
            time,
        } => match position(*latitude, *longitude, time) {
            Ok([elevation, azimuth]) => (north * direction(elevation, azimuth), None),
            Err(why) => {
                check.problem("sun", why, "give degrees north, degrees east and a time");
                return Err(());
            }
        },
        SunPlace::Light(name) => {
            let is = |light: &PunctualLight| {
                let node = |(node, of): &(String, String)| node == name && *of == light.name;
                light.kind == LightKind::Directional
                    && (light.name == *name || nodes.iter().any(node))
            };
            let Some(k) = lights.iter().position(is) else {
                let parallel = lights.iter().filter(|l| l.kind == LightKind::Directional);
                let names: Vec<String> = parallel.map(|l| l.name.clone()).collect();
                let next = match &nearest_of(name, &names)[..] {
                    [] => "the room has none: give elevation_deg and azimuth_deg".to_owned(),
                    near => format!("the nearest names are {}", near.join(", ")),
                };
                let what = format!("no directional light is named '{}'", short(name));
                check.problem("sun", what, next);
                return Err(());
            };
            (-lights[k].direction, Some(k))
        }
    };
    if toward.y <= 0.0 {
        let what = format!(
            "the sun stands {:.1} deg below the horizon",
            -angles(toward)[0]
        );
        check.problem("sun", what, "choose another time or place");
        return Err(());
    }
    Ok(Some(Sun { toward, light }))
}

/// Illuminance of open level ground by the sky, and of a plane across the sun's rays: IES RP-21 (Calculation of daylight
/// availability, 1984), lx.
fn usual(kind: SkyType, elevation: Option<f64>) -> [f64; 2] {
    let Some(elevation) = elevation else {
        return [USUAL_LUX, 0.0];
    };
    let height = elevation.to_radians().sin().max(1e-3);
    let sun = |extinction: f64| 127_500.0 * (-extinction / height).exp();
    match kind.name() {
        "clear" => [800.0 + 15_500.0 * height.sqrt(), sun(0.21)],
        "intermediate" => [300.0 + 45_000.0 * height, sun(0.80)],
        _ => [300.0 + 21_000.0 * height, 0.0],
    }
}

/// Correlated colour temperature of a sky of which nothing more is said, K.
fn usual_kelvin(kind: SkyType) -> f64 {
    match kind.name() {
        "clear" => 12_000.0,
        "intermediate" => 7500.0,
        _ => 6504.0,
    }
}

/// Where lamps and spectra go.
struct Makes<'a> {
    grid: &'a Grid,
    lights: &'a mut Vec<PunctualLight>,
    spectra: &'a mut Vec<LightSpectrum>,
}

impl Makes<'_> {
    /// Index of the spectrum of daylight, luminous size 1.
    fn spectrum(&mut self, kelvin: f64) -> usize {
        let luminous = Observer::cie1931().weights(self.grid)[1];
        let power = self.grid.means(&daylight(kelvin), Outside::Hold);
        let size: f64 = power.iter().zip(luminous).map(|(p, y)| KM * p * y).sum();
        let power = power.map(|p| p / size);
        let same = self.spectra.iter().position(|s| s.power == power);
        same.unwrap_or_else(|| {
            self.spectra.push(LightSpectrum {
                name: format!("daylight/{kelvin:.0}"),
                power,
            });
            self.spectra.len() - 1
        })
    }

    /// Adds the sun, or makes it of a light of the file; and the ground that it shines on.
    fn sun(&mut self, sun: &Sun, lux: f64, kelvin: f64, ground: f64) {
        let light = self.spectrum(kelvin);
        let exitance = ground * lux * sun.toward.y;
        let kind = LightKind::Ground;
        self.lamp(LIT_GROUND, kind, DVec3::Y, light, exitance);
        match sun.light {
            None => self.lamp(SUN_NAME, LightKind::Sun, -sun.toward, light, lux),
            Some(k) => {
                let lamp = &mut self.lights[k];
                lamp.kind = LightKind::Sun;
                (lamp.light, lamp.shape) = (light, [lux; LEAVES]);
            }
        }
    }

    /// Luminous size of a light of the file.
    fn size_of(&self, light: usize) -> f64 {
        let luminous = Observer::cie1931().weights(self.grid)[1];
        let light = &self.lights[light];
        let power = &self.spectra[light.light].power;
        (0..LEAVES)
            .map(|l| KM * power[l] * light.shape[l] * luminous[l])
            .sum()
    }

    /// Adds a lamp, if it shines.
    fn lamp(&mut self, name: &str, kind: LightKind, direction: DVec3, light: usize, lux: f64) {
        if lux > 0.0 {
            self.lights.push(PunctualLight {
                name: name.into(),
                kind,
                node: None,
                position: DVec3::ZERO,
                direction,
                light,
                shape: [lux; LEAVES],
                luminaire: None,
            });
        }
    }
}
