//! Light maps as they are handed to the writers.

use super::cells::{Lattice, bilinear};
use super::charts::Chart;
use super::pack::AtlasPlace;
use super::texels::{ChartTexels, Texel};
use crate::gather::Baked;
use crate::hierarchy::{Face, Mesh};
use crate::solve::weights_of;
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// Texels around every chart, so that what a viewer's filter takes in beyond its edge is its own light, down to the map's half size. Twice as
/// many, as far as a quarter, were half of the texels of a garage of 6,417 charts.
pub(super) const MARGIN: usize = 2;
/// The same for charts of a single texel, whose texture coordinates are its centre.
const MARGIN_OF_ONE: usize = 1;

/// Texels around a chart.
pub(super) fn margin(lattice: &Lattice) -> usize {
    if lattice.single {
        MARGIN_OF_ONE
    } else {
        MARGIN
    }
}

/// A page of texels, row by row from the top: texel (x, y) has its centre at texture coordinates ((x + .5) / width, (y + .5) / height).
#[derive(Debug, Clone)]
pub struct MapPage {
    /// Texels along each axis.
    pub width: usize,
    /// Texels along each axis.
    pub height: usize,
    /// Row by row.
    pub texels: Vec<Texel>,
    /// Surface that each texel belongs to; `u32::MAX`: none.
    pub surfaces: Vec<u32>,
}

/// Light maps of a room, and the room's own mesh with texture coordinates on them.
pub struct LightMaps {
    /// The pages.
    pub pages: Vec<MapPage>,
    /// The pages of each layer of lamps, which add up to the pages; none without layers.
    pub layers: Vec<Vec<MapPage>>,
    /// One mesh for each side of a surface and page; light at its vertices is that of the map there.
    pub baked: Baked,
    /// Texels that light was looked at for, all others are interpolated.
    pub looked: usize,
    /// Charts.
    pub charts: usize,
    /// Is light that comes straight from lamps and the sky left out?
    pub indirect: bool,
    pub(super) placed: PlacedCharts,
}

/// Charts with their texels.
pub(super) struct PlacedCharts {
    /// Empty as long as the maps grow.
    pub(super) charts: Vec<Chart>,
    /// Of each chart.
    pub(super) sizes: Vec<DVec2>,
    pub(super) lattices: Vec<Lattice>,
    pub(super) patches: Vec<ChartTexels>,
    pub(super) places: Vec<AtlasPlace>,
}

impl PlacedCharts {
    /// Makes charts without any light one texel, the same for all; for each chart the one whose place it shares, its own for the
    /// most.
    pub(super) fn share_dark(&mut self) -> Vec<usize> {
        let mut first = None;
        (0..self.patches.len())
            .map(|k| {
                let patch = &mut self.patches[k];
                if patch.texels.iter().any(|t| *t != Texel::default()) {
                    return k;
                }
                (patch.width, patch.height) = (1, 1);
                patch.texels.truncate(1);
                self.lattices[k].single = true;
                *first.get_or_insert(k)
            })
            .collect()
    }

    /// Texels along both axes, from the first texel's centre, at a place of a chart.
    pub(super) fn step(&self, chart: usize, at: DVec2) -> DVec2 {
        let patch = &self.patches[chart];
        let intervals = DVec2::new((patch.width - 1) as f64, (patch.height - 1) as f64);
        match self.lattices[chart].single {
            true => DVec2::ZERO,
            false => at / self.sizes[chart] * intervals,
        }
    }

    /// Place of a chart's point on its page, texels.
    pub(super) fn on_page(&self, chart: usize, at: DVec2) -> DVec2 {
        let place = &self.places[chart];
        let corner = DVec2::new(place.x as f64, place.y as f64);
        let margin = margin(&self.lattices[chart]) as f64;
        corner + (margin + 0.5) + self.step(chart, at)
    }

    /// A bilinear look-up at a place of a chart.
    pub(super) fn look_up(&self, chart: usize, at: DVec2) -> Texel {
        self.patches[chart].look_up(self.step(chart, at))
    }
}

impl ChartTexels {
    /// Numbers and weights of the four texels around a place; beyond the outermost texels these go on.
    pub(super) fn corners(&self, step: DVec2) -> [(usize, f64); 4] {
        let most = DVec2::new((self.width - 1) as f64, (self.height - 1) as f64);
        let step = step.clamp(DVec2::ZERO, most);
        let low = step.floor().min((most - 1.0).max(DVec2::ZERO));
        let (x, y) = (low.x as usize, low.y as usize);
        let (x1, y1) = ((x + 1).min(self.width - 1), (y + 1).min(self.height - 1));
        let weights = bilinear(step - low);
        let texels = [(x, y), (x1, y), (x, y1), (x1, y1)];
        std::array::from_fn(|k| (texels[k].1 * self.width + texels[k].0, weights[k]))
    }

    /// A bilinear look-up.
    fn look_up(&self, step: DVec2) -> Texel {
        let parts = self
            .corners(step)
            .map(|(texel, weight)| (weight, self.texels[texel]));
        Texel::mix(&parts)
    }
}

impl LightMaps {
    /// Texels around every chart of more than one texel that hold its outermost light.
    pub fn margin(&self) -> usize {
        MARGIN
    }

    /// Tristimulus irradiance that the maps show at points of faces, recentred; none where there is no triangle.
    pub fn drawn(&self, mesh: &Mesh, places: &[(Face, DVec3)]) -> Vec<Option<[f64; 3]>> {
        let mut of: HashMap<(u32, bool), (usize, u32)> = HashMap::new();
        for (k, chart) in self.placed.charts.iter().enumerate() {
            for (facet, f) in chart.facets.iter().enumerate() {
                of.insert((f.triangle, chart.back), (k, facet as u32));
            }
        }
        let look = |(face, point): &(Face, DVec3)| {
            let (chart, facet) = of.get(&(face.triangle, face.back))?;
            let [a, b, c] =
                mesh.triangles[face.triangle as usize].map(|p| mesh.positions[p as usize]);
            let flat = self.placed.charts[*chart].at(*facet, weights_of(*point, a, b, c));
            Some(self.placed.look_up(*chart, flat).irradiance.map(f64::from))
        };
        places.iter().map(look).collect()
    }
}
