//! Edges of shadows as edges of triangles: where the input's triangles are split for them, and which vertices lie on both
//! sides.
//!
//! On such an edge every point has a vertex for each side: a side is identified by those lamps, of all that the edge
//! belongs to, that light a place right beside the point. So each side has its own light, and the mesh is as connected as
//! before.

use super::cells::{Cell, CellError, Cells, Corner, ShadowEnd, SurfaceSide, key, within};
use super::divided::{Divided, MeshTriangle};

/// A corner of a cell that lies on the edge of a shadow: cell, corner, lamps.
pub(super) type Sharp = (usize, usize, u64);

impl Cells {
    /// Requests the split of an edge of a cell at a share of the way from corner `k` to the next. None where another split
    /// was requested before, further than `near` from there.
    pub(super) fn cross(&mut self, cell: usize, k: usize, at: f64, near: f64) -> Option<ShadowEnd> {
        let Cell { corners, edges, .. } = &self.all[cell];
        let (id, first) = (edges[k], corners[k].point);
        let edge = &mut self.edges[id as usize];
        let at = if edge.ends[0] == first { at } else { 1.0 - at };
        if edge.split.is_some() || (edge.marked && edge.crossed.is_none()) {
            return None;
        }
        let known = *edge.crossed.get_or_insert(at);
        edge.marked = true;
        ((known - at).abs() * edge.length <= near).then_some(ShadowEnd::Crossing(id))
    }

    /// Requests that a line between two points become an edge at the next split, if possible.
    pub(super) fn line(&mut self, ends: [ShadowEnd; 2], lamps: u64) {
        self.lines.push((ends, lamps));
    }

    /// Finds the ends of lines among the points at which edges were just split.
    pub(super) fn draw_lines(&mut self) {
        for (ends, lamps) in std::mem::take(&mut self.lines) {
            let point = |end| match end {
                ShadowEnd::Point(point) => Some(point),
                ShadowEnd::Crossing(edge) => Some(self.edges[edge as usize].split?.0),
            };
            let (Some(a), Some(b)) = (point(ends[0]), point(ends[1])) else {
                continue;
            };
            *self.along.entry(key(a, b)).or_default() |= lamps;
            for point in [a, b] {
                self.sharpen(point, lamps);
            }
        }
    }

    /// Records that light of lamps ends at a point.
    pub(super) fn sharpen(&mut self, point: u32, lamps: u64) {
        let known = self.sharp.entry(point).or_default();
        if *known & lamps != lamps {
            *known |= lamps;
            self.sharpened.push(point);
        }
    }

    /// Puts a point inside a cell, which becomes three.
    pub(super) fn star(&mut self, k: usize, weights: [f64; 3]) -> ShadowEnd {
        let cell = self.all[k];
        let own = within(&cell.corners, [weights[1], weights[2]]);
        let places = cell.corners.map(|c| self.points[c.point as usize]);
        let point = self.points.len() as u32;
        self.points
            .push(places[0] * own[0] + places[1] * own[1] + places[2] * own[2]);
        let sheet = &mut self.sheets[cell.sheet as usize];
        sheet.vertices.push(self.divided.place(cell.of, weights));
        let vertex = sheet.vertices.len() as u32 - 1;
        let middle = Corner {
            point,
            vertex,
            weights,
        };
        let spokes = cell.corners.map(|c| self.edge(c.point, point));
        let mut first = cell.hints.0;
        for e in 0..3 {
            let n = (e + 1) % 3;
            let corners = [cell.corners[e], cell.corners[n], middle];
            let hints = match e {
                2 => (first, cell.hints.1),
                _ => self.sector(cell.sheet, (first, cell.hints.1), &corners),
            };
            first = hints.1;
            let part = Cell {
                corners,
                edges: [cell.edges[e], spokes[n], spokes[e]],
                area: cell.area * own[(e + 2) % 3],
                hints,
                doubt: CellError {
                    tested: false,
                    ..cell.doubt
                },
                ..cell
            };
            self.starred.push(if e == 0 { k } else { self.all.len() });
            match e {
                0 => self.all[k] = part,
                _ => self.all.push(part),
            }
        }
        ShadowEnd::Point(point)
    }

    /// Moves those hints to the front that lie in a triangle; returns their range.
    fn sector(&mut self, sheet: u32, hints: (u32, u32), corners: &[Corner; 3]) -> (u32, u32) {
        let some = &mut self.sheets[sheet as usize].hints[hints.0 as usize..hints.1 as usize];
        some.sort_by_key(|hint| within(corners, hint.at).iter().any(|w| *w < 0.0));
        let inside =
            some.partition_point(|hint| within(corners, hint.at).iter().all(|w| *w >= 0.0));
        (hints.0, hints.0 + inside as u32)
    }

    /// Lamps whose light ends along an edge of a cell.
    pub(super) fn sharp_along(&self, cell: &Cell, k: usize) -> u64 {
        self.edges[cell.edges[k] as usize].sharp
    }

    /// Corners on edges of shadows, of new cells and of cells around points that were not on such edges before.
    pub(super) fn sharp_corners(&mut self, fresh: &[usize]) -> Vec<Sharp> {
        let mut is_fresh = vec![false; self.all.len()];
        for &k in fresh {
            is_fresh[k] = true;
        }
        let mut anew = std::mem::take(&mut self.sharpened);
        anew.sort_unstable();
        let mut found = Vec::new();
        if self.sharp.is_empty() {
            return found;
        }
        for (cell, of) in self.all.iter().enumerate() {
            for (k, corner) in of.corners.iter().enumerate() {
                if (is_fresh[cell] || anew.binary_search(&corner.point).is_ok())
                    && let Some(&lamps) = self.sharp.get(&corner.point)
                {
                    found.push((cell, k, lamps));
                }
            }
        }
        found
    }

    /// Gives a corner the vertex of its side: `lit` has the lamps that light the side, whose light is looked at
    /// `beside` the corner.
    pub(super) fn take_side(&mut self, (cell, k, lamps): Sharp, lit: u64, beside: [f64; 3]) {
        let Cell {
            sheet,
            of,
            covered,
            corners,
            ..
        } = &mut self.all[cell];
        let sheet = &mut self.sheets[*sheet as usize];
        let vertex = corners[k].vertex;
        let base = sheet.base.get(&vertex).copied().unwrap_or(vertex);
        let fresh = sheet.vertices.len() as u32;
        let side = *sheet
            .sides
            .entry((base, lamps, lit, *covered))
            .or_insert(fresh);
        if side == fresh {
            sheet.vertices.push(sheet.vertices[base as usize]);
            sheet.base.insert(side, base);
            sheet.beside.insert(side, self.divided.place(*of, beside));
        }
        corners[k].vertex = side;
    }
}

/// Where the light beside the middle of a line is looked at if its ends give no place: share of the way to the opposite
/// corner.
const INTO: f64 = 0.05;

impl SurfaceSide {
    /// Light of a vertex in the middle of a line from `a` to `b` is looked at between the places of both ends, on the
    /// side of `c`.
    pub(super) fn beside_line(
        &mut self,
        divided: &Divided,
        vertex: u32,
        of: MeshTriangle,
        [a, b, c]: [Corner; 3],
    ) {
        let beside = |corner: Corner| self.beside.get(&corner.vertex).copied();
        let near = [a, b].map(|end| beside(end).filter(|look| look.triangle == of.0));
        let weights = match near {
            [Some(a), Some(b)] => [0, 1, 2].map(|k| 0.5 * (a.weights[k] + b.weights[k])),
            _ => [0, 1, 2].map(|k| {
                let middle = 0.5 * (a.weights[k] + b.weights[k]);
                (1.0 - INTO) * middle + INTO * c.weights[k]
            }),
        };
        let beside = self.beside.entry(vertex);
        beside.or_insert_with(|| divided.place(of, weights));
    }
}
