//! Makes materials fluoresce as side files wish, and puts what they give out among the light spectra.

use super::check::Check;
use super::fluorescence::{Fluorescence, FluorescenceWish, Term};
use super::json::short;
use super::{LightSpectrum, Material};
use crate::data::{BANDS, Grid};

/// Rounding of measured reflectances and excitations may let their sum exceed 1 by so much.
const ROUNDING: f64 = 1e-6;

/// Makes a material fluoresce as it is wished; its reflectance, `measured` or not, leaves room for what is given out.
pub(super) fn fluoresce(
    material: &mut Material,
    wish: &FluorescenceWish,
    measured: Option<&str>,
    place: &str,
    grid: &Grid,
    spectra: &mut Vec<LightSpectrum>,
    check: &mut Check,
) {
    if wish.terms.is_empty() {
        return;
    }
    if material.sheet.is_some() || material.pane.is_some() {
        let what = "fluoresces and lets light through";
        let next = "take one of them out: what light passes does not fluoresce here";
        check.problem(place, what, next);
        return;
    }
    if material.mirror.is_some() {
        let what = "fluoresces and is a mirror";
        check.problem(
            place,
            what,
            "say \"mirror\": false, or take the fluorescence out",
        );
        return;
    }
    let terms = wish.terms.iter().map(|[emission, excitation]| {
        let known = spectra.iter().position(|s| s.power == *emission);
        let light = known.unwrap_or_else(|| {
            spectra.push(LightSpectrum {
                name: format!("fluorescence of '{}'", short(&material.name)),
                power: *emission,
            });
            spectra.len() - 1
        });
        Term {
            light,
            excitation: *excitation,
            layer: None,
        }
    });
    let fluorescence = Fluorescence {
        terms: terms.collect(),
        from: wish.from.clone(),
    };
    let out = fluorescence.efficiency();
    let rho = measured.map_or([0.0; BANDS], |_| material.reflectance);
    let over: Vec<usize> = (0..BANDS)
        .filter(|&k| rho[k] + out[k] > 1.0 + ROUNDING)
        .collect();
    if let (Some(first), Some(last)) = (over.first(), over.last()) {
        let most = over.iter().map(|&k| rho[k] + out[k]).fold(0.0, f64::max);
        let what = format!(
            "reflectance ({}) and fluorescence come to {most:.3} of the power that arrives between {:.0} and {:.0} nm",
            short(measured.unwrap_or("none")),
            grid.left(*first),
            grid.left(*last + 1)
        );
        let next = "lower one of them: no more leaves than comes; a measured reflectance must not hold what fluoresces";
        check.problem(place, what, next);
        return;
    }
    material.fluorescence = Some(fluorescence);
    material.reflectance = material.bounded(material.reflectance);
}

/// Puts the spectra that materials fluoresce behind those of lamps.
pub(super) fn join(
    materials: &mut [Material],
    spectra: &mut Vec<LightSpectrum>,
    excited: Vec<LightSpectrum>,
) {
    let first = spectra.len();
    let fluorescent = materials.iter_mut().filter_map(|m| m.fluorescence.as_mut());
    for term in fluorescent.flat_map(|f| &mut f.terms) {
        term.light += first;
    }
    spectra.extend(excited);
}
