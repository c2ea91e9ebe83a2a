//! What the program writes: the baked room, pictures, arrays.

pub mod balance;
pub mod camera;
pub mod curve;
pub mod exposure;
pub mod exr;
pub mod gltf;
mod lit_space;
pub mod maps;
pub mod npz;
mod outside;
pub mod picture;
pub mod probes;
mod raster;
mod viewpoint;

pub use balance::Balance;
pub use exposure::{Brightness, Exposure};
pub use gltf::{BakedGlb, Packing, Writing, baked_glb, mapped_glb, vertices_within};
pub use picture::{Format, Picture};
