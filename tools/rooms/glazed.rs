//! The daylit room with its window glazed in three ways: amber glass with a volume, clear glass, a blue film.

use super::daylit;
use super::glb::{Glb, Mesh};
use super::shapes::block;
use glam::dvec3;
use serde_json::{Value, json};

/// Panes of 6 mm in the middle of the reveal: a thin box, a single face, a quad and its back.
pub(crate) fn room() -> Glb {
    let mut glb = daylit::room();
    for extension in ["KHR_materials_transmission", "KHR_materials_volume"] {
        glb.uses(extension);
    }
    let amber = glb.material(json!({
        "name": "amber glass",
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_volume": {
                "thicknessFactor": 0.006,
                "attenuationDistance": 0.006,
                "attenuationColor": [0.95, 0.45, 0.06],
            },
        },
    }));
    let clear = glb.material(json!({
        "name": "clear glass",
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}},
    }));
    let film = glb.material(json!({
        "name": "blue film",
        "alphaMode": "BLEND",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.05, 0.2, 0.9, 0.6],
            "metallicFactor": 0.0,
        },
    }));
    let (bottom, top, z) = (0.9, 2.2, 4.15);
    let x = [1.6, 2.267, 2.933, 3.6];
    let mut thick = block([x[0], bottom, z], [x[1], top, z + 0.006]);
    thick.uvs.clear();
    let face = |from: f64, to: f64, toward: f64| {
        let mut mesh = Mesh::default();
        let at = |x: f64, y: f64| dvec3(x, y, z);
        let corners = [at(from, bottom), at(to, bottom), at(to, top), at(from, top)];
        mesh.quad(corners, dvec3(0.5 * (from + to), bottom, toward));
        mesh
    };
    let mut back_to_back = face(x[2], x[3], 0.0);
    back_to_back.append(&face(x[2], x[3], 9.0));
    glb.draw("amber pane", &[(&thick, amber)]);
    glb.draw("clear pane", &[(&face(x[1], x[2], 9.0), clear)]);
    glb.draw("blue pane", &[(&back_to_back, film)]);
    glb
}

/// A clear sky, the sun where it shines through all three.
pub(crate) fn spectra() -> Value {
    daylit::spectra()
}
