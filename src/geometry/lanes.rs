//! The form factor of [`super::polygon`] for eight pairs of element and triangle at once, f64.
//!
//! The triangle is cut at the horizon without branches: each edge keeps the part above it, and a fourth edge runs along the horizon
//! from where the outline goes down to where it comes up.

use super::polygon::IN_PLANE;
use glam::DVec3;
use wide::f64x8;

/// Three coordinates of eight points.
pub type Points8 = [f64x8; 3];

/// The same point in all lanes.
pub fn all_lanes(point: DVec3) -> Points8 {
    point.to_array().map(f64x8::splat)
}

/// Up to eight points; free lanes repeat the first.
///
/// # Panics
/// On an empty slice.
pub fn lanes_of(points: &[DVec3]) -> Points8 {
    [0, 1, 2].map(|axis| {
        f64x8::new(std::array::from_fn(|lane| {
            points.get(lane).unwrap_or(&points[0])[axis]
        }))
    })
}

/// Form factors from eight elements, each to its own triangle; as [`super::lambert_polygon`].
#[inline]
pub fn lambert_x8(point: Points8, normal: Points8, triangle: [Points8; 3]) -> f64x8 {
    let corners = triangle.map(|corner| sub(corner, point));
    let height = corners.map(|corner| dot(corner, normal));
    let zero = f64x8::ZERO;

    let mut sum = zero;
    let mut up = [zero; 3];
    let mut down = [zero; 3];
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let (ha, hb) = (height[k], height[(k + 1) % 3]);
        let (above, ahead) = (ha.simd_ge(zero), hb.simd_ge(zero));
        // The division is only used where the signs differ.
        let t = ha / (ha - hb);
        let cross = [0, 1, 2].map(|axis| a[axis] + (b[axis] - a[axis]) * t);
        let start = pick(above, a, cross);
        let end = pick(ahead, b, cross);
        sum += edge(start, end, normal) & (above | ahead);
        down = pick(above & !ahead, cross, down);
        up = pick(ahead & !above, cross, up);
    }
    sum += edge(down, up, normal);

    let area = add(
        add(cross(corners[0], corners[1]), cross(corners[1], corners[2])),
        cross(corners[2], corners[0]),
    );
    let reach = corners.map(|c| dot(c, c));
    let reach = reach[0].fast_max(reach[1]).fast_max(reach[2]);
    let apart = dot(area, corners[0]).abs();
    let out_of_plane = apart.simd_gt((dot(area, area) * reach).sqrt() * f64x8::splat(IN_PLANE));
    (sum.abs() * f64x8::splat(1.0 / std::f64::consts::TAU)).fast_min(f64x8::ONE) & out_of_plane
}

/// Form factors from up to eight points with one normal to one triangle.
#[inline]
pub fn lambert_points_x8(points: Points8, normal: DVec3, triangle: &[DVec3; 3]) -> f64x8 {
    lambert_x8(points, all_lanes(normal), triangle.map(all_lanes))
}

/// Form factors from one point to up to eight triangles.
#[inline]
pub fn lambert_triangles_x8(point: DVec3, normal: DVec3, triangles: [Points8; 3]) -> f64x8 {
    lambert_x8(all_lanes(point), all_lanes(normal), triangles)
}

/// As `edge` in [`super::polygon`]; 0 where the corners lie in one line.
#[inline(always)]
fn edge(a: Points8, b: Points8, normal: Points8) -> f64x8 {
    let c = cross(a, b);
    let sine = dot(c, c).sqrt();
    let some = sine.simd_gt(f64x8::ZERO);
    (dot(c, normal) / sine * angle(sine, dot(a, b))) & some
}

/// atan2(y, x) for y >= 0, in [0, pi].
#[inline(always)]
fn angle(y: f64x8, x: f64x8) -> f64x8 {
    y.atan2(x)
}

#[inline(always)]
fn pick(mask: f64x8, a: Points8, b: Points8) -> Points8 {
    [0, 1, 2].map(|axis| mask.select(a[axis], b[axis]))
}

#[inline(always)]
fn add(a: Points8, b: Points8) -> Points8 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn sub(a: Points8, b: Points8) -> Points8 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn dot(a: Points8, b: Points8) -> f64x8 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: Points8, b: Points8) -> Points8 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lambert_polygon;
    use crate::geometry::sampling::{Pcg, sphere_direction};

    #[test]
    fn eight_at_once_agree_with_one_at_a_time() {
        let mut random = Pcg::new(11);
        for round in 0..2_000 {
            // Triangles of all sizes and distances, some across the horizon, some below it.
            let scale = 10f64.powi(round % 7 - 5);
            let mut point =
                |s: f64| (DVec3::new(random.f64(), random.f64(), random.f64()) - 0.5) * s;
            let triangles: Vec<[DVec3; 3]> = (0..8)
                .map(|_| {
                    let at = point(2.0);
                    [0; 3].map(|_| at + point(scale))
                })
                .collect();
            let eye = point(1.0);
            let normal = sphere_direction([random.f64(), random.f64()]);
            let corners =
                [0, 1, 2].map(|k| lanes_of(&triangles.iter().map(|t| t[k]).collect::<Vec<_>>()));
            let fast = lambert_triangles_x8(eye, normal, corners).to_array();
            for (triangle, fast) in triangles.iter().zip(fast) {
                let plain = lambert_polygon(eye, normal, triangle);
                // The sum of three edges loses distance/size of its digits.
                let lost = 1e-15 / scale.min(1.0);
                assert!(
                    (fast - plain).abs() <= 1e-13 * plain + lost,
                    "{fast} {plain} at scale {scale}"
                );
            }
        }
    }

    #[test]
    fn points_over_one_triangle() {
        let triangle = [
            DVec3::Z,
            DVec3::new(1.0, 0.0, 1.0),
            DVec3::new(0.0, 1.0, 1.0),
        ];
        let points = [
            DVec3::ZERO,
            DVec3::Z,
            DVec3::new(0.2, 0.2, 1.0),
            DVec3::new(0.2, 0.2, 0.999),
        ];
        let f = lambert_points_x8(lanes_of(&points), DVec3::Z, &triangle).to_array();
        assert!((f[0] - 0.0962250448649376).abs() < 1e-15);
        assert_eq!(&f[1..3], [0.0, 0.0], "in the plane");
        assert!(f[3] > 0.99 && f[3] < 1.0);
        assert_eq!(f[4..], [f[0]; 4]);
    }
}
