//! The triangles of an index that may block between two patches.
//!
//! The tree's boxes are tested eight at a time against the sides of the [`Shaft`] in f32, the triangles of a leaf in f64; that decides most of
//! them. What crosses sides without a corner in the shaft is clipped.
//!
//! Safe side: a pair reported as clear has no blocker, but for what reaches less than the index's gap into the shaft (1e-6 of the scene's
//! half size; neighbours touch it everywhere).

use super::bvh::{BvhNode, LEAF};
use super::index::RayIndex;
use super::segment::NO_PLANE;
use super::shaft::{SIDES, Shaft, dot};
use super::triangle::{BLOCK, Block};
use super::vectors::{Octet, splat};
use super::walk::Stack;
use fearless_simd::{Level, dispatch, f32x8, f64x8, prelude::*};
use glam::{DVec3, Vec3};

/// Triangles between two patches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShaftContents {
    /// Nothing blocks anywhere between the patches.
    Clear,
    /// Only these triangles may block, in ascending order.
    Few(Vec<u32>),
    /// More than were asked for.
    Many,
}

/// The sides in f32, for eight boxes at a time.
struct Sides8 {
    normal: [[f32; 3]; SIDES],
    offset: [f32; SIDES],
    count: usize,
    low: [f32; 3],
    high: [f32; 3],
}

impl Sides8 {
    fn new(shaft: &Shaft) -> Self {
        let mut sides = Self {
            normal: [[0.0; 3]; SIDES],
            offset: [0.0; SIDES],
            count: shaft.sides().len(),
            low: shaft.low.as_vec3().to_array(),
            high: shaft.high.as_vec3().to_array(),
        };
        for (k, side) in shaft.sides().iter().enumerate() {
            sides.normal[k] = side.normal.as_vec3().to_array();
            sides.offset[k] = side.offset as f32;
        }
        sides
    }

    /// A bit for each child whose box may reach into the shaft. The boxes are padded by ten gaps, which covers the roundings.
    #[inline(always)]
    fn boxes<S: Simd>(&self, simd: S, node: &BvhNode) -> u32 {
        let side = |k: usize, axis: usize| node.bounds[k][axis].load(simd);
        let mut out = side(0, 0).simd_gt(self.high[0]) | side(1, 0).simd_lt(self.low[0]);
        for axis in 1..3 {
            out |= side(0, axis).simd_gt(self.high[axis]) | side(1, axis).simd_lt(self.low[axis]);
        }
        for k in 0..self.count {
            // The corner of the box that is deepest inside.
            let mut depth = f32x8::splat(simd, 0.0);
            for (axis, &x) in self.normal[k].iter().enumerate() {
                depth += side(usize::from(x < 0.0), axis) * x;
            }
            out |= depth.simd_gt(self.offset[k]);
        }
        !(out.to_bitmask() as u32) & ((1 << node.count) - 1)
    }
}

/// A bit for each triangle of a block that may block, and for each of these that surely does because one of its corners is in the shaft: the
/// tests of [`Shaft::holds`] before clipping, in f64.
#[inline(always)]
fn triangles<S: Simd>(simd: S, shaft: &Shaft, block: &Block, gap: f64) -> (u32, u32) {
    let all = (1 << block.count) - 1;
    let [a, b, c] = [
        widen(simd, &block.corners[0]),
        widen(simd, &block.corners[1]),
        widen(simd, &block.corners[2]),
    ];
    let u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    let normal = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let slack = dot(normal, normal).sqrt() * gap;
    let at = dot(normal, a);
    let mut least = f64x8::splat(simd, f64::INFINITY);
    let mut most = f64x8::splat(simd, f64::NEG_INFINITY);
    for &corner in shaft.corners() {
        let d = dot(normal, splat(simd, corner));
        least = least.min(d);
        most = most.max(d);
    }
    let mut out = (least - at).simd_ge(-slack) | (most - at).simd_le(slack);
    for axis in 0..3 {
        let least = a[axis].min(b[axis]).min(c[axis]);
        let most = a[axis].max(b[axis]).max(c[axis]);
        out |= least.simd_gt(shaft.high[axis]) | most.simd_lt(shaft.low[axis]);
    }
    if out.to_bitmask() as u32 & all == all {
        return (0, 0);
    }
    // The corners that some side leaves out.
    let mut outside = [slack.simd_lt(slack); 3];
    for side in shaft.sides() {
        let n = splat(simd, side.normal);
        let offset = side.offset - gap;
        let [a, b, c] = [
            dot(a, n).simd_ge(offset),
            dot(b, n).simd_ge(offset),
            dot(c, n).simd_ge(offset),
        ];
        out |= a & b & c;
        outside[0] |= a;
        outside[1] |= b;
        outside[2] |= c;
    }
    let may = !(out.to_bitmask() as u32) & all;
    let outside = outside[0] & outside[1] & outside[2];
    (may, !(outside.to_bitmask() as u32) & may)
}

#[inline(always)]
fn widen<S: Simd>(simd: S, point: &[Octet; 3]) -> [f64x8<S>; 3] {
    let wide = |x: &Octet| f64x8::from_fn(simd, |k| f64::from(x.0[k]));
    [wide(&point[0]), wide(&point[1]), wide(&point[2])]
}

/// The list as it grows.
struct BlockerList {
    ids: Vec<u32>,
    cap: usize,
}

impl BlockerList {
    /// False when this is one too many.
    fn push(&mut self, id: u32) -> bool {
        if self.ids.len() == self.cap {
            return false;
        }
        if self.ids.capacity() == 0 {
            self.ids.reserve(self.cap.min(16));
        }
        self.ids.push(id);
        true
    }
}

impl RayIndex {
    /// The triangles that may block in a shaft, if at most `cap`. `candidates`: the only triangles to look at, as found for a
    /// shaft that encloses this one (that of the link that was refined); None: all.
    pub fn blockers(&self, shaft: &Shaft, candidates: Option<&[u32]>, cap: usize) -> ShaftContents {
        let mut found = BlockerList {
            ids: Vec::new(),
            cap,
        };
        let fits = dispatch!(Level::new(), simd => match candidates {
            Some(list) => self.sift_all(simd, shaft, list, &mut found),
            None => self.search(simd, shaft, &mut found),
        });
        if !fits {
            ShaftContents::Many
        } else if found.ids.is_empty() {
            ShaftContents::Clear
        } else {
            found.ids.sort_unstable();
            ShaftContents::Few(found.ids)
        }
    }

    /// False when there are too many.
    #[inline(always)]
    fn sift_all<S: Simd>(
        &self,
        simd: S,
        shaft: &Shaft,
        list: &[u32],
        found: &mut BlockerList,
    ) -> bool {
        for ids in list.chunks(BLOCK) {
            if !self.sift(simd, shaft, &self.gather(ids), found) {
                return false;
            }
        }
        true
    }

    /// False when there are too many.
    #[inline(always)]
    fn search<S: Simd>(&self, simd: S, shaft: &Shaft, found: &mut BlockerList) -> bool {
        if self.tree.nodes.is_empty() {
            return true;
        }
        let sides = Sides8::new(shaft);
        let mut stack = Stack::new(0u32);
        while let Some(entry) = stack.pop() {
            if entry & LEAF == 0 {
                let node = &self.tree.nodes[entry as usize];
                let mut open = sides.boxes(simd, node);
                while open != 0 {
                    stack.push(node.children[open.trailing_zeros() as usize]);
                    open &= open - 1;
                }
                continue;
            }
            let block = &self.tree.blocks[(entry & !LEAF) as usize];
            if !self.sift(simd, shaft, block, found) {
                return false;
            }
        }
        true
    }

    /// Adds the triangles of a block that may block; false when there are too many.
    #[inline(always)]
    fn sift<S: Simd>(
        &self,
        simd: S,
        shaft: &Shaft,
        block: &Block,
        found: &mut BlockerList,
    ) -> bool {
        let gap = f64::from(self.gap);
        let (mut open, sure) = triangles(simd, shaft, block, gap);
        while open != 0 {
            let lane = open.trailing_zeros() as usize;
            open &= open - 1;
            let blocks = !own_plane(shaft, block, lane)
                && (sure >> lane & 1 == 1 || {
                    let [a, b, c] = block.corner_lane(lane);
                    let corner = |p: [f32; 3]| DVec3::new(p[0].into(), p[1].into(), p[2].into());
                    shaft.clipped_holds(simd, &[corner(a), corner(b), corner(c)], gap)
                });
            if blocks && !found.push(block.ids[lane]) {
                return false;
            }
        }
        true
    }

    /// A block of triangles from anywhere.
    fn gather(&self, ids: &[u32]) -> Block {
        Block::new(ids.iter().filter_map(|&id| {
            let (block, lane) = self.place(id)?;
            let block = &self.tree.blocks[block];
            let corners = block.corner_lane(lane).map(Vec3::from);
            Some((
                id,
                corners,
                block.planes[lane],
                block.masked >> lane & 1 == 1,
            ))
        }))
    }
}

/// Does the triangle lie in the plane of a patch?
fn own_plane(shaft: &Shaft, block: &Block, lane: usize) -> bool {
    let plane = block.planes[lane];
    plane != NO_PLANE && shaft.planes.contains(&plane)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ShaftEnd;
    use crate::geometry::sampling::{Pcg, on_triangle};
    use crate::geometry::vectors::levels;
    use glam::Vec3;

    fn index_of(triangles: &[[DVec3; 3]]) -> RayIndex {
        let positions: Vec<Vec3> = triangles.iter().flatten().map(|p| p.as_vec3()).collect();
        let n = triangles.len() as u32;
        let ids: Vec<_> = (0..n).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        RayIndex::build(&positions, &ids, &(0..n).collect::<Vec<_>>(), &[])
    }

    /// Crosses with some room to spare, in f64.
    fn crosses([a, b, c]: &[DVec3; 3], p: DVec3, q: DVec3) -> bool {
        let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
        let s = [
            volume(p, q, *a, *b),
            volume(p, q, *b, *c),
            volume(p, q, *c, *a),
        ];
        let least = 1e-5 * s.iter().map(|s| s.abs()).sum::<f64>();
        let ends = [volume(*a, *b, *c, p), volume(*a, *b, *c, q)];
        ends[0] * ends[1] < 0.0
            && ends.iter().all(|e| e.abs() > 1e-5)
            && (s.iter().all(|&s| s > least) || s.iter().all(|&s| s < -least))
    }

    fn front(t: &[DVec3; 3], x: DVec3) -> bool {
        (t[1] - t[0]).cross(t[2] - t[0]).dot(x - t[0]) > 0.0
    }

    #[test]
    fn never_clear_when_a_segment_is_blocked_and_seldom_full_when_none_is() {
        let mut random = Pcg::new(17);
        let (mut clear, mut hidden, mut loose) = (0, 0, 0);
        for round in 0..3_000 {
            let mut point = |s: f64| DVec3::new(random.f64(), random.f64(), random.f64()) * s;
            let size = [0.1, 0.3, 1.0][round % 3];
            let scene: Vec<[DVec3; 3]> = (0..24)
                .map(|_| {
                    let at = point(1.0);
                    [0; 3].map(|_| at + point(size))
                })
                .collect();
            let index = index_of(&scene);
            let (ta, tb) = (scene[0], scene[1]);
            let shaft = Shaft::between(
                &ShaftEnd::Triangle {
                    corners: ta,
                    plane: 0,
                },
                &ShaftEnd::Triangle {
                    corners: tb,
                    plane: 1,
                },
            );
            let contents = index.blockers(&shaft, None, 100);
            let list = match &contents {
                ShaftContents::Clear => &[][..],
                ShaftContents::Few(list) => list,
                ShaftContents::Many => panic!("there are fewer than 100"),
            };
            let plain: Vec<u32> = (2..24)
                .filter(|&k| {
                    shaft.holds(
                        &scene[k as usize].map(|p| p.as_vec3().as_dvec3()),
                        index.gap.into(),
                    )
                })
                .collect();
            assert_eq!(list, plain);
            let all: Vec<u32> = (0..24).collect();
            assert_eq!(index.blockers(&shaft, Some(&all), 100), contents);
            for level in levels() {
                let (ids, cap) = (Vec::new(), 100);
                let mut found = BlockerList { ids, cap };
                dispatch!(level, simd => index.search(simd, &shaft, &mut found));
                found.ids.sort_unstable();
                assert_eq!(found.ids, plain);
            }
            if !list.is_empty() {
                assert_eq!(
                    index.blockers(&shaft, None, list.len() - 1),
                    ShaftContents::Many
                );
            }
            let mut seen = vec![false; scene.len()];
            let mut sample = |count: u32, seen: &mut [bool]| {
                for _ in 0..count {
                    let p = on_triangle(&ta, [random.f64(), random.f64()]);
                    let q = on_triangle(&tb, [random.f64(), random.f64()]);
                    if front(&ta, q) && front(&tb, p) {
                        for (k, t) in scene.iter().enumerate().skip(2) {
                            seen[k] |= crosses(t, p, q);
                        }
                    }
                }
            };
            sample(200, &mut seen);
            for (k, &seen) in seen.iter().enumerate() {
                let listed = list.contains(&(k as u32));
                assert!(listed || !seen, "triangle {k} blocks and is not listed");
            }
            // Where the patches see each other as a whole, every listed triangle blocks something.
            let whole = tb.iter().all(|&q| front(&ta, q)) && ta.iter().all(|&p| front(&tb, p));
            if whole && round % 10 < 3 {
                sample(10_000, &mut seen);
                let blocking = list.iter().filter(|&&k| seen[k as usize]).count();
                hidden += blocking;
                loose += list.len() - blocking;
            }
            clear += usize::from(list.is_empty());
        }
        assert!(clear > 300, "{clear} clear pairs");
        assert!(
            loose * 4 < hidden,
            "{loose} of {hidden} listed triangles block nothing"
        );
    }

    #[test]
    fn boxes_are_safe_too() {
        let mut random = Pcg::new(23);
        for _ in 0..1_000 {
            let mut point = |s: f64| DVec3::new(random.f64(), random.f64(), random.f64()) * s;
            let scene: Vec<[DVec3; 3]> = (0..20)
                .map(|_| {
                    let at = point(1.0);
                    [0; 3].map(|_| at + point(0.4))
                })
                .collect();
            let index = index_of(&scene);
            let corner = [point(1.0), point(1.0)];
            let boxes = corner.map(|low| (low, low + point(0.3)));
            let patches = boxes.map(|(low, high)| ShaftEnd::Box { low, high });
            let triangle = ShaftEnd::Triangle {
                corners: scene[0],
                plane: 0,
            };
            for (a, b) in [(&patches[0], &patches[1]), (&triangle, &patches[1])] {
                let list = match index.blockers(&Shaft::between(a, b), None, 100) {
                    ShaftContents::Few(list) => list,
                    _ => Vec::new(),
                };
                for _ in 0..50 {
                    let mut on = |patch: &ShaftEnd| match patch {
                        ShaftEnd::Point { at, .. } => *at,
                        ShaftEnd::Triangle { corners, .. } => {
                            on_triangle(corners, [random.f64(), random.f64()])
                        }
                        ShaftEnd::Box { low, high } => {
                            *low + (*high - *low)
                                * DVec3::new(random.f64(), random.f64(), random.f64())
                        }
                    };
                    let (p, q) = (on(a), on(b));
                    if matches!(a, ShaftEnd::Triangle { corners, .. } if !front(corners, q)) {
                        continue;
                    }
                    for (k, t) in scene.iter().enumerate().skip(1) {
                        assert!(!crosses(t, p, q) || list.contains(&(k as u32)));
                    }
                }
            }
        }
    }

    #[test]
    fn shafts_from_a_point_list_what_hides_a_part_of_the_target() {
        let mut random = Pcg::new(29);
        let mut listed = 0;
        for _ in 0..2_000 {
            let mut point = |s: f64| DVec3::new(random.f64(), random.f64(), random.f64()) * s;
            let scene: Vec<[DVec3; 3]> = (0..12)
                .map(|_| {
                    let at = point(1.0);
                    [0; 3].map(|_| (at + point(0.4)).as_vec3().as_dvec3())
                })
                .collect();
            let index = index_of(&scene);
            let (at, target) = (point(1.0), scene[0]);
            let normal = (target[0] + target[1] + target[2]) / 3.0 - at;
            let patches = [
                ShaftEnd::Point {
                    at,
                    normal,
                    plane: NO_PLANE,
                },
                ShaftEnd::Triangle {
                    corners: target,
                    plane: 0,
                },
            ];
            let cross = (target[1] - target[0]).cross(target[2] - target[0]);
            // Seen at a grazing angle the shaft is so thin that the gap counts.
            let grazing = cross.dot(at - target[0]) < 0.05 * cross.length();
            if grazing || target.iter().any(|&q| normal.dot(q - at) <= 0.0) {
                continue;
            }
            let shaft = Shaft::between(&patches[0], &patches[1]);
            let list = match index.blockers(&shaft, None, 100) {
                ShaftContents::Few(list) => list,
                _ => Vec::new(),
            };
            for (k, blocker) in scene.iter().enumerate().skip(1) {
                let pieces = crate::geometry::visible_part(at, &target, &[*blocker], 100).unwrap();
                let whole = pieces == [target.to_vec()];
                // A touch below the gap is not listed; no random triangle touches so lightly.
                assert_eq!(list.contains(&(k as u32)), !whole, "triangle {k}");
            }
            listed += list.len();
        }
        assert!(listed > 100, "{listed}");
    }

    #[test]
    fn walls_of_a_room_do_not_block_one_another() {
        // A closed cube with one triangle hanging in the middle.
        let corner =
            |k: u32| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2));
        let mut scene: Vec<[DVec3; 3]> = [
            [0, 1, 2],
            [1, 3, 2],
            [4, 6, 5],
            [5, 6, 7],
            [0, 4, 1],
            [1, 4, 5],
            [2, 3, 6],
            [3, 7, 6],
            [0, 2, 4],
            [2, 6, 4],
            [1, 5, 3],
            [3, 5, 7],
        ]
        .iter()
        .map(|t| t.map(corner))
        .collect();
        scene.push([
            DVec3::new(0.4, 0.4, 0.5),
            DVec3::new(0.6, 0.4, 0.5),
            DVec3::new(0.4, 0.6, 0.5),
        ]);
        let index = index_of(&scene);
        let patch = |k: u32| ShaftEnd::Triangle {
            corners: scene[k as usize],
            plane: k,
        };
        let mut clear = 0;
        for a in 0..12 {
            for b in 0..a {
                match index.blockers(&Shaft::between(&patch(a), &patch(b)), None, 8) {
                    ShaftContents::Clear => clear += 1,
                    ShaftContents::Few(list) => assert_eq!(list, [12], "{a} {b}"),
                    ShaftContents::Many => panic!("only one triangle hangs in the room"),
                }
            }
        }
        assert!(clear >= 10, "{clear}");
        // A small patch in a corner of the floor and one on the wall beside it.
        let small = |o: DVec3, x: DVec3, y: DVec3| ShaftEnd::Triangle {
            corners: [o, o + x * 0.2, o + y * 0.2],
            plane: 99,
        };
        let shaft = Shaft::between(
            &small(DVec3::ZERO, DVec3::X, DVec3::Y),
            &small(DVec3::ZERO, DVec3::Y, DVec3::Z),
        );
        assert_eq!(index.blockers(&shaft, None, 8), ShaftContents::Clear);
    }
}
