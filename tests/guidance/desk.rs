//! A folder with small rooms, and the real program in it.

use crate::common::built::faces;
use crate::common::{F32, Room, U8, push};
use glam::{DVec3, dvec3};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::{Command, Output};

pub(crate) struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    /// A folder with this room as `room.glb`.
    pub(crate) fn with(room: &Room) -> Self {
        let desk = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        desk.put("room.glb", &room.glb());
        desk
    }

    pub(crate) fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn put(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.at(name), bytes).unwrap();
    }

    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_haarlight"));
        command.args(args).current_dir(self.folder.path());
        command.env_remove("RUST_BACKTRACE");
        command
    }

    /// What the program says and prints, once it has ended with `code`.
    pub(crate) fn run(&self, args: &[&str], code: i32) -> (String, String) {
        let Output {
            status,
            stdout,
            stderr,
        } = self.command(args).output().unwrap();
        let (said, printed) = (text(stderr), text(stdout));
        assert_eq!(status.code(), Some(code), "{args:?}\n{said}");
        (said, printed)
    }

    /// A quick bake that ends well; what was said.
    pub(crate) fn bake(&self, more: &[&str]) -> String {
        self.run(
            &[&["bake", "room.glb", "--error", "4", "--xyz"], more].concat(),
            0,
        )
        .0
    }

    /// A bake that is refused; what was said.
    pub(crate) fn refused(&self, more: &[&str]) -> String {
        let said = self.run(&[&["bake", "room.glb"], more].concat(), 2).0;
        assert!(!self.at("room.baked.glb").exists(), "{said}");
        said
    }

    /// The records of a log.
    pub(crate) fn records(&self, name: &str) -> Vec<Value> {
        let log = text(std::fs::read(self.at(name)).unwrap());
        log.lines()
            .map(|l| serde_json::from_str(l).unwrap())
            .collect()
    }

    /// The light of all vertices of the baked room, Y in lm/m2.
    pub(crate) fn light(&self) -> Vec<f32> {
        let bytes = std::fs::read(self.at("room.baked.glb")).unwrap();
        vectors(&bytes, "_XYZ").iter().map(|xyz| xyz[1]).collect()
    }
}

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap()
}

/// JSON and binary chunk of a GLB.
pub(crate) fn chunks(glb: &[u8]) -> (Value, &[u8]) {
    let size = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let json = serde_json::from_slice(&glb[20..20 + size]).unwrap();
    (json, &glb[28 + size..])
}

/// An attribute of three floats of all primitives of a written room, one after the other.
pub(crate) fn vectors(glb: &[u8], attribute: &str) -> Vec<[f32; 3]> {
    let (json, bin) = chunks(glb);
    let mut out = Vec::new();
    for mesh in json["meshes"].as_array().unwrap() {
        for primitive in mesh["primitives"].as_array().unwrap() {
            let accessor = primitive["attributes"][attribute].as_u64().unwrap() as usize;
            let accessor = &json["accessors"][accessor];
            let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
            let start = view["byteOffset"].as_u64().unwrap_or(0)
                + accessor["byteOffset"].as_u64().unwrap_or(0);
            for k in 0..accessor["count"].as_u64().unwrap() as usize {
                let at = start as usize + 12 * k;
                out.push(std::array::from_fn(|c| {
                    f32::from_le_bytes(bin[at + 4 * c..at + 4 * c + 4].try_into().unwrap())
                }));
            }
        }
    }
    out
}

/// Adds an object of quadrilaterals, counter-clockwise from their fronts, with a material of the list.
pub(crate) fn object(room: &mut Room, name: &str, quads: &[[DVec3; 4]], material: usize) {
    let mut corners: Vec<[f32; 3]> = Vec::new();
    let mut normals: Vec<[f32; 3]> = Vec::new();
    let mut indices: Vec<u8> = Vec::new();
    for quad in quads {
        let first = corners.len() as u8;
        let normal = (quad[1] - quad[0]).cross(quad[3] - quad[0]).normalize();
        corners.extend(quad.map(|p| p.as_vec3().to_array()));
        normals.extend([normal.as_vec3().to_array(); 4]);
        indices.extend([0, 1, 2, 0, 2, 3].map(|k| first + k));
    }
    let position = room.vectors(&corners);
    let normal = room.vectors(&normals);
    let count = indices.len();
    let indices = room.accessor(&indices, U8, "SCALAR", count);
    assert_eq!(room.json["accessors"][position]["componentType"], F32);
    let primitive = json!({"attributes": {"POSITION": position, "NORMAL": normal},
        "indices": indices, "material": material});
    let mesh = push(
        &mut room.json["meshes"],
        json!({"name": format!("{name} mesh"), "primitives": [primitive]}),
    );
    let node = push(&mut room.json["nodes"], json!({"name": name, "mesh": mesh}));
    push(&mut room.json["scenes"][0]["nodes"], json!(node));
}

/// Quadrilaterals seen from the other side.
pub(crate) fn turned<const N: usize>(mut quads: [[DVec3; 4]; N]) -> [[DVec3; 4]; N] {
    quads.iter_mut().for_each(|quad| quad.reverse());
    quads
}

/// Six walls of 4 m by 3 m by 5 m that look inwards.
pub(crate) fn walls() -> [[DVec3; 4]; 6] {
    faces(DVec3::ZERO, dvec3(4.0, 3.0, 5.0))
}

/// A panel below the ceiling that looks down.
pub(crate) fn panel() -> [[DVec3; 4]; 1] {
    let p = |x: f64, z: f64| dvec3(x, 2.9, z);
    [[p(1.0, 2.0), p(3.0, 2.0), p(3.0, 3.0), p(1.0, 3.0)]]
}

/// Materials "wall" and "glow"; no objects yet.
pub(crate) fn materials() -> Room {
    let mut room = Room::empty();
    room.json["materials"] = json!([
        {"name": "wall", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0}},
        {"name": "glow", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.2, 0.2, 1.0], "metallicFactor": 0.0},
         "emissiveFactor": [1.0, 1.0, 1.0],
         "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1000.0}}}
    ]);
    room.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
    room
}

/// A room with its panel, as it should be.
pub(crate) fn lit() -> Room {
    let mut room = materials();
    object(&mut room, "Room", &walls(), 0);
    object(&mut room, "Lamp", &panel(), 1);
    room
}

/// The walls alone.
pub(crate) fn dark() -> Room {
    let mut room = materials();
    object(&mut room, "Room", &walls(), 0);
    room
}

/// Adds a punctual light at a node of this transform.
pub(crate) fn light(room: &mut Room, light: Value, node: Value) {
    let lights = &mut room.json["extensions"]["KHR_lights_punctual"]["lights"];
    let index = push(lights, light);
    let mut node = node;
    node["extensions"] = json!({"KHR_lights_punctual": {"light": index}});
    let node = push(&mut room.json["nodes"], node);
    push(&mut room.json["scenes"][0]["nodes"], json!(node));
    push(
        &mut room.json["extensionsUsed"],
        json!("KHR_lights_punctual"),
    );
}

/// All of these texts are in what was said.
pub(crate) fn says(said: &str, texts: &[&str]) {
    for text in texts {
        assert!(said.contains(text), "'{text}' is not in\n{said}");
    }
}
