//! Paths that change their wavelength.
//!
//! A path carries all bands at once, backwards: what it finds on a band counts for that band. Where a surface fluoresces it may go on by
//! a term, `B(l) = e(l) sum over j of g(j) E(j) w` with bands of w nm: from there on whatever it finds, on any band, counts for all bands
//! that it came with, in the fixed proportion `t(l) e(l)`, t being what was left of them. So it needs one spectrum more, whatever the
//! number of changes.

use crate::geometry::sampling::Pcg;
use crate::scene::{LightSpectrum, Material, Scene};
use crate::spectrum::{BANDS, Spectrum};

/// What a path has found.
pub(super) struct PathTally<'a> {
    /// By the band that light was found on.
    pub(super) found: Spectrum,
    /// What counts band by band, once wavelengths were changed: all that was found before.
    sum: &'a mut Spectrum,
    /// How much of what is found counts for each band; none: all of it, for its own.
    shares: Option<Spectrum>,
}

impl<'a> PathTally<'a> {
    /// Goes on from a sum.
    pub(super) fn new(sum: &'a mut Spectrum) -> Self {
        Self {
            found: *sum,
            sum,
            shares: None,
        }
    }

    /// Adds what was found to the sum.
    pub(super) fn settle(self) {
        match self.shares {
            None => *self.sum = self.found,
            Some(shares) => {
                let all: f64 = self.found.iter().sum();
                (self.sum.iter_mut().zip(&shares)).for_each(|(sum, share)| *sum += share * all);
            }
        }
    }

    /// From now on what is found on any band counts by these shares.
    fn change(&mut self, shares: Spectrum) {
        if self.shares.is_none() {
            *self.sum = std::mem::replace(&mut self.found, [0.0; BANDS]);
            self.shares = Some(shares);
        }
    }
}

/// The greatest of all bands, 0 at the least.
pub(super) fn greatest(bands: &Spectrum) -> f64 {
    // Eight by eight: one by one each would wait for the one before.
    let (eights, rest) = bands.as_chunks::<8>();
    let mut greatest = [0.0; 8];
    for eight in eights {
        for (greatest, &x) in greatest.iter_mut().zip(eight) {
            *greatest = f64::max(*greatest, x);
        }
    }
    let all = greatest.iter().chain(rest).copied();
    all.fold(0.0, f64::max)
}

/// What a path is multiplied by at a surface of an `albedo`: of reflection, or of one of the terms that fluoresce by chance, each as often
/// as it may carry the most power.
pub(super) fn goes_on(
    scene: &Scene,
    material: &Material,
    albedo: Spectrum,
    throughput: &mut Spectrum,
    rng: &mut Pcg,
    tally: &mut PathTally,
) {
    let width = scene.grid.width();
    let reflected = |throughput: &Spectrum, chance: f64| -> Spectrum {
        std::array::from_fn(|l| throughput[l] * albedo[l] / chance)
    };
    let Some(fluorescence) = &material.fluorescence else {
        *throughput = reflected(throughput, 1.0);
        return;
    };
    let emission = |light: &LightSpectrum, t: &Spectrum| -> Spectrum {
        std::array::from_fn(|l| t[l] * light.power[l] * width)
    };
    let mut ways = vec![greatest(&reflected(throughput, 1.0))];
    let terms: Vec<_> = fluorescence.once().collect();
    for term in &terms {
        let out: f64 = emission(&scene.spectra[term.light], throughput)
            .iter()
            .sum();
        ways.push(out * greatest(&term.excitation));
    }
    let all: f64 = ways.iter().sum();
    let mut left = rng.f64() * all;
    let chosen = ways.iter().position(|way| {
        left -= way;
        left < 0.0
    });
    // Nothing goes on, or rounding passed the last.
    let chosen = chosen.unwrap_or(0);
    let chance = match all > 0.0 {
        true => ways[chosen] / all,
        false => 1.0,
    };
    if chosen == 0 {
        // By rounding it may be one that is never chosen.
        *throughput = match chance > 0.0 {
            true => reflected(throughput, chance),
            false => [0.0; BANDS],
        };
        return;
    }
    let term = terms[chosen - 1];
    let out = emission(&scene.spectra[term.light], throughput);
    let whole: f64 = out.iter().sum();
    tally.change(out.map(|x| x / whole));
    *throughput = term.excitation.map(|g| g * whole / chance);
}
