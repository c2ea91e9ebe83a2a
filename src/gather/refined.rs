//! The refined mesh of the output: crack-free, and finer where light bends.
//!
//! Every input triangle starts with the quarters that the solver made of it. Where the light in the middle of an edge is
//! not what its ends predict, the triangle is quartered again. Neighbours differ by one level at the most, and a
//! triangle whose neighbour is finer is cut to fit: both use the same points on the common edge, across surfaces too.

use crate::hierarchy::{Mesh, NONE, Tree};
use glam::DVec3;
use std::collections::HashMap;

/// A corner: a point in space, and a vertex of its sheet (points on a crease have several).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corner {
    pub(super) point: u32,
    pub(super) vertex: u32,
    /// Weights of the corners of the cell's input triangle.
    weights: [f64; 3],
}

/// A vertex of a sheet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vertex {
    pub(super) point: u32,
    /// Triangle of the mesh that it is described on, and weights of its corners.
    pub(super) triangle: u32,
    pub(super) weights: [f64; 3],
    /// Entry of the face in the hierarchy.
    pub(super) entry: u32,
}

/// A triangle of the refined mesh, possibly quartered.
#[derive(Debug, Clone, Copy)]
struct Cell {
    corners: [Corner; 3],
    /// Input triangle, and its entry in the hierarchy.
    of: (u32, u32),
    child: u32,
    depth: u8,
}

/// One side of one surface.
#[derive(Debug, Default)]
pub(super) struct Sheet {
    pub(super) surface: usize,
    pub(super) back: bool,
    pub(super) vertices: Vec<Vertex>,
    cells: Vec<Cell>,
    /// Vertex in the middle of two.
    middle: HashMap<(u32, u32), u32>,
}

/// All sheets, on common points.
#[derive(Debug)]
pub(super) struct Refined {
    pub(super) points: Vec<DVec3>,
    pub(super) sheets: Vec<Sheet>,
    /// Point in the middle of an edge, where one is in use.
    middle: HashMap<(u32, u32), u32>,
}

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

impl Refined {
    /// Starts from the elements of the hierarchy. `flat[s]`: does surface `s` have no shading normals of its own? Then its
    /// vertices are not shared across planes. `spaces` holds the space of each entry and whether something covers it: none is
    /// shared by faces of different spaces, and where a covered face meets a bare one it is the bare one's.
    pub(super) fn new(
        mesh: &Mesh,
        tree: &Tree,
        corners_of: &dyn Fn(usize, usize) -> [u32; 3],
        spaces: &[(u32, bool)],
        flat: &[bool],
        two_sided: &[bool],
        deepest: u8,
    ) -> Self {
        let mut refined = Self {
            points: mesh.positions.clone(),
            sheets: Vec::new(),
            middle: HashMap::new(),
        };
        for surface in 0..flat.len() {
            for back in [false, true] {
                if back && !two_sided[surface] {
                    continue;
                }
                let mut sheet = Sheet {
                    surface,
                    back,
                    ..Sheet::default()
                };
                let mut known: HashMap<(u64, u32, u32), u32> = HashMap::new();
                let all = mesh.first_triangle[surface]..mesh.first_triangle[surface + 1];
                let entry = |triangle: u32| tree.entry[triangle as usize][usize::from(back)];
                let of = |t: u32| spaces.get(entry(t) as usize).copied().unwrap_or_default();
                let (covered, bare): (Vec<u32>, Vec<u32>) = all.partition(|&t| of(t).1);
                for triangle in bare.into_iter().chain(covered) {
                    let (entry, (space, _)) = (entry(triangle), of(triangle));
                    let local = mesh.origin[triangle as usize].1 as usize;
                    let names = corners_of(surface, local);
                    let group = if flat[surface] {
                        mesh.plane[triangle as usize]
                    } else {
                        u32::MAX
                    };
                    let mut corners: [Corner; 3] = std::array::from_fn(|k| {
                        let point = mesh.triangles[triangle as usize][k];
                        let mut weights = [0.0; 3];
                        weights[k] = 1.0;
                        let name = match mesh.input_corner(triangle as usize, k) {
                            Some(corner) => u64::from(names[corner]),
                            // A point where triangles were cut belongs to its input triangle alone: attributes may jump.
                            None => u64::from(local as u32 + 1) << 32 | u64::from(point),
                        };
                        let vertex = *known.entry((name, group, space)).or_insert_with(|| {
                            sheet.vertices.push(Vertex {
                                point,
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
                    let cell = sheet.cells.len() as u32;
                    sheet.cells.push(Cell {
                        corners,
                        of: (triangle, entry),
                        child: NONE,
                        depth: 0,
                    });
                    if entry != NONE {
                        refined.follow(
                            &mut sheet,
                            tree,
                            cell,
                            tree.face_node[entry as usize],
                            deepest,
                        );
                    }
                }
                refined.sheets.push(sheet);
            }
        }
        refined
    }

    /// Quarters a cell as the hierarchy does.
    fn follow(&mut self, sheet: &mut Sheet, tree: &Tree, cell: u32, node: u32, deepest: u8) {
        let mut open = vec![(cell, node)];
        while let Some((cell, node)) = open.pop() {
            if tree.node(node).is_leaf() || sheet.cells[cell as usize].depth >= deepest {
                continue;
            }
            self.quarter(sheet, cell);
            let child = sheet.cells[cell as usize].child;
            open.extend((0..4).map(|k| (child + k, tree.node(node).child + k)));
        }
    }

    /// Splits a cell at the middles of its edges; children in the order of [`Tree::subdivide`].
    fn quarter(&mut self, sheet: &mut Sheet, cell: u32) {
        let Cell {
            corners: [a, b, c],
            of,
            depth,
            ..
        } = sheet.cells[cell as usize];
        let (ab, bc, ca) = (
            self.between(sheet, of, a, b),
            self.between(sheet, of, b, c),
            self.between(sheet, of, c, a),
        );
        sheet.cells[cell as usize].child = sheet.cells.len() as u32;
        for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]] {
            sheet.cells.push(Cell {
                corners,
                of,
                child: NONE,
                depth: depth + 1,
            });
        }
    }

    /// The corner in the middle of an edge, made if need be.
    fn between(&mut self, sheet: &mut Sheet, of: (u32, u32), a: Corner, b: Corner) -> Corner {
        let points = &mut self.points;
        let point = *self.middle.entry(key(a.point, b.point)).or_insert_with(|| {
            points.push(0.5 * (points[a.point as usize] + points[b.point as usize]));
            points.len() as u32 - 1
        });
        Corner {
            point,
            vertex: sheet.between(of, a, b, point),
            weights: halfway(a, b),
        }
    }

    /// Quarters cells until neighbours differ by one level at the most.
    pub(super) fn level(&mut self) {
        let mut sheets = std::mem::take(&mut self.sheets);
        loop {
            let mut any = false;
            for sheet in &mut sheets {
                let mut k = 0;
                while k < sheet.cells.len() {
                    let cell = &sheet.cells[k];
                    if cell.child == NONE && self.too_coarse(cell.corners) {
                        self.quarter(sheet, k as u32);
                        any = true;
                    }
                    k += 1;
                }
            }
            if !any {
                break;
            }
        }
        self.sheets = sheets;
    }

    /// Is half of an edge split by a neighbour?
    fn too_coarse(&self, corners: [Corner; 3]) -> bool {
        (0..3).any(|k| {
            let (a, b) = (corners[k].point, corners[(k + 1) % 3].point);
            self.middle.get(&key(a, b)).is_some_and(|&m| {
                self.middle.contains_key(&key(a, m)) || self.middle.contains_key(&key(m, b))
            })
        })
    }

    /// Cells that are not split, as (sheet, cell).
    pub(super) fn leaves(&self) -> Vec<(u32, u32)> {
        let mut all = Vec::new();
        for (s, sheet) in self.sheets.iter().enumerate() {
            all.extend(
                (0..sheet.cells.len())
                    .filter(|&k| sheet.cells[k].child == NONE)
                    .map(|k| (s as u32, k as u32)),
            );
        }
        all
    }

    /// Which vertices of a sheet do the triangles on some triangles of the mesh use?
    pub(super) fn used(&self, sheet: &Sheet, wanted: impl Fn(u32) -> bool) -> Vec<bool> {
        let mut used = vec![false; sheet.vertices.len()];
        for cell in sheet
            .cells
            .iter()
            .filter(|c| c.child == NONE && wanted(c.of.0))
        {
            let [a, b, c] = cell.corners.map(|x| x.vertex);
            let middles =
                [(a, b), (b, c), (c, a)].map(|(p, q)| sheet.middle.get(&key(p, q)).copied());
            for vertex in [a, b, c].into_iter().chain(middles.into_iter().flatten()) {
                used[vertex as usize] = true;
            }
        }
        used
    }

    pub(super) fn corners(&self, (sheet, cell): (u32, u32)) -> [Corner; 3] {
        self.sheets[sheet as usize].cells[cell as usize].corners
    }

    pub(super) fn depth(&self, (sheet, cell): (u32, u32)) -> u8 {
        self.sheets[sheet as usize].cells[cell as usize].depth
    }

    /// Splits a leaf.
    pub(super) fn split(&mut self, (sheet, cell): (u32, u32)) {
        let mut taken = std::mem::take(&mut self.sheets[sheet as usize]);
        if taken.cells[cell as usize].child == NONE {
            self.quarter(&mut taken, cell);
        }
        self.sheets[sheet as usize] = taken;
    }

    /// Vertex in the middle of an edge of a sheet, made if need be without splitting anything: a place to look at light.
    pub(super) fn look(&mut self, (sheet, cell): (u32, u32), a: Corner, b: Corner) -> u32 {
        let known = self.middle.get(&key(a.point, b.point)).copied();
        // A point of its own, not entered as the edge's middle: nobody is forced to use it.
        let point = known.unwrap_or_else(|| {
            self.points
                .push(0.5 * (self.points[a.point as usize] + self.points[b.point as usize]));
            self.points.len() as u32 - 1
        });
        let of = self.sheets[sheet as usize].cells[cell as usize].of;
        self.sheets[sheet as usize].between(of, a, b, point)
    }

    /// Triangles of a sheet that fit their neighbours; makes the vertices they need.
    pub(super) fn triangles(&mut self, sheet: u32) -> Vec<[u32; 3]> {
        let mut taken = std::mem::take(&mut self.sheets[sheet as usize]);
        let mut out = Vec::new();
        for k in 0..taken.cells.len() {
            if taken.cells[k].child != NONE {
                continue;
            }
            let (corners, of) = (taken.cells[k].corners, taken.cells[k].of);
            let [a, b, c] = corners.map(|x| x.vertex);
            let middle: [Option<u32>; 3] = std::array::from_fn(|e| {
                let (p, q) = (corners[e], corners[(e + 1) % 3]);
                self.middle
                    .get(&key(p.point, q.point))
                    .map(|&m| taken.between(of, p, q, m))
            });
            match middle {
                [None, None, None] => out.push([a, b, c]),
                [Some(ab), None, None] => out.extend([[a, ab, c], [ab, b, c]]),
                [None, Some(bc), None] => out.extend([[b, bc, a], [bc, c, a]]),
                [None, None, Some(ca)] => out.extend([[c, ca, b], [ca, a, b]]),
                [Some(ab), Some(bc), None] => out.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
                [None, Some(bc), Some(ca)] => out.extend([[bc, c, ca], [b, bc, ca], [b, ca, a]]),
                [Some(ab), None, Some(ca)] => out.extend([[ca, a, ab], [c, ca, ab], [c, ab, b]]),
                [Some(ab), Some(bc), Some(ca)] => {
                    out.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]])
                }
            }
        }
        self.sheets[sheet as usize] = taken;
        out
    }
}

impl Sheet {
    fn between(&mut self, (triangle, entry): (u32, u32), a: Corner, b: Corner, point: u32) -> u32 {
        if let Some(&known) = self.middle.get(&key(a.vertex, b.vertex)) {
            // A vertex that was only looked at takes the edge's point when that comes into use.
            self.vertices[known as usize].point = point;
            return known;
        }
        let id = self.vertices.len() as u32;
        self.vertices.push(Vertex {
            point,
            triangle,
            weights: halfway(a, b),
            entry,
        });
        self.middle.insert(key(a.vertex, b.vertex), id);
        id
    }
}

fn halfway(a: Corner, b: Corner) -> [f64; 3] {
    std::array::from_fn(|k| 0.5 * (a.weights[k] + b.weights[k]))
}
