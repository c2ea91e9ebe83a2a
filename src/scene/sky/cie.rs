//! Luminance over the dome: ISO 15469:2004 / CIE S 011 (Spatial distribution of daylight, CIE standard general sky).
//!
//! `L(Z, chi) = f(chi) phi(Z)` up to a factor, with the gradation `phi(Z) = 1 + a exp(b / cos Z)` over the angle Z from the zenith and
//! the indicatrix `f(chi) = 1 + c (exp(d chi) - exp(d pi/2)) + e cos^2 chi` over the angle chi from the sun. Type 16 is the traditional
//! overcast sky `(1 + 2 cos Z) / 3` (Moon and Spencer 1942), which the standard keeps beside its fifteen.

use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// a, b of the gradation and c, d, e of the indicatrix for types 1 to 15 (ISO 15469, table 1).
const TYPES: [[f64; 5]; 15] = [
    [4.0, -0.70, 0.0, -1.0, 0.0],
    [4.0, -0.70, 2.0, -1.5, 0.15],
    [1.1, -0.8, 0.0, -1.0, 0.0],
    [1.1, -0.8, 2.0, -1.5, 0.15],
    [0.0, -1.0, 0.0, -1.0, 0.0],
    [0.0, -1.0, 2.0, -1.5, 0.15],
    [0.0, -1.0, 5.0, -2.5, 0.30],
    [0.0, -1.0, 10.0, -3.0, 0.45],
    [-1.0, -0.55, 2.0, -1.5, 0.15],
    [-1.0, -0.55, 5.0, -2.5, 0.30],
    [-1.0, -0.55, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 24.0, -2.8, 0.15],
];
/// The traditional overcast sky.
const TRADITIONAL: u8 = 16;
/// Steps of the quadrature for the illuminance of open ground, by height and around: 1e-5 of it.
pub(super) const STEPS: [usize; 2] = [256, 512];

/// How the light of a sky is spread over the dome, brought to an illuminance of 1 on open level ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distribution {
    /// 1 to 16.
    kind: u8,
    /// Toward the sun.
    sun: DVec3,
    scale: f64,
    /// `exp(d pi/2)` of its type.
    across: f64,
}

impl Distribution {
    /// A type from 1 to 16 with the sun in a direction that looks up (unit length).
    ///
    /// # Panics
    /// There is no such type.
    pub fn new(kind: u8, sun: DVec3) -> Self {
        assert!((1..=TRADITIONAL).contains(&kind), "a sky of type {kind}");
        let plain = Self {
            kind,
            sun,
            scale: 1.0,
            across: (TYPES.get(kind as usize - 1)).map_or(0.0, |t| (t[3] * FRAC_PI_2).exp()),
        };
        let scale = 1.0 / plain.level();
        Self { scale, ..plain }
    }

    /// Does a type depend on where the sun stands?
    pub fn follows_sun(kind: u8) -> bool {
        (kind as usize)
            .checked_sub(1)
            .and_then(|k| TYPES.get(k))
            .is_some_and(|t| t[2] != 0.0)
    }

    /// Is it as bright in all directions?
    pub fn is_even(&self) -> bool {
        self.kind == 5
    }

    /// Its type.
    pub fn kind(&self) -> u8 {
        self.kind
    }

    /// Toward the sun.
    pub fn sun(&self) -> DVec3 {
        self.sun
    }

    /// Radiance from a direction of unit length; below the horizon that of the horizon.
    #[inline]
    pub fn radiance(&self, direction: DVec3) -> f64 {
        self.scale * self.shape(direction)
    }

    /// Radiance of the zenith.
    pub fn zenith(&self) -> f64 {
        self.radiance(DVec3::Y)
    }

    /// How far light from a direction that looks up has the colour of the horizon, 0 at the zenith to 1 there: by the gradation,
    /// `(phi(Z) - phi(0)) / (phi(pi/2) - phi(0)) = 1 - exp(b / cos Z - b)`, of which the type's a has no part.
    pub(super) fn toward_horizon(&self, direction: DVec3) -> f64 {
        let height = direction.y.max(0.0);
        match TYPES.get(self.kind as usize - 1) {
            Some([_, b, ..]) => 1.0 - (b / height - b).exp(),
            None => 1.0 - height,
        }
    }

    /// How far it has the colour of the haze about the sun: by the share of the indicatrix that is its exponential, which stands for
    /// forward scattering.
    pub(super) fn toward_sun(&self, direction: DVec3) -> f64 {
        let Some([_, _, c, d, e]) = TYPES.get(self.kind as usize - 1) else {
            return 0.0;
        };
        let cosine = direction.dot(self.sun).clamp(-1.0, 1.0);
        let haze = c * ((d * cosine.acos()).exp() - self.across);
        haze.max(0.0) / (1.0 + haze + e * cosine * cosine)
    }

    fn shape(&self, direction: DVec3) -> f64 {
        let height = direction.y.max(0.0);
        if self.kind == TRADITIONAL {
            return (1.0 + 2.0 * height) / 3.0;
        }
        let [a, b, c, d, e] = TYPES[self.kind as usize - 1];
        let mut shape = 1.0;
        if a != 0.0 {
            // At the horizon exp(-inf) is 0.
            shape += a * (b / height).exp();
        }
        if c != 0.0 {
            let cosine = direction.dot(self.sun).clamp(-1.0, 1.0);
            shape *= 1.0 + c * ((d * cosine.acos()).exp() - self.across) + e * cosine * cosine;
        }
        shape
    }

    /// Irradiance of open level ground, by the midpoint rule.
    fn level(&self) -> f64 {
        match self.is_even() {
            true => PI,
            false => level(STEPS, |direction| [self.shape(direction)])[0],
        }
    }
}

/// Irradiance of open level ground by radiances that depend on the direction, by the midpoint rule in so many steps by height and around.
pub(super) fn level<const N: usize>(
    [up, around]: [usize; 2],
    radiance: impl Fn(DVec3) -> [f64; N],
) -> [f64; N] {
    let mut sum = [0.0; N];
    for k in 0..up {
        let (height, out) = (FRAC_PI_2 * (k as f64 + 0.5) / up as f64).sin_cos();
        for j in 0..around {
            let (sin, cos) = (TAU * (j as f64 + 0.5) / around as f64).sin_cos();
            let each = radiance(DVec3::new(out * cos, height, out * sin));
            sum = std::array::from_fn(|k| sum[k] + height * out * each[k]);
        }
    }
    sum.map(|sum| sum * FRAC_PI_2 * TAU / (up * around) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sun(elevation: f64) -> DVec3 {
        let h = elevation.to_radians();
        DVec3::new(0.0, h.sin(), -h.cos())
    }

    #[test]
    fn an_even_sky_of_radiance_l_gives_pi_l() {
        let even = Distribution::new(5, DVec3::Y);
        for d in [DVec3::Y, DVec3::X, sun(30.0)] {
            assert_eq!(even.radiance(d), 1.0 / PI);
        }
    }

    /// E = L_z pi (1 + 4/3) / 3: the integral of (1 + 2 c) c over the dome is pi (1 + 4/3).
    #[test]
    fn the_traditional_sky_has_its_closed_form() {
        let sky = Distribution::new(16, DVec3::Y);
        let exact = 9.0 / (7.0 * PI);
        assert!((sky.zenith() / exact - 1.0).abs() < 1e-5);
        // The horizon has a third of the zenith's luminance.
        assert!((sky.radiance(DVec3::X) / sky.zenith() - 1.0 / 3.0).abs() < 1e-12);
    }

    /// In the upper half of the sky, of the zenith's luminance; the horizon is a third as bright.
    #[test]
    fn the_overcast_sky_is_like_the_traditional_one() {
        let [new, old] = [1, 16].map(|kind| Distribution::new(kind, DVec3::Y));
        for elevation in [30.0, 45.0, 60.0, 75.0] {
            let share = |sky: &Distribution| sky.radiance(sun(elevation)) / sky.zenith();
            assert!(
                (share(&new) / share(&old) - 1.0).abs() < 0.05,
                "{elevation}"
            );
        }
        let ratio: f64 = 1.0 + 4.0 * (-0.7_f64).exp();
        assert!((new.zenith() / new.radiance(DVec3::X) - ratio).abs() < 1e-12);
    }

    /// By Simpson's rule in height and azimuth, another way than that of `level`.
    #[test]
    fn every_type_gives_open_ground_an_irradiance_of_one() {
        for kind in 1..=16 {
            let sky = Distribution::new(kind, sun(60.0));
            let (n, m) = (400, 720);
            let mut sum = 0.0;
            for k in 0..=n {
                let h = FRAC_PI_2 * f64::from(k) / f64::from(n);
                let weight = match k {
                    0 => 1.0,
                    k if k == n => 1.0,
                    k if k % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                for j in 0..m {
                    let (s, c) = (TAU * f64::from(j) / f64::from(m)).sin_cos();
                    let d = DVec3::new(h.cos() * c, h.sin(), h.cos() * s);
                    sum += weight * sky.radiance(d) * h.sin() * h.cos();
                }
            }
            let level = sum * FRAC_PI_2 / f64::from(n) / 3.0 * TAU / f64::from(m);
            assert!((level - 1.0).abs() < 2e-4, "{kind}: {level}");
        }
    }

    #[test]
    fn colours_go_from_the_zenith_to_the_horizon_and_the_sun() {
        for kind in 1..=16 {
            let sky = Distribution::new(kind, sun(40.0));
            assert_eq!(sky.toward_horizon(DVec3::Y), 0.0);
            assert_eq!(sky.toward_horizon(DVec3::X), 1.0);
            let at = |elevation| sky.toward_horizon(sun(elevation));
            assert!(at(60.0) < at(30.0) && at(30.0) < at(10.0), "{kind}");
            let [there, beside] = [40.0, 70.0].map(|elevation| sky.toward_sun(sun(elevation)));
            assert_eq!(there > 0.0, Distribution::follows_sun(kind), "{kind}");
            assert!(there <= 1.0 && (there > beside || there == 0.0));
            assert_eq!(sky.toward_sun(-sun(40.0)), 0.0);
        }
    }

    #[test]
    fn clear_skies_are_brightest_at_the_sun() {
        for kind in 11..=15 {
            let sky = Distribution::new(kind, sun(45.0));
            let at = sky.radiance(sun(45.0));
            assert!(at > 3.0 * sky.radiance(DVec3::Y) && at > sky.radiance(sun(40.0)));
            assert!(Distribution::follows_sun(kind));
        }
        assert!([1, 3, 5, 16].iter().all(|&k| !Distribution::follows_sun(k)));
    }
}
