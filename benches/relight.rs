//! How much faster is relighting than the first bake? Both in one run: the bake (rounds and gather), opening its cache,
//! relighting under another lamp and paint (lanes chosen anew), and once more without opening.
//!
//! `cargo bench --bench relight [-- NAME]`, NAME a part of a room's name. The furnished room takes minutes.

use haarlight::keep::Relighter;
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

fn room(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    Scene::load(path.join(name), &Options::default()).expect("a room of scenes/")
}

/// Half the power of the first lamp, another colour of the first paint.
fn changed(name: &str, step: usize) -> Scene {
    let mut scene = room(name);
    let lamp = scene.materials.iter_mut().find_map(|m| m.emission.as_mut());
    if let Some(emission) = lamp {
        emission.shape = emission.shape.map(|x| x / (1.0 + step as f64));
    }
    for (k, r) in scene.materials[0].reflectance.iter_mut().enumerate() {
        *r *= 0.5 + 0.5 * (k + step) as f64 / 66.0;
    }
    scene
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let clock = Instant::now();
    let result = work();
    (result, clock.elapsed().as_secs_f64())
}

fn main() {
    // `cargo bench` adds flags of its own.
    let wanted = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    println!("room               bake s   cache MB   open s  relight s    ratio  again s    ratio");
    for name in ["cornell.glb", "two-rooms.glb", "furnished.glb"] {
        if wanted.as_ref().is_some_and(|w| !name.contains(w.as_str())) {
            continue;
        }
        let folder = tempfile::tempdir().expect("a folder");
        let cache = folder.path().join("cache");
        let scene = room(name);
        let ((bake, baked), first) = timed(|| {
            let mut bake = Bake::new(scene, Settings::default());
            bake.keep();
            bake.run();
            let baked = bake.baked(&|_, _| {});
            (bake, baked)
        });
        let size = bake
            .write_cache(&baked, &cache, u64::MAX)
            .expect("room for the cache");
        drop((bake, baked));
        let scene = changed(name, 1);
        let (mut open, opening) = timed(|| Relighter::open(&cache, scene).expect("our own cache"));
        let (relit, relighting) = timed(|| open.relight().expect("our own cache"));
        black_box(relit);
        let scene = changed(name, 2);
        let (relit, again) = timed(|| {
            open.change(scene).expect("the same shape");
            open.relight().expect("our own cache")
        });
        black_box(relit);
        println!(
            "{name:<16} {first:>8.2} {:>10.1} {opening:>8.3} {relighting:>10.3} {:>8.1} {again:>8.3} {:>8.1}",
            size as f64 / 1e6,
            first / (opening + relighting),
            first / again
        );
    }
}
