//! Pairs that cannot see one another at all.
//!
//! A plane with one patch on each side cuts the shaft in a convex polygon, the hull of the points where the lines from corner to corner
//! cross it. When the triangles of a list that lie in this plane cover that polygon, every segment between the patches is
//! blocked. Safe side: a pair reported as hidden has no free segment; one that is hidden only by several planes
//! together, or by alpha-masked triangles, is not reported.

use super::clip::HalfSpace;
use super::index::RayIndex;
use super::segment::NO_PLANE;
use super::shaft::Shaft;
use glam::{DVec2, DVec3};

/// Pieces of the section thinner than this are covered, of the section's size: the seam between two triangles.
const SEAM: f64 = 1e-9;

/// A section in more pieces than this is given up.
const PIECES: usize = 64;

impl RayIndex {
    /// Do triangles of a list, as found by [`RayIndex::blockers`], hide the two patches of the shaft from one another?
    pub fn hides(&self, shaft: &Shaft, list: &[u32]) -> bool {
        list.iter().enumerate().any(|(k, &id)| {
            // Each plane once, at its first triangle.
            let plane = self.plane_of(id);
            let first = |&other: &u32| plane != NO_PLANE && self.plane_of(other) == plane;
            !list[..k].iter().any(first) && self.plane_hides(shaft, id, &list[k..])
        })
    }

    /// Do the triangles in the plane of `id` cover the section of the shaft?
    fn plane_hides(&self, shaft: &Shaft, id: u32, list: &[u32]) -> bool {
        let Some([a, b, c]) = self.opaque_triangle(id) else {
            return false;
        };
        let Some(normal) = (b - a).cross(c - a).try_normalize() else {
            return false;
        };
        let Some(section) = section(shaft, normal, normal.dot(a), f64::from(self.gap)) else {
            return false;
        };
        let size = section
            .iter()
            .map(|p| p.distance(section[0]))
            .fold(0.0, f64::max);
        let thin = SEAM * size;
        let mut pieces = vec![section];
        let plane = self.plane_of(id);
        for &other in list {
            if other != id && (plane == NO_PLANE || self.plane_of(other) != plane) {
                continue;
            }
            let Some(triangle) = self.opaque_triangle(other) else {
                continue;
            };
            let mut left = Vec::new();
            for piece in pieces {
                subtract(piece, &triangle, normal, thin, &mut left);
            }
            pieces = left;
            if pieces.is_empty() {
                return true;
            }
            if pieces.len() > PIECES {
                return false;
            }
        }
        false
    }

    /// The corners of a triangle without an alpha mask.
    fn opaque_triangle(&self, id: u32) -> Option<[DVec3; 3]> {
        (!self.is_masked(id)).then_some(())?;
        Some(self.triangle(id)?.map(|p| p.as_dvec3()))
    }
}

/// The polygon in which a plane cuts the shaft, counter-clockwise about `normal`; None unless the patches are on different sides of it, by
/// more than `gap`.
fn section(shaft: &Shaft, normal: DVec3, offset: f64, gap: f64) -> Option<Vec<DVec3>> {
    let [from, to] = shaft.ends();
    let height = |p: &DVec3| normal.dot(*p) - offset;
    let side = height(&from[0]).signum();
    let apart =
        from.iter().all(|p| height(p) * side > gap) && to.iter().all(|p| height(p) * side < -gap);
    if !apart {
        return None;
    }
    let [x, y] = super::sampling::tangents(normal);
    let mut points: Vec<(DVec2, DVec3)> = Vec::with_capacity(from.len() * to.len());
    for p in from {
        for q in to {
            let (h, k) = (height(p), height(q));
            let at = p + (q - p) * (h / (h - k));
            points.push((DVec2::new(at.dot(x), at.dot(y)), at));
        }
    }
    hull(points)
}

/// The convex hull in the plane, counter-clockwise (Andrew's monotone chain, 1979). None without area.
fn hull(mut points: Vec<(DVec2, DVec3)>) -> Option<Vec<DVec3>> {
    points.sort_by(|(a, _), (b, _)| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut chain: Vec<(DVec2, DVec3)> = Vec::with_capacity(points.len() + 1);
    let mut grow = |points: &mut dyn Iterator<Item = &(DVec2, DVec3)>| {
        let start = chain.len();
        for &point in points {
            while let [.., a, b] = &chain[start..]
                && (b.0 - a.0).perp_dot(point.0 - a.0) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        // The last point begins the other half.
        chain.pop();
    };
    grow(&mut points.iter());
    grow(&mut points.iter().rev());
    (chain.len() >= 3).then(|| chain.into_iter().map(|(_, p)| p).collect())
}

/// Pushes what a triangle in the same plane leaves of a convex piece.
fn subtract(
    piece: Vec<DVec3>,
    triangle: &[DVec3; 3],
    normal: DVec3,
    thin: f64,
    left: &mut Vec<Vec<DVec3>>,
) {
    let [a, b, c] = triangle;
    let way = (b - a).cross(c - a).dot(normal).signum();
    let first = left.len();
    let (mut rest, mut inside) = (piece.clone(), Vec::new());
    for (p, q) in [(a, b), (b, c), (c, a)] {
        // Outside is to the right of an edge of a counter-clockwise triangle.
        let Some(outward) = ((q - p).cross(normal) * way).try_normalize() else {
            left.truncate(first);
            left.push(piece);
            return;
        };
        let side = HalfSpace {
            normal: outward,
            offset: outward.dot(*p),
        };
        let mut outside = Vec::new();
        side.split(&rest, thin, &mut inside, &mut outside);
        if !outside.is_empty() {
            left.push(outside);
        }
        std::mem::swap(&mut rest, &mut inside);
        if rest.is_empty() {
            left.truncate(first);
            left.push(piece);
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::{Pcg, on_triangle};
    use crate::geometry::{Patch, Segment, ShaftContents, plane_ids};

    fn index_of(triangles: &[[DVec3; 3]], masked: &[bool]) -> RayIndex {
        let exact: Vec<DVec3> = triangles.iter().flatten().copied().collect();
        let positions: Vec<_> = exact.iter().map(|p| p.as_vec3()).collect();
        let ids: Vec<_> = (0..triangles.len() as u32)
            .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
            .collect();
        RayIndex::build(&positions, &ids, &plane_ids(&exact, &ids), masked)
    }

    fn hidden(index: &RayIndex, ends: [[DVec3; 3]; 2]) -> bool {
        let [a, b] = ends.map(|corners| Patch::Triangle {
            corners,
            plane: NO_PLANE,
        });
        let shaft = Shaft::between(&a, &b);
        match index.blockers(&shaft, None, 32) {
            ShaftContents::Few(list) => index.hides(&shaft, &list),
            _ => false,
        }
    }

    /// A wall in the plane z = 0 of `n` by `n` squares of size 1.
    fn wall(n: u32) -> Vec<[DVec3; 3]> {
        let at = |i: u32, j: u32| DVec3::new(f64::from(i), f64::from(j), 0.0);
        (0..n * n)
            .flat_map(|k| {
                let (i, j) = (k % n, k / n);
                [
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                    [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                ]
            })
            .collect()
    }

    #[test]
    fn a_wall_of_squares_hides_and_one_with_a_hole_does_not() {
        let up = |x: f64, y: f64, z: f64| {
            [
                DVec3::new(x, y, z),
                DVec3::new(x + 0.8, y, z),
                DVec3::new(x, y + 0.8, z),
            ]
        };
        let down = |x: f64, y: f64, z: f64| {
            let [a, b, c] = up(x, y, z);
            [a, c, b]
        };
        let mut scene = wall(3);
        let ends = [up(1.1, 1.2, -1.0), down(0.9, 1.4, 2.0)];
        assert!(hidden(&index_of(&scene, &[]), ends));
        // Beside the wall, or part of the way.
        assert!(!hidden(
            &index_of(&scene, &[]),
            [up(2.5, 1.2, -1.0), down(2.5, 1.4, 2.0)]
        ));
        // A mask in the way, then a hole.
        let mut masked = vec![false; scene.len()];
        masked[9] = true;
        assert!(!hidden(&index_of(&scene, &masked), ends));
        scene.remove(9);
        assert!(!hidden(&index_of(&scene, &[]), ends));
    }

    #[test]
    fn hidden_pairs_have_no_free_segment() {
        let mut random = Pcg::new(31);
        let (mut yes, mut fully) = (0, 0);
        for _ in 0..1_500 {
            let mut point = |s: f64| DVec3::new(random.f64(), random.f64(), random.f64()) * s;
            // Part of a wall, and some large triangles across.
            let mut scene = wall(3);
            scene.truncate(14);
            for _ in 0..3 {
                scene.push([0; 3].map(|_| point(4.0) - DVec3::new(0.5, 0.5, 2.0)));
            }
            let index = index_of(&scene, &[]);
            let mut patch = |z: f64| {
                let at = point(2.5) * DVec3::new(1.0, 1.0, 0.2) + DVec3::Z * z;
                let [a, b, c] = [0; 3].map(|_| at + point(0.4));
                if (b - a).cross(c - a).z * z < 0.0 {
                    [a, b, c]
                } else {
                    [a, c, b]
                }
            };
            let ends = [patch(-1.5), patch(1.0)];
            let free = (0..200).any(|_| {
                let [from, to] =
                    ends.map(|t| on_triangle(&t, [random.f64(), random.f64()]).as_vec3());
                !index.occluded(&Segment {
                    from,
                    to,
                    planes: [NO_PLANE; 2],
                })
            });
            let says = hidden(&index, ends);
            assert!(!(says && free));
            yes += usize::from(says);
            fully += usize::from(!free);
        }
        assert!(fully > 100 && yes * 10 > fully * 6, "{yes} of {fully}");
    }
}
