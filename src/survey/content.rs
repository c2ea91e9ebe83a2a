//! Is there a surface, and is there a lamp?

use crate::error::Problem;
use crate::scene::Scene;
use serde_json::Value;

/// Modes of primitives from here on are triangles (glTF 2.0, section 3.7.2.1); below are points and lines.
const TRIANGLES: u64 = 4;

/// A room without a single triangle.
pub(super) fn nothing(scene: &Scene) -> Option<Problem> {
    if scene.surfaces.iter().any(|s| !s.triangles.is_empty()) {
        return None;
    }
    let list = |key: &str| scene.source.json.get(key).and_then(Value::as_array);
    let meshes = list("meshes").map_or(&[][..], Vec::as_slice);
    let shown = list("nodes")
        .into_iter()
        .flatten()
        .any(|n| n.get("mesh").is_some());
    let mut primitives = meshes
        .iter()
        .filter_map(|m| m.get("primitives")?.as_array())
        .flatten();
    let is_thin = |p: &Value| {
        p.get("mode").and_then(Value::as_u64) < Some(TRIANGLES) && p.get("mode").is_some()
    };
    let (why, next) = if meshes.is_empty() {
        ("the file has no mesh", "export the room's objects with it")
    } else if !shown {
        (
            "no node shows a mesh",
            "put the objects into the scene that is exported",
        )
    } else if primitives.all(is_thin) {
        (
            "it holds only points or lines",
            "export faces: triangles are what light falls on",
        )
    } else {
        (
            "no triangle with an area is in the scene",
            "look whether the scene that is exported holds the room's objects",
        )
    };
    let what = format!("there is nothing to bake: {why}");
    Some(Problem::new(scene.source.place(), what, next))
}

/// A room without a lamp.
pub(super) fn no_lamp(scene: &Scene) -> Option<Problem> {
    let glows = scene.surfaces.iter().any(|s| {
        let material = scene.materials.get(s.material);
        material.is_some_and(|m| m.emission.is_some())
    });
    (!glows && scene.lights.is_empty()).then(|| {
        Problem::new(
            scene.source.place(),
            "there is no lamp, all would be black",
            "give a material an emissive colour and strength (KHR_materials_emissive_strength, cd/m2), export the \
             lights (KHR_lights_punctual), or write an \"emission\" with \"luminance_cd_m2\" for a material into the \
             room's .spectra.json; where the room has openings --sky lights it; --allow-dark bakes it as it is",
        )
    })
}
