//! Discomfort glare: the unified glare rating (CIE 117:1995),
//! `UGR = 8 log10(0.25 / L_b * sum L^2 w / p^2)` over the bright parts of luminaires, with the luminance L_b of the background
//! (cd/m2), the luminance L of a part (cd/m2), its solid angle w (sr) and its position index p.

use super::tolerance::Range;
use glam::DVec3;

/// What is seen of a luminaire.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Bright {
    /// Mean luminance of what is seen, cd/m2.
    pub luminance: f64,
    /// Solid angle, sr.
    pub solid_angle: f64,
    /// What it adds to the sum of the rating, `L^2 w / p^2`, cd2/m4 sr.
    pub glare: f64,
}

impl Bright {
    /// Nothing yet.
    pub(crate) const NONE: Self = Self {
        luminance: 0.0,
        solid_angle: 0.0,
        glare: 0.0,
    };

    /// Adds a small part of a luminance, a solid angle and a position index.
    pub(crate) fn add(&mut self, luminance: f64, solid_angle: f64, position: f64) {
        let whole = self.solid_angle + solid_angle;
        if whole > 0.0 {
            self.luminance += (luminance - self.luminance) * solid_angle / whole;
        }
        self.solid_angle = whole;
        self.glare += luminance * luminance * solid_angle / (position * position);
    }

    /// Guth's position index of all of it: that of one part as bright and as large that glares as much.
    pub fn position(&self) -> f64 {
        (self.luminance * self.luminance * self.solid_angle / self.glare).sqrt()
    }
}

/// Guth's position index of a place that is seen in a direction (not a unit vector) by an eye that looks along `forward`, with
/// its head towards `up` (unit vectors, at right angles): 1 straight ahead, more aside. Above the line of sight by Levin's
/// formula (1975), as CIE 117 tabulates it; below by that of Iwata and Tokura (1997). Infinite for what is behind.
///
/// ```
/// use glam::dvec3;
/// use haarlight::color::position_index;
/// let (forward, up) = (dvec3(0.0, 0.0, -1.0), dvec3(0.0, 1.0, 0.0));
/// assert_eq!(position_index(forward, up, dvec3(0.0, 0.0, -3.0)), 1.0);
/// // CIE 117, table of p: H/R = 0.5, T/R = 0.
/// assert!((position_index(forward, up, dvec3(0.0, 0.5, -1.0)) - 2.86).abs() < 0.01);
/// ```
pub fn position_index(forward: DVec3, up: DVec3, direction: DVec3) -> f64 {
    let ahead = direction.dot(forward);
    if ahead <= 0.0 {
        return f64::INFINITY;
    }
    let (high, aside) = (direction.dot(up), direction.dot(forward.cross(up)).abs());
    let away = high.hypot(aside);
    if high < 0.0 {
        let share = away / ahead;
        return 1.0 + if share < 0.6 { 0.8 } else { 1.2 } * share;
    }
    // Degrees: of the plane through the source and the line of sight from the vertical, and from the line of sight.
    let tau = aside.atan2(high).to_degrees();
    let sigma = away.atan2(ahead).to_degrees();
    let first = 35.2 - 0.31889 * tau - 1.22 * (-2.0 * tau / 9.0).exp();
    let second = 21.0 + 0.26667 * tau - 0.002963 * tau * tau;
    (1e-3 * first * sigma + 1e-5 * second * sigma * sigma).exp()
}

/// The unified glare rating of what is seen, before a background of so many cd/m2; negative infinity where nothing glares,
/// none where the background is black.
pub fn unified_glare_rating(background: f64, seen: &[Bright]) -> Option<f64> {
    let sum: f64 = seen.iter().map(|bright| bright.glare).sum();
    (background > 0.0).then(|| 8.0 * (0.25 / background * sum).log10())
}

/// Where a rating lies if its background is wrong by a relative error; what is bright is known.
pub fn glare_range(rating: f64, relative: f64) -> Range {
    let least = (1.0 - relative).max(0.0);
    Range {
        low: rating - 8.0 * (1.0 + relative).log10(),
        high: rating - 8.0 * least.log10(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    /// CIE 117:1995, position index by T/R and H/R. The formula is a fit to Guth's curves, from which the table is read as well: they
    /// differ by up to 3 %, .2 of a rating.
    #[test]
    fn position_indices_are_those_that_are_published() {
        let published = [
            (0.0, 0.1, 1.26),
            (0.0, 0.2, 1.53),
            (0.0, 0.3, 1.90),
            (0.0, 0.4, 2.35),
            (0.0, 0.5, 2.86),
            (0.0, 0.6, 3.50),
            (0.0, 0.7, 4.20),
            (0.0, 0.8, 5.00),
            (0.0, 1.0, 7.00),
        ];
        for (t, h, p) in published {
            let found = position_index(DVec3::NEG_Z, DVec3::Y, dvec3(t, h, -1.0));
            assert!((found / p - 1.0).abs() < 0.03, "{t} {h}: {found} for {p}");
        }
        // Aside it bothers less than as far up.
        let [up, aside] = [dvec3(0.0, 1.0, -1.0), dvec3(1.0, 0.0, -1.0)];
        let of = |d| position_index(DVec3::NEG_Z, DVec3::Y, d);
        assert!(of(aside) < of(up) && of(aside) > 1.0);
        assert_eq!(of(dvec3(1.0, 0.2, -2.0)), of(dvec3(-1.0, 0.2, -2.0)));
        assert_eq!(of(DVec3::Z), f64::INFINITY);
    }

    #[test]
    fn a_luminaire_in_parts_is_the_luminaire() {
        let mut parts = Bright::NONE;
        for _ in 0..10 {
            parts.add(3000.0, 0.002, 2.0);
        }
        let mut whole = Bright::NONE;
        whole.add(3000.0, 0.02, 2.0);
        assert!((parts.glare / whole.glare - 1.0).abs() < 1e-12);
        assert!((parts.position() - 2.0).abs() < 1e-12);
        let rating = unified_glare_rating(40.0, &[parts]).unwrap();
        let expected = 8.0 * (0.25 / 40.0 * 9e6 * 0.02 / 4.0_f64).log10();
        assert!((rating - expected).abs() < 1e-9);
        let range = glare_range(rating, 0.1);
        let of = |background| unified_glare_rating(background, &[parts]).unwrap();
        assert!((range.low - of(44.0)).abs() < 1e-9 && (range.high - of(36.0)).abs() < 1e-9);
        assert_eq!(unified_glare_rating(0.0, &[parts]), None);
    }
}
