//! Points of the room, read through the program.

use super::program::Program;
use serde_json::{Value, json};

/// A point is read with its spectrum, of which the illuminance is the sum, as the picture has it; and with its error.
#[test]
fn points_are_read_with_their_spectra() {
    let program = Program::serve("cornell", &["--error", "0.1"]);
    program.stopped_after(2);
    let room: Value = serde_json::from_slice(&program.get("/room").body).unwrap();
    let observer = &room["room"]["observer"];
    let rough = read_parts(&program, observer, false);
    program.post("/go", "");
    let state = program.wait_done();
    let fine = read_parts(&program, observer, true);
    let stated = state["rounds"].as_array().unwrap().last().unwrap()["de2000"].as_f64();
    assert!(fine < rough, "{fine} {rough}");
    assert!(
        fine < 5.0 * stated.unwrap() && fine > 0.1 * stated.unwrap(),
        "{fine} {stated:?}"
    );
    // Twice the light is twice the spectrum.
    let point = |light: u32| -> Value {
        let mesh = state["picture"][0].as_u64().unwrap();
        let body = program
            .get(&format!(
                "/point?mesh={mesh}&part=0&vertices=0,1,2&weights=1,0,0"
            ))
            .body;
        let found: Value = serde_json::from_slice(&body).unwrap();
        assert!(found["light"].as_u64() >= Some(light.into()));
        found
    };
    let before = point(0);
    program.post("/change", r#"{"dim":{"materials":{"light":2}}}"#);
    let state = program.wait("relit", |s| !s["relit"].is_null() && s["doing"] == "done");
    let after = point(state["picture"][2].as_u64().unwrap() as u32);
    for k in [10, 32, 50] {
        let [a, b] = [&before, &after].map(|p| p["spectrum"][k].as_f64().unwrap());
        assert!((b / a - 2.0).abs() < 0.02, "{k}: {a} {b}");
    }
    points_that_are_none_are_refused(&program, &state["picture"][0]);
}

/// Points read of every part.
const READ: usize = 8;

/// Reads some points of every part; the mean of their errors. `here`: are these the points' own?
fn read_parts(program: &Program, observer: &Value, here: bool) -> f64 {
    let light = program.light_now();
    let [mesh, ..] = light.numbers;
    let (mut first, mut errors) = (0, Vec::new());
    let parts = light.parts.iter().enumerate();
    let all = parts.flat_map(|(part, (count, ..))| (0..READ).map(move |k| (part, *count, k)));
    for (part, count, k) in all {
        let at = [k, READ + k, 2 * READ + k].map(|k| k * (count - 1) / (3 * READ - 1));
        let lux = at.map(|v| f64::from(light.values[first + v][3]));
        if k + 1 == READ {
            first += count;
        }
        let vertices = at.map(|v| v.to_string()).join(",");
        let target =
            format!("/point?mesh={mesh}&part={part}&vertices={vertices}&weights=0.2,0.3,0.5");
        let answer = program.get(&target);
        assert_eq!(answer.status, 200, "{target}: {}", answer.text());
        let found: Value = serde_json::from_slice(&answer.body).unwrap();
        let number = |v: &Value| v.as_f64().unwrap();
        let y = number(&found["xyz"][1]);
        let mixed = 0.2 * lux[0] + 0.3 * lux[1] + 0.5 * lux[2];
        assert!(
            (y - mixed).abs() <= 1e-4 * mixed.max(1e-3),
            "{target}: {y} {mixed}"
        );
        for c in 0..3 {
            let weights = observer[c].as_array().unwrap();
            let spectrum = found["spectrum"].as_array().unwrap();
            assert_eq!((weights.len(), spectrum.len()), (64, 64));
            let sum: f64 = (weights.iter().zip(spectrum))
                .map(|(w, s)| number(w) * number(s))
                .sum();
            let stated = number(&found["xyz"][c]);
            // What lanes average over their leaves is exact under each light.
            assert!(
                (sum - stated).abs() <= 1e-4 * y.max(1e-3),
                "{c}: {sum} {stated}"
            );
        }
        assert_eq!(found["error_here"], here, "{found}");
        errors.push(number(&found["error_de2000"]));
    }
    assert!(
        errors.iter().all(|e| e.is_finite() && *e >= 0.0),
        "{errors:?}"
    );
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert_eq!(
        errors.iter().all(|e| (e - mean).abs() < 1e-9),
        !here,
        "{errors:?}"
    );
    mean
}

fn points_that_are_none_are_refused(program: &Program, mesh: &Value) {
    for target in [
        "/point",
        "/point?mesh=1&part=0&vertices=0,1&weights=1,0,0",
        "/point?mesh=1&part=0&vertices=0,1,2&weights=1,0,nan",
        "/point?mesh=1&part=0&vertices=0,1,-2&weights=1,0,0",
        "/point?mesh=1&part=0&vertices=0,1,2&weights=1,0,7",
    ] {
        assert_eq!(program.get(target).status, 400, "{target}");
    }
    for (mesh, part, vertex) in [
        (&json!(99), 0, 0),
        (mesh, 4_000_000_000_u32, 0),
        (mesh, 0, 4_000_000_000_u32),
    ] {
        let target = format!("/point?mesh={mesh}&part={part}&vertices={vertex},0,0&weights=1,0,0");
        assert_eq!(program.get(&target).status, 204, "{target}");
    }
}
