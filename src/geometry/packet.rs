//! Sixteen segments at once through the tree.
//!
//! A node's eight boxes are first tested against the whole packet (interval arithmetic over its ends and directions), the boxes
//! that survive against the sixteen segments, and a leaf's triangles one after another against those segments
//! that are still open. The answers are the same bits as from one segment at a time.

use super::index::{RayIndex, Stack, safe_inverse};
use super::segment::{NO_PLANE, Segment};
use super::tree::{LEAF, Node};
use super::triangle::{Block, PACKET, Shear, meet_lines};
use glam::Vec3;
use wide::{f32x8, f32x16};

/// Up to sixteen segments that share their main axis.
pub(crate) struct Packet {
    /// Main axis last, as in [`Shear::axes`].
    axes: [usize; 3],
    /// In turned axes.
    origin: [f32x16; 3],
    slope: [f32x16; 3],
    range: [f32x16; 2],
    /// In the axes of the world.
    start: [f32x16; 3],
    inverse: [f32x16; 3],
    planes: [[u32; PACKET]; 2],
    bundle: Bundle,
}

/// Bounds on all segments of a packet.
struct Bundle {
    /// Bounds on the starts and on the ends, by axis.
    starts: [[f32; 2]; 3],
    ends: [[f32; 2]; 3],
    /// Bounds on 1/d where all segments run the same way along an axis.
    inverse: [[f32; 2]; 3],
    /// +1, -1, or 0 where they do not.
    way: [i8; 3],
}

impl Packet {
    /// A bit for each segment that something blocks.
    pub(crate) fn occluded(
        index: &RayIndex,
        segments: &[Segment],
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> u32 {
        if index.tree.nodes.is_empty() {
            return 0;
        }
        Self::each(index, segments, |packet, open| {
            packet.traverse(index, open, opaque)
        })
    }

    /// As [`Self::occluded`], by the triangles of a list.
    pub(crate) fn occluded_by(
        index: &RayIndex,
        list: &[u32],
        segments: &[Segment],
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> u32 {
        Self::each(index, segments, |packet, open| {
            let mut hidden = 0;
            for &id in list {
                if let Some((block, place)) = index.place(id) {
                    let lanes = open & !hidden;
                    hidden |= packet.meet_one(&index.tree.blocks[block], place, lanes, opaque);
                    if hidden == open {
                        break;
                    }
                }
            }
            hidden
        })
    }

    /// Makes a packet for each main axis among the segments, and gathers the answers.
    #[inline(always)]
    fn each(index: &RayIndex, segments: &[Segment], ask: impl Fn(&Self, u32) -> u32) -> u32 {
        let mut lines = [(Vec3::ZERO, Shear::new(Vec3::ZERO, Vec3::Z, [0.0; 2])); PACKET];
        let mut by_axis = [0u32; 3];
        for (k, segment) in segments.iter().take(PACKET).enumerate() {
            lines[k] = index.line(segment);
            by_axis[lines[k].1.axes[2]] |= 1 << k;
        }
        let mut hidden = 0;
        for open in by_axis {
            if open != 0 {
                hidden |= ask(&Self::new(segments, &lines, open), open);
            }
        }
        hidden
    }

    /// Lanes outside `open` repeat one that is in it.
    fn new(segments: &[Segment], lines: &[(Vec3, Shear); PACKET], open: u32) -> Self {
        let first = open.trailing_zeros() as usize;
        let lane = |k: usize| if open >> k & 1 == 1 { k } else { first };
        let gather = |f: &dyn Fn(usize) -> f32| f32x16::new(std::array::from_fn(|k| f(lane(k))));
        let inverse: [[f32; PACKET]; 3] =
            [0, 1, 2].map(|axis| std::array::from_fn(|k| safe_inverse(lines[lane(k)].0[axis])));
        let mut bundle = Bundle {
            starts: [[f32::INFINITY, f32::NEG_INFINITY]; 3],
            ends: [[f32::INFINITY, f32::NEG_INFINITY]; 3],
            inverse: [[f32::INFINITY, f32::NEG_INFINITY]; 3],
            way: [0; 3],
        };
        for (axis, inverse) in inverse.iter().enumerate() {
            for k in 0..PACKET {
                let segment = &segments[lane(k)];
                widen(&mut bundle.starts[axis], segment.from[axis]);
                widen(&mut bundle.ends[axis], segment.to[axis]);
                widen(&mut bundle.inverse[axis], inverse[k]);
            }
            let [low, high] = bundle.inverse[axis];
            bundle.way[axis] = i8::from(low > 0.0) - i8::from(high < 0.0);
        }
        Self {
            axes: lines[first].1.axes,
            origin: [0, 1, 2].map(|axis| gather(&|k| lines[k].1.origin[axis])),
            slope: [0, 1, 2].map(|axis| gather(&|k| lines[k].1.slope[axis])),
            range: [0, 1].map(|side| gather(&|k| lines[k].1.range[side])),
            start: [0, 1, 2].map(|axis| gather(&|k| segments[k].from[axis])),
            inverse: inverse.map(f32x16::new),
            planes: [0, 1].map(|end| std::array::from_fn(|k| segments[lane(k)].planes[end])),
            bundle,
        }
    }

    /// Walks the tree with the lanes of `open`; returns those that are hidden.
    fn traverse(
        &self,
        index: &RayIndex,
        open: u32,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> u32 {
        let mut hidden = 0;
        let mut stack = Stack::new((0u32, open));
        while let Some((entry, lanes)) = stack.pop() {
            let lanes = lanes & !hidden;
            if lanes == 0 {
                continue;
            }
            if entry & LEAF != 0 {
                let block = &index.tree.blocks[(entry & !LEAF) as usize];
                hidden |= self.meet_block(block, lanes, opaque);
                if hidden == open {
                    break;
                }
                continue;
            }
            let node = &index.tree.nodes[entry as usize];
            let mut met = self.bundle.enter(node);
            while met != 0 {
                let child = met.trailing_zeros() as usize;
                met &= met - 1;
                let through = self.enter(node, child) & lanes;
                if through != 0 {
                    stack.push((node.children[child], through));
                }
            }
        }
        hidden
    }

    /// A bit for each segment that meets the box of one child.
    #[inline(always)]
    fn enter(&self, node: &Node, child: usize) -> u32 {
        let mut near = f32x16::ZERO;
        let mut far = f32x16::ONE;
        for axis in 0..3 {
            let low = f32x16::splat(node.bounds[0][axis].as_array()[child]);
            let high = f32x16::splat(node.bounds[1][axis].as_array()[child]);
            let a = (low - self.start[axis]) * self.inverse[axis];
            let b = (high - self.start[axis]) * self.inverse[axis];
            near = near.fast_max(a.fast_min(b));
            far = far.fast_min(a.fast_max(b));
        }
        near.simd_le(far).to_bitmask()
    }

    /// A bit for each segment of `lanes` that a triangle of the block blocks.
    #[inline(always)]
    fn meet_block(
        &self,
        block: &Block,
        lanes: u32,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> u32 {
        let mut hidden = 0;
        for place in 0..block.count as usize {
            hidden |= self.meet_one(block, place, lanes & !hidden, opaque);
            if hidden == lanes {
                break;
            }
        }
        hidden
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
        let corners = self.turned(block, place);
        let (met, e) = meet_lines(corners, self.origin, self.slope, self.range);
        let mut met = met & lanes;
        let mut hidden = 0;
        let plane = block.planes[place];
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            if plane != NO_PLANE && self.planes.iter().any(|side| side[lane] == plane) {
                continue;
            }
            let blocks = block.masked >> place & 1 == 0 || {
                let det = e.det.as_array()[lane];
                let (v, w) = (e.v.as_array()[lane], e.w.as_array()[lane]);
                opaque(block.ids[place], v / det, w / det)
            };
            hidden |= u32::from(blocks) << lane;
        }
        hidden
    }

    /// Corners of a triangle of a block in turned axes.
    #[inline(always)]
    fn turned(&self, block: &Block, place: usize) -> [[f32; 3]; 3] {
        let [x, y, z] = self.axes;
        block
            .corners
            .map(|corner| [x, y, z].map(|axis| corner[axis].as_array()[place]))
    }
}

/// Takes a value into an interval.
#[inline(always)]
fn widen(interval: &mut [f32; 2], x: f32) {
    interval[0] = interval[0].min(x);
    interval[1] = interval[1].max(x);
}

impl Bundle {
    /// A bit for each child whose box some segment of the bundle might meet.
    #[inline(always)]
    fn enter(&self, node: &Node) -> u32 {
        let mut near = f32x8::ZERO;
        let mut far = f32x8::ONE;
        let mut apart = f32x8::ZERO;
        for axis in 0..3 {
            let [low, high] = [node.bounds[0][axis], node.bounds[1][axis]];
            let [start, end] = [self.starts[axis], self.ends[axis]];
            let least = f32x8::splat(start[0].min(end[0]));
            let most = f32x8::splat(start[1].max(end[1]));
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
            let [a, b] = self.inverse[axis].map(f32x8::splat);
            let into = first - f32x8::splat(early);
            let out = last - f32x8::splat(late);
            near = near.fast_max((into * a).fast_min(into * b));
            far = far.fast_min((out * a).fast_max(out * b));
        }
        let open = near.simd_le(far).to_bitmask() & !apart.to_bitmask();
        open & ((1 << node.count) - 1)
    }
}
