//! What the program writes: the baked room, pictures, arrays.

pub mod camera;
pub mod exposure;
pub mod exr;
pub mod gltf;
pub mod npz;
pub mod picture;
mod raster;

pub use exposure::Exposure;
pub use gltf::{BakedGlb, baked_glb};
pub use picture::{Format, Picture};
