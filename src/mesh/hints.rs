//! What the solved light tells of a triangle before any look: every leaf of the hierarchy in it has a value.

use super::cells::{Cells, Corner, Hint, SurfaceSide};
use crate::geometry::quarters;
use crate::hierarchy::Tree;
use crate::solve::Bake;
use glam::DVec3;

impl Cells {
    /// Finds how much of a cell counts, by the hints in it; a cell without hints counts like the triangle that it is
    /// part of.
    pub(super) fn count(&mut self, k: usize) {
        let cell = &mut self.all[k];
        let (first, end) = cell.hints;
        let hints = &self.sheets[cell.sheet as usize].hints[first as usize..end as usize];
        cell.counts = counting(hints.iter().map(|h| [h.area, h.counts])).unwrap_or(cell.counts);
    }
}

impl SurfaceSide {
    /// Parts hints at the line from `m` to `c`: those on the side of `a` come first; where the others begin.
    pub(super) fn part(&mut self, hints: (u32, u32), m: Corner, c: Corner, a: Corner) -> u32 {
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

/// Share of an area that counts, from its parts: the area of each, and the share of it that counts. None of no area.
pub(crate) fn counting(parts: impl Iterator<Item = [f64; 2]>) -> Option<f64> {
    let [area, counted] = parts.fold([0.0; 2], |[area, counted], [part, counts]| {
        [area + part, counted + part * counts]
    });
    (area > 0.0).then(|| counted / area)
}

/// Gives every sheet the leaves of its faces as hints, and every cell its range of them. Cells must still be the
/// triangles of the mesh.
pub(super) fn give(bake: &Bake, cells: &mut Cells) {
    let (tree, light) = (bake.tree(), bake.light());
    let of_leaf: Vec<[f64; 3]> = (0..light.irradiance.len().min(light.leaves.len()))
        .map(|k| bake.lanes().tristimulus(light.irradiance.row(k)))
        .collect();
    let value = |leaf: u32| {
        let place = light.leaves.binary_search(&leaf).ok()?;
        of_leaf.get(place).copied()
    };
    for cell in &mut cells.all {
        let sheet = &mut cells.sheets[cell.sheet as usize];
        let first = sheet.hints.len() as u32;
        if cell.is_face() {
            let face = tree.face_node[cell.of.1 as usize];
            leaves(tree, face, sheet.back, cell.area, |leaf, at, area| {
                let light = value(leaf);
                let open = bake.openness(leaf);
                sheet.hints.extend(light.map(|light| Hint {
                    at,
                    area,
                    counts: tree.node(leaf).counted / tree.node(leaf).area,
                    open,
                    light,
                }));
            });
        }
        cell.hints = (first, sheet.hints.len() as u32);
    }
    for k in 0..cells.all.len() {
        cells.count(k);
    }
}

/// Leaves of a face: node, weights of the second and third corner of the triangle of the mesh at the leaf's middle,
/// area.
pub(crate) fn leaves(
    tree: &Tree,
    face: u32,
    back: bool,
    area: f64,
    mut each: impl FnMut(u32, [f64; 2], f64),
) {
    // Weights of the corners, halved together with the corners.
    let mut open = vec![(face, DVec3::AXES, area)];
    while let Some((id, corners, area)) = open.pop() {
        let node = tree.node(id);
        if node.is_leaf() {
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            // The hierarchy's back faces have their corners the other way round.
            let at = match back {
                true => [middle.z, middle.y],
                false => [middle.y, middle.z],
            };
            each(id, at, area);
            continue;
        }
        for (child, corners) in node.child_range().zip(quarters(corners)) {
            open.push((child, corners, 0.25 * area));
        }
    }
}
