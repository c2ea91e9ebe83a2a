//! A desk of 2 m x 2 m in a closed room of its size, below a lamp that is all of the ceiling.

use crate::common::built::Room;
use glam::{DVec3, dvec3};

/// The paper takes half of the desk, what is plain the other half.
pub(crate) fn furnish(room: &mut Room, [paper, plain, lamp]: [usize; 3], walls: [usize; 4]) {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let [left, right, back, front] = walls;
    room.quad(DVec3::ZERO, 2.0 * z, x, paper);
    room.quad(x, 2.0 * z, x, plain);
    room.quad(2.0 * y, 2.0 * x, 2.0 * z, lamp);
    room.quad(DVec3::ZERO, 2.0 * y, 2.0 * z, left);
    room.quad(2.0 * x, 2.0 * z, 2.0 * y, right);
    room.quad(DVec3::ZERO, 2.0 * x, 2.0 * y, back);
    room.quad(2.0 * z, 2.0 * y, 2.0 * x, front);
}

/// Of the desk, the lamp and two walls.
pub(crate) fn points() -> Vec<(DVec3, DVec3)> {
    let mut points = Vec::new();
    for (a, b) in [(0.31, 0.42), (0.7, 1.4), (1.3, 0.9), (1.7, 1.6)] {
        points.push((dvec3(a, 0.0, b), DVec3::Y));
        points.push((dvec3(a, 2.0, b), DVec3::NEG_Y));
        points.push((dvec3(0.0, a, b), DVec3::X));
        points.push((dvec3(a, b, 0.0), DVec3::Z));
    }
    points
}
