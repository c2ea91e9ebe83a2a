//! How good is the greedy choice of intervals? The bar is a search over all cuts by dynamic programming.
//!
//! For a spectrum and a number n of intervals, all cuts take the averages of eq. 3 of the exact spectrum, and count by the
//! length of J (sum of errors), J the Jacobian of XYZ -> L*u*v*. That sum of vectors does not split into a cost for each
//! interval, so the table of the best sums for each node and count keeps several candidates, not one: what is found
//! is the best known, an upper bound of the optimum.

use super::colour_chart::{ColourChart, UnitLight};
use crate::color::{luv_jacobian, tristimulus};
use crate::spectrum::{
    BANDS, Control, DyadicTree, Estimate, List, Metric, Partition, Representative, Spectrum,
    coarsen, represent, span,
};
use serde::Serialize;

/// Numbers of intervals.
pub const COUNTS: [usize; 4] = [4, 6, 8, 10];
/// Candidates that are kept for each node and count. From 4 to 16 the mean error falls by 2 % at most.
const CANDIDATES: usize = 16;
/// One in so many secondary reflections is looked at.
const STRIDE: usize = 16;

/// Means of dE*uv (first order) over secondary reflections.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CutsRow {
    /// Name of the light.
    pub light: &'static str,
    /// Number of intervals.
    pub intervals: usize,
    /// Halving the worst interval, from one (3.1.3).
    pub split: f64,
    /// Merging the best pair, from 64.
    pub merge: f64,
    /// Best known cut.
    pub best: f64,
}

/// Measures one light.
pub fn measure(chart: &ColourChart, light: &UnitLight) -> Vec<CutsRow> {
    let mut rows: Vec<CutsRow> = COUNTS
        .iter()
        .map(|&intervals| CutsRow {
            light: light.name,
            intervals,
            split: 0.0,
            merge: 0.0,
            best: 0.0,
        })
        .collect();
    let pairs = chart
        .reflectances
        .iter()
        .flat_map(|a| chart.reflectances.iter().map(move |b| (a, b)));
    let spectra: Vec<Spectrum> = pairs
        .step_by(STRIDE)
        .map(|(a, b)| std::array::from_fn(|k| light.power[k] * a[k] * b[k]))
        .collect();
    for spectrum in &spectra {
        let tree = DyadicTree::<Estimate>::new(spectrum, &chart.cmf);
        let jacobian = luv_jacobian(tristimulus(spectrum, chart.cmf.weights()), light.white);
        let metric = Metric::Luv(jacobian);
        let best = search(&tree, &metric);
        for row in &mut rows {
            let n = row.intervals;
            row.split += metric.size(halved(&tree, chart, &metric, n).error(), [0.0; 3]);
            row.merge += metric.size(merged(&tree, chart, &metric, n).error(), [0.0; 3]);
            row.best += best[n];
        }
    }
    for row in &mut rows {
        for figure in [&mut row.split, &mut row.merge, &mut row.best] {
            *figure /= spectra.len() as f64;
        }
    }
    rows
}

/// n intervals by halving: the limit is lowered until there are enough.
fn halved(
    tree: &DyadicTree<Estimate>,
    chart: &ColourChart,
    metric: &Metric,
    n: usize,
) -> List<Estimate> {
    let mut list = List::new(tree, Partition::ROOT);
    while list.partition().count() < n {
        // Just below its present error the list has to take one more step, or several.
        let limit = metric.size(list.error(), [0.0; 3]) * 0.999_999;
        let next = represent(tree, &chart.cmf, metric, limit);
        if next.partition().count() > n || next.partition() == list.partition() {
            break;
        }
        list = next;
    }
    list
}

/// n intervals by merging, with the averages of eq. 3.
fn merged(
    tree: &DyadicTree<Estimate>,
    chart: &ColourChart,
    metric: &Metric,
    n: usize,
) -> List<Estimate> {
    let mut list = List::new(tree, Partition::BANDS);
    let settings = Control {
        representative: Representative::Projection,
        floor: n,
        ..Control::within(f64::INFINITY)
    };
    coarsen(&mut list, &chart.cmf, metric, &settings);
    List::new(tree, list.partition())
}

/// Least length for each number of intervals up to the greatest of [`COUNTS`].
fn search(tree: &DyadicTree<Estimate>, metric: &Metric) -> Vec<f64> {
    let most = COUNTS[COUNTS.len() - 1];
    let length = |e: &[f64; 3]| metric.size(*e, [0.0; 3]);
    // candidates[node][count]: sums of errors.
    let mut candidates: Vec<Vec<Vec<[f64; 3]>>> = vec![vec![Vec::new(); most + 1]; 2 * BANDS];
    for n in (1..2 * BANDS).rev() {
        candidates[n][1].push(tree.node(n).error);
        let (_, len) = span(n);
        for count in 2..=most.min(len) {
            let mut sums: Vec<[f64; 3]> = Vec::new();
            for left in 1..count {
                for a in &candidates[2 * n][left] {
                    sums.extend(
                        candidates[2 * n + 1][count - left]
                            .iter()
                            .map(|b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]),
                    );
                }
            }
            sums.sort_by_cached_key(|sum| length(sum).to_bits());
            sums.truncate(CANDIDATES);
            candidates[n][count] = sums;
        }
    }
    candidates[1]
        .iter()
        .map(|sums| sums.iter().map(&length).fold(f64::INFINITY, f64::min))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::study::Reflectances;

    #[test]
    fn the_search_is_at_least_as_good_as_either_greedy_choice() {
        let chart = ColourChart::new(Reflectances::Babelcolor);
        for row in measure(&chart, &chart.light("D65")) {
            assert!(row.best <= row.merge && row.best <= row.split, "{row:?}");
            assert!(row.best >= 0.0 && row.merge > 0.0, "{row:?}");
        }
    }
}
