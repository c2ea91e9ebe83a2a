//! What panes and mirrors leave of light, lane by lane.
//!
//! A lane of a pane's filter is the pane's transmittance at the mean (eq. 3 under the lane's light) of what its inside lets through,
//! so that filters multiply rows as reflectances do. Neutral panes are exact on any lanes. The same holds for mirrors, with their
//! reflectance at normal incidence.

use super::lanes::Lanes;
use super::passed::{self, Passed, Steps};
use crate::hierarchy::{Crossing, Glazing, Route};
use crate::scene::Scene;
use crate::scene::mirror::Mirror;
use crate::scene::pane::Pane;
use crate::spectrum::BANDS;
use glam::Vec3;

/// Transmittance or reflectance by lane.
pub type Filter = [f32; BANDS];

/// The spectra of panes and mirrors on some lanes.
#[derive(Debug, Clone, Default)]
pub struct Filters {
    /// By material: transmittance of the inside of its pane or reflectance of its mirror, lane by lane; empty for other
    /// materials.
    inside: Vec<Vec<f32>>,
    /// By material: its pane.
    panes: Vec<Option<Pane>>,
    /// Weight of each lane in brightness.
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
            panes: scene.materials.iter().map(|m| m.pane.clone()).collect(),
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

    /// Multiplies a filter by the transmittance of one pane.
    pub fn pass(&self, crossing: &Crossing, filter: &mut Filter) {
        let material = crossing.material as usize;
        let Some(pane) = &self.panes[material] else {
            return;
        };
        let [cosine, thickness, texel] =
            [crossing.cosine, crossing.thickness, crossing.texel].map(f64::from);
        self.multiply(material, pane.passing(cosine, thickness, texel), filter);
    }

    /// Multiplies a filter by the reflectance of one mirror.
    pub fn mirror(&self, material: u32, cosine: f32, filter: &mut Filter) {
        let reflects = |normal| Mirror::reflects(normal, f64::from(cosine));
        self.multiply(material as usize, reflects, filter);
    }

    /// The filter of what light passes.
    pub(crate) fn of(&self, passed: &[[i32; 4]]) -> Filter {
        let mut filter = [1.0; BANDS];
        for &one in passed {
            let one = passed::crossing(one);
            match self.panes[one.material as usize] {
                Some(_) => self.pass(&one, &mut filter),
                None => self.mirror(one.material, one.cosine, &mut filter),
            }
        }
        filter
    }

    /// Can light of a room with these panes and mirrors pass this?
    pub(crate) fn knows(&self, passed: &[[i32; 4]]) -> bool {
        let known = |material: u32| self.inside.get(material as usize);
        passed::is_possible(passed, |material| {
            known(material).is_some_and(|inside| !inside.is_empty())
        })
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

    /// What mirrors on a route and panes between them leave of light; recorded if `kept`.
    pub(crate) fn along(
        &self,
        glazing: Option<Glazing>,
        route: &Route,
        kept: Option<Steps>,
    ) -> Passage {
        if let Some(steps) = kept {
            return self.past(passed::met(glazing.as_ref(), route, steps));
        }
        let mut filter = [1.0; BANDS];
        for &(material, cosine) in route.bounces() {
            self.mirror(material, cosine, &mut filter);
        }
        if let Some(glazing) = glazing {
            for ends in route.points().windows(2) {
                for crossing in glazing.crossings(ends[0].as_vec3(), ends[1].as_vec3()) {
                    self.pass(&crossing, &mut filter);
                }
            }
        }
        Passage::plain(filter)
    }

    /// What is left of light that passes this, and what was passed.
    fn past(&self, passed: Passed) -> Passage {
        Passage {
            filter: self.of(&passed),
            by: vec![(passed, 1.0)],
        }
    }

    /// Rough share of brightness that a filter leaves: the mean over lanes by luminance.
    pub fn brightness(&self, filter: &Filter) -> f64 {
        let lanes = filter.iter().zip(&self.weights);
        lanes.map(|(x, w)| f64::from(*x) * w).sum()
    }
}

/// What is left of light on its way.
#[derive(Debug, Clone)]
pub(crate) struct Passage {
    /// By lane.
    pub(crate) filter: Filter,
    /// If the origin of light is recorded: what the light passes, by shares, so that the filter is the mean of theirs. Else empty.
    pub(crate) by: Vec<(Passed, f32)>,
}

impl Passage {
    /// A passage of which only the filter is recorded.
    fn plain(filter: Filter) -> Self {
        let by = Vec::new();
        Self { filter, by }
    }

    /// A passage past nothing.
    pub(crate) fn free() -> Self {
        Self::plain([1.0; BANDS])
    }
}

/// A weighted mean of what is left of light on several ways, being summed.
#[derive(Debug, Clone)]
pub(crate) struct Tint {
    sum: [f64; BANDS],
    all: f64,
    by: Vec<(Passed, f64)>,
    /// Weight of ways on which nothing is lost.
    free: f64,
}

impl Default for Tint {
    fn default() -> Self {
        Self {
            sum: [0.0; BANDS],
            all: 0.0,
            by: Vec::new(),
            free: 0.0,
        }
    }
}

impl Tint {
    /// Adds a way; none: nothing is lost on it.
    pub(crate) fn add(&mut self, passage: Option<&Passage>, weight: f64) {
        self.all += weight;
        let Some(Passage { filter, by }) = passage else {
            self.free += weight;
            self.sum.iter_mut().for_each(|sum| *sum += weight);
            return;
        };
        for (sum, x) in self.sum.iter_mut().zip(filter) {
            *sum += weight * f64::from(*x);
        }
        let times = |(passed, share): &(Passed, f32)| (passed.clone(), weight * f64::from(*share));
        self.by.extend(by.iter().map(times));
    }

    /// The mean; none without ways.
    pub(crate) fn mean(self) -> Option<Passage> {
        if self.all <= 0.0 {
            return None;
        }
        let share = |weight: f64| (weight / self.all) as f32;
        let by = self.by.into_iter().map(|(p, weight)| (p, share(weight)));
        let mut by: Vec<(Passed, f32)> = by.collect();
        if self.free > 0.0 && !by.is_empty() {
            by.push((Passed::new(), share(self.free)));
        }
        Some(Passage {
            filter: self.sum.map(|x| (x / self.all) as f32),
            by,
        })
    }
}

impl Glass<'_> {
    /// What panes leave of light on a segment, recorded if `kept`; none if it passes no pane.
    pub(crate) fn through(&self, from: Vec3, to: Vec3, kept: Option<Steps>) -> Option<Passage> {
        if let Some(steps) = kept {
            let passed = passed::passed(&self.glazing, from, to, steps);
            return (!passed.is_empty()).then(|| self.filters.past(passed));
        }
        let crossings = self.glazing.crossings(from, to);
        if crossings.is_empty() {
            return None;
        }
        let mut filter = [1.0; BANDS];
        for crossing in &crossings {
            self.filters.pass(crossing, &mut filter);
        }
        Some(Passage::plain(filter))
    }

    /// Share of brightness that panes leave on the segment.
    pub(crate) fn brightness(&self, from: Vec3, to: Vec3) -> f64 {
        let passage = self.through(from, to, None);
        passage.map_or(1.0, |passage| self.filters.brightness(&passage.filter))
    }
}

/// Adds a row times a weight, lane by lane times a filter.
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
