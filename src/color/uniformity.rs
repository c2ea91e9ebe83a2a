//! Uniformity of illuminance over a set of points: least over mean (EN 12464-1: U0), least over greatest.

use super::tolerance::Range;

/// Illuminance over points, lx.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Uniformity {
    /// The least.
    pub min: f64,
    /// The mean, every point alike.
    pub mean: f64,
    /// The greatest.
    pub max: f64,
}

impl Uniformity {
    /// Over points; none without points.
    ///
    /// ```
    /// let all = haarlight::color::Uniformity::of(&[100.0, 200.0, 300.0]).unwrap();
    /// assert_eq!(all.min_over_mean(), Some(0.5));
    /// assert_eq!(all.min_over_max(), Some(1.0 / 3.0));
    /// assert_eq!(haarlight::color::Uniformity::of(&[]), None);
    /// ```
    pub fn of(lux: &[f64]) -> Option<Self> {
        (!lux.is_empty()).then(|| Self {
            min: lux.iter().copied().fold(f64::INFINITY, f64::min),
            mean: lux.iter().sum::<f64>() / lux.len() as f64,
            max: lux.iter().copied().fold(0.0, f64::max),
        })
    }

    /// Least over mean; none without light.
    pub fn min_over_mean(&self) -> Option<f64> {
        (self.mean > 0.0).then(|| self.min / self.mean)
    }

    /// Least over greatest; none without light.
    pub fn min_over_max(&self) -> Option<f64> {
        (self.max > 0.0).then(|| self.min / self.max)
    }

    /// Where a ratio lies if both of its sides are wrong by a relative error, against each other.
    pub fn range(ratio: f64, relative: f64) -> Range {
        let factor = (1.0 + relative) / (1.0 - relative);
        // An error of all there is leaves nothing known.
        let factor = if relative < 1.0 {
            factor
        } else {
            f64::INFINITY
        };
        Range {
            low: ratio / factor,
            high: (ratio * factor).min(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_the_ratio() {
        let dark = Uniformity::of(&[0.0, 0.0]).unwrap();
        assert_eq!((dark.min_over_mean(), dark.min_over_max()), (None, None));
        let range = Uniformity::range(0.5, 0.1);
        assert!((range.low - 0.5 * 0.9 / 1.1).abs() < 1e-15, "{range:?}");
        assert!((range.high - 0.5 * 1.1 / 0.9).abs() < 1e-15, "{range:?}");
        let range = Uniformity::range(0.5, 1.0);
        assert_eq!((range.low, range.high), (0.0, 1.0));
    }
}
