//! The interpolation error of the output, measured: light between vertices beside light at fresh random points.

use super::grow::{Growth, mix};
use super::write::Settled;
use crate::color::de2000;
use crate::gather::Vertex;
use crate::geometry::sampling::{Pcg, triangle_weights};
use crate::solve::Bake;
use serde::Serialize;

/// Points at the least and at the most, and as a share of the looks so far: the rms is then known to some per cent.
const POINTS: [usize; 2] = [1024, 8192];
const SHARE: usize = 8;
/// What was seen is learnt where its square is this many times what was expected.
const SURPRISE: f64 = 4.0;
/// Distinguishes these random numbers from others.
const SEED: u64 = 0x0067_0f11;

/// Interpolation error of a file: colour differences (CIEDE2000 of a white surface's light under the adaptation white) at
/// random points by area, those left out that something solid covers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interpolation {
    /// Root of the mean square.
    pub rms: f64,
    /// Mean.
    pub mean: f64,
    /// Value that 95 % of the points do not exceed.
    pub p95: f64,
    /// Points.
    pub points: usize,
    /// What the rms may be: its share of the error asked for.
    pub allowed: f64,
    /// Did the file get as many vertices as are allowed?
    pub capped: bool,
}

impl Interpolation {
    pub(super) fn new(samples: &[Sample], allowed: f64, capped: bool) -> Self {
        let mut off: Vec<f64> = samples.iter().map(|s| s.off).collect();
        off.sort_by(f64::total_cmp);
        let n = off.len().max(1) as f64;
        let rank = (0.95 * off.len() as f64) as usize;
        Self {
            rms: (off.iter().map(|d| d * d).sum::<f64>() / n).sqrt(),
            mean: off.iter().sum::<f64>() / n,
            p95: off.get(rank).copied().unwrap_or(0.0),
            points: off.len(),
            allowed,
            capped,
        }
    }

    /// Is it as small as it has to be?
    pub fn is_met(&self) -> bool {
        self.rms <= self.allowed
    }
}

/// A random point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    cell: usize,
    /// Colour difference.
    off: f64,
}

impl Growth<'_> {
    /// Looks at random points that were never looked at before, one in each stratum of equal area.
    pub(super) fn measured(
        &mut self,
        bake: &Bake,
        settled: &[Settled],
        turn: u64,
        progress: &dyn Fn(usize, usize),
    ) -> Vec<Sample> {
        let count = (self.looks.len() / SHARE).clamp(POINTS[0], POINTS[1]);
        let whole: f64 = self.cells.all.iter().map(|c| c.area).sum();
        if whole <= 0.0 {
            return Vec::new();
        }
        let mut rng = Pcg::new(bake.settings().seed ^ SEED ^ turn << 32);
        let (mut cell, mut upto) = (0, self.cells.all[0].area);
        let mut asked = Vec::with_capacity(count);
        for k in 0..count {
            let target = (k as f64 + rng.f64()) / count as f64 * whole;
            while upto <= target && cell + 1 < self.cells.all.len() {
                cell += 1;
                upto += self.cells.all[cell].area;
            }
            let weights = triangle_weights([rng.f64(), rng.f64()]);
            let of = &self.cells.all[cell];
            let sheet = &self.cells.sheets[of.sheet as usize];
            let vertex = Vertex {
                triangle: of.of.0,
                weights: of.at(weights),
                entry: of.of.1,
            };
            let look = self.looks.want(&vertex, sheet.surface, sheet.back);
            asked.push((cell, weights, look));
        }
        self.looks.complete(progress);
        let white = bake.light().white;
        let sample = |(cell, weights, look): (usize, [f64; 3], u32)| {
            let of = &self.cells.all[cell];
            let seen = self.looks.at(look)?.xyz;
            let light = of.corners.map(|c| {
                let row = settled[of.sheet as usize].rows[c.vertex as usize];
                row.map_or([0.0; 3], |row| bake.lanes().tristimulus(&row))
            });
            let drawn = mix(&light, weights);
            let off = match drawn == seen || white[1] <= 0.0 {
                true => 0.0,
                false => de2000(drawn, seen, white),
            };
            Some(Sample { cell, off })
        };
        asked.into_iter().filter_map(sample).collect()
    }

    /// Takes what was seen at random points for what is to be expected of their triangles, where it is a surprise.
    pub(super) fn learn(&mut self, samples: &[Sample]) {
        for sample in samples {
            let doubt = &mut self.cells.all[sample.cell].doubt;
            let square = sample.off * sample.off;
            if square > SURPRISE * doubt.square {
                doubt.square = square;
                doubt.inside = sample.off as f32;
                doubt.tested = true;
            }
        }
    }

    /// Triangles that are as small as is allowed and still further off than `square`.
    pub(super) fn unfinished(&self, square: f64) -> usize {
        let small = |c: &&super::cells::Cell| c.doubt.square > square && self.is_smallest(c);
        self.cells.all.iter().filter(small).count()
    }
}
