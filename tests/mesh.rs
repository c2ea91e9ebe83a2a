//! The mesh that is written: no T-junctions, as fine as light needs it, and with the error that is stated.

use crate::common::built;

use built::{Room, baked_to, estimate};
use glam::{DVec3, dvec3};
use haarlight::audit::{PathReference, Report};
use haarlight::gather::Baked;
use haarlight::gather::refined::position;
use haarlight::mesh::Limits;
use haarlight::output::{Exposure, Writing, baked_glb};
use haarlight::scene::{Meshes, Options, Paint, PointLamp, Scene};
use haarlight::solve::Bake;
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

fn baked(scene: Scene, error: f64) -> (Bake, Baked) {
    let bake = baked_to(error, scene);
    let baked = bake.baked(&|_, _| {});
    (bake, baked)
}

fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    Scene::load(path, &Options::default()).unwrap()
}

fn vertices(baked: &Baked) -> usize {
    baked.surfaces.iter().map(|s| s.vertices.len()).sum()
}

/// Wherever time runs out, the mesh is whole, and the error that is stated is that of the mesh that there is.
#[test]
fn a_mesh_that_is_cut_short_is_whole_and_measured() {
    let (bake, whole) = baked(scene("cornell.glb"), 1.0);
    has_no_cracks(&bake, &whole);
    let cut = |after: usize| {
        let asked = AtomicUsize::new(0);
        let late = || asked.fetch_add(1, Ordering::Relaxed) >= after;
        let limits = Limits {
            late: &late,
            ..Limits::default()
        };
        let baked = bake.baked_within(&limits, &|_, _| {});
        (baked, asked.into_inner())
    };
    let (uncut, times) = cut(usize::MAX);
    assert_eq!(
        vertices(&uncut),
        vertices(&whole),
        "asking changes the mesh"
    );
    assert!(times > 10, "{times}");
    let reference = PathReference::new(&bake, 300, 4096, 7);
    for after in [0, times / 6, times / 3] {
        let (baked, _) = cut(after);
        has_no_cracks(&bake, &baked);
        let found = baked.interpolation.unwrap();
        assert!(found.points > 300, "{after}: {found:?}");
        assert!(after > 0 || !found.is_met(), "{found:?}");
        let stated = bake.error_of(&baked).unwrap();
        let measured = Report::of_file(&bake, &baked, &reference);
        let mean = measured.de2000.mean.value;
        assert!(
            (0.6..1.7).contains(&(stated / mean)),
            "{after}: {stated} for {mean}"
        );
    }
}

/// A vertex inside an edge of another triangle of a wall would let the background shine through.
fn has_no_cracks(bake: &Bake, baked: &Baked) {
    for part in &baked.surfaces {
        let surface = &bake.scene().surfaces[part.surface];
        let at: Vec<DVec3> = part.vertices.iter().map(|v| position(surface, v)).collect();
        let mut edges: HashMap<[[u64; 3]; 2], (usize, DVec3, DVec3)> = HashMap::new();
        for t in &part.triangles {
            for k in 0..3 {
                let (p, q) = (at[t[k] as usize], at[t[(k + 1) % 3] as usize]);
                let mut key = [p, q].map(|p| (p + DVec3::ZERO).to_array().map(f64::to_bits));
                key.sort_unstable();
                edges.entry(key).or_insert((0, p, q)).0 += 1;
            }
        }
        for (_, p, q) in edges.values().filter(|(n, ..)| *n == 1) {
            let along = *q - *p;
            let inside = at.iter().filter(|x| {
                let s = (**x - *p).dot(along) / along.length_squared();
                (1e-6..1.0 - 1e-6).contains(&s)
                    && (**x - *p - s * along).length() < 1e-9 * along.length()
            });
            assert_eq!(inside.count(), 0, "{p} {q} of {}", surface.name);
        }
    }
}

/// Light that is the same everywhere takes no vertex but the input's, and so does a room without any.
#[test]
fn even_light_and_darkness_cost_nothing() {
    let (_, glowing) = baked(scene("furnace.glb"), 0.5);
    let of_furnace = scene("furnace.glb");
    let corners = of_furnace.surfaces.iter().map(|s| 3 * s.triangles.len());
    assert!(
        vertices(&glowing) <= corners.sum(),
        "{}",
        vertices(&glowing)
    );
    let mut room = Room::new();
    let wall = room.paint(0.5);
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 5.0), [wall; 6]);
    let (_, dark) = baked(room.scene(), 0.5);
    assert!(vertices(&dark) <= 24, "{}", vertices(&dark));
}

/// A block in the dark next door keeps its triangles, whatever shines here.
#[test]
fn what_is_black_keeps_its_triangles() {
    let mut room = Room::new();
    let (wall, lamp) = (room.paint(0.5), room.lamp(0.5, 1000.0));
    let size = dvec3(4.0, 3.0, 5.0);
    room.hollow(DVec3::ZERO, size, [wall, wall, wall, lamp, wall, wall]);
    let beside = dvec3(10.0, 0.0, 0.0);
    room.hollow(beside, beside + size, [wall; 6]);
    room.block(beside + 1.0, beside + 2.0, wall);
    let (bake, baked) = baked(room.scene(), 0.5);
    let mut lit = 0;
    for part in &baked.surfaces {
        let surface = &bake.scene().surfaces[part.surface];
        let far = surface.positions.iter().all(|p| p.x > 9.0);
        if far {
            assert_eq!(part.triangles.len(), surface.triangles.len());
        }
        lit += usize::from(!far && part.triangles.len() > surface.triangles.len());
    }
    assert!(lit > 3, "{lit}");
}

/// A table whose paint is two-sided, as exporters call everything, is written and lit like one whose paint is not.
#[test]
fn the_inside_of_a_solid_costs_nothing() {
    let of = |two_sided: bool| {
        let mut room = Meshes::default();
        let wall = room.paint(Paint::default());
        let wood = room.paint(Paint {
            albedo: [0.6, 0.4, 0.2],
            two_sided,
            ..Paint::default()
        });
        let (corners, outwards) = block([0.0; 3], [4.0, 3.0, 5.0]);
        let inwards: Vec<[u32; 3]> = outwards.iter().map(|&[a, b, c]| [a, c, b]).collect();
        room.mesh("walls", &corners, &inwards, wall);
        let (corners, outwards) = block([1.0, 0.0, 1.5], [2.0, 0.7, 3.0]);
        room.mesh("table", &corners, &outwards, wood);
        room.lamp(PointLamp {
            name: "lamp".into(),
            position: [2.5, 2.5, 2.0],
            candela: 100.0,
            color: [1.0; 3],
        });
        let scene = Scene::from_meshes(&room, &Options::default()).unwrap();
        let (bake, baked) = baked(scene, 2.0);
        let leaves = bake.tree().leaves().count();
        (leaves, baked.surfaces.len(), baked.irradiance)
    };
    assert!(of(true) == of(false));
}

/// Corners of a block and its faces outwards.
fn block(low: [f32; 3], high: [f32; 3]) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let corner = |k: usize| std::array::from_fn(|axis| [low, high][k >> axis & 1][axis]);
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    (
        (0..8).map(corner).collect(),
        quads.into_iter().flat_map(halves).collect(),
    )
}

/// A file, as a viewer reads it: triangles with position and tristimulus radiosity at the corners, by node mesh.
fn read_back(bytes: &[u8]) -> Vec<[(DVec3, DVec3); 3]> {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let bin = &bytes[20 + length + 8..];
    let view = |accessor: &Value| {
        let accessor = &json["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap_or(0) as usize;
        (accessor.clone(), &bin[start..])
    };
    let vectors = |accessor: &Value| -> Vec<DVec3> {
        let (accessor, bytes) = view(accessor);
        let count = accessor["count"].as_u64().unwrap() as usize;
        let float = |k: usize| f32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().unwrap());
        let all = 0..count;
        all.map(|v| DVec3::from_array([0, 1, 2].map(|i| f64::from(float(3 * v + i)))))
            .collect()
    };
    let mut triangles = Vec::new();
    for primitive in json["meshes"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|mesh| mesh["primitives"].as_array().unwrap())
    {
        let at = vectors(&primitive["attributes"]["POSITION"]);
        let light = vectors(&primitive["attributes"]["_XYZ"]);
        let (accessor, bytes) = view(&primitive["indices"]);
        let wide = accessor["componentType"] == 5125;
        let index = |k: usize| match wide {
            true => u32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().unwrap()) as usize,
            false => usize::from(u16::from_le_bytes(
                bytes[2 * k..2 * k + 2].try_into().unwrap(),
            )),
        };
        for t in 0..accessor["count"].as_u64().unwrap() as usize / 3 {
            triangles.push([0, 1, 2].map(|k| (at[index(3 * t + k)], light[index(3 * t + k)])));
        }
    }
    triangles
}

/// What the audit of a file compares is what somebody gets who reads the file and interpolates `_XYZ`.
#[test]
fn the_file_has_the_error_that_is_stated() {
    // A cube with a punctual light in its middle, painted grey.
    let (bake, baked) = baked(scene("cie171-5.8.glb"), 1.0);
    let interpolation = baked.interpolation.unwrap();
    assert!(
        interpolation.is_met() && interpolation.rms > 0.0,
        "{interpolation:?}"
    );
    // Between vertices there may be what light at points leaves, if no more than its own share of .8; of what light bends by .6.
    let asked = interpolation.allowed.hypot(estimate(&bake).min(0.8));
    assert!(
        (asked - 1.0).abs() < 1e-12 && (interpolation.may_bend - 0.6).abs() < 1e-12,
        "{interpolation:?}"
    );
    let reference = PathReference::new(&bake, 120, 4096, 3);
    let report = Report::of_file(&bake, &baked, &reference);
    let look = Exposure::auto(bake.scene(), &baked.surfaces);
    let writing = Writing {
        xyz: true,
        ..Writing::default()
    };
    let glb = baked_glb(bake.scene(), &baked.surfaces, &look, writing).unwrap();
    let triangles = read_back(&glb.bytes);
    let mut compared = 0;
    for seen in &report.seen {
        // The nearest triangle that faces the right way.
        let mut best = (f64::NEG_INFINITY, DVec3::ZERO);
        for [(a, la), (b, lb), (c, lc)] in &triangles {
            let n = (*b - *a).cross(*c - *a);
            let off = (seen.point - *a).dot(n.normalize_or_zero()).abs();
            if n.normalize_or_zero().dot(seen.normal) < 0.99 || off > 1e-5 {
                continue;
            }
            let weight = |p: DVec3, q: DVec3| (p - seen.point).cross(q - seen.point).dot(n);
            let w =
                [weight(*b, *c), weight(*c, *a), weight(*a, *b)].map(|w| w / n.length_squared());
            let least = w.into_iter().fold(f64::INFINITY, f64::min);
            if least > best.0 {
                best = (least, *la * w[0] + *lb * w[1] + *lc * w[2]);
            }
        }
        // Paint of .5: radiosity is half the irradiance.
        for c in 0..3 {
            let (file, stated) = (2.0 * best.1[c], seen.baked[c]);
            let scale = bake.light().white[1];
            assert!(
                (file - stated).abs() < 2e-3 * scale,
                "{file} {stated} at {}",
                seen.point
            );
        }
        compared += 1;
    }
    assert!(compared > 60, "{compared}");
}

/// Lines between vertices on the light itself would lie below it, and the room that is drawn would take in 1.3 % less than its lamps send:
/// in a closed room both are the same.
#[test]
fn what_is_drawn_takes_in_what_lamps_send() {
    for name in ["convex.glb", "two-rooms.glb"] {
        let (bake, baked) = baked(scene(name), 1.0);
        let sent = bake.rounds().last().unwrap().flux.sent.lamps_lm;
        // What leaves, with what area lamps emit, less what arrives.
        let mut missing = 0.0;
        for part in &baked.surfaces {
            let surface = &bake.scene().surfaces[part.surface];
            for t in &part.triangles {
                let [a, b, c] = t.map(|v| position(surface, &part.vertices[v as usize]));
                let net = |&v: &u32| {
                    let vertex = &part.vertices[v as usize];
                    f64::from(vertex.radiosity[1]) - f64::from(vertex.irradiance[1])
                };
                let area = 0.5 * (b - a).cross(c - a).length();
                missing += area / 3.0 * t.iter().map(net).sum::<f64>();
            }
        }
        let share = missing / sent;
        assert!(share.abs() < 0.007, "{name}: {share}");
    }
}
