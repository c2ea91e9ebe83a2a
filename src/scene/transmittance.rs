//! What a side file says of light that passes: `"transmittance"` of a whole pane at normal incidence, and `"transmission"` of a sheet.

use super::reader::{Reader, Sampled};
use serde_json::{Map, Value};

/// Reads the transmittance of a material's `entry`: by name or table as a reflectance, or one number for all wavelengths. A pane lets light
/// through and does nothing else; whatever stands beside it is a problem.
pub(super) fn read(
    reader: &mut Reader,
    entry: &Map<String, Value>,
    value: &Value,
    place: &str,
) -> Option<Sampled> {
    const OTHERS: [&str; 5] = [
        "reflectance",
        "back_reflectance",
        "emission",
        "fluorescence",
        "transmission",
    ];
    if OTHERS.iter().any(|key| entry.contains_key(*key)) {
        let what = "has a transmittance, and a reflectance or an emission beside it";
        let next = "a pane lets light through and does nothing else: take the other out";
        reader.check.problem(place, what, next);
    }
    share(reader, value, "transmittance", place)
}

/// Reads a share of light that passes under a key, as [`Reader::share`]; more than all cannot.
pub(super) fn share(reader: &mut Reader, value: &Value, key: &str, place: &str) -> Option<Sampled> {
    let place = format!("{place}, {key}");
    let sampled = reader.share(value, &place)?;
    if !sampled.spectrum.iter().all(|t| (0.0..=1.0).contains(t)) {
        reader.goes_beyond(&sampled.from, &place);
        return None;
    }
    Some(sampled)
}

#[cfg(test)]
mod tests {
    use super::super::Options;
    use super::super::check::Check;
    use super::super::spectra_file::SpectraFile;
    use super::*;
    use crate::data::{BANDS, Grid};
    use serde_json::json;

    /// What a side file with this entry comes to, and its problems.
    fn of(wall: &Value) -> (Option<Sampled>, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let json = json!({"materials": {"wall": wall}});
        std::fs::write(folder.path().join("room.spectra.json"), json.to_string()).unwrap();
        std::fs::write(folder.path().join("glass.csv"), "400,0.2\n700,1.2\n").unwrap();
        let (grid, mut check) = (Grid::default(), Check::new("room.glb"));
        let room = folder.path().join("room.glb");
        let names = ["wall".to_owned()];
        let file = SpectraFile::open(&room, &Options::default(), &names, &[], &mut check);
        let spectra = file.material("wall", None, &room, &grid, &mut check);
        let problems = check.into_parts().0;
        let problems = problems.iter().map(ToString::to_string).collect();
        (spectra.transmittance, problems)
    }

    #[test]
    fn panes_let_through_from_nothing_to_all() {
        let (glass, problems) = of(&json!({"transmittance": 0.8}));
        assert_eq!(problems, Vec::<String>::new());
        assert_eq!(glass.unwrap().spectrum, [0.8; BANDS]);
        for (wall, text) in [
            (
                json!({"transmittance": 1.5}),
                "material 'wall', transmittance: '1.5' goes beyond 0 to 1",
            ),
            (
                json!({"transmittance": {"csv": "glass.csv"}}),
                "'glass.csv' goes beyond 0 to 1",
            ),
            (json!({"transmittance": -0.1}), "'-0.1' goes beyond 0 to 1"),
            (
                json!({"transmittance": {"name": "cie/A"}}),
                "'cie/A' is the light of a lamp",
            ),
            (
                json!({"transmittance": 0.5, "reflectance": {"name": "macbeth/white"}}),
                "has a transmittance, and a reflectance or an emission beside it",
            ),
        ] {
            let all = of(&wall).1.join("\n");
            assert!(all.contains(text), "{text}\n-- in --\n{all}");
        }
    }
}
