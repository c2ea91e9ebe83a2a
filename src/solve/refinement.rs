//! What rounds refine: the hierarchy, its links, and the rays of its leaves.

use super::direct::Direct;
use super::leaf_rays::LeafRays;
use super::operator;
use super::punctual::Shadowed;
use super::room::{Room, by_rays};
use crate::geometry::sampling::hash;
use crate::hierarchy::Tree;
use crate::light::{Light, Rows};
use crate::link::{Demand, Graph, LinkRows, MAX_DEPTH, Refined, RowBalance, balance};
use crate::team::Interrupted;
use rayon::prelude::*;

/// Levels of leaves that a round splits where reflected light varies.
const LEVELS: usize = 4;
/// Distinguishes the rays that decide on splits from those that bring light.
const DECIDING: u64 = 0xdec1de;

/// A room divided as finely as the rounds so far asked for.
#[derive(Default)]
pub(crate) struct Refinement {
    pub(crate) tree: Tree,
    pub(crate) graph: Graph,
    pub(crate) leaf_rays: LeafRays,
    /// Area of each node that takes part.
    pub(crate) areas: Vec<f64>,
    pub(crate) balance: RowBalance,
    pub(crate) direct: Direct,
    /// What the choice of lanes may take as given when lamps and paints change: shadows of punctual lights, balance.
    pub(crate) frozen: Option<(Shadowed, Vec<f32>)>,
}

impl Refinement {
    /// The leaves of the hierarchy, ascending.
    pub(crate) fn leaves(&self) -> Vec<u32> {
        self.tree.leaves().collect()
    }

    /// Area of a leaf that takes part and counts.
    pub(crate) fn counted(&self, leaf: u32) -> f64 {
        let node = self.tree.node(leaf);
        self.areas[leaf as usize] * (node.counted / node.area)
    }

    /// The links of each node.
    pub(crate) fn link_rows(&self) -> LinkRows {
        LinkRows::new(self.tree.nodes.len(), &self.graph.links)
    }

    /// The factors by which rows of links sum to their targets.
    pub(crate) fn balanced(&self, rows: &LinkRows) -> RowBalance {
        balance(&self.tree, rows, &self.areas, &self.leaf_rays.target)
    }

    /// Refines the links until none exceeds the demand.
    pub(super) fn refine_links(
        &mut self,
        room: &Room,
        demand: &Demand,
    ) -> Result<Refined, Interrupted> {
        let (tree, graph, seed) = (&mut self.tree, &mut self.graph, room.settings.seed);
        room.with_sight(|sight| graph.refine(tree, sight, seed, demand, &room.interrupt))
    }

    /// Finds out how new leaves look out; returns the rays cast.
    pub(super) fn trace_leaf_rays(&mut self, room: &Room) -> Result<u64, Interrupted> {
        let (tree, leaf_rays, seed) = (&self.tree, &mut self.leaf_rays, room.settings.seed);
        let interrupt = &room.interrupt;
        let rays = room.with_sight(|sight| {
            if by_rays(sight) {
                leaf_rays.look(tree, sight, &room.hemisphere, seed, interrupt)
            } else {
                leaf_rays.extend(tree, sight, room.closed, seed, interrupt)
            }
        })?;
        self.areas = leaf_rays.areas(tree);
        Ok(rays)
    }

    /// Where leaves look for themselves, splits those over which reflected light varied in the last solution; returns the rays cast.
    ///
    /// The rays that decide bring no light. With the same rays for both, those leaves stayed unsplit whose few rays missed a bright place, and
    /// 5 % of a flat's light was lost.
    pub(super) fn split_where_light_varies(
        &mut self,
        room: &Room,
        light: &Light,
        demand: &Demand,
    ) -> Result<u64, Interrupted> {
        if !room.by_rays() {
            return Ok(0);
        }
        let seed = hash(room.settings.seed, DECIDING);
        let mut deciding = LeafRays::of_team(room.team);
        let mut rays = 0;
        for _ in 0..LEVELS {
            rays += room.with_sight(|sight| {
                deciding.look(&self.tree, sight, &room.hemisphere, seed, &room.interrupt)
            })?;
            let known = light.bright_reflected.len();
            let nodes = self.tree.nodes.len() as u32;
            // Children of a patch that was a leaf in the last solution are as bright as it was.
            let mut bright = light.bright_reflected.clone();
            for k in known..nodes as usize {
                bright.push(bright[self.tree.nodes[k].parent as usize]);
            }
            let mut sensitivity = demand.sensitivity.to_vec();
            for k in sensitivity.len()..nodes as usize {
                sensitivity.push(sensitivity[self.tree.nodes[k].parent as usize]);
            }
            let split = (0..nodes)
                .into_par_iter()
                .filter(|&k| {
                    let node = self.tree.node(k);
                    node.is_leaf()
                        && room.team.owns(k as usize)
                        && node.area > demand.least_area
                        && self.tree.elements[node.element as usize].depth < MAX_DEPTH
                        && deciding.variation(k, &bright, seed)
                            * f64::from(sensitivity[k as usize])
                            * self.tree.share(k).sqrt()
                            > demand.threshold
                })
                .collect();
            let split = room.team.union(split);
            for &leaf in &split {
                self.tree.subdivide(leaf);
            }
            if split.is_empty() {
                break;
            }
        }
        Ok(rays)
    }

    /// Leaf rows on all nodes, by area.
    pub(crate) fn on_nodes<const L: usize>(&self, by_leaf: &Rows, leaves: &[u32]) -> Rows {
        let mut rows = Rows::zero(self.tree.nodes.len(), L);
        for (row, &leaf) in by_leaf.all::<L>().iter().zip(leaves) {
            rows.all_mut::<L>()[leaf as usize] = *row;
        }
        operator::pull::<f32, L>(&self.tree, &self.areas, rows.all_mut::<L>());
        rows
    }
}
