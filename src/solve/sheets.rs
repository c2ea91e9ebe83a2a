//! The solve in rooms with diffuse sheets: what leaves one side depends on the light of both,
//! `R = rho (f + F R) + tau (f' + F' R)`, where ' marks the side behind.
//!
//! With M for both terms that is `(1 - M F) R = M f`. M is symmetric, but where a sheet lets more light through than it reflects it
//! has negative eigenvalues, which rules out conjugate gradients on its root. So light is found by BiCGSTAB (van der Vorst 1992), all
//! lanes side by side, which needs no symmetry; then plain sweeps, `R = M (f + F R)`, tell how large the error is and go on if it is
//! too large. In the norm `sum A R^2` M shrinks by the greatest `rho + tau`, s, and F does not grow: a sweep that changes R by d
//! leaves an error of `d s / (1 - s)` at the most.

use super::conjugate::{Convergence, step, turn};
use super::reflection::Reflection;
use super::sums::dot_by_area;
use crate::light::rows::Rows;
use crate::team::Interrupt;

/// Applications of the operator by BiCGSTAB, at the most: bright rooms take some 20.
const MOST: usize = 100;
/// BiCGSTAB goes on to this share of the tolerance: the norm says little of closed-in places.
const SHARE: f64 = 0.1;
/// Sweeps at the most.
const SWEEPS: usize = 400;

/// How the leaves of a room reflect, and what turns radiosity into irradiance.
pub(super) struct System<'a> {
    pub(super) reflection: &'a Reflection,
    /// Area of each leaf.
    pub(super) areas: Vec<f64>,
    /// From radiosity by leaf to irradiance by leaf.
    pub(super) receive: &'a dyn Fn(&Rows) -> Rows,
    /// Ends the solve at any time.
    pub(super) interrupt: &'a Interrupt,
}

impl System<'_> {
    /// Reflected radiosity (from a guess) by direct irradiance, and irradiance by reflected light, all by leaf.
    pub(super) fn solve<const L: usize>(
        &self,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
    ) -> (Convergence, Rows) {
        let mut done = Convergence::default();
        self.approach::<L>(first, reflected, tolerance, &mut done);
        let greatest = self.reflection.greatest.iter();
        let tails: Vec<f64> = greatest
            .map(|&s| f64::from(s) / (1.0 - f64::from(s)))
            .collect();
        loop {
            let seen = (self.receive)(reflected);
            let mut next = seen.clone();
            step::<L>(&mut next, first, [1.0; L]);
            let next = self.reflection.of::<L>(&next);
            step::<L>(reflected, &next, [-1.0; L]);
            let (moved, whole) = (
                dot_by_area::<L>(&self.areas, reflected, reflected),
                dot_by_area::<L>(&self.areas, &next, &next),
            );
            *reflected = next;
            done.iterations += 1;
            (done.residual, done.bound) = (0.0, 0.0);
            for l in 0..L {
                let change = (moved[l] / whole[l].max(f64::MIN_POSITIVE)).sqrt();
                done.residual = done.residual.max(change);
                done.bound = done
                    .bound
                    .max(change * tails.get(l).copied().unwrap_or(0.0));
            }
            let ended = done.iterations >= MOST + SWEEPS || self.interrupt.is_raised();
            if done.bound <= tolerance || ended {
                return (done, seen);
            }
        }
    }

    /// BiCGSTAB. Its result is no worse than the guess.
    fn approach<const L: usize>(
        &self,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
        done: &mut Convergence,
    ) {
        let guess = reflected.clone();
        let mut residual = self.reflection.of::<L>(first);
        let norm = dot_by_area::<L>(&self.areas, &residual, &residual);
        step::<L>(&mut residual, &self.apply::<L>(reflected), [-1.0; L]);
        let start = dot_by_area::<L>(&self.areas, &residual, &residual);
        let shadow = residual.clone();
        let (mut direction, mut applied) = (residual.clone(), Rows::zero(residual.len(), L));
        let mut rho = start;
        let mut left = start;
        done.iterations += 1;
        let goes_on =
            |done: &Convergence| done.iterations + 2 <= MOST && !self.interrupt.is_raised();
        while self.bound(&left, &norm) > SHARE * tolerance && goes_on(done) {
            applied.clone_from(&self.apply::<L>(&direction));
            let alpha = ratios(&rho, &dot_by_area::<L>(&self.areas, &shadow, &applied));
            step::<L>(reflected, &direction, alpha);
            step::<L>(&mut residual, &applied, alpha.map(|a| -a));
            let next = self.apply::<L>(&residual);
            let omega = ratios(
                &dot_by_area::<L>(&self.areas, &next, &residual),
                &dot_by_area::<L>(&self.areas, &next, &next),
            );
            step::<L>(reflected, &residual, omega);
            step::<L>(&mut residual, &next, omega.map(|w| -w));
            done.iterations += 2;
            left = dot_by_area::<L>(&self.areas, &residual, &residual);
            let after = dot_by_area::<L>(&self.areas, &shadow, &residual);
            // p = r + beta (p - omega v).
            let ratio = ratios(&after, &rho);
            let beta = std::array::from_fn(|l| match omega[l] {
                0.0 => 0.0,
                w => ratio[l] * alpha[l] / w,
            });
            step::<L>(&mut direction, &applied, omega.map(|w| -w));
            turn::<L>(&mut direction, &residual, beta);
            rho = after;
        }
        // A lane that broke down keeps its guess; light is nowhere below 0.
        for (row, guess) in reflected.all_mut::<L>().iter_mut().zip(guess.all::<L>()) {
            for l in 0..L {
                if left[l].is_nan() || left[l] > start[l] {
                    row[l] = guess[l];
                }
                row[l] = row[l].max(0.0);
            }
        }
    }

    /// `(1 - M F) x`.
    fn apply<const L: usize>(&self, x: &Rows) -> Rows {
        let again = self.reflection.of::<L>(&(self.receive)(x));
        let mut out = x.clone();
        step::<L>(&mut out, &again, [-1.0; L]);
        out
    }

    /// How large the error of the worst lane may still be, from squares of residual and right-hand side.
    fn bound(&self, left: &[f64], norm: &[f64]) -> f64 {
        let lanes = left.iter().zip(norm).zip(&self.reflection.greatest);
        lanes
            .filter(|((_, norm), _)| **norm > 0.0)
            .map(|((left, norm), &s)| (left / norm).sqrt() / (1.0 - f64::from(s)))
            .fold(0.0, f64::max)
    }
}

/// Quotients lane by lane; 0 where not finite.
fn ratios<const L: usize>(a: &[f64; L], b: &[f64; L]) -> [f32; L] {
    std::array::from_fn(|l| {
        let ratio = (a[l] / b[l]) as f32;
        if ratio.is_finite() { ratio } else { 0.0 }
    })
}
