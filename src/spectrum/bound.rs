//! The neglected term, bounded: the paper's open question (section 5).
//!
//! With the mean m_a = v + e_a / A_a of a spectrum under the weight a_bar, and its standard deviation
//! sigma_a = sqrt(integral over the interval of (f - m_a)^2 a_bar), the errors of a product are exactly
//!
//! e'_a = R e_S + S e_R + e_S e_R / A + C_a,   C_a = integral of (S - m_S)(R - m_R) a_bar,   |C_a| <= sigma_S sigma_R
//!
//! by Cauchy and Schwarz. C_a also cannot take the integral of S R a_bar out of [min S, max S] times that of R a_bar, nor
//! the other way round. So an error known to lie within a radius stays known within a radius. The deviation of the product
//! is at most the least of
//!
//! R_max sigma_S + m_S sigma_R,   S_max sigma_R + m_R sigma_S,   (max - min)/2 sqrt(A).
//!
//! All three follow from (SR - c)^2 >= (SR - m_SR)^2 in the mean for any constant c. Everything here is a bound, up to the
//! rounding of the arithmetic. Spectra must not be negative.

use super::interval::{Cmf, Estimate, Interval, Moment};

/// An interval with a radius around its errors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Bounded {
    /// Value and errors, as [`Moment`] has them, moved to the middle of what is possible.
    pub moment: Moment,
    /// The true error is within this of the estimate.
    pub radius: Cmf,
    /// The standard deviation sigma is at most this.
    pub deviation: Cmf,
    /// The spectrum is nowhere on the interval below this.
    pub low: f64,
    /// Nor above this.
    pub high: f64,
}

impl Bounded {
    /// The mean m_a under each weight, as estimated.
    fn mean(&self, cmf: &Cmf) -> Cmf {
        let Estimate { value, error } = self.moment.0;
        std::array::from_fn(|a| {
            if cmf[a] > 0.0 {
                value + error[a] / cmf[a]
            } else {
                value
            }
        })
    }

    /// The part of the interval's range that is left for the mean under weight `a`, from its radius.
    fn mean_range(&self, mean: f64, a: usize, cmf: &Cmf) -> [f64; 2] {
        let slack = if cmf[a] > 0.0 {
            self.radius[a] / cmf[a]
        } else {
            0.0
        };
        [(mean - slack).max(self.low), (mean + slack).min(self.high)]
    }
}

impl Interval for Bounded {
    fn new(average: f64, f: &[f64], cmf: [&[f64]; 3]) -> Self {
        let deviation = cmf.map(|weights| {
            let total: f64 = weights.iter().sum();
            if total <= 0.0 {
                return 0.0;
            }
            let mean = f.iter().zip(weights).map(|(f, w)| f * w).sum::<f64>() / total;
            f.iter()
                .zip(weights)
                .map(|(f, w)| (f - mean).powi(2) * w)
                .sum::<f64>()
                .sqrt()
        });
        Self {
            moment: Moment::new(average, f, cmf),
            radius: [0.0; 3],
            deviation,
            low: f.iter().copied().fold(f64::INFINITY, f64::min),
            high: f.iter().copied().fold(0.0, f64::max),
        }
    }

    fn constant(value: f64) -> Self {
        Self {
            moment: Moment::constant(value),
            radius: [0.0; 3],
            deviation: [0.0; 3],
            low: value,
            high: value,
        }
    }

    fn times(&self, r: &Self, cmf: &Cmf) -> Self {
        let (mean_s, mean_r) = (self.mean(cmf), r.mean(cmf));
        let mut moment = self.moment.times(&r.moment, cmf);
        let (low, high) = (self.low * r.low, self.high * r.high);
        let (mut radius, mut deviation) = ([0.0; 3], [0.0; 3]);
        for a in 0..3 {
            if cmf[a] <= 0.0 {
                continue;
            }
            let [least, most] = self.mean_range(mean_s[a], a, cmf);
            // The mean of S R: around the product of the means by the radius of S and the covariance, and inside what
            // the ranges of S and R allow.
            let middle = mean_s[a] * mean_r[a];
            let reach = (mean_r[a] * self.radius[a] + self.deviation[a] * r.deviation[a]) / cmf[a];
            let from = (middle - reach)
                .max(self.low * mean_r[a])
                .max(least * r.low);
            let to = (middle + reach)
                .min(self.high * mean_r[a])
                .min(most * r.high);
            // Rounding can cross the two ends where the radius is nothing.
            let (from, to) = (from.min(to), to.max(from));
            moment.0.error[a] = (0.5 * (from + to) - moment.0.value) * cmf[a];
            radius[a] = 0.5 * (to - from) * cmf[a];
            deviation[a] = (r.high * self.deviation[a] + most * r.deviation[a])
                .min(mean_r[a] * self.deviation[a] + self.high * r.deviation[a])
                .min(0.5 * (high - low) * cmf[a].sqrt());
        }
        Self {
            moment,
            radius,
            deviation,
            low,
            high,
        }
    }

    /// Parallel axes: the squares of the deviations add, and the distance of the two means comes on top.
    fn merged(left: &Self, right: &Self, cmf: [&Cmf; 2], share: f64) -> Self {
        let moment = Moment::merged(&left.moment, &right.moment, cmf, share);
        let means = [left.mean(cmf[0]), right.mean(cmf[1])];
        let (low, high) = (left.low.min(right.low), left.high.max(right.high));
        let deviation = std::array::from_fn(|a| {
            let (l, r) = (
                left.mean_range(means[0][a], a, cmf[0]),
                right.mean_range(means[1][a], a, cmf[1]),
            );
            let apart = (l[1] - r[0]).max(r[1] - l[0]).max(0.0);
            let whole = cmf[0][a] + cmf[1][a];
            let between = if whole > 0.0 {
                cmf[0][a] * cmf[1][a] / whole * apart * apart
            } else {
                0.0
            };
            (left.deviation[a].powi(2) + right.deviation[a].powi(2) + between)
                .sqrt()
                .min(0.5 * (high - low) * whole.sqrt())
        });
        Self {
            moment,
            radius: super::list::add(left.radius, right.radius),
            deviation,
            low,
            high,
        }
    }

    /// What deviates from the mean on one half is made up on the other, so by Cauchy and Schwarz the integral of
    /// (f - m) a_bar over a share p of the weight is at most sigma sqrt(p (1 - p) A).
    fn half(&self, whole: &Cmf, half: &Cmf) -> Self {
        let moment = self.moment.half(whole, half);
        let radius = std::array::from_fn(|a| {
            if whole[a] <= 0.0 {
                return 0.0;
            }
            let share = half[a] / whole[a];
            share * self.radius[a]
                + self.deviation[a] * (share * (1.0 - share).max(0.0) * whole[a]).sqrt()
        });
        Self {
            moment,
            radius,
            ..*self
        }
    }

    /// Errors and radii add; deviations do at most (triangle inequality).
    fn plus(&self, factor: f64, other: &Self) -> Self {
        let sum = |a: &Cmf, b: &Cmf| std::array::from_fn(|c| a[c] + factor * b[c]);
        Self {
            moment: self.moment.plus(factor, &other.moment),
            radius: sum(&self.radius, &other.radius),
            deviation: sum(&self.deviation, &other.deviation),
            low: self.low + factor * other.low,
            high: self.high + factor * other.high,
        }
    }

    fn value(&self) -> f64 {
        self.moment.value()
    }

    fn error(&self) -> Cmf {
        self.moment.error()
    }

    fn radius(&self) -> Cmf {
        self.radius
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::color::tristimulus;
    use crate::spectrum::partition::tests::any_cut;
    use crate::spectrum::testing::{cmf, patch};
    use crate::spectrum::{CmfTree, DyadicTree, List, Representative, Spectrum};
    use proptest::prelude::*;

    /// Is everything that the list claims true of `exact`? Slack for rounding only.
    pub(crate) fn holds(
        list: &List<Bounded>,
        exact: &Spectrum,
        cmf: &CmfTree,
    ) -> Result<(), String> {
        let scale = exact.iter().copied().fold(0.0, f64::max);
        for (interval, (first, len)) in list.intervals().iter().zip(list.partition().iter()) {
            let over = first..first + len;
            let truth = Bounded::new(
                interval.value(),
                &exact[over.clone()],
                cmf.weights().each_ref().map(|a| &a[over.clone()]),
            );
            for a in 0..3 {
                let total: f64 = cmf.weights()[a][over.clone()].iter().sum();
                let slack = 1e-12 * scale * total;
                if (truth.error()[a] - interval.error()[a]).abs() > interval.radius[a] + slack {
                    return Err(format!(
                        "error {a} of {first}+{len}: {truth:?} {interval:?}"
                    ));
                }
                if truth.deviation[a] > interval.deviation[a] + 1e-7 * scale * total.sqrt() {
                    return Err(format!(
                        "spread {a} of {first}+{len}: {truth:?} {interval:?}"
                    ));
                }
            }
            if truth.low < interval.low - 1e-12 * scale
                || truth.high > interval.high + 1e-12 * scale
            {
                return Err(format!("range of {first}+{len}: {truth:?} {interval:?}"));
            }
        }
        let (error, radius) = (list.error(), list.radius());
        let truth = tristimulus(exact, cmf.weights());
        for a in 0..3 {
            let off = truth[a] - list.xyz(cmf)[a] - error[a];
            if off.abs() > radius[a] + 1e-12 * scale * cmf.node(1)[a] {
                return Err(format!("total {a}: off by {off}, radius {}", radius[a]));
            }
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn products_and_merges_stay_within_their_bounds(spectra in prop::collection::vec(patch(), 2..6), cut in any_cut(), merges in any::<u64>()) {
            let cmf = cmf();
            let mut exact = spectra[0];
            let mut list = List::new(&DyadicTree::<Bounded>::new(&exact, &cmf), cut);
            let mut out = List::black();
            for r in &spectra[1..] {
                exact = std::array::from_fn(|k| exact[k] * r[k]);
                list.reflect(&DyadicTree::new(r, &cmf), &cmf, &mut out);
                std::mem::swap(&mut list, &mut out);
                prop_assert_eq!(holds(&list, &exact, &cmf), Ok(()));
                let pairs = list.partition().pairs() & merges;
                for first in (0..64).filter(|k| pairs >> k & 1 == 1) {
                    let rule = if first % 4 == 0 { Representative::Mean } else { Representative::Projection };
                    prop_assert!(list.merge(first, &cmf, rule));
                }
                prop_assert_eq!(holds(&list, &exact, &cmf), Ok(()));
                prop_assert_eq!(list.validate(), Ok(()));
            }
        }
    }
}
