//! Colour fidelity Rf (CIE 224:2017, the same in ANSI/IES TM-30-20) and gamut Rg (TM-30-20): 99 samples under the light and
//! under a reference of the same colour temperature, in CAM02-UCS with the 10 degree observer.

use super::appearance::{Appearance, Viewer};
use super::bands::{Bands, ColourSamples, weighted};
use crate::data::{blackbody, cmf_1931, cmf_1964, colour_evaluation, daylight};

/// Between these the reference is a mixture of Planck and daylight, K.
const MIXED: [f64; 2] = [4000.0, 5000.0];
/// Scale of the index.
const PER_DIFFERENCE: f64 = 6.73;
/// Bins of hue of the gamut.
const BINS: usize = 16;

/// Both figures of a light.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Fidelity {
    /// Fidelity, 0 to 100.
    pub rf: f64,
    /// Gamut as a percentage of the reference's.
    pub rg: f64,
}

/// The samples on bands.
#[derive(Debug, Clone)]
pub struct EvaluationColours {
    bands: Bands,
    /// y_bar of the 2 degree observer, by which mixtures are weighed.
    luminous: Vec<f64>,
    samples: ColourSamples,
}

impl EvaluationColours {
    /// The samples on bands.
    pub fn new(bands: &Bands) -> Self {
        Self {
            luminous: bands.weights(&cmf_1931()[1]),
            samples: ColourSamples::new(bands, &cmf_1964(), &colour_evaluation()),
            bands: bands.clone(),
        }
    }

    /// Both figures of a light of a correlated colour temperature; none without light.
    pub fn fidelity(&self, light: &[f64], kelvin: f64) -> Option<Fidelity> {
        let (ours, right) = (self.seen(light), self.seen(&self.reference(kelvin)));
        let differences = ours.iter().zip(&right).map(|(a, b)| {
            let squares = (0..3).map(|k| (a.uniform[k] - b.uniform[k]).powi(2));
            squares.sum::<f64>().sqrt()
        });
        let mean = differences.sum::<f64>() / ours.len() as f64;
        let rf = 10.0 * (((100.0 - PER_DIFFERENCE * mean) / 10.0).exp().ln_1p());
        let rg = 100.0 * area(&ours, &right) / area(&right, &right);
        (rf.is_finite() && rg.is_finite()).then_some(Fidelity { rf, rg })
    }

    fn reference(&self, kelvin: f64) -> Vec<f64> {
        let unit = |mut light: Vec<f64>| {
            let y = weighted(&light, &self.luminous);
            light.iter_mut().for_each(|power| *power /= y);
            light
        };
        let planck = || unit(self.bands.light(&blackbody(kelvin)));
        let daylight = || unit(self.bands.light(&daylight(kelvin)));
        let share = (kelvin - MIXED[0]) / (MIXED[1] - MIXED[0]);
        if share <= 0.0 {
            return planck();
        }
        if share >= 1.0 {
            return daylight();
        }
        let pairs = planck().into_iter().zip(daylight());
        pairs.map(|(p, d)| (1.0 - share) * p + share * d).collect()
    }

    fn seen(&self, light: &[f64]) -> Vec<Appearance> {
        let (white, colours) = self.samples.under(light);
        let viewer = Viewer::new(white);
        colours.map(|xyz| viewer.see(xyz)).collect()
    }
}

/// Area of the polygon of mean a', b' of each bin of the reference's hue; empty bins are passed over.
fn area(colours: &[Appearance], reference: &[Appearance]) -> f64 {
    let mut bins = [[0.0; 3]; BINS];
    for (colour, right) in colours.iter().zip(reference) {
        let bin = right.hue / std::f64::consts::TAU * BINS as f64;
        // Not negative; a hue next below a full turn may round up to it.
        let bin = &mut bins[(bin as usize).min(BINS - 1)];
        let [_, a, b] = colour.uniform;
        *bin = [bin[0] + a, bin[1] + b, bin[2] + 1.0];
    }
    let corners: Vec<[f64; 2]> = (bins.iter())
        .filter(|bin| bin[2] > 0.0)
        .map(|[a, b, n]| [a / n, b / n])
        .collect();
    let next = corners.iter().cycle().skip(1);
    let crosses = corners
        .iter()
        .zip(next)
        .map(|(p, q)| p[0] * q[1] - p[1] * q[0]);
    0.5 * crosses.sum::<f64>()
}
