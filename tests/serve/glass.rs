//! Rooms with panes and mirrors: what is shown after a lamp is dimmed is what a bake of the dimmed room finds.

use crate::program::{Light, Program};
use glam::{DMat4, DVec3};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use serde_json::{Value, json};

/// Triangles that are compared.
const COMPARED: usize = 300;
/// What a lamp is dimmed by.
const FACTOR: f64 = 0.3;

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

/// Dims a lamp of a room, and compares what is shown at the middles of triangles with what a bake of the dimmed room finds there. That the
/// light between vertices is not that of the vertices is taken out by a bake of the room as it was.
fn dimmed_is_baked(room: &str, kind: &str, lamp: &str) {
    let program = Program::serve(room, &["--error", "1"]);
    let state = program.wait_done();
    let before = program.light_now();
    let changes = json!({ "dim": { kind: { lamp: FACTOR } } });
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
    let after = program.light_now();
    let glb = program.get("/mesh").body;
    let [whole, shown] = [&before, &after].map(|light| triangles(&glb, light));
    let file = program.folder.path().join(format!("{room}.glb"));
    let points: Vec<(DVec3, DVec3)> = shown.iter().map(|(point, _)| *point).collect();
    let baked = [1.0, FACTOR].map(|factor| {
        let mut scene = Scene::load(&file, &Options::default()).unwrap();
        for light in scene.lights.iter_mut().filter(|l| l.name == lamp) {
            light.shape = light.shape.map(|x| factor * x);
        }
        let lamps = scene.materials.iter_mut().filter(|m| m.name == lamp);
        for emission in lamps.filter_map(|m| m.emission.as_mut()) {
            emission.shape = emission.shape.map(|x| factor * x);
            emission.scale *= factor;
        }
        let settings = Settings {
            error: 1.0,
            ..Settings::default()
        };
        let mut bake = Bake::new(scene, settings);
        bake.run();
        bake.probe(&points)
    });
    let [mut sum, mut off, mut bias, mut all] = [0.0; 4];
    let mut compared = 0;
    for (k, (_, lux)) in shown.iter().enumerate() {
        let [full, dim] = [&baked[0], &baked[1]].map(|light| light[k].xyz[1]);
        // Where something covers the middle of a triangle its vertices have their neighbours' light.
        if !(0.5..2.0).contains(&(whole[k].1 / full)) {
            continue;
        }
        compared += 1;
        let want = whole[k].1 * dim / full;
        sum += want;
        all += whole[k].1;
        off += (lux - want).abs();
        bias += lux - want;
    }
    let [off, bias, left] = [off / sum, bias / sum, sum / all];
    println!(
        "{room}: {compared} compared, off {off:.4}, bias {bias:+.4}, {left:.3} of the light is left"
    );
    assert!(4 * compared > 3 * COMPARED, "{compared}");
    assert!(left < 0.8, "dimming changes nothing: {left}");
    assert!(
        off < 0.02 && bias.abs() < 0.005,
        "{room}: off {off}, bias {bias}"
    );
}

#[test]
fn a_room_behind_panes_is_dimmed_as_it_is_baked() {
    dimmed_is_baked("glazed", "lights", "sun");
}
