//! Rectangles of a chart between four places of its lattice, halved along either axis where light needs it.
//!
//! Lattices of all levels are nested: what a finer one adds lies in the middles of a coarser one's edges and cells, so what was
//! looked at there to test a cell are corners once it is split. The texels of the map are the lattice of the chart's finest
//! level; between corners that are further apart light is interpolated.

use super::charts::Chart;
use glam::DVec2;

/// Halvings along an axis at the most: a texel of 1 mm in a chart of 8 m at one cell.
pub(super) const DEPTH: u32 = 13;
/// Cells along an axis before anything is halved, at the most.
const FIRST: f64 = 64.0;
/// What is left of a cell and smaller than this share of it counts for nothing.
const NOTHING: f64 = 1e-9;

/// The lattice of a chart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lattice {
    /// Cells along each axis at level 0.
    pub(super) counts: [u32; 2],
    /// Halvings along each axis that the chart's texels have.
    pub(super) finest: [u8; 2],
    /// Is all of the chart one texel?
    pub(super) single: bool,
    size: DVec2,
}

impl Lattice {
    /// Cells no longer than `longest`, where the number of cells allows; they may be as slender as the chart, for each axis is
    /// halved by itself. A single texel for charts smaller than `tiny`; no more texels along an axis than `most`.
    pub(super) fn new(size: DVec2, longest: f64, tiny: f64, most: usize) -> Self {
        let most = (most.saturating_sub(1) as f64).clamp(1.0, FIRST);
        let count = |length: f64| (length / longest - 1e-6).ceil().clamp(1.0, most) as u32;
        Self {
            counts: [count(size.x), count(size.y)],
            finest: [0, 0],
            single: size.length() < tiny,
            size,
        }
    }

    /// The lattice of more than a single texel.
    pub(super) fn opened(&self) -> Self {
        Self {
            single: false,
            ..*self
        }
    }

    /// Where a point of the finest possible lattice lies.
    pub(super) fn at(&self, point: [u32; 2]) -> DVec2 {
        let share = |k: usize| f64::from(point[k]) / f64::from(self.counts[k] << DEPTH);
        DVec2::new(share(0), share(1)) * self.size
    }

    /// Texels along each axis, with `more` halvings along them.
    pub(super) fn texels(&self, more: [u8; 2]) -> [usize; 2] {
        match self.single {
            true => [1, 1],
            false => [0, 1].map(|k| ((self.counts[k] as usize) << (self.finest[k] + more[k])) + 1),
        }
    }
}

/// How far light in a cell is from what its corners say.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ChartCellError {
    /// Mean square of the colour difference, as far as it is known.
    pub(super) square: f64,
    /// Was it looked at, or is it only expected?
    pub(super) tested: bool,
    /// Colour difference in the middles of the edges along each axis, and in the cell, if tested.
    pub(super) bent: [f64; 2],
    pub(super) inside: f64,
    /// How much of what the solved light told of the cell around this one proved true.
    pub(super) trust: f64,
}

/// A rectangle of a chart.
#[derive(Debug, Clone)]
pub(super) struct ChartCell {
    pub(super) chart: u32,
    /// The corner with the least coordinates, on the finest possible lattice.
    pub(super) low: [u32; 2],
    /// Halvings along each axis.
    pub(super) level: [u8; 2],
    /// Which of the chart's triangles lie in it in part.
    pub(super) facets: Vec<u32>,
    /// Which of the chart's hints lie in it.
    pub(super) hints: Vec<u32>,
    /// Area of the chart in it, in the plane.
    pub(super) area: f64,
    /// Share of the area that counts, see `hierarchy::counted`.
    pub(super) counts: f64,
    pub(super) doubt: ChartCellError,
}

impl ChartCell {
    /// Steps of the finest possible lattice along each axis.
    pub(super) fn span(&self) -> [u32; 2] {
        self.level.map(|level| 1 << (DEPTH - u32::from(level)))
    }

    /// A place by shares of the span along each axis, in halves.
    pub(super) fn point(&self, halves: [u32; 2]) -> [u32; 2] {
        let span = self.span();
        [0, 1].map(|k| self.low[k] + span[k] / 2 * halves[k])
    }

    /// Corners: the least, along the first axis, along the second, both.
    pub(super) fn corners(&self) -> [[u32; 2]; 4] {
        [[0, 0], [2, 0], [0, 2], [2, 2]].map(|halves| self.point(halves))
    }

    /// Shares of the way through the cell along each axis.
    pub(super) fn share(&self, lattice: &Lattice, at: DVec2) -> DVec2 {
        let [low, high] = [self.point([0, 0]), self.point([2, 2])].map(|p| lattice.at(p));
        (at - low) / (high - low)
    }

    /// Area that counts.
    pub(super) fn counted(&self) -> f64 {
        self.area * self.counts
    }

    /// Counted area that a look at a corner, in the middle of an edge or inside stands for.
    pub(super) fn per_look(&self) -> f64 {
        self.counted() / 4.0
    }

    /// Area of the chart in the cell, the triangles that have some of it, and the middle of the largest part.
    pub(super) fn clip(&mut self, chart: &Chart, lattice: &Lattice) -> DVec2 {
        let [low, high] = [self.point([0, 0]), self.point([2, 2])].map(|p| lattice.at(p));
        let least = NOTHING * (high - low).element_product();
        let mut largest = (0.0, 0.5 * (low + high));
        self.area = 0.0;
        self.facets.retain(|&k| {
            let part = clipped(&chart.flat[k as usize], low, high);
            let (area, middle) = centre(&part);
            if area > largest.0 {
                largest = (area, middle);
            }
            self.area += area;
            area > least
        });
        largest.1
    }

    /// Its halves along the axes named; those without any of the chart are left out.
    pub(super) fn split(
        &self,
        chart: &Chart,
        lattice: &Lattice,
        hints: &[DVec2],
        axes: [bool; 2],
    ) -> Vec<Self> {
        let parts = |axis: usize| if axes[axis] { vec![0, 1] } else { vec![0] };
        let mut out = Vec::new();
        for y in parts(1) {
            for x in parts(0) {
                let level = [0, 1].map(|k| self.level[k] + u8::from(axes[k]));
                let low = self.point([x, y]);
                let mut child = Self {
                    low,
                    level,
                    doubt: ChartCellError::default(),
                    ..self.clone()
                };
                child.clip(chart, lattice);
                let [near, far] = [child.point([0, 0]), child.point([2, 2])].map(|p| lattice.at(p));
                child.hints.retain(|&h| {
                    let at = hints[h as usize];
                    at.cmpge(near).all() && at.cmplt(far).all()
                });
                if child.area > 0.0 && !child.facets.is_empty() {
                    out.push(child);
                }
            }
        }
        out
    }
}

/// The first cells of a chart.
pub(super) fn first(
    number: u32,
    chart: &Chart,
    lattice: &Lattice,
    hints: &[DVec2],
) -> Vec<ChartCell> {
    let whole = ChartCell {
        chart: number,
        low: [0, 0],
        level: [0, 0],
        facets: (0..chart.flat.len() as u32).collect(),
        hints: Vec::new(),
        area: chart.area,
        counts: 1.0,
        doubt: ChartCellError::default(),
    };
    if lattice.single {
        let hints = (0..hints.len() as u32).collect();
        return vec![ChartCell { hints, ..whole }];
    }
    let [nx, ny] = lattice.counts;
    let mut cells: Vec<ChartCell> = (0..ny)
        .flat_map(|y| (0..nx).map(move |x| [x << DEPTH, y << DEPTH]))
        .map(|low| ChartCell {
            low,
            facets: Vec::new(),
            ..whole.clone()
        })
        .collect();
    let step = lattice.size / DVec2::new(f64::from(nx), f64::from(ny));
    let bucket = |at: DVec2| {
        let [x, y] = (at / step).to_array();
        [
            (x.max(0.0) as u32).min(nx - 1),
            (y.max(0.0) as u32).min(ny - 1),
        ]
    };
    for (k, [a, b, c]) in chart.flat.iter().enumerate() {
        let [[x0, y0], [x1, y1]] = [a.min(*b).min(*c), a.max(*b).max(*c)].map(bucket);
        for y in y0..=y1 {
            for x in x0..=x1 {
                cells[(y * nx + x) as usize].facets.push(k as u32);
            }
        }
    }
    for (k, at) in hints.iter().enumerate() {
        let [x, y] = bucket(*at);
        cells[(y * nx + x) as usize].hints.push(k as u32);
    }
    for cell in &mut cells {
        cell.clip(chart, lattice);
    }
    cells.retain(|cell| cell.area > 0.0 && !cell.facets.is_empty());
    cells
}

/// Weights of four corners at shares of the way along each axis.
pub(super) fn bilinear(share: DVec2) -> [f64; 4] {
    let [x, y] = share.to_array();
    [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y]
}

/// The part of a triangle in a rectangle (Sutherland and Hodgman 1974).
fn clipped(triangle: &[DVec2; 3], low: DVec2, high: DVec2) -> Vec<DVec2> {
    let mut part = triangle.to_vec();
    for (axis, bound, sign) in [
        (0, low.x, 1.0),
        (0, high.x, -1.0),
        (1, low.y, 1.0),
        (1, high.y, -1.0),
    ] {
        let inside = |p: DVec2| sign * (p[axis] - bound);
        let mut out = Vec::with_capacity(part.len() + 1);
        for k in 0..part.len() {
            let (p, q) = (part[k], part[(k + 1) % part.len()]);
            let (dp, dq) = (inside(p), inside(q));
            if dp >= 0.0 {
                out.push(p);
            }
            if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
                out.push(p + (q - p) * (dp / (dp - dq)));
            }
        }
        part = out;
    }
    part
}

/// Area and centroid of a convex polygon.
fn centre(polygon: &[DVec2]) -> (f64, DVec2) {
    let Some((&first, rest)) = polygon.split_first() else {
        return (0.0, DVec2::ZERO);
    };
    let (mut area, mut sum) = (0.0, DVec2::ZERO);
    for pair in rest.windows(2) {
        let part = 0.5 * (pair[0] - first).perp_dot(pair[1] - first).abs();
        area += part;
        sum += part / 3.0 * (first + pair[0] + pair[1]);
    }
    (area, if area > 0.0 { sum / area } else { first })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_cut_by_a_rectangle() {
        let triangle = [DVec2::ZERO, DVec2::new(2.0, 0.0), DVec2::new(0.0, 2.0)];
        let (area, middle) = centre(&clipped(&triangle, DVec2::ZERO, DVec2::ONE));
        assert!((area - 1.0).abs() < 1e-12);
        assert!((middle - 0.5).abs().max_element() < 1e-12);
        let (area, _) = centre(&clipped(&triangle, DVec2::ONE, DVec2::splat(2.0)));
        assert!(area < 1e-12);
    }

    #[test]
    fn lattices_are_nested() {
        let lattice = Lattice::new(DVec2::new(8.0, 2.0), 4.0, 0.0, 1024);
        assert_eq!(lattice.counts, [2, 1]);
        assert_eq!(lattice.at([2 << DEPTH, 1 << DEPTH]), DVec2::new(8.0, 2.0));
        assert_eq!(lattice.texels([1, 0]), [5, 2]);
        let tube = Lattice::new(DVec2::new(100.0, 1e-3), 4.0, 0.0, 1024);
        assert_eq!(tube.counts, [25, 1]);
        let short = Lattice::new(DVec2::new(100.0, 1e-3), 4.0, 0.0, 8);
        assert_eq!(short.texels([0, 0]), [8, 2]);
    }
}
