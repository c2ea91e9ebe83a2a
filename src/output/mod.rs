//! What the program writes: the baked room, pictures, arrays; and how a file is put in place.

pub mod camera;
pub mod exposure;
pub mod exr;
pub mod file;
pub mod gltf;
pub mod npz;
pub mod picture;
mod raster;
pub mod refined;

pub use exposure::Exposure;
pub use gltf::{BakedGlb, baked_glb};
pub use picture::{Format, Picture};
