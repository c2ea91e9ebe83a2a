//! What a solution can be asked: light at receivers, and which receivers are covered.

use super::estimate::{self, EstimatedError};
use super::{Bake, Closed, GatherQuality, flux};
use crate::geometry::{NO_PLANE, Segment};
use crate::hierarchy::NONE;
use crate::link::Sight;
use crate::transport::hemisphere::Hemisphere;
use crate::transport::{Gathered, Gatherer, MOSTLY, Memory, Receiver};
use glam::DVec3;

/// A face of whose area less than this share is uncovered lies below something.
const MOSTLY_COVERED: f64 = 0.01;
/// A place with something right above it, within this share of the room's half diagonal, is not seen: a centimetre in a
/// large room.
const PRESSED: f64 = 2e-3;

impl Bake {
    /// Gathers at the watched points: how wrong their light is, by that of a round ago, see [`super::estimate`].
    pub(super) fn estimate(&mut self) -> Option<EstimatedError> {
        let round = self.rounds.len();
        let by_rays = self.room.by_rays();
        let gathers = estimate::gathers(by_rays);
        let tree = &self.refinement.tree;
        let watched = self.room.probes.receivers(tree, round, gathers);
        let mut gathered = self.gather_with(&watched, GatherQuality::Watched);
        if self.room.keep {
            let traces = gathered.iter_mut().map(|g| g.packed.take()).collect();
            self.solution.watched = [std::mem::take(&mut self.solution.watched[1]), traces];
        }
        let seen: Vec<[f64; 3]> = gathered
            .iter()
            .map(|g| self.solution.lanes.tristimulus(&g.irradiance))
            .collect();
        let fineness = |links: usize, leaves: usize| match by_rays {
            true => leaves.max(1) as f64,
            false => links.max(1) as f64,
        };
        let links = self.refinement.graph.links.len();
        let now = fineness(links, self.solution.light.leaves.len());
        let kept = (self.rounds.last()).map_or(1.0, |r| fineness(r.links, r.elements) / now);
        let share = estimate::share(round, by_rays, kept);
        let before = std::mem::replace(&mut self.solution.seen, seen);
        estimate::error_between(
            &before,
            &self.solution.seen,
            gathers,
            self.solution.light.white,
            share,
        )
    }

    /// Gathers at watched points in a round.
    pub(super) fn watched_gathers(&self) -> usize {
        estimate::gathers(self.room.by_rays()) * self.room.probes.points.len()
    }

    /// Gathers at receivers, in order.
    pub fn gather(&self, receivers: &[Receiver]) -> Vec<Gathered> {
        self.gather_with(receivers, GatherQuality::Full)
    }

    /// Gathers with care, or just for a picture, see [`GatherQuality`].
    pub(crate) fn gather_with(
        &self,
        receivers: &[Receiver],
        quality: GatherQuality,
    ) -> Vec<Gathered> {
        if self.solution.light.width() == 0 || self.solution.light.white == [0.0; 3] {
            // A room without light: nothing to gather.
            return vec![Gathered::dark(); receivers.len()];
        }
        self.room.with_sight(|sight| {
            let sketched = Hemisphere::sketch();
            let scaled;
            let mut gatherer = self.gatherer(sight);
            if let (GatherQuality::Preview, Some(hemisphere)) = (quality, &mut gatherer.hemisphere)
            {
                *hemisphere = &sketched;
            }
            gatherer.allowed_noise = quality.allowed_noise();
            if matches!(quality, GatherQuality::Vertex(_) | GatherQuality::Preview) {
                gatherer.most_backs = MOSTLY;
            }
            if let GatherQuality::Vertex(effort) = quality {
                gatherer.tolerance *= effort.noise();
                if let Some(hemisphere) = &mut gatherer.hemisphere {
                    scaled = hemisphere.scaled(effort.samples());
                    *hemisphere = &scaled;
                }
            }
            let at = |memory: &mut Memory, r: &Receiver| gatherer.at(r, memory).pack();
            self.room.team.map(receivers, Memory::default, at)
        })
    }

    /// Which receivers does something solid cover?
    pub(crate) fn covered(&self, receivers: &[Receiver]) -> Vec<bool> {
        if self.room.closed == Closed::Yes {
            return vec![false; receivers.len()];
        }
        let covered = |(): &mut (), r: &Receiver| {
            flux::covered(
                &self.room.mesh,
                &self.refinement.tree,
                &self.room.rays,
                r.point,
                r.normal,
                r.plane,
                r.seed,
            )
        };
        self.room.team.map(receivers, || (), covered)
    }

    /// Which receivers does something lie upon, so near that nobody sees them? See [`PRESSED`].
    pub(crate) fn pressed(&self, receivers: &[Receiver]) -> Vec<bool> {
        self.room.with_sight(|sight| {
            let pressed = |(): &mut (), to: &Receiver| self.is_pressed(sight, to);
            self.room.team.map(receivers, || (), pressed)
        })
    }

    fn is_pressed(&self, sight: &Sight, to: &Receiver) -> bool {
        let height = PRESSED * self.room.mesh.half_size;
        let above = Segment::new(
            to.point,
            to.point + height * to.normal,
            [to.plane, NO_PLANE],
        );
        sight.occlusion && sight.blocks_one(&above)
    }

    /// Does something solid cover a receiver, or lie upon it?
    pub(crate) fn is_under(&self, sight: &Sight, to: &Receiver) -> bool {
        let covered = || {
            self.room.closed != Closed::Yes
                && flux::covered(
                    &self.room.mesh,
                    &self.refinement.tree,
                    &self.room.rays,
                    to.point,
                    to.normal,
                    to.plane,
                    to.seed,
                )
        };
        self.is_pressed(sight, to) || covered()
    }

    /// Does a ray from a point first meet a black back?
    pub(crate) fn meets_back(&self, to: &Receiver, way: DVec3) -> bool {
        let (from, way) = (to.point.as_vec3(), way.as_vec3());
        let hit = self.room.rays.closest(from, way, f32::MAX, to.plane);
        hit.is_some_and(|hit| self.refinement.tree.met(&hit) == NONE)
    }

    /// Share of a leaf that others see.
    pub(crate) fn openness(&self, leaf: u32) -> f64 {
        f64::from(self.refinement.leaf_rays.bare[leaf as usize])
    }

    /// For each entry of the hierarchy's faces the space that it belongs to, and whether something solid covers it.
    pub(crate) fn spaces(&self) -> Vec<(u32, bool)> {
        let mut spaces = vec![(0, false); self.refinement.tree.faces.len()];
        for (face, space) in self.room.mesh.faces.iter().zip(&self.room.spaces) {
            let entry = self.refinement.tree.entry[face.triangle as usize][usize::from(face.back)];
            let node = self.refinement.tree.face_node[entry as usize];
            let covered = self.refinement.areas[node as usize]
                < MOSTLY_COVERED * self.refinement.tree.node(node).area;
            spaces[entry as usize] = (*space, covered);
        }
        spaces
    }

    pub(crate) fn gatherer<'a>(&'a self, sight: &'a Sight<'a>) -> Gatherer<'a> {
        (self.solution).gatherer(&self.room, &self.refinement.tree, sight)
    }
}
