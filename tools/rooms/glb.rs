//! Writes a binary glTF 2.0 file from meshes, materials, lights, cameras and nodes.
//!
//! One buffer, every attribute in a view of its own, 4-byte aligned. The same calls give the same bytes.
//! Only what the project's rooms need: float attributes, 16- or 32-bit indices, PNG images.

use glam::{DMat4, DVec3};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// glTF component types and buffer view targets (glTF 2.0, 5.1.3 and 5.11.5).
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Triangles with optional attributes.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    /// Positions, metres.
    pub(crate) positions: Vec<DVec3>,
    /// Unit normals, one for each position, or none for flat triangles.
    pub(crate) normals: Vec<DVec3>,
    /// Texture coordinates, one for each position, or none.
    pub(crate) uvs: Vec<[f64; 2]>,
    /// Linear vertex colours, one for each position, or none.
    pub(crate) colors: Vec<[f64; 3]>,
    /// Triangles, counter-clockwise from the front.
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Adds the four-sided face `corners`, turned so that its front shows `toward`.
    pub(crate) fn quad(&mut self, corners: [DVec3; 4], toward: DVec3) {
        let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]);
        let centre = corners.iter().sum::<DVec3>() / 4.0;
        let first = self.positions.len() as u32;
        let order = if normal.dot(toward - centre) > 0.0 {
            [0, 1, 2, 3]
        } else {
            [0, 3, 2, 1]
        };
        self.positions.extend(order.map(|i| corners[i]));
        self.triangles.push([first, first + 1, first + 2]);
        self.triangles.push([first, first + 2, first + 3]);
    }

    /// Adds another mesh that has the same attributes.
    pub(crate) fn append(&mut self, other: &Mesh) {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.uvs.extend(&other.uvs);
        self.colors.extend(&other.colors);
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    }

    /// The mesh moved by a transform without shear.
    pub(crate) fn moved(mut self, by: DMat4) -> Self {
        let turn = glam::DMat3::from_mat4(by).inverse().transpose();
        self.positions
            .iter_mut()
            .for_each(|p| *p = by.transform_point3(*p));
        self.normals
            .iter_mut()
            .for_each(|n| *n = (turn * *n).normalize());
        if by.determinant() < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        self
    }

    /// The mesh with one colour at every vertex.
    pub(crate) fn coloured(mut self, color: [f64; 3]) -> Self {
        self.colors = vec![color; self.positions.len()];
        self
    }
}

/// A document in the making.
#[derive(Debug, Default)]
pub(crate) struct Glb {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    images: Vec<Value>,
    textures: Vec<Value>,
    samplers: Vec<Value>,
    cameras: Vec<Value>,
    lights: Vec<Value>,
    nodes: Vec<Value>,
    /// Nodes that are not in the scene's root because another node holds them.
    held: BTreeSet<usize>,
    extensions: BTreeSet<&'static str>,
    /// Triangles drawn, instances counted.
    triangles: usize,
    mesh_triangles: Vec<usize>,
}

impl Glb {
    /// Triangles of the scene, instances counted.
    pub(crate) fn triangles(&self) -> usize {
        self.triangles
    }

    /// Names an extension that some raw JSON given here uses.
    pub(crate) fn uses(&mut self, extension: &'static str) {
        self.extensions.insert(extension);
    }

    /// A matt material with a linear base colour.
    pub(crate) fn paint(&mut self, name: &str, color: [f64; 3]) -> usize {
        self.material(json!({"name": name, "pbrMetallicRoughness": matt(color)}))
    }

    /// A matt emitter: radiance `nits` times the linear `emissive` colour; `color` is what it reflects.
    pub(crate) fn lamp(
        &mut self,
        name: &str,
        color: [f64; 3],
        emissive: [f64; 3],
        nits: f64,
    ) -> usize {
        self.uses("KHR_materials_emissive_strength");
        self.material(json!({
            "name": name,
            "pbrMetallicRoughness": matt(color),
            "emissiveFactor": emissive,
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": nits}},
        }))
    }

    /// A material in glTF's own words.
    pub(crate) fn material(&mut self, material: Value) -> usize {
        push(&mut self.materials, material)
    }

    /// An embedded PNG with a repeating sampler; the answer is the texture's index.
    pub(crate) fn texture(&mut self, name: &str, png: &[u8]) -> usize {
        let view = self.view(png, None);
        if self.samplers.is_empty() {
            self.samplers.push(json!({"wrapS": 10497, "wrapT": 10497}));
        }
        let image = push(
            &mut self.images,
            json!({"name": name, "mimeType": "image/png", "bufferView": view}),
        );
        push(&mut self.textures, json!({"sampler": 0, "source": image}))
    }

    /// A mesh of one primitive for each part and its material.
    pub(crate) fn mesh(&mut self, name: &str, parts: &[(&Mesh, usize)]) -> usize {
        let mut primitives = Vec::new();
        for (mesh, material) in parts {
            let mut attributes = Map::new();
            attributes.insert("POSITION".into(), json!(self.positions(&mesh.positions)));
            if !mesh.normals.is_empty() {
                let normals = self.floats("VEC3", mesh.normals.iter().map(|n| n.to_array()));
                attributes.insert("NORMAL".into(), json!(normals));
            }
            if !mesh.uvs.is_empty() {
                let uvs = self.floats("VEC2", mesh.uvs.iter().copied());
                attributes.insert("TEXCOORD_0".into(), json!(uvs));
            }
            if !mesh.colors.is_empty() {
                let colors = self.floats("VEC3", mesh.colors.iter().copied());
                attributes.insert("COLOR_0".into(), json!(colors));
            }
            let indices = self.indices(&mesh.triangles, mesh.positions.len());
            primitives
                .push(json!({"attributes": attributes, "indices": indices, "material": material}));
        }
        self.mesh_triangles
            .push(parts.iter().map(|(m, _)| m.triangles.len()).sum());
        push(
            &mut self.meshes,
            json!({"name": name, "primitives": primitives}),
        )
    }

    /// A node at the origin that draws a mesh.
    pub(crate) fn place(&mut self, name: &str, mesh: usize) -> usize {
        self.node(json!({"name": name, "mesh": mesh}))
    }

    /// A mesh of its own, drawn once.
    pub(crate) fn draw(&mut self, name: &str, parts: &[(&Mesh, usize)]) -> usize {
        let mesh = self.mesh(name, parts);
        self.place(name, mesh)
    }

    /// A node in glTF's own words.
    pub(crate) fn node(&mut self, node: Value) -> usize {
        if let Some(mesh) = node["mesh"].as_u64() {
            let instances =
                node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"].as_u64();
            let copies = instances.map_or(1, |a| {
                self.accessors[a as usize]["count"].as_u64().unwrap_or(1)
            });
            self.triangles += self.mesh_triangles[mesh as usize] * copies as usize;
        }
        if let Some(children) = node["children"].as_array() {
            self.held.extend(
                children
                    .iter()
                    .filter_map(Value::as_u64)
                    .map(|c| c as usize),
            );
        }
        push(&mut self.nodes, node)
    }

    /// A node that draws a mesh once for each translation (metres) and turn about +Y (radians).
    pub(crate) fn instances(&mut self, name: &str, mesh: usize, at: &[(DVec3, f64)]) -> usize {
        self.uses("EXT_mesh_gpu_instancing");
        let moves = self.plain("VEC3", at.iter().map(|(p, _)| p.to_array()));
        let turns = self.plain(
            "VEC4",
            at.iter()
                .map(|(_, a)| [0.0, (a / 2.0).sin(), 0.0, (a / 2.0).cos()]),
        );
        let attributes = json!({"TRANSLATION": moves, "ROTATION": turns});
        self.node(json!({
            "name": name,
            "mesh": mesh,
            "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}},
        }))
    }

    /// A perspective camera at `eye` that looks at `target`; vertical field of view in radians.
    pub(crate) fn camera(&mut self, name: &str, eye: DVec3, target: DVec3, yfov: f64, aspect: f64) {
        let perspective =
            json!({"yfov": yfov, "aspectRatio": aspect, "znear": 0.01, "zfar": 1000.0});
        let camera = push(
            &mut self.cameras,
            json!({"name": name, "type": "perspective", "perspective": perspective}),
        );
        let matrix = look(eye, target);
        self.node(json!({"name": name, "camera": camera, "matrix": matrix.to_cols_array()}));
    }

    /// A punctual light (KHR_lights_punctual, in its own words) at `eye`, shining at `target`.
    pub(crate) fn light(&mut self, light: Value, eye: DVec3, target: DVec3) -> usize {
        self.uses("KHR_lights_punctual");
        let name = light["name"].clone();
        let light = push(&mut self.lights, light);
        let matrix = look(eye, target);
        self.node(json!({
            "name": name,
            "matrix": matrix.to_cols_array(),
            "extensions": {"KHR_lights_punctual": {"light": light}},
        }))
    }

    /// The scene as it is once at each of these places, with its cameras at the first. Meshes are held once.
    pub(crate) fn repeat(&mut self, places: &[DVec3]) {
        let once = self.nodes.clone();
        let roots: Vec<usize> = (0..once.len()).filter(|k| !self.held.contains(k)).collect();
        self.triangles *= places.len();
        for (k, place) in places.iter().enumerate() {
            let first = if k == 0 { 0 } else { self.nodes.len() };
            if k > 0 {
                self.nodes
                    .extend(once.iter().map(|node| again(node, first)));
                let held = self.held.range(..once.len()).copied();
                let held: Vec<usize> = held.map(|child| child + first).collect();
                self.held.extend(held);
            }
            let children: Vec<usize> = roots.iter().map(|root| root + first).collect();
            self.held.extend(&children);
            let name = format!("place {}", k + 1);
            let at = place.to_array();
            self.nodes
                .push(json!({"name": name, "translation": at, "children": children}));
        }
    }

    /// The file.
    pub(crate) fn finish(self, name: &str) -> Vec<u8> {
        let roots: Vec<usize> = (0..self.nodes.len())
            .filter(|n| !self.held.contains(n))
            .collect();
        let mut root = Map::new();
        root.insert(
            "asset".into(),
            json!({"version": "2.0", "generator": "haarlight rooms"}),
        );
        if !self.extensions.is_empty() {
            root.insert("extensionsUsed".into(), json!(self.extensions));
        }
        root.insert("scene".into(), json!(0));
        root.insert("scenes".into(), json!([{"name": name, "nodes": roots}]));
        if !self.lights.is_empty() {
            root.insert(
                "extensions".into(),
                json!({"KHR_lights_punctual": {"lights": self.lights}}),
            );
        }
        let lists = [
            ("nodes", self.nodes),
            ("meshes", self.meshes),
            ("materials", self.materials),
            ("textures", self.textures),
            ("images", self.images),
            ("samplers", self.samplers),
            ("cameras", self.cameras),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
        ];
        for (key, list) in lists {
            if !list.is_empty() {
                root.insert(key.into(), list.into());
            }
        }
        root.insert("buffers".into(), json!([{"byteLength": self.bin.len()}]));
        pack(Value::Object(root).to_string().into_bytes(), self.bin)
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        push(&mut self.views, view)
    }

    fn accessor(
        &mut self,
        bytes: &[u8],
        target: Option<u32>,
        component: u32,
        kind: &str,
        count: usize,
    ) -> usize {
        let view = self.view(bytes, target);
        push(
            &mut self.accessors,
            json!({"bufferView": view, "componentType": component, "count": count, "type": kind}),
        )
    }

    fn floats<const N: usize>(
        &mut self,
        kind: &str,
        values: impl Iterator<Item = [f64; N]>,
    ) -> usize {
        let (bytes, count) = float_bytes(values);
        self.accessor(&bytes, Some(ARRAY_BUFFER), FLOAT, kind, count)
    }

    /// Floats that are no vertex attributes, so that their view has no target.
    fn plain<const N: usize>(
        &mut self,
        kind: &str,
        values: impl Iterator<Item = [f64; N]>,
    ) -> usize {
        let (bytes, count) = float_bytes(values);
        self.accessor(&bytes, None, FLOAT, kind, count)
    }

    fn positions(&mut self, positions: &[DVec3]) -> usize {
        let accessor = self.floats("VEC3", positions.iter().map(|p| p.to_array()));
        // The bounds are those of the numbers as stored.
        let stored = |p: &DVec3| p.as_vec3().as_dvec3();
        let min = positions
            .iter()
            .map(stored)
            .fold(DVec3::INFINITY, DVec3::min);
        let max = positions
            .iter()
            .map(stored)
            .fold(DVec3::NEG_INFINITY, DVec3::max);
        self.accessors[accessor]["min"] = json!(min.to_array());
        self.accessors[accessor]["max"] = json!(max.to_array());
        accessor
    }

    fn indices(&mut self, triangles: &[[u32; 3]], vertices: usize) -> usize {
        let flat = triangles.iter().flatten();
        // 65535 is the restart value of 16-bit indices, so that many vertices need 32 bits.
        let (component, bytes): (u32, Vec<u8>) = if vertices < usize::from(u16::MAX) {
            (
                UNSIGNED_SHORT,
                flat.flat_map(|&i| (i as u16).to_le_bytes()).collect(),
            )
        } else {
            (UNSIGNED_INT, flat.flat_map(|&i| i.to_le_bytes()).collect())
        };
        self.accessor(
            &bytes,
            Some(ELEMENT_ARRAY_BUFFER),
            component,
            "SCALAR",
            3 * triangles.len(),
        )
    }
}

/// A node once more, whose children stand `first` further on; without its camera.
fn again(node: &Value, first: usize) -> Value {
    let mut node = node.clone();
    if let Some(object) = node.as_object_mut() {
        object.remove("camera");
    }
    if let Some(children) = node.get_mut("children").and_then(Value::as_array_mut) {
        for child in children {
            *child = json!(child.as_u64().unwrap_or(0) + first as u64);
        }
    }
    node
}

/// A rough dielectric: the nearest thing to Lambertian that glTF has.
pub(crate) fn matt(color: [f64; 3]) -> Value {
    json!({"baseColorFactor": [color[0], color[1], color[2], 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0})
}

fn float_bytes<const N: usize>(values: impl Iterator<Item = [f64; N]>) -> (Vec<u8>, usize) {
    let mut bytes = Vec::new();
    let mut count = 0;
    for value in values {
        bytes.extend(value.iter().flat_map(|&v| (v as f32).to_le_bytes()));
        count += 1;
    }
    (bytes, count)
}

/// Puts a camera or light, which look along their own -Z, at `eye`, looking at `target`.
fn look(eye: DVec3, target: DVec3) -> DMat4 {
    let back = (eye - target).normalize();
    let up = if back.y.abs() > 0.999 {
        DVec3::NEG_Z
    } else {
        DVec3::Y
    };
    let right = up.cross(back).normalize();
    DMat4::from_cols(
        right.extend(0.0),
        back.cross(right).extend(0.0),
        back.extend(0.0),
        eye.extend(1.0),
    )
}

/// The container (glTF 2.0, 4.4): header, JSON chunk padded by blanks, binary chunk padded by zeros.
fn pack(mut json: Vec<u8>, mut bin: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut file = Vec::with_capacity(28 + json.len() + bin.len());
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend(((28 + json.len() + bin.len()) as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend((bin.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bin);
    file
}

fn push<T>(list: &mut Vec<T>, item: T) -> usize {
    list.push(item);
    list.len() - 1
}
