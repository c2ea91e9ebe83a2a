//! The ray index: is anything between two points, and what does a ray hit first?
//!
//! All queries are exact up to f32: the triangle test is watertight (see `triangle`), and the tree only leaves out what cannot
//! be met. A hit counts when it is farther than [`END_GAP`] of the scene's half size from both ends and does not lie in a plane
//! that the query names. Positions are in the caller's space, recentred on the scene so that f32 is fine enough.
//! Triangles block from both sides. Those with an alpha mask ask the caller, in the `_with` variants, whether the point is
//! opaque; the others never do.

use super::packet::Packet;
use super::segment::{NO_PLANE, Segment};
use super::tree::{Input, LEAF, Tree};
use super::triangle::{BLOCK, Block, PACKET, Shear};
use super::walk::{Slabs, Stack, push_by_distance};
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
    pub(crate) tree: Tree,
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
        let tree = Tree::build(Input {
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

    /// The plane of a triangle.
    pub(crate) fn plane_of(&self, id: u32) -> u32 {
        self.place(id).map_or(NO_PLANE, |(block, lane)| {
            self.tree.blocks[block].planes[lane]
        })
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
        if self.tree.nodes.is_empty() {
            return false;
        }
        let (direction, line) = self.line(segment);
        let slabs = Slabs::new(segment.from, direction);
        let mut stack = Stack::new(0u32);
        while let Some(entry) = stack.pop() {
            if entry & LEAF != 0 {
                let block = &self.tree.blocks[(entry & !LEAF) as usize];
                if block_occludes(block, &line, segment.planes, opaque) {
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
            let hidden = Packet::occluded(self, group, opaque);
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
            let hidden = Packet::occluded_by(self, list, group, opaque);
            for (k, answer) in answers.iter_mut().enumerate() {
                *answer = hidden >> k & 1 == 1;
            }
        }
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
        let mut line = Shear::new(from, direction, [self.gap / direction.length(), t_max]);
        let slabs = Slabs::new(from, direction);
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
            let e = line.block_edges(block);
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
        best.map(|n| self.hit(&n, direction))
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
pub(crate) fn block_occludes(
    block: &Block,
    line: &Shear,
    planes: [u32; 2],
    opaque: &impl Fn(u32, f32, f32) -> bool,
) -> bool {
    let e = line.block_edges(block);
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
        let det = e.det.as_array()[lane];
        let (v, w) = (e.v.as_array()[lane], e.w.as_array()[lane]);
        if opaque(block.ids[lane], v / det, w / det) {
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::{Pcg, cosine_direction, sequence02, sphere_direction};
    use glam::DVec3;

    /// Two squares in one place that look opposite ways, cut along different diagonals: each ray meets a front.
    #[test]
    fn sheets_of_two_faces_show_a_front_to_both_sides() {
        let corners = [
            Vec3::new(0.1, 0.3, 0.0),
            Vec3::new(1.2, 0.3, 0.0),
            Vec3::new(1.2, 1.1, 0.0),
            Vec3::new(0.1, 1.1, 0.0),
        ];
        let positions: Vec<Vec3> = corners
            .iter()
            .map(|c| Vec3::new(c.x, c.y, 0.3 * c.x + 0.7 * c.y))
            .collect();
        for triangles in [
            vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
            vec![[0, 3, 1], [1, 3, 2], [0, 1, 2], [0, 2, 3]],
        ] {
            let index = RayIndex::build(&positions, &triangles, &[0; 4], &[false; 4]);
            let mut random = Pcg::new(3);
            for k in 0..1000 {
                let from =
                    point(&mut random) + Vec3::new(0.6, 0.7, if k % 2 == 0 { 3.0 } else { -3.0 });
                let to = Vec3::new(0.2 + 0.9 * random.f32(), 0.4 + 0.6 * random.f32(), 0.0);
                let to = Vec3::new(to.x, to.y, 0.3 * to.x + 0.7 * to.y);
                let hit = index.closest(from, to - from, 2.0, NO_PLANE).unwrap();
                assert!(!hit.from_behind, "{from} {to}: {hit:?}");
            }
        }
    }

    fn point(random: &mut Pcg) -> Vec3 {
        Vec3::new(random.f32(), random.f32(), random.f32()) * 2.0 - 1.0
    }

    /// Triangles of some size strewn about.
    fn clutter(count: u32, size: f32, random: &mut Pcg) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let mut positions = Vec::new();
        for _ in 0..count {
            let at = point(random);
            positions.extend([0; 3].map(|_| at + point(random) * size));
        }
        let triangles = (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        (positions, triangles)
    }

    /// A box of `n` by `n` squares a side, closed.
    fn closed_box(n: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for axis in 0..3 {
            for side in [-1.0f32, 1.0] {
                let base = positions.len() as u32;
                for i in 0..=n {
                    for j in 0..=n {
                        let mut p = Vec3::ZERO;
                        p[axis] = side;
                        p[(axis + 1) % 3] = 2.0 * i as f32 / n as f32 - 1.0;
                        p[(axis + 2) % 3] = 2.0 * j as f32 / n as f32 - 1.0;
                        positions.push(p * Vec3::new(3.1, 2.3, 1.7) + Vec3::new(0.3, -0.2, 0.1));
                    }
                }
                for i in 0..n {
                    for j in 0..n {
                        let a = base + i * (n + 1) + j;
                        let (b, c, d) = (a + n + 1, a + n + 2, a + 1);
                        triangles.extend([[a, b, c], [a, c, d]]);
                    }
                }
            }
        }
        (positions, triangles)
    }

    #[test]
    fn tree_packets_and_plain_loop_agree() {
        let mut random = Pcg::new(1);
        for (count, size) in [(1, 0.5), (7, 0.5), (40, 0.5), (300, 0.2), (3_000, 0.05)] {
            let (positions, triangles) = clutter(count, size, &mut random);
            // The first two have no plane, and must block even a segment without.
            let planes: Vec<u32> = (0..count)
                .map(|k| if k < 2 { NO_PLANE } else { k })
                .collect();
            let masked: Vec<bool> = (0..count).map(|k| k % 3 == 0).collect();
            let index = RayIndex::build(&positions, &triangles, &planes, &masked);
            let opaque = |triangle: u32, u: f32, v: f32| {
                (triangle + (u * 8.0) as u32 + (v * 8.0) as u32).is_multiple_of(2)
            };
            let mut segments = Vec::new();
            for _ in 0..120 {
                // Coherent sixteens, wild sixteens, and some from one point.
                let (a, b) = (point(&mut random), point(&mut random));
                for k in 0..16 {
                    let spread = [0.0, 0.05, 1.0][k % 3];
                    let from = a + point(&mut random) * spread;
                    let to = if k % 5 == 0 {
                        a
                    } else {
                        b + point(&mut random) * spread
                    };
                    let planes = [
                        random.below(count),
                        if k % 2 == 0 {
                            NO_PLANE
                        } else {
                            random.below(count)
                        },
                    ];
                    segments.push(Segment { from, to, planes });
                }
            }
            segments.truncate(segments.len() - 5);
            let mut many = vec![false; segments.len()];
            index.occluded_many_with(&segments, &mut many, &opaque);
            let mut blocked = 0;
            let all: Vec<u32> = (0..count).collect();
            let mut listed = vec![false; segments.len()];
            index.occluded_by(&all, &segments, &mut listed, &opaque);
            for (k, segment) in segments.iter().enumerate() {
                let plain = index.occluded_plain(segment, &opaque);
                assert_eq!(index.occluded_with(segment, &opaque), plain, "{segment:?}");
                assert_eq!(many[k], plain, "{segment:?}");
                assert_eq!(listed[k], plain, "{segment:?}");
                assert!(!plain || index.occluded(segment), "masks only open");
                blocked += usize::from(plain);
            }
            assert!(blocked > 10, "{blocked} of {count}");
        }
    }

    #[test]
    fn closest_agrees_with_the_plain_loop() {
        let mut random = Pcg::new(2);
        let (positions, triangles) = clutter(500, 0.2, &mut random);
        let index = RayIndex::build(&positions, &triangles, &[], &[]);
        for _ in 0..2_000 {
            let (from, direction) = (point(&mut random), point(&mut random));
            let line = Shear::new(from, direction, [index.gap / direction.length(), 2.0]);
            let plain = (0u32..)
                .zip(&triangles)
                .filter_map(|(id, t)| line.meet(t.map(|k| positions[k as usize])).map(|m| (m, id)))
                .min_by(|a, b| a.0.t.total_cmp(&b.0.t).then(a.1.cmp(&b.1)));
            let hit = index.closest(from, direction, 2.0, NO_PLANE);
            assert_eq!(
                hit.map(|h| (h.t, h.uv, h.triangle)),
                plain.map(|(m, id)| (m.t, m.uv, id))
            );
            if let Some(hit) = hit {
                let [a, b, c] = triangles[hit.triangle as usize].map(|k| positions[k as usize]);
                let at = a + (b - a) * hit.uv[0] + (c - a) * hit.uv[1];
                assert!(at.distance(from + direction * hit.t) < 1e-5);
                assert_eq!(hit.from_behind, (b - a).cross(c - a).dot(direction) > 0.0);
            }
        }
    }

    #[test]
    fn beams_hit_what_single_rays_hit() {
        let mut random = Pcg::new(5);
        for count in [5, 30, 2_000] {
            let (positions, triangles) = clutter(count, 0.3, &mut random);
            let planes: Vec<u32> = (0..count).collect();
            let masked: Vec<bool> = (0..count).map(|k| k % 3 == 0).collect();
            let opaque = |triangle: u32, u: f32, v: f32| {
                (triangle + (u * 8.0) as u32 + (v * 8.0) as u32).is_multiple_of(2)
            };
            let index = RayIndex::build(&positions, &triangles, &planes, &masked);
            let mut hits = 0;
            for k in 0..600 {
                let around = point(&mut random) * 1.5;
                let axis = point(&mut random);
                let spread = [0.1, 0.5, 3.0][k % 3];
                let directions: Vec<Vec3> = (0..1 + k % 16)
                    .map(|_| (axis + spread * point(&mut random)).normalize())
                    .collect();
                let from: Vec<Vec3> = directions
                    .iter()
                    .map(|_| around + [0.0, 0.01][k % 2] * point(&mut random))
                    .collect();
                let ignored = random.below(count);
                let mut out = vec![None; directions.len()];
                index.closest_many_with(&from, &directions, ignored, &mut out, &opaque);
                for ((hit, &d), &from) in out.iter().zip(&directions).zip(&from) {
                    let single = index.closest_with(from, d, f32::INFINITY, ignored, &opaque);
                    assert_eq!(hit.map(|h| h.triangle), single.map(|h| h.triangle));
                    if let (Some(a), Some(b)) = (hit, single) {
                        assert!((a.t - b.t).abs() < 1e-4 * (1.0 + b.t), "{a:?} {b:?}");
                        assert_eq!(a.from_behind, b.from_behind);
                        hits += 1;
                    }
                }
            }
            assert!(hits > 10, "{hits} of {count}");
        }
    }

    #[test]
    fn no_ray_leaves_a_closed_box() {
        let (positions, triangles) = closed_box(7);
        let index = RayIndex::build(&positions, &triangles, &[], &[]);
        let mut random = Pcg::new(3);
        let mut segments = Vec::new();
        let inside =
            |random: &mut Pcg| point(random) * Vec3::new(3.0, 2.2, 1.6) + Vec3::new(0.3, -0.2, 0.1);
        for round in 0..200_000 {
            let from = inside(&mut random);
            let t = triangles[random.below(triangles.len() as u32) as usize]
                .map(|k| positions[k as usize]);
            let at = match round % 3 {
                0 => t[0],
                1 => t[0].lerp(t[1], random.f32()),
                _ => t[0].midpoint(t[2]),
            };
            segments.push(Segment {
                from,
                to: from + (at - from) * 1.5,
                planes: [NO_PLANE; 2],
            });
        }
        let mut hidden = vec![false; segments.len()];
        index.occluded_many(&segments, &mut hidden);
        assert_eq!(
            hidden.iter().filter(|&&h| !h).count(),
            0,
            "leaks in packets"
        );
        let leaks = segments.iter().filter(|s| !index.occluded(s)).count();
        assert_eq!(leaks, 0, "leaks one by one");
        let leaks = segments
            .iter()
            .filter(|s| {
                index
                    .closest(s.from, s.to - s.from, f32::INFINITY, NO_PLANE)
                    .is_none()
            })
            .count();
        assert_eq!(leaks, 0, "leaks of nearest hits");
    }

    #[test]
    fn ends_on_surfaces_are_not_hidden_by_them() {
        // Between points of two walls of an empty convex room, corners and edges included.
        let (positions, triangles) = closed_box(4);
        let wall = |k: usize| (k / 32) as u32;
        let planes: Vec<u32> = (0..triangles.len()).map(wall).collect();
        let index = RayIndex::build(&positions, &triangles, &planes, &[]);
        let mut segments = Vec::new();
        for (k, a) in triangles.iter().enumerate() {
            for (l, b) in triangles.iter().enumerate() {
                if wall(k) != wall(l) {
                    let on = |t: &[u32; 3], which: usize| {
                        let [a, b, c] = t.map(|k| positions[k as usize]);
                        [a, b, a.midpoint(b), (a + b + c) / 3.0][which % 4]
                    };
                    segments.push(Segment {
                        from: on(a, k + l),
                        to: on(b, l / 3),
                        planes: [wall(k), wall(l)],
                    });
                }
            }
        }
        let mut hidden = vec![false; segments.len()];
        index.occluded_many(&segments, &mut hidden);
        assert_eq!(hidden.iter().filter(|&&h| h).count(), 0);
    }

    #[test]
    fn directions_over_a_floor_see_the_share_of_a_screen() {
        // Rays leave the centre of a square's shadow: the blocked share is the form factor, 0.239456 for a unit square at height 1.
        let square =
            [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]| Vec3::new(x, y, 1.0));
        let index = RayIndex::build(&square, &[[0, 1, 2], [0, 2, 3]], &[0, 0], &[]);
        let n = 1 << 14;
        let segments: Vec<_> = (0..n)
            .map(|k| Segment {
                from: Vec3::ZERO,
                to: cosine_direction(DVec3::Z, sequence02(k, 1)).as_vec3() * 10.0,
                planes: [NO_PLANE; 2],
            })
            .collect();
        let mut hidden = vec![false; segments.len()];
        index.occluded_many(&segments, &mut hidden);
        let share = hidden.iter().filter(|&&h| h).count() as f64 / f64::from(n);
        assert!((share - 0.239_456_470_460_774).abs() < 2e-3, "{share}");
    }

    #[test]
    fn nothing_to_index_blocks_nothing() {
        let bad = RayIndex::build(
            &[Vec3::ZERO, Vec3::X, Vec3::NAN],
            &[[0, 1, 2], [0, 1, 9]],
            &[],
            &[],
        );
        let sliver = RayIndex::build(
            &[Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
            &[[0, 1, 2], [0, 0, 0]],
            &[],
            &[],
        );
        for index in [RayIndex::build(&[], &[], &[], &[]), bad, sliver] {
            let mut random = Pcg::new(9);
            for _ in 0..64 {
                let to = sphere_direction([random.f64(), random.f64()]).as_vec3();
                let segment = Segment {
                    from: Vec3::X * 0.5,
                    to,
                    planes: [NO_PLANE; 2],
                };
                let mut out = [true];
                index.occluded_many(&[segment], &mut out);
                assert_eq!((index.occluded(&segment), out[0]), (false, false));
                assert_eq!(index.closest(segment.from, to, 9.0, NO_PLANE), None);
            }
        }
    }
}
