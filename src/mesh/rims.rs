//! Light at the rims of what stands on a surface or hovers before it.
//!
//! At the foot of a thing light falls off within a centimetre. A vertex there with its own light darkens everything as far as the next vertex:
//! rays ran from the corners of a garage's oil stain, a millimetre thick, half a metre over the floor. So a vertex at a rim takes the light with which
//! lines to its neighbours are right in their middles, on average by area, if that is brighter. The middles are looked at for this. With it a garage,
//! a living room, a furnished one and a gallery of wide spaces have root mean square errors of 1.69, 1.28, 1.14 and .91 at `--error 1`, without
//! it 1.70, 1.27, 1.20 and 1.03, a sunlit room .60 for .53: it is for the eye, and costs 2 % of the time at the most.

use super::cells::Corner;
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

    /// Edges of a cell that lead away from a rim: the corner at the rim, the other, and the number of the edge.
    pub(super) fn rim_edges(
        &self,
        rims: &Rims,
        k: usize,
    ) -> impl Iterator<Item = [usize; 3]> + use<> {
        let cell = &self.cells.all[k];
        let at_rim = |corner: Corner| rims.contains(&(cell.sheet, corner.point));
        let at = cell.corners.map(|c| !cell.covered && at_rim(c));
        let edges = (0..3).map(|e| [e, (e + 1) % 3]);
        edges
            .flat_map(|[a, b]| [[a, b, a], [b, a, a]])
            .filter(move |&[rim, other, _]| at[rim] && !at[other])
    }

    /// What a vertex at a rim lacks by an edge of the mesh that leads from it, given its light, that at the other end and that in the middle: lines should
    /// be right in the middle, but no vertex is brighter than the middle, or streaks run from rims in half shadow.
    pub(super) fn lacks([own, other, middle]: [f64; 3]) -> f64 {
        middle - own + (middle - other).min(0.0)
    }

    /// Looks at the middles of edges from rims over which light differs by more than is allowed.
    pub(super) fn look_from_rims(&mut self, progress: &dyn Fn(usize, usize)) {
        if !self.looking || self.looks.is_late() {
            return;
        }
        let rims = self.rims();
        for k in 0..self.cells.all.len() {
            let light = self.light(k);
            for [a, b, e] in self.rim_edges(&rims, k) {
                if self.difference(light[a], light[b]) > self.allowed {
                    let middle = self.cells.middle(k, e);
                    self.want(self.cells.all[k].sheet as usize, middle);
                }
            }
        }
        self.looks.complete(progress);
    }
}
