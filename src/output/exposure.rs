//! Exposure: which radiosity shows as white, from what a person in the room adapts to.
//!
//! display = curve(scale * balance * radiosity), all linear, radiosity in lm/m2, display white = 1; see [`curve`].
//!
//! The level of the room is the mean logarithm over the pixels of small pictures from all cameras. A pixel's reading is the
//! geometric mean of two that photographers know: what leaves it (a reflected-light meter, which shows white rooms and
//! dark ones alike, as grey) and what a white surface would send there (an incident-light meter, which leaves a dark room
//! dark). People judge in between. `KEY` is such that a grey of 18 % shows as 18 %, white rooms brighter, dark ones darker.
//!
//! Lamps have no vote. Neither has what is more than `STOPS` away from the level, found by repetition from the median: sun
//! patches, spots beside lamps, single wrong vertices, what lies in the dark. As nearly all of what is seen may lie in the
//! dark, or under a dark texture (COLOR_0 holds light before the texture and ends at 1), the share `BELOW_WHITE` of what
//! is seen is at most `WHITISH` in COLOR_0, before the curve.

use super::camera::{self, View};
use super::curve;
use super::raster::{self, Fragment, RefinedMesh};
use super::white_balance::{IDENTITY, Matrix, WhiteBalance};
use crate::color::{Xyz, multiply};
use crate::gather::BakedSurface;
use crate::gather::refined;
use crate::scene::{Camera, Scene};
use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

/// What the level shows as where everything is white: sqrt(.18), see above.
const KEY: f64 = 0.424_264;
/// What is more stops away from the level than this has no vote.
const STOPS: f64 = 3.0;
/// How often the level is found anew at the most.
const TURNS: usize = 16;
/// Least reflectance that a reading supposes: the logarithm of black is no light level.
const BLACK: f64 = 0.02;
/// See above. With 1 for .9 a gallery with pale walls under wall washers lost its bricks (48 % of the picture above the knee).
const BELOW_WHITE: f64 = 0.8;
const WHITISH: f64 = 0.9;
/// Readings below this share of the 95th percentile are of what no light reaches: backs of walls, gaps.
const UNLIT: f64 = 1e-4;
/// Size of the trial pictures that are metered.
const TRIAL: [usize; 2] = [160, 120];
/// Luminance that a meter shows as grey of 18 % at EV 0 (ISO 100): K / 100 with K = 12.5 cd s/m2 (ISO 2720:1974).
const EV_0: f64 = 0.125;
/// That grey.
const GREY: f64 = 0.18;

/// How bright the room is to be shown. Written `auto`, `auto+1`, `auto-0.5` (stops) or an exposure value for ISO 100.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ExposureSetting {
    /// As metered, brighter by so many stops.
    Auto(f64),
    /// A luminance of 0.125 * 2^EV cd/m2 shows as grey of 18 %.
    Ev(f64),
}

impl Default for ExposureSetting {
    fn default() -> Self {
        Self::Auto(0.0)
    }
}

impl FromStr for ExposureSetting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (stops, make): (&str, fn(f64) -> Self) = match text.strip_prefix("auto") {
            Some("") => return Ok(Self::default()),
            Some(stops) if stops.starts_with(['+', '-']) => (stops, Self::Auto),
            Some(_) => ("", Self::Auto),
            None => (text, Self::Ev),
        };
        match stops.parse::<f64>() {
            Ok(stops) if stops.abs() <= 40.0 => Ok(make(stops)),
            _ => Err(
                "auto, auto+1 (a stop brighter) or an exposure value such as 7.5 is wanted".into(),
            ),
        }
    }
}

impl fmt::Display for ExposureSetting {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Auto(0.0) => f.write_str("auto"),
            Self::Auto(stops) => write!(f, "auto{stops:+}"),
            Self::Ev(ev) => write!(f, "{ev}"),
        }
    }
}

/// How radiosity becomes a display value.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Exposure {
    /// Display value (1 = white) for each lm/m2 of radiosity, before the curve.
    pub scale: f64,
    /// White balance: linear sRGB of radiosity to linear sRGB of equal luminance.
    pub balance: Matrix,
    /// Share of what the cameras see, lamps left out, that the curve makes darker in COLOR_0; none if it was not metered.
    pub compressed: Option<f64>,
}

impl Exposure {
    /// The given factor from radiosity in lm/m2 to display value.
    pub fn new(scale: f64) -> Self {
        Self {
            scale,
            balance: IDENTITY,
            compressed: None,
        }
    }

    /// Luminance of a diffuse surface that shows as white but for the curve, cd/m2.
    pub fn white_luminance(&self) -> f64 {
        1.0 / (self.scale * PI)
    }

    /// The exposure value for ISO 100.
    pub fn ev(&self) -> f64 {
        (GREY * self.white_luminance() / EV_0).log2()
    }

    /// What is shown of linear light, lm/m2, before the curve.
    pub(crate) fn shown(&self, light: [f64; 3]) -> [f64; 3] {
        let light = light.map(|c| self.scale * c);
        if self.balance == IDENTITY {
            light
        } else {
            multiply(&self.balance, light)
        }
    }

    /// Meters the room as its own cameras see it: see the module's words.
    pub fn auto(scene: &Scene, surfaces: &[BakedSurface]) -> Self {
        let cameras = camera::cameras(scene);
        let (brightness, balance) = (ExposureSetting::default(), WhiteBalance::default());
        Self::metered(scene, surfaces, &cameras, brightness, balance)
    }

    /// The same through given cameras, as bright and as white as is wished for. A black room gets a scale of 1.
    pub fn metered(
        scene: &Scene,
        surfaces: &[BakedSurface],
        cameras: &[Camera],
        brightness: ExposureSetting,
        balance: WhiteBalance,
    ) -> Self {
        let meshes = RefinedMesh { scene, surfaces };
        let seen: Vec<Vec<PixelReading>> = cameras.iter().map(|c| seen(&meshes, c)).collect();
        let (lamps, things): (Vec<PixelReading>, Vec<PixelReading>) =
            seen.iter().flatten().copied().partition(|r| r.lamp);
        let (things, lamps) = (lit(things), lit(lamps));
        let readings = if things.is_empty() { &lamps } else { &things };
        let level = AdaptationLevel::of(readings);
        let balance = level.map_or(IDENTITY, |level| balance.matrix(level.white));
        let whitest =
            |of: &[PixelReading]| WHITISH / quantile(of, BELOW_WHITE, |r| r.shown(&balance));
        // No picture may be white all over because another is dark.
        let of_picture = |seen: &Vec<PixelReading>| {
            let things = lit(seen.iter().filter(|r| !r.lamp).copied().collect());
            (!things.is_empty()).then(|| whitest(&things))
        };
        let scale = match (brightness, level) {
            (ExposureSetting::Ev(ev), _) => GREY / (PI * EV_0 * ev.exp2()),
            (ExposureSetting::Auto(_), None) => 1.0,
            (ExposureSetting::Auto(stops), Some(level)) => {
                let most = seen.iter().filter_map(of_picture).reduce(f64::min);
                let most = most.unwrap_or_else(|| whitest(readings));
                (KEY / level.level).min(most) * stops.exp2()
            }
        };
        let over = |r: &&PixelReading| scale * r.shown(&balance) > curve::KNEE;
        let compressed = readings.iter().filter(over).count() as f64 / readings.len().max(1) as f64;
        Self {
            scale,
            balance,
            compressed: Some(compressed),
        }
    }
}

/// What a pixel shows, lm/m2.
#[derive(Debug, Clone, Copy)]
struct PixelReading {
    /// Geometric mean of radiosity and of a white surface's there.
    level: f64,
    /// Linear light, and what it is multiplied by in COLOR_0.
    light: [f64; 3],
    paint: [f64; 3],
    /// Strongest channel of both together.
    strongest: f64,
    /// Tristimulus irradiance.
    white: Xyz,
    lamp: bool,
}

impl PixelReading {
    /// Strongest channel of what COLOR_0 holds, after a white balance.
    fn shown(&self, balance: &Matrix) -> f64 {
        if *balance == IDENTITY {
            return self.strongest;
        }
        let light = multiply(balance, self.light);
        curve::strongest(std::array::from_fn(|c| light[c] * self.paint[c]))
    }
}

/// Those that light reaches.
fn lit(mut readings: Vec<PixelReading>) -> Vec<PixelReading> {
    readings.retain(|r| r.strongest > 0.0 && (r.level * r.strongest).is_finite());
    if !readings.is_empty() {
        let least = UNLIT * quantile(&readings, 0.95, |r| r.level);
        readings.retain(|r| r.level > least);
    }
    readings
}

/// The value that a share of the readings, which are not none, stays below.
fn quantile(readings: &[PixelReading], share: f64, value: impl Fn(&PixelReading) -> f64) -> f64 {
    let mut values: Vec<f64> = readings.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    values[((share * values.len() as f64) as usize).min(values.len() - 1)].max(f64::MIN_POSITIVE)
}

/// What an eye adapts to.
#[derive(Debug, Clone, Copy)]
struct AdaptationLevel {
    level: f64,
    /// Colour of the light, tristimulus, Y = 1.
    white: Xyz,
}

impl AdaptationLevel {
    fn of(readings: &[PixelReading]) -> Option<Self> {
        if readings.is_empty() {
            return None;
        }
        let mut level = quantile(readings, 0.5, |r| r.level);
        let (mut white, mut voters) = ([0.0; 3], 0.0);
        for _ in 0..TURNS {
            let before = level;
            let near = |r: &&PixelReading| (r.level / before).log2().abs() <= STOPS;
            let (mut sum, mut count) = (0.0, 0.0);
            white = [0.0; 3];
            for r in readings.iter().filter(near) {
                sum += r.level.ln();
                count += 1.0;
                if r.white[1] > 0.0 {
                    white = std::array::from_fn(|c| white[c] + r.white[c] / r.white[1]);
                }
            }
            if count == 0.0 {
                break;
            }
            (level, voters) = ((sum / count).exp(), count);
            if (level / before - 1.0).abs() < 1e-6 {
                break;
            }
        }
        Some(Self {
            level,
            white: white.map(|c| c / f64::max(voters, 1.0)),
        })
    }
}

/// One reading for each pixel of a small picture that shows a surface.
fn seen(meshes: &RefinedMesh, camera: &Camera) -> Vec<PixelReading> {
    let [width, height] = TRIAL;
    let read = |hit: &Fragment| {
        let (surface, corners) = meshes.at(hit);
        let material = &meshes.scene.materials[surface.material];
        let paint = |k: usize| match material.vertex_paint {
            true => refined::vertex_color(surface, corners[k]),
            false => [1.0; 4],
        };
        let mix =
            |value: &dyn Fn(usize) -> f64| (0..3).map(|k| hit.weights[k] * value(k)).sum::<f64>();
        let light = [0, 1, 2].map(|c| mix(&|k| f64::from(corners[k].light[c])));
        let paint = [0, 1, 2].map(|c| mix(&|k| f64::from(paint(k)[c])));
        let white = [0, 1, 2].map(|c| mix(&|k| f64::from(corners[k].irradiance[c])));
        let radiosity = mix(&|k| f64::from(corners[k].radiosity[1]));
        // No surface reflects more than a white one; a lamp's own light is its level.
        let white_y = white[1].max(radiosity);
        PixelReading {
            level: (white_y * radiosity.max(BLACK * white_y)).max(0.0).sqrt(),
            light,
            paint,
            strongest: curve::strongest(std::array::from_fn(|c| light[c] * paint[c])),
            white,
            lamp: material.emission.is_some(),
        }
    };
    let view = View::new(meshes.scene, camera, width, height);
    let pixels = raster::draw(meshes, &view, TRIAL, 1, |row| {
        row.iter().map(|hit| hit.as_ref().map(read)).collect()
    });
    pixels.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(levels: impl IntoIterator<Item = (f64, usize)>) -> Vec<PixelReading> {
        let one = |level| PixelReading {
            level,
            light: [level; 3],
            paint: [1.0; 3],
            strongest: level,
            white: [level; 3],
            lamp: false,
        };
        (levels.into_iter())
            .flat_map(|(level, n)| vec![one(level); n])
            .collect()
    }

    #[test]
    fn sun_patches_dark_corners_and_wrong_vertices_have_no_vote() {
        let plain = readings([(50.0, 300), (100.0, 400), (200.0, 300)]);
        let level = AdaptationLevel::of(&plain).unwrap().level;
        assert!((level / 100.0 - 1.0).abs() < 1e-9);
        let disturbed = [(1e4, 250), (1e9, 3), (0.5, 200)];
        let all = readings(
            [(50.0, 300), (100.0, 400), (200.0, 300)]
                .into_iter()
                .chain(disturbed),
        );
        let level = AdaptationLevel::of(&lit(all)).unwrap().level;
        assert!((level / 100.0 - 1.0).abs() < 1e-9, "{level}");
        assert!(AdaptationLevel::of(&lit(readings([(0.0, 9)]))).is_none());
    }

    #[test]
    fn exposure_values() {
        // EV 7 at ISO 100: 16 cd/m2 is middle grey.
        let scale = GREY / (PI * EV_0 * 7f64.exp2());
        assert!((Exposure::new(scale).ev() - 7.0).abs() < 1e-12);
        assert!((GREY * Exposure::new(scale).white_luminance() - 16.0).abs() < 1e-9);
        assert_eq!("auto".parse(), Ok(ExposureSetting::Auto(0.0)));
        assert_eq!("auto-1.5".parse(), Ok(ExposureSetting::Auto(-1.5)));
        assert_eq!("-3".parse(), Ok(ExposureSetting::Ev(-3.0)));
        for bad in ["", "auto1", "auto+", "bright", "NaN", "1e9"] {
            assert!(bad.parse::<ExposureSetting>().is_err(), "{bad}");
        }
        for shown in ["auto", "auto+1", "auto-0.5", "7.5"] {
            assert_eq!(shown.parse::<ExposureSetting>().unwrap().to_string(), shown);
        }
    }
}
