//! Spectral radiance over the dome: Hosek and Wilkie, "An analytic model for full spectral sky-dome radiance" (ACM Transactions on Graphics
//! 31 (4), 2012), fitted by them to path-traced skies; absolute.
//!
//! At each of eleven wavelengths, with the angles theta from the zenith and gamma from the sun,
//!
//! `L = mean (1 + A exp(B / (cos theta + .01))) (C + D exp(E gamma) + F cos^2 gamma + G chi(H, gamma) + I sqrt(cos theta))`,
//! `chi(H, gamma) = (1 + cos^2 gamma) / (1 + H^2 - 2 H cos gamma)^(3/2)`,
//!
//! linear between them. Above 720 nm the last is held, as of other tables: .02 % of a sky's luminance is there, and CIE daylight, which has
//! a band of water there, would make a step of it. Below 320 nm it falls as D65 does, by ozone, to nearly nothing at 300 nm.

use crate::color::{KM, Observer};
use crate::data::{
    BANDS, Grid, Outside, SKYLIGHT_NM, Spectrum, TERMS, Table, WAVES, named, skylight,
};
use glam::DVec3;

/// Below the first wavelength of the model, nm.
const SHORTER: [f64; 2] = [300.0, 310.0];

/// A sky of Hosek and Wilkie.
#[derive(Debug, Clone)]
pub struct Hosek {
    sun: DVec3,
    /// Turbidity of the air, and reflectance of the ground under it.
    air: [f64; 2],
    terms: [[f64; TERMS]; WAVES],
    /// What a band has of each wavelength.
    bands: Box<[Spectrum; WAVES]>,
}

impl Hosek {
    /// A sky with the sun in a direction that looks up (unit length).
    ///
    /// # Panics
    /// Turbidity (1 to 10) or albedo (0 to 1) are out of range, or the sun is below the horizon.
    pub fn new(turbidity: f64, albedo: f64, sun: DVec3, grid: &Grid) -> Self {
        let height = sun.y.min(1.0).asin().to_degrees();
        Self {
            sun,
            air: [turbidity, albedo],
            terms: skylight(turbidity, albedo, height),
            bands: Box::new(std::array::from_fn(|wave| bands_of(wave, grid))),
        }
    }

    /// Toward the sun.
    pub fn sun(&self) -> DVec3 {
        self.sun
    }

    /// Turbidity of the air, and reflectance of the ground under it.
    pub fn air(&self) -> [f64; 2] {
        self.air
    }

    /// Radiance at 320, 360 ... 720 nm from a direction of unit length, W/(m2 sr nm); below the horizon that of the horizon.
    #[inline]
    pub fn radiance(&self, direction: DVec3) -> [f64; WAVES] {
        let height = direction.y.clamp(0.0, 1.0);
        let (root, air) = (height.sqrt(), 1.0 / (height + 0.01));
        let cosine = direction.dot(self.sun).clamp(-1.0, 1.0);
        let (angle, square) = (cosine.acos(), cosine * cosine);
        self.terms.map(|[a, b, c, d, e, f, g, h, i, mean]| {
            let x = 1.0 + h * h - 2.0 * h * cosine;
            let chi = (1.0 + square) / (x * x.sqrt());
            let gradation = 1.0 + a * (b * air).exp();
            let scattering = c + d * (e * angle).exp() + f * square + g * chi + i * root;
            // The fit is positive all over the dome; nothing in its form says so.
            (mean * gradation * scattering).max(0.0)
        })
    }

    /// The spectrum that has these values at the wavelengths of the model.
    pub(super) fn spectrum(&self, values: &[f64; WAVES]) -> Spectrum {
        std::array::from_fn(|band| {
            let each = values.iter().zip(self.bands.iter());
            each.map(|(value, bands)| value * bands[band]).sum()
        })
    }

    /// What a radiance of 1 at each wavelength has as a tristimulus value, Y in cd/m2.
    pub(super) fn tristimulus(&self, grid: &Grid) -> [DVec3; WAVES] {
        let observer = Observer::cie1931().weights(grid);
        self.bands.each_ref().map(|bands| {
            let sum =
                |weights: &Spectrum| -> f64 { (0..BANDS).map(|l| weights[l] * bands[l]).sum() };
            KM * DVec3::from_array(observer.each_ref().map(sum))
        })
    }
}

/// What the bands have of a wavelength: the mean of what is 1 there and falls to 0 at its neighbours.
fn bands_of(wave: usize, grid: &Grid) -> Spectrum {
    let d65 = named("cie/D65").expect("D65 is built in").table;
    let daylight = |nm: f64| d65.at(nm, Outside::Zero);
    let first = |nm: f64| match wave {
        0 => daylight(nm) / daylight(SKYLIGHT_NM[0]),
        _ => 0.0,
    };
    let own = (0..WAVES).map(|k| if k == wave { 1.0 } else { 0.0 });
    let values = SHORTER.into_iter().map(first).chain(own).collect();
    let wavelengths = SHORTER.into_iter().chain(SKYLIGHT_NM).collect();
    let table = Table::new(wavelengths, values).expect("wavelengths increase");
    grid.means(&table, Outside::Hold)
}

#[cfg(test)]
mod tests {
    use super::super::sun::direction;
    use super::*;

    /// Against the emitter `sunsky` of Mitsuba 3.9.1 (`sun_scale` 0, single wavelengths, single precision).
    #[test]
    fn radiance_is_that_of_mitsuba() {
        // Turbidity, albedo, height of the sun; height and azimuth of the direction; 320, 440, 560, 720 nm.
        let cases = [
            (
                [3.0, 0.2, 40.0],
                [90.0, 0.0],
                [0.0376516, 0.0770377, 0.0320497, 0.0110222],
            ),
            (
                [3.0, 0.2, 40.0],
                [40.0, 0.0],
                [0.0588361, 0.23684, 0.200503, 0.120447],
            ),
            (
                [3.0, 0.2, 40.0],
                [25.0, 70.0],
                [0.0452179, 0.14644, 0.0735922, 0.0262638],
            ),
            (
                [3.0, 0.2, 40.0],
                [1.0, 90.0],
                [0.0262755, 0.165702, 0.140453, 0.0654314],
            ),
            (
                [3.5, 0.3, 25.0],
                [90.0, 0.0],
                [0.0236079, 0.0616839, 0.0264942, 0.00849978],
            ),
            (
                [3.5, 0.3, 25.0],
                [25.0, 0.0],
                [0.0403174, 0.324714, 0.355828, 0.236583],
            ),
            (
                [3.5, 0.3, 25.0],
                [10.0, 180.0],
                [0.0255347, 0.193907, 0.130129, 0.0522303],
            ),
            (
                [1.0, 0.0, 90.0],
                [90.0, 0.0],
                [0.0603177, 0.0926362, 0.0422395, 0.00883586],
            ),
            (
                [1.0, 0.0, 90.0],
                [10.0, 180.0],
                [0.0534009, 0.18957, 0.101681, 0.0337091],
            ),
        ];
        for ([turbidity, albedo, height], [up, along], want) in cases {
            // North need not be where the sun is.
            let sky = Hosek::new(turbidity, albedo, direction(height, 33.0), &Grid::paper());
            let got = sky.radiance(direction(up, 33.0 + along));
            for (got, want) in [0, 3, 6, 10].map(|k| got[k]).into_iter().zip(want) {
                assert!(
                    (got / want - 1.0).abs() < 1e-5,
                    "{up} {along}: {got} {want}"
                );
            }
        }
    }

    /// The mean of a band between two wavelengths is that of the line; above the last it is held, below the first it falls off.
    #[test]
    fn spectra_are_lines_between_the_wavelengths() {
        let grid = Grid::new(300.0, 780.0);
        let sky = Hosek::new(3.0, 0.2, direction(40.0, 0.0), &grid);
        let values = std::array::from_fn(|k| 1.0 + (k * k) as f64);
        let bands = sky.spectrum(&values);
        for (band, got) in bands.into_iter().enumerate() {
            let nm = grid.middle(band);
            let k = ((nm - 320.0) / 40.0).clamp(0.0, 9.0) as usize;
            let line = values[k] + (values[k + 1] - values[k]) * (nm - SKYLIGHT_NM[k]) / 40.0;
            // A kink lies in every fifth band or so.
            match nm {
                nm if nm < 307.0 => assert!(got < 0.2),
                nm if nm < 322.0 => assert!(got <= values[0]),
                nm if nm > 724.0 => assert!((got / values[10] - 1.0).abs() < 1e-12),
                _ => assert!((got / line - 1.0).abs() < 0.02, "{nm}: {got} {line}"),
            }
        }
    }
}
