//! What could block between two patches.
//!
//! The shaft is the convex hull of two patches (Haines and Wallace 1991, "Shaft Culling for Efficient Ray-Traced Radiosity"), clipped to
//! the front half-space of a patch that is a triangle: light neither leaves nor arrives behind it. The hull's sides pass
//! through an edge of one patch and a corner of the other; each is pushed out until all corners are inside, so that a rounding never
//! makes the shaft too small. A triangle is a blocker when something of it, clipped by all sides, is left, and the
//! patches lie on both sides of its plane.

use super::clip::HalfSpace;
use super::segment::NO_PLANE;
use super::vectors::splat;
use fearless_simd::{Level, dispatch, f64x8, prelude::*};
use glam::DVec3;

/// A convex end of a shaft, in the space of the index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShaftEnd {
    /// A triangle that sends or receives on its counter-clockwise side, and the id of its plane.
    Triangle {
        /// Corners, counter-clockwise seen from the front.
        corners: [DVec3; 3],
        /// Triangles of this plane never block.
        plane: u32,
    },
    /// A point of a surface that looks along a normal.
    Point {
        /// Where.
        at: DVec3,
        /// Unit normal; what is behind does not block. Zero: it looks everywhere.
        normal: DVec3,
        /// Triangles of this plane never block.
        plane: u32,
    },
    /// A box around a cluster.
    Box {
        /// Low corner.
        low: DVec3,
        /// High corner.
        high: DVec3,
    },
}

/// Sides that a shaft can have: a hull of 11 points has at most 18, and two fronts.
pub(super) const SIDES: usize = 24;

/// A side of a hull whose normal is shorter than this, of the product of the lengths it is made from, has no direction.
const PARALLEL: f64 = 1e-9;

/// The space between two patches.
#[derive(Clone, Debug)]
pub struct Shaft {
    sides: [HalfSpace; SIDES],
    count: usize,
    /// All corners of both patches.
    corners: [DVec3; 16],
    corner_count: usize,
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    pub(super) planes: [u32; 2],
}

/// Corners and edges of a patch.
struct Shape {
    corners: [DVec3; 8],
    count: usize,
    edges: &'static [[usize; 2]],
}

const TRIANGLE_EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// Corner k of a box has the high side on axis a when bit a of k is set.
const BOX_EDGES: [[usize; 2]; 12] = [
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7],
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

impl ShaftEnd {
    fn shape(&self) -> Shape {
        match *self {
            Self::Triangle {
                corners: [a, b, c], ..
            } => Shape {
                corners: [a, b, c, a, a, a, a, a],
                count: 3,
                edges: &TRIANGLE_EDGES,
            },
            Self::Point { at, .. } => Shape {
                corners: [at; 8],
                count: 1,
                edges: &[],
            },
            Self::Box { low, high } => Shape {
                corners: std::array::from_fn(|k| {
                    let side = |axis: usize| {
                        if k >> axis & 1 == 1 {
                            high[axis]
                        } else {
                            low[axis]
                        }
                    };
                    DVec3::new(side(0), side(1), side(2))
                }),
                count: 8,
                edges: &BOX_EDGES,
            },
        }
    }

    fn plane(&self) -> u32 {
        match *self {
            Self::Triangle { plane, .. } | Self::Point { plane, .. } => plane,
            Self::Box { .. } => NO_PLANE,
        }
    }

    /// The half-space behind which nothing counts.
    fn front(&self) -> Option<HalfSpace> {
        match *self {
            Self::Triangle {
                corners: [a, b, c], ..
            } => {
                let normal = -(b - a).cross(c - a).try_normalize()?;
                Some(HalfSpace {
                    normal,
                    offset: normal.dot(a),
                })
            }
            Self::Point { at, normal, .. } => {
                let normal = -normal.try_normalize()?;
                Some(HalfSpace {
                    normal,
                    offset: normal.dot(at),
                })
            }
            Self::Box { .. } => None,
        }
    }
}

impl Shaft {
    /// The shaft between two patches; the order does not matter.
    pub fn between(a: &ShaftEnd, b: &ShaftEnd) -> Self {
        let (sa, sb) = (a.shape(), b.shape());
        let mut shaft = Self {
            sides: [HalfSpace {
                normal: DVec3::ZERO,
                offset: 0.0,
            }; SIDES],
            count: 0,
            corners: [DVec3::ZERO; 16],
            corner_count: 0,
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
            planes: [a.plane(), b.plane()],
        };
        for &corner in sa.corners[..sa.count].iter().chain(&sb.corners[..sb.count]) {
            shaft.corners[shaft.corner_count] = corner;
            shaft.corner_count += 1;
            shaft.low = shaft.low.min(corner);
            shaft.high = shaft.high.max(corner);
        }
        for front in [a.front(), b.front()].into_iter().flatten() {
            shaft.add(front);
        }
        let size = (shaft.high - shaft.low).length();
        dispatch!(Level::new(), simd => {
            shaft.add_sides(simd, &sa, &sb, size);
            shaft.add_sides(simd, &sb, &sa, size);
        });
        shaft
    }

    /// Sides through an edge of one patch and a corner of the other, eight corners at a time: a plane counts when all corners are on one
    /// side of it, up to roundings, and is moved out to the farthest of them.
    #[inline(always)]
    fn add_sides<S: Simd>(&mut self, simd: S, edges: &Shape, corners: &Shape, size: f64) {
        let lane = |axis: usize| f64x8::from_fn(simd, |k| corners.corners[k][axis]);
        let points = [lane(0), lane(1), lane(2)];
        for &[p, q] in edges.edges {
            let (p, q) = (edges.corners[p], edges.corners[q]);
            let edge = splat(simd, q - p);
            let start = splat(simd, p);
            let r = [
                points[0] - start[0],
                points[1] - start[1],
                points[2] - start[2],
            ];
            let normal = [
                edge[1] * r[2] - edge[2] * r[1],
                edge[2] * r[0] - edge[0] * r[2],
                edge[0] * r[1] - edge[1] * r[0],
            ];
            let square = dot(normal, normal);
            let some = square.simd_gt(dot(edge, edge) * dot(r, r) * (PARALLEL * PARALLEL));
            let length = square.sqrt();
            let slack = length * (PARALLEL * size);
            let (mut least, mut most) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 0.0));
            for &corner in &self.corners[..self.corner_count] {
                let d = dot(normal, splat(simd, corner - p));
                least = least.min(d);
                most = most.max(d);
            }
            let outward = (most.simd_le(slack) & some).to_bitmask();
            let inward = (least.simd_ge(-slack) & some).to_bitmask() & !outward;
            let mut found = (outward | inward) & ((1 << corners.count) - 1);
            while found != 0 {
                let k = found.trailing_zeros() as usize;
                found &= found - 1;
                let pick = |x: &f64x8<S>| x[k] / length[k];
                let normal = DVec3::new(pick(&normal[0]), pick(&normal[1]), pick(&normal[2]));
                let at = normal.dot(p);
                self.add(if outward >> k & 1 == 1 {
                    HalfSpace {
                        normal,
                        offset: at + pick(&most),
                    }
                } else {
                    HalfSpace {
                        normal: -normal,
                        offset: -(at + pick(&least)),
                    }
                });
            }
        }
    }

    /// A side that is there already, or one too many, is left out: fewer sides are safe.
    fn add(&mut self, side: HalfSpace) {
        let again =
            |s: &HalfSpace| s.normal.dot(side.normal) > 1.0 - PARALLEL && s.offset <= side.offset;
        if self.count < SIDES && !self.sides().iter().any(again) {
            self.sides[self.count] = side;
            self.count += 1;
        }
    }

    /// All corners of both patches.
    pub(super) fn corners(&self) -> &[DVec3] {
        &self.corners[..self.corner_count]
    }

    pub(super) fn sides(&self) -> &[HalfSpace] {
        &self.sides[..self.count]
    }

    /// Could a triangle block between the patches? `gap`: how far it may reach into the shaft without counting.
    pub fn holds(&self, triangle: &[DVec3; 3], gap: f64) -> bool {
        let [a, b, c] = *triangle;
        let mut crossed = 0u32;
        for (k, side) in self.sides().iter().enumerate() {
            let d = triangle.map(|corner| side.outside(corner) + gap);
            if d.iter().all(|&d| d >= 0.0) {
                return false;
            }
            crossed |= u32::from(d.iter().any(|&d| d > 0.0)) << k;
        }
        let bounds = [(self.low, a.max(b).max(c)), (a.min(b).min(c), self.high)];
        if bounds
            .iter()
            .any(|(low, high)| (*high - *low).min_element() < 0.0)
        {
            return false;
        }
        let Some(normal) = (b - a).cross(c - a).try_normalize() else {
            return false;
        };
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in &self.corners[..self.corner_count] {
            let d = normal.dot(corner - a);
            least = least.min(d);
            most = most.max(d);
        }
        if least >= -gap || most <= gap {
            return false;
        }
        crossed == 0 || dispatch!(Level::new(), simd => self.clipped_holds(simd, triangle, gap))
    }

    /// The last step of [`Self::holds`]: is something left of a triangle when all sides have clipped it?
    #[inline(always)]
    pub(super) fn clipped_holds<S: Simd>(&self, simd: S, triangle: &[DVec3; 3], gap: f64) -> bool {
        let mut outline = ConvexOutline::new(triangle);
        for side in self.sides() {
            match outline.clip(simd, side, gap) {
                Left::Nothing => return false,
                Left::Some => {}
                Left::TooMany => return true,
            }
        }
        true
    }
}

#[inline(always)]
pub(super) fn dot<S: Simd>(a: [f64x8<S>; 3], b: [f64x8<S>; 3]) -> f64x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A convex polygon of up to eight corners, coordinate by coordinate.
struct ConvexOutline {
    corners: [[f64; 8]; 3],
    count: usize,
}

/// What clipping leaves.
enum Left {
    Nothing,
    Some,
    /// More than eight corners; callers stop there, on the safe side.
    TooMany,
}

impl ConvexOutline {
    fn new(triangle: &[DVec3; 3]) -> Self {
        let mut outline = Self {
            corners: [[0.0; 8]; 3],
            count: 3,
        };
        for (k, corner) in triangle.iter().enumerate() {
            outline.set(k, *corner);
        }
        outline
    }

    fn set(&mut self, k: usize, corner: DVec3) {
        for (row, x) in self.corners.iter_mut().zip(corner.to_array()) {
            row[k] = x;
        }
    }

    fn get(&self, k: usize) -> DVec3 {
        DVec3::new(self.corners[0][k], self.corners[1][k], self.corners[2][k])
    }

    /// Keeps what is deeper than `gap` inside.
    #[inline(always)]
    fn clip<S: Simd>(&mut self, simd: S, side: &HalfSpace, gap: f64) -> Left {
        let load = |axis: usize| f64x8::load_array_ref(simd, &self.corners[axis]);
        let points = [load(0), load(1), load(2)];
        let depth = dot(points, splat(simd, side.normal)) - (side.offset - gap);
        let all = (1 << self.count) - 1;
        let inside = depth.simd_lt(0.0).to_bitmask() & all;
        if inside == all {
            return Left::Some;
        }
        if inside == 0 {
            return Left::Nothing;
        }
        // The corners inside follow one another; the outline comes in before the first of them and goes out after the last.
        let depth = depth.to_array();
        let next = |k: usize| if k + 1 == self.count { 0 } else { k + 1 };
        let before = (inside << 1 | inside >> (self.count - 1)) & all;
        let first = (inside & !before).trailing_zeros() as usize;
        let crossing = |k: usize, l: usize| {
            let (a, b) = (self.get(k), self.get(l));
            a + (b - a) * (depth[k] / (depth[k] - depth[l]))
        };
        let mut kept = Self {
            corners: [[0.0; 8]; 3],
            count: 1,
        };
        let last_out = if first == 0 {
            self.count - 1
        } else {
            first - 1
        };
        kept.set(0, crossing(last_out, first));
        let mut k = first;
        loop {
            if kept.count + 1 == 8 {
                return Left::TooMany;
            }
            kept.set(kept.count, self.get(k));
            kept.count += 1;
            let after = next(k);
            if inside >> after & 1 == 0 {
                kept.set(kept.count, crossing(k, after));
                kept.count += 1;
                break;
            }
            k = after;
        }
        *self = kept;
        Left::Some
    }
}
