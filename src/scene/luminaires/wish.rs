//! What a side file or extras say of a lamp's profile.
//!
//! ```json
//! { "lights":    { "Spot":  { "profile": "lamps/spot.ies", "name": "cie/LED-B3", "multiplier": 0.5 } },
//!   "materials": { "panel": { "emission": { "profile": "lamps/panel.ldt", "flux_lm": 3600, "turn_deg": 90 } } } }
//! ```

use super::super::json::short;
use super::super::profile::Profile;
use super::super::reader::{Reader, Sampled};
use super::super::uri;
use crate::data::TableKind;
use serde_json::{Map, Value};
use std::sync::Arc;

/// Keys that go with a profile.
const KEYS: [&str; 4] = ["profile", "multiplier", "flux_lm", "turn_deg"];
/// Keys of a light.
const OF_LIGHT: [&str; 6] = ["name", "csv", KEYS[0], KEYS[1], KEYS[2], KEYS[3]];
/// Keys of the emission of a material.
pub(in crate::scene) const OF_EMISSION: [&str; 7] = [
    "name",
    "csv",
    "luminance_cd_m2",
    KEYS[0],
    KEYS[1],
    KEYS[2],
    KEYS[3],
];

/// A profile that was asked for.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::scene) struct ProfileWish {
    pub(in crate::scene) profile: Arc<Profile>,
    /// Lumens, the multiplier included.
    pub(in crate::scene) flux: f64,
    pub(in crate::scene) turn_deg: f64,
}

/// What is known of a light.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::scene) struct LampWish {
    pub(in crate::scene) spectrum: Option<Sampled>,
    pub(in crate::scene) profile: Option<ProfileWish>,
}

/// Are these extras of a light ours? Other programs write a "name" or "profile" into extras too; all of our names hold a slash, and
/// our profiles are files of the two kinds.
pub(in crate::scene) fn is_ours(extras: &Value) -> bool {
    let by_name = extras["name"].as_str().map(|name| name.contains('/'));
    let profile = extras["profile"].as_str().map(str::to_ascii_lowercase);
    let by_file = profile.is_some_and(|p| p.ends_with(".ies") || p.ends_with(".ldt"));
    by_file || by_name.unwrap_or(extras["csv"].is_string())
}

/// Reads the object of a light.
pub(in crate::scene) fn read(reader: &mut Reader, entry: &Value, place: &str) -> Option<LampWish> {
    let entry = reader.object(entry, place)?;
    reader.keys(entry, &OF_LIGHT, place);
    let profile = read_profile(reader, entry, place);
    let silent = entry.contains_key("profile") && !says_spectrum(entry);
    let spectrum = (!silent).then(|| reader.sampled(entry, TableKind::Illuminant, place));
    Some(LampWish {
        spectrum: spectrum.flatten(),
        profile,
    })
}

/// Does an object say which spectrum?
pub(in crate::scene) fn says_spectrum(object: &Map<String, Value>) -> bool {
    object.contains_key("name") || object.contains_key("csv")
}

/// Reads the keys of a profile, of a light or of an emission; none where there is none or it is wrong.
pub(in crate::scene) fn read_profile(
    reader: &mut Reader,
    object: &Map<String, Value>,
    place: &str,
) -> Option<ProfileWish> {
    let Some(path) = object.get("profile") else {
        for key in KEYS.iter().filter(|key| object.contains_key(**key)) {
            let what = format!("\"{key}\" goes with a profile, and there is none");
            reader
                .check
                .problem(place, what, "add \"profile\", or take it out");
        }
        return None;
    };
    let multiplier = number(reader, object, "multiplier", 0.0, place);
    let flux = number(reader, object, "flux_lm", 0.0, place);
    let turn_deg = number(reader, object, "turn_deg", f64::MIN, place).unwrap_or(0.0);
    let Some(path) = path.as_str() else {
        let what = "\"profile\" is not the name of a file";
        reader
            .check
            .problem(place, what, "name an .ies or .ldt file");
        return None;
    };
    let read = uri::read(&reader.folder, path);
    let bytes = read.map_err(|why| {
        let next = "give an .ies or .ldt file inside the folder of the file that names it";
        reader.check.problem(place, why, next);
    });
    let profile = parsed(&bytes.ok()?, path, place, reader)?;
    Some(ProfileWish {
        flux: flux.unwrap_or(profile.flux()) * multiplier.unwrap_or(1.0),
        profile,
        turn_deg,
    })
}

fn parsed(bytes: &[u8], path: &str, place: &str, reader: &mut Reader) -> Option<Arc<Profile>> {
    checked(bytes, &format!("{place}, '{}'", short(path)), reader.check)
}

/// A profile from the bytes of its file, with what is wrong or odd about it said.
pub(super) fn checked(
    bytes: &[u8],
    place: &str,
    check: &mut super::super::check::Check,
) -> Option<Arc<Profile>> {
    match Profile::parse(bytes) {
        Ok(profile) if profile.flux() > 0.0 => {
            for warning in &profile.warnings {
                check.warn(format!("{place}: {warning}"));
            }
            Some(Arc::new(profile))
        }
        Ok(_) => {
            check.problem(
                place,
                "gives no light: its intensities are 0",
                "give another file",
            );
            None
        }
        Err(fault) => {
            check.problem(
                &format!("{place}, line {}", fault.line),
                fault.what,
                fault.next,
            );
            None
        }
    }
}

fn number(
    reader: &mut Reader,
    object: &Map<String, Value>,
    key: &str,
    least: f64,
    place: &str,
) -> Option<f64> {
    let value = object.get(key)?;
    let number = value.as_f64().filter(|x| x.is_finite() && *x >= least);
    if number.is_none() {
        let what = format!("{key} is {value}");
        let next = match least < 0.0 {
            true => "give a number",
            false => "give a number of at least 0",
        };
        reader.check.problem(place, what, next);
    }
    number
}
