//! Up to sixteen rays through the tree at once: what does each meet first?
//!
//! The walk of `packet`, nearest boxes first; every ray ends at the nearest hit so far, and a box that starts behind the
//! farthest of these ends is passed by. Rays that leave a point in a narrow beam share most of their way; others go one by one.

use super::bvh::{BvhNode, LEAF, WIDTH};
use super::index::{Hit, Nearest, RayIndex};
use super::packet::Packet;
use super::segment::{NO_PLANE, Segment};
use super::triangle::PACKET;
use super::walk::Stack;
use fearless_simd::{Level, dispatch, prelude::*};
use glam::Vec3;

/// Rays whose directions have a mean shorter than this have little of their way in common, and go one by one. Leaves that cast 16 rays over the
/// hemisphere (mean .67) gain: CPU seconds of solves with 0, .7, .8, .9, .95 and .98 are 5.3, 4.9, 4.8, 5.0, 4.7 and 5.0 in a garage, with 0 and .9
/// 63.8 and 60.9 in a canteen, 37.4 and 35.0 in a restaurant, 7.6 and 7.1 in a living room.
const NARROW: f32 = 0.9;

impl RayIndex {
    /// What rays hit first: as [`RayIndex::closest`] with no limit for each of up to sixteen starts and unit `directions`.
    /// Fast where starts and directions lie close together.
    ///
    /// # Panics
    /// When the slices differ in length or hold more than sixteen.
    pub fn closest_many_with(
        &self,
        from: &[Vec3],
        directions: &[Vec3],
        ignore_plane: u32,
        out: &mut [Option<Hit>],
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) {
        assert!(
            directions.len() == out.len() && from.len() == out.len() && out.len() <= PACKET,
            "a start, a direction and an answer for each of up to sixteen rays"
        );
        out.fill(None);
        if self.tree.nodes.is_empty() || directions.is_empty() {
            return;
        }
        let (segments, far) = self.whole_way(from, directions, ignore_plane);
        let sum: Vec3 = directions.iter().sum();
        if sum.length() < NARROW * directions.len() as f32 {
            for (k, out) in out.iter_mut().enumerate() {
                let way = segments[k].to - segments[k].from;
                let hit = self.closest_with(from[k], way, 1.0, ignore_plane, opaque);
                *out = hit.map(|hit| at_distance(hit, far[k]));
            }
            return;
        }
        let nearest = dispatch!(Level::new(), simd => {
            self.beam(simd, &segments[..directions.len()], directions, opaque)
        });
        for (k, out) in out.iter_mut().enumerate() {
            *out = nearest[k].map(|n| at_distance(self.hit(&n, directions[k]), far[k]));
        }
    }

    #[inline(always)]
    fn beam<S: Simd>(
        &self,
        simd: S,
        segments: &[Segment],
        directions: &[Vec3],
        opaque: &impl Fn(u32, f32, f32) -> bool,
    ) -> [Option<Nearest>; PACKET] {
        let Some(packet) = Packet::new(simd, self, segments) else {
            return [None; PACKET];
        };
        let mut beam = Beam {
            index: self,
            directions,
            packet,
            nearest: [None; PACKET],
            farthest: 1.0,
        };
        let mut stack = Stack::new((0.0_f32, 0_u32, beam.packet.open()));
        while let Some((near, entry, lanes)) = stack.pop() {
            if near > beam.farthest {
                continue;
            }
            if entry & LEAF != 0 {
                beam.meet((entry & !LEAF) as usize, lanes, opaque);
            } else {
                beam.enter(&self.tree.nodes[entry as usize], lanes, &mut stack);
            }
        }
        beam.nearest
    }

    /// Segments that end beyond everything, wherever the rays start, and their lengths.
    #[inline]
    fn whole_way(
        &self,
        from: &[Vec3],
        directions: &[Vec3],
        ignore_plane: u32,
    ) -> ([Segment; PACKET], [f32; PACKET]) {
        let [low, high] = self.tree.bounds;
        let mut far = [0.0_f32; PACKET];
        let mut segments = [Segment {
            from: from[0],
            to: from[0],
            planes: [ignore_plane, NO_PLANE],
        }; PACKET];
        for (k, (&from, &direction)) in from.iter().zip(directions).enumerate() {
            far[k] = 1.01 * (from - low).abs().max((from - high).abs()).length() + self.gap;
            segments[k].from = from;
            segments[k].to = from + far[k] * direction;
        }
        (segments, far)
    }
}

/// A hit of a segment of length `far`, as one of a ray of unit direction.
fn at_distance(hit: Hit, far: f32) -> Hit {
    Hit {
        t: hit.t * far,
        ..hit
    }
}

/// Rays on their way, each with what it met first so far.
struct Beam<'a, S: Simd> {
    index: &'a RayIndex,
    directions: &'a [Vec3],
    packet: Packet<S>,
    nearest: [Option<Nearest>; PACKET],
    /// Where the longest ray ends now.
    farthest: f32,
}

impl<S: Simd> Beam<'_, S> {
    /// Ends the rays of `lanes` at the triangles of a block.
    #[inline(always)]
    fn meet(&mut self, number: usize, lanes: u32, opaque: &impl Fn(u32, f32, f32) -> bool) {
        let block = &self.index.tree.blocks[number];
        let mut places = self.packet.straddled(block);
        let mut shortened = false;
        while places != 0 {
            let place = places.trailing_zeros() as usize;
            places &= places - 1;
            let (mut met, e) = self.packet.meet(block, place, lanes);
            while met != 0 {
                let lane = met.trailing_zeros() as usize;
                met &= met - 1;
                let det = e.det[lane];
                let found = Nearest {
                    t: e.height[lane] / det,
                    block: number,
                    place,
                    uv: [e.v[lane] / det, e.w[lane] / det],
                };
                let known = self.nearest[lane].as_ref();
                if (self.index).is_nearer(&found, known, self.directions[lane])
                    && (block.masked >> place & 1 == 0
                        || opaque(block.ids[place], found.uv[0], found.uv[1]))
                {
                    self.packet.shorten(lane, found.end());
                    self.nearest[lane] = Some(found);
                    shortened = true;
                }
            }
        }
        if shortened {
            self.farthest = self.packet.farthest();
        }
    }

    /// Puts the children that rays of `lanes` meet on the stack, the nearest last.
    #[inline(always)]
    fn enter(&self, node: &BvhNode, lanes: u32, stack: &mut Stack<(f32, u32, u32)>) {
        let mut sorted = [(0.0_f32, 0_u32, 0_u32); WIDTH];
        let mut count = 0;
        let mut boxes = self.packet.boxes(node);
        while boxes != 0 {
            let child = boxes.trailing_zeros() as usize;
            boxes &= boxes - 1;
            let (near, through) = self.packet.enter_near(node, child);
            let through = through & lanes;
            if through == 0 {
                continue;
            }
            let mut place = count;
            while place > 0 && sorted[place - 1].0 < near {
                sorted[place] = sorted[place - 1];
                place -= 1;
            }
            sorted[place] = (near, node.children[child], through);
            count += 1;
        }
        for &entry in &sorted[..count] {
            stack.push(entry);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;
    use crate::geometry::vectors::levels;

    /// All that the index says of some segments, one by one, sixteen at a time and by a list.
    #[inline(always)]
    fn answers<S: Simd>(
        simd: S,
        index: &RayIndex,
        segments: &[Segment],
        list: &[u32],
    ) -> (Vec<u32>, Vec<Option<Hit>>) {
        let opaque = |id: u32, u: f32, _: f32| u > 0.3 || id.is_multiple_of(3);
        let (mut hidden, mut hits) = (Vec::new(), Vec::new());
        for group in segments.chunks(PACKET) {
            hidden.push(Packet::occluded(simd, index, group, &opaque));
            hidden.push(Packet::occluded_by(simd, index, list, group, &opaque));
            let ways: Vec<Vec3> = group.iter().map(|s| s.to - s.from).collect();
            let beam = index.beam(simd, group, &ways, &opaque);
            hits.extend(
                ways.iter()
                    .zip(beam)
                    .map(|(&way, n)| Some(index.hit(&n?, way))),
            );
            for (s, &way) in group.iter().zip(&ways) {
                hidden.push(u32::from(index.is_hit(simd, s, &opaque)));
                let (_, line) = index.line(s);
                let first = index.first_hit(simd, line, s.from, way, NO_PLANE, &opaque);
                hits.push(first.map(|n| index.hit(&n, way)));
            }
        }
        (hidden, hits)
    }

    #[test]
    fn all_processors_give_the_same_answers() {
        let mut random = Pcg::new(29);
        let mut point =
            |size: f32| (Vec3::new(random.f32(), random.f32(), random.f32()) - 0.5) * size;
        for round in 0..60 {
            let middle: Vec<Vec3> = (0..40).map(|_| point(2.0)).collect();
            let positions: Vec<Vec3> = (0..120).map(|k| middle[k / 3] + point(0.5)).collect();
            let triangles: Vec<[u32; 3]> = (0..40).map(|k| [0, 1, 2].map(|c| 3 * k + c)).collect();
            let masked: Vec<bool> = (0..40).map(|k| k % 4 == round % 4).collect();
            let index = RayIndex::build(&positions, &triangles, &[], &masked);
            let list: Vec<u32> = (0..40).filter(|k| k % 2 == 0).collect();
            // Together, in one direction, and anywhere.
            let (from, to) = (point(4.0), point(4.0));
            let segments: Vec<Segment> = (0..150)
                .map(|k| Segment {
                    from: from + point([0.1, 0.5, 4.0][k / 50]),
                    to: to + point([0.1, 0.5, 4.0][k / 50]),
                    planes: [NO_PLANE; 2],
                })
                .collect();
            let mut all = levels()
                .into_iter()
                .map(|level| dispatch!(level, simd => answers(simd, &index, &segments, &list)));
            let first = all.next().unwrap();
            assert!(all.all(|other| other == first));
        }
    }
}
