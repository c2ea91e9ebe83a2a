//! Axes: from values to pixels, and where the ticks go.

/// How values are spread along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly, from zero or below the least value.
    Linear,
    /// Evenly, from the least value to the greatest: wavelengths, places.
    Fitted,
    /// By their logarithm; values that are not positive cannot be shown.
    Log,
}

/// A tick: value, and whether it is labelled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tick {
    pub(super) value: f64,
    pub(super) label: bool,
}

/// Labelled steps that are aimed at along a linear axis.
const STEPS: f64 = 6.0;

/// A range of values on a range of pixels.
pub(super) struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    pixels: [f64; 2],
}

impl Axis {
    /// An axis that shows all of `values` that it can.
    pub(super) fn new(scale: Scale, values: impl Iterator<Item = f64>, pixels: [f64; 2]) -> Self {
        let shown = values.filter(|&v| can_show(scale, v));
        let (low, high) = shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        let (low, high) = match scale {
            _ if low > high => (if scale == Scale::Log { 0.1 } else { 0.0 }, 1.0),
            Scale::Linear => {
                let low = low.min(0.0);
                let high = if high > low { high } else { low + 1.0 };
                let step = step((high - low) / STEPS);
                ((low / step).floor() * step, (high / step).ceil() * step)
            }
            Scale::Fitted if low < high => (low, high),
            Scale::Fitted => (low - 0.5, low + 0.5),
            // Out to the next of 1, 2, 5.
            Scale::Log => {
                let (low, high) = (nice_below(low), nice_above(high));
                if low < high {
                    (low, high)
                } else {
                    (nice_below(0.99 * low), nice_above(1.01 * high))
                }
            }
        };
        Self {
            scale,
            low,
            high,
            pixels,
        }
    }

    /// The pixel of a value; none if the axis cannot show it.
    pub(super) fn pixel(&self, value: f64) -> Option<f64> {
        if !can_show(self.scale, value) {
            return None;
        }
        let place = match self.scale {
            Scale::Linear | Scale::Fitted => (value - self.low) / (self.high - self.low),
            Scale::Log => (value / self.low).log10() / (self.high / self.low).log10(),
        };
        Some(self.pixels[0] + place * (self.pixels[1] - self.pixels[0]))
    }

    /// Ticks from low to high.
    pub(super) fn ticks(&self) -> Vec<Tick> {
        match self.scale {
            Scale::Linear | Scale::Fitted => {
                let step = step((self.high - self.low) / STEPS);
                // A hair of tolerance, for ends that are ticks but for rounding.
                let first = (self.low / step - 1e-9).ceil() as i64;
                let last = (self.high / step + 1e-9).floor() as i64;
                let tick = |i: i64| Tick {
                    value: i as f64 * step,
                    label: true,
                };
                (first..=last).map(tick).collect()
            }
            Scale::Log => {
                let decades = (self.high / self.low).log10();
                let first = self.low.log10().floor() as i32;
                let last = self.high.log10().ceil() as i32;
                let inside = |v: f64| v >= self.low * 0.999 && v <= self.high * 1.001;
                let mut ticks = Vec::new();
                for decade in first..=last {
                    for digit in 1..10 {
                        let value = f64::from(digit) * 10f64.powi(decade);
                        let label = digit == 1 || (decades < 3.0 && (digit == 2 || digit == 5));
                        if inside(value) {
                            ticks.push(Tick { value, label });
                        }
                    }
                }
                ticks
            }
        }
    }
}

fn can_show(scale: Scale, value: f64) -> bool {
    value.is_finite() && (scale != Scale::Log || value > 0.0)
}

/// The least of 1, 2, 5 times a power of ten that is not below `wanted`.
fn step(wanted: f64) -> f64 {
    nice_above(wanted)
}

fn nice_above(value: f64) -> f64 {
    let decade = 10f64.powi(value.log10().floor() as i32);
    // A hair of tolerance, for values that are such a number but for rounding.
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|d| d * decade)
        .find(|&v| v >= value * (1.0 - 1e-9))
        .unwrap_or(value)
}

fn nice_below(value: f64) -> f64 {
    let decade = 10f64.powi(value.log10().floor() as i32);
    [10.0, 5.0, 2.0, 1.0]
        .into_iter()
        .map(|d| d * decade)
        .find(|&v| v <= value * (1.0 + 1e-9))
        .unwrap_or(value)
}

/// A tick's label: as short as it is exact, with SI-free powers of ten beyond a million.
pub(super) fn label(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e6).contains(&size) {
        return format!("{value:.0e}");
    }
    // Ticks have one significant digit or are multiples of a step with one: nine decimals are exact.
    let text = format!("{value:.9}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" {
        "0".into()
    } else {
        short.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks()
            .iter()
            .filter(|t| t.label)
            .map(|t| label(t.value))
            .collect()
    }

    #[test]
    fn linear_ticks_are_round_numbers_from_zero() {
        let axis = Axis::new(Scale::Linear, [0.3, 2.9].into_iter(), [0.0, 300.0]);
        assert_eq!(labels(&axis), ["0", "0.5", "1", "1.5", "2", "2.5", "3"]);
        assert_eq!(axis.pixel(1.5), Some(150.0));
    }

    #[test]
    fn fitted_axes_begin_where_values_do() {
        let axis = Axis::new(Scale::Fitted, [380.0, 780.0].into_iter(), [0.0, 400.0]);
        assert_eq!(labels(&axis), ["400", "500", "600", "700"]);
        assert_eq!(
            (axis.pixel(380.0), axis.pixel(780.0)),
            (Some(0.0), Some(400.0))
        );
    }

    #[test]
    fn log_ticks_are_decades_and_more_where_few() {
        let axis = Axis::new(Scale::Log, [0.012, 900.0].into_iter(), [0.0, 1.0]);
        assert_eq!(labels(&axis), ["0.01", "0.1", "1", "10", "100", "1000"]);
        let axis = Axis::new(Scale::Log, [0.6, 30.0].into_iter(), [0.0, 1.0]);
        assert_eq!(labels(&axis), ["0.5", "1", "2", "5", "10", "20", "50"]);
        assert_eq!(
            (axis.pixel(0.5), axis.pixel(0.0), axis.pixel(f64::NAN)),
            (Some(0.0), None, None)
        );
    }

    #[test]
    fn one_value_or_none_still_give_an_axis() {
        for values in [vec![], vec![5.0], vec![0.0], vec![-3.0]] {
            for scale in [Scale::Linear, Scale::Log] {
                let axis = Axis::new(scale, values.iter().copied(), [0.0, 1.0]);
                assert!(labels(&axis).len() >= 2, "{values:?} {scale:?}");
            }
        }
    }

    #[test]
    fn labels_are_short() {
        assert_eq!(
            [0.30000000000000004, -0.0, 2e6, 1e-5, 1234.5].map(label),
            ["0.3", "0", "2e6", "1e-5", "1234.5"]
        );
    }
}
