//! Materials and punctual lights as the document gives them, typed and with the defaults of the standards filled in
//! (glTF 2.0 section 3.9, KHR_lights_punctual, KHR_materials_emissive_strength, KHR_materials_unlit).
//!
//! Units are glTF's: emissive strength in nits, point and spot in candela, directional in lux. What they mean as
//! spectra is decided elsewhere.

use crate::scene::Texture;
use glam::DMat4;
use serde_json::Value;

/// A material, before spectra.
#[derive(Debug, Clone)]
pub struct RawMaterial {
    /// Index in the document; none for glTF's default material.
    pub index: Option<usize>,
    /// Its name; empty if it has none.
    pub name: String,
    /// Linear, each in [0, 1].
    pub base_color_factor: [f32; 4],
    /// Multiplies the base colour.
    pub base_color_texture: Option<Texture>,
    /// In [0, 1].
    pub metallic: f32,
    /// Linear, each in [0, 1].
    pub emissive_factor: [f32; 3],
    /// Nits at emissive factor 1; 1 without KHR_materials_emissive_strength.
    pub emissive_strength: f32,
    /// Multiplies the emissive factor.
    pub emissive_texture: Option<Texture>,
    /// How alpha is meant.
    pub alpha_mode: AlphaMode,
    /// Threshold of [`AlphaMode::Mask`].
    pub alpha_cutoff: f32,
    /// Does the back count too?
    pub double_sided: bool,
    /// KHR_materials_unlit is there.
    pub unlit: bool,
    /// The material's extras.
    pub extras: Option<Value>,
    /// Names of all extensions on the material, sorted.
    pub extensions: Vec<String>,
}

impl Default for RawMaterial {
    /// The material of a primitive that names none.
    fn default() -> Self {
        Self {
            index: None,
            name: String::new(),
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic: 1.0,
            emissive_factor: [0.0; 3],
            emissive_strength: 1.0,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            alpha_cutoff: 0.5,
            double_sided: false,
            unlit: false,
            extras: None,
            extensions: Vec::new(),
        }
    }
}

/// `alphaMode` of a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AlphaMode {
    /// Alpha is not looked at.
    Opaque,
    /// Below the cutoff is a hole.
    Mask,
    /// Alpha is coverage.
    Blend,
}

/// A punctual light at a node, before spectra.
#[derive(Debug, Clone)]
pub struct RawLight {
    /// The light's name, or the node's if it has none.
    pub name: String,
    /// Kind of light.
    pub kind: RawLightKind,
    /// Linear, each in [0, 1].
    pub color: [f32; 3],
    /// Candela (point, spot) or lux (directional).
    pub intensity: f32,
    /// Distance beyond which it gives nothing, in the file's units; none: endless.
    pub range: Option<f32>,
    /// Half angle of full intensity, radians (spot).
    pub inner: f32,
    /// Half angle where the light ends, radians, greater than `inner` (spot).
    pub outer: f32,
    /// The light's extras.
    pub extras: Option<Value>,
    /// Index of the node in the document.
    pub node: usize,
    /// Node to world; the light shines along -Z of its own space.
    pub to_world: DMat4,
}

/// `type` of a punctual light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RawLightKind {
    /// Alike in all directions.
    Point,
    /// A cone.
    Spot,
    /// Parallel.
    Directional,
}
