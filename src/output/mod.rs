//! What the program writes: the baked room, pictures, arrays.

pub mod camera;
pub mod curve;
mod default_view;
pub mod exposure;
pub mod exr;
pub mod gltf;
mod lit_space;
pub mod maps;
pub mod npz;
pub mod picture;
pub mod probes;
mod raster;
mod sky_background;
pub mod white_balance;

pub use exposure::{Exposure, ExposureSetting};
pub use gltf::{BakedGlb, Packing, Writing, baked_glb, mapped_glb, vertices_within};
pub use picture::{Format, Picture};
pub use white_balance::WhiteBalance;
