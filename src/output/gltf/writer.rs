//! The document under construction, and what it has come to so far.

use super::accessor::Data;
use super::buffer::Bin;
use super::packing::{Packing, QuantizationGrid};
use crate::gather::BakedSurface;
use crate::output::Exposure;
use crate::scene::Scene;
use crate::scene::buffers::Buffers;
use glam::DVec3;
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};

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

/// A primitive with a light map, as it stands in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapPart {
    /// Index in `Scene::surfaces`, and whether it is the back of that.
    pub surface: usize,
    /// Is it the back?
    pub back: bool,
    /// Mesh and primitive of the written file.
    pub mesh: usize,
    /// Primitive of the mesh.
    pub primitive: usize,
    /// Number of the page.
    pub page: usize,
    /// Set of texture coordinates.
    pub texcoord: usize,
}

/// Baked materials so far.
#[derive(Default)]
pub(super) struct Unlit {
    /// Scene material to output material.
    pub(super) done: BTreeMap<usize, usize>,
    /// Output materials of the input that already became a baked one.
    pub(super) taken: BTreeSet<usize>,
    /// Input materials that unbaked primitives (points, lines, other scenes) show: these stay.
    pub(super) kept: BTreeSet<usize>,
}

/// The pages as textures of the file.
#[derive(Default)]
pub(super) struct Maps {
    /// Textures of the light and of what is shown, by page.
    pub(super) textures: Vec<[usize; 2]>,
    /// Of the light, see the module's words.
    pub(super) intensity: f64,
    /// Material by scene material, page and set of coordinates.
    pub(super) materials: BTreeMap<(usize, usize, usize), usize>,
    pub(super) parts: Vec<MapPart>,
}

impl Maps {
    /// Factor of the light; none if the light is not in maps.
    pub(super) fn intensity(&self) -> Option<f64> {
        (!self.textures.is_empty()).then_some(self.intensity)
    }
}

/// The refined meshes of a mesh's primitives.
pub(super) type Primitives<'a> = BTreeMap<usize, Vec<&'a BakedSurface>>;

/// The document under construction.
pub(super) struct Writer<'a> {
    pub(super) scene: &'a Scene,
    pub(super) look: &'a Exposure,
    pub(super) writing: Writing,
    /// Distance of backs from their fronts, world units.
    pub(super) apart: f64,
    /// What colour sets of layers are multiplied by.
    pub(super) layer_scale: f64,
    /// What positions of the mesh at hand are rounded to; none: they are floats.
    pub(super) grid: Option<QuantizationGrid>,
    /// The refined meshes by (node, instance), then primitive.
    pub(super) baked: BTreeMap<(usize, Option<usize>), Primitives<'a>>,
    pub(super) data: Data<'a>,
    /// The new document; its accessors and buffer views are in `bin` until the end.
    pub(super) json: Map<String, Value>,
    pub(super) bin: Bin,
    /// Old accessor to new one, for what is carried over.
    pub(super) accessors: BTreeMap<usize, usize>,
    pub(super) materials: Unlit,
    pub(super) maps: Maps,
    /// Does a kept primitive have vertices that need KHR_mesh_quantization?
    pub(super) quantized: bool,
    pub(super) vertices: usize,
    pub(super) triangles: usize,
    pub(super) clipped: usize,
    pub(super) compressed: usize,
    pub(super) warnings: Vec<String>,
}

impl<'a> Writer<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        surfaces: &'a [BakedSurface],
        look: &'a Exposure,
        (writing, layer_scale): (Writing, f64),
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
            layer_scale,
            grid: None,
            baked,
            data: Data::new(&scene.source, buffers),
            json: scene.source.json.as_object().cloned().unwrap_or_default(),
            bin: Bin::new(writing.packing),
            accessors: BTreeMap::new(),
            materials: Unlit::default(),
            maps: Maps::default(),
            quantized: false,
            vertices: 0,
            triangles: 0,
            clipped: 0,
            compressed: 0,
            warnings: Vec::new(),
        }
    }
}
