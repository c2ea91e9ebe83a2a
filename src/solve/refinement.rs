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
use fearless_simd::{Level, dispatch, f32x4};
use rayon::prelude::*;

/// Levels of leaves that a round splits where reflected light varies.
const LEVELS: usize = 4;
/// Greatest standard deviation of the means of a leaf's quarters, of which two may be known, as a share of the brightest light.
const MOST_VARIATION: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Distinguishes the rays that decide on splits from those that bring light.
const DECIDING: u64 = 0xdec1de;
/// How many these are for a leaf of mean area, share of a point's: a quarter of those that bring light. With as many as those a living room takes 1.34
/// times as long and a garage 1.04 times, as many leaves within 2 %, and points are off by 2.20 for 2.33 % and 1.68 for 1.76 (root mean square beside Mitsuba, one seed).
const DECIDING_SHARE: f64 = 1.0 / 16.0;

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
    /// What the choice of lanes may take as given when lamps and paints change: shadows of punctual lights.
    pub(crate) frozen: Option<Shadowed>,
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
    /// 5 % of a flat's light was lost. They are cast anew in every round: to keep them took half as much memory again, and saved a sixth of
    /// the time in a canteen of 512,000 small leaves, next to nothing where most leaves of a round are new.
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
        let (mut bright, mut sensitivity) =
            (light.bright_reflected.clone(), demand.sensitivity.to_vec());
        let (mut rays, mut decided, mut found) = (0, 0, 0);
        let brightest = f64::from(bright.iter().copied().fold(0.0, f32::max));
        for _ in 0..LEVELS {
            let (tree, nodes) = (&self.tree, self.tree.nodes.len() as u32);
            // Children of a patch that was a leaf in the last solution are as bright as it was.
            for of_nodes in [&mut bright, &mut sensitivity] {
                for k in of_nodes.len()..nodes as usize {
                    of_nodes.push(of_nodes[tree.nodes[k].parent as usize]);
                }
            }
            let splits = |k: u32, variation: f64| {
                let node = tree.node(k);
                node.area > demand.least_area
                    && tree.elements[node.element as usize].depth < MAX_DEPTH
                    && variation * f64::from(sensitivity[k as usize]) * tree.share(k).sqrt()
                        > demand.threshold
            };
            let may_split = |k: u32| splits(k, MOST_VARIATION * brightest);
            rays += room.with_sight(|sight| {
                let how = (seed, &room.interrupt);
                deciding.cast(
                    tree,
                    sight,
                    &room.hemisphere,
                    DECIDING_SHARE,
                    how,
                    may_split,
                )
            })?;
            // Ends on leaves that were split just now are as bright as these were: they need not be looked up again.
            deciding.find(tree, found);
            found = deciding.found();
            let split = (decided..nodes)
                .into_par_iter()
                .filter(|&k| {
                    tree.node(k).is_leaf()
                        && room.team.owns(k as usize)
                        && splits(k, deciding.variation(k, &bright, seed))
                })
                .collect();
            decided = nodes;
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
        let all = rows.all_mut::<L>();
        dispatch!(Level::new(), simd => {
            operator::pull::<_, f32x4<_>, L>(simd, &self.tree, &self.areas, all);
        });
        rows
    }
}
