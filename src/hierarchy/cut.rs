//! Triangles cut where others meet them: a floor that runs on below a wall is two floors.
//!
//! A patch has one light, and a triangle of the output runs from corner to corner. If it lies on both sides of a wall it takes
//! light from one side to the other, so every triangle is cut along the lines in which large things cross it, stand on it, or
//! hover right before it: between such a thing (a lamp below a ceiling, a rug, a picture) and the surface is a gap with a
//! light of its own. Parts are the triangles of a constrained Delaunay triangulation, which runs no line on to where it means
//! nothing. [`Mesh::cut`] makes them, with the points that neighbours have on common edges.
//!
//! Lengths are in scene units; points within [`TOUCH`] of each other are one.

use super::mesh::{Face, Mesh, WHOLE};
use crate::geometry::RayIndex;
use crate::scene::sets::{join, root};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Surfaces nearer than this share of the scene's half size touch: the accuracy of f32 positions in a file.
const TOUCH: f64 = 1e-6;
/// Things that hover before a surface nearer than this share of the scene's half size cut the surface. A room with a lamp 1 to 20
/// mm below its ceiling was 2 to 8 % too bright and is within 1.5 %; beyond 6 cm (2 %) nothing changes.
const HOVER: f64 = 0.01;
/// Points that hovering things may add to a triangle: a panel adds up to 8, and 40 cards one above the other thousands.
const OUTLINED: usize = 64;
/// A triangle that more than this many others meet stays whole: it is foliage, not a wall.
const MOST: usize = 256;
/// Lines count whose extent is this share of the scene's half size.
const WORTH: f64 = 0.05;
/// And this share of the triangle, or of the half size where the triangle is larger: from the foot of a table needles would run to the
/// far corners of a floor, and light along them. At `--error 1`, with this and without it, mean and root mean square between vertices: sunlit
/// room .128, .52 and .231, 3.53; home theatre .380, 1.10 and .525, 2.97; furnished room .427, 1.31 and .461, 1.42.
const SMALL: f64 = 0.1;

/// A triangle, and where it is cut.
#[derive(Debug, Clone)]
pub struct Cut {
    /// The triangle.
    triangle: u32,
    /// Points as weights of its corners; the corners themselves come first.
    points: Vec<[f64; 3]>,
    /// Lines from point to point, with no third point on them.
    lines: Vec<VertexPair>,
}

impl Cut {
    fn whole(triangle: u32) -> Self {
        Self {
            triangle,
            points: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            lines: Vec::new(),
        }
    }

    /// Where it is cut, recentred.
    pub fn lines(&self, mesh: &Mesh) -> impl Iterator<Item = [DVec3; 2]> {
        let plane = Plane::of(mesh, self.triangle);
        let at = move |k: u32| plane.at(self.points[k as usize]);
        self.lines.iter().map(move |&(a, b)| [at(a), at(b)])
    }

    /// A triangle with segments on it.
    fn along(triangle: u32, plane: &Plane, segments: &[[DVec3; 2]]) -> Self {
        let mut cut = Self::whole(triangle);
        let mut ends = Vec::with_capacity(segments.len());
        for (k, &segment) in segments.iter().enumerate() {
            ends.push(segment.map(|p| cut.add(plane, p)));
            for &other in &segments[..k] {
                if let Some(crossing) = plane.crossing(segment, other) {
                    cut.add(plane, crossing);
                }
            }
        }
        let at: Vec<DVec3> = cut.points.iter().map(|&w| plane.at(w)).collect();
        let mut lines = BTreeSet::new();
        for [a, b] in ends {
            let mut from = a;
            for next in points_between(&at, [a, b], plane.snap()).chain([b]) {
                if next != from {
                    lines.insert(key(from, next));
                }
                from = next;
            }
        }
        cut.lines = lines.into_iter().collect();
        cut
    }

    /// Adds a point, or finds the one already there.
    fn add(&mut self, plane: &Plane, point: DVec3) -> u32 {
        let near = |w: &[f64; 3]| plane.at(*w).distance(point) <= plane.snap();
        if let Some(known) = self.points.iter().position(near) {
            return known as u32;
        }
        let mut weights = plane.weights(point);
        for (k, w) in weights.iter_mut().enumerate() {
            if *w * plane.altitude(k) <= plane.touch {
                *w = 0.0;
            }
        }
        let sum: f64 = weights.iter().sum();
        self.points.push(weights.map(|w| w / sum));
        self.points.len() as u32 - 1
    }

    /// Leaves out lines of what is small beside the triangle, unless they part it: whatever is connected counts as one.
    fn of_worth(mut self, plane: &Plane) -> Self {
        let mut above: Vec<u32> = (0..self.points.len() as u32).collect();
        for &(a, b) in &self.lines {
            join(&mut above, a, b);
        }
        let groups: Vec<u32> = (0..above.len() as u32)
            .map(|k| root(&mut above, k))
            .collect();
        let mut sizes = vec![(DVec3::INFINITY, DVec3::NEG_INFINITY, 0); groups.len()];
        for (&group, &w) in groups.iter().zip(&self.points) {
            let (low, high, ends) = &mut sizes[group as usize];
            let at = plane.at(w);
            (*low, *high) = (low.min(at), high.max(at));
            *ends += usize::from(w.contains(&0.0));
        }
        let counts = |group: u32| {
            let (low, high, ends) = sizes[group as usize];
            low.distance(high) >= plane.worth() || (ends > 1 && plane.is_large())
        };
        self.lines.retain(|line| counts(groups[line.0 as usize]));
        // Points that nothing leads to any more go.
        let mut kept = BTreeSet::from([0, 1, 2]);
        kept.extend(self.lines.iter().flat_map(|&(a, b)| [a, b]));
        let kept: Vec<u32> = kept.into_iter().collect();
        let new = |old: u32| kept.partition_point(|&k| k < old) as u32;
        self.lines
            .iter_mut()
            .for_each(|(a, b)| (*a, *b) = (new(*a), new(*b)));
        self.points = kept.iter().map(|&k| self.points[k as usize]).collect();
        self
    }

    /// Adopts the points on the triangle's edges: own points move onto them, those of neighbours are added.
    fn share(&mut self, vertices: [u32; 3], edges: &BTreeMap<VertexPair, Vec<f64>>) {
        for w in &mut self.points {
            if let Some((edge, x)) = on_edge(vertices, *w)
                && let Some(points) = edges.get(&edge)
            {
                let nearest = points
                    .iter()
                    .copied()
                    .min_by(|a, b| (a - x).abs().total_cmp(&(b - x).abs()));
                *w = edge_weights(vertices, edge, nearest.unwrap_or(x));
            }
        }
        for k in 0..3 {
            let edge = key(vertices[k], vertices[(k + 1) % 3]);
            for &x in edges.get(&edge).into_iter().flatten() {
                let w = edge_weights(vertices, edge, x);
                if !self.points.contains(&w) {
                    self.points.push(w);
                }
            }
        }
    }

    /// The parts: a constrained Delaunay triangulation of the points.
    fn triangles(&self, plane: &Plane) -> Vec<[u32; 3]> {
        let mut net = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
        // Points that have become one have one place.
        let mut places = Vec::with_capacity(self.points.len());
        let mut point_of = Vec::with_capacity(self.points.len());
        for (&w, point) in self.points.iter().zip(0_u32..) {
            let [x, y] = plane.flat(w).to_array();
            let flat = spade::mitigate_underflow(Point2::new(x, y));
            let place = net.insert(flat).expect("numbers between -1 and 1");
            if place.index() == point_of.len() {
                point_of.push(point);
            }
            places.push(place);
        }
        // The border first: rounding may leave its points beside the edge, and what lies outside is of no part.
        let border = (0..3).flat_map(|k| {
            let mut on: Vec<(f64, u32)> = (0_u32..)
                .zip(&self.points)
                .filter(|(_, w)| w[k] == 0.0)
                .map(|(point, w)| (w[(k + 1) % 3], point))
                .collect();
            on.sort_by(|a, b| a.0.total_cmp(&b.0));
            let pairs = on.windows(2).map(|pair| (pair[0].1, pair[1].1));
            pairs.collect::<Vec<_>>()
        });
        for (a, b) in border.chain(self.lines.iter().copied()) {
            let (a, b) = (places[a as usize], places[b as usize]);
            if a != b && net.can_add_constraint(a, b) {
                net.add_constraint(a, b);
            }
        }
        net.inner_faces()
            .map(|face| face.vertices().map(|v| point_of[v.fix().index()]))
            .filter(|corners| {
                let outside = |k: usize| corners.iter().all(|&c| self.points[c as usize][k] == 0.0);
                !(0..3).any(outside)
            })
            .collect()
    }
}

/// Points on the way between two, in order.
fn points_between(at: &[DVec3], [a, b]: [u32; 2], snap: f64) -> impl Iterator<Item = u32> {
    let start = at[a as usize];
    let way = at[b as usize] - start;
    let length = way.length();
    let along = way / length.max(f64::MIN_POSITIVE);
    let mut on: Vec<(f64, u32)> = (0_u32..)
        .zip(at)
        .filter(|&(x, _)| x != a && x != b)
        .filter_map(|(x, &p)| {
            let t = (p - start).dot(along);
            let off = (p - start - along * t).length();
            (t > 0.0 && t < length && off <= snap).then_some((t, x))
        })
        .collect();
    on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    on.into_iter().map(|(_, x)| x)
}

/// The plane of a triangle, and the lengths below which points coincide or touch.
struct Plane {
    corners: [DVec3; 3],
    normal: DVec3,
    area: f64,
    longest: f64,
    half_size: f64,
    touch: f64,
    hover: f64,
}

impl Plane {
    fn of(mesh: &Mesh, triangle: u32) -> Self {
        let face = Face {
            triangle,
            back: false,
        };
        let corners = mesh.corners(face);
        let [a, b, c] = corners;
        Self {
            corners,
            longest: a.distance(b).max(b.distance(c)).max(c.distance(a)),
            half_size: mesh.half_size,
            normal: mesh.normal[triangle as usize],
            area: mesh.area[triangle as usize],
            touch: TOUCH * mesh.half_size,
            hover: HOVER * mesh.half_size,
        }
    }

    /// Points closer than this are one.
    fn snap(&self) -> f64 {
        2.0 * self.touch
    }

    fn at(&self, w: [f64; 3]) -> DVec3 {
        // Start from the corner itself, so that it is exact to the last bit.
        match w.iter().position(|&x| x == 1.0) {
            Some(k) => self.corners[k],
            None => self.corners[0] * w[0] + self.corners[1] * w[1] + self.corners[2] * w[2],
        }
    }

    fn altitude(&self, k: usize) -> f64 {
        2.0 * self.area / self.corners[(k + 1) % 3].distance(self.corners[(k + 2) % 3])
    }

    /// Weights of the corners of a point in the plane.
    fn weights(&self, p: DVec3) -> [f64; 3] {
        std::array::from_fn(|k| {
            let (a, b) = (self.corners[(k + 1) % 3], self.corners[(k + 2) % 3]);
            (b - a).cross(p - a).dot(self.normal) / (2.0 * self.area)
        })
    }

    /// A point in coordinates of the plane, in lengths of the longest edge.
    fn flat(&self, w: [f64; 3]) -> DVec2 {
        let along = (self.corners[1] - self.corners[0]).normalize_or_zero();
        let d = (self.at(w) - self.corners[0]) / self.longest;
        DVec2::new(d.dot(along), d.dot(self.normal.cross(along)))
    }

    /// Where two segments in the plane cross.
    fn crossing(&self, [p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> Option<DVec3> {
        let (one, other) = (q - p, s - r);
        let cross = one.cross(other).dot(self.normal);
        if cross == 0.0 {
            return None;
        }
        let t = (r - p).cross(other).dot(self.normal) / cross;
        let u = (r - p).cross(one).dot(self.normal) / cross;
        let on = |x: f64| (0.0..=1.0).contains(&x);
        (on(t) && on(u)).then(|| p + one * t)
    }

    /// The extent of what counts on this triangle.
    fn worth(&self) -> f64 {
        (WORTH * self.half_size).max(SMALL * self.longest.min(self.half_size))
    }

    /// May something that is small beside the room count here?
    fn is_large(&self) -> bool {
        self.area >= (WORTH * self.half_size).powi(2)
    }

    /// Distances of points before the plane; 0 where less than `reach`.
    fn before(&self, points: [DVec3; 3], reach: f64) -> [f64; 3] {
        points.map(|p| {
            let d = self.normal.dot(p - self.corners[0]);
            if d.abs() <= reach { 0.0 } else { d }
        })
    }

    /// Edges of another triangle that hover before this one without touching it, clipped to this triangle.
    fn hovering(&self, other: [DVec3; 3]) -> Vec<(usize, [DVec3; 2])> {
        let exact = self.before(other, self.touch);
        let near = self.before(other, self.hover);
        let foot = |k: usize| other[k] - self.normal * exact[k];
        let edge = |k: usize| {
            let next = (k + 1) % 3;
            let hovers = near[k] == 0.0 && near[next] == 0.0 && exact[k] * exact[next] > 0.0;
            let inside = hovers.then(|| clipped([foot(k), foot(next)], &self.corners, self));
            Some((k, inside.flatten()?))
        };
        (0..3).filter_map(edge).collect()
    }

    /// The segment, inside the triangle, where another triangle crosses its plane or stands on it.
    fn met(&self, other: [DVec3; 3]) -> Option<[DVec3; 2]> {
        let d = self.before(other, self.touch);
        let mut ends = Vec::with_capacity(3);
        for k in 0..3 {
            let next = (k + 1) % 3;
            if d[k] == 0.0 {
                ends.push(other[k]);
            }
            if d[k] * d[next] < 0.0 {
                ends.push(other[k].lerp(other[next], d[k] / (d[k] - d[next])));
            }
        }
        match ends[..] {
            [p, q] => clipped([p, q], &self.corners, self),
            // The other triangle touches in a point, or lies in the plane.
            _ => None,
        }
    }
}

/// The part of a segment inside a convex polygon, if it has a length.
fn clipped([p, q]: [DVec3; 2], polygon: &[DVec3], plane: &Plane) -> Option<[DVec3; 2]> {
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    for k in 0..polygon.len() {
        let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
        let inward = plane.normal.cross((b - a).normalize_or_zero());
        let (dp, dq) = (inward.dot(p - a), inward.dot(q - a));
        // A segment along an edge cuts nothing off.
        if dp <= plane.snap() && dq <= plane.snap() {
            return None;
        }
        if dp < 0.0 {
            low = low.max(dp / (dp - dq));
        }
        if dq < 0.0 {
            high = high.min(dp / (dp - dq));
        }
    }
    let along = q - p;
    ((high - low) * along.length() > 2.0 * plane.snap())
        .then(|| [p + along * low, p + along * high])
}

/// All triangles that something large meets or hovers before.
pub fn cuts(mesh: &Mesh, rays: &RayIndex) -> Vec<Cut> {
    let mut taking: Vec<u32> = mesh.faces.iter().map(|f| f.triangle).collect();
    taking.dedup();
    taking
        .par_iter()
        .map_init(Vec::new, |near, &triangle| {
            cut_of(mesh, rays, triangle, near)
        })
        .flatten()
        .collect()
}

/// Where a triangle is cut, if it is.
fn cut_of(mesh: &Mesh, rays: &RayIndex, triangle: u32, near: &mut Vec<u32>) -> Option<Cut> {
    let plane = Plane::of(mesh, triangle);
    let narrow = (0..3).any(|k| plane.altitude(k) < 8.0 * plane.snap());
    if narrow || plane.longest < WORTH * plane.half_size {
        return None;
    }
    let [a, b, c] = plane.corners;
    let reach = if plane.is_large() {
        plane.hover
    } else {
        plane.touch
    };
    let (low, high) = (a.min(b).min(c) - reach, a.max(b).max(c) + reach);
    rays.near(low.as_vec3(), high.as_vec3(), near);
    near.sort_unstable();
    let (mut segments, mut outlines) = (Vec::new(), Vec::new());
    for &other in near.iter() {
        let k = other as usize;
        if mesh.plane[k] == mesh.plane[triangle as usize] || mesh.area[k] <= 0.0 {
            continue;
        }
        let vertices = mesh.triangles[k];
        let corners = vertices.map(|v| mesh.positions[v as usize]);
        segments.extend(plane.met(corners));
        if segments.len() > MOST {
            return None;
        }
        if plane.is_large() && outlines.len() <= MOST {
            let is_large = mesh.area[k] >= (WORTH * plane.half_size).powi(2);
            outlines.extend(plane.hovering(corners).into_iter().map(|(e, segment)| {
                let edge = key(vertices[e], vertices[(e + 1) % 3]);
                ((mesh.plane[k], edge), is_large, segment)
            }));
        }
    }
    let standing = Cut::along(triangle, &plane, &segments).of_worth(&plane);
    // An edge of two triangles in one plane is not an outline.
    let is_once = |edge: &_| outlines.iter().filter(|(other, ..)| other == edge).count() < 2;
    let outlines = outlines
        .iter()
        .filter(|(edge, is_large, _)| *is_large && is_once(edge));
    let met = segments.len();
    segments.extend(outlines.map(|(.., segment)| *segment));
    let all = (met + 1..=2 * MOST)
        .contains(&segments.len())
        .then(|| Cut::along(triangle, &plane, &segments).of_worth(&plane))
        .filter(|all| all.points.len() <= standing.points.len() + OUTLINED);
    let cut = all.unwrap_or(standing);
    (!cut.lines.is_empty()).then_some(cut)
}

/// The lower and the higher vertex of an edge.
type VertexPair = (u32, u32);

fn key(a: u32, b: u32) -> VertexPair {
    (a.min(b), a.max(b))
}

/// For a point on an edge, the edge with the share of the way from its lower to its higher vertex.
fn on_edge(vertices: [u32; 3], w: [f64; 3]) -> Option<(VertexPair, f64)> {
    let k = w.iter().position(|&x| x == 0.0)?;
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    if w[i] == 0.0 || w[j] == 0.0 {
        return None;
    }
    let (a, b) = (vertices[i], vertices[j]);
    Some((key(a, b), if a < b { w[j] } else { w[i] }))
}

/// Shares of the way along each edge at which cuts have points, ascending; merged where both sides have the same point.
fn points_on_edges(mesh: &Mesh, cuts: &[Cut]) -> BTreeMap<VertexPair, Vec<f64>> {
    let mut edges: BTreeMap<VertexPair, Vec<f64>> = BTreeMap::new();
    for cut in cuts {
        let vertices = mesh.triangles[cut.triangle as usize];
        for &w in &cut.points {
            if let Some((edge, t)) = on_edge(vertices, w) {
                edges.entry(edge).or_default().push(t);
            }
        }
    }
    for (&(a, b), points) in &mut edges {
        let length = mesh.positions[a as usize].distance(mesh.positions[b as usize]);
        let least = 2.0 * TOUCH * mesh.half_size / length;
        points.sort_by(f64::total_cmp);
        points.dedup_by(|x, y| *x - *y <= least);
    }
    edges
}

impl Mesh {
    /// The mesh with some triangles cut, and their neighbours fitted.
    pub fn cut(mut self, cuts: &[Cut]) -> Self {
        let edges = points_on_edges(&self, cuts);
        let by_triangle: HashMap<u32, &Cut> = cuts.iter().map(|c| (c.triangle, c)).collect();
        let count = self.triangles.len();
        let mut sides = vec![[false; 2]; count];
        for face in &self.faces {
            sides[face.triangle as usize][usize::from(face.back)] = true;
        }
        let old = std::mem::replace(&mut self, Self::empty());
        self.centre = old.centre;
        (self.half_size, self.reach) = (old.half_size, old.reach);
        self.sheets.clone_from(&old.sheets);
        self.raised.clone_from(&old.raised);
        self.positions.clone_from(&old.positions);
        self.first_triangle.clear();
        let mut welded = HashMap::new();
        for (t, &sides) in sides.iter().enumerate() {
            while self.first_triangle.len() <= old.origin[t].0 as usize {
                self.first_triangle.push(self.triangles.len() as u32);
            }
            let vertices = old.triangles[t];
            let touched =
                (0..3).any(|k| edges.contains_key(&key(vertices[k], vertices[(k + 1) % 3])));
            let mut cut = match by_triangle.get(&(t as u32)) {
                Some(&cut) => cut.clone(),
                None if touched && old.area[t] > 0.0 => Cut::whole(t as u32),
                None => {
                    self.copy(&old, t, vertices, WHOLE, sides);
                    continue;
                }
            };
            let plane = Plane::of(&old, t as u32);
            cut.share(vertices, &edges);
            let ids = self.weld(&cut, vertices, &plane, &mut welded);
            for corners in cut.triangles(&plane) {
                let id = self.within.len() as u32;
                self.within.push(corners.map(|k| cut.points[k as usize]));
                self.copy(&old, t, corners.map(|k| ids[k as usize]), id, sides);
            }
        }
        while self.first_triangle.len() < old.first_triangle.len() {
            self.first_triangle.push(self.triangles.len() as u32);
        }
        self.half = self.paired();
        self
    }

    /// Vertices at the points of a cut: on an edge they are shared with its neighbour.
    fn weld(
        &mut self,
        cut: &Cut,
        vertices: [u32; 3],
        plane: &Plane,
        welded: &mut HashMap<(VertexPair, u64), u32>,
    ) -> Vec<u32> {
        let id = |&w: &[f64; 3]| {
            if let Some(k) = w.iter().position(|&x| x == 1.0) {
                return vertices[k];
            }
            let mut place = || {
                self.positions.push(plane.at(w));
                self.positions.len() as u32 - 1
            };
            match on_edge(vertices, w) {
                Some((edge, x)) => *welded.entry((edge, x.to_bits())).or_insert_with(place),
                None => place(),
            }
        };
        cut.points.iter().map(id).collect()
    }

    /// Copies triangle `t` of another mesh, or a part of it.
    fn copy(&mut self, old: &Self, t: usize, corners: [u32; 3], cut: u32, sides: [bool; 2]) {
        let triangle = self.triangles.len() as u32;
        let [a, b, c] = corners.map(|v| self.positions[v as usize]);
        self.triangles.push(corners);
        self.origin.push(old.origin[t]);
        self.material.push(old.material[t]);
        self.plane.push(old.plane[t]);
        self.normal.push(old.normal[t]);
        self.area.push(if cut == WHOLE {
            old.area[t]
        } else {
            0.5 * (b - a).cross(c - a).length()
        });
        self.part.push(cut);
        for back in [false, true] {
            if sides[usize::from(back)] {
                self.faces.push(Face { triangle, back });
            }
        }
    }
}

/// Weights of a point on an edge, with the same bits from both sides.
fn edge_weights(vertices: [u32; 3], (low, high): VertexPair, t: f64) -> [f64; 3] {
    vertices.map(|v| {
        if v == low {
            1.0 - t
        } else if v == high {
            t
        } else {
            0.0
        }
    })
}
