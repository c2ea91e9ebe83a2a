//! The radiosity equation `R = M (f + F R)`: irradiance f comes straight from lamps, F turns what leaves send into what they receive,
//! M into what they send again.
//!
//! One solver for all rooms. F may be links or rays; M may be one reflectance a lane, a matrix a paint, or light that passes a sheet. So
//! nothing is symmetric in general, and M may have negative eigenvalues. Light is found by BiCGSTAB (van der Vorst 1992) on
//! `(1 - M F) R = M f`, all lanes side by side, which asks for neither; a plain sweep, `R = M (f + F R)`, then says how far that got.
//!
//! In the norm `sum A R^2` M shrinks by the greatest share s of irradiance that leaves a leaf, and F of balanced links does not grow: what a sweep
//! changes by d leaves an error of `d s / (1 - s)` at the most. Of rays that is so in the mean.

use super::reflection::Reflection;
use super::sums::dot_by_area;
use crate::light::rows::Rows;
use crate::team::Interrupt;

/// Applications of F at the most. A corridor of 40 m and albedo .99 takes about 40.
pub(super) const MOST: usize = 400;
/// Light is sought to this share of the tolerance between two sweeps: the norm says little of what is closed in.
const SHARE: f64 = 0.1;
/// Relative change that may be rounding alone: in a row of 512 leaves it stays at 2e-7.
const ROUNDING: f64 = 5e-7;

/// How a solve went.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Convergence {
    /// Applications of F.
    pub iterations: usize,
    /// Relative change of the worst lane by the last sweep.
    pub residual: f64,
    /// Bound of the relative error in the norm above, worst lane; by rays an estimate.
    pub bound: f64,
    /// How often all bounces were found for what fluoresces; 0 where nothing does.
    pub fluorescence: usize,
    /// What lists came to, where light was carried by lists.
    pub carried: Option<Carried>,
}

/// What light carried by lists came to.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Carried {
    /// Mean number of intervals of a list, over all patches and bounces.
    pub(crate) intervals: f64,
    /// Mean over the leaves, by area, of the error that lists know of, CIELUV.
    pub(crate) de_luv: f64,
}

/// A room whose leaves reflect so, with what turns radiosity into irradiance.
pub(super) struct System<'a> {
    pub(super) reflection: &'a Reflection,
    /// Area of each leaf that takes part.
    pub(super) areas: Vec<f64>,
    /// From radiosity by leaf to irradiance by leaf.
    pub(super) receive: &'a (dyn Fn(&Rows) -> Rows + Sync),
    /// Ends the solve wherever it is.
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
        let tails = (self.reflection.greatest::<L>()).map(|s| s / (1.0 - s));
        let mut done = Convergence::default();
        loop {
            let seen = (self.receive)(reflected);
            let mut change = seen.clone();
            step::<L>(&mut change, first, [1.0; L]);
            change = self.reflection.of::<L>(&change);
            step::<L>(&mut change, reflected, [-1.0; L]);
            step::<L>(reflected, &change, [1.0; L]);
            done.iterations += 1;
            let moved = self.products::<L>(&change, &change);
            let whole = self.products::<L>(reflected, reflected);
            done.residual = worst(&moved, &whole, &[1.0; L]);
            done.bound = worst(&moved, &whole, &tails);
            let ended = done.iterations >= MOST || self.interrupt.is_raised();
            if ended || is_near(&moved, &whole, &tails, tolerance) {
                return (done, seen);
            }
            // The residual is that of the guess before the sweep.
            step::<L>(reflected, &change, [-1.0; L]);
            let near = |left: &[f64; L]| is_near(left, &whole, &tails, SHARE * tolerance);
            self.approach::<L>(change, reflected, near, &mut done);
        }
    }

    /// BiCGSTAB from a guess and its residual, until what is left is `near`. No lane ends further off than after a sweep.
    fn approach<const L: usize>(
        &self,
        mut residual: Rows,
        reflected: &mut Rows,
        near: impl Fn(&[f64; L]) -> bool,
        done: &mut Convergence,
    ) {
        let (guess, shadow) = (reflected.clone(), residual.clone());
        let start = self.products::<L>(&residual, &residual);
        let (mut direction, mut rho, mut left) = (residual.clone(), start, start);
        while !near(&left) && done.iterations + 2 < MOST && !self.interrupt.is_raised() {
            let applied = self.apply::<L>(&direction);
            let alpha = ratios(&rho, &self.products::<L>(&shadow, &applied));
            step::<L>(reflected, &direction, alpha);
            step::<L>(&mut residual, &applied, alpha.map(|a| -a));
            let next = self.apply::<L>(&residual);
            let omega = ratios(
                &self.products::<L>(&next, &residual),
                &self.products::<L>(&next, &next),
            );
            step::<L>(reflected, &residual, omega);
            step::<L>(&mut residual, &next, omega.map(|w| -w));
            done.iterations += 2;
            left = self.products::<L>(&residual, &residual);
            let after = self.products::<L>(&shadow, &residual);
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
        // A lane that broke down takes a sweep; where a lane is an interval of wavelengths, light is nowhere below 0.
        let least = match self.reflection.mixed {
            Some(_) => f32::NEG_INFINITY,
            None => 0.0,
        };
        let before = guess.all::<L>().iter().zip(shadow.all::<L>());
        for (row, (guess, change)) in reflected.all_mut::<L>().iter_mut().zip(before) {
            for l in 0..L {
                if left[l].is_nan() || left[l] > start[l] {
                    row[l] = guess[l] + change[l];
                }
                row[l] = row[l].max(least);
            }
        }
    }

    /// `(1 - M F) x`.
    fn apply<const L: usize>(&self, x: &Rows) -> Rows {
        let mut out = x.clone();
        let again = self.reflection.of::<L>(&(self.receive)(x));
        step::<L>(&mut out, &again, [-1.0; L]);
        out
    }

    /// Inner products by area; the same for all lanes where these reflect into each other.
    pub(super) fn products<const L: usize>(&self, x: &Rows, y: &Rows) -> [f64; L] {
        let each = dot_by_area::<L>(&self.areas, x, y);
        match self.reflection.mixed {
            Some(_) => [each.iter().sum(); L],
            None => each,
        }
    }
}

/// The greatest relative length of a lane times its factor, from squares of lengths.
pub(super) fn worst<const L: usize>(
    squares: &[f64; L],
    whole: &[f64; L],
    factors: &[f64; L],
) -> f64 {
    let lanes = squares.iter().zip(whole).zip(factors);
    lanes.fold(0.0, |worst, ((square, whole), factor)| {
        worst.max((square / whole.max(f64::MIN_POSITIVE)).sqrt() * factor)
    })
}

/// Is every lane within the tolerance, or as near as rounding lets it come?
pub(super) fn is_near<const L: usize>(
    squares: &[f64; L],
    whole: &[f64; L],
    tails: &[f64; L],
    tolerance: f64,
) -> bool {
    (0..L).all(|l| {
        let (change, whole) = (squares[l].sqrt(), whole[l].sqrt());
        change * tails[l] <= tolerance * whole || change <= ROUNDING * whole
    })
}

/// Lane by lane; 0 where that is no number.
fn ratios<const L: usize>(a: &[f64; L], b: &[f64; L]) -> [f32; L] {
    std::array::from_fn(|l| {
        let ratio = (a[l] / b[l]) as f32;
        if ratio.is_finite() { ratio } else { 0.0 }
    })
}

/// The next direction: `p = z + beta p`, lane by lane.
fn turn<const L: usize>(p: &mut Rows, z: &Rows, beta: [f32; L]) {
    for (p, z) in p.all_mut::<L>().iter_mut().zip(z.all::<L>()) {
        *p = std::array::from_fn(|l| z[l] + beta[l] * p[l]);
    }
}

/// `x += alpha p`, lane by lane.
pub(super) fn step<const L: usize>(x: &mut Rows, p: &Rows, alpha: [f32; L]) {
    for (x, p) in x.all_mut::<L>().iter_mut().zip(p.all::<L>()) {
        for l in 0..L {
            x[l] += alpha[l] * p[l];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const L: usize = 4;
    /// Leaves in a row.
    const COUNT: usize = 512;
    /// Leaves that a leaf sees on either side.
    const REACH: usize = 4;
    /// Plain sweeps after which light is within 5e-5: .99 to this power.
    const SWEEPS: usize = 1000;
    /// Lane 3 is black, in lane 2 every other leaf is.
    const ALBEDO: [f32; L] = [0.99, 0.5, 0.9, 0.0];

    /// What leaves of two rows receive that see nothing of each other: the next ones on either side, mirrored at the ends of the rows.
    /// Every mean is over as many.
    fn receive(radiosity: &Rows) -> Rows {
        let mut out = Rows::zero(COUNT, L);
        let half = COUNT / 2;
        for k in 0..COUNT {
            let (start, place) = (k / half * half, k % half);
            for d in 1..=REACH {
                let right = if place + d < half {
                    place + d
                } else {
                    2 * half - 1 - place - d
                };
                let left = if place >= d { place - d } else { d - 1 - place };
                for other in [left, right] {
                    for l in 0..L {
                        out.row_mut(k)[l] += radiosity.row(start + other)[l] / (2 * REACH) as f32;
                    }
                }
            }
        }
        out
    }

    /// Light on the first leaf only.
    fn lit() -> Rows {
        let mut first = Rows::zero(COUNT, L);
        first.row_mut(0).fill(1.0);
        first.row_mut(1).fill(1.0);
        first
    }

    fn reflection() -> Reflection {
        let mut rows = Rows::zero(COUNT, L);
        for k in 0..COUNT {
            rows.row_mut(k).copy_from_slice(&ALBEDO);
            rows.row_mut(k)[2] *= (k % 2) as f32;
        }
        Reflection {
            rows,
            greatest: ALBEDO.to_vec(),
            mixed: None,
            sheets: None,
        }
    }

    fn solved(tolerance: f64) -> (Rows, Convergence) {
        let system = System {
            reflection: &reflection(),
            areas: vec![1.0; COUNT],
            receive: &receive,
            interrupt: &crate::team::NEVER,
        };
        let mut reflected = Rows::zero(COUNT, L);
        let (done, _) = system.solve::<L>(&lit(), &mut reflected, tolerance);
        (reflected, done)
    }

    #[test]
    fn it_finds_what_sweeps_find_in_fewer_applications() {
        let (reflection, first) = (reflection(), lit());
        let mut plain = Rows::zero(COUNT, L);
        for _ in 0..SWEEPS {
            let mut next = receive(&plain);
            step::<L>(&mut next, &first, [1.0; L]);
            plain = reflection.of::<L>(&next);
        }
        let (quick, done) = solved(1e-4);
        for (p, q) in plain.all::<L>().iter().zip(quick.all::<L>()) {
            for l in 0..L {
                assert!(
                    (p[l] - q[l]).abs() <= 2e-4 * plain.row(1)[l],
                    "{l}: {p:?} {q:?}"
                );
            }
        }
        // All light that comes in is absorbed: sum (1 - rho) / rho R = first.
        let kept: f32 = quick.all::<L>().iter().map(|r| r[0]).sum::<f32>() / 0.99 * 0.01;
        assert!((kept / 2.0 - 1.0).abs() < 1e-3, "{kept}");
        assert!(6 * done.iterations < SWEEPS, "{done:?}");
    }

    #[test]
    fn what_no_light_reaches_stays_exactly_dark() {
        let (rows, _) = solved(1e-4);
        let half = rows.len() / 2;
        for row in &rows.all::<L>()[half..] {
            assert_eq!(*row, [0.0; L]);
        }
        assert!(rows.all::<L>()[..half].iter().all(|row| row[3] == 0.0));
        assert!(rows.row(half - 1)[0] > 0.0);
    }

    /// No number of iterations makes more of single precision.
    #[test]
    fn it_ends_where_rounding_ends_it() {
        let (_, done) = solved(0.0);
        assert!(done.iterations < MOST && done.residual < 1e-6, "{done:?}");
    }
}
