//! The light of a bake that must end before its first round is done: where rays from the lamps landed, see [`landing`](super::landing).
//!
//! A leaf has, as irradiance `E = flux / area`, the light landed on the smallest node around it that enough rays met, and the same reflected light
//! everywhere: `E rho / (1 - rho)` of the means over the room. All of this light has the mean spectrum of the lamps. It is not a solution, and its
//! error is unknown.

use super::direct::Direct;
use super::leaf_rays::LeafRays;
use super::refinement::Refinement;
use super::{Bake, Solution};
use crate::hierarchy::{NONE, TreeSize};
use crate::light::Rows;
use crate::spectrum::BANDS;
use std::borrow::Cow;

/// Rays that suffice for the light of a node: its standard deviation is then a quarter.
const RAYS: u32 = 16;

/// Mean albedo that is believed at the most, as in the guess of the white.
const ALBEDO: f64 = 0.9;

impl Bake {
    /// Takes back a first round that was interrupted: to the room as prepared.
    pub(super) fn begin_again(&mut self, grown: &TreeSize) {
        let mut tree = std::mem::take(&mut self.refinement.tree);
        tree.shrink(grown);
        self.refinement = Refinement {
            tree,
            leaf_rays: LeafRays::of_team(self.room.team),
            ..Refinement::default()
        };
        self.solution = Solution::new(&self.room);
    }

    /// Lights the room by where rays from the lamps landed.
    pub(super) fn light_by_landings(&mut self) {
        let leaves = self.refinement.leaves();
        let (room, refinement) = (&self.room, &mut self.refinement);
        refinement.leaf_rays.open(&refinement.tree);
        refinement.areas = refinement.leaf_rays.areas(&refinement.tree);
        let sources = room
            .painter()
            .paint(&refinement.tree, &leaves, &self.solution.lanes);
        self.solution.light_lamps(room);
        let guess = room.guess(&refinement.tree);
        self.solution.light.white = room.settings.white.unwrap_or(guess.white);
        let direct = self.landed_on(&leaves);
        let spectrum = self.spectrum_of_lamps(&leaves, &sources.emission);
        let area = self.refinement.tree.counted().max(f64::MIN_POSITIVE);
        let landed: f64 = self
            .room
            .landings
            .iter()
            .map(|l| f64::from(l.flux[1]))
            .sum();
        let albedo = self.albedo(&leaves, &sources.reflectance, &spectrum);
        let even = landed / area * albedo / (1.0 - albedo);
        let mut rows = Vec::with_capacity(leaves.len() * BANDS);
        let mut irradiance = Rows::zero(leaves.len(), BANDS);
        let mut reflected = irradiance.clone();
        for (k, direct) in direct.into_iter().enumerate() {
            for (lane, per_lux) in spectrum.iter().enumerate() {
                rows.push((direct * per_lux) as f32);
                let all = ((direct + even) * per_lux) as f32;
                irradiance.row_mut(k)[lane] = all;
                reflected.row_mut(k)[lane] = all * sources.reflectance.row(k)[lane];
            }
        }
        let nodes = self.refinement.tree.nodes.len();
        let even = vec![[0.0, 1.0]; leaves.len()];
        self.refinement.direct = Direct::known(&leaves, nodes, BANDS, &rows, &even);
        let emitted = self
            .refinement
            .on_nodes::<BANDS>(&sources.emission, &leaves);
        let on_nodes = self.refinement.on_nodes::<BANDS>(&reflected, &leaves);
        let on_nodes = self.without_mirrors::<BANDS>(Cow::Owned(reflected), on_nodes, &leaves);
        self.shine(&leaves, emitted, on_nodes, irradiance);
        self.light_arrives();
    }

    /// Illuminance of leaves by the rays that landed on or around them.
    fn landed_on(&self, leaves: &[u32]) -> Vec<f64> {
        let tree = &self.refinement.tree;
        let mut sums = vec![(0_u32, 0.0_f64); tree.nodes.len()];
        for landing in &self.room.landings {
            let [u, v] = landing.weights.map(f64::from);
            let mut node = tree.leaf_at(landing.entry, [1.0 - u - v, u, v]);
            while node != NONE {
                let (rays, flux) = &mut sums[node as usize];
                *rays += 1;
                *flux += f64::from(landing.flux[1]);
                node = tree.node(node).parent;
            }
        }
        let around = |&leaf: &u32| {
            let mut node = leaf;
            while sums[node as usize].0 < RAYS && tree.node(node).parent != NONE {
                node = tree.node(node).parent;
            }
            sums[node as usize].1 / self.refinement.areas[node as usize]
        };
        leaves.iter().map(around).collect()
    }

    /// Share of the lamps' light that surfaces reflect on average over the area that counts; at most [`ALBEDO`], so that the sum of all
    /// bounces is finite.
    fn albedo(&self, leaves: &[u32], reflectance: &Rows, spectrum: &[f64]) -> f64 {
        let (lanes, tree) = (&self.solution.lanes, &self.refinement.tree);
        let sum = leaves.iter().enumerate().map(|(k, &leaf)| {
            let sent = reflectance.row(k).iter().zip(spectrum);
            let sent: Vec<f32> = sent.map(|(rho, x)| rho * *x as f32).collect();
            tree.node(leaf).counted * lanes.tristimulus(&sent)[1]
        });
        (sum.sum::<f64>() / tree.counted().max(f64::MIN_POSITIVE)).min(ALBEDO)
    }

    /// Irradiance on each lane for one lux of the light of all lamps together; 0 where none shines.
    fn spectrum_of_lamps(&self, leaves: &[u32], emission: &Rows) -> Vec<f64> {
        let mut sum = [0.0_f32; BANDS];
        for (k, &leaf) in leaves.iter().enumerate() {
            let area = self.refinement.tree.node(leaf).area as f32;
            for (sum, x) in sum.iter_mut().zip(emission.row(k)) {
                *sum += area * x;
            }
        }
        for (light, row) in &self.solution.lamps {
            let solid = super::punctual::solid_angle(light.kind);
            // Parallel light counts as if it met a quarter of all surfaces, as in the guess of the white.
            let solid = solid.unwrap_or(0.25 * self.refinement.tree.counted()) as f32;
            for (sum, x) in sum.iter_mut().zip(row) {
                *sum += solid * x;
            }
        }
        let lux = self.solution.lanes.tristimulus(&sum)[1];
        let scale = if lux > 0.0 { 1.0 / lux } else { 0.0 };
        sum.map(|x| scale * f64::from(x)).to_vec()
    }
}
