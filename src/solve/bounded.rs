//! Guaranteed control of the lanes: on the model of the room, with all interreflections, no cut is taken whose error may
//! exceed the tolerance.
//!
//! Every patch of the model carries the record of `spectrum::Bounded` for each light and interval: value, errors, and how
//! far these may be off. `H = P + sum F (E + rho H)` is summed bounce by bounce, with the products and sums of that
//! record, and the tail of the series is bounded by `last bounce * r / (1 - r)`, r the greatest albedo times the greatest
//! row sum. The bound covers what the *lanes* do to the colours of the model (to first order in CIELUV), nothing else; it
//! is some 3 to 6 times the true error, as in the paper's own tests.

use super::coarse::Coarse;
use super::cuts::{CutChoice, split_worst};
use crate::color::{KM, luv_jacobian};
use crate::scene::LightSpectrum;
use crate::spectrum::{
    BANDS, Bounded, CmfTree, DyadicTree, Interval, Metric, Partition, Spectrum, node,
};

/// Bounces at the most.
const BOUNCES: usize = 400;
/// The tail of the series may be this share of the greatest ratio.
const TAIL: f64 = 1e-6;

/// What the model's patches are made of, under one light.
struct LightTrees {
    cmf: CmfTree,
    reflectance: Vec<DyadicTree<Bounded>>,
    /// What passes sheets: a patch, the patch behind it, and the transmittance between them.
    through: Vec<([u32; 2], DyadicTree<Bounded>)>,
    emission: Vec<Option<DyadicTree<Bounded>>>,
    punctual: Vec<Option<DyadicTree<Bounded>>>,
}

impl LightTrees {
    /// What a bounce multiplies light by at the most: greatest albedo times greatest row sum.
    fn ratio(&self, factors: &[Vec<(usize, f64)>]) -> f64 {
        let mut albedo: Vec<f64> = self.reflectance.iter().map(|t| t.node(1).high).collect();
        for ([patch, _], through) in &self.through {
            albedo[*patch as usize] += through.node(1).high;
        }
        let sums = factors.iter().map(|row| row.iter().map(|f| f.1).sum());
        (albedo.into_iter().fold(0.0, f64::max) * sums.fold(0.0, f64::max)).min(0.999)
    }

    /// Radiosity of every patch by the light that arrives, on intervals that are these nodes of a spectrum's tree.
    fn reflect(&self, arrives: &[Vec<Bounded>], nodes: &[usize]) -> Vec<Vec<Bounded>> {
        let times = |row: &[Bounded], by: &DyadicTree<Bounded>| -> Vec<Bounded> {
            let lanes = row.iter().zip(nodes);
            lanes
                .map(|(x, &n)| x.times(by.node(n), self.cmf.node(n)))
                .collect()
        };
        let reflected = arrives.iter().zip(&self.reflectance);
        let mut sent: Vec<Vec<Bounded>> = reflected.map(|(row, rho)| times(row, rho)).collect();
        for ([patch, behind], through) in &self.through {
            let passes = times(&arrives[*behind as usize], through);
            for (s, x) in sent[*patch as usize].iter_mut().zip(&passes) {
                *s = s.plus(1.0, x);
            }
        }
        sent
    }
}

/// `base + sum F from`, patch by patch.
fn gather(
    factors: &[Vec<(usize, f64)>],
    base: &[Vec<Bounded>],
    from: &[Vec<Bounded>],
) -> Vec<Vec<Bounded>> {
    base.iter()
        .zip(factors)
        .map(|(base, row)| {
            let mut sum = base.clone();
            for &(other, factor) in row {
                for (s, x) in sum.iter_mut().zip(&from[other]) {
                    *s = s.plus(factor, x);
                }
            }
            sum
        })
        .collect()
}

impl Coarse {
    /// The shortest cuts found whose bound of the mean colour difference is within `tolerance`.
    pub(super) fn choose_bounded(
        &self,
        spectra: &[LightSpectrum],
        weights: &[Spectrum; 3],
        white: [f64; 3],
        tolerance: f64,
    ) -> CutChoice {
        let all = CmfTree::new(*weights);
        let lights: Vec<LightTrees> = (0..spectra.len())
            .map(|light| {
                let cmf = all.under(&spectra[light].power);
                let trees = |rows: &[Spectrum]| -> Vec<DyadicTree<Bounded>> {
                    rows.iter().map(|row| DyadicTree::new(row, &cmf)).collect()
                };
                let shown = |rows: &[Spectrum]| -> Vec<Option<DyadicTree<Bounded>>> {
                    rows.iter()
                        .map(|row| {
                            row.iter()
                                .any(|&x| x > 0.0)
                                .then(|| DyadicTree::new(row, &cmf))
                        })
                        .collect()
                };
                let through = self.through.iter();
                LightTrees {
                    through: through
                        .map(|(pair, t)| (*pair, DyadicTree::new(t, &cmf)))
                        .collect(),
                    reflectance: trees(&self.reflectance),
                    emission: shown(&self.emission[light]),
                    punctual: shown(&self.punctual[light]),
                    cmf,
                }
            })
            .collect();
        let white = white.map(|x| x / KM);
        let mut cuts = vec![Partition::ROOT; spectra.len()];
        loop {
            let (error, harm) = self.bound(&lights, &cuts, white);
            let count: usize = cuts.iter().map(|c| c.count()).sum();
            if error <= tolerance || count >= BANDS || harm.is_empty() {
                return CutChoice { cuts, error };
            }
            split_worst(&mut cuts, harm, count);
        }
    }

    /// Bound of the mean colour difference, and the intervals that can be split (light, first band) by what they may
    /// cause, the worst first.
    fn bound(
        &self,
        lights: &[LightTrees],
        cuts: &[Partition],
        white: [f64; 3],
    ) -> (f64, Vec<(usize, usize)>) {
        let rows: Vec<Vec<Vec<Bounded>>> = lights
            .iter()
            .zip(cuts)
            .map(|(lit, cut)| self.bounces(lit, *cut))
            .collect();
        let mut mean = 0.0;
        let mut harm: Vec<Vec<f64>> = cuts.iter().map(|c| vec![0.0; c.count()]).collect();
        for k in 0..self.leaves.len() {
            let area = self.tree.share(self.leaves[k]);
            let (mut xyz, mut error, mut radius) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            for ((lit, cut), rows) in lights.iter().zip(cuts).zip(&rows) {
                for (interval, (first, len)) in rows[k].iter().zip(cut.iter()) {
                    let sums = lit.cmf.node(node(first, len));
                    let (e, r) = (interval.error(), interval.radius());
                    for a in 0..3 {
                        xyz[a] += interval.value() * sums[a] + e[a];
                        error[a] += e[a];
                        radius[a] += r[a];
                    }
                }
            }
            let metric = Metric::Luv(luv_jacobian(xyz, white));
            mean += area * metric.size(error, radius);
            for (harm, rows) in harm.iter_mut().zip(&rows) {
                for (harm, interval) in harm.iter_mut().zip(&rows[k]) {
                    *harm += area * metric.size(interval.error(), interval.radius());
                }
            }
        }
        let mut worst: Vec<(f64, usize, usize)> = Vec::new();
        for (light, (cut, harm)) in cuts.iter().zip(&harm).enumerate() {
            for ((first, len), &harm) in cut.iter().zip(harm) {
                if len > 1 && harm > 0.0 {
                    worst.push((harm, light, first));
                }
            }
        }
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        (mean, worst.into_iter().map(|(_, l, f)| (l, f)).collect())
    }

    /// Factors F_ij of every patch i: j and F_ij.
    fn factors(&self) -> Vec<Vec<(usize, f64)>> {
        self.leaves
            .iter()
            .map(|&leaf| {
                let area = self.areas[leaf as usize];
                let row = self.links.row(leaf as usize).iter();
                // The model's patches stand behind its root.
                let factor = |k: u32| f64::from(self.factor[k as usize]);
                row.map(|&(other, exchange)| {
                    let exchange = f64::from(exchange) * factor(leaf) * factor(other);
                    (other as usize - 1, exchange / area)
                })
                .collect()
            })
            .collect()
    }

    /// Irradiance of every patch on the intervals of a cut, all bounces.
    fn bounces(&self, lit: &LightTrees, cut: Partition) -> Vec<Vec<Bounded>> {
        let nodes: Vec<usize> = cut.iter().map(|(first, len)| node(first, len)).collect();
        let factors = self.factors();
        let rows = |trees: &[Option<DyadicTree<Bounded>>]| -> Vec<Vec<Bounded>> {
            let dark = Bounded::constant(0.0);
            let of =
                |tree: &Option<DyadicTree<Bounded>>, n| tree.as_ref().map_or(dark, |t| *t.node(n));
            trees
                .iter()
                .map(|tree| nodes.iter().map(|&n| of(tree, n)).collect())
                .collect()
        };
        let first = gather(&factors, &rows(&lit.punctual), &rows(&lit.emission));
        let ratio = lit.ratio(&factors);
        let mut all = first.clone();
        let mut tail = 0.0;
        for _ in 0..BOUNCES {
            let next = gather(&factors, &first, &lit.reflect(&all, &nodes));
            let last = next
                .iter()
                .flatten()
                .zip(all.iter().flatten())
                .map(|(a, b)| a.high - b.high)
                .fold(0.0, f64::max);
            tail = last * ratio / (1.0 - ratio);
            all = next;
            if tail <= TAIL * all.iter().flatten().map(|b| b.high).fold(0.0, f64::max) {
                break;
            }
        }
        for row in &mut all {
            for (x, &n) in row.iter_mut().zip(&nodes) {
                let sums = lit.cmf.node(n);
                for (radius, sum) in x.radius.iter_mut().zip(sums) {
                    *radius += tail * sum;
                }
            }
        }
        all
    }
}
