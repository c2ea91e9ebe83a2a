//! The watertight segment-triangle test of Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013.
//!
//! A segment p + t d, t in (0,1), is sheared onto its largest axis z; corners become the plane points
//! (x - d_x/d_z z, y - d_y/d_z z) and height z/d_z. The edge functions U, V, W are 2D cross products of these points;
//! the segment's line passes through the triangle when none of them differs in sign, and t = (U z_a + V z_b + W z_c)/(U+V+W).
//! A corner gets the same plane point whichever triangle asks, and a difference of two rounded products never has the
//! wrong sign, only zero; zero counts as inside. So no line slips through between two triangles that share an edge.
//! For that reason no multiply-add is contracted here, and one body of arithmetic serves one triangle, eight triangles
//! against one segment, and sixteen segments against one triangle: all three give the same bits, whatever vectors the processor has.
//!
//! Both faces of a triangle block. A line in the plane of a triangle does not hit it.

use super::vectors::Octet;
use fearless_simd::prelude::*;
use fearless_simd::{f32x8, f32x16, u32x8, u32x16};
use glam::Vec3;
use std::ops::{Add, Mul, Sub};

/// Number of triangles in a block.
pub(crate) const BLOCK: usize = 8;

/// Number of segments in a packet.
pub(crate) const PACKET: usize = 16;

/// A line turned so that it runs along its largest axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shear {
    /// The axes of the world that became x, y, z.
    pub(crate) axes: [usize; 3],
    /// Start of the line, in turned axes.
    pub(crate) origin: [f32; 3],
    /// d_x/d_z, d_y/d_z, 1/d_z.
    pub(crate) slope: [f32; 3],
    /// Open interval of t that counts.
    pub(crate) range: [f32; 2],
}

/// Where a line meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meeting {
    /// Parameter along the line.
    pub(crate) t: f32,
    /// Weights of the second and third corner.
    pub(crate) uv: [f32; 2],
}

/// U, V, W, their sum, and the sum weighted by height: what all forms of the test compare.
#[derive(Clone, Copy)]
pub(crate) struct Edges<T> {
    pub(crate) u: T,
    pub(crate) v: T,
    pub(crate) w: T,
    pub(crate) det: T,
    pub(crate) height: T,
}

/// The arithmetic of the test; `corners[k]` in turned axes.
#[inline(always)]
pub(crate) fn edges<T>(corners: [[T; 3]; 3], origin: [T; 3], slope: [T; 3]) -> Edges<T>
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T>,
{
    let a = sheared(corners[0], origin, slope);
    let b = sheared(corners[1], origin, slope);
    let c = sheared(corners[2], origin, slope);
    let u = c[0] * b[1] - c[1] * b[0];
    let v = a[0] * c[1] - a[1] * c[0];
    let w = b[0] * a[1] - b[1] * a[0];
    Edges {
        u,
        v,
        w,
        det: (u + v) + w,
        height: (u * a[2] + v * b[2]) + w * c[2],
    }
}

/// A corner seen along the line. (No closures here and below: array maps of wide vectors are not always inlined.)
#[inline(always)]
fn sheared<T>(corner: [T; 3], origin: [T; 3], slope: [T; 3]) -> [T; 3]
where
    T: Copy + Sub<Output = T> + Mul<Output = T>,
{
    let z = corner[2] - origin[2];
    [
        (corner[0] - origin[0]) - slope[0] * z,
        (corner[1] - origin[1]) - slope[1] * z,
        slope[2] * z,
    ]
}

/// The axis that a direction runs along most: the last one of equals.
#[inline(always)]
pub(crate) fn main_axis(direction: Vec3) -> usize {
    let d = direction.abs();
    if d.z >= d.x && d.z >= d.y {
        2
    } else if d.y >= d.x {
        1
    } else {
        0
    }
}

impl Shear {
    /// The line `from + t direction` with t in the open interval `range`.
    #[inline(always)]
    pub(crate) fn new(from: Vec3, direction: Vec3, range: [f32; 2]) -> Self {
        let z = main_axis(direction);
        let [x, y, z] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][z];
        let (from, direction) = (from.to_array(), direction.to_array());
        let inverse = 1.0 / direction[z];
        Self {
            axes: [x, y, z],
            origin: [from[x], from[y], from[z]],
            slope: [direction[x] * inverse, direction[y] * inverse, inverse],
            range,
        }
    }

    /// The plain test: one line, one triangle.
    pub(crate) fn meet(&self, corners: [Vec3; 3]) -> Option<Meeting> {
        let e = edges(
            corners.map(|corner| self.axes.map(|k| corner[k])),
            self.origin,
            self.slope,
        );
        let low = e.u.min(e.v).min(e.w);
        let high = e.u.max(e.v).max(e.w);
        if low < 0.0 && high > 0.0 {
            return None;
        }
        let size = e.det.abs();
        let height = if e.det < 0.0 { -e.height } else { e.height };
        // A zero determinant fails both comparisons, and so does a NaN from a segment of no length.
        (height > self.range[0] * size && height < self.range[1] * size).then(|| Meeting {
            t: e.height / e.det,
            uv: [e.v / e.det, e.w / e.det],
        })
    }

    /// The eight sets of edge functions.
    #[inline(always)]
    pub(crate) fn block_edges<S: Simd>(&self, simd: S, block: &Block) -> Edges<f32x8<S>> {
        let [x, y, z] = self.axes;
        let [a, b, c] = &block.corners;
        let load = |lanes: &Octet| lanes.load(simd);
        edges(
            [
                [load(&a[x]), load(&a[y]), load(&a[z])],
                [load(&b[x]), load(&b[y]), load(&b[z])],
                [load(&c[x]), load(&c[y]), load(&c[z])],
            ],
            splat8(simd, self.origin),
            splat8(simd, self.slope),
        )
    }

    /// Which of the eight are met within the range.
    #[inline(always)]
    pub(crate) fn compare<S: Simd>(&self, e: &Edges<f32x8<S>>) -> u32 {
        let low = e.u.min(e.v).min(e.w);
        let high = e.u.max(e.v).max(e.w);
        let size = e.det.abs();
        let sign = e.det.to_bits() & u32x8::splat(e.det.simd, SIGN);
        let height = f32x8::from_bits(e.height.to_bits() ^ sign);
        ((low.simd_ge(0.0) | high.simd_le(0.0))
            & height.simd_gt(size * self.range[0])
            & height.simd_lt(size * self.range[1]))
        .to_bitmask() as u32
    }
}

/// The sign bit of an f32.
const SIGN: u32 = 1 << 31;

#[inline(always)]
fn splat8<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> [f32x8<S>; 3] {
    [
        f32x8::splat(simd, x),
        f32x8::splat(simd, y),
        f32x8::splat(simd, z),
    ]
}

/// Sixteen lines against one triangle, in the turned axes of each line.
#[inline(always)]
pub(crate) fn meet_lines<S: Simd>(
    corners: [[f32x16<S>; 3]; 3],
    origin: [f32x16<S>; 3],
    slope: [f32x16<S>; 3],
    range: [f32x16<S>; 2],
) -> (u32, Edges<f32x16<S>>) {
    let e = edges(corners, origin, slope);
    let low = e.u.min(e.v).min(e.w);
    let high = e.u.max(e.v).max(e.w);
    let size = e.det.abs();
    let sign = e.det.to_bits() & u32x16::splat(e.det.simd, SIGN);
    let height = f32x16::from_bits(e.height.to_bits() ^ sign);
    let met = (low.simd_ge(0.0) | high.simd_le(0.0))
        & height.simd_gt(size * range[0])
        & height.simd_lt(size * range[1]);
    (met.to_bitmask() as u32, e)
}

/// Up to eight triangles, coordinate by coordinate. Free places hold a triangle without area at the origin, which nothing meets.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// `corners[k][axis]`, one lane for each triangle.
    pub(crate) corners: [[Octet; 3]; 3],
    /// Id of the plane of each triangle.
    pub(crate) planes: [u32; BLOCK],
    /// Id of each triangle; free places repeat the first.
    pub(crate) ids: [u32; BLOCK],
    /// How many places are taken.
    pub(crate) count: u32,
    /// Bit k: triangle k has an alpha mask.
    pub(crate) masked: u32,
}

impl Block {
    /// A block of at most eight triangles: id, corners, plane, masked.
    pub(crate) fn new(triangles: impl Iterator<Item = (u32, [Vec3; 3], u32, bool)>) -> Self {
        let mut lanes = [[[0.0f32; BLOCK]; 3]; 3];
        let mut block = Self {
            corners: [[Octet([0.0; BLOCK]); 3]; 3],
            planes: [super::NO_PLANE; BLOCK],
            ids: [0; BLOCK],
            count: 0,
            masked: 0,
        };
        for (lane, (id, corners, plane, masked)) in triangles.take(BLOCK).enumerate() {
            for (corner, point) in corners.iter().enumerate() {
                for axis in 0..3 {
                    lanes[corner][axis][lane] = point[axis];
                }
            }
            block.planes[lane] = plane;
            if lane == 0 {
                block.ids = [id; BLOCK];
            }
            block.ids[lane] = id;
            block.count += 1;
            block.masked |= u32::from(masked) << lane;
        }
        block.corners = lanes.map(|corner| corner.map(Octet));
        block
    }

    /// The corners of the triangle in a lane.
    #[inline(always)]
    pub(crate) fn corner_lane(&self, lane: usize) -> [[f32; 3]; 3] {
        let [a, b, c] = &self.corners;
        [pick(a, lane), pick(b, lane), pick(c, lane)]
    }
}

#[inline(always)]
fn pick(point: &[Octet; 3], lane: usize) -> [f32; 3] {
    [point[0].0[lane], point[1].0[lane], point[2].0[lane]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;
    use crate::geometry::vectors::levels;
    use fearless_simd::dispatch;

    fn point(random: &mut Pcg) -> Vec3 {
        Vec3::new(random.f32(), random.f32(), random.f32()) * 2.0 - 1.0
    }

    #[test]
    fn meets_a_triangle_at_its_known_point() {
        let shear = Shear::new(
            Vec3::new(0.25, 0.25, 1.0),
            Vec3::new(0.0, 0.0, -2.0),
            [0.0, 1.0],
        );
        let met = shear.meet([Vec3::ZERO, Vec3::X, Vec3::Y]).unwrap();
        assert_eq!(
            met,
            Meeting {
                t: 0.5,
                uv: [0.25, 0.25]
            }
        );
        assert_eq!(
            Shear {
                range: [0.0, 0.5],
                ..shear
            }
            .meet([Vec3::ZERO, Vec3::X, Vec3::Y]),
            None
        );
        assert_eq!(
            shear.meet([Vec3::ZERO, Vec3::X, Vec3::X * 0.5]),
            None,
            "no area"
        );
        let none = Shear::new(Vec3::ZERO, Vec3::ZERO, [0.0, 1.0]);
        assert_eq!(none.meet([Vec3::ZERO, Vec3::X, Vec3::Y]), None, "no length");
    }

    #[test]
    fn one_eight_and_sixteen_at_a_time_agree() {
        for level in levels() {
            dispatch!(level, simd => all_agree(simd));
        }
    }

    #[inline(always)]
    fn all_agree<S: Simd>(simd: S) {
        let mut random = Pcg::new(7);
        for _ in 0..2_000 {
            let triangles: Vec<_> = (0..BLOCK as u32)
                .map(|id| (id, [0; 3].map(|_| point(&mut random)), id, false))
                .collect();
            let block = Block::new(triangles.iter().copied());
            let lines: Vec<_> = (0..64)
                .map(|_| Shear::new(point(&mut random), point(&mut random), [1e-3, 0.9]))
                .collect();
            for line in &lines {
                let plain = triangles
                    .iter()
                    .enumerate()
                    .map(|(k, t)| u32::from(line.meet(t.1).is_some()) << k)
                    .sum::<u32>();
                assert_eq!(line.compare(&line.block_edges(simd, &block)), plain);
            }
            for axis in 0..3 {
                let same: Vec<_> = lines
                    .iter()
                    .filter(|l| l.axes[2] == axis)
                    .take(PACKET)
                    .collect();
                if same.len() < PACKET {
                    continue;
                }
                let pick = |f: &dyn Fn(&Shear) -> f32| f32x16::from_fn(simd, |k| f(same[k]));
                let origin = [0, 1, 2].map(|k| pick(&|l| l.origin[k]));
                let slope = [0, 1, 2].map(|k| pick(&|l| l.slope[k]));
                let range = [0, 1].map(|k| pick(&|l| l.range[k]));
                for triangle in &triangles {
                    let corners = triangle
                        .1
                        .map(|c| same[0].axes.map(|k| f32x16::splat(simd, c[k])));
                    let (met, _) = meet_lines(corners, origin, slope, range);
                    for (k, line) in same.iter().enumerate() {
                        assert_eq!(met >> k & 1 == 1, line.meet(triangle.1).is_some());
                    }
                }
            }
        }
    }
}
