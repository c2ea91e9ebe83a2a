//! A round that is given up leaves the bake as it was, wherever it is given up, and asking changes nothing.

use crate::common::built::sphere;
use crate::common::every_effect::small;

use glam::{DMat4, dvec3};
use haarlight::output::{Exposure, Writing, baked_glb};
use haarlight::scene::effects::EffectKind;
use haarlight::scene::{Options, Scene, Surface};
use haarlight::solve::{Bake, Settings};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

fn room(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    Scene::load(path, &Options::default()).unwrap()
}

/// Coarse: what is asked for has no part in what is left.
fn settings() -> Settings {
    Settings {
        error: 4.0,
        ..Settings::default()
    }
}

fn bake(scene: &Scene) -> Bake {
    Bake::new(scene.clone(), settings())
}

/// The records without their times, the light of every patch to the last bit, and what the hierarchy has become.
fn state(bake: &Bake) -> (Vec<String>, Vec<u8>, usize) {
    let records = bake.rounds().iter().map(|round| {
        let mut record = serde_json::to_value(round).unwrap();
        let fields = record.as_object_mut().unwrap();
        fields.retain(|key, _| !key.ends_with("_s"));
        record.to_string()
    });
    let light = bake.light();
    let mut bytes = Vec::new();
    for rows in [&light.reflected, &light.emitted, &light.irradiance] {
        let all = (0..rows.len()).flat_map(|k| rows.row(k));
        bytes.extend(all.flat_map(|x| x.to_le_bytes()));
    }
    (records.collect(), bytes, bake.tree().nodes.len())
}

/// The file, as a sketch of it.
fn file(bake: &Bake) -> Vec<u8> {
    let scene = bake.scene();
    let all: Vec<Vec<bool>> = (scene.surfaces.iter())
        .map(|s| vec![true; s.triangles.len()])
        .collect();
    let baked = bake.sketch(&all, &|_, _| {});
    let look = Exposure::auto(scene, &baked.surfaces);
    baked_glb(scene, &baked.surfaces, &look, Writing::default())
        .unwrap()
        .bytes
}

/// Steps until the bake was asked `after` times; was the round done, and how often was it asked?
fn step(bake: &mut Bake, after: usize) -> (bool, usize) {
    let asked = Arc::new(AtomicUsize::new(0));
    let count = asked.clone();
    let done = bake.step_unless(Arc::new(move || {
        count.fetch_add(1, Ordering::Relaxed) >= after
    }));
    (done.is_some(), asked.load(Ordering::Relaxed))
}

/// Wherever the round after `before` others is given up, what is left is the bake of one round fewer, to the last bit; and it can go on
/// from there.
fn given_up(name: &str, scene: &Scene, before: usize, least: usize) {
    let mut whole = bake(scene);
    for _ in 0..before {
        whole.step();
    }
    let (left, written) = (state(&whole), file(&whole));
    // This one is asked, and the one that goes on below is not.
    let (done, times) = step(&mut whole, usize::MAX);
    assert!(done && times >= least, "{name}: asked {times} times only");
    println!(
        "{name}: asked {times} times, {} patches",
        whole.tree().nodes.len()
    );
    let after = state(&whole);

    let mut other = bake(scene);
    other.keep();
    // Of a first round that is given up nothing is left but the light that rays from the lamps and to the sky tell.
    assert!(!step(&mut other, 0).0 && other.rounds().is_empty());
    let brightness = other.mean_irradiance()[1] / whole.mean_irradiance()[1];
    assert!((0.5..2.0).contains(&brightness), "{name}: {brightness}");
    assert!(file(&other).len() > 1000, "{name}: no file");
    assert!(!other.keeps());
    assert!(step(&mut other, usize::MAX).0);
    for _ in 1..before {
        assert!(step(&mut other, usize::MAX).0);
    }
    assert!(state(&other) == left, "{name}: asking changes a round");
    for after in [0, 1, times / 4, times / 2, 3 * times / 4, times - 1] {
        assert!(
            !step(&mut other, after).0,
            "{name}: not after {after} of {times}"
        );
        assert!(other.taken_back_s().is_some_and(|s| s >= 0.0));
        assert!(state(&other) == left, "{name}: after {after} of {times}");
    }
    assert!(file(&other) == written, "{name}: another file");
    other.step();
    assert!(other.taken_back_s().is_none());
    assert!(state(&other) == after, "{name}: goes on to something else");
}

/// The Cornell box with a ball of so many triangles in it that rays carry its light.
fn crowded() -> Scene {
    let mut scene = room("cornell.glb");
    let (positions, triangles) = sphere(dvec3(0.28, 0.35, 0.28), 0.05, 2);
    let ball = Surface {
        name: "ball".into(),
        node: scene.surfaces.len(),
        to_world: DMat4::IDENTITY,
        positions,
        normals: None,
        texcoords: Vec::new(),
        colors: None,
        triangles,
        ..scene.surfaces[0].clone()
    };
    scene.surfaces.push(ball);
    scene
}

#[test]
fn by_links() {
    given_up("cornell-f2", &room("cornell-f2.glb"), 2, 100);
}

#[test]
fn by_rays() {
    let scene = crowded();
    let mut once = bake(&scene);
    assert!(once.step().row_bytes > 0, "light goes along links");
    given_up("crowded", &scene, 2, 300);
}

/// Each effect by itself.
#[test]
fn whatever_the_effects() {
    use EffectKind::{Fluorescence, Mirrors, Panes, Sheets};
    let each = [
        ("panes", &[Panes][..]),
        ("mirrors", &[Mirrors]),
        ("sheets", &[Sheets]),
        ("fluorescence", &[Fluorescence]),
    ];
    for (name, kinds) in each {
        given_up(name, &small(kinds), 1, 100);
    }
}

/// Prepares a room until it was asked `after` times; and how often was it asked?
fn prepared(scene: &Scene, after: usize) -> (Option<Bake>, usize) {
    let asked = Arc::new(AtomicUsize::new(0));
    let count = asked.clone();
    let stop = move || count.fetch_add(1, Ordering::Relaxed) >= after;
    let bake = Bake::new_unless(scene.clone(), settings(), Arc::new(stop));
    (bake, asked.load(Ordering::Relaxed))
}

/// The preparing of a room can be given up from its first step to the last lamp, also while openings to a sky are looked for behind panes.
/// Asking changes nothing.
#[test]
fn preparing() {
    for (name, scene, least) in [
        ("furnished", room("furnished.glb"), 12),
        ("panes", small(&[EffectKind::Sky, EffectKind::Panes]), 1000),
    ] {
        let (whole, times) = prepared(&scene, usize::MAX);
        assert!(times >= least, "{name}: asked {times} times only");
        for after in (0..8).chain([times / 4, times / 2, times - 1]) {
            let (bake, _) = prepared(&scene, after);
            assert!(bake.is_none(), "{name}: not after {after} of {times}");
        }
        let (mut whole, mut plain) = (whole.unwrap(), bake(&scene));
        assert!(step(&mut whole, usize::MAX).0);
        plain.step();
        assert!(state(&whole) == state(&plain), "{name}: asking changes it");
    }
}
