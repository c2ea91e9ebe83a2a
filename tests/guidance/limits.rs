//! Figures: estimates that are none, lamps that nothing can carry.

use super::desk::{Desk, dark, light, lit, says};
use serde_json::{Value, json};

#[test]
fn estimates_are_numbers_or_unknown() {
    // Before there was no light, `dE00 NaN` was said of such rooms for eleven rounds.
    let desk = Desk::with(&dark());
    let args = [
        "bake",
        "room.glb",
        "--allow-dark",
        "--log",
        "log.jsonl",
        "--json",
    ];
    let (said, printed) = desk.run(&args, 0);
    let log = std::fs::read_to_string(desk.at("log.jsonl")).unwrap();
    for text in [&said, &printed, &log] {
        assert!(!text.contains("NaN") && !text.contains("inf "), "{text}");
    }
    let verdict: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(verdict["verdict"], "reached");
    let value = &verdict["error_de2000"]["value"];
    assert!(value.is_null() || value == 0.0, "{verdict}");

    // There is nothing to keep for other lamps, and that is said; the room is written all the same.
    let said = desk
        .run(&["bake", "room.glb", "--allow-dark", "--cache"], 2)
        .0;
    assert!(said.contains("without light"), "{said}");
    assert!(!desk.at("room.cache").exists() && desk.at("room.baked.glb").exists());

    // A lamp that lights nothing at all, one that is hardly there.
    let mut room = dark();
    let spot = json!({"type": "spot", "intensity": 100.0, "spot": {"outerConeAngle": 0.3}});
    light(
        &mut room,
        spot,
        json!({"translation": [2.0, 1.5, 9.0], "rotation": [0.0, 1.0, 0.0, 0.0]}),
    );
    desk.put("room.glb", &room.glb());
    let said = desk.run(&["bake", "room.glb", "--allow-dark"], 0).0;
    assert!(!said.contains("NaN"), "{said}");
    let mut room = lit();
    let strength = "KHR_materials_emissive_strength";
    room.json["materials"][1]["extensions"][strength]["emissiveStrength"] = json!(1e-30);
    desk.put("room.glb", &room.glb());
    let output = desk.command(&["bake", "room.glb", "--error", "4"]).output();
    let output = output.unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!said.contains("NaN"), "{said}");
    assert!(matches!(output.status.code(), Some(0 | 1)), "{said}");
}

#[test]
fn lamps_beyond_all_bounds_are_an_input_error() {
    let strength = "KHR_materials_emissive_strength";
    let with = |nits: f64| {
        let mut room = lit();
        room.json["materials"][1]["extensions"][strength]["emissiveStrength"] = json!(nits);
        Desk::with(&room)
    };
    for nits in [1e38, 1e30, 1.1e15] {
        let said = with(nits).refused(&[]);
        says(&said, &["material 'glow'", "cd/m2", "give at most 1e15"]);
    }
    // What is just allowed bakes, to light that is a number.
    let desk = with(1e15);
    desk.bake(&[]);
    assert!(desk.light().iter().all(|y| y.is_finite() && *y > 0.0));

    let side =
        json!({"materials": {"glow": {"emission": {"name": "cie/A", "luminance_cd_m2": 1e200}}}});
    let desk = Desk::with(&lit());
    desk.put("room.spectra.json", side.to_string().as_bytes());
    says(&desk.refused(&[]), &["material 'glow'", "1.000e200"]);
    let mut room = dark();
    let bulb = json!({"type": "point", "name": "Bulb", "intensity": 1e37});
    light(&mut room, bulb, json!({"translation": [2.0, 1.5, 2.0]}));
    says(&Desk::with(&room).refused(&[]), &["light 'Bulb'", "cd"]);
}
