//! Rooms in which several effects run, or all of them.

use super::built;
use glam::{DMat4, dvec3};
use haarlight::scene::effects::{EffectKind, Plan};
use haarlight::scene::{Options, Scene, Sides, Surface};
use haarlight::spectrum::BANDS;
use serde_json::json;
use std::path::Path;

/// Panes before sky and sun, walls of paper, a tinted mirror, a ceiling with a dye, and a table that shines by a profile.
pub(crate) fn room() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/glazed.glb");
    let csv = |rows: &str| json!({"csv": rows});
    let options = Options {
        said: Some(json!({"materials": {
            "walls": {"transmission": 0.05},
            "red wall": {"mirror": true},
            "ceiling": {"reflectance": 0.4, "fluorescence": {
                "excitation": csv("380,0.5\n480,0.5"), "emission": csv("500,1\n600,1"), "yield": 1.0,
            }},
            "table": {"emission": {"profile": "gallery-panel.ldt", "name": "cie/LED-B3"}},
        }})),
        ..Options::default()
    };
    Scene::load(path, &options).unwrap()
}

/// All that [`small`] takes.
pub(crate) const EFFECTS: [EffectKind; 7] = [
    EffectKind::MeasuredLamps,
    EffectKind::Sky,
    EffectKind::Sun,
    EffectKind::Panes,
    EffectKind::Sheets,
    EffectKind::Mirrors,
    EffectKind::Fluorescence,
];

/// The Cornell box under D65 with these effects and no other: what must be true in any room costs least in this one.
pub(crate) fn small(kinds: &[EffectKind]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-d65.glb");
    let csv = |rows: &str| json!({"csv": rows});
    let mut said = json!({"materials": {}});
    for kind in kinds {
        match kind {
            EffectKind::Sky => said["sky"] = json!({"type": "overcast"}),
            EffectKind::Sun => {
                said["sky"] =
                    json!({"type": "clear", "sun": {"elevation_deg": 38.0, "azimuth_deg": 0.0}});
            }
            EffectKind::Mirrors => said["materials"]["red"] = json!({"mirror": true}),
            EffectKind::Fluorescence => {
                said["materials"]["green"] = json!({"reflectance": 0.4, "fluorescence": {
                    "excitation": csv("380,0.5\n480,0.5"), "emission": csv("500,1\n600,1"), "yield": 1.0,
                }});
            }
            EffectKind::MeasuredLamps => {
                said["materials"]["light"]["emission"] = json!({"profile": "gallery-panel.ldt", "name": "cie/LED-B3", "luminance_cd_m2": null});
            }
            _ => {}
        }
    }
    let options = Options {
        said: Some(said),
        ..Options::default()
    };
    let mut scene = Scene::load(path, &options).unwrap();
    if kinds.contains(&EffectKind::Panes) {
        let pane = level(&mut scene, 0.45);
        scene.panes.push(pane);
        let glass = scene.materials.last_mut().unwrap();
        glass.pane = Some(built::glass(
            1.5,
            std::array::from_fn(|k| if k < BANDS / 2 { 0.6 } else { 0.9 }),
        ));
    }
    if kinds.contains(&EffectKind::Sheets) {
        let curtain = level(&mut scene, 0.35);
        scene.surfaces.push(curtain);
        let paper = scene.materials.last_mut().unwrap();
        (paper.reflectance, paper.sides) = ([0.5; BANDS], Sides::Both);
        paper.sheet = Some(built::paper([0.3; BANDS]));
    }
    let plan = Plan::of(&scene);
    assert!(kinds.iter().all(|kind| plan.runs(*kind)), "{plan}");
    scene
}

/// A level square, left below the lamp at a height, of a material of its own that the caller makes.
fn level(scene: &mut Scene, height: f64) -> Surface {
    let material = scene.materials.len();
    scene.materials.push(scene.materials[0].clone());
    scene.materials[material].name = format!("level {height}");
    Surface {
        name: format!("level {height}"),
        node: scene.surfaces.len() + scene.panes.len(),
        material,
        to_world: DMat4::IDENTITY,
        positions: [[0.05, 0.1], [0.05, 0.4], [0.3, 0.4], [0.3, 0.1]]
            .map(|[x, z]| dvec3(x, height, z))
            .into(),
        normals: None,
        texcoords: Vec::new(),
        colors: None,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..scene.surfaces[0].clone()
    }
}
