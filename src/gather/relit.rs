//! The output mesh kept with where its light comes from, and its light under other lamps and paints:
//! one sparse product, no ray.

use super::bake::{Baked, lend};
use super::refined::Vertex;
use super::{BakedSurface, trace};
use crate::color::Upsampler;
use crate::hierarchy::{Mesh, NONE};
use crate::solve::{Bake, padded};
use crate::store::codec::Read;
use crate::store::{Broken, Decoder, Encoder, Packs};
use rayon::prelude::*;
use std::io;

/// Vertices that a task lights.
const CHUNK: usize = 256;

/// A vertex of the output on the mesh, with where its light comes from; none if something covers it.
#[derive(Debug)]
pub(crate) struct KeptVertex {
    pub(crate) triangle: u32,
    pub(crate) weights: [f64; 3],
    pub(crate) trace: Option<Box<[u8]>>,
}

/// One side of a surface: mesh and traces.
#[derive(Debug)]
pub(crate) struct Kept {
    surface: usize,
    back: bool,
    /// Triangle of the mesh of each vertex, and weights of its corners.
    vertices: Vec<(u32, [f64; 3])>,
    triangles: Vec<[u32; 3]>,
    /// None for vertices that something covers.
    traces: Packs,
}

impl Kept {
    /// Writes a surface down.
    pub(crate) fn encode(
        surface: &BakedSurface,
        kept: &[KeptVertex],
        out: &mut Encoder,
    ) -> io::Result<()> {
        out.put([surface.surface as u64, u64::from(surface.back)])?;
        out.put_list(kept.len(), kept.iter().map(|v| v.triangle))?;
        out.put_list(kept.len(), kept.iter().map(|v| v.weights))?;
        out.put_all(&surface.triangles)?;
        Packs::encode(kept.iter().map(|v| v.trace.as_deref()), out)
    }

    /// Reads it back.
    pub(crate) fn decode(mesh: &Mesh, from: &mut Decoder) -> Read<Self> {
        let [surface, back] = from.get::<[u64; 2]>()?;
        let origins: Vec<u32> = from.get_all()?;
        let weights: Vec<[f64; 3]> = from.get_exactly(origins.len())?;
        let triangles: Vec<[u32; 3]> = from.get_all()?;
        let traces = Packs::decode(from)?;
        let there = |&t: &u32| {
            let origin = mesh.origin.get(t as usize);
            origin.is_some_and(|o| u64::from(o.0) == surface)
        };
        let surfaces = mesh.first_triangle.len().saturating_sub(1);
        let fits = surface < surfaces as u64
            && origins.iter().all(there)
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
            4 => self.relit_lanes::<4>(kept),
            8 => self.relit_lanes::<8>(kept),
            16 => self.relit_lanes::<16>(kept),
            32 => self.relit_lanes::<32>(kept),
            _ => self.relit_lanes::<64>(kept),
        }
    }

    fn relit_lanes<const L: usize>(&self, kept: &[Kept]) -> Read<Baked> {
        let upsampler = Upsampler::new(&self.scene().grid);
        let looks = self.looks(&upsampler);
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
            let vertices =
                kept.vertices
                    .par_iter()
                    .zip(&rows)
                    .map(|(&(triangle, weights), row)| {
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
