//! Reflection where lanes reflect into each other: coordinates in a basis (paper 2.2.2), a matrix M for each paint.
//!
//! M is symmetric and its eigenvalues lie in [0, rho_max]. A reflection costs m^2 multiplications where lanes of intervals cost m.

use crate::light::lanes::Lanes;
use crate::light::rows::Rows;
use crate::spectrum::Spectrum;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Rows a task multiplies; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 256;

/// How the leaves reflect: the paints, and which paint each leaf has.
#[derive(Debug, Default)]
pub(crate) struct Mixed {
    /// Rows of M, padded to the width of lanes, paint by paint.
    paints: Vec<Rows>,
    of: Vec<u32>,
    /// Greatest eigenvalue of all.
    pub(super) greatest: f64,
}

impl Mixed {
    /// Matrices for paints, and the paint of each leaf.
    pub(crate) fn new(paints: &[Spectrum], of: Vec<u32>, lanes: &Lanes, width: usize) -> Self {
        let m = lanes.len();
        let each: Vec<(Rows, f64)> = paints
            .par_iter()
            .map(|rho| {
                let matrix = DMatrix::from_row_slice(m, m, &lanes.matrix(rho));
                let mut rows = Rows::zero(m, width);
                for i in 0..m {
                    for j in 0..m {
                        rows.row_mut(i)[j] = matrix[(i, j)] as f32;
                    }
                }
                (rows, matrix.symmetric_eigenvalues().max())
            })
            .collect();
        let greatest = each.iter().map(|e| e.1).fold(0.0, f64::max);
        Self {
            paints: each.into_iter().map(|(rows, _)| rows).collect(),
            of,
            greatest,
        }
    }

    /// Rows after reflection.
    pub(super) fn reflect<const L: usize>(&self, rows: &Rows) -> Rows {
        let mut out = Rows::zero(rows.len(), L);
        out.all_mut::<L>()
            .par_chunks_mut(CHUNK)
            .zip(rows.all::<L>().par_chunks(CHUNK))
            .zip(self.of.par_chunks(CHUNK))
            .for_each(|((out, rows), of)| {
                for ((out, row), &paint) in out.iter_mut().zip(rows).zip(of) {
                    for (x, column) in row.iter().zip(self.paints[paint as usize].all::<L>()) {
                        for l in 0..L {
                            out[l] += x * column[l];
                        }
                    }
                }
            });
        out
    }
}
