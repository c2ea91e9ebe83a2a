//! Reads objects of side files and of extras: their keys, and the spectra that they name.

use super::check::{Check, Unknown};
use super::json::short;
use super::said;
use super::uri;
use crate::color::Observer;
use crate::data::{
    BANDS, Grid, Named, Outside, Spectrum, Table, TableKind, named, nearest, nearest_of,
};
use serde_json::{Map, Value};
use std::path::PathBuf;

/// Where the observer's table begins, nm (CIE 018:2019, table 6): shorter wavelengths are there to excite only, and a table without them
/// says nothing of the light that is seen.
const VISIBLE_NM: f64 = 360.0;
/// Above this a table of reflectances is taken for percent.
const NOT_A_FRACTION: f64 = 2.0;

/// A spectrum on the grid, and where it came from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sampled {
    /// `cie/F2` or the CSV's path as written.
    pub(crate) from: String,
    /// Band means.
    pub(crate) spectrum: Spectrum,
    /// Values of a CSV carry a unit; those of the registry are relative.
    pub(crate) is_csv: bool,
}

/// Reads the objects of a side file or of extras.
pub(crate) struct Reader<'a> {
    pub(super) folder: PathBuf,
    pub(super) grid: &'a Grid,
    pub(super) check: &'a mut Check,
    pub(super) unknown: Unknown,
}

impl Reader<'_> {
    /// The table that an object names, and what it is called.
    pub(super) fn table(
        &mut self,
        object: &Map<String, Value>,
        kind: TableKind,
        place: &str,
    ) -> Option<(Table, String)> {
        let (table, from, _) = self.given(object, kind, place)?;
        self.is_share(&table, kind, &from, place)
            .then_some((table, from))
    }

    /// The same, and whether it is a CSV.
    fn given(
        &mut self,
        object: &Map<String, Value>,
        kind: TableKind,
        place: &str,
    ) -> Option<(Table, String, bool)> {
        let text = |key: &str| object.get(key).map(|v| v.as_str().map(str::to_owned));
        match (text("name"), text("csv")) {
            (Some(Some(name)), None) => Some((self.named(&name, kind, place)?, name, false)),
            (None, Some(Some(path))) => Some((self.csv(&path, place)?, said::called(&path), true)),
            _ => {
                let next = "give either \"name\" or \"csv\", a text";
                self.check
                    .problem(place, "does not say which spectrum", next);
                None
            }
        }
    }

    /// Reflectances are shares, not percent; what is none is said.
    fn is_share(&mut self, table: &Table, kind: TableKind, from: &str, place: &str) -> bool {
        let wrong =
            kind == TableKind::Reflectance && table.values().iter().any(|v| *v > NOT_A_FRACTION);
        if wrong {
            let what = format!("'{from}' holds reflectances above {NOT_A_FRACTION}");
            self.check.problem(
                place,
                what,
                "write reflectances from 0 to 1, not in percent",
            );
        }
        !wrong
    }

    /// The spectrum that an object names, on the grid.
    pub(super) fn sampled(
        &mut self,
        object: &Map<String, Value>,
        kind: TableKind,
        place: &str,
    ) -> Option<Sampled> {
        let outside = match kind {
            TableKind::Reflectance => Outside::Hold,
            TableKind::Illuminant => Outside::Zero,
        };
        let (table, from, is_csv) = self.given(object, kind, place)?;
        if !self.is_share(&table, kind, &from, place) {
            return None;
        }
        let spectrum = self.grid.means(&table, outside);
        if kind == TableKind::Illuminant && spectrum.iter().all(|v| *v == 0.0) {
            let (start, end) = (self.grid.start(), self.grid.end());
            let what = format!("'{from}' gives no light from {start} to {end} nm");
            self.check.problem(
                place,
                what,
                "give a spectrum of visible light, in nanometres",
            );
            return None;
        }
        let luminous = || Observer::cie1931().weights(self.grid)[1];
        let seen = |y: Spectrum| spectrum.iter().zip(y).any(|(x, y)| x * y > 0.0);
        if kind == TableKind::Illuminant && !seen(luminous()) {
            let what = format!("'{from}' gives no light that an eye sees");
            let next = "lamps are measured by what is seen of them: give the trace of visible light that it has";
            self.check.problem(place, what, next);
            return None;
        }
        self.note_ultraviolet(&table, kind, &from);
        Some(Sampled {
            from,
            spectrum,
            is_csv,
        })
    }

    /// A share of light at each wavelength: an object that names a spectrum, or one number from 0 to 1 for all.
    pub(super) fn share(&mut self, value: &Value, place: &str) -> Option<Sampled> {
        let Some(plain) = value.as_f64() else {
            let object = self.object(value, place)?;
            self.keys(object, &["name", "csv"], place);
            return self.sampled(object, TableKind::Reflectance, place);
        };
        if !(0.0..=1.0).contains(&plain) {
            self.goes_beyond(&plain.to_string(), place);
            return None;
        }
        Some(Sampled {
            from: plain.to_string(),
            spectrum: [plain; BANDS],
            is_csv: false,
        })
    }

    /// Says that a share of light is none.
    pub(super) fn goes_beyond(&mut self, from: &str, place: &str) {
        let what = format!("'{from}' goes beyond 0 to 1");
        let next = "write a share of light, from 0 to 1";
        self.check.problem(place, what, next);
    }

    /// Says where a spectrum has no data in the ultraviolet that is asked for.
    fn note_ultraviolet(&mut self, table: &Table, kind: TableKind, from: &str) {
        let (start, first) = (self.grid.start(), table.range()[0]);
        if start < VISIBLE_NM && first > start {
            let taken = match kind {
                TableKind::Reflectance => "held at its first value",
                TableKind::Illuminant => "taken as 0",
            };
            let from = short(from);
            self.check.warn(format!(
                "'{from}' has no data below {first} nm: {taken} from {start} nm on"
            ));
        }
    }

    /// The text of the CSV that an object names, and what it is called.
    pub(super) fn text(
        &mut self,
        object: &Map<String, Value>,
        place: &str,
    ) -> Option<(String, String)> {
        let next = "give a CSV inside the folder of the file that names it";
        let Some(path) = object.get("csv").and_then(Value::as_str) else {
            self.check.problem(place, "its csv is no text", next);
            return None;
        };
        match self.bytes(path) {
            Ok(bytes) => {
                let text = String::from_utf8_lossy(&bytes).into_owned();
                Some((text, said::called(path)))
            }
            Err(why) => {
                self.check.problem(place, why, next);
                None
            }
        }
    }

    fn bytes(&self, path: &str) -> Result<Vec<u8>, String> {
        match said::is_rows(path) {
            true => Ok(path.as_bytes().to_vec()),
            false => uri::read(&self.folder, path),
        }
    }

    fn named(&mut self, name: &str, kind: TableKind, place: &str) -> Option<Table> {
        match named(name) {
            Some(Named { table, kind: found }) if found == kind => Some(table),
            Some(_) => {
                let (is, wanted) = match kind {
                    TableKind::Reflectance => ("the light of a lamp", "a reflectance"),
                    TableKind::Illuminant => ("a reflectance", "the light of a lamp"),
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
        let bytes = match self.bytes(path) {
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
    pub(super) fn names(&mut self, value: &Value, place: &str) -> Vec<String> {
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
    pub(super) fn known(&mut self, name: &str, names: &[String], kind: &str, place: &str) {
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
    pub(super) fn entries<'v>(
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

    /// A value as an object; what is none is said.
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

    /// Says which keys are not known.
    pub(crate) fn keys(&mut self, object: &Map<String, Value>, known: &[&str], place: &str) {
        for key in object.keys().filter(|key| !known.contains(&key.as_str())) {
            let near = nearest_of(key, known);
            let what = format!("unknown key \"{}\"", short(key));
            let next = format!("the nearest names are {}", near.join(", "));
            self.check.stranger(self.unknown, place, what, next);
        }
    }
}
