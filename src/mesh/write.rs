//! The vertices as written; covered ones are lent their neighbours' light.

use super::cells::Triangles;
use super::flip::{Ground, grounds, turn};
use super::grow::MeshGrowth;
use crate::color::lab;
use crate::gather::{Baked, BakedSurface, KeptVertex, lend};
use crate::solve::Bake;
use glam::DVec3;
use std::collections::HashMap;

/// A vertex that no look belongs to.
const UNSEEN: u32 = u32::MAX;

/// Light of the vertices of a sheet, as written.
pub(super) struct Settled {
    pub(super) triangles: Vec<[u32; 3]>,
    /// A triangle of the mesh that each lies in, at least in part.
    pub(super) of: Vec<u32>,
    /// A triangle of the mesh that stands for all that belong together with it.
    pub(super) together: Vec<u32>,
    /// Positions of the vertices.
    pub(super) at: Vec<DVec3>,
    /// Irradiance of each vertex that a triangle uses.
    pub(super) rows: Vec<Option<[f32; 64]>>,
    /// The look that each vertex takes its light from.
    looks: Vec<u32>,
    /// Factor of that light, see [`fit`](super::fit).
    factor: Vec<f32>,
    covered: usize,
}

impl MeshGrowth<'_> {
    /// Joins again those vertices divided by a thing on an edge or by the edge of a shadow whose light proved alike on both sides: no
    /// further apart than the allowed mean error.
    fn join(
        &self,
        sheet: usize,
        triangles: &mut [[u32; 3]],
        light: impl Fn(u32) -> Option<[f64; 3]>,
    ) {
        let sheet = &self.cells.sheets[sheet];
        let mut first = HashMap::new();
        for v in triangles.iter_mut().flatten() {
            let base = sheet.base.get(v).unwrap_or(v);
            let own = *sheet.parted.get(base).unwrap_or(base);
            let known = *first.entry(own).or_insert(*v);
            if let (Some(a), Some(b)) = (light(known), light(*v))
                && self.difference(a, b) <= self.allowed
            {
                *v = known;
            }
        }
    }
}

impl Bake {
    /// The light of a mesh, as written.
    pub(super) fn settled(&self, growth: &MeshGrowth) -> Vec<Settled> {
        let fitted = growth.fitted();
        let sheets = growth.cells.triangles().into_iter();
        let sheets = sheets.zip(grounds(&growth.cells)).enumerate();
        sheets
            .map(|(number, (faces, ground))| self.settle(growth, &fitted, number, faces, ground))
            .collect()
    }

    fn settle(
        &self,
        growth: &MeshGrowth,
        fitted: &[(u32, f32)],
        sheet: usize,
        mut faces: Triangles,
        ground: Ground,
    ) -> Settled {
        let mut looks = vec![UNSEEN; ground.at.len()];
        let mut factor = vec![1.0; ground.at.len()];
        for &v in faces.0.iter().flatten() {
            if let Some(look) = growth.look(sheet, v) {
                (looks[v as usize], factor[v as usize]) = fitted[look as usize];
            }
        }
        let seen = |&look: &u32| (look != UNSEEN).then(|| growth.looks.at(look))?;
        let lightness = |(look, &factor): (&u32, &f32)| {
            let xyz = seen(look)?.xyz.map(|x| f64::from(factor) * x);
            Some(lab(xyz, self.light().white)[0])
        };
        let light: Vec<Option<f64>> = looks.iter().zip(&factor).map(lightness).collect();
        growth.join(sheet, &mut faces.0, |v| Some(seen(&looks[v as usize])?.xyz));
        turn(&ground, &mut faces.0, &light);
        let row = |(look, factor): (&u32, &f32)| Some(seen(look)?.row.map(|x| x * factor));
        let mut rows: Vec<Option<[f32; 64]>> = looks.iter().zip(&factor).map(row).collect();
        let (triangles, of) = faces;
        let covered = lend(&mut rows, &triangles);
        Settled {
            triangles,
            of,
            together: ground.of,
            at: ground.at,
            rows,
            looks,
            factor,
            covered,
        }
    }

    /// The vertices with their colours, as the writers need them.
    pub(super) fn write_down(&self, growth: MeshGrowth, settled: Vec<Settled>) -> Baked {
        let looks = self.looks(self.upsampler());
        let layers = self.layer_lanes();
        let mut out = Baked {
            rays: growth.looks.rays,
            ..Baked::default()
        };
        for (sheet, settled) in growth.cells.sheets.iter().zip(settled) {
            out.covered += settled.covered;
            let mut place = vec![u32::MAX; sheet.vertices.len()];
            let mut surface = BakedSurface {
                surface: sheet.surface,
                back: sheet.back,
                layers: vec![Vec::new(); layers.len()],
                ..BakedSurface::default()
            };
            let (mut spectra, mut kept) = (Vec::new(), Vec::new());
            let look = &looks[self.scene().surfaces[sheet.surface].material];
            for triangle in &settled.triangles {
                surface.triangles.push(triangle.map(|v| {
                    let v = v as usize;
                    if place[v] == u32::MAX {
                        place[v] = surface.vertices.len() as u32;
                        let (vertex, row) =
                            (&sheet.vertices[v], settled.rows[v].unwrap_or([0.0; 64]));
                        let written = self.vertex(vertex, sheet.back, &row, look);
                        surface.vertices.push(written);
                        let shown = (vertex, sheet.back, &row);
                        self.add_layers(&layers, shown, look, &mut surface.layers);
                        spectra.push(row);
                        if self.keeps() {
                            let seen = (settled.looks[v] != UNSEEN)
                                .then(|| growth.looks.at(settled.looks[v]));
                            kept.push(KeptVertex {
                                triangle: vertex.triangle,
                                weights: vertex.weights,
                                factor: settled.factor[v],
                                trace: seen.flatten().and_then(|seen| seen.trace.clone()),
                            });
                        }
                    }
                    place[v]
                }));
            }
            out.surfaces.push(surface);
            out.irradiance.push(spectra);
            out.kept.push(kept);
            out.of.push(settled.of);
        }
        out
    }
}
