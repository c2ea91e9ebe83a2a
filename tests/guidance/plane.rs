//! What a bake says of its working plane.

use crate::built::faces;
use crate::desk::{Desk, lit, object, says};
use glam::dvec3;

/// A cupboard of .9 by .9 m hangs in the plane. Inside it is dark: its points are told, and are no part of mean and uniformity.
#[test]
fn the_working_plane_leaves_hollows_out() {
    let told = |cupboard: bool| {
        let mut room = lit();
        let corners = [dvec3(0.2, 0.3, 0.2), dvec3(1.1, 1.8, 1.1)];
        if cupboard {
            room.json["materials"][0]["doubleSided"] = serde_json::json!(true);
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
    assert_eq!(empty["dark_points"], 0, "{empty}");
    let (dark, spacing) = (
        plane["dark_points"].as_f64().unwrap(),
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
