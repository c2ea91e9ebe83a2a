//! Daylight as files and command lines say it: the sun by the name of a light, by place and time, and through cards that are blended.

use crate::common;

use common::Room;
use glam::{DQuat, DVec3, dvec3};
use haarlight::scene::sky::direction;
use haarlight::scene::{LightKind, Options, Scene};
use haarlight::solve::{Bake, Settings};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

/// Of open ground under the sky alone, lx.
const SKY: f64 = 12_000.0;
/// Across the rays of the sun, lx.
const SUN: f64 = 70_000.0;

/// A black floor of 4 m, its front up.
fn floor() -> Room {
    let mut room = Room::empty();
    room.json["materials"] = json!([black("floor")]);
    let position = room.vectors(&[
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 4.0],
        [4.0, 0.0, 4.0],
        [4.0, 0.0, 0.0],
    ]);
    let indices = room.accessor(&[0, 1, 2, 0, 2, 3], common::U8, "SCALAR", 6);
    room.json["meshes"] = json!([{"primitives": [
        {"attributes": {"POSITION": position}, "indices": indices, "material": 0}]}]);
    room.json["nodes"] = json!([{"name": "floor", "mesh": 0}]);
    room
}

fn black(name: &str) -> Value {
    json!({"name": name, "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [0, 0, 0, 1]}})
}

/// A directional light of so many lx at a node, that shines from a direction.
fn shine(room: &mut Room, node: &str, from: DVec3, lux: f64) {
    room.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    room.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"name": "parallel", "type": "directional", "intensity": lux}]}});
    // Lights shine along -Z of their nodes.
    let turn = DQuat::from_rotation_arc(DVec3::Z, from).to_array();
    let carried = json!({"KHR_lights_punctual": {"light": 0}});
    let node = json!({"name": node, "rotation": turn, "extensions": carried});
    let index = common::push(&mut room.json["nodes"], node);
    room.json["scenes"][0]["nodes"] = json!((0..=index).collect::<Vec<usize>>());
}

fn write(folder: &Path, room: &Room, side: Option<Value>) {
    std::fs::write(folder.join("room.glb"), room.glb()).unwrap();
    if let Some(side) = side {
        std::fs::write(folder.join("room.spectra.json"), side.to_string()).unwrap();
    }
}

fn loaded(room: &Room, side: Option<Value>) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), room, side);
    Scene::load(folder.path().join("room.glb"), &Options::default()).unwrap()
}

fn lux(scene: Scene, points: &[(DVec3, DVec3)]) -> Vec<f64> {
    let mut bake = Bake::new(scene, Settings::default());
    bake.run();
    bake.probe(points).iter().map(|p| p.xyz[1]).collect()
}

/// On the floor, and upright above it toward east and south.
fn places() -> [(DVec3, DVec3); 3] {
    let at = dvec3(2.0, 0.0, 2.0);
    [
        (at, DVec3::Y),
        (at + DVec3::Y, DVec3::X),
        (at + DVec3::Y, DVec3::Z),
    ]
}

/// A light of the file that is said to be the sun shines with its own lux from its own direction, and the sky is brightest there, as if
/// the same place were said in degrees.
#[test]
fn the_sun_is_a_node_of_the_file() {
    let [elevation, azimuth] = [35.0, 150.0];
    let toward = direction(elevation, azimuth);
    let mut named = floor();
    shine(&mut named, "Sol", toward, SUN);
    let sky = |sun: Value| {
        Some(
            json!({"sky": {"type": "clear", "illuminance_lx": SKY, "ground_reflectance": 0, "sun": sun}}),
        )
    };
    let scene = loaded(&named, sky(json!("Sol")));
    let suns: Vec<_> = scene
        .lights
        .iter()
        .filter(|l| l.kind.is_parallel())
        .collect();
    assert_eq!(suns.len(), 1, "{:?}", scene.warnings);
    assert_eq!(suns[0].kind, LightKind::Sun);
    let gap = (suns[0].direction + toward).length();
    assert!(gap < 1e-6, "it shines along {}", suns[0].direction);
    let in_degrees = loaded(
        &floor(),
        sky(json!({"elevation_deg": elevation, "azimuth_deg": azimuth, "illuminance_lx": SUN})),
    );
    let [got, want] = [scene, in_degrees].map(|scene| lux(scene, &places()));
    println!("{got:?} for {want:?}");
    let level = SKY + SUN * toward.y;
    assert!((got[0] / level - 1.0).abs() < 1e-3, "{} {level}", got[0]);
    for (got, want) in got.iter().zip(want) {
        assert!((got / want - 1.0).abs() < 1e-3, "{got} {want}");
    }
}

/// Place and time, or the height and azimuth that Reda and Andreas 2004 print for them (appendix A.5: zenith angle 50.11162, with .02 degrees of
/// refraction, azimuth 194.34024), typed at the program.
#[test]
fn the_sun_is_typed_by_place_and_time() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &floor(), None);
    let mut rows = "x,y,z,nx,ny,nz\n".to_owned();
    for (at, n) in places() {
        rows += &format!("{},{},{},{},{},{}\n", at.x, at.y, at.z, n.x, n.y, n.z);
    }
    std::fs::write(folder.path().join("points.csv"), rows).unwrap();
    let probe = |sun: &str| -> Vec<f64> {
        let run = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .current_dir(folder.path())
            .args(["probe", "room.glb", "--points", "points.csv", "-q"])
            .args(["--sky", "clear", "--sky-lux", "12000", "--sun-lux", "70000"])
            .args(["--sun", sun])
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&run.stderr);
        assert!(matches!(run.status.code(), Some(0 | 1)), "{said}");
        let text = String::from_utf8(run.stdout).unwrap();
        let mut lines = text.lines();
        let column = lines.next().unwrap().split(',').position(|k| k == "E_Y");
        let number = |line: &str| line.split(',').nth(column.unwrap()).unwrap().parse();
        lines.map(|line| number(line).unwrap()).collect()
    };
    let timed = probe("39.742476,-105.1786,2003-10-17T12:30:30-07:00");
    let placed = probe("39.88838,194.34024");
    println!("{timed:?} for {placed:?}");
    assert_eq!(timed.len(), 3);
    let toward = direction(39.888_38, 194.340_24);
    let level = SKY + SUN * toward.y;
    assert!((timed[0] / level - 1.0).abs() < 2e-3, "{timed:?} {level}");
    for (timed, placed) in timed.iter().zip(placed) {
        assert!((timed / placed - 1.0).abs() < 2e-3, "{timed} {placed}");
    }
}

/// A blended card over the floor, from a file with a texture: alpha by texel, colour by the material's factor.
#[test]
fn blended_cards_of_a_file_let_light_through_by_texel() {
    let alphas = [0_u8, 64, 128, 255];
    for colour in [1.0, 0.25] {
        let mut room = floor();
        shine(&mut room, "above", DVec3::Y, 500.0);
        let pixels = alphas.map(|alpha| [255, 255, 255, alpha]);
        let view = room.view(&common::png(4, 1, &pixels));
        room.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
        // Nearest texels, not between them.
        room.json["samplers"] =
            json!([{"magFilter": 9728, "minFilter": 9728, "wrapS": 33071, "wrapT": 33071}]);
        room.json["textures"] = json!([{"source": 0, "sampler": 0}]);
        let card = json!({"name": "card", "alphaMode": "BLEND", "pbrMetallicRoughness": {
            "metallicFactor": 0, "baseColorFactor": [colour, colour, colour, 1], "baseColorTexture": {"index": 0}}});
        let material = common::push(&mut room.json["materials"], card);
        let corners = [
            [0.0, 1.0, 0.0],
            [0.0, 1.0, 4.0],
            [4.0, 1.0, 4.0],
            [4.0, 1.0, 0.0],
        ];
        let position = room.vectors(&corners);
        let uvs = room.vectors(&[[0.0, 0.5], [0.0, 0.5], [1.0, 0.5], [1.0, 0.5_f32]]);
        let indices = room.accessor(&[0, 1, 2, 0, 2, 3], common::U8, "SCALAR", 6);
        let primitive = json!({"attributes": {"POSITION": position, "TEXCOORD_0": uvs}, "indices": indices, "material": material});
        let mesh = common::push(&mut room.json["meshes"], json!({"primitives": [primitive]}));
        let node = common::push(
            &mut room.json["nodes"],
            json!({"name": "card", "mesh": mesh}),
        );
        room.json["scenes"][0]["nodes"] = json!((0..=node).collect::<Vec<usize>>());
        let scene = loaded(&room, None);
        assert_eq!((scene.panes.len(), scene.surfaces.len()), (1, 1));
        let at = [0.5, 1.5, 2.5, 3.5].map(|x| (dvec3(x, 0.0, 2.0), DVec3::Y));
        for (got, alpha) in lux(scene, &at).iter().zip(alphas) {
            let a = f64::from(alpha) / 255.0;
            let want = 500.0 * (1.0 - a) * (1.0 - a * (1.0 - colour));
            println!("{colour}, {a:.3}: {got} for {want}");
            assert!(
                (got - want).abs() < 1e-3 * 500.0,
                "{colour} {a}: {got} {want}"
            );
        }
    }
}
