//! The light at points and at the vertices of the refined mesh.

pub mod air;
mod bake;
mod glare;
mod layers;
mod probe;
pub mod refined;
mod shown;
mod spectra;
mod working_plane;

pub use crate::transport::MOSTLY;
pub use air::{Air, Around};
pub use bake::{Baked, Interpolation};
pub(crate) use bake::{KeptVertex, SurfaceResponse, Vertex, lend};
pub use glare::Glare;
pub(crate) use layers::LayerLanes;
pub use probe::Probed;
pub use working_plane::WorkingPlane;

/// The refined mesh of one surface, with the light at its vertices. Output of the gather, input of every writer.
#[derive(Debug, Clone, Default)]
pub struct BakedSurface {
    /// Index in `Scene::surfaces`.
    pub surface: usize,
    /// Is this the back of a two-sided surface? Then its triangles are reversed, and its normals point the other way.
    pub back: bool,
    /// Vertices as points of input triangles: attributes are interpolated with these weights.
    pub vertices: Vec<BakedVertex>,
    /// Triangles, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    /// For each layer (see [`Layers`](crate::scene::layers::Layers)) its part of [`BakedVertex::light`], vertex by vertex; empty
    /// without layers.
    pub layers: Vec<Vec<[f32; 3]>>,
    /// Where the light of this mesh is in light maps; none: it is at the vertices.
    pub map: Option<MapPlace>,
}

/// A mesh's place in light maps.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MapPlace {
    /// Number of the page.
    pub page: usize,
    /// Texture coordinates of each vertex on the page, in [0, 1], (0, 0) the upper left corner.
    pub uv: Vec<[f32; 2]>,
}

/// One output vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BakedVertex {
    /// Index of the input triangle in `Surface::triangles`.
    pub triangle: u32,
    /// Barycentric weights of the triangle's three corners, each in [0, 1], sum 1.
    pub weights: [f64; 3],
    /// Tristimulus irradiance on the front (Km = 683 lm/W: Y is lux); on diffuse sheets including the light behind, as shown
    /// ([`Through`](crate::light::Through)).
    pub irradiance: [f32; 3],
    /// Tristimulus radiosity that leaves the front, own emission included, in lm/m2 (Y); radiance is this over pi.
    pub radiosity: [f32; 3],
    /// This radiosity divided by the paint's texture and vertex colour where there are any: linear sRGB, lm/m2. Times the
    /// texture (and vertex colour) it shows the radiosity. Where there are none it is the radiosity's colour.
    pub light: [f32; 3],
}
