//! A mesh with its light, and what a browser lacks of it in bytes.
//!
//! A mesh begins as a GLB. Where it grows, new vertices are midpoints of two that are there, so that everything the file says
//! of vertices (places, texture coordinates, paint) follows. A browser says which shape of the mesh it has and gets, little-
//! endian:
//!
//! | what | as |
//! |---|---|
//! | mesh, shape, light (numbers), parts | 4 u32 |
//! | for each part: vertices, new ones among them, triangles (0: as they were) | 3 u32 |
//! | for each part: the ends of the edges whose midpoints are new | 2 u32 each |
//! | for each part: corners of all its triangles, if any is new | 3 u32 each |
//! | for each part: COLOR_0 (linear sRGB) and illuminance (lx) of all vertices | 4 f32 each |
//!
//! Parts are the primitives with light, in the order of the file.

use super::spectra::VertexSpectra;
use crate::gather::BakedSurface;
use crate::output::Exposure;
use crate::output::gltf::{self, color_0};
use crate::scene::Scene;
use rayon::prelude::*;
use std::sync::Arc;

/// A part of a mesh beyond the GLB.
#[derive(Debug, Clone, Default)]
pub(super) struct PartGrowth {
    /// Vertices of the part in the GLB.
    pub(super) base: usize,
    /// Ends of the edges whose midpoints came after them.
    pub(super) midpoints: Vec<[u32; 2]>,
    /// Triangles; none: those of the GLB.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A mesh.
#[derive(Debug, Clone)]
pub(super) struct PictureMesh {
    /// Number of the mesh.
    pub(super) mesh: u32,
    pub(super) glb: Arc<[u8]>,
    /// For each shape that it had, the midpoints of each part. The first has none.
    pub(super) had: Vec<Vec<u32>>,
    pub(super) parts: Vec<PartGrowth>,
}

impl PictureMesh {
    /// A mesh that does not grow; `counts`: vertices of its parts.
    pub(super) fn fixed(mesh: u32, glb: Vec<u8>, counts: impl Iterator<Item = usize>) -> Self {
        let parts: Vec<PartGrowth> = counts
            .map(|base| PartGrowth {
                base,
                ..PartGrowth::default()
            })
            .collect();
        Self {
            mesh,
            glb: glb.into(),
            had: vec![vec![0; parts.len()]],
            parts,
        }
    }
}

/// A mesh with its light.
#[derive(Debug)]
pub(super) struct LitMesh {
    pub(super) shape: Arc<PictureMesh>,
    light: u32,
    values: Vec<[f32; 4]>,
    /// What stands behind the values.
    pub(super) spectra: Arc<VertexSpectra>,
}

impl LitMesh {
    /// The light of `surfaces`, which have the vertices of `shape`. `light` numbers it.
    pub(super) fn new(
        shape: Arc<PictureMesh>,
        light: u32,
        scene: &Scene,
        (surfaces, spectra): (&[BakedSurface], Arc<VertexSpectra>),
        exposure: &Exposure,
    ) -> Self {
        let mut values = Vec::new();
        for k in gltf::order(scene, surfaces) {
            let part = &surfaces[k];
            let surface = &scene.surfaces[part.surface];
            let value = part.vertices.par_iter().map(|vertex| {
                let [r, g, b] = color_0(scene, surface, vertex, exposure);
                [r, g, b, vertex.irradiance[1].max(0.0)]
            });
            values.par_extend(value);
        }
        Self {
            shape,
            light,
            values,
            spectra,
        }
    }

    /// Numbers of mesh, shape and light.
    pub(super) fn numbers(&self) -> [u64; 3] {
        let shape = self.shape.had.len() - 1;
        [self.shape.mesh.into(), shape as u64, self.light.into()]
    }

    /// What a browser lacks that has some shape of some mesh; none where it has to begin with the GLB.
    pub(super) fn since(&self, mesh: u32, had: usize) -> Option<Vec<u8>> {
        let shape = &self.shape;
        let known = shape.had.get(had).filter(|_| mesh == shape.mesh)?;
        let same = had + 1 == shape.had.len();
        let [mesh, now, light] = self.numbers();
        let mut out = Bytes::default();
        out.put([
            mesh as u32,
            now as u32,
            light as u32,
            shape.parts.len() as u32,
        ]);
        for (part, &known) in shape.parts.iter().zip(known) {
            let vertices = part.base + part.midpoints.len();
            let new = part.midpoints.len() as u32 - known;
            let triangles = if same { 0 } else { part.triangles.len() };
            out.put([vertices as u32, new, triangles as u32]);
        }
        for (part, &known) in shape.parts.iter().zip(known) {
            part.midpoints[known as usize..]
                .iter()
                .for_each(|&ends| out.put(ends));
        }
        for part in shape.parts.iter().filter(|_| !same) {
            part.triangles.iter().for_each(|&corners| out.put(corners));
        }
        for value in &self.values {
            out.put(value.map(f32::to_bits));
        }
        Some(out.0)
    }
}

#[derive(Default)]
struct Bytes(Vec<u8>);

impl Bytes {
    fn put<const N: usize>(&mut self, numbers: [u32; N]) {
        numbers.iter().for_each(|n| self.0.extend(n.to_le_bytes()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_a_part_gets_the_rest() {
        let lanes = crate::light::lanes::Lanes::dense(&[], &[[0.0; 64]; 3]);
        let shape = PictureMesh {
            mesh: 3,
            glb: Arc::new([]),
            had: vec![vec![0], vec![1], vec![2]],
            parts: vec![PartGrowth {
                base: 3,
                midpoints: vec![[0, 1], [1, 3]],
                triangles: vec![[0, 3, 2]],
            }],
        };
        let picture = LitMesh {
            shape: Arc::new(shape),
            light: 9,
            values: vec![[0.0; 4]; 5],
            spectra: Arc::new(VertexSpectra::own(&lanes, Vec::new(), None)),
        };
        let words = |had| -> Vec<u32> {
            let bytes = picture.since(3, had).unwrap();
            let all = bytes.as_chunks::<4>().0.iter();
            all.map(|b| u32::from_le_bytes(*b)).collect()
        };
        assert_eq!(words(0)[..14], [3, 2, 9, 1, 5, 2, 1, 0, 1, 1, 3, 0, 3, 2]);
        assert_eq!(words(1)[..12], [3, 2, 9, 1, 5, 1, 1, 1, 3, 0, 3, 2]);
        assert_eq!(words(2)[..7], [3, 2, 9, 1, 5, 0, 0]);
        assert_eq!(words(2).len(), 7 + 4 * 5);
        assert!(picture.since(3, 3).is_none() && picture.since(2, 0).is_none());
    }
}
