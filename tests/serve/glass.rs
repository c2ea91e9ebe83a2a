//! Rooms with panes and mirrors: what is shown after a lamp is dimmed is what a bake of the dimmed room finds.

use crate::program::{Light, Program};
use glam::{DMat4, DVec3};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use serde_json::{Value, json};

/// Triangles that are compared.
const COMPARED: usize = 300;
const ERROR: f64 = 1.0;

/// Middles, normals and mean illuminances of the largest triangles of the mesh that is shown.
fn triangles(glb: &[u8], light: &Light) -> Vec<((DVec3, DVec3), f64)> {
    let file = gltf::Gltf::from_slice(glb).unwrap();
    let blob = file.blob.as_deref().unwrap();
    let mut found = Vec::new();
    let (mut first, mut parts) = (0, light.parts.iter());
    let mut stack: Vec<(gltf::Node, DMat4)> = (file.scenes().next().unwrap().nodes())
        .map(|node| (node, DMat4::IDENTITY))
        .collect();
    let mut placed = vec![DMat4::IDENTITY; file.nodes().len()];
    while let Some((node, above)) = stack.pop() {
        let own = node
            .transform()
            .matrix()
            .map(|column| column.map(f64::from));
        placed[node.index()] = above * DMat4::from_cols_array_2d(&own);
        stack.extend(node.children().map(|child| (child, placed[node.index()])));
    }
    for node in file.nodes() {
        let to_world = placed[node.index()];
        for primitive in node
            .mesh()
            .into_iter()
            .flat_map(|mesh| mesh.primitives().collect::<Vec<_>>())
        {
            if primitive.get(&gltf::Semantic::Colors(0)).is_none() {
                continue;
            }
            let (count, ..) = *parts.next().unwrap();
            let reader = primitive.reader(|_| Some(blob));
            let positions: Vec<DVec3> = (reader.read_positions().unwrap())
                .map(|p| to_world.transform_point3(DVec3::from(p.map(f64::from))))
                .collect();
            assert_eq!(positions.len(), count);
            let corners: Vec<usize> = reader
                .read_indices()
                .unwrap()
                .into_u32()
                .map(|k| k as usize)
                .collect();
            for corner in corners.chunks(3) {
                let [a, b, c] = [0, 1, 2].map(|k| positions[corner[k]]);
                let across = (b - a).cross(c - a);
                let lux = |k: usize| f64::from(light.values[first + corner[k]][3]);
                let mean = (lux(0) + lux(1) + lux(2)) / 3.0;
                found.push((
                    across.length(),
                    (((a + b + c) / 3.0, across.normalize_or_zero()), mean),
                ));
            }
            first += count;
        }
    }
    assert_eq!(first, light.values.len());
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, of)| of).take(COMPARED).collect()
}

/// Dims a light of a room, and compares what is shown with a bake of the dimmed room at the middles of triangles.
fn dimmed_is_baked(room: &str, light: &str, factor: f64) {
    let error = ERROR.to_string();
    let program = Program::serve(room, &["--error", &error]);
    let state = program.wait_done();
    let before = program.light_now();
    let changes = json!({ "dim": { "lights": { light: factor } } });
    assert_eq!(program.post("/change", &changes.to_string()).status, 202);
    let relit = program.wait("relit", |s: &Value| {
        s["picture"][2].as_u64() > Some(before.numbers[2].into())
            && s["changes"] == changes
            && s["doing"] == "done"
    });
    assert_eq!(
        relit["picture"][0], state["picture"][0],
        "solved anew: {relit}"
    );
    let shown = program.light_now();
    let places = triangles(&program.get("/mesh").body, &shown);

    let file = program.folder.path().join(format!("{room}.glb"));
    let mut scene = Scene::load(file, &Options::default()).unwrap();
    for lamp in scene.lights.iter_mut().filter(|l| l.name == light) {
        lamp.shape = lamp.shape.map(|x| factor * x);
    }
    let settings = Settings {
        error: 0.5 * ERROR,
        ..Settings::default()
    };
    let mut bake = Bake::new(scene, settings);
    bake.run();
    let points: Vec<(DVec3, DVec3)> = places.iter().map(|(point, _)| *point).collect();
    let baked = bake.probe(&points);
    let [mut sum, mut off, mut bias] = [0.0; 3];
    for ((_, lux), baked) in places.iter().zip(&baked) {
        sum += baked.xyz[1];
        off += (lux - baked.xyz[1]).abs();
        bias += lux - baked.xyz[1];
    }
    let change = before.mean_lux() / shown.mean_lux();
    println!(
        "{room}: off {:.4}, bias {:+.4}, dimmed by {change:.2}",
        off / sum,
        bias / sum
    );
    assert!(change > 1.1, "dimming changes nothing: {change}");
    assert!(
        off < 0.03 * sum && bias.abs() < 0.01 * sum,
        "{room}: off {}, bias {}",
        off / sum,
        bias / sum
    );
}

#[test]
fn a_room_behind_panes_is_dimmed_as_it_is_baked() {
    dimmed_is_baked("glazed", "sky", 0.3);
}

#[test]
fn a_room_with_mirrors_is_dimmed_as_it_is_baked() {
    dimmed_is_baked("mirrored", "spot", 0.3);
}
