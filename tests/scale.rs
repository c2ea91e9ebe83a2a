//! The scale of a file does not matter: a room on a plain of a square kilometre is the room alone, and a room a hundred times as large or as
//! small has the same light.

#[path = "common/built.rs"]
mod built;

use built::{Room, sphere};
use glam::{DVec3, dvec3};
use haarlight::scene::Scene;
use haarlight::solve::{Bake, Settings};
use std::time::Instant;

/// What a room stands on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Ground {
    /// A floor of its own, as large as its walls need.
    Floor,
    /// A plain of a square kilometre, some way from its middle, that is the floor.
    Plain,
    /// A floor that lies in such a plain.
    Lying,
}

/// A room to build.
#[derive(Debug, Clone, Copy)]
struct Plan {
    ground: Ground,
    /// Are walls, floor and ceiling there from both sides?
    two_sided: bool,
    /// Does so much stand in it that it is looked at by rays?
    furnished: bool,
    /// Metres to the unit of the file.
    size: f64,
}

/// Inner size of the room, m.
const ROOM: DVec3 = dvec3(4.0, 2.6, 3.0);
/// Thickness of its walls, m.
const THICK: f64 = 0.2;
/// Where on the plain it stands.
const AWAY: [f64; 2] = [310.0, 170.0];

impl Plan {
    fn scene(self) -> Scene {
        let mut room = Room::new();
        let [wall, floor, wood] = [0.7, 0.3, 0.5].map(|rho| room.paint(rho));
        let plain = room.paint(0.3);
        let lamp = room.lamp(0.0, 8000.0);
        if self.two_sided {
            [wall, floor, plain].map(|paint| room.two_sided(paint));
        }
        let at = |p: DVec3| p * self.size;
        let [low, high] = [
            dvec3(-THICK, 0.0, -THICK),
            dvec3(ROOM.x + THICK, ROOM.y, ROOM.z + THICK),
        ];
        let flat = |room: &mut Room, low: DVec3, high: DVec3, paint| {
            let (z, x) = (DVec3::Z * (high - low), DVec3::X * (high - low));
            room.quad(at(low), at(z), at(x), paint);
        };
        if self.ground != Ground::Plain {
            flat(&mut room, low, high.with_y(0.0), floor);
        }
        if self.ground != Ground::Floor {
            let low = dvec3(-AWAY[0], 0.0, -AWAY[1]);
            flat(&mut room, low, low + dvec3(1000.0, 0.0, 1000.0), plain);
        }
        let block = |room: &mut Room, low: DVec3, high: DVec3, paint| {
            room.block(at(low), at(high), paint);
        };
        for [a, b] in [
            [low, dvec3(0.0, ROOM.y, high.z)],
            [dvec3(ROOM.x, 0.0, low.z), high],
            [dvec3(0.0, 0.0, low.z), dvec3(ROOM.x, ROOM.y, 0.0)],
            [dvec3(0.0, 0.0, ROOM.z), dvec3(ROOM.x, ROOM.y, high.z)],
            [low.with_y(ROOM.y), high.with_y(ROOM.y + THICK)],
        ] {
            block(&mut room, a, b, wall);
        }
        // Looks down.
        let corner = dvec3(1.6, ROOM.y - 0.05, 1.2);
        room.quad(at(corner), at(0.8 * DVec3::X), at(0.6 * DVec3::Z), lamp);
        block(
            &mut room,
            dvec3(0.6, 0.72, 0.8),
            dvec3(1.9, 0.76, 1.6),
            wood,
        );
        block(&mut room, dvec3(2.9, 0.0, 0.1), dvec3(3.9, 0.45, 2.1), wood);
        if self.furnished {
            let (corners, triangles) = sphere(at(dvec3(2.3, 0.3, 2.3)), 0.3 * self.size, 2);
            room.mesh(corners, triangles, wood);
        }
        room.scene()
    }

    /// Points on floor, table, bed, ceiling and walls.
    fn points(self) -> Vec<(DVec3, DVec3)> {
        let mut points = Vec::new();
        for i in 0..6 {
            for k in 0..4 {
                let [u, v] = [(f64::from(i) + 0.5) / 6.0, (f64::from(k) + 0.5) / 4.0];
                points.push((dvec3(u * ROOM.x, 0.0, v * ROOM.z), DVec3::Y));
                points.push((dvec3(u * ROOM.x, ROOM.y, v * ROOM.z), DVec3::NEG_Y));
                points.push((dvec3(u * ROOM.x, v * ROOM.y, 0.0), DVec3::Z));
                points.push((dvec3(0.0, v * ROOM.y, u * ROOM.z), DVec3::X));
            }
        }
        let lies_under = |p: &DVec3| {
            (p.y == 0.0 && p.x > 2.85 && p.z < 2.15)
                || (p.y == 0.0 && p.distance(dvec3(2.3, 0.0, 2.3)) < 0.1)
                || (p.z == 0.0 && p.x > 2.85 && p.y < 0.46)
        };
        points.retain(|(p, _)| !lies_under(p));
        points.iter().map(|&(p, n)| (p * self.size, n)).collect()
    }

    fn bake(self, error: f64) -> Seen {
        let started = Instant::now();
        let mut bake = Bake::new(
            self.scene(),
            Settings {
                error,
                ..Settings::default()
            },
        );
        let verdict = bake.run();
        let lux: Vec<f64> = bake
            .probe(&self.points())
            .iter()
            .map(|p| p.xyz[1])
            .collect();
        let solved = started.elapsed().as_secs_f64();
        let baked = bake.baked(&|_, _| {});
        let vertices = baked.surfaces.iter().map(|s| s.vertices.len()).sum();
        let last = bake.rounds().last().unwrap();
        let seen = Seen {
            lux,
            vertices,
            error: last.error.total_de2000.value.unwrap_or(f64::NAN),
        };
        let white = bake.light().white[1];
        println!(
            "{self:?}: {verdict:?} in {} rounds, {} leaves, {} links, estimate {:.3}, white {white:.0}, {vertices} vertices, {solved:.2} s + {:.2} s",
            bake.rounds().len(),
            bake.light().leaves.len(),
            last.links,
            seen.error,
            started.elapsed().as_secs_f64() - solved,
        );
        seen
    }
}

/// What a bake found.
struct Seen {
    lux: Vec<f64>,
    vertices: usize,
    error: f64,
}

impl Seen {
    /// Root mean square of the relative difference, and the greatest.
    fn off(&self, truth: &Self) -> [f64; 2] {
        let off = self
            .lux
            .iter()
            .zip(&truth.lux)
            .map(|(a, b)| (a / b - 1.0).abs());
        let off: Vec<f64> = off.collect();
        let square = off.iter().map(|x| x * x).sum::<f64>() / off.len() as f64;
        [square.sqrt(), off.iter().fold(0.0, |a, b| a.max(*b))]
    }
}

#[test]
#[ignore = "prints what is"]
fn measure() {
    for furnished in [false, true] {
        for two_sided in [false, true] {
            let plan = |ground, size| Plan {
                ground,
                two_sided,
                furnished,
                size,
            };
            let fine = plan(Ground::Floor, 1.0).bake(0.1);
            let all = [
                plan(Ground::Floor, 1.0),
                plan(Ground::Plain, 1.0),
                plan(Ground::Lying, 1.0),
                plan(Ground::Floor, 100.0),
                plan(Ground::Floor, 0.01),
            ];
            for plan in all {
                let seen = plan.bake(0.5);
                let [rms, most] = seen.off(&fine);
                println!(
                    "    off {:.2} % RMS, {:.1} % at most",
                    100.0 * rms,
                    100.0 * most
                );
            }
        }
    }
}
