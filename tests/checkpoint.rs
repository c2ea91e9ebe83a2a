//! A bake that is stopped between rounds and resumed ends with the same bytes; what does not belong is refused.

use crate::common::every_effect::{self, EFFECTS};
use crate::common::garbled;

use haarlight::output::{Exposure, Writing, baked_glb, npz};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use proptest::prelude::*;
use std::path::Path;
use std::process::Command;
use std::sync::{LazyLock, Mutex};

fn room(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    Scene::load(path, &Options::default()).unwrap()
}

fn settings(error: f64, rounds: usize) -> Settings {
    Settings {
        error,
        rounds,
        ..Settings::default()
    }
}

/// What the rounds left behind: records without their times, and the light of every patch to the last bit.
fn state(bake: &Bake) -> (Vec<String>, Vec<u8>) {
    let records = bake.rounds().iter().map(|round| {
        let mut record = serde_json::to_value(round).unwrap();
        let fields = record.as_object_mut().unwrap();
        fields.retain(|key, _| !key.ends_with("_s"));
        record.to_string()
    });
    let light = bake.light();
    let mut bytes = Vec::new();
    for rows in [
        &light.reflected,
        &light.mirrors,
        &light.emitted,
        &light.irradiance,
    ] {
        let all = (0..rows.len()).flat_map(|k| rows.row(k));
        bytes.extend(all.flat_map(|x| x.to_le_bytes()));
    }
    (records.collect(), bytes)
}

/// Both output files.
fn files(bake: &Bake) -> [Vec<u8>; 2] {
    let scene = bake.scene();
    let all: Vec<Vec<bool>> = (scene.surfaces.iter())
        .map(|s| vec![true; s.triangles.len()])
        .collect();
    let baked = bake.sketch(&all, &|_, _| {});
    let look = Exposure::auto(scene, &baked.surfaces);
    let mut arrays = Vec::new();
    let spectra = bake.radiosity_spectra(&baked);
    npz::write_baked(&mut arrays, scene, &baked.surfaces, &spectra).unwrap();
    let glb = baked_glb(scene, &baked.surfaces, &look, Writing::default()).unwrap();
    [glb.bytes, arrays]
}

/// Masks, textures, point and spot lights, several light spectra, all effects at once: whatever a round leaves behind is in the file.
#[test]
fn a_resumed_bake_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for (name, scene, rounds, written) in [
        ("furnished", room("furnished.glb"), 2, false),
        ("two rooms", room("two-rooms.glb"), 3, true),
        ("cornell", room("cornell-f2.glb"), 4, true),
        ("convex", room("convex.glb"), 3, true),
        ("every effect", every_effect::small(&EFFECTS), 2, true),
    ] {
        // Coarse: what a round is asked for is no part of what is kept.
        let settings = settings(8.0, rounds);
        let mut whole = Bake::new(scene.clone(), settings.clone());
        let file = |round: usize| folder.path().join(format!("{name}.{round}"));
        for round in 1..=rounds {
            whole.step();
            let size = whole.save(&file(round)).unwrap();
            assert_eq!(size, std::fs::metadata(file(round)).unwrap().len());
        }
        let (expected, out) = (state(&whole), written.then(|| files(&whole)));
        for stopped in 1..=rounds {
            let mut bake = Bake::new(scene.clone(), settings.clone());
            bake.resume(&file(stopped)).unwrap();
            assert_eq!(bake.rounds().len(), stopped);
            let before = bake.rounds()[stopped - 1].elapsed_s;
            while bake.rounds().len() < rounds {
                bake.step();
                assert!(bake.rounds().last().unwrap().elapsed_s > before);
            }
            let got = state(&bake);
            assert_eq!(got.0, expected.0, "{name} after {stopped}: records");
            assert!(got.1 == expected.1, "{name} after {stopped}: light");
            if stopped + 1 >= rounds {
                let same = written.then(|| files(&bake)) == out;
                assert!(same, "{name} after {stopped}: files");
            }
            // What is written down again is the same file but for the time and the checksum.
            if stopped == rounds {
                let again = folder.path().join("again");
                bake.save(&again).unwrap();
                let [a, b] = [&again, &file(rounds)].map(|p| {
                    let mut bytes = std::fs::read(p).unwrap();
                    bytes.truncate(bytes.len() - 8);
                    let (rest, asides) = bytes.split_last_chunk().unwrap();
                    let time = rest.len() - 16 * u64::from_le_bytes(*asides) as usize - 8;
                    bytes[time..time + 8].fill(0);
                    bytes
                });
                assert!(a == b, "{name}: again");
            }
        }
    }
}

/// However spectra are carried.
#[test]
fn every_representation_is_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c");
    for how in ["dense", "rgb", "characteristic:5", "uniform:6", "paper"] {
        let settings = Settings {
            representation: how.parse().unwrap(),
            ..settings(8.0, 2)
        };
        let mut whole = Bake::new(room("cornell.glb"), settings.clone());
        whole.step();
        whole.save(&path).unwrap();
        whole.step();
        let mut resumed = Bake::new(room("cornell.glb"), settings);
        resumed.resume(&path).unwrap();
        resumed.step();
        assert!(state(&whole) == state(&resumed), "{how}");
    }
}

#[test]
fn another_bake_is_refused_with_what_changed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c");
    let mut bake = Bake::new(room("cornell.glb"), settings(2.0, 9));
    bake.step();
    bake.save(&path).unwrap();
    let refused = |scene: Scene, settings: Settings| {
        let mut other = Bake::new(scene, settings);
        let error = other.resume(&path).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        // Nothing was taken over.
        assert!(other.rounds().is_empty());
        error.to_string()
    };
    let mut painted = room("cornell.glb");
    painted.materials[0].reflectance[5] *= 0.5;
    let name = painted.materials[0].name.clone();
    let text = refused(painted, settings(2.0, 9));
    assert!(
        text.contains(&format!("material '{name}' changed")),
        "{text}"
    );
    assert!(text.contains("remove this one"), "{text}");
    let mut moved = room("cornell.glb");
    moved.surfaces[0].positions[0].y += 0.1;
    let name = moved.surfaces[0].name.clone();
    let text = refused(moved, settings(2.0, 9));
    assert!(text.contains(&format!("surface {name} changed")), "{text}");
    let text = refused(room("cornell.glb"), settings(1.0, 9));
    assert!(text.contains("error asked for changed"), "{text}");
    let text = refused(room("convex.glb"), settings(2.0, 9));
    assert!(text.contains("is new"), "{text}");
    // How many rounds are allowed does not change what they do.
    let mut longer = Bake::new(room("cornell.glb"), settings(2.0, 10));
    longer.resume(&path).unwrap();
    // A checkpoint that is none.
    std::fs::write(&path, b"glTF").unwrap();
    let text = refused(room("cornell.glb"), settings(2.0, 9));
    assert!(text.contains("is no checkpoint"), "{text}");
}

static CONVEX: LazyLock<Scene> = LazyLock::new(|| room("convex.glb"));

/// A bake of this room that has taken nothing over yet.
static UNTOUCHED: Mutex<Option<Bake>> = Mutex::new(None);

/// A checkpoint of it after two rounds.
static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c");
    let mut bake = Bake::new(CONVEX.clone(), settings(5.0, 9));
    bake.step();
    bake.step();
    bake.save(&path).unwrap();
    std::fs::read(&path).unwrap()
});

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, rng_seed: proptest::test_runner::RngSeed::Fixed(5), failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever stands in a file, even under a right checksum, is taken or refused, and never a fault.
    #[test]
    fn garbled_files_do_no_harm(
        changes in garbled::changes(),
        cut in prop::option::of(any::<prop::sample::Index>()),
        early in any::<bool>(),
        signed in any::<bool>(),
    ) {
        // Half of the cases where the lengths of the first lists are.
        let mut bytes = garbled::garbled(&SMALL, changes, early, cut);
        if signed {
            garbled::sign(&mut bytes);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c");
        std::fs::write(&path, &bytes).unwrap();
        let known = UNTOUCHED.lock().unwrap().take();
        let mut bake = known.unwrap_or_else(|| Bake::new(CONVEX.clone(), settings(5.0, 9)));
        if let Err(error) = bake.resume(&path) {
            prop_assert_eq!(error.exit_code(), 2);
            // Nothing is read under a wrong checksum.
            if !signed {
                prop_assert!(bake.rounds().is_empty());
                *UNTOUCHED.lock().unwrap() = Some(bake);
            }
        }
    }
}

/// The command: stopped by its time, resumed, and the same room comes out; the log is whole.
#[test]
fn the_command_goes_on_from_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    for file in ["cornell.glb", "cornell.spectra.json"] {
        std::fs::copy(scenes.join(file), folder.path().join(file)).unwrap();
    }
    let run = |args: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .args(["bake", "cornell.glb", "--error", "4"])
            .args(args)
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), said)
    };
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(run(&["-o", "whole.glb"]).0, Some(0));
    let (code, said) = run(&["--time", "1e-9", "--checkpoint", "c", "-o", "part.glb"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(read("part.glb") != read("whole.glb"));
    let (code, said) = run(&["--checkpoint", "c", "-o", "part.glb", "--log", "log"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("going on after round 1"), "{said}");
    assert!(read("part.glb") == read("whole.glb"));
    let log = String::from_utf8(read("log")).unwrap();
    let rounds = log
        .lines()
        .filter(|l| l.starts_with("{\"record\":\"round\""));
    assert!(rounds.count() > 1, "{log}");
    // Once more: nothing is left to do.
    let (code, said) = run(&["--checkpoint", "c", "-o", "again.glb"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(read("again.glb") == read("whole.glb"));
    let (code, said) = run(&["--checkpoint", "c", "--seed", "3"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("seed changed"), "{said}");
    // The room itself is no place for a checkpoint.
    let (code, said) = run(&["--checkpoint", "cornell.glb"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("overwrite an input"), "{said}");
}
