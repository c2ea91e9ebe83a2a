//! The written files as an engine reads them: triangles in the world with texture coordinates, and pages.

use glam::{DMat4, DQuat, DVec2, DVec3};
use serde_json::Value;
use std::path::Path;

/// A triangle with its place on a page.
pub(crate) struct Mapped {
    /// Number of its entry in the index.
    pub(crate) entry: usize,
    pub(crate) node: String,
    pub(crate) page: usize,
    pub(crate) back: bool,
    pub(crate) corners: [DVec3; 3],
    /// Shading normals out of the side that is lit.
    pub(crate) normals: [DVec3; 3],
    pub(crate) uv: [DVec2; 3],
}

/// A page: linear sRGB irradiance, lx.
pub(crate) struct Texels {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) rgb: Vec<[f64; 3]>,
}

impl Texels {
    /// A bilinear look-up, edges clamped, as graphics cards do it.
    pub(crate) fn look_up(&self, uv: DVec2) -> [f64; 3] {
        let most = DVec2::new((self.width - 1) as f64, (self.height - 1) as f64);
        let at = uv * DVec2::new(self.width as f64, self.height as f64) - 0.5;
        let low = at.floor();
        let texel = |dx: f64, dy: f64| {
            let p = (low + DVec2::new(dx, dy)).clamp(DVec2::ZERO, most);
            self.rgb[p.y as usize * self.width + p.x as usize]
        };
        let f = at - low;
        let parts = [
            ((1.0 - f.x) * (1.0 - f.y), texel(0.0, 0.0)),
            (f.x * (1.0 - f.y), texel(1.0, 0.0)),
            ((1.0 - f.x) * f.y, texel(0.0, 1.0)),
            (f.x * f.y, texel(1.0, 1.0)),
        ];
        [0, 1, 2].map(|c| parts.iter().map(|(w, t)| w * t[c]).sum())
    }
}

/// JSON and binary chunk of a glb.
pub(crate) fn chunks(bytes: &[u8]) -> (Value, &[u8]) {
    let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let end = 20 + length(12);
    (
        serde_json::from_slice(&bytes[20..end]).unwrap(),
        &bytes[end + 8..],
    )
}

/// An accessor of floats or indices without stride, as numbers.
fn numbers(json: &Value, bin: &[u8], accessor: &Value) -> Vec<f64> {
    let accessor = &json["accessors"][accessor.as_u64().unwrap() as usize];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap_or(0) as usize;
    let bytes = &bin[start..start + view["byteLength"].as_u64().unwrap() as usize];
    match accessor["componentType"].as_u64().unwrap() {
        5123 => bytes
            .as_chunks()
            .0
            .iter()
            .map(|b| f64::from(u16::from_le_bytes(*b)))
            .collect(),
        5125 => bytes
            .as_chunks()
            .0
            .iter()
            .map(|b| f64::from(u32::from_le_bytes(*b)))
            .collect(),
        _ => bytes
            .as_chunks()
            .0
            .iter()
            .map(|b| f64::from(f32::from_le_bytes(*b)))
            .collect(),
    }
}

fn transform(node: &Value) -> DMat4 {
    let list = |key: &str| -> Option<Vec<f64>> {
        Some(
            node[key]
                .as_array()?
                .iter()
                .map(|v| v.as_f64().unwrap())
                .collect(),
        )
    };
    if let Some(matrix) = list("matrix") {
        return DMat4::from_cols_slice(&matrix);
    }
    let vec = |key: &str, or: DVec3| list(key).map_or(or, |v| DVec3::from_slice(&v));
    let turn = list("rotation").map_or(DQuat::IDENTITY, |v| DQuat::from_slice(&v));
    DMat4::from_scale_rotation_translation(
        vec("scale", DVec3::ONE),
        turn,
        vec("translation", DVec3::ZERO),
    )
}

/// All triangles that the index lists, with the rectangle's arithmetic done.
pub(crate) fn triangles(glb: &[u8], index: &Value) -> Vec<Mapped> {
    let (json, bin) = chunks(glb);
    let nodes = json["nodes"].as_array().unwrap();
    let mut world = vec![DMat4::IDENTITY; nodes.len()];
    for root in json["scenes"][0]["nodes"].as_array().unwrap() {
        let mut open = vec![(root.as_u64().unwrap() as usize, DMat4::IDENTITY)];
        while let Some((node, above)) = open.pop() {
            world[node] = above * transform(&nodes[node]);
            for child in nodes[node]["children"].as_array().into_iter().flatten() {
                open.push((child.as_u64().unwrap() as usize, world[node]));
            }
        }
    }
    let mut out = Vec::new();
    for (place, entry) in index["meshes"].as_array().unwrap().iter().enumerate() {
        let number = |key: &str| entry[key].as_u64().unwrap() as usize;
        let node = number("node");
        let primitive = &json["meshes"][number("mesh")]["primitives"][number("primitive")];
        let attribute = |name: &str| {
            let accessor = &primitive["attributes"][name];
            (!accessor.is_null()).then(|| numbers(&json, bin, accessor))
        };
        let rect: Vec<f64> = (entry["uv_rect"].as_array().unwrap().iter())
            .map(|v| v.as_f64().unwrap())
            .collect();
        let (low, high) = (DVec2::from_slice(&rect[..2]), DVec2::from_slice(&rect[2..]));
        let set = format!("TEXCOORD_{}", number("texcoord"));
        let (at, uv, normals) = (
            attribute("POSITION").unwrap(),
            attribute(&set).unwrap(),
            attribute("NORMAL"),
        );
        let turned = world[node].inverse().transpose();
        let mirrored = world[node].determinant() < 0.0;
        for corner in numbers(&json, bin, &primitive["indices"]).chunks(3) {
            let corner = [0, 1, 2].map(|k| corner[k] as usize);
            let corners =
                corner.map(|v| world[node].transform_point3(DVec3::from_slice(&at[3 * v..])));
            let [a, b, c] = corners;
            let flat = (b - a).cross(c - a).normalize() * if mirrored { -1.0 } else { 1.0 };
            let normal = |v: usize| match &normals {
                Some(normals) => turned
                    .transform_vector3(DVec3::from_slice(&normals[3 * v..]))
                    .normalize(),
                None => flat,
            };
            out.push(Mapped {
                entry: place,
                node: entry["name"].as_str().unwrap_or("").to_owned(),
                page: number("page"),
                back: entry["back"].as_bool().unwrap(),
                corners,
                normals: corner.map(normal),
                uv: corner.map(|v| low + DVec2::from_slice(&uv[2 * v..]) * (high - low)),
            });
        }
    }
    out
}

/// The EXR pages that the index names.
pub(crate) fn pages(folder: &Path, index: &Value) -> Vec<Texels> {
    listed(
        folder,
        &index["pages"],
        index["lux_per_unit"].as_f64().unwrap(),
    )
}

/// The EXR pages of a list.
pub(crate) fn listed(folder: &Path, pages: &Value, unit: f64) -> Vec<Texels> {
    let read = |page: &Value| {
        use exr::prelude::*;
        let image = read_first_rgba_layer_from_file(
            folder.join(page["exr"].as_str().unwrap()),
            |size, _| (size.width(), vec![[0.0_f32; 3]; size.area()]),
            |(width, texels): &mut (usize, Vec<[f32; 3]>),
             at,
             (r, g, b, _): (f32, f32, f32, f32)| {
                texels[at.y() * *width + at.x()] = [r, g, b];
            },
        )
        .unwrap();
        let (width, rgb) = image.layer_data.channel_data.pixels;
        Texels {
            width,
            height: rgb.len() / width,
            rgb: rgb.iter().map(|t| t.map(|c| f64::from(c) * unit)).collect(),
        }
    };
    pages.as_array().unwrap().iter().map(read).collect()
}
