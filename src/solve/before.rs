//! What a bake was before a round, so that the round can be taken back.
//!
//! Hierarchy and rays of leaves only grow: of these only their sizes are kept. Of the light, what the leaves reflect and receive is kept; the
//! rest is found again from that, as from a checkpoint. This takes 38 of 670 MB in the fourth round of a restaurant of 153,000 elements; a
//! copy of everything took 340 MB beside 750 in the fifth.

use super::Bake;
use super::direct::Direct;
use super::leaf_rays;
use super::solution::Solution;
use crate::hierarchy::TreeSize;
use crate::light::{Light, Neighbours, Rows};
use crate::link::{Graph, RowBalance};

/// A bake between two rounds.
pub(super) struct Before {
    tree: TreeSize,
    leaf_rays: leaf_rays::LeafRaysSize,
    graph: Graph,
    balance: RowBalance,
    direct: Direct,
    /// Of its light only irradiance, the white, the leaves, mirrors and sheets are kept.
    solution: Solution,
    /// Reflected radiosity of the leaves.
    reflected: Rows,
}

impl Bake {
    /// What is needed to take a round back.
    pub(super) fn before(&self) -> Before {
        let (refinement, solution) = (&self.refinement, &self.solution);
        let light = &solution.light;
        let mut reflected = Rows::zero(light.leaves.len(), light.width());
        for (k, &leaf) in light.leaves.iter().enumerate() {
            reflected
                .row_mut(k)
                .copy_from_slice(light.reflected.row(leaf as usize));
        }
        Before {
            tree: refinement.tree.grown(),
            leaf_rays: refinement.leaf_rays.grown(),
            graph: refinement.graph.clone(),
            balance: refinement.balance.clone(),
            direct: refinement.direct.clone(),
            solution: Solution {
                lanes: solution.lanes.clone(),
                filters: solution.filters.clone(),
                lamps: solution.lamps.clone(),
                light: Light {
                    irradiance: light.irradiance.clone(),
                    leaves: light.leaves.clone(),
                    mirrors: light.mirrors.clone(),
                    through: light.through.clone(),
                    tilts: light.tilts.clone(),
                    white: light.white,
                    ..Light::default()
                },
                previous: Rows::default(),
                seen: solution.seen.clone(),
                watched: solution.watched.clone(),
                ..*solution
            },
            reflected,
        }
    }

    /// Takes back what was done since `before`.
    pub(super) fn take_back(&mut self, before: Before) {
        let refinement = &mut self.refinement;
        refinement.leaf_rays.shrink(&before.leaf_rays);
        refinement.tree.shrink(&before.tree);
        refinement.leaf_rays.find(&refinement.tree, 0);
        let tilts = before.solution.light.tilts.clone();
        refinement.leaf_rays.tilt_by(tilts);
        refinement.areas = refinement.leaf_rays.areas(&refinement.tree);
        refinement.graph = before.graph;
        refinement.balance = before.balance;
        refinement.direct = before.direct;
        self.solution = before.solution;
        let tints = &mut refinement.leaf_rays.tints;
        tints.on(&self.solution.filters);
        self.light_up(&before.reflected);
        self.light_arrives();
        self.solution.light.neighbours =
            Neighbours::new(self.refinement.tree.nodes.len(), &self.refinement.graph);
    }
}
