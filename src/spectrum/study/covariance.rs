//! What knowing the covariances of the scene's reflectances would buy: an idea, measured.
//!
//! On an interval, under the weights light times a_bar, the mean of R_i R_j is m_i m_j + c_ij exactly, c the covariance.
//! For three factors m_i m_j m_k + m_i c_jk + m_j c_ik + m_k c_ij leaves out the third central moment alone. A table of c
//! for all pairs of n materials has 127 * 3 * n (n + 1) / 2 numbers. Here it is set against means alone (the corrected
//! values of a list), on the cuts of perceptual control of the ratio to the light.

use super::colour_chart::{ColourChart, UnitLight};
use super::modes::{DifferenceSummary, ratio};
use super::walk::{Extent, LEVELS, WalkStart, walk};
use crate::color::{Xyz, de_luv, luv_jacobian, tristimulus};
use crate::spectrum::{
    CmfTree, Control, List, Metric, Moment, NODES, Partition, Spectrum, control, node, represent,
    span,
};
use serde::Serialize;

/// dE*uv to which the lists are controlled.
const LIMIT: f64 = 1.0;

/// One light and level.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CovarianceRow {
    /// Name of the light.
    pub light: &'static str,
    /// Name of the level.
    pub level: &'static str,
    /// Average number of intervals.
    pub intervals_mean: f64,
    /// dE*uv of products of means.
    pub means: DifferenceSummary,
    /// dE*uv with the covariances of all pairs.
    pub covariances: DifferenceSummary,
}

/// Means and covariances of reflectances on every node, for each tristimulus value.
struct Moments<'a> {
    cmf: &'a CmfTree,
    /// By material and node.
    means: Vec<Vec<Xyz>>,
    /// By the two materials and node.
    covariances: Vec<Vec<Vec<Xyz>>>,
}

impl<'a> Moments<'a> {
    fn new(cmf: &'a CmfTree, reflectances: &[Spectrum]) -> Self {
        let over_nodes = |f: &dyn Fn(usize) -> Xyz| {
            (0..NODES)
                .map(|n| if n == 0 { [0.0; 3] } else { f(n) })
                .collect::<Vec<Xyz>>()
        };
        let means: Vec<Vec<Xyz>> = reflectances
            .iter()
            .map(|r| over_nodes(&|n| mean(cmf, n, |k| r[k])))
            .collect();
        let covariance = |i: usize, j: usize| {
            over_nodes(&|n| {
                let both = mean(cmf, n, |k| reflectances[i][k] * reflectances[j][k]);
                std::array::from_fn(|a| both[a] - means[i][n][a] * means[j][n][a])
            })
        };
        let count = reflectances.len();
        let covariances = (0..count)
            .map(|i| (0..count).map(|j| covariance(i, j)).collect())
            .collect();
        Self {
            cmf,
            means,
            covariances,
        }
    }

    /// Tristimulus values of a product of one to three materials on a cut, with the covariances.
    fn xyz(&self, cut: Partition, materials: &[usize]) -> Xyz {
        let mut sum = [0.0; 3];
        for (first, len) in cut.iter() {
            let n = node(first, len);
            for a in 0..3 {
                let m = |i: usize| self.means[materials[i]][n][a];
                let c = |i: usize, j: usize| self.covariances[materials[i]][materials[j]][n][a];
                let mean = match materials.len() {
                    1 => m(0),
                    2 => m(0) * m(1) + c(0, 1),
                    _ => m(0) * m(1) * m(2) + m(0) * c(1, 2) + m(1) * c(0, 2) + m(2) * c(0, 1),
                };
                sum[a] += mean * self.cmf.node(n)[a];
            }
        }
        sum
    }
}

/// Mean of f over a node under each weight; 0 where the weight is 0.
fn mean(cmf: &CmfTree, n: usize, f: impl Fn(usize) -> f64) -> Xyz {
    let (first, len) = span(n);
    std::array::from_fn(|a| {
        let total = cmf.node(n)[a];
        let sum: f64 = (first..first + len)
            .map(|k| f(k) * cmf.weights()[a][k])
            .sum();
        if total > 0.0 { sum / total } else { 0.0 }
    })
}

/// Measures one light.
pub fn measure(chart: &ColourChart, light: &UnitLight) -> Vec<CovarianceRow> {
    let (chart, one) = ratio(chart, light);
    let start = WalkStart::<Moment>::new(&chart, &one);
    let moments = Moments::new(&chart.cmf, &chart.reflectances);
    let luv = |colour: Xyz| Metric::Luv(luv_jacobian(colour, light.white));
    let source = represent(start.source(), &chart.cmf, &luv(light.white), LIMIT);
    let mut errors = [const { (Vec::new(), Vec::new()) }; 3];
    let mut intervals = [0; 3];
    let mut path_of = PathIndex::new(chart.reflectances.len());
    walk(
        &start,
        &source,
        Extent::Whole,
        |list: &mut List<Moment>, path, exact| {
            control(
                list,
                path,
                &chart.cmf,
                &luv(list.corrected_xyz(&chart.cmf)),
                &Control::within(LIMIT),
            );
            let level = path.reflections.len() - 1;
            let reference = tristimulus(exact, chart.cmf.weights());
            let materials = path_of.next(level);
            errors[level].0.push(de_luv(
                reference,
                list.corrected_xyz(&chart.cmf),
                light.white,
            ));
            errors[level].1.push(de_luv(
                reference,
                moments.xyz(list.partition(), &materials[..=level]),
                light.white,
            ));
            intervals[level] += list.partition().count();
        },
    );
    let rows = errors
        .into_iter()
        .enumerate()
        .map(|(level, (means, covariances))| CovarianceRow {
            light: light.name,
            level: LEVELS[level],
            intervals_mean: intervals[level] as f64 / means.len() as f64,
            means: DifferenceSummary::new(means),
            covariances: DifferenceSummary::new(covariances),
        });
    rows.collect()
}

/// The materials of the products in the order of a walk.
struct PathIndex {
    count: usize,
    seen: [usize; 3],
}

impl PathIndex {
    fn new(count: usize) -> Self {
        Self {
            count,
            seen: [0; 3],
        }
    }

    /// Materials of the next product of a level; only the first `level + 1` count.
    fn next(&mut self, level: usize) -> [usize; 3] {
        let at = self.seen[level];
        self.seen[level] += 1;
        let n = self.count;
        match level {
            0 => [at, 0, 0],
            1 => [at / n, at % n, 0],
            _ => [at / (n * n), at / n % n, at % n],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::study::Reflectances;

    #[test]
    fn covariances_make_primary_and_secondary_reflections_exact() {
        let chart = ColourChart::new(Reflectances::Babelcolor);
        let rows = measure(&chart, &chart.light("F2"));
        assert!(rows[0].means.max < 1e-9 && rows[0].covariances.max < 1e-9);
        assert!(rows[1].covariances.max < 1e-9 && rows[1].means.max > 0.01);
        assert!(rows[2].covariances.mean < rows[2].means.mean);
    }
}
