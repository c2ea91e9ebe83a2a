//! Light at the rims of what stands on a surface or hovers before it.
//!
//! At the foot of a thing light falls off within a centimetre. A vertex there with its own light darkens everything as far as the next vertex:
//! rays ran from the corners of a garage's oil stain, a millimetre thick, half a metre over the floor. So a vertex at a rim takes more light, by least
//! squares along the edges that lead away, whose middles are looked at for this; and takes it from the middle that is nearest to that, so that it has the
//! colours of the surroundings and keeps them when lamps change.

use super::cells::Cell;
use super::grow::MeshGrowth;
use std::collections::{HashMap, HashSet};

/// Points at which spaces of one side of a surface meet, with the number of its sheet.
pub(super) type Rims = HashSet<(u32, u32)>;

impl MeshGrowth<'_> {
    /// Finds the rims.
    pub(super) fn rims(&self) -> Rims {
        let spaces = self.looks.spaces();
        let mut first = HashMap::new();
        let corners = self.cells.all.iter().flat_map(|cell| {
            let space = spaces.get(cell.of.1 as usize).copied().unwrap_or_default();
            cell.corners.map(|c| ((cell.sheet, c.point), space))
        });
        corners
            .filter(|&(at, space)| *first.entry(at).or_insert(space) != space)
            .map(|(at, _)| at)
            .collect()
    }

    /// If a corner of a cell is at a rim: edges of the cell that lead away from there, each with the corner at its other end; no edge below things.
    pub(super) fn rim_edges(&self, rims: &Rims, cell: &Cell, k: usize) -> Option<Vec<[usize; 2]>> {
        let at = cell.corners.map(|c| rims.contains(&(cell.sheet, c.point)));
        let edges = [[k, (k + 1) % 3], [(k + 2) % 3, (k + 2) % 3]];
        let away = |[_, other]: &[usize; 2]| !at[*other] && !cell.covered;
        at[k].then(|| edges.into_iter().filter(away).collect())
    }

    /// Looks at the middles of edges from rims over which light differs by more than is allowed.
    pub(super) fn look_from_rims(&mut self, progress: &dyn Fn(usize, usize)) {
        if !self.looking || self.looks.is_late() {
            return;
        }
        let rims = self.rims();
        for k in 0..self.cells.all.len() {
            let light = self.light(k);
            for a in 0..3 {
                let edges = self.rim_edges(&rims, &self.cells.all[k], a);
                for [edge, b] in edges.into_iter().flatten() {
                    if self.difference(light[a], light[b]) > self.allowed {
                        let middle = self.cells.middle(k, edge);
                        let cell = &self.cells.all[k];
                        let (sheet, area) = (cell.sheet as usize, cell.per_look());
                        self.want(sheet, middle, area);
                    }
                }
            }
        }
        self.looks.complete(progress);
    }
}

/// What a vertex at a rim lacks by an edge that leads from it, given its light, that at the other end and that in the middle. The line that is
/// right in the middle is the best one for light that is that of the other end everywhere but at the rim; for light of the second degree half of
/// that is, and of a straight line nothing. No vertex is made brighter than the middle, or streaks run from rims in half shadow.
pub(super) fn lacks([own, other, middle]: [f64; 3]) -> f64 {
    let most = (middle - own + (middle - other).min(0.0)).max(0.0);
    match most > 0.0 {
        true => most * most / most.max(other - own),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By least squares over the edge, the other end given.
    #[test]
    fn the_best_line_lacks_nothing_half_or_all() {
        let best = |light: fn(f64) -> f64| {
            let n = 10_000;
            let (mut above, mut below) = (0.0, 0.0);
            for k in 0..n {
                let x = (f64::from(k) + 0.5) / f64::from(n);
                above += (1.0 - x) * (light(x) - x * light(1.0));
                below += (1.0 - x) * (1.0 - x);
            }
            above / below
        };
        let straight = |x: f64| 2.0 + 3.0 * x;
        let curve = |x: f64| 2.0 + 3.0 * (2.0 * x - x * x);
        let foot = |x: f64| if x > 0.0 { 5.0 } else { 2.0 };
        for light in [straight, curve, foot] {
            let own = 2.0 + lacks([light(0.0), light(1.0), light(0.5)]);
            let best = best(light);
            assert!((own - best).abs() < 1e-3, "{own} for {best}");
        }
        assert_eq!(lacks([2.0, 1.0, 4.0]), 2.0);
        assert_eq!(lacks([2.0, 5.0, 1.0]), 0.0);
    }
}
