//! Alpha-opic equivalent daylight illuminances (CIE S 026/E:2018): for each of the five photoreceptors of the eye, the
//! illuminance of D65 that would excite it as much.

use super::bands::{Bands, weighted};
use crate::data::{alpha_opic, cmf_1931, named};

/// The receptors in the order of the CIE's table: S-, M-, L-cone-opic, rhodopic, melanopic.
pub const RECEPTORS: [&str; 5] = ["sc", "mc", "lc", "rh", "mel"];

/// The action spectra on bands.
#[derive(Debug, Clone)]
pub struct AlphaOpic {
    /// Weighted so that a light's sum is its equivalent daylight for a luminous sum of 1.
    actions: [Vec<f64>; 5],
}

impl AlphaOpic {
    /// The action spectra on bands.
    pub fn new(bands: &Bands) -> Self {
        let d65 = bands.light(&named("cie/D65").expect("D65 is built in").table);
        let luminous = weighted(&d65, &bands.weights(&cmf_1931()[1]));
        Self {
            actions: alpha_opic().map(|action| {
                let mut weights = bands.weights(&action);
                let of_daylight = weighted(&d65, &weights) / luminous;
                weights.iter_mut().for_each(|w| *w /= of_daylight);
                weights
            }),
        }
    }

    /// Equivalent daylight of a light, in units of `sum light y_bar`: multiply by 683 lm/W for lux.
    pub fn daylight(&self, light: &[f64]) -> [f64; 5] {
        self.actions
            .each_ref()
            .map(|action| weighted(light, action))
    }
}
