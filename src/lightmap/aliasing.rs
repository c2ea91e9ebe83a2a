//! Edges of shadows without steps: a texel next to an edge shows the mean light of its square, not that of its middle.
//!
//! The mean is that of nine places half a texel apart with weights 1/4, 1/8, 1/16 (the linear filter that look-ups use, two
//! texels wide). Some of them were looked at when the cells beside were tested.

use super::cells::{ChartCell, DEPTH, Lattice};
use super::grow::LightmapGrowth;
use super::sampler::LatticeSample;
use super::texels::TexelKey;
use std::collections::BTreeSet;

/// A cell at the finest level whose light is off by this many times what is allowed has an edge in it.
const ROUGH: f64 = 2.0;
/// Share of the looks so far that this may take at the most, roughest cells first.
const SHARE: f64 = 0.5;
/// Places of the lattice that were moved further than this share of a texel show other light.
const MOVED: f64 = 1e-3;

/// Means of the light around texels at edges.
pub(super) type Smoothed = Vec<(TexelKey, Vec<(f64, LatticeSample)>)>;

impl LightmapGrowth<'_> {
    /// Looks around the texels of cells with edges; these texels with their places and weights.
    pub(super) fn smooth(&mut self, allowed: f64, progress: &dyn Fn(usize, usize)) -> Smoothed {
        let is_finest = |c: &ChartCell, l: &Lattice| !l.single && c.level == l.finest;
        let mut rough: Vec<usize> = (0..self.cells.len())
            .filter(|&k| {
                let cell = &self.cells[k];
                let off = cell.doubt.tested && cell.doubt.square > (ROUGH * allowed).powi(2);
                off && is_finest(cell, &self.lattices[cell.chart as usize])
            })
            .collect();
        let square = |k: usize| self.cells[k].doubt.square;
        rough.sort_by(|&a, &b| square(b).total_cmp(&square(a)).then(a.cmp(&b)));
        // A cell shares its corners with three others, and asks for three new places a corner.
        rough.truncate((SHARE * self.sampler.looks.len() as f64 / 3.0) as usize);
        let keys: BTreeSet<TexelKey> = rough
            .iter()
            .flat_map(|&k| self.cells[k].corners().map(|p| (self.cells[k].chart, p)))
            .collect();
        let mut out = Vec::with_capacity(keys.len());
        for (chart, point) in keys {
            let parts = self.around(chart, point);
            out.push(((chart, point), parts));
        }
        self.sampler.looks.complete(progress);
        out
    }

    /// The nine places around a texel, those that are on the chart.
    fn around(&mut self, number: u32, point: [u32; 2]) -> Vec<(f64, LatticeSample)> {
        let lattice = self.lattices[number as usize];
        let half = lattice
            .finest
            .map(|level| 1_i64 << (DEPTH - u32::from(level) - 1));
        let texel = lattice.at(half.map(|h| 2 * h as u32));
        // There are four such places to a texel.
        let area = 0.25 * texel.element_product();
        let mut parts = Vec::with_capacity(9);
        for dy in -1..=1_i64 {
            for dx in -1..=1_i64 {
                let place = [0, 1].map(|k| i64::from(point[k]) + [dx, dy][k] * half[k]);
                let most = lattice.counts.map(|n| i64::from(n) << DEPTH);
                if (0..2).any(|k| place[k] < 0 || place[k] > most[k]) {
                    continue;
                }
                let place = place.map(|p| p as u32);
                let chart = (number, &self.charts[number as usize]);
                let sample = self.sampler.want(chart, &lattice, place, area);
                let moved = (sample.at - lattice.at(place)) / texel;
                if moved.length() <= MOVED || (dx == 0 && dy == 0) {
                    let weight = 0.25 / f64::from(1_u32 << (dx.abs() + dy.abs()));
                    parts.push((weight, sample));
                }
            }
        }
        parts
    }
}
