//! Piecewise cubic polynomials (paper 2.2.1, Raso and Fournier 1991).
//!
//! The range is cut into equal pieces; on each a spectrum is a cubic in Chebyshev form. The product of two cubics has
//! degree 6 and is reduced to 3 by leaving out T4 to T6. The light is in the tristimulus weights, the integrals of
//! light times a_bar times T_i.

use super::Method;
use crate::color::Xyz;
use crate::spectrum::{BANDS, CmfTree, Spectrum};
use nalgebra::{DMatrix, DVector};

/// Coefficients of a piece.
const ORDER: usize = 4;

/// Spectra as cubics.
#[derive(Debug, Clone)]
pub struct Cubics {
    pieces: usize,
    /// Tristimulus weights of each coefficient.
    weights: Vec<Xyz>,
}

impl Cubics {
    /// n / 4 pieces; none unless n is a multiple of 4 in 4..=64.
    pub fn new(cmf: &CmfTree, light: &Spectrum, n: usize) -> Option<Self> {
        if n == 0 || !n.is_multiple_of(ORDER) || n > BANDS {
            return None;
        }
        let pieces = n / ORDER;
        let mut weights = vec![[0.0; 3]; n];
        for band in 0..BANDS {
            let (piece, x) = place(band, pieces);
            for (i, t) in chebyshev(x).into_iter().enumerate() {
                for a in 0..3 {
                    weights[piece * ORDER + i][a] += light[band] * cmf.weights()[a][band] * t;
                }
            }
        }
        Some(Self { pieces, weights })
    }
}

/// The piece that holds the middle of a band, and the position in it, in [-1, 1].
fn place(band: usize, pieces: usize) -> (usize, f64) {
    let at = (band as f64 + 0.5) / BANDS as f64 * pieces as f64;
    (at as usize, 2.0 * at.fract() - 1.0)
}

/// T0 to T3 at x.
fn chebyshev(x: f64) -> [f64; ORDER] {
    [1.0, x, 2.0 * x * x - 1.0, x * (4.0 * x * x - 3.0)]
}

impl Method for Cubics {
    fn name(&self) -> &'static str {
        "cubics"
    }

    fn terms(&self) -> usize {
        self.pieces * ORDER
    }

    fn light(&self) -> Vec<f64> {
        (0..self.terms())
            .map(|i| if i % ORDER == 0 { 1.0 } else { 0.0 })
            .collect()
    }

    /// Least squares on the bands of each piece, of which there are at least four.
    fn material(&self, reflectance: &Spectrum) -> Vec<f64> {
        let mut all = Vec::with_capacity(self.terms());
        for piece in 0..self.pieces {
            let inside: Vec<(f64, f64)> = (0..BANDS)
                .filter_map(|k| {
                    Some(place(k, self.pieces))
                        .filter(|p| p.0 == piece)
                        .map(|p| (p.1, reflectance[k]))
                })
                .collect();
            let basis = DMatrix::from_fn(inside.len(), ORDER, |row, i| chebyshev(inside[row].0)[i]);
            let values = DVector::from_iterator(inside.len(), inside.iter().map(|p| p.1));
            let fit = (basis.transpose() * &basis)
                .cholesky()
                .expect("four distinct points fix a cubic")
                .solve(&(basis.transpose() * values));
            all.extend(fit.iter());
        }
        all
    }

    fn reflect(&self, spectrum: &[f64], material: &[f64], out: &mut [f64]) {
        for ((out, s), r) in out
            .chunks_exact_mut(ORDER)
            .zip(spectrum.chunks_exact(ORDER))
            .zip(material.chunks_exact(ORDER))
        {
            // T_i T_j = (T_{i+j} + T_{|i-j|}) / 2, and what lies above T3 is left out.
            out[0] = s[0] * r[0] + 0.5 * (s[1] * r[1] + s[2] * r[2] + s[3] * r[3]);
            out[1] = s[0] * r[1]
                + s[1] * r[0]
                + 0.5 * (s[1] * r[2] + s[2] * r[1] + s[2] * r[3] + s[3] * r[2]);
            out[2] = s[0] * r[2] + s[2] * r[0] + 0.5 * (s[1] * r[1] + s[1] * r[3] + s[3] * r[1]);
            out[3] = s[0] * r[3] + s[3] * r[0] + 0.5 * (s[1] * r[2] + s[2] * r[1]);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::testing::cmf;

    #[test]
    fn product_of_a_line_and_a_parabola_is_exact() {
        let method = Cubics::new(&cmf(), &[1.0; BANDS], 8).unwrap();
        let line: Spectrum = std::array::from_fn(|k| 0.2 + k as f64 / 100.0);
        let parabola: Spectrum = std::array::from_fn(|k| 0.9 - (k as f64 / 70.0).powi(2));
        let product: Spectrum = std::array::from_fn(|k| line[k] * parabola[k]);
        let mut out = vec![0.0; 8];
        method.reflect(
            &method.material(&line),
            &method.material(&parabola),
            &mut out,
        );
        for (ours, exact) in out.iter().zip(method.material(&product)) {
            assert!((ours - exact).abs() < 1e-12);
        }
    }
}
