//! Fluorescence of a material on lanes: each lane of irradiance excites the material's terms, and each term fills the lanes of its own
//! light spectrum.

use super::lanes::Lanes;
use crate::scene::Scene;
use crate::scene::fluorescence::Fluorescence;
use crate::spectrum::{BANDS, Spectrum};

/// A material's terms.
#[derive(Debug, Clone)]
pub struct Fluorescent {
    /// For each term: what each lane of irradiance at 1 excites, and the row that excitation 1 emits; padded with 0.
    terms: Vec<([f32; BANDS], [f32; BANDS])>,
}

impl Fluorescent {
    /// The terms of a material on some lanes.
    pub fn new(fluorescence: &Fluorescence, lanes: &Lanes, scene: &Scene) -> Self {
        let layers = scene.changes.layers.as_ref();
        let terms = fluorescence.terms.iter().map(|term| {
            let (mut taken, mut given) = ([0.0; BANDS], [0.0; BANDS]);
            let all = lanes.taken(&term.excitation, scene.grid.width());
            for ((to, share), lane) in taken.iter_mut().zip(all).zip(lanes.lanes()) {
                let layer = lane
                    .light
                    .zip(layers)
                    .map(|(light, all)| all.of_light[light]);
                // Lanes of all lights together excite only the first copy.
                let own = match (term.layer, layer) {
                    (Some(own), Some(layer)) => own == layer,
                    (Some(own), None) => own == 0,
                    (None, _) => true,
                };
                *to = if own { share } else { 0.0 };
            }
            lanes.add_emission(term.light, &[1.0; BANDS], 1.0, &mut given);
            (taken, given)
        });
        Self {
            terms: terms.collect(),
        }
    }

    /// Fluorescent exitance by an irradiance.
    pub fn of<const L: usize>(&self, irradiance: &[f32; L]) -> [f32; L] {
        let mut out = [0.0; L];
        for (taken, given) in &self.terms {
            let excited: f32 = irradiance.iter().zip(taken).map(|(x, t)| x * t).sum();
            out.iter_mut()
                .zip(given)
                .for_each(|(o, g)| *o += excited * g);
        }
        out
    }

    /// Tristimulus exitance for each lane of irradiance at 1.
    pub fn tristimulus(&self, lanes: &Lanes) -> Vec<[f64; 3]> {
        let terms = self.terms.iter();
        let terms: Vec<_> = terms
            .map(|(t, given)| (t, lanes.tristimulus(given)))
            .collect();
        let lane = |l: usize| {
            let add = |sum: [f64; 3], (taken, xyz): &(&[f32; BANDS], [f64; 3])| {
                std::array::from_fn(|c| sum[c] + f64::from(taken[l]) * xyz[c])
            };
            terms.iter().fold([0.0; 3], add)
        };
        (0..lanes.len()).map(lane).collect()
    }

    /// Spectral exitance under an irradiance, W/m2/nm.
    pub fn spectrum(&self, lanes: &Lanes, irradiance: &[f32; BANDS]) -> Spectrum {
        lanes.spectrum(&self.of(irradiance))
    }
}

/// Weights of light by what it excites, besides the observer's: for each band the tristimulus values that a surface
/// fluoresces under it, the greatest of all materials; none where nothing fluoresces.
pub(crate) fn guide(scene: &Scene, weights: &[Spectrum; 3]) -> Option<[Spectrum; 3]> {
    let width = scene.grid.width();
    let mut more = [[0.0_f64; BANDS]; 3];
    let mut any = false;
    let used = scene.surfaces.iter().map(|s| s.material);
    let used: std::collections::BTreeSet<usize> = used.collect();
    for fluorescence in used
        .iter()
        .filter_map(|&m| scene.materials[m].fluorescence.as_ref())
    {
        any = true;
        let mut own = [[0.0; BANDS]; 3];
        for term in fluorescence.once() {
            let power = &scene.spectra[term.light].power;
            for (own, w) in own.iter_mut().zip(weights) {
                let seen: f64 = power.iter().zip(w).map(|(p, w)| p * w).sum();
                (own.iter_mut().zip(&term.excitation)).for_each(|(x, g)| *x += g * width * seen);
            }
        }
        for (most, own) in more.iter_mut().flatten().zip(own.iter().flatten()) {
            *most = most.max(*own);
        }
    }
    any.then_some(more)
}

/// Share of excitation that counts in brightness beside visible light: such that the most exciting lamp counts no more than the most
/// visible one, or errors of one would vanish beside the other.
pub(crate) fn balance(scene: &Scene, weights: &[Spectrum; 3], guide: &[Spectrum; 3]) -> f64 {
    let surfaces = scene.materials.iter().filter_map(|m| m.emission.as_ref());
    let surfaces = surfaces.map(|e| (e.light, &e.shape));
    let lights = scene.lights.iter().map(|l| (l.light, &l.shape));
    let share = |lamps: &mut dyn Iterator<Item = (usize, &Spectrum)>| {
        let mut most = [0.0_f64; 2];
        for (light, shape) in lamps {
            let power = shape.iter().zip(&scene.spectra[light].power);
            let power: Vec<f64> = power.map(|(s, p)| s * p).collect();
            for (most, w) in most.iter_mut().zip([weights, guide]) {
                let sum: f64 = power.iter().zip(&w[1]).map(|(p, w)| p * w).sum();
                *most = most.max(sum);
            }
        }
        if most[1] > most[0] {
            most[0] / most[1]
        } else {
            1.0
        }
    };
    share(&mut { surfaces }).min(share(&mut { lights }))
}
