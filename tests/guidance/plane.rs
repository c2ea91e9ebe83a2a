//! What a bake says of its working plane.

use super::desk::{Desk, light, lit, object, says};
use crate::common::built::faces;
use glam::dvec3;
use serde_json::json;

/// A cupboard of .9 by .9 m hangs in the plane. Its inside is a hollow: its points are told, and are no part of mean and uniformity.
#[test]
fn the_working_plane_leaves_hollows_out() {
    let told = |cupboard: bool| {
        let mut room = lit();
        let corners = [dvec3(0.2, 0.3, 0.2), dvec3(1.1, 1.8, 1.1)];
        if cupboard {
            room.json["materials"][0]["doubleSided"] = json!(true);
            object(&mut room, "Cupboard", &faces(corners[0], corners[1]), 0);
        }
        let desk = Desk::with(&room);
        let said = desk.bake(&["--log", "log.jsonl"]);
        let records = desk.records("log.jsonl");
        (
            said,
            records.last().unwrap()["metrics"]["working_plane"].clone(),
        )
    };
    let [(_, empty), (said, plane)] = [told(false), told(true)];
    assert_eq!(empty["left_out"], 0, "{empty}");
    let (dark, spacing) = (
        plane["left_out"].as_f64().unwrap(),
        plane["spacing_m"].as_f64().unwrap(),
    );
    let want = 0.81 / (spacing * spacing);
    assert!(dark > 0.4 * want && dark < 1.8 * want, "{dark} of {want}");
    let least = plane["min_lux"].as_f64().unwrap();
    assert!(
        least > 0.01 * plane["mean_lux"]["value"].as_f64().unwrap(),
        "{plane}"
    );
    let mean = format!("mean {:.0} (", plane["mean_lux"]["value"].as_f64().unwrap());
    says(
        &said,
        &[
            "on a plane 0.85 m above the floor, at",
            &mean,
            "min/mean 0.",
            "UGR from camera '",
        ],
    );
    // What nobody asked for is not looked for.
    let quiet = Desk::with(&lit()).bake(&[]);
    assert!(
        !quiet.contains("UGR") && !quiet.contains("on a plane"),
        "{quiet}"
    );
}

/// A hollow below the room with a glimmer in it and a lawn before it that the sun shines on are lower than the floor, and large. Neither is it.
#[test]
fn hollows_and_lawns_are_no_floors() {
    let mut room = lit();
    let mut ember = room.json["materials"][1].clone();
    ember["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = json!(1e-4);
    room.json["materials"].as_array_mut().unwrap().push(ember);
    let hollow = faces(dvec3(0.0, -2.0, 0.0), dvec3(4.0, -1.0, 5.0));
    object(&mut room, "Hollow", &hollow, 2);
    let p = |x: f64, z: f64| dvec3(x, -0.4, z);
    let lawn = [[p(5.0, 0.0), p(5.0, 5.0), p(11.0, 5.0), p(11.0, 0.0)]];
    object(&mut room, "Lawn", &lawn, 0);
    let sun = json!({"type": "directional", "intensity": 5000.0});
    let down = json!({"rotation": [-0.5_f64.sqrt(), 0.0, 0.0, 0.5_f64.sqrt()]});
    light(&mut room, sun, down);
    let desk = Desk::with(&room);
    desk.bake(&["--log", "log.jsonl"]);
    let records = desk.records("log.jsonl");
    let plane = &records.last().unwrap()["metrics"]["working_plane"];
    assert_eq!(plane["floor_m"], 0.0, "{plane}");
    // The panel alone, not the sun.
    assert!(plane["max_lux"].as_f64().unwrap() < 1000.0, "{plane}");
}
