//! Panes and mirrors between leaves that look for themselves: which of their rays pass what, and what that leaves of each lane.
//!
//! Rays are kept from round to round and lanes are not, so what is kept of a ray is what it passes. Angles and thicknesses are rounded:
//! a room has few panes and mirrors, and thousands of rays then share one filter.

use crate::hierarchy::{Crossing, Glazing, Route};
use crate::light::{Filters, Rows, padded};
use crate::scene::Scene;
use crate::spectrum::LEAVES;
use glam::Vec3;
use std::collections::BTreeMap;

/// Steps of the cosine of incidence and of a texture's value from 0 to 1, each taken at its middle: transmittance bends by less than 1e-3
/// over a step but for the last 2 degrees before grazing.
const STEPS: f32 = 128.0;
/// Steps of thickness to a doubling: 2 % of what is absorbed.
const OCTAVE: f32 = 32.0;

/// What a ray passes, rounded: material, cosine, thickness, texture's value of each pane; of a mirror the first two.
pub(super) type Passed = Vec<[i32; 4]>;

/// What the rays of leaves pass.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tints {
    /// For each ray the filter that it passes, counted from 1; 0: none. Empty in a room without panes and mirrors.
    of: Vec<u32>,
    /// The filters that rays pass.
    known: BTreeMap<Passed, u32>,
    /// What they leave, by lane.
    rows: Rows,
}

/// What a ray to `to` passes.
pub(super) fn passed(glazing: &Glazing, from: Vec3, to: Vec3) -> Passed {
    let crossings = glazing.crossings(from, to);
    let mut passed: Passed = crossings.iter().map(rounded).collect();
    passed.sort_unstable();
    passed
}

/// What a ray meets and passes that mirrors send on.
pub(super) fn met(glazing: Option<&Glazing>, route: &Route) -> Passed {
    let mirror = |&(material, cosine): &(u32, f32)| {
        rounded(&Crossing {
            material,
            cosine,
            thickness: 0.0,
            texel: 1.0,
        })
    };
    let mut all: Passed = route.bounces().iter().map(mirror).collect();
    if let Some(glazing) = glazing {
        for ends in route.points().windows(2) {
            all.extend(passed(glazing, ends[0].as_vec3(), ends[1].as_vec3()));
        }
    }
    all.sort_unstable();
    all
}

fn rounded(crossing: &Crossing) -> [i32; 4] {
    let step = |x: f32| ((x * STEPS) as i32).clamp(0, STEPS as i32 - 1);
    let thickness = match crossing.thickness > 0.0 {
        true => (OCTAVE * crossing.thickness.log2()).round() as i32,
        false => i32::MIN,
    };
    // A plain pane has the value 1, whole.
    let texel = if crossing.texel >= 1.0 {
        STEPS as i32
    } else {
        step(crossing.texel)
    };
    [
        crossing.material as i32,
        step(crossing.cosine),
        thickness,
        texel,
    ]
}

fn crossing([material, cosine, thickness, texel]: [i32; 4]) -> Crossing {
    let middle = |k: i32| ((k as f32 + 0.5) / STEPS).min(1.0);
    Crossing {
        material: material as u32,
        cosine: middle(cosine),
        thickness: match thickness {
            i32::MIN => 0.0,
            k => (k as f32 / OCTAVE).exp2(),
        },
        texel: middle(texel),
    }
}

impl Tints {
    /// No ray passes anything?
    pub(super) fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// Notes what the rays of one more leaf pass, of which there are `count`: those that pass anything, in order.
    pub(super) fn extend(&mut self, count: usize, passed: Vec<(u32, Passed)>) {
        let first = self.of.len();
        self.of.resize(first + count, 0);
        for (ray, passed) in passed {
            let next = self.known.len() as u32 + 1;
            self.of[first + ray as usize] = *self.known.entry(passed).or_insert(next);
        }
    }

    /// How many filters rays pass.
    pub(super) fn filters(&self) -> usize {
        self.known.len()
    }

    /// Forgets all rays but the first, and all but the first filters.
    pub(super) fn shrink(&mut self, rays: usize, filters: usize) {
        self.of.truncate(rays);
        self.known.retain(|_, number| *number as usize <= filters);
    }

    /// Works the filters out for these lanes.
    pub(super) fn on(&mut self, scene: &Scene, filters: &Filters) {
        if self.is_empty() {
            return;
        }
        self.rows = Rows::zero(self.known.len(), padded(filters.len()));
        for (passed, &number) in &self.known {
            let mut filter = [1.0; LEAVES];
            for &one in passed {
                let one = crossing(one);
                match scene.materials[one.material as usize].mirror {
                    Some(_) => filters.mirror(one.material, one.cosine, &mut filter),
                    None => filters.pass(scene, &one, &mut filter),
                }
            }
            let row = self.rows.row_mut(number as usize - 1);
            row.copy_from_slice(&filter[..row.len()]);
        }
    }

    /// What a ray's filter leaves of each lane; none if it passes none.
    pub(super) fn row<const L: usize>(&self, ray: usize) -> Option<&[f32; L]> {
        let number = self.of.get(ray)?.checked_sub(1)?;
        self.rows.all::<L>().get(number as usize)
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        4 * self.of.len() + self.rows.bytes()
    }
}
