//! A small room built in code: a document and the scene that an importer would make of it, and a refined mesh.
//!
//! Mesh 0 has two primitives, a textured floor and a wall with vertex colours, and hangs on two nodes, one mirrored.
//! Mesh 1 is instanced twice; mesh 2 holds points, which carry no light. A camera, an animation and extras ride along.

use glam::{DMat4, DQuat, DVec3, Vec3};
use haarlight::gather::{BakedSurface, BakedVertex};
use haarlight::scene::*;
use haarlight::spectrum::{BANDS, Grid};
use serde_json::{Value, json};

/// Side of the quads.
pub(crate) const SIDE: f32 = 2.0;

const CORNERS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
const TRIANGLES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];
const COLORS: [[u8; 4]; 4] = [
    [255, 0, 0, 255],
    [0, 255, 0, 255],
    [0, 0, 255, 255],
    [255, 255, 255, 255],
];

/// The document under construction.
#[derive(Default)]
struct Document {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Document {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }),
        );
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    fn accessor(
        &mut self,
        bytes: &[u8],
        component: u32,
        count: usize,
        kind: &str,
        normalized: bool,
    ) -> usize {
        let view = self.view(bytes);
        let mut accessor =
            json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        if normalized {
            accessor["normalized"] = json!(true);
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, rows: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = rows
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let accessor = self.accessor(&bytes, 5126, rows.len(), kind, false);
        if N == 3 {
            let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..N)
                    .map(|i| rows.iter().map(|r| r[i]).reduce(pick).unwrap())
                    .collect()
            };
            self.accessors[accessor]["min"] = json!(bound(f32::min));
            self.accessors[accessor]["max"] = json!(bound(f32::max));
        }
        accessor
    }
}

/// Local corners of the floor (in y = 0, facing +y).
fn floor_corners() -> [[f32; 3]; 4] {
    CORNERS.map(|[u, v]| [SIDE * u, 0.0, -SIDE * v])
}

/// Local corners of the wall (in z = -SIDE, facing +z).
fn wall_corners() -> [[f32; 3]; 4] {
    CORNERS.map(|[u, v]| [SIDE * u, SIDE * v, -SIDE])
}

/// A white square with a transparent dark one in the middle, as PNG and as decoded.
fn checker() -> (Vec<u8>, Image) {
    let pixel = |x: u32, y: u32| {
        if (x / 2 + y / 2).is_multiple_of(2) {
            [255u8; 4]
        } else {
            [64, 128, 32, 255]
        }
    };
    let picture = image::RgbaImage::from_fn(8, 8, |x, y| image::Rgba(pixel(x, y)));
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let linear = |c: u8| {
        let c = f32::from(c) / 255.0;
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    };
    let pixels = picture.pixels().map(|p| {
        [
            linear(p[0]),
            linear(p[1]),
            linear(p[2]),
            f32::from(p[3]) / 255.0,
        ]
    });
    (png.into_inner(), Image::new("checker", 8, pixels.collect()))
}

fn material(name: &str, index: usize) -> Material {
    Material {
        name: name.into(),
        index: Some(index),
        sides: Sides::Front,
        reflectance: [0.5; BANDS],
        reflectance_from: "base colour".into(),
        base_color: [0.5; 3],
        paint: None,
        vertex_paint: false,
        emission: None,
        alpha: Alpha::Opaque,
        pane: None,
        sheet: None,
        mirror: None,
        fluorescence: None,
    }
}

/// The room.
pub(crate) fn room() -> Scene {
    let mut document = Document::default();
    let indices = |d: &mut Document| {
        let bytes: Vec<u8> = TRIANGLES.iter().flatten().map(|&i| i as u8).collect();
        d.accessor(&bytes, 5121, 6, "SCALAR", false)
    };
    let unused = document.floats(&[[7.0f32; 3]; 1000]);
    let texcoords: Vec<u8> = CORNERS
        .iter()
        .flatten()
        .flat_map(|c| ((c * 65535.0) as u16).to_le_bytes())
        .collect();
    let floor = json!({ "material": 0, "indices": indices(&mut document), "attributes": {
        "POSITION": document.floats(&floor_corners()),
        "NORMAL": document.floats(&[[0.0f32, 1.0, 0.0]; 4]),
        "TANGENT": document.floats(&[[1.0f32, 0.0, 0.0, -1.0]; 4]),
        "TEXCOORD_0": document.accessor(&texcoords, 5123, 4, "VEC2", true),
        "_HEAT": document.floats(&[[1.0f32], [2.0], [3.0], [4.0]]),
        "_ID": document.accessor(&[0; 16], 5123, 4, "SCALAR", false),
    }, "extras": { "kept": [unused] } });
    let wall = json!({ "material": 1, "indices": indices(&mut document), "attributes": {
        "POSITION": document.floats(&wall_corners()),
        "COLOR_0": document.accessor(COLORS.as_flattened(), 5121, 4, "VEC4", true),
    } });
    let lamp = json!({ "material": 2, "indices": indices(&mut document), "attributes": {
        "POSITION": document.floats(&floor_corners()),
        "NORMAL": document.floats(&[[0.0f32, 1.0, 0.0]; 4]),
    } });
    let points = json!({ "mode": 0, "material": 1, "attributes": {
        "POSITION": document.floats(&[[0.0f32, 0.1, 0.2], [0.3, 0.4, 0.5]]),
        "COLOR_0": document.accessor(&[255, 0, 0, 0, 0, 255, 0, 0], 5121, 2, "VEC3", true),
    } });
    // Three bytes an element need a stride of four.
    let view = document.views.len() - 1;
    document.views[view]["byteStride"] = json!(4);
    let turned = DQuat::from_rotation_y(0.5);
    let translations = document.floats(&[[0.0f32, 3.0, 0.0], [3.0, 3.0, 0.0]]);
    let rotations = document.floats(&[[0.0f32, 0.0, 0.0, 1.0], turned.as_quat().to_array()]);
    let times = document.floats(&[[0.0f32], [1.0]]);
    document.accessors[times]["min"] = json!([0.0]);
    document.accessors[times]["max"] = json!([1.0]);
    let moves = document.floats(&[[0.0f32; 3], [1.0, 0.0, 0.0]]);
    let (png, image) = checker();
    let image_view = document.view(&png);

    let json = json!({
        "asset": { "version": "2.0", "generator": "by hand", "extras": { "note": "kept" } },
        "scene": 0,
        "scenes": [{ "name": "main", "nodes": [0] }],
        "extensionsUsed": ["EXT_mesh_gpu_instancing", "KHR_lights_punctual", "KHR_materials_emissive_strength"],
        "extensionsRequired": ["EXT_mesh_gpu_instancing"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "name": "bulb" }] } },
        "nodes": [
            { "name": "root", "children": [1, 2, 3, 4, 5], "extras": { "who": "root" } },
            { "name": "left", "mesh": 0, "translation": [1.0, 0.0, 0.0] },
            { "name": "right", "mesh": 0, "scale": [-1.0, 1.0, 1.0] },
            { "name": "lamp", "mesh": 1, "translation": [0.0, 0.5, 0.0], "extensions": { "EXT_mesh_gpu_instancing":
                { "attributes": { "TRANSLATION": translations, "ROTATION": rotations } } } },
            { "name": "eye", "camera": 0, "translation": [0.0, 1.0, 5.0],
                "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "name": "dust", "mesh": 2 },
        ],
        "cameras": [{ "type": "perspective", "name": "eye",
            "perspective": { "yfov": 0.8, "znear": 0.1 } }],
        "animations": [{ "channels": [{ "sampler": 0, "target": { "node": 4, "path": "translation" } }],
            "samplers": [{ "input": times, "output": moves }] }],
        "meshes": [
            { "name": "corner", "primitives": [floor, wall], "extras": { "mesh": "kept" } },
            { "name": "panel", "primitives": [lamp] },
            { "name": "points", "primitives": [points] },
        ],
        "materials": [
            { "name": "tiles", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 },
                "baseColorFactor": [0.5, 0.5, 0.5, 1.0] }, "extras": { "paint": "kept" } },
            { "name": "wall", "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0] } },
            { "name": "light", "emissiveFactor": [1.0, 1.0, 1.0],
                "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 10.0 } } },
        ],
        "textures": [{ "source": 0 }],
        "images": [{ "name": "checker", "bufferView": image_view, "mimeType": "image/png" }],
        "buffers": [{ "byteLength": document.bytes.len() }],
        "bufferViews": document.views,
        "accessors": document.accessors,
    });

    let texture = Texture {
        image: 0,
        texcoord: 0,
        transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        wrap: [Wrap::Repeat; 2],
    };
    let mut tiles = material("tiles", 0);
    tiles.paint = Some(texture);
    let mut wall_paint = material("wall", 1);
    wall_paint.vertex_paint = true;
    let mut light = material("light", 2);
    light.emission = Some(Emission {
        light: 0,
        shape: [1.0; BANDS],
        texture: None,
        color: [1.0; 3],
        scale: 1.0,
        from: "emissive colour".into(),
        profile: None,
    });

    let left = DMat4::from_translation(DVec3::X);
    let right = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let lamp = DMat4::from_translation(DVec3::new(0.0, 0.5, 0.0));
    let lamps = [
        lamp * DMat4::from_translation(DVec3::new(0.0, 3.0, 0.0)),
        lamp * DMat4::from_rotation_translation(turned, DVec3::new(3.0, 3.0, 0.0)),
    ];
    let mut surfaces = Vec::new();
    for (node, to_world) in [(1, left), (2, right)] {
        let mut floor = surface(node, 0, 0, 0, to_world, floor_corners());
        floor.normals = Some(vec![Vec3::Y; 4]);
        floor.texcoords = vec![CORNERS.to_vec()];
        let mut wall = surface(node, 0, 1, 1, to_world, wall_corners());
        wall.colors = Some(
            COLORS
                .iter()
                .map(|c| c.map(|c| f32::from(c) / 255.0))
                .collect(),
        );
        surfaces.extend([floor, wall]);
    }
    for (i, to_world) in lamps.into_iter().enumerate() {
        let mut panel = surface(3, 1, 0, 2, to_world, floor_corners());
        panel.instance = Some(i);
        panel.normals = Some(vec![Vec3::Y; 4]);
        surfaces.push(panel);
    }

    Scene {
        source: Source {
            path: "room.glb".into(),
            json,
            buffers: vec![document.bytes.into()],
        },
        grid: Grid::default(),
        surfaces,
        panes: Vec::new(),
        materials: vec![tiles, wall_paint, light],
        solids: Default::default(),
        images: vec![image],
        spectra: vec![LightSpectrum {
            name: "cie/D65".into(),
            power: [1.0; BANDS],
        }],
        lights: Vec::new(),
        sky: None,
        cameras: vec![Camera {
            name: "eye".into(),
            to_world: DMat4::from_translation(DVec3::new(0.0, 1.0, 5.0)),
            projection: Projection::Perspective(0.8),
            aspect: None,
        }],
        warnings: Vec::new(),
        changes: Default::default(),
    }
}

fn surface(
    node: usize,
    mesh: usize,
    primitive: usize,
    material: usize,
    to_world: DMat4,
    corners: [[f32; 3]; 4],
) -> Surface {
    let mirrored = to_world.determinant() < 0.0;
    Surface {
        name: format!("node {node}, mesh {mesh}, primitive {primitive}"),
        node,
        mesh,
        primitive,
        instance: None,
        material,
        to_world,
        positions: corners
            .iter()
            .map(|c| to_world.transform_point3(Vec3::from(*c).as_dvec3()))
            .collect(),
        normals: None,
        texcoords: Vec::new(),
        colors: None,
        triangles: TRIANGLES
            .iter()
            .map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] })
            .collect(),
    }
}

/// Each quad cut into `n` by `n` cells, lit by a smooth function of the place.
pub(crate) fn refined(scene: &Scene, n: u32) -> Vec<BakedSurface> {
    let light = |p: DVec3| [100.0 + 20.0 * p.x, 120.0, 80.0 + 30.0 * p.y].map(|c| c as f32);
    scene
        .surfaces
        .iter()
        .enumerate()
        .map(|(index, surface)| {
            let mut baked = BakedSurface {
                surface: index,
                ..BakedSurface::default()
            };
            let mirrored = surface.to_world.determinant() < 0.0;
            for y in 0..=n {
                for x in 0..=n {
                    let (u, v) = (f64::from(x) / f64::from(n), f64::from(y) / f64::from(n));
                    // Corner weights of (0, 1, 2) below the diagonal and (0, 2, 3) above it.
                    let (triangle, weights) = if u >= v {
                        (0, [1.0 - u, u - v, v])
                    } else {
                        (1, [1.0 - v, u, v - u])
                    };
                    let weights = if mirrored {
                        [weights[0], weights[2], weights[1]]
                    } else {
                        weights
                    };
                    let mut vertex = BakedVertex {
                        triangle,
                        weights,
                        irradiance: [1.0; 3],
                        radiosity: [0.0; 3],
                        light: [0.0; 3],
                    };
                    let emits = scene.materials[surface.material].emission.is_some();
                    let place = haarlight::gather::refined::position(surface, &vertex);
                    vertex.light = if emits { [5000.0; 3] } else { light(place) };
                    vertex.radiosity = vertex.light;
                    baked.vertices.push(vertex);
                }
            }
            for y in 0..n {
                for x in 0..n {
                    let at = |dx: u32, dy: u32| (y + dy) * (n + 1) + x + dx;
                    for [a, b, c] in [
                        [at(0, 0), at(1, 0), at(1, 1)],
                        [at(0, 0), at(1, 1), at(0, 1)],
                    ] {
                        baked
                            .triangles
                            .push(if mirrored { [a, c, b] } else { [a, b, c] });
                    }
                }
            }
            baked
        })
        .collect()
}

/// The back of a sheet, with its own even light.
pub(crate) fn back(front: &BakedSurface, light: f64) -> BakedSurface {
    let mut back = front.clone();
    back.back = true;
    for triangle in &mut back.triangles {
        triangle.swap(1, 2);
    }
    for vertex in &mut back.vertices {
        vertex.light = [(light * std::f64::consts::PI) as f32; 3];
        vertex.radiosity = vertex.light;
    }
    back
}
