//! Stacked bars as SVG, lying: where the time goes, by phase. Same input, same bytes.

use super::axis::{Axis, Scale, label};
use super::svg::{Anchor, COLORS, Svg, text_width};

/// Width of the picture, pixels; its height follows from the number of bars.
const WIDTH: f64 = 800.0;
const TOP: f64 = 84.0;
const BOTTOM: f64 = 58.0;
const RIGHT: f64 = 62.0;
/// Height of a bar and from bar to bar.
const BAR: f64 = 24.0;
const STEP: f64 = 36.0;
const TITLE: f64 = 18.0;
const LABEL: f64 = 14.0;
const SMALL: f64 = 13.0;
const MAJOR: &str = "#d9d9d9";
const FRAME: &str = "#8c8c8c";

/// Stacked bars.
#[derive(Debug, Clone)]
pub struct Bars {
    /// What the chart says, in one line.
    pub title: String,
    /// Quantity and unit of the values.
    pub unit: String,
    /// Names of the parts, in order from the left.
    pub parts: Vec<String>,
    /// Name of each bar and its parts' values, zero or above.
    pub bars: Vec<(String, Vec<f64>)>,
}

impl Bars {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let names = self
            .bars
            .iter()
            .map(|(name, _)| text_width(name, SMALL))
            .fold(0.0, f64::max);
        let left = (names + 28.0).min(0.5 * WIDTH);
        let bottom = TOP + STEP * self.bars.len() as f64;
        let total = |values: &[f64]| values.iter().copied().filter(|&v| shown(v)).sum::<f64>();
        let totals = self.bars.iter().map(|(_, values)| total(values));
        let axis = Axis::new(Scale::Linear, totals, [left, WIDTH - RIGHT]);

        let mut svg = Svg::new(WIDTH, bottom + BOTTOM);
        svg.bold([20.0, 30.0], &self.title, TITLE);
        let mut x = 20.0;
        for (i, part) in self.parts.iter().enumerate() {
            svg.rect([x, 46.0], [12.0, 12.0], COLORS[i % COLORS.len()]);
            svg.text([x + 17.0, 56.5], part, SMALL, Anchor::Start);
            x += 34.0 + text_width(part, SMALL);
        }
        for tick in axis.ticks() {
            let Some(at) = axis.pixel(tick.value) else {
                continue;
            };
            svg.line([at, TOP - 8.0], [at, bottom], MAJOR, 1.0);
            svg.text(
                [at, bottom + 20.0],
                &label(tick.value),
                SMALL,
                Anchor::Middle,
            );
        }
        for (row, (name, values)) in self.bars.iter().enumerate() {
            let y = TOP + STEP * row as f64;
            svg.text([left - 8.0, y + 0.5 * BAR + 4.5], name, SMALL, Anchor::End);
            let mut sum = 0.0;
            let mut from = left;
            for (i, &value) in values.iter().enumerate().filter(|(_, v)| shown(**v)) {
                sum += value;
                let to = axis.pixel(sum).unwrap_or(from);
                svg.rect([from, y], [to - from, BAR], COLORS[i % COLORS.len()]);
                from = to;
            }
            svg.text(
                [from + 6.0, y + 0.5 * BAR + 4.5],
                &three_digits(sum),
                SMALL,
                Anchor::Start,
            );
        }
        svg.line([left, TOP - 8.0], [left, bottom], FRAME, 1.5);
        svg.text(
            [0.5 * (left + WIDTH - RIGHT), bottom + 44.0],
            &self.unit,
            LABEL,
            Anchor::Middle,
        );
        svg.finish()
    }
}

fn shown(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

/// Three significant digits.
fn three_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let before = value.abs().log10().floor() as i32 + 1;
    let decimals = usize::try_from(3 - before).unwrap_or(0);
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bars() -> Bars {
        Bars {
            title: "Where the time goes".into(),
            unit: "CPU time, s".into(),
            parts: ["hierarchy", "visibility", "links", "solve", "gather"]
                .map(String::from)
                .to_vec(),
            bars: vec![
                ("Cornell box".into(), vec![0.01, 0.21, 0.08, 0.03, 0.12]),
                ("two rooms".into(), vec![0.02, 0.61, 0.22, 0.09, 0.4]),
                ("furnished, 50 k".into(), vec![0.2, 2.4, 0.9, 0.3, 1.1]),
            ],
        }
    }

    #[test]
    fn bytes_are_stable_and_bars_end_at_their_sum() {
        let svg = bars().to_svg();
        assert_eq!(svg, bars().to_svg());
        assert!(svg.contains(">0.450<") && svg.contains(">1.34<") && svg.contains(">4.90<"));
    }

    #[test]
    fn values_that_cannot_be_shown_take_no_room() {
        let mut odd = bars();
        odd.bars[0].1 = vec![f64::NAN, -1.0, 2.0];
        let svg = odd.to_svg();
        assert!(svg.contains(">2.00<") && !svg.contains("NaN"));
    }
}
