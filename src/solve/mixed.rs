//! The solve where lanes reflect into each other: coordinates in a basis (paper 2.2.2), a matrix M for each paint.
//!
//! M is symmetric and its eigenvalues lie in [0, rho_max], so that with `R = sqrt(M / A) y` the radiosity equation
//! becomes `(1 - K) y = sqrt(A M) first`, `K = sqrt(M) G sqrt(M) / A`: symmetric as for single lanes, but one system for
//! all lanes, with one alpha and beta. A reflection costs m^2 multiplications where lanes of intervals cost m.

use super::conjugate::{Convergence, MAX_ITERATIONS, step, turn};
use super::operator::Operator;
use super::rays::RaySystem;
use super::sums::dot;
use crate::light::lanes::Lanes;
use crate::light::rows::Rows;
use crate::spectrum::Leaves;
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// Rows a task multiplies; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 256;

/// How the leaves reflect: the paints, and which paint each leaf has.
#[derive(Debug, Default)]
pub(crate) struct Mixed {
    /// Rows of M, padded to the width of lanes, paint by paint.
    whole: Vec<Rows>,
    /// Rows of the root of M.
    root: Vec<Rows>,
    of: Vec<u32>,
    /// Greatest eigenvalue of all matrices.
    greatest: f64,
}

impl Mixed {
    /// Matrices for paints, and the paint of each leaf.
    pub(crate) fn new(paints: &[Leaves], of: Vec<u32>, lanes: &Lanes, width: usize) -> Self {
        let m = lanes.len();
        let rows = |matrix: &DMatrix<f64>| {
            let mut rows = Rows::zero(m, width);
            for i in 0..m {
                for j in 0..m {
                    rows.row_mut(i)[j] = matrix[(i, j)] as f32;
                }
            }
            rows
        };
        let each: Vec<(Rows, Rows, f64)> = paints
            .par_iter()
            .map(|rho| {
                let whole = DMatrix::from_row_slice(m, m, &lanes.matrix(rho));
                let eigen = SymmetricEigen::new(whole.clone());
                let roots = eigen.eigenvalues.map(|x| x.max(0.0).sqrt());
                let root = &eigen.eigenvectors
                    * DMatrix::from_diagonal(&roots)
                    * eigen.eigenvectors.transpose();
                (rows(&whole), rows(&root), eigen.eigenvalues.max())
            })
            .collect();
        let greatest = each.iter().map(|e| e.2).fold(0.0, f64::max);
        let (whole, root) = each.into_iter().map(|(w, r, _)| (w, r)).unzip();
        Self {
            whole,
            root,
            of,
            greatest,
        }
    }

    /// Rows after reflection.
    pub(super) fn reflect<const L: usize>(&self, rows: &Rows) -> Rows {
        self.times::<L>(&self.whole, rows)
    }

    fn times<const L: usize>(&self, matrices: &[Rows], rows: &Rows) -> Rows {
        let mut out = Rows::zero(rows.len(), L);
        out.all_mut::<L>()
            .par_chunks_mut(CHUNK)
            .zip(rows.all::<L>().par_chunks(CHUNK))
            .zip(self.of.par_chunks(CHUNK))
            .for_each(|((out, rows), of)| {
                for ((out, row), &paint) in out.iter_mut().zip(rows).zip(of) {
                    for (x, column) in row.iter().zip(matrices[paint as usize].all::<L>()) {
                        for l in 0..L {
                            out[l] += x * column[l];
                        }
                    }
                }
            });
        out
    }

    /// Reflected radiosity of the leaves from the irradiance of the first bounce.
    pub(super) fn solve<const L: usize>(
        &self,
        operator: &Operator,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
    ) -> Convergence {
        let count = operator.leaves.len();
        let roots: Vec<f32> = operator
            .leaves
            .iter()
            .map(|&leaf| operator.areas[leaf as usize].sqrt() as f32)
            .collect();
        let scaled = |mut rows: Rows, power: i32| {
            for (row, root) in rows.all_mut::<L>().iter_mut().zip(&roots) {
                let s = root.powi(power);
                *row = row.map(|x| x * s);
            }
            rows
        };
        let nodes = operator.tree.nodes.len();
        let (mut scratch, mut gathered) = (Rows::zero(nodes, L), Rows::zero(nodes, L));
        let mut incoming = Rows::zero(count, L);
        let mut apply = |y: &Rows| {
            let out = scaled(self.times::<L>(&self.root, y), -1);
            operator.irradiance::<L>(&out, &mut scratch, &mut gathered, &mut incoming);
            let mut back = scaled(self.times::<L>(&self.root, &incoming), 1);
            for (b, y) in back.all_mut::<L>().iter_mut().zip(y.all::<L>()) {
                *b = std::array::from_fn(|l| y[l] - b[l]);
            }
            back
        };
        let all = |x: &Rows, y: &Rows| dot::<L>(x, y).iter().sum::<f64>();
        let mut residual = scaled(self.times::<L>(&self.root, first), 1);
        let mut y = Rows::zero(count, L);
        let mut direction = residual.clone();
        let norm = all(&residual, &residual).max(f64::MIN_POSITIVE);
        let mut rr = all(&residual, &residual);
        let mut done = Convergence::default();
        loop {
            done.residual = (rr / norm).sqrt();
            done.bound = done.residual / (1.0 - self.greatest);
            // Rounding ends progress at about 1e-7.
            if done.bound <= tolerance || done.iterations >= MAX_ITERATIONS || rr <= 1e-14 * norm {
                break;
            }
            let applied = apply(&direction);
            done.iterations += 1;
            let curvature = all(&direction, &applied);
            if curvature <= 0.0 {
                break;
            }
            let alpha = (rr / curvature) as f32;
            step::<L>(&mut y, &direction, [alpha; L]);
            step::<L>(&mut residual, &applied, [-alpha; L]);
            let next = all(&residual, &residual);
            let beta = (next / rr) as f32;
            turn::<L>(&mut direction, &residual, [beta; L]);
            rr = next;
        }
        *reflected = scaled(self.times::<L>(&self.root, &y), -1);
        done
    }

    /// [`Self::solve`] where leaves look for themselves: plain sweeps, since no lane has a flux of its own to conserve.
    /// Reflected radiosity, and irradiance by it.
    pub(super) fn solve_by_rays<const L: usize>(
        &self,
        system: &RaySystem,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
    ) -> (Convergence, Rows) {
        let mut done = Convergence::default();
        loop {
            let seen = system.received::<L>(reflected);
            let mut all = seen.clone();
            step::<L>(&mut all, first, [1.0; L]);
            let mut change = self.reflect::<L>(&all);
            step::<L>(&mut change, reflected, [-1.0; L]);
            step::<L>(reflected, &change, [1.0; L]);
            done.iterations += 1;
            let length = |x: &Rows| dot::<L>(x, x).iter().sum::<f64>().sqrt();
            done.residual = length(&change) / length(reflected).max(f64::MIN_POSITIVE);
            done.bound = done.residual * self.greatest / (1.0 - self.greatest);
            let ended = done.iterations >= MAX_ITERATIONS || system.interrupt.is_raised();
            if done.bound <= tolerance || ended {
                return (done, seen);
            }
        }
    }
}
