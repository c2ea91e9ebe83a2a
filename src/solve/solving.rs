//! The solve of a round: from direct light on the leaves to the light on every patch, with the balance of fluxes.

use super::fluorescing::{Glow, Rounds};
use super::flux::{self, Closed};
use super::linear;
use super::list_bounces::{ListBounces, Senders};
use super::mixed::Mixed;
use super::operator::Operator;
use super::reflection::Reflection;
use super::solver::{Convergence, System, step};
use super::{Bake, SolveInput};
use crate::light::{Light, Neighbours, Rows, padded, weighed};
use crate::link::LinkRows;
use crate::scene::effects::EffectKind;
use crate::spectrum::{BANDS, Spectrum};
use std::borrow::Cow;

/// The leaves under direct light, and how they reflect: what the bounces start from.
struct BounceStart<'a> {
    leaves: &'a [u32],
    links: &'a LinkRows,
    /// Direct irradiance by leaf.
    first: &'a Rows,
    reflection: &'a Reflection,
    /// From radiosity by leaf to irradiance by leaf.
    receive: &'a (dyn Fn(&Rows) -> Rows + Sync),
    /// Relative error at which the solve ends.
    tolerance: f64,
}

/// The result of all bounces.
struct Bounced {
    convergence: Convergence,
    /// Irradiance by reflected light and by fluorescence.
    irradiance: Rows,
    /// Fluorescent exitance, by leaf; none where nothing fluoresces.
    given: Option<Rows>,
    /// By what the flux of reflected light was multiplied.
    ratio: f64,
}

impl Bounced {
    /// The result on leaves that reflect nothing.
    fn none<const L: usize>(leaves: usize) -> Self {
        Self {
            convergence: Convergence::default(),
            irradiance: Rows::zero(leaves, L),
            given: None,
            ratio: 1.0,
        }
    }
}

/// Rows plus fluorescent exitance, if any.
fn with<'a, const L: usize>(rows: &'a Rows, given: Option<&Rows>) -> Cow<'a, Rows> {
    let mut rows = Cow::Borrowed(rows);
    if let Some(given) = given {
        step::<L>(rows.to_mut(), given, [1.0; L]);
    }
    rows
}

impl Bake {
    /// Solves on the current links and measures the solution.
    pub(super) fn solve(
        &mut self,
        rows: &LinkRows,
        leaves: &[u32],
    ) -> (Convergence, flux::FluxBalance) {
        match padded(self.solution.lanes.len()) {
            4 => self.solve_on::<4>(rows, leaves),
            8 => self.solve_on::<8>(rows, leaves),
            16 => self.solve_on::<16>(rows, leaves),
            32 => self.solve_on::<32>(rows, leaves),
            _ => self.solve_on::<64>(rows, leaves),
        }
    }

    /// [`Self::solve`] on rows of `L` lanes.
    fn solve_on<const L: usize>(
        &mut self,
        rows: &LinkRows,
        leaves: &[u32],
    ) -> (Convergence, flux::FluxBalance) {
        let mut first = Rows::zero(leaves.len(), L);
        for (k, &leaf) in leaves.iter().enumerate() {
            let row = self.refinement.direct.row(leaf);
            first.row_mut(k)[..row.len()].copy_from_slice(row);
        }
        let input = SolveInput {
            sources: self
                .room
                .painter()
                .paint(&self.refinement.tree, leaves, &self.solution.lanes),
            first,
            reflected: self.solution.guess::<L>(&self.refinement.tree, leaves),
            emitted: None,
            tolerance: self.room.tolerance(),
            tilts: self.room.by_rays(),
            counted: true,
        };
        let solved = self.solve_with::<L>(rows, leaves, input);
        self.light_arrives();
        solved
    }

    /// The solve itself; returns also what it starts from.
    pub(crate) fn solve_with<const L: usize>(
        &mut self,
        rows: &LinkRows,
        leaves: &[u32],
        input: SolveInput,
    ) -> (Convergence, flux::FluxBalance) {
        let SolveInput {
            sources,
            mut first,
            mut reflected,
            emitted,
            tolerance,
            tilts,
            counted,
        } = input;
        let emission = sources.emission;
        let by_rays = self.room.by_rays();
        self.refinement.leaf_rays.tints.on(&self.solution.filters);
        self.add_lamps_in_mirrors::<L>(&emission, leaves, &mut first);
        let mut scaled = flux::Scaled::default();
        if self.room.sealed == Closed::Yes && !by_rays {
            scaled.direct = self.conserve(&mut first, &emission, leaves);
        }
        let reflection = Reflection {
            rows: sources.reflectance,
            greatest: sources.greatest,
            mixed: self.mixed(leaves),
            sheets: sources.sheets,
        };
        let sums = self.sums_of(rows);
        let runs = self.room.plan.runs(EffectKind::Interreflection);
        let bounced = self.bounced::<L>(
            (rows, leaves, &sums),
            (&first, &reflection, sources.glow.as_ref()),
            (tolerance, tilts),
            &mut reflected,
        );
        scaled.reflected = bounced.ratio;
        let (mut irradiance, given) = (bounced.irradiance, bounced.given);
        step::<L>(&mut irradiance, &first, [1.0; L]);
        if !runs {
            reflected = reflection.of::<L>(&irradiance);
        }
        let sent = with::<L>(&reflected, given.as_ref());
        let on_nodes = self.refinement.on_nodes::<L>(&sent, leaves);
        let through = reflection.sheets.as_ref();
        let mut through = through.map(|s| s.shown.clone()).unwrap_or_default();
        let mut flux = flux::FluxBalance::default();
        if counted {
            let fluxes = flux::FluxRows {
                emission: &emission,
                reflected: &reflected,
                irradiance: &irradiance,
                first: &first,
                fluoresced: given.as_ref(),
                reflectance: &reflection.albedo::<L>(&reflected, &irradiance),
            };
            flux = self.flux::<L>(leaves, &fluxes, &on_nodes, &sums);
        }
        (flux.sent, flux.scaled) = (self.room.sent, scaled);
        let emitted = emitted.unwrap_or_else(|| self.refinement.on_nodes::<L>(&emission, leaves));
        let on_nodes = self.without_mirrors::<L>(sent, on_nodes, leaves);
        if !through.is_empty() {
            irradiance = through.shown(irradiance);
        }
        self.solution.light.through = through;
        self.shine(leaves, emitted, on_nodes, irradiance);
        (bounced.convergence, flux)
    }

    /// All bounces, where they run. If `tilts` are asked for, leaves are tilted before by what they reflected in the last round; in the
    /// first by a solve without.
    fn bounced<const L: usize>(
        &mut self,
        (rows, leaves, sums): (&LinkRows, &[u32], &[f64]),
        (first, reflection, glow): (&Rows, &Reflection, Option<&Glow>),
        (tolerance, tilts): (f64, bool),
        reflected: &mut Rows,
    ) -> Bounced {
        if !self.room.plan.runs(EffectKind::Interreflection) {
            return Bounced::none::<L>(leaves.len());
        }
        let bounce = |bake: &Self, reflected: &mut Rows| {
            let lit = BounceStart {
                leaves,
                links: rows,
                first,
                reflection,
                receive: &*bake.receive::<L>(rows, leaves),
                tolerance,
            };
            bake.all_bounces::<L>(&lit, rows, sums, glow, reflected)
        };
        let mut before = 0;
        if tilts {
            if reflected.all::<L>().iter().all(|row| *row == [0.0; L]) {
                before = bounce(self, reflected).convergence.iterations;
            }
            self.tilt_leaves::<L>(leaves, first, reflected);
        }
        let mut bounced = bounce(self, reflected);
        bounced.convergence.iterations += before;
        bounced
    }

    /// Finds how the light of leaves is tilted, by their direct light and what they receive besides.
    fn tilt_leaves<const L: usize>(&mut self, leaves: &[u32], first: &Rows, reflected: &Rows) {
        let lanes = &self.solution.lanes;
        let refinement = &mut self.refinement;
        let by_leaf = |rows: &Rows| {
            let bright = |row: &[f32; L]| lanes.notice(row).into_iter().sum::<f64>() as f32;
            rows.all::<L>().iter().map(bright).collect::<Vec<f32>>()
        };
        let mut bright = vec![0.0; refinement.tree.nodes.len()];
        for (&leaf, b) in leaves.iter().zip(by_leaf(reflected)) {
            bright[leaf as usize] = b;
        }
        let direct = leaves.iter().zip(by_leaf(first));
        let direct: Vec<[f32; 2]> = direct
            .map(|(&leaf, b)| [b, b * refinement.direct.with_openness(leaf)])
            .collect();
        let room = (&refinement.tree, leaves, self.room.settings.seed);
        (refinement.leaf_rays).tilt(room, &bright, &direct, &refinement.areas);
    }

    /// Matrices of the paints, where lanes are not bands.
    fn mixed(&self, leaves: &[u32]) -> Option<Mixed> {
        let (tree, lanes) = (&self.refinement.tree, &self.solution.lanes);
        (lanes.is_mixed()).then(|| self.room.painter().mixed(tree, leaves, lanes))
    }

    /// Adds the light of lamps in curved mirrors.
    fn add_lamps_in_mirrors<const L: usize>(
        &self,
        emission: &Rows,
        leaves: &[u32],
        first: &mut Rows,
    ) {
        if self.room.mirrors.is_none() {
            return;
        }
        let emitted = self.refinement.on_nodes::<L>(emission, leaves);
        if let Some(more) = self
            .refinement
            .leaf_rays
            .lamps_in_mirrors::<L>(leaves, &emitted)
        {
            step::<L>(first, &more, [1.0; L]);
        }
    }

    /// All bounces, and fluorescence.
    fn all_bounces<const L: usize>(
        &self,
        lit: &BounceStart,
        rows: &LinkRows,
        sums: &[f64],
        glow: Option<&Glow>,
        reflected: &mut Rows,
    ) -> Bounced {
        let mut given = None;
        let (convergence, mut irradiance) = match glow {
            Some(glow) => {
                let (done, out, seen) = self.fluoresce::<L>(lit, glow, reflected);
                given = Some(out);
                (done, seen)
            }
            None => self.bounce::<L>(lit, reflected),
        };
        let mut ratio = 1.0;
        if !self.room.by_rays() {
            let glow = glow.zip(given.as_mut());
            (irradiance, ratio) = self.slope::<L>(lit, rows, sums, reflected, glow);
        }
        Bounced {
            convergence,
            irradiance,
            given,
            ratio,
        }
    }

    /// All bounces, before links are looked at once more: how the solve went, and irradiance by reflected light.
    fn bounce<const L: usize>(
        &self,
        lit: &BounceStart,
        reflected: &mut Rows,
    ) -> (Convergence, Rows) {
        let system = System {
            reflection: lit.reflection,
            areas: self.areas_of(lit.leaves),
            receive: lit.receive,
            interrupt: &self.room.interrupt,
        };
        match self.solution.list_limit {
            Some(limit) if L == BANDS => {
                let bounces = ListBounces {
                    system: &system,
                    senders: self.senders(lit.links, lit.leaves),
                    weights: &self.room.weights,
                    white: self.solution.light.white,
                    limit,
                };
                bounces.solve(lit.first, reflected, lit.tolerance)
            }
            _ => system.solve::<L>(lit.first, reflected, lit.tolerance),
        }
    }

    /// From whom leaves receive.
    pub(super) fn senders<'a>(&'a self, rows: &'a LinkRows, leaves: &'a [u32]) -> Senders<'a> {
        let refinement = &self.refinement;
        match self.room.by_rays() {
            true => Senders::Rays(&refinement.leaf_rays, leaves),
            false => Senders::Links(Operator::new(
                &refinement.tree,
                rows,
                leaves,
                &refinement.areas,
                &refinement.balance.factor,
            )),
        }
    }

    /// As much of the area of leaves as takes part.
    fn areas_of(&self, leaves: &[u32]) -> Vec<f64> {
        let areas = &self.refinement.areas;
        leaves.iter().map(|&leaf| areas[leaf as usize]).collect()
    }

    /// [`Self::bounce`] where surfaces fluoresce: also the fluorescent exitance, and irradiance by both.
    fn fluoresce<const L: usize>(
        &self,
        lit: &BounceStart,
        glow: &Glow,
        reflected: &mut Rows,
    ) -> (Convergence, Rows, Rows) {
        let one = [1.0; BANDS];
        let power = self
            .solution
            .lanes
            .taken(&one, self.room.scene.grid.width());
        let rounds = Rounds {
            glow,
            areas: self.areas_of(lit.leaves),
            power: power.into_iter().map(f64::from).collect(),
            tolerance: lit.tolerance,
            interrupt: &self.room.interrupt,
        };
        rounds.solve::<L>(lit.first, reflected, lit.receive, |first, reflected| {
            self.bounce::<L>(&BounceStart { first, ..*lit }, reflected)
        })
    }

    /// What turns radiosity of the leaves into what they receive: their rays, or links.
    pub(super) fn receive<'a, const L: usize>(
        &'a self,
        rows: &'a LinkRows,
        leaves: &'a [u32],
    ) -> Box<dyn Fn(&Rows) -> Rows + Sync + 'a> {
        match self.senders(rows, leaves) {
            Senders::Links(operator) => {
                Box::new(move |radiosity| operator.received::<L>(radiosity))
            }
            Senders::Rays(leaf_rays, leaves) => Box::new(move |radiosity| {
                let mut seen = Rows::zero(leaves.len(), L);
                let nodes = self.refinement.on_nodes::<L>(radiosity, leaves);
                leaf_rays.irradiance::<L>(leaves, &nodes, &mut seen);
                seen
            }),
        }
    }

    /// What rows of links sum to; empty where leaves look for themselves.
    fn sums_of(&self, rows: &LinkRows) -> Vec<f64> {
        if self.room.by_rays() {
            return Vec::new();
        }
        let factor: Vec<f64> = self
            .refinement
            .balance
            .factor
            .iter()
            .map(|&f| f64::from(f))
            .collect();
        crate::link::row_sums(&self.refinement.tree, rows, &self.refinement.areas, &factor)
    }

    /// Scales direct light so that all that lamps emit arrives; returns its flux after over before.
    fn conserve(&self, first: &mut Rows, emission: &Rows, leaves: &[u32]) -> f64 {
        let lumens =
            |rows: &Rows| flux::lumens(&self.refinement.areas, &self.solution.lanes, leaves, rows);
        let before = lumens(first);
        flux::conserve(
            first,
            emission,
            &self.solution.lamps,
            &self.refinement.areas,
            leaves,
        );
        flux::ratio(lumens(first), before)
    }

    /// Last passes over the links, see [`linear`]: irradiance by reflected light, and what its flux was multiplied by. What fluoresces is
    /// found anew with them.
    fn slope<const L: usize>(
        &self,
        lit: &BounceStart,
        rows: &LinkRows,
        sums: &[f64],
        reflected: &mut Rows,
        mut glow: Option<(&Glow, &mut Rows)>,
    ) -> (Rows, f64) {
        let (leaves, reflection) = (lit.leaves, lit.reflection);
        let lumens =
            |rows: &Rows| flux::lumens(&self.refinement.areas, &self.solution.lanes, leaves, rows);
        let slopes = linear::Slopes::new(
            &self.refinement.tree,
            rows,
            &self.refinement.areas,
            leaves,
            sums,
        );
        let bounced = reflection.of::<L>(lit.first);
        let (mut irradiance, mut ratio) = (Rows::default(), 1.0);
        for _ in 0..linear::PASSES {
            // Fluorescence does not depend on the irradiance of its own lane: it counts with direct light.
            let given = glow.as_ref().map(|(_, given)| &**given);
            irradiance = slopes.irradiance::<L>(&with::<L>(reflected, given));
            let before = lumens(&irradiance);
            let again = reflection.of::<L>(&irradiance);
            let first = with::<L>(&bounced, given);
            let energy = slopes.balance::<L>(&irradiance, &first, &again);
            reflection.scale::<L>(&self.solution.lanes, &mut irradiance, energy);
            ratio = flux::ratio(lumens(&irradiance), before);
            let mut all = irradiance.clone();
            step::<L>(&mut all, lit.first, [1.0; L]);
            *reflected = reflection.of::<L>(&all);
            if let Some((glow, given)) = &mut glow {
                **given = glow.of::<L>(&all);
            }
            if self.room.interrupt.is_raised() {
                break;
            }
        }
        (irradiance, ratio)
    }

    /// Where the light went; where leaves look for themselves, by whole leaves.
    fn flux<const L: usize>(
        &self,
        leaves: &[u32],
        rows: &flux::FluxRows,
        on_nodes: &Rows,
        sums: &[f64],
    ) -> flux::FluxBalance {
        let (refinement, lanes) = (&self.refinement, &self.solution.lanes);
        if !self.room.by_rays() {
            return flux::flux(&refinement.areas, lanes, leaves, rows, sums);
        }
        let mut whole = Rows::zero(leaves.len(), L);
        if self.room.plan.runs(EffectKind::Interreflection) {
            (refinement.leaf_rays).irradiance_of_whole::<L>(leaves, on_nodes, &mut whole);
        }
        let whole = flux::Whole {
            indirect: &whole,
            direct: &|leaf| f64::from(refinement.direct.whole(leaf)),
            area: &|leaf| refinement.tree.node(leaf).area,
            mirror: &|leaf| self.is_mirror(leaf),
        };
        flux::flux_by_rays(&refinement.areas, lanes, leaves, rows, &whole)
    }

    /// Is a leaf a mirror?
    pub(super) fn is_mirror(&self, leaf: u32) -> bool {
        self.room.mirrors.as_ref().is_some_and(|mirrors| {
            let face = self.refinement.tree.face_of(leaf);
            mirrors.is_side(face.triangle, face.back)
        })
    }

    /// Takes the radiosity of mirrors as matt surfaces out of what leaves send, and keeps it for rays that met too many
    /// mirrors; returns what all nodes send.
    pub(super) fn without_mirrors<const L: usize>(
        &mut self,
        sent: Cow<Rows>,
        on_nodes: Rows,
        leaves: &[u32],
    ) -> Rows {
        if self.room.mirrors.is_none() {
            return on_nodes;
        }
        let (mut sent, mut mirrors) = (
            sent.into_owned(),
            Rows::zero(self.refinement.tree.nodes.len(), L),
        );
        for (row, &leaf) in sent.all_mut::<L>().iter_mut().zip(leaves) {
            if self.is_mirror(leaf) {
                mirrors.all_mut::<L>()[leaf as usize] = *row;
                *row = [0.0; L];
            }
        }
        self.solution.light.mirrors = mirrors;
        self.refinement.on_nodes::<L>(&sent, leaves)
    }

    /// Takes over a solution: light by node, irradiance by leaf, and the adaptation white.
    pub(super) fn shine(
        &mut self,
        leaves: &[u32],
        emitted: Rows,
        reflected: Rows,
        irradiance: Rows,
    ) {
        self.solution.light = Light {
            reflected,
            emitted,
            irradiance,
            leaves: leaves.to_vec(),
            neighbours: Neighbours::new(self.refinement.tree.nodes.len(), &self.refinement.graph),
            through: std::mem::take(&mut self.solution.light.through),
            mirrors: std::mem::take(&mut self.solution.light.mirrors),
            white: self.solution.light.white,
            half_size: self.room.mesh.half_size,
            tilts: self.refinement.leaf_rays.tilts.clone(),
            apart: self.solution.lanes.excites().is_some(),
            ..Light::default()
        };
        self.solution.light.white = self
            .room
            .settings
            .white
            .unwrap_or_else(|| self.mean_irradiance().map(|x| 2.0 * x));
        self.solution
            .light
            .measure(&self.refinement.tree, &self.room.mesh, &self.solution.lanes);
    }

    /// Stores how bright the light arriving on each leaf is.
    pub(super) fn light_arrives(&mut self) {
        let light = &self.solution.light;
        let weights = self.solution.bright_weights();
        let bright = |row: &[f32]| weighed(row, &weights) as f32;
        let nodes = self.refinement.tree.nodes.len();
        let mut arrival = vec![0.0; nodes];
        for (k, &leaf) in light.leaves.iter().enumerate() {
            arrival[leaf as usize] = bright(light.irradiance.row(k));
        }
        let mut sides = vec![[0.0; 2]; if light.through.is_empty() { 0 } else { nodes }];
        for (place, side) in light.through.sides(bright) {
            sides[light.leaves[place as usize] as usize] = side;
        }
        (self.solution.light.arrival, self.solution.light.sides) = (arrival, sides);
        self.solution.light.bright_lamps = self.solution.bright_lamps();
    }

    /// Mean irradiance over the area that counts, tristimulus.
    pub fn mean_irradiance(&self) -> [f64; 3] {
        self.mean_over_leaves(|row| self.solution.lanes.tristimulus(row))
    }

    /// The spectrum of the mean irradiance, W/m2/nm on the 64 bands.
    pub fn mean_spectrum(&self) -> Spectrum {
        self.mean_over_leaves(|row| self.solution.lanes.spectrum(row))
    }

    /// The mean of `of` irradiance over the area that counts; 0 where there is none.
    fn mean_over_leaves<const N: usize>(&self, of: impl Fn(&[f32]) -> [f64; N]) -> [f64; N] {
        let (mut sum, mut area) = ([0.0; N], 0.0);
        for (k, &leaf) in self.solution.light.leaves.iter().enumerate() {
            let a = self.refinement.counted(leaf);
            let each = of(self.solution.light.irradiance.row(k));
            sum = std::array::from_fn(|c| sum[c] + a * each[c]);
            area += a;
        }
        sum.map(|x| if area > 0.0 { x / area } else { 0.0 })
    }
}
