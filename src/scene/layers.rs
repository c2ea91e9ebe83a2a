//! Layers: the lamps of a room in groups whose light is told apart, so that an engine can switch and dim them.
//!
//! Rows hold the light of each light spectrum by itself (see `light::lanes`). A layer is a set of light spectra: lamps of
//! one spectrum in two groups get a copy of it each. Nothing else of the program need know of layers, and what they hold
//! adds up to the whole, for it is the same sum of lanes, taken in parts.
//!
//! The side file says which lamps go together:
//!
//! ```json
//! { "layers": { "ceiling": ["panel"], "desk": ["Desk lamp", "bulb"], "day": ["sky", "sun"] } }
//! ```
//!
//! A lamp goes by the name of its light or material, by that of its node or of any node above it; the sky, with the
//! ground below it, is `sky`, the sun, with the ground that it lights, is `sun`. The first layer that names it has it. What
//! no layer names is a layer of its own: a light by the name of its node, surfaces by that of their material.

/// Layers at the most, those of several light spectra counted by these: rows have 64 lanes, and with fewer than 4 wavelength
/// intervals a layer reflected colours are off by several dE (tertiary reflections: a mean of 1.7 dE*uv with 4, see `spectrum`).
pub const MOST_LAYERS: usize = 16;

/// A layer that is wished for: its name, and those of its lamps.
pub(crate) type LayerWish = (String, Vec<String>);

/// The groups of lamps of a room, and what they are of its spectra.
#[derive(Debug, Clone, PartialEq)]
pub struct Layers {
    /// Name of each layer.
    pub names: Vec<String>,
    /// Layer of each of [`Scene::spectra`](crate::scene::Scene::spectra).
    pub of_light: Vec<usize>,
    /// For each of [`Scene::spectra`](crate::scene::Scene::spectra) the number of the spectrum that it is a copy of; copies of one have one number.
    pub kin: Vec<usize>,
}
