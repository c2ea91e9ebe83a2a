//! A room in memory.

use super::layers::{LayerWish, Layers};
use super::sky::Sky;
use super::{Camera, Image, LightSpectrum, Material, PunctualLight, Sides, Source, Surface};
use crate::data::Grid;
use std::collections::BTreeSet;

/// A room, read and checked.
///
/// Positions are in metres (the file's units, times the scale that was asked for), world space, right-handed, +Y up.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The document as read: written back by the output with the light added.
    pub source: Source,
    /// The wavelength grid that every spectrum here is sampled on.
    pub grid: Grid,
    /// One entry for each drawn primitive at each node (and each instance of it).
    pub surfaces: Vec<Surface>,
    /// The same for what lets light straight through: filters on rays, that neither block nor receive.
    pub panes: Vec<Surface>,
    /// Materials; `Surface::material` points in here.
    pub materials: Vec<Material>,
    /// Two-sided surfaces that are the skins of solids: their backs see only the dark inside, and take no part.
    pub solids: BTreeSet<usize>,
    /// Decoded images that some paint, emission or alpha mask uses.
    pub images: Vec<Image>,
    /// The distinct light spectra ("lamps by colour"); emissions and lights point in here.
    pub spectra: Vec<LightSpectrum>,
    /// Punctual lights; those of a sky stand last.
    pub lights: Vec<PunctualLight>,
    /// The sky, if one is described: how the light of [`LightKind::Sky`](super::LightKind::Sky) is spread.
    pub sky: Option<Sky>,
    /// Cameras of the file.
    pub cameras: Vec<Camera>,
    /// What the user should know: nothing is dropped in silence.
    pub warnings: Vec<String>,
    /// What was changed since it was read.
    pub changes: Changes,
}

impl Scene {
    /// The sides of a surface that take part: those of its material, but for solids.
    ///
    /// # Panics
    /// If there is no such surface.
    pub fn sides(&self, surface: usize) -> Sides {
        match self.solids.contains(&surface) {
            true => Sides::Front,
            false => self.materials[self.surfaces[surface].material].sides,
        }
    }
}

/// What was changed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Changes {
    /// Metres for each unit of the file, as the user says.
    pub scale: f64,
    /// Surfaces whose faces were turned.
    pub flipped: BTreeSet<usize>,
    /// The lamps in groups, if they were parted.
    pub layers: Option<Layers>,
    /// Which groups the side file asks for.
    pub(crate) layers_wished: Vec<LayerWish>,
}

impl Default for Changes {
    fn default() -> Self {
        Self {
            scale: 1.0,
            flipped: BTreeSet::new(),
            layers: None,
            layers_wished: Vec::new(),
        }
    }
}
