//! The solution where leaves look for themselves: `R = rho (H0 + K R)`, `K` the mean over what the rays of a leaf meet.
//!
//! Plain sweeps (Jacobi) shrink every error by the albedo. One factor per lane and sweep helps: it scales the whole
//! solution so that no light is missing, because the slowest mode of a bright room is the room as a whole. The factor goes
//! to 1 as the sweeps converge: rows are taken as they are.

use super::conjugate::Convergence;
use super::operator::pull;
use super::outlook::Outlook;
use super::sums::{CHUNK, added, chunks};
use super::two_grid::TwoGrid;
use crate::hierarchy::Tree;
use crate::light::rows::Rows;
use crate::team::Interrupt;
use rayon::prelude::*;

/// Sweeps at the most.
const SWEEPS: usize = 400;
/// The scale of one sweep stays within this factor.
const GREATEST_SCALE: f64 = 2.0;
/// The slowest shrinkage of changes from sweep to sweep that is believed.
const SLOWEST: f64 = 0.95;
/// After a correction that left more than this share of the change, a sweep goes without: errors that the few patches
/// cannot resolve must not build up.
const WORTH_CORRECTING: f64 = 0.5;

/// What a solve by rays works on.
pub(crate) struct RaySystem<'a> {
    pub(super) tree: &'a Tree,
    pub(super) outlook: &'a Outlook,
    pub(super) leaves: &'a [u32],
    /// Area of each node that takes part.
    pub(super) areas: &'a [f64],
    /// By leaf.
    pub(super) reflectance: &'a Rows,
    /// Greatest reflectance of each lane.
    pub(super) greatest: &'a [f32],
    /// Few patches that stand for the room, and tristimulus values of each lane.
    pub(super) two_grid: Option<(&'a TwoGrid, &'a [[f64; 3]])>,
    /// Ends the sweeps at any time.
    pub(super) interrupt: &'a Interrupt,
}

/// The changes of a sweep, times areas.
struct Change<const L: usize> {
    /// By lane, absolute.
    change: [f64; L],
    /// Reflected radiosity after the sweep, by lane.
    total: [f64; L],
    /// By patch of the two grids, signed.
    moved: Option<Vec<[f64; L]>>,
}

impl RaySystem<'_> {
    /// Reflected radiosity (from a guess) and irradiance by reflected light, both by leaf.
    pub(super) fn solve<const L: usize>(
        &self,
        first: &Rows,
        reflected: &mut Rows,
        tolerance: f64,
    ) -> (Convergence, Rows) {
        let mut nodes = Rows::zero(self.tree.nodes.len(), L);
        let mut seen = Rows::zero(self.leaves.len(), L);
        let mut done = Convergence::default();
        let mean_reflectance = self
            .two_grid
            .map(|(grid, _)| grid.means::<L>(&self.sums::<L>(grid, self.reflectance)));
        let patches = self.two_grid.map_or(0, |(grid, _)| grid.len());
        let mut steps = vec![[0.0; 3]; patches];
        let mut corrected = false;
        loop {
            self.receive::<L>(reflected, &mut nodes, &mut seen);
            let scale = self.missing::<L>(reflected, &seen, first);
            let factor = scale.map(|x| x as f32);
            for h in seen.all_mut::<L>() {
                *h = std::array::from_fn(|l| h[l] * factor[l]);
            }
            let Change {
                change,
                total,
                moved,
            } = self.reflect::<L>(&seen, first, factor, reflected);
            done.iterations += 1;
            let before = done.residual;
            (done.residual, done.bound) = match self.two_grid {
                None => self.worst(&change, &total),
                Some((_, xyz)) => self.seen(&change, &total, xyz),
            };
            let mut settled = done.bound <= tolerance;
            if let (Some((grid, xyz)), Some(moved)) = (self.two_grid, &moved) {
                // The mean error is small first; light trapped somewhere settles last.
                let earlier = std::mem::replace(&mut steps, grid.seen::<L>(moved, xyz));
                settled = settled && {
                    let all = grid.seen::<L>(&self.sums::<L>(grid, reflected), xyz);
                    let ratio = (done.residual / before).min(SLOWEST);
                    grid.left(&earlier, &steps, &all, ratio) <= tolerance
                };
            }
            if settled || done.iterations >= SWEEPS || self.interrupt.is_raised() {
                return (done, seen);
            }
            corrected = !(corrected && done.residual > WORTH_CORRECTING * before);
            if let (Some((grid, _)), Some(rho), Some(moved), true) =
                (self.two_grid, &mean_reflectance, moved, corrected)
            {
                let change = grid.means::<L>(&moved);
                let means = grid.means::<L>(&self.sums::<L>(grid, &seen));
                let received = [&seen, &means];
                grid.correct::<L>(&change, rho, received, self.reflectance, reflected);
            }
        }
    }

    /// By what a sweep must be scaled, lane by lane, so that no light is missing: the first reflection of direct light,
    /// over the light reflected now less its next reflection.
    fn missing<const L: usize>(&self, reflected: &Rows, seen: &Rows, first: &Rows) -> [f64; L] {
        let bounces = chunks::<L>(reflected).zip(chunks::<L>(seen));
        let direct = chunks::<L>(first).zip(chunks::<L>(self.reflectance));
        let parts = bounces.zip(direct).zip(self.leaves.par_chunks(CHUNK));
        let parts = parts.map(|(((reflected, seen), (first, rho)), leaves)| {
            let (mut now, mut once, mut again) = ([0.0; L], [0.0; L], [0.0; L]);
            let rows = reflected.iter().zip(seen).zip(first.iter().zip(rho));
            for (((r, h), (f, rho)), &leaf) in rows.zip(leaves) {
                let a = self.areas[leaf as usize];
                for l in 0..L {
                    now[l] += a * f64::from(r[l]);
                    once[l] += a * f64::from(rho[l] * f[l]);
                    again[l] += a * f64::from(rho[l] * h[l]);
                }
            }
            [now, once, again]
        });
        let [now, once, again] = added(parts);
        let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 1.0 };
        std::array::from_fn(|l| {
            ratio(once[l], now[l] - again[l]).clamp(1.0 / GREATEST_SCALE, GREATEST_SCALE)
        })
    }

    /// Reflects what the leaves receive; `factor` is what `seen` was scaled by.
    fn reflect<const L: usize>(
        &self,
        seen: &Rows,
        first: &Rows,
        factor: [f32; L],
        reflected: &mut Rows,
    ) -> Change<L> {
        let (seen, first) = (seen.all::<L>(), first.all::<L>());
        let rho = self.reflectance.all::<L>();
        let next = |k: usize| -> [f32; L] {
            std::array::from_fn(|l| rho[k][l] * (first[k][l] + seen[k][l]))
        };
        let moved = self.two_grid.map(|(grid, _)| {
            let now = reflected.all::<L>();
            // Changes against the scaled solution, which as a whole misses no light.
            let change = |k: usize| {
                let next = next(k);
                std::array::from_fn(|l| next[l] - factor[l] * now[k][l])
            };
            grid.sums::<L>(|k| self.areas[self.leaves[k] as usize], change)
        });
        let parts = reflected.all_mut::<L>().par_chunks_mut(CHUNK).enumerate();
        let parts = parts.map(|(chunk, rows)| {
            let (mut change, mut total) = ([0.0; L], [0.0; L]);
            for (k, r) in (chunk * CHUNK..).zip(rows) {
                let a = self.areas[self.leaves[k] as usize];
                let next = next(k);
                for l in 0..L {
                    change[l] += a * f64::from((next[l] - r[l]).abs());
                    total[l] += a * f64::from(next[l]);
                }
                *r = next;
            }
            [change, total]
        });
        let [change, total] = added(parts);
        Change {
            change,
            total,
            moved,
        }
    }

    /// Rows by leaf, times areas, summed over patches.
    fn sums<const L: usize>(&self, grid: &TwoGrid, rows: &Rows) -> Vec<[f64; L]> {
        let rows = rows.all::<L>();
        grid.sums::<L>(|k| self.areas[self.leaves[k] as usize], |k| rows[k])
    }

    /// Relative change of the worst lane, and bound of its error.
    fn worst(&self, change: &[f64], total: &[f64]) -> (f64, f64) {
        let (mut residual, mut bound) = (0.0_f64, 0.0_f64);
        for ((change, total), rho) in change.iter().zip(total).zip(self.greatest) {
            let relative = if *total > 0.0 { change / total } else { 0.0 };
            let rho = f64::from(*rho);
            residual = residual.max(relative);
            bound = bound.max(relative * rho / (1.0 - rho));
        }
        (residual, bound)
    }

    /// [`Self::worst`] for X, Y and Z in place of lanes.
    fn seen(&self, change: &[f64], total: &[f64], xyz: &[[f64; 3]]) -> (f64, f64) {
        let (mut residual, mut bound) = (0.0_f64, 0.0_f64);
        for c in 0..3 {
            let (mut moved, mut left, mut all) = (0.0, 0.0, 0.0);
            for (l, xyz) in xyz.iter().enumerate() {
                let (weight, rho) = (xyz[c].abs(), f64::from(self.greatest[l]));
                moved += weight * change[l];
                left += weight * change[l] * rho / (1.0 - rho);
                all += weight * total[l];
            }
            if all > 0.0 {
                residual = residual.max(moved / all);
                bound = bound.max(left / all);
            }
        }
        (residual, bound)
    }

    /// Irradiance of the leaves by radiosity.
    pub(super) fn received<const L: usize>(&self, radiosity: &Rows) -> Rows {
        let mut nodes = Rows::zero(self.tree.nodes.len(), L);
        let mut seen = Rows::zero(self.leaves.len(), L);
        self.receive::<L>(radiosity, &mut nodes, &mut seen);
        seen
    }

    /// [`Self::received`] into `seen`; `nodes` is scratch, a row for each node.
    fn receive<const L: usize>(&self, reflected: &Rows, nodes: &mut Rows, seen: &mut Rows) {
        let all = nodes.all_mut::<L>();
        for (row, &leaf) in reflected.all::<L>().iter().zip(self.leaves) {
            all[leaf as usize] = *row;
        }
        pull::<f32, L>(self.tree, self.areas, all);
        self.outlook.irradiance::<L>(self.leaves, nodes, seen);
    }
}
