//! Holes of alpha-masked surfaces.

use super::Mesh;
use crate::scene::{Alpha, Scene};

/// Is a point of a triangle (barycentric weights of its corners) a hole?
pub fn is_hole(scene: &Scene, mesh: &Mesh, triangle: u32, weights: [f32; 3]) -> bool {
    let (surface, local) = mesh.origin[triangle as usize];
    let surface = &scene.surfaces[surface as usize];
    let Alpha::Mask {
        cutoff,
        factor,
        texture,
    } = &scene.materials[surface.material].alpha
    else {
        return false;
    };
    let weights = mesh.on_origin_f32(triangle as usize, weights);
    let corners = surface.triangles[local as usize].map(|v| v as usize);
    let mut alpha = *factor;
    if let Some(texture) = texture
        && let Some(uvs) = surface.texcoords.get(texture.texcoord)
    {
        let uv = std::array::from_fn(|c| (0..3).map(|k| uvs[corners[k]][c] * weights[k]).sum());
        alpha *= texture.sample(&scene.images, uv)[3];
    }
    if let Some(colors) = &surface.colors {
        alpha *= (0..3)
            .map(|k| colors[corners[k]][3] * weights[k])
            .sum::<f32>();
    }
    alpha < *cutoff
}
