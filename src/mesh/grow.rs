//! The mesh grows where straight lines between its vertices differ from the light that a look there finds.
//!
//! Every triangle has a mean square of the colour difference between both, and times its area this is its share of the
//! error: first as expected from the solved light, then as seen in the middles of its edges and at one point inside. The
//! triangles with the largest shares are looked at or, if that is done, split at the edges over which light bends; so shares
//! become alike, which takes the fewest vertices for a sum. Squares are used although growing ends by the mean: teeth along
//! shadows are few, and visible.

use super::cells::{Cell, CellError, Cells, Corner, Hint, within};
use super::looks::Looks;
use super::shades::Shades;
use super::turns::{BENDS, BY_CHANCE, EXCESS, GrowthOutcome, RANGE, largest};
use crate::color::seen_difference;
use crate::geometry::sampling::{hash, triangle_weights};
use rayon::prelude::*;
use std::collections::HashMap;
use std::time::Instant;

/// A look that is not asked for yet.
const UNKNOWN: u32 = u32::MAX;
/// Triangles are split until their longest edge is this share of the room's half diagonal.
const SMALLEST: f64 = 1e-3;
/// Share of the mean square that remains after a bisection: two bisections halve a smooth triangle's size, and its
/// error falls with the square of that.
pub(super) const SHRINK: f64 = 0.25;
/// Where something covers the middle of an edge, this share of the difference between its ends counts.
const COVERED: f64 = 0.25;
/// Vertices that splitting one triangle may take, including those of its neighbours: 1 to 5 were measured, twice as many on an
/// edge of a shadow.
pub(super) const SPLIT: usize = 16;
/// A limit of vertices counts as reached when less than one in this many is left.
const FULL: usize = 64;

/// Light at the corners of a cell, mean square of its difference from the solved light, and the worst place.
type Told = ([[f64; 3]; 3], f64, Option<(Hint, f64)>);
/// Looks in the middles of edges and inside, and weights of the corners at the last.
type LookRequest = ([u32; 3], u32, [f64; 3]);

/// Sum of the light of neighbours of covered vertices, and their number.
type Lent = HashMap<u32, ([f64; 3], f64)>;

/// For a random point the cell, the vertices between which it is drawn and their weights, and two looks.
pub(super) type PointLooks = (usize, ([u32; 3], [f64; 3]), [u32; 2]);

/// A mesh that grows.
pub(super) struct MeshGrowth<'a> {
    pub(super) cells: Cells,
    pub(super) looks: Looks<'a>,
    /// The lamps that throw shadows.
    pub(super) shades: Shades<'a>,
    /// Look of each vertex of each sheet.
    looked: Vec<Vec<u32>>,
    /// Light lent to covered vertices of each sheet.
    lent: Vec<Lent>,
    pub(super) white: [f64; 3],
    /// Edges no longer than this are not split.
    smallest: f64,
    /// Vertices at the most.
    pub(super) most: usize,
    /// Is `most` a limit, or a rough number?
    pub(super) strict: bool,
    /// By how much light may bend between vertices, in the mean; triangles of the input are expected to have it until more is known of them.
    pub(super) allowed: f64,
    /// Variance of a look by chance.
    pub(super) noise: f64,
    /// Points of the last measurement.
    pub(super) asked: Vec<PointLooks>,
    /// Is light looked at, or is the solved light believed?
    pub(super) looking: bool,
    /// When growing ends if nothing is looked at any more.
    pub(super) until: Option<Instant>,
    /// Triangles split to finish edges of shadows.
    pub(super) for_lines: usize,
}

impl<'a> MeshGrowth<'a> {
    /// Starts with cells.
    pub(super) fn new(
        cells: Cells,
        looks: Looks<'a>,
        shades: Shades<'a>,
        white: [f64; 3],
        half_size: f64,
    ) -> Self {
        Self {
            looked: vec![Vec::new(); cells.sheets.len()],
            lent: vec![Lent::new(); cells.sheets.len()],
            cells,
            looks,
            shades,
            white,
            smallest: SMALLEST * half_size,
            most: usize::MAX,
            strict: false,
            allowed: 0.0,
            noise: 0.0,
            asked: Vec::new(),
            looking: true,
            until: None,
            for_lines: 0,
        }
    }

    pub(super) fn difference(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        seen_difference(a, b, self.white)
    }

    /// Asks for looks at the vertices of some cells.
    fn want_corners(&mut self, cells: &[usize]) {
        for &k in cells {
            let cell = &self.cells.all[k];
            let (sheet, vertices) = (cell.sheet as usize, cell.corners.map(|c| c.vertex));
            let area = cell.per_look();
            for vertex in vertices {
                self.want(sheet, vertex, area);
            }
        }
    }

    /// Asks for a look at a vertex that is to stand for that area besides what it stood for before.
    pub(super) fn want(&mut self, sheet: usize, vertex: u32, area: f64) -> u32 {
        let looked = &mut self.looked[sheet];
        let sheet = &self.cells.sheets[sheet];
        looked.resize(sheet.vertices.len(), UNKNOWN);
        let look = &mut looked[vertex as usize];
        if *look == UNKNOWN {
            let own = &sheet.vertices[vertex as usize];
            *look = match sheet.beside.get(&vertex) {
                Some(beside) => self.looks.want_texel(beside, sheet.surface, sheet.back),
                None => self.looks.want(own, sheet.surface, sheet.back),
            };
        }
        self.looks.stand_for(*look, area);
        *look
    }

    /// From now on believes the solved light, or looks.
    pub(super) fn believe(&mut self, believing: bool) {
        self.looking = !believing;
        self.looks.believing = believing;
    }

    /// Looks again at the vertices of triangles that lie on `wanted` triangles of the mesh, and at their neighbours, which
    /// may lend them light.
    pub(super) fn look_again(
        &mut self,
        wanted: impl Fn(u32) -> bool,
        progress: &dyn Fn(usize, usize),
    ) {
        let all = || 0..self.cells.all.len();
        let sheets = self.cells.sheets.iter();
        let mut near: Vec<Vec<bool>> = sheets.map(|s| vec![false; s.vertices.len()]).collect();
        for cell in self.cells.all.iter().filter(|cell| wanted(cell.of.0)) {
            for corner in cell.corners {
                near[cell.sheet as usize][corner.vertex as usize] = true;
            }
        }
        let is_near = |&k: &usize| {
            let cell = &self.cells.all[k];
            let mut corners = cell.corners.iter();
            corners.any(|c| near[cell.sheet as usize][c.vertex as usize])
        };
        let some: Vec<usize> = all().filter(is_near).collect();
        for &k in &some {
            let cell = &self.cells.all[k];
            for corner in cell.corners {
                self.looked[cell.sheet as usize][corner.vertex as usize] = UNKNOWN;
            }
        }
        self.want_corners(&some);
        self.looks.complete(progress);
    }

    /// Is a cell too small to be split?
    pub(super) fn is_smallest(&self, cell: &Cell) -> bool {
        self.cells.size(cell) <= self.smallest
    }

    /// Look of a vertex, if asked for.
    pub(super) fn look(&self, sheet: usize, vertex: u32) -> Option<u32> {
        let look = self.looked[sheet].get(vertex as usize);
        look.copied().filter(|&look| look != UNKNOWN)
    }

    /// Light at the corners of a cell.
    pub(super) fn light(&self, cell: usize) -> [[f64; 3]; 3] {
        let cell = &self.cells.all[cell];
        cell.corners.map(|c| {
            let sheet = cell.sheet as usize;
            let seen = self.seen(sheet, c.vertex);
            let lent = || {
                self.lent[sheet]
                    .get(&c.vertex)
                    .map(|(sum, n)| sum.map(|x| x / n))
            };
            seen.or_else(lent).unwrap_or_default()
        })
    }

    /// Variance by chance of what is drawn between three vertices, a multiple of that of a look of the usual effort. Vertices without a look have none.
    pub(super) fn variance(&self, sheet: usize, vertices: [u32; 3], weights: [f64; 3]) -> f64 {
        let of = |(&vertex, w): (&u32, f64)| {
            let look = self.look(sheet, vertex);
            w * w * look.map_or(0.0, |look| self.looks.variance(look))
        };
        vertices.iter().zip(weights).map(of).sum()
    }

    fn seen(&self, sheet: usize, vertex: u32) -> Option<[f64; 3]> {
        let look = self.look(sheet, vertex)?;
        self.looks.at(look).map(|seen| seen.xyz)
    }

    /// Lends covered vertices the light of their neighbours, as in the output.
    fn lend(&mut self) {
        let mut lent = vec![Lent::new(); self.cells.sheets.len()];
        for cell in &self.cells.all {
            let sheet = cell.sheet as usize;
            let light = cell.corners.map(|c| self.seen(sheet, c.vertex));
            let covered = cell.corners.iter().zip(&light).filter(|(_, l)| l.is_none());
            for (corner, _) in covered {
                for x in light.iter().flatten() {
                    let (sum, n) = lent[sheet].entry(corner.vertex).or_default();
                    *sum = [0, 1, 2].map(|c| sum[c] + x[c]);
                    *n += 1.0;
                }
            }
        }
        self.lent = lent;
    }

    /// Can anybody see any part of a cell? Told by its corners and by the rays of leaves.
    fn is_seen(&self, cell: usize) -> bool {
        let cell = &self.cells.all[cell];
        let sheet = &self.cells.sheets[cell.sheet as usize];
        let hints = &sheet.hints[cell.hints.0 as usize..cell.hints.1 as usize];
        let corner = |c: &Corner| self.seen(cell.sheet as usize, c.vertex).is_some();
        cell.corners.iter().any(corner) || hints.iter().any(|hint| hint.open > 0.0)
    }

    /// Counted area of all cells of which anything can be seen: the error is a mean over this.
    pub(super) fn seen_area(&self) -> f64 {
        let seen = (0..self.cells.all.len()).filter(|&k| self.is_seen(k));
        seen.map(|k| self.cells.all[k].counted()).sum()
    }

    /// Mean square of the solved light's difference from a cell, as far as others see it, the worst place and the difference
    /// there.
    fn told(&self, cell: usize, light: &[[f64; 3]; 3]) -> (f64, Option<(Hint, f64)>) {
        let cell = &self.cells.all[cell];
        let sheet = &self.cells.sheets[cell.sheet as usize];
        let hints = &sheet.hints[cell.hints.0 as usize..cell.hints.1 as usize];
        let (mut sum, mut area, mut worst) = (0.0, 0.0, None::<(Hint, f64)>);
        for hint in hints {
            let d = self.difference(mix(light, within(&cell.corners, hint.at)), hint.light);
            sum += hint.area * hint.open * d * d;
            area += hint.area;
            if hint.open > 0.0 && worst.is_none_or(|(_, most)| d > most) {
                worst = Some((*hint, d));
            }
        }
        (if area > 0.0 { sum / area } else { 0.0 }, worst)
    }

    /// Looks at the corners of new cells, and sets the error that the solved light lets expect there.
    pub(super) fn expect(&mut self, fresh: &[usize], first: bool, progress: &dyn Fn(usize, usize)) {
        self.want_corners(fresh);
        self.looks.complete(progress);
        self.lend();
        let expected: Vec<f64> = fresh
            .par_iter()
            .map(|&k| {
                let light = self.light(k);
                let told = self.told(k, &light).0;
                let CellError { square, trust, .. } = self.cells.all[k].doubt;
                if !self.is_seen(k) {
                    return 0.0;
                }
                let range = (0..3).map(|k| self.difference(light[k], light[(k + 1) % 3]));
                let range = (RANGE * range.fold(0.0, f64::max)).powi(2);
                match first {
                    true => told.max(range).max(self.allowed * self.allowed),
                    // Half of a triangle that was flat where it was looked at may still hide something.
                    false => square.max(told * f64::from(trust * trust)).max(range),
                }
            })
            .collect();
        for (&k, square) in fresh.iter().zip(expected) {
            let doubt = &mut self.cells.all[k].doubt;
            doubt.square = square;
            if first {
                doubt.trust = 1.0;
            }
        }
    }

    /// Makes the first vertices.
    pub(super) fn begin(&mut self, progress: &dyn Fn(usize, usize)) {
        if self.looking && !self.looks.is_late() {
            let most = self.left_of_limit();
            self.cells.fence(&self.shades, self.looks.spaces(), most);
        }
        let all: Vec<usize> = (0..self.cells.all.len()).collect();
        let all = self.cells.take_sides(&self.shades, all);
        self.expect(&all, true, progress);
    }

    /// Sum of all shares.
    pub(super) fn sum(&self) -> f64 {
        self.cells.all.iter().map(share).sum()
    }

    /// Grows until the sum of all shares is at most `goal`.
    pub(super) fn grow(&mut self, goal: f64, progress: &dyn Fn(usize, usize)) -> GrowthOutcome {
        loop {
            let excess = self.sum() - goal;
            if excess <= 0.0 {
                self.finish_lines(progress);
                return GrowthOutcome::Reached;
            }
            let is_late = match self.until {
                Some(until) => Instant::now() > until,
                None => self.looking && self.looks.is_late(),
            };
            if is_late {
                return GrowthOutcome::Late;
            }
            let left = self.most.saturating_sub(self.used());
            let batch = left / SPLIT;
            if left == 0 || batch == 0 || batch < self.most / (SPLIT * FULL) {
                self.finish_lines(progress);
                return GrowthOutcome::Most;
            }
            let mut picked = self.pick(excess);
            picked.truncate(batch);
            if picked.is_empty() {
                return GrowthOutcome::Smallest;
            }
            let looking = self.looking;
            let (tested, untested): (Vec<usize>, Vec<usize>) = picked
                .into_iter()
                .partition(|&k| self.cells.all[k].doubt.tested || !looking);
            self.test(&untested, progress);
            let fresh = self.split(&tested);
            self.expect(&fresh, false, progress);
        }
    }

    /// Vertices that a limit that was asked for leaves; any number without one.
    pub(super) fn left_of_limit(&self) -> usize {
        match self.strict {
            true => self.most.saturating_sub(self.used()),
            false => usize::MAX,
        }
    }

    /// Number of vertices that would be written.
    pub(super) fn used(&self) -> usize {
        let sheets = self.cells.sheets.iter();
        let mut used: Vec<Vec<bool>> = sheets.map(|s| vec![false; s.vertices.len()]).collect();
        for cell in &self.cells.all {
            for corner in cell.corners {
                used[cell.sheet as usize][corner.vertex as usize] = true;
            }
        }
        used.iter().flatten().filter(|used| **used).count()
    }

    /// The cells with the largest shares that can be split, as many as make up the excess.
    fn pick(&self, excess: f64) -> Vec<usize> {
        let all = self.cells.all.par_iter().enumerate();
        let shares = all
            .filter(|(_, c)| share(c) > 0.0 && !self.is_smallest(c))
            .map(|(k, c)| (share(c), k))
            .collect();
        let mut left = EXCESS * excess;
        let mut picked = Vec::new();
        for (share, k) in largest(shares) {
            if left <= 0.0 {
                break;
            }
            left -= share;
            picked.push(k);
        }
        picked
    }

    /// Marks the edges of a tested cell over which light bends; all of them if light differs inside.
    pub(super) fn mark(&mut self, k: usize) {
        let doubt = self.cells.all[k].doubt;
        let worst = doubt.bent.into_iter().fold(doubt.inside, f32::max);
        let limit = BENDS as f32 * worst;
        let bends = |e: &usize| worst > 0.0 && doubt.bent[*e] >= limit;
        let mut edges: Vec<usize> = (0..3).filter(bends).collect();
        if edges.is_empty() {
            edges = match self.looking && worst > 0.0 {
                true => vec![0, 1, 2],
                false => vec![self.cells.longest(&self.cells.all[k])],
            };
        }
        for e in edges {
            self.cells.mark(k, e);
        }
    }

    /// Looks at light in the middles of edges and at a point inside: where the solved light differs most, or a random
    /// one.
    fn test(&mut self, cells: &[usize], progress: &dyn Fn(usize, usize)) {
        let told: Vec<_> = cells
            .par_iter()
            .map(|&k| {
                let light = self.light(k);
                let (square, worst) = self.told(k, &light);
                let cell = &self.cells.all[k];
                // A single leaf tells nothing of differences inside.
                let worst = worst.filter(|(_, d)| cell.hints.1 > cell.hints.0 + 1 && *d > 0.0);
                (light, square, worst)
            })
            .collect();
        let mut asked = Vec::with_capacity(cells.len());
        for (&k, (_, _, worst)) in cells.iter().zip(&told) {
            let sheet = self.cells.all[k].sheet as usize;
            let middles = [0, 1, 2].map(|e| self.cells.middle(k, e));
            let area = self.cells.all[k].per_look();
            let middles = middles.map(|vertex| self.want(sheet, vertex, area));
            let cell = &self.cells.all[k];
            let weights = match worst {
                Some((hint, _)) => within(&cell.corners, hint.at),
                None => {
                    let seed = hash(k as u64, self.cells.all.len() as u64);
                    let unit = |x: u64| (x >> 11) as f64 / (1_u64 << 53) as f64;
                    triangle_weights([unit(seed), unit(hash(seed, 1))])
                }
            };
            let inside = self.cells.divided.place(cell.of, cell.at(weights));
            let sheet = &self.cells.sheets[sheet];
            let inside = self.looks.want(&inside, sheet.surface, sheet.back);
            self.looks.stand_for(inside, area);
            asked.push((middles, inside, weights));
        }
        self.looks.complete(progress);
        for ((&k, told), asked) in cells.iter().zip(told).zip(asked) {
            self.cells.all[k].doubt = self.judged(k, told, asked);
        }
    }

    /// The doubt of a cell, from its light, the solved light's difference and worst place, looks in the middles of edges and
    /// one inside, and the place of the last.
    fn judged(
        &self,
        k: usize,
        (light, told, worst): Told,
        (middles, inside, weights): LookRequest,
    ) -> CellError {
        let Cell { sheet, corners, .. } = &self.cells.all[k];
        let vertices = corners.map(|c| c.vertex);
        let off = |look: u32, weights: [f64; 3]| {
            let seen = self.looks.at(look)?.xyz;
            let off = self.difference(mix(&light, weights), seen);
            // A difference that chance alone may cause is not a bend.
            let drawn = self.variance(*sheet as usize, vertices, weights);
            let chance = self.noise * (self.looks.variance(look) + drawn);
            Some((off * off - BY_CHANCE * chance).max(0.0).sqrt())
        };
        let halves = [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]];
        let seen = corners.map(|c| self.seen(*sheet as usize, c.vertex).is_some());
        let mut looks = middles.into_iter().chain([inside]);
        if !seen.contains(&true) && looks.all(|look| self.looks.at(look).is_none()) {
            // The cell lies below something.
            return CellError {
                tested: true,
                ..CellError::default()
            };
        }
        let bent = [0, 1, 2].map(|e| {
            // The edge of something that stands here runs through the cell, unless the whole cell lies below it.
            let ends = || match seen[e] || seen[(e + 1) % 3] {
                true => self.difference(light[e], light[(e + 1) % 3]),
                false => 0.0,
            };
            off(middles[e], halves[e]).unwrap_or_else(|| COVERED * ends())
        });
        let inside = off(inside, weights);
        let missed = [0, 1, 2].map(|e| {
            let [a, b] = [e, (e + 1) % 3].map(|e| seen[e].then_some(light[e][1]));
            let middle = self.looks.at(middles[e])?.xyz[1];
            Some((middle - 0.5 * (a? + b?)) as f32)
        });
        let edges: f64 = bent.iter().map(|d| d * d).sum();
        let before = f64::from(self.cells.all[k].doubt.trust);
        let (square, trust) = match (worst, inside) {
            (Some((_, most)), inside) => {
                let trust = inside.map_or(before, |inside| (inside / most).min(1.0));
                ((0.25 * edges).max(trust * trust * told), trust)
            }
            (None, Some(inside)) => (0.25 * (edges + inside * inside), 1.0),
            (None, None) => ((0.25 * edges).max(before * before * told), before),
        };
        let inside = inside.unwrap_or(square.sqrt());
        CellError {
            square,
            tested: true,
            bent: bent.map(|d| d as f32),
            inside: inside as f32,
            trust: trust as f32,
            missed,
        }
    }
}

/// Contribution of a cell to the mean square, times the total area.
pub(super) fn share(cell: &Cell) -> f64 {
    cell.counted() * cell.doubt.square
}

/// Light between three corners.
pub(super) fn mix(light: &[[f64; 3]; 3], weights: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| (0..3).map(|k| light[k][c] * weights[k]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::{Effort, GatherQuality};
    use crate::transport::tests::baked;

    /// However flat the triangle was of which they are halves.
    #[test]
    fn halves_expect_something_of_the_difference_of_their_corners() {
        let bake = baked("cornell.glb", 1);
        let mut growth = bake.growth(GatherQuality::Vertex(Effort::default()), &|| false);
        growth.begin(&|_, _| {});
        let all: Vec<usize> = (0..growth.cells.all.len()).collect();
        for &k in &all {
            growth.cells.all[k].doubt = CellError::default();
        }
        growth.expect(&all, false, &|_, _| {});
        let mut apart = 0;
        for &k in &all {
            let [a, b, c] = growth.light(k);
            let pairs = [[a, b], [b, c], [c, a]].map(|[a, b]| growth.difference(a, b));
            let range = pairs.into_iter().fold(0.0, f64::max);
            apart += usize::from(range > 1.0);
            assert_eq!(growth.cells.all[k].doubt.square, (0.1 * range).powi(2));
        }
        assert!(apart > 10, "{apart}");
    }
}
