//! The sky over a room and the sun in it.
//!
//! | file | what |
//! |---|---|
//! | `cie` | how luminance lies over the dome: ISO 15469 |
//! | `sun` | where the sun stands |
//! | `wish` | what a side file or a command line says of sky and sun |
//! | `lamps` | the lamps that this makes: sky, ground below the horizon, sun |
//!
//! Up is +Y, as glTF has it; north is -Z, so that east is +X, unless `north_deg` says otherwise. Azimuths run clockwise seen
//! from above: from north over east.
//!
//! The sky stands in [`Scene::lights`](super::Scene::lights) like other lamps, of kinds that say how its light arrives. Its
//! shape there is the illuminance of open level ground in lux; [`Sky`] says how that is spread over the dome. Rays that leave the
//! room downwards meet open ground, lit by sky and sun and reflecting alike in all directions and wavelengths.

mod cie;
pub(super) mod lamps;
mod sun;
mod wish;

pub use cie::Distribution;
pub(crate) use lamps::join;
pub use sun::{Hours, direction};
pub use wish::{BRIGHT, KELVIN, TURN};
pub use wish::{Brightness, SkyType, SkyWish, SunPlace, SunWish};

use super::check::Check;
use super::{LightKind, Scene};
use crate::error::{Error, Result};
use glam::DVec3;

/// Radius of the sun's disc, radians: .53 degrees across.
pub const SUN_RADIUS: f64 = 0.5 * 0.53 * std::f64::consts::PI / 180.0;

/// The sky of a room.
#[derive(Debug, Clone)]
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

impl Scene {
    /// The same room under a sky, instead of the one it had; names of nodes are not known here, those of lights are.
    ///
    /// # Errors
    /// [`Error::Input`]: what is said of sky and sun does not go together.
    pub fn under(mut self, wish: &SkyWish) -> Result<Self> {
        self.shut_out_sky();
        let mut check = Check::new(self.source.path.display().to_string());
        let (lights, spectra) = (&mut self.lights, &mut self.spectra);
        let sky = join(wish, &[], &self.grid, lights, spectra, &mut check);
        let (problems, warnings) = check.into_parts();
        if !problems.is_empty() {
            return Err(Error::Input(problems));
        }
        self.sky = sky;
        self.warnings.extend(warnings);
        Ok(self)
    }

    /// Takes the sky out again, with its sun if that is none of the file's lights: no ray of this room gets there.
    pub(crate) fn shut_out_sky(&mut self) {
        let Some(sky) = self.sky.take() else { return };
        self.lights.retain(|light| {
            !light.kind.is_dome() && (sky.sun_of_file || light.kind != LightKind::Sun)
        });
        // Their spectra stand last.
        while let Some(last) = self.spectra.len().checked_sub(1) {
            let emissions = self.materials.iter().filter_map(|m| m.emission.as_ref());
            let mut used = emissions
                .map(|e| e.light)
                .chain(self.lights.iter().map(|l| l.light));
            if used.any(|light| light == last) {
                break;
            }
            self.spectra.pop();
        }
    }
}
