//! The solve where surfaces fluoresce: `R = rho (f + F R) + Q (f + F R)`, Q from the lanes that excite to the lanes that are emitted.
//!
//! Each lane reflects by itself, so fluorescence is found in rounds: with its present part `G`, all bounces of `G` and of all other
//! light as ever, `R' = rho (f + F G + F R')`; from the light that this brings, a new G. A round that changes the power of G by d leaves
//! an error of `d / (1 - k)` at the most: of fluorescence at a wavelength no more than k comes back as G, k the greatest `g / (1 - rho)`
//! at wavelengths of emissions, since every meeting with a fluorescent surface reflects rho and emits g. As emissions mostly excite
//! nothing, the second round mostly finds what the first found.

use super::solver::{Convergence, step};
use super::sums::{CHUNK, added, chunks};
use crate::hierarchy::{Mesh, Tree};
use crate::light::lanes::Lanes;
use crate::light::{Fluorescent, Rows};
use crate::scene::{GREATEST_ALBEDO, Material, Scene};
use crate::spectrum::BANDS;
use crate::team::Interrupt;
use rayon::prelude::*;

/// Rounds at the most; a dye whose emission excites it with a yield of .9 took 9 in a white room.
const ROUNDS: usize = 60;
/// Rounds end at this change whatever the bound: the rest is rounding of f32.
const ROUNDING: f64 = 1e-6;

/// What fluoresces, and how.
#[derive(Debug, Clone)]
pub(crate) struct Glow {
    /// Materials that fluoresce.
    kinds: Vec<Fluorescent>,
    /// For each leaf the index of its material among these; none where it does not fluoresce.
    of: Vec<Option<u8>>,
    /// Greatest share of fluorescent power that comes back as fluorescent power.
    back: f64,
}

impl Glow {
    /// The fluorescence of the leaves of a hierarchy; none where nothing fluoresces.
    pub(super) fn new(
        (scene, mesh): (&Scene, &Mesh),
        tree: &Tree,
        leaves: &[u32],
        lanes: &Lanes,
    ) -> Option<Self> {
        let mut kinds = Vec::new();
        let of_material: Vec<Option<u8>> = (scene.materials.iter())
            .map(|m| {
                let kind = Fluorescent::new(m.fluorescence.as_ref()?, lanes, scene);
                // More kinds than a byte counts would need more light spectra than rows hold: the rest do not
                // fluoresce.
                let number = u8::try_from(kinds.len()).ok()?;
                kinds.push(kind);
                Some(number)
            })
            .collect();
        if kinds.is_empty() {
            return None;
        }
        let of = leaves
            .iter()
            .map(|&leaf| of_material[mesh.material[tree.face_of(leaf).triangle as usize] as usize]);
        let of: Vec<Option<u8>> = of.collect();
        of.iter().any(Option::is_some).then(|| Self {
            of,
            kinds,
            back: back(scene),
        })
    }

    /// Fluorescent exitance of the leaves by their irradiance.
    pub(super) fn of<const L: usize>(&self, irradiance: &Rows) -> Rows {
        let mut out = Rows::zero(irradiance.len(), L);
        let rows = out.all_mut::<L>().par_iter_mut();
        rows.zip(irradiance.all::<L>())
            .zip(&self.of)
            .for_each(|((out, row), kind)| {
                if let Some(kind) = kind {
                    *out = self.kinds[usize::from(*kind)].of(row);
                }
            });
        out
    }
}

/// The greatest `g / (1 - rho)` of a material at a wavelength of any fluorescent emission.
fn back(scene: &Scene) -> f64 {
    let fluorescent = || {
        let used = scene.materials.iter();
        used.filter_map(|m| Some((m, m.fluorescence.as_ref()?)))
    };
    let mut emitted = [false; BANDS];
    for term in fluorescent().flat_map(|(_, f)| &f.terms) {
        let power = &scene.spectra[term.light].power;
        (emitted.iter_mut().zip(power)).for_each(|(e, p)| *e |= *p > 0.0);
    }
    let of = |(m, f): (&Material, &crate::scene::fluorescence::Fluorescence)| {
        let out = f.efficiency();
        let painted = m.paint.is_some() || m.vertex_paint;
        (0..BANDS)
            .filter(|&k| emitted[k])
            .fold(0.0, |most: f64, k| {
                let rho = match painted {
                    true => GREATEST_ALBEDO - out[k],
                    false => m.reflectance[k],
                };
                most.max(out[k] / (1.0 - rho))
            })
    };
    // Materials from files are bounded; those made in code may not be.
    fluorescent()
        .map(of)
        .fold(0.0, f64::max)
        .min(GREATEST_ALBEDO)
}

/// What takes part in a round.
pub(super) struct Rounds<'a> {
    pub(super) glow: &'a Glow,
    /// Area of each leaf.
    pub(super) areas: Vec<f64>,
    /// Power (W/m2) of each lane at 1.
    pub(super) power: Vec<f64>,
    /// Relative error at which the rounds end.
    pub(super) tolerance: f64,
    /// Ends the rounds at any time.
    pub(super) interrupt: &'a Interrupt,
}

impl Rounds<'_> {
    /// Reflected radiosity, fluorescent exitance, and irradiance by both, by leaf. `receive` turns radiosity into irradiance; `bounce`
    /// finds, from direct irradiance, its reflected radiosity and the irradiance by that.
    pub(super) fn solve<const L: usize>(
        &self,
        first: &Rows,
        reflected: &mut Rows,
        receive: impl Fn(&Rows) -> Rows,
        mut bounce: impl FnMut(&Rows, &mut Rows) -> (Convergence, Rows),
    ) -> (Convergence, Rows, Rows) {
        let mut given = self.glow.of::<L>(first);
        let mut done = Convergence::default();
        loop {
            let brought = receive(&given);
            let mut lit = first.clone();
            step::<L>(&mut lit, &brought, [1.0; L]);
            let (solved, mut seen) = bounce(&lit, reflected);
            done.iterations += solved.iterations;
            done.fluorescence += 1;
            step::<L>(&mut lit, &seen, [1.0; L]);
            let next = self.glow.of::<L>(&lit);
            let [changed, all] = self.change::<L>(&given, &next);
            let change = if all > 0.0 { changed / all } else { 0.0 };
            done.residual = solved.residual.max(change);
            done.bound = solved.bound.max(change / (1.0 - self.glow.back));
            let settled = change / (1.0 - self.glow.back) <= self.tolerance || change <= ROUNDING;
            if settled || done.fluorescence >= ROUNDS || self.interrupt.is_raised() {
                step::<L>(&mut seen, &brought, [1.0; L]);
                return (done, given, seen);
            }
            given = next;
        }
    }

    /// Power by which `now` differs from `before`, and power of `now`.
    fn change<const L: usize>(&self, before: &Rows, now: &Rows) -> [f64; 2] {
        let rows = chunks::<L>(before).zip(chunks::<L>(now));
        let parts = (rows.zip(self.areas.par_chunks(CHUNK))).map(|((before, now), areas)| {
            let mut sums = [0.0; 2];
            for ((before, now), area) in before.iter().zip(now).zip(areas) {
                let lanes = before.iter().zip(now).zip(&self.power);
                for ((before, now), power) in lanes {
                    sums[0] += area * power * f64::from((now - before).abs());
                    sums[1] += area * power * f64::from(*now);
                }
            }
            [sums]
        });
        let [sums] = added(parts);
        sums
    }
}
