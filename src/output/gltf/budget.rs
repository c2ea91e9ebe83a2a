//! How many vertices a file of a given size holds.
//!
//! The room as it is, written with light of zero, takes B bytes for V vertices; every further vertex takes its attributes and
//! two triangles. So `(bytes - B) / per vertex + V` fit. Packed files are measured: their share of the plain size, and a
//! quarter more, for new vertices are less alike than the input's.

use super::asset::BakedGlb;
use super::baked_glb;
use super::packing::Packing;
use super::writer::Writing;
use crate::error::Result;
use crate::gather::{BakedSurface, BakedVertex};
use crate::output::Exposure;
use crate::scene::{Scene, Sides, Surface};

/// Packed vertices may take so much more than the input's.
const LESS_ALIKE: f64 = 1.25;

/// Vertices of a baked room that takes `bytes`; those of the input at least.
///
/// # Errors
/// As [`baked_glb`].
pub fn vertices_within(scene: &Scene, bytes: usize, writing: Writing) -> Result<usize> {
    let sheets = (0..scene.surfaces.len()).flat_map(|s| {
        let both = scene.sides(s) == Sides::Both;
        [false, true]
            .into_iter()
            .filter(move |back| both || !back)
            .map(move |back| (s, back))
    });
    let surfaces: Vec<BakedSurface> = sheets.map(|(s, back)| as_it_is(scene, s, back)).collect();
    let size = |writing| baked_glb(scene, &surfaces, &Exposure::new(1.0), writing);
    let BakedGlb {
        bytes: whole,
        vertices,
        ..
    } = size(writing)?;
    // Layers are always floats.
    let layers = 12 * layers(scene);
    let of_vertex = |index| {
        let sizes = scene.surfaces.iter().map(|s| of_vertex(s, writing, index));
        (sizes.max().unwrap_or(1) + layers) as f64
    };
    let mut share = 1.0;
    if writing.packing == Packing::Meshopt {
        let plain = Writing {
            packing: Packing::Quantized,
            ..writing
        };
        share = (LESS_ALIKE * whole.len() as f64 / size(plain)?.bytes.len() as f64).min(1.0);
    }
    let left = bytes.saturating_sub(whole.len()) as f64;
    let all = |index| vertices + (left / (share * of_vertex(index))) as usize;
    // Where all vertices could be of one sheet, indices of 16 bits may not do.
    let short = all(2);
    Ok(match short <= usize::from(u16::MAX) {
        true => short,
        false => all(4),
    })
}

/// Layers of the scene.
fn layers(scene: &Scene) -> usize {
    let layers = scene.changes.layers.as_ref();
    layers.map_or(0, |layers| layers.names.len())
}

/// Bytes of a vertex of a surface and of its two triangles.
fn of_vertex(surface: &Surface, writing: Writing, index: usize) -> usize {
    let [position, direction, coordinates, color] = match writing.packing {
        Packing::Floats => [12, 12, 8, 12],
        _ => [8, 4, 4, 8],
    };
    let normal = usize::from(surface.normals.is_some()) * direction;
    // With alpha, if there is any.
    let alpha = usize::from(surface.colors.is_some()) * 4;
    let xyz = usize::from(writing.xyz) * 12;
    position + normal + surface.texcoords.len() * coordinates + color + alpha + xyz + 6 * index
}

/// A surface with its own vertices, dark.
fn as_it_is(scene: &Scene, number: usize, back: bool) -> BakedSurface {
    let surface = &scene.surfaces[number];
    let mut place = vec![u32::MAX; surface.positions.len()];
    let mut out = BakedSurface {
        surface: number,
        back,
        ..BakedSurface::default()
    };
    for (t, triangle) in (0_u32..).zip(&surface.triangles) {
        let mut corners = [0, 1, 2].map(|k| {
            let place = &mut place[triangle[k] as usize];
            if *place == u32::MAX {
                *place = out.vertices.len() as u32;
                let mut weights = [0.0; 3];
                weights[k] = 1.0;
                out.vertices.push(BakedVertex {
                    triangle: t,
                    weights,
                    irradiance: [0.0; 3],
                    radiosity: [0.0; 3],
                    light: [0.0; 3],
                });
            }
            *place
        });
        if back {
            corners.swap(1, 2);
        }
        out.triangles.push(corners);
    }
    out.layers = vec![vec![[0.0; 3]; out.vertices.len()]; layers(scene)];
    out
}
