//! Which triangle of the output lies where on a triangle of the input.
//!
//! A wall of one triangle may have ten thousand parts, and the error is measured at thousands of points on it: going through all of them for
//! every point took two thirds of the time of rooms of few triangles. So parts lie in a grid of about as many squares, made when a point first asks for it.

use crate::solve::weights_of;
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// A triangle of the output, and weights of its corners at a point.
pub(super) type PointInTriangle = ([u32; 3], [f64; 3]);

/// Triangles of a sheet by a triangle of the mesh that stands for all that belong together, see [`Divided`](super::divided::Divided).
pub(super) struct OutputParts {
    all: HashMap<u32, Vec<[u32; 3]>>,
    grids: HashMap<u32, PartGrid>,
}

impl OutputParts {
    /// Triangles, and the triangle of the mesh that stands for each.
    pub(super) fn new(triangles: &[[u32; 3]], of: &[u32]) -> Self {
        let mut all: HashMap<u32, Vec<[u32; 3]>> = HashMap::new();
        for (triangle, of) in triangles.iter().zip(of) {
            all.entry(*of).or_default().push(*triangle);
        }
        Self {
            all,
            grids: HashMap::new(),
        }
    }

    /// The triangle around a point of what a triangle of the mesh stands for, and weights of its corners there; of several, the one that the point lies
    /// deepest in. `at` are the places of vertices.
    pub(super) fn find(&mut self, at: &[DVec3], of: u32, point: DVec3) -> Option<PointInTriangle> {
        let all = self.all.get(&of)?;
        let grid = self.grids.entry(of);
        let grid = grid.or_insert_with(|| PartGrid::new(at, all));
        let near = grid.near(point).iter().map(|&k| &all[k as usize]);
        // Rounding may put a point outside of all parts.
        deepest(at, near, point)
            .filter(|part| depth(part) >= 0.0)
            .or_else(|| deepest(at, all.iter(), point))
    }
}

/// How far inside of its triangle a point is.
fn depth((_, w): &PointInTriangle) -> f64 {
    w[0].min(w[1]).min(w[2])
}

fn deepest<'a>(
    at: &[DVec3],
    triangles: impl Iterator<Item = &'a [u32; 3]>,
    point: DVec3,
) -> Option<PointInTriangle> {
    let place = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| at[v as usize]);
        (*t, weights_of(point, a, b, c))
    };
    let whole = triangles.map(place).filter(|part| depth(part).is_finite());
    whole.max_by(|a, b| depth(a).total_cmp(&depth(b)))
}

/// Parts by squares of the plane of two axes, over which they are spread most.
struct PartGrid {
    axes: [usize; 2],
    low: DVec2,
    /// Squares for each unit of length.
    scale: DVec2,
    /// Squares on a side.
    side: usize,
    /// For each square the parts that may reach into it, ascending.
    squares: Vec<Vec<u32>>,
}

impl PartGrid {
    fn new(at: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let points = triangles.iter().flatten().map(|&v| at[v as usize]);
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] = points.fold(none, |[low, high], p| [low.min(p), high.max(p)]);
        let size = high - low;
        let least = (0..3).fold(0, |k, axis| if size[axis] < size[k] { axis } else { k });
        let axes = [(least + 1) % 3, (least + 2) % 3];
        let side = triangles.len().isqrt().max(1);
        let scale = axes.map(|axis| side as f64 / size[axis].max(f64::MIN_POSITIVE));
        let mut grid = Self {
            axes,
            low: DVec2::from(axes.map(|axis| low[axis])),
            scale: DVec2::from(scale),
            side,
            squares: vec![Vec::new(); side * side],
        };
        for (k, triangle) in (0..).zip(triangles) {
            let squares = triangle.map(|v| grid.square(at[v as usize]));
            let range = |axis: usize| {
                let [a, b, c] = squares.map(|square| square[axis]);
                a.min(b).min(c)..=a.max(b).max(c)
            };
            for y in range(1) {
                for x in range(0) {
                    grid.squares[y * side + x].push(k);
                }
            }
        }
        grid
    }

    /// The square that a point lies in, or the nearest.
    fn square(&self, point: DVec3) -> [usize; 2] {
        let at = (DVec2::from(self.axes.map(|axis| point[axis])) - self.low) * self.scale;
        at.to_array().map(|x| (x as usize).min(self.side - 1))
    }

    /// Parts that may be around a point.
    fn near(&self, point: DVec3) -> &[u32] {
        let [x, y] = self.square(point);
        &self.squares[y * self.side + x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::{Pcg, triangle_weights};

    /// A triangle divided at random, whichever way it faces; some points lie on its edges, some beside it.
    #[test]
    fn the_grid_finds_what_going_through_all_finds() {
        let mut random = Pcg::new(7);
        for axis in 0..3 {
            let corner = |x: f64, y: f64| {
                let mut p = DVec3::splat(0.3 * x - 0.2 * y);
                (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (x, y);
                p
            };
            let mut at = vec![corner(0.0, 0.0), corner(5.0, 1.0), corner(2.0, 4.0)];
            let mut triangles = vec![[0, 1, 2]];
            for _ in 0..300 {
                let k = random.below(triangles.len() as u32) as usize;
                let [a, b, c] = triangles[k];
                let [p, q, r] = [a, b, c].map(|v: u32| at[v as usize]);
                let w = triangle_weights([random.f64(), random.f64()]);
                let new = at.len() as u32;
                at.push(w[0] * p + w[1] * q + w[2] * r);
                triangles[k] = [a, b, new];
                triangles.extend([[b, c, new], [c, a, new]]);
            }
            let of = vec![9; triangles.len()];
            let mut parts = OutputParts::new(&triangles, &of);
            let mut inside = 0;
            for k in 0..2000 {
                let [v, w] = [random.f64(), random.f64()];
                let point = match k % 3 {
                    0 => at[0].lerp(at[1], v),
                    1 => corner(7.0 * v - 1.0, 7.0 * w - 1.0),
                    _ => at[k % at.len()],
                };
                let found = parts.find(&at, 9, point);
                let plain = deepest(&at, triangles.iter(), point);
                assert_eq!(found, plain);
                inside += usize::from(depth(&plain.unwrap()) >= 0.0);
            }
            assert!((800..1900).contains(&inside), "{inside}");
            assert_eq!(parts.find(&at, 8, at[0]), None);
        }
    }
}
