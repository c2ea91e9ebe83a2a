//! Planck's law: spectral power of a blackbody,
//! M(lambda, T) proportional to lambda^-5 / (exp(c2 / (lambda T)) - 1), scaled to 100 at 560 nm like the CIE illuminants.
//!
//! It does not include the refractive index of air.

use super::Table;

/// c2 = h c / k, in m K. From the exact SI values of 2019 (CODATA 2018): h = 6.62607015e-34 J s,
/// c = 299792458 m/s, k = 1.380649e-23 J/K.
pub const SECOND_RADIATION_CONSTANT: f64 = 6.626_070_15e-34 * 299_792_458.0 / 1.380_649e-23;

/// Wavelength at which the power is 100, nm (CIE 015, illuminant A).
const REFERENCE_NM: f64 = 560.0;

/// Relative power of a blackbody at `kelvin` (in [500, 50000]), 100 at 560 nm; 300-900 nm in steps of 1 nm.
pub fn blackbody(kelvin: f64) -> Table {
    let wavelengths: Vec<f64> = (300..=900).map(f64::from).collect();
    let values = wavelengths
        .iter()
        .map(|&nm| 100.0 * planck_ratio(nm, kelvin))
        .collect();
    Table::new(wavelengths, values).expect("Planck's law is finite and positive at 500 K and above")
}

/// M(nm) / M(560 nm).
fn planck_ratio(nm: f64, kelvin: f64) -> f64 {
    let exponent = |nm: f64| SECOND_RADIATION_CONSTANT / (nm * 1e-9 * kelvin);
    (REFERENCE_NM / nm).powi(5) * exponent(REFERENCE_NM).exp_m1() / exponent(nm).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Outside, named};

    #[test]
    fn illuminant_a_is_a_blackbody() {
        // CIE 015: illuminant A is Planck's law at 2848 K with c2 = 1.435e-2 m K, that is 2848 * 1.4388 / 1.435 K.
        let kelvin = 2848.0 * SECOND_RADIATION_CONSTANT / 1.435e-2;
        let (ours, cie) = (blackbody(kelvin), named("cie/A").unwrap().table);
        for (&nm, &value) in cie.wavelengths().iter().zip(cie.values()) {
            let relative = ours.at(nm, Outside::Zero) / value - 1.0;
            // The table has six significant digits.
            assert!(relative.abs() < 5e-6, "{nm} nm: {relative}");
        }
    }

    #[test]
    fn peaks_where_wien_says() {
        // Wien: lambda_max T = 2.897771955e-3 m K (CODATA 2018).
        for kelvin in [4000.0, 5000.0, 6500.0] {
            let table = blackbody(kelvin);
            let peak = (0..601)
                .max_by(|&a, &b| table.values()[a].total_cmp(&table.values()[b]))
                .unwrap();
            assert!(
                (table.wavelengths()[peak] - 2.897_771_955e6 / kelvin).abs() <= 0.5,
                "{kelvin} K"
            );
        }
    }

    #[test]
    fn extreme_temperatures_are_finite() {
        for kelvin in [500.0, 50_000.0] {
            assert!(
                blackbody(kelvin)
                    .values()
                    .iter()
                    .all(|v| v.is_finite() && *v > 0.0)
            );
        }
    }
}
