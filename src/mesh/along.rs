//! Splits the triangles that growing picks: along edges of shadows where there are any, else at edges over which light
//! bends.

use super::grow::{MeshGrowth, SHRINK, SPLIT};
use super::shades::COVER;

/// For edges of shadows so many triangles may be split once growing is over: a share of all, and so many in a small room. At `--error 1`
/// they are 792 of 9,972 in a sunlit room, 1,949 of 56,989 in a home theatre, 620 of 56,761 in a living room, 429 of 26,457 in a flat. With
/// a third of that the sunlit room kept teeth of 10 cm at a round edge.
const FOR_LINES: f64 = 0.025;
const LINES: usize = 1000;

impl MeshGrowth<'_> {
    /// Splits cells that were looked at; returns the new cells.
    pub(super) fn split(&mut self, tested: &[usize]) -> Vec<usize> {
        let wanted = match self.looking {
            true => tested.iter().map(|&k| (k, self.lamps_of(k))).collect(),
            false => Vec::new(),
        };
        let mut fresh = self.cells.split_along(&self.shades, &wanted, SHRINK);
        for &k in tested {
            if fresh.binary_search(&k).is_err() {
                self.mark(k);
            }
        }
        let bisected = self.cells.split(SHRINK);
        fresh.extend(self.cells.take_sides(&self.shades, bisected));
        fresh.sort_unstable();
        fresh.dedup();
        fresh
    }

    /// Carries edges of shadows on to their ends, whatever the error is: half a line is visible. Splits at most [`FOR_LINES`] of all
    /// triangles, however often it is called, and no more than a limit of vertices that was asked for allows.
    pub(super) fn finish_lines(&mut self, progress: &dyn Fn(usize, usize)) {
        if !self.looking || self.looks.is_late() {
            return;
        }
        let all = (FOR_LINES * self.cells.all.len() as f64) as usize + LINES;
        let most = (all.saturating_sub(self.for_lines)).min(self.left_of_limit() / SPLIT);
        let late = || self.looks.is_late();
        let (fresh, split) = (self.cells).finish_lines(&self.shades, most, SHRINK, &late);
        self.for_lines += split;
        self.expect(&fresh, false, progress);
    }

    /// Lamps whose shadow would matter in a cell, and [`COVER`] if anything covers part of the cell.
    fn lamps_of(&self, k: usize) -> u64 {
        let cell = &self.cells.all[k];
        let light = self.light(k);
        let mean = [0, 1, 2].map(|c| (light[0][c] + light[1][c] + light[2][c]) / 3.0);
        let least = self.allowed;
        let shows = |more: [f64; 3]| {
            let brighter = [0, 1, 2].map(|c| mean[c] + more[c]);
            self.difference(mean, brighter) > least
        };
        let at = |w| self.shades.place(&self.cells, cell, cell.at(w));
        let places = [
            [0.8, 0.1, 0.1],
            [0.1, 0.8, 0.1],
            [0.1, 0.1, 0.8],
            [1.0 / 3.0; 3],
        ]
        .map(at);
        let hidden = |vertex: u32| {
            let look = self.look(cell.sheet as usize, vertex);
            look.is_some_and(|look| self.looks.at(look).is_none())
        };
        let mut around = cell.corners.iter().map(|c| c.vertex);
        let middles = (0..3).filter_map(|e| self.cells.known_middle(cell, e));
        let covered = around.any(hidden) || middles.into_iter().any(hidden);
        self.shades.that_matter(&places, shows) | if covered { COVER } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::GatherQuality;
    use crate::transport::tests::baked;

    /// Any place close enough to an edge that is known passed for a bend of it, and in every part of the triangle again: this room
    /// had 36,000 triangles more after nine steps, and no end.
    #[test]
    fn lines_come_to_an_end() {
        let bake = baked("furnished.glb", 1);
        let mut growth = bake.growth(GatherQuality::Preview, &|| false);
        growth.allowed = 1.0;
        growth.begin(&|_, _| {});
        let goal = 0.1 * growth.sum();
        growth.grow(goal, &|_, _| {});
        let split = growth.for_lines;
        let (_, more) = (growth.cells).finish_lines(&growth.shades, 10_000, SHRINK, &|| false);
        assert!(split > 100 && more < 50, "{split}, {more}");
    }
}
