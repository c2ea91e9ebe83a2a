//! The output mesh kept with where its light comes from, and its light under other lamps and paints:
//! one sparse product, no ray.

use crate::gather::{Baked, BakedSurface, KeptVertex, LayerLanes, Vertex, lend};
use crate::hierarchy::Mesh;
use crate::light::{mixed, padded};
use crate::solve::Bake;
use crate::store::codec::Read;
use crate::store::{Broken, Decoder, Encoder, Packs};
use crate::transport::trace::{self, Stains};
use rayon::prelude::*;
use std::io;

/// One side of a surface: mesh and traces.
#[derive(Debug)]
pub(crate) struct TracedSide {
    surface: usize,
    back: bool,
    /// Triangle of the mesh of each vertex, and weights of its corners.
    vertices: Vec<(u32, [f64; 3])>,
    /// What the light of each is multiplied by.
    factors: Vec<f32>,
    triangles: Vec<[u32; 3]>,
    /// None for vertices that something covers.
    traces: Packs,
}

impl TracedSide {
    /// Writes a surface down.
    pub(crate) fn encode(
        surface: &BakedSurface,
        kept: &[KeptVertex],
        out: &mut Encoder,
    ) -> io::Result<()> {
        out.put([surface.surface as u64, u64::from(surface.back)])?;
        out.put_list(kept.len(), kept.iter().map(|v| v.triangle))?;
        out.put_list(kept.len(), kept.iter().map(|v| v.weights))?;
        out.put_list(kept.len(), kept.iter().map(|v| v.factor))?;
        out.put_all(&surface.triangles)?;
        let traces: Vec<_> = kept.iter().map(|v| v.trace.as_deref()).collect();
        Packs::encode(&traces, out)
    }

    /// Reads it back.
    pub(crate) fn decode(mesh: &Mesh, from: &mut Decoder) -> Read<Self> {
        let [surface, back] = from.get::<[u64; 2]>()?;
        let origins: Vec<u32> = from.get_all()?;
        let weights: Vec<[f64; 3]> = from.get_exactly(origins.len())?;
        let factors: Vec<f32> = from.get_exactly(origins.len())?;
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
            && traces.len() == origins.len()
            && factors.iter().all(|f| f.is_finite() && *f >= 0.0);
        if !fits {
            return Err(Broken::new("has a mesh that does not fit the room"));
        }
        Ok(Self {
            surface: surface as usize,
            back: back == 1,
            vertices: origins.into_iter().zip(weights).collect(),
            factors,
            triangles,
            traces,
        })
    }

    /// A vertex on its element.
    fn on_element(&self, &(triangle, weights): &(u32, [f64; 3]), bake: &Bake) -> Vertex {
        let entry = bake.tree().entry[triangle as usize][usize::from(self.back)];
        Vertex {
            triangle,
            weights,
            entry,
        }
    }
}

impl Bake {
    /// The kept mesh under the present light.
    pub(crate) fn relit(&self, kept: &[TracedSide]) -> Read<Baked> {
        match padded(self.lanes().len()) {
            4 => self.relit_lanes::<4>(kept),
            8 => self.relit_lanes::<8>(kept),
            16 => self.relit_lanes::<16>(kept),
            32 => self.relit_lanes::<32>(kept),
            _ => self.relit_lanes::<64>(kept),
        }
    }

    fn relit_lanes<const L: usize>(&self, kept: &[TracedSide]) -> Read<Baked> {
        let (looks, layers) = (self.looks(self.upsampler()), self.layer_lanes());
        let stains = Stains::new(&self.solution.filters);
        let mut out = Baked::default();
        for kept in kept {
            let mut rows: Vec<[f32; 64]> = bytemuck::zeroed_vec(kept.vertices.len());
            if self.light().through.is_empty() {
                kept.traces.for_each(&mut rows, |packed, row| {
                    self.relit_row::<L>(packed, None, &stains, row)
                })?;
            } else {
                let places = kept.vertices.iter().map(|vertex| self.place(kept, vertex));
                let mut placed: Vec<(Option<u32>, [f32; 64])> = places.zip(rows).collect();
                kept.traces.for_each(&mut placed, |packed, (place, row)| {
                    self.relit_row::<L>(packed, *place, &stains, row)
                })?;
                rows = placed.into_iter().map(|(_, row)| row).collect();
            }
            let moved = rows.par_iter_mut().zip(&kept.factors);
            moved.for_each(|(row, factor)| row.iter_mut().for_each(|x| *x *= factor));
            out.covered += lend_some(&mut rows, &kept.triangles);
            let look = &looks[self.scene().surfaces[kept.surface].material];
            let lit = kept.vertices.par_iter().zip(&rows);
            let vertices = lit.map(|(vertex, row)| {
                self.vertex(&kept.on_element(vertex, self), kept.back, row, look)
            });
            let layer = |(k, lanes): (usize, &LayerLanes)| {
                let lit = kept.vertices.par_iter().zip(&rows);
                let shown = lit.map(|(vertex, row)| {
                    let vertex = kept.on_element(vertex, self);
                    self.layer(k, lanes, (&vertex, kept.back, row), look)
                });
                shown.collect()
            };
            out.surfaces.push(BakedSurface {
                layers: layers.iter().enumerate().map(layer).collect(),
                surface: kept.surface,
                back: kept.back,
                vertices: vertices.collect(),
                triangles: kept.triangles.clone(),
                map: None,
            });
            out.irradiance.push(rows);
        }
        Ok(out)
    }

    /// The place of the leaf of a vertex among the leaves of the solution, if it is one of a sheet: the leaf that it was gathered on.
    fn place(&self, kept: &TracedSide, vertex: &(u32, [f64; 3])) -> Option<u32> {
        let vertex = kept.on_element(vertex, self);
        let to = self.receiver(&vertex, kept.surface, kept.back);
        self.place_on_sheet(to.leaf?)
    }

    /// Light by a kept trace, of sheets (with the `place` of a leaf) by two; NaN without.
    fn relit_row<const L: usize>(
        &self,
        packed: Option<&[u8]>,
        place: Option<u32>,
        stains: &Stains,
        row: &mut [f32; 64],
    ) -> Read<()> {
        let Some(packed) = packed else {
            row[0] = f32::NAN;
            return Ok(());
        };
        let lit = |packed| trace::replay::<L>(packed, self.light(), self.lamps(), stains);
        let shares = place.and_then(|place| self.light().through.shares(place));
        match shares {
            Some(shares) => {
                let [own, behind] = trace::parted(packed)?;
                row[..L].copy_from_slice(&lit(own)?);
                mixed(shares, &mut row[..L], &lit(behind)?);
            }
            None => row[..L].copy_from_slice(&lit(packed)?),
        }
        Ok(())
    }
}

/// Gives covered vertices (NaN) the light of their neighbours; returns how many there were.
fn lend_some(rows: &mut [[f32; 64]], triangles: &[[u32; 3]]) -> usize {
    // Only where something is covered: the rest lends nothing.
    let covered = |v: u32| rows[v as usize][0].is_nan();
    let around = triangles.iter().filter(|t| t.iter().any(|&v| covered(v)));
    let around: Vec<[u32; 3]> = around.copied().collect();
    let mut all: Vec<u32> = around.iter().flatten().copied().collect();
    all.sort_unstable();
    all.dedup();
    let place = |v: u32| all.partition_point(|&other| other < v) as u32;
    let triangles: Vec<[u32; 3]> = around.iter().map(|t| t.map(place)).collect();
    let lent = all.iter().map(|&v| {
        let row = rows[v as usize];
        (!row[0].is_nan()).then_some(row)
    });
    let mut lent: Vec<Option<[f32; 64]>> = lent.collect();
    let count = lend(&mut lent, &triangles);
    for (&v, row) in all.iter().zip(lent) {
        rows[v as usize] = row.unwrap_or([0.0; 64]);
    }
    for row in rows.iter_mut().filter(|row| row[0].is_nan()) {
        row[0] = 0.0;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Lent to where it is needed is lent to all.
        #[test]
        fn some_neighbours_lend_what_all_do(
            lit in prop::collection::vec(prop::option::of(0.0_f32..9.0), 12),
            triangles in prop::collection::vec([0_u32..12, 0_u32..12, 0_u32..12], 0..16),
        ) {
            let mut all: Vec<Option<[f32; 64]>> = lit.iter().map(|x| x.map(|x| [x; 64])).collect();
            let mut some: Vec<[f32; 64]> = all.iter().map(|x| x.unwrap_or([f32::NAN; 64])).collect();
            prop_assert_eq!(lend(&mut all, &triangles), lend_some(&mut some, &triangles));
            for (k, (all, some)) in all.iter().zip(&some).enumerate() {
                // What no triangle uses is of no use.
                if triangles.iter().flatten().any(|&v| v as usize == k) {
                    prop_assert_eq!(all.unwrap_or([0.0; 64]), *some);
                }
            }
        }
    }
}
