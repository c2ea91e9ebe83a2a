//! From the solved light to maps.

use super::aliasing::Smoothed;
use super::cells::ChartCell;
use super::charts::{Chart, charts};
use super::grow::{Budget, LightmapGrowth};
use super::maps::{LightMaps, MapPage, PlacedCharts, margin};
use super::pack::pack;
use super::sampler::{LatticeSample, Sampler};
use super::seams::close;
use super::texels::{ChartTexels, Corners, Texel, TexelKey, lend, patch};
use super::unwrap::Conformal;
use crate::gather::{Baked, BakedSurface, LayerLanes, MapPlace, SurfaceResponse};
use crate::mesh::looks::Looks;
use crate::mesh::measure::summed;
use crate::mesh::turns::Turns;
use crate::solve::{Bake, Effort, GatherQuality};
use glam::DVec2;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Looks at the most at an asked-for error of [`AT`]; half as many at twice the error.
const MOST_LOOKS: f64 = 262_144.0;
const AT: f64 = 0.5;
/// Texels at the most, margins included, besides those that every chart has. The error between a garage's is .76, .59 and .57 at `--error 1` with half as
/// many, nine tenths and a quarter more, and .51 and .50 at .5 with as many and half more; they take 1.8 MB there.
const MOST_TEXELS: usize = 1_048_576;

/// What bounds light maps besides their error.
pub struct MapLimits<'a> {
    /// Texels along an axis of a page at the most; 16 or more.
    pub page: usize,
    /// Texels of all pages at the most; every chart has one with its margin in any case. None: as many as the error may need.
    pub texels: Option<usize>,
    /// Is light that comes straight from lamps and the sky left out?
    pub indirect: bool,
    /// Is it time to end? What is not looked at then shows the solved light as it is.
    pub late: &'a (dyn Fn() -> bool + Sync),
}

impl Default for MapLimits<'_> {
    fn default() -> Self {
        Self {
            page: 1024,
            texels: None,
            indirect: false,
            late: &|| false,
        }
    }
}

/// Number and lanes of a layer.
pub(super) type NumberedLayer<'a> = (usize, &'a LayerLanes);

impl Bake {
    /// The light of the room in maps, whose error between texels, measured, is within what light at points leaves of the error asked for.
    /// `progress` is told (done, of) in looks of the present pass.
    pub fn light_maps(&self, limits: &MapLimits, progress: &dyn Fn(usize, usize)) -> LightMaps {
        let spaces = self.spaces();
        let all = charts(self.scene(), self.mesh(), self.tree(), &spaces, &Conformal);
        let mut looks = Looks::new(
            self,
            spaces.clone(),
            GatherQuality::Vertex(Effort::default()),
            limits.late,
        );
        looks.indirect = limits.indirect;
        let more = AT / self.settings().error;
        let budget = Budget {
            looks: usize::MAX,
            texels: usize::MAX,
            page: limits.page,
        };
        let mut growth = LightmapGrowth::new(self, all, Sampler::new(looks), budget);
        let allowed = self.error_between();
        growth.unknown = allowed[1] * allowed[1];
        growth.begin(progress);
        // What every chart needs in any case comes on top.
        growth.budget.looks = growth.sampler.looks.len() + (MOST_LOOKS * more) as usize;
        let most = growth.texels() + MOST_TEXELS;
        growth.budget.texels = limits.texels.unwrap_or(most);
        let area = growth.seen_area();
        let points = growth.points(self, 0, progress);
        let samples = growth.compared(&points, &self.placed(&growth, &Vec::new(), None).0);
        let before = summed(&samples, allowed, None);
        growth.noise = before.noise * before.noise;
        let mut turns = Turns::new(area, growth.cells.len(), before);
        loop {
            let end = growth.grow(turns.aim, progress);
            let points = growth.points(self, turns.turn, progress);
            growth.even_out();
            let samples = growth.compared(&points, &self.placed(&growth, &Vec::new(), None).0);
            let found = summed(&samples, allowed, None);
            let ended = (end, (limits.late)());
            if turns.is_over(found, growth.cells.len(), ended, growth.sum()) {
                let smoothed = growth.smooth(allowed[1], progress);
                growth.even_out();
                let (mut placed, covered) = self.placed(&growth, &smoothed, None);
                close(self, &growth.charts, &spaces, &mut placed);
                let samples = growth.compared(&points, &placed);
                let layers = self.layers_of_maps(&growth, &smoothed, &spaces, &placed);
                let mut maps = self.written(growth, placed, &layers);
                maps.indirect = limits.indirect;
                maps.baked.covered = covered;
                maps.baked.interpolation = Some(summed(&samples, allowed, None));
                return maps;
            }
            growth.learn(&points, &samples);
        }
    }

    /// The charts' texels, and how many places something covers. Charts move out of the growth only at its end, so these are
    /// copies. `part`: number and lanes of the layer whose light they have; none: all light.
    pub(super) fn placed(
        &self,
        growth: &LightmapGrowth,
        smoothed: &Smoothed,
        part: Option<NumberedLayer>,
    ) -> (PlacedCharts, usize) {
        let looks = self.looks(self.upsampler());
        let mut cells: Vec<Vec<&ChartCell>> = vec![Vec::new(); growth.charts.len()];
        for cell in &growth.cells {
            cells[cell.chart as usize].push(cell);
        }
        let mut means: HashMap<TexelKey, &[(f64, LatticeSample)]> = HashMap::new();
        means.extend(smoothed.iter().map(|(key, parts)| (*key, parts.as_slice())));
        let made: Vec<(ChartTexels, usize)> = (0..growth.charts.len())
            .into_par_iter()
            .map(|k| {
                let (chart, lattice) = (&growth.charts[k], &growth.lattices[k]);
                let look = &looks[self.scene().surfaces[chart.surface].material];
                let texel =
                    |sample: &LatticeSample| self.texel_of(growth, chart, look, part, sample);
                let mut corners = Corners::new();
                for point in cells[k].iter().flat_map(|cell| cell.corners()) {
                    corners.entry(point).or_insert_with(|| {
                        let own = growth
                            .sampler
                            .known(k as u32, lattice, point)
                            .and_then(texel);
                        let parts = means.get(&(k as u32, point)).into_iter().copied().flatten();
                        let parts: Vec<(f64, Texel)> =
                            parts.filter_map(|(w, s)| Some((*w, texel(s)?))).collect();
                        let sum: f64 = parts.iter().map(|(w, _)| w).sum();
                        match own.is_some() && sum > 0.0 {
                            true => Some(Texel::mix(
                                &parts.iter().map(|(w, t)| (w / sum, *t)).collect::<Vec<_>>(),
                            )),
                            false => own,
                        }
                    });
                }
                let covered = lend(&mut corners, &cells[k], Texel::mean);
                (patch(lattice, &cells[k], &corners), covered)
            })
            .collect();
        let covered = made.iter().map(|(_, covered)| covered).sum();
        let patches = made.into_iter().map(|(patch, _)| patch).collect();
        let placed = PlacedCharts {
            sizes: growth.charts.iter().map(|c| c.size).collect(),
            lattices: growth.lattices.clone(),
            patches,
            places: Vec::new(),
            charts: Vec::new(),
        };
        (placed, covered)
    }

    /// What was seen at a place; none: something covers it.
    fn texel_of(
        &self,
        growth: &LightmapGrowth,
        chart: &Chart,
        look: &SurfaceResponse,
        part: Option<NumberedLayer>,
        sample: &LatticeSample,
    ) -> Option<Texel> {
        let factor = growth.factors.get(sample.look as usize).unwrap_or(&1.0);
        let row = growth
            .sampler
            .looks
            .at(sample.look)?
            .row
            .map(|x| factor * x);
        if let Some((k, lanes)) = part {
            let shown = (&sample.vertex, chart.back, &row);
            let irradiance = self.lanes().tristimulus(&lanes.of(&row));
            return Some(Texel {
                irradiance: irradiance.map(|x| x as f32),
                light: self.layer(k, lanes, shown, look),
            });
        }
        let vertex = self.vertex(&sample.vertex, chart.back, &row, look);
        Some(Texel {
            irradiance: vertex.irradiance,
            light: vertex.light,
        })
    }

    /// Pages, and the mesh with its coordinates on them.
    fn written(
        &self,
        growth: LightmapGrowth,
        mut placed: PlacedCharts,
        layers: &[Vec<ChartTexels>],
    ) -> LightMaps {
        placed.charts = growth.charts;
        let shares = placed.share_dark();
        let outer = |k: usize| {
            let (patch, margin) = (&placed.patches[k], margin(&placed.lattices[k]));
            [patch.width + 2 * margin, patch.height + 2 * margin]
        };
        let own: Vec<usize> = (0..shares.len()).filter(|&k| shares[k] == k).collect();
        let sizes: Vec<[usize; 2]> = own.iter().map(|&k| outer(k)).collect();
        let (found, pages) = pack(&sizes, growth.budget.page);
        let place = |k: &usize| own.binary_search(k).map(|at| found[at]).unwrap_or_default();
        placed.places = shares.iter().map(place).collect();
        let page = |[width, height]: [usize; 2]| MapPage {
            width,
            height,
            texels: vec![Texel::default(); width * height],
            surfaces: vec![u32::MAX; width * height],
        };
        let mut pages: Vec<MapPage> = pages.into_iter().map(page).collect();
        for &k in &own {
            placed.fill(
                k,
                &placed.patches[k],
                margin(&placed.lattices[k]),
                &mut pages,
            );
        }
        let layers = layers
            .iter()
            .map(|layer| super::layers::pages(&placed, &own, layer, &pages));
        let layers = layers.collect();
        let mut baked = Baked {
            rays: growth.sampler.looks.rays,
            ..Baked::default()
        };
        self.meshes(&placed, &pages, &mut baked);
        LightMaps {
            charts: placed.charts.len(),
            indirect: false,
            looked: growth.sampler.looks.len(),
            pages,
            layers,
            baked,
            placed,
        }
    }

    /// The room's own mesh, a part for each side of a surface and page.
    fn meshes(&self, placed: &PlacedCharts, pages: &[MapPage], baked: &mut Baked) {
        let mut parts: BTreeMap<(usize, bool, usize), Vec<usize>> = BTreeMap::new();
        for (k, chart) in placed.charts.iter().enumerate() {
            let key = (chart.surface, chart.back, placed.places[k].page);
            parts.entry(key).or_default().push(k);
        }
        let looks = self.looks(self.upsampler());
        for ((number, back, page), charts) in parts {
            let look = &looks[self.scene().surfaces[number].material];
            let side = DVec2::new(pages[page].width as f64, pages[page].height as f64);
            let mut surface = BakedSurface {
                surface: number,
                back,
                ..BakedSurface::default()
            };
            let (mut uv, mut of) = (Vec::new(), Vec::new());
            for k in charts {
                let chart = &placed.charts[k];
                let first = surface.vertices.len() as u32;
                for (vertex, (_, at)) in chart.vertices.iter().zip(&chart.points) {
                    let texel = placed.look_up(k, *at);
                    let written = self.vertex(vertex, back, &[0.0; 64], look);
                    surface.vertices.push(crate::gather::BakedVertex {
                        irradiance: texel.irradiance,
                        light: texel.light,
                        ..written
                    });
                    uv.push((placed.on_page(k, *at) / side).as_vec2().to_array());
                }
                for facet in &chart.facets {
                    surface.triangles.push(facet.corners.map(|c| first + c));
                    of.push(facet.triangle);
                }
            }
            surface.map = Some(MapPlace { page, uv });
            baked.surfaces.push(surface);
            baked.of.push(of);
        }
    }
}
