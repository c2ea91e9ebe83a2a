//! Charts: pieces of a side of a surface that lie flat in the plane, in the file's units, turned to fit a small rectangle.

use super::finder::Finder;
use super::regions::{Region, RegionInput};
use super::unwrap::{Flat, Unwrap};
use crate::gather::Vertex;
use crate::hierarchy::{Mesh, Tree};
use crate::scene::{Scene, Sides};
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, HashMap};

/// Directions of edges that are tried for the smallest rectangle.
const DIRECTIONS: usize = 64;

/// A triangle of a chart.
#[derive(Debug, Clone)]
pub(super) struct Facet {
    /// Triangle of the mesh, and its entry in the hierarchy.
    pub(super) triangle: u32,
    pub(super) entry: u32,
    /// Vertices of the chart, counter-clockwise seen from the side.
    pub(super) corners: [u32; 3],
}

/// A piece of a side of a surface.
#[derive(Debug)]
pub(super) struct Chart {
    pub(super) surface: usize,
    pub(super) back: bool,
    pub(super) facets: Vec<Facet>,
    /// The same triangles in the plane, corners in the same order.
    pub(super) flat: Vec<[DVec2; 3]>,
    pub(super) vertices: Vec<Vertex>,
    /// Points of the welded mesh, and where they lie in the plane.
    pub(super) points: Vec<(u32, DVec2)>,
    /// The chart lies in [0, `size`].
    pub(super) size: DVec2,
    pub(super) area: f64,
    pub(super) finder: Finder,
}

impl Chart {
    /// The vertex at weights of a facet's corners.
    pub(super) fn vertex(&self, facet: u32, weights: [f64; 3]) -> Vertex {
        let of = &self.facets[facet as usize];
        Vertex {
            triangle: of.triangle,
            weights: if self.back {
                [weights[0], weights[2], weights[1]]
            } else {
                weights
            },
            entry: of.entry,
        }
    }

    /// A corner of a facet, as a vertex of its own triangle.
    pub(super) fn corner(&self, facet: &Facet, k: usize) -> Vertex {
        let mut weights = [0.0; 3];
        weights[turned([0, 1, 2], self.back)[k] as usize] = 1.0;
        Vertex {
            triangle: facet.triangle,
            weights,
            entry: facet.entry,
        }
    }

    /// Place in the plane of weights of the corners of a triangle of the mesh.
    pub(super) fn at(&self, facet: u32, [u, v, w]: [f64; 3]) -> DVec2 {
        let [a, b, c] = self.flat[facet as usize];
        let (v, w) = if self.back { (w, v) } else { (v, w) };
        a * u + b * v + c * w
    }
}

/// Cuts all sides of all surfaces into charts.
pub(super) fn charts(
    scene: &Scene,
    mesh: &Mesh,
    tree: &Tree,
    spaces: &[(u32, bool)],
    unwrap: &dyn Unwrap,
) -> Vec<Chart> {
    let mut out = Vec::new();
    for (number, surface) in scene.surfaces.iter().enumerate() {
        let both = scene.sides(number) == Sides::Both;
        for back in [false, true].into_iter().filter(|back| both || !back) {
            let side = RegionInput {
                mesh,
                tree,
                spaces,
                surface,
                number,
                back,
            };
            for region in side.regions() {
                curved(&side, &region, unwrap, &mut out);
            }
        }
    }
    out
}

/// The charts of a region: one if it is flat.
fn curved(side: &RegionInput, region: &Region, unwrap: &dyn Unwrap, out: &mut Vec<Chart>) {
    if region.flat {
        out.push(chart(side, &region.triangles, &plane(side, region)));
        return;
    }
    let mut local: HashMap<u32, u32> = HashMap::new();
    let mut positions = Vec::new();
    let mut number = |p: u32| {
        *local.entry(p).or_insert_with(|| {
            positions.push(side.mesh.positions[p as usize]);
            positions.len() as u32 - 1
        })
    };
    let triangles: Vec<[u32; 3]> = (region.triangles.iter())
        .map(|t| turned(side.mesh.triangles[*t as usize], side.back).map(&mut number))
        .collect();
    let flat = unwrap.flatten(&positions, &triangles).unwrap_or_default();
    let mut parts: BTreeMap<u32, (Vec<u32>, Vec<[DVec2; 3]>)> = BTreeMap::new();
    let mut left = Vec::new();
    for (k, &t) in region.triangles.iter().enumerate() {
        match flat.get(k) {
            Some(Some::<Flat>((part, corners))) => {
                let part = parts.entry(*part).or_default();
                part.0.push(t);
                part.1.push(*corners);
            }
            _ => left.push(t),
        }
    }
    for (triangles, corners) in parts.into_values() {
        out.push(chart(side, &triangles, &corners));
    }
    let left = Region {
        triangles: left,
        flat: false,
    };
    for region in side.planes(&left) {
        out.push(chart(side, &region.triangles, &plane(side, &region)));
    }
}

fn turned([a, b, c]: [u32; 3], back: bool) -> [u32; 3] {
    if back { [a, c, b] } else { [a, b, c] }
}

/// Corners of the triangles of a flat region, in its plane.
fn plane(side: &RegionInput, region: &Region) -> Vec<[DVec2; 3]> {
    let mesh = side.mesh;
    // The largest triangle knows its normal best.
    let area = |t: &&u32| mesh.area[**t as usize];
    let largest = (region.triangles.iter()).max_by(|a, b| area(a).total_cmp(&area(b)));
    let normal = largest.map_or(DVec3::Z, |t| mesh.normal[*t as usize]);
    let normal = if side.back { -normal } else { normal };
    let right = normal.any_orthonormal_vector();
    let up = normal.cross(right);
    let origin = largest.map_or(DVec3::ZERO, |t| mesh.at(*t as usize, [1.0, 0.0, 0.0]));
    let corners = |t: &u32| {
        turned(mesh.triangles[*t as usize], side.back).map(|p| {
            let p = mesh.positions[p as usize] - origin;
            DVec2::new(p.dot(right), p.dot(up))
        })
    };
    region.triangles.iter().map(corners).collect()
}

/// The turn (cosine, sine) along an edge that gives the smallest rectangle, wider than high.
fn best_turn(flat: &[[DVec2; 3]]) -> DVec2 {
    let edges = flat
        .iter()
        .flat_map(|[a, b, c]| [*b - *a, *c - *b, *a - *c]);
    let mut edges: Vec<DVec2> = edges.collect();
    edges.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
    let mut best = (f64::INFINITY, DVec2::X);
    for edge in edges.into_iter().take(DIRECTIONS) {
        let Some(along) = edge.try_normalize() else {
            continue;
        };
        let size = extent(flat, along);
        let area = size.x * size.y;
        if area < best.0 * (1.0 - 1e-9) {
            best = (
                area,
                if size.x >= size.y {
                    along
                } else {
                    along.perp()
                },
            );
        }
    }
    best.1
}

/// Turned so that `along` is the first axis.
fn turn(at: DVec2, along: DVec2) -> DVec2 {
    DVec2::new(at.dot(along), along.perp_dot(at))
}

fn extent(flat: &[[DVec2; 3]], along: DVec2) -> DVec2 {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for at in flat.as_flattened() {
        let at = turn(*at, along);
        (low, high) = (low.min(at), high.max(at));
    }
    high - low
}

/// A chart of triangles whose corners in the plane are known.
fn chart(side: &RegionInput, triangles: &[u32], corners: &[[DVec2; 3]]) -> Chart {
    let (mesh, surface) = (side.mesh, side.surface);
    let along = best_turn(corners);
    let mut flat: Vec<[DVec2; 3]> = corners
        .iter()
        .map(|c| c.map(|at| turn(at, along)))
        .collect();
    let low = (flat.iter().flatten()).fold(DVec2::INFINITY, |l, at| l.min(*at));
    flat.iter_mut().flatten().for_each(|at| *at -= low);
    let size = (flat.iter().flatten()).fold(DVec2::ZERO, |h, at| h.max(*at));
    let (mut vertices, mut points, mut facets) = (Vec::new(), Vec::new(), Vec::new());
    let mut known: HashMap<(u64, [u64; 2]), u32> = HashMap::new();
    for (&triangle, (flat, before)) in triangles.iter().zip(flat.iter().zip(corners)) {
        let entry = side.entry(triangle);
        let local = mesh.origin[triangle as usize].1;
        let order = turned([0, 1, 2], side.back);
        let corners = [0, 1, 2].map(|k| {
            let corner = order[k] as usize;
            let point = mesh.triangles[triangle as usize][corner];
            // As in the mesh of vertices: a point where triangles were cut belongs to its input triangle alone.
            let name = match mesh.input_corner(triangle as usize, corner) {
                Some(corner) => u64::from(surface.triangles[local as usize][corner]),
                None => u64::from(local + 1) << 32 | u64::from(point),
            };
            let place = before[k].to_array().map(f64::to_bits);
            *known.entry((name, place)).or_insert_with(|| {
                let mut weights = [0.0; 3];
                weights[corner] = 1.0;
                vertices.push(Vertex {
                    triangle,
                    weights,
                    entry,
                });
                points.push((point, flat[k]));
                vertices.len() as u32 - 1
            })
        });
        facets.push(Facet {
            triangle,
            entry,
            corners,
        });
    }
    Chart {
        surface: side.number,
        back: side.back,
        area: triangles.iter().map(|t| mesh.area[*t as usize]).sum(),
        finder: Finder::new(&flat, size),
        facets,
        flat,
        vertices,
        points,
        size,
    }
}
