//! Triangles cut where others meet them: a floor that runs on below a wall is two floors.
//!
//! A patch has one light. If it lies on both sides of a wall it takes light from one side to the other, so every triangle
//! is cut along the segments in which others cross it or stand on it. The parts are convex; a cut runs on to the border
//! of the part that it crosses. [`super::spaces`] finds out which triangles are worth cutting (those that belong to
//! several spaces), and [`Mesh::cut`] makes the new triangles, with the points that their neighbours have on common
//! edges.
//!
//! A thing that hovers right before a surface (a lamp below a ceiling, a rug, a picture) is as good as on it: between them is
//! a gap with a light of its own, and a patch that lies partly in the gap would show the gap's light to the room.
//! Lengths are in scene units; points within [`TOUCH`] of each other are one.

use super::mesh::{Face, Mesh, WHOLE};
use crate::geometry::RayIndex;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Surfaces nearer than this share of the scene's half size touch: the accuracy of f32 positions in a file.
const TOUCH: f64 = 1e-6;
/// Things that hover before a surface nearer than this share of the scene's half size cut the surface. A room with a lamp 1 to 20
/// mm below its ceiling was 2 to 8 % too bright and is within 1.5 %; beyond 6 cm (2 %) nothing changes. Only in rooms all of whose
/// cuts are made: in a restaurant, where rays do what links do here, four times the leaves gained nothing.
const HOVER: f64 = 0.01;
/// Parts that hovering things may add to a triangle: a panel adds up to 8, and 40 cards one above the other thousands.
const OUTLINED: usize = 64;
/// A triangle that more than this many others meet stays whole: it is foliage, not a wall.
const MOST: usize = 256;

/// A triangle in convex parts.
#[derive(Debug, Clone)]
pub struct Cut {
    /// The triangle.
    pub(super) triangle: u32,
    /// Points as weights of its corners; the corners themselves come first.
    points: Vec<[f64; 3]>,
    /// Corners of the parts among `points`, in the sense of the triangle.
    parts: Vec<Vec<u32>>,
}

impl Cut {
    fn whole(triangle: u32) -> Self {
        Self {
            triangle,
            points: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            parts: vec![vec![0, 1, 2]],
        }
    }

    /// Corners of the parts in space.
    pub(super) fn polygons(&self, mesh: &Mesh) -> Vec<Vec<DVec3>> {
        let plane = Plane::of(mesh, self.triangle);
        let at = |&p: &u32| plane.at(self.points[p as usize]);
        self.parts
            .iter()
            .map(|part| part.iter().map(at).collect())
            .collect()
    }

    /// Adds a point, or finds the one already there.
    fn add(&mut self, plane: &Plane, weights: [f64; 3]) -> u32 {
        let point = plane.at(weights);
        let near = |w: &[f64; 3]| plane.at(*w).distance(point) <= plane.snap();
        if let Some(known) = self.points.iter().position(near) {
            return known as u32;
        }
        let mut weights: [f64; 3] = std::array::from_fn(|k| {
            if weights[k] * plane.altitude(k) <= plane.touch {
                0.0
            } else {
                weights[k]
            }
        });
        let sum: f64 = weights.iter().sum();
        weights = weights.map(|w| w / sum);
        self.points.push(weights);
        self.points.len() as u32 - 1
    }

    /// Cuts the parts that a segment crosses.
    fn split(&mut self, plane: &Plane, [p, q]: [DVec3; 2]) {
        let across = plane.normal.cross((q - p).normalize_or_zero());
        for part in std::mem::take(&mut self.parts) {
            let corners: Vec<DVec3> = part
                .iter()
                .map(|&k| plane.at(self.points[k as usize]))
                .collect();
            let side: Vec<f64> = corners
                .iter()
                .map(|x| {
                    let d = across.dot(*x - p);
                    if d.abs() <= plane.snap() { 0.0 } else { d }
                })
                .collect();
            let both = side.iter().any(|&d| d > 0.0) && side.iter().any(|&d| d < 0.0);
            if !both || clipped([p, q], &corners, plane).is_none() {
                self.parts.push(part);
                continue;
            }
            let (mut left, mut right) = (Vec::new(), Vec::new());
            for k in 0..part.len() {
                let next = (k + 1) % part.len();
                if side[k] >= 0.0 {
                    left.push(part[k]);
                }
                if side[k] <= 0.0 {
                    right.push(part[k]);
                }
                if side[k] * side[next] < 0.0 {
                    let t = side[k] / (side[k] - side[next]);
                    let (a, b) = (
                        self.points[part[k] as usize],
                        self.points[part[next] as usize],
                    );
                    let id = self.add(plane, std::array::from_fn(|c| a[c] + t * (b[c] - a[c])));
                    left.push(id);
                    right.push(id);
                }
            }
            for mut part in [left, right] {
                part.dedup();
                if part.len() > 1 && part.first() == part.last() {
                    part.pop();
                }
                if part.len() > 2 {
                    self.parts.push(part);
                }
            }
        }
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

    /// Cuts along the outlines of hovering things, unless that makes too many parts: then along none.
    fn outlined(self, plane: &Plane, outlines: Vec<[DVec3; 2]>) -> Self {
        let most = self.parts.len() + OUTLINED;
        let mut cut = self.clone();
        for &outline in outlines.iter().take(MOST + 1) {
            cut.split(plane, outline);
            if cut.parts.len() > most {
                return self;
            }
        }
        match outlines.len() > MOST {
            true => self,
            false => cut,
        }
    }

    /// Gives every part the points that lie on its edges, so that neighbours have the same points.
    fn fit(&mut self, plane: &Plane) {
        let at: Vec<DVec3> = self.points.iter().map(|&w| plane.at(w)).collect();
        for part in &mut self.parts {
            let mut fitted = Vec::new();
            for k in 0..part.len() {
                let (a, b) = (part[k], part[(k + 1) % part.len()]);
                let (p, along) = (at[a as usize], at[b as usize] - at[a as usize]);
                let length = along.length();
                let along = along / length.max(f64::MIN_POSITIVE);
                let mut on: Vec<(f64, u32)> = (0..at.len() as u32)
                    .filter(|&x| x != a && x != b)
                    .filter_map(|x| {
                        let d = at[x as usize] - p;
                        let t = d.dot(along);
                        let off = (d - along * t).length();
                        (t > 0.0 && t < length && off <= plane.snap()).then_some((t, x))
                    })
                    .collect();
                on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
                fitted.push(a);
                fitted.extend(on.into_iter().map(|(_, x)| x));
            }
            *part = fitted;
        }
    }

    /// Triangles of all parts: cuts off ears, always that of the greatest altitude that leaves no point on its long
    /// side.
    fn triangles(&self, plane: &Plane) -> Vec<[u32; 3]> {
        let at = |k: u32| plane.at(self.points[k as usize]);
        let mut out = Vec::new();
        for part in &self.parts {
            let mut ring = part.clone();
            while ring.len() > 3 {
                let n = ring.len();
                let altitude = |k: usize| {
                    let [a, b, c] = [ring[(k + n - 1) % n], ring[k], ring[(k + 1) % n]].map(at);
                    let area = (b - a).cross(c - a).dot(plane.normal);
                    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                    let bare = (0..n - 3).all(|j| {
                        let d = at(ring[(k + 2 + j) % n]) - a;
                        let along = (c - a).normalize_or_zero();
                        (d - along * d.dot(along)).length() > plane.snap()
                    });
                    let altitude = area / longest.max(f64::MIN_POSITIVE);
                    if bare { altitude } else { altitude - 1e300 }
                };
                let best = (0..n)
                    .max_by(|&i, &j| altitude(i).total_cmp(&altitude(j)).then(j.cmp(&i)))
                    .unwrap_or(0);
                out.push([ring[(best + n - 1) % n], ring[best], ring[(best + 1) % n]]);
                ring.remove(best);
            }
            out.push([ring[0], ring[1], ring[2]]);
        }
        out
    }
}

/// The plane of a triangle, and the lengths below which points coincide or touch.
struct Plane {
    corners: [DVec3; 3],
    normal: DVec3,
    area: f64,
    touch: f64,
    hover: f64,
}

impl Plane {
    fn of(mesh: &Mesh, triangle: u32) -> Self {
        let face = Face {
            triangle,
            back: false,
        };
        Self {
            corners: mesh.corners(face),
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

/// All triangles that others meet, in parts; if `hovering`, also those before which something hovers.
pub fn cuts(mesh: &Mesh, rays: &RayIndex, hovering: bool) -> Vec<Cut> {
    let mut taking: Vec<u32> = mesh.faces.iter().map(|f| f.triangle).collect();
    taking.dedup();
    taking
        .par_iter()
        .map_init(Vec::new, |near, &triangle| {
            let plane = Plane::of(mesh, triangle);
            if (0..3).any(|k| plane.altitude(k) < 8.0 * plane.snap()) {
                return None;
            }
            let [a, b, c] = plane.corners;
            let reach = DVec3::splat(if hovering { plane.hover } else { plane.touch });
            let (low, high) = (a.min(b).min(c) - reach, a.max(b).max(c) + reach);
            rays.near(low.as_vec3(), high.as_vec3(), near);
            near.sort_unstable();
            let (mut segments, mut outlines) = (Vec::new(), Vec::new());
            for &other in near.iter() {
                let k = other as usize;
                if mesh.plane[k] == mesh.plane[triangle as usize] || mesh.area[k] <= 0.0 {
                    continue;
                }
                let corners = mesh.triangles[k].map(|v| mesh.positions[v as usize]);
                segments.extend(plane.met(corners));
                if hovering && outlines.len() <= MOST {
                    let vertices = mesh.triangles[k];
                    outlines.extend(plane.hovering(corners).into_iter().map(|(e, segment)| {
                        let edge = key(vertices[e], vertices[(e + 1) % 3]);
                        ((mesh.plane[k], edge), segment)
                    }));
                }
                if segments.len() > MOST {
                    return None;
                }
            }
            let mut cut = Cut::whole(triangle);
            for segment in segments {
                cut.split(&plane, segment);
            }
            // An edge of two triangles in one plane is not an outline.
            let is_once = |edge: &_| outlines.iter().filter(|(other, _)| other == edge).count() < 2;
            let outlines = outlines.iter().filter(|(edge, _)| is_once(edge));
            let cut = cut.outlined(&plane, outlines.map(|(_, segment)| *segment).collect());
            (cut.parts.len() > 1).then_some(cut)
        })
        .flatten()
        .collect()
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
            cut.fit(&plane);
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
