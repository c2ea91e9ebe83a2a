//! Options that several commands share, as typed and as meant.

use super::sky::SkyArgs;
use crate::gather::BakedSurface;
use crate::output::{Exposure, ExposureSetting, Packing, WhiteBalance, Writing};
use crate::scene::{Camera, Options, Scene};
use crate::spectrum::{BANDS, Grid};
use crate::survey::SurveyOptions;
use crate::team::Team;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;

/// Shortest wavelength that the tables of daylight and of illuminant A know (CIE 015:2004, table T.1), which is there to excite what
/// fluoresces, and longest that the observer's table knows (CIE 018:2019, table 6), nm.
const KNOWN_NM: [f64; 2] = [300.0, 830.0];
/// Narrowest band, nm: the step of the finest tables.
const LEAST_LEAF_NM: f64 = 1.0;

/// Options of all commands.
#[derive(Debug, Clone, Default, clap::Args)]
#[non_exhaustive]
pub struct Common {
    /// Threads to work with; the result does not depend on it [default: all cores].
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// Seed of all sampling patterns.
    #[arg(long, global = true, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Say nothing but errors.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// The rank that this process is of a job; alone unless [`Job`](crate::team::Job) says otherwise.
    #[arg(skip)]
    pub team: Team,
}

/// Options of the commands that read a room.
#[derive(Debug, Clone, Default, clap::Args)]
#[non_exhaustive]
pub struct Reading {
    /// Spectra of materials and lights [default: ROOM's name with .spectra.json, if it is there].
    #[arg(long, value_name = "FILE")]
    pub spectra: Option<PathBuf>,
    /// Wavelengths to work on, nm; 64 bands divide them. From 300 on where ultraviolet light excites what fluoresces.
    #[arg(long, value_name = "FROM..TO", default_value = "380..780")]
    pub range: WavelengthRange,
    /// Only warn of keys and names in the file of spectra that mean nothing.
    #[arg(long)]
    pub lenient: bool,
    /// Metres for each unit of the file: 0.01 for a room drawn in centimetres. Files are written in the file's unit.
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
    pub scale: Option<f64>,
    /// Where all lamps shine away from the room: turn the faces that look reversed.
    #[arg(long)]
    pub flip: bool,
    /// Go on where no lamp lights the room.
    #[arg(long)]
    pub allow_dark: bool,
    /// What is outside.
    #[command(flatten)]
    pub sky: SkyArgs,
}

impl Reading {
    /// How to read a room.
    pub fn options(&self) -> Options {
        Options {
            grid: self.range.grid(),
            spectra: self.spectra.clone(),
            said: None,
            lenient: self.lenient,
            scale: self.scale,
            sky: self.sky.wish(),
        }
    }

    /// What is decided before the room is looked over.
    pub fn wishes(&self) -> SurveyOptions {
        SurveyOptions {
            allow_dark: self.allow_dark,
            flip: self.flip,
        }
    }
}

/// Options of the commands that solve.
#[derive(Debug, Clone, Copy, clap::Args)]
#[non_exhaustive]
pub struct Solving {
    /// Mean colour difference (CIEDE2000) at which to stop.
    #[arg(long, value_name = "DE", default_value_t = 0.5, value_parser = positive)]
    pub error: f64,
    /// Take about this many seconds in all, with gather, pictures and writing [default: no limit]. Where not even the first
    /// round fits, a bake shows where rays from the lamps landed.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub time: Option<f64>,
}

/// How the room is shown, in the file and in pictures.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
#[non_exhaustive]
pub struct Showing {
    /// How bright: auto (what a person in the room adapts to), auto+1 (a stop brighter) or an exposure value for ISO 100.
    #[arg(
        long,
        value_name = "auto|auto+N|EV",
        default_value_t,
        allow_hyphen_values = true
    )]
    pub exposure: ExposureSetting,
    /// Which light shows as white: none (D65, colours as they are), auto (the room's) or a colour temperature, K.
    #[arg(long, value_name = "none|auto|KELVIN", default_value_t)]
    pub white_balance: WhiteBalance,
}

impl Showing {
    /// The exposure of a room, metered through its cameras.
    pub(super) fn of(
        self,
        scene: &Scene,
        surfaces: &[BakedSurface],
        cameras: &[Camera],
    ) -> Exposure {
        Exposure::metered(scene, surfaces, cameras, self.exposure, self.white_balance)
    }
}

/// What is written for each vertex, and how.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
#[non_exhaustive]
pub struct Storing {
    /// Keep the tristimulus radiosity of every vertex in the baked room, as the attribute _XYZ: lm/m2, not clipped.
    #[arg(long)]
    pub xyz: bool,
    /// How the baked room's numbers are stored: none (floats), quantize (8 and 16 bits, KHR_mesh_quantization) or meshopt
    /// (these, packed: EXT_meshopt_compression).
    #[arg(long, value_name = "HOW", default_value_t)]
    pub compress: Packing,
}

impl Storing {
    pub(super) fn writing(self) -> Writing {
        Writing {
            xyz: self.xyz,
            packing: self.compress,
        }
    }
}

/// A range of wavelengths, typed as `380..780`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WavelengthRange {
    /// First and last wavelength, nm.
    pub nm: [f64; 2],
}

impl Default for WavelengthRange {
    fn default() -> Self {
        let grid = Grid::default();
        Self {
            nm: [grid.start(), grid.end()],
        }
    }
}

impl WavelengthRange {
    /// The 64 bands on this range.
    pub fn grid(self) -> Grid {
        Grid::new(self.nm[0], self.nm[1])
    }
}

impl FromStr for WavelengthRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let ends = text
            .split_once("..")
            .and_then(|(from, to)| Some([from.trim().parse().ok()?, to.trim().parse().ok()?]));
        let Some([from, to]) = ends else {
            return Err("a range of wavelengths looks like 380..780".into());
        };
        let [least, most] = KNOWN_NM;
        let widest = BANDS as f64 * LEAST_LEAF_NM;
        // Written so that NaN fails.
        if !(from >= least && to <= most && to - from >= widest) {
            return Err(format!(
                "wavelengths lie in {least}..{most} nm, and 64 bands of 1 nm or more need {widest} nm"
            ));
        }
        Ok(Self { nm: [from, to] })
    }
}

/// A finite number above zero.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("a number above zero is wanted".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_checked() {
        let range: WavelengthRange = "380..700".parse().unwrap();
        assert_eq!(range.grid(), Grid::paper());
        assert_eq!(WavelengthRange::default().grid(), Grid::default());
        assert!("300..780".parse::<WavelengthRange>().is_ok());
        for bad in [
            "380", "380-780", "780..380", "NaN..780", "290..780", "380..400", "a..b",
        ] {
            assert!(bad.parse::<WavelengthRange>().is_err(), "{bad}");
        }
    }

    #[test]
    fn only_numbers_above_zero_are_positive() {
        assert_eq!(positive("0.5"), Ok(0.5));
        for bad in ["0", "-1", "NaN", "inf", "x"] {
            assert!(positive(bad).is_err(), "{bad}");
        }
    }
}
