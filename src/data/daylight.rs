//! CIE daylight: spectral power of a phase of daylight by its correlated colour temperature,
//! S = S0 + M1 S1 + M2 S2 (CIE 015:2004, section 3.1 and table T.2), 100 at 560 nm.
//!
//! Facts of a published standard; digits as in the colour-science library 0.4.7 (BSD-3-Clause, Colour Developers).

use super::Table;

/// Temperatures that the chromaticity of daylight is given for, K.
const RANGE: [f64; 2] = [4000.0, 25_000.0];
/// First wavelength of [`COMPONENTS`], nm.
const FIRST_NM: f64 = 300.0;
/// Step of [`COMPONENTS`], nm; linear between.
const STEP_NM: f64 = 10.0;

/// S0, S1, S2 at 300, 310 ... 830 nm.
const COMPONENTS: [[f64; 3]; 54] = [
    [0.04, 0.02, 0.0],
    [6.0, 4.5, 2.0],
    [29.6, 22.4, 4.0],
    [55.3, 42.0, 8.5],
    [57.3, 40.6, 7.8],
    [61.8, 41.6, 6.7],
    [61.5, 38.0, 5.3],
    [68.8, 42.4, 6.1],
    [63.4, 38.5, 3.0],
    [65.8, 35.0, 1.2],
    [94.8, 43.4, -1.1],
    [104.8, 46.3, -0.5],
    [105.9, 43.9, -0.7],
    [96.8, 37.1, -1.2],
    [113.9, 36.7, -2.6],
    [125.6, 35.9, -2.9],
    [125.5, 32.6, -2.8],
    [121.3, 27.9, -2.6],
    [121.3, 24.3, -2.6],
    [113.5, 20.1, -1.8],
    [113.1, 16.2, -1.5],
    [110.8, 13.2, -1.3],
    [106.5, 8.6, -1.2],
    [108.8, 6.1, -1.0],
    [105.3, 4.2, -0.5],
    [104.4, 1.9, -0.3],
    [100.0, 0.0, 0.0],
    [96.0, -1.6, 0.2],
    [95.1, -3.5, 0.5],
    [89.1, -3.5, 2.1],
    [90.5, -5.8, 3.2],
    [90.3, -7.2, 4.1],
    [88.4, -8.6, 4.7],
    [84.0, -9.5, 5.1],
    [85.1, -10.9, 6.7],
    [81.9, -10.7, 7.3],
    [82.6, -12.0, 8.6],
    [84.9, -14.0, 9.8],
    [81.3, -13.6, 10.2],
    [71.9, -12.0, 8.3],
    [74.3, -13.3, 9.6],
    [76.4, -12.9, 8.5],
    [63.3, -10.6, 7.0],
    [71.7, -11.6, 7.6],
    [77.0, -12.2, 8.0],
    [65.2, -10.2, 6.7],
    [47.7, -7.8, 5.2],
    [68.6, -11.2, 7.4],
    [65.0, -10.4, 6.8],
    [66.0, -10.6, 7.0],
    [61.0, -9.7, 6.4],
    [53.3, -8.3, 5.5],
    [58.9, -9.3, 6.1],
    [61.9, -9.8, 6.5],
];

/// Relative power of daylight at a correlated colour temperature, K, held to 4000..25000 K; 300-830 nm.
///
/// The temperature is that of today's Planck's law: D65 is 6504 K.
///
/// ```
/// use haarlight::data::{Outside, daylight, named};
/// let (ours, cie) = (daylight(6504.0), named("cie/D65").unwrap().table);
/// assert!((ours.at(450.0, Outside::Zero) / cie.at(450.0, Outside::Zero) - 1.0).abs() < 2e-4);
/// ```
pub fn daylight(kelvin: f64) -> Table {
    let [x, y] = chromaticity(kelvin.clamp(RANGE[0], RANGE[1]));
    let whole = 0.0241 + 0.2562 * x - 0.7341 * y;
    let m1 = (-1.3515 - 1.7703 * x + 5.9114 * y) / whole;
    let m2 = (0.03 - 31.4424 * x + 30.0717 * y) / whole;
    let wavelengths = (0..COMPONENTS.len())
        .map(|k| FIRST_NM + STEP_NM * k as f64)
        .collect();
    let values = COMPONENTS
        .iter()
        .map(|[s0, s1, s2]| (s0 + m1 * s1 + m2 * s2).max(0.0))
        .collect();
    Table::new(wavelengths, values).expect("daylight is finite and not negative")
}

/// x, y of daylight (CIE 015:2004, 3.2 and 3.3).
fn chromaticity(kelvin: f64) -> [f64; 2] {
    let t = 1e3 / kelvin;
    let x = if kelvin <= 7000.0 {
        0.244_063 + t * (0.099_11 + t * (2.967_8 - t * 4.607))
    } else {
        0.237_04 + t * (0.247_48 + t * (1.901_8 - t * 2.006_4))
    };
    [x, -3.0 * x * x + 2.870 * x - 0.275]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Outside, named};

    #[test]
    fn the_d_illuminants_are_daylight() {
        // CIE 015:2004, 3.1: D illuminants have the nominal temperature times 1.4388 / 1.4380. Their tables come from M1 and
        // M2 rounded to three digits.
        for (name, nominal) in [
            ("cie/D50", 5000.0),
            ("cie/D55", 5500.0),
            ("cie/D65", 6500.0),
            ("cie/D75", 7500.0),
        ] {
            let cie = named(name).unwrap().table;
            let ours = daylight(nominal * 1.4388 / 1.4380);
            for (&nm, &value) in cie.wavelengths().iter().zip(cie.values()) {
                let off = ours.at(nm, Outside::Zero) - value;
                assert!(off.abs() < 0.06, "{name} at {nm} nm: {off}");
            }
        }
    }

    #[test]
    fn the_ends_are_held() {
        assert_eq!(daylight(1000.0), daylight(4000.0));
        assert_eq!(daylight(1e6), daylight(25_000.0));
    }
}
