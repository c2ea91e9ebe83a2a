//! Methods whose product is term by term: each term is a weighted mean of the bands, and tristimulus values are sums of
//! the terms with fixed weights.

use super::Method;
use crate::color::Xyz;
use crate::spectrum::{BANDS, Spectrum};

/// n terms, each a mean of the bands.
#[derive(Debug, Clone)]
pub struct Pointwise {
    name: &'static str,
    /// The means: for each term the weights of the bands, of sum 1.
    means: Vec<Spectrum>,
    /// Tristimulus weights of each term.
    weights: Vec<Xyz>,
    /// The light's terms; all 1 where the light is in the weights.
    light: Vec<f64>,
}

impl Pointwise {
    /// From means, weights and the light's terms. The weights are scaled so that the light has Y = 1.
    pub(super) fn new(
        name: &'static str,
        means: Vec<Spectrum>,
        weights: Vec<Xyz>,
        light: Vec<f64>,
    ) -> Self {
        let mut this = Self {
            name,
            means,
            weights,
            light,
        };
        let y = this.xyz(&this.light)[1];
        if y > 0.0 {
            this.weights.iter_mut().for_each(|w| *w = w.map(|w| w / y));
        }
        this
    }

    /// The terms of a spectrum.
    pub fn terms_of(&self, spectrum: &Spectrum) -> Vec<f64> {
        self.means
            .iter()
            .map(|mean| mean_of(mean, spectrum))
            .collect()
    }
}

/// The mean of a spectrum with given weights.
pub(super) fn mean_of(mean: &Spectrum, spectrum: &Spectrum) -> f64 {
    (0..BANDS).map(|band| mean[band] * spectrum[band]).sum()
}

/// The mean that is the value at a position in bands (band k's value holds at k), linear between, in [0, 63].
pub(super) fn value_at(position: f64) -> Spectrum {
    let position = position.clamp(0.0, (BANDS - 1) as f64);
    let below = (position as usize).min(BANDS - 2);
    let mut mean = [0.0; BANDS];
    mean[below] = 1.0 - (position - below as f64);
    mean[below + 1] = position - below as f64;
    mean
}

impl Method for Pointwise {
    fn name(&self) -> &'static str {
        self.name
    }

    fn terms(&self) -> usize {
        self.means.len()
    }

    fn light(&self) -> Vec<f64> {
        self.light.clone()
    }

    fn material(&self, reflectance: &Spectrum) -> Vec<f64> {
        self.terms_of(reflectance)
    }

    fn reflect(&self, spectrum: &[f64], material: &[f64], out: &mut [f64]) {
        for ((out, s), r) in out.iter_mut().zip(spectrum).zip(material) {
            *out = s * r;
        }
    }

    fn xyz(&self, spectrum: &[f64]) -> Xyz {
        spectrum
            .iter()
            .zip(&self.weights)
            .fold([0.0; 3], |sum, (s, w)| {
                std::array::from_fn(|a| sum[a] + s * w[a])
            })
    }
}
