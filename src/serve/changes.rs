//! Lamps and paints as they were changed: the body of `POST /change`.
//!
//! ```json
//! { "materials": { "wall": { "reflectance": { "name": "macbeth/blue" } },
//!                  "panel": { "emission": { "name": "cie/A" } } },
//!   "lights":    { "Spot": { "name": "cie/F11" } },
//!   "dim":       { "materials": { "panel": 0.5 }, "lights": { "Spot": 0 } } }
//! ```
//!
//! `materials` and `lights` are laid over the room's file of spectra (see [`Options::changes`]), `dim` multiplies what lamps
//! give out as they then are; 0 turns them off. A body says all that is changed since the room was read: `{}` undoes it.

use crate::data::nearest_of;
use crate::error::{Error, Problem, Result};
use crate::scene::{LightKind, Options, Scene, short};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// The strongest lamp is so many times what it was.
const MOST: f64 = 1000.0;

/// Reads a room with changes.
#[derive(Debug)]
pub(super) struct RoomReader {
    path: std::path::PathBuf,
    options: Options,
    /// Surfaces whose faces were turned.
    flipped: BTreeSet<usize>,
}

impl RoomReader {
    /// Reads a room again as `scene` was read.
    pub(super) fn new(options: Options, scene: &Scene) -> Self {
        Self {
            path: scene.source.path.clone(),
            options,
            flipped: scene.changes.flipped.clone(),
        }
    }

    /// The room with the changes that a body tells of, and those changes.
    pub(super) fn read(&self, body: &[u8]) -> Result<(Scene, Value)> {
        let wrong = |what: String, next: &str| Error::input("the change", what, next);
        let changes: Value = serde_json::from_slice(body)
            .map_err(|problem| wrong(format!("is not valid JSON ({problem})"), "send an object"))?;
        let Value::Object(mut parts) = changes.clone() else {
            return Err(wrong("is not an object".into(), "send { ... }"));
        };
        const KEYS: [&str; 3] = ["materials", "lights", "dim"];
        if let Some(key) = parts.keys().find(|key| !KEYS.contains(&key.as_str())) {
            let what = format!("has a key \"{}\"", short(key));
            return Err(wrong(what, "materials, lights and dim can be changed"));
        }
        let dim = parts.shift_remove("dim").unwrap_or_else(|| json!({}));
        let mut options = self.options.clone();
        options.say(Value::Object(parts));
        let mut scene = Scene::load(&self.path, &options)?;
        scene.flip(self.flipped.iter().copied());
        dimmed(&mut scene, &dim)?;
        Ok((scene, changes))
    }
}

/// Dims the lamps of a room.
fn dimmed(scene: &mut Scene, dim: &Value) -> Result<()> {
    let mut problems = Vec::new();
    let empty = Map::new();
    let Some(dim) = dim.as_object() else {
        return Err(Error::input("dim", "is not an object", "write { ... }"));
    };
    for (kind, entries) in dim {
        if !matches!(kind.as_str(), "materials" | "lights") || !entries.is_object() {
            let what = format!("\"{}\" is no object of materials or lights", short(kind));
            problems.push(Problem::new("dim", what, "name materials and lights"));
        }
        for (name, factor) in entries.as_object().unwrap_or(&empty) {
            let place = format!("dim: {kind}: '{}'", short(name));
            match factor.as_f64().filter(|f| (0.0..=MOST).contains(f)) {
                None => problems.push(Problem::new(
                    place,
                    format!("{} is no factor", short(&factor.to_string())),
                    format!("give a number from 0 (off) to {MOST}"),
                )),
                Some(factor) if kind == "materials" => {
                    problems.extend(dim_material(scene, name, factor, place));
                }
                Some(factor) => problems.extend(dim_light(scene, name, factor, place)),
            }
        }
    }
    match problems.is_empty() {
        true => Ok(()),
        false => Err(Error::Input(problems)),
    }
}

fn dim_material(scene: &mut Scene, name: &str, factor: f64, place: String) -> Option<Problem> {
    let mut found = false;
    let lamps = scene.materials.iter_mut().filter(|m| m.name == name);
    for emission in lamps.filter_map(|m| m.emission.as_mut()) {
        found = true;
        emission.shape = emission.shape.map(|x| factor * x);
        emission.scale *= factor;
    }
    // What shines by a profile is among the lights, by the name of its material.
    let lights = scene.lights.iter_mut();
    for light in lights.filter(|l| l.kind == LightKind::Surface && l.name == name) {
        light.shape = light.shape.map(|x| factor * x);
    }
    let known = scene.materials.iter().filter(|m| m.emission.is_some());
    (!found).then(|| unknown(place, name, known.map(|m| m.name.clone()).collect()))
}

fn dim_light(scene: &mut Scene, name: &str, factor: f64, place: String) -> Option<Problem> {
    let own = |kind: LightKind| kind != LightKind::Surface;
    let mut found = false;
    let lights = scene.lights.iter_mut();
    for light in lights.filter(|l| own(l.kind) && l.name == name) {
        found = true;
        light.shape = light.shape.map(|x| factor * x);
    }
    let known = scene.lights.iter().filter(|l| own(l.kind));
    (!found).then(|| unknown(place, name, known.map(|l| l.name.clone()).collect()))
}

fn unknown(place: String, name: &str, known: Vec<String>) -> Problem {
    let near = nearest_of(name, &known);
    let next = match near.is_empty() {
        true => "there is none of this kind".to_owned(),
        false => format!("the nearest names are {}", near.join(", ")),
    };
    Problem::new(place, "is no lamp of this room", next)
}

/// A lamp that shines and was dark when the room was solved: nobody looked for its shadows.
pub(super) fn newly_emitting(before: &Scene, now: &Scene) -> Option<String> {
    let shines = |shape: &[f64]| shape.iter().any(|&x| x > 0.0);
    let materials = |scene: &Scene| -> Vec<bool> {
        let emissions = scene.materials.iter().map(|m| m.emission.as_ref());
        emissions
            .map(|e| e.is_some_and(|e| shines(&e.shape)))
            .collect()
    };
    let lights =
        |scene: &Scene| -> Vec<bool> { scene.lights.iter().map(|l| shines(&l.shape)).collect() };
    let new = |before: Vec<bool>, now: Vec<bool>| {
        let was = |k: usize| before.get(k).copied().unwrap_or(false);
        (0..now.len()).find(|&k| now[k] && !was(k))
    };
    let material = new(materials(before), materials(now)).map(|k| now.materials[k].name.clone());
    material.or_else(|| new(lights(before), lights(now)).map(|k| now.lights[k].name.clone()))
}
