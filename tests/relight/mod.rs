//! Relighting: the same as a fresh bake within the errors that both state, without a ray; other shapes are refused.

mod glass;

use crate::common::built::estimate;
use crate::common::every_effect::small;
use crate::common::garbled;

use glam::DVec3;
use haarlight::color::de2000;
use haarlight::gather::{Baked, BakedVertex, MOSTLY};
use haarlight::geometry::{NO_PLANE, Segment};
use haarlight::keep::{Relighter, Relit};
use haarlight::mesh::Limits;
use haarlight::scene::effects::EffectKind;
use haarlight::scene::pane::PaneKind;
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Representation, Settings};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn room(name: &str) -> Scene {
    with(name, json!({}))
}

/// A room with what is said over its side file.
fn with(name: &str, said: Value) -> Scene {
    let mut options = Options::default();
    options.say(said);
    Scene::load(scenes().join(name), &options).unwrap()
}

fn settings(error: f64, rounds: usize) -> Settings {
    Settings {
        error,
        rounds,
        ..Settings::default()
    }
}

/// A cache of a bake, and the bake.
pub(crate) struct Cached {
    cache: Vec<u8>,
    pub(crate) bake: Bake,
    pub(crate) baked: Baked,
}

impl Cached {
    pub(crate) fn new(scene: Scene, settings: Settings) -> Self {
        Self::within(&Limits::default(), scene, settings)
    }

    /// With as many vertices as the limits allow.
    fn within(limits: &Limits, scene: Scene, settings: Settings) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cache");
        let mut bake = Bake::new(scene, settings);
        bake.keep();
        bake.run();
        let baked = bake.baked_within(limits, &|_, _| {});
        let size = bake.write_cache(&baked, &path, u64::MAX).unwrap();
        assert_eq!(size, std::fs::metadata(&path).unwrap().len());
        let cache = std::fs::read(&path).unwrap();
        Self { cache, bake, baked }
    }

    fn open(&self, scene: Scene) -> haarlight::Result<Relighter> {
        opened(&self.cache, scene)
    }

    pub(crate) fn relit(&self, scene: Scene) -> (Relighter, Relit) {
        let mut relighter = self.open(scene).unwrap();
        let relit = relighter.relight().unwrap();
        (relighter, relit)
    }
}

/// Opens the bytes of a cache for a room.
fn opened(cache: &[u8], scene: Scene) -> haarlight::Result<Relighter> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cache");
    std::fs::write(&path, cache).unwrap();
    Relighter::open(&path, scene)
}

/// Rooms that several tests change, each of them baked once.
static CORNELL: LazyLock<Cached> =
    LazyLock::new(|| Cached::new(room("cornell.glb"), settings(1.0, 9)));
static FURNISHED: LazyLock<Cached> =
    LazyLock::new(|| Cached::new(room("furnished.glb"), settings(3.0, 3)));
pub(crate) static GLAZED: LazyLock<Cached> =
    LazyLock::new(|| Cached::new(room("glazed.glb"), settings(4.0, 2)));
static MIRRORED: LazyLock<Cached> =
    LazyLock::new(|| Cached::new(room("mirrored.glb"), settings(4.0, 2)));

/// Tristimulus irradiance of all vertices.
pub(crate) fn irradiance(baked: &Baked) -> Vec<[f64; 3]> {
    let vertices = baked.surfaces.iter().flat_map(|s| &s.vertices);
    vertices.map(|v| v.irradiance.map(f64::from)).collect()
}

/// Mean colour difference by area, as errors are stated, of `relit` and what a fresh bake gathers at every `step`-th vertex.
fn difference(fresh: &Bake, relit: &Baked, step: usize) -> f64 {
    let white = fresh.light().white;
    let (mut points, mut seen, mut areas) = (Vec::new(), Vec::new(), Vec::new());
    for surface in &relit.surfaces {
        let input = &fresh.scene().surfaces[surface.surface];
        // Shading normals are the file's: probes know flat faces.
        if surface.back || input.normals.is_some() {
            continue;
        }
        let at = |vertex: &BakedVertex, inset: f64| -> DVec3 {
            let corners = input.triangles[vertex.triangle as usize];
            let corners = corners.map(|v| input.positions[v as usize]);
            let inner = vertex.weights.map(|w| w * (1.0 - inset) + inset / 3.0);
            (0..3).map(|k| corners[k] * inner[k]).sum()
        };
        let mut around = vec![0.0; surface.vertices.len()];
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|v| at(&surface.vertices[v as usize], 0.0));
            for &v in triangle {
                around[v as usize] += (b - a).cross(c - a).length() / 6.0;
            }
        }
        for (vertex, area) in surface.vertices.iter().zip(around).step_by(step) {
            // As far inside as the gather goes.
            let [a, b, c] =
                input.triangles[vertex.triangle as usize].map(|v| input.positions[v as usize]);
            let normal = (b - a).cross(c - a).normalize();
            // Where something lies right upon it, a vertex takes its neighbours' light, whatever gets through the slit.
            let (mesh, point) = (fresh.mesh(), at(vertex, 2e-3));
            let from = point - mesh.centre;
            let of = (surface.surface as u32, vertex.triangle);
            let plane = mesh.origin.iter().position(|&o| o == of);
            let plane = plane.map_or(NO_PLANE, |t| mesh.plane[t]);
            let above = from + 2e-3 * mesh.half_size * normal;
            if (fresh.rays()).occluded(&Segment::new(from, above, [plane, NO_PLANE])) {
                continue;
            }
            points.push((point, normal));
            seen.push(vertex.irradiance.map(f64::from));
            areas.push(area);
        }
    }
    assert!(points.len() > 100, "{}", points.len());
    let fresh = fresh.probe(&points);
    let (mut sum, mut total) = (0.0, 0.0);
    for ((a, b), area) in fresh.iter().zip(&seen).zip(&areas) {
        // Below something that stands on it, a vertex takes its neighbours' light, and a probe finds none.
        if a.xyz[1] > 1e-3 * white[1] && a.backs <= MOSTLY {
            sum += area * de2000(a.xyz, *b, white);
            total += area;
        }
    }
    sum / total
}

/// How far relit light is from that of a fresh bake, and what both state of themselves. Vertices stand off their own light, so that lines between them are right in the
/// mean: by as much as without a change.
fn measured_and_stated(cached: &Cached, relit: &Relit, fresh: &Bake) -> [f64; 2] {
    let stated = relit.record.error_de2000.value.unwrap();
    let same = difference(&cached.bake, &cached.baked, 1);
    let measured = difference(fresh, &relit.baked, 1);
    [measured, stated.hypot(estimate(fresh)).hypot(same)]
}

/// Nothing changed: the bake to rounding, on the same mesh. There is no ray index, so a ray would see everything.
#[test]
fn without_a_change_the_bake_comes_out() {
    let closed = Cached::new(room("cornell-closed.glb"), settings(2.0, 9));
    for (name, cached) in [
        ("cornell.glb", &*CORNELL),
        ("cornell-closed.glb", &closed),
        ("two-rooms.glb", &SMALL[0]),
        ("furnished.glb", &*FURNISHED),
        ("glazed.glb", &GLAZED),
        ("mirrored.glb", &MIRRORED),
    ] {
        let (relighter, relit) = cached.relit(room(name));
        assert!(!relit.record.changed);
        assert_eq!(relighter.lanes().lanes(), cached.bake.lanes().lanes());
        assert_eq!(relit.baked.surfaces.len(), cached.baked.surfaces.len());
        for (a, b) in relit.baked.surfaces.iter().zip(&cached.baked.surfaces) {
            assert_eq!(a.triangles, b.triangles);
            assert_eq!((a.surface, a.back), (b.surface, b.back));
            for (a, b) in a.vertices.iter().zip(&b.vertices) {
                assert_eq!((a.triangle, a.weights), (b.triangle, b.weights));
                for (a, b) in [(a.irradiance, b.irradiance), (a.radiosity, b.radiosity)] {
                    for c in 0..3 {
                        let gap = (a[c] - b[c]).abs();
                        assert!(gap <= 2e-5 * b[1].max(1e-3), "{name}: {a:?} {b:?}");
                    }
                }
            }
        }
        assert_eq!(relit.baked.covered, cached.baked.covered);
        let difference = relit.record.error_de2000.value.unwrap() / estimate(&cached.bake);
        assert!((difference - 1.0).abs() < 0.05, "{difference}");
    }
}

/// Other lamps and other paints: what a fresh bake finds, within what both say that they may err.
#[test]
fn other_lamps_and_paints_give_what_a_fresh_bake_gives() {
    // Under a lamp with lines, and one wall in the complementary colour.
    let changed = || {
        let mut scene = room("cornell.glb");
        let lamp = room("cornell-f2.glb").spectra[0].clone();
        scene.spectra[0] = lamp;
        let wall = scene.materials.iter().position(|m| m.name == "red");
        let wall = wall.expect("the Cornell box has a red wall");
        for r in &mut scene.materials[wall].reflectance {
            *r = 0.7 - *r;
        }
        scene
    };
    let cached = &CORNELL;
    let (relighter, relit) = cached.relit(changed());
    assert!(relit.record.changed);
    let mut fresh = Bake::new(changed(), settings(1.0, 9));
    fresh.run();
    let [measured, stated] = measured_and_stated(cached, &relit, &fresh);
    assert!(measured < stated, "{measured} {stated}");
    // It is another light: the old one is far off.
    assert!(difference(&fresh, &cached.baked, 1) > 5.0 * measured);
    let white = relighter.light().white;
    for (a, b) in white.iter().zip(fresh.light().white) {
        assert!((a / b - 1.0).abs() < 0.01, "{a} {b}");
    }
}

/// However little the light changes, the room was not refined for it: the errors of the last two rounds count as alike, 1.5 of their distance. Of
/// that the bake left out the noise of the round before.
#[test]
fn light_that_a_room_was_not_refined_for_is_less_certain() {
    let mut scene = room("furnished.glb");
    for r in &mut scene.materials[0].reflectance {
        *r *= 1.0 - 1e-6;
    }
    let (_, relit) = FURNISHED.relit(scene);
    assert!(relit.record.changed);
    // Wavelengths and the solve err about as before: lanes are chosen anew.
    let [.., before, last] = FURNISHED.bake.rounds() else {
        panic!("one round")
    };
    let error = &last.error;
    let [all, wavelengths, solve, noise] = [
        &error.total_de2000,
        &error.spectrum_de_luv,
        &error.convergence_de_luv,
        &before.error.noise_de2000,
    ]
    .map(|figure| figure.value.unwrap());
    let others = wavelengths.hypot(solve);
    let geometry = (all * all - others * others).sqrt();
    let want = (1.5 * geometry.hypot(noise)).hypot(others);
    let stated = relit.record.error_de2000.value.unwrap();
    assert!((stated / want - 1.0).abs() < 0.05, "{stated} for {want}");
}

/// In the furnished room the window and the panel go out; walls are painted, the bulb is made ten times as strong.
#[test]
fn lamps_go_out_in_a_furnished_room() {
    let changed = || {
        let mut scene = room("furnished.glb");
        for material in &mut scene.materials {
            match material.name.as_str() {
                "sky" | "panel" => material.emission = None,
                "plaster" => material.reflectance = material.reflectance.map(|r| 0.5 * r),
                "bulb" => {
                    let emission = material.emission.as_mut().unwrap();
                    emission.shape = emission.shape.map(|x| 10.0 * x);
                }
                _ => {}
            }
        }
        scene
    };
    let cached = &FURNISHED;
    let (_, relit) = cached.relit(changed());
    let mut fresh = Bake::new(changed(), settings(3.0, 3));
    fresh.run();
    let stated = relit.record.error_de2000.value.unwrap();
    let measured = difference(&fresh, &relit.baked, 1);
    println!(
        "furnished: measured {measured}, stated {stated} and {}",
        estimate(&fresh)
    );
    assert!(
        measured < stated.hypot(estimate(&fresh)),
        "{measured} {stated}"
    );
    assert!(difference(&fresh, &cached.baked, 1) > 3.0 * measured);
}

/// Lamps behind panes and in mirrors, the colours of panes and mirrors themselves: what a fresh bake finds.
#[test]
fn panes_and_mirrors_leave_what_they_leave_in_a_fresh_bake() {
    for (name, cached) in [("glazed.glb", &GLAZED), ("mirrored.glb", &MIRRORED)] {
        let changed = || {
            let mut scene = room(name);
            for (k, light) in scene.spectra.iter_mut().enumerate() {
                // Redder, and the second half as strong.
                let power = light.power.iter().zip(0..);
                let power = power.map(|(x, l)| x * f64::from(l) / (32.0 * (k + 1) as f64));
                light.power = power.collect::<Vec<f64>>().try_into().unwrap();
            }
            for material in &mut scene.materials {
                if let Some(pane) = &mut material.pane {
                    let (PaneKind::Glass { inside: colour, .. } | PaneKind::Cover { colour, .. }) =
                        &mut pane.kind
                    else {
                        continue;
                    };
                    (colour[20..40].iter_mut()).for_each(|x| *x *= 0.5);
                }
                if let Some(mirror) = &mut material.mirror {
                    (mirror.reflectance[20..40].iter_mut()).for_each(|x| *x *= 0.5);
                }
            }
            scene
        };
        let (_, relit) = cached.relit(changed());
        assert!(relit.record.changed);
        let mut fresh = Bake::new(changed(), settings(4.0, 2));
        fresh.run();
        let [measured, stated] = measured_and_stated(cached, &relit, &fresh);
        // Estimates are to be at least .7 of what is measured.
        assert!(0.7 * measured < stated, "{name}: {measured} {stated}");
        assert!(
            difference(&fresh, &cached.baked, 1) > 3.0 * measured,
            "{name}"
        );
    }
}

/// Another pane, or a mirror that is none any more, is another shape: where light goes is in the cache.
#[test]
fn moved_panes_and_dull_mirrors_are_refused() {
    let refused = |which: usize, change: &dyn Fn(&mut Scene)| {
        let mut other = SMALL[which].bake.scene().clone();
        change(&mut other);
        let error = SMALL[which].open(other).err().unwrap();
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    };
    let text = refused(1, &|scene| scene.panes[0].positions[0].x += 0.01);
    assert!(text.contains("another shape: pane"), "{text}");
    let text = refused(2, &|scene| {
        scene.materials.iter_mut().for_each(|m| m.mirror = None);
    });
    assert!(text.contains("another shape: surface"), "{text}");
}

/// Relit from a cache, a room does not depend on the number of threads.
#[test]
fn caches_are_the_same_on_any_number_of_threads() {
    use EffectKind::{Mirrors, Panes};
    for (name, scene) in [("panes", small(&[Panes])), ("mirrors", small(&[Mirrors]))] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let cached = Cached::new(scene.clone(), settings(6.0, 1));
                let mut dimmed = scene.clone();
                dimmed.spectra[0].power.iter_mut().for_each(|x| *x *= 0.5);
                let (_, relit) = cached.relit(dimmed);
                irradiance(&relit.baked)
            })
        };
        assert!(on(1) == on(16), "{name}");
    }
}

/// Light adds up: the room under all lamps is the sum of the rooms under one lamp each; twice the power is twice the light.
#[test]
fn light_adds_up() {
    let dense = Settings {
        representation: Representation::Dense,
        ..settings(1.0, 2)
    };
    // Light adds up wherever it is looked at: a mesh grown to the error asked for takes most of the time.
    let limits = Limits {
        vertices: Some(4000),
        ..Limits::default()
    };
    let cached = Cached::within(&limits, room("furnished.glb"), dense);
    let mut relighter = cached.open(room("furnished.glb")).unwrap();
    let mut under = |keep: &dyn Fn(&str) -> f64| {
        let mut scene = room("furnished.glb");
        for material in &mut scene.materials {
            let power = keep(&material.name);
            if let Some(e) = &mut material.emission {
                e.shape = e.shape.map(|x| power * x);
                e.scale *= power;
            }
        }
        for light in &mut scene.lights {
            let power = keep(&light.name);
            light.shape = light.shape.map(|x| power * x);
        }
        relighter.change(scene).unwrap();
        irradiance(&relighter.relight().unwrap().baked)
    };
    let all = under(&|_| 1.0);
    let twice = under(&|_| 2.0);
    let window = under(&|name| f64::from(u8::from(name == "sky")));
    let others = under(&|name| f64::from(u8::from(name != "sky")));
    let mean = all.iter().map(|xyz| xyz[1]).sum::<f64>() / all.len() as f64;
    // Each of the two solves behind a sum ends at a relative error of .002 times the error asked for, also in pockets where
    // little light arrives, and arrives late: corrections of whole patches must not put light there, or take what is there.
    let near = |a: f64, b: f64| (a - b).abs() < 2.5 * 2e-3 * a.max(0.1 * mean);
    for k in 0..all.len() {
        for c in 0..3 {
            let (double, sum) = (twice[k][c], window[k][c] + others[k][c]);
            assert!(near(2.0 * all[k][c], double), "{:?} {double}", all[k]);
            assert!(near(all[k][c], sum), "{:?} {sum}", all[k]);
        }
    }
}

#[test]
fn another_shape_is_refused_with_what_changed() {
    let cached = &FURNISHED;
    let refused = |scene: Scene| {
        let error = cached.open(scene).err().unwrap();
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    };
    let mut open = cached.open(room("furnished.glb")).unwrap();
    assert!(open.change(room("convex.glb")).is_err());
    let mut moved = room("furnished.glb");
    moved.surfaces[4].positions[2].z += 0.01;
    let name = moved.surfaces[4].name.clone();
    let text = refused(moved);
    assert!(text.contains(&format!("surface {name} changed")), "{text}");
    assert!(text.contains("bake the room again with --cache"), "{text}");
    let mut lamp = room("furnished.glb");
    lamp.lights[0].position.x += 0.5;
    let text = refused(lamp);
    assert!(text.contains("place of light"), "{text}");
    let mut glowing = room("furnished.glb");
    let glow = glowing.materials.iter().find_map(|m| m.emission.clone());
    let oak = glowing
        .materials
        .iter()
        .position(|m| m.name == "oak")
        .unwrap();
    glowing.materials[oak].emission = glow;
    let text = refused(glowing);
    assert!(text.contains("gives out light and did not"), "{text}");
    let text = refused(room("convex.glb"));
    assert!(text.contains("another shape"), "{text}");
    // A cache that would be too large is refused before it is written.
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("other");
    let error = cached
        .bake
        .write_cache(&cached.baked, &at, 1000)
        .unwrap_err();
    assert!(error.to_string().contains("--cache-limit"), "{error}");
    assert!(!at.exists());
    // A bake that was not told to keep anything has no cache.
    let mut bake = Bake::new(room("convex.glb"), settings(9.0, 1));
    bake.step();
    let baked = bake.baked(&|_, _| {});
    assert!(bake.write_cache(&baked, &at, u64::MAX).is_err());
}

/// A bake that went on from a checkpoint keeps all it needs.
#[test]
fn a_resumed_bake_writes_the_same_cache() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut whole = Bake::new(room("two-rooms.glb"), settings(5.0, 2));
    whole.keep();
    whole.step();
    whole.save(&at("state")).unwrap();
    whole.run();
    let mut resumed = Bake::new(room("two-rooms.glb"), settings(5.0, 2));
    let text = resumed.resume(&at("state")).unwrap_err().to_string();
    assert!(text.contains("--cache changed"), "{text}");
    resumed.keep();
    resumed.resume(&at("state")).unwrap();
    resumed.run();
    for (bake, name) in [(&whole, "a"), (&resumed, "b")] {
        let baked = bake.baked(&|_, _| {});
        bake.write_cache(&baked, &at(name), u64::MAX).unwrap();
    }
    let light = |name: &str| {
        let mut relighter = Relighter::open(&at(name), room("two-rooms.glb")).unwrap();
        irradiance(&relighter.relight().unwrap().baked)
    };
    assert_eq!(light("a"), light("b"));
}

/// Rooms and their caches: one of few triangles, and such with panes and mirrors.
static SMALL: LazyLock<[Cached; 3]> = LazyLock::new(|| {
    use EffectKind::{Mirrors, Panes};
    [
        Cached::new(room("two-rooms.glb"), settings(5.0, 2)),
        Cached::new(small(&[Panes]), settings(9.0, 1)),
        Cached::new(small(&[Mirrors]), settings(9.0, 1)),
    ]
});

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, rng_seed: proptest::test_runner::RngSeed::Fixed(6), failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever stands in a file, even under a right checksum, is taken or refused, and never a fault.
    #[test]
    fn garbled_caches_do_no_harm(
        changes in garbled::changes(),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
        early in any::<bool>(),
        which in prop::sample::select(vec![0, 0, 1, 2]),
    ) {
        let Cached { cache, bake, .. } = &SMALL[which];
        let scene = bake.scene().clone();
        let mut bytes = garbled::garbled(cache, changes, early, cut);
        garbled::sign(&mut bytes);
        let done = opened(&bytes, scene).and_then(|mut r| r.relight());
        if let Err(error) = done {
            prop_assert_eq!(error.exit_code(), 2);
        }
    }
}

/// The command: names by default, the same file back, and polite refusals.
#[test]
fn the_command_relights() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["cornell.glb", "cornell.spectra.json"] {
        std::fs::copy(scenes().join(file), folder.path().join(file)).unwrap();
    }
    let run = |args: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .args(args)
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), said, output.stdout)
    };
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    let (code, said, _) = run(&["relight", "cornell.glb"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("there is no cache"), "{said}");
    let baking = [
        "bake",
        "cornell.glb",
        "--error",
        "2",
        "--cache",
        "cornell.cache",
    ];
    let (code, said, _) = run(&baking);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("MB"), "{said}");
    let baked = read("cornell.baked.glb");
    let (code, said, out) = run(&["relight", "cornell.glb", "--json", "-o", "same.glb"]);
    assert_eq!(code, Some(0), "{said}");
    let line: Value = serde_json::from_slice(&out).unwrap();
    assert_eq!(line["changed"], false);
    // The same meshes; only digits of numbers in the text may be fewer or more.
    let binary =
        |glb: &[u8]| glb.len() - u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    assert_eq!(binary(&read("same.glb")), binary(&baked));
    // A lamp of half the power: half the light, and an exposure that makes up for it.
    let spectra = String::from_utf8(read("cornell.spectra.json")).unwrap();
    let mut spectra: Value = serde_json::from_str(&spectra).unwrap();
    let lamp = spectra["materials"]
        .as_object_mut()
        .unwrap()
        .values_mut()
        .find(|m| m.get("emission").is_some())
        .unwrap();
    let name = lamp["emission"]["name"].as_str().unwrap_or("").to_owned();
    lamp["emission"] = json!({"name": "cie/F2", "luminance_cd_m2": 100.0});
    assert_ne!(name, "cie/F2");
    std::fs::write(folder.path().join("evening.json"), spectra.to_string()).unwrap();
    let args = [
        "relight",
        "cornell.glb",
        "--spectra",
        "evening.json",
        "--json",
    ];
    let (code, said, out) = run(&args);
    assert_eq!(code, Some(0), "{said}");
    let line: Value = serde_json::from_slice(&out).unwrap();
    assert_eq!(line["changed"], true);
    assert!(read("cornell.baked.glb") != baked);
    // Another room, an input as the output, and a file that is no cache.
    std::fs::copy(
        scenes().join("convex.glb"),
        folder.path().join("convex.glb"),
    )
    .unwrap();
    let (code, said, _) = run(&["relight", "convex.glb", "--cache", "cornell.cache"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("another shape"), "{said}");
    let (code, said, _) = run(&["relight", "cornell.glb", "--npz", "cornell.cache"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("overwrite an input"), "{said}");
    std::fs::write(folder.path().join("cornell.cache"), b"PK").unwrap();
    let (code, said, _) = run(&["relight", "cornell.glb"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("no cache of this program"), "{said}");
}

/// Lamps that shared a spectrum get spectra of their own, and share one again: lanes follow, and nobody's light is lost.
#[test]
fn lamps_get_spectra_of_their_own_and_share_one_again() {
    let tinted = || {
        let emission = json!({"name": "cie/F11", "luminance_cd_m2": 20000});
        let said = json!({"materials": {"bulb": {"emission": emission}}});
        with("furnished.glb", said)
    };
    let plain = || room("furnished.glb");
    assert!(tinted().spectra.len() > plain().spectra.len());
    let cached = Cached::new(plain(), settings(3.0, 2));
    let mean = |baked: &Baked| -> f64 {
        let all = irradiance(baked);
        all.iter().map(|xyz| xyz[1]).sum::<f64>() / all.len() as f64
    };
    let before = mean(&cached.baked);
    let (mut relighter, _) = cached.relit(plain());
    relighter.change(tinted()).unwrap();
    let more = relighter.relight().unwrap();
    let mut fresh = Bake::new(tinted(), settings(3.0, 2));
    fresh.run();
    let stated = more.record.error_de2000.value.unwrap();
    let measured = difference(&fresh, &more.baked, 1);
    println!(
        "measured {measured}, stated {stated} and {}",
        estimate(&fresh)
    );
    assert!(
        measured < stated.hypot(estimate(&fresh)),
        "{measured} {stated}"
    );
    // What is undone is undone, by way of a first answer.
    relighter.change(plain()).unwrap();
    relighter.relight_roughly().unwrap();
    let back = mean(&relighter.relight().unwrap().baked);
    assert!((back / before - 1.0).abs() < 0.01, "{back} {before}");
}
