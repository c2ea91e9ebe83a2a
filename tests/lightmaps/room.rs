//! A closed room as a glb with all that a light map must get along with: meshes without texture coordinates and with both sets in
//! use, one mesh on several nodes, one of them mirrored, instances, a curved surface, a two-sided sheet.

use glam::{DMat4, DQuat, DVec3, Quat, Vec3};
use serde_json::{Value, json};
use std::f32::consts::TAU;

/// Half the sides of the room, metres.
const HALF: [f32; 3] = [2.0, 1.5, 2.0];
/// Faces around the tube.
const SIDES: u32 = 24;

#[derive(Default)]
struct Glb {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

impl Glb {
    fn view(&mut self, bytes: &[u8]) -> usize {
        let at = self.bytes.len();
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views
            .push(json!({ "buffer": 0, "byteOffset": at, "byteLength": bytes.len() }));
        self.views.len() - 1
    }

    fn floats<const N: usize>(&mut self, rows: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = rows
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let view = self.view(&bytes);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N)
                .map(|i| rows.iter().map(|r| r[i]).reduce(pick).unwrap())
                .collect()
        };
        self.accessors.push(
            json!({ "bufferView": view, "componentType": 5126, "count": rows.len(),
            "type": kind, "min": bound(f32::min), "max": bound(f32::max) }),
        );
        self.accessors.len() - 1
    }

    /// A mesh of one primitive; `sets` of texture coordinates.
    fn mesh(
        &mut self,
        at: &[Vec3],
        normals: Option<&[Vec3]>,
        triangles: &[[u32; 3]],
        sets: usize,
        material: usize,
    ) -> usize {
        let rows: Vec<[f32; 3]> = at.iter().map(|p| p.to_array()).collect();
        let mut attributes = json!({ "POSITION": self.floats(&rows) });
        if let Some(normals) = normals {
            let rows: Vec<[f32; 3]> = normals.iter().map(|p| p.to_array()).collect();
            attributes["NORMAL"] = json!(self.floats(&rows));
        }
        for set in 0..sets {
            let rows: Vec<[f32; 2]> = at.iter().map(|p| [p.x * 0.3, p.y * 0.7]).collect();
            attributes[format!("TEXCOORD_{set}")] = json!(self.floats(&rows));
        }
        let bytes: Vec<u8> = triangles
            .iter()
            .flatten()
            .flat_map(|i| i.to_le_bytes())
            .collect();
        let view = self.view(&bytes);
        self.accessors.push(json!({ "bufferView": view, "componentType": 5125, "count": 3 * triangles.len(), "type": "SCALAR" }));
        let indices = self.accessors.len() - 1;
        self.meshes.push(json!({ "primitives": [{ "attributes": attributes, "indices": indices, "material": material }] }));
        self.meshes.len() - 1
    }

    fn node(&mut self, name: &str, mesh: usize, to: DMat4) {
        self.nodes
            .push(json!({ "name": name, "mesh": mesh, "matrix": to.to_cols_array() }));
    }
}

const SQUARE: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// A square of side 2 around the origin, facing +z.
fn square() -> [Vec3; 4] {
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0))
}

/// The room's glb.
pub(crate) fn room() -> Vec<u8> {
    let mut glb = Glb::default();
    let square = square();
    let plain = glb.mesh(&square, None, &SQUARE, 0, 0);
    let mapped = glb.mesh(&square, Some(&[Vec3::Z; 4]), &SQUARE, 2, 1);
    let [x, y, z] = HALF.map(f64::from);
    let place = |at: DVec3, turn: DQuat, size: DVec3| {
        DMat4::from_scale_rotation_translation(size, turn, at)
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    // Walls face inwards; the mirrored one is turned inside out twice.
    glb.node(
        "floor",
        plain,
        place(
            -y * DVec3::Y,
            DQuat::from_rotation_x(-quarter),
            DVec3::new(x, z, 1.0),
        ),
    );
    glb.node(
        "ceiling",
        plain,
        place(
            y * DVec3::Y,
            DQuat::from_rotation_x(quarter),
            DVec3::new(x, z, 1.0),
        ),
    );
    glb.node(
        "back",
        mapped,
        place(-z * DVec3::Z, DQuat::IDENTITY, DVec3::new(x, y, 1.0)),
    );
    glb.node(
        "front",
        mapped,
        place(
            z * DVec3::Z,
            DQuat::from_rotation_y(2.0 * quarter),
            DVec3::new(x, y, 1.0),
        ),
    );
    glb.node(
        "left",
        mapped,
        place(
            -x * DVec3::X,
            DQuat::from_rotation_y(quarter),
            DVec3::new(z, y, 1.0),
        ),
    );
    glb.node(
        "right, mirrored",
        mapped,
        place(
            x * DVec3::X,
            DQuat::from_rotation_y(-quarter),
            DVec3::new(-z, y, 1.0),
        ),
    );
    let sheet = glb.mesh(&square, None, &SQUARE, 1, 2);
    let tilt = DQuat::from_rotation_x(-quarter * 0.9);
    glb.node(
        "sheet",
        sheet,
        place(DVec3::new(0.9, -0.2, 0.5), tilt, DVec3::new(0.5, 0.6, 1.0)),
    );
    let tube = tube(&mut glb);
    let translation = glb.floats(&[[-0.9, -1.0, -0.6], [-0.2, -0.8, -1.2]]);
    let turn = Quat::from_rotation_y(0.4).to_array();
    let rotation = glb.floats(&[Quat::IDENTITY.to_array(), turn]);
    glb.nodes.push(
        json!({ "name": "tubes", "mesh": tube, "extensions": { "EXT_mesh_gpu_instancing": {
        "attributes": { "TRANSLATION": translation, "ROTATION": rotation } } } }),
    );
    glb.nodes
        .push(json!({ "name": "lamp", "translation": [0.3, 1.0, 0.2],
        "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    written(glb)
}

/// A smooth tube without caps that faces outwards.
fn tube(glb: &mut Glb) -> usize {
    let (mut at, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..=SIDES {
        let (sin, cos) = (TAU * k as f32 / SIDES as f32).sin_cos();
        for y in [-0.4, 0.4] {
            at.push(Vec3::new(0.25 * sin, y, 0.25 * cos));
            normals.push(Vec3::new(sin, 0.0, cos));
        }
        if k < SIDES {
            let a = 2 * k;
            triangles.extend([[a, a + 2, a + 3], [a, a + 3, a + 1]]);
        }
    }
    glb.mesh(&at, Some(&normals), &triangles, 1, 1)
}

fn written(glb: Glb) -> Vec<u8> {
    let grey = |rho: f64, both: bool| json!({ "pbrMetallicRoughness": { "baseColorFactor": [rho, rho, rho, 1.0], "metallicFactor": 0.0 }, "doubleSided": both });
    let json = json!({
        "asset": { "version": "2.0" }, "scene": 0,
        "scenes": [{ "nodes": (0..glb.nodes.len()).collect::<Vec<_>>() }],
        "extensionsUsed": ["KHR_lights_punctual", "EXT_mesh_gpu_instancing"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 100.0 }] } },
        "materials": [grey(0.6, false), grey(0.5, false), grey(0.4, true)],
        "buffers": [{ "byteLength": glb.bytes.len() }], "bufferViews": glb.views,
        "accessors": glb.accessors, "meshes": glb.meshes, "nodes": glb.nodes,
    });
    let mut text = serde_json::to_vec(&json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + text.len() + 8 + glb.bytes.len();
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((total as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &glb.bytes)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}
