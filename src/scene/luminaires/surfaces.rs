//! A light for each surface that shines by a profile.
//!
//! The surface keeps an emission, which is how bright it is shown: the mean luminance `flux / (pi area)` of all surfaces of
//! its material. What it sends out is a light of [`LightKind::Surface`], one for each surface.

use super::super::check::Check;
use super::super::json::short;
use super::super::lamp_spectra::{GREATEST_SIZE, bearable};
use super::super::{LightKind, Material, PunctualLight, Scene, Sides, Surface};
use super::mounted::{Luminaire, tilt_share};
use super::wish::ProfileWish;
use crate::data::Spectrum;
use std::f64::consts::PI;
use std::sync::Arc;

/// Less of the light that has nowhere to go is not worth a word.
const LOST: f64 = 0.01;
/// A side that is so many times the other is the longer one.
const LONG: f64 = 1.5;
/// Triangles of a surface that shines by a profile, at the most: every place looks at all of them.
const MOST_TRIANGLES: usize = 1024;
/// A surface that is so many times as long as the luminous opening of the file is no such lamp.
const TOO_LONG: f64 = 3.0;

/// Adds the lights of surfaces, and gives their materials the luminance that they are shown with. `wishes` by material;
/// `scale` is metres for a unit of the file;
/// `size` tells the luminous size of a light spectrum with a shape.
pub(in crate::scene) fn add(
    wishes: &[Option<ProfileWish>],
    surfaces: &[Surface],
    materials: &mut [Material],
    lights: &mut Vec<PunctualLight>,
    scale: f64,
    size: impl Fn(usize, &Spectrum) -> f64,
    check: &mut Check,
) {
    for (m, (wish, material)) in wishes.iter().zip(materials).enumerate() {
        let (Some(wish), Some(emission)) = (wish, &mut material.emission) else {
            continue;
        };
        let place = format!("material '{}'", short(&material.name));
        let unit = 1.0 / size(emission.light, &emission.shape);
        let (mut area, mut flux, mut lost) = (0.0, 0.0, 0.0_f64);
        for (k, surface) in surfaces.iter().enumerate().filter(|s| s.1.material == m) {
            if surface.triangles.len() > MOST_TRIANGLES {
                let what = format!(
                    "{} has {} triangles, and a profile shines from {MOST_TRIANGLES} at the most",
                    surface.name,
                    surface.triangles.len()
                );
                let next = "make the surface simpler, or give the profile to a light instead";
                check.problem(&place, what, next);
                continue;
            }
            let profile = Arc::clone(&wish.profile);
            let mounted =
                Luminaire::on_surface(profile, (k, surface), material.sides, wish.turn_deg);
            let Some((luminaire, position)) = mounted else {
                let what = format!("{} shows nothing where its profile shines", surface.name);
                let next = "turn its faces, or give the profile to a light instead";
                check.problem(&place, what, next);
                continue;
            };
            let tilt = tilt_share(&luminaire);
            lost = lost.max(1.0 - luminaire.reach());
            odd(&luminaire, surface, scale, &place, check);
            area += luminaire.area();
            flux += wish.flux * tilt;
            lights.push(PunctualLight {
                name: material.name.clone(),
                kind: LightKind::Surface,
                node: None,
                position,
                direction: luminaire.nadir(),
                light: emission.light,
                shape: emission.shape.map(|x| x * unit * wish.flux * tilt),
                luminaire: Some(Arc::new(luminaire)),
            });
        }
        if lost > LOST {
            check.warn(format!(
                "{place}: {:.0} % of the light of its profile goes where the surface shows nothing; the rest is brought \
                 up to the profile's lumens (a light without extent, or a two-sided surface, sends it all ways)",
                100.0 * lost
            ));
        }
        let luminance = if area > 0.0 { flux / (PI * area) } else { 0.0 };
        if !bearable(luminance.max(flux), "lm", &place, check) {
            continue;
        }
        debug_assert!(luminance <= GREATEST_SIZE);
        emission.shape = emission.shape.map(|x| x * unit * luminance);
        emission.scale *= unit * luminance;
    }
}

/// Warns of a surface that has not the form of its profile's lamp.
fn odd(luminaire: &Luminaire, surface: &Surface, scale: f64, place: &str, check: &mut Check) {
    let longest = luminaire.profile.opening_m.into_iter().fold(0.0, f64::max);
    let across = 2.0 * scale * luminaire.radius();
    if longest > 0.0 && across > TOO_LONG * longest {
        check.warn(format!(
            "{place}: {} is {across:.2} m across, and its profile that of a lamp of {longest:.2} m; each surface \
             shines once, whatever its size",
            surface.name
        ));
    }
    if lies_across(luminaire) {
        check.warn(format!(
            "{place}: the longer side of {} lies across the one of its profile's opening; \"turn_deg\": 90 \
             turns the profile",
            surface.name
        ));
    }
}

/// Is a surface long where the opening of its profile is short?
fn lies_across(luminaire: &Luminaire) -> bool {
    let long = |[a, b]: [f64; 2]| match (a > LONG * b, b > LONG * a) {
        (true, false) => Some(0),
        (false, true) => Some(1),
        _ => None,
    };
    let [a, b, _] = luminaire.profile.opening_m;
    let (own, opening) = (long(luminaire.extent()), long([a, b]));
    own.is_some() && opening.is_some() && own != opening
}

/// Mounts the profiles of surfaces again, which were scaled or turned. A surface that shows nothing any more keeps its light as it was.
pub(in crate::scene) fn remount(scene: &mut Scene) {
    let (surfaces, materials) = (&scene.surfaces, &scene.materials);
    for light in &mut scene.lights {
        let Some(luminaire) = &light.luminaire else {
            continue;
        };
        let Some(k) = luminaire.surface() else {
            continue;
        };
        let (surface, profile) = (&surfaces[k], Arc::clone(&luminaire.profile));
        let sides: Sides = materials[surface.material].sides;
        let again = Luminaire::on_surface(profile, (k, surface), sides, luminaire.turn_deg);
        if let Some((luminaire, position)) = again {
            (light.position, light.direction) = (position, luminaire.nadir());
            light.luminaire = Some(Arc::new(luminaire));
        }
    }
}
