//! Turns edges between needles.
//!
//! The edge of a small shadow puts many points close together on an edge of a triangle, and the triangle beyond is bisected at each of
//! them towards the same corner: a fan of needles, which draw light of the shadow across a floor. Two parts of one triangle of the input
//! that share an edge, unless light ends along it, may as well share the other diagonal, and do where that is clearly the better shape.

use super::cells::{Cell, CellError, Cells, Corner, key};
use super::divided::MeshTriangle;
use std::collections::{BTreeMap, BTreeSet};

/// The flatter of two triangles must become this many times as high for its length: right angles made by bisection stay as they are. At
/// `--error 1`, means of six seeds without turns and with this (vertices, mean dE00 between them, root mean square): small gallery 1,956, .421,
/// .72 and 1,789, .408, .71; flat 3,032, .381, .93 and 2,909, .355, .85; Cornell 887, .414, .85 and 871, .381, .55; sunlit room 10,032, .151, 1.00
/// and 9,546, .172, 1.03. With 2, 1.5 and 1.2, later: small gallery 1,760 .410 .78, 1,666 .414 .76 and 1,702 .400 .68; Cornell .381 .55, .420 .97
/// and .392 .59; flat .381 .84, .349 .83 and .358 .93; three seeds of a sunlit room .145 .83, .170 .98 and .149 .79, of a gallery .324 .81, .324 .96
/// and .362 1.11.
const HIGHER: f64 = 2.0;

/// An edge, and the sheet whose triangles meet there.
type SheetEdge = (u32, u32);

impl Cells {
    /// Turns edges of new cells; cells that change become new ones.
    pub(super) fn turn_needles(&mut self, fresh: &mut Vec<usize>) {
        let mut beside = self.at_edges(fresh);
        // The flattest triangle around becomes higher with every turn, so this ends.
        let mut open: BTreeSet<SheetEdge> = beside.keys().copied().collect();
        while let Some(at) = open.pop_first() {
            let Some(&[t, s]) = beside.get(&at).map(Vec::as_slice) else {
                continue;
            };
            if let Some([bc, ad]) = self.turned(at.0, [t, s]) {
                beside.remove(&at);
                let new = (self.all[t].edges[0], at.1);
                beside.insert(new, vec![t, s]);
                // The first has an edge of the second now, and the other way round.
                let [db, ca] = [self.all[t].edges[1], self.all[s].edges[1]];
                for (edge, from, to) in [(db, s, t), (ca, t, s)] {
                    let cells = beside.get_mut(&(edge, at.1));
                    let old = cells.and_then(|cells| cells.iter_mut().find(|k| **k == from));
                    if let Some(old) = old {
                        *old = to;
                    }
                }
                open.extend([db, ca, bc, ad].map(|edge| (edge, at.1)));
                fresh.extend([t, s]);
            }
        }
        fresh.sort_unstable();
        fresh.dedup();
    }

    /// The cells at each edge of some.
    fn at_edges(&self, some: &[usize]) -> BTreeMap<SheetEdge, Vec<usize>> {
        let mut is_wanted = vec![false; self.edges.len()];
        for edge in some.iter().flat_map(|&k| self.all[k].edges) {
            is_wanted[edge as usize] = self.edges[edge as usize].sharp == 0;
        }
        let mut beside: BTreeMap<SheetEdge, Vec<usize>> = BTreeMap::new();
        for (k, cell) in self.all.iter().enumerate() {
            for edge in cell.edges.into_iter().filter(|&e| is_wanted[e as usize]) {
                beside.entry((edge, cell.sheet)).or_default().push(k);
            }
        }
        beside
    }

    /// Turns an edge between two cells if that makes better triangles; returns the edges that each keeps. The first edge of both is then
    /// the one that was turned.
    fn turned(&mut self, edge: u32, [t, s]: [usize; 2]) -> Option<[u32; 2]> {
        let (one, other) = (self.all[t], self.all[s]);
        let [i, j] = [one, other].map(|cell| cell.edges.iter().position(|&e| e == edge));
        let (i, j) = (i?, j?);
        // (a, b, c) and (b, a, d); the other diagonal leads from c to d.
        let [a, b, c] = [0, 1, 2].map(|k| one.corners[(i + k) % 3]);
        let [b_too, a_too, d] = [0, 1, 2].map(|k| other.corners[(j + k) % 3]);
        let is_one_place = a.vertex == a_too.vertex && b.vertex == b_too.vertex;
        let is_line = |p: Corner, q: Corner| {
            let lamps = self.along.get(&key(p.point, q.point));
            lamps.is_some_and(|lamps| *lamps != 0)
        };
        if !is_one_place || !self.divided.are_together(one.of, other.of) || is_line(a, b) {
            return None;
        }
        // Weights of both in one triangle of the mesh: in that of the larger cell.
        let of = if one.area >= other.area {
            one.of
        } else {
            other.of
        };
        let [a, b, c] = [a, b, c].map(|corner| self.moved(corner, one.of, of));
        let d = self.moved(d, other.of, of);
        let area = one.area + other.area;
        let [left, right] = [[c, d, b], [d, c, a]].map(|corners| area * cross(corners));
        let whole = cross([a, b, c]) + cross([b, a, d]);
        let areas = [left / whole, right / whole];
        let flatter = |pair: [([Corner; 3], f64); 2]| {
            let [x, y] = pair.map(|(corners, area)| self.height(corners, area));
            x.min(y)
        };
        let before = flatter([([a, b, c], one.area), ([b, a, d], other.area)]);
        let after = flatter([([c, d, b], areas[0]), ([d, c, a], areas[1])]);
        // Where the four corners are those of no convex quadrilateral a triangle has a negative area.
        if after.is_nan() || after <= HIGHER * before {
            return None;
        }
        let cd = self.edge(c.point, d.point);
        let (hints, border) = self.merged(&[one, other], of, [c, d, b]);
        let [bc, ca] = [1, 2].map(|k| one.edges[(i + k) % 3]);
        let [ad, db] = [1, 2].map(|k| other.edges[(j + k) % 3]);
        let mean = (one.doubt.square * one.area + other.doubt.square * other.area) / area;
        let half = |corners, edges, area, hints| Cell {
            of,
            corners,
            edges,
            area,
            hints,
            doubt: CellError {
                square: mean,
                trust: one.doubt.trust.max(other.doubt.trust),
                ..CellError::default()
            },
            ..one
        };
        self.all[t] = half([c, d, b], [cd, db, bc], areas[0], (hints.0, border));
        self.all[s] = half([d, c, a], [cd, ca, ad], areas[1], (border, hints.1));
        self.count(t);
        self.count(s);
        Some([bc, ad])
    }

    /// The same corner with weights in another triangle of the mesh.
    fn moved(&self, corner: Corner, from: MeshTriangle, to: MeshTriangle) -> Corner {
        if from == to {
            return corner;
        }
        let [v, w] = (self.divided).moved(from, to, [corner.weights[1], corner.weights[2]]);
        Corner {
            weights: [1.0 - v - w, v, w],
            ..corner
        }
    }

    /// Height of a triangle as a share of its longest edge.
    fn height(&self, corners: [Corner; 3], area: f64) -> f64 {
        let [a, b, c] = corners.map(|corner| self.points[corner.point as usize]);
        let longest = (a.distance_squared(b)).max(b.distance_squared(c));
        2.0 * area / longest.max(c.distance_squared(a))
    }

    /// Hints of two cells in one range, those on the side of the last of three corners first; and where the others begin.
    fn merged(
        &mut self,
        both: &[Cell; 2],
        of: MeshTriangle,
        [c, d, b]: [Corner; 3],
    ) -> ((u32, u32), u32) {
        for cell in both.iter().filter(|cell| cell.of != of) {
            let (first, end) = cell.hints;
            for hint in &mut self.sheets[cell.sheet as usize].hints[first as usize..end as usize] {
                hint.at = self.divided.moved(cell.of, of, hint.at);
            }
        }
        let sheet = &mut self.sheets[both[0].sheet as usize];
        let [one, other] = [both[0].hints, both[1].hints];
        let hints = if one.1 == other.0 {
            (one.0, other.1)
        } else if other.1 == one.0 {
            (other.0, one.1)
        } else {
            let first = sheet.hints.len() as u32;
            for (from, to) in [one, other] {
                sheet.hints.extend_from_within(from as usize..to as usize);
            }
            (first, sheet.hints.len() as u32)
        };
        (hints, sheet.part(hints, c, d, b))
    }
}

/// Twice the area of a triangle in weights of the corners of the triangle of the mesh, negative if it is turned round.
fn cross(corners: [Corner; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| [corner.weights[1], corner.weights[2]]);
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use crate::mesh::cells::{Cells, within};
    use crate::mesh::grow::MeshGrowth;
    use crate::solve::GatherQuality;
    use crate::transport::tests::baked;

    /// Halves the largest triangle, and puts a point into one half right beside the other; returns the triangle, and the edge between
    /// both halves.
    fn needle(cells: &mut Cells) -> ((u32, u32), u32) {
        let mut all = 0..cells.all.len();
        let first = all.next().unwrap();
        let k = all.fold(first, |best, k| {
            let is_larger = cells.all[k].area > cells.all[best].area;
            if is_larger { k } else { best }
        });
        let of = cells.all[k].of;
        cells.mark(k, cells.longest(&cells.all[k]));
        let fresh = cells.split(1.0);
        let halves: Vec<usize> = (fresh.into_iter())
            .filter(|&k| cells.all[k].of == of)
            .collect();
        let [one, other] = [halves[0], halves[1]].map(|k| cells.all[k].edges);
        let e = (0..3).find(|&e| other.contains(&one[e])).unwrap();
        let mut weights = [0.495; 3];
        weights[(e + 2) % 3] = 0.01;
        cells.star(halves[0], cells.all[halves[0]].at(weights));
        (of, one[e])
    }

    /// Area and number of hints of all cells; each hint lies in its cell.
    fn held(cells: &Cells) -> (f64, usize) {
        for cell in &cells.all {
            for (k, &edge) in cell.edges.iter().enumerate() {
                let mut ends = cells.edges[edge as usize].ends;
                let mut own = [k, (k + 1) % 3].map(|k| cell.corners[k].point);
                ends.sort_unstable();
                own.sort_unstable();
                assert_eq!(ends, own);
            }
            let hints = &cells.sheets[cell.sheet as usize].hints;
            for hint in &hints[cell.hints.0 as usize..cell.hints.1 as usize] {
                let w = within(&cell.corners, hint.at);
                assert!(w.iter().all(|w| *w > -1e-9), "{w:?}");
            }
        }
        let all = cells.all.iter();
        all.fold((0.0, 0), |(area, hints), cell| {
            (
                area + cell.area,
                hints + (cell.hints.1 - cell.hints.0) as usize,
            )
        })
    }

    /// Of the parts of a triangle.
    fn least_height(cells: &Cells, of: (u32, u32)) -> f64 {
        let parts = cells.all.iter().filter(|cell| cell.of == of);
        let heights = parts.map(|cell| cells.height(cell.corners, cell.area));
        heights.fold(f64::INFINITY, f64::min)
    }

    fn growth(bake: &crate::solve::Bake) -> MeshGrowth<'_> {
        bake.growth(GatherQuality::Preview, &|| false)
    }

    #[test]
    fn the_edge_of_a_needle_is_turned_unless_it_is_a_line() {
        let bake = baked("cornell.glb", 3);
        let cells = &mut growth(bake).cells;
        let (of, edge) = needle(cells);
        let (area, hints) = held(cells);
        let flat = least_height(cells, of);
        let mut all: Vec<usize> = (0..cells.all.len()).collect();
        cells.turn_needles(&mut all);
        assert!(
            flat < 0.02 && least_height(cells, of) > 0.1,
            "{flat} {}",
            least_height(cells, of)
        );
        assert!(cells.all.iter().all(|cell| !cell.edges.contains(&edge)));
        let then = held(cells);
        assert!((then.0 / area - 1.0).abs() < 1e-12 && then.1 == hints && hints > 100);

        let cells = &mut growth(bake).cells;
        let (of, edge) = needle(cells);
        cells.edges[edge as usize].sharp = 1;
        cells.turn_needles(&mut all);
        assert!(cells.all.iter().any(|cell| cell.edges.contains(&edge)));
        assert_eq!(least_height(cells, of), flat);
    }
}
