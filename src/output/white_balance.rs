//! White balance: which light shows as white.

use crate::color::{Bands, GREATEST_DUV, LinearSrgb, Locus, Xyz, bradford, multiply, uv_1960};
use crate::data::{blackbody, cmf_1931, daylight};
use crate::spectrum::Grid;
use std::fmt;
use std::str::FromStr;

/// Temperatures that may be asked for, K.
const KELVIN: [f64; 2] = [1000.0, 25_000.0];
/// From here on a temperature means daylight, as CIE 015 has it; below, a blackbody.
const DAYLIGHT: f64 = 4000.0;

/// A matrix on linear sRGB.
pub type Matrix = [[f64; 3]; 3];

/// Leaves colours as they are.
pub(crate) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Which light is to show as white. Written `none`, `auto` or a temperature in kelvin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum WhiteBalance {
    /// D65, the display's own: colours as they are.
    #[default]
    None,
    /// What lights the room, as far as an eye takes it for white.
    Auto,
    /// Daylight of this colour temperature, K; below 4000 K a blackbody.
    Kelvin(f64),
}

impl FromStr for WhiteBalance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [least, most] = KELVIN;
        match text {
            "none" => Ok(Self::None),
            "auto" => Ok(Self::Auto),
            kelvin => match kelvin.trim_end_matches(['K', 'k']).parse::<f64>() {
                Ok(kelvin) if (least..=most).contains(&kelvin) => Ok(Self::Kelvin(kelvin)),
                _ => Err(format!(
                    "auto, none or a temperature of {least} to {most} kelvin is wanted"
                )),
            },
        }
    }
}

impl fmt::Display for WhiteBalance {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Auto => f.write_str("auto"),
            Self::Kelvin(kelvin) => write!(f, "{kelvin}"),
        }
    }
}

impl WhiteBalance {
    /// The matrix that shows the chosen light as white, of equal luminance. `seen`: what lights the room, tristimulus.
    pub(super) fn matrix(self, seen: Xyz) -> Matrix {
        let white = match self {
            Self::None => None,
            Self::Auto => taken_for_white(seen),
            Self::Kelvin(kelvin) => {
                let weights = cmf_1931().map(|cmf| bands().weights(&cmf));
                let light = bands().light(&match kelvin >= DAYLIGHT {
                    true => daylight(kelvin),
                    false => blackbody(kelvin),
                });
                let sum = |w: &Vec<f64>| light.iter().zip(w).map(|(l, w)| l * w).sum::<f64>();
                Some(weights.each_ref().map(sum))
            }
        };
        white.map_or(IDENTITY, |[x, y, z]| {
            let srgb = LinearSrgb::standard();
            let adapted = bradford([x / y, 1.0, z / y], srgb.to_xyz([1.0; 3]));
            // Columns: what becomes of red, green and blue.
            let columns = IDENTITY.map(|c| srgb.from_xyz(multiply(&adapted, srgb.to_xyz(c))));
            std::array::from_fn(|row| std::array::from_fn(|column| columns[column][row]))
        })
    }
}

fn bands() -> Bands {
    Bands::of(&Grid::default())
}

/// An eye takes for white what is near the colours of glowing bodies; a coloured light stays coloured.
fn taken_for_white(seen: Xyz) -> Option<Xyz> {
    let near = Locus::new(&bands()).correlated(uv_1960(seen)?)?;
    (near.duv.abs() <= GREATEST_DUV).then_some(seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_white_asked_for_shows_as_white() {
        let seen = |kelvin| {
            let weights = cmf_1931().map(|cmf| bands().weights(&cmf));
            let light = bands().light(&blackbody(kelvin));
            weights.map(|w| light.iter().zip(w).map(|(l, w)| l * w).sum::<f64>())
        };
        for (balance, kelvin) in [
            (WhiteBalance::Auto, 2700.0),
            (WhiteBalance::Kelvin(3000.0), 3000.0),
        ] {
            let white = seen(kelvin);
            let rgb = LinearSrgb::standard().from_xyz(white.map(|c| c / white[1]));
            let shown = multiply(&balance.matrix(white), rgb);
            assert!(shown.iter().all(|c| (c - 1.0).abs() < 1e-9), "{shown:?}");
        }
        assert_eq!(WhiteBalance::None.matrix(seen(2700.0)), IDENTITY);
        // Red light stays red, and darkness is nothing to adapt to.
        assert_eq!(WhiteBalance::Auto.matrix([0.41, 0.21, 0.02]), IDENTITY);
        assert_eq!(WhiteBalance::Auto.matrix([0.0; 3]), IDENTITY);
    }

    #[test]
    fn words_and_kelvin() {
        assert_eq!("3200K".parse(), Ok(WhiteBalance::Kelvin(3200.0)));
        assert_eq!("auto".parse(), Ok(WhiteBalance::Auto));
        for bad in ["", "warm", "10", "NaN", "1e9"] {
            assert!(bad.parse::<WhiteBalance>().is_err(), "{bad}");
        }
    }
}
