//! What panes and mirrors leave of light, lane by lane.
//!
//! A lane of a filter is the pane's transmittance for the mean (eq. 3 under the lane's light) of what its inside lets through, so that
//! filters multiply rows as reflectances do. Neutral panes are exact on any lanes. The same of mirrors, with what they reflect at
//! normal incidence.

use super::lanes::Lanes;
use crate::hierarchy::{Crossing, Glazing, Route};
use crate::scene::Scene;
use crate::scene::mirror::Mirror;
use crate::spectrum::LEAVES;
use glam::Vec3;

/// What passes, by lane.
pub type Filter = [f32; LEAVES];

/// The spectra of panes and mirrors on some lanes.
#[derive(Debug, Clone, Default)]
pub struct Filters {
    /// By material: what the inside of its pane lets through or its mirror reflects, lane by lane; empty for what is neither.
    inside: Vec<Vec<f32>>,
    /// How much each lane counts in brightness.
    weights: Vec<f64>,
}

/// The panes of a room and their spectra.
#[derive(Clone, Copy)]
pub struct Glass<'a> {
    /// Where panes are.
    pub glazing: Glazing<'a>,
    /// Their spectra.
    pub filters: &'a Filters,
}

impl Filters {
    /// For the panes and mirrors of a scene.
    pub fn new(scene: &Scene, lanes: &Lanes) -> Self {
        let inside = scene.materials.iter().map(|material| {
            let (spectrum, neutral) = match (&material.pane, &material.mirror) {
                (Some(pane), _) => (pane.spectrum(), pane.is_neutral()),
                (_, Some(mirror)) => (&mirror.reflectance, mirror.is_neutral()),
                _ => return Vec::new(),
            };
            let mut row = vec![spectrum[0] as f32; lanes.len()];
            if !neutral {
                lanes.averages(spectrum, &mut row);
            }
            row
        });
        let all: f64 = lanes.xyz().iter().map(|xyz| xyz[1].abs()).sum();
        let weights = lanes
            .xyz()
            .iter()
            .map(|xyz| xyz[1].abs() / all.max(f64::MIN_POSITIVE));
        Self {
            inside: inside.collect(),
            weights: weights.collect(),
        }
    }

    /// Lanes in use.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// No lanes?
    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// Multiplies a filter by what one pane lets through.
    pub fn pass(&self, scene: &Scene, crossing: &Crossing, filter: &mut Filter) {
        let material = crossing.material as usize;
        let Some(pane) = &scene.materials[material].pane else {
            return;
        };
        let [cosine, thickness, texel] =
            [crossing.cosine, crossing.thickness, crossing.texel].map(f64::from);
        self.multiply(material, pane.passing(cosine, thickness, texel), filter);
    }

    /// Multiplies a filter by what one mirror reflects.
    pub fn mirror(&self, material: u32, cosine: f32, filter: &mut Filter) {
        let reflects = |normal| Mirror::reflects(normal, f64::from(cosine));
        self.multiply(material as usize, reflects, filter);
    }

    fn multiply(&self, material: usize, passing: impl Fn(f64) -> f64, filter: &mut Filter) {
        let mut last = (f32::NAN, 1.0);
        for (x, &inside) in filter.iter_mut().zip(&self.inside[material]) {
            if inside != last.0 {
                last = (inside, passing(f64::from(inside)) as f32);
            }
            *x *= last.1;
        }
    }

    /// What is left of light by way of mirrors, and of panes between them.
    pub fn along(&self, glazing: Option<Glazing>, route: &Route) -> Filter {
        let mut filter = [1.0; LEAVES];
        for &(material, cosine) in route.bounces() {
            self.mirror(material, cosine, &mut filter);
        }
        let Some(glazing) = glazing else {
            return filter;
        };
        for ends in route.points().windows(2) {
            for crossing in glazing.crossings(ends[0].as_vec3(), ends[1].as_vec3()) {
                self.pass(glazing.scene, &crossing, &mut filter);
            }
        }
        filter
    }

    /// About how bright light is that has passed, as a share: the mean over lanes by luminance.
    pub fn brightness(&self, filter: &Filter) -> f64 {
        let lanes = filter.iter().zip(&self.weights);
        lanes.map(|(x, w)| f64::from(*x) * w).sum()
    }
}

/// A weighted mean of filters, being summed.
#[derive(Debug, Clone, Copy)]
pub struct Tint {
    sum: [f64; LEAVES],
    all: f64,
}

impl Default for Tint {
    fn default() -> Self {
        Self {
            sum: [0.0; LEAVES],
            all: 0.0,
        }
    }
}

impl Tint {
    /// Adds a filter.
    pub fn add(&mut self, filter: &Filter, weight: f64) {
        self.all += weight;
        for (sum, x) in self.sum.iter_mut().zip(filter) {
            *sum += weight * f64::from(*x);
        }
    }

    /// The mean; none of nothing.
    pub fn mean(&self) -> Option<Filter> {
        (self.all > 0.0).then(|| self.sum.map(|x| (x / self.all) as f32))
    }
}

impl Glass<'_> {
    /// What panes leave of light on a segment; none if it passes none.
    pub fn through(&self, from: Vec3, to: Vec3) -> Option<Filter> {
        let crossings = self.glazing.crossings(from, to);
        if crossings.is_empty() {
            return None;
        }
        let mut filter = [1.0; LEAVES];
        for crossing in &crossings {
            self.filters.pass(self.glazing.scene, crossing, &mut filter);
        }
        Some(filter)
    }

    /// How bright light is that has passed the segment, as a share.
    pub fn brightness(&self, from: Vec3, to: Vec3) -> f64 {
        let filter = self.through(from, to);
        filter.map_or(1.0, |filter| self.filters.brightness(&filter))
    }
}

/// Adds a row times a weight, of each lane what a filter leaves.
pub(crate) fn accumulate(sum: &mut [f32], weight: f32, row: &[f32], tint: Option<&Filter>) {
    match tint {
        None => {
            for (x, r) in sum.iter_mut().zip(row) {
                *x += weight * r;
            }
        }
        Some(tint) => {
            for ((x, r), t) in sum.iter_mut().zip(row).zip(tint) {
                *x += weight * r * t;
            }
        }
    }
}
