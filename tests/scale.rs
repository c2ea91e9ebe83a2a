//! The scale of a file does not matter: a room on a plain of a square kilometre is the room alone, and a room a hundred times as large or as
//! small has the same light.

use crate::common::built;

use built::{Room, sphere};
use glam::{DVec3, dvec3};
use haarlight::scene::Scene;
use haarlight::solve::{Averages, Bake, Round, Settings};
use std::sync::LazyLock;
use std::time::Instant;

/// What a room stands on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Ground {
    /// None: the room has insides only.
    None,
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
/// Points stand so far above the floor, m: what lies in the plane of something else is raised by less.
const ABOVE: f64 = 1e-3;
/// CIEDE2000 of a relative error of a mid grey: .5 are about 1.4 %.
const DE_OF_RELATIVE: f64 = 35.0;
/// Where on the plain it stands.
const AWAY: [f64; 2] = [310.0, 170.0];

impl Plan {
    fn scene(self) -> Scene {
        let mut room = Room::new();
        let [wall, floor, wood] = [0.7, 0.3, 0.5].map(|rho| room.paint(rho));
        let plain = room.paint(0.3);
        let lamp = room.lamp(0.0, 8000.0);
        if self.two_sided {
            for paint in [wall, floor, plain] {
                room.two_sided(paint);
            }
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
        if matches!(self.ground, Ground::Floor | Ground::Lying) {
            flat(&mut room, low, high.with_y(0.0), floor);
        }
        if matches!(self.ground, Ground::Plain | Ground::Lying) {
            let low = dvec3(-AWAY[0], 0.0, -AWAY[1]);
            flat(&mut room, low, low + dvec3(1000.0, 0.0, 1000.0), plain);
        }
        let block = |room: &mut Room, low: DVec3, high: DVec3, paint| {
            room.block(at(low), at(high), paint);
        };
        let walls = [
            [low, dvec3(0.0, ROOM.y, high.z)],
            [dvec3(ROOM.x, 0.0, low.z), high],
            [dvec3(0.0, 0.0, low.z), dvec3(ROOM.x, ROOM.y, 0.0)],
            [dvec3(0.0, 0.0, ROOM.z), dvec3(ROOM.x, ROOM.y, high.z)],
            [low.with_y(ROOM.y), high.with_y(ROOM.y + THICK)],
        ];
        match self.ground {
            Ground::None => {
                let six = [wall, wall, floor, wall, wall, wall];
                room.hollow(DVec3::ZERO, at(ROOM), six);
            }
            _ => walls
                .into_iter()
                .for_each(|[a, b]| block(&mut room, a, b, wall)),
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
                points.push((dvec3(u * ROOM.x, ABOVE, v * ROOM.z), DVec3::Y));
                points.push((dvec3(u * ROOM.x, ROOM.y, v * ROOM.z), DVec3::NEG_Y));
                points.push((dvec3(u * ROOM.x, v * ROOM.y, 0.0), DVec3::Z));
                points.push((dvec3(0.0, v * ROOM.y, u * ROOM.z), DVec3::X));
            }
        }
        let lies_under = |p: &DVec3| {
            (p.y == ABOVE && p.x > 2.85 && p.z < 2.15)
                || (p.y == ABOVE && p.distance(dvec3(2.3, 0.0, 2.3)) < 0.1)
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
        let last = bake.rounds().last().unwrap();
        let estimate = |round: &Round| round.error.total_de2000.value.unwrap_or(f64::NAN);
        let seen = Seen {
            lux,
            white: bake.light().white[1],
            leaves: bake.rounds().iter().map(|r| r.elements).collect(),
            averages: bake.averages(),
            errors: bake.rounds().iter().map(estimate).collect(),
            by_rays: last.row_bytes > 0,
        };
        println!(
            "{self:?}: {verdict:?} in {} rounds, {:?} leaves, {} links, estimates {:.3?}, white {:.0}, {:.2} s",
            bake.rounds().len(),
            seen.leaves,
            last.links,
            seen.errors,
            seen.white,
            started.elapsed().as_secs_f64(),
        );
        seen
    }
}

/// What a bake found.
struct Seen {
    lux: Vec<f64>,
    white: f64,
    averages: Averages,
    /// Leaves and estimates, round by round.
    leaves: Vec<usize>,
    errors: Vec<f64>,
    /// Does light go by rays there?
    by_rays: bool,
}

impl Seen {
    /// Estimates and numbers of leaves of both after as many rounds, the most that both have: a further round leaves a third of the error with
    /// three times the leaves.
    fn alike(&self, other: &Self) -> [[f64; 2]; 2] {
        let rounds = self.errors.len().min(other.errors.len());
        let leaves = |seen: &Self| seen.leaves[rounds - 1] as f64;
        let both = [self, other];
        [both.map(|seen| seen.errors[rounds - 1]), both.map(leaves)]
    }

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

/// All rooms on a floor of their own, as large as they are.
fn plans() -> [Plan; 4] {
    [(false, false), (false, true), (true, false), (true, true)].map(|(furnished, two_sided)| {
        Plan {
            ground: Ground::Floor,
            two_sided,
            furnished,
            size: 1.0,
        }
    })
}

/// These rooms to the default error, each of them once for all tests.
static ALONE: [LazyLock<Seen>; 4] = [
    LazyLock::new(|| plans()[0].bake(0.5)),
    LazyLock::new(|| plans()[1].bake(0.5)),
    LazyLock::new(|| plans()[2].bake(0.5)),
    LazyLock::new(|| plans()[3].bake(0.5)),
];

/// Outsides of walls are as large as their insides: averaged over both, white and stated error were half of what they are. What is left is the
/// floor below the walls, 4.5 % of the room and too narrow to be told from it, and the chance of 160 watched points.
#[test]
fn outsides_of_walls_change_nothing() {
    let thick = &ALONE[0];
    let thin = Plan {
        ground: Ground::None,
        ..plans()[0]
    };
    let thin = &thin.bake(0.5);
    let [rms, most] = thick.off(thin);
    assert!(rms < 0.014 && most < 0.06, "off {rms}, {most}");
    let ratio = thick.white / thin.white;
    assert!((ratio - 1.0).abs() < 0.06, "white {ratio}");
    let [[a, b], _] = thick.alike(thin);
    assert!((0.55..1.8).contains(&(a / b)), "estimate {a} for {b}");
    let ratio = thick.averages.counted_m2 / thin.averages.area_m2;
    assert!((ratio - 1.0).abs() < 0.06, "area that counts {ratio}");
}

/// Light within what is stated, and as much work: on the plain floors are found to be the same room.
#[test]
fn a_plain_around_a_room_changes_nothing() {
    let grounds = [Ground::Plain, Ground::Lying];
    let mut estimates = [1.0; 2];
    for (plan, alone) in plans().into_iter().zip(&ALONE) {
        let fine = plan.bake(0.2);
        for (ground, estimates) in grounds.into_iter().zip(&mut estimates) {
            let plain = Plan { ground, ..plan }.bake(0.5);
            let [rms, most] = plain.off(&fine);
            assert!(rms < 0.014 && most < 0.06, "{ground:?}: off {rms}, {most}");
            let same = |a: f64, b: f64, factor: f64, what: &str| {
                assert!(
                    a < factor * b && b < factor * a,
                    "{ground:?}: {what} {a} for {b}"
                );
            };
            same(plain.white, alone.white, 1.1, "white");
            let [[a, b], [leaves, of_alone]] = plain.alike(alone);
            if plain.by_rays == alone.by_rays {
                same(a, b, 2.0, "estimate");
                *estimates *= a / b;
            } else {
                // After as many rounds one is finer than the other: its estimate must know its own error.
                let measured = DE_OF_RELATIVE * rms;
                assert!(
                    (0.7..3.0).contains(&(a / measured)),
                    "{ground:?}: {a} for {measured}"
                );
            }
            same(leaves, of_alone, 3.0, "leaves");
            // The chance of 160 watched points.
            assert!(plain.errors.len().abs_diff(alone.errors.len()) <= 1);
            same(
                plain.averages.counted_m2,
                alone.averages.counted_m2,
                1.2,
                "area that counts",
            );
            assert!(plain.averages.area_m2 > 1e6);
        }
    }
    // That chance is less for all rooms together.
    for (ground, product) in grounds.into_iter().zip(estimates) {
        let mean = f64::powf(product, 1.0 / plans().len() as f64);
        assert!((0.67..1.5).contains(&mean), "{ground:?}: estimates {mean}");
    }
}

/// Positions are rounded as much at all powers of two, and no length or area is absolute: not a bit differs.
#[test]
fn sizes_by_powers_of_two_change_no_bit() {
    let sizes = [64.0, 1.0 / 64.0].into_iter().cycle();
    for ((plan, one), size) in plans().into_iter().zip(&ALONE).zip(sizes) {
        let other = Plan { size, ..plan }.bake(0.5);
        assert_eq!(one.lux, other.lux, "{size}");
    }
}

/// What is rounded otherwise is split otherwise here and there.
#[test]
fn a_hundred_times_as_large_or_small_has_the_same_light() {
    let sizes = [100.0, 0.01].into_iter().cycle();
    for ((plan, one), size) in plans().into_iter().zip(&ALONE).zip(sizes) {
        let [rms, most] = Plan { size, ..plan }.bake(0.5).off(one);
        assert!(rms < 0.012 && most < 0.04, "{size}: {rms}, {most}");
    }
}
