//! The error between the vertices of the output, measured: the light that is drawn there against light at new random points.
//!
//! Where points look by rays, a look errs by chance, and so does what is drawn between looks: that is an error of the file, however much of it was evened
//! out. What looks at the points err by is not. Every point is looked at twice, each time with rays of its own: light drawn there that is off by d differs from
//! one look, whose variance is s^2, by `d^2 + s^2` in the mean square, and s^2 is half the mean square by which the looks differ. Their mean has half of that
//! variance: were differences a straight function of it, twice the difference from the mean less that from one look would be the difference without any.
//! At `--error 1` that is .73 where closer looks find .73 (garage), .68 for .71 (living room); the roots of squares less s^2 have a mean of .53 and .53.

use super::cells::Cell;
use super::grow::{MeshGrowth, PointLooks, mix};
use super::parts::OutputParts;
use super::write::Settled;
use crate::color::seen_difference;
use crate::gather::{Interpolation, LayerLanes};
use crate::geometry::sampling::{Pcg, hash, triangle_weights};
use crate::solve::Bake;

/// Points: the least, the most, and as a share of the looks so far: the mean is then known to some per cent.
pub(crate) const POINTS: [usize; 2] = [512, 4096];
pub(crate) const SHARE: usize = 16;
/// A measured square is learnt if it is this many times what was expected.
pub(crate) const SURPRISE: f64 = 4.0;
/// A single point must differ by this many times the variance of a look to count.
pub(crate) const CHANCE: f64 = 4.0;
/// Distinguishes these random numbers from others.
const SEED: u64 = 0x0067_0f11;

/// The error of a file between its vertices or texels, from samples; `allowed`, `may_bend`: what its mean may be, and what light may bend by.
pub(crate) fn summed(
    samples: &[ErrorSample],
    [allowed, may_bend]: [f64; 2],
    capped: Option<usize>,
) -> Interpolation {
    let mut off: Vec<f64> = samples.iter().map(|s| s.off).collect();
    off.sort_by(f64::total_cmp);
    let n = off.len().max(1) as f64;
    let rank = (0.95 * off.len() as f64) as usize;
    let square = samples.iter().map(|s| s.square).sum::<f64>() / n;
    let noise = samples.iter().map(|s| s.noise).sum::<f64>() / n;
    let bends = |s: &ErrorSample| s.bend.abs().sqrt().copysign(s.bend);
    Interpolation {
        rms: square.max(0.0).sqrt(),
        mean: (off.iter().sum::<f64>() / n).max(0.0),
        bends: (samples.iter().map(bends).sum::<f64>() / n).max(0.0),
        p95: off.get(rank).map_or(0.0, |off| off.max(0.0)),
        noise: noise.sqrt(),
        points: off.len(),
        allowed,
        may_bend,
        capped,
    }
}

/// A random point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ErrorSample {
    pub(crate) cell: usize,
    /// Colour difference of what is drawn there, and its square; below 0 by chance.
    pub(crate) off: f64,
    pub(crate) square: f64,
    /// The same without what chance makes of what is drawn.
    pub(crate) bend: f64,
    /// Variance of a look.
    pub(crate) noise: f64,
}

impl ErrorSample {
    /// Light drawn in a cell against two looks there, by the colour difference between two lights. `variance`: that of what is drawn, by chance, in variances
    /// of a look, before it was evened out.
    pub(crate) fn new(
        cell: usize,
        (drawn, [one, two]): ([f64; 3], [[f64; 3]; 2]),
        variance: f64,
        difference: impl Fn([f64; 3], [f64; 3]) -> f64,
    ) -> Self {
        let noise = 0.5 * difference(one, two).powi(2);
        let apart = [one, two].map(|look| difference(drawn, look));
        let mean = [0, 1, 2].map(|c| 0.5 * (one[c] + two[c]));
        let square = 0.5 * (apart[0].powi(2) + apart[1].powi(2)) - noise;
        Self {
            cell,
            off: 2.0 * difference(drawn, mean) - 0.5 * (apart[0] + apart[1]),
            square,
            bend: square - variance * noise,
            noise,
        }
    }
}

impl MeshGrowth<'_> {
    /// Looks at new random points, one in each stratum of equal counted area.
    pub(super) fn measured(
        &mut self,
        bake: &Bake,
        settled: &[Settled],
        turn: u64,
        progress: &dyn Fn(usize, usize),
    ) -> Vec<ErrorSample> {
        // The first only tells how much looks err by chance.
        let count = match self.looks.is_late() || turn == 0 {
            true => POINTS[0],
            false => (self.looks.len() / SHARE).clamp(POINTS[0], POINTS[1]),
        };
        let whole: f64 = self.cells.all.iter().map(Cell::counted).sum();
        if whole <= 0.0 {
            return Vec::new();
        }
        let mut rng = Pcg::new(bake.settings().seed ^ SEED ^ turn << 32);
        let (mut cell, mut upto) = (0, self.cells.all[0].counted());
        let all = settled.iter();
        let mut parts: Vec<OutputParts> = all
            .map(|s| OutputParts::new(&s.triangles, &s.together))
            .collect();
        let mut asked = Vec::with_capacity(count);
        for k in 0..count {
            let target = (k as f64 + rng.f64()) / count as f64 * whole;
            while upto <= target && cell + 1 < self.cells.all.len() {
                cell += 1;
                upto += self.cells.all[cell].counted();
            }
            let weights = triangle_weights([rng.f64(), rng.f64()]);
            let of = &self.cells.all[cell];
            let sheet = &self.cells.sheets[of.sheet as usize];
            let rng_seed = turn << 32 | k as u64;
            let vertex = self.cells.divided.place(of.of, of.at(weights));
            let mut look = |turn: u64| {
                let seed = hash(bake.settings().seed ^ SEED, 2 * rng_seed + turn);
                self.looks.again(&vertex, sheet.surface, sheet.back, seed)
            };
            let looks = [look(0), look(1)];
            let drawn = &settled[of.sheet as usize];
            let at = of.corners.map(|c| drawn.at[c.vertex as usize]);
            let point = (0..3).map(|k| weights[k] * at[k]).sum();
            let first = self.cells.divided.first(of.of);
            let part = parts[of.sheet as usize].find(&drawn.at, first, point);
            asked.extend(part.map(|part| (cell, part, looks)));
        }
        // However late it is, the error that is stated is measured.
        self.looks.patient = true;
        self.looks.complete(progress);
        self.looks.patient = false;
        self.asked = asked;
        self.compared(bake, settled, None)
    }

    /// The last measurement for each layer by itself, under the white of the whole.
    pub(super) fn of_layers(
        &self,
        bake: &Bake,
        settled: &[Settled],
        allowed: [f64; 2],
    ) -> Vec<Interpolation> {
        let one = |lanes| summed(&self.compared(bake, settled, Some(lanes)), allowed, None);
        bake.layer_lanes().iter().map(one).collect()
    }

    /// Light drawn at the points of the last measurement against light seen there: all light, or that of a layer.
    fn compared(
        &self,
        bake: &Bake,
        settled: &[Settled],
        part: Option<&LayerLanes>,
    ) -> Vec<ErrorSample> {
        let white = bake.light().white;
        let shown = |row: &[f32; 64]| match part {
            Some(lanes) => bake.lanes().tristimulus(&lanes.of(row)),
            None => bake.lanes().tristimulus(row),
        };
        let difference = |a, b| seen_difference(a, b, white);
        let sample = |&(cell, (corners, weights), looks): &PointLooks| {
            let sheet = self.cells.all[cell].sheet as usize;
            let settled = &settled[sheet];
            let [one, two] = looks.map(|look| self.looks.at(look).map(|seen| shown(&seen.row)));
            let (one, two) = (one?, two?);
            let light =
                corners.map(|v| settled.rows[v as usize].map_or([0.0; 3], |row| shown(&row)));
            let drawn = mix(&light, weights);
            let variance = self.variance(sheet, corners, weights);
            Some(ErrorSample::new(
                cell,
                (drawn, [one, two]),
                variance,
                difference,
            ))
        };
        self.asked.iter().filter_map(sample).collect()
    }

    /// Sets the expected error of triangles to that seen at random points, where it is a surprise.
    pub(super) fn learn(&mut self, samples: &[ErrorSample]) {
        for sample in samples {
            let doubt = &mut self.cells.all[sample.cell].doubt;
            let square = sample.bend - CHANCE * sample.noise;
            if square > SURPRISE * doubt.square {
                doubt.square = square;
                doubt.inside = square.sqrt() as f32;
                doubt.tested = true;
            }
        }
    }

    /// Number of triangles as small as allowed and still further off than `square`.
    pub(super) fn unfinished(&self, square: f64) -> usize {
        let small = |c: &&Cell| c.doubt.square > square && self.is_smallest(c);
        self.cells.all.iter().filter(small).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is drawn is off by so many standard errors of the looks that tell it.
    #[test]
    fn what_is_drawn_is_off_by_what_looks_do_not_err_by() {
        let mut rng = Pcg::new(5);
        let mut chance = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
        let grey = |x: f64| [x; 3];
        let apart = |a: [f64; 3], b: [f64; 3]| (a[0] - b[0]).abs();
        for (off, low, high) in [(0.0, 0.0, 0.4), (1.0, 0.85, 1.0), (3.0, 2.9, 3.1)] {
            let sample = |_| {
                let looks = [grey(chance()), grey(chance())];
                ErrorSample::new(0, (grey(off), looks), 0.5, apart)
            };
            let samples: Vec<ErrorSample> = (0..20_000).map(sample).collect();
            let found = summed(&samples, [1.0; 2], None);
            assert!((low..high).contains(&found.mean), "{off}: {found:?}");
            assert!((found.rms - off).abs() < 0.15, "{off}: {found:?}");
            assert!((found.noise - 1.0).abs() < 0.05, "{found:?}");
            let bend = samples.iter().map(|s| s.bend).sum::<f64>() / 20_000.0;
            assert!((bend - off * off + 0.5).abs() < 0.15, "{off}: {bend}");
        }
    }
}
