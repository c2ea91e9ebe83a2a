//! Mean, root mean square, 95th percentile and greatest of errors that are seen through noise, with intervals of 95 %.
//!
//! With observed difference o and standard error s at a point, `E[o^2] = d^2 + s^2` for the true difference d; figures
//! are made of `sqrt(max(0, o^2 - s^2))`, and the root mean square of `sqrt(max(0, mean(o^2 - s^2)))`, which is unbiased.
//! Intervals of means come from the spread over the points, those of order statistics from moving every point by 2 s.
//! Where d is far below s the mean of those roots is 0.4 s, not 0; the lower end of its interval is lowered by as much.

use serde::Serialize;

/// What noise alone shows as, share of its standard error: the mean of `sqrt(max(0, z^2 - 1))` over a normal z.
const NOISE_SHOWS: f64 = 0.4;
/// Two-sided normal quantile of 95 %.
const NORMAL_95: f64 = 1.96;

/// A measured figure with its interval of 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Measured {
    /// Best figure.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Mean, 95th percentile and greatest of a measured error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ErrorSummary {
    /// Mean.
    pub mean: Measured,
    /// Root of the mean square.
    pub rms: Measured,
    /// Value that 95 % of the points do not exceed.
    pub p95: Measured,
    /// Greatest.
    pub max: Measured,
}

impl Measured {
    /// Mean of values, its interval by their spread.
    pub(super) fn mean(x: &[f64]) -> Self {
        let n = x.len().max(1) as f64;
        let value = x.iter().sum::<f64>() / n;
        let variance = x.iter().map(|x| (x - value).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let half = NORMAL_95 * (variance / n).sqrt();
        Self {
            value,
            low: value - half,
            high: value + half,
        }
    }

    /// By what share the sum of the first is above that of the second; 0 of nothing. Its interval is that of a ratio: by the spread of
    /// what is left of the differences when that share is taken off.
    pub(super) fn excess(pairs: &[[f64; 2]]) -> Self {
        let mean = |k: usize| pairs.iter().map(|p| p[k]).sum::<f64>() / pairs.len().max(1) as f64;
        let (of, to) = (mean(0), mean(1));
        if to <= 0.0 {
            return Self::mean(&[]);
        }
        let value = of / to - 1.0;
        let left: Vec<f64> = (pairs.iter())
            .map(|[a, b]| value + (a - b - value * b) / to)
            .collect();
        Self::mean(&left)
    }

    /// The same with its lower end lowered, to 0 at the most.
    fn lowered(self, by: f64) -> Self {
        Self {
            low: (self.low - by).max(0.0),
            ..self
        }
    }
}

impl ErrorSummary {
    /// Figures of errors `[observed, standard error]`.
    pub(super) fn of(errors: &[[f64; 2]]) -> Self {
        let value: Vec<f64> = errors
            .iter()
            .map(|[o, s]| (o * o - s * s).max(0.0).sqrt())
            .collect();
        let at = |shift: f64| -> Vec<f64> {
            errors
                .iter()
                .map(|[o, s]| (o.abs() + shift * s).max(0.0))
                .collect()
        };
        let noise = errors.iter().map(|[_, s]| s).sum::<f64>() / errors.len().max(1) as f64;
        let order = |share: f64| Measured {
            value: percentile(value.clone(), share),
            low: percentile(at(-2.0), share),
            high: percentile(at(2.0), share),
        };
        let squares: Vec<f64> = errors.iter().map(|[o, s]| o * o - s * s).collect();
        let squares = Measured::mean(&squares);
        let root = |x: f64| x.max(0.0).sqrt();
        Self {
            mean: Measured::mean(&value).lowered(NOISE_SHOWS * noise),
            rms: Measured {
                value: root(squares.value),
                low: root(squares.low),
                high: root(squares.high),
            },
            p95: order(0.95),
            max: order(1.0),
        }
    }
}

/// The value that a share of the values does not exceed; 0 of none.
fn percentile(mut x: Vec<f64>, share: f64) -> f64 {
    x.sort_by(f64::total_cmp);
    let rank = (share * x.len() as f64).ceil() as usize;
    x.get(rank.clamp(1, x.len().max(1)) - 1)
        .copied()
        .unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;

    #[test]
    fn noise_is_not_counted_as_error() {
        // True errors of 0 and of 0.5 seen through noise of standard deviation 0.2.
        let mut rng = Pcg::new(7);
        let mut normal = move || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
        for truth in [0.0, 0.5] {
            let errors: Vec<[f64; 2]> = (0..4000).map(|_| [truth + 0.2 * normal(), 0.2]).collect();
            let s = ErrorSummary::of(&errors);
            assert!((s.rms.value - truth).abs() < 0.03, "{truth}: {s:?}");
            assert!(s.rms.low <= truth && truth <= s.rms.high, "{truth}: {s:?}");
            let naive = (errors.iter().map(|e| e[0] * e[0]).sum::<f64>() / 4000.0).sqrt();
            assert!(naive > truth + 0.03);
        }
    }

    #[test]
    fn a_known_error_is_measured() {
        // Twenty points without noise, one of which is off by 3.
        let mut errors = vec![[0.0, 0.0]; 20];
        errors[7] = [3.0, 0.0];
        let s = ErrorSummary::of(&errors);
        assert!((s.mean.value - 0.15).abs() < 1e-12 && s.mean.low < 0.15 && s.mean.high > 0.15);
        assert!((s.rms.value - 3.0 / 20f64.sqrt()).abs() < 1e-12);
        assert_eq!((s.p95.value, s.max.value), (0.0, 3.0));
    }

    #[test]
    fn a_point_in_the_dark_makes_no_bias() {
        // Ninety-nine points that are 1 % too bright, and one that is ten thousand times too bright in the dark.
        let mut lux = vec![[101.0, 100.0]; 99];
        lux.push([1.0, 1e-4]);
        let bias = Measured::excess(&lux);
        assert!((bias.value - 0.0101).abs() < 1e-6, "{bias:?}");
        assert!(bias.low < 0.01 && bias.high > 0.0101 && bias.high < 0.02);
        assert_eq!(Measured::excess(&[[0.0, 0.0]]).value, 0.0);
    }

    #[test]
    fn order_statistics() {
        assert_eq!(percentile((1..=100).map(f64::from).collect(), 0.95), 95.0);
        assert_eq!(percentile(vec![3.0, 1.0, 2.0], 1.0), 3.0);
        assert_eq!(percentile(vec![], 0.95), 0.0);
    }
}
