//! The record of a round, from what it measured and what it left.

use super::estimate::Distance;
use super::forecast::{Past, next_round};
use super::record::{Errors, Figure, FigureKind, Round, RoundMeasurements};
use super::{Bake, DE_PER_PERCENT, Representation};
use crate::link::Occlusion;

impl Bake {
    /// The record of a round.
    pub(super) fn recorded(&self, m: RoundMeasurements) -> Round {
        let bake = self;
        let light = &bake.solution.light;
        let errors = bake.errors(&m);
        let seconds = m.clock.total();
        let own = Past {
            seconds,
            error: errors.total_de2000.value,
            links: bake.refinement.graph.links.len(),
        };
        let before = bake.rounds.iter().map(Round::past);
        let past: Vec<Past> = before.chain([own]).collect();
        let ahead = bake.goal().forecast(&past);
        let per = |bytes: usize, count: usize| bytes as f64 / count.max(1) as f64;
        let (of_links, of_elements) = (bake.bytes_of_links(&m), bake.bytes_of_elements());
        Round {
            record: "round",
            round: bake.rounds.len() + 1,
            elapsed_s: bake.started.elapsed().as_secs_f64(),
            round_s: seconds,
            next_round_s: next_round(&past),
            remaining_rounds: ahead.map(|a| a.rounds),
            remaining_s: ahead.map(|a| a.seconds),
            look_s: m.clock.last() / bake.watched_gathers().max(1) as f64,
            phases_s: m
                .clock
                .laps()
                .iter()
                .map(|(name, s)| ((*name).to_owned(), (*s).into()))
                .collect(),
            threshold: m.threshold,
            rays: m.rays,
            opening_rays: match bake.rounds.is_empty() {
                true => bake.room.opening_rays,
                false => 0,
            },
            links_evaluated: m.refined.evaluated,
            links_capped: m.refined.capped,
            elements: light.leaves.len(),
            nodes: bake.refinement.tree.nodes.len(),
            links: bake.refinement.graph.links.len(),
            links_clear: bake
                .refinement
                .graph
                .links
                .iter()
                .filter(|l| l.occlusion == Occlusion::Clear)
                .count(),
            intervals_working: bake.solution.lanes.len(),
            intervals_mean: (m.convergence.carried)
                .map_or_else(|| bake.intervals_mean(), |c| c.intervals),
            memory_bytes: of_links + of_elements,
            row_bytes: self.refinement.leaf_rays.row_bytes(),
            bytes_per_link: per(of_links, bake.refinement.graph.links.len()),
            bytes_per_element: per(of_elements, light.leaves.len()),
            iterations: m.convergence.iterations,
            fluorescence_rounds: m.convergence.fluorescence,
            error: errors,
            flux: m.flux,
            row_sum_defect: bake.refinement.balance.defect_before,
            row_sum_defect_after: bake.refinement.balance.defect_after,
        }
    }

    /// Memory of links and what belongs to them, bytes.
    fn bytes_of_links(&self, m: &RoundMeasurements) -> usize {
        m.link_bytes
            + size_of_val(self.refinement.graph.links.as_slice())
            + size_of_val(self.refinement.graph.blockers.as_slice())
            + self.solution.light.neighbours.bytes()
    }

    /// Memory of the hierarchy and the light on it, bytes.
    fn bytes_of_elements(&self) -> usize {
        self.refinement.tree.bytes()
            + self.solution.light.bytes()
            + self.refinement.direct.bytes()
            + size_of_val(self.refinement.areas.as_slice())
            + size_of_val(self.refinement.balance.factor.as_slice())
            + self.refinement.leaf_rays.bytes()
    }

    /// What is known of the error, by source.
    fn errors(&self, m: &RoundMeasurements) -> Errors {
        let estimate = Figure::estimate;
        let carried = m.convergence.carried.map(|carried| carried.de_luv);
        let known = carried.or(self.solution.spectrum_error);
        let spectrum = known.unwrap_or(0.0);
        let convergence_de = m.convergence.bound * 100.0 * DE_PER_PERCENT;
        // Sources are independent: their squares add. The distance between rounds shows only geometry.
        let all = |geometry: f64| {
            (geometry * geometry + spectrum * spectrum + convergence_de * convergence_de).sqrt()
        };
        let white = self.solution.light.white.iter().sum::<f64>();
        let of = |figure: &dyn Fn(Distance) -> f64| estimate(m.estimate.map(|e| figure(e.error)));
        Errors {
            total_de2000: of(&|d| all(d.de2000)),
            noise_de2000: estimate(m.estimate.and_then(|e| e.noise)),
            total_de_luv: of(&|d| all(d.de_luv)),
            total_relative: of(&|d| d.relative.hypot(m.convergence.bound)),
            geometry_chromaticity: of(&|d| d.chromaticity),
            geometry_de_luv: of(&|d| d.de_luv),
            spectrum_de_luv: Figure {
                value: known.filter(|e| e.is_finite()),
                kind: match self.room.settings.representation {
                    Representation::Guaranteed => FigureKind::Bound,
                    _ => FigureKind::Estimate,
                },
            },
            convergence: Figure {
                value: Some(m.convergence.bound).filter(|e| e.is_finite()),
                // Rows of rays sum to what they must in the mean only.
                kind: match self.room.by_rays() {
                    true => FigureKind::Estimate,
                    false => FigureKind::Bound,
                },
            },
            convergence_de_luv: estimate(Some(convergence_de)),
            total_xyz: of(&|d| d.relative * white / 6.0),
        }
    }
}

impl Round {
    /// What the end of a bake depends on.
    pub(super) fn past(&self) -> Past {
        Past {
            seconds: self.round_s,
            error: self.error.total_de2000.value,
            links: self.links,
        }
    }
}
