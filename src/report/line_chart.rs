//! Line charts as SVG: error against time, intervals against error. Same input, same bytes.

use super::axis::{Axis, Scale, Tick, label};
use super::svg::{Anchor, COLORS, Svg, text_width};

/// Size of the picture, pixels.
const SIZE: [f64; 2] = [800.0, 480.0];
/// Free space left, top, bottom of the plot; the right side holds the names.
const LEFT: f64 = 78.0;
const TOP: f64 = 58.0;
const BOTTOM: f64 = 62.0;
/// Sizes of letters, pixels.
const TITLE: f64 = 18.0;
const LABEL: f64 = 14.0;
const SMALL: f64 = 13.0;
/// Colours of grid lines.
const MAJOR: &str = "#d9d9d9";
const MINOR: &str = "#f0f0f0";
const FRAME: &str = "#8c8c8c";
/// Lines of more points are drawn without marks: they would be a string of beads.
const MARKED: usize = 60;
/// Least distance between two names, pixels.
const NAME_STEP: f64 = 18.0;

/// A line of a chart.
#[derive(Debug, Clone)]
pub struct Series {
    /// Shown at its end.
    pub name: String,
    /// (x, y), drawn in this order; points that the axes cannot show interrupt the line.
    pub points: Vec<[f64; 2]>,
}

/// A chart of lines with marks.
#[derive(Debug, Clone)]
pub struct LineChart {
    /// What the chart says, in one line.
    pub title: String,
    /// Quantity and unit along x.
    pub x: String,
    /// Quantity and unit along y.
    pub y: String,
    /// Spread along x.
    pub x_scale: Scale,
    /// Spread along y.
    pub y_scale: Scale,
    /// The lines; eight colours and four marks are told apart.
    pub series: Vec<Series>,
}

impl LineChart {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let names = self
            .series
            .iter()
            .map(|s| text_width(&s.name, SMALL))
            .fold(0.0, f64::max);
        let right = (SIZE[0] - names - 34.0).max(0.45 * SIZE[0]);
        let bottom = SIZE[1] - BOTTOM;
        let all = |i: usize| {
            self.series
                .iter()
                .flat_map(move |s| s.points.iter().map(move |p| p[i]))
        };
        let x = Axis::new(self.x_scale, all(0), [LEFT, right]);
        let y = Axis::new(self.y_scale, all(1), [bottom, TOP]);

        let mut svg = Svg::new(SIZE[0], SIZE[1]);
        svg.bold([LEFT, 30.0], &self.title, TITLE);
        grid(&mut svg, &x, &y, [LEFT, right], [TOP, bottom]);
        svg.text(
            [0.5 * (LEFT + right), SIZE[1] - 16.0],
            &self.x,
            LABEL,
            Anchor::Middle,
        );
        svg.upright([22.0, 0.5 * (TOP + bottom)], &self.y, LABEL);

        let mut ends = Vec::new();
        for (i, series) in self.series.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let pixels: Vec<Option<[f64; 2]>> = series
                .points
                .iter()
                .map(|p| Some([x.pixel(p[0])?, y.pixel(p[1])?]))
                .collect();
            for run in pixels.split(Option::is_none).filter(|run| run.len() > 1) {
                let run: Vec<[f64; 2]> = run.iter().flatten().copied().collect();
                svg.polyline(&run, color);
            }
            if pixels.len() <= MARKED {
                pixels.iter().flatten().for_each(|&p| svg.mark(p, color, i));
            }
            ends.push((pixels.iter().flatten().last().map_or(bottom, |p| p[1]), i));
        }
        self.names(&mut svg, ends, right, bottom);
        svg.finish()
    }

    /// Names right of the plot, at the height of their line's last point as far as there is room.
    fn names(&self, svg: &mut Svg, mut ends: Vec<(f64, usize)>, right: f64, bottom: f64) {
        ends.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut heights = Vec::with_capacity(ends.len());
        for (height, _) in &ends {
            let above = heights
                .last()
                .map_or(f64::NEG_INFINITY, |h: &f64| h + NAME_STEP);
            heights.push(height.max(above));
        }
        // Pushed below the plot: push back up from the bottom.
        let mut limit = bottom;
        for height in heights.iter_mut().rev() {
            *height = height.min(limit);
            limit = *height - NAME_STEP;
        }
        for (height, (_, i)) in heights.into_iter().zip(ends) {
            svg.mark([right + 14.0, height], COLORS[i % COLORS.len()], i);
            svg.text(
                [right + 24.0, height + 4.5],
                &self.series[i].name,
                SMALL,
                Anchor::Start,
            );
        }
    }
}

/// Grid lines and tick labels of both axes, and the frame.
fn grid(svg: &mut Svg, x: &Axis, y: &Axis, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) {
    let placed = |axis: &Axis, major: bool| -> Vec<(f64, Tick)> {
        let ticks = axis.ticks().into_iter().filter(|t| t.label == major);
        ticks
            .filter_map(|t| Some((axis.pixel(t.value)?, t)))
            .collect()
    };
    for (major, color) in [(false, MINOR), (true, MAJOR)] {
        for (at, _) in placed(x, major) {
            svg.line([at, top], [at, bottom], color, 1.0);
        }
        for (at, _) in placed(y, major) {
            svg.line([left, at], [right, at], color, 1.0);
        }
    }
    for (at, tick) in placed(x, true) {
        svg.text(
            [at, bottom + 20.0],
            &label(tick.value),
            SMALL,
            Anchor::Middle,
        );
    }
    for (at, tick) in placed(y, true) {
        svg.text(
            [left - 8.0, at + 4.5],
            &label(tick.value),
            SMALL,
            Anchor::End,
        );
    }
    svg.line([left, bottom], [right, bottom], FRAME, 1.5);
    svg.line([left, top], [left, bottom], FRAME, 1.5);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> LineChart {
        let series = |name: &str, scale: f64| Series {
            name: name.into(),
            points: (0..6)
                .map(|i| [0.05 * 2f64.powi(i), scale * 3.0 / 1.7f64.powi(i)])
                .collect(),
        };
        LineChart {
            title: "Cornell box under F2: error against time".into(),
            x: "CPU time, s".into(),
            y: "mean ΔE*uv".into(),
            x_scale: Scale::Log,
            y_scale: Scale::Log,
            series: vec![
                series("adaptive, perceptual", 1.0),
                series("64 bands", 2.2),
                series("RGB <3>", 3.0),
                series("uniform 16", 1.05),
            ],
        }
    }

    #[test]
    fn bytes_are_stable_and_names_escaped() {
        let svg = chart().to_svg();
        assert_eq!(svg, chart().to_svg());
        assert!(svg.contains("RGB &lt;3&gt;") && !svg.contains("<3>"));
        assert_eq!(svg.matches("<polyline").count(), 4);
    }

    #[test]
    fn names_never_overlap() {
        let svg = chart().to_svg();
        let heights: Vec<f64> = ["adaptive, perceptual", "64 bands", "RGB", "uniform 16"]
            .iter()
            .map(|name| {
                let line = svg
                    .lines()
                    .find(|l| l.starts_with("<text") && l.contains(&format!(">{name}")))
                    .unwrap();
                line.split("y=\"")
                    .nth(1)
                    .unwrap()
                    .split('"')
                    .next()
                    .unwrap()
                    .parse()
                    .unwrap()
            })
            .collect();
        for (i, a) in heights.iter().enumerate() {
            assert!(
                heights[..i]
                    .iter()
                    .all(|b| (a - b).abs() > NAME_STEP - 0.11),
                "{heights:?}"
            );
        }
    }

    #[test]
    fn points_that_cannot_be_shown_interrupt_the_line() {
        let mut chart = chart();
        chart.series.truncate(1);
        chart.series[0].points[3][1] = 0.0;
        let svg = chart.to_svg();
        assert_eq!(svg.matches("<polyline").count(), 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn an_empty_chart_is_still_a_picture() {
        let mut chart = chart();
        chart.series.clear();
        assert!(chart.to_svg().ends_with("</svg>\n"));
    }
}
