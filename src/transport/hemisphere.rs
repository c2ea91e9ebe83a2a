//! Indirect light by rays over the hemisphere: `H(p) = 1/n sum of B(where ray k ends)`, directions with density cos / pi.
//!
//! In cluttered rooms nearly every link of a point is partly hidden, and rays to each patch in turn cost more than rays
//! that find the patches themselves: one ray then gives form factor and visibility at once. All points share one pattern
//! of directions (a (0,2)-sequence, Kollig and Keller 2002, on the concentric map of Shirley and Chiu 1997), in beams of
//! sixteen, turned about the normal by the point's seed.

use crate::geometry::sampling::sequence02;
use glam::DVec3;

/// Directions in a beam.
pub(crate) const BEAM: usize = 16;
/// Directions at the least, and at the most.
const COUNT: [usize; 2] = [64, 4096];
/// Directions at an asked-for colour difference of [`AT`]; their error falls with the power 3/4 of their number. With 512 points of the grey garage
/// are off by 6.7, 5.0 and 2.7 % at `--error` 2, 1 and .5 (root mean square), with 1,024 by 4.7, 3.9 and 2.6, for 6, 14 and 33 % more time, but its
/// file is a quarter smaller: of 71,000 vertices a seventh was due to noise.
const USUAL: f64 = 1024.0;
const AT: f64 = 0.5;

/// A set of directions about +z, beam by beam.
#[derive(Debug, Clone)]
pub struct Hemisphere {
    directions: Vec<DVec3>,
}

impl Hemisphere {
    /// As many directions as an asked-for error (CIEDE2000) needs.
    pub fn for_error(error: f64) -> Self {
        let wanted = USUAL * (AT / error).powf(4.0 / 3.0);
        let count = (wanted.min(COUNT[1] as f64) as usize).next_power_of_two();
        Self::new(count.clamp(COUNT[0], COUNT[1]))
    }

    /// The least number of directions.
    pub(crate) fn sketch() -> Self {
        Self::new(COUNT[0])
    }

    /// With so many times the directions, a power of two, as far as there may be so many.
    pub(crate) fn scaled(&self, samples: f64) -> Self {
        Self::new(((self.len() as f64 * samples) as usize).clamp(COUNT[0], COUNT[1]))
    }

    /// `count` directions, a power of two, at least 16.
    pub(crate) fn new(count: usize) -> Self {
        let beams = count / BEAM;
        // Cells of the unit square, as square as possible; each holds one beam.
        let columns = 1 << (beams.ilog2().div_ceil(2));
        let rows = beams / columns;
        let mut points: Vec<(usize, [f64; 2])> = (0..count as u32)
            .map(|k| {
                let p = sequence02(k, 0);
                let cell = |x: f64, n: usize| (x * n as f64) as usize;
                (cell(p[1], rows) * columns + cell(p[0], columns), p)
            })
            .collect();
        points.sort_by_key(|&(cell, _)| cell);
        Self {
            directions: points.into_iter().map(|(_, p)| lifted(p)).collect(),
        }
    }

    /// How many directions.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// The beams.
    pub(crate) fn beams(&self) -> impl Iterator<Item = &[DVec3]> {
        self.directions.chunks(BEAM)
    }
}

/// A point of the unit square on the disk (concentric map), lifted to the hemisphere: density cos / pi.
fn lifted([x, y]: [f64; 2]) -> DVec3 {
    let (a, b) = (2.0 * x - 1.0, 2.0 * y - 1.0);
    let quarter = std::f64::consts::FRAC_PI_4;
    let (radius, angle) = if a.abs() > b.abs() {
        (a, quarter * (b / a))
    } else if b != 0.0 {
        (b, quarter * (2.0 - a / b))
    } else {
        (0.0, 0.0)
    };
    let (sin, cos) = angle.sin_cos();
    DVec3::new(
        radius * cos,
        radius * sin,
        (1.0 - radius * radius).max(0.0).sqrt(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_have_the_moments_of_a_cosine() {
        for count in [64, 256, 1024, 4096] {
            let h = Hemisphere::new(count);
            assert_eq!(h.len(), count);
            assert!(h.beams().all(|b| b.len() == BEAM));
            let mean = |f: &dyn Fn(DVec3) -> f64| {
                h.directions.iter().map(|&d| f(d)).sum::<f64>() / count as f64
            };
            let slack = 0.5 / (count as f64).powf(0.75);
            assert!((mean(&|d| d.z) - 2.0 / 3.0).abs() < slack);
            assert!((mean(&|d| d.x * d.x) - 0.25).abs() < slack);
            assert!(mean(&|d| d.x).abs() < slack && mean(&|d| d.y).abs() < slack);
            assert!((mean(&|d| d.length()) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn beams_are_narrow() {
        let h = Hemisphere::new(256);
        for beam in h.beams() {
            let axis = beam.iter().sum::<DVec3>().normalize();
            assert!(beam.iter().all(|d| d.dot(axis) > 0.6), "{axis}");
        }
    }
}
