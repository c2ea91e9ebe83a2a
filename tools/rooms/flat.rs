//! A furnished flat of two rooms, 4.2 x 3.6 m and 3.18 x 3.6 m, 2.6 m high, joined by a door opening. One tube close below the
//! ceiling of the first room lights both.

use super::glb::{Glb, Mesh};
use super::shapes::{block, tube};
use glam::{DMat4, DVec3, dvec3};
use std::f64::consts::FRAC_PI_2;

const HEIGHT: f64 = 2.6;
/// Both sides of the wall between the rooms, and the far end.
const WALL: [f64; 2] = [4.2, 4.32];
const FAR: f64 = 7.5;
const DEPTH: f64 = 3.6;
/// The door: z from and to, and height.
const DOOR: [f64; 3] = [2.4, 3.3, 2.05];

pub(crate) fn room() -> Glb {
    let mut glb = Glb::default();
    shell(&mut glb);
    lamp(&mut glb);
    furniture(&mut glb);
    glb.camera(
        "living room",
        dvec3(0.3, 1.6, 3.3),
        dvec3(2.7, 0.8, 0.4),
        1.1,
        4.0 / 3.0,
    );
    glb.camera(
        "bedroom",
        dvec3(7.2, 1.6, 3.3),
        dvec3(4.6, 0.6, 1.4),
        1.1,
        4.0 / 3.0,
    );
    glb
}

/// A rectangle along the axes, seen from a point.
fn flat(mesh: &mut Mesh, low: [f64; 3], high: [f64; 3], toward: DVec3) {
    let (low, high) = (DVec3::from_array(low), DVec3::from_array(high));
    let along: Vec<DVec3> = DVec3::AXES
        .into_iter()
        .map(|axis| axis * (high - low).dot(axis))
        .filter(|edge| edge.length() > 0.0)
        .collect();
    let [u, v] = [along[0], along[1]];
    mesh.quad([low, low + u, low + u + v, low + v], toward);
}

fn shell(glb: &mut Glb) {
    let plaster = glb.paint("plaster", [0.75, 0.74, 0.7]);
    let ceiling = glb.paint("ceiling", [0.86; 3]);
    let floor = glb.paint("floor", [0.32, 0.2, 0.12]);
    let frame = glb.paint("door frame", [0.55, 0.52, 0.48]);
    let [from, to, top] = DOOR;
    let [mut walls, mut above, mut below, mut around] = [(); 4].map(|()| Mesh::default());
    for [left, right] in [[0.0, WALL[0]], [WALL[1], FAR]] {
        let middle = dvec3(0.5 * (left + right), 0.5 * HEIGHT, 0.5 * DEPTH);
        flat(&mut below, [left, 0.0, 0.0], [right, 0.0, DEPTH], middle);
        flat(
            &mut above,
            [left, HEIGHT, 0.0],
            [right, HEIGHT, DEPTH],
            middle,
        );
        for z in [0.0, DEPTH] {
            flat(&mut walls, [left, 0.0, z], [right, HEIGHT, z], middle);
        }
        let [whole, door] = if left == 0.0 {
            [left, right]
        } else {
            [right, left]
        };
        flat(
            &mut walls,
            [whole, 0.0, 0.0],
            [whole, HEIGHT, DEPTH],
            middle,
        );
        flat(&mut walls, [door, 0.0, 0.0], [door, HEIGHT, from], middle);
        flat(&mut walls, [door, 0.0, to], [door, HEIGHT, DEPTH], middle);
        flat(&mut walls, [door, top, from], [door, HEIGHT, to], middle);
    }
    let middle = dvec3(0.5 * (WALL[0] + WALL[1]), 1.0, 0.5 * (from + to));
    flat(&mut below, [WALL[0], 0.0, from], [WALL[1], 0.0, to], middle);
    flat(
        &mut around,
        [WALL[0], top, from],
        [WALL[1], top, to],
        middle,
    );
    for z in [from, to] {
        flat(&mut around, [WALL[0], 0.0, z], [WALL[1], top, z], middle);
    }
    let parts = [
        (&walls, plaster),
        (&above, ceiling),
        (&below, floor),
        (&around, frame),
    ];
    glb.draw("shell", &parts);
}

/// A tube of 1.2 m and 2,700 lm about, and what it hangs in.
fn lamp(glb: &mut Glb) {
    let glow = glb.lamp("tube", [0.7; 3], [1.0, 0.97, 0.9], 7200.0);
    let metal = glb.paint("housing", [0.8; 3]);
    let middle = dvec3(2.1, HEIGHT - 0.08, 1.8);
    let lying =
        DMat4::from_translation(middle - dvec3(-0.6, 0.0, 0.0)) * DMat4::from_rotation_z(FRAC_PI_2);
    let tube = tube([0.0; 3], 0.019, 1.2, 8).moved(lying);
    let housing = block(
        [middle.x - 0.62, HEIGHT - 0.05, middle.z - 0.04],
        [middle.x + 0.62, HEIGHT - 0.01, middle.z + 0.04],
    );
    glb.draw("lamp", &[(&tube, glow), (&housing, metal)]);
}

fn furniture(glb: &mut Glb) {
    let oak = glb.paint("oak", [0.5, 0.36, 0.2]);
    let white = glb.paint("lacquer", [0.82, 0.82, 0.8]);
    let linen = glb.paint("linen", [0.6, 0.62, 0.7]);
    let wool = glb.paint("wool", [0.45, 0.12, 0.1]);
    let mut table = block([1.2, 0.72, 1.9], [2.8, 0.76, 2.8]);
    for x in [1.22, 2.72] {
        for z in [1.92, 2.72] {
            table.append(&block([x, 0.0, z], [x + 0.06, 0.72, z + 0.06]));
        }
    }
    glb.draw("table", &[(&table, oak)]);
    let mut shelf = block([0.4, 0.0, 0.005], [1.6, 1.8, 0.02]);
    for x in [0.4, 1.58] {
        shelf.append(&block([x, 0.0, 0.02], [x + 0.02, 1.8, 0.34]));
    }
    for y in [0.08, 0.65, 1.22, 1.78] {
        shelf.append(&block([0.42, y, 0.02], [1.58, y + 0.02, 0.34]));
    }
    glb.draw("shelf", &[(&shelf, white)]);
    let mut bed = block([5.3, 0.12, 0.1], [7.3, 0.5, 1.7]);
    bed.append(&block([6.8, 0.5, 0.3], [7.2, 0.62, 1.5]));
    glb.draw("bed", &[(&bed, linen)]);
    let board = block([7.32, 0.0, 0.05], [7.38, 1.0, 1.75]);
    glb.draw("headboard", &[(&board, oak)]);
    let mut rug = Mesh::default();
    flat(
        &mut rug,
        [5.0, 0.01, 1.9],
        [6.8, 0.01, 3.1],
        dvec3(6.0, 2.0, 2.5),
    );
    glb.draw("rug", &[(&rug, wool)]);
}
