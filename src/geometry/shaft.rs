//! What could block between two patches.
//!
//! The shaft is the convex hull of two patches (Haines and Wallace 1991, "Shaft Culling for Efficient Ray-Traced Radiosity"), cut to
//! the front half-space of a patch that is a triangle: light neither leaves nor arrives behind it. The hull's sides pass
//! through an edge of one patch and a corner of the other; each is pushed out until all corners are inside, so that a rounding never
//! makes the shaft too small. A triangle is a blocker when something of it, clipped by all sides, is left, and the
//! patches lie on both sides of its plane.
//!
//! Safe side: a pair reported as clear has no blocker, but for what reaches less than the index's gap into the shaft (1e-6 of the scene's half size;
//! neighbours touch it everywhere).

use super::clip::HalfSpace;
use super::index::RayIndex;
use super::segment::NO_PLANE;
use super::tree::{LEAF, Node};
use super::triangle::{BLOCK, Block};
use glam::DVec3;
use wide::f32x8;

/// A convex end of a shaft, in the space of the index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Patch {
    /// A triangle that sends or receives on its counter-clockwise side, and the id of its plane.
    Triangle {
        /// Corners, counter-clockwise seen from the front.
        corners: [DVec3; 3],
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

/// Sides that a shaft can have: a hull of 11 points has at most 18, and two fronts.
const SIDES: usize = 24;

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
    low: DVec3,
    high: DVec3,
    planes: [u32; 2],
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

impl Patch {
    fn shape(&self) -> Shape {
        match *self {
            Self::Triangle {
                corners: [a, b, c], ..
            } => Shape {
                corners: [a, b, c, a, a, a, a, a],
                count: 3,
                edges: &TRIANGLE_EDGES,
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
            Self::Triangle { plane, .. } => plane,
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
            Self::Box { .. } => None,
        }
    }
}

impl Shaft {
    /// The shaft between two patches; the order does not matter.
    pub fn between(a: &Patch, b: &Patch) -> Self {
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
        shaft.add_sides(&sa, &sb, size);
        shaft.add_sides(&sb, &sa, size);
        shaft
    }

    /// Sides through an edge of one patch and a corner of the other.
    fn add_sides(&mut self, edges: &Shape, corners: &Shape, size: f64) {
        for &[p, q] in edges.edges {
            let (p, q) = (edges.corners[p], edges.corners[q]);
            for &corner in &corners.corners[..corners.count] {
                let normal = (q - p).cross(corner - p);
                let length = normal.length();
                if length <= PARALLEL * (q - p).length() * (corner - p).length() {
                    continue;
                }
                self.support(normal / length, p, size);
            }
        }
    }

    /// Adds the plane through `on` if all corners are on one side of it, up to roundings.
    fn support(&mut self, normal: DVec3, on: DVec3, size: f64) {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        let at = normal.dot(on);
        for corner in &self.corners[..self.corner_count] {
            let d = normal.dot(*corner) - at;
            least = least.min(d);
            most = most.max(d);
        }
        let slack = PARALLEL * size;
        if most <= slack {
            self.add(HalfSpace {
                normal,
                offset: at + most,
            });
        } else if least >= -slack {
            self.add(HalfSpace {
                normal: -normal,
                offset: -(at + least),
            });
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

    fn sides(&self) -> &[HalfSpace] {
        &self.sides[..self.count]
    }

    /// Could a triangle block between the patches? `gap`: how far it may reach into the shaft without counting.
    fn holds(&self, triangle: &[DVec3; 3], gap: f64) -> bool {
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
        // What is left after cutting at the sides that cross it.
        let mut polygon = Polygon::new(triangle);
        for (k, side) in self.sides().iter().enumerate() {
            if crossed >> k & 1 == 1 && !polygon.cut(side, gap) {
                return false;
            }
        }
        true
    }
}

/// A convex polygon that is cut again and again, without allocation.
struct Polygon {
    corners: [DVec3; 3 + SIDES],
    count: usize,
}

impl Polygon {
    fn new(triangle: &[DVec3; 3]) -> Self {
        let mut corners = [DVec3::ZERO; 3 + SIDES];
        corners[..3].copy_from_slice(triangle);
        Self { corners, count: 3 }
    }

    /// Keeps what is deeper than `gap` inside; false if that is nothing. Each cut of a convex polygon adds at most one corner.
    fn cut(&mut self, side: &HalfSpace, gap: f64) -> bool {
        let mut kept = [DVec3::ZERO; 3 + SIDES];
        let mut count = 0;
        let mut push = |corner: DVec3| {
            if let Some(place) = kept.get_mut(count) {
                *place = corner;
                count += 1;
            }
        };
        let mut before = self.corners[self.count - 1];
        let mut d0 = side.outside(before) + gap;
        for &corner in &self.corners[..self.count] {
            let d1 = side.outside(corner) + gap;
            if (d0 < 0.0) != (d1 < 0.0) {
                push(before + (corner - before) * (d0 / (d0 - d1)));
            }
            if d1 < 0.0 {
                push(corner);
            }
            (before, d0) = (corner, d1);
        }
        self.corners = kept;
        self.count = count;
        count >= 3
    }
}

/// The shaft in the precision of the tree's boxes.
struct Sides8 {
    normal: [[f32; 3]; SIDES],
    offset: [f32; SIDES],
    count: usize,
    low: [f32; 3],
    high: [f32; 3],
}

impl Sides8 {
    /// Offsets grow by `slack`, for the roundings of f32.
    fn new(shaft: &Shaft, slack: f64) -> Self {
        let mut sides = Self {
            normal: [[0.0; 3]; SIDES],
            offset: [0.0; SIDES],
            count: shaft.count,
            low: (shaft.low - slack).as_vec3().to_array(),
            high: (shaft.high + slack).as_vec3().to_array(),
        };
        for (k, side) in shaft.sides().iter().enumerate() {
            sides.normal[k] = side.normal.as_vec3().to_array();
            sides.offset[k] = (side.offset + slack) as f32;
        }
        sides
    }

    /// A bit for each child whose box may reach into the shaft.
    #[inline(always)]
    fn boxes(&self, node: &Node) -> u32 {
        let mut out = f32x8::ZERO;
        for axis in 0..3 {
            out = out
                | node.bounds[0][axis].simd_gt(f32x8::splat(self.high[axis]))
                | node.bounds[1][axis].simd_lt(f32x8::splat(self.low[axis]));
        }
        for k in 0..self.count {
            let n = self.normal[k];
            // The corner of the box that is deepest inside.
            let mut depth = f32x8::ZERO;
            for (axis, &x) in n.iter().enumerate() {
                depth += node.bounds[usize::from(x < 0.0)][axis] * f32x8::splat(x);
            }
            out |= depth.simd_gt(f32x8::splat(self.offset[k]));
        }
        !out.to_bitmask() & ((1 << node.count) - 1)
    }

    /// A bit for each triangle of a block that no single side keeps out.
    #[inline(always)]
    fn triangles(&self, block: &Block) -> u32 {
        let mut out = f32x8::ZERO;
        for k in 0..self.count {
            let mut depth = [f32x8::ZERO; 3];
            for (axis, &x) in self.normal[k].iter().enumerate() {
                let x = f32x8::splat(x);
                for (depth, corner) in depth.iter_mut().zip(&block.corners) {
                    *depth += corner[axis] * x;
                }
            }
            let least = depth[0].fast_min(depth[1]).fast_min(depth[2]);
            out |= least.simd_gt(f32x8::splat(self.offset[k]));
        }
        !out.to_bitmask() & ((1 << block.count) - 1)
    }
}

/// What stays in a shaft's list.
struct Found {
    ids: Vec<u32>,
    cap: usize,
}

impl RayIndex {
    /// The triangles that may block in a shaft, if at most `cap`. `candidates`: the only triangles to look at, as found for a
    /// shaft that encloses this one (the link that was refined); None: all.
    pub fn blockers(&self, shaft: &Shaft, candidates: Option<&[u32]>, cap: usize) -> ShaftContents {
        let mut found = Found {
            ids: Vec::new(),
            cap,
        };
        let fits = match candidates {
            Some(list) => list.iter().all(|&id| {
                let Some((block, lane)) = self.place(id) else {
                    return true;
                };
                self.take(shaft, &self.tree.blocks[block], lane, &mut found)
            }),
            None => self.search(shaft, &mut found),
        };
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
    fn search(&self, shaft: &Shaft, found: &mut Found) -> bool {
        if self.tree.nodes.is_empty() {
            return true;
        }
        let sides = Sides8::new(shaft, f64::from(self.gap));
        let mut stack = super::index::Stack::new(0u32);
        while let Some(entry) = stack.pop() {
            if entry & LEAF == 0 {
                let node = &self.tree.nodes[entry as usize];
                let mut open = sides.boxes(node);
                while open != 0 {
                    stack.push(node.children[open.trailing_zeros() as usize]);
                    open &= open - 1;
                }
                continue;
            }
            let block = &self.tree.blocks[(entry & !LEAF) as usize];
            let mut open = sides.triangles(block);
            while open != 0 {
                let lane = open.trailing_zeros() as usize;
                open &= open - 1;
                if !self.take(shaft, block, lane, found) {
                    return false;
                }
            }
        }
        true
    }

    /// Adds a triangle if it may block; false when it is one too many.
    fn take(&self, shaft: &Shaft, block: &Block, lane: usize, found: &mut Found) -> bool {
        debug_assert!(lane < BLOCK);
        let plane = block.planes[lane];
        if plane != NO_PLANE && shaft.planes.contains(&plane) {
            return true;
        }
        let corners = block
            .corner_lane(lane)
            .map(|c| DVec3::from(c.map(f64::from)));
        if !shaft.holds(&corners, f64::from(self.gap)) {
            return true;
        }
        found.ids.push(block.ids[lane]);
        found.ids.len() <= found.cap
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::{Pcg, on_triangle};
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
                &Patch::Triangle {
                    corners: ta,
                    plane: 0,
                },
                &Patch::Triangle {
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
            let all: Vec<u32> = (0..24).collect();
            assert_eq!(index.blockers(&shaft, Some(&all), 100), contents);
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
            let patches = boxes.map(|(low, high)| Patch::Box { low, high });
            let triangle = Patch::Triangle {
                corners: scene[0],
                plane: 0,
            };
            for (a, b) in [(&patches[0], &patches[1]), (&triangle, &patches[1])] {
                let list = match index.blockers(&Shaft::between(a, b), None, 100) {
                    ShaftContents::Few(list) => list,
                    _ => Vec::new(),
                };
                for _ in 0..50 {
                    let mut on = |patch: &Patch| match patch {
                        Patch::Triangle { corners, .. } => {
                            on_triangle(corners, [random.f64(), random.f64()])
                        }
                        Patch::Box { low, high } => {
                            *low + (*high - *low)
                                * DVec3::new(random.f64(), random.f64(), random.f64())
                        }
                    };
                    let (p, q) = (on(a), on(b));
                    if matches!(a, Patch::Triangle { corners, .. } if !front(corners, q)) {
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
        let patch = |k: u32| Patch::Triangle {
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
        let small = |o: DVec3, x: DVec3, y: DVec3| Patch::Triangle {
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
