//! CIECAM02 with the uniform space CAM02-UCS, for full adaptation in an average surround: what colour fidelity is measured
//! in (CIE 159:2004; Luo, Cui, Li 2006; viewing conditions of CIE 224:2017: adapting luminance 100 cd/m2, Yb = 20).

use super::{Xyz, multiply};

const CAT02: [[f64; 3]; 3] = [
    [0.7328, 0.4296, -0.1624],
    [-0.7036, 1.6975, 0.0061],
    [0.0030, 0.0136, 0.9834],
];
const CAT02_BACK: [[f64; 3]; 3] = [
    [1.096_124, -0.278_869, 0.182_745],
    [0.454_369, 0.473_533, 0.072_098],
    [-0.009_628, -0.005_698, 1.015_326],
];
/// Hunt-Pointer-Estevez.
const CONES: [[f64; 3]; 3] = [
    [0.389_71, 0.688_98, -0.078_68],
    [-0.229_81, 1.183_40, 0.046_41],
    [0.0, 0.0, 1.0],
];
/// Luminance that the eye is adapted to, cd/m2.
const ADAPTING: f64 = 100.0;
/// Luminance factor of the background, %.
const BACKGROUND: f64 = 20.0;
/// Impact of an average surround.
const SURROUND: f64 = 0.69;

/// What a colour looks like.
#[derive(Debug, Clone, Copy)]
pub(super) struct Appearance {
    /// J', a', b'.
    pub(super) uniform: [f64; 3],
    /// Hue angle, radians in [0, 2 pi).
    pub(super) hue: f64,
}

/// The eye under a white.
#[derive(Debug, Clone, Copy)]
pub(super) struct Viewer {
    /// Factors of full adaptation.
    gain: [f64; 3],
    /// Luminance level adaptation.
    level: f64,
    /// Induction factor, and exponent of lightness.
    induction: f64,
    exponent: f64,
    /// Achromatic response of the white.
    white: f64,
}

impl Viewer {
    /// Adapted to a white with Y = 100.
    pub(super) fn new(white: Xyz) -> Self {
        let five = 5.0 * ADAPTING;
        let k4 = (1.0 / (five + 1.0)).powi(4);
        let share = BACKGROUND / white[1];
        let mut viewer = Self {
            gain: multiply(&CAT02, white).map(|sharp| white[1] / sharp),
            level: 0.2 * k4 * five + 0.1 * (1.0 - k4).powi(2) * five.cbrt(),
            induction: 0.725 * share.powf(-0.2),
            exponent: SURROUND * (1.48 + share.sqrt()),
            white: 1.0,
        };
        viewer.white = viewer.achromatic(viewer.responses(white));
        viewer
    }

    /// Post-adaptation cone responses.
    fn responses(&self, xyz: Xyz) -> [f64; 3] {
        let sharp = multiply(&CAT02, xyz);
        let adapted = [0, 1, 2].map(|k| sharp[k] * self.gain[k]);
        multiply(&CONES, multiply(&CAT02_BACK, adapted)).map(|cone| {
            let power = (self.level * cone.abs() / 100.0).powf(0.42);
            (400.0 * power / (27.13 + power)).copysign(cone) + 0.1
        })
    }

    fn achromatic(&self, [r, g, b]: [f64; 3]) -> f64 {
        (2.0 * r + g + b / 20.0 - 0.305) * self.induction
    }

    /// What a colour looks like.
    pub(super) fn see(&self, xyz: Xyz) -> Appearance {
        let [r, g, b] = self.responses(xyz);
        let red = r - 12.0 * g / 11.0 + b / 11.0;
        let yellow = (r + g - 2.0 * b) / 9.0;
        let hue = yellow.atan2(red).rem_euclid(std::f64::consts::TAU);
        let lightness = (self.achromatic([r, g, b]) / self.white).max(0.0);
        let lightness = 100.0 * lightness.powf(self.exponent);
        let eccentricity = 0.25 * ((hue + 2.0).cos() + 3.8);
        let t = 50_000.0 / 13.0 * self.induction * eccentricity * red.hypot(yellow)
            / (r + g + 1.05 * b);
        let chroma = t.max(0.0).powf(0.9)
            * (lightness / 100.0).sqrt()
            * (1.64 - 0.29f64.powf(BACKGROUND / 100.0)).powf(0.73);
        let colourfulness = (1.0 + 0.0228 * chroma * self.level.powf(0.25)).ln() / 0.0228;
        Appearance {
            uniform: [
                1.7 * lightness / (1.0 + 0.007 * lightness),
                colourfulness * hue.cos(),
                colourfulness * hue.sin(),
            ],
            hue,
        }
    }
}
