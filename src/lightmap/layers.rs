//! Pages of the layers of lamps (see `scene::layers`): the texels of the whole, with a part of its light.
//!
//! All that makes texels of looks is linear but the closing of seams, which ends when it is close enough. What the layers then
//! lack of the whole goes to the brightest of them, texel by texel, so that they add up.

use super::aliasing::Smoothed;
use super::charts::Chart;
use super::grow::LightmapGrowth;
use super::maps::{MapPage, PlacedCharts, margin};
use super::seams::close;
use super::texels::{ChartTexels, Texel};
use crate::solve::Bake;

impl Bake {
    /// The texels of each layer, chart by chart; `whole` are those of all light, seams closed.
    pub(super) fn layers_of_maps(
        &self,
        growth: &LightmapGrowth,
        smoothed: &Smoothed,
        spaces: &[(u32, bool)],
        whole: &PlacedCharts,
    ) -> Vec<Vec<ChartTexels>> {
        let lanes = self.layer_lanes();
        let one = |part| {
            let (mut placed, _) = self.placed(growth, smoothed, Some(part));
            close(self, &growth.charts, spaces, &mut placed);
            placed.patches
        };
        let mut layers: Vec<Vec<ChartTexels>> = lanes.iter().enumerate().map(one).collect();
        for (chart, patch) in whole.patches.iter().enumerate() {
            for (t, texel) in patch.texels.iter().enumerate() {
                complete(&mut layers, [chart, t], texel);
            }
        }
        layers
    }
}

/// Brings the sum of the layers' texels to `whole`.
fn complete(layers: &mut [Vec<ChartTexels>], [chart, t]: [usize; 2], whole: &Texel) {
    let bright = |k: usize| layers[k][chart].texels[t].irradiance[1];
    let order = |a: &usize, b: &usize| bright(*a).total_cmp(&bright(*b));
    let Some(brightest) = (0..layers.len()).max_by(order) else {
        return;
    };
    let mut parts = vec![(1.0, *whole)];
    let others = (0..layers.len()).filter(|k| *k != brightest);
    parts.extend(others.map(|k| (-1.0, layers[k][chart].texels[t])));
    layers[brightest][chart].texels[t] = Texel::mix(&parts);
}

/// Pages of a layer, laid out as those of the whole. Charts that are dark there have become one texel.
pub(super) fn pages(
    placed: &PlacedCharts,
    own: &[usize],
    layer: &[ChartTexels],
    like: &[MapPage],
) -> Vec<MapPage> {
    let dark = |page: &MapPage| MapPage {
        texels: vec![Texel::default(); page.texels.len()],
        ..page.clone()
    };
    let mut pages: Vec<MapPage> = like.iter().map(dark).collect();
    for &k in own {
        let (patch, margin) = (&placed.patches[k], margin(&placed.lattices[k]));
        if patch.texels.len() == layer[k].texels.len() {
            placed.fill(k, &layer[k], margin, &mut pages);
        }
    }
    pages
}

impl PlacedCharts {
    /// Writes the texels of a chart to its page; the margin goes on with the outermost ones.
    pub(super) fn fill(&self, k: usize, patch: &ChartTexels, margin: usize, pages: &mut [MapPage]) {
        let chart: &Chart = &self.charts[k];
        let (place, surface) = (self.places[k], chart.surface as u32);
        let page = &mut pages[place.page];
        for y in 0..patch.height + 2 * margin {
            for x in 0..patch.width + 2 * margin {
                let inner = |at: usize, count: usize| at.saturating_sub(margin).min(count - 1);
                let from = inner(y, patch.height) * patch.width + inner(x, patch.width);
                let to = (place.y + y) * page.width + place.x + x;
                page.texels[to] = patch.texels[from];
                page.surfaces[to] = surface;
            }
        }
    }
}
