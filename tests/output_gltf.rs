//! The baked GLB, read back with another reader.

use crate::output_room;

use glam::{DMat4, DVec3, Mat4};
use haarlight::gather::BakedSurface;
use haarlight::gather::refined;
use haarlight::output::{BakedGlb, Exposure, Packing, Writing};
use haarlight::scene::Scene;
use output_room::{refined as refine, room};

/// With the unclipped truth beside the colours.
const TRUTH: Writing = Writing {
    xyz: true,
    packing: Packing::Floats,
};

fn baked_glb(
    scene: &Scene,
    surfaces: &[BakedSurface],
    look: &Exposure,
) -> haarlight::Result<BakedGlb> {
    haarlight::output::baked_glb(scene, surfaces, look, TRUTH)
}

/// The file as the `gltf` crate sees it, with its validation on.
struct Read {
    gltf: gltf::Gltf,
    blob: Vec<u8>,
    json: serde_json::Value,
}

fn read(bytes: &[u8]) -> Read {
    let glb = gltf::Glb::from_slice(bytes).unwrap();
    let json = serde_json::from_slice(&glb.json).unwrap();
    let mut gltf = gltf::Gltf::from_slice(bytes).unwrap();
    let blob = gltf.blob.take().unwrap();
    Read { gltf, blob, json }
}

fn baked(scene: &Scene) -> Read {
    let surfaces = refine(scene, 3);
    let look = Exposure::new(1e-3);
    let glb = baked_glb(scene, &surfaces, &look).unwrap();
    assert_eq!(glb.bytes, baked_glb(scene, &surfaces, &look).unwrap().bytes);
    read(&glb.bytes)
}

impl Read {
    fn node(&self, name: &str) -> gltf::Node<'_> {
        self.gltf.nodes().find(|n| n.name() == Some(name)).unwrap()
    }

    /// World positions and triangles of a primitive at a node below the (untransformed) root.
    fn world(&self, parents: &[&str], primitive: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let to_world = parents.iter().fold(DMat4::IDENTITY, |m, name| {
            m * Mat4::from_cols_array_2d(&self.node(name).transform().matrix()).as_dmat4()
        });
        let node = self.node(parents.last().unwrap());
        let primitive = node.mesh().unwrap().primitives().nth(primitive).unwrap();
        let reader = primitive.reader(|_| Some(&self.blob));
        let positions = reader.read_positions().unwrap();
        let positions = positions
            .map(|p| to_world.transform_point3(glam::Vec3::from(p).as_dvec3()))
            .collect();
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        let turned = to_world.determinant() < 0.0;
        let turn = |t: &[u32]| {
            if turned {
                [t[0], t[2], t[1]]
            } else {
                [t[0], t[1], t[2]]
            }
        };
        (positions, indices.chunks(3).map(turn).collect())
    }
}

/// Leaves the file in `target/tmp` for `tools/validate.mjs`.
#[test]
fn the_file_for_the_validator() {
    let scene = room();
    let surfaces = refine(&scene, 3);
    let glb = baked_glb(&scene, &surfaces, &Exposure::auto(&scene, &surfaces)).unwrap();
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("output_room.glb");
    haarlight::store::file::write_atomic(&path, None, |w| w.write_all(&glb.bytes)).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), glb.bytes);
}

#[test]
fn each_node_and_instance_shows_its_own_refined_mesh_in_its_place() {
    let scene = room();
    let surfaces = refine(&scene, 3);
    let read = baked(&scene);
    let places: [(&[&str], usize); 6] = [
        (&["left"], 0),
        (&["left"], 1),
        (&["right"], 0),
        (&["right"], 1),
        (&["lamp", "lamp 0"], 0),
        (&["lamp", "lamp 1"], 0),
    ];
    let mut meshes = std::collections::BTreeSet::new();
    for (surface, (path, primitive)) in surfaces.iter().zip(places) {
        let (positions, triangles) = read.world(path, primitive);
        let input = &scene.surfaces[surface.surface];
        assert_eq!(positions.len(), surface.vertices.len());
        for (p, v) in positions.iter().zip(&surface.vertices) {
            assert!(
                (*p - refined::position(input, v)).length() < 1e-6,
                "{path:?}: {p}"
            );
        }
        assert_eq!(triangles, surface.triangles, "{path:?}");
        meshes.insert(read.node(path.last().unwrap()).mesh().unwrap().index());
    }
    assert_eq!(meshes.len(), 4);
    assert!(read.node("lamp").mesh().is_none());
}

#[test]
fn color_0_is_exposed_light_times_vertex_paint_and_xyz_is_raw() {
    let scene = room();
    let surfaces = refine(&scene, 3);
    let read = baked(&scene);
    for (surface, (node, primitive)) in
        surfaces
            .iter()
            .zip([("left", 0), ("left", 1), ("right", 0), ("right", 1)])
    {
        let input = &scene.surfaces[surface.surface];
        let mesh = read.node(node).mesh().unwrap();
        let primitive = mesh.primitives().nth(primitive).unwrap();
        let reader = primitive.reader(|_| Some(&read.blob));
        let Some(gltf::mesh::util::ReadColors::RgbF32(colors)) = reader.read_colors(0) else {
            panic!("not floats")
        };
        for (color, vertex) in colors.zip(&surface.vertices) {
            // Bilinear corner colours by hand: the wall's corners are red, green, blue, white.
            let corners = input.triangles[vertex.triangle as usize];
            for i in 0..3 {
                let paint: f64 = match &input.colors {
                    Some(c) => (0..3)
                        .map(|k| vertex.weights[k] * f64::from(c[corners[k] as usize][i]))
                        .sum(),
                    None => 1.0,
                };
                let wanted = 1e-3 * f64::from(vertex.light[i]) * paint;
                assert!((f64::from(color[i]) - wanted).abs() < 1e-6, "{color:?}");
            }
        }
        let (_, xyz) = primitive
            .attributes()
            .find(|(s, _)| s.to_string() == "_XYZ")
            .unwrap();
        let xyz: Vec<[f32; 3]> = gltf::accessor::Iter::new(xyz, |_| Some(&read.blob))
            .unwrap()
            .collect();
        assert!(
            xyz.iter()
                .zip(&surface.vertices)
                .all(|(xyz, v)| *xyz == v.radiosity)
        );
    }
}

#[test]
fn lamps_are_clipped_to_white_and_counted() {
    let scene = room();
    let glb = baked_glb(&scene, &refine(&scene, 3), &Exposure::new(1e-3)).unwrap();
    assert_eq!(glb.clipped, 2 * 16);
    assert_eq!((glb.vertices, glb.triangles), (6 * 16, 6 * 18));
    let read = read(&glb.bytes);
    let mesh = read.node("lamp 1").mesh().unwrap();
    let primitive = mesh.primitives().next().unwrap();
    let colors = primitive
        .reader(|_| Some(&read.blob))
        .read_colors(0)
        .unwrap();
    assert!(colors.into_rgb_f32().all(|c| c.iter().all(|&c| c > 0.95)));
}

#[test]
fn input_attributes_are_interpolated() {
    let scene = room();
    let surfaces = refine(&scene, 3);
    let read = baked(&scene);
    let mesh = read.node("left").mesh().unwrap();
    let floor = mesh.primitives().next().unwrap();
    let reader = floor.reader(|_| Some(&read.blob));
    let uvs: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    for (uv, p) in uvs.iter().zip(&positions) {
        assert!(
            (uv[0] * output_room::SIDE - p[0]).abs() < 1e-6
                && (uv[1] * output_room::SIDE + p[2]).abs() < 1e-6
        );
    }
    assert!(reader.read_normals().unwrap().all(|n| n == [0.0, 1.0, 0.0]));
    assert!(
        reader
            .read_tangents()
            .unwrap()
            .all(|t| t == [1.0, 0.0, 0.0, -1.0])
    );
    let attribute = |name: &str| {
        floor
            .attributes()
            .find(|(s, _)| s.to_string() == name)
            .map(|(_, a)| a)
    };
    let heat: Vec<f32> =
        gltf::accessor::Iter::new(attribute("_HEAT").unwrap(), |_| Some(&read.blob))
            .unwrap()
            .collect();
    let corners = [1.0, 2.0, 3.0, 4.0];
    for (heat, v) in heat.iter().zip(&surfaces[0].vertices) {
        let corner = scene.surfaces[0].triangles[v.triangle as usize];
        let wanted: f64 = (0..3)
            .map(|k| v.weights[k] * corners[corner[k] as usize])
            .sum();
        assert!((f64::from(*heat) - wanted).abs() < 1e-6);
    }
    assert!(attribute("_ID").is_none(), "ids are not interpolated");
}

#[test]
fn materials_become_unlit_and_keep_their_paint() {
    let scene = room();
    let read = baked(&scene);
    let mesh = read.node("left").mesh().unwrap();
    let materials: Vec<_> = mesh.primitives().map(|p| p.material()).collect();
    assert!(materials.iter().all(gltf::Material::unlit));
    let pbr = materials[0].pbr_metallic_roughness();
    assert_eq!(pbr.base_color_factor(), [1.0; 4]);
    assert_eq!(
        pbr.base_color_texture().unwrap().texture().source().name(),
        Some("checker")
    );
    assert_eq!(read.json["materials"][0]["extras"]["paint"], "kept");
    // The points still show the wall's own material, so the baked wall has a copy.
    let dust = read.node("dust").mesh().unwrap();
    let dust = dust.primitives().next().unwrap();
    assert!(!dust.material().unlit());
    assert_eq!(dust.material().name(), Some("wall"));
    assert_ne!(dust.material().index(), materials[1].index());
    assert_eq!(materials[1].name(), Some("wall"));
}

#[test]
fn the_back_of_a_two_sided_surface_is_a_primitive_of_its_own() {
    let mut scene = room();
    scene.source.json["materials"][0]["doubleSided"] = serde_json::json!(true);
    scene.materials[0].sides = haarlight::scene::Sides::Both;
    // The floor of the plain node and of the mirrored one, with their backs behind them.
    let mut surfaces = refine(&scene, 3);
    let backs: Vec<_> = [0, 2]
        .map(|floor| output_room::back(&surfaces[floor], 1.0))
        .into();
    surfaces.extend(backs.clone());
    let glb = baked_glb(&scene, &surfaces, &Exposure::new(1e-3)).unwrap();
    let read = read(&glb.bytes);
    for (node, back) in ["left", "right"].into_iter().zip(&backs) {
        let mesh = read.node(node).mesh().unwrap();
        // Floor, its back, wall.
        let primitives: Vec<_> = mesh.primitives().collect();
        assert_eq!(primitives.len(), 3);
        let (floor, under) = (&primitives[0], &primitives[1]);
        assert!(!floor.material().double_sided() && floor.material().unlit());
        assert_eq!(floor.material().index(), under.material().index());
        let reader = under.reader(|_| Some(&read.blob));
        assert!(
            reader
                .read_normals()
                .unwrap()
                .all(|n| n == [0.0, -1.0, 0.0])
        );
        // The texture still runs the same way: cross(normal, tangent) * hand is what it was on the front.
        let bitangent = |primitive: &gltf::Primitive| {
            let reader = primitive.reader(|_| Some(&read.blob));
            let normal = reader.read_normals().unwrap().next().unwrap();
            let [x, y, z, hand] = reader.read_tangents().unwrap().next().unwrap();
            glam::Vec3::from(normal).cross(glam::vec3(x, y, z)) * hand
        };
        assert_eq!(bitangent(under), bitangent(floor));
        let (positions, triangles) = read.world(&[node], 1);
        assert_eq!(triangles, back.triangles);
        for [a, b, c] in triangles.iter().map(|t| t.map(|v| positions[v as usize])) {
            assert!((b - a).cross(c - a).y < 0.0, "{node}: faces down");
        }
        let mut colors = reader.read_colors(0).unwrap().into_rgb_f32();
        assert!(colors.all(|c| c.iter().all(|c| (c - 3.141_593e-3).abs() < 1e-8)));
    }
}

#[test]
fn a_texture_that_the_light_was_not_divided_by_goes() {
    let mut scene = room();
    scene.materials[0].paint = None;
    let read = baked(&scene);
    assert!(
        read.json["materials"][0]["pbrMetallicRoughness"]
            .get("baseColorTexture")
            .is_none()
    );
}

#[test]
fn a_mask_under_a_measured_reflectance_stays_as_white_with_holes() {
    let mut scene = room();
    let texture = scene.materials[0].paint.take();
    scene.images[0].pixels[5][3] = 0.0;
    scene.materials[0].alpha = haarlight::scene::Alpha::Mask {
        cutoff: 0.5,
        factor: 1.0,
        texture,
    };
    let read = baked(&scene);
    let material = read.gltf.materials().next().unwrap();
    let image = material
        .pbr_metallic_roughness()
        .base_color_texture()
        .unwrap()
        .texture()
        .source();
    let gltf::image::Source::View { view, .. } = image.source() else {
        panic!("not embedded")
    };
    let picture = image::load_from_memory(&read.blob[view.offset()..][..view.length()])
        .unwrap()
        .to_rgba8();
    assert_eq!(picture.get_pixel(5, 0).0, [255, 255, 255, 0]);
    assert_eq!(picture.get_pixel(4, 0).0, [255, 255, 255, 255]);
}

#[test]
fn the_rest_of_the_document_survives() {
    let scene = room();
    let read = baked(&scene);
    let (old, new) = (&scene.source.json, &read.json);
    for key in ["scene", "scenes", "cameras", "extensions", "textures"] {
        assert_eq!(old[key], new[key], "{key}");
    }
    assert_eq!(new["nodes"][0], old["nodes"][0]);
    assert_eq!(new["nodes"][4], old["nodes"][4]);
    assert_eq!(new["asset"]["generator"], "by hand");
    assert_eq!(new["asset"]["extras"]["note"], "kept");
    assert_eq!(
        new["asset"]["extras"]["haarlight"]["exposure"]["scale"],
        1e-3
    );
    assert_eq!(new["meshes"][0]["extras"]["mesh"], "kept");
    assert_eq!(
        new["extensionsUsed"],
        serde_json::json!(["KHR_lights_punctual", "KHR_materials_unlit"])
    );
    assert!(new.get("extensionsRequired").is_none());
    // Key frames and points come with their data.
    let animation = read.gltf.animations().next().unwrap();
    let channel = animation.channels().next().unwrap();
    let reader = channel.reader(|_| Some(&read.blob));
    assert_eq!(
        reader.read_inputs().unwrap().collect::<Vec<_>>(),
        [0.0, 1.0]
    );
    let dust = read.node("dust").mesh().unwrap();
    let points = dust.primitives().next().unwrap();
    let reader = points.reader(|_| Some(&read.blob));
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    assert_eq!(positions, [[0.0, 0.1, 0.2], [0.3, 0.4, 0.5]]);
    let colors: Vec<[u8; 3]> = reader.read_colors(0).unwrap().into_rgb_u8().collect();
    assert_eq!(colors, [[255, 0, 0], [0, 255, 0]]);
}

#[test]
fn replaced_data_is_not_dragged_along() {
    let scene = room();
    let read = baked(&scene);
    // 1000 positions nobody uses, in the input.
    assert!(scene.source.buffers[0].len() > 12_000);
    let used: usize = read.gltf.views().map(|v| v.length()).sum();
    assert!(used <= read.blob.len() && read.blob.len() < used + 4 * read.gltf.views().len());
    let referenced: usize = read.gltf.accessors().map(|a| a.count() * a.size()).sum();
    assert!(
        used < referenced + 500,
        "{used} bytes in views, {referenced} in accessors"
    );
}

#[test]
fn data_inside_a_compressed_stream_is_taken_from_the_scene() {
    let plain = room();
    let mut scene = room();
    for primitive in scene.source.json["meshes"][0]["primitives"]
        .as_array_mut()
        .unwrap()
    {
        primitive["extensions"] = serde_json::json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": {} } });
    }
    scene.source.json["extensionsRequired"]
        .as_array_mut()
        .unwrap()
        .push("KHR_draco_mesh_compression".into());
    let (a, b) = (baked(&plain), baked(&scene));
    assert!(b.json.get("extensionsRequired").is_none());
    for node in ["left", "right"] {
        let (positions, _) = a.world(&[node], 0);
        assert_eq!(b.world(&[node], 0).0, positions);
        let normals = |read: &Read| -> Vec<[f32; 3]> {
            let mesh = read.node(node).mesh().unwrap();
            let floor = mesh.primitives().next().unwrap();
            floor
                .reader(|_| Some(&read.blob))
                .read_normals()
                .unwrap()
                .collect()
        };
        assert_eq!(normals(&a), normals(&b));
    }
}

#[test]
fn a_broken_refined_mesh_is_refused() {
    let scene = room();
    let mut surfaces = refine(&scene, 1);
    surfaces[0].vertices[1].light[0] = f32::NAN;
    assert_eq!(
        baked_glb(&scene, &surfaces, &Exposure::new(1.0))
            .unwrap_err()
            .exit_code(),
        3
    );
    let mut surfaces = refine(&scene, 1);
    surfaces[0].triangles[0][0] = 99;
    assert!(baked_glb(&scene, &surfaces, &Exposure::new(1.0)).is_err());
}

/// Moves the positions of a primitive into a meshopt stream, and leaves nothing in their old place.
#[cfg(feature = "meshopt")]
fn pack_positions(scene: &mut Scene, mesh: usize) {
    let source = &mut scene.source;
    let accessor = &source.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"];
    let view = source.json["accessors"][accessor.as_u64().unwrap() as usize]["bufferView"]
        .as_u64()
        .unwrap() as usize;
    let start = source.json["bufferViews"][view]["byteOffset"]
        .as_u64()
        .unwrap() as usize;
    let length = source.json["bufferViews"][view]["byteLength"]
        .as_u64()
        .unwrap() as usize;
    let mut bytes = source.buffers[0].to_vec();
    let number = |c: &[u8]| f32::from_le_bytes(c.try_into().unwrap());
    let rows: Vec<[f32; 3]> = bytes[start..start + length]
        .chunks(12)
        .map(|row| [number(&row[..4]), number(&row[4..8]), number(&row[8..])])
        .collect();
    let packed = meshopt::encode_vertex_buffer(&rows).unwrap();
    bytes[start..start + length].fill(0);
    source.buffers[0] = bytes.into();
    source.json["bufferViews"][view]["extensions"] = serde_json::json!({ "EXT_meshopt_compression": {
        "buffer": source.buffers.len(), "byteLength": packed.len(), "byteStride": 12, "count": rows.len(),
        "mode": "ATTRIBUTES" } });
    source.buffers.push(packed.into());
}

#[cfg(feature = "meshopt")]
#[test]
fn packed_buffers_come_out_plain() {
    let mut scene = room();
    let plain = baked(&scene);
    pack_positions(&mut scene, 0);
    pack_positions(&mut scene, 2);
    for key in ["extensionsUsed", "extensionsRequired"] {
        scene.source.json[key]
            .as_array_mut()
            .unwrap()
            .push("EXT_meshopt_compression".into());
    }
    let packed = baked(&scene);
    assert_eq!(plain.json, packed.json);
    assert_eq!(plain.blob, packed.blob);
}

#[test]
fn external_images_come_inside_and_missing_ones_are_grey() {
    let folder = tempfile::tempdir().unwrap();
    let png = {
        let scene = room();
        scene.source.image_bytes(0).unwrap()
    };
    std::fs::write(folder.path().join("my tiles.png"), &png).unwrap();
    let embedded = |uri: &str| {
        let mut scene = room();
        scene.source.path = folder.path().join("room.gltf");
        scene.source.json["images"][0] = serde_json::json!({ "name": "checker", "uri": uri });
        let glb = baked_glb(&scene, &refine(&scene, 1), &Exposure::new(1.0)).unwrap();
        let read = read(&glb.bytes);
        let image = read.gltf.images().next().unwrap();
        let gltf::image::Source::View { view, mime_type } = image.source() else {
            panic!("not inside")
        };
        assert_eq!(mime_type, "image/png");
        (
            read.blob[view.offset()..][..view.length()].to_vec(),
            glb.warnings,
        )
    };
    assert_eq!(embedded("my%20tiles.png"), (png, vec![]));
    let (grey, warnings) = embedded("lost.png");
    assert_eq!(
        image::load_from_memory(&grey)
            .unwrap()
            .to_rgb8()
            .get_pixel(0, 0)
            .0,
        [188; 3]
    );
    assert!(
        warnings.len() == 1 && warnings[0].contains("lost.png"),
        "{warnings:?}"
    );
}

#[test]
fn poses_are_frozen_where_light_is_baked() {
    let mut scene = room();
    let json = &mut scene.source.json;
    let position = json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].clone();
    for p in 0..2 {
        json["meshes"][0]["primitives"][p]["targets"] =
            serde_json::json!([{ "POSITION": position }]);
    }
    json["meshes"][0]["weights"] = serde_json::json!([0.0]);
    json["skins"] = serde_json::json!([{ "joints": [0] }]);
    json["nodes"][1]["skin"] = serde_json::json!(0);
    json["nodes"][1]["weights"] = serde_json::json!([0.0]);
    let channel = serde_json::json!({ "sampler": 0, "target": { "node": 1, "path": "weights" } });
    json["animations"][0]["channels"]
        .as_array_mut()
        .unwrap()
        .push(channel);
    let read = baked(&scene);
    let left = read.node("left");
    assert!(left.skin().is_none() && left.weights().is_none());
    let mesh = left.mesh().unwrap();
    assert!(mesh.weights().is_none() && mesh.primitives().all(|p| p.morph_targets().len() == 0));
    let animation = read.gltf.animations().next().unwrap();
    assert_eq!(animation.channels().count(), 1);
}
