//! What a lighting designer asks of the light at a point: illuminance, colour temperature, rendering, fidelity, alpha-opic
//! daylight; each a number or the reason why it has none.

use super::KM;
use super::alphaopic::{AlphaOpic, RECEPTORS};
use super::bands::{Bands, weighted};
use super::correlated::{GREATEST_DUV, Locus, uv_1960};
use super::fidelity::EvaluationColours;
use super::rendering::TestColours;
use super::tolerance::{Range, Stated, Tolerance};
use crate::data::cmf_1931;
use std::fmt;

/// How many measures there are.
pub const MEASURES: usize = 12;
/// Names with units, in the order of [`LightMeasures::values`].
pub const NAMES: [&str; MEASURES] = [
    "lux", "CCT_K", "Duv", "Ra", "R9", "Rf", "Rg", "EDI_sc", "EDI_mc", "EDI_lc", "EDI_rh",
    "EDI_mel",
];
/// Place of the illuminance.
const LUX: usize = 0;
/// Place of the first of the equivalent daylight illuminances, in lx; the rest are as many as there are receptors.
const DAYLIGHT: usize = MEASURES - RECEPTORS.len();

/// Why a measure has no value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Undefined {
    /// Nothing shines there.
    NoLight,
    /// The light is too far from white to have a colour temperature.
    NotWhite,
    /// The light lies beyond an end of the Planckian locus.
    BeyondLocus,
}

impl fmt::Display for Undefined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoLight => "no light",
            Self::NotWhite => "|Duv| above 0.05: not a white",
            Self::BeyondLocus => "no colour temperature in 1000..50000 K",
        })
    }
}

/// A light, measured.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LightMeasures {
    /// In the order of [`NAMES`].
    pub values: [Result<f64, Undefined>; MEASURES],
    /// Distance in (u, v) of the light and the reference of Ra; none where Ra is not defined.
    pub reference_distance: Option<f64>,
}

/// Measures lights on bands.
#[derive(Debug, Clone)]
pub struct Meter {
    observer: [Vec<f64>; 3],
    locus: Locus,
    test: TestColours,
    evaluation: EvaluationColours,
    alpha: AlphaOpic,
    tolerance: Tolerance,
}

impl Meter {
    /// A meter for lights on bands; works out the Planckian locus.
    pub fn new(bands: &Bands) -> Self {
        let observer = cmf_1931().map(|cmf| bands.weights(&cmf));
        Self {
            locus: Locus::new(bands),
            test: TestColours::new(bands),
            evaluation: EvaluationColours::new(bands),
            alpha: AlphaOpic::new(bands),
            tolerance: Tolerance::new(bands, observer.clone()),
            observer,
        }
    }

    /// Measures a light: irradiance on the bands, W/m2/nm.
    pub fn measure(&self, light: &[f64]) -> LightMeasures {
        let xyz = self.observer.each_ref().map(|w| weighted(light, w));
        let mut values = [Err(Undefined::NoLight); MEASURES];
        values[LUX] = Ok(KM * xyz[1].max(0.0));
        let mut out = LightMeasures {
            values,
            reference_distance: None,
        };
        let Some(uv) = uv_1960(xyz).filter(|_| xyz[1] > 0.0) else {
            return out;
        };
        let daylight = self.alpha.daylight(light).map(|sum| Ok(KM * sum));
        out.values[DAYLIGHT..].copy_from_slice(&daylight);
        let Some(correlated) = self.locus.correlated(uv) else {
            out.values[1..DAYLIGHT].fill(Err(Undefined::BeyondLocus));
            return out;
        };
        out.values[1..DAYLIGHT].fill(Err(Undefined::NotWhite));
        out.values[2] = Ok(correlated.duv);
        if correlated.duv.abs() > GREATEST_DUV {
            return out;
        }
        out.values[1] = Ok(correlated.kelvin);
        if let Some(rendering) = self.test.rendering(light, correlated.kelvin) {
            out.values[3] = Ok(rendering.ra);
            out.values[4] = Ok(rendering.special[8]);
            out.reference_distance = Some(rendering.distance);
        }
        if let Some(fidelity) = self.evaluation.fidelity(light, correlated.kelvin) {
            out.values[5] = Ok(fidelity.rf);
            out.values[6] = Ok(fidelity.rg);
        }
        out
    }

    /// Where each measure lies if the light is as wrong as stated: an estimate. None where the measure has no value, and
    /// where the light is too narrow in wavelength for the error of its colour to say anything of its spectrum.
    pub fn ranges(
        &self,
        light: &[f64],
        measured: &LightMeasures,
        stated: Stated,
    ) -> [Option<Range>; MEASURES] {
        let others = self.tolerance.variants(light, stated.chromaticity);
        let others: Option<Vec<LightMeasures>> =
            others.map(|lights| lights.iter().map(|l| self.measure(l)).collect());
        std::array::from_fn(|k| {
            let value = measured.values[k].ok()?;
            let mut range = Range::of(value);
            if k != LUX {
                // A variant that has lost its colour temperature has nothing to say.
                let others = others.as_ref()?.iter();
                others
                    .filter_map(|other| other.values[k].ok())
                    .for_each(|other| range.take(other));
            }
            Some(if k == LUX || k >= DAYLIGHT {
                range.scaled(stated.relative)
            } else {
                range
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Grid;
    use crate::data::{blackbody, named, names};

    /// CCT, Duv, Ra, R9, Rf, Rg, then the five equivalent daylight illuminances of 100 lx, of every illuminant of the CIE.
    ///
    /// From the tables at 380-780 nm, 5 nm: the first six by colour-science 0.4.7 (`uv_to_CCT_Ohno2013`,
    /// `colour_rendering_index`, `colour_fidelity_index_ANSIIESTM3018`); the others by plain sums over the tables interpolated
    /// at 1 nm, of which FL12 equals the page of frudawski.de to the last digit.
    const PEER: [(&str, [f64; 6], [f64; 5]); 48] = [
        (
            "cie/A",
            [2855.6, 0.00000, 100.00, 99.99, 100.00, 100.00],
            [31.102, 80.657, 101.707, 57.306, 49.578],
        ),
        (
            "cie/C",
            [6774.0, -0.00215, 97.56, 85.26, 97.83, 101.23],
            [108.754, 100.082, 100.534, 101.585, 102.986],
        ),
        (
            "cie/D50",
            [5001.7, 0.00321, 99.99, 99.99, 100.00, 100.00],
            [74.688, 94.995, 100.033, 87.630, 84.736],
        ),
        (
            "cie/D55",
            [5502.3, 0.00326, 99.98, 99.95, 100.00, 100.00],
            [83.899, 96.930, 99.983, 92.280, 90.431],
        ),
        (
            "cie/D65",
            [6503.0, 0.00321, 99.99, 100.00, 100.00, 100.00],
            [100.000, 100.000, 100.000, 100.000, 100.000],
        ),
        (
            "cie/D75",
            [7504.9, 0.00314, 99.99, 99.96, 99.99, 100.00],
            [113.259, 102.315, 100.086, 106.080, 107.617],
        ),
        (
            "cie/E",
            [5455.4, -0.00442, 95.29, 82.23, 94.71, 103.66],
            [92.550, 95.943, 100.614, 91.746, 90.582],
        ),
        (
            "cie/F1",
            [6428.2, 0.00713, 75.82, -47.43, 80.64, 89.83],
            [95.341, 98.182, 98.849, 89.411, 86.961],
        ),
        (
            "cie/F2",
            [4224.5, 0.00179, 64.15, -83.91, 70.12, 86.42],
            [62.192, 88.017, 99.205, 63.804, 56.990],
        ),
        (
            "cie/F3",
            [3446.1, 0.00067, 56.68, -102.16, 63.08, 84.38],
            [46.335, 82.431, 99.664, 50.613, 41.841],
        ),
        (
            "cie/F4",
            [2938.0, -0.00082, 51.35, -111.30, 56.70, 83.49],
            [36.330, 77.876, 100.458, 41.226, 31.551],
        ),
        (
            "cie/F5",
            [6345.3, 0.01075, 71.66, -67.73, 77.84, 87.42],
            [90.790, 98.013, 98.353, 87.341, 83.989],
        ),
        (
            "cie/F6",
            [4148.5, 0.00604, 59.01, -104.77, 66.52, 83.48],
            [55.654, 87.290, 98.652, 60.061, 51.986],
        ),
        (
            "cie/F7",
            [6494.8, 0.00322, 90.18, 61.05, 91.47, 98.90],
            [99.863, 98.680, 99.355, 94.060, 92.337],
        ),
        (
            "cie/F8",
            [4997.2, 0.00321, 95.50, 98.47, 95.46, 101.67],
            [74.308, 94.281, 99.626, 84.639, 80.521],
        ),
        (
            "cie/F9",
            [4149.0, -0.00001, 90.29, 69.61, 91.00, 99.73],
            [61.419, 89.309, 99.900, 72.293, 66.339],
        ),
        (
            "cie/F10",
            [4998.4, 0.00329, 80.96, 27.01, 79.48, 99.30],
            [75.732, 91.967, 98.354, 74.972, 68.340],
        ),
        (
            "cie/F11",
            [3998.6, 0.00005, 82.83, 25.25, 80.04, 101.06],
            [59.132, 86.992, 99.103, 64.792, 56.360],
        ),
        (
            "cie/F12",
            [2999.6, 0.00004, 83.05, 0.95, 77.55, 102.41],
            [35.929, 79.904, 100.440, 50.848, 40.420],
        ),
        (
            "cie/FL3.1",
            [2931.6, -0.00080, 51.14, -109.97, 55.33, 83.98],
            [36.270, 77.629, 100.360, 40.356, 30.317],
        ),
        (
            "cie/FL3.2",
            [3965.3, -0.00170, 70.31, -38.05, 73.91, 91.89],
            [60.830, 86.558, 99.609, 62.164, 55.014],
        ),
        (
            "cie/FL3.3",
            [6279.7, 0.00938, 71.77, -63.64, 77.37, 88.38],
            [91.282, 97.462, 98.362, 85.977, 82.286],
        ),
        (
            "cie/FL3.4",
            [2903.8, -0.00067, 86.50, 75.37, 80.19, 105.73],
            [34.492, 79.178, 100.658, 50.318, 39.964],
        ),
        (
            "cie/FL3.5",
            [4085.6, -0.00291, 96.37, 95.00, 95.24, 101.86],
            [63.264, 89.475, 100.466, 74.793, 69.697],
        ),
        (
            "cie/FL3.6",
            [4893.5, 0.00271, 96.29, 93.80, 96.32, 100.80],
            [72.693, 93.987, 99.826, 84.125, 80.173],
        ),
        (
            "cie/FL3.7",
            [2978.7, -0.00002, 81.40, -9.25, 75.75, 102.08],
            [35.594, 79.558, 100.460, 49.757, 39.127],
        ),
        (
            "cie/FL3.8",
            [4005.5, 0.00254, 80.35, 13.53, 78.79, 99.92],
            [56.396, 86.905, 98.821, 63.448, 54.350],
        ),
        (
            "cie/FL3.9",
            [4852.3, 0.00185, 79.57, 23.98, 77.40, 99.96],
            [74.919, 90.917, 98.351, 72.321, 65.010],
        ),
        (
            "cie/FL3.10",
            [4999.5, 0.00201, 88.35, 46.40, 86.24, 100.10],
            [76.165, 93.132, 99.153, 80.054, 75.050],
        ),
        (
            "cie/FL3.11",
            [5852.7, 0.00479, 77.60, 23.74, 77.48, 97.62],
            [89.503, 94.711, 97.848, 80.360, 74.525],
        ),
        (
            "cie/FL3.12",
            [2984.2, -0.00026, 93.02, 56.98, 90.97, 99.89],
            [34.686, 81.536, 101.491, 57.359, 49.292],
        ),
        (
            "cie/FL3.13",
            [3895.8, -0.00278, 95.89, 70.62, 95.57, 98.51],
            [58.083, 89.173, 101.120, 74.850, 70.498],
        ),
        (
            "cie/FL3.14",
            [5044.1, 0.00478, 94.94, 93.59, 94.19, 99.27],
            [71.788, 96.304, 100.440, 91.418, 89.204],
        ),
        (
            "cie/FL3.15",
            [6507.8, 0.00310, 98.46, 96.40, 98.71, 100.65],
            [98.505, 100.072, 100.021, 99.965, 99.733],
        ),
        (
            "cie/HP1",
            [1959.2, 0.00078, 8.07, -260.76, 34.19, 53.97],
            [11.130, 66.394, 105.422, 22.687, 15.430],
        ),
        (
            "cie/HP2",
            [2506.3, 0.00071, 82.53, 52.48, 82.31, 104.47],
            [22.769, 75.270, 101.335, 42.939, 32.961],
        ),
        (
            "cie/HP3",
            [3144.0, 0.00237, 82.37, -29.36, 83.19, 97.17],
            [36.777, 81.664, 100.584, 55.231, 45.896],
        ),
        (
            "cie/HP4",
            [4002.1, 0.00118, 75.96, -51.49, 77.85, 95.17],
            [60.035, 87.072, 99.489, 64.660, 56.734],
        ),
        (
            "cie/HP5",
            [4039.4, -0.00171, 89.11, 18.48, 90.11, 97.44],
            [62.444, 88.895, 100.483, 72.530, 67.207],
        ),
        (
            "cie/LED-B1",
            [2733.5, -0.00070, 81.77, 12.58, 84.08, 96.15],
            [29.534, 78.102, 101.689, 49.243, 40.668],
        ),
        (
            "cie/LED-B2",
            [2997.8, -0.00098, 82.77, 17.58, 84.30, 96.58],
            [36.188, 80.646, 101.097, 53.979, 45.802],
        ),
        (
            "cie/LED-B3",
            [4102.5, -0.00066, 84.83, 23.76, 85.32, 97.86],
            [61.764, 88.412, 99.776, 69.854, 63.257],
        ),
        (
            "cie/LED-B4",
            [5108.9, 0.00046, 76.81, -1.62, 76.91, 95.51],
            [80.885, 91.659, 98.504, 74.981, 69.082],
        ),
        (
            "cie/LED-B5",
            [6597.6, 0.00089, 80.24, 6.91, 79.47, 94.15],
            [103.471, 96.723, 98.570, 88.308, 85.518],
        ),
        (
            "cie/LED-BH1",
            [2851.3, -0.00031, 91.79, 73.45, 85.24, 106.77],
            [32.674, 78.931, 100.897, 51.503, 41.195],
        ),
        (
            "cie/LED-RGB1",
            [2839.8, 0.00427, 57.11, -34.21, 71.00, 107.01],
            [24.341, 82.354, 101.902, 67.295, 57.771],
        ),
        (
            "cie/LED-V1",
            [2723.7, -0.00188, 95.32, 97.90, 87.34, 101.93],
            [32.821, 79.783, 102.461, 57.079, 49.613],
        ),
        (
            "cie/LED-V2",
            [4069.5, 0.00104, 95.66, 95.01, 94.07, 99.32],
            [59.953, 90.900, 100.932, 79.482, 75.422],
        ),
    ];

    fn meters() -> [(Bands, Meter); 2] {
        [Bands::samples(380, 780, 5), Bands::of(&Grid::default())]
            .map(|bands| (bands.clone(), Meter::new(&bands)))
    }

    fn values(name: &str, (bands, meter): &(Bands, Meter)) -> [f64; MEASURES] {
        let mut light = bands.light(&named(name).unwrap().table);
        let lux = meter.measure(&light).values[LUX].unwrap();
        light.iter_mut().for_each(|power| *power *= 100.0 / lux);
        meter.measure(&light).values.map(|value| value.unwrap())
    }

    #[test]
    fn every_illuminant_is_as_a_peer_has_it() {
        // Greatest differences allowed: CCT relative, Duv, Ra, R9, Rf, Rg, daylight relative. At 5 nm ours is the peer's
        // method but for the colour temperature of Ra's reference (Robertson's there). Bands of 6.25 nm blur lines.
        let allowed = [
            [4e-4, 4e-5, 0.02, 0.1, 0.02, 0.02, 3e-3],
            [4.5e-3, 3.5e-4, 1.3, 5.0, 0.9, 0.8, 4.5e-3],
        ];
        for (meter, allowed) in meters().iter().zip(allowed) {
            let mut worst = [0.0f64; 7];
            for (name, colour, daylight) in &PEER {
                let got = values(name, meter);
                let off = [0, 1, 2, 3, 4, 5].map(|k| (got[k + 1] - colour[k]).abs());
                let far = |k: usize| (got[DAYLIGHT + k] / daylight[k] - 1.0).abs();
                let far = (0..5).map(far).fold(0.0, f64::max);
                let off = [
                    off[0] / colour[0],
                    off[1],
                    off[2],
                    off[3],
                    off[4],
                    off[5],
                    far,
                ];
                for k in 0..7 {
                    assert!(off[k] <= allowed[k], "{name}, {k}: {got:?}");
                    worst[k] = worst[k].max(off[k]);
                }
            }
            println!("greatest differences: {worst:?}");
        }
        let named = names().into_iter().filter(|name| name.starts_with("cie/"));
        assert!(named.eq(PEER.map(|row| row.0.to_owned())));
    }

    #[test]
    fn published_figures() {
        for meter in &meters() {
            // CIE 13.3-1995 and CIE 015:2004 print FL2 64, FL11 83.
            assert!((values("cie/F2", meter)[3] - 64.0).abs() < 0.5);
            assert!((values("cie/F11", meter)[3] - 83.0).abs() < 0.5);
            // CIE 015: A 2856 K on the locus, D65 6504 K with Duv .0032, FL2 4230 K (rounded to tens).
            for (name, kelvin, within) in [
                ("cie/A", 2856.0, 1.0),
                ("cie/D65", 6504.0, 2.0),
                ("cie/F2", 4230.0, 10.0),
            ] {
                let got = values(name, meter)[1];
                assert!((got - kelvin).abs() < within, "{name}: {got} K");
            }
            assert!(values("cie/A", meter)[2].abs() < 1e-5);
            assert!((values("cie/D65", meter)[2] - 0.0032).abs() < 5e-5);
            // CIE S 026 by frudawski.de: melanopic daylight of 100 lx, and FL12 for all receptors.
            // LED-B2: our sum over 5 nm of the tables of CIE 015 and CIE S 026, as no printed figure is at hand.
            let published = [("cie/A", 49.58), ("cie/D55", 90.40), ("cie/FL12", 40.42)];
            for (name, mel) in published.into_iter().chain([("cie/LED-B2", 45.78)]) {
                let got = values(name, meter)[11];
                assert!((got / mel - 1.0).abs() < 0.005, "{name}: {got}");
            }
            let published = [35.929, 79.904, 100.440, 50.848, 40.420];
            for (got, want) in values("cie/FL12", meter)[DAYLIGHT..].iter().zip(published) {
                assert!((got / want - 1.0).abs() < 0.005, "{got} {want}");
            }
        }
    }

    #[test]
    fn efficacies_of_daylight_are_the_published_ones() {
        // CIE S 026, table 4: mW/lm.
        let published = [0.8173, 1.4558, 1.6289, 1.4497, 1.3262];
        let bands = Bands::samples(380, 780, 1);
        let d65 = bands.light(&named("cie/D65").unwrap().table);
        let lumens = KM * weighted(&d65, &bands.weights(&cmf_1931()[1]));
        for (action, want) in crate::data::alpha_opic().iter().zip(published) {
            let got = 1e3 * weighted(&d65, &bands.weights(action)) / lumens;
            assert!((got - want).abs() < 6e-5, "{got} {want}");
        }
    }

    #[test]
    fn blackbodies_are_found_and_render_perfectly() {
        for (bands, meter) in &meters() {
            for kelvin in (2000..=20_000).step_by(250).map(f64::from) {
                let got = meter.measure(&bands.light(&blackbody(kelvin))).values;
                assert!((got[1].unwrap() - kelvin).abs() < 1.0, "{got:?}");
                assert!(got[2].unwrap().abs() < 1e-5, "{got:?}");
                if kelvin < 4000.0 {
                    assert!(got[3].unwrap() > 99.99 && got[5].unwrap() > 99.9);
                    assert!((got[6].unwrap() - 100.0).abs() < 0.05);
                }
            }
        }
    }

    #[test]
    fn both_of_ohnos_solutions_find_the_light_off_the_locus() {
        // A chromaticity at a known distance along the normal of the locus, on either side, of both sizes.
        let bands = Bands::samples(360, 830, 1);
        let locus = Locus::new(&bands);
        let weights = cmf_1931().map(|cmf| bands.weights(&cmf));
        let at = |kelvin: f64| {
            let light = bands.light(&blackbody(kelvin));
            uv_1960(weights.each_ref().map(|w| weighted(&light, w))).unwrap()
        };
        for kelvin in [2000.0, 2856.0, 4000.0, 6500.0, 10_000.0, 20_000.0] {
            let ([u, v], before, after) = (at(kelvin), at(0.999 * kelvin), at(1.001 * kelvin));
            let (du, dv) = (after[0] - before[0], after[1] - before[1]);
            let length = du.hypot(dv);
            for duv in [
                -0.03, -0.01, -0.0021, -0.0019, -1e-4, 1e-4, 0.0019, 0.0021, 0.01, 0.03,
            ] {
                let there = [u + duv * dv / length, v - duv * du / length];
                let got = locus.correlated(there).unwrap();
                assert!(
                    (got.kelvin / kelvin - 1.0).abs() < 2e-4,
                    "{kelvin} {duv}: {got:?}"
                );
                assert!((got.duv - duv).abs() < 2e-6, "{kelvin} {duv}: {got:?}");
            }
        }
    }

    #[test]
    fn what_has_no_colour_temperature_says_why() {
        let (_, meter) = &meters()[1];
        let dark = meter.measure(&[0.0; 64]);
        assert_eq!(dark.values[LUX], Ok(0.0));
        assert!(
            dark.values[1..]
                .iter()
                .all(|v| *v == Err(Undefined::NoLight))
        );
        // A green line.
        let mut green = [0.0; 64];
        green[24] = 0.01;
        let got = meter.measure(&green);
        assert_eq!(got.values[1], Err(Undefined::NotWhite));
        assert_eq!(got.values[3], Err(Undefined::NotWhite));
        assert!(got.values[2].unwrap() > GREATEST_DUV);
        assert!(got.values[11].unwrap() > 0.0);
        let stated = Stated {
            relative: 0.1,
            chromaticity: 1e-3,
        };
        let ranges = meter.ranges(&green, &got, stated);
        assert!(ranges[LUX].is_some() && ranges[1].is_none() && ranges[11].is_none());
        // A deep blue and a deep red lie beyond the ends.
        let mut blue = [0.0; 64];
        blue[5] = 1.0;
        assert_eq!(meter.measure(&blue).values[1], Err(Undefined::BeyondLocus));
    }

    #[test]
    fn ranges_hold_their_values_and_grow_with_the_error() {
        let (bands, meter) = &meters()[1];
        for name in ["cie/A", "cie/D65", "cie/F2", "cie/F11", "cie/LED-B2"] {
            let light = bands.light(&named(name).unwrap().table);
            let measured = meter.measure(&light);
            let ranges = |error: f64| {
                let stated = Stated {
                    relative: 10.0 * error,
                    chromaticity: error,
                };
                meter.ranges(&light, &measured, stated).map(Option::unwrap)
            };
            for ((none, small), (great, value)) in
                (ranges(0.0).iter().zip(ranges(1e-4))).zip(ranges(1e-3).iter().zip(measured.values))
            {
                let value = value.unwrap();
                assert!((none.high - none.low).abs() < 1e-9 * value.abs().max(1.0));
                assert!(small.low < small.high, "{name} {small:?}");
                assert!(
                    small.low <= value && value <= small.high,
                    "{name} {small:?}"
                );
                // Indices of a light that is its own reference have nowhere to rise.
                assert!(
                    great.low < small.low && small.high <= great.high,
                    "{name} {great:?}"
                );
            }
            let duv = ranges(1e-4)[2];
            assert!((duv.high - duv.low - 2e-4).abs() < 2e-5, "{name} {duv:?}");
        }
    }
}
