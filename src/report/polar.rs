//! The polar curve of a lamp, as SVG: intensity by angle from nadir, in the planes C0-C180 and C90-C270 (types A and B: the vertical
//! and the horizontal plane). Same input, same bytes.

use super::axis::{Axis, Scale, label};
use super::svg::{Anchor, COLORS, Svg};
use crate::scene::profile::{Angles, Profile};

const SIZE: [f64; 2] = [640.0, 640.0];
const MIDDLE: [f64; 2] = [320.0, 330.0];
/// Radius of the greatest intensity, pixels.
const RADIUS: f64 = 230.0;
const GRID: &str = "#dddddd";
const SMALL: f64 = 13.0;

/// The curve of a profile, as its file has it.
pub fn svg(profile: &Profile, title: &str) -> String {
    let mut svg = Svg::new(SIZE[0], SIZE[1]);
    svg.bold([24.0, 30.0], title, 18.0);
    let peak = profile.peak();
    let about = format!(
        "{}, type {}: {:.0} lm, at most {peak:.0} cd",
        profile.format,
        profile.angles.letter(),
        profile.flux()
    );
    svg.text([24.0, 52.0], &about, SMALL, Anchor::Start);
    let axis = Axis::new(Scale::Linear, [0.0, peak].into_iter(), [0.0, RADIUS]);
    let at = |radius: f64, degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [MIDDLE[0] + radius * sin, MIDDLE[1] + radius * cos]
    };
    for tick in axis.ticks() {
        let Some(radius) = axis.pixel(tick.value).filter(|r| *r > 1.0) else {
            continue;
        };
        let circle: Vec<[f64; 2]> = (0..=72).map(|k| at(radius, 5.0 * f64::from(k))).collect();
        svg.lines(circle.windows(2).map(|w| [w[0], w[1]]), GRID, 1.0);
        let [x, y] = at(radius, 0.0);
        svg.text([x + 3.0, y - 3.0], &label(tick.value), SMALL, Anchor::Start);
    }
    for degrees in (-150..=180).step_by(30) {
        let degrees = f64::from(degrees);
        svg.line(MIDDLE, at(RADIUS, degrees), GRID, 1.0);
        let [x, y] = at(RADIUS + 18.0, degrees);
        let text = format!("{:.0}°", degrees.abs());
        svg.text([x, y + 4.5], &text, SMALL, Anchor::Middle);
    }
    let planes = match profile.angles {
        Angles::C => ["C0-C180", "C90-C270"],
        Angles::A | Angles::B => ["vertical", "horizontal"],
    };
    // The second below the first, which it may lie upon.
    for (k, plane) in planes.iter().enumerate().rev() {
        let curve = profile.curve(90.0 * k as f64);
        let radius = |cd: f64| axis.pixel(cd).unwrap_or(0.0);
        let points: Vec<[f64; 2]> = curve.iter().map(|&[d, cd]| at(radius(cd), d)).collect();
        svg.polyline(&points, COLORS[k]);
        let y = SIZE[1] - 40.0 + 20.0 * k as f64;
        svg.line([24.0, y - 4.5], [50.0, y - 4.5], COLORS[k], 3.0);
        svg.text([58.0, y], plane, SMALL, Anchor::Start);
    }
    svg.text([MIDDLE[0] + RADIUS, 600.0], "cd", SMALL, Anchor::End);
    svg.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_has_its_planes_and_figures() {
        let file = "IESNA91\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0 1 1 10\n0 45 90 0 100 80 0\n";
        let profile = Profile::parse(file.as_bytes()).unwrap();
        let text = svg(&profile, "lamp");
        for part in [
            "C0-C180",
            "C90-C270",
            "at most 100 cd",
            "LM-63-1991, type C",
            "90°",
        ] {
            assert!(text.contains(part), "{part}");
        }
        assert!(!text.contains("NaN") && !text.contains("inf"));
        assert_eq!(text, svg(&profile, "lamp"));
    }
}
