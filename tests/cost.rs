//! What each way to carry spectra claims, held against the 64 bands on the same links; and the sweep as a command.

use crate::common::built;

use haarlight::cost::{HeldRun, held};
use haarlight::data::{Outside, named};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Representation, Settings};
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

fn room(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    Scene::load(path, &Options::default()).unwrap()
}

/// The Cornell box under another lamp.
fn cornell(lamp: &str) -> Scene {
    let mut scene = room("cornell-f2.glb");
    let power = scene.grid.means(&named(lamp).unwrap().table, Outside::Zero);
    for light in &mut scene.spectra {
        light.power = power;
    }
    scene
}

/// A bake of two rounds.
fn two_rounds(scene: Scene) -> Bake {
    let settings = Settings {
        rounds: 2,
        ..Settings::default()
    };
    built::run(scene, settings)
}

/// Lamps whose Cornell box is solved in all ways, once for all tests.
const LAMPS: [&str; 3] = ["cie/F2", "cie/F11", "cie/A"];
static UNDER: [LazyLock<Vec<HeldRun>>; 3] = [
    LazyLock::new(|| all_ways(cornell(LAMPS[0]))),
    LazyLock::new(|| all_ways(cornell(LAMPS[1]))),
    LazyLock::new(|| all_ways(cornell(LAMPS[2]))),
];

/// Two rounds, then all ways on their links.
fn all_ways(scene: Scene) -> Vec<HeldRun> {
    let mut bake = two_rounds(scene);
    let white = bake.light().white;
    held(&mut bake, white)
}

fn found(runs: &[HeldRun], representation: Representation, asked: f64) -> HeldRun {
    *runs
        .iter()
        .find(|r| r.representation == representation && r.asked == asked)
        .unwrap()
}

/// Direct light is gathered anew for every solution: whether a lamp is entered depends on brightness, and so on lanes, by
/// a hair. Nothing here is told apart below this, CIELUV.
const HAIR: f64 = 0.01;

/// What lanes may cause, share of the error asked for.
const SHARE: f64 = 0.2;

#[test]
fn every_way_keeps_what_it_claims_under_line_spectra() {
    for (lamp, runs) in LAMPS.iter().zip(&UNDER) {
        for run in runs.iter() {
            match run.representation {
                // An estimate, made on a model of the room: a third more is allowed for what the model lacks.
                Representation::Adaptive => {
                    let believed = run.believed.unwrap();
                    assert!(run.de_luv <= 1.33 * believed + HAIR, "{lamp}: {run:?}");
                    assert!(believed <= SHARE * run.asked, "{lamp}: {run:?}");
                }
                Representation::Guaranteed => {
                    let believed = run.believed.unwrap();
                    assert!(run.de_luv <= believed + HAIR, "{lamp}: {run:?}");
                    assert!(believed <= SHARE * run.asked, "{lamp}: {run:?}");
                }
                Representation::Dense => assert_eq!(run.de_luv, 0.0),
                _ => {}
            }
        }
        // More numbers, less error: across a factor of four.
        for way in [Representation::Uniform, Representation::Characteristic] {
            let few = found(runs, way(4), 0.0);
            let many = found(runs, way(16), 0.0);
            assert!(
                many.de_luv < 0.5 * few.de_luv + HAIR,
                "{lamp}: {few:?} {many:?}"
            );
        }
    }
}

/// All 64 intervals, or all 64 vectors, are the 64 bands in another form.
#[test]
fn whole_sets_are_exact() {
    let mut bake = two_rounds(room("cornell-f2.glb"));
    let white = bake.light().white;
    bake.hold(Representation::Dense, 0.5).unwrap();
    let truth = bake.leaf_colours();
    for way in [
        Representation::Uniform(64),
        Representation::Characteristic(64),
    ] {
        bake.hold(way, 0.5).unwrap();
        let mean = bake
            .leaf_colours()
            .iter()
            .zip(&truth)
            .map(|(is, ought)| haarlight::color::de_luv(is.0, ought.0, white))
            .sum::<f64>()
            / truth.len() as f64;
        assert!(mean < HAIR, "{way}: {mean}");
    }
}

/// The case for spectra: three numbers are wrong by more than the eye forgives, and no refinement helps. Measured: 1.96 on
/// average and 5.7 at worst under F2, 1.37 and 4.0 under F11.
#[test]
fn srgb_is_wrong_under_lamps_of_lines() {
    // F2 and F11.
    for ((lamp, runs), least) in LAMPS.iter().zip(&UNDER).zip([[1.5, 4.5], [1.1, 3.0]]) {
        let rgb = found(runs, Representation::Rgb, 0.0);
        let ours = found(runs, Representation::Adaptive, 0.5);
        assert!(
            rgb.de2000 > least[0] && rgb.greatest > least[1],
            "{lamp}: {rgb:?}"
        );
        assert!(ours.de2000 < 0.1 * rgb.de2000, "{lamp}: {ours:?}");
    }
}

/// What lists are asked for below.
const LISTS: [f64; 3] = [8.0, 2.0, 0.5];

/// What lists lose in the mean, what they believe to lose, and how long they are: where rays carry light, as [`held`] finds it on links.
fn lists_by_rays() -> [[f64; 3]; 3] {
    // Few rays do: all ways are held against the same ones.
    let settings = Settings {
        error: 4.0,
        rounds: 1,
        ..Settings::default()
    };
    let mut bake = built::run(room("furnished.glb"), settings);
    let white = bake.light().white;
    bake.hold(Representation::Dense, 0.5).unwrap();
    let truth = bake.leaf_colours();
    LISTS.map(|asked| {
        let held = bake.hold(Representation::Lists, asked).unwrap();
        let (mut sum, mut area) = (0.0, 0.0);
        for ((is, a), (ought, _)) in bake.leaf_colours().iter().zip(&truth) {
            sum += a * haarlight::color::de_luv(*is, *ought, white);
            area += a;
        }
        [sum / area, held.spectrum_de_luv.unwrap(), held.lanes]
    })
}

/// Light that goes from patch to patch as lists, along links and by rays: its loss is within what was asked for, lists know about how
/// much it is, and they are no longer than that needs.
#[test]
fn lists_lose_no_more_than_they_may() {
    let links = |runs: &[HeldRun]| {
        let runs = LISTS.map(|asked| found(runs, Representation::Lists, asked));
        runs.map(|run| [run.de_luv, run.believed.unwrap(), run.lanes])
    };
    for (name, lists) in [
        ("links, F2", links(&UNDER[0])),
        ("links, A", links(&UNDER[2])),
        ("rays", lists_by_rays()),
    ] {
        let mut length = 0.0;
        for (asked, [off, believed, lanes]) in LISTS.into_iter().zip(lists) {
            println!("{name}, {asked}: {off:.4}, believed {believed:.4}, {lanes:.2} long");
            assert!(off <= SHARE * asked + HAIR, "{name}, {asked}: {off}");
            // Lists neglect how light and reflectance vary together within an interval (paper 3.2).
            assert!(
                off <= 3.0 * believed + HAIR,
                "{name}, {asked}: {off} {believed}"
            );
            assert!(lanes > length, "{name}, {asked}: {lanes}");
            length = lanes;
        }
        assert!(length < 24.0, "{name}: {length}");
    }
}

#[test]
fn a_grey_room_takes_one_number_however_it_is_asked() {
    let scene = || {
        let mut scene = room("cornell-f2.glb");
        for material in &mut scene.materials {
            material.reflectance = [0.5; 64];
        }
        scene
    };
    for run in all_ways(scene()) {
        match run.representation {
            Representation::Adaptive | Representation::Guaranteed => {
                assert_eq!(run.lanes, 1.0, "{run:?}");
            }
            _ => {}
        }
        // One vector: the lamp itself. Intervals of radiosity itself have to follow its lines.
        if !matches!(
            run.representation,
            Representation::Paper | Representation::Lists
        ) {
            assert!(run.de_luv < HAIR, "{run:?}");
        }
    }
}

#[test]
fn the_command_writes_tables_and_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("cost");
    let done = Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .args(["cost", "scenes/cornell-f2.glb", "--errors", "4", "--quiet"])
        .args(["--representations", "adaptive,rgb", "--points", "10"])
        .args(["--repeats", "1", "--knob", "-o"])
        .arg(&out)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(done.status.success(), "{done:?}");
    let text = String::from_utf8(done.stdout).unwrap();
    assert!(text.contains("Choice: `--error 4`"), "{text}");
    let csv = std::fs::read_to_string(out.join("cost.csv")).unwrap();
    let columns: Vec<usize> = csv.lines().map(|l| l.split(',').count()).collect();
    assert!(
        columns.len() >= 3 && columns.iter().all(|c| *c == columns[0]),
        "{csv}"
    );
    let page = std::fs::read_to_string(out.join("cost.md")).unwrap();
    for picture in ["error-time", "phases", "intervals", "memory"] {
        let svg = std::fs::read_to_string(out.join(format!("{picture}.svg"))).unwrap();
        assert!(svg.contains("<polyline") || svg.contains("<circle") || svg.contains("<rect"));
        assert!(page.contains(&format!("({picture}.svg)")));
    }
    assert!(page.contains("## One knob"));
}
