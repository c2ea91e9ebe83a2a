//! The CIE 1931 2 degree standard observer on the bands of a grid.
//!
//! A = k * integral of S(lambda) a_bar(lambda) d lambda, for A in X, Y, Z (paper eq. 1; CIE 015:2004, section 7).
//! With S held constant on each band this is k * sum S_leaf w_leaf, w_leaf the integral of a_bar over the band, in nm.
//! The paper samples a_bar at the left edge of the band instead.

use crate::data::{Grid, Spectrum};
use crate::data::{Outside, Table, cmf_1931};

/// Maximum luminous efficacy of radiation, lm/W (CIE 018:2019; 683.002 for the SI's 540 THz, 683 by convention).
pub const KM: f64 = 683.0;

/// Colour matching functions.
#[derive(Debug, Clone)]
pub struct Observer {
    cmf: [Table; 3],
}

impl Observer {
    /// The CIE 1931 2 degree standard observer, 360-830 nm, 1 nm.
    pub fn cie1931() -> Self {
        Self { cmf: cmf_1931() }
    }

    /// Integrals of x_bar, y_bar, z_bar over each band, nm.
    pub fn weights(&self, grid: &Grid) -> [Spectrum; 3] {
        self.cmf.each_ref().map(|cmf| {
            grid.means(cmf, Outside::Zero)
                .map(|mean| mean * grid.width())
        })
    }

    /// x_bar, y_bar, z_bar at the left edge of each band: the paper's weights (2.1.1).
    pub fn samples(&self, grid: &Grid) -> [Spectrum; 3] {
        self.cmf
            .each_ref()
            .map(|cmf| grid.left_edges(cmf, Outside::Zero))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::tristimulus;
    use crate::data::named;

    /// Sums over the visible range at a step of nm, as the CIE works them out (CIE 015:2004, 7.1).
    fn summed(table: &Table, from: u32, to: u32, step: usize) -> [f64; 3] {
        let sum = |cmf: &Table| {
            (from..=to)
                .step_by(step)
                .map(f64::from)
                .map(|nm| cmf.at(nm, Outside::Zero) * table.at(nm, Outside::Hold))
                .sum()
        };
        Observer::cie1931().cmf.each_ref().map(sum)
    }

    fn chromaticity(xyz: [f64; 3]) -> [f64; 2] {
        let sum: f64 = xyz.iter().sum();
        [xyz[0] / sum, xyz[1] / sum]
    }

    #[test]
    fn white_points_are_the_published_ones() {
        // CIE 015:2004, tables T.3 (A, C, D50, D55, D65, D75), T.8.1 (fluorescent lamps): x, y of the 2 degree observer.
        let published = [
            ("cie/A", 0.447_58, 0.407_45),
            ("cie/C", 0.310_06, 0.316_16),
            ("cie/D50", 0.345_67, 0.358_51),
            ("cie/D55", 0.332_43, 0.347_44),
            ("cie/D65", 0.312_72, 0.329_03),
            ("cie/D75", 0.299_03, 0.314_88),
            ("cie/E", 0.333_33, 0.333_33),
            ("cie/F2", 0.3721, 0.3751),
            ("cie/F7", 0.3129, 0.3292),
            ("cie/F11", 0.3805, 0.3769),
            ("cie/FL3.1", 0.4407, 0.4033),
            ("cie/HP1", 0.5330, 0.4150),
            ("cie/LED-B1", 0.4560, 0.4078),
        ];
        for (name, x, y) in published {
            let xy = chromaticity(summed(&named(name).unwrap().table, 380, 780, 5));
            // Half a unit of the fourth digit, in which the lamps are published.
            assert!(
                (xy[0] - x).abs() < 5.1e-5 && (xy[1] - y).abs() < 5.1e-5,
                "{name}: {xy:?}"
            );
        }
    }

    #[test]
    fn bands_give_the_white_point_of_the_1_nm_table() {
        let observer = Observer::cie1931();
        let grid = Grid::new(360.0, 830.0);
        for name in ["cie/A", "cie/D65", "cie/F2"] {
            let table = named(name).unwrap().table;
            let fine = chromaticity(summed(&table, 360, 830, 1));
            let bands = chromaticity(tristimulus(
                &grid.means(&table, Outside::Hold),
                &observer.weights(&grid),
            ));
            assert!(
                (fine[0] - bands[0]).hypot(fine[1] - bands[1]) < 1e-3,
                "{name}: {fine:?} {bands:?}"
            );
        }
    }

    #[test]
    fn luminous_efficacy_of_radiation() {
        let observer = Observer::cie1931();
        // Sums of the 1 nm tables (ISO/CIE 11664-1): 106.8655, 106.8569, 106.8923.
        let weights = observer.weights(&Grid::new(360.0, 830.0));
        for (w, published) in weights.iter().zip([106.8655, 106.8569, 106.8923]) {
            let sum = w.iter().sum::<f64>();
            assert!((sum - published).abs() < 4e-4, "{sum}");
        }
        assert_eq!(observer.cmf[1].at(555.0, Outside::Zero) * KM, 683.0);
        // The candela of 1948: a blackbody at the freezing point of platinum, 2042 K, has 60 cd/cm2. Its radiance is
        // sigma T^4 / pi, of which the visible part is found from Planck's law, whose whole is pi^4/15 (T/c2)^4.
        let (kelvin, c2) = (2042.0, crate::data::SECOND_RADIATION_CONSTANT);
        let planck = |nm: f64| (nm * 1e-9).powi(-5) / (c2 / (nm * 1e-9 * kelvin)).exp_m1();
        let y = summed(&crate::data::blackbody(kelvin), 360, 830, 1)[1];
        let visible = y * 1e-9 * planck(560.0) / 100.0;
        let whole = std::f64::consts::PI.powi(4) / 15.0 * (kelvin / c2).powi(4);
        let radiance = 5.670_374_419e-8 * f64::powi(kelvin, 4) / std::f64::consts::PI;
        let luminance = KM * visible / whole * radiance;
        assert!((luminance / 60e4 - 1.0).abs() < 0.005, "{luminance} cd/m2");
    }
}
