//! Which triangles lie in one plane.
//!
//! Two triangles share an id when the corners of the one with the smaller altitude are all within [`TOLERANCE`] times the scene's
//! diagonal of the plane of the other, whichever way they face. The larger triangle always lends the plane, so that a chain of nearly
//! flat neighbours does not drift: triangles are taken by falling altitude, and each joins the first plane that holds it.
//! Candidates come from a hash grid over (normal, offset) whose cell is as wide as the normal of the triangle at hand is
//! uncertain, 3 tolerance / altitude.

use glam::DVec3;

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
    let mut grid = PlaneHash::new(
        FIRST_CELL,
        tolerance,
        centre.distance(high),
        triangles.len(),
    );
    for k in order {
        let (Some(plane), Some(corners)) = (planes[k], corners[k]) else {
            continue;
        };
        let uncertain = (3.0 * tolerance / plane.altitude).min(1.0);
        while grid.cell < 2.0 * uncertain {
            grid = grid.coarser(&leaders);
        }
        let mut found = usize::MAX;
        grid.candidates(&plane, uncertain, |l| {
            let leader = &leaders[l];
            let on = |p: &DVec3| (leader.normal.dot(*p) - leader.offset).abs() <= tolerance;
            if l < found && corners.iter().all(on) {
                found = l;
            }
        });
        if found == usize::MAX {
            grid.insert(leaders.len(), &plane);
            found = leaders.len();
            leaders.push(plane);
        }
        leader_of[k] = found;
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

/// Planes by normal and offset, in cells of one size; both signs of a plane are looked up. A table of chains: a bucket may hold
/// planes of several cells, which the caller tells apart anyway.
struct PlaneHash {
    cell: f64,
    offset_cell: f64,
    tolerance: f64,
    radius: f64,
    /// Last leader in each bucket; the length is a power of two.
    last: Vec<u32>,
    /// The leader before each leader in its bucket.
    before: Vec<u32>,
}

/// End of a chain.
const NONE: u32 = u32::MAX;

impl PlaneHash {
    fn new(cell: f64, tolerance: f64, radius: f64, capacity: usize) -> Self {
        Self {
            cell,
            offset_cell: 2.0 * tolerance + cell * radius,
            tolerance,
            radius,
            last: vec![NONE; (2 * capacity).next_power_of_two()],
            before: Vec::new(),
        }
    }

    fn coarser(&self, leaders: &[Plane]) -> Self {
        let mut grid = Self::new(
            self.cell * COARSER,
            self.tolerance,
            self.radius,
            self.last.len() / 2,
        );
        for (k, plane) in leaders.iter().enumerate() {
            grid.insert(k, plane);
        }
        grid
    }

    fn bucket(&self, cell: [i64; 4]) -> usize {
        let mixed = cell
            .iter()
            .fold(0, |h, &x| super::sampling::hash(h, x as u64));
        mixed as usize & (self.last.len() - 1)
    }

    fn insert(&mut self, leader: usize, plane: &Plane) {
        let n = plane.normal / self.cell;
        let cell = [n.x, n.y, n.z, plane.offset / self.offset_cell].map(|x| x.floor() as i64);
        let bucket = self.bucket(cell);
        self.before
            .push(std::mem::replace(&mut self.last[bucket], leader as u32));
    }

    /// Calls with every leader whose normal may be within `uncertain` of the plane's or its opposite, and offset accordingly, and
    /// with some more.
    fn candidates(&self, plane: &Plane, uncertain: f64, mut call: impl FnMut(usize)) {
        // At most half a cell each, so at most two cells an axis.
        let reach = [
            uncertain,
            uncertain,
            uncertain,
            self.tolerance + uncertain * self.radius,
        ];
        for sign in [1.0, -1.0] {
            let n = plane.normal * sign;
            let centre = [n.x, n.y, n.z, plane.offset * sign];
            let size = [self.cell, self.cell, self.cell, self.offset_cell];
            let at = |axis: usize, by: f64| {
                ((centre[axis] + by * reach[axis]) / size[axis]).floor() as i64
            };
            let low = [0, 1, 2, 3].map(|axis| at(axis, -1.0));
            let two = [0, 1, 2, 3].map(|axis| at(axis, 1.0) - low[axis]);
            for corner in 0..16i64 {
                let step = [0, 1, 2, 3].map(|axis| corner >> axis & 1);
                if (0..4).any(|axis| step[axis] > two[axis]) {
                    continue;
                }
                let cell = [0, 1, 2, 3].map(|axis| low[axis] + step[axis]);
                let mut leader = self.last[self.bucket(cell)];
                while leader != NONE {
                    call(leader as usize);
                    leader = self.before[leader as usize];
                }
            }
        }
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
