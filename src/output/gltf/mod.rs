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
mod attributes;
mod budget;
mod buffer;
mod image;
mod keep;
mod layers;
mod maps;
mod material;
mod meshes;
mod packing;

use super::Exposure;
use crate::error::{Error, Result};
use crate::gather::BakedSurface;
use crate::gather::refined;
use crate::lightmap::LightMaps;
use crate::scene::Scene;
use crate::scene::buffers::Buffers;
use accessor::Data;
pub use attributes::color_0;
pub use budget::vertices_within;
use buffer::Bin;
use glam::DVec3;
pub use maps::MapPart;
use packing::Grid;
pub use packing::Packing;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Version of `asset.extras.haarlight`.
pub const EXTRAS_VERSION: u32 = 2;

/// How far backs of two-sided sheets are drawn from the fronts, share of half the room's diagonal: 512 steps of f32 there,
/// .15 mm in a room of 10 m, so that rays in single precision meet the right one.
const APART: f64 = 512.0 * 0.5 * f32::EPSILON as f64;

/// What is written, and how.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Writing {
    /// Is the tristimulus radiosity of vertices kept, as `_XYZ`?
    pub xyz: bool,
    /// How numbers are stored.
    pub packing: Packing,
}

/// A written room and what is to be said about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BakedGlb {
    /// The file.
    pub bytes: Vec<u8>,
    /// Vertices written with light.
    pub vertices: usize,
    /// Triangles written with light.
    pub triangles: usize,
    /// Vertices that were beyond white or outside of sRGB before the curve (lamps, spots beside them).
    pub clipped: usize,
    /// Vertices that the curve made darker, those beyond white among them.
    pub compressed: usize,
    /// What could not be carried over.
    pub warnings: Vec<String>,
    /// Primitives with light maps.
    pub parts: Vec<MapPart>,
}

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
    let mut writer = Writer::new(scene, surfaces, look, writing, &buffers);
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

/// The refined meshes of a mesh's primitives.
type Primitives<'a> = BTreeMap<usize, Vec<&'a BakedSurface>>;

/// The document under construction.
struct Writer<'a> {
    scene: &'a Scene,
    look: &'a Exposure,
    writing: Writing,
    /// Distance of backs from their fronts, world units.
    apart: f64,
    /// What colour sets of layers are multiplied by.
    layer_scale: f64,
    /// What positions of the mesh at hand are rounded to; none: they are floats.
    grid: Option<Grid>,
    /// The refined meshes by (node, instance), then primitive.
    baked: BTreeMap<(usize, Option<usize>), Primitives<'a>>,
    data: Data<'a>,
    /// The new document; its accessors and buffer views are in `bin` until the end.
    json: Map<String, Value>,
    bin: Bin,
    /// Old accessor to new one, for what is carried over.
    accessors: BTreeMap<usize, usize>,
    materials: material::Unlit,
    maps: maps::Maps,
    /// Does a kept primitive have vertices that need KHR_mesh_quantization?
    quantized: bool,
    vertices: usize,
    triangles: usize,
    clipped: usize,
    compressed: usize,
    warnings: Vec<String>,
}

impl<'a> Writer<'a> {
    fn new(
        scene: &'a Scene,
        surfaces: &'a [BakedSurface],
        look: &'a Exposure,
        writing: Writing,
        buffers: &'a Buffers,
    ) -> Self {
        let mut baked: BTreeMap<_, Primitives> = BTreeMap::new();
        for refined in surfaces.iter().filter(|s| !s.triangles.is_empty()) {
            let surface = &scene.surfaces[refined.surface];
            let place = baked.entry((surface.node, surface.instance)).or_default();
            place.entry(surface.primitive).or_default().push(refined);
        }
        let places = || scene.surfaces.iter().flat_map(|s| &s.positions);
        let low = places().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let high = places().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        // On a grid of 65,536 steps a lift of one may round to none.
        let steps = if writing.packing == Packing::Floats {
            1.0
        } else {
            4.0
        };
        Self {
            scene,
            look,
            writing,
            apart: steps * APART * 0.5 * (high - low).max(DVec3::ZERO).length(),
            layer_scale: layers::scale(scene, surfaces, look),
            grid: None,
            baked,
            data: Data::new(&scene.source, buffers),
            json: scene.source.json.as_object().cloned().unwrap_or_default(),
            bin: Bin::new(writing.packing),
            accessors: BTreeMap::new(),
            materials: material::Unlit::default(),
            maps: maps::Maps::default(),
            quantized: false,
            vertices: 0,
            triangles: 0,
            clipped: 0,
            compressed: 0,
            warnings: Vec::new(),
        }
    }

    /// What the file says about itself.
    fn asset(&mut self) {
        let mut facts = json!({
            "version": EXTRAS_VERSION,
            "program": concat!("haarlight ", env!("CARGO_PKG_VERSION")),
            "exposure": {
                "scale": self.look.scale,
                "ev100": self.look.ev(),
                "white_luminance_cd_m2": self.look.white_luminance(),
                "white_balance": self.look.balance,
            },
            "attributes": {
                "COLOR_0": "linear sRGB, radiosity over base colour texture, times exposure.white_balance and exposure.scale; a strongest channel p above 0.8 is brought to 1 - 0.04 / (p - 0.6) and the colour mixed with white",
            },
            "clipped_vertices": self.clipped,
            "compressed_vertices": self.compressed,
        });
        if let Some(intensity) = self.maps.intensity() {
            facts["attributes"] = json!({
                "MOZ_lightmap": "linear; texel * intensity / pi * base colour * texture * vertex colour = exposed radiosity, ends at 1",
                "emissiveTexture": "sRGB; the same over the texture and vertex colours, as COLOR_0 would show it: for readers without KHR_materials_unlit",
            });
            facts["intensity"] = json!(intensity);
        }
        if let Some(layers) = self.layer_facts() {
            let what = "linear sRGB, light of one layer: COLOR_0 = curve(layers.scale * sum), the curve as above";
            facts["attributes"]["COLOR_1, ..."] = json!(what);
            facts["layers"] = layers;
        }
        if self.writing.xyz {
            let what = "CIE 1931 tristimulus radiosity, lm/m2, not clipped";
            facts["attributes"]["_XYZ"] = json!(what);
        }
        let asset = self.json.entry("asset").or_insert_with(|| json!({}));
        let Some(asset) = asset.as_object_mut() else {
            return;
        };
        asset.entry("version").or_insert_with(|| json!("2.0"));
        asset
            .entry("generator")
            .or_insert_with(|| json!(concat!("haarlight ", env!("CARGO_PKG_VERSION"))));
        match asset.get_mut("extras") {
            Some(Value::Object(extras)) => {
                extras.insert("haarlight".into(), facts);
            }
            // Extras may be anything; what is not an object moves aside.
            Some(other) => *other = json!({ "haarlight": facts, "original": other.take() }),
            None => {
                asset.insert("extras".into(), json!({ "haarlight": facts }));
            }
        }
    }

    fn finish(mut self) -> Result<BakedGlb> {
        let (bytes, buffers, views, accessors) = self.bin.finish()?;
        let lists = [
            ("buffers", buffers),
            ("bufferViews", views),
            ("accessors", accessors),
        ];
        for (key, list) in lists {
            put_list(&mut self.json, key, list);
        }
        for name in self.bin.extensions() {
            for key in ["extensionsUsed", "extensionsRequired"] {
                let mut names = list(&Value::Object(self.json.clone()), key).to_vec();
                if !names.iter().any(|n| n == name) {
                    names.push(json!(name));
                    put_list(&mut self.json, key, names);
                }
            }
        }
        let json = serde_json::to_vec(&Value::Object(self.json))
            .map_err(|problem| Error::Internal(format!("glTF JSON: {problem}")))?;
        Ok(BakedGlb {
            bytes: container(json, bytes)?,
            vertices: self.vertices,
            triangles: self.triangles,
            clipped: self.clipped,
            compressed: self.compressed,
            warnings: self.warnings,
            parts: self.maps.parts,
        })
    }
}

/// glTF forbids empty lists: they are left out.
fn put_list(json: &mut Map<String, Value>, key: &str, list: Vec<Value>) {
    if list.is_empty() {
        json.shift_remove(key);
    } else {
        json.insert(key.into(), Value::Array(list));
    }
}

/// The elements of a top-level list, or none.
fn list<'j>(json: &'j Value, key: &str) -> &'j [Value] {
    json.get(key)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

/// A non-negative integer field.
fn index(json: &Value, key: &str) -> Option<usize> {
    json.get(key)
        .and_then(Value::as_u64)
        .and_then(|i| usize::try_from(i).ok())
}

/// An extension's object.
fn extension<'j>(json: &'j Value, name: &str) -> Option<&'j Value> {
    json.get("extensions").and_then(|e| e.get(name))
}

/// Takes an extension (or other key below `key`) away, and the holder with it when that was the last.
fn remove_below(json: &mut Value, key: &str, name: &str) {
    let Some(object) = json.as_object_mut() else {
        return;
    };
    let Some(holder) = object.get_mut(key).and_then(Value::as_object_mut) else {
        return;
    };
    holder.shift_remove(name);
    if holder.is_empty() {
        object.shift_remove(key);
    }
}

/// GLB container (glTF 2.0, section 4.4): header, JSON chunk padded with spaces, BIN chunk padded with zeros.
fn container(mut json: Vec<u8>, mut bin: Vec<u8>) -> Result<Vec<u8>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let bin_chunk = if bin.is_empty() { 0 } else { 8 + bin.len() };
    let length = 12 + 8 + json.len() + bin_chunk;
    let Ok(total) = u32::try_from(length) else {
        return Err(Error::input(
            "output",
            format!("the baked room takes {length} bytes and a GLB holds at most 4 GiB"),
            "ask for a larger --error",
        ));
    };
    // Chunks are shorter than the whole, so they fit as well.
    let size = |chunk: &[u8]| (chunk.len() as u32).to_le_bytes();
    let mut out = Vec::with_capacity(length);
    out.extend(b"glTF");
    out.extend(2u32.to_le_bytes());
    out.extend(total.to_le_bytes());
    out.extend(size(&json));
    out.extend(b"JSON");
    out.extend(&json);
    if !bin.is_empty() {
        out.extend(size(&bin));
        out.extend(b"BIN\0");
        out.extend(&bin);
    }
    Ok(out)
}
