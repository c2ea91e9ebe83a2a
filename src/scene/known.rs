//! What side files and extras say of a material.

use super::fluorescence;
use super::json::short;
use super::luminaires::{self, ProfileWish};
use super::reader::{Reader, Sampled};
use super::transmittance;
use crate::data::TableKind;
use serde_json::{Map, Value};

/// What is known of a material.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct MaterialSpectra {
    /// Reflectance, unit 1.
    pub(crate) reflectance: Option<Sampled>,
    /// Emission and its luminance, cd/m2, if given.
    pub(crate) emission: Option<(Sampled, Option<f64>)>,
    /// How the emission is spread, if not evenly.
    pub(crate) profile: Option<ProfileWish>,
    /// Transmittance of a pane at normal incidence, unit 1.
    pub(crate) transmittance: Option<Sampled>,
    /// Diffuse transmittance of a sheet, unit 1.
    pub(crate) transmission: Option<Sampled>,
    /// Reflectance of the back of a sheet, unit 1.
    pub(crate) back: Option<Sampled>,
    /// Is it a mirror? None: as its roughness says.
    pub(crate) mirror: Option<bool>,
    /// What it fluoresces.
    pub(crate) fluorescence: Option<fluorescence::FluorescenceWish>,
}

impl MaterialSpectra {
    /// These spectra, and where they say nothing the others.
    pub(crate) fn or(self, other: Self) -> Self {
        Self {
            reflectance: self.reflectance.or(other.reflectance),
            emission: self.emission.or(other.emission),
            profile: self.profile.or(other.profile),
            transmittance: self.transmittance.or(other.transmittance),
            transmission: self.transmission.or(other.transmission),
            back: self.back.or(other.back),
            mirror: self.mirror.or(other.mirror),
            fluorescence: self.fluorescence.or(other.fluorescence),
        }
    }
}

/// Reads the object of a material.
pub(super) fn read(reader: &mut Reader, entry: &Value, place: &str) -> MaterialSpectra {
    let Some(entry) = reader.object(entry, place) else {
        return MaterialSpectra::default();
    };
    const KEYS: [&str; 7] = [
        "reflectance",
        "back_reflectance",
        "emission",
        "mirror",
        "fluorescence",
        "transmission",
        "transmittance",
    ];
    reader.keys(entry, &KEYS, place);
    let mut spectra = MaterialSpectra::default();
    let mut reflectance = |key: &str| reader.share(entry.get(key)?, &format!("{place}, {key}"));
    spectra.reflectance = reflectance("reflectance");
    spectra.back = reflectance("back_reflectance");
    if let Some(value) = entry.get("fluorescence") {
        spectra.fluorescence = fluorescence::read(reader, value, place);
        let diagonal = (spectra.fluorescence.as_ref()).and_then(|wish| wish.diagonal);
        match (&spectra.reflectance, diagonal) {
            (Some(_), Some(_)) => {
                let what = "has a reflectance, and a matrix whose diagonal is one";
                let next = "take the reflectance out, or leave the diagonal at 0";
                reader.check.problem(place, what, next);
            }
            (None, Some(spectrum)) => {
                spectra.reflectance = Some(Sampled {
                    from: "the matrix's diagonal".into(),
                    spectrum,
                    is_csv: true,
                });
            }
            _ => {}
        }
    }
    if let Some(value) = entry.get("transmittance") {
        spectra.transmittance = transmittance::read(reader, entry, value, place);
    }
    if let Some(value) = entry.get("transmission") {
        spectra.transmission = transmittance::share(reader, value, "transmission", place);
    }
    if let Some(value) = entry.get("mirror") {
        spectra.mirror = value.as_bool();
        if spectra.mirror.is_none() {
            let what = format!("mirror is {}, not true or false", short(&value.to_string()));
            let next = "write \"mirror\": true, or false for a matt surface";
            reader.check.problem(place, what, next);
        }
    }
    if let Some(value) = entry.get("emission") {
        let place = format!("{place}, emission");
        if let Some(object) = reader.object(value, &place) {
            spectra.profile = luminaires::read_profile(reader, object, &place);
            reader.keys(object, &luminaires::OF_EMISSION, &place);
            let luminance = luminance(reader, object, &place);
            if luminaires::says_spectrum(object) || !object.contains_key("profile") {
                let sampled = reader.sampled(object, TableKind::Illuminant, &place);
                spectra.emission = sampled.map(|s| (s, luminance));
            }
        }
    }
    spectra
}

fn luminance(reader: &mut Reader, object: &Map<String, Value>, place: &str) -> Option<f64> {
    let value = object.get("luminance_cd_m2")?;
    let number = value.as_f64().filter(|v| v.is_finite() && *v >= 0.0);
    if number.is_none() {
        let what = format!("luminance_cd_m2 is {value}, not a number of at least 0");
        reader
            .check
            .problem(place, what, "give the luminance in cd/m2");
    }
    number
}
