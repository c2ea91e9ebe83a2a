//! Which triangle of a chart lies at a place of its plane, or nearest to it.

use glam::DVec2;

/// Buckets a triangle, about: few are in more than four then.
const BUCKETS: f64 = 1.0;
/// Buckets along an axis at the most.
const MOST: usize = 256;

/// Triangles in buckets of equal size.
#[derive(Debug)]
pub(super) struct Finder {
    low: DVec2,
    size: DVec2,
    counts: [usize; 2],
    buckets: Vec<Vec<u32>>,
}

/// Triangle, weights of its corners at the nearest place in it, distance to that.
pub(super) type NearestTriangle = (u32, [f64; 3], f64);

impl Finder {
    /// Over triangles that lie in [0, `extent`].
    pub(super) fn new(triangles: &[[DVec2; 3]], extent: DVec2) -> Self {
        let side = (BUCKETS * triangles.len() as f64).sqrt();
        let aspect = (extent.x / extent.y.max(f64::MIN_POSITIVE)).sqrt();
        let count = |n: f64| (n.round() as usize).clamp(1, MOST);
        let counts = [
            count(side * aspect),
            count(side / aspect.max(f64::MIN_POSITIVE)),
        ];
        let size = DVec2::new(extent.x / counts[0] as f64, extent.y / counts[1] as f64);
        let mut finder = Self {
            low: DVec2::ZERO,
            size: size.max(DVec2::splat(f64::MIN_POSITIVE)),
            counts,
            buckets: vec![Vec::new(); counts[0] * counts[1]],
        };
        for (k, [a, b, c]) in triangles.iter().enumerate() {
            let [x0, y0] = finder.bucket(a.min(*b).min(*c));
            let [x1, y1] = finder.bucket(a.max(*b).max(*c));
            for y in y0..=y1 {
                for x in x0..=x1 {
                    finder.buckets[y * counts[0] + x].push(k as u32);
                }
            }
        }
        finder
    }

    fn bucket(&self, at: DVec2) -> [usize; 2] {
        let place = (at - self.low) / self.size;
        [0, 1].map(|k| (place[k].max(0.0) as usize).min(self.counts[k] - 1))
    }

    /// The nearest place on any triangle.
    pub(super) fn nearest(&self, triangles: &[[DVec2; 3]], at: DVec2) -> Option<NearestTriangle> {
        let middle = self.bucket(at);
        let mut best: Option<NearestTriangle> = None;
        for ring in 0..self.counts[0].max(self.counts[1]) {
            // What is in this ring of buckets is at least so far away.
            let least = (ring as f64 - 1.0) * self.size.min_element();
            if best.is_some_and(|(_, _, d)| d <= least.max(0.0)) {
                break;
            }
            for bucket in self.ring(middle, ring) {
                for &k in &self.buckets[bucket] {
                    let (weights, distance) = closest(at, triangles[k as usize]);
                    let nearer =
                        |(other, _, d): (u32, _, f64)| distance < d || (distance == d && k < other);
                    if best.is_none_or(nearer) {
                        best = Some((k, weights, distance));
                    }
                }
            }
        }
        best
    }

    /// Buckets at a distance of `ring` from one.
    fn ring(&self, [x, y]: [usize; 2], ring: usize) -> Vec<usize> {
        let (left, right) = (x.saturating_sub(ring), (x + ring).min(self.counts[0] - 1));
        let (low, high) = (y.saturating_sub(ring), (y + ring).min(self.counts[1] - 1));
        let mut out = Vec::new();
        for row in low..=high {
            let whole = row + ring == y || row == y + ring;
            for column in left..=right {
                if whole || column + ring == x || column == x + ring {
                    out.push(row * self.counts[0] + column);
                }
            }
        }
        out
    }
}

/// Weights of the corners at the place of a triangle nearest to a point, and the distance. The triangle has area.
pub(super) fn closest(at: DVec2, [a, b, c]: [DVec2; 3]) -> ([f64; 3], f64) {
    let twice = (b - a).perp_dot(c - a);
    let wb = (at - a).perp_dot(c - a) / twice;
    let wc = (b - a).perp_dot(at - a) / twice;
    let weights = [1.0 - wb - wc, wb, wc];
    if weights.iter().all(|w| *w >= 0.0) {
        return (weights, 0.0);
    }
    let corners = [a, b, c];
    let mut best = ([1.0, 0.0, 0.0], f64::INFINITY);
    for k in 0..3 {
        let (p, q) = (corners[k], corners[(k + 1) % 3]);
        let along = (at - p).dot(q - p) / (q - p).length_squared().max(f64::MIN_POSITIVE);
        let along = along.clamp(0.0, 1.0);
        let distance = at.distance(p.lerp(q, along));
        if distance < best.1 {
            let mut weights = [0.0; 3];
            (weights[k], weights[(k + 1) % 3]) = (1.0 - along, along);
            best = (weights, distance);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;

    #[test]
    fn buckets_find_what_a_plain_search_finds() {
        let mut rng = Pcg::new(7);
        let mut point = || DVec2::new(3.0 * rng.f64(), rng.f64());
        let triangles: Vec<[DVec2; 3]> = (0..60)
            .map(|_| [point(), point(), point()])
            .filter(|[a, b, c]| (*b - *a).perp_dot(*c - *a).abs() > 1e-3)
            .map(|[a, b, c]| [a, a.lerp(b, 0.1), a.lerp(c, 0.1)])
            .collect();
        let finder = Finder::new(&triangles, DVec2::new(3.0, 1.0));
        for _ in 0..500 {
            let at = point() * 1.2 - 0.1;
            let plain = triangles.iter().map(|t| closest(at, *t).1);
            let plain = plain.fold(f64::INFINITY, f64::min);
            let found = finder.nearest(&triangles, at).unwrap().2;
            assert!((found - plain).abs() < 1e-12, "{found} {plain}");
        }
    }
}
