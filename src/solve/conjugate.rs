//! Conjugate gradients on all bands at once: one matrix, one right-hand side a lane, one alpha and beta a lane.
//!
//! (Hestenes and Stiefel 1952.) The operator is symmetric with eigenvalues in [1 - rho_max, 1 + rho_max], so that
//! `|error| <= |residual| / (1 - rho_max)` in the norm `sum A R^2 / rho`: a *bound*, given exact row sums.

use super::operator::Operator;
use super::rows::Rows;
use rayon::prelude::*;

/// Iterations at the most. Corridors of albedo .99 take about 20.
pub(super) const MAX_ITERATIONS: usize = 400;
/// Rows a partial sum covers; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 1024;

/// How a solve went.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Convergence {
    /// Operator applications.
    pub iterations: usize,
    /// Greatest relative residual of a lane.
    pub residual: f64,
    /// Bound of the relative error in the norm above: residual / (1 - rho_max), worst lane.
    pub bound: f64,
}

/// The system `(1 - K) y = b`.
#[derive(Debug)]
pub(super) struct System<'a> {
    /// Pull, gather, push.
    pub operator: Operator<'a>,
    /// Reflectance of each leaf.
    pub reflectance: &'a Rows,
    /// Greatest reflectance of each lane.
    pub greatest: &'a [f32],
}

impl System<'_> {
    /// Reflected radiosity of the leaves (by leaf) from the irradiance of the first bounce, starting from a guess.
    pub(super) fn solve<const L: usize>(
        &self,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
    ) -> Convergence {
        let (tree, areas) = (self.operator.tree, self.operator.areas);
        let leaves = self.operator.leaves;
        let count = leaves.len();
        let mut root = Rows::zero(count, L);
        for ((root, rho), &leaf) in root
            .all_mut::<L>()
            .iter_mut()
            .zip(self.reflectance.all::<L>())
            .zip(leaves)
        {
            let area = areas[leaf as usize] as f32;
            *root = rho.map(|x| (x * area).sqrt());
        }
        let mut work = Work {
            radiosity: Rows::zero(count, L),
            nodes: Rows::zero(tree.nodes.len(), L),
            gathered: Rows::zero(tree.nodes.len(), L),
        };
        let mut b = Rows::zero(count, L);
        for ((b, h), r) in b
            .all_mut::<L>()
            .iter_mut()
            .zip(first.all::<L>())
            .zip(root.all::<L>())
        {
            *b = std::array::from_fn(|l| h[l] * r[l]);
        }
        // y from the guess; 0 where nothing is reflected.
        let mut y = Rows::zero(count, L);
        for (((y, guess), r), &leaf) in y
            .all_mut::<L>()
            .iter_mut()
            .zip(reflected.all::<L>())
            .zip(root.all::<L>())
            .zip(leaves)
        {
            let area = areas[leaf as usize] as f32;
            *y = std::array::from_fn(|l| {
                if r[l] > 0.0 {
                    guess[l] * area / r[l]
                } else {
                    0.0
                }
            });
        }
        let norm = dot::<L>(&b, &b).map(|x| x.max(f64::MIN_POSITIVE));
        let mut applied = Rows::zero(count, L);
        self.apply::<L>(&y, &root, &mut work, &mut applied);
        let mut residual = Rows::zero(count, L);
        for ((r, b), a) in residual
            .all_mut::<L>()
            .iter_mut()
            .zip(b.all::<L>())
            .zip(applied.all::<L>())
        {
            *r = std::array::from_fn(|l| b[l] - a[l]);
        }
        let mut direction = residual.clone();
        let mut rr = dot::<L>(&residual, &residual);
        let mut done = Convergence::default();
        loop {
            done.residual = 0.0;
            done.bound = 0.0;
            for l in 0..L {
                let relative = (rr[l] / norm[l]).sqrt();
                done.residual = done.residual.max(relative);
                done.bound = done
                    .bound
                    .max(relative / (1.0 - f64::from(self.greatest[l])));
            }
            if done.bound <= tolerance || done.iterations >= MAX_ITERATIONS {
                break;
            }
            self.apply::<L>(&direction, &root, &mut work, &mut applied);
            done.iterations += 1;
            let curvature = dot::<L>(&direction, &applied);
            let alpha: [f32; L] = std::array::from_fn(|l| {
                if curvature[l] > 0.0 {
                    (rr[l] / curvature[l]) as f32
                } else {
                    0.0
                }
            });
            step::<L>(&mut y, &direction, alpha);
            step::<L>(&mut residual, &applied, alpha.map(|a| -a));
            let next = dot::<L>(&residual, &residual);
            let beta: [f32; L] = std::array::from_fn(|l| {
                if rr[l] > 0.0 {
                    (next[l] / rr[l]) as f32
                } else {
                    0.0
                }
            });
            for (d, r) in direction.all_mut::<L>().iter_mut().zip(residual.all::<L>()) {
                *d = std::array::from_fn(|l| r[l] + beta[l] * d[l]);
            }
            // Rounding ends progress: what is left is f32, not the method.
            if next.iter().zip(&norm).all(|(n, b)| *n <= 1e-14 * b) {
                rr = next;
                done.residual = rr
                    .iter()
                    .zip(&norm)
                    .map(|(r, b)| (r / b).sqrt())
                    .fold(0.0, f64::max);
                done.bound = (0..L)
                    .map(|l| (rr[l] / norm[l]).sqrt() / (1.0 - f64::from(self.greatest[l])))
                    .fold(0.0, f64::max);
                break;
            }
            rr = next;
        }
        for (((out, y), r), &leaf) in reflected
            .all_mut::<L>()
            .iter_mut()
            .zip(y.all::<L>())
            .zip(root.all::<L>())
            .zip(leaves)
        {
            let inverse = (1.0 / areas[leaf as usize]) as f32;
            *out = std::array::from_fn(|l| y[l] * r[l] * inverse);
        }
        done
    }

    /// `(1 - K) y`.
    fn apply<const L: usize>(&self, y: &Rows, root: &Rows, work: &mut Work, out: &mut Rows) {
        let areas = self.operator.areas;
        let rows = work
            .radiosity
            .all_mut::<L>()
            .iter_mut()
            .zip(y.all::<L>())
            .zip(root.all::<L>());
        for (((b, y), r), &leaf) in rows.zip(self.operator.leaves) {
            let inverse = (1.0 / areas[leaf as usize]) as f32;
            *b = std::array::from_fn(|l| y[l] * r[l] * inverse);
        }
        self.operator
            .irradiance::<L>(&work.radiosity, &mut work.nodes, &mut work.gathered, out);
        for ((o, y), r) in out
            .all_mut::<L>()
            .iter_mut()
            .zip(y.all::<L>())
            .zip(root.all::<L>())
        {
            *o = std::array::from_fn(|l| y[l] - r[l] * o[l]);
        }
    }
}

/// Scratch of the operator.
struct Work {
    radiosity: Rows,
    nodes: Rows,
    gathered: Rows,
}

/// `x += alpha p`, lane by lane.
pub(super) fn step<const L: usize>(x: &mut Rows, p: &Rows, alpha: [f32; L]) {
    for (x, p) in x.all_mut::<L>().iter_mut().zip(p.all::<L>()) {
        for l in 0..L {
            x[l] += alpha[l] * p[l];
        }
    }
}

/// Inner products lane by lane, f64, summed in fixed chunks.
pub(super) fn dot<const L: usize>(x: &Rows, y: &Rows) -> [f64; L] {
    let parts: Vec<[f64; L]> = x
        .all::<L>()
        .par_chunks(CHUNK)
        .zip(y.all::<L>().par_chunks(CHUNK))
        .map(|(x, y)| {
            let mut sum = [0.0; L];
            for (x, y) in x.iter().zip(y) {
                add_products(&mut sum, x, y);
            }
            sum
        })
        .collect();
    parts.iter().fold([0.0; L], |acc, part| {
        std::array::from_fn(|l| acc[l] + part[l])
    })
}

/// `sum += x y`. Slices of a length that the compiler does not know: of arrays it makes single numbers.
#[inline(never)]
fn add_products(sum: &mut [f64], x: &[f32], y: &[f32]) {
    for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
        *s += f64::from(*x) * f64::from(*y);
    }
}
