//! The triangles of the output: input triangles, bisected at edges that they share, in the middle or where the edge of a
//! shadow crosses.
//!
//! An edge is split for all triangles that have it, so a vertex never lies on the edge of a triangle that does not use
//! it. For which triangles share an edge, see [`Skins`](super::skins::Skins).

use super::divided::{Divided, MeshTriangle, barycentric, between};
use super::missed::missed_by_halves;
use super::skins::Skins;
use crate::gather::Vertex;
use crate::hierarchy::{Mesh, NONE, Tree};
use crate::scene::{Scene, Sides, Surface};
use glam::DVec3;
use std::collections::HashMap;

/// Edges shorter than this share of a triangle's longest are split only together with the longest: strips may stay strips,
/// needles must not arise.
const SLENDER: f64 = 0.25;

/// An edge of the input on which something stands is treated like the edge of the shadow of a lamp that lights no place;
/// each side has its own light.
pub(super) const FENCE: u64 = 1 << 62;

/// In place of the way along an edge: what is looked at in a covered cell tells nothing of a bare neighbour.
const COVERED: u8 = 3;

/// A corner of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub(super) point: u32,
    /// Index in the sheet's vertices.
    pub(super) vertex: u32,
    /// Weights of the corners of the cell's triangle of the mesh; outside of it if cells were turned, see [`Divided`].
    pub(super) weights: [f64; 3],
}

/// What two points bound.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    pub(super) ends: [u32; 2],
    pub(super) length: f64,
    pub(super) marked: bool,
    /// Where the edge is to be split, from the first end on, if the edge of a shadow crosses it.
    pub(super) crossed: Option<f64>,
    /// Lamps whose light ends along the edge, one bit each.
    pub(super) sharp: u64,
    /// Once the edge is split: the point there, and both halves.
    pub(super) split: Option<(u32, [u32; 2])>,
}

/// A place where the edge of a shadow bends or ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ShadowEnd {
    Point(u32),
    /// Where this edge is to be split.
    Crossing(u32),
}

/// How far the light in a triangle is from that between its corners.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CellError {
    /// Mean square of the colour difference, as far as known.
    pub(super) square: f64,
    /// Was light looked at here, or is the difference only expected?
    pub(super) tested: bool,
    /// Colour difference in the middle of each edge, if tested.
    pub(super) bent: [f32; 3],
    /// Colour difference at a point inside, if tested.
    pub(super) inside: f32,
    /// Share of the differences told by the solved light that proved true in the triangle around this one.
    pub(super) trust: f32,
    /// Illuminance that lines miss in the middle of each edge, lx: as seen, or as derived for parts of a triangle that was looked at;
    /// none where unknown.
    pub(super) missed: [Option<f32>; 3],
}

/// A triangle of the output.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub(super) sheet: u32,
    /// Triangle of the mesh, and its entry in the hierarchy: the cell lies in it, or in parts that belong together with it.
    pub(super) of: MeshTriangle,
    /// Does something cover the entry?
    pub(super) covered: bool,
    pub(super) corners: [Corner; 3],
    /// Edge k leads from corner k to the next.
    pub(super) edges: [u32; 3],
    pub(super) area: f64,
    /// Share of the area that counts, see `hierarchy::counted`.
    pub(super) counts: f64,
    /// The range of the sheet's hints that lie in the triangle.
    pub(super) hints: (u32, u32),
    pub(super) doubt: CellError,
}

/// The solved light at a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hint {
    /// Weights of the second and third corner of the triangle of the mesh.
    pub(super) at: [f64; 2],
    pub(super) area: f64,
    /// Share of the area that counts.
    pub(super) counts: f64,
    /// Share of the area that others see, see `solve::leaf_rays`.
    pub(super) open: f64,
    /// Tristimulus irradiance.
    pub(super) light: [f64; 3],
}

/// One side of one surface.
#[derive(Debug, Default)]
pub(super) struct SurfaceSide {
    pub(super) surface: usize,
    pub(super) back: bool,
    pub(super) vertices: Vec<Vertex>,
    pub(super) hints: Vec<Hint>,
    /// Vertex between two: in their middle (0), or at this share from the first to the second. Along an edge on which
    /// something stands, also by the direction in which the triangle runs along it.
    between: HashMap<(u32, u32, u64, u8), u32>,
    /// Vertices on the edge of a shadow: the vertex before its light was divided, the lamps whose light ends there, those of them that
    /// light its side, and whether that side is covered.
    pub(super) sides: HashMap<(u32, u64, u64, bool), u32>,
    pub(super) base: HashMap<u32, u32>,
    /// Vertices on edges on which something stands: the vertex from which each was divided.
    pub(super) parted: HashMap<u32, u32>,
    /// Places where the light of such vertices is looked at.
    pub(super) beside: HashMap<u32, Vertex>,
}

/// All triangles.
#[derive(Debug)]
pub(super) struct Cells {
    pub(super) sheets: Vec<SurfaceSide>,
    pub(super) divided: Divided,
    pub(super) all: Vec<Cell>,
    pub(super) edges: Vec<Edge>,
    pub(super) points: Vec<DVec3>,
    /// Points on edges of shadows, and lamps whose light ends there.
    pub(super) sharp: HashMap<u32, u64>,
    /// Of these points, those that are new.
    pub(super) sharpened: Vec<u32>,
    /// Edges of shadows that are to become edges of triangles at the next split.
    pub(super) lines: Vec<([ShadowEnd; 2], u64)>,
    pub(super) along: HashMap<(u32, u32), u64>,
    /// Triangles made by points put inside others.
    pub(super) starred: Vec<usize>,
}

/// What the first cells are made from.
struct Start<'a> {
    mesh: &'a Mesh,
    tree: &'a Tree,
    spaces: &'a [(u32, bool)],
    skins: Skins,
    /// Edges by skin and ends.
    edges: HashMap<(u32, u32, u32), u32>,
}

impl Start<'_> {
    fn entry(&self, triangle: u32, back: bool) -> u32 {
        self.tree.entry[triangle as usize][usize::from(back)]
    }

    fn space(&self, triangle: u32, back: bool) -> (u32, bool) {
        let entry = self.entry(triangle, back);
        self.spaces.get(entry as usize).copied().unwrap_or_default()
    }
}

pub(super) fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

impl Cells {
    /// Starts from the triangles of the mesh. `spaces` holds the space of each entry and whether something covers it.
    pub(super) fn new(scene: &Scene, mesh: &Mesh, tree: &Tree, spaces: &[(u32, bool)]) -> Self {
        let mut start = Start {
            mesh,
            tree,
            spaces,
            skins: Skins::new(scene, mesh),
            edges: HashMap::new(),
        };
        let mut cells = Self {
            sheets: Vec::new(),
            divided: Divided::new(mesh, tree, spaces),
            all: Vec::new(),
            edges: Vec::new(),
            points: mesh.positions.clone(),
            sharp: HashMap::new(),
            sharpened: Vec::new(),
            lines: Vec::new(),
            along: HashMap::new(),
            starred: Vec::new(),
        };
        for (number, surface) in scene.surfaces.iter().enumerate() {
            cells.add(&mut start, number, surface, false);
            if scene.sides(number) == Sides::Both {
                cells.add(&mut start, number, surface, true);
            }
        }
        cells
    }

    /// Adds a side of a surface. Vertices are those of the input; they are not shared across planes where a surface has no
    /// normals of its own, nor by faces of different spaces; where a covered face meets a bare one the vertex belongs to the
    /// bare one.
    fn add(&mut self, start: &mut Start, number: usize, surface: &Surface, back: bool) {
        let (mesh, number_of_sheet) = (start.mesh, self.sheets.len() as u32);
        let mut sheet = SurfaceSide {
            surface: number,
            back,
            ..SurfaceSide::default()
        };
        let mut known: HashMap<(u64, u32, u32), u32> = HashMap::new();
        let all = mesh.first_triangle[number]..mesh.first_triangle[number + 1];
        let (covered, bare): (Vec<u32>, Vec<u32>) = all.partition(|&t| start.space(t, back).1);
        for triangle in bare.into_iter().chain(covered) {
            let entry = start.entry(triangle, back);
            let (space, covered) = start.space(triangle, back);
            let local = mesh.origin[triangle as usize].1 as usize;
            let group = match surface.normals {
                Some(_) => u32::MAX,
                None => mesh.plane[triangle as usize],
            };
            let mut corners = [0, 1, 2].map(|k| {
                let point = mesh.triangles[triangle as usize][k];
                let mut weights = [0.0; 3];
                weights[k] = 1.0;
                let name = match mesh.input_corner(triangle as usize, k) {
                    Some(corner) => u64::from(surface.triangles[local][corner]),
                    // A point where triangles were cut belongs to its input triangle alone: attributes may differ
                    // across it.
                    None => u64::from(local as u32 + 1) << 32 | u64::from(point),
                };
                let vertex = *known.entry((name, group, space)).or_insert_with(|| {
                    sheet.vertices.push(Vertex {
                        triangle,
                        weights,
                        entry,
                    });
                    sheet.vertices.len() as u32 - 1
                });
                Corner {
                    point,
                    vertex,
                    weights,
                }
            });
            if back {
                corners.swap(1, 2);
            }
            let skin = start.skins.of(triangle, back);
            let edges = [0, 1, 2].map(|k| {
                let (a, b) = key(corners[k].point, corners[(k + 1) % 3].point);
                let known = start.edges.entry((skin, a, b));
                let edge = *known.or_insert_with(|| self.edge(a, b));
                let mut ends = [k, (k + 1) % 3].map(|k| corners[k]);
                ends.sort_by_key(|corner| corner.point);
                let weights = ends.map(|corner| corner.weights);
                self.divided.span(edge, (triangle, entry), weights);
                edge
            });
            self.all.push(Cell {
                sheet: number_of_sheet,
                of: (triangle, entry),
                covered,
                corners,
                edges,
                area: mesh.area[triangle as usize],
                counts: 1.0,
                hints: (0, 0),
                doubt: CellError::default(),
            });
        }
        self.sheets.push(sheet);
    }

    pub(super) fn edge(&mut self, a: u32, b: u32) -> u32 {
        let length = self.points[a as usize].distance(self.points[b as usize]);
        self.edges.push(Edge {
            ends: [a, b],
            length,
            marked: false,
            crossed: None,
            sharp: 0,
            split: None,
        });
        self.edges.len() as u32 - 1
    }

    fn length(&self, cell: &Cell, k: usize) -> f64 {
        self.edges[cell.edges[k] as usize].length
    }

    /// Which edge of a cell is its longest?
    pub(super) fn longest(&self, cell: &Cell) -> usize {
        let longer = |best: usize, k: usize| match self.length(cell, k) > self.length(cell, best) {
            true => k,
            false => best,
        };
        longer(longer(0, 1), 2)
    }

    /// Length of the longest edge of a cell.
    pub(super) fn size(&self, cell: &Cell) -> f64 {
        self.length(cell, self.longest(cell))
    }

    /// Vertex in the middle of an edge of a cell, made if need be: a place to look at light; nothing is split.
    pub(super) fn middle(&mut self, cell: usize, k: usize) -> u32 {
        let Cell {
            sheet, of, corners, ..
        } = self.all[cell];
        let middle = self.on_edge(cell, k, 0.5);
        if self.sharp_along(&self.all[cell], k) != 0 {
            let around = [0, 1, 2].map(|e| corners[(k + e) % 3]);
            self.sheets[sheet as usize].beside_line(&self.divided, middle, of, around);
        }
        middle
    }

    /// Vertex on an edge of a cell, made if need be: at share `at` of the way between the ends of the edge, in its sense.
    fn on_edge(&mut self, cell: usize, k: usize, at: f64) -> u32 {
        let way = self.way_along(&self.all[cell], k);
        let Cell {
            sheet,
            of,
            corners,
            edges,
            ..
        } = self.all[cell];
        let edge = edges[k];
        let [mut a, mut b] = [corners[k], corners[(k + 1) % 3]];
        if self.edges[edge as usize].ends[0] != a.point {
            (a, b) = (b, a);
        }
        let (of, [from, to]) = self.divided.span(edge, of, [a.weights, b.weights]);
        let SurfaceSide {
            vertices,
            between: known,
            ..
        } = &mut self.sheets[sheet as usize];
        let name = match at == 0.5 {
            true => (a.vertex.min(b.vertex), a.vertex.max(b.vertex), 0, way),
            false => (a.vertex, b.vertex, at.to_bits(), way),
        };
        *known.entry(name).or_insert_with(|| {
            vertices.push(self.divided.place(of, between(from, to, at)));
            vertices.len() as u32 - 1
        })
    }

    /// Vertex in the middle of an edge of a cell, if it exists.
    pub(super) fn known_middle(&self, cell: &Cell, k: usize) -> Option<u32> {
        let [a, b] = [k, (k + 1) % 3].map(|k| cell.corners[k].vertex);
        let known = &self.sheets[cell.sheet as usize].between;
        known
            .get(&(a.min(b), a.max(b), 0, self.way_along(cell, k)))
            .copied()
    }

    /// Direction in which a cell runs along an edge on which something stands; 0 along all other edges, whose sides share vertices
    /// if both are covered or both bare.
    fn way_along(&self, cell: &Cell, k: usize) -> u8 {
        let edge = &self.edges[cell.edges[k] as usize];
        match edge.sharp & FENCE {
            _ if cell.covered => COVERED,
            0 => 0,
            _ if edge.ends[0] == cell.corners[k].point => 1,
            _ => 2,
        }
    }

    /// Marks an edge of a cell to be split.
    pub(super) fn mark(&mut self, cell: usize, k: usize) {
        let edge = self.all[cell].edges[k];
        self.edges[edge as usize].marked = true;
    }

    /// Splits the marked edges, and the triangles that have them; returns the new triangles. `shrink` is the share of
    /// an expected mean square that remains after a bisection.
    pub(super) fn split(&mut self, shrink: f64) -> Vec<usize> {
        self.close();
        for k in 0..self.edges.len() {
            let Edge {
                ends: [a, b],
                marked,
                crossed,
                sharp,
                split,
                ..
            } = self.edges[k];
            if marked && split.is_none() {
                let point = self.points.len() as u32;
                let at = crossed.unwrap_or(0.5);
                let (from, to) = (self.points[a as usize], self.points[b as usize]);
                self.points.push((1.0 - at) * from + at * to);
                let halves = [self.edge(a, point), self.edge(point, b)];
                for half in halves {
                    self.edges[half as usize].sharp = sharp;
                }
                if sharp != 0 {
                    self.sharp.insert(point, sharp);
                }
                self.edges[k].split = Some((point, halves));
            }
        }
        self.draw_lines();
        let mut fresh = std::mem::take(&mut self.starred);
        let mut k = 0;
        // Halves that still have a split edge come up again: new ones at the end, others right here.
        while k < self.all.len() {
            if let Some(edge) = self.to_bisect(&self.all[k]) {
                self.bisect(k, edge, shrink);
                if fresh.last() != Some(&k) {
                    fresh.push(k);
                }
                fresh.push(self.all.len() - 1);
            } else {
                k += 1;
            }
        }
        self.turn_needles(&mut fresh);
        fresh
    }

    /// Marks the longest edges of triangles that would become slivers.
    fn close(&mut self) {
        loop {
            let mut any = false;
            for k in 0..self.all.len() {
                let cell = &self.all[k];
                let longest = self.longest(cell);
                let limit = SLENDER * self.length(cell, longest);
                let edge = |k: usize| &self.edges[cell.edges[k] as usize];
                // Where the edge of a shadow crosses an edge, that must be split there, even alone.
                let slender = |k: usize| {
                    let edge = edge(k);
                    edge.marked && edge.crossed.is_none() && edge.length < limit
                };
                if !edge(longest).marked && (0..3).any(slender) {
                    self.mark(k, longest);
                    any = true;
                }
            }
            if !any {
                return;
            }
        }
    }

    /// The longest split edge of a cell; edges crossed by the edge of a shadow come first, so that this becomes an edge of
    /// triangles.
    fn to_bisect(&self, cell: &Cell) -> Option<usize> {
        let edge = |k: usize| &self.edges[cell.edges[k] as usize];
        let rank = |k: usize| (edge(k).crossed.is_some(), edge(k).length);
        let split = (0..3).filter(|&k| edge(k).split.is_some());
        split.reduce(|best, k| match rank(k) > rank(best) {
            true => k,
            false => best,
        })
    }

    /// Bisects a cell at a split edge: one half takes its place, the other is appended.
    fn bisect(&mut self, k: usize, edge: usize, shrink: f64) {
        let whole = self.all[k];
        let Cell {
            sheet,
            of,
            corners,
            edges,
            hints,
            doubt,
            ..
        } = whole;
        let [a, b, c] = [0, 1, 2].map(|k| corners[(edge + k) % 3]);
        let [ab, bc, ca] = [0, 1, 2].map(|k| edges[(edge + k) % 3]);
        let Edge {
            ends,
            split,
            crossed,
            ..
        } = self.edges[ab as usize];
        let Some((point, mut halves)) = split else {
            return;
        };
        let at = crossed.unwrap_or(0.5);
        let vertex = self.on_edge(k, edge, at);
        self.divided.halve(ab, of, at, halves);
        let (from, to, of_a) = match ends[0] == a.point {
            true => (a, b, at),
            false => {
                halves.swap(0, 1);
                (b, a, 1.0 - at)
            }
        };
        let m = Corner {
            point,
            vertex,
            weights: between(from.weights, to.weights, at),
        };
        let mc = self.edge(point, c.point);
        let sharp = self.along.get(&key(point, c.point));
        self.edges[mc as usize].sharp = sharp.copied().unwrap_or(0);
        let border = self.sheets[sheet as usize].part(hints, m, c, a);
        let own = [0, 1, 2].map(|k| doubt.missed[(edge + k) % 3]);
        // Where lines miss the edge of a shadow, nothing follows for the halves.
        let missed = match crossed {
            None => missed_by_halves(own, of_a as f32),
            Some(_) => [[None; 3]; 2],
        };
        let half = |corners, edges, share: f64, hints, missed| Cell {
            corners,
            edges,
            area: share * whole.area,
            hints,
            doubt: CellError {
                square: shrink * doubt.square,
                trust: doubt.trust,
                missed,
                ..CellError::default()
            },
            ..whole
        };
        let first = half(
            [a, m, c],
            [halves[0], mc, ca],
            of_a,
            (hints.0, border),
            missed[0],
        );
        let rest = (border, hints.1);
        self.all[k] = first;
        self.all.push(half(
            [m, b, c],
            [halves[1], bc, mc],
            1.0 - of_a,
            rest,
            missed[1],
        ));
        self.count(k);
        self.count(self.all.len() - 1);
    }

    /// The triangles of each sheet.
    pub(super) fn triangles(&self) -> Vec<Triangles> {
        let mut sheets = vec![(Vec::new(), Vec::new()); self.sheets.len()];
        for cell in &self.all {
            let (triangles, of) = &mut sheets[cell.sheet as usize];
            triangles.push(cell.corners.map(|corner| corner.vertex));
            of.push(cell.of.0);
        }
        sheets
    }
}

/// Triangles of a sheet by their vertices, each with a triangle of the mesh that it lies in, at least in part.
pub(super) type Triangles = (Vec<[u32; 3]>, Vec<u32>);

/// Weights of the corners of a cell at a place of its triangle of the mesh.
pub(super) fn within(corners: &[Corner; 3], at: [f64; 2]) -> [f64; 3] {
    barycentric(corners.map(|c| [c.weights[1], c.weights[2]]), at)
}

impl Cell {
    /// Weights of the corners of the triangle of the mesh, from weights of the cell's own corners.
    pub(super) fn at(&self, weights: [f64; 3]) -> [f64; 3] {
        let corner = |k: usize, j: usize| self.corners[k].weights[j] * weights[k];
        std::array::from_fn(|j| corner(0, j) + corner(1, j) + corner(2, j))
    }

    /// Area that counts.
    pub(super) fn counted(&self) -> f64 {
        self.area * self.counts
    }

    /// Counted area that a look at a corner, in the middle of an edge or inside stands for.
    pub(super) fn per_look(&self) -> f64 {
        self.counted() / 3.0
    }

    /// Does the cell belong to a face of the hierarchy, and has it any area?
    pub(super) fn is_face(&self) -> bool {
        self.of.1 != NONE && self.area > 0.0
    }
}
