//! What do spectra cost in a whole bake? Three rooms, adaptive lanes beside all 64 bands and beside linear sRGB: CPU
//! seconds from the room as read to the light at the vertices, all threads. Bakes of the three kinds alternate and the
//! fastest of each counts.
//!
//! `cargo bench --bench bake`

use haarlight::cost::clock;
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Representation, Settings};
use std::path::Path;

/// Rooms, the error asked for, and how often each is baked.
const ROOMS: [(&str, f64, usize); 3] = [
    ("cornell-f2", 1.0, 5),
    ("two-rooms", 1.0, 3),
    ("furnished", 2.0, 2),
];
const KINDS: [Representation; 3] = [
    Representation::Adaptive,
    Representation::Dense,
    Representation::Rgb,
];

/// CPU seconds of the rounds and of the whole bake.
fn bake(scene: Scene, representation: Representation, error: f64) -> [f64; 2] {
    let start = clock::seconds();
    let settings = Settings {
        error,
        representation,
        ..Settings::default()
    };
    let mut bake = Bake::new(scene, settings);
    bake.run();
    let rounds = clock::seconds() - start;
    std::hint::black_box(bake.baked(&|_, _| {}));
    [rounds, clock::seconds() - start]
}

fn main() {
    let short = std::env::args().any(|a| a == "--test" || a == "test");
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    println!("CPU seconds to the light at the vertices (rounds alone in brackets)");
    println!(
        "room         dE00  adaptive         64 leaves        sRGB             | adaptive:sRGB  64:adaptive"
    );
    for (room, error, repeats) in ROOMS {
        let path = scenes.join(format!("{room}.glb"));
        let scene = match Scene::load(&path, &Options::default()) {
            Ok(scene) => scene,
            Err(problem) => {
                eprintln!("{room}: {problem}");
                continue;
            }
        };
        let mut best = [[f64::INFINITY; 2]; 3];
        for _ in 0..if short { 1 } else { repeats } {
            for (best, kind) in best.iter_mut().zip(KINDS) {
                let took = bake(scene.clone(), kind, error);
                *best = std::array::from_fn(|k| best[k].min(took[k]));
            }
        }
        let cell = |[rounds, all]: [f64; 2]| format!("{all:>6.2} ({rounds:>6.3})");
        println!(
            "{room:<12} {error:>4}  {}  {}  {}  | {:>10.2} {:>12.2}",
            cell(best[0]),
            cell(best[1]),
            cell(best[2]),
            best[0][1] / best[2][1],
            best[1][1] / best[0][1]
        );
    }
}
