//! What is outside, as typed.

use crate::scene::sky::{
    BRIGHT, KELVIN, SUN_KELVIN, SkyBrightness, SkyName, SkyWish, SunPlace, SunWish, TURN,
};

/// Options of sky and sun. Each wins over what the file of spectra says.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "Sky and sun")]
#[non_exhaustive]
pub struct SkyArgs {
    /// Light that enters where rays leave the room: overcast, intermediate, clear, uniform, or cie:1 to cie:16 (ISO 15469); hosek or
    /// hosek:TURBIDITY, 1 to 10 (Hosek and Wilkie 2012: colours and brightness from the sun's height, turbidity [default: 3] and --ground); or an
    /// equirectangular map of all directions, .hdr or .exr, its middle toward +X.
    #[arg(long = "sky", value_name = "TYPE|MAP")]
    pub name: Option<SkyName>,
    /// Where the sun stands, degrees: its height and its azimuth from north (-Z) over east (+X); or the place and time that it
    /// is seen from, as in 52.5,13.4,2026-06-21T12:00:00+02:00; none: no sun, nor parallel light of the file.
    #[arg(
        long,
        value_name = "ELEVATION,AZIMUTH|LATITUDE,LONGITUDE,TIME|none",
        allow_hyphen_values = true
    )]
    pub sun: Option<SunPlace>,
    /// Illuminance of open level ground by the sky alone, lx [default: by type and height of the sun].
    #[arg(long, value_name = "LX", value_parser = not_negative, conflicts_with = "sky_luminance")]
    pub sky_lux: Option<f64>,
    /// Luminance of the zenith, cd/m2; of a map, that of its white [default of a map: 1].
    #[arg(long, value_name = "CD_M2", value_parser = not_negative)]
    pub sky_luminance: Option<f64>,
    /// Correlated colour temperature of the sky, K: of the zenith where the next two say more [default: overcast 6504,
    /// intermediate 7500, clear 12000].
    #[arg(long, value_name = "K", value_parser = kelvin)]
    pub sky_cct: Option<f64>,
    /// The same at the horizon [default: as the zenith].
    #[arg(long, value_name = "K", value_parser = kelvin)]
    pub horizon_cct: Option<f64>,
    /// The same about the sun [default: as elsewhere].
    #[arg(long, value_name = "K", value_parser = kelvin)]
    pub sunward_cct: Option<f64>,
    /// Illuminance of a plane across the sun's rays, lx; 0: the sky alone [default: by type and height of the sun].
    #[arg(long, value_name = "LX", value_parser = not_negative)]
    pub sun_lux: Option<f64>,
    /// Correlated colour temperature of the sun, K; below 4000 that of a blackbody [default: 5500].
    #[arg(long, value_name = "K", value_parser = sun_kelvin)]
    pub sun_cct: Option<f64>,
    /// Reflectance of open ground below the horizon [default: 0.2, under a map what it shows there].
    #[arg(long, value_name = "RHO", value_parser = share)]
    pub ground: Option<f64>,
    /// Where north is, degrees clockwise from -Z seen from above [default: 0].
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, value_parser = turn)]
    pub north: Option<f64>,
}

impl SkyArgs {
    /// What is meant.
    pub(super) fn wish(&self) -> SkyWish {
        let lux = self.sky_lux.map(SkyBrightness::Illuminance);
        let (kind, turbidity, map) = match &self.name {
            Some(SkyName::Type(kind)) => (Some(*kind), None, None),
            Some(SkyName::Hosek(turbidity)) => (None, Some(*turbidity), None),
            Some(SkyName::Map(path)) => (None, None, Some(path.clone())),
            None => (None, None, None),
        };
        SkyWish {
            kind,
            turbidity,
            map,
            brightness: lux.or(self.sky_luminance.map(SkyBrightness::Luminance)),
            kelvin: self.sky_cct,
            horizon_kelvin: self.horizon_cct,
            sunward_kelvin: self.sunward_cct,
            ground: self.ground,
            north: self.north,
            sun: SunWish {
                place: self.sun.clone(),
                illuminance: self.sun_lux,
                kelvin: self.sun_cct,
            },
        }
    }
}

fn within(text: &str, [least, most]: [f64; 2]) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        _ => Err(format!("a number from {least} to {most} is wanted")),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    within(text, BRIGHT)
}

fn turn(text: &str) -> Result<f64, String> {
    within(text, TURN)
}

fn kelvin(text: &str) -> Result<f64, String> {
    within(text, KELVIN)
}

fn sun_kelvin(text: &str) -> Result<f64, String> {
    within(text, SUN_KELVIN)
}

fn share(text: &str) -> Result<f64, String> {
    within(text, [0.0, 1.0])
}
