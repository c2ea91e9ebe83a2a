//! The ray index: is anything between two points, and what does a ray hit first?
//!
//! All queries are exact up to f32: the triangle test is watertight (see `triangle`), and the tree only leaves out what cannot
//! be met. A hit counts when it is farther than [`END_GAP`] of the scene's half size from both ends and does not lie in a plane
//! that the query names. Positions are in the caller's space, recentred on the scene so that f32 is fine enough.
//! Triangles block from both sides. Those with an alpha mask ask the caller, in the `_with` variants, whether the point is
//! opaque; the others never do.

use super::bvh::{Bvh, Input, LEAF};
use super::segment::{NO_PLANE, Segment};
use super::triangle::{BLOCK, Block, Shear};
use super::walk::{Slabs, Stack, push_by_distance};
use fearless_simd::{Level, dispatch, prelude::*};
use glam::Vec3;

/// Hits nearer than this to an end of a segment do not count, of the scene's half size: an end on an edge is off the
/// neighbour's plane by a few roundings of its coordinates (2^-24), and must not be hidden by it.
pub const END_GAP: f32 = 1e-6;

/// Hits in one plane whose distances differ by less than this share are in one place: a few roundings.
const TOGETHER: f32 = 8.0 * f32::EPSILON;

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// Index of the triangle.
    pub triangle: u32,
    /// Barycentric weights of the second and third corner.
    pub uv: [f32; 2],
    /// Did the ray come from the back of the triangle?
    pub from_behind: bool,
}

/// A tree over triangles that answers visibility queries.
#[derive(Clone, Debug)]
pub struct RayIndex {
    pub(crate) tree: Bvh,
    /// Hits within this distance of an end do not count.
    pub(crate) gap: f32,
    /// For each triangle `block * 8 + lane`.
    places: Vec<u32>,
}

/// In [`RayIndex::places`]: the triangle was left out.
const NOWHERE: u32 = u32::MAX;

impl RayIndex {
    /// Builds the index. Triangle k lies in plane `planes[k]` and has an alpha mask if `masked[k]`; missing entries mean no
    /// plane and no mask. Triangles with an index out of range or a coordinate that is not finite are left out.
    pub fn build(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        planes: &[u32],
        masked: &[bool],
    ) -> Self {
        let tree = Bvh::build(Input {
            positions,
            triangles,
            planes,
            masked,
        });
        let gap = END_GAP * 0.5 * (tree.bounds[1] - tree.bounds[0]).max_element();
        let mut places = vec![NOWHERE; triangles.len()];
        for (k, block) in (0u32..).zip(&tree.blocks) {
            for lane in 0..block.count {
                places[block.ids[lane as usize] as usize] = k * BLOCK as u32 + lane;
            }
        }
        Self { tree, gap, places }
    }

    /// The same where only a room of half this size counts of the scene: coordinates there are rounded less.
    pub(crate) fn for_room(mut self, half_size: f32) -> Self {
        self.gap = self.gap.min(END_GAP * half_size);
        self
    }

    /// Block and lane of a triangle.
    pub(crate) fn place(&self, triangle: u32) -> Option<(usize, usize)> {
        let place = *self.places.get(triangle as usize)?;
        (place != NOWHERE).then_some((place as usize / BLOCK, place as usize % BLOCK))
    }

    /// Low and high corner of all triangles.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.tree.bounds
    }

    /// The corners of a triangle, as the index holds them; None for one that was left out.
    pub fn triangle(&self, id: u32) -> Option<[Vec3; 3]> {
        let (block, lane) = self.place(id)?;
        Some(self.tree.blocks[block].corner_lane(lane).map(Vec3::from))
    }

    /// Has the triangle an alpha mask?
    pub fn is_masked(&self, id: u32) -> bool {
        self.place(id)
            .is_some_and(|(block, lane)| self.tree.blocks[block].masked >> lane & 1 == 1)
    }

    /// The largest coordinate, either sign.
    pub(crate) fn reach(&self) -> f32 {
        self.tree
            .bounds
            .map(|corner| corner.abs().max_element())
            .into_iter()
            .fold(0.0, f32::max)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        std::mem::size_of_val(&self.tree.nodes[..])
            + std::mem::size_of_val(&self.tree.blocks[..])
            + std::mem::size_of_val(&self.places[..])
    }

    /// The line of a segment, shortened by the gap at both ends.
    #[inline(always)]
    pub(crate) fn line(&self, segment: &Segment) -> (Vec3, Shear) {
        let direction = segment.to - segment.from;
        let gap = self.gap / direction.length();
        (
            direction,
            Shear::new(segment.from, direction, [gap, 1.0 - gap]),
        )
    }

    /// Does anything block the segment? Masked triangles count as opaque.
    pub fn occluded(&self, segment: &Segment) -> bool {
        self.occluded_with(segment, &|_, _, _| true)
    }

    /// Does anything block the segment? `opaque(triangle, u, v)` is asked for masked triangles, with the weights of the second
    /// and third corner.
    pub fn occluded_with(
        &self,
        segment: &Segment,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> bool {
        !self.tree.nodes.is_empty()
            && dispatch!(Level::new(), simd => self.is_hit(simd, segment, opaque))
    }

    #[inline(always)]
    pub(super) fn is_hit<S: Simd>(
        &self,
        simd: S,
        segment: &Segment,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> bool {
        let (direction, line) = self.line(segment);
        let slabs = Slabs::new(simd, segment.from, direction);
        let mut stack = Stack::new(0u32);
        while let Some(entry) = stack.pop() {
            if entry & LEAF != 0 {
                let block = &self.tree.blocks[(entry & !LEAF) as usize];
                if block_occludes(simd, block, &line, segment.planes, opaque) {
                    return true;
                }
            } else {
                let node = &self.tree.nodes[entry as usize];
                let (_, mut met) = slabs.enter(node, 1.0);
                while met != 0 {
                    stack.push(node.children[met.trailing_zeros() as usize]);
                    met &= met - 1;
                }
            }
        }
        false
    }

    /// The plain version: every triangle in turn.
    pub fn occluded_plain(
        &self,
        segment: &Segment,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> bool {
        let (_, line) = self.line(segment);
        self.tree.blocks.iter().any(|block| {
            (0..block.count as usize).any(|lane| {
                let corners = block.corner_lane(lane).map(Vec3::from);
                let plane = block.planes[lane];
                (plane == NO_PLANE || !segment.planes.contains(&plane))
                    && line.meet(corners).is_some_and(|met| {
                        block.masked >> lane & 1 == 0
                            || opaque(block.ids[lane], met.uv[0], met.uv[1])
                    })
            })
        })
    }

    /// As [`Self::occluded`] for many segments, sixteen at a time; fast when neighbours in the list run alike, as from one
    /// point or between two patches.
    ///
    /// # Panics
    /// When the slices differ in length.
    pub fn occluded_many(&self, segments: &[Segment], out: &mut [bool]) {
        self.occluded_many_with(segments, out, &|_, _, _| true);
    }

    /// The nearest hit with t in the open interval from the gap to `t_max` (in lengths of `direction`), triangles of
    /// `ignore_plane` left out. Masked triangles count as opaque.
    pub fn closest(
        &self,
        from: Vec3,
        direction: Vec3,
        t_max: f32,
        ignore_plane: u32,
    ) -> Option<Hit> {
        self.closest_with(from, direction, t_max, ignore_plane, &|_, _, _| true)
    }

    /// As [`Self::closest`]; masked triangles are asked.
    pub fn closest_with(
        &self,
        from: Vec3,
        direction: Vec3,
        t_max: f32,
        ignore_plane: u32,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> Option<Hit> {
        if self.tree.nodes.is_empty() {
            return None;
        }
        let line = Shear::new(from, direction, [self.gap / direction.length(), t_max]);
        let nearest = dispatch!(Level::new(), simd => {
            self.first_hit(simd, line, from, direction, ignore_plane, opaque)
        });
        nearest.map(|n| self.hit(&n, direction))
    }

    #[inline(always)]
    pub(super) fn first_hit<S: Simd>(
        &self,
        simd: S,
        mut line: Shear,
        from: Vec3,
        direction: Vec3,
        ignore_plane: u32,
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> Option<Nearest> {
        let slabs = Slabs::new(simd, from, direction);
        let mut best: Option<Nearest> = None;
        let mut stack = Stack::new((0.0f32, 0u32));
        while let Some((near, entry)) = stack.pop() {
            if near > line.range[1] {
                continue;
            }
            if entry & LEAF == 0 {
                push_by_distance(
                    &self.tree.nodes[entry as usize],
                    &slabs,
                    line.range[1],
                    &mut stack,
                );
                continue;
            }
            let number = (entry & !LEAF) as usize;
            let block = &self.tree.blocks[number];
            let e = line.block_edges(simd, block);
            let mut met = line.compare(&e);
            if met == 0 {
                continue;
            }
            let t = (e.height / e.det).to_array();
            let (u, v) = ((e.v / e.det).to_array(), (e.w / e.det).to_array());
            while met != 0 {
                let lane = met.trailing_zeros() as usize;
                met &= met - 1;
                let plane = block.planes[lane];
                if plane == ignore_plane && plane != NO_PLANE {
                    continue;
                }
                let found = Nearest {
                    t: t[lane],
                    block: number,
                    place: lane,
                    uv: [u[lane], v[lane]],
                };
                if self.is_nearer(&found, best.as_ref(), direction)
                    && (block.masked >> lane & 1 == 0 || opaque(block.ids[lane], u[lane], v[lane]))
                {
                    line.range[1] = line.range[1].min(found.end());
                    best = Some(found);
                }
            }
        }
        best
    }

    /// Does `found` come before the nearest hit so far? Equal distances go to the lower id, whatever the order of the
    /// tree; but a sheet made of two faces back to back is met at the one that faces the ray.
    #[inline(always)]
    pub(super) fn is_nearer(
        &self,
        found: &Nearest,
        best: Option<&Nearest>,
        direction: Vec3,
    ) -> bool {
        let Some(best) = best else { return true };
        let (one, other) = (
            &self.tree.blocks[found.block],
            &self.tree.blocks[best.block],
        );
        let plane = one.planes[found.place];
        let together = plane == other.planes[best.place]
            && plane != NO_PLANE
            && (found.t - best.t).abs() <= TOGETHER * best.t;
        if together {
            let turned = behind(one, found.place, direction);
            if turned != behind(other, best.place, direction) {
                return !turned;
            }
        }
        (found.t, one.ids[found.place]) < (best.t, other.ids[best.place])
    }

    /// What the caller is told of the nearest hit.
    pub(super) fn hit(&self, nearest: &Nearest, direction: Vec3) -> Hit {
        let block = &self.tree.blocks[nearest.block];
        Hit {
            t: nearest.t,
            triangle: block.ids[nearest.place],
            uv: nearest.uv,
            from_behind: behind(block, nearest.place, direction),
        }
    }
}

/// The nearest hit of a ray so far.
#[derive(Clone, Copy)]
pub(super) struct Nearest {
    pub(super) t: f32,
    pub(super) block: usize,
    pub(super) place: usize,
    pub(super) uv: [f32; 2],
}

impl Nearest {
    /// Hits up to here may still take its place.
    #[inline(always)]
    pub(super) fn end(&self) -> f32 {
        self.t * (1.0 + TOGETHER)
    }
}

/// Does a ray meet the back of a triangle of the block?
fn behind(block: &Block, lane: usize, direction: Vec3) -> bool {
    let [a, b, c] = block.corner_lane(lane).map(Vec3::from);
    (b - a).cross(c - a).dot(direction) > 0.0
}

/// Does a triangle of the block hide the segment?
#[inline(always)]
fn block_occludes<S: Simd>(
    simd: S,
    block: &Block,
    line: &Shear,
    planes: [u32; 2],
    opaque: &impl Fn(u32, f32, f32) -> bool,
) -> bool {
    let e = line.block_edges(simd, block);
    let mut met = line.compare(&e);
    while met != 0 {
        let lane = met.trailing_zeros() as usize;
        met &= met - 1;
        let plane = block.planes[lane];
        if planes.contains(&plane) && plane != NO_PLANE {
            continue;
        }
        if block.masked >> lane & 1 == 0 {
            return true;
        }
        let (det, v, w) = (e.det[lane], e.v[lane], e.w[lane]);
        if opaque(block.ids[lane], v / det, w / det) {
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests;
