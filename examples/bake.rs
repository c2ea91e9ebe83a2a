//! A room gets its light: read, solve round by round, write.
//!
//! `cargo run --release --example bake -- scenes/cornell.glb cornell.baked.glb`

use haarlight::Result;
use haarlight::mesh::Limits;
use haarlight::output::{Exposure, ExposureSetting, WhiteBalance, Writing, baked_glb, camera};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use haarlight::store::file;
use std::path::Path;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let room = arguments.next().unwrap_or("scenes/cornell.glb".into());
    let to = arguments.next().unwrap_or("room.baked.glb".into());
    let scene = Scene::load(&room, &Options::default())?;
    let mut bake = Bake::new(
        scene,
        Settings {
            error: 1.0,
            ..Settings::default()
        },
    );
    while bake.verdict().is_none() {
        let round = bake.step();
        println!(
            "round {}: dE00 {:?} (estimate)",
            round.round, round.error.total_de2000.value
        );
    }
    let baked = bake.baked_within(&Limits::default(), &|_, _| {});
    let cameras = camera::cameras(bake.scene());
    let exposure = Exposure::metered(
        bake.scene(),
        &baked.surfaces,
        &cameras,
        ExposureSetting::default(),
        WhiteBalance::default(),
    );
    let glb = baked_glb(bake.scene(), &baked.surfaces, &exposure, Writing::default())?;
    file::write_atomic(Path::new(&to), Some(Path::new(&room)), |w| {
        w.write_all(&glb.bytes)
    })?;
    println!(
        "{to}: {} vertices, dE00 {:?} (estimate)",
        glb.vertices,
        bake.error_of(&baked)
    );
    Ok(())
}
