//! Which triangles lie in one plane.
//!
//! Two triangles share an id when the corners of the one with the smaller altitude are all within [`TOLERANCE`] times the scene's
//! diagonal of the plane of the other, whichever way they face. The larger triangle always lends the plane, so that a chain of nearly
//! flat neighbours does not drift: triangles are taken by falling altitude, and each joins the first plane that holds it.
//! Candidates come from a hash grid over (normal, offset) whose cell is as wide as the normal of the triangle at hand is
//! uncertain, 3 tolerance / altitude.

use glam::DVec3;
use std::collections::HashMap;

/// How far from a plane its triangles' corners may be, of the diagonal of the scene's box: about one rounding of f32
/// coordinates. In a room of 10 m this is below 1 micrometre.
pub const TOLERANCE: f64 = 4e-8;

/// Cell of the first grid, in units of the normal; each next grid is coarser by [`COARSER`].
const FIRST_CELL: f64 = 1e-6;

/// Ratio of the cells of two grids: few grids, few false candidates.
const COARSER: f64 = 8.0;

/// A triangle's own plane.
#[derive(Clone, Copy)]
struct Plane {
    normal: DVec3,
    offset: f64,
    /// The shortest altitude of the triangle.
    altitude: f64,
}

/// One id for each triangle; equal ids mean one plane. Ids count up from 0 in order of first use. A triangle without area, or with
/// an index out of range or a coordinate that is not finite, has an id of its own.
pub fn plane_ids(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<u32> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &p in positions.iter().filter(|p| p.is_finite()) {
        low = low.min(p);
        high = high.max(p);
    }
    let centre = 0.5 * (low + high);
    let tolerance = TOLERANCE * (high - low).length();
    let corners: Vec<Option<[DVec3; 3]>> = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|k| positions.get(k as usize).map(|&p| p - centre));
            Some([a?, b?, c?]).filter(|t| t.iter().all(|p| p.is_finite()))
        })
        .collect();
    let planes: Vec<_> = corners
        .iter()
        .map(|t| t.as_ref().and_then(|t| own_plane(t, tolerance)))
        .collect();

    let mut order: Vec<usize> = (0..triangles.len()).collect();
    let altitude = |k: usize| planes[k].map_or(0.0, |p| p.altitude);
    order.sort_by(|&a, &b| altitude(b).total_cmp(&altitude(a)).then(a.cmp(&b)));

    let mut leaders: Vec<Plane> = Vec::new();
    let mut leader_of = vec![usize::MAX; triangles.len()];
    let mut grid = Grid::new(FIRST_CELL, tolerance, centre.distance(high));
    for k in order {
        let (Some(plane), Some(corners)) = (planes[k], corners[k]) else {
            continue;
        };
        let uncertain = (3.0 * tolerance / plane.altitude).min(1.0);
        while grid.cell < 2.0 * uncertain {
            grid = grid.coarser(&leaders);
        }
        let found = grid.candidates(&plane).filter(|&l| {
            let leader = &leaders[l];
            corners
                .iter()
                .all(|p| (leader.normal.dot(*p) - leader.offset).abs() <= tolerance)
        });
        leader_of[k] = found.min().unwrap_or_else(|| {
            grid.insert(leaders.len(), &plane);
            leaders.push(plane);
            leaders.len() - 1
        });
    }
    number(&leader_of)
}

/// Renumbers in order of first use; those without a leader each get their own number.
fn number(leader_of: &[usize]) -> Vec<u32> {
    let mut names = vec![u32::MAX; leader_of.len()];
    let mut next = 0u32;
    let mut fresh = || {
        next += 1;
        next - 1
    };
    leader_of
        .iter()
        .map(|&leader| {
            if leader == usize::MAX {
                return fresh();
            }
            if names[leader] == u32::MAX {
                names[leader] = fresh();
            }
            names[leader]
        })
        .collect()
}

/// None when the triangle is a needle or a point.
fn own_plane([a, b, c]: &[DVec3; 3], tolerance: f64) -> Option<Plane> {
    let cross = (b - a).cross(c - a);
    let longest = a.distance(*b).max(b.distance(*c)).max(c.distance(*a));
    let altitude = cross.length() / longest;
    let normal = cross.try_normalize()?;
    (altitude > tolerance).then(|| Plane {
        normal,
        offset: normal.dot((a + b + c) / 3.0),
        altitude,
    })
}

/// Planes by normal and offset, in cells of one size; both signs of a plane are looked up.
struct Grid {
    cell: f64,
    offset_cell: f64,
    tolerance: f64,
    radius: f64,
    /// Last leader in a cell.
    last: HashMap<[i64; 4], usize>,
    /// The leader before each leader in its cell.
    before: Vec<usize>,
}

impl Grid {
    fn new(cell: f64, tolerance: f64, radius: f64) -> Self {
        Self {
            cell,
            offset_cell: 2.0 * tolerance + cell * radius,
            tolerance,
            radius,
            last: HashMap::new(),
            before: Vec::new(),
        }
    }

    fn coarser(&self, leaders: &[Plane]) -> Self {
        let mut grid = Self::new(self.cell * COARSER, self.tolerance, self.radius);
        for (k, plane) in leaders.iter().enumerate() {
            grid.insert(k, plane);
        }
        grid
    }

    /// Coordinates in cells.
    fn place(&self, normal: DVec3, offset: f64) -> [f64; 4] {
        let n = normal / self.cell;
        [n.x, n.y, n.z, offset / self.offset_cell]
    }

    fn insert(&mut self, leader: usize, plane: &Plane) {
        let key = self
            .place(plane.normal, plane.offset)
            .map(|x| x.floor() as i64);
        let before = self.last.insert(key, leader);
        self.before.push(before.unwrap_or(usize::MAX));
    }

    /// Every leader within half a cell in normal and offset, and some more.
    fn candidates<'a>(&'a self, plane: &Plane) -> impl Iterator<Item = usize> + 'a {
        let plane = *plane;
        [1.0, -1.0]
            .into_iter()
            .flat_map(move |sign| {
                let low = self
                    .place(plane.normal * sign, plane.offset * sign)
                    .map(|x| (x - 0.5).floor() as i64);
                (0..16i64).map(move |corner| {
                    std::array::from_fn::<i64, 4, _>(|axis| low[axis] + (corner >> axis & 1))
                })
            })
            .filter_map(|key| self.last.get(&key).copied())
            .flat_map(move |last| {
                std::iter::successors(Some(last), move |&k| {
                    Some(self.before[k]).filter(|&k| k != usize::MAX)
                })
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;
    use glam::{DMat4, DQuat};

    /// Two triangles over a unit square at a height.
    fn square(positions: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>, corner: DVec3, size: f64) {
        let n = positions.len() as u32;
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            positions.push(corner + DVec3::new(x * size, y * size, 0.0));
        }
        triangles.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
    }

    #[test]
    fn surfaces_a_micrometre_apart_stay_distinct() {
        let (mut p, mut t) = (Vec::new(), Vec::new());
        square(&mut p, &mut t, DVec3::ZERO, 10.0);
        square(&mut p, &mut t, DVec3::new(2.0, 3.0, 1e-6), 0.1);
        square(&mut p, &mut t, DVec3::new(4.0, 3.0, 0.0), 0.01);
        t[5].swap(0, 1); // facing down
        let mut turned = p.clone();
        for (origin, p) in [
            (DVec3::ZERO, &p),
            (DVec3::splat(3.0), &{
                let turn = DMat4::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1));
                turned
                    .iter_mut()
                    .for_each(|p| *p = turn.transform_point3(*p));
                turned
            }),
        ] {
            let p: Vec<_> = p.iter().map(|p| p + origin).collect();
            assert_eq!(plane_ids(&p, &t), [0, 0, 1, 1, 0, 0]);
        }
    }

    #[test]
    fn cube_has_six_planes_in_any_order() {
        let mut p = Vec::new();
        for k in 0..8u32 {
            p.push(DVec3::new(
                f64::from(k & 1),
                f64::from(k >> 1 & 1),
                f64::from(k >> 2),
            ));
        }
        let t = [
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ];
        assert_eq!(plane_ids(&p, &t), [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]);
    }

    #[test]
    fn agrees_with_testing_all_pairs() {
        // Tilted planes with rounded coordinates: the grid must find the same leaders as a scan over all of them.
        let mut random = Pcg::new(3);
        let (mut p, mut t) = (Vec::new(), Vec::new());
        for _ in 0..12 {
            let mut point = || DVec3::new(random.f64(), random.f64(), random.f64()) * 10.0;
            let [a, b, c] = [point(), point(), point()];
            for _ in 0..40 {
                let size = 10f64.powf(-3.0 * random.f64());
                let (x, y) = (random.f64(), random.f64());
                for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.3, 1.0)] {
                    let q = a + (b - a) * (x + size * dx) + (c - a) * (y + size * dy);
                    p.push(q.as_vec3().as_dvec3());
                }
                let n = p.len() as u32;
                t.push([n - 3, n - 2, n - 1]);
            }
        }
        let ids = plane_ids(&p, &t);

        let (low, high) = p
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &q| {
                (l.min(q), h.max(q))
            });
        let tolerance = TOLERANCE * (high - low).length();
        let centre = 0.5 * (low + high);
        let corners: Vec<_> = t
            .iter()
            .map(|t| t.map(|k| p[k as usize] - centre))
            .collect();
        let own: Vec<_> = corners
            .iter()
            .map(|c| own_plane(c, tolerance).unwrap())
            .collect();
        let mut order: Vec<_> = (0..t.len()).collect();
        order.sort_by(|&a, &b| own[b].altitude.total_cmp(&own[a].altitude).then(a.cmp(&b)));
        let mut leaders: Vec<usize> = Vec::new();
        for k in order {
            let holds = |&&l: &&usize| {
                corners[k]
                    .iter()
                    .all(|q| (own[l].normal.dot(*q) - own[l].offset).abs() <= tolerance)
            };
            let leader = leaders.iter().find(holds).copied().unwrap_or(k);
            if leader == k {
                leaders.push(k);
            }
            assert_eq!(ids[k], ids[leader], "triangle {k}");
        }
        let mut distinct = ids.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), leaders.len());
        assert!(leaders.len() < t.len() / 2, "{} planes", leaders.len());
    }

    #[test]
    fn broken_triangles_have_ids_of_their_own() {
        let p = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0, DVec3::Y, DVec3::NAN];
        let t = [[0, 1, 3], [0, 1, 2], [0, 1, 9], [0, 1, 4], [0, 2, 3]];
        assert_eq!(plane_ids(&p, &t), [0, 1, 2, 3, 0]);
        assert_eq!(plane_ids(&[], &[]), [0u32; 0]);
    }
}
