//! Reflectance and emission of patches, row by row, from the materials.

use super::fluorescing::Glow;
use super::mixed::Mixed;
use super::reflection::Sheets;
use crate::color::Upsampler;
use crate::hierarchy::{Element, Mesh, NONE, Tree};
use crate::light::Through;
use crate::light::lanes::Lanes;
use crate::light::rows::{Rows, padded};
use crate::scene::mirror::Mirror;
use crate::scene::sheet::SheetMeans;
use crate::scene::{Emission, GREATEST_ALBEDO, Material, Scene, Surface, Texture};
use crate::spectrum::Spectrum;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Patches that a task paints.
const CHUNK: usize = 256;

/// What the leaves of a hierarchy reflect and emit.
#[derive(Debug, Clone)]
pub(crate) struct Sources {
    /// Reflectance by leaf.
    pub reflectance: Rows,
    /// Exitance by leaf: pi times radiance.
    pub emission: Rows,
    /// Greatest reflectance of each lane; at a sheet, with its transmittance.
    pub greatest: Vec<f32>,
    /// What passes sheets; none in a room without.
    pub sheets: Option<Sheets>,
    /// What fluoresces; none in a room without.
    pub glow: Option<Glow>,
}

/// Turns materials into rows.
pub(crate) struct Painter<'a> {
    scene: &'a Scene,
    mesh: &'a Mesh,
    upsampler: &'a Upsampler,
    /// By material; none where it is no sheet.
    sheets: Vec<Option<SheetMeans>>,
}

impl<'a> Painter<'a> {
    /// A painter for the materials of a scene.
    pub(crate) fn new(scene: &'a Scene, mesh: &'a Mesh, upsampler: &'a Upsampler) -> Self {
        let sheets = scene.materials.iter();
        Self {
            scene,
            mesh,
            upsampler,
            sheets: sheets
                .map(|material| material.sheet_means(&scene.images, upsampler))
                .collect(),
        }
    }

    /// Rows for the given leaves of `tree`.
    pub(crate) fn paint(&self, tree: &Tree, leaves: &[u32], lanes: &Lanes) -> Sources {
        let width = padded(lanes.len());
        // One row per material; textured materials are worked out patch by patch.
        let plain: Vec<(Vec<f32>, Vec<f32>)> = self
            .scene
            .materials
            .iter()
            .map(|m| {
                let (mut rho, mut emission) = (vec![0.0; width], vec![0.0; width]);
                // Rays that have met too many mirrors take a mirror for a matt surface.
                let mirror = m.mirror.as_ref().map(Mirror::overall);
                lanes.averages(mirror.as_ref().unwrap_or(&m.reflectance), &mut rho);
                if let Some(e) = m.even_emission() {
                    lanes.add_emission(e.light, &e.shape, PI, &mut emission);
                }
                (rho, emission)
            })
            .collect();
        let (mut reflectance, mut emission) = (
            Rows::zero(leaves.len(), width),
            Rows::zero(leaves.len(), width),
        );
        let greatest = reflectance
            .parts_mut(CHUNK)
            .zip(emission.parts_mut(CHUNK))
            .zip(leaves.par_chunks(CHUNK))
            .map(|((rho, emission), leaves)| {
                let mut greatest = vec![0.0_f32; width];
                let rows = rho.chunks_mut(width).zip(emission.chunks_mut(width));
                for ((rho, emission), &leaf) in rows.zip(leaves) {
                    let element = tree.elements[tree.node(leaf).element as usize];
                    let triangle = tree.faces[element.face as usize].triangle as usize;
                    let material = self.mesh.material[triangle] as usize;
                    rho.copy_from_slice(&plain[material].0);
                    emission.copy_from_slice(&plain[material].1);
                    let m = &self.scene.materials[material];
                    if let Some(color) = self.paint_of(m, triangle, &element) {
                        lanes.averages(&self.clamped(m, color), rho);
                    }
                    if let Some((e, shape)) = self.glow_of(m, triangle, &element) {
                        emission.fill(0.0);
                        lanes.add_emission(e.light, &shape, PI * e.scale, emission);
                    }
                    for (g, r) in greatest.iter_mut().zip(rho) {
                        *g = g.max(*r);
                    }
                }
                greatest
            })
            .reduce(
                || vec![0.0_f32; width],
                |a, b| a.iter().zip(&b).map(|(a, b)| a.max(*b)).collect(),
            );
        let mut sources = Sources {
            reflectance,
            emission,
            greatest,
            sheets: None,
            glow: Glow::new((self.scene, self.mesh), tree, leaves, lanes),
        };
        if self.scene.materials.iter().any(|m| m.sheet.is_some()) {
            self.weave(tree, leaves, lanes, &mut sources);
        }
        sources
    }

    /// Adds the transmittance of sheets, and reduces their reflectance to what that leaves.
    fn weave(&self, tree: &Tree, leaves: &[u32], lanes: &Lanes, sources: &mut Sources) {
        let pairs: Vec<[u32; 2]> = (0_u32..)
            .zip(leaves)
            .filter_map(|(place, &leaf)| {
                let behind = leaves.binary_search(&tree.behind(leaf)).ok()?;
                Some([place, behind as u32])
            })
            .collect();
        if pairs.is_empty() {
            return;
        }
        let width = sources.reflectance.width();
        let mut rows = [(); 4].map(|()| Rows::zero(pairs.len(), width));
        for (k, [place, _]) in pairs.iter().enumerate() {
            let element = tree.elements[tree.node(leaves[*place as usize]).element as usize];
            let Some(woven) = self.woven(tree, &element) else {
                continue;
            };
            for (rows, spectrum) in rows.iter_mut().zip(&woven) {
                lanes.averages(spectrum, rows.row_mut(k));
            }
            // As colours, the two may sum to more than their spectra do.
            let [rho, through, ..] = &mut rows;
            for (rho, through) in rho.row_mut(k).iter_mut().zip(through.row(k)) {
                *rho = rho.min(GREATEST_ALBEDO as f32 - through).max(0.0);
            }
            let [rho, through, ..] = &rows;
            sources
                .reflectance
                .row_mut(*place as usize)
                .copy_from_slice(rho.row(k));
            let both = rho.row(k).iter().zip(through.row(k));
            for (g, (rho, through)) in sources.greatest.iter_mut().zip(both) {
                *g = g.max(rho + through);
            }
        }
        let [_, through, plain, whole] = rows;
        sources.sheets = Some(Sheets {
            shown: Through::new(pairs.clone(), [&plain, &through, &whole]),
            pairs,
            through,
        });
    }

    /// Reflectance and transmittance of an element of a sheet; its reflectance without the pattern of its paint, which viewers add;
    /// and the reflectance that its light is shown by. None where it is no sheet.
    pub(super) fn woven(&self, tree: &Tree, element: &Element) -> Option<[Spectrum; 4]> {
        let face = tree.faces[element.face as usize];
        let triangle = face.triangle as usize;
        let material = self.mesh.material[triangle] as usize;
        let m = &self.scene.materials[material];
        let (sheet, means) = (m.sheet.as_ref()?, self.sheets[material].as_ref()?);
        let surface = &self.scene.surfaces[self.mesh.origin[triangle].0 as usize];
        let weights = self.corner_weights(triangle, element);
        let weave = sheet.weave(|texture| self.texel(texture, surface, triangle, &weights));
        let color = self.paint_of(m, triangle, element);
        let up = self.upsampler;
        let [rho, through] = m.scatters(sheet, color, weave, face.back, up);
        let [plain, _] = m.scatters(sheet, means.color, weave, face.back, up);
        Some([rho, through, plain, means.shown])
    }

    /// The matrices of the given leaves, for lanes that reflect into each other.
    pub(super) fn mixed(&self, tree: &Tree, leaves: &[u32], lanes: &Lanes) -> Mixed {
        let mut paints: Vec<Spectrum> =
            self.scene.materials.iter().map(|m| m.reflectance).collect();
        let mut of = Vec::with_capacity(leaves.len());
        for &leaf in leaves {
            let element = tree.elements[tree.node(leaf).element as usize];
            let triangle = tree.faces[element.face as usize].triangle as usize;
            let material = self.mesh.material[triangle];
            let m = &self.scene.materials[material as usize];
            of.push(match self.paint_of(m, triangle, &element) {
                Some(color) => {
                    paints.push(self.clamped(m, color));
                    paints.len() as u32 - 1
                }
                None => material,
            });
        }
        Mixed::new(&paints, of, lanes, padded(lanes.len()))
    }

    /// Albedo of a linear colour on a material: bounded below 1, so that light ends.
    fn clamped(&self, m: &Material, color: [f32; 3]) -> Spectrum {
        m.bounded(self.upsampler.reflectance_fast(color))
    }

    /// Mean linear base colour over an element, if it varies: factor times texture times vertex colours.
    fn paint_of(&self, m: &Material, triangle: usize, element: &Element) -> Option<[f32; 3]> {
        let surface = &self.scene.surfaces[self.mesh.origin[triangle].0 as usize];
        let vertex_paint = m.vertex_paint && surface.colors.is_some();
        if m.mirror.is_some() || (m.paint.is_none() && !vertex_paint) {
            return None;
        }
        let weights = self.corner_weights(triangle, element);
        let mut color = m.base_color;
        if let Some(texture) = &m.paint {
            let texel = self.texel(texture, surface, triangle, &weights);
            color = std::array::from_fn(|k| color[k] * texel[k]);
        }
        if let (true, Some(colors)) = (vertex_paint, &surface.colors) {
            let corners = surface.triangles[self.mesh.origin[triangle].1 as usize];
            // The mean over the element is the value in its middle: vertex colours are linear.
            let middle: [f64; 3] =
                std::array::from_fn(|k| (weights[0][k] + weights[1][k] + weights[2][k]) / 3.0);
            let mean: [f32; 3] = std::array::from_fn(|c| {
                (0..3)
                    .map(|k| colors[corners[k] as usize][c] * middle[k] as f32)
                    .sum()
            });
            color = std::array::from_fn(|k| color[k] * mean[k]);
        }
        Some(color)
    }

    /// Emission over an element and its spectral shape, if a texture varies it.
    fn glow_of<'m>(
        &self,
        m: &'m Material,
        triangle: usize,
        element: &Element,
    ) -> Option<(&'m Emission, Spectrum)> {
        let e = m.even_emission()?;
        let texture = e.texture.as_ref()?;
        let surface = &self.scene.surfaces[self.mesh.origin[triangle].0 as usize];
        let texel = self.texel(
            texture,
            surface,
            triangle,
            &self.corner_weights(triangle, element),
        );
        let color: [f32; 3] = std::array::from_fn(|k| e.color[k] * texel[k]);
        Some((e, self.upsampler.reflectance_fast(color)))
    }

    fn texel(
        &self,
        texture: &Texture,
        surface: &Surface,
        triangle: usize,
        weights: &[[f64; 3]; 3],
    ) -> [f32; 4] {
        let Some(uvs) = surface.texcoords.get(texture.texcoord) else {
            return [1.0; 4];
        };
        let corners =
            surface.triangles[self.mesh.origin[triangle].1 as usize].map(|v| uvs[v as usize]);
        let uv = weights
            .map(|w| std::array::from_fn(|c| (0..3).map(|k| corners[k][c] * w[k] as f32).sum()));
        texture.average(&self.scene.images, uv)
    }

    /// Barycentric weights of an element's corners on its input triangle.
    fn corner_weights(&self, triangle: usize, element: &Element) -> [[f64; 3]; 3] {
        let [a, b, c] = self.mesh.triangles[triangle].map(|v| self.mesh.positions[v as usize]);
        let on_origin = |w| self.mesh.on_origin(triangle, w);
        element.corners.map(|p| on_origin(weights_of(p, a, b, c)))
    }
}

/// Barycentric weights of a point of a triangle's plane.
pub(crate) fn weights_of(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> [f64; 3] {
    let normal = (b - a).cross(c - a);
    let square = normal.length_squared();
    let wb = (p - a).cross(c - a).dot(normal) / square;
    let wc = (b - a).cross(p - a).dot(normal) / square;
    [1.0 - wb - wc, wb, wc]
}

/// What single leaves reflect, emit and get from punctual lights, on all 64 bands.
pub(crate) struct DenseSources<'a> {
    painter: &'a Painter<'a>,
    tree: &'a Tree,
    shadowed: &'a super::punctual::Shadowed,
    /// Position of each leaf node in the list of leaves.
    place: Vec<u32>,
}

impl<'a> DenseSources<'a> {
    pub(crate) fn new(
        painter: &'a Painter<'a>,
        tree: &'a Tree,
        shadowed: &'a super::punctual::Shadowed,
        leaves: &[u32],
    ) -> Self {
        let mut place = vec![u32::MAX; tree.nodes.len()];
        for (k, &leaf) in leaves.iter().enumerate() {
            place[leaf as usize] = k as u32;
        }
        Self {
            painter,
            tree,
            shadowed,
            place,
        }
    }

    fn of(&self, leaf: u32) -> (&'a Material, usize, Element) {
        let element = self.tree.elements[self.tree.node(leaf).element as usize];
        let triangle = self.tree.faces[element.face as usize].triangle as usize;
        (
            &self.painter.scene.materials[self.painter.mesh.material[triangle] as usize],
            triangle,
            element,
        )
    }
}

impl super::coarse::Dense for DenseSources<'_> {
    fn reflectance(&self, leaf: u32) -> Spectrum {
        let (m, triangle, element) = self.of(leaf);
        if let Some([rho, ..]) = self.painter.woven(self.tree, &element) {
            return rho;
        }
        match self.painter.paint_of(m, triangle, &element) {
            Some(color) => self.painter.clamped(m, color),
            None => m.reflectance,
        }
    }

    fn through(&self, leaf: u32) -> Option<Spectrum> {
        let element = self.tree.elements[self.tree.node(leaf).element as usize];
        (self.tree.behind(leaf) != NONE)
            .then(|| self.painter.woven(self.tree, &element))?
            .map(|[_, through, ..]| through)
    }

    fn emission(&self, leaf: u32, light: usize) -> Option<Spectrum> {
        let (m, triangle, element) = self.of(leaf);
        let e = m.even_emission().filter(|e| e.light == light)?;
        Some(match self.painter.glow_of(m, triangle, &element) {
            Some((e, shape)) => shape.map(|x| PI * e.scale * x),
            None => e.shape.map(|x| PI * x),
        })
    }

    fn excitation(&self, leaf: u32, light: usize) -> Option<Spectrum> {
        let (m, ..) = self.of(leaf);
        let terms = m.fluorescence.iter().flat_map(|f| &f.terms);
        let excited = terms.filter(|t| t.light == light).map(|t| t.excitation);
        excited.reduce(|a, b| std::array::from_fn(|k| a[k] + b[k]))
    }

    fn punctual(&self, leaf: u32, light: usize) -> Option<Spectrum> {
        let mut sum: Option<Spectrum> = None;
        for &(lamp, factor) in &self.shadowed.by_leaf[self.place[leaf as usize] as usize] {
            let lamp = &self.painter.scene.lights[lamp as usize];
            if lamp.light == light {
                let sum = sum.get_or_insert([0.0; crate::spectrum::BANDS]);
                for (s, x) in sum.iter_mut().zip(&lamp.shape) {
                    *s += f64::from(factor) * x;
                }
            }
        }
        sum
    }
}
