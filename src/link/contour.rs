//! Unoccluded exchange of two triangles by contour integrals.
//!
//! Stokes' theorem turns `A_1 F_12` into `1/(2 pi) contour integral over both of ln r dx_1 . dx_2` (Sparrow 1963). For a pair
//! of straight edges the inner integral is elementary; so is the outer one for parallel edges and for edges with a common
//! corner, where its integrand is singular. For other edges Gauss-Legendre quadrature suffices. The integrand is a
//! logarithm where the area form has `1/r^2`: two triangles that share an edge are not a hard case.

use crate::geometry::lanes::{angle_over_sine, dot, sub};
use crate::geometry::polygon::edges;
use crate::geometry::vectors::{atan, ln, only, sum};
use fearless_simd::{Level, dispatch, f64x8, prelude::*};
use glam::DVec3;
use std::f64::consts::TAU;

/// Points and weights of the 6-point Gauss-Legendre rule on [0, 1] (Abramowitz and Stegun 1964, table 25.4).
const GAUSS: [(f64, f64); 6] = [
    (0.033_765_242_898_423_99, 0.085_662_246_189_585_17),
    (0.169_395_306_766_867_74, 0.180_380_786_524_069_3),
    (0.380_690_406_958_401_55, 0.233_956_967_286_345_52),
    (0.619_309_593_041_598_5, 0.233_956_967_286_345_52),
    (0.830_604_693_233_132_3, 0.180_380_786_524_069_3),
    (0.966_234_757_101_576, 0.085_662_246_189_585_17),
];

/// Least argument of a logarithm; the logarithm's factor is 0 there.
const LEAST: f64 = f64::MIN_POSITIVE;

/// Edges whose directions differ by less count as parallel: the error is of the same order.
const PARALLEL: f64 = 1e-10;

/// `A_1 F_12` of two triangles that face each other, each clipped to the front of the other; corners counter-clockwise
/// from the front, same unit of length. Relative error about 1e-5 for triangles with a common edge, less for others; it grows
/// where edges that share no corner pass close by each other.
pub fn exchange(one: &[DVec3; 3], two: &[DVec3; 3]) -> f64 {
    let (a, b) = (front(one, two), front(two, one));
    if a.len() < 3 || b.len() < 3 {
        return 0.0;
    }
    let mut sum = Logs::default();
    for (p, q) in edges(&a) {
        for (r, s) in edges(&b) {
            let along = (q - p).dot(s - r);
            if along != 0.0 {
                sum.pair(along, [p, q], [r, s]);
            }
        }
    }
    // Edges of facing triangles run in opposite directions; rounding may leave a trace below zero.
    (sum.total() / TAU).max(0.0)
}

/// A weighted sum of means of `ln |x - y|`, worked out eight at a time.
#[derive(Default)]
struct Logs {
    sum: f64,
    /// Means over y on an edge: their weights, x, and both ends.
    edges: Eight<10>,
    /// Means over two parallel edges: second primitives with their weights, u and h.
    parallel: Eight<3>,
}

impl Logs {
    /// Adds `weight` times the mean over x on pq and y on rs.
    ///
    /// Edges with a common corner, where the outer integrand is singular, have a closed form: with the corner as origin
    /// and `f(a, b)` the double integral over lengths a and b, `f(ta, tb) = t^2 (f + a b ln t)`, hence by the derivative at
    /// t = 1 `2 f + a b = a df/da + b df/db`, and both derivatives are integrals over one edge.
    fn pair(&mut self, weight: f64, [p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) {
        if (p == r && q == s) || (p == s && q == r) {
            self.sum += weight * (p.distance(q).ln() - 1.5);
            return;
        }
        if self.parallel_pair(weight, [p, q], [r, s]) {
            return;
        }
        let common = [(p, q, r, s), (p, q, s, r), (q, p, r, s), (q, p, s, r)]
            .into_iter()
            .find(|c| c.0 == c.2);
        if let Some((corner, a, _, b)) = common {
            self.edge(0.5 * weight, a, corner, b);
            self.edge(0.5 * weight, b, corner, a);
            self.sum -= 0.5 * weight;
            return;
        }
        // Gauss points go on the shorter edge, over which the inner integral changes less.
        let ((p, q), (r, s)) = if p.distance_squared(q) <= r.distance_squared(s) {
            ((p, q), (r, s))
        } else {
            ((r, s), (p, q))
        };
        for (t, part) in GAUSS {
            self.edge(weight * part, p.lerp(q, t), r, s);
        }
    }

    /// [`Self::pair`] for parallel edges, whose double integral is elementary; false for others.
    fn parallel_pair(&mut self, weight: f64, [p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> bool {
        let (a, b) = (q - p, s - r);
        let (square_a, square_b) = (a.length_squared(), b.length_squared());
        let sine = a.cross(b).length_squared();
        if sine > PARALLEL * PARALLEL * square_a * square_b || square_a == 0.0 || square_b == 0.0 {
            return false;
        }
        let (length_a, length_b) = (square_a.sqrt(), square_b.sqrt());
        let along = b / length_b;
        let from = p - r;
        let u = from.dot(along);
        let height = (from - along * u).length();
        let step = length_a.copysign(a.dot(along));
        // Positions of q and p relative to s and r: the second primitive at four values of u.
        let weight = weight / (step * length_b);
        for (u, sign) in [
            (u, -1.0),
            (u + step - length_b, -1.0),
            (u - length_b, 1.0),
            (u + step, 1.0),
        ] {
            self.second([sign * weight, u, height]);
        }
        true
    }

    /// Adds `weight` times the mean over y on rs.
    fn edge(&mut self, weight: f64, x: DVec3, r: DVec3, s: DVec3) {
        let row = [weight, x.x, x.y, x.z, r.x, r.y, r.z, s.x, s.y, s.z];
        if self.edges.push(row) {
            self.sum += means(self.edges.take());
        }
    }

    /// Adds `weight` times the second primitive at u and h.
    fn second(&mut self, row: [f64; 3]) {
        if self.parallel.push(row) {
            self.sum += second_primitives(self.parallel.take());
        }
    }

    /// The sum, including what is left in the batches.
    fn total(mut self) -> f64 {
        self.sum + means(self.edges.take()) + second_primitives(self.parallel.take())
    }
}

/// Up to eight rows of numbers, by column. Unset rows have weight 0.
struct Eight<const N: usize> {
    columns: [[f64; 8]; N],
    count: usize,
}

impl<const N: usize> Default for Eight<N> {
    fn default() -> Self {
        Self {
            columns: [[0.0; 8]; N],
            count: 0,
        }
    }
}

impl<const N: usize> Eight<N> {
    /// Adds a row; true when there are eight.
    fn push(&mut self, row: [f64; N]) -> bool {
        for (column, x) in self.columns.iter_mut().zip(row) {
            column[self.count] = x;
        }
        self.count += 1;
        self.count == 8
    }

    /// The columns; the next rows start afresh.
    fn take(&mut self) -> &[[f64; 8]; N] {
        // The first column holds the weights.
        self.columns[0][self.count..].fill(0.0);
        self.count = 0;
        &self.columns
    }
}

/// Sum of weighted means of `ln |x - y|` over y on rs; an edge of length 0 adds nothing.
///
/// With x at height h over the line and its foot at u from r, the mean over the length L is
/// `((L - u) ln |s - x| + u ln |r - x| + h angle) / L - 1`, where x sees the edge under the angle.
fn means(rows: &[[f64; 8]; 10]) -> f64 {
    dispatch!(Level::new(), simd => means_of(simd, rows))
}

#[inline(always)]
fn means_of<S: Simd>(simd: S, rows: &[[f64; 8]; 10]) -> f64 {
    let column = |k: usize| f64x8::load_array_ref(simd, &rows[k]);
    let three = |k: usize| [column(k), column(k + 1), column(k + 2)];
    let (weight, point, from, to) = (column(0), three(1), three(4), three(7));
    let (edge, before, behind) = (sub(to, from), sub(point, from), sub(point, to));
    let square = dot(edge, edge);
    let one = f64x8::splat(simd, 1.0);
    let over = one / square.max(LEAST);
    let u = dot(before, edge) * over;
    let foot = sub(before, [u * edge[0], u * edge[1], u * edge[2]]);
    let (near, far) = (dot(before, before), dot(behind, behind));
    let rest = one - u;
    let logs = rest * ln(far.max(LEAST)) + u * ln(near.max(LEAST));
    // In units of the edge's length; the angle's sine is proportional to h.
    let hh = dot(foot, foot) * over;
    let size = (near * far).sqrt() * over;
    let over_sine = angle_over_sine(
        hh - u * rest,
        size,
        #[inline(always)]
        || hh.sqrt(),
    );
    let angle = only(hh.simd_gt(0.0), hh * over_sine);
    let mean = logs * 0.5 + angle - one;
    sum(only(square.simd_gt(0.0), weight * mean))
}

/// Sum of weighted second primitives: functions of u whose second derivative is `ln sqrt(u^2 + h^2)`.
fn second_primitives(rows: &[[f64; 8]; 3]) -> f64 {
    dispatch!(Level::new(), simd => second_primitives_of(simd, rows))
}

#[inline(always)]
fn second_primitives_of<S: Simd>(simd: S, rows: &[[f64; 8]; 3]) -> f64 {
    let column = |k: usize| f64x8::load_array_ref(simd, &rows[k]);
    let (weight, u, h) = (column(0), column(1), column(2));
    let (uu, hh) = (u * u, h * h);
    let angle = only(h.simd_gt(0.0), atan(u / h));
    let logs = (uu - hh) * 0.25 * ln((uu + hh).max(LEAST));
    sum(weight * (logs - uu * 0.75 + h * u * angle))
}

/// The part of `polygon` in front of the plane of `other`.
fn front(polygon: &[DVec3; 3], other: &[DVec3; 3]) -> arrayvec::Polygon {
    let normal = (other[1] - other[0]).cross(other[2] - other[0]);
    let height = polygon.map(|p| normal.dot(p - other[0]));
    // Corners within rounding of the plane lie on it: neighbours must not lose a sliver to noise.
    let noise = 1e-12
        * normal.length()
        * polygon
            .iter()
            .map(|p| (*p - other[0]).length())
            .fold(0.0, f64::max);
    let mut out = arrayvec::Polygon::default();
    for k in 0..3 {
        let (p, q) = (polygon[k], polygon[(k + 1) % 3]);
        let (hp, hq) = (height[k], height[(k + 1) % 3]);
        if hp >= -noise {
            out.push(p);
        }
        if (hp > noise && hq < -noise) || (hp < -noise && hq > noise) {
            out.push(p.lerp(q, hp / (hp - hq)));
        }
    }
    if height.iter().all(|&h| h <= noise) {
        out.clear();
    }
    out
}

/// A triangle cut by one plane: four corners at the most.
mod arrayvec {
    use glam::DVec3;

    #[derive(Default)]
    pub(super) struct Polygon {
        corners: [DVec3; 4],
        count: usize,
    }

    impl Polygon {
        /// Never more than four: a plane cuts two edges at the most.
        pub(super) fn push(&mut self, corner: DVec3) {
            if self.count < 4 {
                self.corners[self.count] = corner;
                self.count += 1;
            }
        }

        pub(super) fn clear(&mut self) {
            self.count = 0;
        }
    }

    impl std::ops::Deref for Polygon {
        type Target = [DVec3];

        fn deref(&self) -> &[DVec3] {
            &self.corners[..self.count]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;
    use crate::geometry::vectors::levels;

    fn squares(a: [DVec3; 4], b: [DVec3; 4]) -> f64 {
        let halves = |q: [DVec3; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]];
        let mut sum = 0.0;
        for s in halves(a) {
            for t in halves(b) {
                sum += exchange(&s, &t);
            }
        }
        sum
    }

    fn v(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }

    /// Catalogue values: Howell C-11 and C-14, recomputed to 15 digits.
    #[test]
    fn squares_face_to_face_and_at_an_edge() {
        let floor = [v(0., 0., 0.), v(1., 0., 0.), v(1., 1., 0.), v(0., 1., 0.)];
        let ceiling = |h| [v(0., 0., h), v(0., 1., h), v(1., 1., h), v(1., 0., h)];
        let close = |got: f64, want: f64, tolerance: f64| {
            assert!((got / want - 1.0).abs() < tolerance, "{got} {want}")
        };
        close(squares(floor, ceiling(1.0)), 0.199_824_895_698_387, 1e-6);
        close(squares(floor, ceiling(10.0)), 0.003_162_056_838_755, 1e-6);
        close(squares(floor, ceiling(0.1)), 0.826_994_522_397, 1e-4);
        let wall = [v(0., 0., 0.), v(0., 1., 0.), v(0., 1., 1.), v(0., 0., 1.)];
        close(squares(floor, wall), 0.200_043_776_075_403, 1e-5);
    }

    /// Mean of `ln |x - y|` over both edges, as the code above has it.
    fn mean_log(p: DVec3, q: DVec3, r: DVec3, s: DVec3) -> f64 {
        let mut sum = Logs::default();
        sum.pair(1.0, [p, q], [r, s]);
        sum.total()
    }

    /// Eight at once against one at a time, at every place of a batch.
    #[test]
    fn batches_agree_with_plain_primitives() {
        let primitive = |u: f64, h: f64| {
            0.5 * u * (u * u + h * h).ln() - u + if h > 0.0 { h * (u / h).atan() } else { 0.0 }
        };
        let second = |u: f64, h: f64| {
            let (uu, hh) = (u * u, h * h);
            let angle = if h > 0.0 { (u / h).atan() } else { 0.0 };
            0.25 * (uu - hh) * (uu + hh).ln() - 0.75 * uu + h * u * angle
        };
        let mut random = Pcg::new(3);
        for round in 0..500 {
            let scale = 10f64.powi(round % 9 - 6);
            let (mut sum, mut plain, mut most) = (Logs::default(), 0.0, 0.0_f64);
            for k in 0..=round % 21 {
                let mut point = |s: f64| v(random.f64(), random.f64(), random.f64()) * s;
                let (x, r) = (point(1.0), point(1.0));
                let s = r + point(scale) - point(scale);
                let weight = f64::from(k % 5) - 1.5;
                sum.edge(weight, x, r, s);
                let length = (s - r).length();
                let along = (s - r) / length;
                let u = (x - r).dot(along);
                let h = (x - r - u * along).length();
                plain += weight * (primitive(length - u, h) - primitive(-u, h)) / length;
                sum.second([weight, u, h * scale]);
                let term = weight * second(u, h * scale);
                plain += term;
                most += (weight * length.ln()).abs() + term.abs() + 4.0;
            }
            // The plain difference of primitives loses digits where the edge is short.
            let lost = 1e-14 * most / scale.min(1.0);
            let got = sum.total();
            assert!((got - plain).abs() < lost, "{got} {plain} at {scale}");
        }
        // Whatever the processor.
        let rows = std::array::from_fn(|_| std::array::from_fn(|_| random.f64()));
        let sums = |level| {
            let of_edges = dispatch!(level, simd => means_of(simd, &rows));
            let rows = [rows[0], rows[1], rows[2]];
            [
                of_edges,
                dispatch!(level, simd => second_primitives_of(simd, &rows)),
            ]
        };
        for (sum, plain) in levels()
            .into_iter()
            .flat_map(|level| sums(level).into_iter().zip(sums(Level::new())))
        {
            assert!((sum - plain).abs() < 1e-13, "{sum} {plain}");
        }
        // On the edge, at its end, beyond it; and an edge that is a point.
        let (o, e) = (DVec3::ZERO, DVec3::X);
        for (x, want) in [
            (0.5 * e, -1.0 - 2.0_f64.ln()),
            (o, -1.0),
            (e, -1.0),
            (2.0 * e, 4.0_f64.ln() - 1.0),
        ] {
            let mut sum = Logs::default();
            sum.edge(1.0, x, o, e);
            assert!((sum.total() - want).abs() < 1e-15, "{x}");
        }
        let mut sum = Logs::default();
        sum.edge(1.0, e, o, o);
        assert_eq!(sum.total(), 0.0);
    }

    /// Closed forms against plain double quadrature; the edges are apart, where quadrature is exact too.
    #[test]
    fn mean_logarithms() {
        let plain = |p: DVec3, q: DVec3, r: DVec3, s: DVec3| -> f64 {
            // Composite Gauss: 40 parts of 6 points.
            let nodes: Vec<(f64, f64)> = (0..40)
                .flat_map(|k| {
                    GAUSS
                        .iter()
                        .map(move |&(t, w)| ((f64::from(k) + t) / 40.0, w / 40.0))
                })
                .collect();
            nodes
                .iter()
                .map(|&(t, a)| {
                    nodes
                        .iter()
                        .map(|&(u, b)| a * b * p.lerp(q, t).distance(r.lerp(s, u)).ln())
                        .sum::<f64>()
                })
                .sum()
        };
        let o = DVec3::ZERO;
        for (p, q, r, s, tolerance) in [
            (o, v(1., 0., 0.), v(0.3, 0.4, 0.), v(1.8, 0.4, 0.), 1e-12),
            (o, v(1., 0., 0.), v(1.8, 0.4, 0.2), v(0.3, 0.4, 0.2), 1e-12),
            (o, v(1., 2., 0.), v(3., 6., 0.), v(2., 4., 0.), 1e-12),
            (o, v(1., 0., 0.), v(0., 0.5, 1.), v(0.2, 1.5, 0.), 1e-6),
            // Common corners: here the quadrature errs.
            (o, v(1., 0., 0.), o, v(0.2, 1.5, 0.), 1e-4),
            (v(1., 0., 0.), o, v(-0.5, 0., 0.), o, 1e-4),
            (o, v(1., 0., 0.), v(0.7, 0., 0.), v(-0.1, 0., 0.), 2e-2),
        ] {
            let (fast, slow) = (mean_log(p, q, r, s), plain(p, q, r, s));
            assert!(
                (fast - slow).abs() < tolerance,
                "{p} {q} {r} {s}: {fast} {slow}"
            );
        }
        // One edge with itself: ln L - 3/2.
        assert_eq!(
            mean_log(o, v(2., 0., 0.), v(2., 0., 0.), o),
            2.0_f64.ln() - 1.5
        );
    }

    /// Each face of a regular tetrahedron sees the others alike: 1/3.
    #[test]
    fn tetrahedron() {
        let c = [
            v(1., 1., 1.),
            v(1., -1., -1.),
            v(-1., 1., -1.),
            v(-1., -1., 1.),
        ];
        let area = 0.5 * (c[1] - c[0]).cross(c[2] - c[0]).length();
        let inward = |i: usize, j: usize, k: usize| {
            let flip = (c[j] - c[i]).cross(c[k] - c[i]).dot(c[i]) > 0.0;
            if flip {
                [c[i], c[k], c[j]]
            } else {
                [c[i], c[j], c[k]]
            }
        };
        let f = exchange(&inward(0, 1, 2), &inward(0, 1, 3)) / area;
        assert!((f - 1.0 / 3.0).abs() < 1e-5, "{f}");
    }

    /// Half of a square is below the other's plane: only the front half counts.
    #[test]
    fn clipped_at_the_horizon() {
        let floor = [v(0., 0., 0.), v(1., 0., 0.), v(1., 1., 0.), v(0., 1., 0.)];
        let whole = [
            v(-1., 0., -1.),
            v(-1., 1., -1.),
            v(-1., 1., 1.),
            v(-1., 0., 1.),
        ];
        let half = [
            v(-1., 0., 0.),
            v(-1., 1., 0.),
            v(-1., 1., 1.),
            v(-1., 0., 1.),
        ];
        assert!((squares(floor, whole) - squares(floor, half)).abs() < 1e-4 * squares(floor, half));
    }
}
