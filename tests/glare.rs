//! Glare at viewpoints and daylight factors, against closed forms.

use crate::common::built;

use built::{Room, baked_to};
use glam::{DVec3, dvec3};
use haarlight::color::position_index;
use haarlight::scene::LightKind;
use haarlight::scene::sky::{SkyBrightness, SkyType, SkyWish};
use std::f64::consts::PI;

/// Errors of bakes.
const ERROR: f64 = 1.0;

/// A grey room of 6 m by 4 m by 3 m with a panel of 60 cm at its ceiling.
fn room() -> Room {
    let mut room = Room::new();
    let paint = room.paint(0.5);
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 6.0), [paint; 6]);
    let lamp = room.lamp(0.0, 5000.0 * PI);
    let corner = dvec3(1.7, 2.99, 1.2);
    room.quad(corner, 0.6 * DVec3::X, 0.6 * DVec3::Z, lamp);
    room
}

const EYE: DVec3 = dvec3(2.0, 1.2, 5.0);
const AHEAD: DVec3 = DVec3::NEG_Z;

/// Solid angle of the panel and what it adds to the sum of the rating over its luminance squared, by a fine grid.
fn panel() -> (f64, f64) {
    const N: usize = 400;
    let side = 0.6 / N as f64;
    let (mut solid, mut glare) = (0.0, 0.0);
    for k in 0..N * N {
        let (i, j) = ((k % N) as f64 + 0.5, (k / N) as f64 + 0.5);
        let way = dvec3(1.7 + i * side, 2.99, 1.2 + j * side) - EYE;
        let part = side * side * way.y / way.length().powi(3);
        solid += part;
        glare += part / position_index(AHEAD, DVec3::Y, way).powi(2);
    }
    (solid, glare)
}

#[test]
fn the_rating_of_a_panel_is_the_formula() {
    let mut room = room();
    // A light without extent has no luminance: it is named, and adds to the background alone.
    room.punctual(LightKind::Point, dvec3(1.0, 2.0, 1.0), DVec3::NEG_Y, 50.0);
    let bake = baked_to(ERROR, room.scene());
    let seen = bake.glare(EYE, AHEAD);
    let [(_, bright)] = &seen.luminaires[..] else {
        panic!("{seen:?}");
    };
    let (solid, glare) = panel();
    assert!((bright.luminance / 5000.0 - 1.0).abs() < 1e-4, "{seen:?}");
    assert!(
        (bright.solid_angle / solid - 1.0).abs() < 1e-3,
        "{seen:?} {solid}"
    );
    let of_panel = 5000.0_f64.powi(2) * glare;
    assert!((bright.glare / of_panel - 1.0).abs() < 5e-3, "{seen:?}");
    assert_eq!(seen.left_out.len(), 1, "{seen:?}");
    // What reaches the eye, less what comes straight from both lamps.
    let all = bake.probe(&[(EYE, AHEAD)])[0].xyz[1];
    let way = dvec3(1.0, 2.0, 1.0) - EYE;
    let point = 50.0 * way.dot(AHEAD) / way.length().powi(3);
    let direct = {
        const N: usize = 400;
        let side = 0.6 / N as f64;
        let part = |k: usize| {
            let (i, j) = ((k % N) as f64 + 0.5, (k / N) as f64 + 0.5);
            let way = dvec3(1.7 + i * side, 2.99, 1.2 + j * side) - EYE;
            5000.0 * side * side * way.y * way.dot(AHEAD) / way.length().powi(4)
        };
        (0..N * N).map(part).sum::<f64>()
    };
    let background = (all - direct - point) / PI;
    assert!(
        (seen.background / background - 1.0).abs() < 0.01,
        "{seen:?} {background}"
    );
    let rating = 8.0 * (0.25 / seen.background * of_panel).log10();
    assert!(
        (seen.rating.unwrap() - rating).abs() < 0.02,
        "{seen:?} {rating}"
    );
}

#[test]
fn what_hides_a_panel_takes_its_glare() {
    let board = |half: bool| {
        let mut room = room();
        let paint = room.paint(0.5);
        room.two_sided(paint);
        let width = if half { 0.3 } else { 0.6 };
        // Right below the panel, so that it hides what it covers of it.
        room.quad(
            dvec3(1.7, 2.98, 0.5),
            width * DVec3::X,
            2.5 * DVec3::Z,
            paint,
        );
        baked_to(ERROR, room.scene()).glare(EYE, AHEAD)
    };
    let half = board(true);
    let share = half.luminaires[0].1.solid_angle / panel().0;
    assert!((share - 0.5).abs() < 0.03, "{share} {half:?}");
    let none = board(false);
    assert!(none.luminaires.is_empty(), "{none:?}");
    assert_eq!(none.rating, Some(f64::NEG_INFINITY));
    // Nor does one see what is behind.
    assert!(
        baked_to(ERROR, room().scene())
            .glare(EYE, DVec3::Z)
            .luminaires
            .is_empty()
    );
}

/// Open ground has a factor of 100 %, the foot of a wall that hides half of a uniform sky 50 %; whatever lamps there are.
#[test]
fn daylight_factors_are_those_of_the_sky_alone() {
    let mut room = Room::new();
    let black = room.paint(0.0);
    room.quad(dvec3(-1.0, 0.0, 0.0), 2.0 * DVec3::Z, 2.0 * DVec3::X, black);
    room.quad(
        dvec3(-100.0, 0.0, 0.0),
        200.0 * DVec3::X,
        100.0 * DVec3::Y,
        black,
    );
    let lamp = dvec3(0.0, 1.0, 1.0);
    room.punctual(LightKind::Point, lamp, DVec3::NEG_Y, 5000.0);
    let wish = SkyWish {
        kind: Some(SkyType(5)),
        brightness: Some(SkyBrightness::Illuminance(8000.0)),
        ..SkyWish::default()
    };
    let scene = room.scene().under(&wish).unwrap();
    let outside = scene.sky_illuminance().unwrap();
    assert!((outside / 8000.0 - 1.0).abs() < 1e-6, "{outside}");
    let alone = scene.under_sky_alone().unwrap();
    assert!(alone.under_sky_alone().is_none());
    let point = [(dvec3(0.0, 0.0, 0.02), DVec3::Y)];
    let factor = baked_to(ERROR, alone).probe(&point)[0].xyz[1] / outside;
    assert!((factor - 0.5).abs() < 2e-3, "{factor}");
    // The lamp shines all the same.
    assert!(baked_to(ERROR, scene).probe(&point)[0].xyz[1] > 0.6 * outside);
}
