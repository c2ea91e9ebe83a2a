//! What spectra of light are weighted on: the 64 bands of a grid, or the samples of a published table.
//!
//! A light has one power for each band. On a grid a weight is the exact integral of the weighting function over the band;
//! on samples it is the function there, times the step, as the CIE sums (CIE 015:2004, 7.1).

use super::Xyz;
use crate::data::{BANDS, Grid, Outside, Table};

/// Wavelength bands.
#[derive(Debug, Clone)]
pub struct Bands {
    /// From and to, nm; equal for a sample.
    edges: Vec<[f64; 2]>,
    /// Width of a band or step of the samples, nm.
    width: f64,
}

impl Bands {
    /// The bands of a grid.
    pub fn of(grid: &Grid) -> Self {
        Self {
            edges: (0..BANDS)
                .map(|band| [grid.left(band), grid.left(band + 1)])
                .collect(),
            width: grid.width(),
        }
    }

    /// Samples at `from`, `from + step` ... `to` nm.
    pub fn samples(from: u32, to: u32, step: u32) -> Self {
        Self {
            edges: (from..=to)
                .step_by(step as usize)
                .map(|nm| [f64::from(nm); 2])
                .collect(),
            width: f64::from(step),
        }
    }

    /// Middles of the bands, nm.
    pub fn middles(&self) -> impl Iterator<Item = f64> {
        self.edges.iter().map(|[from, to]| 0.5 * (from + to))
    }

    /// Integral of a weighting function over each band, nm.
    pub fn weights(&self, function: &Table) -> Vec<f64> {
        self.over(function, Outside::Zero, self.width)
    }

    /// A light on the bands: its mean over each.
    pub fn light(&self, table: &Table) -> Vec<f64> {
        self.over(table, Outside::Zero, 1.0)
    }

    /// A function times a reflectance (held outside its rows), on the bands.
    pub fn reflected(&self, function: &Table, reflectance: &Table) -> Vec<f64> {
        let rows = function.wavelengths().iter().zip(function.values());
        let product = rows
            .map(|(&nm, value)| value * reflectance.at(nm, Outside::Hold))
            .collect();
        let product = Table::new(function.wavelengths().to_vec(), product)
            .expect("a product of published tables is finite and not negative");
        self.weights(&product)
    }

    /// Mean over each band, times `scale`.
    fn over(&self, table: &Table, outside: Outside, scale: f64) -> Vec<f64> {
        (self.edges.iter())
            .map(|&[from, to]| {
                if from == to {
                    scale * table.at(from, outside)
                } else {
                    scale / self.width * table.integral(from, to, outside)
                }
            })
            .collect()
    }
}

/// Coloured samples under a light: an observer on bands, and times each reflectance.
#[derive(Debug, Clone)]
pub(super) struct ColourSamples {
    white: [Vec<f64>; 3],
    colours: Vec<[Vec<f64>; 3]>,
}

impl ColourSamples {
    pub(super) fn new(bands: &Bands, observer: &[Table; 3], reflectances: &[Table]) -> Self {
        let times = |reflectance: &Table| {
            let function = observer.each_ref();
            function.map(|function| bands.reflected(function, reflectance))
        };
        Self {
            white: observer.each_ref().map(|function| bands.weights(function)),
            colours: reflectances.iter().map(times).collect(),
        }
    }

    /// The white and the samples under a light, Y of the white 100.
    pub(super) fn under(&self, light: &[f64]) -> (Xyz, impl Iterator<Item = Xyz>) {
        let y = weighted(light, &self.white[1]);
        let seen = move |weights: &[Vec<f64>; 3]| {
            weights.each_ref().map(|w| 100.0 * weighted(light, w) / y)
        };
        (seen(&self.white), self.colours.iter().map(seen))
    }
}

/// `sum light * weights`.
pub(super) fn weighted(light: &[f64], weights: &[f64]) -> f64 {
    light.iter().zip(weights).map(|(l, w)| l * w).sum()
}
