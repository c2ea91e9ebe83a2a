//! The solve of a round: from direct light on the leaves to the light on every patch, with the flux that went where.

use super::conjugate::{Convergence, System};
use super::flux::{self, Closed};
use super::linear;
use super::mixed::Mixed;
use super::operator::{self, Operator};
use super::rays::RaySystem;
use super::sources::{Painter, Sources};
use super::{Bake, Given};
use crate::light::{Arrival, Light, Neighbours, Rows, brightness, weighed};
use crate::link::LinkRows;
use crate::scene::effects::Kind;

/// The solve ends at this relative error for each unit of asked-for colour difference: far below geometry and spectrum.
const SOLVE_SHARE: f64 = 0.002;

impl Bake {
    /// Turns materials into rows.
    pub(crate) fn painter(&self) -> Painter<'_> {
        Painter::new(&self.scene, &self.mesh, &self.upsampler)
    }

    /// Relative error at which a solve ends.
    pub(crate) fn tolerance(&self) -> f64 {
        SOLVE_SHARE * self.settings.error
    }

    /// Solves on the current links and measures the solution.
    pub(super) fn solve<const L: usize>(
        &mut self,
        rows: &LinkRows,
        leaves: &[u32],
    ) -> (Convergence, flux::Balance) {
        let mut first = Rows::zero(leaves.len(), L);
        for (k, &leaf) in leaves.iter().enumerate() {
            let row = self.direct.row(leaf);
            first.row_mut(k)[..row.len()].copy_from_slice(row);
        }
        let given = Given {
            sources: self.painter().paint(&self.tree, leaves, &self.lanes),
            first,
            reflected: self.guess::<L>(leaves),
            emitted: None,
            tolerance: self.tolerance(),
        };
        let solved = self.solve_with::<L>(rows, leaves, given);
        self.light_arrives();
        solved
    }

    /// The same with what it starts from.
    pub(crate) fn solve_with<const L: usize>(
        &mut self,
        rows: &LinkRows,
        leaves: &[u32],
        given: Given,
    ) -> (Convergence, flux::Balance) {
        let Given {
            sources:
                Sources {
                    mut reflectance,
                    emission,
                    greatest,
                },
            mut first,
            mut reflected,
            emitted,
            tolerance,
        } = given;
        let nodes = self.tree.nodes.len();
        let by_rays = self.by_rays();
        self.outlook.tints.on(&self.scene, &self.filters);
        let mut scaled = flux::Scaled::default();
        if self.sealed == Closed::Yes && !by_rays {
            let lumens = |rows: &Rows| flux::lumens(&self.areas, &self.lanes, leaves, rows);
            let before = lumens(&first);
            flux::conserve(&mut first, &emission, &self.lamps, &self.areas, leaves);
            scaled.direct = flux::ratio(lumens(&first), before);
        }
        let mixed = self
            .lanes
            .is_mixed()
            .then(|| self.painter().mixed(&self.tree, leaves, &self.lanes));
        let plus = |a: &Rows, b: &Rows| {
            let mut sum = a.clone();
            for (a, b) in sum.all_mut::<L>().iter_mut().zip(b.all::<L>()) {
                *a = std::array::from_fn(|l| a[l] + b[l]);
            }
            sum
        };
        let reflect = |irradiance: &Rows| match &mixed {
            Some(mixed) => mixed.reflect::<L>(irradiance),
            None => {
                let mut reflected = irradiance.clone();
                for (r, rho) in reflected
                    .all_mut::<L>()
                    .iter_mut()
                    .zip(reflectance.all::<L>())
                {
                    *r = std::array::from_fn(|l| r[l] * rho[l]);
                }
                reflected
            }
        };
        let runs = self.plan.runs(Kind::Interreflection);
        let (convergence, mut irradiance, sums) = if by_rays {
            let system = RaySystem {
                tree: &self.tree,
                outlook: &self.outlook,
                leaves,
                areas: &self.areas,
                reflectance: &reflectance,
                greatest: &greatest,
                two_grid: self.two_grid.as_ref().map(|grid| (grid, self.lanes.xyz())),
            };
            let (convergence, seen) = match &mixed {
                _ if !runs => (Convergence::default(), Rows::zero(leaves.len(), L)),
                Some(mixed) => mixed.solve_by_rays::<L>(&system, &first, &mut reflected, tolerance),
                None => system.solve::<L>(&first, &mut reflected, tolerance),
            };
            (convergence, seen, Vec::new())
        } else {
            let system = System {
                operator: Operator::new(
                    &self.tree,
                    rows,
                    leaves,
                    &self.areas,
                    &self.balance.factor,
                ),
                reflectance: &reflectance,
                greatest: &greatest,
            };
            let convergence = match &mixed {
                _ if !runs => Convergence::default(),
                Some(mixed) => {
                    mixed.solve::<L>(&system.operator, &first, &mut reflected, tolerance)
                }
                None => system.solve::<L>(&first, &mut reflected, tolerance),
            };
            let factor: Vec<f64> = self.balance.factor.iter().map(|&f| f64::from(f)).collect();
            let sums = crate::link::row_sums(&self.tree, rows, &self.areas, &factor);
            let mut irradiance = Rows::zero(leaves.len(), L);
            if runs {
                let slopes = linear::Slopes::new(&self.tree, rows, &self.areas, leaves, &sums);
                let bounced = reflect(&first);
                for _ in 0..linear::PASSES {
                    irradiance = slopes.irradiance::<L>(&reflected);
                    let before = flux::lumens(&self.areas, &self.lanes, leaves, &irradiance);
                    let again = reflect(&irradiance);
                    let [over, without] = slopes.balance::<L>(&irradiance, &bounced, &again);
                    if mixed.is_some() {
                        // Lanes are no bands: it is each of the 64 leaves that keeps its energy.
                        let leaves_of = |sum: [f64; L]| self.lanes.leaves(&sum.map(|x| x as f32));
                        let (over, without) = (leaves_of(over), leaves_of(without));
                        let scale = std::array::from_fn(|k| linear::amplitude(over[k], without[k]));
                        let whole = vec![0; leaves.len()];
                        irradiance =
                            Mixed::new(&[scale], whole, &self.lanes, L).reflect::<L>(&irradiance);
                    } else {
                        let scale: [f32; L] =
                            std::array::from_fn(|l| linear::amplitude(over[l], without[l]) as f32);
                        for row in irradiance.all_mut::<L>() {
                            *row = std::array::from_fn(|l| row[l] * scale[l]);
                        }
                    }
                    let after = flux::lumens(&self.areas, &self.lanes, leaves, &irradiance);
                    scaled.reflected = flux::ratio(after, before);
                    reflected = reflect(&plus(&irradiance, &first));
                }
            }
            (convergence, irradiance, sums)
        };
        irradiance = plus(&irradiance, &first);
        if !runs {
            reflected = reflect(&irradiance);
        }
        if mixed.is_some() {
            // Seen lane by lane, albedo is what came back of what came in.
            for ((rho, r), h) in reflectance
                .all_mut::<L>()
                .iter_mut()
                .zip(reflected.all::<L>())
                .zip(irradiance.all::<L>())
            {
                *rho = std::array::from_fn(|l| if h[l] == 0.0 { 0.0 } else { r[l] / h[l] });
            }
        }
        let fluxes = flux::FluxRows {
            emission: &emission,
            reflected: &reflected,
            irradiance: &irradiance,
            first: &first,
            reflectance: &reflectance,
        };
        let on_nodes = self.on_nodes::<L>(&reflected, leaves);
        let mut flux = if by_rays {
            let mut whole = Rows::zero(leaves.len(), L);
            if runs {
                self.outlook
                    .irradiance_of_whole::<L>(leaves, &on_nodes, &mut whole);
            }
            let whole = flux::Whole {
                indirect: &whole,
                direct: &|leaf| f64::from(self.direct.whole(leaf)),
                area: &|leaf| self.tree.node(leaf).area,
            };
            flux::flux_by_rays(&self.areas, &self.lanes, leaves, &fluxes, &whole)
        } else {
            flux::flux(&self.areas, &self.lanes, leaves, &fluxes, &sums)
        };
        (flux.sent, flux.scaled) = (self.sent, scaled);
        self.light = Light {
            reflected: on_nodes,
            emitted: emitted.unwrap_or_else(|| self.on_nodes::<L>(&emission, leaves)),
            irradiance,
            leaves: leaves.to_vec(),
            neighbours: Neighbours::new(nodes, &self.graph),
            white: self.light.white,
            half_size: self.mesh.half_size,
            ..Light::default()
        };
        self.light.white = self
            .settings
            .white
            .unwrap_or_else(|| self.mean_irradiance().map(|x| 2.0 * x));
        self.light.measure(&self.tree, &self.lanes);
        (convergence, flux)
    }

    /// What turns a row into brightness, share of the white's.
    pub(super) fn bright_weights(&self) -> Vec<f64> {
        let white = self.light.white;
        let xyz = self.lanes.xyz().iter();
        xyz.map(|&xyz| brightness(xyz, white)).collect()
    }

    /// Notes how bright what arrives on leaves is.
    pub(super) fn light_arrives(&mut self) {
        let light = &self.light;
        let weights = self.bright_weights();
        let bright = |row: &[f32]| weighed(row, &weights) as f32;
        let mut arrival = vec![Arrival::default(); self.tree.nodes.len()];
        for (k, &leaf) in light.leaves.iter().enumerate() {
            arrival[leaf as usize] = Arrival {
                all: bright(light.irradiance.row(k)),
                direct: bright(self.direct.row(leaf)),
                spread: self.direct.spread(leaf),
            };
        }
        self.light.arrival = arrival;
        self.light.bright_lamps = self.bright_lamps();
    }

    /// How bright each lamp is for a factor of 1, share of the white's.
    pub(super) fn bright_lamps(&self) -> Vec<f32> {
        let weights = self.bright_weights();
        let lamps = self.lamps.iter();
        lamps
            .map(|(_, row)| weighed(row, &weights) as f32)
            .collect()
    }

    /// Area-weighted mean irradiance, tristimulus.
    pub fn mean_irradiance(&self) -> [f64; 3] {
        let (mut sum, mut area) = ([0.0; 3], 0.0);
        for (k, &leaf) in self.light.leaves.iter().enumerate() {
            let a = self.areas[leaf as usize];
            let xyz = self.lanes.tristimulus(self.light.irradiance.row(k));
            sum = std::array::from_fn(|c| sum[c] + a * xyz[c]);
            area += a;
        }
        sum.map(|x| if area > 0.0 { x / area } else { 0.0 })
    }

    /// Reflected radiosity of the last round on the leaves of this one: a new element starts from its nearest ancestor.
    pub(crate) fn guess<const L: usize>(&self, leaves: &[u32]) -> Rows {
        let mut rows = Rows::zero(leaves.len(), L);
        if self.previous.width() == L {
            let known = self.previous.len();
            for (row, &leaf) in rows.all_mut::<L>().iter_mut().zip(leaves) {
                let mut id = leaf;
                while id as usize >= known {
                    id = self.tree.node(id).parent;
                }
                *row = self.previous.all::<L>()[id as usize];
            }
        }
        rows
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
