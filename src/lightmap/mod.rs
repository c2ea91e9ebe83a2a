//! The light in maps: pages of texels instead of vertices, for engines that want the room's own mesh.
//!
//! Every side of every surface is cut into charts, the charts get texels where the light needs them, and the file's error is that of
//! a bilinear look-up, measured. Charts are flat where the surface is, else `unwrap` flattens them.

mod aliasing;
mod bake;
mod cells;
mod charts;
mod finder;
mod grow;
mod hinges;
mod layers;
mod maps;
mod measure;
mod pack;
mod regions;
mod sampler;
mod seams;
mod texels;
mod unwrap;
mod worth;

pub use bake::MapLimits;
pub use maps::{LightMaps, MapPage};
pub use texels::Texel;
