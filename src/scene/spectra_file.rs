//! Measured spectra for a room: `room.spectra.json` beside it (or the file that `--spectra` names), and `extras`.
//!
//! ```json
//! { "materials": { "wall":  { "reflectance": { "csv": "spectra/wall.csv" } },
//!                  "panel": { "reflectance": { "name": "macbeth/white" },
//!                             "emission": { "name": "cie/F2", "luminance_cd_m2": 5000 } },
//!                  "glass": { "transmittance": { "csv": "spectra/glass.csv" } } },
//!   "lights":    { "Spot": { "name": "cie/A" } },
//!   "sky":       { "type": "overcast" },
//!   "layers":    { "desk": ["Spot", "bulb"] } }
//! ```
//!
//! Materials and lights go by their glTF names; all that share a name get the entry. `extras` of a material hold the
//! object of a material, `extras` of a light that of a light. The file wins, reflectance and emission each by itself.
//!
//! A CSV (`wavelength_nm,value`, linear between rows) lies in the folder of the file that names it; a text of several lines
//! is the CSV itself. A reflectance is held beyond its rows, an emission is zero there. The emission of a *surface* given as a CSV without a luminance is
//! spectral radiance in W/m2/sr/nm; with a luminance (cd/m2) only its shape counts. A named illuminant without a
//! luminance keeps the brightness that glTF gives the material. The spectrum of a *light* is a shape always: glTF's
//! candela or lux, times the luminance of its colour, say how bright it is. `"profile"`: see `luminaires`.
//!
//! Unknown keys of the file, and names that the room does not have, are problems that come with the nearest names; a
//! lenient reader is only warned of them. Unknown keys of `extras` belong to other programs and are passed over.

use super::check::{Check, Unknown};
use super::json::short;
use super::known::{MaterialSpectra, Sampled};
use super::layers::Wish;
use super::load::Options;
use super::luminaires::{self, LampWish};
use super::said;
use super::sky::SkyWish;
use super::transmittance;
use super::uri;
use crate::data::Grid;
use crate::data::{Kind, Named, Outside, Table, named, nearest, nearest_of};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Above this a table of reflectances is taken for percent.
const NOT_A_FRACTION: f64 = 2.0;

/// The side file of a room; empty if there is none.
#[derive(Debug, Default)]
pub(crate) struct SpectraFile {
    materials: BTreeMap<String, MaterialSpectra>,
    lights: BTreeMap<String, LampWish>,
    /// What is said of sky and sun.
    pub(crate) sky: SkyWish,
    /// Which lamps are told apart, see [`layers`](super::layers).
    pub(crate) layers: Vec<Wish>,
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
            let spectra = reader.material(entry, &place);
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
            .map(|extras| reader.material(extras, &format!("material '{}', extras", short(name))))
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

/// Reads the objects of a side file or of extras.
pub(crate) struct Reader<'a> {
    pub(super) folder: PathBuf,
    grid: &'a Grid,
    pub(super) check: &'a mut Check,
    unknown: Unknown,
}

impl Reader<'_> {
    fn material(&mut self, entry: &Value, place: &str) -> MaterialSpectra {
        let Some(entry) = self.object(entry, place) else {
            return MaterialSpectra::default();
        };
        self.keys(entry, &["reflectance", "emission", "transmittance"], place);
        let mut spectra = MaterialSpectra::default();
        if let Some(value) = entry.get("reflectance") {
            let place = format!("{place}, reflectance");
            if let Some(object) = self.object(value, &place) {
                self.keys(object, &["name", "csv"], &place);
                spectra.reflectance = self.sampled(object, Kind::Reflectance, &place);
            }
        }
        if let Some(value) = entry.get("transmittance") {
            spectra.transmittance = transmittance::read(self, entry, value, place);
        }
        if let Some(value) = entry.get("emission") {
            let place = format!("{place}, emission");
            if let Some(object) = self.object(value, &place) {
                spectra.profile = luminaires::read_profile(self, object, &place);
                self.keys(object, &luminaires::OF_EMISSION, &place);
                let luminance = self.luminance(object, &place);
                if luminaires::says_spectrum(object) || !object.contains_key("profile") {
                    let sampled = self.sampled(object, Kind::Illuminant, &place);
                    spectra.emission = sampled.map(|s| (s, luminance));
                }
            }
        }
        spectra
    }

    fn luminance(&mut self, object: &Map<String, Value>, place: &str) -> Option<f64> {
        let value = object.get("luminance_cd_m2")?;
        let number = value.as_f64().filter(|v| v.is_finite() && *v >= 0.0);
        if number.is_none() {
            let what = format!("luminance_cd_m2 is {value}, not a number of at least 0");
            self.check
                .problem(place, what, "give the luminance in cd/m2");
        }
        number
    }

    pub(super) fn sampled(
        &mut self,
        object: &Map<String, Value>,
        kind: Kind,
        place: &str,
    ) -> Option<Sampled> {
        let outside = match kind {
            Kind::Reflectance => Outside::Hold,
            Kind::Illuminant => Outside::Zero,
        };
        let text = |key: &str| object.get(key).map(|v| v.as_str().map(str::to_owned));
        let (table, from, is_csv) = match (text("name"), text("csv")) {
            (Some(Some(name)), None) => (self.named(&name, kind, place)?, name, false),
            (None, Some(Some(path))) => (self.csv(&path, place)?, said::called(&path), true),
            _ => {
                let next = "give either \"name\" or \"csv\", a text";
                self.check
                    .problem(place, "does not say which spectrum", next);
                return None;
            }
        };
        if kind == Kind::Reflectance && table.values().iter().any(|v| *v > NOT_A_FRACTION) {
            let what = format!("'{from}' holds reflectances above {NOT_A_FRACTION}");
            self.check.problem(
                place,
                what,
                "write reflectances from 0 to 1, not in percent",
            );
            return None;
        }
        let leaves = self.grid.means(&table, outside);
        if kind == Kind::Illuminant && leaves.iter().all(|v| *v == 0.0) {
            let (start, end) = (self.grid.start(), self.grid.end());
            let what = format!("'{from}' gives no light from {start} to {end} nm");
            self.check.problem(
                place,
                what,
                "give a spectrum of visible light, in nanometres",
            );
            return None;
        }
        Some(Sampled {
            from,
            leaves,
            is_csv,
        })
    }

    fn named(&mut self, name: &str, kind: Kind, place: &str) -> Option<Table> {
        match named(name) {
            Some(Named { table, kind: found }) if found == kind => Some(table),
            Some(_) => {
                let (is, wanted) = match kind {
                    Kind::Reflectance => ("the light of a lamp", "a reflectance"),
                    Kind::Illuminant => ("a reflectance", "the light of a lamp"),
                };
                let what = format!("'{name}' is {is}, not {wanted}");
                self.check.problem(place, what, format!("name {wanted}"));
                None
            }
            None => {
                let what = format!("no spectrum is named '{}'", short(name));
                let next = format!("the nearest names are {}", nearest(name).join(", "));
                self.check.problem(place, what, next);
                None
            }
        }
    }

    fn csv(&mut self, path: &str, place: &str) -> Option<Table> {
        let next = "give a CSV of wavelength_nm,value inside the folder of the file that names it";
        let read = match said::is_rows(path) {
            true => Ok(path.as_bytes().to_vec()),
            false => uri::read(&self.folder, path),
        };
        let bytes = match read {
            Ok(bytes) => bytes,
            Err(why) => {
                self.check.problem(place, why, next);
                return None;
            }
        };
        match Table::parse_csv(&String::from_utf8_lossy(&bytes)) {
            Ok(table) => Some(table),
            Err(why) => {
                let what = format!("'{}', {why}", said::called(path));
                self.check.problem(place, what, next);
                None
            }
        }
    }

    /// A list of names, or one name.
    fn names(&mut self, value: &Value, place: &str) -> Vec<String> {
        let text = |v: &Value| v.as_str().map(str::to_owned);
        let names = match value {
            Value::Array(list) => list.iter().map(text).collect(),
            one => text(one).map(|name| vec![name]),
        };
        let names = names.filter(|names: &Vec<String>| !names.is_empty());
        if names.is_none() {
            let next = "write [\"LAMP\", ...], names of lights, materials or nodes";
            self.check.problem(place, "is no list of names", next);
        }
        names.unwrap_or_default()
    }

    /// An entry for a name that the room does not have.
    fn known(&mut self, name: &str, names: &[String], kind: &str, place: &str) {
        if names.iter().any(|n| n == name) {
            return;
        }
        let near: Vec<String> = nearest_of(name, names).iter().map(|n| short(n)).collect();
        let next = if near.is_empty() {
            format!("the room has no {kind}s: take the entry out")
        } else {
            format!("the nearest names are {}", near.join(", "))
        };
        self.check.stranger(
            self.unknown,
            place,
            format!("the room has no {kind} of that name"),
            next,
        );
    }

    /// The members of an object inside an object; none where it is missing.
    fn entries<'v>(
        &mut self,
        top: &'v Map<String, Value>,
        key: &str,
        place: &str,
    ) -> Vec<(&'v String, &'v Value)> {
        top.get(key)
            .and_then(|value| self.object(value, &format!("{place}: {key}")))
            .map(|object| object.iter().collect())
            .unwrap_or_default()
    }

    pub(crate) fn object<'v>(
        &mut self,
        value: &'v Value,
        place: &str,
    ) -> Option<&'v Map<String, Value>> {
        let object = value.as_object();
        match (object, self.unknown) {
            (None, Unknown::Refuse | Unknown::Warn) => {
                self.check
                    .problem(place, "is not a JSON object", "write { ... }")
            }
            (None, Unknown::Ignore) => self
                .check
                .warn(format!("{place}: not an object, passed over")),
            _ => {}
        }
        object
    }

    pub(crate) fn keys(&mut self, object: &Map<String, Value>, known: &[&str], place: &str) {
        for key in object.keys().filter(|key| !known.contains(&key.as_str())) {
            let near = nearest_of(key, known);
            let what = format!("unknown key \"{}\"", short(key));
            let next = format!("the nearest names are {}", near.join(", "));
            self.check.stranger(self.unknown, place, what, next);
        }
    }
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
        assert_eq!(rows.unwrap().leaves, wall.leaves);
        // Held beyond its rows.
        assert!((wall.leaves[0] - 0.2).abs() < 1e-12 && (wall.leaves[63] - 0.5).abs() < 1e-12);
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
            "material 'wall': unknown key \"emision\"; the nearest names are emission, reflectance",
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
