//! Where the way of a ray that left a room is narrowest.

use super::gaps::{Exit, Gap};
use super::sides::{BEAM, Openings, RayStart, Wall};
use crate::geometry::sampling::{Pcg, around};
use glam::DVec3;

/// Angles that the rays about a way keep, as many by each power of two, radians: what stands 45 degrees away makes nothing narrow.
const ANGLES: [f64; 2] = [0.0005, 0.8];

/// What stands on all sides of a way leans to none: the mean of the directions toward it is shorter than this. On one side of an edge
/// it is 2 / pi.
const LEAN: f64 = 0.45;

impl Openings {
    /// Rays close about a ray that left tell what stands beside its way: its gap is where it crosses the plane of what is nearest, or on
    /// the box around the room if nothing is near, or on one side only.
    pub(super) fn gap(
        &self,
        start: &RayStart,
        exit: &Exit,
        meet: &(impl Fn(&RayStart, &[DVec3; BEAM]) -> [Option<Wall>; BEAM] + Sync),
        seed: u64,
    ) -> Gap {
        let Exit { place, way, .. } = *exit;
        let mut random = Pcg::new(seed);
        let [least, most] = ANGLES.map(f64::log2);
        let angles: [f64; BEAM] = std::array::from_fn(|k| {
            let share = (k as f64 + random.f64()) / BEAM as f64;
            (least + (most - least) * share).exp2()
        });
        let ways = angles.map(|angle| around(way, angle.cos(), random.f64()));
        let met = meet(start, &ways);
        // What lies along the ray, as the sides of a deep window and the floor do, makes it no narrower: its plane is crossed elsewhere.
        let beside = (0..BEAM).filter_map(|k| {
            let wall = met[k].filter(|_| start.normal.dot(ways[k]) > 0.0)?;
            let facing = wall.normal.dot(way);
            let straight = wall.distance * angles[k].cos();
            let by_plane = wall.distance * wall.normal.dot(ways[k]) / facing;
            let is_near = by_plane > 0.5 * straight && by_plane < 2.0 * straight;
            is_near.then_some((angles[k] / facing.abs(), by_plane, wall.normal))
        });
        let beside = beside.min_by(|a, b| a.0.total_cmp(&b.0));
        let (mut far, mut axis) = self.leaves(start.point, way);
        // The edge of a house before the sky has something on one side.
        let is_shut = |k: &usize| met[*k].is_some() || start.normal.dot(ways[*k]) <= 0.0;
        let sides = (0..BEAM).filter(is_shut).map(|k| {
            let aside = ways[k] - way * ways[k].dot(way);
            (1.0, aside.normalize_or_zero())
        });
        let (count, sum) = sides.fold((0.0, DVec3::ZERO), |a, b| (a.0 + b.0, a.1 + b.1));
        if let Some((_, by_plane, normal)) = beside
            && by_plane < far
            && sum.length() < LEAN * count
        {
            (far, axis) = (by_plane, normal.abs().max_position());
        }
        let at = start.point + way * far;
        Gap { place, at, axis }
    }
}
