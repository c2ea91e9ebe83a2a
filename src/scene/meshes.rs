//! A room made in memory: triangles, paints and lamps, for programs that have no file.
//!
//! The room becomes a glTF document like any other, so that everything works on it that works on a file, and what is baked can
//! be written as one.

use super::document::Document;
use super::{Options, Scene};
use crate::error::{Error, Result};
use gltf::binary::{Glb, Header};
use serde_json::{Map, Value, json};
use std::borrow::Cow;
use std::path::Path;

/// glTF component types (glTF 2.0, 3.6.2.2).
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// What the light meets.
#[derive(Debug, Clone, PartialEq)]
pub struct Paint {
    /// For messages, and for the file of spectra.
    pub name: String,
    /// Linear sRGB albedo, each in [0, 1].
    pub albedo: [f32; 3],
    /// Linear sRGB luminance that the surface sends out, cd/m2, each from 0.
    pub luminance: [f32; 3],
    /// Does the back reflect and shine too? If not, it is black.
    pub two_sided: bool,
    /// `{"reflectance": ..., "emission": ...}` as in the file of spectra, in place of the colours; null: none.
    pub spectra: Value,
}

impl Default for Paint {
    /// A mid grey that does not shine.
    fn default() -> Self {
        Self {
            name: String::new(),
            albedo: [0.5; 3],
            luminance: [0.0; 3],
            two_sided: false,
            spectra: Value::Null,
        }
    }
}

/// A lamp that is a point, alike in all directions.
#[derive(Debug, Clone, PartialEq)]
pub struct PointLamp {
    /// For messages, and for the file of spectra.
    pub name: String,
    /// Place, metres.
    pub position: [f32; 3],
    /// Luminous intensity, cd, from 0.
    pub candela: f32,
    /// Linear sRGB, each in [0, 1].
    pub color: [f32; 3],
}

/// Triangles of one paint.
#[derive(Debug, Clone, PartialEq)]
struct PaintedMesh {
    name: String,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    paint: usize,
}

/// Meshes with their paints, and lamps. Metres, +Y up.
///
/// ```
/// use haarlight::scene::{Meshes, Options, Paint, Scene};
/// use haarlight::solve::{Bake, Settings};
/// use glam::DVec3;
///
/// let mut room = Meshes::default();
/// let floor = room.paint(Paint { name: "floor".into(), ..Paint::default() });
/// let sky = room.paint(Paint { name: "panel".into(), albedo: [0.0; 3], luminance: [100.0; 3], ..Paint::default() });
/// let square = |y: f32| [[-1.0, y, -1.0], [1.0, y, -1.0], [1.0, y, 1.0], [-1.0, y, 1.0]];
/// room.mesh("floor", &square(0.0), &[[0, 2, 1], [0, 3, 2]], floor);
/// room.mesh("panel", &square(2.0), &[[0, 1, 2], [0, 2, 3]], sky);
/// let mut bake = Bake::new(Scene::from_meshes(&room, &Options::default())?, Settings { error: 2.0, ..Settings::default() });
/// bake.run();
/// // Two squares of 2 m, 2 m apart: the middle of the one gets pi times the other's luminance times its form factor, .2395.
/// let centre = DVec3::ZERO;
/// let lux = bake.probe(&[(centre, DVec3::Y)])[0].xyz[1];
/// assert!((lux / (std::f64::consts::PI * 100.0 * 0.239_4) - 1.0).abs() < 0.01, "{lux}");
/// # Ok::<(), haarlight::Error>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Meshes {
    meshes: Vec<PaintedMesh>,
    paints: Vec<Paint>,
    lamps: Vec<PointLamp>,
}

impl Meshes {
    /// Adds a paint; its number, for [`Meshes::mesh`].
    pub fn paint(&mut self, paint: Paint) -> usize {
        self.paints.push(paint);
        self.paints.len() - 1
    }

    /// Adds triangles, counter-clockwise seen from the front, as indices of positions. What is wrong with them comes out of
    /// [`Scene::from_meshes`].
    pub fn mesh(
        &mut self,
        name: &str,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
        paint: usize,
    ) {
        self.meshes.push(PaintedMesh {
            name: name.into(),
            positions: positions.into(),
            triangles: triangles.into(),
            paint,
        });
    }

    /// Adds a lamp.
    pub fn lamp(&mut self, lamp: PointLamp) {
        self.lamps.push(lamp);
    }

    /// The room as a binary glTF file.
    ///
    /// # Errors
    /// [`Error::Input`] if it takes 4 GiB or more.
    pub fn glb(&self) -> Result<Vec<u8>> {
        let (mut bin, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
        let mut add = |bytes: Vec<u8>, component: u32, kind: &str, count: usize, more: Value| {
            views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
            bin.extend(bytes);
            let mut accessor = json!({"bufferView": views.len() - 1, "componentType": component, "type": kind, "count": count});
            merge(&mut accessor, more);
            accessors.push(accessor);
            accessors.len() - 1
        };
        let mut meshes = Vec::new();
        for mesh in &self.meshes {
            let bytes = |x: &[f32; 3]| x.map(f32::to_le_bytes).concat();
            let positions = mesh.positions.iter().flat_map(bytes).collect();
            let ends = |start: f32, end: fn(f32, f32) -> f32| -> [f32; 3] {
                std::array::from_fn(|c| mesh.positions.iter().map(|p| p[c]).fold(start, end))
            };
            let range = json!({"min": ends(f32::INFINITY, f32::min), "max": ends(f32::NEG_INFINITY, f32::max)});
            let at = add(positions, FLOAT, "VEC3", mesh.positions.len(), range);
            let corners = mesh.triangles.iter().flatten();
            let bytes = corners.flat_map(|i| i.to_le_bytes()).collect();
            let count = 3 * mesh.triangles.len();
            let indices = add(bytes, UNSIGNED_INT, "SCALAR", count, json!({}));
            meshes.push(json!({"name": mesh.name, "primitives": [
                {"attributes": {"POSITION": at}, "indices": indices, "material": mesh.paint}]}));
        }
        let mut root = json!({
            "asset": {"version": "2.0", "generator": crate::PROGRAM},
            "materials": self.paints.iter().map(material).collect::<Vec<_>>(),
            "meshes": meshes,
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{"byteLength": bin.len()}],
        });
        let mut nodes: Vec<Value> = (self.meshes.iter().enumerate())
            .map(|(k, mesh)| json!({"name": mesh.name, "mesh": k}))
            .collect();
        let mut used = vec!["KHR_materials_emissive_strength"];
        if !self.lamps.is_empty() {
            used.push("KHR_lights_punctual");
            let lights: Vec<Value> = self.lamps.iter().map(light).collect();
            root["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
            nodes.extend(self.lamps.iter().enumerate().map(|(k, lamp)| {
                json!({"name": lamp.name, "translation": lamp.position,
                    "extensions": {"KHR_lights_punctual": {"light": k}}})
            }));
        }
        root["scenes"] = json!([{"nodes": (0..nodes.len()).collect::<Vec<_>>()}]);
        root["scene"] = json!(0);
        root["nodes"] = json!(nodes);
        root["extensionsUsed"] = json!(used);
        let glb = Glb {
            header: Header {
                magic: *b"glTF",
                version: 2,
                length: 0,
            },
            json: Cow::Owned(root.to_string().into_bytes()),
            bin: Some(Cow::Owned(bin)),
        };
        let large = |_| Error::input("", "the room takes 4 GiB or more", "make it smaller");
        glb.to_vec().map_err(large)
    }
}

impl Scene {
    /// The room that meshes in memory make; messages name it `(meshes)`. No file of spectra is looked for, unless `options` name
    /// one; what paints name by relative paths is looked for where the program runs.
    ///
    /// # Errors
    /// [`Error::Input`] with everything that is wrong with it, as [`Scene::load`].
    pub fn from_meshes(room: &Meshes, options: &Options) -> Result<Self> {
        Self::from_document(
            Document::from_bytes(Path::new("(meshes)"), &room.glb()?)?,
            options,
        )
    }
}

fn merge(object: &mut Value, more: Value) {
    let (Value::Object(into), Value::Object(from)) = (object, more) else {
        return;
    };
    into.extend(from);
}

/// The strength is the brightest channel, and the factor what is left of the others.
fn material(paint: &Paint) -> Value {
    let strength = paint.luminance.into_iter().fold(0.0, f32::max);
    let factor = paint
        .luminance
        .map(|x| if strength > 0.0 { x / strength } else { 0.0 });
    let [r, g, b] = paint.albedo;
    let mut extras = Map::new();
    if let Value::Object(spectra) = &paint.spectra {
        extras.clone_from(spectra);
    }
    json!({
        "name": paint.name,
        "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0},
        "emissiveFactor": factor,
        "doubleSided": paint.two_sided,
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": strength}},
        "extras": extras,
    })
}

fn light(lamp: &PointLamp) -> Value {
    json!({"name": lamp.name, "type": "point", "intensity": lamp.candela, "color": lamp.color})
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room() -> Meshes {
        let mut room = Meshes::default();
        let spectra = json!({"reflectance": {"name": "macbeth/white"}});
        let white = room.paint(Paint {
            name: "white".into(),
            spectra,
            ..Paint::default()
        });
        let corners = [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [2.0, 0.0, 0.0]];
        room.mesh("floor", &corners, &[[0, 1, 2]], white);
        room.lamp(PointLamp {
            name: "bulb".into(),
            position: [0.0, 1.0, 0.0],
            candela: 10.0,
            color: [1.0; 3],
        });
        room
    }

    #[test]
    fn a_room_in_memory_is_read_as_it_was_made() {
        let scene = Scene::from_meshes(&room(), &Options::default()).unwrap();
        assert_eq!(scene.surfaces.len(), 1);
        assert_eq!(scene.surfaces[0].positions[1].z, 2.0);
        assert_eq!(scene.lights.len(), 1);
        assert_eq!(scene.lights[0].position.y, 1.0);
        let white = &scene.materials[scene.surfaces[0].material];
        assert!(
            white.reflectance[32] > 0.85,
            "the measured white of the chart"
        );
    }

    #[test]
    fn what_is_wrong_is_named() {
        let mut room = room();
        room.mesh("hole", &[[0.0; 3]; 3], &[[0, 1, 7]], 0);
        room.mesh("bare", &[[0.0; 3]; 3], &[[0, 1, 2]], 9);
        let error = Scene::from_meshes(&room, &Options::default()).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("hole") && text.contains("bare"), "{text}");
        assert_eq!(error.exit_code(), 2);
    }
}
