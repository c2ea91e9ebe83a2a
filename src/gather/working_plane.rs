//! Points that represent the light of a whole room: a horizontal grid over its floor.
//!
//! The floor is the lowest large level of lit faces that look up: faces within [`LEVEL`] of each other are one level, and a level is large if
//! it has [`LARGE`] of the area of the largest. So a table is not a floor, nor is a hollow that hardly any light reaches, see [`DARK`]. Nor is
//! the ground outside: where enough of these faces have something above them, the rest do not count. The grid has the same spacing both ways
//! and lies [`HEIGHT`] above the floor, like the reference plane of daylight (EN 17037:2018); in rooms lower than twice that, on the floor
//! itself. No border along the walls is left out.

use crate::geometry::{NO_PLANE, Segment};
use crate::solve::Bake;
use glam::{DVec3, dvec3};
use std::collections::BTreeMap;

/// Height of the plane above the floor, m.
const HEIGHT: f64 = 0.85;
/// Rough number of points.
const POINTS: f64 = 150.0;
/// Points in one direction at the most: thin floors that run diagonally have few for their size.
const MOST: f64 = 200.0;
/// Height of one level, m.
const LEVEL: f64 = 0.05;
/// Distance above points at which the ways between them run, share of the room's half size: some millimetres.
const LIFT: f64 = 1e-3;
/// Share of the largest level's area that makes a level a floor.
const LARGE: f64 = 0.25;
/// A level with less light than this share of the brightest lies in a hollow: where walls meet badly light leaks into the ground below a
/// house, 5e-6 of the light on the lawn (sun-room of the shared rooms); nobody works at a daylight factor of .01 %.
const DARK: f64 = 1e-4;
/// Cosine of the greatest slope of a face that looks up, 2.6 degrees.
const UP: f64 = 0.999;

/// A horizontal grid of points over the floor of a room.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct WorkingPlane {
    /// Height of the floor in world space, m.
    pub floor: f64,
    /// Height of the points above the floor, m: .85, or 0 in low rooms.
    pub height: f64,
    /// Distance between neighbours, m.
    pub spacing: f64,
    /// Points in world space with their normals, straight up.
    pub points: Vec<(DVec3, DVec3)>,
    /// For each point the part of the plane that it lies in: nothing is between neighbours of a part. Parts of few points lie in
    /// cupboards and pillars.
    pub parts: Vec<usize>,
}

impl Bake {
    /// The working plane of the room; none where no face that looks up is lit.
    pub fn working_plane(&self) -> Option<WorkingPlane> {
        let mesh = self.mesh();
        let lit = self.lit_and_up();
        let height_of = |entry: usize| middle(corners(self, entry)).y;
        let mut levels: BTreeMap<i64, [f64; 2]> = BTreeMap::new();
        for (&entry, [area, light]) in &lit {
            let of = levels.entry(level(height_of(entry))).or_default();
            *of = [of[0] + area, of[1] + light];
        }
        // Rounding may divide a single plane into two levels.
        let with_next = |k: i64| {
            let of = |k: i64| levels.get(&k).copied().unwrap_or_default();
            [0, 1].map(|x| of(k)[x] + of(k + 1)[x])
        };
        let large = |levels: Vec<i64>| -> Vec<i64> {
            let area = |k: &i64| with_next(*k)[0];
            let most = levels.iter().map(area).fold(0.0, f64::max);
            let is_large = |k: &i64| area(k) >= LARGE * most;
            levels.into_iter().filter(is_large).collect()
        };
        let brightness = |k: &i64| {
            let [area, light] = with_next(*k);
            light / area
        };
        let all = large(levels.keys().copied().collect());
        let most = all.iter().map(brightness).fold(0.0, f64::max);
        let is_lit = |k: &i64| brightness(k) >= DARK * most;
        // Leave out hollows, which may be larger than the floor.
        let lit_levels = levels.keys().copied().filter(is_lit).collect();
        let lowest = large(lit_levels).into_iter().min()?;
        let of_floor = |entry: usize| (lowest..=lowest + 1).contains(&level(height_of(entry)));
        let faces: Vec<(usize, f64)> = (lit.into_iter())
            .filter(|&(entry, _)| of_floor(entry))
            .map(|(entry, [area, _])| (entry, area))
            .collect();
        let area: f64 = faces.iter().map(|(_, area)| area).sum();
        let moment: f64 = (faces.iter())
            .map(|&(entry, area)| area * height_of(entry))
            .sum();
        let floor = moment / area;
        let top = (mesh.positions.iter()).fold(f64::NEG_INFINITY, |top, p| top.max(p.y));
        let height = if top - floor < 2.0 * HEIGHT {
            0.0
        } else {
            HEIGHT
        };
        let triangles: Vec<[DVec3; 3]> = (faces.iter())
            .map(|&(entry, _)| corners(self, entry))
            .collect();
        let (spacing, places) = grid(&triangles, area);
        // On the floor itself, which may have a rug, or at one height.
        let at = |place: DVec3| match height > 0.0 {
            true => mesh.centre + dvec3(place.x, floor + height, place.z),
            false => mesh.centre + place,
        };
        let (keys, points): (Vec<_>, Vec<_>) = places
            .map(|(key, place)| (key, (at(place), DVec3::Y)))
            .unzip();
        let parts = self.parts(&keys, &points);
        Some(WorkingPlane {
            floor: mesh.centre.y + floor,
            height,
            spacing,
            points,
            parts,
        })
    }

    /// The part that each point of a grid lies in, as the index of the part's first point.
    fn parts(&self, keys: &[(i64, i64)], points: &[(DVec3, DVec3)]) -> Vec<usize> {
        let centre = self.mesh().centre;
        // On the floor itself, ways between points must not lie in it.
        let lift = LIFT * self.mesh().half_size * DVec3::Y;
        let place = |k: usize| points[k].0 - centre + lift;
        let numbers: BTreeMap<_, usize> = keys.iter().copied().zip(0..).collect();
        let mut parts: Vec<usize> = (0..points.len()).collect();
        for (k, &(i, j)) in keys.iter().enumerate() {
            for next in [(i + 1, j), (i, j + 1)] {
                let Some(&other) = numbers.get(&next) else {
                    continue;
                };
                let way = Segment::new(place(k), place(other), [NO_PLANE; 2]);
                if parts[k] != parts[other] && !self.rays().occluded(&way) {
                    let (to, from) = (parts[k].min(parts[other]), parts[k].max(parts[other]));
                    parts
                        .iter_mut()
                        .filter(|p| **p == from)
                        .for_each(|p| *p = to);
                }
            }
        }
        parts
    }

    /// Faces that look up, by their entry in the hierarchy, each with its lit area and the light on that; only those with something above
    /// them where these have [`LARGE`] of all the area.
    fn lit_and_up(&self) -> BTreeMap<usize, [f64; 2]> {
        let (tree, arrival) = (self.tree(), &self.light().arrival);
        let mut lit: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
        for leaf in tree.leaves() {
            let node = tree.node(leaf);
            let light = arrival.get(leaf as usize).map_or(0.0, |&a| f64::from(a));
            let Some(element) = tree.element(node).filter(|_| light > 0.0) else {
                continue;
            };
            let entry = element.face as usize;
            if tree.face_normal[entry].y >= UP {
                let of = lit.entry(entry).or_default();
                *of = [of[0] + node.area, of[1] + node.area * light];
            }
        }
        let area = |of: &BTreeMap<usize, [f64; 2]>| of.values().map(|[a, _]| a).sum::<f64>();
        let covered = |entry: &usize| {
            let corners = corners(self, *entry);
            let top = middle(corners) + 3.0 * self.mesh().half_size * DVec3::Y;
            let plane = self.mesh().plane[tree.faces[*entry].triangle as usize];
            let up = Segment::new(middle(corners), top, [plane, NO_PLANE]);
            self.rays().occluded(&up)
        };
        let mut within = lit.clone();
        within.retain(|entry, _| covered(entry));
        match area(&within) >= LARGE * area(&lit) {
            true => within,
            false => lit,
        }
    }
}

/// Corners of a face, recentred.
fn corners(bake: &Bake, entry: usize) -> [DVec3; 3] {
    bake.mesh().corners(bake.tree().faces[entry])
}

fn middle(corners: [DVec3; 3]) -> DVec3 {
    corners.iter().sum::<DVec3>() / 3.0
}

/// The level of a height.
fn level(height: f64) -> i64 {
    (height / LEVEL).round() as i64
}

/// The distance of neighbours, m, and the points of a grid over triangles by row and column, the highest where several triangles lie above each other;
/// `area` is that of all triangles.
fn grid(triangles: &[[DVec3; 3]], area: f64) -> (f64, impl Iterator<Item = ((i64, i64), DVec3)>) {
    let points = || triangles.iter().flatten();
    let low = points().fold(DVec3::INFINITY, |low, p| low.min(*p));
    let high = points().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
    let size = high - low;
    let spacing = (area / POINTS).sqrt().max(size.x.max(size.z) / MOST);
    // The same margin on both sides.
    let first = [[low.x, size.x], [low.z, size.z]].map(|[low, size]| {
        let count = (size / spacing).round().max(1.0);
        low + 0.5 * (size - (count - 1.0) * spacing)
    });
    let mut found: BTreeMap<(i64, i64), DVec3> = BTreeMap::new();
    for &[a, b, c] in triangles {
        let steps = |axis: usize, of: fn(DVec3) -> f64| {
            let [a, b, c] = [a, b, c].map(|p| (of(p) - first[axis]) / spacing);
            a.min(b).min(c).ceil() as i64..=a.max(b).max(c).floor() as i64
        };
        for (i, j) in steps(0, |p| p.x).flat_map(|i| steps(1, |p| p.z).map(move |j| (i, j))) {
            let x = first[0] + i as f64 * spacing;
            let z = first[1] + j as f64 * spacing;
            let turn = |a: DVec3, b: DVec3| (b.x - a.x) * (z - a.z) - (b.z - a.z) * (x - a.x);
            let turns = [turn(b, c), turn(c, a), turn(a, b)];
            let all: f64 = turns.iter().sum();
            if all != 0.0 && turns.iter().all(|turn| turn / all >= 0.0) {
                let y = (turns[0] * a.y + turns[1] * b.y + turns[2] * c.y) / all;
                let place = found.entry((i, j)).or_insert(dvec3(x, y, z));
                place.y = place.y.max(y);
            }
        }
    }
    (spacing, found.into_iter())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::tests::baked;

    fn plane_of(name: &'static str) -> WorkingPlane {
        baked(name, 1).working_plane().unwrap()
    }

    #[test]
    fn a_low_box_is_told_by_its_floor_and_a_room_above_it() {
        let cornell = plane_of("cornell.glb");
        assert_eq!(cornell.height, 0.0);
        let furnished = plane_of("furnished.glb");
        assert_eq!(furnished.height, HEIGHT);
        for plane in [&cornell, &furnished] {
            let count = plane.points.len();
            assert!((100..=200).contains(&count), "{count}");
            // The floor with the rug.
            assert!((0.0..0.01).contains(&plane.floor), "{}", plane.floor);
            for (point, normal) in &plane.points {
                let height = if plane.height > 0.0 { plane.floor } else { 0.0 } + plane.height;
                assert!((point.y - height).abs() < 1e-9, "{point}");
                assert_eq!(*normal, DVec3::Y);
            }
        }
    }

    #[test]
    fn places_lie_over_their_triangles() {
        // An L-shaped floor of area 3.
        let quad = |x: f64, z: f64| {
            let [a, b, c, d] = [[x, z], [x, z + 1.0], [x + 1.0, z + 1.0], [x + 1.0, z]]
                .map(|[x, z]| dvec3(x, 0.0, z));
            [[a, b, c], [a, c, d]]
        };
        let floor = [quad(0.0, 0.0), quad(1.0, 0.0), quad(0.0, 1.0)].concat();
        let (spacing, places) = grid(&floor, 3.0);
        let places: Vec<DVec3> = places.map(|(_, place)| place).collect();
        assert!((spacing - (3.0_f64 / POINTS).sqrt()).abs() < 1e-12);
        assert!(places.iter().all(|p| p.x <= 1.0 || p.z <= 1.0));
        assert!(places.len().abs_diff(150) < 20, "{}", places.len());
    }
}
