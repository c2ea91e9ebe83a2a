//! Dust changes nothing: the same room with any number of tiny triangles in it has the same light, found as well, on both sides of every
//! number at which a program might switch to other means.

use crate::common::traced::CORNELL;

use glam::{DMat4, DVec3};
use haarlight::audit::Report;
use haarlight::color::de2000;
use haarlight::geometry::sampling::{Pcg, sphere_direction};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use std::path::Path;

/// Numbers of triangles. What the room itself has, 34, comes on top.
const DUST: [usize; 6] = [0, 200, 220, 240, 300, 5000];
/// Edge of a triangle over half the room's greatest side: 1 mm in a room of 2 m by 2 m.
const EDGE: f64 = 1e-3;
/// Bakes of each room: the rays of one err alike at neighbouring points, so that one bake tells less than its points do.
const SEEDS: u64 = 4;

fn cornell() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.glb");
    Scene::load(&file, &Options::default()).unwrap()
}

/// The Cornell box with `count` triangles in its air, of the material of its first surface.
fn dusty(count: usize, low: DVec3, high: DVec3) -> Scene {
    let mut scene = cornell();
    let mut random = Pcg::new(5);
    let mut surface = scene.surfaces[0].clone();
    let edge = EDGE * 0.5 * (high - low).max_element();
    surface.name = "dust".into();
    (surface.normals, surface.colors) = (None, None);
    surface.texcoords = Vec::new();
    surface.positions = (0..count)
        .flat_map(|_| {
            let at = DVec3::from_array([0, 1, 2].map(|_| 0.02 + 0.96 * random.f64()));
            let at = low + at * (high - low);
            let [u, v] = [0, 1].map(|_| sphere_direction([random.f64(), random.f64()]));
            [at, at + edge * u, at + edge * v]
        })
        .collect();
    surface.triangles = (0..count as u32)
        .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
        .collect();
    surface.to_world = DMat4::IDENTITY;
    if count > 0 {
        scene.surfaces.push(surface);
    }
    scene
}

/// Mean and half of its interval of 95 %.
fn mean(x: &[f64]) -> [f64; 2] {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    [mean, 1.96 * (variance / n).sqrt()]
}

#[test]
fn error_changes_smoothly_with_dust() {
    let clean = Bake::new(cornell(), Settings::default());
    let seen = Report::against(&clean, &CORNELL).seen;
    let points: Vec<(DVec3, DVec3)> = seen.iter().map(|s| (s.point, s.normal)).collect();
    let mesh = clean.mesh();
    let corners = || mesh.positions.iter().map(|p| *p + mesh.centre);
    let low = corners().fold(DVec3::INFINITY, DVec3::min);
    let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
    let mut last: Option<[f64; 2]> = None;
    for count in DUST {
        let mut off = vec![0.0; seen.len()];
        for seed in 1..=SEEDS {
            let settings = Settings {
                seed,
                ..Settings::default()
            };
            let mut bake = Bake::new(dusty(count, low, high), settings);
            bake.run();
            let white = bake.light().white;
            let probed = bake.probe(&points);
            for ((off, probed), seen) in off.iter_mut().zip(&probed).zip(&seen) {
                *off += de2000(probed.xyz, seen.traced, white) / SEEDS as f64;
            }
            println!(
                "{count} triangles of dust: {} rounds, {} leaves, {:.2} s",
                bake.rounds().len(),
                bake.light().leaves.len(),
                bake.rounds().iter().map(|r| r.round_s).sum::<f64>()
            );
        }
        let [error, half] = mean(&off);
        println!("{count} triangles of dust: dE00 {error:.3} +- {half:.3}");
        assert!(error < 0.5, "{count}: {error}");
        if let Some([before, half_before]) = last {
            let allowed = (half * half + half_before * half_before).sqrt();
            assert!(
                (error - before).abs() < allowed,
                "from {before} to {error} with {count}"
            );
        }
        last = Some([error, half]);
    }
}
