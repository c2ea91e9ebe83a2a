//! Small openings far away: as right as a wall of glass. By rays, in rooms of many triangles, beside quadrature.

use crate::common::built;
use crate::common::daylit;

use built::Room;
use daylit::{LUX, glanced, through, traced, wish};
use glam::{DVec3, dvec3};
use haarlight::color::{KM, Observer};
use haarlight::scene::sky::{Distribution, SkyWish, direction};
use haarlight::solve::Bake;

/// A black room of 4 m x 3 m x 12 m, cut into more triangles than are clipped exactly, with an opening of a width and a height in the
/// middle of its wall z = 0; returns the opening. With a terrace the room's box goes on outside for 1.5 m all around: what is open is then
/// not in its sides.
fn long_room(width: f64, height: f64, terrace: bool) -> (Room, [DVec3; 3]) {
    let mut room = Room::new();
    let paint = room.paint(0.0);
    let mut panel = |corner: DVec3, u: DVec3, v: DVec3, cuts: u32| {
        let n = f64::from(cuts);
        for k in 0..cuts * cuts {
            let at = corner + u * (f64::from(k / cuts) / n) + v * (f64::from(k % cuts) / n);
            room.quad(at, u / n, v / n, paint);
        }
    };
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    panel(DVec3::ZERO, 12.0 * z, 4.0 * x, 8);
    panel(3.0 * y, 4.0 * x, 12.0 * z, 8);
    panel(DVec3::ZERO, 3.0 * y, 12.0 * z, 8);
    panel(4.0 * x, 12.0 * z, 3.0 * y, 8);
    panel(12.0 * z, 3.0 * y, 4.0 * x, 8);
    let (beside, below) = (0.5 * (4.0 - width), 0.5 * (3.0 - height));
    let corner = beside * x + below * y;
    for outward in [false, true] {
        let mut wall = |at: DVec3, u: DVec3, v: DVec3| match outward {
            true => panel(at, v, u, 1),
            false => panel(at, u, v, 1),
        };
        if terrace || !outward {
            if beside > 0.0 {
                wall(DVec3::ZERO, beside * x, 3.0 * y);
                wall((4.0 - beside) * x, beside * x, 3.0 * y);
            }
            if below > 0.0 {
                wall(beside * x, width * x, below * y);
                wall(beside * x + (3.0 - below) * y, width * x, below * y);
            }
        }
    }
    if terrace {
        panel(dvec3(-1.5, 0.0, -1.5), 1.5 * z, 7.0 * x, 2);
    }
    (room, [corner, width * x, height * y])
}

/// Points of the floor, a side wall and the wall opposite.
fn points() -> Vec<(DVec3, DVec3)> {
    let floor = (0..11).map(|k| {
        (
            dvec3(1.1 + 0.07 * f64::from(k), 0.0, 1.2 + f64::from(k)),
            DVec3::Y,
        )
    });
    let side = (0..11).map(|k| {
        (
            dvec3(4.0, 1.0 + 0.1 * f64::from(k), 1.1 + f64::from(k)),
            DVec3::NEG_X,
        )
    });
    let far = (0..5).map(|k| (dvec3(0.5 + 0.7 * f64::from(k), 1.3, 12.0), DVec3::NEG_Z));
    floor.chain(side).chain(far).collect()
}

/// An overcast sky over black ground, which hides nothing of it.
fn sky() -> SkyWish {
    SkyWish {
        ground: Some(0.0),
        ..wish(1)
    }
}

/// Illuminances by quadrature.
fn truth(opening: [DVec3; 3]) -> Vec<f64> {
    let sky = Distribution::new(1, direction(60.0, 0.0));
    let of = |at| LUX * through(|d| sky.radiance(d), 0.0, opening, at);
    points().into_iter().map(of).collect()
}

/// Ratios to quadrature less 1, ascending.
fn errors(bake: &Bake, opening: [DVec3; 3]) -> Vec<f64> {
    let got = bake.probe(&points());
    let ratios = got
        .iter()
        .zip(truth(opening))
        // Those above the opening see nothing but ground by it.
        .filter(|(_, want)| *want > 0.0)
        .map(|(p, want)| p.xyz[1] / want - 1.0);
    let mut errors: Vec<f64> = ratios.collect();
    errors.sort_by(f64::total_cmp);
    println!("{errors:.4?}");
    errors
}

/// Small openings and, as the last, all of the wall.
const OPENINGS: [(f64, f64); 5] = [(0.02, 2.0), (0.1, 0.1), (0.3, 0.3), (2.0, 1.0), (4.0, 3.0)];

/// Holds every point within `most` of the truth, and the root mean square of each opening within `rms` and within a quarter more than that
/// of a wall of glass.
fn holds(terrace: bool, most: f64, rms: f64) {
    let found = OPENINGS.map(|(width, height)| {
        let (room, opening) = long_room(width, height, terrace);
        let errors = errors(&glanced(room, &sky()), opening);
        let worst = errors.iter().fold(0.0, |worst: f64, e| worst.max(e.abs()));
        let squares: f64 = errors.iter().map(|e| e * e).sum();
        let rms = (squares / errors.len() as f64).sqrt();
        println!("{width} x {height}: {rms:.4}, worst {worst:.4}");
        (rms, worst)
    });
    let wall = found[OPENINGS.len() - 1].0;
    for ((width, height), (got, worst)) in OPENINGS.into_iter().zip(found) {
        assert!(worst < most, "{width} x {height}: {worst}");
        assert!(got < rms, "{width} x {height}: {got}");
        assert!(got < 1.25 * wall, "{width} x {height}: {got}, wall {wall}");
    }
}

#[test]
fn small_openings_in_the_outermost_wall_are_as_right_as_a_wall_of_glass() {
    holds(false, 0.0075, 0.0025);
}

/// Here the room goes on beyond the opening, on a terrace: from there much sky is seen by which nothing comes in. Points that see a strip
/// of the sky above black ground are off most.
#[test]
fn small_openings_in_inner_walls_are_as_right_as_a_wall_of_glass_there() {
    holds(true, 0.05, 0.02);
}

/// The audit's paths look through them, too.
#[test]
fn paths_find_small_openings() {
    let (room, opening) = long_room(0.02, 2.0, false);
    let scene = room.scene().under(&sky()).unwrap();
    let bake = Bake::new(scene, haarlight::solve::Settings::default());
    let scene = bake.scene();
    let weights = Observer::cie1931().weights(&scene.grid)[1].map(|y| KM * y);
    let answers = traced(&bake, points(), 1024);
    for (answer, want) in answers.iter().zip(truth(opening)) {
        let (got, noise) = answer.linear(&weights);
        println!("{got:.5} for {want:.5}, {noise:.5}");
        assert!(noise < 0.02 * want, "{noise} of {want}");
        assert!(
            (got - want).abs() < 0.003 * want + 4.0 * noise,
            "{got} for {want}"
        );
    }
}
