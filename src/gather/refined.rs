//! The refined mesh as points of the input mesh: attribute(vertex) = sum over the triangle's corners of weight * attribute.
//!
//! A vertex on an edge has one weight of zero, and a sum of two products does not depend on their order: two triangles
//! that share an edge get the same bits for it, so there is no crack.

use crate::error::{Error, Result};
use crate::gather::{BakedSurface, BakedVertex};
use crate::scene::{Scene, Surface};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Checks that every index of a refined mesh is in range and that every number is finite.
///
/// # Errors
/// An internal fault: the mesh comes from this program. All writers call this first and may index freely afterwards.
pub fn check(scene: &Scene, surfaces: &[BakedSurface]) -> Result<()> {
    for baked in surfaces {
        let Some(surface) = scene.surfaces.get(baked.surface) else {
            return Err(Error::Internal(format!(
                "refined mesh of surface {} of {}",
                baked.surface,
                scene.surfaces.len()
            )));
        };
        let fault = |what: &str| {
            Err(Error::Internal(format!(
                "{}: refined mesh: {what}",
                surface.name
            )))
        };
        if surface.material >= scene.materials.len() {
            return fault("no such material");
        }
        let corners_exist =
            |t: &[u32; 3]| t.iter().all(|&c| (c as usize) < surface.positions.len());
        for vertex in &baked.vertices {
            if !surface
                .triangles
                .get(vertex.triangle as usize)
                .is_some_and(corners_exist)
            {
                return fault("a vertex lies on no input triangle");
            }
            let finite = vertex.weights.iter().all(|w| w.is_finite())
                && vertex
                    .light
                    .iter()
                    .chain(&vertex.radiosity)
                    .chain(&vertex.irradiance)
                    .all(|c| c.is_finite());
            if !finite {
                return fault("light or weights of a vertex are not finite");
            }
        }
        if baked
            .triangles
            .iter()
            .flatten()
            .any(|&v| v as usize >= baked.vertices.len())
        {
            return fault("a triangle names a vertex that does not exist");
        }
    }
    Ok(())
}

/// The three input vertices that a refined vertex is interpolated from.
pub fn corners(surface: &Surface, vertex: &BakedVertex) -> [usize; 3] {
    surface.triangles[vertex.triangle as usize].map(|c| c as usize)
}

/// World position, the file's units.
pub fn position(surface: &Surface, vertex: &BakedVertex) -> DVec3 {
    let [a, b, c] = corners(surface, vertex).map(|c| surface.positions[c]);
    let [u, v, w] = vertex.weights;
    u * a + v * b + w * c
}

/// Shading normal in world space, unit length, on the side that the surface shows: the interpolated one, else that of
/// the input triangle.
pub fn normal(surface: &Surface, baked: &BakedSurface, vertex: &BakedVertex) -> DVec3 {
    let corners = corners(surface, vertex);
    let [a, b, c] = corners.map(|c| surface.positions[c]);
    let flat = (b - a).cross(c - a);
    let smooth = surface.normals.as_ref().map(|normals| {
        let normal = |c: usize| normals.get(c).copied().unwrap_or(Vec3::ZERO).as_dvec3();
        (0..3)
            .map(|k| vertex.weights[k] * normal(corners[k]))
            .sum::<DVec3>()
    });
    let front = smooth
        .and_then(DVec3::try_normalize)
        .or(flat.try_normalize())
        .unwrap_or(DVec3::Y);
    if baked.back { -front } else { front }
}

/// Unit normals of the refined mesh itself at its vertices, on the side that it shows: means by area over the triangles
/// that meet at a place, so that equal places have equal ones. Zero where they cancel.
pub fn outward(surface: &Surface, baked: &BakedSurface) -> Vec<DVec3> {
    // Adding zero turns -0 into +0.
    let key = |p: DVec3| (p + DVec3::ZERO).to_array().map(f64::to_bits);
    let places: Vec<DVec3> = (baked.vertices.iter())
        .map(|v| position(surface, v))
        .collect();
    let mut sums: HashMap<[u64; 3], DVec3> = HashMap::new();
    for triangle in &baked.triangles {
        let [a, b, c] = triangle.map(|v| places[v as usize]);
        let normal = (b - a).cross(c - a);
        for p in [a, b, c] {
            *sums.entry(key(p)).or_default() += normal;
        }
    }
    let sum = |p: &DVec3| sums.get(&key(*p)).copied().unwrap_or_default();
    places.iter().map(|p| sum(p).normalize_or_zero()).collect()
}

/// Interpolates four-component vertex data; vertices beyond the end of `data` count as `missing`.
pub(crate) fn vec4(
    surface: &Surface,
    vertex: &BakedVertex,
    data: &[[f32; 4]],
    missing: [f32; 4],
) -> [f32; 4] {
    let corners = corners(surface, vertex);
    std::array::from_fn(|i| {
        let at =
            |k: usize| f64::from(data.get(corners[k]).unwrap_or(&missing)[i]) * vertex.weights[k];
        (at(0) + at(1) + at(2)) as f32
    })
}

/// Linear vertex colour that multiplies the paint; white where the surface has none.
pub(crate) fn vertex_color(surface: &Surface, vertex: &BakedVertex) -> [f32; 4] {
    match &surface.colors {
        Some(colors) => vec4(surface, vertex, colors, [1.0; 4]),
        None => [1.0; 4],
    }
}
