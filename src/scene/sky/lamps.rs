//! The lamps that a sky makes.

use super::Distribution;
use super::dome::Sky;
use super::light::{SkyLight, of_sun, usual};
use super::parts::PLACES;
use super::sun::{angles, direction, position};
use super::wish::{SkyType, SkyWish, SunPlace, TURBIDITY};
use crate::color::{KM, Observer};
use crate::data::{BANDS, Grid, Spectrum, nearest_of};
use crate::scene::check::{Check, listed};
use crate::scene::json::short;
use crate::scene::{LightKind, LightSpectrum, PunctualLight};
use glam::{DQuat, DVec3};

/// The type that is meant by clear.
const CLEAR: SkyType = SkyType(12);
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
    let put_out = wish.sun.place == Some(SunPlace::Nowhere);
    if put_out {
        lights.retain(|light| light.kind != LightKind::Directional);
    }
    let toward = sun.as_ref().map(|sun| sun.toward);
    let light = match (wish.turbidity.zip(toward), kind, &wish.map) {
        (Some((turbidity, sun)), ..) => SkyLight::of_air(wish, turbidity, sun, grid, check)?,
        (None, Some(kind), _) => SkyLight::of_type(wish, kind, toward, grid, check)?,
        (None, None, Some(path)) => SkyLight::of_map(wish, path, grid, check)?,
        (None, None, None) => return None,
    };
    let mut makes = Makes {
        grid,
        lights,
        spectra,
    };
    let (ground, own_sun) = (light.ground, light.sun.filter(|_| !put_out));
    if sun.is_none() && own_sun.is_none() && !put_out {
        sunless(wish, check);
        sun_of_file(makes.lights, check);
    }
    let (mut sky, spectrum) = makes.sky(light);
    let shining = match sun {
        Some(sun) => {
            // Of others nothing is known: the sun shines as it does in a clear sky.
            let usual = usual(kind.unwrap_or(CLEAR), Some(angles(sun.toward)[0]));
            makes.placed(wish, &sun, usual[1], check)
        }
        None => own_sun.and_then(|(toward, shape)| makes.of_map(wish, toward, spectrum, shape)),
    };
    if let Some(sun) = shining {
        if sun.light.is_none() {
            two_suns(makes.lights, check);
        }
        let lux = makes.size(sun.spectrum, &sun.shape);
        let [elevation, azimuth] = angles(sun.toward);
        let azimuth = (azimuth - wish.north.unwrap_or(0.0)).rem_euclid(360.0);
        sky.sun_said = Some(format!(
            "{elevation:.1} deg high, azimuth {azimuth:.1} deg, {lux:.0} lx across its rays, {}",
            sun.said
        ));
        sky.sun_of_file = sun.light.is_some();
        makes.sun(&sun, ground);
    }
    sky.bright = makes.bright();
    Some(sky)
}

/// Something is said of a sun that stands nowhere. That it has no light is nothing.
fn sunless(wish: &SkyWish, check: &mut Check) {
    let shines = wish.sun.illuminance.is_some_and(|lux| lux > 0.0);
    if shines || wish.sun.kelvin.is_some() {
        let what = "something is said of the sun's light, but not where it stands";
        let next = "give --sun ELEVATION,AZIMUTH or \"sun\" in the file of spectra, or leave out its illuminance and colour temperature";
        check.problem("sun", what, next);
    }
}

/// Names of the parallel lights of the file, and the first as it is.
fn parallel(lights: &[PunctualLight]) -> Option<(String, String)> {
    let parallel = lights.iter().filter(|l| l.kind == LightKind::Directional);
    let names: Vec<String> = parallel.map(|l| short(&l.name)).collect();
    let quoted: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    Some((listed(&quoted), names.into_iter().next()?))
}

/// Parallel light of the file goes on shining under a sky of which no sun is said.
fn sun_of_file(lights: &[PunctualLight], check: &mut Check) {
    if let Some((all, name)) = parallel(lights) {
        check.warn(format!(
            "parallel light of the file ({all}) shines on under this sky, as a sun would: --sun none, or \"sun\": false in the \"sky\" of the \
             file of spectra, puts it out; \"sun\": \"{name}\" there makes it the sun of the sky"
        ));
    }
}

/// Parallel light of the file beside a sun is a second one.
fn two_suns(lights: &[PunctualLight], check: &mut Check) {
    if let Some((all, name)) = parallel(lights) {
        check.warn(format!(
            "the sun shines beside parallel light of the file ({all}): two suns, if that is meant as one; \"sun\": \"{name}\" in the \"sky\" \
             of the file of spectra, without --sun, makes it the sun"
        ));
    }
}

/// What kind of sky is asked for, if it is no map, and its sun; none where what is said does not go together, which is told.
fn asked(
    wish: &SkyWish,
    nodes: &[(String, String)],
    lights: &[PunctualLight],
    check: &mut Check,
) -> Option<(Option<SkyType>, Option<Sun>)> {
    if wish.kind.is_none() && wish.map.is_none() && wish.turbidity.is_none() {
        let what = "something is said of sky or sun, but not what the sky is like";
        let next = "give --sky clear, or \"type\" in the file of spectra";
        check.problem("sky", what, next);
        return None;
    }
    let sun = sun_of(wish, nodes, lights, check).ok()?;
    if let Some(turbidity) = wish.turbidity
        && !(TURBIDITY[0]..=TURBIDITY[1]).contains(&turbidity)
    {
        let what = format!("the sky of Hosek and Wilkie has a turbidity of {turbidity}");
        let next = "give one from 1 (clean air) to 10 (haze)";
        check.problem("sky", what, next);
        return None;
    }
    let brightest = match (wish.turbidity, wish.kind) {
        (Some(_), _) => Some("of Hosek and Wilkie"),
        (None, Some(kind)) if Distribution::follows_sun(kind.0) => Some(kind.name()),
        _ => None,
    };
    if let (Some(name), None) = (brightest, &sun) {
        let what = format!("a sky that is {name} is brightest about the sun");
        let next =
            "say where the sun stands: --sun ELEVATION,AZIMUTH or \"sun\" in the file of spectra";
        check.problem("sky", what, next);
        return None;
    }
    Some((wish.kind, sun))
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
        SunPlace::Nowhere => return Ok(None),
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

/// A sun that shines.
struct Shining {
    toward: DVec3,
    /// The light of the file that it is.
    light: Option<usize>,
    spectrum: usize,
    shape: Spectrum,
    /// Its colour, in words.
    said: String,
}

/// Where lamps and spectra go.
struct Makes<'a> {
    grid: &'a Grid,
    lights: &'a mut Vec<PunctualLight>,
    spectra: &'a mut Vec<LightSpectrum>,
}

impl Makes<'_> {
    /// Index of a spectrum.
    fn add_spectrum(&mut self, spectrum: LightSpectrum) -> usize {
        let same = self.spectra.iter().position(|s| s.power == spectrum.power);
        same.unwrap_or_else(|| {
            self.spectra.push(spectrum);
            self.spectra.len() - 1
        })
    }

    /// Adds the lamps of a sky and of what lies below the horizon; also returns the index of their spectrum.
    fn sky(&mut self, light: SkyLight) -> (Sky, usize) {
        let spectrum = self.add_spectrum(light.spectrum);
        let mut below = light.below;
        if let Some(rho) = light.ground {
            let all = |l: usize| light.above.iter().map(|part| rho * part[l]).sum();
            below[0] = std::array::from_fn(all);
        }
        for (k, suffix) in light.names.iter().enumerate() {
            let (name, kind) = (format!("sky{suffix}"), LightKind::Sky(k as u8));
            self.lamp(&name, kind, DVec3::NEG_Y, spectrum, light.above[k]);
        }
        for (k, suffix) in light.names.iter().enumerate() {
            let suffix = if light.ground.is_some() { "" } else { suffix };
            let (name, kind) = (format!("ground{suffix}"), LightKind::Ground(k as u8));
            self.lamp(&name, kind, DVec3::Y, spectrum, below[k]);
        }
        let sky = Sky {
            dome: light.dome,
            said: light.said,
            sun_said: None,
            sun_of_file: false,
            below: light.ground.is_none(),
            bright: [0.0; PLACES],
        };
        (sky, spectrum)
    }

    /// The sun where it was asked for. A light of the file that has none is taken out.
    fn placed(
        &mut self,
        wish: &SkyWish,
        sun: &Sun,
        usual: f64,
        check: &mut Check,
    ) -> Option<Shining> {
        let own = sun.light.map(|k| self.size_of(k));
        let lux = wish.sun.illuminance.or(own).unwrap_or(usual);
        if lux <= 0.0 {
            if let Some(k) = sun.light {
                self.lights.remove(k);
            }
            return None;
        }
        let kelvin = wish.sun.kelvin.unwrap_or(SUN_KELVIN);
        if let (Some(k), None) = (sun.light, wish.sun.kelvin) {
            let name = short(&self.lights[k].name);
            check.warn(format!(
                "light '{name}' is the sun: its colour gives way to daylight of {kelvin:.0} K (\"cct_k\" sets another)"
            ));
        }
        Some(Shining {
            toward: sun.toward,
            light: sun.light,
            spectrum: self.add_spectrum(of_sun(kelvin, self.grid)),
            shape: [lux; BANDS],
            said: format!("{kelvin:.0} K"),
        })
    }

    /// The sun of a map, as it is there or as it was asked for.
    fn of_map(
        &mut self,
        wish: &SkyWish,
        toward: DVec3,
        spectrum: usize,
        shape: Spectrum,
    ) -> Option<Shining> {
        let own = self.size(spectrum, &shape);
        let lux = wish.sun.illuminance.unwrap_or(own);
        if lux <= 0.0 {
            return None;
        }
        let (spectrum, shape, said) = match wish.sun.kelvin {
            Some(kelvin) => {
                let spectrum = self.add_spectrum(of_sun(kelvin, self.grid));
                (spectrum, [lux; BANDS], format!("{kelvin:.0} K"))
            }
            None => (spectrum, shape.map(|x| x * lux / own), "of the map".into()),
        };
        Some(Shining {
            toward,
            light: None,
            spectrum,
            shape,
            said,
        })
    }

    /// Adds the sun, or makes it of a light of the file; and the ground that it shines on.
    fn sun(&mut self, sun: &Shining, ground: Option<f64>) {
        let rho = ground.unwrap_or(0.0) * sun.toward.y;
        let (kind, shape) = (LightKind::Ground(0), sun.shape.map(|x| rho * x));
        self.lamp(LIT_GROUND, kind, DVec3::Y, sun.spectrum, shape);
        match sun.light {
            None => {
                let kind = LightKind::Sun;
                self.lamp(SUN_NAME, kind, -sun.toward, sun.spectrum, sun.shape);
            }
            Some(k) => {
                let lamp = &mut self.lights[k];
                lamp.kind = LightKind::Sun;
                (lamp.light, lamp.shape) = (sun.spectrum, sun.shape);
            }
        }
    }

    /// Luminous size of a light of the file.
    fn size_of(&self, light: usize) -> f64 {
        let light = &self.lights[light];
        self.size(light.light, &light.shape)
    }

    /// Luminous size of a spectrum times a shape.
    fn size(&self, spectrum: usize, shape: &Spectrum) -> f64 {
        let luminous = Observer::cie1931().weights(self.grid)[1];
        let power = &self.spectra[spectrum].power;
        (0..BANDS)
            .map(|l| KM * power[l] * shape[l] * luminous[l])
            .sum()
    }

    /// How bright the parts of sky and ground are, together 1.
    fn bright(&self) -> [f64; PLACES] {
        let mut bright = [0.0; PLACES];
        for (k, light) in self.lights.iter().enumerate() {
            if let Some(place) = light.kind.place() {
                bright[place] += self.size_of(k);
            }
        }
        let all: f64 = bright.iter().sum();
        match all > 0.0 {
            true => bright.map(|b| b / all),
            false => bright,
        }
    }

    /// Adds a lamp, if it shines.
    fn lamp(
        &mut self,
        name: &str,
        kind: LightKind,
        direction: DVec3,
        light: usize,
        shape: Spectrum,
    ) {
        if shape.iter().any(|&x| x > 0.0) {
            self.lights.push(PunctualLight {
                name: name.into(),
                kind,
                node: None,
                position: DVec3::ZERO,
                direction,
                light,
                shape,
                luminaire: None,
            });
        }
    }
}
