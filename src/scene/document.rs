//! A glTF document, opened: container, JSON and buffers read and checked, materials and lights typed.

use crate::scene::Source;
pub use crate::scene::raw::{AlphaMode, RawLight, RawLightKind, RawMaterial};

/// A document: everything read, nothing yet turned into geometry.
#[derive(Debug)]
pub struct Document {
    /// The JSON and the buffers.
    pub source: Source,
    materials: Vec<RawMaterial>,
    lights: Vec<RawLight>,
}

impl Document {
    /// Materials in the document's order; after them glTF's default material if some primitive names none.
    /// `Surface::material` is an index in this list.
    pub fn raw_materials(&self) -> &[RawMaterial] {
        &self.materials
    }

    /// The punctual lights of the scene, one entry for each node that carries one, in order of the node walk.
    pub fn raw_lights(&self) -> &[RawLight] {
        &self.lights
    }
}
