//! The triangles of the output: input triangles, bisected at the middles of edges that they share.
//!
//! An edge that is split is split for every triangle that has it, so a vertex never lies on the edge of a triangle that
//! does not use it. Which triangles share an edge, see [`Skins`](super::skins::Skins).

use super::skins::Skins;
use crate::gather::Vertex;
use crate::hierarchy::{Mesh, NONE, Tree};
use crate::scene::{Scene, Sides, Surface};
use glam::DVec3;
use std::collections::HashMap;

/// Edges shorter than this share of a triangle's longest are split only together with the longest: strips may stay strips,
/// needles may not turn up.
const SLENDER: f64 = 0.25;

/// A corner of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    point: u32,
    /// Index in the sheet's vertices.
    pub(super) vertex: u32,
    /// Weights of the corners of the triangle of the mesh.
    pub(super) weights: [f64; 3],
}

/// What two points bound.
#[derive(Debug, Clone, Copy)]
struct Edge {
    ends: [u32; 2],
    length: f64,
    marked: bool,
    /// Once it is split: the point in its middle, and both halves.
    split: Option<(u32, [u32; 2])>,
}

/// How far light in a triangle is from what its corners say.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Doubt {
    /// Mean square of the colour difference, as far as it is known.
    pub(super) square: f64,
    /// Was it looked at, or is it only expected?
    pub(super) tested: bool,
    /// Colour difference in the middle of each edge, if tested.
    pub(super) bent: [f32; 3],
    /// And inside.
    pub(super) inside: f32,
    /// How much of what the solved light told of the triangle around this one proved true.
    pub(super) trust: f32,
}

/// A triangle of the output.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    pub(super) sheet: u32,
    /// Triangle of the mesh, and its entry in the hierarchy.
    pub(super) of: (u32, u32),
    pub(super) corners: [Corner; 3],
    /// Edge k leads from corner k to the next.
    edges: [u32; 3],
    pub(super) area: f64,
    /// Which of the sheet's hints lie in it.
    pub(super) hints: (u32, u32),
    pub(super) doubt: Doubt,
}

/// What the solved light says at a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hint {
    /// Weights of the second and third corner of the triangle of the mesh.
    pub(super) at: [f64; 2],
    pub(super) area: f64,
    /// What of it others see, see `solve::outlook`.
    pub(super) open: f64,
    /// Tristimulus irradiance.
    pub(super) light: [f64; 3],
}

/// One side of one surface.
#[derive(Debug, Default)]
pub(super) struct Sheet {
    pub(super) surface: usize,
    pub(super) back: bool,
    pub(super) vertices: Vec<Vertex>,
    pub(super) hints: Vec<Hint>,
    /// Vertex in the middle of two.
    middle: HashMap<(u32, u32), u32>,
}

/// All triangles.
#[derive(Debug)]
pub(super) struct Cells {
    pub(super) sheets: Vec<Sheet>,
    pub(super) all: Vec<Cell>,
    edges: Vec<Edge>,
    points: Vec<DVec3>,
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

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

fn halfway(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| 0.5 * (a[k] + b[k]))
}

impl Cells {
    /// Starts with the triangles of the mesh. `spaces` holds the space of each entry and whether something covers it.
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
            all: Vec::new(),
            edges: Vec::new(),
            points: mesh.positions.clone(),
        };
        for (number, surface) in scene.surfaces.iter().enumerate() {
            cells.add(&mut start, number, surface, false);
            if scene.materials[surface.material].sides == Sides::Both {
                cells.add(&mut start, number, surface, true);
            }
        }
        cells
    }

    /// Adds a side of a surface. Vertices are those of the input, not shared across planes where a surface has no normals of
    /// its own, nor by faces of different spaces; where a covered face meets a bare one it is the bare one's.
    fn add(&mut self, start: &mut Start, number: usize, surface: &Surface, back: bool) {
        let (mesh, number_of_sheet) = (start.mesh, self.sheets.len() as u32);
        let mut sheet = Sheet {
            surface: number,
            back,
            ..Sheet::default()
        };
        let mut known: HashMap<(u64, u32, u32), u32> = HashMap::new();
        let all = mesh.first_triangle[number]..mesh.first_triangle[number + 1];
        let (covered, bare): (Vec<u32>, Vec<u32>) = all.partition(|&t| start.space(t, back).1);
        for triangle in bare.into_iter().chain(covered) {
            let entry = start.entry(triangle, back);
            let space = start.space(triangle, back).0;
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
                    // A point where triangles were cut belongs to its input triangle alone: attributes may jump.
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
                *known.or_insert_with(|| self.edge(a, b))
            });
            self.all.push(Cell {
                sheet: number_of_sheet,
                of: (triangle, entry),
                corners,
                edges,
                area: mesh.area[triangle as usize],
                hints: (0, 0),
                doubt: Doubt::default(),
            });
        }
        self.sheets.push(sheet);
    }

    fn edge(&mut self, a: u32, b: u32) -> u32 {
        let length = self.points[a as usize].distance(self.points[b as usize]);
        self.edges.push(Edge {
            ends: [a, b],
            length,
            marked: false,
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

    /// Vertex in the middle of an edge of a cell, made if need be: a place to look at light; nothing is split for it.
    pub(super) fn middle(&mut self, cell: usize, k: usize) -> u32 {
        let Cell {
            sheet, of, corners, ..
        } = self.all[cell];
        self.sheets[sheet as usize].between(of, corners[k], corners[(k + 1) % 3])
    }

    /// Marks an edge of a cell to be split.
    pub(super) fn mark(&mut self, cell: usize, k: usize) {
        let edge = self.all[cell].edges[k];
        self.edges[edge as usize].marked = true;
    }

    /// Splits the marked edges, and the triangles that have them; returns the triangles that are new. `shrink` is what
    /// remains of an expected mean square after a bisection.
    pub(super) fn split(&mut self, shrink: f64) -> Vec<usize> {
        self.close();
        for k in 0..self.edges.len() {
            let Edge {
                ends: [a, b],
                marked,
                split,
                ..
            } = self.edges[k];
            if marked && split.is_none() {
                let middle = self.points.len() as u32;
                let between = 0.5 * (self.points[a as usize] + self.points[b as usize]);
                self.points.push(between);
                let halves = [self.edge(a, middle), self.edge(middle, b)];
                self.edges[k].split = Some((middle, halves));
            }
        }
        let mut fresh = Vec::new();
        let mut k = 0;
        // Halves that still have a split edge come up again, at the end or here.
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
        fresh.sort_unstable();
        fresh.dedup();
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
                let slender = |k: usize| edge(k).marked && edge(k).length < limit;
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

    /// The longest of the split edges of a cell.
    fn to_bisect(&self, cell: &Cell) -> Option<usize> {
        let split = |&k: &usize| self.edges[cell.edges[k] as usize].split.is_some();
        let longer = |best: usize, k: usize| match self.length(cell, k) > self.length(cell, best) {
            true => k,
            false => best,
        };
        (0..3).filter(split).reduce(longer)
    }

    /// Bisects a cell at a split edge: one half takes its place, the other is the last.
    fn bisect(&mut self, k: usize, edge: usize, shrink: f64) {
        let Cell {
            sheet,
            of,
            corners,
            edges,
            area,
            hints,
            doubt,
        } = self.all[k];
        let [a, b, c] = [0, 1, 2].map(|k| corners[(edge + k) % 3]);
        let [ab, bc, ca] = [0, 1, 2].map(|k| edges[(edge + k) % 3]);
        let Edge { ends, split, .. } = self.edges[ab as usize];
        let Some((point, mut halves)) = split else {
            return;
        };
        if ends[0] != a.point {
            halves.swap(0, 1);
        }
        let m = Corner {
            point,
            vertex: self.sheets[sheet as usize].between(of, a, b),
            weights: halfway(a.weights, b.weights),
        };
        let mc = self.edge(point, c.point);
        let border = self.sheets[sheet as usize].part(hints, m, c, a);
        let half = |corners, edges, hints| Cell {
            sheet,
            of,
            corners,
            edges,
            area: 0.5 * area,
            hints,
            doubt: Doubt {
                square: shrink * doubt.square,
                trust: doubt.trust,
                ..Doubt::default()
            },
        };
        self.all[k] = half([a, m, c], [halves[0], mc, ca], (hints.0, border));
        self.all
            .push(half([m, b, c], [halves[1], bc, mc], (border, hints.1)));
    }

    /// Triangles of a sheet by their vertices, with the triangle of the mesh that each is part of.
    pub(super) fn triangles(&self, sheet: usize) -> (Vec<[u32; 3]>, Vec<u32>) {
        let cells = self.all.iter().filter(|c| c.sheet as usize == sheet);
        cells
            .map(|c| (c.corners.map(|corner| corner.vertex), c.of.0))
            .unzip()
    }
}

impl Sheet {
    fn between(&mut self, (triangle, entry): (u32, u32), a: Corner, b: Corner) -> u32 {
        let vertices = &mut self.vertices;
        let known = self.middle.entry(key(a.vertex, b.vertex));
        *known.or_insert_with(|| {
            vertices.push(Vertex {
                triangle,
                weights: halfway(a.weights, b.weights),
                entry,
            });
            vertices.len() as u32 - 1
        })
    }

    /// Parts hints at the line from `m` to `c`: those on the side of `a` come first; where the others begin.
    fn part(&mut self, hints: (u32, u32), m: Corner, c: Corner, a: Corner) -> u32 {
        let flat = |w: [f64; 3]| [w[1], w[2]];
        let (m, c, a) = (flat(m.weights), flat(c.weights), flat(a.weights));
        let side = |p: [f64; 2]| (c[0] - m[0]) * (p[1] - m[1]) - (c[1] - m[1]) * (p[0] - m[0]);
        let of_a = side(a);
        let some = &mut self.hints[hints.0 as usize..hints.1 as usize];
        let (first, second): (Vec<Hint>, Vec<Hint>) =
            some.iter().partition(|hint| side(hint.at) * of_a >= 0.0);
        let border = hints.0 + first.len() as u32;
        for (place, hint) in some.iter_mut().zip(first.into_iter().chain(second)) {
            *place = hint;
        }
        border
    }
}

/// Weights of the corners of a cell at a place of its triangle of the mesh.
pub(super) fn within(corners: &[Corner; 3], at: [f64; 2]) -> [f64; 3] {
    let [a, b, c] = corners.map(|c| [c.weights[1], c.weights[2]]);
    let cross = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    let whole = cross(a, b, c);
    [
        cross(at, b, c) / whole,
        cross(a, at, c) / whole,
        cross(a, b, at) / whole,
    ]
}

impl Cell {
    /// Weights of the corners of the triangle of the mesh, from those of the cell's own.
    pub(super) fn at(&self, weights: [f64; 3]) -> [f64; 3] {
        let corner = |k: usize, j: usize| self.corners[k].weights[j] * weights[k];
        std::array::from_fn(|j| corner(0, j) + corner(1, j) + corner(2, j))
    }

    /// Does it belong to a face of the hierarchy, with some area?
    pub(super) fn is_face(&self) -> bool {
        self.of.1 != NONE && self.area > 0.0
    }
}
