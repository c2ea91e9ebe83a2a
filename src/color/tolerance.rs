//! What a stated error of light means for measures that depend on its whole spectrum.
//!
//! Two errors are stated: of illuminance, relative, and of chromaticity, in (u, v). How an error of chromaticity lies over
//! wavelength is not stated. It comes from light between surfaces, too much or too little of it, and paints are smooth; so it
//! is taken to be a factor `1 + a t + b (2 t^2 - 1)` on the spectrum, t from -1 to 1 over the range. Eight such factors shift
//! the chromaticity by the stated error in eight directions; a measure's range is what it does under them: an *estimate*.

use super::bands::{Bands, weighted};
use super::correlated::uv_1960;
use std::f64::consts::TAU;

/// Directions in the (u, v) diagram.
const DIRECTIONS: usize = 8;

/// Errors that a light is stated to have.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Stated {
    /// Of illuminance, relative.
    pub relative: f64,
    /// Of chromaticity, distance in (u, v) of the CIE 1960 diagram.
    pub chromaticity: f64,
}

/// From and to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The least.
    pub low: f64,
    /// The greatest.
    pub high: f64,
}

impl Range {
    /// One value.
    pub fn of(value: f64) -> Self {
        Self {
            low: value,
            high: value,
        }
    }

    /// A value more.
    pub fn take(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    /// Wider by a relative error; not below zero.
    pub fn scaled(self, relative: f64) -> Self {
        Self {
            low: (self.low * (1.0 - relative)).max(0.0),
            high: self.high * (1.0 + relative),
        }
    }
}

/// Makes variants of lights.
#[derive(Debug, Clone)]
pub(super) struct Tolerance {
    observer: [Vec<f64>; 3],
    /// The two smooth factors on the bands.
    shapes: [Vec<f64>; 2],
}

impl Tolerance {
    pub(super) fn new(bands: &Bands, observer: [Vec<f64>; 3]) -> Self {
        let middles: Vec<f64> = bands.middles().collect();
        let (from, to) = (middles[0], middles[middles.len() - 1]);
        let along = |nm: &f64| (2.0 * nm - from - to) / (to - from);
        Self {
            observer,
            shapes: [
                middles.iter().map(along).collect(),
                (middles.iter().map(along))
                    .map(|t| 2.0 * t * t - 1.0)
                    .collect(),
            ],
        }
    }

    /// The light shifted by `chromaticity` in all directions, of the same luminous sum; none if that takes a factor that is
    /// not smaller than the light itself.
    pub(super) fn variants(&self, light: &[f64], chromaticity: f64) -> Option<Vec<Vec<f64>>> {
        let xyz = self.observer.each_ref().map(|w| weighted(light, w));
        let [u, v] = uv_1960(xyz)?;
        let whole = xyz[0] + 15.0 * xyz[1] + 3.0 * xyz[2];
        // Change of u and v for each factor, to first order: u = 4 X / whole, v = 6 Y / whole.
        let [[u1, v1], [u2, v2]] = self.shapes.each_ref().map(|shape| {
            let part: Vec<f64> = light.iter().zip(shape).map(|(l, s)| l * s).collect();
            let [x, y, z] = self.observer.each_ref().map(|w| weighted(&part, w));
            let more = x + 15.0 * y + 3.0 * z;
            [(4.0 * x - u * more) / whole, (6.0 * y - v * more) / whole]
        });
        let determinant = u1 * v2 - u2 * v1;
        (0..DIRECTIONS)
            .map(|k| {
                let (dv, du) = (TAU * k as f64 / DIRECTIONS as f64).sin_cos();
                let a = chromaticity * (du * v2 - dv * u2) / determinant;
                let b = chromaticity * (dv * u1 - du * v1) / determinant;
                // Also false for NaN: a light of one wavelength has no determinant.
                (a.abs() + b.abs() < 1.0).then(|| self.variant(light, xyz[1], [a, b]))
            })
            .collect()
    }

    fn variant(&self, light: &[f64], luminous: f64, [a, b]: [f64; 2]) -> Vec<f64> {
        let [first, second] = &self.shapes;
        let mut out: Vec<f64> = (light.iter().zip(first).zip(second))
            .map(|((l, s1), s2)| l * (1.0 + a * s1 + b * s2))
            .collect();
        let scale = luminous / weighted(&out, &self.observer[1]);
        out.iter_mut().for_each(|power| *power *= scale);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Grid;
    use crate::data::{cmf_1931, named};

    #[test]
    fn variants_are_as_far_as_stated_and_as_bright() {
        let bands = Bands::of(&Grid::default());
        let observer = cmf_1931().map(|cmf| bands.weights(&cmf));
        let tolerance = Tolerance::new(&bands, observer.clone());
        for name in ["cie/A", "cie/D65", "cie/F2", "cie/F11", "cie/LED-RGB1"] {
            let light = bands.light(&named(name).unwrap().table);
            let xyz = |l: &[f64]| observer.each_ref().map(|w| weighted(l, w));
            let [u, v] = uv_1960(xyz(&light)).unwrap();
            for other in tolerance.variants(&light, 5e-4).unwrap() {
                let [u2, v2] = uv_1960(xyz(&other)).unwrap();
                let far = (u - u2).hypot(v - v2);
                // To first order: within 5 %.
                assert!((far / 5e-4 - 1.0).abs() < 0.05, "{name}: {far}");
                assert!((xyz(&other)[1] / xyz(&light)[1] - 1.0).abs() < 1e-12);
            }
        }
        let mut line = vec![0.0; 64];
        line[30] = 1.0;
        assert!(tolerance.variants(&line, 0.002).is_none());
    }
}
