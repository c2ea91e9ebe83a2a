//! Measured spectra for a room: `room.spectra.json` beside it (or the file that `--spectra` names), and `extras`.
//!
//! ```json
//! { "materials": { "wall":  { "reflectance": { "csv": "spectra/wall.csv" } },
//!                  "panel": { "reflectance": { "name": "macbeth/white" },
//!                             "emission": { "name": "cie/F2", "luminance_cd_m2": 5000 } },
//!                  "glass": { "transmittance": { "csv": "spectra/glass.csv" } },
//!                  "shade": { "reflectance": { "csv": "outside.csv" }, "back_reflectance": { "csv": "inside.csv" },
//!                             "transmission": { "csv": "paper.csv" } },
//!                  "silver": { "reflectance": { "csv": "silver.csv" }, "mirror": true } },
//!   "lights":    { "Spot": { "name": "cie/A" } },
//!   "sky":       { "type": "overcast" },
//!   "layers":    { "desk": ["Spot", "bulb"] } }
//! ```
//!
//! Materials and lights go by their glTF names; all that share a name get the entry. `extras` of a material hold the
//! object of a material, `extras` of a light that of a light. The file wins, reflectance and emission each by itself.
//!
//! A CSV (`wavelength_nm,value`, linear between rows) lies in the folder of the file that names it; a text of several lines
//! is the CSV itself. One number from 0 to 1 is a reflectance, transmittance or transmission alike at all wavelengths. A reflectance is held beyond its rows, an emission is zero there. The emission of a *surface* given as a CSV without a luminance is
//! spectral radiance in W/m2/sr/nm; with a luminance (cd/m2) only its shape counts. A named illuminant without a
//! luminance keeps the brightness that glTF gives the material. The spectrum of a *light* is a shape always: glTF's
//! candela or lux, times the luminance of its colour, say how bright it is. `"profile"`: see `luminaires`.
//!
//! `"fluorescence"`: see [`fluorescence`](super::fluorescence).
//!
//! Unknown keys of the file, and names that the room does not have, are problems that come with the nearest names; a
//! lenient reader is only warned of them. Unknown keys of `extras` belong to other programs and are passed over.

use super::check::{Check, Unknown};
use super::json::short;
use super::known::{self, MaterialSpectra};
use super::layers::LayerWish;
use super::luminaires::{self, LampWish};
use super::options::Options;
use super::reader::Reader;
use super::said;
use super::sky::SkyWish;
use super::uri;
use crate::data::Grid;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The side file of a room; empty if there is none.
#[derive(Debug, Default)]
pub(crate) struct SpectraFile {
    materials: BTreeMap<String, MaterialSpectra>,
    lights: BTreeMap<String, LampWish>,
    /// What is said of sky and sun.
    pub(crate) sky: SkyWish,
    /// Which lamps are told apart, see [`layers`](super::layers).
    pub(crate) layers: Vec<LayerWish>,
}

impl SpectraFile {
    /// Reads the file that was asked for, or the one beside the room if it is there, and what was said over it.
    ///
    /// `materials` and `lights` are the names in the room; entries for other names, and keys that mean nothing, are
    /// problems unless the reader is lenient.
    pub(crate) fn open(
        room: &Path,
        options: &Options,
        materials: &[String],
        lights: &[String],
        check: &mut Check,
    ) -> Self {
        let path = options.spectra.clone().or_else(|| beside(room));
        let place = path
            .as_ref()
            .map_or_else(|| "spectra".to_owned(), |path| path.display().to_string());
        let json = match &path {
            Some(path) => match said::json_of(path) {
                Ok(json) => Some(json),
                Err((what, next)) => {
                    check.problem(&place, what, next);
                    return Self::default();
                }
            },
            None => None,
        };
        let Some(json) = said::over(json, options.said.as_ref()) else {
            return Self::default();
        };
        let mut reader = Reader {
            folder: uri::folder_of(path.as_deref().unwrap_or(room)),
            grid: &options.grid,
            check,
            unknown: if options.lenient {
                Unknown::Warn
            } else {
                Unknown::Refuse
            },
        };
        let mut file = Self::default();
        let Some(top) = reader.object(&json, &place) else {
            return file;
        };
        reader.keys(top, &["materials", "lights", "sky", "layers"], &place);
        if let Some(sky) = top.get("sky") {
            file.sky = SkyWish::read(sky, &format!("{place}: sky"), &mut reader);
        }
        for (name, entry) in reader.entries(top, "materials", &place) {
            let place = format!("{place}: material '{}'", short(name));
            reader.known(name, materials, "material", &place);
            let spectra = known::read(&mut reader, entry, &place);
            file.materials.insert(name.clone(), spectra);
        }
        for (name, entry) in reader.entries(top, "layers", &place) {
            let place = format!("{place}: layer '{}'", short(name));
            let lamps = reader.names(entry, &place);
            file.layers.push((name.clone(), lamps));
        }
        for (name, entry) in reader.entries(top, "lights", &place) {
            let place = format!("{place}: light '{}'", short(name));
            reader.known(name, lights, "light", &place);
            if let Some(lamp) = luminaires::read(&mut reader, entry, &place) {
                file.lights.insert(name.clone(), lamp);
            }
        }
        file
    }

    /// What the file says of a material, and where it is silent the material's `extras`.
    pub(crate) fn material(
        &self,
        name: &str,
        extras: Option<&Value>,
        room: &Path,
        grid: &Grid,
        check: &mut Check,
    ) -> MaterialSpectra {
        let mut reader = Reader {
            folder: uri::folder_of(room),
            grid,
            check,
            unknown: Unknown::Ignore,
        };
        let own = extras
            .filter(|extras| extras.is_object())
            .map(|extras| {
                let place = format!("material '{}', extras", short(name));
                known::read(&mut reader, extras, &place)
            })
            .unwrap_or_default();
        self.materials
            .get(name)
            .cloned()
            .unwrap_or_default()
            .or(own)
    }

    /// The same for a punctual light.
    pub(crate) fn light(
        &self,
        name: &str,
        extras: Option<&Value>,
        room: &Path,
        grid: &Grid,
        check: &mut Check,
    ) -> Option<LampWish> {
        if let Some(lamp) = self.lights.get(name) {
            return Some(lamp.clone());
        }
        let extras = extras.filter(|extras| luminaires::is_ours(extras))?;
        let mut reader = Reader {
            folder: uri::folder_of(room),
            grid,
            check,
            unknown: Unknown::Ignore,
        };
        let place = format!("light '{}', extras", short(name));
        luminaires::read(&mut reader, extras, &place)
    }
}

/// `room.spectra.json` for `room.glb`, if it is there.
fn beside(room: &Path) -> Option<PathBuf> {
    let stem = room.file_stem()?;
    let mut name = stem.to_os_string();
    name.push(".spectra.json");
    let path = room.with_file_name(name);
    path.exists().then_some(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Opens a side file of this content for a room with materials wall, lamp and a light Spot.
    fn open(json: &Value, extra: &[(&str, &str)]) -> (SpectraFile, Vec<String>, Vec<String>) {
        opened(json, extra, Unknown::Refuse)
    }

    fn opened(
        json: &Value,
        extra: &[(&str, &str)],
        unknown: Unknown,
    ) -> (SpectraFile, Vec<String>, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in extra {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        std::fs::write(folder.path().join("room.spectra.json"), json.to_string()).unwrap();
        let mut check = Check::new("room.glb");
        let names = ["wall", "lamp"].map(str::to_owned);
        let room = folder.path().join("room.glb");
        let options = Options {
            lenient: unknown == Unknown::Warn,
            ..Options::default()
        };
        let lights = ["Spot".to_owned()];
        let file = SpectraFile::open(&room, &options, &names, &lights, &mut check);
        let (problems, warnings) = check.into_parts();
        (
            file,
            problems.iter().map(ToString::to_string).collect(),
            warnings,
        )
    }

    #[test]
    fn reads_names_tables_and_luminances() {
        let (file, problems, warnings) = open(
            &json!({
                "materials": {
                    "wall": {"reflectance": {"csv": "wall.csv"}},
                    "lamp": {"reflectance": {"name": "macbeth/white"},
                             "emission": {"name": "cie/F2", "luminance_cd_m2": 5000}},
                },
                "lights": {"Spot": {"name": "cie/A"}},
            }),
            &[("wall.csv", "wavelength_nm,value\n400,0.2\n700,0.5\n")],
        );
        assert_eq!((problems, warnings), (vec![], vec![]));
        let wall = file.materials["wall"].reflectance.as_ref().unwrap();
        let rows = json!({"materials": {"wall": {"reflectance": {"csv": "400,0.2\n700,0.5"}}}});
        let rows = open(&rows, &[]).0.materials["wall"].reflectance.clone();
        assert_eq!(rows.unwrap().spectrum, wall.spectrum);
        // Held beyond its rows.
        assert!((wall.spectrum[0] - 0.2).abs() < 1e-12 && (wall.spectrum[63] - 0.5).abs() < 1e-12);
        assert!(wall.is_csv);
        let (lamp, luminance) = file.materials["lamp"].emission.as_ref().unwrap();
        assert_eq!(
            (lamp.from.as_str(), *luminance, lamp.is_csv),
            ("cie/F2", Some(5000.0), false)
        );
        let spot = file.lights["Spot"].spectrum.as_ref();
        assert_eq!(spot.unwrap().from, "cie/A");
    }

    #[test]
    fn one_number_is_a_share_at_all_wavelengths() {
        for key in [
            "reflectance",
            "back_reflectance",
            "transmission",
            "transmittance",
        ] {
            let of = |number: f64| open(&json!({"materials": {"wall": {key: number}}}), &[]);
            let (file, problems, _) = of(0.25);
            assert_eq!(problems, Vec::<String>::new());
            let wall = &file.materials["wall"];
            let all = [
                &wall.reflectance,
                &wall.back,
                &wall.transmission,
                &wall.transmittance,
            ];
            let given: Vec<_> = all.into_iter().flatten().collect();
            assert_eq!(given.len(), 1, "{key}");
            assert_eq!(given[0].spectrum, [0.25; 64]);
            for number in [1.5, -0.1] {
                let said = of(number).1.join("\n");
                let text = format!("material 'wall', {key}: '{number}' goes beyond 0 to 1");
                assert!(said.contains(&text), "{text}\n-- in --\n{said}");
            }
        }
    }

    #[test]
    fn every_problem_is_told_with_a_way_out() {
        let (_, problems, warnings) = open(
            &json!({
                "materials": {
                    "wal": {"reflectance": {"name": "macbeth/white"}},
                    "wall": {"reflectance": {"name": "cie/F2"}, "emision": {}},
                    "lamp": {"reflectance": {"csv": "percent.csv"},
                             "emission": {"name": "cie/F99", "luminance_cd_m2": -1}},
                },
                "lights": {"Spot": {"csv": "../secret.csv"}, "Sun": {"name": "cie/A", "csv": "x.csv"}},
                "version": 1,
            }),
            &[("percent.csv", "400,20\n700,50\n")],
        );
        let all = problems.join("\n");
        for text in [
            "material 'wal': the room has no material of that name; the nearest names are wall, lamp",
            "'cie/F2' is the light of a lamp, not a reflectance",
            "'percent.csv' holds reflectances above 2",
            "luminance_cd_m2 is -1",
            "no spectrum is named 'cie/F99'; the nearest names are cie/F9",
            "climbs out of",
            "light 'Sun': the room has no light of that name; the nearest names are Spot",
            "light 'Sun': does not say which spectrum",
            "material 'wall': unknown key \"emision\"; the nearest names are emission, mirror, transmission",
            "unknown key \"version\"",
        ] {
            assert!(all.contains(text), "{text}\n-- in --\n{all}");
        }
        assert_eq!((problems.len(), warnings.len()), (10, 0), "{all}");
    }

    #[test]
    fn a_lenient_reader_is_warned_of_strangers() {
        let (file, problems, warnings) = opened(
            &json!({
                "materials": {"wal": {}, "wall": {"emision": {}, "reflectance": {"name": "macbeth/white"}}},
                "version": 1,
            }),
            &[],
            Unknown::Warn,
        );
        assert_eq!(problems, Vec::<String>::new());
        assert!(file.materials["wall"].reflectance.is_some());
        let all = warnings.join("\n");
        for text in [
            "\"emision\"; the nearest names are emission",
            "\"version\"",
            "'wal': the room has no",
        ] {
            assert!(all.contains(text), "{text}\n-- in --\n{all}");
        }
    }

    #[test]
    fn a_broken_or_missing_file_is_a_problem() {
        let mut check = Check::new("room.glb");
        let asked = Options {
            spectra: Some("/nowhere/at/all.json".into()),
            ..Options::default()
        };
        SpectraFile::open(Path::new("room.glb"), &asked, &[], &[], &mut check);
        assert!(check.has_problems());
        assert!(open(&json!([1, 2]), &[]).1[0].contains("not a JSON object"));
        assert!(
            open(&json!({"materials": 7}), &[]).1[0].contains("materials: is not a JSON object")
        );
        assert!(open(&json!({}), &[]).1.is_empty());
    }

    #[test]
    fn light_outside_the_grid_is_a_problem() {
        let ultraviolet = [("uv.csv", "wavelength_nm,value\n200,1\n300,1\n")];
        let (_, problems, _) = open(
            &json!({"lights": {"Spot": {"csv": "uv.csv"}}}),
            &ultraviolet,
        );
        assert!(
            problems[0].contains("gives no light from 380 to 780 nm"),
            "{problems:?}"
        );
    }

    #[test]
    fn the_file_wins_over_extras_field_by_field() {
        let (file, ..) = open(
            &json!({"materials": {"wall": {"reflectance": {"name": "macbeth/red"}}}}),
            &[],
        );
        let mut check = Check::new("room.glb");
        let extras = json!({
            "reflectance": {"name": "macbeth/blue"},
            "emission": {"name": "cie/A", "luminance_cd_m2": 10},
            "someone": "else's",
        });
        let grid = Grid::default();
        let spectra = file.material(
            "wall",
            Some(&extras),
            Path::new("room.glb"),
            &grid,
            &mut check,
        );
        assert_eq!(spectra.reflectance.unwrap().from, "macbeth/red");
        assert_eq!(spectra.emission.unwrap().0.from, "cie/A");
        // A light's extras are ours only if they name one of our spectra.
        let mut light = |extras| {
            let spectrum = file.light(
                "Spot",
                Some(&extras),
                Path::new("room.glb"),
                &grid,
                &mut check,
            );
            spectrum.and_then(|s| s.spectrum).map(|s| s.from)
        };
        assert_eq!(light(json!({"name": "cie/F11"})), Some("cie/F11".into()));
        assert_eq!(light(json!({"name": "Lamp.001"})), None);
        assert!(!check.has_problems());
        assert_eq!(check.into_parts().1, Vec::<String>::new());
    }
}
