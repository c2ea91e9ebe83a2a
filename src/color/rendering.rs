//! The CIE colour rendering index: the general index Ra (mean of samples 1 to 8) and the special indices (CIE 13.3-1995).
//!
//! Samples under the light and under a reference of the same colour temperature (Planck below 5000 K, daylight from there)
//! are compared in W*U*V* after a von Kries adaptation; R = 100 - 4.6 dE.

use super::Xyz;
use super::bands::{Bands, ColourSamples};
use super::correlated::uv_1960;
use crate::data::{blackbody, cmf_1931, daylight, test_colours};

/// From here the reference is daylight, K.
const DAYLIGHT_FROM: f64 = 5000.0;
/// Scale of the index.
const PER_DIFFERENCE: f64 = 4.6;
/// Samples of the general index.
const GENERAL: usize = 8;
/// Greatest distance of light and reference in (u, v) for which the CIE vouches (CIE 13.3, 5.3).
pub const GREATEST_DISTANCE: f64 = 5.4e-3;

/// The indices of a light.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Rendering {
    /// The general index.
    pub ra: f64,
    /// R1 to R14.
    pub special: [f64; 14],
    /// Distance of light and reference in (u, v).
    pub distance: f64,
}

/// The samples on bands.
#[derive(Debug, Clone)]
pub struct TestColours {
    bands: Bands,
    samples: ColourSamples,
}

impl TestColours {
    /// The samples on bands.
    pub fn new(bands: &Bands) -> Self {
        Self {
            samples: ColourSamples::new(bands, &cmf_1931(), &test_colours()),
            bands: bands.clone(),
        }
    }

    /// The indices of a light of a correlated colour temperature; none without light.
    pub fn rendering(&self, light: &[f64], kelvin: f64) -> Option<Rendering> {
        let reference = self.bands.light(&if kelvin < DAYLIGHT_FROM {
            blackbody(kelvin)
        } else {
            daylight(kelvin)
        });
        let (white, ours) = self.samples.under(light);
        let (aim, right) = self.samples.under(&reference);
        let (white, aim) = (uv_1960(white)?, uv_1960(aim)?);
        let mut special = [0.0; 14];
        for (index, (under, right)) in special.iter_mut().zip(ours.zip(right)) {
            let ours = uniform(under[1], adapted(uv_1960(under)?, white, aim), aim);
            let right = uniform(right[1], uv_1960(right)?, aim);
            let squares = (0..3).map(|k| (ours[k] - right[k]).powi(2));
            *index = 100.0 - PER_DIFFERENCE * squares.sum::<f64>().sqrt();
        }
        Some(Rendering {
            ra: special[..GENERAL].iter().sum::<f64>() / GENERAL as f64,
            special,
            distance: (white[0] - aim[0]).hypot(white[1] - aim[1]),
        })
    }
}

/// Where a chromaticity seen under `white` lies under `aim` (CIE 13.3, 5.7).
fn adapted(uv: [f64; 2], white: [f64; 2], aim: [f64; 2]) -> [f64; 2] {
    let c = |[u, v]: [f64; 2]| (4.0 - u - 10.0 * v) / v;
    let d = |[u, v]: [f64; 2]| (1.708 * v + 0.404 - 1.481 * u) / v;
    let c = c(aim) / c(white) * c(uv);
    let d = d(aim) / d(white) * d(uv);
    let whole = 16.518 + 1.481 * c - d;
    [(10.872 + 0.404 * c - 4.0 * d) / whole, 5.520 / whole]
}

/// W*, U*, V* (CIE 1964).
fn uniform(y: f64, [u, v]: [f64; 2], [u0, v0]: [f64; 2]) -> Xyz {
    let w = 25.0 * y.cbrt() - 17.0;
    [w, 13.0 * w * (u - u0), 13.0 * w * (v - v0)]
}
