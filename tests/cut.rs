//! Triangles cut where others meet them: nothing is lost, no crack opens, and input attributes stay where they were.

use crate::common::built;

use built::Room;
use glam::{DVec3, dvec3};
use haarlight::audit::Report;
use haarlight::geometry::RayIndex;
use haarlight::hierarchy::{Mesh, cuts};
use haarlight::scene::Scene;
use haarlight::solve::{Bake, Settings};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::collections::HashMap;

fn index(mesh: &Mesh) -> RayIndex {
    let positions: Vec<glam::Vec3> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
    RayIndex::build(&positions, &mesh.triangles, &mesh.plane, &[])
}

/// A box of 4 x 3 x 5 with sheets through it.
fn with_sheets(sheets: &[(DVec3, DVec3, DVec3)]) -> Scene {
    let mut room = Room::new();
    let (wall, sheet) = (room.paint(0.5), room.paint(0.5));
    room.two_sided(sheet);
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 5.0), [wall; 6]);
    for &(corner, u, v) in sheets {
        room.quad(corner, u, v, sheet);
    }
    room.scene()
}

/// Every edge of the triangles of the first surfaces has its counterpart.
fn closed(mesh: &Mesh, surfaces: u32) {
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for (t, origin) in mesh.triangles.iter().zip(&mesh.origin) {
        if origin.0 < surfaces {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                assert_ne!(a, b);
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
    }
    assert!(
        edges.values().all(|&n| n == 0),
        "an edge without counterpart"
    );
}

fn sheets() -> impl Strategy<Value = Vec<(DVec3, DVec3, DVec3)>> {
    let point = || (-1.0..5.0_f64, -1.0..4.0_f64, -1.0..6.0_f64);
    let arm = || (-4.0..4.0_f64, -4.0..4.0_f64, -4.0..4.0_f64);
    let sheet = (point(), arm(), arm())
        .prop_map(|(p, u, v)| [p, u, v].map(|(x, y, z)| dvec3(x, y, z)))
        .prop_filter("no area", |[_, u, v]| u.cross(*v).length() > 0.1)
        .prop_map(|[p, u, v]| (p, u, v));
    proptest::collection::vec(sheet, 1..8)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, rng_seed: RngSeed::Fixed(4), ..ProptestConfig::default() })]

    #[test]
    fn cuts_lose_nothing_and_leave_no_crack(sheets in sheets()) {
        let scene = with_sheets(&sheets);
        let whole = Mesh::new(&scene);
        let cuts = cuts(&whole, &index(&whole));
        let mesh = Mesh::new(&scene).cut(&cuts);
        closed(&mesh, 6);
        let mut area: HashMap<(u32, u32), f64> = HashMap::new();
        for (origin, a) in mesh.origin.iter().zip(&mesh.area) {
            *area.entry(*origin).or_default() += a;
        }
        for (origin, a) in whole.origin.iter().zip(&whole.area) {
            prop_assert!((area[origin] / a - 1.0).abs() < 1e-5, "{origin:?}: {} of {a}", area[origin]);
        }
        for (t, corners) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
            prop_assert!((b - a).cross(c - a).dot(mesh.normal[t]) > 0.0, "turned over");
            // Weights name the place on the input.
            let input = &scene.surfaces[mesh.origin[t].0 as usize];
            let on = input.triangles[mesh.origin[t].1 as usize].map(|v| input.positions[v as usize]);
            for k in 0..3 {
                let mut unit = [0.0; 3];
                unit[k] = 1.0;
                let w = mesh.on_origin(t, unit);
                let at = on[0] * w[0] + on[1] * w[1] + on[2] * w[2];
                prop_assert!(at.distance([a, b, c][k] + mesh.centre) < 1e-9);
            }
        }
        // Nothing large crosses the inside of a part any more.
        for cut in haarlight::hierarchy::cuts(&mesh, &index(&mesh)) {
            for [p, q] in cut.lines(&mesh) {
                prop_assert!(p.distance(q) < 0.1 * mesh.half_size, "{p} {q} not cut");
            }
        }
    }
}

/// A slanted sheet parts a room; the baked mesh has no crack along it, and both sides keep their own light.
#[test]
fn the_baked_mesh_fits_along_a_cut() {
    let mut room = Room::new();
    let (wall, lamp, sheet) = (room.paint(0.5), room.lamp(0.5, 1000.0), room.paint(0.5));
    room.two_sided(sheet);
    room.hollow(
        DVec3::ZERO,
        dvec3(4.0, 3.0, 5.0),
        [lamp, wall, wall, wall, wall, wall],
    );
    room.quad(
        dvec3(1.3, 0.0, 0.0),
        3.0 * DVec3::Y,
        dvec3(1.1, 0.0, 5.0),
        sheet,
    );
    let mut bake = Bake::new(room.scene(), Settings::default());
    bake.run();
    closed(bake.mesh(), 6);
    let baked = bake.baked(&|_, _| {});
    let mut edges: HashMap<[[u64; 3]; 2], i32> = HashMap::new();
    let (mut bright, mut dark) = (0, 0);
    for surface in baked.surfaces.iter().filter(|s| s.surface < 6) {
        let input = &bake.scene().surfaces[surface.surface];
        let at: Vec<DVec3> = surface
            .vertices
            .iter()
            .map(|v| {
                let corners = input.triangles[v.triangle as usize];
                (0..3)
                    .map(|k| input.positions[corners[k] as usize] * v.weights[k])
                    .sum()
            })
            .collect();
        for t in &surface.triangles {
            for k in 0..3 {
                let ends = [t[k], t[(k + 1) % 3]]
                    .map(|v| (at[v as usize] + DVec3::ZERO).to_array().map(f64::to_bits));
                let turned = ends[0] > ends[1];
                let key = if turned { [ends[1], ends[0]] } else { ends };
                *edges.entry(key).or_default() += if turned { -1 } else { 1 };
            }
        }
        for (v, p) in surface.vertices.iter().zip(&at) {
            let border = 1.3 + 1.1 * p.z / 5.0;
            if p.x > border + 1e-6 {
                assert_eq!(v.irradiance, [0.0; 3], "light behind the sheet at {p}");
                dark += 1;
            } else if p.x < border - 1e-6 {
                assert!(v.irradiance[1] > 0.0, "no light before the sheet at {p}");
                bright += 1;
            }
        }
    }
    assert!(bright > 20 && dark > 10, "{bright} {dark}");
    assert!(edges.values().all(|&n| n == 0), "cracks");
}

/// The spaces of a room, its cuts and its light do not depend on the number of threads.
#[test]
fn cuts_are_the_same_at_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut room = Room::new();
            let (wall, lamp) = (room.paint(0.5), room.lamp(0.5, 1000.0));
            room.two_sided(wall);
            room.hollow(
                DVec3::ZERO,
                dvec3(4.0, 3.0, 5.0),
                [lamp, wall, wall, wall, wall, wall],
            );
            let slant = dvec3(0.7, 0.0, 5.0);
            room.quad(dvec3(1.3, 0.0, 0.0), 3.0 * DVec3::Y, slant, wall);
            room.quad(dvec3(2.3, 0.0, 0.0), 3.0 * DVec3::Y, slant, wall);
            room.block(dvec3(3.0, -0.2, 1.0), dvec3(3.5, 1.0, 2.0), wall);
            let bake = built::baked_to(4.0, room.scene());
            let baked = bake.baked(&|_, _| {});
            let text = format!("{:?} {:?}", bake.mesh().triangles, baked.irradiance);
            (text, bake.tree().nodes.len())
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(8));
}

/// What stands on a floor cuts it, so that no patch lies in part below a block, whatever else is in the room; the foot of a table
/// is too small for that.
#[test]
fn what_stands_on_a_floor_cuts_it_if_it_is_large() {
    for (width, cut) in [(1.0, true), (0.05, false)] {
        for others in [0, 150] {
            let mut room = Room::new();
            let (wall, lamp) = (room.paint(0.5), room.lamp(0.5, 1000.0));
            room.hollow(
                DVec3::ZERO,
                dvec3(4.0, 3.0, 5.0),
                [lamp, wall, wall, wall, wall, wall],
            );
            let low = dvec3(1.0, 0.0, 1.0);
            room.block(low, low + dvec3(width, 1.0, width), wall);
            for k in 0..others {
                let at = dvec3(
                    0.1 + 0.2 * f64::from(k % 15),
                    2.0,
                    0.1 + 0.4 * f64::from(k / 15),
                );
                room.quad(at, 0.1 * DVec3::X, 0.1 * DVec3::Z, wall);
            }
            let scene = room.scene();
            let whole = Mesh::new(&scene);
            let bake = Bake::new(scene, Settings::default());
            assert_eq!(bake.mesh().triangles != whole.triangles, cut);
        }
    }
}

/// A lamp below a ceiling, so near that it is all but on it: most of what it sends up stays in the gap. Without a cut along the
/// lamp's outline, patches of the ceiling that lie in the gap and beside it show the gap's light to the room, 2 to 8 %.
#[test]
fn a_lamp_right_below_a_ceiling_does_not_light_the_room_by_its_gap() {
    for gap in [0.002, 0.02] {
        let mut room = Room::new();
        let (wall, lamp) = (room.paint(0.7), room.lamp(0.8, 1000.0));
        room.hollow(DVec3::ZERO, dvec3(4.0, 2.7, 5.0), [wall; 6]);
        let low = dvec3(1.6, 2.67 - gap, 2.1);
        room.block(low, low + dvec3(0.8, 0.03, 0.8), lamp);
        let scene = room.scene();
        let whole = Mesh::new(&scene);
        let cuts = cuts(&whole, &index(&whole));
        assert_eq!(cuts.len(), 2, "the ceiling's triangles");
        let mut bake = Bake::new(scene, Settings::default());
        bake.run();
        let bias = Report::new(&bake, 100, 8192, 1).bias;
        assert!(bias.value.abs() < 0.02, "{gap}: {bias:?}");
    }
}

/// A rug of many triangles hovers before a floor that a wall stands on: too many outlines to cut along, but the wall still cuts.
#[test]
fn what_hovers_takes_no_cut_away() {
    let mut room = Room::new();
    let (wall, sheet, rug) = (room.paint(0.5), room.paint(0.5), room.paint(0.5));
    room.two_sided(sheet);
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 5.0), [wall; 6]);
    room.quad(DVec3::X, dvec3(0.0, 0.0, 5.0), dvec3(0.0, 3.0, 0.0), sheet);
    for k in 0..100 {
        let at = dvec3(
            2.0 + 0.1 * f64::from(k % 10),
            0.005,
            1.0 + 0.1 * f64::from(k / 10),
        );
        room.quad(at, dvec3(0.0, 0.0, 0.1), dvec3(0.1, 0.0, 0.0), rug);
    }
    let scene = room.scene();
    let whole = Mesh::new(&scene);
    let cuts = cuts(&whole, &index(&whole));
    assert!(cuts.len() >= 4);
    assert!(whole.cut(&cuts).triangles.len() < 2_000);
}
