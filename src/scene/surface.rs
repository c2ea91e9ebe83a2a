//! A surface: triangles of one material in world space.

use glam::{DMat4, DVec3, Vec3};

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
    /// Index in [`Scene::materials`](crate::scene::Scene::materials).
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

/// Greatest albedo: at 1 a closed room that emits has no steady state, near it the condition is 1/(1 - albedo).
pub const GREATEST_ALBEDO: f64 = 0.999;

/// Which sides of a surface reflect and emit. The other side is black and blocks light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// Only the front.
    Front,
    /// Both, alike.
    Both,
}
