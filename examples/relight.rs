//! The same room under another lamp, without a ray: what a bake keeps is enough.
//!
//! `cargo run --release --example relight`

use haarlight::Result;
use haarlight::keep::Relighter;
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<()> {
    let room = "scenes/cornell.glb";
    let read = |spectra: &str| {
        let spectra = Some(PathBuf::from(spectra));
        Scene::load(
            room,
            &Options {
                spectra,
                ..Options::default()
            },
        )
    };
    let mut bake = Bake::new(
        read("scenes/cornell.spectra.json")?,
        Settings {
            error: 1.0,
            ..Settings::default()
        },
    );
    bake.keep();
    let clock = Instant::now();
    bake.run();
    let baked = bake.baked(&|_, _| {});
    println!("baked in {:.2} s", clock.elapsed().as_secs_f64());
    let cache = std::env::temp_dir().join("haarlight-example.cache");
    bake.write_cache(&baked, &cache, u64::MAX)?;

    let mut kept = Relighter::open(&cache, read("scenes/cornell.spectra.json")?)?;
    for lamp in [
        "scenes/cornell-f2.spectra.json",
        "scenes/cornell-d65.spectra.json",
    ] {
        let clock = Instant::now();
        kept.change(read(lamp)?)?;
        let relit = kept.relight()?;
        let vertices: usize = relit.baked.surfaces.iter().map(|s| s.vertices.len()).sum();
        println!(
            "{lamp}: {vertices} vertices in {:.3} s",
            clock.elapsed().as_secs_f64()
        );
    }
    std::fs::remove_file(&cache).map_err(|e| haarlight::Error::io(Path::new(&cache), e))
}
