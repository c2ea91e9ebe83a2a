//! The baked room as one GLB: the input document with its meshes replaced by the refined ones, light in COLOR_0.
//!
//! COLOR_0 = curve(exposure * light * vertex paint), linear sRGB, confined to [0, 1] as glTF 2.0 (section 3.7.2.1) asks
//! by the curve of [`curve`](super::curve), which leaves alone what is below .8 of white;
//! with KHR_materials_unlit a viewer shows COLOR_0 * base colour texture, which is the radiosity.
//! `_XYZ`, if it is asked for, holds the unclipped truth: tristimulus radiosity, Y in lm/m2.
//! What the bake does not touch (names, nodes, cameras, lights, animations, extras, unknown extensions) is kept.
//! Not kept: skins and morph targets of baked meshes (the light belongs to one pose), material variants of baked
//! primitives, instance attributes other than the transform.

mod accessor;
mod asset;
mod attributes;
mod budget;
mod buffer;
mod image;
mod json;
mod keep;
mod layers;
mod maps;
mod material;
mod meshes;
mod packing;
mod writer;

pub use asset::{BakedGlb, EXTRAS_VERSION};
pub use attributes::color_0;
pub use budget::vertices_within;
pub use packing::Packing;
pub use writer::{MapPart, Writing};

use super::Exposure;
use crate::error::Result;
use crate::gather::BakedSurface;
use crate::gather::refined;
use crate::lightmap::LightMaps;
use crate::scene::Scene;
use crate::scene::buffers::Buffers;
use writer::Writer;

/// Writes the room with its light: see the module's words.
///
/// Equal input gives equal bytes.
///
/// # Errors
/// The refined mesh is broken (internal fault), an instance transform cannot be read, or the result passes 4 GiB.
pub fn baked_glb(
    scene: &Scene,
    surfaces: &[BakedSurface],
    look: &Exposure,
    writing: Writing,
) -> Result<BakedGlb> {
    written(scene, surfaces, None, look, writing)
}

/// Writes the room's own mesh with its light in maps: see `maps`.
///
/// # Errors
/// As [`baked_glb`].
pub fn mapped_glb(scene: &Scene, maps: &LightMaps, look: &Exposure) -> Result<BakedGlb> {
    let surfaces = &maps.baked.surfaces;
    written(scene, surfaces, Some(maps), look, Writing::default())
}

fn written(
    scene: &Scene,
    surfaces: &[BakedSurface],
    maps: Option<&LightMaps>,
    look: &Exposure,
    writing: Writing,
) -> Result<BakedGlb> {
    refined::check(scene, surfaces)?;
    let buffers = Buffers::sound(scene.source.buffers.clone());
    let mut writer = Writer::new(
        scene,
        surfaces,
        look,
        (writing, layers::scale(scene, surfaces, look)),
        &buffers,
    );
    writer.raw_views();
    writer.images();
    maps.map_or(Ok(()), |maps| writer.pages(maps))?;
    writer.meshes()?;
    writer.animations();
    writer.other_accessors();
    writer.extensions();
    writer.asset();
    writer.finish()
}

/// The surfaces that are written, in the order in which the file's meshes and their primitives have them.
pub fn order(scene: &Scene, surfaces: &[BakedSurface]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..surfaces.len())
        .filter(|&k| !surfaces[k].triangles.is_empty())
        .collect();
    order.sort_by_key(|&k| {
        let surface = &scene.surfaces[surfaces[k].surface];
        (surface.node, surface.instance, surface.primitive)
    });
    order
}
