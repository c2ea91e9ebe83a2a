//! Characteristic vectors (paper 2.2.2, Peercy 1993): an orthonormal basis E_i made for the scene.
//!
//! Training set: S, S R_i and S R_i R_j. The basis are the eigenvectors of the m greatest eigenvalues of its second
//! moments. A reflectance is the matrix R_ij = sum R E_i E_j, tristimulus values are T_ki = sum E_i a_bar_k.

use super::Method;
use crate::color::Xyz;
use crate::spectrum::{BANDS, CmfTree, Spectrum};
use nalgebra::{SMatrix, SymmetricEigen};

/// m orthonormal vectors (in 1..=64) for lights and the reflectances of a scene, that of the greatest eigenvalue first.
pub fn basis(lights: &[Spectrum], reflectances: &[Spectrum], m: usize) -> Vec<Spectrum> {
    let mut moments = SMatrix::<f64, BANDS, BANDS>::zeros();
    let mut add = |spectrum: &Spectrum| {
        let v = SMatrix::<f64, BANDS, 1>::from_fn(|k, _| spectrum[k]);
        moments.ger(1.0, &v, &v, 1.0);
    };
    for light in lights {
        add(light);
        for first in reflectances {
            let once: Spectrum = std::array::from_fn(|k| light[k] * first[k]);
            add(&once);
            for second in reflectances {
                add(&std::array::from_fn(|k| once[k] * second[k]));
            }
        }
    }
    let eigen = SymmetricEigen::new(moments);
    let mut order: Vec<usize> = (0..BANDS).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    order
        .iter()
        .take(m)
        .map(|&i| std::array::from_fn(|k| eigen.eigenvectors[(k, i)]))
        .collect()
}

/// Spectra as coordinates in a trained basis.
#[derive(Debug, Clone)]
pub struct Characteristic {
    basis: Vec<Spectrum>,
    light: Vec<f64>,
    weights: Vec<Xyz>,
}

impl Characteristic {
    /// m vectors (in 1..=64) for a light and the reflectances of a scene.
    pub fn new(cmf: &CmfTree, light: &Spectrum, reflectances: &[Spectrum], m: usize) -> Self {
        let basis = basis(&[*light], reflectances, m);
        let dot = |a: &Spectrum, b: &Spectrum| (0..BANDS).map(|k| a[k] * b[k]).sum::<f64>();
        let coordinates = basis.iter().map(|e| dot(e, light)).collect();
        let weights = basis
            .iter()
            .map(|e| cmf.weights().each_ref().map(|a| dot(e, a)))
            .collect();
        Self {
            basis,
            light: coordinates,
            weights,
        }
    }
}

impl Method for Characteristic {
    fn name(&self) -> &'static str {
        "characteristic vectors"
    }

    fn terms(&self) -> usize {
        self.basis.len()
    }

    fn light(&self) -> Vec<f64> {
        self.light.clone()
    }

    /// The matrix R_ij row by row.
    fn material(&self, reflectance: &Spectrum) -> Vec<f64> {
        let entry = |i: &Spectrum, j: &Spectrum| {
            (0..BANDS)
                .map(|k| reflectance[k] * i[k] * j[k])
                .sum::<f64>()
        };
        self.basis
            .iter()
            .flat_map(|i| self.basis.iter().map(move |j| entry(i, j)))
            .collect()
    }

    fn reflect(&self, spectrum: &[f64], material: &[f64], out: &mut [f64]) {
        for (out, row) in out.iter_mut().zip(material.chunks_exact(spectrum.len())) {
            *out = row.iter().zip(spectrum).map(|(r, s)| r * s).sum();
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
