//! Whole bakes through the library: energy, determinism, spectra of the output.

use haarlight::color::{KM, Observer};
use haarlight::gather::Baked;
use haarlight::output::{Exposure, Writing, baked_glb, npz};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings, Verdict};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

fn room(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name);
    Scene::load(path, &Options::default()).unwrap()
}

fn settings(error: f64) -> Settings {
    Settings {
        error,
        ..Settings::default()
    }
}

/// Both files of a bake.
fn files(bake: &Bake, baked: &Baked) -> [Vec<u8>; 2] {
    let scene = bake.scene();
    let look = Exposure::auto(scene, &baked.surfaces);
    let mut arrays = Vec::new();
    let spectra = bake.radiosity_spectra(baked);
    npz::write_baked(&mut arrays, scene, &baked.surfaces, &spectra).unwrap();
    [
        baked_glb(scene, &baked.surfaces, &look, Writing::default())
            .unwrap()
            .bytes,
        arrays,
    ]
}

/// Emitted flux is absorbed flux in a closed box, in every band; the lamp's flux is known: 428.8 lm.
#[test]
fn no_light_is_lost_in_a_closed_box() {
    let mut bake = Bake::new(room("cornell-closed.glb"), settings(0.5));
    assert_eq!(bake.run(), Verdict::Reached);
    for round in bake.rounds() {
        let flux = round.flux;
        assert!((flux.emitted_lm - 428.827).abs() < 0.5, "{flux:?}");
        // What the fronts receive is passed on without loss in every round and every band.
        assert!(flux.worst_band < 1e-3, "{flux:?}");
        assert!(flux.escaped_lm.abs() < 1e-3 * flux.emitted_lm, "{flux:?}");
    }
    let flux = bake.rounds().last().unwrap().flux;
    let out = flux.absorbed_lm + flux.escaped_lm;
    assert!((out / flux.emitted_lm - 1.0).abs() < 1e-3, "{flux:?}");
}

/// A preview ends with the second round, which has the first estimate; a bake at the default needs a third, good as the
/// second may look.
#[test]
fn two_rounds_do_for_a_preview() {
    for (error, rounds) in [(4.0, 2), (1.9, 3), (0.5, 3)] {
        let mut bake = Bake::new(room("cornell-f2.glb"), settings(error));
        assert_eq!(bake.run(), Verdict::Reached);
        let estimates = bake.rounds().iter().map(|r| r.error.total_de2000.value);
        let estimates: Vec<Option<f64>> = estimates.collect();
        assert_eq!(estimates.len(), rounds, "{error}: {estimates:?}");
        assert!(estimates[rounds - 1].unwrap() <= error);
    }
}

/// The same bytes at any thread count, and whether or not anybody watches.
#[test]
fn threads_and_onlookers_change_nothing() {
    let run = |threads: usize, watched: bool| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut bake = Bake::new(room("two-rooms.glb"), settings(4.0));
            let phases: Arc<Mutex<Vec<&str>>> = Arc::default();
            if watched {
                let phases = Arc::clone(&phases);
                bake.watch(Arc::new(move |phase| phases.lock().unwrap().push(phase)));
            }
            bake.run();
            let calls = AtomicUsize::new(0);
            let baked = bake.baked(&|done, of| {
                assert!(done <= of);
                calls.fetch_add(1, Ordering::Relaxed);
            });
            assert!(calls.into_inner() > 0);
            let expected: Vec<String> = bake
                .rounds()
                .iter()
                .flat_map(|r| r.phases_s.keys().cloned())
                .collect();
            let seen = phases.lock().unwrap().clone();
            assert!(!watched || seen == expected, "{seen:?}");
            files(&bake, &baked)
        })
    };
    let one = run(1, false);
    let two = run(2, true);
    assert!(one[0] == two[0], "glb differs");
    assert!(one[1] == two[1], "npz differs");
}

/// The spectra of the npz are the light of the glb: their tristimulus values are what `_XYZ` holds.
#[test]
fn spectra_integrate_to_the_tristimulus_radiosity() {
    let mut bake = Bake::new(room("cornell.glb"), settings(1.0));
    bake.run();
    let baked = bake.baked(&|_, _| {});
    let weights = Observer::cie1931().weights(&bake.scene().grid);
    let mut seen = 0;
    for (surface, spectra) in baked.surfaces.iter().zip(bake.radiosity_spectra(&baked)) {
        assert_eq!(surface.vertices.len(), spectra.len());
        for (vertex, spectrum) in surface.vertices.iter().zip(&spectra) {
            let xyz = weights.map(|w| {
                let sum: f64 = w.iter().zip(spectrum).map(|(w, x)| w * f64::from(*x)).sum();
                KM * sum
            });
            for (a, b) in xyz.iter().zip(vertex.radiosity) {
                assert!(
                    (a - f64::from(b)).abs() < 1e-4 * xyz[1].max(1.0),
                    "{xyz:?} {vertex:?}"
                );
            }
            seen += 1;
        }
    }
    assert!(seen > 500, "{seen}");
}

/// A room with nothing in it, and one without a lamp, are baked like any other.
#[test]
fn a_dark_room_is_done_at_once() {
    let mut dark = room("convex.glb");
    for material in &mut dark.materials {
        material.emission = None;
    }
    dark.spectra.clear();
    let mut empty = room("convex.glb");
    empty.surfaces.clear();
    for (scene, vertices) in [(dark, true), (empty, false)] {
        let mut bake = Bake::new(scene, settings(0.5));
        assert_eq!(bake.run(), Verdict::Reached);
        assert_eq!(bake.rounds().len(), 1);
        let baked = bake.baked(&|_, _| {});
        let mut all = baked.surfaces.iter().flat_map(|s| &s.vertices).peekable();
        assert_eq!(all.peek().is_some(), vertices);
        assert!(all.all(|v| v.radiosity == [0.0; 3]));
        files(&bake, &baked);
    }
}

/// Vertex colours paint the radiosity of the output too, in the mesh and in the spectra.
#[test]
fn vertex_colours_are_in_the_radiosity() {
    let mut scene = room("convex.glb");
    let painted = (0..scene.surfaces.len())
        .find(|&k| {
            scene.materials[scene.surfaces[k].material]
                .emission
                .is_none()
        })
        .unwrap();
    let count = scene.surfaces[painted].positions.len();
    let material = scene.surfaces[painted].material;
    let color = [0.5_f32, 0.25, 0.125];
    scene.materials[material].base_color = [0.8; 3];
    scene.materials[material].vertex_paint = true;
    scene.surfaces[painted].colors = Some(vec![[color[0], color[1], color[2], 1.0]; count]);
    let grid = scene.grid;
    let mut bake = Bake::new(scene, settings(2.0));
    bake.run();
    let baked = bake.baked(&|_, _| ());
    let spectra = bake.radiosity_spectra(&baked);
    let wanted = haarlight::color::Upsampler::new(&grid).reflectance(color.map(|c| 0.8 * c));
    let weights = Observer::cie1931().weights(&grid);
    for (k, sheet) in baked.surfaces.iter().enumerate() {
        if sheet.surface != painted {
            continue;
        }
        for (v, vertex) in sheet.vertices.iter().enumerate() {
            let irradiance = bake.lanes().spectrum(&baked.irradiance[k][v]);
            let y: f64 = (0..64)
                .map(|l| KM * weights[1][l] * wanted[l] * irradiance[l])
                .sum();
            let close = |x: f64| (x / y - 1.0).abs() < 0.02;
            assert!(close(f64::from(vertex.radiosity[1])), "{vertex:?} {y}");
            let sum: f64 = (0..64)
                .map(|l| KM * weights[1][l] * f64::from(spectra[k][v][l]))
                .sum();
            assert!(close(sum), "{sum} {y}");
        }
    }
}
