//! What the light is worked out for: surfaces in world space, paint, lamps, cameras, and the document they came from.

mod accessor;
pub(crate) mod buffers;
mod camera;
pub mod changes;
pub(crate) mod check;
mod compression;
mod container;
pub mod document;
pub mod effects;
pub mod facts;
pub mod geometry;
mod image;
mod instances;
mod json;
mod known;
pub mod lacking;
pub mod layers;
mod light;
mod load;
pub mod luminaires;
mod material;
mod meshes;
mod nodes;
pub mod pane;
mod primitive;
pub mod profile;
mod raw;
mod said;
pub mod sky;
mod spectra_file;
mod texture;
mod texture_info;
mod transmittance;
pub(crate) mod uri;
mod world;

pub(crate) use json::short;
pub use load::Options;
pub use material::GREATEST_ALBEDO;
pub(crate) use material::listed;
pub use meshes::{Meshes, Paint, PointLamp};

use crate::data::{Grid, Leaves};
use glam::{DMat4, DVec3, Vec3};
use std::sync::Arc;

/// A room, read and checked.
///
/// Positions are in metres (the file's units, times the scale that was asked for), world space, right-handed, +Y up.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The document as read: written back by the output with the light added.
    pub source: Source,
    /// The wavelength grid that every spectrum here is sampled on.
    pub grid: Grid,
    /// One entry for each drawn primitive at each node (and each instance of it).
    pub surfaces: Vec<Surface>,
    /// The same for what lets light straight through: filters on rays, that neither block nor receive.
    pub panes: Vec<Surface>,
    /// Materials; `Surface::material` points in here.
    pub materials: Vec<Material>,
    /// Decoded images that some paint, emission or alpha mask uses.
    pub images: Vec<Image>,
    /// The distinct light spectra ("lamps by colour"); emissions and lights point in here.
    pub spectra: Vec<LightSpectrum>,
    /// Punctual lights; those of a sky stand last.
    pub lights: Vec<PunctualLight>,
    /// The sky, if one is described: how the light of [`LightKind::Sky`] is spread.
    pub sky: Option<sky::Sky>,
    /// Cameras of the file.
    pub cameras: Vec<Camera>,
    /// What the user should know: nothing is dropped in silence.
    pub warnings: Vec<String>,
    /// What was changed since it was read.
    pub changes: changes::Changes,
}

/// The glTF document behind a scene: kept whole, so that names, cameras, extras and unknown things survive.
#[derive(Debug, Clone)]
pub struct Source {
    /// The file that was read.
    pub path: std::path::PathBuf,
    /// The whole JSON, as in the file.
    pub json: serde_json::Value,
    /// The buffers of the document, decoded, in order of the JSON's `buffers`.
    pub buffers: Vec<Arc<[u8]>>,
}

impl Source {
    /// Where the problems of a whole room are.
    pub(crate) fn place(&self) -> String {
        self.path.display().to_string()
    }
}

/// A primitive at a node: the unit of input and of output.
#[derive(Debug, Clone)]
pub struct Surface {
    /// For messages: `node 4 'Chair', mesh 1 'seat', primitive 0`.
    pub name: String,
    /// Index of the node in the document.
    pub node: usize,
    /// Index of the mesh in the document.
    pub mesh: usize,
    /// Index of the primitive in the mesh.
    pub primitive: usize,
    /// Which instance of EXT_mesh_gpu_instancing this is.
    pub instance: Option<usize>,
    /// Index in [`Scene::materials`].
    pub material: usize,
    /// From the primitive's local space to world space (with the instance's transform, if any).
    pub to_world: DMat4,
    /// Vertices, world space.
    pub positions: Vec<DVec3>,
    /// Shading normals, world space, unit length; none: flat triangles.
    pub normals: Option<Vec<Vec3>>,
    /// Texture coordinates by set; `Material` textures name the set.
    pub texcoords: Vec<Vec<[f32; 2]>>,
    /// COLOR_0, linear, multiplies the base colour.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Triangles, counter-clockwise seen from the front in world space (mirrored nodes already turned).
    /// Index into `positions`, which is also the index into the original vertex attributes.
    pub triangles: Vec<[u32; 3]>,
}

/// A Lambertian material, one- or two-sided.
#[derive(Debug, Clone)]
pub struct Material {
    /// For messages and side files.
    pub name: String,
    /// Index in the document; none for glTF's default material.
    pub index: Option<usize>,
    /// Does the back reflect and emit too?
    pub sides: Sides,
    /// Albedo of the base colour factor (or the measured reflectance) on the grid's leaves, each in [0, 0.999].
    pub reflectance: Leaves,
    /// Where the reflectance comes from, for `inspect`.
    pub reflectance_from: String,
    /// Linear base colour factor; [1, 1, 1] where the reflectance is measured.
    pub base_color: [f32; 3],
    /// Texture that multiplies the base colour; none where the reflectance is measured.
    pub paint: Option<Texture>,
    /// Do vertex colours of a surface multiply the base colour? False where the reflectance is measured.
    pub vertex_paint: bool,
    /// What the surface gives out.
    pub emission: Option<Emission>,
    /// Holes.
    pub alpha: Alpha,
    /// What it lets straight through; then its surfaces stand in [`Scene::panes`].
    pub pane: Option<pane::Pane>,
}

/// Which sides of a surface reflect and emit. The other side is black and blocks light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// Only the front.
    Front,
    /// Both, alike.
    Both,
}

/// Coverage.
#[derive(Debug, Clone)]
pub enum Alpha {
    /// No holes.
    Opaque,
    /// A point is a hole where `factor * texture alpha * vertex alpha < cutoff`.
    Mask {
        /// Threshold.
        cutoff: f32,
        /// Base colour factor's alpha.
        factor: f32,
        /// Base colour texture.
        texture: Option<Texture>,
    },
}

/// Lambertian emission: `radiance(leaf) = spectra[light].power[leaf] * shape[leaf]`, W/m2/sr/nm; where there is a
/// texture the shape differs from point to point ([`Emission::shape_at`]).
#[derive(Debug, Clone)]
pub struct Emission {
    /// Index in [`Scene::spectra`].
    pub light: usize,
    /// Multiplier of the light's power per leaf, at the emissive factor.
    pub shape: Leaves,
    /// Emissive texture; then the shape of a point is `scale * upsample(factor * texel)`.
    pub texture: Option<Texture>,
    /// Linear emissive factor.
    pub color: [f32; 3],
    /// For textured emission: multiplier of the upsampled `color * texel` (both brought into [0, 1] first).
    pub scale: f64,
    /// Where the spectrum comes from, for `inspect`.
    pub from: String,
    /// How the light is spread, if not evenly: then `shape` only says how bright the surface is shown, and what it sends out is a
    /// light of [`LightKind::Surface`].
    pub profile: Option<Arc<profile::Profile>>,
}

impl Material {
    /// What the surface sends out evenly to all sides; none where a profile says how it shines.
    pub fn even_emission(&self) -> Option<&Emission> {
        self.emission.as_ref().filter(|e| e.profile.is_none())
    }
}

/// A spectrum that lamps share. Lamps given by colour share D65 and differ by `shape`.
#[derive(Debug, Clone, PartialEq)]
pub struct LightSpectrum {
    /// `cie/F2`, `blackbody/2700`, a file name ...
    pub name: String,
    /// Relative power per nm on the grid's leaves.
    pub power: Leaves,
}

/// A light without extent, or one of a sky. Radiant intensity in W/sr/nm (point, spot), irradiance in W/m2/nm across its rays
/// (directional, sun) or of open level ground (sky), exitance in W/m2/nm (ground), radiant flux in W/nm (profile, surface).
#[derive(Debug, Clone)]
pub struct PunctualLight {
    /// For messages.
    pub name: String,
    /// Kind and its parameters.
    pub kind: LightKind,
    /// Index of its node in the document; none for lights of a sky and those of surfaces.
    pub node: Option<usize>,
    /// World position.
    pub position: DVec3,
    /// World direction in which it shines, unit length.
    pub direction: DVec3,
    /// Index in [`Scene::spectra`].
    pub light: usize,
    /// `intensity(leaf) = spectra[light].power[leaf] * shape[leaf]`.
    pub shape: Leaves,
    /// How its light is spread, and from where: of the kinds that say so, and of no other.
    pub luminaire: Option<Arc<luminaires::Luminaire>>,
}

/// Kinds of KHR_lights_punctual, measured lamps, and those of a sky.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Shines alike in all directions.
    Point,
    /// A cone: full inside `inner`, zero outside `outer`, (half angles, radians), glTF's smooth fall-off between.
    Spot {
        /// Half angle of full intensity.
        inner: f64,
        /// Half angle where the light ends.
        outer: f64,
    },
    /// Parallel light.
    Directional,
    /// Shines from a point as its [profile](PunctualLight::luminaire) says.
    Profile,
    /// Shines from a surface as its profile says: a lamp with an extent.
    Surface,
    /// The sun: light from a disc of [`sky::SUN_RADIUS`], infinitely far away.
    Sun,
    /// The sky above the horizon, spread as [`Scene::sky`] says.
    Sky,
    /// Open ground below the horizon, alike in all directions.
    Ground,
}

impl LightKind {
    /// Does it shine from far away, from one direction?
    pub fn is_parallel(self) -> bool {
        matches!(self, Self::Directional | Self::Sun)
    }

    /// Does it shine from half of all directions?
    pub fn is_dome(self) -> bool {
        matches!(self, Self::Sky | Self::Ground)
    }
}

/// A camera of the file in world space; looks along -Z of its own space.
#[derive(Debug, Clone)]
pub struct Camera {
    /// For file names.
    pub name: String,
    /// Camera to world.
    pub to_world: DMat4,
    /// Vertical field of view in radians, or the half height of an orthographic view.
    pub projection: Projection,
    /// Width by height; none: 4 by 3.
    pub aspect: Option<f64>,
}

/// Projection of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Vertical field of view, radians.
    Perspective(f64),
    /// Half of the height, in the file's units.
    Orthographic(f64),
}

/// A texture reference: image, coordinates, sampler, KHR_texture_transform.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Index in [`Scene::images`].
    pub image: usize,
    /// Which set of coordinates.
    pub texcoord: usize,
    /// KHR_texture_transform as rows of a 2x3 matrix on (u, v, 1).
    pub transform: [[f32; 3]; 2],
    /// Wrapping in u and v.
    pub wrap: [Wrap; 2],
}

/// Wrapping of texture coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrap {
    /// Tile.
    Repeat,
    /// Tile, every second one turned.
    Mirror,
    /// Hold the edge.
    Clamp,
}

/// A decoded image: linear light, alpha as is.
#[derive(Debug, Clone)]
pub struct Image {
    /// For messages.
    pub name: String,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Linear RGBA, row by row from the top.
    pub pixels: Vec<[f32; 4]>,
}
