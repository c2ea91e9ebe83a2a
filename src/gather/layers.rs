//! The light of each layer of lamps (see `scene::layers`): rows hold every light spectrum separately, and a layer is
//! some of their lanes. So the layers of a vertex are parts of one sum, and add up to it but for rounding.

use super::bake::{SurfaceResponse, Vertex};
use crate::color::LinearSrgb;
use crate::light::lanes::Lane;
use crate::scene::layers::Layers;
use crate::solve::Bake;

/// The lanes of a row that belong to a layer.
#[derive(Debug, Clone)]
pub(crate) struct LayerLanes([bool; 64]);

impl LayerLanes {
    /// The layer's part of a row.
    pub(crate) fn of(&self, row: &[f32]) -> [f32; 64] {
        let mut part = [0.0; 64];
        for ((part, x), own) in part.iter_mut().zip(row).zip(self.0) {
            *part = if own { *x } else { 0.0 };
        }
        part
    }
}

impl Bake {
    /// The layers of the room, if its lamps were divided into layers and rows hold these separately.
    pub fn layers(&self) -> Option<&Layers> {
        let layers = self.scene().changes.layers.as_ref()?;
        self.lanes().is_ratio().then_some(layers)
    }

    /// The lanes of each layer; none without layers.
    pub(crate) fn layer_lanes(&self) -> Vec<LayerLanes> {
        let Some(layers) = self.layers() else {
            return Vec::new();
        };
        let lanes = self.lanes().lanes();
        let has = |k: usize, lane: Option<&Lane>| {
            let light = lane.and_then(|lane| lane.light);
            light.is_some_and(|light| layers.of_light[light] == k)
        };
        let each = 0..layers.names.len();
        each.map(|k| LayerLanes(std::array::from_fn(|l| has(k, lanes.get(l)))))
            .collect()
    }

    /// Appends the light of each layer at a vertex, as in [`BakedVertex::light`](super::BakedVertex::light), to
    /// `shown`, layer by layer.
    pub(crate) fn add_layers(
        &self,
        layers: &[LayerLanes],
        (vertex, back, row): (&Vertex, bool, &[f32; 64]),
        look: &SurfaceResponse,
        shown: &mut [Vec<[f32; 3]>],
    ) {
        for (k, (lanes, out)) in layers.iter().zip(shown).enumerate() {
            out.push(self.layer(k, lanes, (vertex, back, row), look));
        }
    }

    /// The light of layer `k` at a vertex.
    pub(crate) fn layer(
        &self,
        k: usize,
        lanes: &LayerLanes,
        (vertex, back, row): (&Vertex, bool, &[f32; 64]),
        look: &SurfaceResponse,
    ) -> [f32; 3] {
        let reflected = look.reflect(&lanes.of(row));
        let glow = match (self.glow(vertex, back, look), look.shown) {
            (None, _) => [0.0; 3],
            (Some(own), None) => self.lanes().tristimulus(&lanes.of(own)),
            // Shown by a profile: all its light comes from one lamp.
            (Some(_), Some(shown)) => {
                let layer = look.light.zip(self.layers());
                let own = layer.is_some_and(|(light, layers)| layers.of_light[light] == k);
                shown.map(|x| if own { x } else { 0.0 })
            }
        };
        let rgb = LinearSrgb::standard().from_xyz([0, 1, 2].map(|c| reflected[c] + glow[c]));
        let unpainted = look.unpainted.unwrap_or([1.0; 3]);
        std::array::from_fn(|c| (rgb[c] / unpainted[c]) as f32)
    }
}
