//! What is said of sky and sun: `"sky"` of the side file, or the command line, which wins point by point.
//!
//! ```json
//! "sky": { "type": "clear", "illuminance_lx": 12000, "cct_k": 12000, "ground_reflectance": 0.2, "north_deg": 0,
//!          "sun": { "elevation_deg": 40, "azimuth_deg": 200, "illuminance_lx": 80000, "cct_k": 5500 } }
//! ```
//!
//! `type` is overcast (CIE 1), intermediate (10), clear (12), uniform (5), or cie:1 to cie:16 (16: traditional overcast); or hosek, the
//! spectral sky of Hosek and Wilkie, which takes a `turbidity` (1 to 10, by default 3), has colours and an illuminance of its own and reckons
//! with the reflectance of the ground.
//! `illuminance_lx` is that of open level ground by the sky alone; `luminance_cd_m2` in its place is that of the zenith. `cct_k` is the
//! colour of the whole sky, or where `horizon_cct_k` or `sunward_cct_k` say what it is at the horizon and about the sun, of the zenith.
//!
//! `map` in place of `type` names a picture of all directions (`.hdr`, `.exr`, see `map`) in the folder of the file that names it;
//! `luminance_cd_m2` is then that of white, (1, 1, 1), by default 1. What it shows below the horizon counts, unless
//! `ground_reflectance` puts open ground there. The sun
//! stands at an elevation and azimuth, or where it is seen at `latitude_deg`, `longitude_deg` (east) and `time`
//! (`2026-06-21T12:00:00+02:00`); or `"sun"` is the name of a directional light of the file, or `false`: none shines, nor does parallel light
//! of the file. Its `illuminance_lx` is that of a plane
//! across its rays, its `cct_k` that of CIE daylight, below 4000 K, which that does not reach, of a blackbody.

use super::sun::Hours;
use crate::scene::json::short;
use crate::scene::reader::Reader;
use crate::scene::uri::{self, UriTarget};
use serde_json::{Map, Value};
use std::path::PathBuf;
use std::str::FromStr;

/// Type of a sky: 1 to 16.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SkyType(pub u8);

const NAMES: [(&str, u8); 4] = [
    ("overcast", 1),
    ("uniform", 5),
    ("intermediate", 10),
    ("clear", 12),
];

impl SkyType {
    /// In words.
    pub(super) fn name(self) -> &'static str {
        match self.0 {
            5 => "uniform",
            1..=6 | 16 => "overcast",
            7..=10 => "intermediate",
            _ => "clear",
        }
    }
}

impl FromStr for SkyType {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = NAMES.iter().find(|(name, _)| *name == text);
        let number = text.strip_prefix("cie:").and_then(|n| n.parse().ok());
        named
            .map(|&(_, kind)| kind)
            .or(number)
            .filter(|kind| (1..=16).contains(kind))
            .map(Self)
            .ok_or_else(|| {
                "a sky is overcast, intermediate, clear, uniform, cie:1 to cie:16, or hosek".into()
            })
    }
}

/// Turbidities of the sky of Hosek and Wilkie.
pub(super) const TURBIDITY: [f64; 2] = crate::data::TURBIDITY;
/// That of clear air over land, where none is said.
const USUAL_TURBIDITY: f64 = 3.0;
/// What that sky is called.
const HOSEK: &str = "hosek";

/// What a command line names: a type of sky, or a picture of all directions.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SkyName {
    /// Of ISO 15469.
    Type(SkyType),
    /// Of Hosek and Wilkie, by its turbidity.
    Hosek(f64),
    /// A file.
    Map(PathBuf),
}

impl FromStr for SkyName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(rest) = text.strip_prefix(HOSEK) {
            let said = rest.strip_prefix(':').map(|t| t.parse().ok());
            let turbidity = match rest {
                "" => Some(USUAL_TURBIDITY),
                _ => said.flatten(),
            };
            if let Some(t) = turbidity.filter(|t| (TURBIDITY[0]..=TURBIDITY[1]).contains(t)) {
                return Ok(Self::Hosek(t));
            }
        }
        let path = PathBuf::from(text);
        let ending = path.extension().map(|e| e.to_ascii_lowercase());
        match text.parse() {
            Ok(kind) => Ok(Self::Type(kind)),
            Err(_) if ending.is_some_and(|e| e == "hdr" || e == "exr") => Ok(Self::Map(path)),
            Err(why) => Err(format!(
                "{why} (with its turbidity hosek:1 to hosek:10), or a map of all directions as .hdr or .exr"
            )),
        }
    }
}

/// How bright the sky is.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum SkyBrightness {
    /// Of open level ground, by the sky alone, lx.
    Illuminance(f64),
    /// Of the zenith, cd/m2.
    Luminance(f64),
}

/// Where the sun stands.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SunPlace {
    /// Degrees above the horizon, and clockwise from north.
    Angles {
        /// Above the horizon.
        elevation: f64,
        /// From north over east.
        azimuth: f64,
    },
    /// Seen from a place at a time.
    Clock {
        /// Degrees north.
        latitude: f64,
        /// Degrees east.
        longitude: f64,
        /// When.
        time: Hours,
    },
    /// A directional light of the file, by its name or its node's.
    Light(String),
    /// None shines; directional lights of the file are put out.
    Nowhere,
}

/// What a command line says for no sun.
const NO_SUN: &str = "none";

impl FromStr for SunPlace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == NO_SUN {
            return Ok(Self::Nowhere);
        }
        let number = |text: &str, what: &str, [least, most]: [f64; 2]| {
            let number = text.trim().parse::<f64>().ok();
            let within = number.filter(|n| (least..=most).contains(n));
            within.ok_or_else(|| {
                let text = short(text);
                format!("its {what} is '{text}', not a number of degrees from {least} to {most}")
            })
        };
        let parts: Vec<&str> = text.split(',').collect();
        match parts[..] {
            [elevation, azimuth] => Ok(Self::Angles {
                elevation: number(elevation, "elevation", HEIGHT)?,
                azimuth: number(azimuth, "azimuth", TURN)?,
            }),
            [latitude, longitude, time] => Ok(Self::Clock {
                latitude: number(latitude, "latitude", HEIGHT)?,
                longitude: number(longitude, "longitude", HALF_TURN)?,
                time: moment(time.trim())?,
            }),
            _ => Err(format!(
                "the sun stands at ELEVATION,AZIMUTH in degrees, or at LATITUDE,LONGITUDE,TIME as in 52.5,13.4,{MOMENT}; decimals have a \
                 point; {NO_SUN} puts it out"
            )),
        }
    }
}

/// How a time is written.
const MOMENT: &str = "2026-06-21T12:00:00+02:00";

/// A time, with its distance from universal time.
fn moment(text: &str) -> Result<Hours, String> {
    let zoneless = || format!("{text}Z").parse::<Hours>().is_ok();
    text.parse().map_err(|_| match zoneless() {
        true => format!(
            "its time '{}' has no time zone: end it with the distance from universal time, as in {MOMENT}, or with Z for universal time itself",
            short(text)
        ),
        false => format!("its time '{}' is none: write it as in {MOMENT}", short(text)),
    })
}

/// What is said of the sun.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SunWish {
    /// Where it stands.
    pub place: Option<SunPlace>,
    /// Of a plane across its rays, lx.
    pub illuminance: Option<f64>,
    /// Correlated colour temperature, K.
    pub kelvin: Option<f64>,
}

/// What is said of the sky.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SkyWish {
    /// What kind of sky.
    pub kind: Option<SkyType>,
    /// How bright: of a map, its white.
    pub brightness: Option<SkyBrightness>,
    /// Turbidity of the sky of Hosek and Wilkie in the place of a kind.
    pub turbidity: Option<f64>,
    /// A picture of all directions in the place of a kind.
    pub map: Option<PathBuf>,
    /// Correlated colour temperature, K: of the zenith where others are said.
    pub kelvin: Option<f64>,
    /// The same at the horizon.
    pub horizon_kelvin: Option<f64>,
    /// The same about the sun.
    pub sunward_kelvin: Option<f64>,
    /// Reflectance of the ground below the horizon.
    pub ground: Option<f64>,
    /// Where north is, degrees clockwise from -Z.
    pub north: Option<f64>,
    /// The sun.
    pub sun: SunWish,
}

impl SkyWish {
    /// Nothing said?
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// These, and where they say nothing the others.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        let (kind, turbidity, map) = match (self.kind, self.turbidity, self.map) {
            (None, None, None) => (other.kind, other.turbidity, other.map),
            said => said,
        };
        Self {
            kind,
            turbidity,
            map,
            brightness: self.brightness.or(other.brightness),
            kelvin: self.kelvin.or(other.kelvin),
            horizon_kelvin: self.horizon_kelvin.or(other.horizon_kelvin),
            sunward_kelvin: self.sunward_kelvin.or(other.sunward_kelvin),
            ground: self.ground.or(other.ground),
            north: self.north.or(other.north),
            sun: SunWish {
                place: self.sun.place.or(other.sun.place),
                illuminance: self.sun.illuminance.or(other.sun.illuminance),
                kelvin: self.sun.kelvin.or(other.sun.kelvin),
            },
        }
    }

    /// Reads the entry of a side file.
    pub(crate) fn read(value: &Value, place: &str, reader: &mut Reader) -> Self {
        let Some(sky) = reader.object(value, place) else {
            return Self::default();
        };
        let known = [
            "type",
            "turbidity",
            "map",
            "illuminance_lx",
            "luminance_cd_m2",
            "cct_k",
            "horizon_cct_k",
            "sunward_cct_k",
            "ground_reflectance",
            "north_deg",
            "sun",
        ];
        reader.keys(sky, &known, place);
        let is_hosek = sky.get("type").and_then(Value::as_str) == Some(HOSEK);
        let turbidity = number(sky, "turbidity", TURBIDITY, place, reader);
        if sky.contains_key("turbidity") && !is_hosek {
            let what = "gives a turbidity to a sky that has none";
            reader
                .check
                .problem(place, what, "give it \"type\": \"hosek\"");
        }
        let mut wish = Self {
            kind: (!is_hosek)
                .then(|| parsed(sky, "type", str::parse, place, reader))
                .flatten(),
            turbidity: turbidity.or(is_hosek.then_some(USUAL_TURBIDITY)),
            map: map(sky, place, reader),
            kelvin: number(sky, "cct_k", KELVIN, place, reader),
            horizon_kelvin: number(sky, "horizon_cct_k", KELVIN, place, reader),
            sunward_kelvin: number(sky, "sunward_cct_k", KELVIN, place, reader),
            ground: number(sky, "ground_reflectance", [0.0, 1.0], place, reader),
            north: number(sky, "north_deg", TURN, place, reader),
            ..Self::default()
        };
        if sky.contains_key("type") && sky.contains_key("map") {
            let what = "says twice what it is like";
            reader.check.problem(place, what, "give either type or map");
        }
        let lux = number(sky, "illuminance_lx", BRIGHT, place, reader);
        let luminance = number(sky, "luminance_cd_m2", BRIGHT, place, reader);
        wish.brightness = match (lux, luminance) {
            (Some(_), Some(_)) => {
                let what = "says how bright it is twice";
                let next = "give either illuminance_lx or luminance_cd_m2";
                reader.check.problem(place, what, next);
                None
            }
            (Some(lux), None) => Some(SkyBrightness::Illuminance(lux)),
            (None, luminance) => luminance.map(SkyBrightness::Luminance),
        };
        match sky.get("sun") {
            None => {}
            Some(Value::Bool(false)) => wish.sun.place = Some(SunPlace::Nowhere),
            Some(Value::String(name)) => wish.sun.place = Some(SunPlace::Light(name.clone())),
            Some(sun) => wish.sun = SunWish::read(sun, &format!("{place}, sun"), reader),
        }
        wish
    }
}

/// Range of the correlated colour temperature of daylight, K.
pub const KELVIN: [f64; 2] = [4000.0, 25_000.0];
/// The same of the sun: a low one is redder than any daylight that the CIE has a spectrum for, about 2000 K on the horizon. Down to 600 mired.
pub const SUN_KELVIN: [f64; 2] = [1667.0, 25_000.0];
/// Range of an illuminance, lx, or a luminance, cd/m2.
pub const BRIGHT: [f64; 2] = [0.0, 1e9];
/// Range of an azimuth, degrees.
pub const TURN: [f64; 2] = [-360.0, 360.0];
const HALF_TURN: [f64; 2] = [-180.0, 180.0];
const HEIGHT: [f64; 2] = [-90.0, 90.0];

impl SunWish {
    fn read(value: &Value, place: &str, reader: &mut Reader) -> Self {
        let Some(sun) = reader.object(value, place) else {
            return Self::default();
        };
        let angles = ["elevation_deg", "azimuth_deg"];
        let clock = ["latitude_deg", "longitude_deg", "time"];
        let known = [&angles[..], &clock, &["light", "illuminance_lx", "cct_k"]].concat();
        reader.keys(sun, &known, place);
        let has = |keys: &[&str]| keys.iter().any(|key| sun.contains_key(*key));
        let light = sun.get("light").and_then(Value::as_str).map(str::to_owned);
        let said = match (has(&angles), has(&clock), light) {
            (true, false, None) => {
                let elevation = number(sun, angles[0], HEIGHT, place, reader);
                let azimuth = number(sun, angles[1], TURN, place, reader);
                elevation
                    .zip(azimuth)
                    .map(|(elevation, azimuth)| SunPlace::Angles { elevation, azimuth })
            }
            (false, true, None) => {
                let latitude = number(sun, clock[0], HEIGHT, place, reader);
                let longitude = number(sun, clock[1], HALF_TURN, place, reader);
                let time = parsed(sun, clock[2], moment, place, reader);
                let both = latitude.zip(longitude).zip(time);
                both.map(|((latitude, longitude), time)| SunPlace::Clock {
                    latitude,
                    longitude,
                    time,
                })
            }
            (false, false, Some(name)) => Some(SunPlace::Light(name)),
            (false, false, None) => return Self::with(None, sun, place, reader),
            _ => None,
        };
        if said.is_none() {
            let what = "does not say where the sun stands";
            let next = "give elevation_deg and azimuth_deg, or latitude_deg, longitude_deg and time, or light";
            reader.check.problem(place, what, next);
        }
        Self::with(said, sun, place, reader)
    }

    fn with(
        said: Option<SunPlace>,
        sun: &Map<String, Value>,
        place: &str,
        reader: &mut Reader,
    ) -> Self {
        Self {
            place: said,
            illuminance: number(sun, "illuminance_lx", BRIGHT, place, reader),
            kelvin: number(sun, "cct_k", SUN_KELVIN, place, reader),
        }
    }
}

/// Where the picture of all directions lies that an object names.
fn map(sky: &Map<String, Value>, place: &str, reader: &mut Reader) -> Option<PathBuf> {
    let value = sky.get("map")?;
    let located = match value.as_str() {
        Some(name) => uri::locate(&reader.folder, name),
        None => Err(format!("map is {value}")),
    };
    let next = "name a .hdr or .exr inside the folder of the file that names it";
    match located {
        Ok(UriTarget::File(path)) => return Some(path),
        Ok(UriTarget::Here(_)) => reader.check.problem(place, "map is a data URI", next),
        Err(why) => reader.check.problem(place, why, next),
    }
    None
}

/// A number within bounds.
fn number(
    object: &Map<String, Value>,
    key: &str,
    [least, most]: [f64; 2],
    place: &str,
    reader: &mut Reader,
) -> Option<f64> {
    let value = object.get(key)?;
    let number = value.as_f64().filter(|v| (least..=most).contains(v));
    if number.is_none() {
        let what = format!("{key} is {value}, not a number from {least} to {most}");
        reader
            .check
            .problem(place, what, "give one within these bounds");
    }
    number
}

/// A text that reads as something.
fn parsed<T>(
    object: &Map<String, Value>,
    key: &str,
    parse: impl Fn(&str) -> Result<T, String>,
    place: &str,
    reader: &mut Reader,
) -> Option<T> {
    let value = object.get(key)?;
    match value.as_str().map(parse) {
        Some(Ok(read)) => Some(read),
        Some(Err(why)) => {
            reader
                .check
                .problem(place, format!("{key} is {value}"), why);
            None
        }
        None => {
            reader
                .check
                .problem(place, format!("{key} is {value}"), "write a text");
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Grid;
    use crate::scene::check::{Check, Unknown};

    #[test]
    fn skies_and_suns_are_typed() {
        for (text, kind) in [
            ("overcast", 1),
            ("clear", 12),
            ("cie:16", 16),
            ("uniform", 5),
        ] {
            assert_eq!(text.parse(), Ok(SkyType(kind)));
        }
        for bad in ["cie:0", "cie:17", "cie:", "cloudy", ""] {
            assert!(bad.parse::<SkyType>().is_err(), "{bad}");
        }
        assert_eq!("a/b.HDR".parse(), Ok(SkyName::Map("a/b.HDR".into())));
        assert_eq!("cie:3".parse(), Ok(SkyName::Type(SkyType(3))));
        assert!("cloudy.png".parse::<SkyName>().is_err());
        assert_eq!("hosek".parse(), Ok(SkyName::Hosek(3.0)));
        assert_eq!("hosek:2.5".parse(), Ok(SkyName::Hosek(2.5)));
        for bad in ["hosek:0.5", "hosek:11", "hosek:", "hosek3", "hosek:nan"] {
            assert!(bad.parse::<SkyName>().is_err(), "{bad}");
        }
        assert_eq!(
            "40,200".parse(),
            Ok(SunPlace::Angles {
                elevation: 40.0,
                azimuth: 200.0
            })
        );
        assert_eq!("none".parse(), Ok(SunPlace::Nowhere));
        let clock = "52.5,13.4,2026-06-21T12:00:00+02:00".parse();
        assert!(matches!(clock, Ok(SunPlace::Clock { latitude: 52.5, .. })));
        for (bad, why) in [
            ("40", "ELEVATION,AZIMUTH"),
            ("1,2,3,4", "decimals have a point"),
            (
                "95,3",
                "its elevation is '95', not a number of degrees from -90 to 90",
            ),
            ("NaN,3", "its elevation is 'NaN'"),
            ("1,b", "its azimuth is 'b'"),
            ("99,2,2026-06-21T12:00:00Z", "its latitude is '99'"),
            ("1,200,2026-06-21T12:00:00Z", "its longitude is '200'"),
            ("1,2,noon", "its time 'noon' is none: write it as in 2026-"),
            ("1,2,2026-06-21T12:00:00", "has no time zone"),
        ] {
            let said = bad.parse::<SunPlace>().unwrap_err();
            assert!(said.contains(why), "{bad}: {said}");
        }
    }
    #[test]
    fn turbidity_belongs_to_one_sky() {
        let read = |text: &str| {
            let grid = Grid::paper();
            let mut check = Check::new("room.spectra.json");
            let mut reader = Reader {
                folder: PathBuf::new(),
                grid: &grid,
                check: &mut check,
                unknown: Unknown::Refuse,
            };
            let wish = SkyWish::read(&serde_json::from_str(text).unwrap(), "sky", &mut reader);
            let problems = check.into_parts().0;
            let told: Vec<String> = problems.iter().map(ToString::to_string).collect();
            (wish.kind, wish.turbidity, told.join("\n"))
        };
        let (kind, turbidity, told) = read(r#"{"type": "hosek", "turbidity": 4.5}"#);
        assert_eq!((kind, turbidity, told), (None, Some(4.5), String::new()));
        assert_eq!(read(r#"{"type": "hosek"}"#).1, Some(3.0));
        let told = read(r#"{"type": "hosek", "turbidity": 0.5}"#).2;
        assert!(
            told.contains("turbidity is 0.5, not a number from 1 to 10"),
            "{told}"
        );
        let told = read(r#"{"type": "clear", "turbidity": 3}"#).2;
        assert!(told.contains("turbidity to a sky that has none"), "{told}");
        let told = read(r#"{"type": "hosec"}"#).2;
        assert!(told.contains("or hosek"), "{told}");
    }

    /// A sky on the command line takes the place of that of the file, whatever kind either is.
    #[test]
    fn one_sky_gives_way_to_another() {
        let hosek = SkyWish {
            turbidity: Some(3.0),
            ..SkyWish::default()
        };
        let clear = SkyWish {
            kind: Some(SkyType(12)),
            ground: Some(0.5),
            ..SkyWish::default()
        };
        let over = hosek.clone().or(clear.clone());
        assert_eq!(
            (over.kind, over.turbidity, over.ground),
            (None, Some(3.0), Some(0.5))
        );
        let under = clear.or(hosek);
        assert_eq!((under.kind, under.turbidity), (Some(SkyType(12)), None));
    }
}
