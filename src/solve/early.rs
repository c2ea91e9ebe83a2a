//! The light of a bake that must end before its first round is done: where rays from the lamps landed, see [`landing`](super::landing), and
//! what random points see of a sky.
//!
//! A leaf has, as irradiance `E = flux / area`, the light landed on the smallest node around it that enough rays met, and everywhere the same
//! light besides: what landed light is reflected where it lands, spread over the room and divided by `1 - rho` of its mean albedo. All of this
//! light has the mean spectrum of lamps and sky. It is not a solution, and its error is unknown.

use super::direct::{Direct, receiver};
use super::landed::Landing;
use super::leaf_rays::LeafRays;
use super::refinement::Refinement;
use super::{Bake, Solution};
use crate::geometry::sampling::sequence02;
use crate::hierarchy::{NONE, TreeSize};
use crate::light::Rows;
use crate::spectrum::BANDS;
use crate::transport::{Gathered, Gatherer, Memory, Receiver};
use rayon::prelude::*;
use std::borrow::Cow;

/// Rays that suffice for the light of a node: its standard deviation is then a quarter.
const RAYS: u32 = 16;

/// Points that look at a sky: [`RAYS`] for each of a thousand patches.
const GLANCES: u32 = 16_384;

/// Mean albedo that is believed at the most, as in the guess of the white, so that the sum of all bounces is finite.
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
        let (mut landings, from_sky) = self.landings_of_sky();
        landings.extend(&self.room.landings);
        let direct = self.landed_on(&leaves, &landings);
        let spectrum = self.spectrum_of_lamps(&leaves, &sources.emission, from_sky);
        let area = self.refinement.tree.counted().max(f64::MIN_POSITIVE);
        let albedos = self.albedos(&sources.reflectance, &spectrum);
        let counted: Vec<f64> = (leaves.iter())
            .map(|&leaf| self.refinement.counted(leaf))
            .collect();
        let mean = |of: &dyn Fn(usize) -> f64| -> f64 {
            (0..leaves.len()).map(|k| counted[k] * of(k)).sum::<f64>() / area
        };
        let albedo = mean(&|k| albedos[k]).min(ALBEDO);
        let even = mean(&|k| direct[k] * albedos[k]) / (1.0 - albedo);
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
        let even = vec![[0.0, 1.0, 0.0]; leaves.len()];
        self.refinement.direct = Direct::known(&leaves, nodes, BANDS, &rows, &even);
        let emitted = self
            .refinement
            .on_nodes::<BANDS>(&sources.emission, &leaves);
        let on_nodes = self.refinement.on_nodes::<BANDS>(&reflected, &leaves);
        let on_nodes = self.without_mirrors::<BANDS>(Cow::Owned(reflected), on_nodes, &leaves);
        self.shine(&leaves, emitted, on_nodes, irradiance);
        self.light_arrives();
    }

    /// Where light of the sky lands, and its flux on each lane: points at random, more where it counts, look at it by few rays.
    fn landings_of_sky(&self) -> (Vec<Landing>, [f32; BANDS]) {
        let (tree, mut sum) = (&self.refinement.tree, [0.0; BANDS]);
        if self.room.outside.is_none() || tree.faces.is_empty() {
            return (Vec::new(), sum);
        }
        let look = |gatherer: &Gatherer, memory: &mut Memory, k: u32| {
            let share = (f64::from(k) + 0.5) / f64::from(GLANCES);
            let (entry, weights) = tree.random(share, sequence02(k, 19));
            let leaf = tree.leaf_at(entry as u32, weights);
            let on_face = receiver(tree, tree.face_node[entry], weights, u64::from(k));
            let to = Receiver {
                leaf: Some(leaf),
                ..on_face
            };
            let mut seen = Gathered::dark();
            gatherer.outside(&to, None, false, memory, &mut seen);
            let node = tree.node(leaf);
            // Rounding may choose the last face though none of it counts.
            let stands_for = match node.counted > 0.0 {
                true => tree.counted() / f64::from(GLANCES) * node.area / node.counted,
                false => 0.0,
            };
            let flux = seen.direct.map(|x| x * stands_for as f32);
            let landing = Landing {
                entry: entry as u32,
                weights: [weights[1], weights[2]].map(|w| w as f32),
                flux: self.solution.lanes.tristimulus(&flux).map(|x| x as f32),
            };
            (landing, flux)
        };
        let found: Vec<_> = self.room.with_sight(|sight| {
            let gatherer = Gatherer {
                shafts: false,
                ..self.gatherer(sight)
            };
            let points = (0..GLANCES).into_par_iter();
            points
                .map_init(Memory::default, |memory, k| look(&gatherer, memory, k))
                .collect()
        });
        for (_, flux) in &found {
            sum = std::array::from_fn(|lane| sum[lane] + flux[lane]);
        }
        (found.into_iter().map(|f| f.0).collect(), sum)
    }

    /// Illuminance of leaves by the rays that landed on or around them.
    fn landed_on(&self, leaves: &[u32], landings: &[Landing]) -> Vec<f64> {
        let tree = &self.refinement.tree;
        let mut sums = vec![(0_u32, 0.0_f64); tree.nodes.len()];
        for landing in landings {
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

    /// Share of the light that each leaf reflects.
    fn albedos(&self, reflectance: &Rows, spectrum: &[f64]) -> Vec<f64> {
        let of = |k: usize| {
            let sent = reflectance.row(k).iter().zip(spectrum);
            let sent: Vec<f32> = sent.map(|(rho, x)| rho * *x as f32).collect();
            self.solution.lanes.tristimulus(&sent)[1]
        };
        (0..reflectance.len()).map(of).collect()
    }

    /// Irradiance on each lane for one lux of the light of all lamps together and of the `sum` from the sky; 0 where none shines.
    fn spectrum_of_lamps(
        &self,
        leaves: &[u32],
        emission: &Rows,
        mut sum: [f32; BANDS],
    ) -> Vec<f64> {
        for (k, &leaf) in leaves.iter().enumerate() {
            let area = self.refinement.tree.node(leaf).area as f32;
            for (sum, x) in sum.iter_mut().zip(emission.row(k)) {
                *sum += area * x;
            }
        }
        let lamps = self.solution.lamps.iter();
        for (light, row) in lamps.filter(|(light, _)| !light.kind.is_dome()) {
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
