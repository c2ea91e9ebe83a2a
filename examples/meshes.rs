//! A room made in memory: a corridor of boxes with a measured lamp, and the light at its end.
//!
//! `cargo run --release --example meshes`

use haarlight::Result;
use haarlight::glam::DVec3;
use haarlight::scene::{Meshes, Options, Paint, Scene};
use haarlight::solve::{Bake, Settings};
use serde_json::json;

/// A box seen from inside: its corners, and triangles whose fronts look inwards.
fn inside(low: [f32; 3], high: [f32; 3]) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let corner = |k: usize| std::array::from_fn(|c| if k >> c & 1 == 1 { high[c] } else { low[c] });
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let halves = sides.map(|[a, b, c, d]| [[a, c, b], [a, d, c]]);
    ((0..8).map(corner).collect(), halves.concat())
}

fn main() -> Result<()> {
    let mut room = Meshes::default();
    let wall = room.paint(Paint {
        name: "wall".into(),
        albedo: [0.7; 3],
        ..Paint::default()
    });
    let tube = room.paint(Paint {
        name: "tube".into(),
        albedo: [0.0; 3],
        spectra: json!({"emission": {"name": "cie/F11", "luminance_cd_m2": 8000}}),
        ..Paint::default()
    });
    let (corners, triangles) = inside([-1.0, 0.0, 0.0], [1.0, 2.5, 12.0]);
    room.mesh("corridor", &corners, &triangles, wall);
    let tube_at = [
        [-0.6, 2.45, 2.0],
        [-0.6, 2.45, 2.1],
        [0.6, 2.45, 2.1],
        [0.6, 2.45, 2.0],
    ];
    // Its front looks down.
    room.mesh("tube", &tube_at, &[[0, 2, 1], [0, 3, 2]], tube);
    let mut bake = Bake::new(
        Scene::from_meshes(&room, &Options::default())?,
        Settings::default(),
    );
    bake.run();
    for z in [2.0, 6.0, 10.0, 11.9] {
        let lux = bake.probe(&[(DVec3::new(0.0, 0.0, z), DVec3::Y)])[0].xyz[1];
        println!("{lux:7.1} lux on the floor at {z} m");
    }
    Ok(())
}
