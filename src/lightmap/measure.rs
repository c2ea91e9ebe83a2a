//! The error of a light map, measured: a bilinear look-up beside light at fresh random points.
//!
//! As between vertices (`mesh::measure`): every point is looked at twice, and what looks differ by chance is taken off.

use super::grow::LightmapGrowth;
use super::maps::PlacedCharts;
use super::sampler::LatticeSample as Place;
use crate::geometry::sampling::{Pcg, hash};
use crate::mesh::measure::{CHANCE, ErrorSample, POINTS, SHARE, SURPRISE};
use crate::solve::Bake;
use glam::DVec2;
use std::collections::HashMap;

/// Distinguishes these random numbers from others.
const SEED: u64 = 0x0067_0a55;

/// A random point of a chart, looked at twice.
pub(super) struct TestPoint {
    chart: usize,
    place: Place,
    looks: [u32; 2],
}

impl LightmapGrowth<'_> {
    /// Looks at random points that were never looked at before, one in each stratum of equal counted area.
    pub(super) fn points(
        &mut self,
        bake: &Bake,
        turn: u64,
        progress: &dyn Fn(usize, usize),
    ) -> Vec<TestPoint> {
        let count = match self.sampler.looks.is_late() {
            true => POINTS[0],
            false => (self.sampler.looks.len() / SHARE).clamp(POINTS[0], POINTS[1]),
        };
        let tree = bake.tree();
        if tree.counted() <= 0.0 {
            return Vec::new();
        }
        let mut facets = HashMap::new();
        for (k, chart) in self.charts.iter().enumerate() {
            let of_chart = chart.facets.iter().zip(0_u32..);
            facets.extend(of_chart.map(|(f, facet)| (f.entry as usize, (k, facet))));
        }
        let mut rng = Pcg::new(bake.settings().seed ^ SEED ^ turn << 32);
        let mut points = Vec::with_capacity(count);
        for k in 0..count {
            let share = (k as f64 + rng.f64()) / count as f64;
            let (entry, weights) = tree.random(share, [rng.f64(), rng.f64()]);
            let Some(&(number, facet)) = facets.get(&entry) else {
                continue;
            };
            let chart = &self.charts[number];
            let vertex = chart.vertex(facet, weights);
            let looks = [0, 1].map(|n| {
                let seed = hash(bake.settings().seed ^ SEED, 2 * (turn << 32 | k as u64) + n);
                self.sampler
                    .looks
                    .texel_again(&vertex, chart.surface, chart.back, seed)
            });
            let place = Place {
                look: looks[0],
                at: chart.at(facet, vertex.weights),
                vertex,
            };
            points.push(TestPoint {
                chart: number,
                place,
                looks,
            });
        }
        // However late it is, what is said of the error is measured.
        self.sampler.looks.patient = true;
        self.sampler.looks.complete(progress);
        self.sampler.looks.patient = false;
        points
    }

    /// How far maps are off at points; those that something covers are left out. `ErrorSample::cell` counts points here.
    pub(super) fn compared(&self, points: &[TestPoint], placed: &PlacedCharts) -> Vec<ErrorSample> {
        let cells = self.by_chart();
        let sample = |(cell, point): (usize, &TestPoint)| {
            let [one, two] = point
                .looks
                .map(|look| self.sampler.looks.at(look).map(|s| s.xyz));
            let (one, two) = (one?, two?);
            let drawn = placed
                .look_up(point.chart, point.place.at)
                .irradiance
                .map(f64::from);
            let variance = self.shared(point, &cells);
            let difference = |a, b| self.difference(a, b);
            Some(ErrorSample::new(
                cell,
                (drawn, [one, two]),
                variance,
                difference,
            ))
        };
        points.iter().enumerate().filter_map(sample).collect()
    }

    /// Variance of the light that is drawn at a point, by chance, in variances of a look of the usual effort.
    fn shared(&self, point: &TestPoint, cells: &[Vec<usize>]) -> f64 {
        let of_cell = |k: usize| {
            let cell = &self.cells[k];
            let share = cell.share(&self.lattices[point.chart], point.place.at);
            self.variance(cell, share)
        };
        self.cell_at(point, cells).map_or(1.0, of_cell)
    }

    /// Cells of each chart.
    pub(super) fn by_chart(&self) -> Vec<Vec<usize>> {
        let mut cells = vec![Vec::new(); self.charts.len()];
        for (k, cell) in self.cells.iter().enumerate() {
            cells[cell.chart as usize].push(k);
        }
        cells
    }

    fn cell_at(&self, point: &TestPoint, cells: &[Vec<usize>]) -> Option<usize> {
        let lattice = &self.lattices[point.chart];
        let holds = |k: &usize| {
            let share = self.cells[*k].share(lattice, point.place.at);
            lattice.single || (share.cmpge(DVec2::ZERO).all() && share.cmple(DVec2::ONE).all())
        };
        cells[point.chart].iter().copied().find(holds)
    }

    /// Takes what was seen at random points for what is to be expected of their cells, where it is a surprise.
    pub(super) fn learn(&mut self, points: &[TestPoint], samples: &[ErrorSample]) {
        let cells = self.by_chart();
        for sample in samples {
            let square = sample.bend - CHANCE * sample.noise;
            let Some(cell) = self
                .cell_at(&points[sample.cell], &cells)
                .filter(|_| square > 0.0)
            else {
                continue;
            };
            let doubt = &mut self.cells[cell].doubt;
            if square > SURPRISE * doubt.square {
                doubt.square = square;
                doubt.inside = square.sqrt();
                doubt.tested = true;
            }
        }
    }
}
