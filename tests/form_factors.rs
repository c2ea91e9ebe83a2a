//! Form factors against closed forms: points by Lambert's formula, patches by contour integrals, links as the solver
//! makes them, and the solver itself. Figures without another source are recomputed from the closed form that is named.

use crate::common::built;

use built::{Room, faces};
use glam::{DVec3, dvec3};
use haarlight::geometry::lambert_polygon;
use haarlight::link::exchange;
use haarlight::solve::{Bake, Settings};
use std::f64::consts::{PI, TAU};

/// `A F` of two convex polygons by their fans of triangles.
fn polygons(a: &[DVec3], b: &[DVec3]) -> f64 {
    let fan = |p: &[DVec3]| -> Vec<[DVec3; 3]> {
        (1..p.len() - 1).map(|k| [p[0], p[k], p[k + 1]]).collect()
    };
    let b = fan(b);
    fan(a)
        .iter()
        .map(|s| b.iter().map(|t| exchange(s, t)).sum::<f64>())
        .sum()
}

/// A rectangle by corner and edges; its front is where `u x v` points.
fn rectangle(corner: DVec3, u: DVec3, v: DVec3) -> [DVec3; 4] {
    [corner, corner + u, corner + u + v, corner + v]
}

fn near(got: f64, want: f64, tolerance: f64) {
    assert!(
        (got / want - 1.0).abs() <= tolerance,
        "{got} should be {want}, off by {:e}",
        got / want - 1.0
    );
}

/// Howell's catalogue, B-3 and B-4 (rectangle) and Lambert's polygon.
#[test]
fn from_an_element_of_surface() {
    let above = rectangle(DVec3::Z, DVec3::X, DVec3::Y);
    let f = |at: DVec3, n: DVec3, p: &[DVec3]| lambert_polygon(at, n, p);
    near(f(DVec3::ZERO, DVec3::Z, &above), 0.138531605994893, 1e-14);
    near(
        f(dvec3(0.5, 0.5, 0.0), DVec3::Z, &above),
        0.239456470460774,
        1e-14,
    );
    let wall = rectangle(DVec3::X, DVec3::Y, DVec3::Z);
    near(f(DVec3::ZERO, DVec3::Z, &wall), 0.055734197002554, 1e-13);
    let triangle = [DVec3::Z, dvec3(1.0, 0.0, 1.0), dvec3(0.0, 1.0, 1.0)];
    near(
        f(DVec3::ZERO, DVec3::Z, &triangle),
        0.0962250448649376,
        1e-14,
    );
    let half_below = rectangle(dvec3(1.0, -1.0, -1.0), 2.0 * DVec3::Y, 2.0 * DVec3::Z);
    near(
        f(DVec3::ZERO, DVec3::Z, &half_below),
        0.111468394005107,
        1e-13,
    );
}

/// The naive `A cos cos / (pi r^2)` gives 31.8 ... 3.2e11 here.
#[test]
fn next_to_a_square_the_factor_stays_below_one() {
    let square = rectangle(dvec3(-0.5, -0.5, 0.0), DVec3::X, DVec3::Y);
    for (h, one_minus) in [
        (0.1, 1.0 - 0.96833956),
        (0.01, 1.0 - 0.99967279),
        (0.001, 1.0 - 0.99999673),
        (1e-6, 3.27e-12),
    ] {
        let f = lambert_polygon(dvec3(0.0, 0.0, h), DVec3::NEG_Z, &square);
        assert!(f < 1.0, "{h}: {f}");
        near(1.0 - f, one_minus, 2e-3);
    }
}

/// Howell C-11 (parallel) and C-14 (perpendicular).
#[test]
fn between_rectangles() {
    let floor = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
    let lid = |h: f64, w: f64| rectangle(dvec3(0.0, 0.0, h), DVec3::Y, w * DVec3::X);
    near(polygons(&floor, &lid(1.0, 1.0)), 0.199824895698387, 1e-9);
    near(polygons(&floor, &lid(10.0, 1.0)), 0.003162056838755, 1e-9);
    near(polygons(&floor, &lid(0.1, 1.0)), 0.826994522397, 1e-11);
    near(polygons(&floor, &lid(0.01, 1.0)), 0.980416602926, 1e-11);
    let long = rectangle(DVec3::ZERO, 2.0 * DVec3::X, DVec3::Y);
    near(
        polygons(&long, &lid(1.0, 2.0)) / 2.0,
        0.285875384850715,
        1e-9,
    );
    let wall = |h: f64| rectangle(DVec3::ZERO, DVec3::Y, h * DVec3::Z);
    near(polygons(&floor, &wall(1.0)), 0.200043776075403, 1e-9);
    let deep = rectangle(DVec3::ZERO, 2.0 * DVec3::X, DVec3::Y);
    near(polygons(&deep, &wall(1.0)) / 2.0, 0.116426301397681, 1e-9);
    near(polygons(&wall(1.0), &deep), 0.232852602795362, 1e-9);
}

/// A box of 10 x 6 x 3: the floor's factors, and closure of every face.
#[test]
fn between_the_faces_of_a_box() {
    let faces = faces(DVec3::ZERO, dvec3(10.0, 6.0, 3.0));
    let f = |a: usize, b: usize| polygons(&faces[a], &faces[b]);
    // Order of faces: -x, +x, -y, +y, -z, +z.
    near(f(4, 5) / 60.0, 0.488700936440038, 1e-9);
    near(f(4, 2) / 60.0, 0.162387354926514, 1e-9);
    near(f(4, 0) / 60.0, 0.093262176853466, 1e-9);
    for (a, area) in [18.0, 18.0, 30.0, 30.0, 60.0, 60.0].into_iter().enumerate() {
        let sum: f64 = (0..6).filter(|&b| b != a).map(|b| f(a, b)).sum();
        near(sum / area, 1.0, 1e-9);
    }
}

/// Howell C-41, on polygons of 96 corners that have the disks' areas.
#[test]
fn between_coaxial_disks() {
    const CORNERS: usize = 96;
    let disk = |r: f64, z: f64, up: bool| -> Vec<DVec3> {
        let share = TAU / CORNERS as f64;
        // A polygon of the same area as the circle: the rest of the error is of fourth order in the angle.
        let r = r * (share / share.sin()).sqrt();
        let mut corners: Vec<DVec3> = (0..CORNERS)
            .map(|k| {
                dvec3(
                    r * (share * k as f64).cos(),
                    r * (share * k as f64).sin(),
                    z,
                )
            })
            .collect();
        if !up {
            corners.reverse();
        }
        corners
    };
    for (r1, r2, want) in [
        (1.0, 1.0, 0.381966011250105),
        (1.0, 2.0, 0.763932022500210),
        (0.5, 1.0, 0.468871125850725),
    ] {
        let f = polygons(&disk(r1, 0.0, true), &disk(r2, 1.0, false)) / (PI * r1 * r1);
        near(f, want, 2e-7);
    }
}

/// Crossed strings: `sqrt(1 + (w/d)^2)` and so on; a strip of 1 m before one of 2 km.
#[test]
fn between_infinite_strips() {
    const LONG: f64 = 1000.0;
    let short = rectangle(dvec3(0.0, -0.5, 0.0), DVec3::X, DVec3::Y);
    let parallel = rectangle(dvec3(0.0, -LONG, 1.0), 2.0 * LONG * DVec3::Y, DVec3::X);
    near(polygons(&short, &parallel), 2.0_f64.sqrt() - 1.0, 1e-8);
    let upright = rectangle(dvec3(0.0, -LONG, 0.0), 2.0 * LONG * DVec3::Y, DVec3::Z);
    near(polygons(&short, &upright), 1.0 - 0.5_f64.sqrt(), 1e-8);
}

/// Both sides of a groove of angle a: `1 - sin(a/2)`.
#[test]
fn across_a_groove() {
    const LONG: f64 = 1000.0;
    for (degrees, want) in [
        (60.0, 0.5),
        (30.0, 0.741180955),
        (10.0, 0.912844257),
        (1.0, 0.991273465),
    ] {
        let angle = f64::to_radians(degrees);
        let short = rectangle(dvec3(0.0, -0.5, 0.0), DVec3::X, DVec3::Y);
        let up = dvec3(angle.cos(), 0.0, angle.sin());
        let long = rectangle(dvec3(0.0, -LONG, 0.0), 2.0 * LONG * DVec3::Y, up);
        near(polygons(&short, &long), want, 3e-9);
    }
}

/// Any two faces of a regular tetrahedron: 1/3.
#[test]
fn between_the_faces_of_a_tetrahedron() {
    let c = [
        dvec3(1., 1., 1.),
        dvec3(1., -1., -1.),
        dvec3(-1., 1., -1.),
        dvec3(-1., -1., 1.),
    ];
    let area = 2.0 * 3.0_f64.sqrt();
    for (a, b) in [
        ([0, 2, 1], [0, 1, 3]),
        ([0, 3, 2], [1, 2, 3]),
        ([0, 1, 3], [1, 2, 3]),
    ] {
        let f = exchange(&a.map(|k| c[k]), &b.map(|k| c[k]));
        near(f / area, 1.0 / 3.0, 1e-12);
    }
}

/// The solver with its default settings: a lamp of 1 lm/m2 and a black receiver; mean irradiance is `F`.
#[test]
fn through_the_solver() {
    // Lamp and receiver as (corner, u, v), the factor from receiver to lamp.
    let unit = |z: f64| (dvec3(0.0, 0.0, z), DVec3::Y, DVec3::X);
    let floor = (DVec3::ZERO, DVec3::X, DVec3::Y);
    let cases = [
        (unit(1.0), floor, 0.199824895698387),
        (unit(10.0), floor, 0.003162056838755),
        (unit(0.1), floor, 0.826994522397),
        ((DVec3::ZERO, DVec3::Y, DVec3::Z), floor, 0.200043776075403),
        (
            (DVec3::ZERO, DVec3::Y, DVec3::Z),
            (DVec3::ZERO, 2.0 * DVec3::X, DVec3::Y),
            0.116426301397681,
        ),
    ];
    for (lamp, receiver, want) in cases {
        let mut room = Room::new();
        let glow = room.lamp(0.0, 1000.0);
        let black = room.paint(0.0);
        room.quad(lamp.0, lamp.1, lamp.2, glow);
        room.quad(receiver.0, receiver.1, receiver.2, black);
        let mut bake = Bake::new(room.scene(), Settings::default());
        bake.run();
        let (mut flux, mut area) = (0.0, 0.0);
        for (k, &leaf) in bake.light().leaves.iter().enumerate() {
            let node = bake.tree().node(leaf);
            let normal = receiver.1.cross(receiver.2).normalize();
            if node.normal.dot(normal) > 1.0 - 1e-9 {
                let lux = bake.lanes().tristimulus(bake.light().irradiance.row(k))[1];
                flux += node.area * lux;
                area += node.area;
            }
        }
        near(flux / area / 1000.0, want, 5e-4);
    }
}
