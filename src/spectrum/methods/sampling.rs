//! Direct sampling, "weighted ordinates" (paper 2.1.1), with any number of samples.
//!
//! A = K sum S_r(lambda_i) a_bar(lambda_i), with K such that the sampled light has Y = 1.

use super::pointwise::{Pointwise, mean_of};
use crate::spectrum::{BANDS, CmfTree, Spectrum};

/// n samples (in 1..=64), each the band in the middle of the n-th part of the range.
pub fn sampling(cmf: &CmfTree, light: &Spectrum, n: usize) -> Pointwise {
    let means: Vec<Spectrum> = (0..n)
        .map(|i| {
            let mut one = [0.0; BANDS];
            one[(2 * i + 1) * BANDS / (2 * n)] = 1.0;
            one
        })
        .collect();
    finish("point samples", means, cmf, light)
}

/// n bands of equal width, wider ones than the 64 (n in 1..=64): means of light and reflectances, sums of the colour matching functions.
pub fn bands(cmf: &CmfTree, light: &Spectrum, n: usize) -> Pointwise {
    let means: Vec<Spectrum> = (0..n)
        .map(|i| {
            // A band of the grid that two of these share counts in both by its part.
            let (from, to) = (
                (i * BANDS) as f64 / n as f64,
                ((i + 1) * BANDS) as f64 / n as f64,
            );
            let width = to - from;
            std::array::from_fn(|band| {
                ((to.min(band as f64 + 1.0) - from.max(band as f64)).max(0.0)) / width
            })
        })
        .collect();
    finish("uniform bands", means, cmf, light)
}

fn finish(name: &'static str, means: Vec<Spectrum>, cmf: &CmfTree, light: &Spectrum) -> Pointwise {
    let weights = means
        .iter()
        .map(|mean| cmf.weights().each_ref().map(|a| mean_of(mean, a)))
        .collect();
    let terms = means.iter().map(|mean| mean_of(mean, light)).collect();
    Pointwise::new(name, means, weights, terms)
}
