//! Correlated colour temperature and Duv, the distance from the Planckian locus in the CIE 1960 (u, v) diagram, after
//! Y. Ohno, "Practical use and calculation of CCT and Duv", Leukos 10 (2014), 47-55.
//!
//! The nearest row of a table of blackbodies and its two neighbours give two solutions: of the triangle of the
//! neighbours and the light, exact near the locus, and of the parabola through the three distances, exact far from it.
//! The first holds where |Duv| < .002. Rows are .25 % apart, in f64: his correction of 1 % rows (.99991) is not needed.
//!
//! The locus is worked out on the bands of the light, so that a blackbody on 64 bands lies on it.

use super::Xyz;
use super::bands::{Bands, weighted};
use crate::data::{blackbody, cmf_1931};

/// Temperatures of the first and the last row, K.
pub const KNOWN_KELVIN: [f64; 2] = [1000.0, 50_000.0];
/// Greatest |Duv| at which a colour temperature has a meaning (CIE 015:2004, 9.5).
pub const GREATEST_DUV: f64 = 0.05;
/// Ratio of temperatures of two rows.
const RATIO: f64 = 1.0025;
/// |Duv| from which the parabola holds (Ohno 2014).
const PARABOLA_FROM: f64 = 0.002;

/// A colour temperature and how far from the locus it was found.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Correlated {
    /// Correlated colour temperature, K.
    pub kelvin: f64,
    /// Distance from the locus, positive above it (greenish).
    pub duv: f64,
}

#[derive(Debug, Clone, Copy)]
struct Row {
    kelvin: f64,
    uv: [f64; 2],
}

/// The Planckian locus.
#[derive(Debug, Clone)]
pub struct Locus {
    rows: Vec<Row>,
}

/// u, v of the CIE 1960 diagram; none without light.
pub fn uv_1960(xyz: Xyz) -> Option<[f64; 2]> {
    let whole = xyz[0] + 15.0 * xyz[1] + 3.0 * xyz[2];
    (whole > 0.0 && whole.is_finite()).then(|| [4.0 * xyz[0] / whole, 6.0 * xyz[1] / whole])
}

impl Locus {
    /// The locus on bands.
    pub fn new(bands: &Bands) -> Self {
        let weights = cmf_1931().map(|cmf| bands.weights(&cmf));
        let [first, last] = KNOWN_KELVIN;
        let steps = ((last / first).ln() / RATIO.ln()).ceil() as usize;
        let rows = (0..=steps)
            .filter_map(|k| {
                let kelvin = first * (last / first).powf(k as f64 / steps as f64);
                let light = bands.light(&blackbody(kelvin));
                let uv = uv_1960(weights.each_ref().map(|w| weighted(&light, w)))?;
                Some(Row { kelvin, uv })
            })
            .collect();
        Self { rows }
    }

    /// The colour temperature of a chromaticity; none beyond either end of the locus.
    pub fn correlated(&self, uv: [f64; 2]) -> Option<Correlated> {
        let distance = |row: &Row| (uv[0] - row.uv[0]).hypot(uv[1] - row.uv[1]);
        let nearest = (0..self.rows.len())
            .min_by(|&a, &b| distance(&self.rows[a]).total_cmp(&distance(&self.rows[b])))?;
        let rows = self.rows.get(nearest.checked_sub(1)?..nearest + 2)?;
        let distances = [0, 1, 2].map(|k| distance(&rows[k]));
        let triangle = triangle([rows[0], rows[2]], [distances[0], distances[2]], uv)?;
        if triangle.duv.abs() < PARABOLA_FROM {
            return Some(triangle);
        }
        Some(parabola(
            [0, 1, 2].map(|k| rows[k].kelvin),
            distances,
            triangle.duv.signum(),
        ))
    }
}

/// The foot of the light on the line between two rows.
fn triangle([a, b]: [Row; 2], [to_a, to_b]: [f64; 2], uv: [f64; 2]) -> Option<Correlated> {
    let length = (b.uv[0] - a.uv[0]).hypot(b.uv[1] - a.uv[1]);
    let along = (to_a * to_a - to_b * to_b + length * length) / (2.0 * length);
    let share = along / length;
    let foot_v = a.uv[1] + (b.uv[1] - a.uv[1]) * share;
    let height = (to_a * to_a - along * along).max(0.0).sqrt();
    share.is_finite().then(|| Correlated {
        kelvin: a.kelvin + (b.kelvin - a.kelvin) * share,
        duv: height.copysign(uv[1] - foot_v),
    })
}

/// The lowest point of the parabola through three distances over temperature.
fn parabola([t0, t1, t2]: [f64; 3], [d0, d1, d2]: [f64; 3], sign: f64) -> Correlated {
    // Newton's form: d0 + slope (t - t0) + bend (t - t0) (t - t1).
    let slope = (d1 - d0) / (t1 - t0);
    let bend = ((d2 - d1) / (t2 - t1) - slope) / (t2 - t0);
    let kelvin = 0.5 * (t0 + t1 - slope / bend);
    let duv = d0 + slope * (kelvin - t0) + bend * (kelvin - t0) * (kelvin - t1);
    Correlated {
        kelvin,
        duv: sign * duv,
    }
}
