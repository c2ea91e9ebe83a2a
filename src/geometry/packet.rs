//! Sixteen segments at once through the tree.
//!
//! A node's eight boxes are first tested against the whole packet (interval arithmetic over its ends and directions), the boxes
//! that survive against the sixteen segments. In a leaf, triangles with all ends of the packet on one side of their
//! plane are dropped, eight at a time, and the others tested one after another against those segments that are
//! still open. The answers are the same bits as from one segment at a time.

use super::bvh::{BvhNode, LEAF};
use super::index::RayIndex;
use super::segment::{NO_PLANE, Segment};
use super::triangle::{Block, Edges, PACKET, meet_lines};
use super::walk::{LEAST_COMPONENT, Stack};
use fearless_simd::{Level, dispatch, f32x4, f32x8, f32x16, f64x2, mask32x16, prelude::*, u32x16};
use glam::Vec3;

/// Up to sixteen segments.
pub(crate) struct Packet<S: Simd> {
    turn: Turn<S>,
    /// In turned axes, see [`super::triangle::Shear`].
    origin: [f32x16<S>; 3],
    slope: [f32x16<S>; 3],
    range: [f32x16<S>; 2],
    /// In the axes of the world: 1/d, and start/d.
    inverse: [f32x16<S>; 3],
    offset: [f32x16<S>; 3],
    planes: [u32x16<S>; 2],
    bundle: Bundle,
    /// The lanes that hold a segment.
    open: u32,
}

/// Which axes of the world become x, y, z.
enum Turn<S: Simd> {
    /// The same for all segments.
    Same([usize; 3]),
    /// The lanes whose main axis is x, and y.
    Mixed([mask32x16<S>; 2]),
}

/// Bounds on all segments of a packet.
struct Bundle {
    /// Least and greatest start, and end.
    starts: [Vec3; 2],
    ends: [Vec3; 2],
    /// Bounds on 1/d.
    inverse: [[f32; 2]; 3],
    /// +1, -1 where all segments run the same way along an axis, else 0.
    way: [i8; 3],
    /// Slack of the test for sides of a plane, in units of the normal's components' sum.
    slack: f32,
}

/// Roundings of f32, of the scene's reach, that the side of a plane is uncertain by: 2^-20.
const SIDE_SLACK: f32 = 1.0 / 1_048_576.0;

/// Ends within a box of this share of the scene's surface are one place. Measured in a room of 350 000 triangles.
const COMMON_PLACE: f32 = 0.01;

impl RayIndex {
    /// As [`Self::occluded_with`] for many segments.
    ///
    /// # Panics
    /// When the slices differ in length.
    pub fn occluded_many_with(
        &self,
        segments: &[Segment],
        out: &mut [bool],
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) {
        assert_eq!(segments.len(), out.len(), "one answer for each segment");
        for (group, answers) in segments.chunks(PACKET).zip(out.chunks_mut(PACKET)) {
            let hidden =
                dispatch!(Level::new(), simd => Packet::occluded(simd, self, group, opaque));
            for (k, answer) in answers.iter_mut().enumerate() {
                *answer = hidden >> k & 1 == 1;
            }
        }
    }

    /// Does one of the triangles of `list` block? For a shaft with few blockers: no tree is walked. Otherwise as
    /// [`Self::occluded_many_with`].
    ///
    /// # Panics
    /// When the slices differ in length.
    pub fn occluded_by(
        &self,
        list: &[u32],
        segments: &[Segment],
        out: &mut [bool],
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) {
        assert_eq!(segments.len(), out.len(), "one answer for each segment");
        for (group, answers) in segments.chunks(PACKET).zip(out.chunks_mut(PACKET)) {
            let hidden = dispatch!(Level::new(), simd => Packet::occluded_by(simd, self, list, group, opaque));
            for (k, answer) in answers.iter_mut().enumerate() {
                *answer = hidden >> k & 1 == 1;
            }
        }
    }
}

impl<S: Simd> Packet<S> {
    /// A bit for each segment that something blocks.
    #[inline(always)]
    pub(super) fn occluded(
        simd: S,
        index: &RayIndex,
        segments: &[Segment],
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> u32 {
        if index.tree.nodes.is_empty() {
            return 0;
        }
        match Self::new(simd, index, segments) {
            Some(packet) if packet.worthwhile(index) => packet.traverse(index, opaque),
            _ => (0..).zip(segments).fold(0, |hidden, (k, segment)| {
                hidden | u32::from(index.occluded_with(segment, opaque)) << k
            }),
        }
    }

    /// As [`Self::occluded`], by the triangles of a list.
    #[inline(always)]
    pub(super) fn occluded_by(
        simd: S,
        index: &RayIndex,
        list: &[u32],
        segments: &[Segment],
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> u32 {
        let Some(packet) = Self::new(simd, index, segments) else {
            return 0;
        };
        let mut open = packet.open;
        for &id in list {
            if let Some((block, place)) = index.place(id) {
                open &= !packet.meet_one(&index.tree.blocks[block], place, open, opaque);
                if open == 0 {
                    break;
                }
            }
        }
        packet.open & !open
    }

    /// None of no segments. Free lanes repeat the first.
    #[inline(always)]
    pub(super) fn new(simd: S, index: &RayIndex, segments: &[Segment]) -> Option<Self> {
        let first = segments.first()?;
        let count = segments.len().min(PACKET);
        let mut rows = [row(simd, first); PACKET];
        for (place, segment) in rows.iter_mut().zip(segments) {
            *place = row(simd, segment);
        }
        let [x, y, z, to_x, to_y, to_z, plane, other] = columns(&rows);
        let from = [x, y, z];
        let d = [to_x - x, to_y - y, to_z - z];
        let turn = Turn::of(d);
        let turned = turn.lanes(d);
        let one = f32x16::splat(simd, 1.0);
        let inverse = one / turned[2];
        let gap = f32x16::splat(simd, index.gap) / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let inverses = [safe_inverse(d[0]), safe_inverse(d[1]), safe_inverse(d[2])];
        Some(Self {
            origin: turn.lanes(from),
            slope: [turned[0] * inverse, turned[1] * inverse, inverse],
            range: [gap, one - gap],
            offset: [
                from[0] * inverses[0],
                from[1] * inverses[1],
                from[2] * inverses[2],
            ],
            bundle: Bundle::of(&rows, &inverses, SIDE_SLACK * index.reach()),
            inverse: inverses,
            planes: [plane.to_bits(), other.to_bits()],
            turn,
            open: (1 << count) - 1,
        })
    }

    /// In a tree of more than one node, segments that have neither a way along their main axes nor a place in common are faster one by one.
    #[inline(always)]
    fn worthwhile(&self, index: &RayIndex) -> bool {
        if index.tree.nodes.len() <= 1 || matches!(self.turn, Turn::Same(_)) {
            return true;
        }
        let area = |[low, high]: [Vec3; 2]| {
            let d = high - low;
            d.x * d.y + d.y * d.z + d.z * d.x
        };
        let loose = area(self.bundle.starts).min(area(self.bundle.ends));
        loose < COMMON_PLACE * area(index.tree.bounds)
    }

    /// Walks the tree; returns the lanes that are hidden.
    #[inline(always)]
    fn traverse(&self, index: &RayIndex, opaque: &impl Fn(u32, f32, f32) -> bool) -> u32 {
        let mut open = self.open;
        let mut stack = Stack::new((0u32, open));
        while let Some((entry, lanes)) = stack.pop() {
            let lanes = lanes & open;
            if lanes == 0 {
                continue;
            }
            if entry & LEAF != 0 {
                let block = &index.tree.blocks[(entry & !LEAF) as usize];
                open &= !self.meet_block(block, lanes, opaque);
                if open == 0 {
                    break;
                }
                continue;
            }
            let node = &index.tree.nodes[entry as usize];
            let mut met = self.boxes(node);
            while met != 0 {
                let child = met.trailing_zeros() as usize;
                met &= met - 1;
                let through = self.enter(node, child) & lanes;
                if through != 0 {
                    stack.push((node.children[child], through));
                }
            }
        }
        self.open & !open
    }

    /// A bit for each segment that meets the box of one child.
    #[inline(always)]
    fn enter(&self, node: &BvhNode, child: usize) -> u32 {
        let one = f32x16::splat(self.simd(), 1.0);
        let (near, far) = self.slabs(node, child, one);
        near.simd_le(far).to_bitmask() as u32
    }

    /// The same for segments that end at their nearest hit, and where the first enters.
    #[inline(always)]
    pub(super) fn enter_near(&self, node: &BvhNode, child: usize) -> (f32, u32) {
        let (near, far) = self.slabs(node, child, self.range[1]);
        let met = near.simd_le(far);
        let first = met.select(near, f32x16::splat(self.simd(), 1.0));
        (range_of(first)[0], met.to_bitmask() as u32)
    }

    /// Where the segments enter and leave the box of one child.
    #[inline(always)]
    fn slabs(&self, node: &BvhNode, child: usize, end: f32x16<S>) -> (f32x16<S>, f32x16<S>) {
        let simd = self.simd();
        let mut near = f32x16::splat(simd, 0.0);
        let mut far = end;
        for axis in 0..3 {
            let low = f32x16::splat(simd, node.bounds[0][axis].0[child]);
            let high = f32x16::splat(simd, node.bounds[1][axis].0[child]);
            let a = low.mul_sub(self.inverse[axis], self.offset[axis]);
            let b = high.mul_sub(self.inverse[axis], self.offset[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near, far)
    }

    #[inline(always)]
    fn simd(&self) -> S {
        self.range[0].simd
    }

    /// The lanes that hold a segment.
    pub(super) fn open(&self) -> u32 {
        self.open
    }

    /// A bit for each child whose box some segment might meet.
    #[inline(always)]
    pub(super) fn boxes(&self, node: &BvhNode) -> u32 {
        self.bundle.enter(self.simd(), node)
    }

    /// A bit for each triangle of a block that some segment might meet.
    #[inline(always)]
    pub(super) fn straddled(&self, block: &Block) -> u32 {
        self.bundle.straddles(self.simd(), block)
    }

    /// Ends a segment at `t`.
    #[inline(always)]
    pub(super) fn shorten(&mut self, lane: usize, t: f32) {
        let end = &mut self.range[1][lane];
        *end = end.min(t);
    }

    /// Where the longest segment ends. Free lanes repeat the first and never end: they count as long as it.
    #[inline(always)]
    pub(super) fn farthest(&self) -> f32 {
        let ends = self.range[1].to_array();
        let count = 32 - self.open.leading_zeros() as usize;
        ends[..count].iter().fold(0.0, |a, &b| a.max(b))
    }

    /// A bit for each segment of `lanes` that meets one triangle of the block in its range, masks aside, and where.
    #[inline(always)]
    pub(super) fn meet(&self, block: &Block, place: usize, lanes: u32) -> (u32, Edges<f32x16<S>>) {
        let simd = self.simd();
        let corners = block.corner_lane(place);
        let [a, b, c] = corners;
        let corners = match &self.turn {
            &Turn::Same([x, y, z]) => [
                splat(simd, [a[x], a[y], a[z]]),
                splat(simd, [b[x], b[y], b[z]]),
                splat(simd, [c[x], c[y], c[z]]),
            ],
            mixed => [
                mixed.lanes(splat(simd, a)),
                mixed.lanes(splat(simd, b)),
                mixed.lanes(splat(simd, c)),
            ],
        };
        let (met, e) = meet_lines(corners, self.origin, self.slope, self.range);
        let mut met = met & lanes;
        let plane = block.planes[place];
        if met != 0 && plane != NO_PLANE {
            let own = self.planes[0].simd_eq(plane) | self.planes[1].simd_eq(plane);
            met &= !(own.to_bitmask() as u32);
        }
        (met, e)
    }

    /// A bit for each segment of `lanes` that a triangle of the block blocks.
    #[inline(always)]
    fn meet_block(
        &self,
        block: &Block,
        lanes: u32,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> u32 {
        let mut open = lanes;
        let mut places = self.bundle.straddles(self.simd(), block);
        while places != 0 && open != 0 {
            let place = places.trailing_zeros() as usize;
            places &= places - 1;
            open &= !self.meet_one(block, place, open, opaque);
        }
        lanes & !open
    }

    /// A bit for each segment of `lanes` that one triangle of the block blocks.
    #[inline(always)]
    fn meet_one(
        &self,
        block: &Block,
        place: usize,
        lanes: u32,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> u32 {
        let (mut met, e) = self.meet(block, place, lanes);
        if block.masked >> place & 1 == 0 {
            return met;
        }
        let mut hidden = 0;
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            let (det, v, w) = (e.det[lane], e.v[lane], e.w[lane]);
            hidden |= u32::from(opaque(block.ids[place], v / det, w / det)) << lane;
        }
        hidden
    }
}

impl<S: Simd> Turn<S> {
    /// By the greatest component of each direction.
    #[inline(always)]
    fn of(d: [f32x16<S>; 3]) -> Self {
        let size = [d[0].abs(), d[1].abs(), d[2].abs()];
        let main_z = size[2].simd_ge(size[0]) & size[2].simd_ge(size[1]);
        let main_y = size[1].simd_ge(size[0]) & !main_z;
        let main_x = !(main_y | main_z);
        if main_x.all_true() {
            Self::Same([1, 2, 0])
        } else if main_y.all_true() {
            Self::Same([2, 0, 1])
        } else if main_z.all_true() {
            Self::Same([0, 1, 2])
        } else {
            Self::Mixed([main_x, main_y])
        }
    }

    /// World axes to turned axes.
    #[inline(always)]
    fn lanes(&self, [x, y, z]: [f32x16<S>; 3]) -> [f32x16<S>; 3] {
        match self {
            &Self::Same([a, b, c]) => [[x, y, z][a], [x, y, z][b], [x, y, z][c]],
            Self::Mixed([main_x, main_y]) => [
                main_x.select(y, main_y.select(z, x)),
                main_x.select(z, main_y.select(x, y)),
                main_x.select(x, main_y.select(y, z)),
            ],
        }
    }
}

/// A segment as one row: ends, then planes.
#[inline(always)]
fn row<S: Simd>(simd: S, s: &Segment) -> f32x8<S> {
    let [p, q] = [f32::from_bits(s.planes[0]), f32::from_bits(s.planes[1])];
    [s.from.x, s.from.y, s.from.z, s.to.x, s.to.y, s.to.z, p, q].simd_into(simd)
}

/// Starts, ends and planes of sixteen rows, side by side.
#[inline(always)]
fn columns<S: Simd>(rows: &[f32x8<S>; PACKET]) -> [f32x16<S>; 8] {
    let [a, b, c, d] = [
        squares(rows, 0),
        squares(rows, 4),
        squares(rows, 8),
        squares(rows, 12),
    ];
    let column = |k: usize| a[k].combine(b[k]).combine(c[k].combine(d[k]));
    [
        column(0),
        column(1),
        column(2),
        column(3),
        column(4),
        column(5),
        column(6),
        column(7),
    ]
}

/// The eight columns of four rows from `first` on.
#[inline(always)]
fn squares<S: Simd>(rows: &[f32x8<S>; PACKET], first: usize) -> [f32x4<S>; 8] {
    let (a, e) = rows[first].split();
    let (b, f) = rows[first + 1].split();
    let (c, g) = rows[first + 2].split();
    let (d, h) = rows[first + 3].split();
    let ([i, j, k, l], [m, n, o, p]) = (transposed([a, b, c, d]), transposed([e, f, g, h]));
    [i, j, k, l, m, n, o, p]
}

/// Rows for columns.
#[inline(always)]
fn transposed<S: Simd>([a, b, c, d]: [f32x4<S>; 4]) -> [f32x4<S>; 4] {
    let pairs = |x: f32x4<S>, y: f32x4<S>| -> [f64x2<S>; 2] {
        [x.zip_low(y).bitcast(), x.zip_high(y).bitcast()]
    };
    let ([ab, ab2], [cd, cd2]) = (pairs(a, b), pairs(c, d));
    [
        ab.zip_low(cd).bitcast(),
        ab.zip_high(cd).bitcast(),
        ab2.zip_low(cd2).bitcast(),
        ab2.zip_high(cd2).bitcast(),
    ]
}

/// The two ends in a row.
#[inline(always)]
fn ends_of<S: Simd>(row: f32x8<S>) -> (Vec3, Vec3) {
    let [a, b, c, d, e, f, _, _] = row.to_array();
    (Vec3::new(a, b, c), Vec3::new(d, e, f))
}

#[inline(always)]
fn splat<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> [f32x16<S>; 3] {
    [
        f32x16::splat(simd, x),
        f32x16::splat(simd, y),
        f32x16::splat(simd, z),
    ]
}

/// 1/d, finite; as in one segment's slabs.
#[inline(always)]
fn safe_inverse<S: Simd>(d: f32x16<S>) -> f32x16<S> {
    let least = f32x16::splat(d.simd, LEAST_COMPONENT);
    let tiny = d.abs().simd_lt(least);
    f32x16::splat(d.simd, 1.0) / tiny.select(least.copysign(d), d)
}

/// Least and greatest lane.
#[inline(always)]
fn range_of<S: Simd>(x: f32x16<S>) -> [f32; 2] {
    let (a, b) = x.split();
    let (least, most) = (a.min(b), a.max(b));
    let ((a, b), (c, d)) = (least.split(), most.split());
    let (least, most) = (a.min(b).to_array(), c.max(d).to_array());
    [
        least[0].min(least[1]).min(least[2].min(least[3])),
        most[0].max(most[1]).max(most[2].max(most[3])),
    ]
}

impl Bundle {
    /// Bounds on rows and on 1/d.
    #[inline(always)]
    fn of<S: Simd>(rows: &[f32x8<S>; PACKET], inverses: &[f32x16<S>; 3], slack: f32) -> Self {
        let (mut least, mut most) = (rows[0], rows[0]);
        for row in &rows[1..] {
            least = least.min(*row);
            most = most.max(*row);
        }
        let mut bundle = Self {
            starts: [ends_of(least).0, ends_of(most).0],
            ends: [ends_of(least).1, ends_of(most).1],
            inverse: [[0.0; 2]; 3],
            way: [0; 3],
            slack,
        };
        for (axis, &inverse) in inverses.iter().enumerate() {
            let [a, b] = range_of(inverse);
            bundle.inverse[axis] = [a, b];
            bundle.way[axis] = i8::from(a > 0.0) - i8::from(b < 0.0);
        }
        bundle
    }

    /// A bit for each child whose box some segment of the bundle might meet.
    #[inline(always)]
    fn enter<S: Simd>(&self, simd: S, node: &BvhNode) -> u32 {
        let mut near = f32x8::splat(simd, 0.0);
        let mut far = f32x8::splat(simd, 1.0);
        let mut apart = near.simd_gt(far);
        for axis in 0..3 {
            let [low, high] = [
                node.bounds[0][axis].load(simd),
                node.bounds[1][axis].load(simd),
            ];
            let start = [self.starts[0][axis], self.starts[1][axis]];
            let end = [self.ends[0][axis], self.ends[1][axis]];
            let least = start[0].min(end[0]);
            let most = start[1].max(end[1]);
            apart = apart | low.simd_gt(most) | high.simd_lt(least);
            let way = self.way[axis];
            if way == 0 {
                continue;
            }
            // For segments that run up: (low - start) / d is least for the largest start, and for the largest or least 1/d as
            // its sign says; the way out is bounded in the same manner.
            let (first, last) = if way > 0 { (low, high) } else { (high, low) };
            let (early, late) = if way > 0 {
                (start[1], start[0])
            } else {
                (start[0], start[1])
            };
            let [a, b] = self.inverse[axis];
            let into = first - early;
            let out = last - late;
            near = near.max((into * a).min(into * b));
            far = far.min((out * a).max(out * b));
        }
        let open = (near.simd_le(far) & !apart).to_bitmask() as u32;
        open & ((1 << node.count) - 1)
    }

    /// A bit for each triangle whose plane may have ends of the bundle on both sides.
    #[inline(always)]
    fn straddles<S: Simd>(&self, simd: S, block: &Block) -> u32 {
        let load = |k: usize, axis: usize| -> f32x8<S> { block.corners[k][axis].load(simd) };
        let a = [load(0, 0), load(0, 1), load(0, 2)];
        let u = [load(1, 0) - a[0], load(1, 1) - a[1], load(1, 2) - a[2]];
        let v = [load(2, 0) - a[0], load(2, 1) - a[1], load(2, 2) - a[2]];
        let n = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        // The least and greatest height of the two boxes of ends over the plane.
        let zero = f32x8::splat(simd, 0.0);
        let mut low = [zero; 2];
        let mut high = [zero; 2];
        let mut slack = zero;
        for axis in 0..3 {
            for (k, ends) in [self.starts, self.ends].iter().enumerate() {
                let p = (f32x8::splat(simd, ends[0][axis]) - a[axis]) * n[axis];
                let q = (f32x8::splat(simd, ends[1][axis]) - a[axis]) * n[axis];
                low[k] += p.min(q);
                high[k] += p.max(q);
            }
            slack += n[axis].abs();
        }
        slack *= self.slack;
        let below = high[0].max(high[1]).simd_lt(-slack);
        let above = low[0].min(low[1]).simd_gt(slack);
        !((below | above).to_bitmask() as u32) & ((1 << block.count) - 1)
    }
}
