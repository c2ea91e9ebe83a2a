//! Direct light on the leaves of a bake: what [`Direct`](super::direct::Direct) needs of points.

use super::Bake;
use super::direct::{LeafSampler, receiver};
use super::flux::{self, Closed};
use super::landed::Landed;
use super::refinement::Refinement;
use super::room::{Room, by_rays};
use super::solution::Solution;
use crate::geometry::sampling::{cosine_direction, hash, sequence02};
use crate::hierarchy::{NONE, Tree};
use crate::light::{Neighbours, Rows, close_by, padded, weighed};
use crate::link::{Demand, Sight};
use crate::team::Interrupted;
use crate::transport::{Gatherer, Memory, Receiver};
use glam::Vec3;

/// What one patch may misplace of the direct light of a leaf, share of white per unit of asked-for error. With five
/// times as much a white room of 10 000 faces is 1 % too dark, without a limit 14 %.
const DIRECT_SHARE: f64 = 0.02;
/// Rays that tell how open a point is.
const OPEN_RAYS: usize = 4;
/// Places on a leaf that tell how bright it is without shadows: its middle, and near its corners.
const PLACES: [[f64; 3]; 4] = [
    [1.0 / 3.0; 3],
    [0.9, 0.05, 0.05],
    [0.05, 0.9, 0.05],
    [0.05, 0.05, 0.9],
];

/// Mirrors multiply the light of lamps by this at the most, by assumption.
const MIRRORED: f64 = 2.0;

/// Gathers at points of leaves while the hierarchy is being refined.
struct LampLightSampler<'a> {
    room: &'a Room,
    solution: &'a Solution,
    sight: &'a Sight<'a>,
    /// `sight` with nothing in the way.
    clear: Sight<'a>,
    weights: Vec<f64>,
}

impl LeafSampler for LampLightSampler<'_> {
    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn direct(
        &self,
        tree: &Tree,
        to: &Receiver,
        tolerance: f64,
        memory: &mut Memory,
    ) -> Option<[f32; 64]> {
        let (room, by_rays) = (self.room, by_rays(self.sight));
        let gatherer = Gatherer {
            tolerance,
            shafts: !by_rays,
            ..self.solution.gatherer(room, tree, self.sight)
        };
        let row = gatherer.direct(to, memory);
        let hidden = !by_rays
            && room.closed == Closed::No
            && row.iter().all(|&x| x == 0.0)
            && flux::covered(
                &room.mesh, tree, &room.rays, to.point, to.normal, to.plane, to.seed,
            );
        (!hidden).then_some(row)
    }

    fn unshadowed(&self, tree: &Tree, leaf: u32, tolerance: f64) -> f64 {
        let gatherer = Gatherer {
            tolerance,
            sight: &self.clear,
            glass: None,
            ..self.solution.gatherer(self.room, tree, self.sight)
        };
        let mut memory = Memory::default();
        let bright = |at: [f64; 3]| {
            let row = gatherer.direct(&receiver(tree, leaf, at, 0), &mut memory);
            weighed(&row, &self.weights)
        };
        let most = PLACES.map(bright).into_iter().fold(0.0, f64::max);
        match self.sight.mirrors {
            Some(_) => MIRRORED * most,
            None => most,
        }
    }

    fn landed(&self, tree: &Tree) -> Landed {
        Landed::new(tree, &self.room.landings, self.solution.light.white)
    }

    fn by_chance(&self) -> bool {
        by_rays(self.sight)
    }

    fn openness(&self, tree: &Tree, to: &Receiver, memory: &mut Memory) -> [f32; 2] {
        let shift = hash(to.seed, 5);
        let directions: [Vec3; OPEN_RAYS] = std::array::from_fn(|k| {
            cosine_direction(to.normal, sequence02(k as u32, shift)).as_vec3()
        });
        let mut hits = [None; OPEN_RAYS];
        let from = [to.point.as_vec3(); OPEN_RAYS];
        self.sight.meet(&from, &directions, to.plane, &mut hits);
        memory.rays += OPEN_RAYS as u64;
        let near = to.leaf.map_or(0.0, |leaf| close_by(tree.node(leaf).area));
        let fronts = || hits.iter().flatten().filter(|hit| tree.met(hit) != NONE);
        let far = fronts().filter(|hit| hit.t >= near).count();
        [fronts().count(), far].map(|count| count as f32 / OPEN_RAYS as f32)
    }
}

impl Bake {
    /// Gathers direct light on all leaves, splitting those over which it varies.
    pub(super) fn gather_direct(&mut self, demand: &Demand) -> Result<(), Interrupted> {
        match padded(self.solution.lanes.len()) {
            4 => self.place_emission::<4>(),
            8 => self.place_emission::<8>(),
            16 => self.place_emission::<16>(),
            32 => self.place_emission::<32>(),
            _ => self.place_emission::<64>(),
        }?;
        let (room, solution) = (&self.room, &mut self.solution);
        solution.light_lamps(room);
        solution.light.bright_lamps = solution.bright_lamps();
        let Refinement { tree, direct, .. } = &mut self.refinement;
        room.with_sight(|sight| {
            let look = LampLightSampler {
                room,
                solution,
                sight,
                clear: Sight {
                    occlusion: false,
                    panes: None,
                    mirrors: None,
                    ..*sight
                },
                weights: solution.bright_weights(),
            };
            let coarsest = DIRECT_SHARE * room.settings.error;
            let spread = (room.team, &room.interrupt);
            direct.refine(tree, demand, coarsest, &look, spread)
        })
    }

    /// Puts emission and links in place for a gather.
    fn place_emission<const L: usize>(&mut self) -> Result<(), Interrupted> {
        let (room, refinement, solution) = (&self.room, &mut self.refinement, &mut self.solution);
        let leaves = refinement.leaves();
        let painter = room.painter();
        let sources = painter.paint(&refinement.tree, &leaves, &solution.lanes);
        refinement.trace_leaf_rays(room)?;
        let nodes = refinement.tree.nodes.len();
        let light = &mut solution.light;
        light.emitted = refinement.on_nodes::<L>(&sources.emission, &leaves);
        light.neighbours = Neighbours::new(nodes, &refinement.graph);
        solution.previous = std::mem::replace(&mut light.reflected, Rows::zero(nodes, L));
        light.measure(&refinement.tree, &room.mesh, &solution.lanes);
        Ok(())
    }
}
