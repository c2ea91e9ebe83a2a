//! Light that is easily missed or counted twice: narrow spots, sun through a small hole, faces that lie in others.

use crate::common::built;

use built::{Room, baked_to};
use glam::{DVec3, dvec3};
use haarlight::hierarchy::Mesh;
use haarlight::scene::LightKind;
use std::f64::consts::PI;

/// Errors of bakes.
const ERROR: f64 = 1.0;

/// The pool of a cone of 1 degree is 5 cm across, on a floor of 24 m2 in two triangles.
#[test]
fn narrow_spots_light_what_their_lumens_say() {
    for degrees in [1.0_f64, 2.0, 5.0, 40.0] {
        let mut room = Room::new();
        let grey = room.paint(0.5);
        room.hollow(DVec3::ZERO, dvec3(6.0, 3.0, 4.0), [grey; 6]);
        let (inner, outer) = (0.0, (0.5 * degrees).to_radians());
        let spot = LightKind::Spot { inner, outer };
        room.punctual(spot, dvec3(3.0, 2.8, 2.0), dvec3(0.6, -1.0, 0.2), 10_000.0);
        let lumens = 10_000.0 * 2.0 * PI * (1.0 - outer.cos()) / 3.0;
        let bake = baked_to(ERROR, room.scene());
        for round in bake.rounds() {
            let share = round.flux.received_lm / lumens;
            assert!((share - 1.0).abs() < 0.01, "{degrees} degrees: {share}");
        }
    }
}

/// .3 m in a roof of 20 by 15 m: points of the floor's first leaves are metres apart.
#[test]
fn sun_through_a_small_hole_is_found_and_counted() {
    let mut room = Room::new();
    let grey = room.paint(0.8);
    let (size, hole) = (dvec3(20.0, 8.0, 15.0), 0.3);
    let (x, z) = (9.0, 7.0);
    let sides = built::faces(DVec3::ZERO, size);
    for side in [0, 1, 2, 4, 5] {
        room.polygon(&sides[side], grey);
    }
    let strips = [
        [0.0, size.x, 0.0, z],
        [0.0, size.x, z + hole, size.z],
        [0.0, x, z, z + hole],
        [x + hole, size.x, z, z + hole],
    ];
    for [left, right, back, front] in strips {
        let corner = dvec3(left, size.y, back);
        room.quad(
            corner,
            DVec3::X * (right - left),
            DVec3::Z * (front - back),
            grey,
        );
    }
    let direction = dvec3(0.3, -1.0, 0.4).normalize();
    room.punctual(LightKind::Directional, DVec3::ZERO, direction, 100_000.0);
    let lumens = 100_000.0 * hole * hole * -direction.y;
    let bake = baked_to(ERROR, room.scene());
    let share = bake.rounds().last().unwrap().flux.received_lm / lumens;
    // .979 is found; the rest is lost on leaves along the edge of the patch. Without rays from the sun it is 0.
    assert!((share - 1.0).abs() < 0.03, "{share}");
}

/// A carpet that lies in the plane of the floor lights the room as one that lies upon it.
#[test]
fn what_lies_in_a_floor_is_raised() {
    let with_carpet = |height: f64| {
        let mut room = Room::new();
        let (grey, dark) = (room.paint(0.8), room.paint(0.1));
        room.hollow(DVec3::ZERO, dvec3(4.0, 2.5, 3.0), [grey; 6]);
        room.quad(
            dvec3(0.5, height, 0.5),
            DVec3::Z * 2.0,
            DVec3::X * 3.0,
            dark,
        );
        room.point(dvec3(2.0, 2.0, 1.5), 1000.0);
        room.scene()
    };
    let flush = with_carpet(0.0);
    let [raised] = Mesh::new(&flush).raised.try_into().unwrap();
    assert_eq!(raised.surfaces, [6, 2]);
    assert!(
        (raised.area - 6.0).abs() < 1e-9 && raised.height < 1e-3,
        "{raised:?}"
    );
    assert!(Mesh::new(&with_carpet(0.01)).raised.is_empty());
    let lux = [flush, with_carpet(0.002)].map(|scene| {
        let bake = baked_to(ERROR, scene);
        let received = bake.rounds().last().unwrap().flux.received_lm;
        assert!((received / 1000.0 - 1.0).abs() < 0.02, "{received}");
        let on_carpet = |y: f64| (dvec3(2.0, y, 1.4), DVec3::Y);
        let points = [
            (dvec3(2.0, 2.49, 0.2), DVec3::NEG_Y),
            on_carpet(0.0),
            on_carpet(1e-4),
            on_carpet(0.003),
        ];
        let probed = bake.probe(&points);
        [0, 1, 2, 3].map(|k| probed[k].xyz[1])
    });
    assert!((lux[0][0] / lux[1][0] - 1.0).abs() < 0.02, "{lux:?}");
    // On the carpet where the file has it, below where rays meet it, it is as bright as right above.
    let [_, on, low, above] = lux[0];
    assert!((on / above - 1.0).abs() < 0.01, "{lux:?}");
    assert!((low / above - 1.0).abs() < 0.01, "{lux:?}");
    assert!((above / lux[1][3] - 1.0).abs() < 0.02, "{lux:?}");
}

/// Shading normals that lean toward a sun behind the face: its own plane hides nothing, and in a vault nothing else would.
#[test]
fn no_sun_comes_through_a_face_with_leaning_normals() {
    let mut room = Room::new();
    let black = room.paint(0.0);
    room.quad(
        dvec3(-1.0, 2.0, -1.0),
        DVec3::X * 2.0,
        DVec3::Z * 2.0,
        black,
    );
    room.quad(
        // The shade falls 23 m away.
        dvec3(-10.0, 0.0, -1.0),
        DVec3::Z * 2.0,
        DVec3::X * 40.0,
        black,
    );
    let low = 5.0_f64.to_radians();
    let direction = dvec3(low.cos(), -low.sin(), 0.0);
    room.punctual(LightKind::Directional, DVec3::ZERO, direction, 1000.0);
    let mut scene = room.scene();
    let leaning = dvec3(-(2.0 * low).sin(), -(2.0 * low).cos(), 0.0);
    assert!(leaning.dot(direction) < 0.0);
    scene.surfaces[0].normals = Some(vec![leaning.as_vec3(); 4]);
    let baked = baked_to(ERROR, scene).baked(&|_, _| ());
    for part in baked.surfaces.iter().filter(|part| part.surface == 0) {
        for vertex in &part.vertices {
            assert_eq!(vertex.irradiance, [0.0; 3]);
        }
    }
    let floor = baked
        .surfaces
        .iter()
        .find(|part| part.surface == 1)
        .unwrap();
    assert!(
        floor
            .vertices
            .iter()
            .any(|vertex| vertex.irradiance[1] > 50.0)
    );
}
