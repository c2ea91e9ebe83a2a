//! Light in the air: irradiance from all sides at points, as spherical harmonics and as an ambient cube.
//!
//! At a point the irradiance `E(n)` of a small surface with normal n is gathered for 26 directions n, as `probe` does it:
//! the six axes, twelve edges and eight corners of a cube, which with weights 1/21, 4/105 and 9/280 are Lebedev's
//! quadrature of degree 7 (Lebedev 1976). With real spherical harmonics Y_lm,
//!
//! `E(n) = sum A_l L_lm Y_lm(n)`, A_0 = pi, A_1 = 2 pi / 3, A_2 = pi / 4, A_3 = 0, A_4 = -pi / 24 ...
//! (Ramamoorthi and Hanrahan, 2001), so that `L_lm = 4 pi / A_l sum w E(n) Y_lm(n)` for l up to 2 are the coefficients of *radiance*. Orders 3 to 5
//! of E do not disturb them; higher orders put order 2 off by up to 19 % for a lamp without extent. The truncation is the part of E beyond order 2,
//! up to some per cent of E where light comes from one side; it is measured in the 26 directions.
//!
//! The ambient cube (Mitchell, McTaggart and Green 2006) is E to +X, -X, +Y, -Y, +Z and -Z.

use super::LayerLanes;
use crate::color::Xyz;
use crate::solve::Bake;
use crate::survey::{PointLocation, places};
use crate::transport::{Gathered, Receiver};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Directions at a point.
const DIRECTIONS: usize = 26;
/// Points gathered at a time: 26 rows each.
const PART: usize = 1024;

/// Irradiance from all sides at a point, tristimulus, lm/m2.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Around {
    /// Coefficients of radiance, lm/m2/sr: (l, m) = (0, 0), (1, -1), (1, 0), (1, 1), (2, -2) ... (2, 2).
    pub sh: [Xyz; 9],
    /// Irradiance of surfaces that look to +X, -X, +Y, -Y, +Z, -Z.
    pub cube: [Xyz; 6],
}

/// A point in the air.
#[derive(Debug, Clone)]
pub struct Air {
    /// Is the point in the room? If not, no light is gathered.
    pub place: PointLocation,
    /// All light.
    pub light: Around,
    /// The light of each layer, if there are any; layers add up to `light`.
    pub layers: Vec<Around>,
    /// Irradiance beyond the coefficients: root mean square of illuminance over all directions, share of its mean.
    pub truncation: f64,
}

/// The directions and their weights, which sum to 1.
pub fn directions() -> [(DVec3, f64); DIRECTIONS] {
    let mut all = [(DVec3::ZERO, 0.0); DIRECTIONS];
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut place = 0;
    let mut add = |way: DVec3, weight: f64| {
        all[place] = (way.normalize(), weight);
        place += 1;
    };
    for axis in axes {
        add(axis, 1.0 / 21.0);
        // Avoid negative zeros: directions of rays about a normal depend on their sign.
        add(DVec3::ZERO - axis, 1.0 / 21.0);
    }
    for [a, b] in [[0, 1], [1, 2], [2, 0]] {
        for [s, t] in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
            add(s * axes[a] + t * axes[b], 4.0 / 105.0);
        }
    }
    for k in 0..8 {
        let sign = |bit: u32| if k >> bit & 1 == 0 { 1.0 } else { -1.0 };
        add(DVec3::new(sign(0), sign(1), sign(2)), 9.0 / 280.0);
    }
    all
}

/// Real spherical harmonics up to order 2, in the order and with the signs of three.js and others.
pub fn harmonics(n: DVec3) -> [f64; 9] {
    let DVec3 { x, y, z } = n;
    let root = |a: f64| (a / PI).sqrt();
    let (one, two) = (0.5 * root(3.0), 0.5 * root(15.0));
    [
        0.5 * root(1.0),
        one * y,
        one * z,
        one * x,
        two * x * y,
        two * y * z,
        0.25 * root(5.0) * (3.0 * z * z - 1.0),
        two * x * z,
        0.5 * two * (x * x - y * y),
    ]
}

/// Factor from a coefficient of radiance to one of irradiance.
fn cosine(k: usize) -> f64 {
    match k {
        0 => PI,
        1..=3 => 2.0 * PI / 3.0,
        _ => PI / 4.0,
    }
}

impl Around {
    /// From irradiance in the 26 [`directions`].
    pub fn new(irradiance: &[Xyz; DIRECTIONS]) -> Self {
        let mut sh = [[0.0; 3]; 9];
        for ((way, weight), e) in directions().into_iter().zip(irradiance) {
            for (k, y) in harmonics(way).into_iter().enumerate() {
                let factor = 4.0 * PI * weight * y / cosine(k);
                sh[k] = [0, 1, 2].map(|c| sh[k][c] + factor * e[c]);
            }
        }
        Self {
            sh,
            cube: std::array::from_fn(|side| irradiance[side]),
        }
    }

    /// Irradiance of a surface with normal `n`, from the coefficients.
    pub fn irradiance(&self, n: DVec3) -> Xyz {
        let basis = harmonics(n);
        [0, 1, 2].map(|c| (0..9).map(|k| cosine(k) * basis[k] * self.sh[k][c]).sum())
    }

    /// Mean of several.
    pub(crate) fn mean(all: &[Self]) -> Self {
        let n = all.len().max(1) as f64;
        let mean = |get: &dyn Fn(&Self) -> Xyz| -> Xyz {
            [0, 1, 2].map(|c| all.iter().map(|a| get(a)[c]).sum::<f64>() / n)
        };
        Self {
            sh: std::array::from_fn(|k| mean(&|a| a.sh[k])),
            cube: std::array::from_fn(|k| mean(&|a| a.cube[k])),
        }
    }
}

impl Bake {
    /// Light at points in the air (world space). Points inside something solid or outside the room are marked, and dark.
    ///
    /// ```
    /// use glam::DVec3;
    /// use haarlight::scene::{Options, Scene};
    /// use haarlight::solve::{Bake, Settings};
    /// let room = Scene::load("scenes/convex.glb", &Options::default())?;
    /// let mut bake = Bake::new(room, Settings { error: 2.0, ..Settings::default() });
    /// bake.run();
    /// let centre = bake.mesh().centre;
    /// let up = bake.probe(&[(centre, DVec3::Y)])[0].xyz;
    /// assert_eq!(bake.air(&[centre])[0].light.cube[2], up);
    /// # Ok::<(), haarlight::Error>(())
    /// ```
    pub fn air(&self, points: &[DVec3]) -> Vec<Air> {
        let lanes = self.layer_lanes();
        points
            .chunks(PART)
            .flat_map(|part| self.air_of(part, &lanes))
            .collect()
    }

    fn air_of(&self, points: &[DVec3], layers: &[LayerLanes]) -> Vec<Air> {
        // Seen from the points themselves.
        let aimless: Vec<(DVec3, DVec3)> = points.iter().map(|&p| (p, DVec3::ZERO)).collect();
        let places = places(self.scene(), &aimless);
        let directions = directions();
        let looking = |(point, _): (&DVec3, &PointLocation)| {
            let spot = self.spot(*point, |_| true);
            // One pattern for all: neighbours err alike, which does not show.
            directions.map(|(normal, _)| self.receiver_at(&spot, normal, 0))
        };
        let receivers: Vec<Receiver> = (points.par_iter().zip(&places))
            .filter(|(_, place)| **place == PointLocation::Room)
            .flat_map_iter(looking)
            .collect();
        let gathered = self.gather(&receivers);
        let mut gathered = gathered.chunks_exact(DIRECTIONS);
        let one = |place: PointLocation| {
            let rows = match place {
                PointLocation::Room => gathered.next(),
                _ => None,
            };
            self.air_at(place, rows.unwrap_or(&[]), layers)
        };
        places.into_iter().map(one).collect()
    }

    fn air_at(&self, place: PointLocation, rows: &[Gathered], layers: &[LayerLanes]) -> Air {
        let mut all = [[0.0; 3]; DIRECTIONS];
        let mut parts = vec![all; layers.len()];
        for (k, gathered) in rows.iter().enumerate() {
            all[k] = self.lanes().tristimulus(&gathered.irradiance);
            for (part, lanes) in parts.iter_mut().zip(layers) {
                part[k] = self.lanes().tristimulus(&lanes.of(&gathered.irradiance));
            }
        }
        let light = Around::new(&all);
        let (mut square, mut mean) = (0.0, 0.0);
        for ((way, weight), e) in directions().into_iter().zip(&all) {
            square += weight * (light.irradiance(way)[1] - e[1]).powi(2);
            mean += weight * e[1];
        }
        Air {
            place,
            light,
            layers: parts.iter().map(Around::new).collect(),
            truncation: if mean > 0.0 {
                square.sqrt() / mean
            } else {
                0.0
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(e: impl Fn(DVec3) -> f64) -> Around {
        Around::new(&directions().map(|(n, _)| [e(n); 3]))
    }

    /// The quadrature is exact for the products of all harmonics up to order 2 (degree 4).
    #[test]
    fn harmonics_are_orthonormal() {
        for i in 0..9 {
            for j in 0..9 {
                let product = |(n, w): &(DVec3, f64)| w * harmonics(*n)[i] * harmonics(*n)[j];
                let sum: f64 = 4.0 * PI * directions().iter().map(product).sum::<f64>();
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((sum - expected).abs() < 1e-14, "{i} {j}: {sum}");
            }
        }
    }

    /// In a furnace of radiance 1 there is only the constant.
    #[test]
    fn a_furnace_is_a_constant() {
        let around = of(|_| PI);
        assert!((around.sh[0][1] - 2.0 * PI.sqrt()).abs() < 1e-13);
        assert!(around.sh[1..].iter().all(|c| c[1].abs() < 1e-13));
    }

    /// Radiance 1 from a half-space: E = pi (1 + cos) / 2; the integrals of Y over the half sphere are sqrt(pi) and
    /// sqrt(3 pi) / 2 times the direction, and none of order 2.
    #[test]
    fn a_half_space_is_a_constant_and_a_slope() {
        let toward = DVec3::new(0.48, -0.6, 0.64);
        let around = of(|n| 0.5 * PI * (1.0 + n.dot(toward)));
        let slope = 0.5 * (3.0 * PI).sqrt();
        let expected = [
            PI.sqrt(),
            slope * toward.y,
            slope * toward.z,
            slope * toward.x,
        ];
        for (k, coefficient) in around.sh.iter().enumerate() {
            let expected = expected.get(k).copied().unwrap_or(0.0);
            assert!(
                (coefficient[1] - expected).abs() < 1e-13,
                "{k}: {coefficient:?}"
            );
        }
        assert!((around.irradiance(toward)[1] - PI).abs() < 1e-12);
    }

    /// For a lamp without extent, E = max(0, cos), the coefficients are Y in its direction. Orders 6 and more of E, which the
    /// quadrature takes for lower ones, put order 2 off the most where the lamp lies on an axis: there the rule has 1/21 + 4
    /// (4/105) / sqrt(2) / 4 = .07456 for the mean of c (3 c^2 - 1) / 2 over the lit half, which is 1/16: 19.3 %.
    #[test]
    fn a_lamp_is_its_direction() {
        for toward in [
            DVec3::Y,
            DVec3::new(0.48, -0.6, 0.64),
            DVec3::ONE.normalize(),
        ] {
            let around = of(|n| n.dot(toward).max(0.0));
            let exact = harmonics(toward);
            let greatest = exact.iter().fold(0.0_f64, |m, y| m.max(y.abs()));
            for (c, y) in around.sh.iter().zip(exact) {
                assert!(
                    (c[1] - y).abs() < 0.194 * greatest,
                    "{toward}: {} {y}",
                    c[1]
                );
            }
        }
    }
}
