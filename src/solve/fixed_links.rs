//! Held links: a solution that differs from the last round in nothing but how spectra are carried.
//!
//! This shows by itself what lanes do to colours: the solution is compared with one on all 64 bands of the
//! same links, with direct light gathered at the same points of the same elements.

use super::direct::Direct;
use super::{Bake, NOBODY, Representation};
use crate::link::Demand;
use std::time::Instant;

/// Held solutions are converged as far as a bake that asks for this error.
const CONVERGED: f64 = 0.01;

/// A solution on held links.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedLinkSolve {
    /// Numbers that hold a spectrum: lanes, or the mean length of lists.
    pub lanes: f64,
    /// Error expected by the choice of lanes or known to the lists, mean CIELUV; none where nothing is known.
    pub spectrum_de_luv: Option<f64>,
    /// Operator applications.
    pub iterations: usize,
    /// Choice of lanes and solve, without direct light, s.
    pub seconds: f64,
}

impl Bake {
    /// Solves again on the links and leaves of the last round. `error` is what the lanes are chosen for; the solve itself
    /// goes far beyond it. Afterwards [`Bake::light`] and [`Bake::lanes`] are those of this solution. None before the
    /// first round.
    pub fn hold(&mut self, representation: Representation, error: f64) -> Option<FixedLinkSolve> {
        let threshold = self.rounds.last()?.threshold;
        let white = self.solution.light.white;
        let started = Instant::now();
        (self.room.settings.representation, self.room.settings.error) = (representation, error);
        // Forget the former lanes: those good enough for another error would be taken again.
        self.solution.lanes = self.room.dense_lanes();
        self.choose_lanes().expect(NOBODY);
        let chosen = started.elapsed();
        self.refinement.direct = Direct::default();
        self.gather_direct(&Demand {
            bright: &[],
            sensitivity: &[],
            threshold,
            least_area: f64::INFINITY,
            hidden: true,
        })
        .expect(NOBODY);
        let started = Instant::now();
        let leaves = self.refinement.leaves();
        let rows = self.refinement.link_rows();
        self.refinement.trace_leaf_rays(&self.room).expect(NOBODY);
        self.refinement.balance = self.refinement.balanced(&rows);
        self.room.settings.error = CONVERGED;
        let (convergence, _) = self.solve(&rows, &leaves);
        self.room.settings.error = error;
        self.solution.light.white = white;
        let carried = convergence.carried;
        Some(FixedLinkSolve {
            lanes: carried.map_or(self.solution.lanes.len() as f64, |c| c.intervals),
            spectrum_de_luv: carried.map(|c| c.de_luv).or(self.solution.spectrum_error),
            iterations: convergence.iterations,
            seconds: (chosen + started.elapsed()).as_secs_f64(),
        })
    }

    /// Tristimulus irradiance of the leaves of the hierarchy, lx for Y, each with its area.
    pub fn leaf_colours(&self) -> Vec<([f64; 3], f64)> {
        self.solution
            .light
            .leaves
            .iter()
            .enumerate()
            .map(|(k, &leaf)| {
                let xyz = self
                    .solution
                    .lanes
                    .tristimulus(self.solution.light.irradiance.row(k));
                (xyz, self.refinement.counted(leaf))
            })
            .collect()
    }
}
