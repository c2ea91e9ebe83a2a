//! What a list or a tree knows of a spectrum on one interval (paper 3.1.2, 3.2).
//!
//! For f held as the value v on an interval I, and each colour matching function a_bar,
//! e_a = integral over I of (f - v) a_bar (eq. 2 without K: scale the source by K and every error below it is scaled).
//! A_a stands for the integral of a_bar over I. All rules here are per interval; units are those of f times nm.

/// Sums of the three colour matching functions over an interval.
pub type Cmf = [f64; 3];

/// How the value of two merged intervals is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Representative {
    /// Half the sum (paper 3.2).
    Mean,
    /// Least squares in the three tristimulus values, as in eq. 3.
    Projection,
}

/// A spectrum on one interval: its value and what is known of the error of that value.
pub trait Interval: Copy + Default + std::fmt::Debug {
    /// The value `average` held for the bands `f` under the colour matching functions `cmf` (same bands).
    fn new(average: f64, f: &[f64], cmf: [&[f64]; 3]) -> Self;

    /// A value that stands for a spectrum known to be constant on the interval.
    fn constant(value: f64) -> Self;

    /// Reflection: this spectrum times a reflectance whose errors are exact (a node of a tree), on an interval of sums `cmf`.
    #[must_use]
    fn times(&self, reflectance: &Self, cmf: &Cmf) -> Self;

    /// Both halves of an interval as one, whose value is `share` of the left and the rest of the right; `cmf` are the sums
    /// over the halves.
    #[must_use]
    fn merged(left: &Self, right: &Self, cmf: [&Cmf; 2], share: f64) -> Self;

    /// One half of an interval, whose own spectrum is not known beyond the record of the whole; `whole` and `half` are the
    /// sums of the colour matching functions. The errors of the two halves add up to that of the whole.
    #[must_use]
    fn half(&self, whole: &Cmf, half: &Cmf) -> Self;

    /// This plus `factor` (not negative) times another spectrum on the same interval.
    #[must_use]
    fn plus(&self, factor: f64, other: &Self) -> Self;

    /// The value.
    fn value(&self) -> f64;

    /// Estimate of the three errors.
    fn error(&self) -> Cmf;

    /// How far the three errors may lie from their estimate; zero where that is not known.
    fn radius(&self) -> Cmf;
}

/// The paper's record: a value and three errors, the neglected term left out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
#[non_exhaustive]
pub struct Estimate {
    /// The value held.
    pub value: f64,
    /// Its errors against x_bar, y_bar, z_bar.
    pub error: Cmf,
}

impl Interval for Estimate {
    fn new(average: f64, f: &[f64], cmf: [&[f64]; 3]) -> Self {
        let error = cmf.map(|a| f.iter().zip(a).map(|(f, a)| (f - average) * a).sum());
        Self {
            value: average,
            error,
        }
    }

    fn constant(value: f64) -> Self {
        Self {
            value,
            error: [0.0; 3],
        }
    }

    /// e' = R e_S + S e_R (3.2): the integral of (S - S_av)(R - R_av) a_bar is neglected.
    #[inline]
    fn times(&self, reflectance: &Self, _: &Cmf) -> Self {
        let (s, r) = (self, reflectance);
        let error = std::array::from_fn(|a| r.value * s.error[a] + s.value * r.error[a]);
        Self {
            value: s.value * r.value,
            error,
        }
    }

    #[inline]
    fn merged(left: &Self, right: &Self, cmf: [&Cmf; 2], share: f64) -> Self {
        let value = right.value + share * (left.value - right.value);
        let (dl, dr) = (left.value - value, right.value - value);
        let error = std::array::from_fn(|a| {
            left.error[a] + right.error[a] + cmf[0][a] * dl + cmf[1][a] * dr
        });
        Self { value, error }
    }

    fn half(&self, whole: &Cmf, half: &Cmf) -> Self {
        let share = |a: usize| {
            if whole[a] > 0.0 {
                half[a] / whole[a]
            } else {
                0.0
            }
        };
        Self {
            value: self.value,
            error: std::array::from_fn(|a| self.error[a] * share(a)),
        }
    }

    #[inline]
    fn plus(&self, factor: f64, other: &Self) -> Self {
        let error = std::array::from_fn(|a| self.error[a] + factor * other.error[a]);
        Self {
            value: self.value + factor * other.value,
            error,
        }
    }

    #[inline]
    fn value(&self) -> f64 {
        self.value
    }

    #[inline]
    fn error(&self) -> Cmf {
        self.error
    }

    #[inline]
    fn radius(&self) -> Cmf {
        [0.0; 3]
    }
}

/// The paper's record with the part of the neglected term that costs nothing:
/// e' = R e_S + S e_R + e_S e_R / A, that is, the means m_a = v + e_a / A_a multiply.
///
/// What is then neglected is the covariance of S and R on the interval.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(transparent)]
pub struct Moment(pub Estimate);

impl Interval for Moment {
    fn new(average: f64, f: &[f64], cmf: [&[f64]; 3]) -> Self {
        Self(Estimate::new(average, f, cmf))
    }

    fn constant(value: f64) -> Self {
        Self(Estimate::constant(value))
    }

    #[inline]
    fn times(&self, reflectance: &Self, cmf: &Cmf) -> Self {
        let (s, r) = (&self.0, &reflectance.0);
        let error = std::array::from_fn(|a| {
            let both = if cmf[a] > 0.0 {
                s.error[a] * r.error[a] / cmf[a]
            } else {
                0.0
            };
            r.value * s.error[a] + s.value * r.error[a] + both
        });
        Self(Estimate {
            value: s.value * r.value,
            error,
        })
    }

    #[inline]
    fn merged(left: &Self, right: &Self, cmf: [&Cmf; 2], share: f64) -> Self {
        Self(Estimate::merged(&left.0, &right.0, cmf, share))
    }

    fn half(&self, whole: &Cmf, half: &Cmf) -> Self {
        Self(self.0.half(whole, half))
    }

    #[inline]
    fn plus(&self, factor: f64, other: &Self) -> Self {
        Self(self.0.plus(factor, &other.0))
    }

    #[inline]
    fn value(&self) -> f64 {
        self.0.value
    }

    #[inline]
    fn error(&self) -> Cmf {
        self.0.error
    }

    #[inline]
    fn radius(&self) -> Cmf {
        [0.0; 3]
    }
}
