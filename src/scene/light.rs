//! Lights: the spectra that lamps share, and lights without extent.

use super::luminaires::Luminaire;
use super::sky::PARTS;
use crate::data::Spectrum;
use glam::DVec3;
use std::sync::Arc;

/// A spectrum that lamps share. Lamps given by colour share D65 and differ by `shape`.
#[derive(Debug, Clone, PartialEq)]
pub struct LightSpectrum {
    /// `cie/F2`, `blackbody/2700`, a file name ...
    pub name: String,
    /// Relative power per nm on the grid's bands.
    pub power: Spectrum,
}

/// A light without extent, or one of a sky. Radiant intensity in W/sr/nm (point, spot), irradiance in W/m2/nm across its rays
/// (directional, sun) or of open level ground (sky), exitance in W/m2/nm (ground), radiant flux in W/nm (profile, surface).
#[derive(Debug, Clone)]
pub struct PunctualLight {
    /// For messages.
    pub name: String,
    /// Kind and its parameters.
    pub kind: LightKind,
    /// Index of its node in the document; none for lights of a sky and those of surfaces.
    pub node: Option<usize>,
    /// World position.
    pub position: DVec3,
    /// World direction in which it shines, unit length.
    pub direction: DVec3,
    /// Index in [`Scene::spectra`](crate::scene::Scene::spectra).
    pub light: usize,
    /// `intensity(band) = spectra[light].power[band] * shape[band]`.
    pub shape: Spectrum,
    /// How its light is spread, and from where: of the kinds that say so, and of no other.
    pub luminaire: Option<Arc<Luminaire>>,
}

/// Kinds of KHR_lights_punctual, measured lamps, and those of a sky.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LightKind {
    /// Shines alike in all directions.
    Point,
    /// A cone: full inside `inner`, zero outside `outer`, (half angles, radians), glTF's smooth fall-off between.
    Spot {
        /// Half angle of full intensity.
        inner: f64,
        /// Half angle where the light ends.
        outer: f64,
    },
    /// Parallel light.
    Directional,
    /// Shines from a point as its [profile](PunctualLight::luminaire) says.
    Profile,
    /// Shines from a surface as its profile says: a lamp with an extent.
    Surface,
    /// The sun: light from a disc of [`SUN_RADIUS`](super::sky::SUN_RADIUS), infinitely far away.
    Sun,
    /// The sky above the horizon, spread as this part of [`Scene::sky`](super::Scene::sky) says.
    Sky(u8),
    /// What lies below the horizon, open ground alike in all directions or spread as this part says.
    Ground(u8),
}

impl LightKind {
    /// Does it shine from far away, from one direction?
    pub fn is_parallel(self) -> bool {
        matches!(self, Self::Directional | Self::Sun)
    }

    /// Does it shine from half of all directions?
    pub fn is_dome(self) -> bool {
        self.place().is_some()
    }

    /// Of a spot, the share of its full intensity at a cosine to its axis: the fall-off that KHR_lights_punctual gives, smooth between the
    /// cosines of both angles. Its .001 as the least width, which is there so that nothing is divided by 0, would leave a cone of 1
    /// degree .1 % of its candela. 1 of all others.
    pub fn fall_off(self, along: f64) -> f64 {
        let Self::Spot { inner, outer } = self else {
            return 1.0;
        };
        let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-12);
        ((along - outer.cos()) * scale).clamp(0.0, 1.0).powi(2)
    }

    /// Of sky and ground, their place among the parts of a [`Sky`](super::sky::Sky).
    pub fn place(self) -> Option<usize> {
        match self {
            Self::Sky(part) => Some(usize::from(part)),
            Self::Ground(part) => Some(PARTS + usize::from(part)),
            _ => None,
        }
    }
}
