//! A sky whose colour changes with the direction, as a mixture of three spectra.
//!
//! What comes from a direction is told by its tristimulus value, and of all spectra that have this one it gets the likeliest: that by linear
//! regression over the dome, in which all directions count alike. Regression keeps what it starts from, so the mixture has the
//! colour of the model in all directions. The three spectra stand at the corners of the smallest triangle, among those whose
//! spectra are nowhere negative where the eye sees, around the chromaticities of the dome, so that no direction has less than
//! nothing of one.
//!
//! Over turbidities of 2 to 10 and a sun 5 to 85 degrees high, in directions above 1 degree, spectra from 380 to 780 nm are off by .9 % of their
//! mean (root mean square; 9 % in the worst direction, close to the sun), colours by .0005 dE00 (.007). Below .7 degrees, where no direction
//! is sampled, colours may be off by more. Where the eye does not see they tell little: at 360 nm directions are off by 7 % in the mean, at 320 nm by
//! 20 %; open ground has its due.

use super::cie::level;
use super::hosek::Hosek;
use super::parts::PARTS;
use crate::data::{Grid, Spectrum, WAVES};
use glam::{DMat2, DMat3, DVec2, DVec3, dvec2};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Heights and azimuths, to one side of the sun, of the directions that count; the lowest ones are .7 degrees high. The horizon itself has
/// under haze and a low sun a colour around which no triangle lies; with 48 heights, the lowest 1 degree, colours above are off by up to 4 dE00.
const GRID: [usize; 2] = [64, 32];
/// Directions of the sides of a triangle.
const SIDES: usize = 48;
/// How far they are from what the directions of the grid have, in standard deviations of that: so that those between lie inside.
const MARGIN: f64 = 0.02;
/// Steps of the quadrature for the illuminance of open ground, by height and around: 1e-4 of it.
const STEPS: [usize; 2] = [128, 256];
/// Wavelengths of the model at which the eye does not see, the first two.
const UNSEEN: usize = 2;

/// A sky of Hosek and Wilkie with the mixture that stands for it.
#[derive(Debug, Clone)]
pub struct Spectral {
    model: Hosek,
    scale: f64,
    /// What each wavelength of the model brings to the radiance of each part, of which open level ground has an irradiance of 1.
    shares: [[f64; WAVES]; PARTS],
    /// Spectral irradiance of open level ground by each part, W/(m2 nm).
    levels: [Spectrum; PARTS],
}

impl Spectral {
    /// Toward the sun.
    pub(super) fn sun(&self) -> DVec3 {
        self.model.sun()
    }

    /// The mixture for a model.
    pub(super) fn new(model: Hosek, grid: &Grid) -> Self {
        let colours = model.tristimulus(grid);
        let dome = Samples::of(&model, &colours);
        let regression = dome.regression();
        let corners = dome.triangle(&regression);
        let from = DMat3::from_cols_array_2d(&corners.map(|c| c.to_array())).inverse();
        let shares = colours.map(|colour| (from * colour).to_array());
        let of = |radiance: [f64; WAVES], part: usize| -> f64 {
            let each = radiance.iter().zip(&shares);
            each.map(|(x, shares)| x * shares[part])
                .sum::<f64>()
                .max(0.0)
        };
        let irradiance: [f64; PARTS + UNSEEN] = level(STEPS, |d| {
            let radiance = model.radiance(d);
            std::array::from_fn(|k| match k.checked_sub(PARTS) {
                None => of(radiance, k),
                Some(wave) => radiance[wave],
            })
        });
        let parts: [f64; PARTS] = std::array::from_fn(|k| irradiance[k]);
        let mut spectra = corners.map(|corner| regression.map(|g| corner.dot(g).max(0.0)));
        // What was negative there is nothing, and the rest less: open ground has what it should have.
        for wave in 0..UNSEEN {
            let mixed: f64 = (0..PARTS).map(|k| parts[k] * spectra[k][wave]).sum();
            let factor = irradiance[PARTS + wave] / mixed;
            spectra.iter_mut().for_each(|s| s[wave] *= factor);
        }
        Self {
            levels: std::array::from_fn(|k| model.spectrum(&spectra[k].map(|x| parts[k] * x))),
            shares: std::array::from_fn(|k| shares.map(|shares| shares[k] / parts[k])),
            model,
            scale: 1.0,
        }
    }

    /// The same, so many times as bright.
    pub(super) fn scaled(self, factor: f64) -> Self {
        Self {
            levels: self.levels.map(|level| level.map(|x| factor * x)),
            scale: factor * self.scale,
            ..self
        }
    }

    /// The model.
    pub fn model(&self) -> &Hosek {
        &self.model
    }

    /// Spectral irradiance of open level ground by each part, W/(m2 nm).
    pub(super) fn levels(&self) -> &[Spectrum; PARTS] {
        &self.levels
    }

    /// Radiance of each part, of which open level ground has an irradiance of 1.
    #[inline]
    pub(super) fn radiance(&self, direction: DVec3) -> [f64; PARTS] {
        let radiance = self.model.radiance(direction);
        self.shares.each_ref().map(|shares| {
            let each = radiance.iter().zip(shares);
            each.map(|(x, share)| x * share).sum::<f64>().max(0.0)
        })
    }

    /// What comes from a direction by the model itself, W/(m2 sr nm).
    pub(super) fn exact(&self, direction: DVec3) -> Spectrum {
        let radiance = self.model.radiance(direction);
        self.model.spectrum(&radiance.map(|x| self.scale * x))
    }
}

/// Directions of the dome with what comes from there.
struct Samples {
    /// Weight: the solid angle over the square of the luminance, so that it is errors by share that count.
    weights: Vec<f64>,
    radiances: Vec<[f64; WAVES]>,
    colours: Vec<DVec3>,
}

impl Samples {
    /// All over the dome, and toward the sun.
    fn of(model: &Hosek, colours: &[DVec3; WAVES]) -> Self {
        let sun = model.sun();
        let ahead = DVec3::new(sun.x, 0.0, sun.z).normalize_or(DVec3::NEG_Z);
        let side = ahead.cross(DVec3::Y);
        let [up, around] = GRID;
        let at = |(k, j): (usize, usize)| {
            let (height, out) = (FRAC_PI_2 * (k as f64 + 0.5) / up as f64).sin_cos();
            let (sin, cos) = (PI * j as f64 / around as f64).sin_cos();
            out * (cos * ahead + sin * side) + height * DVec3::Y
        };
        let grid = (0..up).flat_map(|k| (0..=around).map(move |j| (k, j)));
        let directions: Vec<DVec3> = grid.map(at).chain([sun]).collect();
        let radiances: Vec<_> = directions.iter().map(|&d| model.radiance(d)).collect();
        let colour = |radiance: &[f64; WAVES]| -> DVec3 {
            colours.iter().zip(radiance).map(|(c, x)| *c * *x).sum()
        };
        let colours: Vec<DVec3> = radiances.iter().map(colour).collect();
        let weigh = |(d, c): (&DVec3, &DVec3)| (1.0 - d.y * d.y).max(0.0).sqrt() / (c.y * c.y);
        let weights = directions.iter().zip(&colours).map(weigh).collect();
        Self {
            weights,
            radiances,
            colours,
        }
    }

    /// The radiance at each wavelength by tristimulus value: what this is to be multiplied with.
    fn regression(&self) -> [DVec3; WAVES] {
        let (mut squares, mut products) = (DMat3::ZERO, [DVec3::ZERO; WAVES]);
        let each = self.weights.iter().zip(&self.colours).zip(&self.radiances);
        for ((&weight, &colour), radiance) in each {
            let weighted = weight * colour;
            let [x, y, z] = colour.to_array().map(|c| c * weighted);
            squares += DMat3::from_cols(x, y, z);
            for (product, x) in products.iter_mut().zip(radiance) {
                *product += *x * weighted;
            }
        }
        let inverse = squares.inverse();
        products.map(|product| inverse * product)
    }

    /// Tristimulus values, of luminance 1, at the corners of the triangle.
    fn triangle(&self, regression: &[DVec3; WAVES]) -> [DVec3; PARTS] {
        let flat: Vec<DVec2> = (self.colours.iter())
            .map(|c| dvec2(c.x / c.y, c.z / c.y))
            .collect();
        let count = flat.len() as f64;
        let mean = flat.iter().sum::<DVec2>() / count;
        // Brought to a standard deviation of 1 in all directions: the smallest triangle stays the smallest.
        let (mut xx, mut xz, mut zz) = (0.0, 0.0, 0.0);
        for d in flat.iter().map(|p| *p - mean) {
            (xx, xz, zz) = (
                xx + d.x * d.x / count,
                xz + d.x * d.y / count,
                zz + d.y * d.y / count,
            );
        }
        let lower = DMat2::from_cols(
            dvec2(xx.sqrt(), xz / xx.sqrt()),
            dvec2(0.0, (zz - xz * xz / xx).sqrt()),
        );
        let inverse = lower.inverse();
        let round: Vec<DVec2> = flat.iter().map(|p| inverse * (*p - mean)).collect();
        let sides: Vec<(DVec2, f64)> = (0..SIDES)
            .map(|k| {
                let normal = DVec2::from_angle(TAU * k as f64 / SIDES as f64);
                let far = round.iter().map(|p| p.dot(normal)).fold(0.0, f64::max);
                (normal, far + MARGIN)
            })
            .collect();
        let corner = |i: usize, j: usize| {
            let ((m, a), (n, b)) = (sides[i], sides[j]);
            let at = DMat2::from_cols(m, n).transpose().inverse() * dvec2(a, b);
            let back = lower * at + mean;
            let colour = DVec3::new(back.x, 1.0, back.y);
            let dark = regression[UNSEEN..].iter().any(|g| g.dot(colour) < 0.0);
            HullCorner { at, colour, dark }
        };
        let mut best: Option<((bool, f64), [DVec3; PARTS])> = None;
        for i in 0..SIDES {
            for j in i + 1..(i + SIDES / 2).min(SIDES) {
                let first = corner(i, j);
                // Less than half a turn from each to the next.
                for k in i + SIDES / 2 + 1..(j + SIDES / 2).min(SIDES) {
                    let [second, third] = [corner(j, k), corner(k, i)];
                    let area = (second.at - first.at).perp_dot(third.at - first.at).abs();
                    let cost = (first.dark || second.dark || third.dark, area);
                    if best.is_none_or(|(least, _)| cost < least) {
                        best = Some((cost, [&first, &second, &third].map(|c| c.colour)));
                    }
                }
            }
        }
        let (_, mut corners) = best.expect("there are triangles");
        corners.sort_by(|a, b| b.z.total_cmp(&a.z));
        corners
    }
}

/// Where two sides meet.
struct HullCorner {
    /// Among the chromaticities, brought to a standard deviation of 1.
    at: DVec2,
    /// Tristimulus value, of luminance 1.
    colour: DVec3,
    /// Is its spectrum negative where the eye sees?
    dark: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{KM, Observer};
    use crate::color::{de2000, tristimulus};
    use crate::geometry::sampling::sequence02;
    use crate::scene::sky::direction;

    /// Colours are those of the model, spectra nearly, and open ground has what the model gives it.
    #[test]
    fn the_mixture_stands_for_the_model() {
        let grid = Grid::new(380.0, 780.0);
        let weights = Observer::cie1931().weights(&grid);
        let (mut spectra, mut colours) = ([0.0_f64; 2], [0.0_f64; 2]);
        let mut count = 0.0;
        for turbidity in [2.0, 3.0, 4.5, 6.0, 8.0, 10.0] {
            for height in [5.0, 15.0, 30.0, 60.0, 85.0] {
                let sun = direction(height, 70.0);
                let sky = Spectral::new(Hosek::new(turbidity, 0.2, sun, &grid), &grid);
                for k in 0..256 {
                    // Alike over the dome above 1 degree.
                    let [u, v] = sequence02(k, 5);
                    let d = direction(
                        (1.0_f64.to_radians().sin() * (1.0 - u) + u)
                            .asin()
                            .to_degrees(),
                        360.0 * v,
                    );
                    let (exact, parts) = (sky.exact(d), sky.radiance(d));
                    let mixed: Spectrum = std::array::from_fn(|l| {
                        (0..PARTS).map(|k| parts[k] * sky.levels()[k][l]).sum()
                    });
                    let mean = exact.iter().sum::<f64>() / exact.len() as f64;
                    let squares: f64 = exact.iter().zip(&mixed).map(|(a, b)| (a - b).powi(2)).sum();
                    let off = (squares / exact.len() as f64).sqrt() / mean;
                    let [a, b] = [exact, mixed].map(|s| tristimulus(&s, &weights).map(|x| KM * x));
                    let white = [0.95047, 1.0, 1.08883].map(|x| 2.0 * a[1] * x);
                    let seen = de2000(a, b, white);
                    spectra = [spectra[0] + off, spectra[1].max(off)];
                    colours = [colours[0] + seen, colours[1].max(seen)];
                    count += 1.0;
                }
            }
        }
        println!(
            "spectra: mean {:.5}, worst {:.5}",
            spectra[0] / count,
            spectra[1]
        );
        println!(
            "dE00: mean {:.6}, worst {:.5}",
            colours[0] / count,
            colours[1]
        );
        assert!(spectra[0] / count < 0.01 && spectra[1] < 0.15);
        assert!(colours[0] / count < 0.002 && colours[1] < 0.05);
    }

    /// By the same midpoint rule the parts have an irradiance of 1, and together the illuminance of the model.
    #[test]
    fn open_ground_has_the_light_of_the_model() {
        let grid = Grid::new(300.0, 780.0);
        let luminous = Observer::cie1931().weights(&grid)[1];
        for (turbidity, height) in [(1.0, 90.0), (3.0, 40.0), (6.5, 12.0), (10.0, 3.0)] {
            let model = Hosek::new(turbidity, 0.3, direction(height, 200.0), &grid);
            let sky = Spectral::new(model, &grid).scaled(2.0);
            for one in level([192, 320], |d| sky.radiance(d)) {
                assert!((one - 1.0).abs() < 1e-3, "{turbidity} {height}: {one}");
            }
            let exact: [f64; 64] = level([64, 128], |d| sky.exact(d));
            let mixed: Spectrum = std::array::from_fn(|l| sky.levels().iter().map(|s| s[l]).sum());
            let size = |s: &Spectrum| -> f64 { s.iter().zip(&luminous).map(|(p, y)| p * y).sum() };
            assert!((size(&exact) / size(&mixed) - 1.0).abs() < 1e-3);
            for (l, (a, b)) in exact.iter().zip(mixed).enumerate() {
                assert!(
                    (a / b - 1.0).abs() < 0.03,
                    "{turbidity} {height}, {l}: {a} {b}"
                );
            }
            assert!(sky.levels().iter().flatten().all(|&x| x >= 0.0));
        }
    }
}
