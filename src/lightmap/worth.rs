//! Which cells are looked at or split next: those that bring most for the looks and texels that they take.
//!
//! A chart has texels of one size, so that a cell of a large one may ask for a hundred thousand of them where all of a small chart has four.
//! By their shares of the error alone a dozen walls of a garage took the texels of 4,000 things.

use super::cells::{ChartCell, DEPTH};
use super::grow::{LightmapGrowth, share, taken};
use super::maps::MARGIN;
use crate::mesh::turns::{BENDS, EXCESS, largest};

/// Looks at a cell before it is split, or at the corners of its parts.
const LOOKS_AT_CELL: f64 = 5.0;

impl LightmapGrowth<'_> {
    /// The cells that bring most for what they take, as many as make up the excess.
    pub(super) fn pick(&self, excess: f64) -> Vec<usize> {
        let mut left_texels = self.budget.texels.saturating_sub(self.texels());
        let mut left = EXCESS * excess;
        let mut picked = Vec::new();
        let mut raised = vec![[0; 2]; self.lattices.len()];
        for (_, k) in largest(self.worth(left_texels)) {
            if left <= 0.0 {
                break;
            }
            let cell = &self.cells[k];
            if let Some(axes) = self.axes(cell).filter(|_| cell.doubt.tested) {
                // What a chart has more of serves all cells that ask for it.
                let before = raised[cell.chart as usize];
                let more = self.more(cell, axes);
                let both = [0, 1].map(|k| before[k].max(more[k]));
                let added = self.added(cell, both) - self.added(cell, before);
                if added > left_texels {
                    continue;
                }
                (raised[cell.chart as usize], left_texels) = (both, left_texels - added);
            }
            left -= share(cell);
            picked.push(k);
        }
        picked
    }

    /// For every cell that can be looked at or split its share of the error by what that takes, in texels: looks are worth as many as there
    /// may be for each, and what a chart must have more of is paid for by all cells that ask for it, in proportion to their shares.
    fn worth(&self, left_texels: usize) -> Vec<(f64, usize)> {
        let looks = LOOKS_AT_CELL * self.budget.texels as f64 / self.budget.looks as f64;
        let open = |(k, cell): (usize, &ChartCell)| {
            let added = match cell.doubt.tested {
                true => self.added(cell, self.more(cell, self.axes(cell)?)),
                false => 0,
            };
            (share(cell) > 0.0 && added <= left_texels).then_some((k, added))
        };
        let open: Vec<(usize, usize)> = self.cells.iter().enumerate().filter_map(open).collect();
        let mut asking = vec![0.0; self.charts.len()];
        for &(k, _) in open.iter().filter(|(_, added)| *added > 0) {
            asking[self.cells[k].chart as usize] += share(&self.cells[k]);
        }
        let worth = |(k, added): (usize, usize)| {
            let (cell, own) = (&self.cells[k], share(&self.cells[k]));
            let texels = match added {
                0 => 0.0,
                added => added as f64 * own / asking[cell.chart as usize],
            };
            (own / (looks + texels), k)
        };
        open.into_iter().map(worth).collect()
    }

    /// Halvings that a chart lacks for a cell to be split along some axes.
    pub(super) fn more(&self, cell: &ChartCell, axes: [bool; 2]) -> [u8; 2] {
        let lattice = &self.lattices[cell.chart as usize];
        [0, 1].map(|k| u8::from(axes[k] && cell.level[k] == lattice.finest[k]))
    }

    /// Texels that a cell's chart takes more with such halvings; a chart of a single one gets texels along its axes first.
    fn added(&self, cell: &ChartCell, more: [u8; 2]) -> usize {
        let lattice = &self.lattices[cell.chart as usize];
        let then = match lattice.single && more != [0, 0] {
            true => taken(&lattice.opened(), [0, 0]),
            false => taken(lattice, more),
        };
        then - taken(lattice, [0, 0])
    }

    /// The axes along which a tested cell is to be split; none if the page has no room for it.
    pub(super) fn axes(&self, cell: &ChartCell) -> Option<[bool; 2]> {
        let lattice = &self.lattices[cell.chart as usize];
        let doubt = &cell.doubt;
        let worst = doubt.bent[0].max(doubt.bent[1]);
        let mut axes = match worst >= BENDS * doubt.inside {
            true => doubt.bent.map(|bent| bent >= BENDS * worst),
            false => [true, true],
        };
        for k in (0..2).filter(|_| !lattice.single) {
            let mut more = [0, 0];
            more[k] = u8::from(cell.level[k] == lattice.finest[k]);
            let fits = lattice.texels(more)[k] + 2 * MARGIN <= self.budget.page;
            axes[k] &= fits && u32::from(cell.level[k]) < DEPTH - 1;
        }
        (axes[0] || axes[1]).then_some(axes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::cells::ChartCellError;
    use crate::lightmap::grow::tests::not_begun;
    use crate::transport::tests::baked;

    /// A chart that has to be twice as fine for one cell is worth less than one of few texels, and more for two such cells.
    #[test]
    fn cells_of_a_chart_share_what_it_takes() {
        let bake = baked("two-rooms.glb", 1);
        let mut growth = not_begun(bake);
        let fine = |growth: &LightmapGrowth, c: &ChartCell| {
            let lattice = &growth.lattices[c.chart as usize];
            !lattice.single && lattice.counts.iter().product::<u32>() > 20
        };
        let of_large: Vec<usize> = (0..growth.cells.len())
            .filter(|&k| fine(&growth, &growth.cells[k]))
            .collect();
        let chart = growth.cells[of_large[0]].chart;
        let [one, other] = [of_large[0], of_large[1]];
        assert_eq!(growth.cells[other].chart, chart);
        for cell in &mut growth.cells {
            cell.doubt = ChartCellError::default();
        }
        let bends = ChartCellError {
            square: 1.0,
            tested: true,
            bent: [1.0; 2],
            ..ChartCellError::default()
        };
        growth.cells[one].doubt = bends;
        let alone = growth.worth(100_000);
        growth.cells[other].doubt = bends;
        let both = growth.worth(100_000);
        growth.cells[other].doubt.tested = false;
        let untested = growth.worth(100_000);
        let of = |worth: &[(f64, usize)], k: usize| worth.iter().find(|w| w.1 == k).unwrap().0;
        assert_eq!((alone.len(), both.len()), (1, 2));
        assert!(of(&both, one) > 1.5 * of(&alone, one));
        assert!(of(&untested, other) > of(&both, other));
        assert!(growth.worth(1).iter().all(|w| w.1 == other));
        // What does not count is worth nothing, however far it is off.
        growth.cells[other].counts = 0.0;
        assert!(growth.worth(1).is_empty());
    }
}
