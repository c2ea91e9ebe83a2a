//! The progressive solution: rounds of refine, balance, solve and estimate, each of which leaves a whole solution.
//!
//! [`Bake::step`] is the loop on one screen; everything it calls stands in a file of its own.

mod before;
mod bounded;
mod checkpoint;
mod choice;
mod coarse;
mod cuts;
mod direct;
mod early;
pub(crate) mod effort;
mod estimate;
mod fixed_links;
mod fluorescing;
pub(crate) mod flux;
pub mod forecast;
mod lamp_light;
mod lamp_rays;
mod landed;
mod landing;
mod leaf_rays;
mod linear;
mod list_bounces;
mod lists;
mod lit;
mod looking;
mod mixed;
mod operator;
mod outside;
mod parted_mesh;
pub(crate) mod punctual;
pub mod record;
mod recording;
pub mod reference;
mod refinement;
mod reflection;
mod representation;
mod room;
mod solution;
pub(crate) mod solver;
mod solving;
mod sources;
mod sums;
mod threshold_factors;
mod tinted;
mod views;

pub(crate) use effort::Effort;
pub use lists::PatchList;
pub use lit::Averages;
pub use record::{Round, Verdict};
pub use representation::Representation;
pub(crate) use sources::weights_of;

use crate::color::Upsampler;
use crate::geometry::RayIndex;
use crate::hierarchy::{Mesh, Tree};
use crate::light::lanes::Lanes;
use crate::light::{Light, Rows};
use crate::link::{Demand, is_small};
use crate::scene::effects::Plan;
use crate::scene::{PunctualLight, Scene};
use crate::team::{Asked, Interrupt, Interrupted, Team};
pub(crate) use estimate::SHARE_ALIKE;
pub use fixed_links::FixedLinkSolve;
pub use flux::Closed;
use forecast::{BY_LINKS, BY_RAYS, Goal, Past};
pub use operator::Operator;
pub use outside::running;
use refinement::Refinement;
pub use room::Settings;
pub(crate) use room::{Room, RoomAnalysis};
pub(crate) use solution::{DE_PER_PERCENT, Solution};
use sources::Sources;
use std::time::Instant;
use threshold_factors::ThresholdFactors;

/// Threshold of the first round, share of white (see [`Demand::threshold`]); each round divides it.
const FIRST_THRESHOLD: f64 = 0.02;
/// What a round divides the threshold by: about twice the links, half the error. By rays the second round does so twice: one step
/// divides .1 to 1.9 % of the leaves there (`docs/decisions.md`).
const THRESHOLD_STEP: f64 = 3.0;
/// Rooms of at least this many faces choose their lanes only once.
const MANY_FACES: usize = 50_000;
/// Elements are not split below this share of the area that counts.
const LEAST_AREA: f64 = 1e-7;
/// The working partition may cause this share of the asked-for error. In the Cornell box under F2, .05 to .35 cost the
/// same time within 2 %, and at an error of 2, .35 left a third more error than .05.
const SPECTRUM_SHARE: f64 = 0.2;
/// Shares of the asked-for error that may be caused by light at points, and by straight lines between the vertices of
/// the output: their squares add to 1. Equal shares would ask a room whose rounds halve the error for one more round in
/// one case of six.
const LIGHT_SHARE: f64 = 0.8;
const INTERPOLATION_SHARE: f64 = 0.6;
/// Why a step without an interrupt always ends in a result.
pub(crate) const NOBODY: &str = "nobody interrupts it";

/// What a gather is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum GatherQuality {
    /// Points anywhere.
    Full,
    /// Watched points, by which the error is estimated.
    Watched,
    /// Vertices: nobody sees those that lie inside something, and as there are many, they follow fewer paths, and are worth as much as the surface about them.
    Vertex(Effort),
    /// A picture of an unfinished bake.
    Preview,
}

/// A room being baked.
pub struct Bake {
    pub(crate) room: Room,
    pub(crate) refinement: Refinement,
    pub(crate) solution: Solution,
    pub(crate) rounds: Vec<Round>,
    pub(crate) watch: Option<record::Watch>,
    pub(crate) started: Instant,
    /// Seconds that the last step took, if it was taken back.
    taken_back_s: Option<f64>,
}

/// What a solve starts from, by leaf.
pub(crate) struct SolveInput {
    pub(crate) sources: Sources,
    /// Direct irradiance.
    pub(crate) first: Rows,
    /// A first guess of the reflected light.
    pub(crate) reflected: Rows,
    /// What every node emits, if known.
    pub(crate) emitted: Option<Rows>,
    /// Relative error at which the solve ends.
    pub(crate) tolerance: f64,
    /// Are the tilts of leaves found anew? Under other lamps they stay, so that light stays linear in its lamps.
    pub(crate) tilts: bool,
    /// Is a record asked for of where the light went?
    pub(crate) counted: bool,
}

impl Bake {
    /// Prepares a room: welds it, builds the hierarchy and the ray index, and decides what to simulate.
    pub fn new(scene: Scene, settings: Settings) -> Self {
        Self::with(scene, settings, None)
    }

    /// [`Bake::new`], unless `asked` ends it before it is known where the light of lamps goes: then there is nothing.
    pub fn new_unless(scene: Scene, settings: Settings, asked: Asked) -> Option<Self> {
        Self::prepared(scene, settings, None, Interrupt::by(asked)).ok()
    }

    /// Prepares a room of which rays have already told which faces share a space and what is closed.
    pub(crate) fn with(scene: Scene, settings: Settings, analysis: Option<RoomAnalysis>) -> Self {
        Self::prepared(scene, settings, analysis, Interrupt::default()).expect(NOBODY)
    }

    fn prepared(
        scene: Scene,
        settings: Settings,
        analysis: Option<RoomAnalysis>,
        interrupt: Interrupt,
    ) -> Result<Self, Interrupted> {
        let started = Instant::now();
        let (mut room, tree) = Room::new(scene, settings, analysis, interrupt)?;
        room.interrupt = Interrupt::default();
        Ok(Self {
            refinement: Refinement {
                tree,
                ..Refinement::default()
            },
            solution: Solution::new(&room),
            room,
            rounds: Vec::new(),
            watch: None,
            started,
            taken_back_s: None,
        })
    }

    /// One round: a finer hierarchy, its links, a solution, and what is known of its error.
    pub fn step(&mut self) -> &Round {
        let record = self.round().expect(NOBODY);
        self.taken_back_s = None;
        self.rounds.push(record);
        &self.rounds[self.rounds.len() - 1]
    }

    /// [`Bake::step`], unless `asked` ends it before the round is done: then there is no round, and the bake is what it was before; if the
    /// round was the first, it has the light that rays from the lamps and to the sky give, see `early`, and keeps nothing until
    /// [`Bake::keep`] asks for it again. Rounds of a bake by several ranks are always done: they would all have to be interrupted at the
    /// very same place.
    pub fn step_unless(&mut self, asked: Asked) -> Option<&Round> {
        let is_first = self.rounds.is_empty();
        if !self.room.team.is_alone() {
            return Some(self.step());
        }
        let begun = Instant::now();
        let grown = self.refinement.tree.grown();
        let before = (!is_first).then(|| self.before());
        self.room.interrupt = Interrupt::by(asked);
        let record = self.round();
        self.room.interrupt = Interrupt::default();
        match record {
            Ok(record) => {
                self.taken_back_s = None;
                self.rounds.push(record);
                self.rounds.last()
            }
            Err(Interrupted) => {
                match before {
                    Some(before) => self.take_back(before),
                    None => {
                        self.begin_again(&grown);
                        self.room.keep = false;
                        self.light_by_landings();
                    }
                }
                self.taken_back_s = Some(begun.elapsed().as_secs_f64());
                None
            }
        }
    }

    /// Seconds that the last step took, if it was taken back: see [`Bake::step_unless`].
    pub fn taken_back_s(&self) -> Option<f64> {
        self.taken_back_s
    }

    /// A round, and its record. If it is interrupted, what it worked on is of no use any more.
    fn round(&mut self) -> Result<Round, Interrupted> {
        let mut clock = record::Clock::start(self.watch.clone());
        let round = self.rounds.len();
        if round == 0 && self.taken_back_s.is_some() {
            // The light of a first round that was interrupted is nothing to go on from.
            self.begin_again(&self.refinement.tree.grown());
        }
        let by_rays = self.room.by_rays();
        let steps = round + usize::from(by_rays && round > 0);
        let threshold = FIRST_THRESHOLD / THRESHOLD_STEP.powi(steps as i32);

        let (bright, sensitivity) = self.stakes();
        let faces = self.refinement.tree.faces.len();
        let shares = ThresholdFactors::of(by_rays, is_small(&self.room.mesh), faces);
        let demand = Demand {
            bright: &bright,
            sensitivity: &sensitivity,
            threshold: threshold * shares.link,
            least_area: LEAST_AREA * self.refinement.tree.counted(),
            hidden: !by_rays,
        };
        let refined = self.refinement.refine_links(&self.room, &demand)?;
        clock.lap("links");

        // The first links are coarse: choose again once there are more. In a room of many faces even the first are fine
        // enough, and new lanes would mean gathering all direct light anew.
        if round == 0 || (round == 1 && faces < MANY_FACES) {
            self.choose_lanes()?;
        }
        clock.lap("spectrum");

        let mut escape_rays = 0;
        if round > 0 {
            let demand = Demand {
                threshold: threshold * shares.reflected,
                ..demand
            };
            let light = &self.solution.light;
            escape_rays +=
                (self.refinement).split_where_light_varies(&self.room, light, &demand)?;
        }
        let direct_rays = self.refinement.direct.rays;
        self.gather_direct(&Demand {
            threshold: threshold * shares.direct,
            ..demand
        })?;
        clock.lap("direct");

        let (leaves, rows) = (self.refinement.leaves(), self.refinement.link_rows());
        escape_rays += self.refinement.trace_leaf_rays(&self.room)?;
        // Rays need no balance: their rows sum to what they must as they are.
        if !by_rays {
            self.refinement.balance = self.refinement.balanced(&rows);
        }
        clock.lap("balance");

        let (convergence, flux) = self.solve(&rows, &leaves);
        // A solve that was given up ends early.
        self.room.interrupt.check()?;
        self.solution.previous = Rows::default();
        clock.lap("solve");

        let estimate = self.estimate();
        clock.lap("estimate");
        Ok(self.recorded(record::RoundMeasurements {
            threshold,
            refined: &refined,
            convergence: &convergence,
            estimate,
            flux,
            link_bytes: rows.bytes(),
            rays: refined.rays + escape_rays + self.refinement.direct.rays - direct_rays,
            clock: &clock,
        }))
    }

    /// How bright every node is relative to white, and how much a change of its irradiance changes its lightness: from the last
    /// solution, or a guess before the first.
    fn stakes(&mut self) -> (Vec<f32>, Vec<f32>) {
        let tree = &self.refinement.tree;
        let nodes = tree.nodes.len();
        if self.rounds.is_empty() {
            let guess = self.room.guess(tree);
            self.solution.light.white = self.room.settings.white.unwrap_or(guess.white);
            return (guess.bright, vec![1.0; nodes]);
        }
        if self.room.settings.white.is_none() {
            self.solution.light.white = self.room.landed_white(tree, self.solution.light.white);
        }
        let bright = &self.solution.light.bright_reflected;
        (
            bright[..nodes].to_vec(),
            self.solution.lightness_sensitivity(tree),
        )
    }
}

impl Bake {
    /// Has the bake come to an end, and how? None: another round may help.
    pub fn verdict(&self) -> Option<Verdict> {
        if self.rounds.is_empty() {
            return None;
        }
        if self.refinement.tree.nodes.is_empty() || self.room.scene.spectra.is_empty() {
            return Some(Verdict::Reached);
        }
        let past: Vec<Past> = self.rounds.iter().map(Round::past).collect();
        self.goal().verdict(&past)
    }

    /// The error that light may have between vertices or texels, what it differs by there by chance included: what light at points leaves of the error that was asked
    /// for, or what it would if it had its share. Then that of light which bends alone, which is seen in patterns.
    pub(crate) fn error_between(&self) -> [f64; 2] {
        let asked = self.room.settings.error;
        let of_light = self
            .rounds
            .last()
            .and_then(|round| round.error.total_de2000.value);
        let of_light = of_light.map_or(LIGHT_SHARE * asked, |found| found.min(LIGHT_SHARE * asked));
        [
            (asked * asked - of_light * of_light).sqrt(),
            INTERPOLATION_SHARE * asked,
        ]
    }

    /// What is asked of the light on the patches.
    fn goal(&self) -> Goal {
        Goal {
            error: LIGHT_SHARE * self.room.settings.error,
            rounds: self.room.settings.rounds,
            fall: if self.room.by_rays() {
                BY_RAYS
            } else {
                BY_LINKS
            },
        }
    }

    /// Spreads the work over a team: from here on all ranks must get the same calls, and reach the same results.
    pub fn spread_over(&mut self, team: Team) {
        self.room.team = team;
        self.refinement.leaf_rays.team = team;
    }

    /// The ranks that bake this room together.
    pub fn team(&self) -> Team {
        self.room.team
    }

    /// Tells `watch` of every phase of a round that ends, by the name that it has in [`Round::phases_s`].
    pub fn watch(&mut self, watch: record::Watch) {
        self.watch = Some(watch);
    }

    /// Rounds until the end.
    pub fn run(&mut self) -> Verdict {
        loop {
            if let Some(verdict) = self.verdict() {
                return verdict;
            }
            self.step();
        }
    }

    /// Punctual lights, recentred, with their rows.
    pub(crate) fn lamps(&self) -> &[(PunctualLight, Vec<f32>)] {
        &self.solution.lamps
    }

    /// What the lanes stand for.
    pub fn lanes(&self) -> &Lanes {
        &self.solution.lanes
    }

    /// The room.
    pub fn scene(&self) -> &Scene {
        &self.room.scene
    }

    /// The welded triangles.
    pub fn mesh(&self) -> &Mesh {
        &self.room.mesh
    }

    pub(crate) fn upsampler(&self) -> &Upsampler {
        &self.room.upsampler
    }

    /// The hierarchy.
    pub fn tree(&self) -> &Tree {
        &self.refinement.tree
    }

    /// The solution of the last round.
    pub fn light(&self) -> &Light {
        &self.solution.light
    }

    /// Which effects are simulated, and why.
    pub fn plan(&self) -> &Plan {
        &self.room.plan
    }

    /// Records of the rounds so far.
    pub fn rounds(&self) -> &[Round] {
        &self.rounds
    }

    /// Does every ray inside the room meet the front of a surface?
    pub fn closed(&self) -> Closed {
        self.room.closed
    }

    /// The ray index.
    pub fn rays(&self) -> &RayIndex {
        &self.room.rays
    }

    /// What was asked for.
    pub fn settings(&self) -> &Settings {
        &self.room.settings
    }
}
