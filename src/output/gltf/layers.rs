//! Layers as further colour sets: COLOR_1, COLOR_2, ... hold the exposed light of one group of lamps each, before the curve of
//! COLOR_0, over a power of two that brings all of them into [0, 1].
//!
//! `COLOR_0 = curve(scale * (COLOR_1 + COLOR_2 + ...))`. A layer by itself may be of a colour outside of sRGB where the whole
//! is not; it is then shown by the nearest that keeps the sum: channel by channel the layers, each brought into sRGB, share the
//! whole. Layers are always stored as floats: a lamp that is in the picture is hundreds of times as bright as white, which
//! leaves 16 bits too few for the rest.

use super::attributes::exposed;
use super::writer::Writer;
use crate::gather::{BakedSurface, BakedVertex};
use crate::output::{Exposure, curve};
use crate::scene::{Material, Scene, Surface};
use serde_json::{Value, json};

/// Exposed light of all layers at a vertex: linear sRGB, none below 0.
fn shown(
    (material, surface): (&Material, &Surface),
    baked: &BakedSurface,
    v: usize,
    look: &Exposure,
) -> Vec<[f64; 3]> {
    let vertex = &baked.vertices[v];
    let part = |layer: &Vec<[f32; 3]>| {
        let light = layer[v];
        exposed(material, surface, &BakedVertex { light, ..*vertex }, look)
    };
    let parts: Vec<[f64; 3]> = baked.layers.iter().map(part).collect();
    if parts.iter().flatten().all(|&c| c >= 0.0) {
        return parts;
    }
    let whole = curve::into_gamut(exposed(material, surface, vertex, look));
    let parts: Vec<[f64; 3]> = parts.into_iter().map(curve::into_gamut).collect();
    let sum = [0, 1, 2].map(|c| parts.iter().map(|p| p[c]).sum::<f64>());
    let share = [0, 1, 2].map(|c| if sum[c] > 0.0 { whole[c] / sum[c] } else { 0.0 });
    let shared = |p: [f64; 3]| std::array::from_fn(|c| p[c] * share[c]);
    parts.into_iter().map(shared).collect()
}

/// What colour sets of layers are to be multiplied by: the least power of two, 1 or more, that brings them into [0, 1].
pub(super) fn scale(scene: &Scene, surfaces: &[BakedSurface], look: &Exposure) -> f64 {
    let brightest = |baked: &BakedSurface| {
        let surface = &scene.surfaces[baked.surface];
        let material = &scene.materials[surface.material];
        let count = if baked.layers.is_empty() {
            0
        } else {
            baked.vertices.len()
        };
        let all = (0..count).flat_map(|v| shown((material, surface), baked, v, look));
        all.flatten().fold(0.0, f64::max)
    };
    let brightest = surfaces.iter().map(brightest).fold(1.0, f64::max);
    brightest.log2().ceil().exp2()
}

impl Writer<'_> {
    /// Adds the colour sets of the layers of a refined primitive; their accessors.
    pub(super) fn layer_sets(&mut self, surface: &Surface, baked: &BakedSurface) -> Vec<usize> {
        let material = &self.scene.materials[surface.material];
        let mut sets = vec![Vec::with_capacity(baked.vertices.len()); baked.layers.len()];
        for v in 0..baked.vertices.len() {
            let parts = shown((material, surface), baked, v, self.look);
            for (set, part) in sets.iter_mut().zip(parts) {
                set.push(part.map(|c| (c / self.layer_scale) as f32));
            }
        }
        sets.iter().map(|set| self.bin.floats(set)).collect()
    }

    /// What the file says of its layers; nothing where there are none.
    pub(super) fn layer_facts(&self) -> Option<Value> {
        let layers = self.scene.changes.layers.as_ref()?;
        let wanted = self
            .baked
            .values()
            .flat_map(|primitives| primitives.values().flatten());
        let count = wanted.map(|baked| baked.layers.len()).max()?;
        let entry = |(k, name)| json!({ "name": name, "attribute": format!("COLOR_{}", k + 1) });
        let names: Vec<Value> = layers.names.iter().enumerate().map(entry).collect();
        (count > 0).then(|| json!({ "scale": self.layer_scale, "names": names }))
    }
}
