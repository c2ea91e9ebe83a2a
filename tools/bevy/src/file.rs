//! What stands in a baked glb, read without Bevy; and what `haarlight probe` finds.

use bevy_math::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A glb in two chunks.
pub(crate) struct Glb {
    pub(crate) path: PathBuf,
    pub(crate) json: Value,
    body: Vec<u8>,
}

pub(crate) fn number(of: &Value) -> usize {
    of.as_u64().expect("a number") as usize
}

impl Glb {
    pub(crate) fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).expect("the room can be read");
        let length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
        Self {
            path: path.to_owned(),
            json: serde_json::from_slice(&bytes[20..20 + length]).expect("JSON"),
            body: bytes[28 + length..].to_vec(),
        }
    }

    pub(crate) fn name(&self) -> String {
        let name = self.path.file_name().expect("a file");
        name.to_string_lossy().into_owned()
    }

    pub(crate) fn primitive(&self, mesh: usize, primitive: usize) -> &Value {
        &self.json["meshes"][mesh]["primitives"][primitive]
    }

    /// Rows of an accessor of floats.
    pub(crate) fn floats(&self, accessor: &Value) -> Vec<Vec<f32>> {
        let accessor = &self.json["accessors"][number(accessor)];
        assert_eq!(
            number(&accessor["componentType"]),
            5126,
            "packed: bake without --compress"
        );
        let width = match accessor["type"].as_str() {
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            _ => 4,
        };
        let bytes = self.bytes(accessor, 4 * width);
        let row = |row: &[u8]| {
            row.chunks(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect()
        };
        bytes.chunks(4 * width).map(row).collect()
    }

    /// Corners of a primitive's triangles.
    pub(crate) fn corners(&self, mesh: usize, primitive: usize) -> Vec<usize> {
        let accessor = &self.json["accessors"][number(&self.primitive(mesh, primitive)["indices"])];
        let size = match number(&accessor["componentType"]) {
            5121 => 1,
            5123 => 2,
            _ => 4,
        };
        let index = |b: &[u8]| b.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
        self.bytes(accessor, size).chunks(size).map(index).collect()
    }

    /// Bytes of an accessor without gaps, rows of `size`.
    fn bytes(&self, accessor: &Value, size: usize) -> &[u8] {
        let view = &self.json["bufferViews"][number(&accessor["bufferView"])];
        assert!(
            view["byteStride"]
                .as_u64()
                .is_none_or(|s| s as usize == size)
        );
        let at = |of: &Value| of["byteOffset"].as_u64().unwrap_or(0) as usize;
        let start = at(view) + at(accessor);
        &self.body[start..start + size * number(&accessor["count"])]
    }

    /// From a node's space to the world's.
    pub(crate) fn world(&self, node: usize) -> DAffine3 {
        let nodes = self.json["nodes"].as_array().expect("nodes");
        let local = |node: &Value| {
            let numbers = |key: &str| -> Option<Vec<f64>> {
                node[key].as_array()?.iter().map(Value::as_f64).collect()
            };
            let vector = |key: &str, other| numbers(key).map_or(other, |v| DVec3::from_slice(&v));
            match numbers("matrix") {
                Some(m) => DAffine3::from_mat4(DMat4::from_cols_slice(&m)),
                None => DAffine3::from_scale_rotation_translation(
                    vector("scale", DVec3::ONE),
                    numbers("rotation").map_or(DQuat::IDENTITY, |q| DQuat::from_slice(&q)),
                    vector("translation", DVec3::ZERO),
                ),
            }
        };
        let is_above = |of: &Value| {
            let children = of["children"].as_array();
            children.is_some_and(|all| all.iter().any(|c| number(c) == node))
        };
        let own = local(&nodes[node]);
        match nodes.iter().position(is_above) {
            Some(above) => self.world(above) * own,
            None => own,
        }
    }

    /// Linear sRGB irradiance that `haarlight probe` finds at points (place, normal) of the room that was baked; none without
    /// the program or the room.
    pub(crate) fn probed(
        &self,
        points: &[(DVec3, DVec3)],
        options: &[String],
    ) -> Option<Vec<[f64; 3]>> {
        let program = std::env::var_os("HAARLIGHT")?;
        let room = self.path.to_string_lossy().replace(".baked.glb", ".glb");
        let list = std::env::temp_dir().join(format!("points-{}.csv", std::process::id()));
        let row =
            |(p, n): &(DVec3, DVec3)| format!("{},{},{},{},{},{}\n", p.x, p.y, p.z, n.x, n.y, n.z);
        let rows: String = points.iter().map(row).collect();
        std::fs::write(&list, format!("x,y,z,nx,ny,nz\n{rows}")).expect("a place for points");
        let output = Command::new(program)
            .args(["probe", &room, "-q", "--points"])
            .arg(&list)
            .args(options)
            .output();
        std::fs::remove_file(&list).expect("it was written");
        let text = String::from_utf8(output.expect("the program runs").stdout).expect("text");
        let found: Vec<[f64; 3]> = text.lines().skip(1).map(linear).collect();
        assert_eq!(found.len(), points.len(), "probe failed");
        Some(found)
    }
}

/// Linear sRGB (IEC 61966-2-1) of a line of `probe`.
fn linear(line: &str) -> [f64; 3] {
    let numbers: Vec<f64> = line
        .split(',')
        .skip(6)
        .take(3)
        .map(|n| n.parse().expect("a number"))
        .collect();
    let [x, y, z] = [numbers[0], numbers[1], numbers[2]];
    [
        3.240_625_5 * x - 1.537_208 * y - 0.498_628_6 * z,
        -0.968_930_7 * x + 1.875_756_1 * y + 0.041_517_5 * z,
        0.055_710_1 * x - 0.204_021_1 * y + 1.056_995_9 * z,
    ]
}
