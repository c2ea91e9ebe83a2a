//! The form factor of [`super::polygon`] for eight pairs of element and triangle at once, f64.
//!
//! The triangle is clipped at the horizon without branches: each edge keeps the part above it, and a fourth edge runs along the horizon
//! from where the outline goes down to where it comes up.

use super::polygon::{IN_PLANE, lambert_polygon};
use super::vectors::{only, splat, sum};
use fearless_simd::{Level, dispatch, f64x8, mask64x8, prelude::*};
use glam::DVec3;

/// Three coordinates of eight points.
pub type Points8 = [[f64; 8]; 3];

/// The same as vectors.
type Vectors<S> = [f64x8<S>; 3];

/// The same point in all lanes.
#[inline]
pub fn all_lanes(point: DVec3) -> Points8 {
    [[point.x; 8], [point.y; 8], [point.z; 8]]
}

/// Up to eight points, the first of any more; free lanes repeat the first.
#[inline]
pub fn lanes_of(points: impl IntoIterator<Item = DVec3>) -> Points8 {
    let mut lanes = [[0.0; 8]; 3];
    for (k, p) in points.into_iter().take(8).enumerate() {
        put(&mut lanes, k, p);
    }
    lanes
}

/// Puts a point into a lane; the first goes into all.
#[inline(always)]
fn put(lanes: &mut Points8, k: usize, p: DVec3) {
    for (lane, x) in lanes.iter_mut().zip(p.to_array()) {
        if k == 0 {
            lane.fill(x);
        }
        lane[k] = x;
    }
}

/// Form factors from eight elements to a triangle; as [`super::lambert_polygon`].
pub fn lambert_x8(point: &Points8, normal: &Points8, triangle: &[DVec3; 3]) -> [f64; 8] {
    dispatch!(Level::new(), simd => {
        let [a, b, c] = *triangle;
        let triangle = [splat(simd, a), splat(simd, b), splat(simd, c)];
        factors(load(simd, point), load(simd, normal), triangle).to_array()
    })
}

/// Form factors from one point to up to eight triangles.
pub fn lambert_triangles_x8(
    point: DVec3,
    normal: DVec3,
    triangles: impl Iterator<Item = [DVec3; 3]>,
) -> [f64; 8] {
    let mut corners = [[[0.0; 8]; 3]; 3];
    for (k, triangle) in triangles.take(8).enumerate() {
        for (lanes, corner) in corners.iter_mut().zip(triangle) {
            put(lanes, k, corner);
        }
    }
    dispatch!(Level::new(), simd => {
        let [a, b, c] = &corners;
        let triangle = [load(simd, a), load(simd, b), load(simd, c)];
        factors(splat(simd, point), splat(simd, normal), triangle).to_array()
    })
}

#[inline(always)]
fn load<S: Simd>(simd: S, [x, y, z]: &Points8) -> Vectors<S> {
    [
        f64x8::load_array_ref(simd, x),
        f64x8::load_array_ref(simd, y),
        f64x8::load_array_ref(simd, z),
    ]
}

#[inline(always)]
fn factors<S: Simd>(point: Vectors<S>, normal: Vectors<S>, triangle: [Vectors<S>; 3]) -> f64x8<S> {
    let [a, b, c] = [
        sub(triangle[0], point),
        sub(triangle[1], point),
        sub(triangle[2], point),
    ];
    let height = [dot(a, normal), dot(b, normal), dot(c, normal)];
    let lengths = [length(a), length(b), length(c)];
    let crosses = [cross(a, b), cross(b, c), cross(c, a)];

    let area = add(add(crosses[0], crosses[1]), crosses[2]);
    let reach = lengths[0].max(lengths[1]).max(lengths[2]);
    let apart = dot(area, a);
    let least = reach * IN_PLANE;
    let out_of_plane = (apart * apart).simd_gt(dot(area, area) * (least * least));

    let lowest = height[0].min(height[1]).min(height[2]);
    let sum = if lowest.simd_ge(0.0).all_true() {
        edge(a, b, crosses[0], lengths[0] * lengths[1], normal)
            + edge(b, c, crosses[1], lengths[1] * lengths[2], normal)
            + edge(c, a, crosses[2], lengths[2] * lengths[0], normal)
    } else {
        clipped([a, b, c], height, normal)
    };
    only(
        out_of_plane,
        (sum.abs() * (1.0 / std::f64::consts::TAU)).min(1.0),
    )
}

/// The sum over the edges of what is above the horizon.
#[inline(always)]
fn clipped<S: Simd>(
    corners: [Vectors<S>; 3],
    height: [f64x8<S>; 3],
    normal: Vectors<S>,
) -> f64x8<S> {
    let simd = height[0].simd;
    // Seldom asked for, and long: a function of its own.
    simd.vectorize(
        #[inline(always)]
        || {
            let zero = f64x8::splat(simd, 0.0);
            let mut sum = zero;
            let mut up = [zero; 3];
            let mut down = [zero; 3];
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let (ha, hb) = (height[k], height[(k + 1) % 3]);
                let (above, ahead) = (ha.simd_ge(zero), hb.simd_ge(zero));
                // The quotient is only used where the signs differ.
                let t = ha / (ha - hb);
                let across = [
                    (b[0] - a[0]).mul_add(t, a[0]),
                    (b[1] - a[1]).mul_add(t, a[1]),
                    (b[2] - a[2]).mul_add(t, a[2]),
                ];
                let part = free_edge(pick(above, a, across), pick(ahead, b, across), normal);
                sum += only(above | ahead, part);
                down = pick(above & !ahead, across, down);
                up = pick(ahead & !above, across, up);
            }
            sum + free_edge(down, up, normal)
        },
    )
}

/// Form factor from one point to one polygon, its edges side by side; as [`super::lambert_polygon`], which takes the polygons of
/// more than seven corners.
pub fn lambert_edges_x8(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    // The horizon may take a lane.
    if !(3..8).contains(&polygon.len()) {
        return lambert_polygon(point, normal, polygon);
    }
    // The outline above the horizon.
    let mut corners = [DVec3::ZERO; 8];
    let mut count = 0;
    let mut before = polygon[polygon.len() - 1] - point;
    let mut below = before.dot(normal);
    for &corner in polygon {
        let corner = corner - point;
        let height = corner.dot(normal);
        if count + 2 > corners.len() {
            // One that is not convex may cross the horizon more often than twice.
            return lambert_polygon(point, normal, polygon);
        }
        if (below < 0.0) != (height < 0.0) {
            corners[count] = before + (corner - before) * (below / (below - height));
            count += 1;
        }
        if height >= 0.0 {
            corners[count] = corner;
            count += 1;
        }
        (before, below) = (corner, height);
    }
    // Each edge a lane; free lanes run from the point to itself.
    let (mut from, mut to) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
    for lane in 0..count {
        let ahead = if lane + 1 < count { lane + 1 } else { 0 };
        for axis in 0..3 {
            from[axis][lane] = corners[lane][axis];
            to[axis][lane] = corners[ahead][axis];
        }
    }
    dispatch!(Level::new(), simd => {
        edge_sum(load(simd, &from), load(simd, &to), splat(simd, normal), corners[0])
    })
}

/// The form factor to a polygon above the horizon from its edges; `corner`: one of its corners.
#[inline(always)]
fn edge_sum<S: Simd>(a: Vectors<S>, b: Vectors<S>, normal: Vectors<S>, corner: DVec3) -> f64 {
    let crosses = cross(a, b);
    let squares = dot(a, a);
    let area = DVec3::new(sum(crosses[0]), sum(crosses[1]), sum(crosses[2]));
    let reach = squares.to_array().into_iter().fold(0.0, f64::max);
    if area.dot(corner).powi(2) <= IN_PLANE * IN_PLANE * area.length_squared() * reach {
        return 0.0;
    }
    let size = (squares * dot(b, b)).sqrt();
    let total = sum(edge(a, b, crosses, size, normal));
    (total.abs() / std::f64::consts::TAU).min(1.0)
}

#[inline(always)]
fn free_edge<S: Simd>(a: Vectors<S>, b: Vectors<S>, normal: Vectors<S>) -> f64x8<S> {
    edge(a, b, cross(a, b), length(a) * length(b), normal)
}

/// As `edge` in [`super::polygon`]; 0 where the corners lie in one line. `size` = |a||b|.
#[inline(always)]
fn edge<S: Simd>(
    a: Vectors<S>,
    b: Vectors<S>,
    c: Vectors<S>,
    size: f64x8<S>,
    normal: Vectors<S>,
) -> f64x8<S> {
    let ratio = angle_over_sine(
        dot(a, b),
        size,
        #[inline(always)]
        || length(c),
    );
    // A point on the edge, or an edge of no length: infinite or NaN above, no angle here.
    only(dot(c, c).simd_gt(0.0), dot(c, normal) * ratio)
}

/// The angle gamma between a and b over |c|, c = a x b, from x = a.b and `size` = |a||b|; without meaning where c is nil.
///
/// It comes without a root: with w = tan^2(gamma/2) = (|a||b| - x)/(|a||b| + x), gamma/|c| = 2 P(w)/(|a||b| + x),
/// P(w) = atan(sqrt w)/sqrt w. Beyond a right angle, the same for pi - gamma, and then |c| itself is asked for.
#[inline(always)]
pub(crate) fn angle_over_sine<S: Simd>(
    x: f64x8<S>,
    size: f64x8<S>,
    sine: impl FnOnce() -> f64x8<S>,
) -> f64x8<S> {
    let folded = x.abs();
    let over = f64x8::splat(x.simd, 1.0) / (size + folded);
    let w = (size - folded).max(0.0) * over;
    let ratio = series(w) * (over + over);
    let wide = x.simd_lt(0.0);
    if wide.any_true() {
        let whole = f64x8::splat(x.simd, std::f64::consts::PI);
        wide.select(whole / sine() - ratio, ratio)
    } else {
        ratio
    }
}

/// atan(sqrt w)/sqrt w for w in [0,1]: interpolated at the Chebyshev points of degree 18, relative error 3e-16.
const SERIES: [f64; 19] = [
    0.9999999999999998,
    -0.333333333333188,
    0.19999999998244405,
    -0.14285714201153485,
    0.11111108947215684,
    -0.09090875100099982,
    0.07691950418796795,
    -0.06664007607654046,
    0.05867776001706719,
    -0.052025829246698206,
    0.045668724719449945,
    -0.03852606834610674,
    0.02992405293802711,
    -0.02033087003302746,
    0.011430023675054508,
    -0.0050003664537326496,
    0.0015739493241755762,
    -0.00031420077366807334,
    2.969635660165779e-05,
];

/// The even and the odd powers apart, for a shorter chain.
#[inline(always)]
fn series<S: Simd>(w: f64x8<S>) -> f64x8<S> {
    let square = w * w;
    let mut even = f64x8::splat(w.simd, SERIES[18]);
    let mut odd = f64x8::splat(w.simd, SERIES[17]);
    for k in (0..8).rev() {
        even = even.mul_add(square, SERIES[2 * k + 2]);
        odd = odd.mul_add(square, SERIES[2 * k + 1]);
    }
    even.mul_add(square, odd.mul_add(w, SERIES[0]))
}

#[inline(always)]
fn length<S: Simd>(a: Vectors<S>) -> f64x8<S> {
    dot(a, a).sqrt()
}

#[inline(always)]
fn pick<S: Simd>(mask: mask64x8<S>, a: Vectors<S>, b: Vectors<S>) -> Vectors<S> {
    [
        mask.select(a[0], b[0]),
        mask.select(a[1], b[1]),
        mask.select(a[2], b[2]),
    ]
}

#[inline(always)]
fn add<S: Simd>(a: Vectors<S>, b: Vectors<S>) -> Vectors<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub<S: Simd>(a: [f64x8<S>; 3], b: [f64x8<S>; 3]) -> [f64x8<S>; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn dot<S: Simd>(a: [f64x8<S>; 3], b: [f64x8<S>; 3]) -> f64x8<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
fn cross<S: Simd>(a: Vectors<S>, b: Vectors<S>) -> Vectors<S> {
    [
        a[1].mul_sub(b[2], a[2] * b[1]),
        a[2].mul_sub(b[0], a[0] * b[2]),
        a[0].mul_sub(b[1], a[1] * b[0]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lambert_polygon;
    use crate::geometry::sampling::{Pcg, sphere_direction};
    use crate::geometry::vectors::levels;

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
            let fast = lambert_triangles_x8(eye, normal, triangles.iter().copied());
            let corners = [0, 1, 2].map(|k| lanes_of(triangles.iter().map(|t| t[k])));
            let others = levels().into_iter().map(|level| {
                dispatch!(level, simd => {
                    let [a, b, c] = &corners;
                    let triangle = [load(simd, a), load(simd, b), load(simd, c)];
                    factors(splat(simd, eye), splat(simd, normal), triangle).to_array()
                })
            });
            for (fast, other) in others.flat_map(|other| fast.into_iter().zip(other)) {
                assert!((fast - other).abs() <= 1e-13 * fast + 1e-15 / scale.min(1.0));
            }
            for (triangle, fast) in triangles.iter().zip(fast) {
                let plain = lambert_polygon(eye, normal, triangle);
                let edges = lambert_edges_x8(eye, normal, triangle);
                // The sum of three edges loses distance/size of its digits.
                let lost = 1e-15 / scale.min(1.0);
                for fast in [fast, edges] {
                    assert!(
                        (fast - plain).abs() <= 1e-13 * plain + lost,
                        "{fast} {plain} at scale {scale}"
                    );
                }
            }
        }
    }

    #[test]
    fn edges_of_polygons_of_any_kind() {
        let mut random = Pcg::new(12);
        for round in 0..4_000 {
            // Stars in a plane: most are not convex.
            let count = round % 12;
            let [x, y] = [0; 2].map(|_| sphere_direction([random.f64(), random.f64()]));
            let at = sphere_direction([random.f64(), random.f64()]) * (2.0 * random.f64());
            let polygon: Vec<DVec3> = (0..count)
                .map(|k| {
                    let (sine, cosine) =
                        (f64::from(k) / f64::from(count.max(1)) * std::f64::consts::TAU).sin_cos();
                    at + (x * cosine + y * sine) * (0.1 + random.f64())
                })
                .collect();
            let normal = sphere_direction([random.f64(), random.f64()]);
            let fast = lambert_edges_x8(DVec3::ZERO, normal, &polygon);
            let plain = lambert_polygon(DVec3::ZERO, normal, &polygon);
            assert!((fast - plain).abs() <= 1e-13, "{fast} {plain} {polygon:?}");
        }
        let inside = [DVec3::X, DVec3::Y, -DVec3::X - DVec3::Y];
        assert_eq!(lambert_edges_x8(DVec3::ZERO, DVec3::Z, &inside), 0.0);
        assert_eq!(lambert_edges_x8(DVec3::ZERO, DVec3::Z, &[DVec3::Z; 3]), 0.0);
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
        let f = lambert_x8(&lanes_of(points), &all_lanes(DVec3::Z), &triangle);
        assert!((f[0] - 0.0962250448649376).abs() < 1e-15);
        assert_eq!(&f[1..3], [0.0, 0.0], "in the plane");
        assert!(f[3] > 0.99 && f[3] < 1.0);
        assert_eq!(f[4..], [f[0]; 4]);
    }
}
