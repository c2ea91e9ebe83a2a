//! What a sky shines with: how much, of which spectra, and how that is spread.

use super::Distribution;
use super::dome::{Dome, Tinted};
use super::hosek::Hosek;
use super::map::{Map, Wanted};
use super::mixture::Spectral;
use super::parts::PARTS;
use super::picture::SkyPicture;
use super::sun::angles;
use super::wish::{BRIGHT, KELVIN, SkyBrightness, SkyType, SkyWish};
use crate::color::{KM, Observer, Upsampler, primaries};
use crate::data::{BANDS, Grid, Outside, Spectrum, Table, blackbody, daylight, named};
use crate::scene::LightSpectrum;
use crate::scene::check::Check;
use crate::scene::json::short;
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;

/// Illuminance of open ground under a sky of which nothing more is said, not even where the sun stands: an overcast day, lx.
const USUAL_LUX: f64 = 10_000.0;
/// Reflectance of open ground, of which nothing more is said: grass, earth and asphalt mixed, as daylight calculations take it.
const USUAL_GROUND: f64 = 0.2;
/// What the parts of a sky are called besides: by colour of daylight, of a spectral sky, and of a map.
const SHADES: [&str; PARTS] = ["", ", horizon", ", about the sun"];
const MIXED: [&str; PARTS] = [", bluest", ", between", ", least blue"];
const PRIMARIES: [&str; PARTS] = [", red", ", green", ", blue"];
/// Illuminances beyond this are no light of day, lx.
const MOST_LUX: f64 = BRIGHT[1];

/// What a sky shines with.
pub(super) struct SkyLight {
    pub(super) dome: Dome,
    pub(super) said: String,
    /// What its parts are called besides.
    pub(super) names: [&'static str; PARTS],
    /// Luminous size 1.
    pub(super) spectrum: LightSpectrum,
    /// Shares of it by part: irradiance of open level ground, and of a plane that looks down.
    pub(super) above: [Spectrum; PARTS],
    pub(super) below: [Spectrum; PARTS],
    /// Reflectance of open ground below the horizon, where that is what is seen there.
    pub(super) ground: Option<f64>,
    /// A sun of its own: toward it, and the share of the spectrum across its rays.
    pub(super) sun: Option<(DVec3, Spectrum)>,
}

impl SkyLight {
    /// A sky of ISO 15469.
    pub(super) fn of_type(
        wish: &SkyWish,
        kind: SkyType,
        sun: Option<DVec3>,
        grid: &Grid,
        check: &mut Check,
    ) -> Option<Self> {
        let luminance = Distribution::new(kind.0, sun.unwrap_or(DVec3::Y));
        if wish.sunward_kelvin.is_some() && !Distribution::follows_sun(kind.0) {
            let what = format!("cie:{} is not brighter about the sun", kind.0);
            let next = "leave out what colour it has there (sunward CCT), or take another type";
            check.problem("sky", what, next);
            return None;
        }
        let lux = match wish.brightness {
            Some(SkyBrightness::Illuminance(lux)) => lux,
            Some(SkyBrightness::Luminance(zenith)) => zenith / luminance.zenith(),
            None => usual(kind, sun.map(|sun| angles(sun)[0]))[0],
        };
        let kelvin = wish.kelvin.unwrap_or(usual_kelvin(kind));
        let ground = wish.ground.unwrap_or(USUAL_GROUND);
        let others = [wish.horizon_kelvin, wish.sunward_kelvin];
        let dome = Tinted::new(luminance, others.map(|kelvin| kelvin.is_some()));
        let own = of_daylight(kelvin, grid);
        let colours = [Some(kelvin), others[0], others[1]];
        let levels = dome.levels();
        let above = std::array::from_fn(|part| {
            let other = of_daylight(colours[part].unwrap_or(kelvin), grid);
            std::array::from_fn(|l| lux * levels[part] * (other.power[l] / own.power[l]))
        });
        let also = |place: &str, kelvin: Option<f64>| {
            kelvin.map_or(String::new(), |kelvin| format!(", {kelvin:.0} K {place}"))
        };
        Some(Self {
            dome: Dome::Cie(dome),
            said: format!(
                "CIE {} ({}), {lux:.0} lx on open ground, {kelvin:.0} K{}{}; ground {ground}",
                kind.0,
                kind.name(),
                also("at the horizon", others[0]),
                also("about the sun", others[1]),
            ),
            names: SHADES,
            spectrum: own,
            above,
            below: [[0.0; BANDS]; PARTS],
            ground: Some(ground),
            sun: None,
        })
    }

    /// A sky of Hosek and Wilkie.
    pub(super) fn of_air(
        wish: &SkyWish,
        turbidity: f64,
        sun: DVec3,
        grid: &Grid,
        check: &mut Check,
    ) -> Option<Self> {
        let kelvins = [wish.kelvin, wish.horizon_kelvin, wish.sunward_kelvin];
        if kelvins.iter().any(Option::is_some) {
            let what = "the sky of Hosek and Wilkie has colours of its own";
            let next = "leave out its colour temperature (\"cct_k\", --sky-cct and the like), or take another type";
            check.problem("sky", what, next);
            return None;
        }
        let ground = wish.ground.unwrap_or(USUAL_GROUND);
        let sky = Spectral::new(Hosek::new(turbidity, ground, sun, grid), grid);
        let luminous = Observer::cie1931().weights(grid)[1];
        let size = |power: &Spectrum| -> f64 {
            let each = power.iter().zip(&luminous);
            each.map(|(p, y)| KM * p * y).sum()
        };
        let own = size(&sum_of(*sky.levels()));
        let factor = match wish.brightness {
            Some(SkyBrightness::Illuminance(lux)) => lux / own,
            Some(SkyBrightness::Luminance(zenith)) => zenith / size(&sky.exact(DVec3::Y)),
            None => 1.0,
        };
        let power = sum_of(*sky.levels()).map(|x| x / own);
        let sky = sky.scaled(factor);
        let lux = factor * own;
        Some(Self {
            said: format!(
                "Hosek and Wilkie, turbidity {turbidity}, {lux:.0} lx on open ground; ground {ground}"
            ),
            names: MIXED,
            above: sky
                .levels()
                .map(|level| std::array::from_fn(|l| level[l] / power[l])),
            spectrum: LightSpectrum {
                name: format!("hosek/{turbidity}"),
                power,
            },
            dome: Dome::Spectral(Arc::new(sky)),
            below: [[0.0; BANDS]; PARTS],
            ground: Some(ground),
            sun: None,
        })
    }

    /// A picture of all directions.
    pub(super) fn of_map(
        wish: &SkyWish,
        path: &Path,
        grid: &Grid,
        check: &mut Check,
    ) -> Option<Self> {
        let place = format!("map '{}'", short(&path.display().to_string()));
        let picture = match SkyPicture::read(path) {
            Ok(picture) => picture,
            Err((what, next)) => {
                check.problem(&place, what, next);
                return None;
            }
        };
        for warning in &picture.warnings {
            check.warn(format!("{place}: {warning}"));
        }
        let kelvins = [wish.kelvin, wish.horizon_kelvin, wish.sunward_kelvin];
        if kelvins.iter().any(Option::is_some) {
            check.warn(format!(
                "{place}: colour temperatures of the sky are passed over, it has its own colours"
            ));
        }
        let upsampler = Upsampler::new(grid);
        let luminance =
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|c| upsampler.luminance(c));
        let north = wish.north.unwrap_or(0.0).to_radians();
        let [width, file_width] = [picture.width, picture.file_width];
        let wanted = Wanted {
            sun: wish.sun.place.is_none(),
            below: wish.ground.is_none(),
        };
        let (map, sun) = Map::new(picture, luminance, north, wanted);
        let [above, below] = map.levels();
        let lux = |levels: [f64; PARTS]| -> f64 {
            levels.iter().zip(&luminance).map(|(e, y)| e * y).sum()
        };
        let white = match wish.brightness {
            Some(SkyBrightness::Illuminance(wanted)) => wanted / lux(above),
            Some(SkyBrightness::Luminance(white)) => white,
            None => 1.0,
        };
        let [up, down] = [above, below].map(|levels| white * lux(levels));
        if lux(above) + lux(below) <= 0.0 && sun.is_none() {
            check.problem(&place, "is black", "give one that shines");
            return None;
        }
        if !(0.0..=MOST_LUX).contains(&(up + down)) {
            let what = format!("gives {up:.3e} lx from above and {down:.3e} lx from below");
            let next = "say how bright it is: illuminance_lx or luminance_cd_m2 of white (--sky-lux, --sky-luminance)";
            check.problem(&place, what, next);
            return None;
        }
        let shares = primaries(&upsampler);
        let shapes = |levels: [f64; PARTS]| {
            let of = |k: usize| shares[k].map(|share| white * levels[k] * share);
            std::array::from_fn(of)
        };
        let shrunk = match width < file_width {
            true => format!(" (of {file_width})"),
            false => String::new(),
        };
        let ground = match wish.ground {
            Some(rho) => format!("ground {rho}"),
            None => format!("{down:.0} lx from below the horizon"),
        };
        Some(Self {
            said: format!(
                "{place}, {width} texels around{shrunk}, {up:.0} lx on open ground; {ground}"
            ),
            dome: Dome::Map(Arc::new(map)),
            names: PRIMARIES,
            spectrum: white_of(grid),
            above: shapes(above),
            below: shapes(below),
            ground: wish.ground,
            sun: sun.map(|sun| (sun.toward, sum_of(shapes(sun.across)))),
        })
    }
}

/// Illuminance of open level ground by the sky, and of a plane across the sun's rays: IES RP-21 (Calculation of daylight
/// availability, 1984), lx.
pub(super) fn usual(kind: SkyType, elevation: Option<f64>) -> [f64; 2] {
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

/// The spectrum of daylight, luminous size 1.
pub(super) fn of_daylight(kelvin: f64, grid: &Grid) -> LightSpectrum {
    sized(format!("daylight/{kelvin:.0}"), &daylight(kelvin), grid)
}

/// The spectrum of a sun: daylight, and where that ends a blackbody, luminous size 1.
pub(super) fn of_sun(kelvin: f64, grid: &Grid) -> LightSpectrum {
    match kelvin >= KELVIN[0] {
        true => of_daylight(kelvin, grid),
        false => sized(format!("blackbody/{kelvin:.0}"), &blackbody(kelvin), grid),
    }
}

fn sum_of(parts: [Spectrum; PARTS]) -> Spectrum {
    std::array::from_fn(|l| parts.iter().map(|part| part[l]).sum())
}

/// The spectrum of a map's white, luminous size 1.
fn white_of(grid: &Grid) -> LightSpectrum {
    let d65 = named("cie/D65").expect("D65 is built in").table;
    sized("cie/D65".into(), &d65, grid)
}

fn sized(name: String, table: &Table, grid: &Grid) -> LightSpectrum {
    let luminous = Observer::cie1931().weights(grid)[1];
    let power = grid.means(table, Outside::Hold);
    let size: f64 = power.iter().zip(luminous).map(|(p, y)| KM * p * y).sum();
    let power = power.map(|p| p / size);
    LightSpectrum { name, power }
}
