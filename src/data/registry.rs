//! Spectra by name: `cie/F2`, `macbeth/white`, `cornell/red`, `blackbody/2700`.
//!
//! The tables lie beside this file as CSV, each with its source, edition, step, range, units and licence.

use super::nearest::nearest_of;
use super::table::CsvColumns;
use super::{Table, blackbody};

/// What a named table is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableKind {
    /// Relative spectral power.
    Illuminant,
    /// Reflectance factor, [0, 1].
    Reflectance,
}

/// A spectrum of the registry.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Named {
    /// Its values.
    pub table: Table,
    /// What they mean.
    pub kind: TableKind,
}

/// Temperatures that `blackbody/...` takes, K.
const TEMPERATURES: std::ops::RangeInclusive<f64> = 500.0..=50_000.0;

struct File {
    prefix: &'static str,
    kind: TableKind,
    csv: &'static str,
}

const FILES: [File; 9] = [
    File {
        prefix: "cie",
        kind: TableKind::Illuminant,
        csv: include_str!("illuminants.csv"),
    },
    File {
        prefix: "cie",
        kind: TableKind::Illuminant,
        csv: include_str!("fluorescent.csv"),
    },
    File {
        prefix: "cie",
        kind: TableKind::Illuminant,
        csv: include_str!("fluorescent_fl3.csv"),
    },
    File {
        prefix: "cie",
        kind: TableKind::Illuminant,
        csv: include_str!("discharge.csv"),
    },
    File {
        prefix: "cie",
        kind: TableKind::Illuminant,
        csv: include_str!("led.csv"),
    },
    File {
        prefix: "macbeth",
        kind: TableKind::Reflectance,
        csv: include_str!("colorchecker_ohta.csv"),
    },
    File {
        prefix: "babelcolor",
        kind: TableKind::Reflectance,
        csv: include_str!("colorchecker_babelcolor.csv"),
    },
    File {
        prefix: "cornell",
        kind: TableKind::Reflectance,
        csv: include_str!("cornell_walls.csv"),
    },
    File {
        prefix: "cornell",
        kind: TableKind::Illuminant,
        csv: include_str!("cornell_light.csv"),
    },
];

impl File {
    fn columns(&self) -> CsvColumns {
        CsvColumns::parse(self.csv).expect("built-in tables are well formed")
    }
}

/// The spectrum of that name, none if there is no such name.
///
/// ```
/// use haarlight::data::{Outside, TableKind, named};
/// let f2 = named("cie/F2").unwrap();
/// assert_eq!(f2.kind, TableKind::Illuminant);
/// assert_eq!(f2.table.at(545.0, Outside::Zero), 24.88);
/// assert_eq!(named("cie/FL2"), Some(f2));
/// assert_eq!(named("blackbody/2700").unwrap().table.at(560.0, Outside::Zero), 100.0);
/// assert_eq!(named("cie/F99"), None);
/// ```
pub fn named(name: &str) -> Option<Named> {
    let (prefix, column) = name.split_once('/')?;
    if prefix == "blackbody" {
        let kelvin = column
            .parse::<f64>()
            .ok()
            .filter(|kelvin| TEMPERATURES.contains(kelvin))?;
        return Some(Named {
            table: blackbody(kelvin),
            kind: TableKind::Illuminant,
        });
    }
    // CIE 015:2004 renamed F1-F12 to FL1-FL12.
    let old_name = column
        .strip_prefix("FL")
        .filter(|rest| !rest.contains('.'))
        .map(|rest| format!("F{rest}"));
    let column = old_name.as_deref().unwrap_or(column);
    FILES
        .iter()
        .filter(|file| file.prefix == prefix)
        .find_map(|file| {
            let table = file.columns().table(column)?;
            Some(Named {
                table,
                kind: file.kind,
            })
        })
}

/// Every name, in the order of the publications; one blackbody stands for all of them.
pub fn names() -> Vec<String> {
    let mut names = Vec::new();
    for file in &FILES {
        names.extend(
            file.columns()
                .names
                .iter()
                .map(|column| format!("{}/{column}", file.prefix)),
        );
    }
    names.push("blackbody/2700".into());
    names
}

/// The three names nearest to `name` by edit distance (letter case is free), nearest first.
///
/// ```
/// assert_eq!(haarlight::data::nearest("cie/d65x")[0], "cie/D65");
/// assert_eq!(haarlight::data::nearest("cornel/red")[0], "cornell/red");
/// ```
pub fn nearest(name: &str) -> Vec<String> {
    nearest_of(name, names())
}

/// The CIE 1931 2 degree observer: x_bar, y_bar, z_bar at 360-830 nm in steps of 1 nm.
pub(crate) fn cmf_1931() -> [Table; 3] {
    columns_of(include_str!("cmf_1931.csv"), ["x_bar", "y_bar", "z_bar"])
}

/// The CIE 1964 10 degree observer: x_bar, y_bar, z_bar at 360-830 nm in steps of 1 nm.
pub(crate) fn cmf_1964() -> [Table; 3] {
    columns_of(
        include_str!("cmf_1964.csv"),
        ["x10_bar", "y10_bar", "z10_bar"],
    )
}

/// The CIE S 026 action spectra: S-, M-, L-cone-opic, rhodopic, melanopic at 380-780 nm in steps of 1 nm.
pub(crate) fn alpha_opic() -> [Table; 5] {
    let names = [
        "s_cone_opic",
        "m_cone_opic",
        "l_cone_opic",
        "rhodopic",
        "melanopic",
    ];
    columns_of(include_str!("alpha_opic.csv"), names)
}

/// The 14 test colour samples of CIE 13.3, reflectance at 360-830 nm in steps of 5 nm.
pub(crate) fn test_colours() -> Vec<Table> {
    all_of(include_str!("test_colours.csv"))
}

/// The 99 colour evaluation samples of CIE 224 and TM-30, reflectance at 380-780 nm in steps of 5 nm.
pub(crate) fn colour_evaluation() -> Vec<Table> {
    all_of(include_str!("colour_evaluation.csv"))
}

fn columns_of<const N: usize>(csv: &str, names: [&str; N]) -> [Table; N] {
    let columns = CsvColumns::parse(csv).expect("built-in tables are well formed");
    names.map(|name| {
        columns
            .table(name)
            .expect("built-in tables have the columns that they are read for")
    })
}

fn all_of(csv: &str) -> Vec<Table> {
    let columns = CsvColumns::parse(csv).expect("built-in tables are well formed");
    (columns.names.iter())
        .filter_map(|name| columns.table(name))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_resolves_and_is_its_own_nearest() {
        let names = names();
        assert_eq!(names.len(), 7 + 12 + 15 + 5 + 9 + 24 + 24 + 3 + 1 + 1);
        for name in &names {
            assert!(named(name).is_some(), "{name}");
            assert_eq!(&nearest(name)[0], name);
        }
    }

    #[test]
    fn unknown_names_are_none() {
        for name in [
            "",
            "cie",
            "cie/",
            "/",
            "blackbody/",
            "blackbody/499",
            "blackbody/nan",
            "blackbody/inf",
            "cie/FL3.16",
            "D65",
        ] {
            assert_eq!(named(name), None, "{name}");
        }
        assert_eq!(nearest(&"x".repeat(100_000)).len(), 3);
    }

    #[test]
    fn reflectances_are_physical() {
        for name in names() {
            let named = named(&name).unwrap();
            if named.kind == TableKind::Reflectance {
                assert!(
                    named.table.values().iter().all(|v| (0.0..=1.0).contains(v)),
                    "{name}"
                );
            }
        }
    }

    #[test]
    fn headers_state_their_source() {
        for csv in FILES.iter().map(|file| file.csv).chain([
            include_str!("cmf_1931.csv"),
            include_str!("cmf_1964.csv"),
            include_str!("alpha_opic.csv"),
            include_str!("test_colours.csv"),
            include_str!("colour_evaluation.csv"),
            include_str!("hosek_wilkie.csv"),
        ]) {
            for key in [
                "# source: ",
                "# edition: ",
                "# range: ",
                "# units: ",
                "# licence: ",
                "# original: ",
            ] {
                assert!(
                    csv.lines().any(|line| line.starts_with(key)),
                    "{key} missing"
                );
            }
        }
    }
}
