//! The little of SVG 1.1 that charts need. Coordinates are written with one decimal, so that bytes are stable.

use std::fmt::Write;

/// Colours of series, told apart by colour-blind readers too: M. Okabe and K. Ito, Color Universal Design (2008),
/// without the yellow that is lost on white; a grey is the eighth.
pub(super) const COLORS: [&str; 8] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#a6a6a6",
];

/// Ink of text.
const INK: &str = "#222222";

/// Where a text is tied to its point.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A picture under construction.
pub(super) struct Svg(String);

impl Svg {
    pub(super) fn new(width: f64, height: f64) -> Self {
        let mut svg = String::new();
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"Helvetica, Arial, sans-serif\">"
        );
        let _ = writeln!(
            svg,
            "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>"
        );
        Self(svg)
    }

    pub(super) fn line(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], color: &str, width: f64) {
        let _ = writeln!(
            self.0,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{color}\" stroke-width=\"{width}\"/>"
        );
    }

    pub(super) fn polyline(&mut self, points: &[[f64; 2]], color: &str) {
        let points: Vec<String> = points
            .iter()
            .map(|[x, y]| format!("{x:.1},{y:.1}"))
            .collect();
        let _ = writeln!(
            self.0,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-linejoin=\"round\"/>",
            points.join(" ")
        );
    }

    /// Straight lines between pairs of points, in one element.
    pub(super) fn lines(
        &mut self,
        pairs: impl Iterator<Item = [[f64; 2]; 2]>,
        color: &str,
        width: f64,
    ) {
        let _ = write!(self.0, "<path d=\"");
        for [[x1, y1], [x2, y2]] in pairs {
            let _ = write!(self.0, "M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}");
        }
        let _ = writeln!(
            self.0,
            "\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" stroke-linecap=\"round\"/>"
        );
    }

    /// Filled triangles, in one element.
    pub(super) fn triangles(&mut self, all: impl Iterator<Item = [[f64; 2]; 3]>, color: &str) {
        let _ = write!(self.0, "<path d=\"");
        for [[x1, y1], [x2, y2], [x3, y3]] in all {
            let _ = write!(self.0, "M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}L{x3:.1} {y3:.1}Z");
        }
        let _ = writeln!(self.0, "\" fill=\"{color}\"/>");
    }

    /// A mark of one of four shapes, told apart without colour.
    pub(super) fn mark(&mut self, [x, y]: [f64; 2], color: &str, shape: usize) {
        let fill = format!("fill=\"{color}\" stroke=\"#ffffff\" stroke-width=\"1\"");
        let _ = match shape % 4 {
            0 => writeln!(
                self.0,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" {fill}/>"
            ),
            1 => writeln!(
                self.0,
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"7\" height=\"7\" {fill}/>",
                x - 3.5,
                y - 3.5
            ),
            2 => writeln!(
                self.0,
                "<path d=\"M{x:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}Z\" {fill}/>",
                y - 5.0,
                x + 4.5,
                y + 3.5,
                x - 4.5,
                y + 3.5
            ),
            _ => writeln!(
                self.0,
                "<path d=\"M{x:.1} {:.1}L{:.1} {y:.1}L{x:.1} {:.1}L{:.1} {y:.1}Z\" {fill}/>",
                y - 5.0,
                x + 5.0,
                y + 5.0,
                x - 5.0
            ),
        };
    }

    pub(super) fn rect(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], color: &str) {
        let _ = writeln!(
            self.0,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{color}\"/>"
        );
    }

    pub(super) fn text(&mut self, [x, y]: [f64; 2], text: &str, size: f64, anchor: Anchor) {
        self.any_text([x, y], text, size, anchor, "");
    }

    pub(super) fn bold(&mut self, [x, y]: [f64; 2], text: &str, size: f64) {
        self.any_text([x, y], text, size, Anchor::Start, " font-weight=\"bold\"");
    }

    /// Text that runs upwards.
    pub(super) fn upright(&mut self, [x, y]: [f64; 2], text: &str, size: f64) {
        self.any_text(
            [x, y],
            text,
            size,
            Anchor::Middle,
            &format!(" transform=\"rotate(-90 {x:.1} {y:.1})\""),
        );
    }

    fn any_text(&mut self, [x, y]: [f64; 2], text: &str, size: f64, anchor: Anchor, more: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let _ = writeln!(
            self.0,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{INK}\"{more}>{}</text>",
            escaped(text)
        );
    }

    pub(super) fn finish(mut self) -> String {
        self.0.push_str("</svg>\n");
        self.0
    }
}

/// Width of a text in pixels, about: letters of a sans-serif take 0.55 of the size on average, rounded up.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    0.58 * size * text.chars().count() as f64
}

/// XML text; characters that XML has no place for are left out.
fn escaped(text: &str) -> String {
    let legal = text.chars().filter(|c| !c.is_control());
    legal.fold(String::new(), |mut out, c| {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            _ => out.push(c),
        }
        out
    })
}
