//! The plan: which effects a scene calls for. What is off costs nothing; what the program lacks is named.
//!
//! Only what some surface or lamp of the scene uses counts. A plan never leaves out an effect that could change the
//! picture: where a question would be too dear to answer, the effect runs.

use super::check::listed;
use super::json::short;
use super::lacking::lacking;
use super::sheet::Sheet;
use super::{Alpha, Image, LightKind, Material, PunctualLight, Scene, Sides, Surface, Texture};
use crate::color::{KM, Observer, Upsampler};
use crate::data::Spectrum;
use glam::DVec3;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// How far behind a plane a vertex of a convex room may lie, as a share of the room's size. Positions are stored as f32
/// (6e-8 of their size) and may have been turned by a node; a gap of 1e-6 hides nothing that a link could see.
const CONVEX_TOLERANCE: f64 = 1e-6;

/// The convexity test gives up (and occlusion runs) past this many plane-vertex pairs: 0.1 s.
const CONVEX_PAIRS: usize = 100_000_000;

/// The effects, in the order of the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum EffectKind {
    /// Light that surfaces pass on.
    Interreflection,
    /// Surfaces that block light.
    Occlusion,
    /// More than one band.
    Colour,
    /// More than one light spectrum.
    LightSpectra,
    /// Images on paint, lamps or holes.
    Textures,
    /// Holes.
    AlphaMasks,
    /// Surfaces that give out light.
    EmissiveSurfaces,
    /// Lights without extent that shine all around.
    PointLights,
    /// Lights without extent that shine in a cone.
    SpotLights,
    /// Parallel light.
    DirectionalLights,
    /// Lamps whose light is spread as a file of photometric data says.
    MeasuredLamps,
    /// Light of a sky that enters where rays leave the room.
    Sky,
    /// Direct light of the sun.
    Sun,
    /// Surfaces whose back reflects and emits too.
    TwoSided,
    /// What lets light straight through.
    Panes,
    /// What lets diffuse light through.
    Sheets,
    /// What sends light on in one direction.
    Mirrors,
    /// What gives light out again at other wavelengths.
    Fluorescence,
}

impl EffectKind {
    /// The effect's name in plans and logs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Interreflection => "interreflection",
            Self::Occlusion => "occlusion",
            Self::Colour => "colour",
            Self::LightSpectra => "several light spectra",
            Self::Textures => "textures",
            Self::AlphaMasks => "alpha masks",
            Self::EmissiveSurfaces => "emissive surfaces",
            Self::PointLights => "point lights",
            Self::SpotLights => "spot lights",
            Self::DirectionalLights => "directional lights",
            Self::MeasuredLamps => "measured lamps",
            Self::Sky => "sky",
            Self::Sun => "sun",
            Self::TwoSided => "two-sided surfaces",
            Self::Panes => "panes",
            Self::Sheets => "diffuse sheets",
            Self::Mirrors => "mirrors",
            Self::Fluorescence => "fluorescence",
        }
    }
}

/// One line of the plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Effect {
    /// [`EffectKind::name`], or the name of an effect that the program lacks.
    pub name: String,
    /// Does it run?
    pub runs: bool,
    /// Does the program lack it?
    pub lacking: bool,
    /// Why, in words.
    pub reason: String,
}

/// What runs for a scene, what does not, and why.
///
/// Displays as a table; serializes as a list of `{name, runs, lacking, reason}`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Plan {
    effects: Vec<Effect>,
}

impl Plan {
    /// The plan for a scene.
    pub fn of(scene: &Scene) -> Self {
        let used: BTreeSet<usize> = scene.surfaces.iter().map(|s| s.material).collect();
        let used: Vec<&Material> = used
            .into_iter()
            .filter_map(|m| scene.materials.get(m))
            .collect();
        let mut plan = Self {
            effects: Vec::new(),
        };
        plan.add(EffectKind::Interreflection, interreflection(&used));
        plan.add(EffectKind::Occlusion, occlusion(scene));
        plan.add(EffectKind::Colour, colour(scene, &used));
        plan.add(EffectKind::LightSpectra, light_spectra(scene));
        let textured = |m: &&&Material| is_textured(m);
        plan.add(
            EffectKind::Textures,
            counted(used.iter().filter(textured), "material"),
        );
        let masked = |m: &&&Material| matches!(m.alpha, Alpha::Mask { .. });
        plan.add(
            EffectKind::AlphaMasks,
            counted(used.iter().filter(masked), "material"),
        );
        plan.add(
            EffectKind::EmissiveSurfaces,
            counted(used.iter().filter(|m| m.emission.is_some()), "material"),
        );
        let lights = |is: fn(&LightKind) -> bool| {
            let names: Vec<String> = scene
                .lights
                .iter()
                .filter(|l| is(&l.kind))
                .map(|l| quoted(&l.name))
                .collect();
            number_of(&names, "light")
        };
        plan.add(
            EffectKind::PointLights,
            lights(|k| matches!(k, LightKind::Point)),
        );
        plan.add(
            EffectKind::SpotLights,
            lights(|k| matches!(k, LightKind::Spot { .. })),
        );
        plan.add(
            EffectKind::DirectionalLights,
            lights(|k| matches!(k, LightKind::Directional)),
        );
        plan.add(EffectKind::MeasuredLamps, measured(scene));
        let sky = scene.sky.as_ref();
        let said = |text: Option<&String>| match text {
            Some(text) => (true, text.clone()),
            None => (false, "none is described".into()),
        };
        plan.add(EffectKind::Sky, said(sky.map(|sky| &sky.said)));
        plan.add(
            EffectKind::Sun,
            said(sky.and_then(|sky| sky.sun_said.as_ref())),
        );
        plan.add(EffectKind::TwoSided, two_sided(scene));
        plan.add(EffectKind::Panes, panes(scene));
        plan.add(EffectKind::Sheets, sheets(&used));
        plan.add(EffectKind::Mirrors, mirrors(scene, &used));
        plan.add(EffectKind::Fluorescence, fluorescence(&used));
        for lack in lacking(&scene.source.json) {
            plan.effects.push(Effect {
                name: lack.effect,
                runs: false,
                lacking: true,
                reason: lack.reason,
            });
        }
        plan
    }

    /// Does this effect run?
    pub fn runs(&self, kind: EffectKind) -> bool {
        self.effects.iter().any(|e| e.name == kind.name() && e.runs)
    }

    /// The lines, [`EffectKind`]s in order, then what the program lacks.
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// Takes an effect off.
    pub(crate) fn off(&mut self, kind: EffectKind, reason: &str) {
        let mut named = self.effects.iter_mut().filter(|e| e.name == kind.name());
        if let Some(effect) = named.next() {
            (effect.runs, effect.reason) = (false, reason.into());
        }
    }

    /// Lets an effect run that does not.
    pub(crate) fn on(&mut self, kind: EffectKind, reason: &str) {
        let mut named = self.effects.iter_mut().filter(|e| e.name == kind.name());
        if let Some(effect) = named.find(|effect| !effect.runs) {
            (effect.runs, effect.reason) = (true, reason.into());
        }
    }

    /// Says more of an effect.
    pub(crate) fn say(&mut self, kind: EffectKind, more: &str) {
        let mut named = self.effects.iter_mut().filter(|e| e.name == kind.name());
        if let Some(effect) = named.next() {
            effect.reason += &format!("; {more}");
        }
    }

    fn add(&mut self, kind: EffectKind, (runs, reason): (bool, String)) {
        self.effects.push(Effect {
            name: kind.name().into(),
            runs,
            lacking: false,
            reason,
        });
    }
}

fn light_spectra(scene: &Scene) -> (bool, String) {
    let names: Vec<String> = scene.spectra.iter().map(|s| s.name.clone()).collect();
    match &names[..] {
        [] => (false, "no lamp".into()),
        [one] => (false, format!("all light is {one}")),
        many => (true, format!("{}: {}", many.len(), listed(many))),
    }
}

fn is_textured(m: &Material) -> bool {
    let mask = matches!(
        &m.alpha,
        Alpha::Mask {
            texture: Some(_),
            ..
        }
    );
    let woven = m.sheet.as_ref().is_some_and(Sheet::is_textured);
    m.paint.is_some() || woven || mask || m.emission.as_ref().is_some_and(|e| e.texture.is_some())
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self
            .effects
            .iter()
            .map(|e| e.name.chars().count())
            .max()
            .unwrap_or(0);
        for Effect {
            name,
            runs,
            lacking,
            reason,
        } in &self.effects
        {
            let state = match (lacking, runs) {
                (true, _) => "lacking",
                (_, true) => "runs",
                _ => "off",
            };
            writeln!(f, "{name:width$}  {state:7}  {reason}")?;
        }
        Ok(())
    }
}

fn quoted(name: &str) -> String {
    format!("'{}'", short(name))
}

fn number_of(names: &[String], what: &str) -> (bool, String) {
    match names.len() {
        0 => (false, "none".into()),
        1 => (true, format!("1 {what}: {}", names[0])),
        n => (true, format!("{n} {what}s: {}", listed(names))),
    }
}

/// Lamps with a profile, what it is of, and their lumens.
fn measured(scene: &Scene) -> (bool, String) {
    let luminous = Observer::cie1931().weights(&scene.grid)[1];
    let lumens = |light: &PunctualLight| -> f64 {
        let bands = scene.spectra[light.light].power.iter().zip(&light.shape);
        bands.zip(&luminous).map(|((p, s), y)| KM * p * s * y).sum()
    };
    let lamps = scene.lights.iter().filter_map(|light| {
        let profile = &light.luminaire.as_ref()?.profile;
        let of = match profile.luminaire.as_str() {
            "" => &profile.format,
            name => name,
        };
        Some(format!(
            "{} as {}, {:.0} lm",
            quoted(&light.name),
            quoted(of),
            lumens(light)
        ))
    });
    number_of(&lamps.collect::<Vec<String>>(), "lamp")
}

fn counted<'a, 'b: 'a>(
    materials: impl Iterator<Item = &'a &'b Material>,
    what: &str,
) -> (bool, String) {
    number_of(
        &materials.map(|m| quoted(&m.name)).collect::<Vec<_>>(),
        what,
    )
}

/// Both sides of what is no solid.
fn two_sided(scene: &Scene) -> (bool, String) {
    let both = (0..scene.surfaces.len()).filter(|&s| scene.sides(s) == Sides::Both);
    let used: BTreeSet<usize> = both.map(|s| scene.surfaces[s].material).collect();
    let names = used.iter().map(|&m| quoted(&scene.materials[m].name));
    let (runs, reason) = number_of(&names.collect::<Vec<_>>(), "material");
    match scene.solids.len() {
        0 => (runs, reason),
        1 => (runs, format!("{reason}; one surface is that of a solid")),
        n => (runs, format!("{reason}; {n} surfaces are those of solids")),
    }
}

/// A texture or a vertex colour multiplies: black stays black.
fn interreflection(used: &[&Material]) -> (bool, String) {
    let bright = used
        .iter()
        .filter(|m| {
            let sends = m.sheet.is_some() || m.fluorescence.is_some();
            sends || m.reflectance.iter().any(|r| *r > 0.0)
        })
        .count();
    match bright {
        0 => (false, "every surface is black".into()),
        n if n == used.len() => (true, "every surface reflects".into()),
        n => (true, format!("{n} of {} materials reflect", used.len())),
    }
}

fn is_flat(spectrum: &Spectrum) -> bool {
    spectrum.iter().all(|v| *v == spectrum[0])
}

fn is_grey(image: &Image) -> bool {
    image.pixels.iter().all(|[r, g, b, _]| r == g && g == b)
}

/// One band is enough where every reflectance is flat and every lamp is its light spectrum times a number.
fn colour(scene: &Scene, used: &[&Material]) -> (bool, String) {
    let grey_image = |index: usize| scene.images.get(index).is_some_and(is_grey);
    let mut greys: BTreeMap<usize, bool> = BTreeMap::new();
    let mut grey = |index: usize| *greys.entry(index).or_insert_with(|| grey_image(index));
    for material in used {
        if !is_flat(&material.reflectance) {
            return (true, format!("{} has a colour", quoted(&material.name)));
        }
        if material.paint.as_ref().is_some_and(|t| !grey(t.image)) {
            return (
                true,
                format!("the texture of {} has colours", quoted(&material.name)),
            );
        }
        if let Some(sheet) = &material.sheet {
            let tinted = |t: &Texture| !grey(t.image);
            let flat = is_flat(&sheet.transmittance) && sheet.back.as_ref().is_none_or(is_flat);
            if !flat || sheet.color_texture.as_ref().is_some_and(tinted) {
                let name = quoted(&material.name);
                return (true, format!("what {name} lets through has a colour"));
            }
        }
        if material.fluorescence.is_some() {
            return (true, format!("{} fluoresces", quoted(&material.name)));
        }
        if let Some(emission) = &material.emission {
            let tinted = emission.texture.as_ref().is_some_and(|t| !grey(t.image));
            if tinted || !is_flat(&emission.shape) {
                return (
                    true,
                    format!(
                        "the light of {} has a colour of its own",
                        quoted(&material.name)
                    ),
                );
            }
        }
    }
    let tinted = |s: &&Surface| {
        let pane = scene
            .materials
            .get(s.material)
            .and_then(|m| m.pane.as_ref());
        pane.is_some_and(|pane| !pane.is_neutral())
    };
    if let Some(surface) = scene.panes.iter().find(tinted) {
        let name = quoted(&scene.materials[surface.material].name);
        return (true, format!("the pane {name} has a colour"));
    }
    if let Some(light) = scene.lights.iter().find(|l| !is_flat(&l.shape)) {
        return (
            true,
            format!("the light {} has a colour of its own", quoted(&light.name)),
        );
    }
    let painted = |s: &&Surface| {
        let counts = scene
            .materials
            .get(s.material)
            .is_some_and(|m| m.vertex_paint);
        counts
            && s.colors
                .iter()
                .flatten()
                .any(|[r, g, b, _]| r != g || g != b)
    };
    if let Some(surface) = scene.surfaces.iter().find(painted) {
        return (true, format!("{} has vertex colours", surface.name));
    }
    (false, "every surface is grey: one band".into())
}

/// Materials that let light through, with the share of white (D65) that they do at normal incidence.
fn panes(scene: &Scene) -> (bool, String) {
    let used: BTreeSet<usize> = scene.panes.iter().map(|s| s.material).collect();
    let upsampler = Upsampler::new(&scene.grid);
    let names: Vec<String> = (used.into_iter())
        .filter_map(|m| scene.materials.get(m))
        .filter_map(|m| Some((m, m.pane.as_ref()?)))
        .map(|(m, pane)| {
            let (name, from) = (quoted(&m.name), short(&pane.from));
            let (through, back) = (upsampler.xyz(&pane.normal())[1], pane.reflects());
            format!("{name} ({from}: {through:.2} passes, {back:.2} reflected and left out)")
        })
        .collect();
    match names.len() {
        0 => (false, "none".into()),
        _ => (true, format!("light passes {}", listed(&names))),
    }
}

/// Materials that let diffuse light through.
fn sheets(used: &[&Material]) -> (bool, String) {
    let names: Vec<String> = (used.iter())
        .filter(|m| m.sheet.is_some())
        .map(|m| quoted(&m.name))
        .collect();
    match &names[..] {
        [] => (false, "none".into()),
        [one] => (true, format!("material {one} lets diffuse light through")),
        many => {
            let named = listed(many);
            (true, format!("materials {named} let diffuse light through"))
        }
    }
}

/// Materials that mirror, with the share of white (D65) that they reflect at normal incidence.
fn mirrors(scene: &Scene, used: &[&Material]) -> (bool, String) {
    if used.iter().all(|m| m.mirror.is_none()) {
        return (false, "none".into());
    }
    let upsampler = Upsampler::new(&scene.grid);
    let names: Vec<String> = (used.iter())
        .filter_map(|m| Some((m, m.mirror.as_ref()?)))
        .map(|(m, mirror)| {
            let share = upsampler.xyz(&mirror.reflectance)[1];
            let (name, from) = (quoted(&m.name), short(&mirror.from));
            format!("{name} ({from}: {share:.2} reflected)")
        })
        .collect();
    (true, format!("light is mirrored by {}", listed(&names)))
}

/// Materials that give light out again at other wavelengths, and by what.
fn fluorescence(used: &[&Material]) -> (bool, String) {
    let names: Vec<String> = (used.iter())
        .filter_map(|m| Some((m, m.fluorescence.as_ref()?)))
        .map(|(m, f)| format!("{} ({})", quoted(&m.name), f.from))
        .collect();
    number_of(&names, "material")
}

/// Off where nothing can stand between two points that see each other's front, nor between a point and a light.
fn occlusion(scene: &Scene) -> (bool, String) {
    if !scene.panes.is_empty() {
        return (true, "panes stand in the way of light".into());
    }
    let mirrors = |s: &Surface| {
        let material = scene.materials.get(s.material);
        material.is_some_and(|m| m.mirror.is_some())
    };
    if scene.surfaces.iter().any(mirrors) {
        return (true, "mirrors stand in the way of light".into());
    }
    match blocked(&scene.surfaces, &scene.lights) {
        None => (
            false,
            "the room is convex and empty: nothing can block".into(),
        ),
        Some(reason) => (true, reason),
    }
}

/// Why something could block; none if every vertex and every light lies on or before every triangle's plane.
///
/// Then a segment between two points of the surfaces (or to a light) never passes from the front of a triangle to its
/// back. A parallel light comes from infinity: it must shine on the front of every triangle.
fn blocked(surfaces: &[Surface], lights: &[PunctualLight]) -> Option<String> {
    let vertices: Vec<DVec3> = surfaces
        .iter()
        .flat_map(|s| s.positions.iter().copied())
        .collect();
    let low = vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = vertices
        .iter()
        .copied()
        .fold(DVec3::NEG_INFINITY, DVec3::max);
    let tolerance = CONVEX_TOLERANCE * (high - low).length();
    let stands = |l: &&PunctualLight| !(l.kind.is_parallel() || l.kind.is_dome());
    let mut pairs = 0;
    for surface in surfaces {
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|i| surface.positions[i as usize]);
            // A triangle without area has no plane, and hides nothing.
            let Some(normal) = (b - a).cross(c - a).try_normalize() else {
                continue;
            };
            let behind = |p: DVec3| normal.dot(p - a) < -tolerance;
            if vertices.iter().any(|p| behind(*p)) {
                return Some(format!(
                    "{} turns its back on a part of the room",
                    surface.name
                ));
            }
            if let Some(light) = lights.iter().filter(stands).find(|l| behind(l.position)) {
                return Some(format!(
                    "the light {} stands behind {}",
                    quoted(&light.name),
                    surface.name
                ));
            }
            let parallel = lights.iter().filter(|l| l.kind.is_parallel());
            if let Some(light) = parallel
                .into_iter()
                .find(|l| normal.dot(l.direction) > -CONVEX_TOLERANCE)
            {
                return Some(format!(
                    "the light {} shines on the back of {}",
                    quoted(&light.name),
                    surface.name
                ));
            }
            pairs += vertices.len();
            if pairs > CONVEX_PAIRS {
                return Some("too many triangles to show that the room is convex".into());
            }
        }
    }
    None
}

#[cfg(test)]
mod tests;
