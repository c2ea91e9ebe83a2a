//! A faint lamp in the room next door, behind a wall and among so many small things that only rays tell what is seen of it.

#[path = "common/built.rs"]
mod built;

use built::Room;
use glam::{DVec3, dvec3};
use haarlight::geometry::sampling::Pcg;
use haarlight::solve::{Bake, Settings};
use std::f64::consts::PI;

/// Leaves below this one are the bright lamp's, the others the faint one's.
const PARTED: usize = 28;
/// How many times brighter the one is.
const BRIGHTER: f64 = 50.0;

/// Two rooms of 4 x 3 x 4 m with a wall between them, a bright lamp in the first, a faint one in the second.
fn rooms() -> Room {
    let mut room = Room::new();
    let paint = room.paint(0.5);
    room.hollow(DVec3::ZERO, dvec3(8.0, 3.0, 4.0), [paint; 6]);
    room.block(dvec3(3.95, 0.0, 0.0), dvec3(4.05, 3.0, 4.0), paint);
    for (x, own, exitance) in [
        (2.0, true, 20_000.0 * PI),
        (6.0, false, 20_000.0 * PI / BRIGHTER),
    ] {
        let power = std::array::from_fn(|k| if (k < PARTED) == own { 1.0 } else { 0.0 });
        let light = room.spectrum("half", power);
        let lamp = room.paint(0.0);
        room.glow(lamp, light, exitance);
        let corner = dvec3(x - 0.3, 2.95, 1.7);
        room.quad(corner, 0.6 * DVec3::X, 0.6 * DVec3::Z, lamp);
    }
    let mut random = Pcg::new(5);
    for _ in 0..60 {
        let [x, y, z] =
            [(0.2, 7.4), (0.3, 2.0), (0.2, 3.4)].map(|(low, size)| low + size * random.f64());
        if (x - 4.0_f64).abs() > 0.35 {
            let low = dvec3(x, y, z);
            room.block(low, low + 0.12, paint);
        }
    }
    room
}

#[test]
fn a_faint_lamp_does_not_shine_through_a_wall() {
    let settings = Settings {
        error: 1.0,
        ..Settings::default()
    };
    let mut bake = Bake::new(rooms().scene(), settings);
    bake.run();
    let points: Vec<(DVec3, DVec3)> = (0..200)
        .map(|k| {
            let (i, j) = (f64::from(k % 20), f64::from(k / 20));
            (dvec3(0.2 + 0.4 * i, 0.0, 0.2 + 0.4 * j), DVec3::Y)
        })
        .collect();
    // Of each half, light of both lamps.
    let mut light = [[0.0; 2]; 2];
    for ((point, _), probed) in points.iter().zip(bake.probe(&points)) {
        let half = usize::from(point.x > 4.0);
        for (k, x) in probed.leaves.iter().enumerate() {
            light[half][usize::from(k >= PARTED)] += x;
        }
    }
    let [[bright, strays], [other, faint]] = light;
    println!("{light:?}");
    assert!(faint > 0.0 && bright > 10.0 * faint, "{light:?}");
    // Strays were .08 % of the light there while lamps that no ray went to counted as seen.
    assert!(strays < 2e-5 * bright, "{strays} of {bright}");
    assert!(other < 1e-3 * faint, "{other} of {faint}");
}
