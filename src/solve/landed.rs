//! Where rays from lamps landed on leaves, compared with the light found at the leaves' points.

use crate::hierarchy::Tree;
use crate::light::brightness;
use std::collections::HashMap;

/// Landed light must exceed its noise by this many standard deviations: ten rays where points found nothing.
const SIGMAS: f64 = 3.0;

/// A leaf on which this many rays landed is gathered at, however small: eight are .02 % of the light of all lamps.
const MANY: f64 = 8.0;

/// Where a ray from a lamp met a front.
#[derive(Debug, Clone, Copy)]
pub(super) struct Landing {
    /// Entry of the hierarchy's faces, and the weights of its second and third corner.
    pub(super) entry: u32,
    pub(super) weights: [f32; 2],
    /// Tristimulus flux of the ray, lm.
    pub(super) flux: [f32; 3],
}

/// Light that landed on leaves.
#[derive(Debug, Default)]
pub(super) struct Landed {
    /// By leaf: brightness times area, and the square of its standard deviation.
    sums: HashMap<u32, [f64; 2]>,
}

impl Landed {
    /// Landings on the leaves of a hierarchy, as shares of a white.
    pub(super) fn new(tree: &Tree, landings: &[Landing], white: [f64; 3]) -> Self {
        let mut sums: HashMap<u32, [f64; 2]> = HashMap::new();
        for landing in landings {
            let [u, v] = landing.weights.map(f64::from);
            let leaf = tree.leaf_at(landing.entry, [1.0 - u - v, u, v]);
            let bright = brightness(landing.flux.map(f64::from), white);
            let [sum, square] = sums.entry(leaf).or_default();
            *sum += bright;
            *square += bright * bright;
        }
        Self { sums }
    }

    /// Did more rays land on a leaf than [`MANY`]?
    pub(super) fn matters(&self, leaf: u32) -> bool {
        let sums = self.sums.get(&leaf);
        sums.is_some_and(|[sum, square]| sum * sum > MANY * square)
    }

    /// How much brighter a leaf is on average than its points found; 0 where that may be chance.
    pub(super) fn missing(&self, leaf: u32, area: f64, found: f64) -> f64 {
        let Some([sum, square]) = self.sums.get(&leaf) else {
            return 0.0;
        };
        let missing = sum / area - found;
        match missing * area > SIGMAS * square.sqrt() {
            true => missing,
            false => 0.0,
        }
    }
}
