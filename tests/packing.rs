//! Smaller files: what is left out, quantised numbers, packed streams, budgets.

use crate::output_room;

use glam::DVec3;
use haarlight::output::{BakedGlb, Exposure, Packing, Writing, baked_glb, vertices_within};
use haarlight::scene::{Options, Scene, Sides};
use output_room::{back, refined as refine, room};

fn written(writing: Writing) -> BakedGlb {
    let scene = room();
    baked_glb(&scene, &refine(&scene, 3), &Exposure::new(1e-3), writing).unwrap()
}

fn packed(packing: Packing) -> Writing {
    Writing {
        packing,
        ..Writing::default()
    }
}

fn load(glb: &BakedGlb) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.glb");
    std::fs::write(&path, &glb.bytes).unwrap();
    Scene::load(path, &Options::default()).unwrap()
}

fn json(glb: &BakedGlb) -> serde_json::Value {
    serde_json::from_slice(&gltf::Glb::from_slice(&glb.bytes).unwrap().json).unwrap()
}

#[test]
fn the_unclipped_light_is_written_only_if_it_is_asked_for() {
    let has = |writing| json(&written(writing)).to_string().contains("\"_XYZ\":");
    assert!(!has(Writing::default()));
    assert!(has(Writing {
        xyz: true,
        ..Writing::default()
    }));
}

/// Triangles by their corners, in an order that does not depend on that in the file.
fn triangles(scene: &Scene) -> Vec<Vec<[u32; 3]>> {
    let sorted = |s: &haarlight::scene::Surface| {
        let least =
            |&[a, b, c]: &[u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
        let mut all: Vec<[u32; 3]> = s.triangles.iter().map(least).collect();
        all.sort_unstable();
        all
    };
    scene.surfaces.iter().map(sorted).collect()
}

fn read_alike(packing: Packing) {
    let plain = load(&written(Writing::default()));
    let glb = written(packed(packing));
    assert_eq!(glb.bytes, written(packed(packing)).bytes);
    assert!(
        json(&glb)["extensionsRequired"]
            .as_array()
            .unwrap()
            .contains(&"KHR_mesh_quantization".into())
    );
    let small = load(&glb);
    assert_eq!(triangles(&plain), triangles(&small));
    for (a, b) in plain.surfaces.iter().zip(&small.surfaces) {
        let size = a
            .positions
            .iter()
            .fold(0.0, |s: f64, p| s.max(p.distance(a.positions[0])));
        for (p, q) in a.positions.iter().zip(&b.positions) {
            // Half a step of the mesh's grid in each direction.
            assert!(p.distance(*q) < size / 30_000.0, "{p} {q}");
        }
        let normals = |s: &haarlight::scene::Surface| s.normals.clone().unwrap_or_default();
        for (m, n) in normals(a).iter().zip(normals(b)) {
            assert!(m.distance(n) < 0.01, "{m} {n}");
        }
        let colors = |s: &haarlight::scene::Surface| s.colors.clone().unwrap();
        for (c, d) in colors(a).iter().flatten().zip(colors(b).iter().flatten()) {
            assert!((c - d).abs() < 1e-5, "{c} {d}");
        }
        for (s, t) in a
            .texcoords
            .iter()
            .flatten()
            .zip(b.texcoords.iter().flatten())
        {
            assert!(
                (s[0] - t[0]).abs() + (s[1] - t[1]).abs() < 1e-4,
                "{s:?} {t:?}"
            );
        }
    }
}

#[test]
fn quantised_numbers_read_alike() {
    read_alike(Packing::Quantized);
}

#[cfg(feature = "meshopt")]
#[test]
fn packed_streams_read_alike() {
    read_alike(Packing::Meshopt);
}

/// Backs lie a little behind their fronts, by an amount that single precision tells from nothing.
#[test]
fn backs_do_not_coincide_with_fronts() {
    let mut scene = room();
    scene.source.json["materials"][0]["doubleSided"] = true.into();
    scene.materials[0].sides = Sides::Both;
    let mut surfaces = refine(&scene, 3);
    let under = back(&surfaces[0], 1.0);
    surfaces.push(under.clone());
    let glb = baked_glb(&scene, &surfaces, &Exposure::new(1e-3), Writing::default()).unwrap();
    let read = load(&glb);
    let sheets: Vec<_> = read
        .surfaces
        .iter()
        .filter(|s| s.name.contains("left"))
        .collect();
    let (front, back) = (&sheets[0], &sheets[1]);
    let all = || read.surfaces.iter().flat_map(|s| &s.positions);
    let low = all().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let high = all().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    let diagonal = low.distance(high);
    assert_eq!(front.positions.len(), back.positions.len());
    for (p, q) in front.positions.iter().zip(&back.positions) {
        let apart = p.y - q.y;
        assert!(
            apart > 5e-6 * diagonal && apart < 1e-4 * diagonal,
            "{p} {q}"
        );
    }
}

#[test]
fn a_budget_of_bytes_is_one_of_vertices() {
    let scene = room();
    for writing in [Writing::default(), packed(Packing::Quantized)] {
        let least = vertices_within(&scene, 0, writing).unwrap();
        let more = vertices_within(&scene, 1_000_000, writing).unwrap();
        assert_eq!(
            least,
            scene
                .surfaces
                .iter()
                .map(|s| s.positions.len())
                .sum::<usize>()
        );
        // A mesh of about as many vertices takes about as many bytes, and not more.
        let per_sheet = more / scene.surfaces.len();
        let n = (per_sheet as f64).sqrt() as u32 - 1;
        let glb = baked_glb(&scene, &refine(&scene, n), &Exposure::new(1e-3), writing).unwrap();
        let share = glb.bytes.len() as f64 / 1e6 * more as f64 / glb.vertices as f64;
        assert!((0.6..1.0).contains(&share), "{writing:?}: {share}");
    }
}
