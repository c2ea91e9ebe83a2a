//! Rooms whose walls follow the axes: a grid of solid and hollow cells.
//!
//! A face stands wherever a hollow cell meets a solid one (or the outside of the grid) and shows the hollow side. Every
//! face is a cell of the grid, so that neighbours share whole edges: no T-vertex, no gap, and a closed surface.

use super::glb::Mesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// The grid.
pub(crate) struct Cells<'a> {
    /// Cutting planes across x, y and z, metres, ascending.
    pub(crate) cuts: [&'a [f64]; 3],
    /// Is the cell around this point hollow?
    pub(crate) hollow: &'a dyn Fn(DVec3) -> bool,
    /// The paint of the face around this point whose normal is the second argument.
    pub(crate) paint: &'a dyn Fn(DVec3, DVec3) -> usize,
}

impl Cells<'_> {
    /// The faces, one mesh for each paint. Texture coordinates are metres along the wall.
    pub(crate) fn meshes(&self) -> BTreeMap<usize, Mesh> {
        let mut meshes: BTreeMap<usize, Mesh> = BTreeMap::new();
        let mut shared: BTreeMap<(usize, usize, bool, [usize; 3]), u32> = BTreeMap::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for plane in 0..self.cuts[axis].len() {
                for j in 0..self.cuts[u].len() - 1 {
                    for k in 0..self.cuts[v].len() - 1 {
                        let mut cell = [0; 3];
                        (cell[axis], cell[u], cell[v]) = (plane, j, k);
                        let above = self.is_hollow(cell, axis, 0);
                        let below = self.is_hollow(cell, axis, 1);
                        if above == below {
                            continue;
                        }
                        let mut normal = DVec3::ZERO;
                        normal[axis] = if above { 1.0 } else { -1.0 };
                        let mut centre = self.middle(cell);
                        centre[axis] = self.cuts[axis][plane];
                        let paint = (self.paint)(centre, normal);
                        let mesh = meshes.entry(paint).or_default();
                        let corner = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
                            let mut at = cell;
                            at[u] += du;
                            at[v] += dv;
                            *shared.entry((paint, axis, above, at)).or_insert_with(|| {
                                let p =
                                    DVec3::from_array(std::array::from_fn(|a| self.cuts[a][at[a]]));
                                mesh.positions.push(p);
                                mesh.normals.push(normal);
                                mesh.uvs.push(flat_uv(p, axis));
                                mesh.positions.len() as u32 - 1
                            })
                        });
                        let [a, b, c, d] = corner;
                        if above {
                            mesh.triangles.extend([[a, b, c], [a, c, d]]);
                        } else {
                            mesh.triangles.extend([[a, c, b], [a, d, c]]);
                        }
                    }
                }
            }
        }
        meshes
    }

    /// Is the cell `back` steps down the axis hollow? Outside of the grid all is solid.
    fn is_hollow(&self, mut cell: [usize; 3], axis: usize, back: usize) -> bool {
        let Some(at) = cell[axis].checked_sub(back) else {
            return false;
        };
        cell[axis] = at;
        at + 1 < self.cuts[axis].len() && (self.hollow)(self.middle(cell))
    }

    fn middle(&self, cell: [usize; 3]) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|a| {
            let cuts = self.cuts[a];
            let next = (cell[a] + 1).min(cuts.len() - 1);
            (cuts[cell[a]] + cuts[next]) / 2.0
        }))
    }
}

/// Texture coordinates on an axis-aligned plane: v runs down.
fn flat_uv(p: DVec3, axis: usize) -> [f64; 2] {
    match axis {
        0 => [p.z, -p.y],
        1 => [p.x, p.z],
        _ => [p.x, -p.y],
    }
}
