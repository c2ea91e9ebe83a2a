//! The readers of side files, spectra and points, and whole bakes, under broken and hostile input: an input problem that
//! says what is wrong, or sound numbers. Never a panic.

use crate::common;
use crate::common::built;

use common::Room;
use haarlight::Error;
use haarlight::cli::points::Points;
use haarlight::scene::document::Document;
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(8),
        ..ProptestConfig::default()
    }
}

/// Two triangles that see each other, one of them a lamp, and a point light; names for side files.
fn room() -> Room {
    let mut room = Room::triangle();
    let corners = [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]];
    let upper = room.vectors(&corners);
    room.json["materials"] = json!([
        {"name": "wall", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}},
        {"name": "panel", "emissiveFactor": [1, 1, 1]}]);
    room.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    common::push(
        &mut room.json["meshes"][0]["primitives"],
        json!({"attributes": {"POSITION": upper}, "material": 1}),
    );
    room.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    room.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"name": "bulb", "type": "point", "intensity": 100}]}});
    room.json["scenes"][0]["nodes"] = json!([0, 1]);
    common::push(
        &mut room.json["nodes"],
        json!({"translation": [0.3, 0.3, 0.5], "extensions": {"KHR_lights_punctual": {"light": 0}}}),
    );
    room
}

/// It is an input problem, or what is loaded is sound and so is a bake of it.
fn sound(loaded: haarlight::Result<Scene>, bake: bool) -> Result<(), TestCaseError> {
    let scene = match loaded {
        Err(Error::Input(problems)) => {
            prop_assert!(!problems.is_empty());
            return Ok(());
        }
        Err(other) => return Err(TestCaseError::fail(other.to_string())),
        Ok(scene) => scene,
    };
    for material in &scene.materials {
        let albedo = material.reflectance;
        prop_assert!(
            albedo.iter().all(|r| (0.0..=0.999).contains(r)),
            "{albedo:?}"
        );
        if let Some(e) = &material.emission {
            prop_assert!(e.shape.iter().all(|x| x.is_finite() && *x >= 0.0));
        }
    }
    for light in &scene.spectra {
        let power = light.power;
        prop_assert!(
            power.iter().all(|x| x.is_finite() && *x >= 0.0),
            "{power:?}"
        );
    }
    if !bake {
        return Ok(());
    }
    let settings = Settings {
        error: 4.0,
        ..Settings::default()
    };
    let mut bake = Bake::new(scene, settings);
    for _ in 0..2 {
        bake.step();
    }
    // A few rooms of odd triangles use up all vertices that they may have.
    let baked = built::baked_within(2000, &bake);
    for v in baked.surfaces.iter().flat_map(|s| &s.vertices) {
        let all = v.irradiance.iter().chain(&v.radiosity).chain(&v.light);
        prop_assert!(all.clone().all(|x| x.is_finite()), "{v:?}");
    }
    Ok(())
}

/// Loads the room beside a side file and a spectrum.
fn with_files(side: &[u8], spectrum: &[u8]) -> haarlight::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("room.glb"), room().glb()).unwrap();
    std::fs::write(at("room.spectra.json"), side).unwrap();
    std::fs::write(at("s.csv"), spectrum).unwrap();
    Scene::load(at("room.glb"), &Options::default())
}

/// A side file that says all that can be said.
fn side_file() -> Value {
    json!({"materials": {"wall": {"reflectance": {"csv": "s.csv"}},
                         "panel": {"reflectance": {"name": "macbeth/white"},
                                   "emission": {"name": "cie/F2", "luminance_cd_m2": 5000}}},
           "lights": {"bulb": {"name": "cie/A"}}})
}

const SPECTRUM: &str = "wavelength_nm,value\n380,0.1\n500,0.4\n780,0.7\n";

#[test]
fn the_side_file_that_is_changed_below_loads() {
    let scene = with_files(side_file().to_string().as_bytes(), SPECTRUM.as_bytes()).unwrap();
    assert_eq!(scene.materials[0].reflectance_from, "s.csv");
    sound(Ok(scene), true).unwrap();
}

/// Puts `value` in the place of value `target` (counted down) of a JSON tree; returns how many were passed.
fn replace(json: &mut Value, target: &mut usize, value: &Value) -> usize {
    let own = 1;
    if *target == 0 {
        *json = value.clone();
        *target = usize::MAX;
        return own;
    }
    *target -= 1;
    own + match json {
        Value::Array(list) => list.iter_mut().map(|v| replace(v, target, value)).sum(),
        Value::Object(map) => map.values_mut().map(|v| replace(v, target, value)).sum(),
        _ => 0,
    }
}

fn nasty() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(json!(null)),
        Just(json!(true)),
        Just(json!([])),
        Just(json!({})),
        Just(json!("")),
        Just(json!(-1)),
        Just(json!(0)),
        Just(json!(1e-300)),
        Just(json!(1e300)),
        Just(json!(u64::MAX)),
        Just(json!("cie/F2")),
        Just(json!("macbeth/white")),
        Just(json!("s.csv")),
        Just(json!("../s.csv")),
        Just(json!("/etc/passwd")),
        Just(json!("http://example.org/s.csv")),
        Just(json!("/dev/zero")),
        Just(json!({"csv": "s.csv"})),
        Just(json!({"csv": "s.csv", "name": "cie/A"})),
        Just(json!({"csv": "room.glb"})),
        Just(json!({"csv": "."})),
        Just(json!({"name": "x".repeat(10_000)})),
        ".{0,20}".prop_map(|s| json!(s)),
    ]
}

/// A cell of a table, mostly a number.
fn cell() -> impl Strategy<Value = String> {
    prop_oneof![
        4 => (-10.0..1000.0_f64).prop_map(|x| x.to_string()),
        1 => any::<f64>().prop_map(|x| x.to_string()),
        1 => Just("1e308".to_owned()),
        1 => Just("-1e-308".to_owned()),
        1 => Just(String::new()),
        1 => "[ -~]{0,8}",
        1 => ".{0,4}",
    ]
}

fn table(columns: usize, header: &'static str) -> impl Strategy<Value = String> {
    let row = prop::collection::vec(cell(), 0..columns + 2).prop_map(|cells| cells.join(","));
    let lines = prop::collection::vec(row, 0..12).prop_map(|rows| rows.join("\n"));
    let top = prop_oneof![4 => Just(header.to_owned()), 1 => ".{0,30}"];
    (top, lines).prop_map(|(top, lines)| format!("{top}\n{lines}"))
}

proptest! {
    #![proptest_config(cases(400))]

    #[test]
    fn changed_side_files_are_survived(which in any::<prop::sample::Index>(), value in nasty(), bake in 0..8) {
        let mut side = side_file();
        let count = replace(&mut side, &mut { usize::MAX - 1 }, &value);
        replace(&mut side, &mut which.index(count), &value);
        sound(with_files(side.to_string().as_bytes(), SPECTRUM.as_bytes()), bake == 0)?;
    }

    #[test]
    fn any_bytes_for_a_side_file(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        sound(with_files(&bytes, SPECTRUM.as_bytes()), false)?;
    }

    #[test]
    fn cut_side_files_are_survived(at in any::<prop::sample::Index>()) {
        let side = side_file().to_string();
        sound(with_files(&side.as_bytes()[..at.index(side.len())], SPECTRUM.as_bytes()), false)?;
    }

    #[test]
    fn any_table_for_a_spectrum(text in table(2, "wavelength_nm,value"), emission in any::<bool>(), bake in 0..8) {
        let mut side = side_file();
        if emission {
            side["materials"]["panel"]["emission"] = json!({"csv": "s.csv"});
            side["lights"]["bulb"] = json!({"csv": "s.csv"});
        }
        sound(with_files(side.to_string().as_bytes(), text.as_bytes()), bake == 0)?;
    }

    #[test]
    fn any_bytes_for_a_spectrum(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        sound(with_files(side_file().to_string().as_bytes(), &bytes), false)?;
    }

    #[test]
    fn any_table_of_points(text in table(6, "x,y,z,nx,ny,nz")) {
        let read = Points::parse(&text, "points.csv");
        for (point, normal) in &read.points {
            prop_assert!(point.is_finite() && (normal.length() - 1.0).abs() < 1e-9, "{point} {normal}");
        }
        prop_assert!(!read.points.is_empty() || !read.problems.is_empty());
        prop_assert!(read.problems.iter().all(|p| p.to_string().contains("points.csv")));
    }

    #[test]
    fn any_text_of_points(text in ".{0,300}") {
        let read = Points::parse(&text, "points.csv");
        prop_assert!(!read.points.is_empty() || !read.problems.is_empty());
    }
}

/// A coordinate from the far ends of single precision, or an ordinary one.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => -2.0..2.0_f32,
        2 => prop::sample::select(vec![0.0_f32, -0.0, 1.0, 1e-45, 1e-38, 1e-20, 1e-7, 1e6, 1e12, -1e18, 1e30, 3e38]),
    ]
}

proptest! {
    #![proptest_config(cases(300))]

    /// Triangles anywhere, of any shape: refused, or baked to finite light.
    #[test]
    fn any_triangles_are_baked(corners in prop::collection::vec([coordinate(), coordinate(), coordinate()], 3..15)) {
        let mut room = room();
        let whole = corners.len() / 3 * 3;
        let position = room.vectors(&corners[..whole]);
        common::push(
            &mut room.json["meshes"][0]["primitives"],
            json!({"attributes": {"POSITION": position}, "material": 1}),
        );
        let document = Document::from_bytes(Path::new("room.glb"), &room.glb());
        sound(document.and_then(|d| Scene::from_document(d, &Options::default())), true)?;
    }

    /// Any flip of any byte that still loads is baked as well.
    #[test]
    fn flipped_rooms_are_baked(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4)) {
        let mut bytes = room().glb();
        for (at, value) in flips {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        let document = Document::from_bytes(Path::new("room.glb"), &bytes);
        sound(document.and_then(|d| Scene::from_document(d, &Options::default())), true)?;
    }
}

/// Devices, folders and pipes in the place of files: code 2 at once, by name.
#[test]
#[cfg(unix)]
fn what_is_no_file_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let room = at("room.glb");
    std::fs::write(&room, self::room().glb()).unwrap();
    let pipe = at("pipe.glb");
    assert!(
        Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .unwrap()
            .success()
    );
    let text = |p: &Path| p.to_str().unwrap().to_owned();
    let (room, pipe, dir) = (text(&room), text(&pipe), text(folder.path()));
    for thing in ["/dev/zero", "/dev/null", &pipe, &dir] {
        for arguments in [
            vec!["bake", thing, "-o", "out.glb"],
            vec!["inspect", thing],
            vec!["bake", &room, "--spectra", thing, "-o", "out.glb"],
            vec!["probe", &room, "--points", thing],
        ] {
            let out = Command::new(env!("CARGO_BIN_EXE_haarlight"))
                .args(&arguments)
                .current_dir(folder.path())
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&out.stderr);
            assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
            assert!(said.contains(thing), "{arguments:?}: {said}");
        }
    }
}
