//! Hinges of a map: three places of a lattice in a row, see [`evened`].

use super::grow::LightmapGrowth;
use crate::mesh::smooth::{Hinge, evened};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Places no further apart than this share of a chart are one.
const ROUNDING: f64 = 1e-9;

/// A place of a lattice and an axis: the nearest place before it and the nearest behind it on that axis, as far as they are known.
type LatticeRows = BTreeMap<(usize, [u32; 2]), [Option<[u32; 2]>; 2]>;

impl LightmapGrowth<'_> {
    /// Evens out what looks differ by chance.
    pub(super) fn even_out(&mut self) {
        let looks = &self.sampler.looks;
        let light = evened(looks, (self.noise, self.white[1]), |errors| {
            self.hinges(errors)
        });
        let factor = |(look, light): (u32, f64)| match looks.at(look).map(|seen| seen.xyz[1]) {
            Some(own) if own > 0.0 => (light / own) as f32,
            _ => 1.0,
        };
        self.factors = (0..).zip(light).map(factor).collect();
    }

    /// Three looks in a row, on all charts.
    fn hinges(&self, errors: &[f64]) -> Vec<Hinge> {
        let of_chart = |(chart, cells): (usize, &Vec<usize>)| {
            let (chart, mut hinges) = (chart as u32, Vec::new());
            for ((axis, at), beside) in self.rows(cells) {
                let looks = [beside[0], beside[1], Some(at)].map(|p| self.unmoved(chart, p?));
                let ([Some(low), Some(high)], [Some(a), Some(b), Some(own)]) = (beside, looks)
                else {
                    continue;
                };
                let way = |to: [u32; 2]| f64::from(to[axis].abs_diff(at[axis]));
                let share = way(low) / (way(low) + way(high));
                let weights = [1.0 - share, share, -1.0, 0.0];
                hinges.extend(Hinge::new([a, b, own, own], weights, errors));
            }
            hinges
        };
        let charts = self.by_chart();
        let charts = charts.par_iter().enumerate();
        charts.flat_map_iter(of_chart).collect()
    }

    /// The nearest places beside each that was looked at, along edges of cells and through their middles.
    fn rows(&self, cells: &[usize]) -> LatticeRows {
        let mut rows = LatticeRows::new();
        for cell in cells.iter().map(|&k| &self.cells[k]) {
            for (axis, across) in [0, 1]
                .into_iter()
                .flat_map(|axis| [0, 1, 2].map(|a| (axis, a)))
            {
                let place = |along| match axis {
                    0 => cell.point([along, across]),
                    _ => cell.point([across, along]),
                };
                let is_known = |point: &[u32; 2]| self.unmoved(cell.chart, *point).is_some();
                let places = [0, 1, 2].map(place).into_iter();
                let mut known: Vec<[u32; 2]> = places.filter(is_known).collect();
                // The smallest cells have no middles.
                known.dedup();
                for two in known.windows(2) {
                    let mut nearer = |at: [u32; 2], side: usize, other: [u32; 2]| {
                        let beside = &mut rows.entry((axis, at)).or_default()[side];
                        let way = |to: [u32; 2]| to[axis].abs_diff(at[axis]);
                        if beside.is_none_or(|before| way(other) < way(before)) {
                            *beside = Some(other);
                        }
                    };
                    nearer(two[0], 1, two[1]);
                    nearer(two[1], 0, two[0]);
                }
            }
        }
        rows
    }

    /// The look at a place of a lattice, if it was seen there and not beside.
    fn unmoved(&self, chart: u32, point: [u32; 2]) -> Option<u32> {
        let lattice = &self.lattices[chart as usize];
        let sample = self.sampler.known(chart, lattice, point)?;
        let off = sample.at.distance(lattice.at(point));
        let is_there =
            !lattice.single && off <= ROUNDING * self.charts[chart as usize].size.length();
        let light = self.sampler.looks.at(sample.look)?.xyz[1];
        (is_there && light > 0.0).then_some(sample.look)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::grow::tests::begun;
    use crate::mesh::measure::summed;
    use crate::transport::tests::baked;

    /// Among cells of all sizes, also where a large one lies beside small ones.
    #[test]
    fn straight_light_bends_over_no_hinge() {
        let bake = baked("cornell.glb", 1);
        let mut growth = begun(bake);
        growth.grow(0.5 * growth.sum(), &|_, _| {});
        let mut light = vec![0.0; growth.sampler.looks.len()];
        for cell in &growth.cells {
            let lattice = &growth.lattices[cell.chart as usize];
            for point in [0, 1, 2]
                .into_iter()
                .flat_map(|x| [0, 1, 2].map(|y| [x, y]))
            {
                let known = growth.sampler.known(cell.chart, lattice, cell.point(point));
                if let Some(sample) = known {
                    light[sample.look as usize] = 5.0 + 3.0 * sample.at.x - 2.0 * sample.at.y;
                }
            }
        }
        let hinges = growth.hinges(&vec![1.0; light.len()]);
        assert!(hinges.len() > growth.cells.len(), "{}", hinges.len());
        assert!(hinges.iter().all(|hinge| hinge.bend(&light).abs() < 1e-9));
    }

    /// As it is drawn, at points between texels.
    #[test]
    fn evened_light_is_nearer_to_the_truth() {
        let bake = baked("furnished.glb", 2);
        let mut growth = begun(bake);
        growth.grow(growth.seen_area(), &|_, _| {});
        let points = growth.points(bake, 1, &|_, _| {});
        let drawn = |growth: &LightmapGrowth| {
            let placed = bake.placed(growth, &Vec::new(), None).0;
            summed(&growth.compared(&points, &placed), [1.0; 2], None)
        };
        let seen = drawn(&growth);
        growth.noise = seen.noise * seen.noise;
        growth.even_out();
        let evened = drawn(&growth);
        assert!(evened.mean < seen.mean, "{evened:?} {seen:?}");
        let factor = |look| f64::from(growth.factors[look as usize]);
        // And the map shows it.
        let placed = bake.placed(&growth, &Vec::new(), None).0;
        let mut moved = 0;
        for cell in &growth.cells {
            let lattice = &growth.lattices[cell.chart as usize];
            if lattice.single || cell.level != lattice.finest {
                continue;
            }
            for corner in cell.corners() {
                let Some(look) = growth.unmoved(cell.chart, corner) else {
                    continue;
                };
                let light = factor(look) * growth.sampler.looks.at(look).unwrap().xyz[1];
                let texel = placed.look_up(cell.chart as usize, lattice.at(corner));
                let shown = f64::from(texel.irradiance[1]);
                assert!((shown - light).abs() <= 1e-4 * light, "{shown} {light}");
                moved += usize::from((factor(look) - 1.0).abs() > 0.01);
            }
        }
        assert!(moved > 100, "{moved}");
    }
}
