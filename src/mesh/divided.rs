//! Triangles of the input that cutting divided.
//!
//! A cell keeps the weights of its corners, and its hints, in a triangle of the mesh. Where an input triangle was cut, cells grow together over
//! its parts: an edge between two parts means nothing to light unless something stands on it. Weights may then lie outside of the triangle that
//! they belong to, and a place is looked up in the part that it lies in. Places on edges are found from the ends of the edge, and not of the cell
//! that asks: all cells on an edge of the input, and both sides of a line, must find the same bits.

use crate::gather::Vertex;
use crate::hierarchy::{Mesh, NONE, Tree};
use std::collections::HashMap;

/// Weights below this lie outside: rounding leaves less.
const OUTSIDE: f64 = -1e-9;

/// A triangle of the mesh and its entry in the hierarchy.
pub(super) type MeshTriangle = (u32, u32);

/// A part of a triangle of the input.
#[derive(Debug)]
struct Part {
    of: MeshTriangle,
    /// Weights of the second and third corner of the triangle of the input at the corners of the part.
    corners: [[f64; 2]; 3],
}

/// Weights of the corners of a triangle of the mesh at both ends of an edge.
type EdgeSpan = (MeshTriangle, [[f64; 3]; 2]);

/// Sets of parts that belong together: of one triangle of the input, on one side, in one space, all covered or all bare.
#[derive(Debug)]
pub(super) struct Divided {
    sets: Vec<Vec<Part>>,
    /// For each entry its set and place there; none of triangles that were not cut.
    by_entry: Vec<Option<(u32, u32)>>,
    /// Edges by their number and set, as the first cell that splits them has them; those of parts as they are.
    spans: HashMap<(u32, u32), EdgeSpan>,
}

impl Divided {
    /// The sets of a mesh; `spaces` holds the space of each entry and whether something covers it.
    pub(super) fn new(mesh: &Mesh, tree: &Tree, spaces: &[(u32, bool)]) -> Self {
        let mut divided = Self {
            sets: Vec::new(),
            by_entry: vec![None; spaces.len()],
            spans: HashMap::new(),
        };
        let all: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        // Parts of a triangle of the input follow each other.
        let cut = |t: u32| mesh.origin[t as usize];
        for parts in all.chunk_by(|a, b| cut(*a) == cut(*b)) {
            for side in [0, 1] {
                if parts.len() > 1 {
                    divided.add(mesh, tree, spaces, (parts, side));
                }
            }
        }
        divided
    }

    fn add(
        &mut self,
        mesh: &Mesh,
        tree: &Tree,
        spaces: &[(u32, bool)],
        (parts, side): (&[u32], usize),
    ) {
        let entry = |t: &u32| tree.entry[*t as usize][side];
        let of = parts.iter().map(|t| (*t, entry(t)));
        let mut faces: Vec<MeshTriangle> = of.filter(|(_, entry)| *entry != NONE).collect();
        let space = |(_, entry): &MeshTriangle| spaces[*entry as usize];
        faces.sort_by_key(space);
        for set in faces.chunk_by(|a, b| space(a) == space(b)) {
            let number = self.sets.len() as u32;
            for (place, (_, entry)) in (0..).zip(set) {
                self.by_entry[*entry as usize] = Some((number, place));
            }
            let corner = |triangle: u32, weights| {
                let on_origin = mesh.on_origin(triangle as usize, weights);
                [on_origin[1], on_origin[2]]
            };
            let part = |&of: &MeshTriangle| Part {
                of,
                corners: unit().map(|weights| corner(of.0, weights)),
            };
            self.sets.push(set.iter().map(part).collect());
        }
    }

    fn part(&self, (_, entry): MeshTriangle) -> Option<(u32, &Part)> {
        let (set, place) = (*self.by_entry.get(entry as usize)?)?;
        Some((set, &self.sets[set as usize][place as usize]))
    }

    /// May cells of two triangles of the mesh be turned against each other?
    pub(super) fn are_together(&self, one: MeshTriangle, other: MeshTriangle) -> bool {
        let set = |of| self.part(of).map(|(set, _)| set);
        one == other || set(one).is_some_and(|one| Some(one) == set(other))
    }

    /// A triangle of the mesh that stands for all that belong together with one.
    pub(super) fn first(&self, of: MeshTriangle) -> u32 {
        let set = self.part(of).map(|(set, _)| &self.sets[set as usize]);
        set.map_or(of.0, |set| set[0].of.0)
    }

    /// A place with these weights of the corners of a triangle of the mesh, in the part in which it lies.
    pub(super) fn place(&self, of: MeshTriangle, weights: [f64; 3]) -> Vertex {
        let own = vertex(of, weights);
        let is_inside = weights.iter().all(|w| *w >= OUTSIDE);
        let (false, Some((set, part))) = (is_inside, self.part(of)) else {
            return own;
        };
        let at = mixed(&part.corners, weights);
        let parts = self.sets[set as usize].iter();
        let places = parts.map(|part| (part.of, barycentric(part.corners, at)));
        let least = |w: &[f64; 3]| w[0].min(w[1]).min(w[2]);
        let deepest = places
            .filter(|(_, w)| least(w).is_finite())
            .max_by(|(_, a), (_, b)| least(a).total_cmp(&least(b)));
        deepest.map_or(own, |(of, weights)| vertex(of, weights))
    }

    /// Remembers the place of an edge, if cells on it may be turned: weights at both ends in a triangle of the mesh.
    pub(super) fn span(&mut self, edge: u32, of: MeshTriangle, ends: [[f64; 3]; 2]) -> EdgeSpan {
        match self.part(of) {
            None => (of, ends),
            Some((set, _)) => *self.spans.entry((edge, set)).or_insert((of, ends)),
        }
    }

    /// Remembers the places of both halves of an edge that is split at this share of the way.
    pub(super) fn halve(&mut self, edge: u32, of: MeshTriangle, at: f64, halves: [u32; 2]) {
        let known = self
            .part(of)
            .and_then(|(set, _)| self.spans.get(&(edge, set)));
        if let Some(&(of, [from, to])) = known {
            let middle = between(from, to, at);
            self.span(halves[0], of, [from, middle]);
            self.span(halves[1], of, [middle, to]);
        }
    }

    /// Weights of the second and third corner of one triangle of the mesh at a place given by those of another; both belong together.
    pub(super) fn moved(&self, from: MeshTriangle, to: MeshTriangle, at: [f64; 2]) -> [f64; 2] {
        let (Some((_, old)), Some((_, new))) = (self.part(from), self.part(to)) else {
            return at;
        };
        let on_origin = mixed(&old.corners, [1.0 - at[0] - at[1], at[0], at[1]]);
        let weights = barycentric(new.corners, on_origin);
        [weights[1], weights[2]]
    }
}

/// A place on the way between two. Both triangles of an edge must get the same bits, whichever weights are zero.
pub(super) fn between(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    std::array::from_fn(|k| (1.0 - t) * a[k] + t * b[k])
}

/// Weights of a triangle's own corners.
fn unit() -> [[f64; 3]; 3] {
    glam::DMat3::IDENTITY.to_cols_array_2d()
}

fn vertex((triangle, entry): MeshTriangle, weights: [f64; 3]) -> Vertex {
    Vertex {
        triangle,
        weights,
        entry,
    }
}

fn mixed(corners: &[[f64; 2]; 3], weights: [f64; 3]) -> [f64; 2] {
    [0, 1].map(|k| (0..3).map(|c| corners[c][k] * weights[c]).sum())
}

/// Weights of the corners of a triangle of the plane at a place.
pub(super) fn barycentric([a, b, c]: [[f64; 2]; 3], at: [f64; 2]) -> [f64; 3] {
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

#[cfg(test)]
mod tests {
    use crate::geometry::sampling::{Pcg, triangle_weights};
    use crate::mesh::cells::{Cells, within};
    use crate::solve::GatherQuality;
    use crate::transport::tests::baked;

    /// A floor that was cut along the things on it is turned across the cuts, and keeps its places and what is known there.
    #[test]
    fn cells_are_turned_across_the_parts_of_a_triangle() {
        let bake = baked("flat.glb", 1);
        let (mesh, tree) = (bake.mesh(), bake.tree());
        let cells = &mut bake.growth(GatherQuality::Preview, &|| false).cells;
        let sizes = |cells: &Cells| {
            let all = cells.all.iter();
            all.fold((0.0, 0), |(area, hints), cell| {
                (area + cell.area, hints + cell.hints.1 - cell.hints.0)
            })
        };
        let before = sizes(cells);
        for _ in 0..4 {
            for k in 0..cells.all.len() {
                cells.mark(k, cells.longest(&cells.all[k]));
            }
            cells.split(1.0);
        }
        let then = sizes(cells);
        assert!((then.0 / before.0 - 1.0).abs() < 1e-9 && then.1 == before.1);

        let mut random = Pcg::new(3);
        let mut elsewhere = 0;
        for cell in &cells.all {
            let hints = &cells.sheets[cell.sheet as usize].hints;
            for hint in &hints[cell.hints.0 as usize..cell.hints.1 as usize] {
                let own = within(&cell.corners, hint.at);
                assert!(own.iter().all(|w| *w > -1e-6), "{own:?}");
            }
            let own = triangle_weights([random.f64(), random.f64()]);
            let at = (0..3).map(|k| own[k] * cells.points[cell.corners[k].point as usize]);
            let at: glam::DVec3 = at.sum();
            let place = cells.divided.place(cell.of, cell.at(own));
            let found = mesh.at(place.triangle as usize, place.weights);
            assert!(found.distance(at) < 1e-9 * mesh.half_size);
            assert!(place.weights.iter().all(|w| *w > -1e-6));
            let back = usize::from(cells.sheets[cell.sheet as usize].back);
            assert_eq!(place.entry, tree.entry[place.triangle as usize][back]);
            assert_eq!(place.triangle, mesh.part_at(cell.of.0, at));
            elsewhere += usize::from(place.triangle != cell.of.0);
        }
        assert!(elsewhere > 3, "{elsewhere}");
    }
}
