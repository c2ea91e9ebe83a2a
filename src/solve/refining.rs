//! What a round refines by: how bright patches are, how much a change would be seen, and where reflected light varies.

use super::{Bake, by_rays, flux};
use crate::light::{brightness, keenness};
use crate::link::{Demand, MAX_DEPTH, Refined};
use rayon::prelude::*;

/// Levels that a round splits leaves by where reflected light varies.
const LEVELS: usize = 4;

impl Bake {
    /// How bright every node is beside the white: from the last solution, or a guess before the first.
    pub(super) fn brightness_of_nodes(&mut self) -> Vec<f32> {
        let nodes = self.tree.nodes.len();
        if self.rounds.is_empty() {
            let guess = flux::guess(&self.scene, &self.mesh, &self.tree, &self.weights);
            self.light.white = self.settings.white.unwrap_or(guess.white);
            return guess.bright;
        }
        let light = &self.light;
        (0..nodes).map(|k| light.bright_reflected[k]).collect()
    }

    /// How much lightness a change of irradiance makes at every node, from the last solution; 1 before the first.
    pub(super) fn keenness(&self) -> Vec<f32> {
        if self.rounds.is_empty() {
            return vec![1.0; self.tree.nodes.len()];
        }
        let mut keen = vec![0.0_f32; self.tree.nodes.len()];
        for (k, &leaf) in self.light.leaves.iter().enumerate() {
            let h = brightness(
                self.lanes.tristimulus(self.light.irradiance.row(k)),
                self.light.white,
            );
            keen[leaf as usize] = keenness(h) as f32;
        }
        for k in (0..keen.len()).rev() {
            let node = &self.tree.nodes[k];
            if !node.is_leaf() {
                let sum: f64 = node
                    .child_range()
                    .map(|c| f64::from(keen[c as usize]) * self.tree.node(c).area)
                    .sum();
                keen[k] = (sum / node.area) as f32;
            }
        }
        keen
    }

    /// Refines the links until none exceeds the demand.
    pub(super) fn refine_links(&mut self, demand: &Demand) -> Refined {
        let mut tree = std::mem::take(&mut self.tree);
        let mut graph = std::mem::take(&mut self.graph);
        let seed = self.settings.seed;
        let refined = self.with_sight(|_, sight| graph.refine(&mut tree, sight, seed, demand));
        (self.tree, self.graph) = (tree, graph);
        refined
    }

    /// Learns how new leaves look out; returns the rays cast.
    pub(super) fn look_out(&mut self) -> u64 {
        let mut outlook = std::mem::take(&mut self.outlook);
        let seed = self.settings.seed;
        let rays = self.with_sight(|bake, sight| {
            if by_rays(sight) {
                outlook.look(&bake.tree, sight, &bake.hemisphere, seed)
            } else {
                outlook.extend(&bake.tree, sight, bake.closed, seed)
            }
        });
        self.outlook = outlook;
        self.areas = self.outlook.areas(&self.tree);
        rays
    }

    /// Splits leaves that look for themselves and see reflected light vary, and lets the parts look; the rays cast.
    pub(super) fn split_where_light_varies(&mut self, demand: &Demand) -> u64 {
        if self.rounds.is_empty() || !self.by_rays() {
            return 0;
        }
        let mut rays = 0;
        for _ in 0..LEVELS {
            rays += self.look_out();
            let known = self.light.bright_reflected.len();
            let nodes = self.tree.nodes.len() as u32;
            // Parts of a patch that was a leaf in the last solution are as bright as it.
            let mut bright = self.light.bright_reflected.clone();
            for k in known..nodes as usize {
                bright.push(bright[self.tree.nodes[k].parent as usize]);
            }
            let mut keen = demand.keen.to_vec();
            for k in keen.len()..nodes as usize {
                keen.push(keen[self.tree.nodes[k].parent as usize]);
            }
            let seed = self.settings.seed;
            let split = (0..nodes)
                .into_par_iter()
                .filter(|&k| {
                    let node = self.tree.node(k);
                    node.is_leaf()
                        && self.team.owns(k as usize)
                        && node.area > demand.least_area
                        && self.tree.elements[node.element as usize].depth < MAX_DEPTH
                        && self.outlook.variation(k, &bright, seed)
                            * f64::from(keen[k as usize])
                            * (node.area / demand.total_area).sqrt()
                            > demand.threshold
                })
                .collect();
            let split = self.team.union(split);
            for &leaf in &split {
                self.tree.subdivide(leaf);
            }
            if split.is_empty() {
                break;
            }
        }
        rays
    }
}
