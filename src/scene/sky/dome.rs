//! The sky of a room.

use super::cie::Distribution;
use glam::DVec3;

/// Radius of the sun's disc, radians: .53 degrees across.
pub const SUN_RADIUS: f64 = 0.5 * 0.53 * std::f64::consts::PI / 180.0;

/// The sky of a room.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Sky {
    /// How its light is spread.
    pub dome: Distribution,
    /// In words, for plans and logs.
    pub said: String,
    /// The same of the sun; none where no direct light of it is asked for.
    pub sun_said: Option<String>,
    /// Is the sun a light of the file?
    pub sun_of_file: bool,
}

impl Sky {
    /// Radiance from a direction that looks up, where open level ground has an irradiance of 1.
    #[inline]
    pub fn radiance(&self, direction: DVec3) -> f64 {
        self.dome.radiance(direction)
    }
}
