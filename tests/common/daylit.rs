//! The rooms of CIE 171:2006, 5.9 and what follows, and light through their openings by quadrature.

use crate::common::built::{self, Room, sun};
use glam::{DVec3, dvec3};
use haarlight::audit::{Answer, Audit};
use haarlight::geometry::NO_PLANE;
use haarlight::scene::Scene;
use haarlight::scene::sky::{SkyBrightness, SkyType, SkyWish};
use haarlight::solve::{Bake, Settings};
use std::f64::consts::PI;
use std::iter::Sum;
use std::ops::Mul;

/// Prints a row of the table in `BENCHMARKS.md`: a case of CIE 171, what of it, the worst point and the root mean square, as shares.
pub(crate) fn row(case: &str, what: &str, worst: f64, rms: f64) {
    println!(
        "CIE 171 | {case} | {what} | {:.3} | {:.3} |",
        100.0 * worst,
        100.0 * rms
    );
}

/// Illuminance of open ground in these tests: per cent are lux.
pub(crate) const LUX: f64 = 100.0;

/// A place of the report, z up, in glTF's space.
pub(crate) fn cie(x: f64, y: f64, z: f64) -> DVec3 {
    dvec3(x, z, -y)
}

/// A sky of a CIE type with the sun at 60 degrees over y = 4 of the report (north here), without its direct light.
pub(crate) fn wish(kind: u8) -> SkyWish {
    SkyWish {
        kind: Some(SkyType(kind)),
        brightness: Some(SkyBrightness::Illuminance(LUX)),
        ground: Some(0.3),
        sun: sun([60.0, 0.0], 0.0),
        ..SkyWish::default()
    }
}

pub(crate) fn bake(room: Room, wish: &SkyWish) -> Bake {
    built::baked(under(room, wish))
}

fn under(room: Room, wish: &SkyWish) -> Scene {
    room.scene().under(wish).unwrap()
}

/// One round: what points see of the sky itself does not depend on it, so that in a black room further rounds change no figure.
pub(crate) fn glanced(room: Room, wish: &SkyWish) -> Bake {
    built::glanced(under(room, wish))
}

/// The same for grey light, under a white beside which none is worth dividing a patch for, or telling its colour.
pub(crate) fn glanced_in_grey(room: Room, wish: &SkyWish, seed: u64) -> Bake {
    built::run(under(room, wish), in_grey(seed))
}

fn in_grey(seed: u64) -> Settings {
    Settings {
        rounds: 1,
        seed,
        white: Some([1e9; 3]),
        ..Settings::default()
    }
}

/// A bake of which not even the first round is done: it has the light that random points see.
pub(crate) fn given_up(room: Room, wish: &SkyWish) -> Bake {
    let mut bake = Bake::new(under(room, wish), in_grey(0));
    assert!(bake.step_unless(std::sync::Arc::new(|| true)).is_none());
    bake
}

/// What so many paths from each place find in the room of a bake.
pub(crate) fn traced(bake: &Bake, places: Vec<(DVec3, DVec3)>, paths: usize) -> Vec<Answer> {
    let (scene, mesh) = (bake.scene(), bake.mesh());
    let inwards = |(point, normal)| (point - mesh.centre + 1e-6 * normal, normal, NO_PLANE);
    let places: Vec<_> = places.into_iter().map(inwards).collect();
    Audit::new(scene, mesh, bake.rays()).irradiance(&places, &vec![paths; places.len()], 3)
}

/// The room of 5.9 with an opening of a width in the middle of its roof, every panel cut into `cuts` x `cuts` squares.
pub(crate) fn room(rho: f64, opening: f64, cuts: usize) -> Room {
    let mut room = Room::new();
    let paint = room.paint(rho);
    let mut panel = |corner: DVec3, u: DVec3, v: DVec3| {
        let n = cuts as f64;
        for j in 0..cuts {
            for i in 0..cuts {
                let at = corner + u * (i as f64 / n) + v * (j as f64 / n);
                room.quad(at, u / n, v / n, paint);
            }
        }
    };
    let (x, y, z) = (cie(1.0, 0.0, 0.0), cie(0.0, 1.0, 0.0), cie(0.0, 0.0, 1.0));
    panel(DVec3::ZERO, 4.0 * x, 4.0 * y);
    panel(DVec3::ZERO, 3.0 * z, 4.0 * x);
    panel(4.0 * y, 4.0 * x, 3.0 * z);
    panel(DVec3::ZERO, 4.0 * y, 3.0 * z);
    panel(4.0 * x, 3.0 * z, 4.0 * y);
    let rim = 0.5 * (4.0 - opening);
    if rim > 0.0 {
        let top = 3.0 * z;
        panel(top, rim * y, 4.0 * x);
        panel(top + (4.0 - rim) * y, rim * y, 4.0 * x);
        panel(top + rim * y, opening * y, rim * x);
        panel(top + rim * y + (4.0 - rim) * x, opening * y, rim * x);
    }
    room
}

/// The same room with a window of 2 m x 1 m in the wall y = 4, its sill at 1 m; returns the window.
pub(crate) fn beside(room: &mut Room) -> [DVec3; 3] {
    let wall = cie(0.0, 4.0, 0.0);
    let (x, z) = (cie(1.0, 0.0, 0.0), cie(0.0, 0.0, 1.0));
    let paint = beside_whole(room);
    room.quad(wall, 4.0 * x, 1.0 * z, paint);
    room.quad(wall + 2.0 * z, 4.0 * x, 1.0 * z, paint);
    room.quad(wall + 1.0 * z, 1.0 * x, 1.0 * z, paint);
    room.quad(wall + 1.0 * z + 3.0 * x, 1.0 * x, 1.0 * z, paint);
    [wall + 1.0 * z + 1.0 * x, 2.0 * x, 1.0 * z]
}

/// The facade openings of 5.11 and 5.12: that window, and all of the wall, 4 m x 3 m.
pub(crate) fn facade(room: &mut Room, whole: bool) -> [DVec3; 3] {
    if !whole {
        return beside(room);
    }
    beside_whole(room);
    [cie(0.0, 4.0, 0.0), cie(4.0, 0.0, 0.0), cie(0.0, 0.0, 3.0)]
}

/// The room without the wall y = 4; returns its paint.
fn beside_whole(room: &mut Room) -> usize {
    let paint = room.paint(0.0);
    let (x, y, z) = (cie(1.0, 0.0, 0.0), cie(0.0, 1.0, 0.0), cie(0.0, 0.0, 1.0));
    room.quad(DVec3::ZERO, 4.0 * x, 4.0 * y, paint);
    room.quad(3.0 * z, 4.0 * y, 4.0 * x, paint);
    room.quad(DVec3::ZERO, 3.0 * z, 4.0 * x, paint);
    room.quad(DVec3::ZERO, 4.0 * y, 3.0 * z, paint);
    room.quad(4.0 * x, 3.0 * z, 4.0 * y, paint);
    paint
}

/// Places in that room that see the window.
pub(crate) fn places_beside() -> [(DVec3, DVec3); 6] {
    [
        (cie(2.0, 2.0, 0.0), DVec3::Y),
        (cie(2.0, 3.5, 0.0), DVec3::Y),
        (cie(2.0, 2.0, 3.0), DVec3::NEG_Y),
        (cie(1.0, 3.0, 3.0), DVec3::NEG_Y),
        (cie(2.0, 0.0, 1.5), cie(0.0, 1.0, 0.0)),
        (cie(0.0, 2.0, 1.0), cie(1.0, 0.0, 0.0)),
    ]
}

/// Points A to F of the wall and G to N of the floor, with their normals, in the room.
pub(crate) fn points() -> Vec<(DVec3, DVec3)> {
    let wall = (0..6).map(|k| (cie(2.0, 0.0, 2.75 - 0.5 * f64::from(k)), cie(0.0, 1.0, 0.0)));
    let floor = (0..8).map(|k| (cie(2.0, 0.25 + 0.5 * f64::from(k), 0.0), DVec3::Y));
    wall.chain(floor).collect()
}

/// Points A to N, those above G to N at the ceiling, some of the side walls, and those places: all see an opening of the facade.
pub(crate) fn points_beside() -> Vec<(DVec3, DVec3)> {
    let ceiling = (0..8).map(|k| (cie(2.0, 0.25 + 0.5 * f64::from(k), 3.0), DVec3::NEG_Y));
    let sides = [(1.0, 1.0), (2.0, 1.0), (3.0, 0.5), (3.0, 2.5)]
        .map(|(y, z)| (cie(0.0, y, z), cie(1.0, 0.0, 0.0)));
    let all = points().into_iter().chain(ceiling).chain(sides);
    all.chain(places_beside()).collect()
}

/// Irradiance at a point through a parallelogram, lit by a sky of 1 (and ground of `ground`), by quadrature.
pub(crate) fn through(
    sky: impl Fn(DVec3) -> f64,
    ground: f64,
    opening: [DVec3; 3],
    place: (DVec3, DVec3),
) -> f64 {
    let seen = |d: DVec3| if d.y > 0.0 { sky(d) } else { ground / PI };
    past_the_horizon(seen, opening, place)
}

/// The same of whatever is seen in each direction, by so many points along each side: the plain midpoint rule, for what has edges.
pub(crate) fn gathered<const N: usize>(
    seen: impl Fn(DVec3) -> f64,
    [corner, u, v]: [DVec3; 3],
    (point, normal): (DVec3, DVec3),
) -> f64 {
    let (area, across) = (u.cross(v).length(), u.cross(v).normalize());
    let mut sum = 0.0;
    for j in 0..N {
        for i in 0..N {
            let at = |k: usize| (k as f64 + 0.5) / N as f64;
            let way = corner + u * at(i) + v * at(j) - point;
            let r2 = way.length_squared();
            let d = way / r2.sqrt();
            sum += seen(d) * normal.dot(d).max(0.0) * across.dot(d).abs() / r2;
        }
    }
    sum * area / (N * N) as f64
}

/// Nodes of Gauss and Legendre's rule of four points on -1 to 1, and what each weighs; the other half lies on the other side of 0.
const LEGENDRE: [[f64; 2]; 2] = [
    [0.339_981_043_584_856_3, 0.652_145_154_862_546_1],
    [0.861_136_311_594_052_7, 0.347_854_845_137_453_9],
];
/// Cells of an opening along each side, a rule of four by four points in each: at the points and openings of CIE 171 it is off by 1.5e-4 at
/// the most, where the glow about the sun has its tip, as the midpoint rule of 400 by 400 points is by 1.1e-4.
const CELLS: usize = 32;

/// The same of a sky and a ground that are smooth each, of several at once too: an upright opening is cut at the horizon, where what is
/// seen jumps.
pub(crate) fn past_the_horizon<T: Mul<f64, Output = T> + Sum>(
    seen: impl Fn(DVec3) -> T,
    [corner, u, v]: [DVec3; 3],
    place: (DVec3, DVec3),
) -> T {
    let upright = v.x == 0.0 && v.z == 0.0;
    let share = match upright {
        true => ((place.0.y - corner.y) / v.y).clamp(0.0, 1.0),
        false => 0.0,
    };
    let below = v * share;
    let parts = [[corner, u, below], [corner + below, u, v - below]];
    let there = parts.into_iter().filter(|part| part[2] != DVec3::ZERO);
    there.map(|part| smooth(&seen, part, place)).sum()
}

fn smooth<T: Mul<f64, Output = T> + Sum>(
    seen: impl Fn(DVec3) -> T,
    [corner, u, v]: [DVec3; 3],
    (point, normal): (DVec3, DVec3),
) -> T {
    let (area, across) = (u.cross(v).length(), u.cross(v).normalize());
    let cells = (0..CELLS).flat_map(|cell| {
        LEGENDRE.into_iter().flat_map(move |[node, weight]| {
            let at = |x: f64| (cell as f64 + 0.5 + 0.5 * x) / CELLS as f64;
            [-node, node].map(|x| (at(x), 0.5 * weight / CELLS as f64))
        })
    });
    let line: Vec<(f64, f64)> = cells.collect();
    let nodes = line.iter().flat_map(|a| line.iter().map(move |b| (a, b)));
    let brought = nodes.map(|((t, of_row), (s, weight))| {
        let way = corner + u * *s + v * *t - point;
        let r2 = way.length_squared();
        let d = way / r2.sqrt();
        let brings = normal.dot(d).max(0.0) * across.dot(d).abs() / r2;
        seen(d) * (of_row * weight * brings)
    });
    brought.sum::<T>() * area
}

/// The opening in the roof: a corner and two sides.
pub(crate) fn roof(opening: f64) -> [DVec3; 3] {
    let rim = 0.5 * (4.0 - opening);
    [
        cie(rim, rim, 3.0),
        cie(opening, 0.0, 0.0),
        cie(0.0, opening, 0.0),
    ]
}

/// Index of the slab that comes nearest to that glass: within .6 % from 9 degrees above grazing upwards.
pub(crate) const INDEX: f64 = 1.54;

/// Clear glass of 6 mm as the report gives it, by the cosine of incidence.
pub(crate) fn glass_of_the_report(cosine: f64) -> f64 {
    [
        -0.028378, 3.156075, -3.058376, -1.428919, 4.014235, -1.775827,
    ]
    .into_iter()
    .rev()
    .fold(0.0, |sum, k| sum * cosine + k)
}
