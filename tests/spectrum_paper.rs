//! `haarlight paper` through the binary, and the comparison of the methods of section 2.

use serde_json::Value;
use std::process::Command;
use std::sync::LazyLock;

/// What `paper --json` prints.
static JSON: LazyLock<Value> = LazyLock::new(|| {
    let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .args(["paper", "--json"])
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
});

#[test]
fn the_command_prints_table_1_as_json() {
    let json = &*JSON;
    for (light, intervals, xyz, luv) in [
        ("C", 8, "0.0014", "0.26"),
        ("D65", 7, "0.0013", "0.33"),
        ("F2", 11, "0.0015", "0.27"),
    ] {
        let column = &json["table1"][light];
        assert_eq!(column["source"]["intervals"], intervals);
        assert_eq!(
            format!("{:.4}", column["source"]["xyz_error"].as_f64().unwrap()),
            xyz
        );
        assert_eq!(
            format!("{:.2}", column["source"]["luv_error"].as_f64().unwrap()),
            luv
        );
        for level in ["primary", "secondary", "tertiary"] {
            let level = &column[level];
            let shares = ["none", "refinement", "merge", "fluctuation"]
                .map(|key| level[key].as_f64().unwrap());
            assert!((shares.iter().sum::<f64>() - 100.0).abs() < 1e-9, "{level}");
            for key in [
                "intervals_mean",
                "intervals_sd",
                "luv_mean",
                "luv_max",
                "luv_sd",
                "measure_error",
            ] {
                assert!(level[key].is_number(), "{key}");
            }
        }
    }
    for key in ["control", "bounds", "methods"] {
        assert!(!json[key].as_array().unwrap().is_empty(), "{key}");
    }
    assert!(
        json["bounds"]
            .as_array()
            .unwrap()
            .iter()
            .all(|row| row["violations"] == 0 && row["above_eps_max"] == 0.0)
    );
    assert!(
        json["table2"]["stages"]
            .as_array()
            .unwrap()
            .iter()
            .all(|stage| stage["adaptive_ns"].is_number())
    );
}

#[test]
fn unknown_reflectances_are_refused() {
    let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .args(["paper", "--reflectances", "munsell"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
}

/// Mean dE*uv of the tertiary reflections over the three lights, at 4, 6, 12 and 16 terms.
#[test]
fn adaptive_lists_beat_the_other_methods_at_equal_terms() {
    let rows = JSON["methods"].as_array().unwrap();
    let mean = |method: &str, terms: usize| {
        let picked: Vec<f64> = rows
            .iter()
            .filter(|r| r["method"] == method && r["terms"] == terms)
            .map(|r| r["luv_mean"][2].as_f64().unwrap())
            .collect();
        assert_eq!(picked.len(), 3, "{method} {terms}");
        picked.iter().sum::<f64>() / 3.0
    };
    for (terms, limit) in [(4, 1.7), (6, 0.61), (12, 0.15), (16, 0.08)] {
        assert!(
            mean("adaptive", terms) < limit,
            "{terms}: {}",
            mean("adaptive", terms)
        );
        for other in [
            "point samples",
            "uniform bands",
            "Gauss XYZ",
            "Gauss AC1C2",
            "Gauss shared",
            "segments",
        ] {
            assert!(
                mean("adaptive", terms) < mean(other, terms),
                "{other} {terms}"
            );
        }
    }
    // Characteristic vectors are trained on the very scene and cost n^2: with few terms corrected lists beat them all the same.
    for terms in [4, 6, 8] {
        assert!(mean("adaptive bound, corrected", terms) < mean("characteristic vectors", terms));
    }
}
