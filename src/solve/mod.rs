//! The progressive solution: rounds of refine, balance, solve and estimate, each of which leaves a whole solution.
//!
//! [`Bake::step`] is the loop on one screen; everything it calls stands in a file of its own.

mod aggregates;
mod bounded;
mod checkpoint;
mod choice;
mod coarse;
pub(crate) mod conjugate;
mod cuts;
mod direct;
mod estimate;
mod fluorescing;
pub(crate) mod flux;
pub mod forecast;
mod held;
mod lamp_light;
mod linear;
mod lists;
mod looking;
mod mixed;
mod operator;
mod outlook;
mod outside;
mod parting;
pub(crate) mod punctual;
mod rays;
pub mod record;
mod recording;
pub mod reference;
mod refining;
mod reflection;
mod representation;
mod sent;
mod shares;
mod sheets;
mod solving;
mod sources;
mod sums;
mod tinted;
pub(crate) mod two_grid;

pub use lists::PatchList;
pub use record::{Round, Verdict};
pub use representation::Representation;
pub(crate) use sources::weights_of;

use crate::color::{Observer, Upsampler};
use crate::geometry::RayIndex;
use crate::hierarchy::{Glazing, Mesh, Mirrors, Panes, Tree};
use crate::light::lanes::Lanes;
use crate::light::{Filters, Light, Rows};
use crate::link::{Balance, Demand, Graph, LinkRows, Opaque, Sight, balance, is_small};
use crate::scene::effects::{Kind, Plan};
use crate::scene::{PunctualLight, Scene};
use crate::spectrum::Leaves;
use crate::team::Team;
use crate::transport::Outside;
use crate::transport::hemisphere::Hemisphere;
use direct::Direct;
pub use flux::Closed;
pub use held::Held;
pub use operator::Operator;
use outlook::Outlook;
use parting::Parting;
use shares::Shares;
use sources::Sources;
use std::time::Instant;

/// What the user asks for.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Settings {
    /// Mean colour difference (CIEDE2000) at which to stop.
    pub error: f64,
    /// How spectra are carried.
    pub representation: Representation,
    /// Mean colour difference (CIELUV) that adaptive lanes may cause; none: a share of `error`.
    pub spectrum: Option<f64>,
    /// Seed of every sampling pattern.
    pub seed: u64,
    /// Irradiance (tristimulus) of the adaptation white; none: twice the mean irradiance of the room.
    pub white: Option<[f64; 3]>,
    /// Rounds at the most.
    pub rounds: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            error: 0.5,
            representation: Representation::Adaptive,
            spectrum: None,
            seed: 0,
            white: None,
            rounds: 12,
        }
    }
}

/// Threshold of the first round, share of white (see [`Demand::threshold`]); each round divides it.
const FIRST_THRESHOLD: f64 = 0.02;
/// What a round divides the threshold by: about twice the links, half the error.
const THRESHOLD_STEP: f64 = 3.0;
/// One distance between rounds may be small by chance, or because the second found nothing to refine yet.
const LEAST_ROUNDS: usize = 3;
/// Fewer rounds do where a mere preview is asked for, an error of so much, and the estimate is so many times smaller.
const PREVIEW: f64 = 2.0;
const EARLY: f64 = 4.0;
/// A round that leaves this share of the error of the one before has stalled, if there are many links already. One that finds it
/// much greater has not: it found light that the rounds before it overlooked, as in the gap above a lamp.
const STALLED: f64 = 0.9;
const WORTH_STALLING: usize = 100_000;
/// No round that would make more links than this, at four times those of the last: about 200 MB.
const MOST_LINKS: usize = 4_000_000;
/// Rooms of this many faces choose their lanes once.
const MANY_FACES: usize = 50_000;
/// Rooms of few triangles with panes or mirrors take directions for this share of the error: what is clipped exactly in others is found by rays
/// there, and a ray costs next to nothing.
const GLAZED_DIRECTIONS: f64 = 0.25;
/// A shade around a bulb is as bright as a lamp, but found by rays like all that passes light on: rooms with sheets take directions for
/// this share of the error. In a curtained room twice as fine directions and tolerances of points brought the estimate of the fifth round
/// from .56 to .38 dE00, with half the elements.
const SHEET_DIRECTIONS: f64 = 0.5;
/// Elements are not split below this share of the area of all faces.
const LEAST_AREA: f64 = 1e-7;
/// The working partition may cause this share of the asked-for error. In the Cornell box under F2, .05 to .35 cost the
/// same time within 2 %, and .35 left a third more error at 2 than .05.
const SPECTRUM_SHARE: f64 = 0.2;
/// Shares of the error asked for that light at points and straight lines between the vertices of the output may take:
/// squares add to 1. Half and half would ask a room whose rounds halve the error for a further round in one of six cases
/// more.
pub(crate) const LIGHT_SHARE: f64 = 0.8;
pub(crate) const INTERPOLATION_SHARE: f64 = 0.6;
/// A relative error of 1 % of a mid grey is about this colour difference, see `estimate`.
pub(crate) const DE_PER_PERCENT: f64 = 0.35;

/// What a gather is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Care {
    /// Points anywhere.
    Full,
    /// Vertices: those within something are seen by nobody.
    Vertex,
    /// A picture on the way.
    Sketch,
}

/// Do leaves and points of this room look for themselves? In a room of few triangles exact clipping is better, but it knows no
/// filters: where there are panes or mirrors rays do all.
fn by_rays(sight: &Sight) -> bool {
    let plain = sight.panes.is_none() && sight.mirrors.is_none();
    sight.occlusion && !(sight.small() && plain)
}

/// For what share of the error a room takes directions.
fn directions(plan: &Plan, mesh: &Mesh) -> f64 {
    let filtered = plan.runs(Kind::Panes) || plan.runs(Kind::Mirrors);
    match (filtered && is_small(mesh), plan.runs(Kind::Sheets)) {
        (true, _) => GLAZED_DIRECTIONS,
        (_, true) => SHEET_DIRECTIONS,
        _ => 1.0,
    }
}

/// A room being baked.
pub struct Bake {
    pub(crate) scene: Scene,
    pub(crate) settings: Settings,
    pub(crate) plan: Plan,
    pub(crate) mesh: Mesh,
    pub(crate) tree: Tree,
    pub(crate) rays: RayIndex,
    /// What light passes through; none where the room has no panes.
    pub(crate) panes: Option<Panes>,
    /// What sends light on in one direction; none where the room has no mirrors.
    pub(crate) mirrors: Option<Mirrors>,
    /// The spectra of panes and mirrors on the present lanes.
    pub(crate) filters: Filters,
    pub(crate) graph: Graph,
    pub(crate) closed: Closed,
    /// The same for what is not covered by something solid.
    pub(crate) sealed: Closed,
    pub(crate) weights: [Leaves; 3],
    /// Colours of textures as spectra: its table is made once.
    pub(crate) upsampler: Upsampler,
    pub(crate) lanes: Lanes,
    /// Colour difference (CIELUV) that the lanes cause, as far as it is known.
    pub(crate) spectrum_error: Option<f64>,
    pub(crate) outlook: Outlook,
    /// Area of each node that takes part.
    pub(crate) areas: Vec<f64>,
    pub(crate) balance: Balance,
    pub(crate) light: Light,
    /// Reflected radiosity of the round before, by node: where a solve starts.
    pub(crate) previous: Rows,
    pub(crate) lamps: Vec<(PunctualLight, Vec<f32>)>,
    /// What is outside; none where no light comes from there.
    pub(crate) outside: Option<Outside>,
    pub(crate) direct: direct::Direct,
    pub(crate) probes: estimate::Probes,
    /// Where the light of lamps goes first.
    pub(crate) sent: flux::Sent,
    pub(crate) hemisphere: Hemisphere,
    pub(crate) rounds: Vec<Round>,
    pub(crate) watch: Option<record::Watch>,
    /// Is it kept where light comes from, for relighting?
    pub(crate) keep: bool,
    /// Where the light of the watched points came from in the last two rounds, if that is kept.
    pub(crate) watched: [Vec<Option<Box<[u8]>>>; 2],
    /// What the choice of lanes may take for granted when lamps and paints change: shadows of punctual lights, balance.
    pub(crate) frozen: Option<(punctual::Shadowed, Vec<f32>)>,
    /// Few patches that stand for the room in a solve by rays.
    pub(crate) two_grid: Option<two_grid::TwoGrid>,
    /// Space of each face, and which cuts were made for them, see [`spaces`].
    pub(crate) spaces: Vec<u32>,
    pub(crate) parted: Vec<u32>,
    /// The ranks that bake this room together.
    pub(crate) team: Team,
    pub(crate) started: Instant,
}

/// What rays have told of a room before the first round.
pub(crate) struct Known {
    pub(crate) spaces: Vec<u32>,
    /// Which cuts of triangles were made for their sake.
    pub(crate) parted: Vec<u32>,
    /// Of the room, and without what is covered.
    pub(crate) closed: [Closed; 2],
}

/// What a solve starts from, by leaf.
pub(crate) struct Given {
    pub(crate) sources: Sources,
    /// Direct irradiance.
    pub(crate) first: Rows,
    /// A guess of what is reflected.
    pub(crate) reflected: Rows,
    /// What every node emits, if that is known.
    pub(crate) emitted: Option<Rows>,
    /// Relative error at which the solve ends.
    pub(crate) tolerance: f64,
    /// Is it asked for where the light went?
    pub(crate) counted: bool,
}

impl Bake {
    /// Prepares a room: welds it, builds the hierarchy and the ray index, and decides what to simulate.
    pub fn new(scene: Scene, settings: Settings) -> Self {
        Self::with(scene, settings, None)
    }

    /// The same where rays have told already which faces share a space, and what is closed.
    pub(crate) fn with(scene: Scene, settings: Settings, known: Option<Known>) -> Self {
        let started = Instant::now();
        let mut plan = Plan::of(&scene);
        let mesh = Mesh::new(&scene);
        let (parting, closed) = match known {
            Some(known) => {
                let parting = Parting::again(&scene, mesh, known.spaces, known.parted);
                (parting, Some(known.closed))
            }
            None => (Parting::find(&scene, mesh, &plan, settings.seed), None),
        };
        let Parting {
            mesh,
            rays,
            spaces,
            parted,
        } = parting;
        let tree = Tree::new(&mesh, &spaces);
        let weights = Observer::cie1931().weights(&scene.grid);
        let upsampler = Upsampler::new(&scene.grid);
        let lanes = Lanes::dense(&scene.spectra, &weights);
        let mirrors = Mirrors::new(&scene, &mesh);
        if let Some(mirrors) = &mirrors {
            plan.say(Kind::Mirrors, &mirrors.said());
        }
        let hemisphere = Hemisphere::for_error(settings.error * directions(&plan, &mesh));
        let probes = estimate::Probes::new(&tree, settings.seed);
        let mut bake = Self {
            closed: Closed::No,
            sealed: Closed::No,
            outlook: Outlook::default(),
            areas: Vec::new(),
            balance: Balance::default(),
            light: Light::default(),
            previous: Rows::default(),
            lamps: Vec::new(),
            outside: None,
            direct: direct::Direct::default(),
            graph: Graph::default(),
            rounds: Vec::new(),
            watch: None,
            keep: false,
            watched: Default::default(),
            frozen: None,
            two_grid: None,
            team: Team::default(),
            spectrum_error: None,
            sent: flux::Sent::default(),
            panes: Panes::new(&scene, mesh.centre),
            mirrors,
            filters: Filters::new(&scene, &lanes),
            scene,
            settings,
            plan,
            mesh,
            tree,
            rays,
            weights,
            upsampler,
            lanes,
            probes,
            hemisphere,
            spaces,
            parted,
            started,
        };
        match closed {
            Some(closed) => {
                [bake.closed, bake.sealed] = closed;
                bake.look_outside(false);
            }
            None => bake.look_around(),
        }
        bake
    }

    /// One round: a finer hierarchy, its links, a solution, and what is known of its error.
    pub fn step(&mut self) -> &Round {
        let mut clock = record::Clock::start(self.watch.clone());
        let round = self.rounds.len();
        let threshold = FIRST_THRESHOLD / THRESHOLD_STEP.powi(round as i32);

        let bright = self.brightness_of_nodes();
        let by_rays = self.by_rays();
        let shares = Shares::of(by_rays, is_small(&self.mesh), self.tree.faces.len());
        let keen = self.keenness();
        let demand = Demand {
            bright: &bright,
            keen: &keen,
            total_area: self.tree.nodes.first().map_or(0.0, |n| n.area),
            threshold: threshold * shares.link,
            least_area: LEAST_AREA * self.tree.nodes.first().map_or(0.0, |n| n.area),
            hidden: !by_rays,
        };
        let refined = self.refine_links(&demand);
        clock.lap("links");

        // The first links are coarse: look again once there are more. A room of many faces is not coarse even then, and
        // new lanes would ask for all direct light anew.
        if round == 0 || (round == 1 && self.tree.faces.len() < MANY_FACES) {
            self.choose_lanes();
        }
        clock.lap("spectrum");

        let mut escape_rays = self.split_where_light_varies(&Demand {
            threshold: threshold * shares.reflected,
            ..demand
        });
        let direct_rays = self.direct.rays;
        let demand = Demand {
            threshold: threshold * shares.direct,
            ..demand
        };
        self.gather_direct(&demand);
        clock.lap("direct");

        let leaves: Vec<u32> = self.tree.leaves().collect();
        let rows = LinkRows::new(self.tree.nodes.len(), &self.graph.links);
        escape_rays += self.look_out();
        // Rays need no balance: their rows sum to what they must as they are.
        if !by_rays {
            self.balance = balance(&self.tree, &rows, &self.areas, &self.outlook.target);
        }
        clock.lap("balance");

        let (convergence, flux) = self.solve(&rows, &leaves);
        clock.lap("solve");

        let distance = self.distance();
        clock.lap("estimate");
        let record = self.recorded(record::Measured {
            threshold,
            refined: &refined,
            convergence: &convergence,
            distance,
            flux,
            link_bytes: rows.bytes(),
            rays: refined.rays + escape_rays + self.direct.rays - direct_rays,
            clock: &clock,
        });
        self.rounds.push(record);
        &self.rounds[round]
    }
}

impl Bake {
    /// Has the bake come to an end, and how? None: another round may help.
    pub fn verdict(&self) -> Option<Verdict> {
        let last = self.rounds.last()?;
        let estimate = |r: &Round| r.error.total_de2000.value;
        let asked = LIGHT_SHARE * self.settings.error;
        let settled =
            |e: f64| self.rounds.len() >= LEAST_ROUNDS || (asked >= PREVIEW && EARLY * e <= asked);
        if estimate(last).is_some_and(|e| e <= asked && settled(e)) {
            return Some(Verdict::Reached);
        }
        if self.tree.nodes.is_empty() || self.scene.spectra.is_empty() {
            return Some(Verdict::Reached);
        }
        if self.rounds.len() >= self.settings.rounds {
            return Some(Verdict::OutOfRounds);
        }
        // Four times the links for next to nothing: what is left is the noise of visibility in the gather.
        let before = self
            .rounds
            .len()
            .checked_sub(2)
            .and_then(|k| estimate(&self.rounds[k]));
        let stalled = before
            .zip(estimate(last))
            .is_some_and(|(before, now)| (STALLED..1.0 / STALLED).contains(&(now / before)));
        (4 * last.links > MOST_LINKS || (stalled && last.links > WORTH_STALLING))
            .then_some(Verdict::Exhausted)
    }

    /// Spreads the work over a team: all ranks are to be told the same from here on, and come to the same.
    pub fn spread_over(&mut self, team: Team) {
        self.team = team;
        self.outlook.team = team;
    }

    /// The ranks that bake this room together.
    pub fn team(&self) -> Team {
        self.team
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

    /// Do leaves and points of this room look for themselves?
    fn by_rays(&self) -> bool {
        self.with_sight(|_, sight| by_rays(sight))
    }

    /// Runs `f` with what blocks light in this room.
    pub(crate) fn with_sight<T>(&self, f: impl FnOnce(&Self, &Sight) -> T) -> T {
        let opaque = |triangle: u32, u: f32, v: f32| {
            !crate::hierarchy::alpha::is_hole(
                &self.scene,
                &self.mesh,
                triangle,
                [1.0 - u - v, u, v],
            )
        };
        let opaque: Option<&Opaque> = if self.plan.runs(Kind::AlphaMasks) {
            Some(&opaque)
        } else {
            None
        };
        f(
            self,
            &Sight {
                rays: &self.rays,
                mesh: &self.mesh,
                opaque,
                panes: self.glazing(),
                mirrors: self.mirrors.as_ref(),
                occlusion: self.plan.runs(Kind::Occlusion),
            },
        )
    }

    /// The panes of this room.
    pub(crate) fn glazing(&self) -> Option<Glazing<'_>> {
        let scene = &self.scene;
        (self.panes.as_ref()).map(|panes| Glazing { panes, scene })
    }

    /// Punctual lights, recentred, with their rows.
    pub(crate) fn lamps(&self) -> &[(PunctualLight, Vec<f32>)] {
        &self.lamps
    }

    /// What the lanes stand for.
    pub fn lanes(&self) -> &Lanes {
        &self.lanes
    }

    /// The room.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The welded triangles.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    pub(crate) fn upsampler(&self) -> &Upsampler {
        &self.upsampler
    }

    /// The hierarchy.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// The solution of the last round.
    pub fn light(&self) -> &Light {
        &self.light
    }

    /// What runs and why.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Records of the rounds so far.
    pub fn rounds(&self) -> &[Round] {
        &self.rounds
    }

    /// Does light always meet a front?
    pub fn closed(&self) -> Closed {
        self.closed
    }

    /// The ray index.
    pub fn rays(&self) -> &RayIndex {
        &self.rays
    }

    /// What was asked for.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}
