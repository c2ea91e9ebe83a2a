//! Where panes are: which of them a ray passes, at what angle, and through how much glass.
//!
//! Panes have a ray index of their own and block nothing. A ray asks for all their faces that it crosses; faces that bound one
//! sheet of glass count as one pane, however it was modelled:
//! - a face that stands alone is a pane;
//! - faces that lie upon each other (a quad and its back) are one;
//! - where a ray enters by a face and leaves by another, parallel and nearer than [`NEAR`] or of the same thin closed part, both are
//!   one pane;
//! - a closed part that is thicker is a solid where its material has a volume, and absorbs along the chord; without one it is hollow,
//!   and each of its walls is a pane.

use crate::geometry::{NO_PLANE, RayIndex, Segment};
use crate::scene::pane::{Pane, PaneKind, texel};
use crate::scene::sets::{join, root};
use crate::scene::{Scene, Surface};
use glam::{DVec3, Vec3};
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};

/// Faces of one pane are at most this far apart, m: laminated glass of banks and aquaria is 30 to 50 mm thick; the panes of double
/// glazing are as far apart, but each of these has both its faces.
const NEAR: f64 = 0.05;
/// Hits nearer to each other than this share of the panes' half size are in one place: a few roundings of f32.
const TOGETHER: f64 = 2e-6;
/// Least cosine between normals of parallel faces: 2.6 degrees.
const PARALLEL: f64 = 0.999;
/// A closed part thinner than this share of its size contains nothing: f32 positions are off by 1e-7 of that.
const HOLLOW: f64 = 1e-6;
/// Pairs of solids and parts that may be their cavities, at the most.
const MOST_PAIRS: usize = 1 << 22;

/// One pane that a ray passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Index of its material.
    pub material: u32,
    /// Cosine of incidence.
    pub cosine: f32,
    /// Thickness of a slab that absorbs as much, in units of the material.
    pub thickness: f32,
    /// Value of the pane's texture at the crossing.
    pub texel: f32,
}

/// A triangle of a pane.
#[derive(Debug, Clone, Copy)]
struct PaneFace {
    /// Index in [`Scene::panes`], and of the triangle there.
    surface: u32,
    triangle: u32,
    material: u32,
    /// The connected part that the triangle belongs to.
    part: u32,
    normal: DVec3,
}

/// A connected part of a pane's surface.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    closed: bool,
    /// For a closed part, volume over half its surface: the thickness of a flat one.
    thickness: f64,
    /// Do its faces look inwards? They do in a reversed solid, and in a cavity of a solid.
    inward: bool,
    /// Lower and upper corner of its bounding box.
    bounds: [DVec3; 2],
}

impl Part {
    fn holds(&self, other: &Self) -> bool {
        let [low, high] = self.bounds;
        self.closed && low.cmple(other.bounds[0]).all() && high.cmpge(other.bounds[1]).all()
    }
}

/// All panes of a room.
#[derive(Debug, Clone)]
pub struct Panes {
    rays: RayIndex,
    faces: Vec<PaneFace>,
    parts: Vec<Part>,
    /// For each part: is it a solid whose faces look inwards?
    reversed: Vec<bool>,
    /// Distance within which hits are in one place.
    together: f64,
}

/// The panes of a room with their materials.
#[derive(Debug, Clone, Copy)]
pub struct Glazing<'a> {
    /// Positions of the panes.
    pub panes: &'a Panes,
    /// Materials of the panes.
    pub scene: &'a Scene,
}

impl Glazing<'_> {
    /// The panes that the segment passes, in any order.
    pub fn crossings(&self, from: Vec3, to: Vec3) -> Vec<Crossing> {
        self.panes.crossings(self.scene, from, to)
    }
}

/// A face that a ray crosses.
#[derive(Debug, Clone, Copy)]
struct PaneHit {
    /// Distance from the start of the ray.
    at: f64,
    face: PaneFace,
    enters: bool,
    cosine: f64,
    texel: f64,
}

impl Panes {
    /// The panes of a scene, recentred like its mesh; none where there are none.
    pub fn new(scene: &Scene, centre: DVec3) -> Option<Self> {
        if scene.panes.is_empty() {
            return None;
        }
        let (mut faces, mut parts) = (Vec::new(), Vec::new());
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (number, surface) in scene.panes.iter().enumerate() {
            let first = positions.len() as u32;
            positions.extend(surface.positions.iter().map(|p| (*p - centre).as_vec3()));
            let of = parts_of(surface, &mut parts);
            for (k, (corners, part)) in surface.triangles.iter().zip(of).enumerate() {
                let [a, b, c] = corners.map(|i| surface.positions[i as usize]);
                triangles.push(corners.map(|i| first + i));
                faces.push(PaneFace {
                    surface: number as u32,
                    triangle: k as u32,
                    material: surface.material as u32,
                    part,
                    normal: (b - a).cross(c - a).normalize_or_zero(),
                });
            }
        }
        // All triangles are masked: so the index asks about every face that a ray crosses.
        let rays = RayIndex::build(&positions, &triangles, &[], &vec![true; triangles.len()]);
        let [low, high] = rays.bounds();
        let far = low.abs().max(high.abs()).max_element();
        let solids: Vec<&Part> = parts.iter().filter(|p| p.closed && !p.inward).collect();
        let inward = parts.iter().filter(|p| p.closed && p.inward).count();
        // With more pairs than that, cavities are not looked for.
        let few = inward * solids.len() <= MOST_PAIRS;
        let reversed = parts
            .iter()
            .map(|part| few && part.closed && part.inward && !solids.iter().any(|s| s.holds(part)));
        Some(Self {
            reversed: reversed.collect(),
            together: TOGETHER * f64::from(far),
            rays,
            faces,
            parts,
        })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.rays.bytes() + size_of_val(self.faces.as_slice()) + size_of_val(self.parts.as_slice())
    }

    fn crossings(&self, scene: &Scene, from: Vec3, to: Vec3) -> Vec<Crossing> {
        let met = RefCell::new(Vec::new());
        let segment = Segment {
            from,
            to,
            planes: [NO_PLANE; 2],
        };
        self.rays.occluded_with(&segment, &|triangle, u, v| {
            met.borrow_mut().push((triangle, u, v));
            false
        });
        let met = met.into_inner();
        if met.is_empty() {
            return Vec::new();
        }
        let (from, to) = (from.as_dvec3(), to.as_dvec3());
        let direction = (to - from).normalize_or_zero();
        let mut hits: Vec<PaneHit> = met
            .into_iter()
            .map(|(triangle, u, v)| self.hit(scene, from, direction, (triangle, u, v)))
            .collect();
        hits.sort_by(|a, b| {
            let key = |h: &PaneHit| (h.face.surface, h.face.triangle);
            a.at.total_cmp(&b.at).then(key(a).cmp(&key(b)))
        });
        self.panes_of(scene, &hits, from.distance(to))
    }

    fn hit(
        &self,
        scene: &Scene,
        from: DVec3,
        direction: DVec3,
        (triangle, u, v): (u32, f32, f32),
    ) -> PaneHit {
        let face = self.faces[triangle as usize];
        let weights = [1.0 - u - v, u, v];
        let corners = self.rays.triangle(triangle).unwrap_or_default();
        let point: Vec3 = corners.into_iter().zip(weights).map(|(c, w)| c * w).sum();
        let along = face.normal.dot(direction);
        let surface = &scene.panes[face.surface as usize];
        PaneHit {
            at: (point.as_dvec3() - from).dot(direction),
            face,
            enters: (along < 0.0) != self.reversed[face.part as usize],
            cosine: along.abs(),
            texel: texel_at(scene, surface, face.triangle, weights),
        }
    }

    /// Combines faces that bound one pane.
    fn panes_of(&self, scene: &Scene, hits: &[PaneHit], length: f64) -> Vec<Crossing> {
        let mut out = Vec::new();
        // Faces entered and not yet left; and the last face that was finished.
        let mut open: Vec<PaneHit> = Vec::new();
        let mut last: Option<PaneHit> = None;
        for hit in hits {
            let same = |other: &PaneHit| {
                other.face.material == hit.face.material
                    && other.face.normal.dot(hit.face.normal).abs() > PARALLEL
                    && (hit.at - other.at).abs() <= self.together
            };
            // An edge shared by two triangles, or a back that lies right on its front.
            let here = |o: &&PaneHit| hit.at - o.at <= self.together;
            let mut near = open.iter().rev().take_while(here);
            let again = near.any(|o| o.enters == hit.enters && same(o));
            if again || last.is_some_and(|last| same(&last)) {
                continue;
            }
            if hit.enters {
                open.push(*hit);
                continue;
            }
            last = Some(*hit);
            let entry = open.iter().rposition(|entry| self.bound(entry, hit));
            match entry.map(|k| open.remove(k)) {
                Some(entry) => self.between(scene, &entry, hit, &mut out),
                None => out.push(self.alone(scene, hit, hit.at)),
            }
        }
        out.extend(open.iter().map(|h| self.alone(scene, h, length - h.at)));
        out
    }

    /// Do two faces bound the same glass?
    fn bound(&self, entry: &PaneHit, exit: &PaneHit) -> bool {
        let [a, b] = [entry.face, exit.face];
        let near = (exit.at - entry.at) * entry.cosine <= NEAR && is_parallel(entry, exit);
        // A cavity counts as a part of its own.
        let one = [a, b].iter().all(|f| self.parts[f.part as usize].closed);
        a.material == b.material && (near || one)
    }

    /// The panes between two faces.
    fn between(&self, scene: &Scene, entry: &PaneHit, exit: &PaneHit, out: &mut Vec<Crossing>) {
        let Some(pane) = pane_of(scene, entry) else {
            return;
        };
        let chord = exit.at - entry.at;
        if chord <= self.together {
            // A face and its back in one place.
            return out.push(self.alone(scene, entry, 0.0));
        }
        let parallel = is_parallel(entry, exit);
        let thin = self.parts[entry.face.part as usize].thickness <= NEAR
            || parallel && chord * entry.cosine <= NEAR;
        match pane.kind {
            PaneKind::Glass {
                unit: Some(unit),
                ior,
                ..
            } => {
                let way = if parallel {
                    entry.cosine
                } else {
                    refracted(ior, entry.cosine)
                };
                out.push(entry.crossing(chord * way / unit));
            }
            PaneKind::Glass { thickness, .. } if thin => out.push(entry.crossing(thickness)),
            PaneKind::Cover { .. } if thin => out.push(entry.crossing(1.0)),
            _ => out.extend([entry, exit].map(|hit| self.alone(scene, hit, 0.0))),
        }
    }

    /// A single face; a ray that starts or ends within a solid passes `chord` of it.
    fn alone(&self, scene: &Scene, hit: &PaneHit, chord: f64) -> Crossing {
        let solid = self.parts[hit.face.part as usize].closed;
        match pane_of(scene, hit).map(|p| &p.kind) {
            Some(&PaneKind::Glass {
                unit: Some(unit),
                ior,
                ..
            }) if solid => hit.crossing(chord * refracted(ior, hit.cosine) / unit),
            Some(&PaneKind::Glass { thickness, .. }) => hit.crossing(thickness),
            _ => hit.crossing(1.0),
        }
    }
}

impl PaneHit {
    fn crossing(&self, thickness: f64) -> Crossing {
        Crossing {
            material: self.face.material,
            cosine: self.cosine as f32,
            thickness: thickness as f32,
            texel: self.texel as f32,
        }
    }
}

fn is_parallel(a: &PaneHit, b: &PaneHit) -> bool {
    a.face.normal.dot(b.face.normal).abs() > PARALLEL
}

/// Cosine of the refracted ray.
fn refracted(ior: f64, cosine: f64) -> f64 {
    (1.0 - (1.0 - cosine * cosine) / (ior * ior))
        .max(0.0)
        .sqrt()
}

fn pane_of<'a>(scene: &'a Scene, hit: &PaneHit) -> Option<&'a Pane> {
    scene.materials[hit.face.material as usize].pane.as_ref()
}

/// Value of a pane's texture; for paint, that of the vertex alpha.
fn texel_at(scene: &Scene, surface: &Surface, triangle: u32, weights: [f32; 3]) -> f64 {
    let Some(pane) = &scene.materials[surface.material].pane else {
        return 1.0;
    };
    let corners = surface.triangles[triangle as usize].map(|i| i as usize);
    let mut value = 1.0;
    if let Some(texture) = &pane.texture
        && let Some(uvs) = surface.texcoords.get(texture.texcoord)
    {
        let uv = std::array::from_fn(|c| (0..3).map(|k| uvs[corners[k]][c] * weights[k]).sum());
        value *= texel(pane, &scene.images, uv);
    }
    if let (PaneKind::Cover { .. }, Some(colors)) = (&pane.kind, &surface.colors) {
        let alpha: f32 = (0..3).map(|k| colors[corners[k]][3] * weights[k]).sum();
        value *= f64::from(alpha);
    }
    value
}

/// Adds the connected parts of a surface; returns the part of each triangle.
fn parts_of(surface: &Surface, parts: &mut Vec<Part>) -> Vec<u32> {
    // Vertices at equal positions are one: exporters split them where normals or texture coordinates differ.
    let mut welded: HashMap<[u64; 3], u32> = HashMap::new();
    let mut of_vertex = Vec::with_capacity(surface.positions.len());
    for p in &surface.positions {
        let next = welded.len() as u32;
        let key = (*p + DVec3::ZERO).to_array().map(f64::to_bits);
        of_vertex.push(*welded.entry(key).or_insert(next));
    }
    let mut above: Vec<u32> = (0..welded.len() as u32).collect();
    let triangles = || {
        let all = surface.triangles.iter();
        all.map(|t| t.map(|i| of_vertex[i as usize]))
    };
    for [a, b, c] in triangles() {
        for other in [b, c] {
            join(&mut above, a, other);
        }
    }
    let mut number: BTreeMap<u32, u32> = BTreeMap::new();
    // For each part: how much more often each edge is run along in one direction than in the other; volume and area.
    let mut edges: BTreeMap<(u32, u32, u32), i64> = BTreeMap::new();
    let first = parts.len() as u32;
    let mut sums: Vec<[f64; 2]> = Vec::new();
    let mut bounds: Vec<[DVec3; 2]> = Vec::new();
    let origin = surface.positions.first().copied().unwrap_or_default();
    let mut of = Vec::with_capacity(surface.triangles.len());
    for (corners, triangle) in triangles().zip(&surface.triangles) {
        let next = first + number.len() as u32;
        let part = *number.entry(root(&mut above, corners[0])).or_insert(next);
        of.push(part);
        sums.resize(number.len(), [0.0; 2]);
        bounds.resize(number.len(), [DVec3::INFINITY, DVec3::NEG_INFINITY]);
        let [low, high] = &mut bounds[(part - first) as usize];
        for i in triangle {
            let p = surface.positions[*i as usize];
            (*low, *high) = (low.min(p), high.max(p));
        }
        let [a, b, c] = triangle.map(|i| surface.positions[i as usize] - origin);
        let sum = &mut sums[(part - first) as usize];
        sum[0] += a.dot(b.cross(c)) / 6.0;
        sum[1] += 0.5 * (b - a).cross(c - a).length();
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            *edges.entry((part, a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    let mut closed = vec![true; sums.len()];
    for ((part, ..), balance) in edges {
        closed[(part - first) as usize] &= balance == 0;
    }
    let each = sums.iter().zip(closed).zip(bounds);
    parts.extend(each.map(|((&[volume, area], balanced), bounds)| {
        let thickness = 2.0 * volume.abs() / area;
        // A face and its back also balance, but contain nothing.
        let closed = balanced && thickness > HOLLOW * area.sqrt();
        Part {
            closed,
            thickness: if closed { thickness } else { f64::INFINITY },
            inward: volume < 0.0,
            bounds,
        }
    }));
    of
}
