//! Two-sided surfaces that are the skins of solids: chairs, shelves, blocks. Exporters call everything two-sided, and insides that no
//! light can reach would be half of a room's elements and half of its file.
//!
//! A surface belongs to a solid if every edge is run through as often one way as the other, and if behind each of its triangles is a
//! place that it encloses. Nothing comes in there, whatever else stands in the room, so that leaving these sides out changes no light
//! outside. Insides with a lamp or a camera in them may be the room itself: they stay.

use super::sets::{join, root};
use super::{Alpha, Camera, LightKind, Material, PunctualLight, Sides, Surface};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Rays run this way: along nothing that is usually built, so that hardly any meets an edge.
const ALONG: DVec3 = DVec3::new(0.47, 0.81, 0.35);
/// How far behind a triangle lies the place that it must enclose, as a share of the solid: a micrometre in a chair, whose plastic is some
/// millimetres thick.
const BEHIND: f64 = 1e-6;
/// A lamp or a camera so near to an inside, as a share of the solid, may be there: a panel lies in the very plane of its ceiling.
const NEAR: f64 = 1e-3;
/// Triangles that are asked about one ray at the most: a surface through which more of them go is left as it is, and no file takes forever. Chairs of
/// 3,356 triangles ask 36 a ray on average and 172 at the most, two things of a living room 34 and 144.
const MOST_ASKED: usize = 2000;
/// Triangles of a leaf of the tree in which rays look for them.
const LEAF: usize = 8;

/// The surfaces whose backs take no part.
pub(super) fn solids(
    surfaces: &[Surface],
    materials: &[Material],
    lights: &[PunctualLight],
    cameras: &[Camera],
) -> BTreeSet<usize> {
    let candidate = |s: &Surface| {
        let m = &materials[s.material];
        let shut = matches!(m.alpha, Alpha::Opaque) && m.sheet.is_none();
        m.sides == Sides::Both && shut && m.emission.is_none()
    };
    // One object of the file is one node, of some primitives.
    let mut objects: BTreeMap<(usize, Option<usize>), Vec<usize>> = BTreeMap::new();
    for (k, surface) in surfaces.iter().enumerate().filter(|(_, s)| candidate(s)) {
        let object = objects.entry((surface.node, surface.instance));
        object.or_default().push(k);
    }
    let occupants = occupants(surfaces, materials, lights, cameras);
    let objects: Vec<Vec<usize>> = objects.into_values().collect();
    let of = |object: &Vec<usize>| Shell::new(surfaces, object).solids(&occupants);
    objects.par_iter().flat_map_iter(of).collect()
}

/// Places where a lamp or a camera is; of triangles that shine their middles and what lies a little inside of their corners.
fn occupants(
    surfaces: &[Surface],
    materials: &[Material],
    lights: &[PunctualLight],
    cameras: &[Camera],
) -> Vec<DVec3> {
    let glows = |s: &&Surface| materials[s.material].emission.is_some();
    let places = |s: &Surface, t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| s.positions[v as usize]);
        let middle = (a + b + c) / 3.0;
        [a, b, c, middle].map(|p| p.lerp(middle, 0.1))
    };
    let glowing = surfaces.iter().filter(glows);
    let placed = |l: &&PunctualLight| {
        matches!(
            l.kind,
            LightKind::Point | LightKind::Spot { .. } | LightKind::Profile | LightKind::Surface
        )
    };
    (glowing.flat_map(|s| s.triangles.iter().flat_map(move |t| places(s, t))))
        .chain(lights.iter().filter(placed).map(|l| l.position))
        .chain(cameras.iter().map(|c| c.to_world.w_axis.truncate()))
        .collect()
}

/// The triangles of one object that are parts of closed shells.
struct Shell {
    /// Two axes across the rays, and one along them.
    axes: DMat3,
    /// Corners by these axes.
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Surface of each triangle.
    surface: Vec<usize>,
    /// Surfaces some of whose triangles are no part of a closed shell.
    open: BTreeSet<usize>,
}

impl Shell {
    fn new(surfaces: &[Surface], object: &[usize]) -> Self {
        let along = ALONG.normalize();
        let (u, v) = along.any_orthonormal_pair();
        let axes = DMat3::from_cols(u, v, along).transpose();
        let mut shell = Self {
            axes,
            positions: Vec::new(),
            triangles: Vec::new(),
            surface: Vec::new(),
            open: BTreeSet::new(),
        };
        let mut welded: HashMap<[u64; 3], u32> = HashMap::new();
        for &s in object {
            let mut weld = |p: &DVec3| {
                let key = (*p + DVec3::ZERO).to_array().map(f64::to_bits);
                *welded.entry(key).or_insert_with(|| {
                    shell.positions.push(axes * *p);
                    shell.positions.len() as u32 - 1
                })
            };
            let ids: Vec<u32> = surfaces[s].positions.iter().map(&mut weld).collect();
            let triangles = surfaces[s].triangles.iter();
            let triangles = triangles.map(|t| t.map(|v| ids[v as usize]));
            for t in triangles.filter(|[a, b, c]| a != b && b != c && c != a) {
                shell.triangles.push(t);
                shell.surface.push(s);
            }
        }
        shell.without_open_parts();
        shell
    }

    /// Leaves out what hangs together with an edge that is not run through as often one way as the other.
    fn without_open_parts(&mut self) {
        let mut edges: Vec<([u32; 2], bool, u32)> = Vec::with_capacity(3 * self.triangles.len());
        for (&[a, b, c], t) in self.triangles.iter().zip(0_u32..) {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                edges.push(([p.min(q), p.max(q)], p < q, t));
            }
        }
        edges.sort_unstable();
        let mut above: Vec<u32> = (0..self.triangles.len() as u32).collect();
        let mut uneven: Vec<u32> = Vec::new();
        for same in edges.chunk_by(|a, b| a.0 == b.0) {
            let up = same.iter().filter(|e| e.1).count();
            if 2 * up != same.len() {
                uneven.push(same[0].2);
            }
            for e in &same[1..] {
                join(&mut above, same[0].2, e.2);
            }
        }
        let uneven: BTreeSet<u32> = uneven.into_iter().map(|t| root(&mut above, t)).collect();
        let open: Vec<bool> = (0..above.len() as u32)
            .map(|t| uneven.contains(&root(&mut above, t)))
            .collect();
        let of_open = |(s, open): (&usize, &bool)| open.then_some(*s);
        self.open = self.surface.iter().zip(&open).filter_map(of_open).collect();
        let mut closed = open.iter().map(|open| !open);
        self.triangles.retain(|_| closed.next() == Some(true));
        let mut closed = open.iter().map(|open| !open);
        self.surface.retain(|_| closed.next() == Some(true));
    }

    /// The surfaces that belong to solids with nobody inside.
    fn solids(&self, occupants: &[DVec3]) -> BTreeSet<usize> {
        let mut found: BTreeSet<usize> = self.surface.iter().copied().collect();
        found.retain(|s| !self.open.contains(s));
        if found.is_empty() {
            return found;
        }
        let tree = Rectangles::new(self);
        let outer = tree.nodes[0];
        let size = (outer.high - outer.low).length();
        let around = DMat3::IDENTITY.to_cols_array_2d().map(DVec3::from);
        let around = around.into_iter().flat_map(|axis| [axis, -axis]);
        let around: Vec<DVec3> = around.map(|d| NEAR * size * d).collect();
        let inhabited = occupants.iter().any(|p| {
            let p = self.axes * *p;
            let inside = |d: &DVec3| self.turns(&tree, p + *d) != Some(0);
            outer.is_near(p.truncate(), NEAR * size) && around.iter().any(inside)
        });
        if inhabited {
            return BTreeSet::new();
        }
        let behind = BEHIND * size;
        let exposed = |t: usize| {
            let [a, b, c] = self.triangles[t].map(|v| self.positions[v as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            self.turns(&tree, (a + b + c) / 3.0 - behind * normal)
                .is_none_or(|turns| turns == 0)
        };
        let exposed: BTreeSet<usize> = (0..self.triangles.len())
            .into_par_iter()
            .filter(|&t| exposed(t))
            .map(|t| self.surface[t])
            .collect();
        &found - &exposed
    }

    /// How many times the shell goes around a place: 0 outside. None: too many triangles are in the way.
    fn turns(&self, tree: &Rectangles, place: DVec3) -> Option<i32> {
        let (mut turns, mut asked) = (0, 0);
        let mut open = vec![0_usize];
        while let Some(k) = open.pop() {
            let node = &tree.nodes[k];
            if !node.is_near(place.truncate(), 0.0) {
                continue;
            }
            if node.inner != 0 {
                open.extend([node.inner, node.inner + 1]);
                continue;
            }
            asked += node.end - node.first;
            if asked > MOST_ASKED {
                return None;
            }
            turns += (tree.order[node.first..node.end].iter())
                .map(|&t| self.crossing(t as usize, place))
                .sum::<i32>();
        }
        Some(turns)
    }

    /// 1 where the ray from a place leaves through the front of a triangle, -1 where it enters there.
    fn crossing(&self, triangle: usize, place: DVec3) -> i32 {
        let corners = self.triangles[triangle];
        let at = |v: u32| self.positions[v as usize];
        // Both triangles of an edge work with the same numbers, so that a ray passes through exactly one of them.
        let is_left = |p: u32, q: u32| {
            let (a, b) = (at(p.min(q)).truncate(), at(p.max(q)).truncate());
            ((b - a).perp_dot(place.truncate() - a) >= 0.0) == (p < q)
        };
        let [a, b, c] = corners;
        let left = is_left(a, b);
        if is_left(b, c) != left || is_left(c, a) != left {
            return 0;
        }
        let [a, b, c] = corners.map(at);
        let normal = (b - a).cross(c - a);
        match ((a - place).dot(normal) * normal.z > 0.0, left) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => -1,
        }
    }
}

/// A rectangle across the rays, and what lies in it: triangles `first..end` of the order, or two nodes from `inner` on.
#[derive(Debug, Clone, Copy)]
struct Rectangle {
    low: DVec2,
    high: DVec2,
    first: usize,
    end: usize,
    inner: usize,
}

impl Rectangle {
    fn is_near(&self, p: DVec2, distance: f64) -> bool {
        p.cmpge(self.low - distance).all() && p.cmple(self.high + distance).all()
    }
}

/// Triangles by where they lie across the rays.
struct Rectangles {
    nodes: Vec<Rectangle>,
    order: Vec<u32>,
}

impl Rectangles {
    fn new(shell: &Shell) -> Self {
        let bounds = |t: &u32| {
            let corners =
                shell.triangles[*t as usize].map(|v| shell.positions[v as usize].truncate());
            let [a, b, c] = corners;
            (a.min(b).min(c), a.max(b).max(c))
        };
        let mut tree = Self {
            nodes: Vec::new(),
            order: (0..shell.triangles.len() as u32).collect(),
        };
        let around = |order: &[u32], first: usize| {
            let all = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            let (low, high) = order
                .iter()
                .map(bounds)
                .fold(all, |x, y| (x.0.min(y.0), x.1.max(y.1)));
            Rectangle {
                low,
                high,
                first,
                end: first + order.len(),
                inner: 0,
            }
        };
        tree.nodes.push(around(&tree.order, 0));
        let mut k = 0;
        while k < tree.nodes.len() {
            let Rectangle {
                low,
                high,
                first,
                end,
                ..
            } = tree.nodes[k];
            if end - first > LEAF {
                let axis = usize::from(high.y - low.y > high.x - low.x);
                let part = &mut tree.order[first..end];
                let half = part.len() / 2;
                let middle = |t: &u32| {
                    let (low, high) = bounds(t);
                    low[axis] + high[axis]
                };
                part.select_nth_unstable_by(half, |s, t| {
                    middle(s).total_cmp(&middle(t)).then(s.cmp(t))
                });
                let (one, other) = part.split_at(half);
                let halves = [around(one, first), around(other, first + half)];
                tree.nodes[k].inner = tree.nodes.len();
                tree.nodes.extend(halves);
            }
            k += 1;
        }
        tree
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Meshes, Options, Paint, PointLamp, Projection, Scene};
    use glam::DMat4;

    /// Positions, and corners of triangles.
    type Triangles = (Vec<[f32; 3]>, Vec<[u32; 3]>);

    /// Corners of a block of 1 m by its lowest corner, and its faces outwards.
    fn block(x: f32) -> Triangles {
        let corner = |k: u32| [0, 1, 2].map(|axis| (k >> axis & 1) as f32);
        let corners = (0..8).map(corner).map(|[a, b, c]| [x + a, b, c]);
        let quads = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let halves = quads
            .into_iter()
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
        (corners.collect(), halves.collect())
    }

    /// Two-sided meshes with a lamp beside them, or elsewhere.
    fn scene(meshes: &[Triangles], lamp: [f32; 3]) -> Scene {
        let mut room = Meshes::default();
        let paint = room.paint(Paint {
            two_sided: true,
            ..Paint::default()
        });
        for (positions, triangles) in meshes {
            room.mesh("thing", positions, triangles, paint);
        }
        room.lamp(PointLamp {
            name: "lamp".into(),
            position: lamp,
            candela: 100.0,
            color: [1.0; 3],
        });
        Scene::from_meshes(&room, &Options::default()).unwrap()
    }

    fn found(meshes: &[Triangles], lamp: [f32; 3]) -> Vec<usize> {
        scene(meshes, lamp).solids.into_iter().collect()
    }

    const BESIDE: [f32; 3] = [-1.0, 0.3, 0.4];

    #[test]
    fn blocks_are_solids_and_what_has_a_hole_is_none() {
        let mut holed = block(4.0);
        holed.1.pop();
        let scene = scene(&[block(0.0), holed, block(2.0)], BESIDE);
        assert_eq!(scene.solids, BTreeSet::from([0, 2]));
        assert_eq!([0, 1].map(|s| scene.sides(s)), [Sides::Front, Sides::Both]);
    }

    /// A surface with a closed and an open part shows both sides.
    #[test]
    fn a_sheet_beside_a_block_leaves_the_surface_two_sided() {
        let (mut corners, mut triangles) = block(0.0);
        let (more, sheet) = block(3.0);
        corners.extend(more);
        triangles.extend(sheet[..2].iter().map(|t| t.map(|v| v + 8)));
        assert!(found(&[(corners, triangles)], BESIDE).is_empty());
    }

    #[test]
    fn rooms_with_a_lamp_or_a_camera_inside_are_no_solids() {
        assert!(found(&[block(0.0)], [0.5, 0.6, 0.7]).is_empty());
        let scene = scene(&[block(0.0), block(2.0)], BESIDE);
        let camera = Camera {
            name: "within".into(),
            to_world: DMat4::from_translation(DVec3::new(2.2, 0.5, 0.3)),
            projection: Projection::Perspective(1.0),
            aspect: None,
        };
        let seen = solids(&scene.surfaces, &scene.materials, &[], &[camera]);
        assert_eq!(seen, BTreeSet::from([0]));
    }

    /// The panel of a room may lie in the plane of its ceiling, and a strip go through the wall between two.
    #[test]
    fn rooms_lit_from_their_border_are_no_solids() {
        let lit = |rooms: &[Triangles], panel: [[f32; 3]; 4]| {
            let mut room = Meshes::default();
            let wall = room.paint(Paint {
                two_sided: true,
                ..Paint::default()
            });
            let lamp = room.paint(Paint {
                luminance: [100.0; 3],
                ..Paint::default()
            });
            for (positions, triangles) in rooms {
                room.mesh("room", positions, triangles, wall);
            }
            room.mesh("panel", &panel, &[[0, 1, 2], [0, 2, 3]], lamp);
            Scene::from_meshes(&room, &Options::default())
                .unwrap()
                .solids
        };
        let square = |low: [f32; 2], high: [f32; 2], y: f32| {
            let [[x0, z0], [x1, z1]] = [low, high];
            [[x0, y, z0], [x1, y, z0], [x1, y, z1], [x0, y, z1]]
        };
        let ceiling = square([0.4, 0.4], [0.6, 0.6], 1.0);
        assert!(lit(&[block(0.0)], ceiling).is_empty());
        let strip = square([0.5, 0.4], [2.5, 0.6], 0.5);
        assert!(lit(&[block(0.0), block(2.0)], strip).is_empty());
        let beside = square([1.2, 0.4], [1.8, 0.6], 0.5);
        assert_eq!(lit(&[block(0.0), block(2.0)], beside).len(), 2);
    }

    /// Faces of which some or all look inwards: backs are outside there.
    #[test]
    fn what_is_turned_inside_out_is_no_solid() {
        let (corners, mut triangles) = block(0.0);
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
        assert!(found(&[(corners.clone(), triangles)], BESIDE).is_empty());
        // A block whose far end is turned by 180 degrees: a bow tie seen from the side, closed, one half inside out.
        let (mut corners, triangles) = block(0.0);
        for pair in [[0, 2], [4, 6]] {
            corners.swap(pair[0], pair[1]);
        }
        assert!(found(&[(corners, triangles)], BESIDE).is_empty());
    }

    /// Whatever else is in the way of the rays: blocks in a row, one object.
    #[test]
    fn an_object_of_many_blocks_is_a_solid() {
        let (mut corners, mut triangles) = (Vec::new(), Vec::new());
        for k in 0..40_u32 {
            // Some have a face in common, some overlap.
            let (more, faces) = block([1.0, 0.75][k as usize % 2] * k as f32);
            corners.extend(more);
            triangles.extend(faces.iter().map(|t| t.map(|v| v + 8 * k)));
        }
        assert_eq!(found(&[(corners, triangles)], BESIDE), [0]);
    }

    /// The plain way to count turns: the angle that the shell takes up.
    #[test]
    fn rays_count_turns_as_solid_angles_do() {
        let scene = scene(&[block(0.0)], BESIDE);
        let shell = Shell::new(&scene.surfaces, &[0]);
        let tree = Rectangles::new(&shell);
        let at = |v: u32| shell.positions[v as usize];
        for k in 0..200 {
            let unit = |m: f64| (f64::from(k) * m).fract();
            let place = DVec3::new(
                3.0 * unit(0.618) - 1.0,
                2.0 * unit(0.755) - 0.5,
                2.0 * unit(0.57) - 0.5,
            );
            let place = shell.axes * place;
            // Van Oosterom and Strackee 1983.
            let angle = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|v| (at(v) - place).normalize());
                2.0 * a
                    .dot(b.cross(c))
                    .atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
            };
            let whole: f64 = shell.triangles.iter().map(angle).sum();
            let turns = (whole / (4.0 * std::f64::consts::PI)).round() as i32;
            assert_eq!(shell.turns(&tree, place), Some(turns), "{place}");
        }
    }
}
