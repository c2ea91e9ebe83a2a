//! Files with nothing in them, rooms of a strange size, a picture that is smaller than it looks.

use super::desk::{Desk, dark, light, lit, materials, object, panel, says, vectors, walls};
use crate::common::{Room, push};
use haarlight::scene::{Options, Scene};
use serde_json::json;

#[test]
fn a_file_with_nothing_to_bake_is_refused() {
    let mut thin = Room::triangle();
    thin.primitive()["mode"] = json!(1);
    let mut unseen = lit();
    unseen.json["scenes"] = json!([{"nodes": [0]}]);
    let mut bare = lit();
    for node in bare.json["nodes"].as_array_mut().unwrap() {
        node.as_object_mut().unwrap().remove("mesh");
    }
    for (room, why) in [
        (Room::empty(), "the file has no mesh"),
        (thin, "only points or lines"),
        (unseen, "no triangle with an area is in the scene"),
        (bare, "no node shows a mesh"),
    ] {
        let desk = Desk::with(&room);
        // Not even where darkness is meant.
        for more in [&[][..], &["--allow-dark"]] {
            says(&desk.refused(more), &["there is nothing to bake", why]);
        }
    }
}

/// The room times `factor`, as a node's scale.
fn sized(factor: f64) -> Room {
    let mut room = lit();
    let children = room.json["scenes"][0]["nodes"].take();
    let node = json!({"children": children, "scale": [factor, factor, factor]});
    let node = push(&mut room.json["nodes"], node);
    room.json["scenes"][0]["nodes"] = json!([node]);
    room
}

#[test]
fn strange_sizes_come_with_a_scale() {
    for (factor, size, way_out) in [
        (100.0, "500 m", "centimetres, give --scale 0.01"),
        (1000.0, "5000 m", "millimetres, give --scale 0.001"),
        (0.01, "0.05 m", "give --scale 100"),
    ] {
        let desk = Desk::with(&sized(factor));
        let said = desk.bake(&[]);
        says(&said, &["warning: the room is", size, way_out]);
    }
    assert!(!Desk::with(&lit()).bake(&[]).contains("--scale"));
    assert!(!Desk::with(&sized(50.0)).bake(&[]).contains("--scale"));
    // A scale of nothing is none.
    Desk::with(&lit()).run(&["bake", "room.glb", "--scale", "0"], 2);
}

/// A room in centimetres with its scale is the room in metres: the same light by a lamp of the same candela, and the file
/// keeps its unit.
#[test]
fn a_scale_makes_metres_and_the_file_keeps_its_unit() {
    let bulb = || json!({"type": "point", "name": "Bulb", "intensity": 100.0});
    let mut metres = dark();
    light(&mut metres, bulb(), json!({"translation": [2.0, 1.5, 2.0]}));
    let mut centimetres = materials();
    let large = walls().map(|face| face.map(|p| p * 100.0));
    object(&mut centimetres, "Room", &large, 0);
    light(
        &mut centimetres,
        bulb(),
        json!({"translation": [200.0, 150.0, 200.0]}),
    );
    let (small, large) = (Desk::with(&metres), Desk::with(&centimetres));
    small.bake(&["--npz", "out.npz"]);
    let said = large.bake(&["--scale", "0.01", "--npz", "out.npz"]);
    assert!(!said.contains("warning"), "{said}");
    let read = |desk: &Desk| std::fs::read(desk.at("room.baked.glb")).unwrap();
    let (a, b) = (read(&small), read(&large));
    let (places_a, places_b) = (vectors(&a, "POSITION"), vectors(&b, "POSITION"));
    let top = |places: &[[f32; 3]]| places.iter().flatten().fold(0.0f32, |m, x| m.max(*x));
    assert_eq!((top(&places_a), top(&places_b)), (5.0, 500.0));
    let mean = |desk: &Desk| {
        let light = desk.light();
        f64::from(light.iter().sum::<f32>()) / light.len() as f64
    };
    assert!((mean(&large) / mean(&small) - 1.0).abs() < 0.02);

    // Sensors are given in the file's unit, and told in it.
    small.put("p.csv", b"x,y,z,nx,ny,nz\n2,0,2,0,1,0\n");
    large.put("p.csv", b"x,y,z,nx,ny,nz\n200,0,200,0,1,0\n");
    let probe = ["probe", "room.glb", "--points", "p.csv", "--error", "4"];
    let (_, one) = small.run(&probe, 0);
    let (_, other) = large.run(&[&probe[..], &["--scale", "0.01"]].concat(), 0);
    let cells = |csv: &str| -> Vec<f64> {
        let line = csv.lines().nth(1).unwrap();
        line.split(',').map_while(|c| c.parse().ok()).collect()
    };
    let (one, other) = (cells(&one), cells(&other));
    assert_eq!((one[0], other[0]), (2.0, 200.0));
    assert!((other[7] / one[7] - 1.0).abs() < 0.02, "{one:?} {other:?}");
}

#[test]
fn a_picture_of_618_bytes_is_read() {
    let png = include_bytes!("palette.png");
    assert_eq!(png.len(), 618);
    let mut room = materials();
    let image = room.view(png);
    room.json["images"] =
        json!([{"name": "palette", "bufferView": image, "mimeType": "image/png"}]);
    room.json["textures"] = json!([{"source": 0}]);
    room.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    object(&mut room, "Room", &walls(), 0);
    object(&mut room, "Lamp", &panel(), 1);
    let coordinates = room.vectors(&[[0.0, 0.0]; 24]);
    room.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(coordinates);
    let desk = Desk::with(&room);
    let scene = Scene::load(desk.at("room.glb"), &Options::default()).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    let image = &scene.images[0];
    assert_eq!((image.width, image.height), (2048, 2048));
    // All of it is the one colour of the palette, half clear.
    assert_eq!(image.pixels[7][..3], [0.0, 0.0, 1.0]);
    assert!((image.pixels[7][3] - 128.0 / 255.0).abs() < 1e-6);
}
