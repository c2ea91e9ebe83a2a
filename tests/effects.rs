//! Only the effects that a scene calls for are paid for: shown by counters, never by time.

use crate::common::built;
use crate::common::every_effect::{self, EFFECTS};

use built::{Room, sun};
use glam::{DVec3, dvec3};
use haarlight::audit::{PathReference, Report};
use haarlight::scene::effects::{EffectKind, Plan};
use haarlight::scene::profile::Profile;
use haarlight::scene::sky::{SkyType, SkyWish};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Representation, Settings};
use haarlight::spectrum::BANDS;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, LazyLock};

fn room(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    Scene::load(path, &Options::default()).unwrap()
}

fn baked(scene: Scene, representation: Representation) -> Bake {
    let mut bake = Bake::new(
        scene,
        Settings {
            error: 1.0,
            representation,
            rounds: 3,
            ..Settings::default()
        },
    );
    bake.run();
    bake
}

/// Rooms that several tests look at.
static BAKED: LazyLock<BTreeMap<&str, Bake>> = LazyLock::new(|| {
    let names = [
        "cornell.glb",
        "two-rooms.glb",
        "cie171-5.4.glb",
        "cie171-5.8.glb",
    ];
    let all = names.map(|name| (name, baked(room(name), Representation::Adaptive)));
    all.into()
});

/// So many rounds that ask for little.
fn stepped(scene: Scene, rounds: usize) -> Bake {
    let settings = Settings {
        error: 4.0,
        ..Settings::default()
    };
    let mut bake = Bake::new(scene, settings);
    for _ in 0..rounds {
        bake.step();
    }
    bake
}

/// Points in the air and on walls of a room around the middle.
fn points(bake: &Bake) -> Vec<(DVec3, DVec3)> {
    let mesh = bake.mesh();
    let on_walls = mesh.triangles.iter().zip(&mesh.normal).map(|(t, n)| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        (mesh.centre + 0.5 * a + 0.3 * b + 0.2 * c, *n)
    });
    let in_the_air = [DVec3::X, DVec3::Y, DVec3::NEG_Z].map(|n| (mesh.centre + 0.1 * n, n));
    on_walls.chain(in_the_air).collect()
}

/// A grey room takes one band, and that band tells all 64.
///
/// Both solve the same system but from different first guesses; what is asked for is small enough that what the solver
/// leaves undone (a share of it) is below the rounding of f32 sums.
#[test]
fn a_grey_room_takes_one_band() {
    let solve = |scene: Scene, representation| {
        let mut bake = Bake::new(
            scene,
            Settings {
                error: 1e-3,
                representation,
                rounds: 2,
                ..Settings::default()
            },
        );
        bake.run();
        bake
    };
    // The Cornell box under F2, its walls painted grey: shadows, and a lamp of lines.
    let grey_box = || {
        let mut scene = room("cornell-f2.glb");
        for (k, material) in scene.materials.iter_mut().enumerate() {
            material.reflectance = [0.2 + 0.15 * k as f64; 64];
        }
        scene
    };
    let rooms: [(&str, &dyn Fn() -> Scene); 3] = [
        ("furnace", &|| room("furnace.glb")),
        ("cube", &|| room("cie171-5.8.glb")),
        ("grey box", &grey_box),
    ];
    for (name, scene) in rooms {
        assert!(!Plan::of(&scene()).runs(EffectKind::Colour), "{name}");
        let one = solve(scene(), Representation::Adaptive);
        let all = solve(scene(), Representation::Dense);
        for round in one.rounds() {
            assert_eq!(round.intervals_working, 1, "{name}");
        }
        assert_eq!(all.rounds().last().unwrap().intervals_working, 64);
        let points = points(&one);
        for (k, (a, b)) in one
            .probe(&points)
            .iter()
            .zip(all.probe(&points))
            .enumerate()
        {
            for (a, b) in a
                .xyz
                .iter()
                .chain(&a.spectrum)
                .zip(b.xyz.iter().chain(&b.spectrum))
            {
                // Rows are f32 (6e-8); sums run over some hundred terms, iterations over some ten.
                assert!(
                    (a - b).abs() <= 1e-5 * b.abs(),
                    "{name}, point {k}: {a} {b}"
                );
            }
        }
    }
}

/// Colour costs more than one band: the counter of the test above does count.
#[test]
fn a_coloured_room_takes_more() {
    let bake = &BAKED["cornell.glb"];
    assert!(bake.plan().runs(EffectKind::Colour));
    assert!(bake.rounds().iter().all(|r| r.intervals_working > 1));
}

/// Nothing can block in a convex empty room: no visibility ray for links, direct light, gather or probes.
#[test]
fn a_convex_room_casts_no_ray() {
    let [convex, furnace] =
        ["convex.glb", "furnace.glb"].map(|name| baked(room(name), Representation::Adaptive));
    for (name, bake) in [
        ("convex", &convex),
        ("furnace", &furnace),
        ("5.4", &BAKED["cie171-5.4.glb"]),
        ("5.8", &BAKED["cie171-5.8.glb"]),
    ] {
        assert!(!bake.plan().runs(EffectKind::Occlusion), "{name}");
        assert_eq!(
            bake.rounds().iter().map(|r| r.rays).sum::<u64>(),
            0,
            "{name}"
        );
        assert_eq!(bake.baked(&|_, _| {}).rays, 0, "{name}");
    }
    let bake = &BAKED["two-rooms.glb"];
    assert!(bake.rounds().iter().all(|r| r.rays > 0));
    assert!(built::baked_within(2000, bake).rays > 0);
}

/// Black walls pass nothing on: nothing is iterated.
#[test]
fn black_walls_take_no_iteration() {
    let [lamp, floor, wall] = ["cie171-5.3.glb", "cie171-5.6.glb", "cie171-5.7.glb"]
        .map(|name| baked(room(name), Representation::Adaptive));
    for (name, bake) in [
        ("5.3", &lamp),
        ("5.4", &BAKED["cie171-5.4.glb"]),
        ("5.6", &floor),
        ("5.7", &wall),
    ] {
        assert!(!bake.plan().runs(EffectKind::Interreflection), "{name}");
        for round in bake.rounds() {
            assert_eq!(round.iterations, 0, "{name}");
            assert!(round.flux.absorbed_lm > 0.0, "{name} is lit");
        }
    }
    let bake = &BAKED["cie171-5.8.glb"];
    assert!(bake.rounds().iter().all(|r| r.iterations > 0));
}

/// Where no material has a texture there is no image, and so nothing that could be sampled.
#[test]
fn a_room_without_textures_has_none_to_sample() {
    for name in ["cornell.glb", "two-rooms.glb", "convex.glb"] {
        let scene = room(name);
        assert!(
            !Plan::of(&scene).runs(EffectKind::Textures) && scene.images.is_empty(),
            "{name}"
        );
        let textured = scene
            .materials
            .iter()
            .any(|m| m.paint.is_some() || m.emission.as_ref().is_some_and(|e| e.texture.is_some()));
        assert!(!textured, "{name}");
    }
    let scene = room("furnished.glb");
    assert!(Plan::of(&scene).runs(EffectKind::Textures) && !scene.images.is_empty());
}

/// One light spectrum keeps one cut of one tree; two keep two.
#[test]
fn one_light_spectrum_keeps_one_tree() {
    let lights = |name: &str| {
        let bake = &BAKED[name];
        let mut lights: Vec<_> = bake.lanes().lanes().iter().map(|l| l.light).collect();
        // Each light's intervals stand together and tile the 64 bands once.
        for light in bake.lanes().lanes().chunk_by(|a, b| a.light == b.light) {
            assert_eq!(light.iter().map(|l| l.count).sum::<usize>(), 64, "{name}");
        }
        lights.dedup();
        (lights, bake.plan().runs(EffectKind::LightSpectra))
    };
    assert_eq!(lights("cornell.glb"), (vec![Some(0)], false));
    assert_eq!(lights("two-rooms.glb"), (vec![Some(0), Some(1)], true));
}

/// A pane, a sheet, a mirror and a lamp with a profile on no surface, and sky and sun over a closed room: no ray of the light, no byte, no element
/// more, and the same light. (Fluorescence: `tests/fluorescence.rs`.) That it is closed takes as many rays in any room.
#[test]
fn effects_that_are_not_there_cost_nothing() {
    let counted = |more: &dyn Fn(&mut Room) -> Vec<EffectKind>, change: &dyn Fn(Scene) -> Scene| {
        let mut room = Room::new();
        let paint = room.paint(0.5);
        room.hollow(DVec3::ZERO, dvec3(3.0, 2.5, 3.0), [paint; 6]);
        room.block(dvec3(1.0, 0.2, 1.0), dvec3(1.5, 1.0, 1.4), paint);
        room.point(dvec3(0.6, 1.3, 1.4), 1000.0);
        let kinds = more(&mut room);
        let bake = stepped(change(room.scene()), 3);
        let plan = bake.plan();
        assert!(!kinds.iter().any(|kind| plan.runs(*kind)), "{plan}");
        let counters: Vec<_> = (bake.rounds().iter())
            .map(|r| {
                (
                    r.rays,
                    r.nodes,
                    r.links,
                    r.intervals_working,
                    r.memory_bytes,
                )
            })
            .collect();
        let written = bake.baked(&|_, _| {});
        let vertices = written.surfaces.into_iter().map(|s| s.vertices);
        let looked = bake.rounds().iter().map(|r| r.opening_rays).sum::<u64>();
        (
            (counters, written.rays, vertices.collect::<Vec<_>>()),
            looked,
        )
    };
    let half = [0.5; BANDS];
    let as_it_is = |scene: Scene| scene;
    let (plain, looked) = counted(&|_| vec![], &as_it_is);
    assert_eq!(looked, 0, "nobody looks for a sky that is not there");
    type Adds<'a> = &'a dyn Fn(&mut Room) -> EffectKind;
    let unused: [(&str, Adds); 3] = [
        ("pane", &|room| {
            room.pane(1.5, half);
            EffectKind::Panes
        }),
        ("sheet", &|room| {
            room.sheet(half, half, [0.4; BANDS]);
            EffectKind::Sheets
        }),
        ("mirror", &|room| {
            room.mirror(half);
            EffectKind::Mirrors
        }),
    ];
    for (name, more) in unused {
        let with = counted(&|room| vec![more(room)], &as_it_is);
        assert!(with == (plain.clone(), 0), "{name}");
    }
    let profiled = |mut scene: Scene| {
        let even = b"IESNA91\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 10\n0 180\n0\n9 9\n";
        let lamp = scene.materials.last_mut().and_then(|m| m.emission.as_mut());
        lamp.unwrap().profile = Some(Arc::new(Profile::parse(even).unwrap()));
        scene
    };
    let lamp = |room: &mut Room| {
        room.lamp(0.1, 100.0);
        vec![EffectKind::MeasuredLamps]
    };
    assert!(counted(&lamp, &profiled) == (plain.clone(), 0), "profile");
    let overcast = SkyWish {
        kind: Some(SkyType(1)),
        ..SkyWish::default()
    };
    let sunny = SkyWish {
        kind: Some(SkyType(12)),
        sun: sun([40.0, 120.0], 80_000.0),
        ..SkyWish::default()
    };
    for (wish, kinds) in [
        (&overcast, vec![EffectKind::Sky]),
        (&sunny, vec![EffectKind::Sky, EffectKind::Sun]),
    ] {
        let under = |scene: Scene| scene.under(wish).unwrap();
        let (with, looked) = counted(&|_| kinds.clone(), &under);
        println!("{kinds:?}: {looked} rays told that the room is closed");
        assert!(with == plain, "{kinds:?}");
        // As many in any closed room, and no more than a blink takes.
        assert!(looked > 0 && looked <= 1 << 20, "{looked}");
        let bake = stepped(under(room("cornell-closed.glb")), 2);
        let of = |round: usize| bake.rounds()[round].opening_rays;
        assert_eq!((of(0), of(1)), (looked, 0));
    }
    let under = |scene: Scene| scene.under(&overcast).unwrap();
    let plan = haarlight::solve::running(under(room("cornell-closed.glb"))).to_string();
    assert!(
        plan.contains("the room is closed: no ray leaves it"),
        "{plan}"
    );
}

/// The audit's paths follow all effects by their own rules, and each where others are.
#[test]
fn paths_agree_with_all_effects_at_once() {
    let bake = baked(every_effect::room(), Representation::Adaptive);
    let plan = bake.plan();
    for kind in EFFECTS {
        assert!(plan.runs(kind), "{plan}");
    }
    // A few bright paths make some references uncertain: each counts by how narrow its interval is.
    let (mut bias, mut weights) = (0.0, 0.0);
    for seed in 3..7 {
        let reference = PathReference::new(&bake, 150, 1 << 13, seed);
        let report = Report::against(&bake, &reference);
        println!(
            "dE00 {:?}, bias {:?}, noise {:.3}, estimate {:?}",
            report.de2000.mean, report.bias, report.noise_de2000, report.estimate_de2000
        );
        assert!(report.de2000.mean.value < 0.5, "{:?}", report.de2000);
        let [low, high] = [report.bias.low, report.bias.high];
        assert!(low < 5e-3 && high > -5e-3, "{:?}", report.bias);
        let weight = (high - low).powi(-2);
        bias += weight * report.bias.value;
        weights += weight;
    }
    bias /= weights;
    println!("bias of all: {bias}");
    assert!(bias.abs() < 2e-3, "{bias}");
}
