//! Floors of furnished living rooms: a scene as large as one likes, for measuring time and memory.
//!
//! The rooms are closed against each other. Their furniture is the same, and each has nodes of its own, so that light is worked out in
//! every one of them.

use super::furnished;
use super::glb::Glb;
use glam::dvec3;

/// Triangles of one room, about.
const ROOM: usize = 12_000;
/// Rooms along a floor, and across.
const FLOOR: [usize; 2] = [5, 2];
/// From room to room, m: their sizes with walls, niches and windows between.
const STEP: [f64; 3] = [6.4, 3.1, 5.6];

/// As many rooms as come nearest to `triangles`.
pub(crate) fn room(triangles: usize) -> Glb {
    let mut glb = furnished::room(ROOM);
    let rooms = (triangles as f64 / glb.triangles() as f64).round().max(1.0) as usize;
    let [along, across] = FLOOR;
    let places: Vec<_> = (0..rooms)
        .map(|k| {
            let (floor, place) = (k / (along * across), k % (along * across));
            let [x, z] = [place % along, place / along];
            dvec3(
                STEP[0] * x as f64,
                STEP[1] * floor as f64,
                STEP[2] * z as f64,
            )
        })
        .collect();
    glb.repeat(&places);
    glb
}
