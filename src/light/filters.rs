//! What panes and mirrors leave of light, lane by lane.
//!
//! A lane of a pane's filter is the pane's transmittance at the mean (eq. 3 under the lane's light) of what its inside lets through,
//! so that filters multiply rows as reflectances do. Neutral panes are exact on any lanes. The same holds for mirrors, with their
//! reflectance at normal incidence.

use super::lanes::Lanes;
use super::passed::{self, Passed, Steps};
use crate::geometry::vectors::{Octet, exp};
use crate::hierarchy::{Crossing, Glazing, Route};
use crate::scene::Scene;
use crate::scene::mirror::Mirror;
use crate::scene::pane::{Pane, PaneKind, Slab};
use crate::spectrum::BANDS;
use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use glam::Vec3;
use std::collections::BTreeMap;

/// Transmittance or reflectance by lane.
pub type Filter = [f32; BANDS];

/// The spectra of panes and mirrors on some lanes.
#[derive(Debug, Clone, Default)]
pub struct Filters {
    /// By material and lane: reflectance of its mirror, transmittance of its paint, logarithm of that of the inside of its glass; empty for
    /// other materials. The last number fills the octet.
    inside: Vec<Vec<Octet>>,
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
            if (material.pane.as_ref()).is_some_and(|p| matches!(p.kind, PaneKind::Glass { .. })) {
                // Finite, as light may go no way at all through what is black; a mean may exceed 1 by a rounding.
                row.iter_mut()
                    .for_each(|x| *x = x.clamp(0.0, 1.0).ln().max(f32::MIN));
            }
            let octet = |some: &[f32]| Octet(std::array::from_fn(|k| some[k.min(some.len() - 1)]));
            row.chunks(8).map(octet).collect()
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
        match pane.slab(cosine, thickness, texel) {
            Some((slab, share)) => {
                dispatch!(Level::new(), simd => {
                    through(simd, &slab, share, &self.inside[material], filter);
                });
            }
            None => self.multiply(material, pane.passing(cosine, thickness, texel), filter),
        }
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
        for (x, inside) in filter.chunks_exact_mut(8).zip(&self.inside[material]) {
            for (x, inside) in x.iter_mut().zip(inside.0) {
                *x *= passing(f64::from(inside)) as f32;
            }
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

/// Multiplies a filter by what a share of a slab lets through, of which the inside's transmittance has these logarithms:
/// [`Pane::passing`] for eight lanes at once, with one power for each and one division.
#[inline(always)]
fn through<S: Simd>(simd: S, slab: &Slab, share: f64, logs: &[Octet], filter: &mut Filter) {
    let c = |x: f64| f32x8::splat(simd, x as f32);
    // Along the face nothing gets in. A way that is no number of f32 would make a clear pane black.
    let (way, share) = slab.way.map_or((0.0, 0.0), |way| (way.min(1e30), share));
    let way = c(way);
    // `(1 - R)^2 a / (1 - R^2 a^2)` of both polarisations; none where all is reflected, as far as f32 can tell.
    let [(once_s, twice_s), (once_p, twice_p)] = slab.reflected.map(|r| match r < 1.0 - 1e-7 {
        true => (c(0.5 * share * (1.0 - r) * (1.0 - r)), c(r * r)),
        false => (c(0.0), c(0.0)),
    });
    for (x, log) in filter.chunks_exact_mut(8).zip(logs) {
        let a = exp(way * log.load(simd));
        let a2 = a * a;
        let [below_s, below_p] = [twice_s, twice_p].map(|twice| 1.0 - twice * a2);
        let above = once_s.mul_add(below_p, once_p * below_s);
        let passes = a * above / (below_s * below_p);
        (f32x8::from_slice(simd, x) * passes).store_slice(x);
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
    by: BTreeMap<Passed, f64>,
    /// Weight of ways on which nothing is lost.
    free: f64,
}

impl Default for Tint {
    fn default() -> Self {
        Self {
            sum: [0.0; BANDS],
            all: 0.0,
            by: BTreeMap::new(),
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
        for (passed, share) in by {
            let weight = weight * f64::from(*share);
            // Most rays pass what others passed, too.
            match self.by.get_mut(passed) {
                Some(sum) => *sum += weight,
                None => _ = self.by.insert(passed.clone(), weight),
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// All lanes of glass at once, and each by itself in f64.
    #[test]
    fn eight_lanes_of_glass_are_what_each_is() {
        let insides = [0.0, 1e-30, 1e-3, 0.2, 0.5, 0.9, 0.999, 1.0];
        let logs = [Octet(insides.map(|x: f64| (x.ln() as f32).max(f32::MIN)))];
        for level in crate::geometry::vectors::levels() {
            for ior in [1.0, 1.33, 1.5, 2.4, 1e9] {
                for (thickness, share) in [
                    (0.0, 1.0),
                    (1.0, 1.0),
                    (0.3, 0.7),
                    (20.0, 0.5),
                    (1e300, 1.0),
                ] {
                    for cosine in [0.0, 1e-12, 0.01, 0.3, 0.7, 1.0] {
                        let slab = Slab::new(ior, thickness, cosine);
                        let mut filter = [0.5; BANDS];
                        dispatch!(level, simd => through(simd, &slab, share, &logs, &mut filter));
                        for (inside, x) in insides.into_iter().zip(filter) {
                            let want = 0.5 * share * slab.passes(inside);
                            let off = (f64::from(x) - want).abs();
                            assert!(
                                off < 1e-6,
                                "{ior} {thickness} {cosine} {inside}: {x} {want}"
                            );
                        }
                    }
                }
            }
        }
    }
}
