//! The output mesh kept with where its light comes from, and its light under other lamps and paints:
//! one sparse product, no ray.

use super::bake::{Baked, Look, lend};
use super::refined::Vertex;
use super::{BakedSurface, trace};
use crate::color::Upsampler;
use crate::hierarchy::NONE;
use crate::scene::Scene;
use crate::solve::{Bake, padded};
use crate::store::codec::Read;
use crate::store::{Broken, Decoder, Encoder, Packs};
use rayon::prelude::*;
use std::io;

/// Vertices that a task lights.
const CHUNK: usize = 256;

/// One side of a surface: mesh and traces.
#[derive(Debug)]
pub(crate) struct Kept {
    surface: usize,
    back: bool,
    /// Input triangle of each vertex, and weights of its corners.
    vertices: Vec<(u32, [f64; 3])>,
    triangles: Vec<[u32; 3]>,
    /// None for vertices that something covers.
    traces: Packs,
}

impl Kept {
    /// Writes a surface down.
    pub(crate) fn encode(
        surface: &BakedSurface,
        traces: &[Option<Box<[u8]>>],
        out: &mut Encoder,
    ) -> io::Result<()> {
        out.put([surface.surface as u64, u64::from(surface.back)])?;
        let vertices = &surface.vertices;
        out.put_list(vertices.len(), vertices.iter().map(|v| v.triangle))?;
        out.put_list(vertices.len(), vertices.iter().map(|v| v.weights))?;
        out.put_all(&surface.triangles)?;
        Packs::encode(traces.iter().map(Option::as_deref), out)
    }

    /// Reads it back.
    pub(crate) fn decode(scene: &Scene, from: &mut Decoder) -> Read<Self> {
        let [surface, back] = from.get::<[u64; 2]>()?;
        let of = usize::try_from(surface)
            .ok()
            .and_then(|k| scene.surfaces.get(k))
            .ok_or_else(|| Broken::new("has a surface that the room has not"))?;
        let origins: Vec<u32> = from.get_all()?;
        let weights: Vec<[f64; 3]> = from.get_exactly(origins.len())?;
        let triangles: Vec<[u32; 3]> = from.get_all()?;
        let traces = Packs::decode(from)?;
        let fits = origins.iter().all(|&t| (t as usize) < of.triangles.len())
            && triangles
                .iter()
                .flatten()
                .all(|&v| (v as usize) < origins.len())
            && traces.len() == origins.len();
        if !fits {
            return Err(Broken::new("has a mesh that does not fit the room"));
        }
        Ok(Self {
            surface: surface as usize,
            back: back == 1,
            vertices: origins.into_iter().zip(weights).collect(),
            triangles,
            traces,
        })
    }
}

impl Bake {
    /// The kept mesh under the present light.
    pub(crate) fn relit(&self, kept: &[Kept]) -> Read<Baked> {
        match padded(self.lanes().len()) {
            8 => self.relit_lanes::<8>(kept),
            16 => self.relit_lanes::<16>(kept),
            32 => self.relit_lanes::<32>(kept),
            _ => self.relit_lanes::<64>(kept),
        }
    }

    fn relit_lanes<const L: usize>(&self, kept: &[Kept]) -> Read<Baked> {
        let upsampler = Upsampler::new(&self.scene().grid);
        let looks: Vec<Look> = self
            .scene()
            .materials
            .iter()
            .map(|m| Look::new(self, m, &upsampler))
            .collect();
        let mut out = Baked::default();
        for kept in kept {
            let count = kept.vertices.len();
            let parts: Vec<Vec<Option<[f32; 64]>>> = (0..count)
                .collect::<Vec<usize>>()
                .par_chunks(CHUNK)
                .map(|chunk| {
                    chunk
                        .iter()
                        .map(|&k| self.row::<L>(kept.traces.get(k)))
                        .collect()
                })
                .collect::<Read<_>>()?;
            let mut rows = parts.concat();
            out.covered += lend(&mut rows, &kept.triangles);
            let rows: Vec<[f32; 64]> = rows.into_iter().map(|r| r.unwrap_or([0.0; 64])).collect();
            let look = &looks[self.scene().surfaces[kept.surface].material];
            let first = self.mesh().first_triangle[kept.surface];
            let vertices = kept
                .vertices
                .par_iter()
                .zip(&rows)
                .map(|(&(local, weights), row)| {
                    let triangle = first + local;
                    let vertex = Vertex {
                        point: NONE,
                        triangle,
                        weights,
                        entry: self.tree().entry[triangle as usize][usize::from(kept.back)],
                    };
                    self.vertex(&vertex, kept.back, row, look)
                });
            out.surfaces.push(BakedSurface {
                surface: kept.surface,
                back: kept.back,
                vertices: vertices.collect(),
                triangles: kept.triangles.clone(),
            });
            out.irradiance.push(rows);
            out.traces.push(Vec::new());
        }
        Ok(out)
    }

    fn row<const L: usize>(&self, packed: Option<&[u8]>) -> Read<Option<[f32; 64]>> {
        let Some(packed) = packed else {
            return Ok(None);
        };
        let lit = trace::replay::<L>(packed, self.light(), self.lamps())?;
        let mut row = [0.0; 64];
        row[..L].copy_from_slice(&lit);
        Ok(Some(row))
    }
}
