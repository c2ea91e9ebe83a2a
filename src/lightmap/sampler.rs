//! Looks at light at places of charts: the place itself where the chart is, else the nearest one on it.

use super::cells::Lattice;
use super::charts::Chart;
use crate::gather::Vertex;
use crate::mesh::looks::Looks;
use glam::DVec2;
use std::collections::HashMap;

/// Where light was looked at for a place of a lattice.
#[derive(Debug, Clone, Copy)]
pub(super) struct LatticeSample {
    /// The look's number.
    pub(super) look: u32,
    /// In the chart's plane.
    pub(super) at: DVec2,
    pub(super) vertex: Vertex,
}

/// All looks so far, by chart and place.
pub(super) struct Sampler<'a> {
    pub(super) looks: Looks<'a>,
    known: HashMap<(u32, [u32; 2]), LatticeSample>,
}

impl<'a> Sampler<'a> {
    pub(super) fn new(looks: Looks<'a>) -> Self {
        Self {
            looks,
            known: HashMap::new(),
        }
    }

    /// Asks for a place of a chart's lattice that is to stand for that area besides what it stood for before; it is looked at when the looks are completed.
    pub(super) fn want(
        &mut self,
        (number, chart): (u32, &Chart),
        lattice: &Lattice,
        point: [u32; 2],
        area: f64,
    ) -> LatticeSample {
        let point = if lattice.single { [u32::MAX; 2] } else { point };
        if let Some(sample) = self.known.get(&(number, point)) {
            self.looks.stand_for(sample.look, area);
            return *sample;
        }
        let at = match lattice.single {
            true => 0.5 * chart.size,
            false => lattice.at(point),
        };
        let sample = self.want_at(chart, at, area);
        self.known.insert((number, point), sample);
        sample
    }

    /// Asks for any place.
    pub(super) fn want_at(&mut self, chart: &Chart, at: DVec2, area: f64) -> LatticeSample {
        // A chart has a triangle at least, and that a nearest place.
        let (facet, weights, _) = chart.finder.nearest(&chart.flat, at).unwrap_or_default();
        let vertex = chart.vertex(facet, weights);
        let at = chart.at(facet, vertex.weights);
        let look = self.looks.want_texel(&vertex, chart.surface, chart.back);
        self.looks.stand_for(look, area);
        LatticeSample { look, at, vertex }
    }

    /// The place of a lattice, if it was asked for.
    pub(super) fn known(
        &self,
        chart: u32,
        lattice: &Lattice,
        point: [u32; 2],
    ) -> Option<&LatticeSample> {
        let point = if lattice.single { [u32::MAX; 2] } else { point };
        self.known.get(&(chart, point))
    }

    /// Tristimulus irradiance that was seen; none: something covers the place.
    pub(super) fn seen(&self, sample: &LatticeSample) -> Option<[f64; 3]> {
        self.looks.at(sample.look).map(|seen| seen.xyz)
    }
}
