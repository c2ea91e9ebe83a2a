//! The ways in which rows may carry spectra: the program's own, and those that it is measured against.

use std::fmt;
use std::str::FromStr;

/// Intervals and vectors at the most: the bands.
const MOST: u8 = 64;

/// How spectra are carried by the rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Representation {
    /// Ratios to each light on a cut whose *estimated* colour error, with all interreflections, is within the share of
    /// the asked-for error. Written `adaptive` or `perceptual`.
    #[default]
    Adaptive,
    /// Like `Adaptive`, but the error within the share is a *bound*: the paper's neglected term is taken at its
    /// greatest.
    Guaranteed,
    /// Radiosity itself on the union of the cuts that the paper's own control (3.1.3, 3.4, errors in XYZ) gives the
    /// lights and their first and second reflections.
    Paper,
    /// A list for each patch, radiosity itself, multiplied, refined and merged from patch to patch (3.2 to 3.4); all 64 bands in rooms with
    /// panes, mirrors, sheets or fluorescence, and when several ranks bake.
    Lists,
    /// Ratios to each light on this many intervals of equal width, in 1..=64.
    Uniform(u8),
    /// Coordinates in a basis of this many vectors made for the room (paper 2.2.2), in 1..=64.
    Characteristic(u8),
    /// All 64 bands.
    Dense,
    /// Linear sRGB: reflectances and lamps are reduced to three numbers before anything is solved.
    Rgb,
}

impl fmt::Display for Representation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Adaptive => f.write_str("adaptive"),
            Self::Guaranteed => f.write_str("guaranteed"),
            Self::Paper => f.write_str("paper"),
            Self::Lists => f.write_str("lists"),
            Self::Uniform(n) => write!(f, "uniform:{n}"),
            Self::Characteristic(n) => write!(f, "characteristic:{n}"),
            Self::Dense => f.write_str("dense"),
            Self::Rgb => f.write_str("rgb"),
        }
    }
}

impl FromStr for Representation {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let count = |text: &str| {
            let n: u8 = text.parse().map_err(|_| format!("{text}: not a number"))?;
            if (1..=MOST).contains(&n) {
                Ok(n)
            } else {
                Err(format!("{n}: 1 to {MOST} are possible"))
            }
        };
        match text.split_once(':') {
            Some(("uniform", n)) => count(n).map(Self::Uniform),
            Some(("characteristic", n)) => count(n).map(Self::Characteristic),
            Some(_) => Err("uniform:N or characteristic:N".into()),
            None => match text {
                "adaptive" | "perceptual" => Ok(Self::Adaptive),
                "guaranteed" => Ok(Self::Guaranteed),
                "paper" => Ok(Self::Paper),
                "lists" => Ok(Self::Lists),
                "dense" => Ok(Self::Dense),
                "rgb" => Ok(Self::Rgb),
                _ => Err(
                    "perceptual, guaranteed, paper, lists, uniform:N, characteristic:N, dense or rgb"
                        .into(),
                ),
            },
        }
    }
}

impl serde::Serialize for Representation {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> serde::Deserialize<'de> for Representation {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        for r in [
            Representation::Adaptive,
            Representation::Guaranteed,
            Representation::Paper,
            Representation::Lists,
            Representation::Uniform(12),
            Representation::Characteristic(64),
            Representation::Dense,
            Representation::Rgb,
        ] {
            assert_eq!(r.to_string().parse(), Ok(r));
        }
        assert_eq!("perceptual".parse(), Ok(Representation::Adaptive));
        for bad in [
            "",
            "uniform",
            "uniform:0",
            "uniform:65",
            "uniform:x",
            "bands:3",
        ] {
            assert!(bad.parse::<Representation>().is_err(), "{bad}");
        }
    }
}
