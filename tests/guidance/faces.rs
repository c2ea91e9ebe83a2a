//! Lamps that shine away from the room, and no lamp at all.

use super::desk::{Desk, dark, light, lit, materials, object, panel, says, turned, vectors, walls};
use glam::dvec3;
use serde_json::json;

#[test]
fn a_reversed_lamp_is_named_and_flip_turns_it() {
    // It hangs in the place of a ceiling and shines up, into the open.
    let mut hung = turned(panel());
    hung.iter_mut().flatten().for_each(|p| p.y = 3.0);
    let mut room = materials();
    let five: Vec<_> = (walls().into_iter().enumerate())
        .filter(|(k, _)| *k != 3)
        .map(|(_, face)| face)
        .collect();
    object(&mut room, "Room", &five, 0);
    object(&mut room, "Lamp", &hung, 1);
    let desk = Desk::with(&room);

    let said = desk.refused(&[]);
    says(
        &said,
        &[
            "all lamps shine away from the room",
            "faces look reversed",
            "'Lamp'",
            "'Lamp mesh'",
            "material 'glow'",
            "--flip",
            "--allow-dark",
        ],
    );
    assert!(!said.contains("'wall'"), "{said}");

    let said = desk.bake(&["--flip"]);
    says(&said, &["--flip: turned", "'Lamp'"]);
    let brightest = desk.light().into_iter().fold(0.0, f32::max);
    assert!(brightest > 1000.0, "{brightest}");
    // What is written is turned too, its normals with it.
    let bytes = std::fs::read(desk.at("room.baked.glb")).unwrap();
    let (places, normals) = (vectors(&bytes, "POSITION"), vectors(&bytes, "NORMAL"));
    let mut seen = 0;
    for (place, normal) in places.iter().zip(&normals) {
        let [x, y, z] = *place;
        if y == 3.0 && (0.9..3.1).contains(&x) && (1.9..3.1).contains(&z) {
            assert_eq!(*normal, [0.0, -1.0, 0.0]);
            seen += 1;
        }
    }
    assert!(seen > 0);
}

#[test]
fn a_room_that_is_reversed_as_a_whole_is_told_and_turned() {
    let mut room = materials();
    object(&mut room, "Room", &turned(walls()), 0);
    object(&mut room, "Lamp", &turned(panel()), 1);
    let desk = Desk::with(&room);
    let said = desk.refused(&[]);
    says(
        &said,
        &["faces look reversed", "seen from behind", "turns all faces"],
    );
    says(&desk.bake(&["--flip"]), &["all 2 surfaces are turned"]);
    let whole = desk.light();

    // The same light as in the room that was right from the start.
    desk.put("room.glb", &lit().glb());
    desk.bake(&[]);
    let right = desk.light();
    let mean = |y: &[f32]| f64::from(y.iter().sum::<f32>()) / y.len() as f64;
    assert!((mean(&whole) / mean(&right) - 1.0).abs() < 0.1);
}

#[test]
fn a_spot_that_points_out_of_the_room_is_named() {
    let mut room = dark();
    let spot = json!({"type": "spot", "name": "Beam", "intensity": 100.0,
        "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.3}});
    // Above the room, shining up: -Z turned to +Y.
    let up = json!({"name": "Stand", "translation": [2.0, 4.0, 2.0],
        "rotation": [0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()]});
    light(&mut room, spot, up);
    let desk = Desk::with(&room);
    let said = desk.refused(&[]);
    says(&said, &["spot light 'Beam'", "-Z", "--allow-dark"]);
    assert!(!said.contains("give --flip"), "{said}");
}

/// A hand's breadth of sky is light. A room without any is closed, not reversed, and says of the sky that it is off.
#[test]
fn a_small_opening_lets_the_sky_in_and_a_closed_room_shuts_it_out() {
    let overcast = ["--sky", "overcast"];
    let sun = [
        "--sky",
        "overcast",
        "--sky-lux",
        "0",
        "--ground",
        "0",
        "--sun",
        "60,30",
    ];
    let sun = [&sun[..], &["--sun-lux", "50000"]].concat();
    let desk = Desk::with(&dark());
    for sky in [&overcast[..], &sun] {
        let said = desk.refused(sky);
        says(
            &said,
            &[
                "no lamp lights the room",
                "the room is closed, no ray leaves it",
                "--allow-dark",
            ],
        );
        assert!(
            !said.contains("reversed") && !said.contains("--flip"),
            "{said}"
        );
        let (_, page) = desk.run(&[&["inspect", "room.glb"], sky].concat(), 0);
        says(&page, &["off      the room is closed: no ray leaves it"]);
    }

    // A ceiling of four parts about a hole of .1 m.
    let mut faces = walls().to_vec();
    faces.remove(3);
    let xs = [0.0, 1.9, 2.0, 4.0];
    let zs = [0.0, 2.4, 2.5, 5.0];
    for (x, z) in [
        ([0, 3], [0, 1]),
        ([0, 3], [2, 3]),
        ([0, 1], [1, 2]),
        ([2, 3], [1, 2]),
    ] {
        let p = |i: usize, k: usize| dvec3(xs[x[i]], 3.0, zs[z[k]]);
        faces.push([p(0, 0), p(1, 0), p(1, 1), p(0, 1)]);
    }
    let mut room = materials();
    object(&mut room, "Room", &faces, 0);
    let desk = Desk::with(&room);
    for sky in [&overcast[..], &sun] {
        let (_, page) = desk.run(&[&["inspect", "room.glb"], sky].concat(), 0);
        assert!(!page.contains("no front"), "{page}");
        let mut lines = page.lines().map(|line| line.split_whitespace().take(2));
        assert!(lines.any(|words| words.eq(["sky", "runs"])), "{page}");
    }
    desk.bake(&overcast);
    assert!(desk.light().into_iter().fold(0.0, f32::max) > 0.0);
}

#[test]
fn good_rooms_pass_and_flip_says_that_there_is_nothing_to_turn() {
    let desk = Desk::with(&lit());
    let said = desk.bake(&["--flip"]);
    says(&said, &["--flip: nothing was turned"]);
    let mut room = dark();
    let bulb = json!({"type": "point", "name": "Bulb", "intensity": 100.0});
    light(&mut room, bulb, json!({"translation": [2.0, 1.5, 2.0]}));
    desk.put("room.glb", &room.glb());
    assert!(!desk.bake(&[]).contains("warning"));
}

#[test]
fn a_room_without_a_lamp_is_refused_unless_it_is_meant() {
    let desk = Desk::with(&dark());
    let said = desk.refused(&[]);
    says(
        &said,
        &[
            "there is no lamp",
            "KHR_materials_emissive_strength",
            "KHR_lights_punctual",
            "luminance_cd_m2",
            "--allow-dark",
        ],
    );
    let said = desk.bake(&["--allow-dark", "--log", "log.jsonl"]);
    says(&said, &["warning: there is no lamp", "1 warning"]);
    assert!(desk.light().iter().all(|y| *y == 0.0));
    assert!(!said.contains("NaN"), "{said}");

    // A side file's emission is a lamp.
    let side =
        json!({"materials": {"glow": {"emission": {"name": "cie/A", "luminance_cd_m2": 100}}}});
    let mut room = materials();
    room.json["materials"][1]["emissiveFactor"] = json!([0.0, 0.0, 0.0]);
    object(&mut room, "Room", &walls(), 0);
    object(&mut room, "Lamp", &panel(), 1);
    desk.put("room.glb", &room.glb());
    desk.run(&["bake", "room.glb"], 2);
    desk.put("room.spectra.json", side.to_string().as_bytes());
    desk.bake(&[]);

    // The other commands that solve say so too; `inspect` only mentions it.
    let desk = Desk::with(&dark());
    desk.put("points.csv", b"x,y,z,nx,ny,nz\n1,1,1,0,1,0\n");
    let said = desk
        .run(&["probe", "room.glb", "--points", "points.csv"], 2)
        .0;
    says(&said, &["there is no lamp"]);
    let (_, page) = desk.run(&["inspect", "room.glb"], 0);
    says(&page, &["there is no lamp", "Warnings"]);
}
