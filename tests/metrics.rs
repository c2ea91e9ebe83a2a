//! `haarlight probe --metrics` on the Cornell box: columns, ranges, and what the colour of the walls does to the light.

use crate::common::built::glanced;

use haarlight::scene::{Options, Scene};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

const NAMES: [&str; 12] = [
    "lux", "CCT_K", "Duv", "Ra", "R9", "Rf", "Rg", "EDI_sc", "EDI_mc", "EDI_lc", "EDI_rh",
    "EDI_mel",
];

/// Prints of a probe of the Cornell box at points on its floor, and what it said.
fn probed(options: &[&str]) -> (String, String) {
    let folder = tempfile::tempdir().unwrap();
    let points = folder.path().join("points.csv");
    std::fs::write(&points, POINTS).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .arg("probe")
        .arg(cornell())
        .arg("--points")
        .arg(points)
        .args(options)
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    (String::from_utf8(output.stdout).unwrap(), said)
}

/// Three in the room, one outside.
const POINTS: &str = "\
x,y,z,nx,ny,nz
0.1,0,0.4,0,1,0
0.4,0,0.1,0,1,0
0.52,0,0.5,0,1,0
0,-0.5,0,0,-1,0
";

#[test]
fn metrics_come_after_the_other_columns() {
    let (plain, _) = probed(&["--error", "4"]);
    let (csv, said) = probed(&["--error", "4", "--metrics"]);
    let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let before = plain.lines().next().unwrap();
    assert!(csv.starts_with(before), "{header:?}");
    let first = before.split(',').count();
    assert_eq!(header.len(), first + 3 * NAMES.len() - 1);
    assert_eq!(header[first..first + 3], ["lux_low", "lux_high", "CCT_K"]);
    assert_eq!(header.last(), Some(&"EDI_mel_high"));
    for line in csv.lines().skip(1) {
        assert_eq!(line.split(',').count(), header.len(), "{line}");
    }
    assert!(
        said.contains("uniformity over 3 points: min/mean"),
        "{said}"
    );
}

#[test]
fn figures_hold_their_ranges_and_a_finer_solution() {
    let json = |options: &[&str]| -> Value { serde_json::from_str(&probed(options).0).unwrap() };
    let coarse = json(&["--metrics", "--json", "--error", "1"]);
    let fine = json(&["--metrics", "--json", "--error", "0.1"]);
    let (metrics, fine) = (&coarse["metrics"], &fine["metrics"]);
    assert_eq!(metrics["kind"], "estimate");
    let error = |m: &Value, key: &str| m[key].as_f64().unwrap();
    for key in ["relative_error", "chromaticity_error"] {
        assert!(error(metrics, key) > error(fine, key), "{metrics} {fine}");
    }
    let lux = coarse["columns"]
        .as_array()
        .unwrap()
        .iter()
        .position(|c| c == "lux")
        .unwrap();
    let (mut held, mut all) = (0, 0);
    for k in 0..3 {
        let point = &metrics["points"][k];
        let row = coarse["rows"][k][lux].as_f64().unwrap();
        assert!((point["lux"]["value"].as_f64().unwrap() / row - 1.0).abs() < 1e-4);
        for name in NAMES {
            let at = |key: &str| {
                point[name][key]
                    .as_f64()
                    .unwrap_or_else(|| panic!("{name} {point}"))
            };
            assert!(
                at("low") <= at("value") && at("value") <= at("high"),
                "{name} {point}"
            );
            let better = fine["points"][k][name]["value"].as_f64().unwrap();
            all += 1;
            held += usize::from((at("low")..=at("high")).contains(&better));
            println!(
                "{k} {name}: {} {} {} finer {better}",
                at("low"),
                at("value"),
                at("high")
            );
        }
    }
    // Ranges are root mean squares, not bounds.
    assert!(3 * held >= 2 * all, "{held} of {all}");
    let uniformity = &metrics["uniformity"];
    assert_eq!(uniformity["points"], 3);
    let least = uniformity["min_lux"].as_f64().unwrap() / uniformity["mean_lux"].as_f64().unwrap();
    assert_eq!(uniformity["min_over_mean"]["value"].as_f64(), Some(least));
    // The point outside is dark: nothing is known of a colour that is not there.
    let dark = &metrics["points"][3];
    assert_eq!(dark["lux"]["value"], 0.0);
    for name in &NAMES[1..] {
        assert_eq!(dark[name]["reason"], "no light", "{dark}");
    }
}

/// The open side of the box lets a sky in: the lamp has no part in its daylight factor.
#[test]
fn daylight_and_glare_are_told_where_they_are_asked_for() {
    let options = [
        "--metrics",
        "--json",
        "--error",
        "2",
        "--sky",
        "uniform",
        "--sky-lux",
        "10000",
    ];
    let eye = [
        "--ugr",
        "0.278,0.25,-0.2,0,0,1",
        "--ugr",
        "0.278,0.25,0.1,0,1,0",
    ];
    let (out, said) = probed(&[&options[..], &eye].concat());
    let out: Value = serde_json::from_str(&out).unwrap();
    let factor = |k: usize| &out["metrics"]["points"][k]["DF_percent"];
    for k in 0..3 {
        let at = |key: &str| factor(k)[key].as_f64().unwrap();
        assert!(0.5 < at("value") && at("value") < 60.0, "{}", factor(k));
        assert!(at("low") < at("value") && at("value") < at("high"));
    }
    let views = out["ugr"].as_array().unwrap();
    assert_eq!(views.len(), 2);
    for view in views {
        assert!(view["background_cd_m2"].as_f64().unwrap() > 1.0, "{view}");
        let left_out = view["left_out"][0].as_str().unwrap();
        assert!(left_out.contains("the sky"), "{view}");
    }
    assert!(!said.contains("UGR"), "{said}");
    let (csv, _) = probed(&["--metrics", "--error", "2", "--sky", "uniform"]);
    assert!(
        csv.lines()
            .next()
            .unwrap()
            .ends_with("DF_percent,DF_percent_low,DF_percent_high")
    );
    let (out, _) = probed(&["--error", "2", "--ugr", eye[1]]);
    let last = out.lines().last().unwrap();
    assert!(last.starts_with("UGR at [0.278, 0.25, -0.2]"), "{out}");
}

/// The verdict of a bake has the figures of the mean light on all surfaces.
#[test]
fn the_log_measures_the_light_of_the_room() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    for name in ["furnace.glb", "cornell-d65.glb", "cornell-d65.spectra.json"] {
        std::fs::copy(scenes.join(name), folder.path().join(name)).unwrap();
    }
    let metrics = |name: &str| -> Value {
        let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .args(["bake", "-q", "--json", "--error", "2"])
            .arg(folder.path().join(name))
            .output()
            .unwrap();
        let verdict: Value = serde_json::from_slice(&output.stdout).unwrap();
        verdict["metrics"].clone()
    };
    // 200 cd/m2 everywhere, so 628.3 lm/m2 sent out, of which 10 pi are emitted and the rest is .95 of what comes.
    let furnace = metrics("furnace.glb");
    let lux = furnace["lux"]["value"].as_f64().unwrap();
    let expected = 10.0 * std::f64::consts::PI / (1.0 - 0.95);
    assert!((lux / expected - 1.0).abs() < 0.01, "{lux} {expected}");
    let box_under_d65 = metrics("cornell-d65.glb");
    for name in NAMES {
        let [low, value, high] = ["low", "value", "high"].map(|k| &box_under_d65[name][k]);
        let [Some(low), Some(value), Some(high)] = [low, value, high].map(Value::as_f64) else {
            panic!("{name}: {}", box_under_d65[name]);
        };
        assert!(low <= value && value <= high, "{name}");
    }
    // White and coloured walls make it warmer than the lamp's 6504 K, and leave it near daylight.
    let cct = box_under_d65["CCT_K"]["value"].as_f64().unwrap();
    assert!((4000.0..6504.0).contains(&cct), "{cct}");
}

/// A bake of the Cornell box: its verdict's metrics.
fn metrics_of_bake(options: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let room = folder.path().join("cornell.glb");
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    for name in ["cornell.glb", "cornell.spectra.json"] {
        std::fs::copy(scenes.join(name), folder.path().join(name)).unwrap();
    }
    let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .args(["bake", "-q", "--json", "--error", "1"])
        .arg(room)
        .args(options)
        .output()
        .unwrap();
    let verdict: Value = serde_json::from_slice(&output.stdout).unwrap();
    verdict["metrics"].clone()
}

fn cornell() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.glb")
}

/// The points on its floor that the log tells of, as a file for `probe`.
static FLOOR: LazyLock<String> = LazyLock::new(|| {
    let bake = glanced(Scene::load(cornell(), &Options::default()).unwrap());
    let plane = bake.working_plane().unwrap().points;
    let rows = plane
        .iter()
        .map(|(p, _)| format!("{},{},{},0,1,0\n", p.x, p.y, p.z));
    "x,y,z,nx,ny,nz\n".to_owned() + &rows.collect::<String>()
});

/// A probe of these points, and what else is asked for.
fn floor_probed(options: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let points = folder.path().join("points.csv");
    std::fs::write(&points, &*FLOOR).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .args(["probe", "--metrics", "--json", "--error", "1", "-q"])
        .arg(cornell())
        .arg("--points")
        .arg(&points)
        .args(options)
        .output()
        .unwrap();
    serde_json::from_slice(&output.stdout).unwrap()
}

fn near(a: &Value, b: &Value, tolerance: f64) {
    let [x, y] = [a, b].map(|value| value.as_f64().unwrap_or_else(|| panic!("{a} {b}")));
    assert!((x / y - 1.0).abs() <= tolerance, "{x} {y}");
}

/// The mean over the floor, its uniformity and the glare that the cameras see are those that `probe` finds.
#[test]
fn the_log_measures_the_working_plane_and_glare() {
    let metrics = metrics_of_bake(&[]);
    let plane = &metrics["working_plane"];
    // The box is half a metre high: its floor is the plane.
    assert_eq!(plane["height_m"], 0.0);
    assert!(plane["floor_m"].as_f64().unwrap().abs() < 1e-9, "{plane}");
    let count = plane["points"].as_u64().unwrap();
    assert!((100..=200).contains(&count), "{plane}");
    assert!(plane["DF_percent"].is_null(), "{plane}");
    for name in ["mean_lux", "min_over_mean", "min_over_max"] {
        let [low, value, high] = ["low", "value", "high"].map(|k| plane[name][k].as_f64().unwrap());
        assert!(0.0 < low && low < value && value < high, "{name}: {plane}");
    }
    let view = &metrics["ugr"][0];
    assert!(view["camera"].is_string(), "{view}");
    let six = [&view["eye"], &view["direction"]].map(|v| {
        let numbers = v.as_array().unwrap().iter().map(Value::to_string);
        numbers.collect::<Vec<_>>().join(",")
    });
    let probed = floor_probed(&["--ugr", &six.join(",")]);
    let uniformity = &probed["metrics"]["uniformity"];
    near(&plane["mean_lux"]["value"], &uniformity["mean_lux"], 0.01);
    near(
        &plane["min_over_mean"]["value"],
        &uniformity["min_over_mean"]["value"],
        0.03,
    );
    near(
        &view["background_cd_m2"],
        &probed["ugr"][0]["background_cd_m2"],
        0.02,
    );
    near(
        &view["rating"]["value"],
        &probed["ugr"][0]["rating"]["value"],
        0.02,
    );
}

/// Rows keep the light of the sky apart from the lamp's: their daylight factor is that of a bake under the sky alone.
#[test]
fn the_log_has_daylight_factors_where_there_is_a_sky() {
    let sky = ["--sky", "uniform", "--sky-lux", "10000"];
    let metrics = metrics_of_bake(&sky);
    let factor = &metrics["working_plane"]["DF_percent"];
    let probed = floor_probed(&sky);
    let points = probed["metrics"]["points"].as_array().unwrap().iter();
    let places = probed["places"].as_array().unwrap().iter();
    let inside = points.zip(places).filter(|(_, place)| **place == "room");
    let mut all: Vec<f64> = inside
        .map(|(p, _)| p["DF_percent"]["value"].as_f64().unwrap())
        .collect();
    all.sort_by(f64::total_cmp);
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    near(&factor["mean"]["value"], &Value::from(mean), 0.05);
    near(
        &factor["median"]["value"],
        &Value::from(all[all.len() / 2]),
        0.1,
    );
    for name in ["mean", "median"] {
        let [low, value, high] =
            ["low", "value", "high"].map(|k| factor[name][k].as_f64().unwrap());
        assert!(low < value && value < high, "{factor}");
    }
}
