//! Side files of light maps: irradiance in floats, for programs that keep the room's own materials, and what belongs where.
//!
//! `NAME.map-K.exr` (and `.ktx2`) hold page K: linear sRGB irradiance (Y of the colour is illuminance) in units of `lux_per_unit`, 1
//! unless a number of 16 bits could not hold it. Row 0 is the top: texture coordinates as in glTF. Numbers have 16 bits, with layers 32, so that
//! what is read of these adds up to the whole.
//! `NAME.maps.json` lists the pages and, for each primitive with light, where its light is, see [`Index`].
//!
//! Radiosity is base colour times irradiance, lm/m2; radiance a pi-th of it. three.js shows base colour times texel times
//! `lightMapIntensity` over pi: `pi * exposure * lux_per_unit` shows what the glb shows; its EXR loader begins with the bottom row
//! (`repeat` (1, -1), `offset` (0, 1)). Bevy: `Lightmap { image, uv_rect }` with `lightmap_exposure` = `lux_per_unit / pi`, for it
//! multiplies by the base colour alone.

mod exr;
mod ktx2;

use crate::PROGRAM;
use crate::color::LinearSrgb;
use crate::error::{Error, Result};
use crate::lightmap::{LightMaps, MapPage};
use crate::output::{BakedGlb, Exposure};
use crate::scene::Scene;
pub use exr::to_exr;
pub(super) use ktx2::ktx2;
pub use ktx2::to_ktx2;
use serde::Serialize;
use serde_json::Value;

/// Version of the index.
pub const VERSION: u32 = 1;
/// Greatest number in a page, and least of the brightest: numbers of 16 bits end at 65,504 and lose precision below 6e-5.
const GREATEST: f64 = 32_768.0;
const LEAST: f64 = 1.0;

/// Floats of which pages are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 16 bits.
    Half,
    /// 32 bits.
    Single,
}

impl Precision {
    /// 32 bits where there are layers: halves of two lamps' light were off by 6e-4 of the brightest sum, these are by 1.3e-7.
    pub fn of(maps: &LightMaps) -> Self {
        match maps.layers.is_empty() {
            true => Self::Half,
            false => Self::Single,
        }
    }
}

/// `NAME.maps.json`.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Index {
    /// `haarlight.lightmaps`.
    pub format: &'static str,
    /// [`VERSION`].
    pub version: u32,
    /// Name and version of the program.
    pub program: &'static str,
    /// `irradiance`, or `indirect irradiance` without what comes straight from lamps and the sky.
    pub quantity: &'static str,
    /// Always `linear sRGB`.
    pub colour: &'static str,
    /// Illuminance of a texel of (1, 1, 1), lx.
    pub lux_per_unit: f64,
    /// Display value (1: white) of a radiosity of 1 lm/m2 in the glb.
    pub exposure: f64,
    /// What colours of the pages are multiplied by in the glb for `--white-balance`, row by row; pages are as measured.
    pub white_balance: [[f64; 3]; 3],
    /// Texels around every chart of more than one texel that hold its outermost light.
    pub margin: usize,
    /// The pages.
    pub pages: Vec<PageEntry>,
    /// The same pages for each layer of lamps, which add up to these; none without layers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<LayerEntry>,
    /// Primitives of the glb with light.
    pub meshes: Vec<MeshEntry>,
}

/// A page.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct PageEntry {
    /// Texels.
    pub width: usize,
    /// Texels.
    pub height: usize,
    /// File beside the index.
    pub exr: String,
    /// File beside the index, if it was asked for.
    pub ktx2: Option<String>,
}

/// A layer of lamps.
#[derive(Debug, Clone, Serialize)]
pub struct LayerEntry {
    /// Its name.
    pub name: String,
    /// Its pages, in the order of those of all light.
    pub pages: Vec<PageEntry>,
}

/// A primitive with light. Its place on the page is `uv_rect[0..2] + uv * (uv_rect[2..4] - uv_rect[0..2])`, uv its set `texcoord`.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct MeshEntry {
    /// Node of the glb that shows it.
    pub node: usize,
    /// Name of that node.
    pub name: Option<String>,
    /// Mesh of the glb.
    pub mesh: usize,
    /// Primitive of the mesh.
    pub primitive: usize,
    /// Is it the back of a two-sided surface?
    pub back: bool,
    /// Number of the page.
    pub page: usize,
    /// Set of texture coordinates.
    pub texcoord: usize,
    /// Part of the page that texture coordinates of 0 to 1 stand for: least u and v, greatest u and v.
    pub uv_rect: [f32; 4],
}

/// Illuminance of a texel of 1, lx: a power of two.
pub fn lux_per_unit(maps: &LightMaps) -> f64 {
    let texels = maps.pages.iter().flat_map(|page| &page.texels);
    let brightest = texels.flat_map(|t| rgb(t.irradiance)).fold(0.0, f64::max);
    if brightest == 0.0 || (LEAST..=GREATEST).contains(&brightest) {
        return 1.0;
    }
    (brightest / GREATEST).log2().ceil().exp2()
}

/// Linear sRGB of tristimulus values.
fn rgb(xyz: [f32; 3]) -> [f64; 3] {
    LinearSrgb::standard().from_xyz(xyz.map(f64::from))
}

/// Texels in linear sRGB, in units.
fn texels(page: &MapPage, lux_per_unit: f64) -> Vec<[f32; 3]> {
    let srgb = LinearSrgb::standard();
    let texel = |t: &crate::lightmap::Texel| {
        srgb.from_xyz(t.irradiance.map(f64::from))
            .map(|c| (c / lux_per_unit) as f32)
    };
    page.texels.iter().map(texel).collect()
}

/// What belongs where; `name(page, layer, ending)` is the name of a page's file; layer none: all light.
///
/// # Errors
/// The glb cannot be read back (internal fault).
pub fn index(
    scene: &Scene,
    maps: &LightMaps,
    glb: &BakedGlb,
    look: &Exposure,
    ktx2: bool,
    name: &dyn Fn(usize, Option<usize>, &str) -> String,
) -> Result<Index> {
    let json = document(glb)?;
    let nodes = json["nodes"].as_array().map_or(&[][..], Vec::as_slice);
    let mut meshes = Vec::new();
    for part in &glb.parts {
        for (number, node) in nodes.iter().enumerate() {
            if node["mesh"].as_u64() != Some(part.mesh as u64) {
                continue;
            }
            let own = node["name"].as_str().map(str::to_owned);
            let of_input = scene.surfaces[part.surface].name.clone();
            meshes.push(MeshEntry {
                node: number,
                name: own.or(Some(of_input)),
                mesh: part.mesh,
                primitive: part.primitive,
                back: part.back,
                page: part.page,
                texcoord: part.texcoord,
                uv_rect: [0.0, 0.0, 1.0, 1.0],
            });
        }
    }
    let pages = |pages: &[MapPage], layer: Option<usize>| -> Vec<PageEntry> {
        let page = |(k, page): (usize, &MapPage)| PageEntry {
            width: page.width,
            height: page.height,
            exr: name(k, layer, "exr"),
            ktx2: ktx2.then(|| name(k, layer, "ktx2")),
        };
        pages.iter().enumerate().map(page).collect()
    };
    let names = scene.changes.layers.iter().flat_map(|l| &l.names);
    let layer = |(l, (own, name)): (usize, (&Vec<MapPage>, &String))| LayerEntry {
        name: name.clone(),
        pages: pages(own, Some(l)),
    };
    Ok(Index {
        format: "haarlight.lightmaps",
        version: VERSION,
        program: PROGRAM,
        quantity: if maps.indirect {
            "indirect irradiance"
        } else {
            "irradiance"
        },
        colour: "linear sRGB",
        lux_per_unit: lux_per_unit(maps),
        exposure: look.scale,
        white_balance: look.balance,
        margin: maps.margin(),
        pages: pages(&maps.pages, None),
        layers: maps
            .layers
            .iter()
            .zip(names)
            .enumerate()
            .map(layer)
            .collect(),
        meshes,
    })
}

/// The JSON of a glb that was written here: its first chunk.
fn document(glb: &BakedGlb) -> Result<Value> {
    let fault = || Error::Internal("the glb that was written cannot be read".into());
    let length = glb.bytes.get(12..16).ok_or_else(fault)?;
    let length = length.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
    let json = glb.bytes.get(20..20 + length).ok_or_else(fault)?;
    serde_json::from_slice(json).map_err(|_| fault())
}
