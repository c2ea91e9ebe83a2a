//! Lux on a desk: a grid of sensors in a room.
//!
//! `cargo run --release --example probe`

use haarlight::Result;
use haarlight::glam::DVec3;
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};

/// Sensors along a side.
const SIDE: usize = 5;

fn main() -> Result<()> {
    let scene = Scene::load("scenes/cornell.glb", &Options::default())?;
    let mut bake = Bake::new(scene, Settings::default());
    bake.run();
    // 30 cm above the floor of the box, looking up.
    let (middle, half) = (bake.mesh().centre, 0.2);
    let across = |k: usize| half * (2.0 * k as f64 / (SIDE - 1) as f64 - 1.0);
    let place = |k: usize| {
        DVec3::new(
            middle.x + across(k % SIDE),
            0.3,
            middle.z + across(k / SIDE),
        )
    };
    let sensors: Vec<_> = (0..SIDE * SIDE).map(|k| (place(k), DVec3::Y)).collect();
    let lux: Vec<f64> = bake.probe(&sensors).iter().map(|p| p.xyz[1]).collect();
    for row in lux.chunks(SIDE) {
        println!(
            "{}",
            row.iter().map(|x| format!("{x:8.1}")).collect::<String>()
        );
    }
    let error = bake
        .rounds()
        .last()
        .and_then(|r| r.error.total_de2000.value);
    println!("lux; light is off by dE00 {error:?} in the mean (estimate)");
    Ok(())
}
