//! Segmentation of the visible range (paper 2.1.3, Deville et al. 1994): the light's lines are isolated from its continuum
//! by their gradient, what is dark is left out, and each segment takes one sample.
//!
//! The sample lies at the centre of gravity of light times (x_bar + y_bar + z_bar), a one-point Gauss rule; the segment's
//! tristimulus weights are the sums of the light times each function. The publication leaves open how the continuum is
//! cut: here into pieces of equal weight.

use super::pointwise::{Pointwise, value_at};
use crate::spectrum::{BANDS, CmfTree, Spectrum};

/// A band is a line where the light exceeds the mean of its neighbours by this share of it.
const LINE: f64 = 0.5;

/// n segments, of which at most half are spent on lines, the strongest first.
pub fn segments(cmf: &CmfTree, light: &Spectrum, n: usize) -> Pointwise {
    let visible: Spectrum =
        std::array::from_fn(|k| light[k] * cmf.weights().iter().map(|a| a[k]).sum::<f64>());
    let continuum = |k: usize| 0.5 * (light[k.max(1) - 1] + light[(k + 1).min(BANDS - 1)]);
    let mut lines: Vec<usize> = (0..BANDS)
        .filter(|&k| light[k] > (1.0 + LINE) * continuum(k) && visible[k] > 0.0)
        .collect();
    lines.sort_by(|&a, &b| visible[b].total_cmp(&visible[a]));
    lines.truncate(n / 2);

    let mut groups: Vec<Vec<usize>> = lines.iter().map(|&k| vec![k]).collect();
    let rest: Vec<usize> = (0..BANDS)
        .filter(|k| visible[*k] > 0.0 && !lines.contains(k))
        .collect();
    let total: f64 = rest.iter().map(|&k| visible[k]).sum();
    let parts = n - lines.len();
    let mut pieces = vec![Vec::new(); parts];
    let mut before = 0.0;
    for k in rest {
        // The band goes where its middle falls; the share is below 1, so the index is below `parts`.
        let share = (before + 0.5 * visible[k]) / total;
        pieces[((share * parts as f64) as usize).min(parts - 1)].push(k);
        before += visible[k];
    }
    groups.extend(pieces.into_iter().filter(|piece| !piece.is_empty()));

    let weights = groups
        .iter()
        .map(|group| {
            cmf.weights()
                .each_ref()
                .map(|a| group.iter().map(|&k| light[k] * a[k]).sum())
        })
        .collect();
    let means: Vec<Spectrum> = groups
        .iter()
        .map(|group| {
            let weight: f64 = group.iter().map(|&k| visible[k]).sum();
            value_at(group.iter().map(|&k| k as f64 * visible[k]).sum::<f64>() / weight)
        })
        .collect();
    let light = vec![1.0; means.len()];
    Pointwise::new("segments", means, weights, light)
}
