//! Reading glTF: small documents built here, one matter each.

use crate::common;

use common::{Room, U8, U16, png, push};
use glam::{DVec3, Vec3};
use haarlight::scene::document::{AlphaMode, Document, RawLightKind};
use haarlight::scene::{Options, Projection, Scene, Surface, Wrap};
use serde_json::json;

/// Front of the first triangle, unit length.
fn front(surface: &Surface) -> DVec3 {
    let [a, b, c] = surface.triangles[0].map(|i| surface.positions[i as usize]);
    (b - a).cross(c - a).normalize()
}

#[test]
fn a_triangle_has_a_name_a_default_material_and_a_place() {
    let (document, geometry) = Room::triangle().load().unwrap();
    let [surface] = geometry.surfaces.as_slice() else {
        panic!("one surface")
    };
    assert_eq!(surface.name, "node 0 'n', mesh 0 'm', primitive 0");
    assert_eq!(
        (
            surface.node,
            surface.mesh,
            surface.primitive,
            surface.instance
        ),
        (0, 0, 0, None)
    );
    assert_eq!(surface.positions[1], DVec3::X);
    assert_eq!(surface.triangles, [[0, 1, 2]]);
    assert!(surface.normals.is_none() && surface.colors.is_none() && surface.texcoords.is_empty());
    let [material] = document.raw_materials() else {
        panic!("the default material")
    };
    assert_eq!((material.index, surface.material), (None, 0));
    assert_eq!(
        (material.base_color_factor, material.emissive_factor),
        ([1.0; 4], [0.0; 3])
    );
    assert!(geometry.warnings.is_empty());
}

#[test]
fn strips_fans_and_lists_without_indices_show_the_same_side() {
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
    ];
    let round = [corners[0], corners[1], corners[3], corners[2]];
    for (mode, points, count) in [
        (4, &corners[..3], 1),
        (5, &corners[..], 2),
        (6, &round[..], 2),
    ] {
        let mut room = Room::empty();
        let position = room.vectors(points);
        room.json["nodes"][0]["mesh"] = json!(0);
        room.json["meshes"] =
            json!([{"primitives": [{"mode": mode, "attributes": {"POSITION": position}}]}]);
        let (_, geometry) = room.load().unwrap();
        let surface = &geometry.surfaces[0];
        assert_eq!(surface.triangles.len(), count);
        for &triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|i| surface.positions[i as usize]);
            assert_eq!((b - a).cross(c - a), DVec3::Z, "mode {mode}");
        }
    }
}

#[test]
fn mirrored_nodes_keep_their_front_and_sheared_ones_their_normals() {
    let normal = Vec3::new(0.0, 0.6, 0.8);
    let mut room = Room::triangle();
    let normals = room.vectors(&[normal.to_array(); 3]);
    room.primitive()["attributes"]["NORMAL"] = json!(normals);
    let mut at = |node: serde_json::Value| {
        room.json["nodes"][0] = node;
        let (_, geometry) = room.load().unwrap();
        let surface = geometry.surfaces[0].clone();
        (front(&surface), surface.normals.unwrap()[0])
    };
    // Seen in a mirror at x = 0 the side that showed to +z still does.
    assert_eq!(
        at(json!({"mesh": 0, "scale": [-1, 1, 1]})),
        (DVec3::Z, normal)
    );
    let (turned, shading) = at(json!({"mesh": 0, "scale": [1, 1, -1]}));
    assert_eq!((turned, shading), (-DVec3::Z, Vec3::new(0.0, 0.6, -0.8)));
    // x' = x + z / 2: a plane through (0.6 y + 0.8 z = 0) keeps its normal's y and z, as x does not enter.
    let (_, shading) =
        at(json!({"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0.5, 0, 1, 0, 3, 4, 5, 1]}));
    assert!((shading - normal).length() < 1e-6);
    // y' = y + x: the normal's x becomes -0.6.
    let (_, shading) =
        at(json!({"mesh": 0, "matrix": [1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}));
    let expected = Vec3::new(-0.6, 0.6, 0.8).normalize();
    assert!((shading - expected).length() < 1e-6, "{shading}");
}

#[test]
fn a_mesh_at_many_nodes_and_instances() {
    let mut room = Room::triangle();
    let shift = room.vectors(&[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turn = room.vectors(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]]);
    room.json["nodes"] = json!([{"children": [1, 2], "translation": [0, 0, 5]}, {"mesh": 0},
        {"mesh": 0, "scale": [2, 2, 2], "extensions": {"EXT_mesh_gpu_instancing":
            {"attributes": {"TRANSLATION": shift, "ROTATION": turn}}}}]);
    room.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    room.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let (_, geometry) = room.load().unwrap();
    let corner: Vec<DVec3> = geometry.surfaces.iter().map(|s| s.positions[1]).collect();
    assert_eq!(corner[0], DVec3::new(1.0, 0.0, 5.0));
    assert_eq!(corner[1], DVec3::new(4.0, 0.0, 5.0));
    // (1,0,0) turned to (0,1,0), moved to (0,3,0), doubled.
    assert!(
        (corner[2] - DVec3::new(0.0, 6.0, 5.0)).length() < 1e-6,
        "{}",
        corner[2]
    );
    let instances: Vec<Option<usize>> = geometry.surfaces.iter().map(|s| s.instance).collect();
    assert_eq!(instances, [None, Some(0), Some(1)]);
    assert!(
        geometry.surfaces[2]
            .name
            .ends_with("primitive 0, instance 1")
    );
}

#[test]
fn quantised_and_sparse_vertices() {
    let mut room = Room::triangle();
    let view = room.view(&[0, 0, 0, 0, 255, 0, 0, 0, 0, 255, 0, 0]);
    room.json["bufferViews"][view]["byteStride"] = json!(4);
    let position = push(
        &mut room.json["accessors"],
        json!({"bufferView": view, "componentType": U8, "normalized": true, "type": "VEC3", "count": 3}),
    );
    room.primitive()["attributes"]["POSITION"] = json!(position);
    room.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let (_, geometry) = room.load().unwrap();
    assert_eq!(
        geometry.surfaces[0].positions,
        [DVec3::ZERO, DVec3::X, DVec3::Y]
    );

    let at = room.view(&2u16.to_le_bytes());
    let value = room.view(&[7, 8, 9]);
    room.json["accessors"][position]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": at, "componentType": U16}, "values": {"bufferView": value}});
    room.json["accessors"][position]["normalized"] = json!(false);
    let (_, geometry) = room.load().unwrap();
    assert_eq!(geometry.surfaces[0].positions[2], DVec3::new(7.0, 8.0, 9.0));
}

#[test]
fn colours_coordinates_and_missing_sets() {
    let mut room = Room::triangle();
    let rgb: Vec<u8> = [65535u16, 0, 0]
        .repeat(3)
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let colors = room.accessor(&rgb, U16, "VEC3", 3);
    room.json["accessors"][colors]["normalized"] = json!(true);
    let first = room.vectors(&[[0.0, 0.0], [1.0, 0.0], [0.0, f32::NAN]]);
    room.primitive()["attributes"]["COLOR_0"] = json!(colors);
    room.primitive()["attributes"]["TEXCOORD_0"] = json!(first);
    room.primitive()["material"] = json!(0);
    let image = room.view(&png(1, 1, &[[255, 0, 0, 255]]));
    room.json["images"] = json!([{"bufferView": image, "mimeType": "image/png"}]);
    room.json["textures"] = json!([{"source": 0}]);
    room.json["materials"] = json!([{"emissiveTexture": {"index": 0, "texCoord": 1}}]);
    let (_, geometry) = room.load().unwrap();
    let surface = &geometry.surfaces[0];
    assert_eq!(surface.colors.as_ref().unwrap()[2], [1.0, 0.0, 0.0, 1.0]);
    assert_eq!(
        surface.texcoords,
        [vec![[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]], vec![[0.0; 2]; 3]]
    );
    assert!(
        geometry
            .warnings
            .iter()
            .any(|w| w.contains("texture coordinates are out of range"))
    );
    assert!(
        geometry
            .warnings
            .iter()
            .any(|w| w.contains("lack texture coordinates"))
    );
    assert_eq!(geometry.images[0].pixels, [[1.0, 0.0, 0.0, 1.0]]);
}

#[test]
fn materials_come_with_the_defaults_of_the_standard() {
    let mut room = Room::triangle();
    room.primitive()["material"] = json!(1);
    room.json["materials"] = json!([{}, {"name": "w", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "emissiveFactor": [2, 1, 0], "extras": {"a": 1}, "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0, 1.5],
        "metallicFactor": 0}, "extensions": {"KHR_materials_unlit": {}, "KHR_materials_emissive_strength":
        {"emissiveStrength": 10}}}]);
    let (document, geometry) = room.load().unwrap();
    let [plain, other] = document.raw_materials() else {
        panic!("no default material is needed")
    };
    assert_eq!(
        (plain.metallic, plain.alpha_mode, plain.alpha_cutoff),
        (1.0, AlphaMode::Opaque, 0.5)
    );
    assert_eq!(plain.emissive_strength, 1.0);
    assert_eq!(other.base_color_factor, [0.5, 0.25, 0.0, 1.0]);
    // The excess over 1 goes into the strength.
    assert_eq!(
        (other.emissive_factor, other.emissive_strength),
        ([1.0, 0.5, 0.0], 20.0)
    );
    assert_eq!(
        (other.alpha_mode, other.alpha_cutoff),
        (AlphaMode::Mask, 0.25)
    );
    assert!(other.double_sided && other.unlit && other.extras.is_some());
    assert_eq!(
        other.extensions,
        ["KHR_materials_emissive_strength", "KHR_materials_unlit"]
    );
    assert_eq!(geometry.surfaces[0].material, 1);
    assert_eq!(geometry.warnings.len(), 2, "{:?}", geometry.warnings);
}

/// Of a metal that is smooth by its factors a texture's blue says where it is one; its green makes it smoother only.
#[test]
fn textures_say_where_smooth_metals_are_mirrors() {
    let read = |roughness: f64, pixels: &[[u8; 4]]| {
        let mut room = Room::triangle();
        room.primitive()["material"] = json!(0);
        let image = room.view(&png(pixels.len() as u32, 1, pixels));
        room.json["images"] = json!([{"bufferView": image, "mimeType": "image/png"}]);
        room.json["textures"] = json!([{"source": 0}]);
        room.json["materials"] = json!([{"pbrMetallicRoughness":
            {"roughnessFactor": roughness, "metallicRoughnessTexture": {"index": 0}}}]);
        let (document, _) = room.load().unwrap();
        let scene = Scene::from_document(document, &Options::default()).unwrap();
        (
            scene.materials[0].mirror.is_some(),
            scene.warnings.join("\n"),
        )
    };
    let (metal, other) = ([0, 255, 255, 255], [0, 255, 0, 255]);
    let few = |strays: usize| [vec![metal; 200 - strays], vec![other; strays]].concat();
    for (roughness, pixels, mirrors) in [
        (0.05, vec![metal; 4], true),
        // JPEG.
        (0.05, vec![[0, 0, 250, 255]], true),
        (0.05, vec![other; 4], false),
        (0.05, few(1), true),
        (0.05, few(20), false),
        (0.5, vec![[0, 0, 255, 255]; 4], false),
    ] {
        let (is_mirror, said) = read(roughness, &pixels);
        assert_eq!(is_mirror, mirrors, "{roughness} {:?}: {said}", pixels[0]);
        let told = "whose metallicRoughnessTexture says no metal in places: matt";
        assert_eq!(said.contains(told), !mirrors && roughness < 0.1, "{said}");
        let unused = "said by a metallicRoughnessTexture, which is not used: matt everywhere";
        assert_eq!(said.contains(unused), !mirrors, "{said}");
    }
}

#[test]
fn textures_from_data_uris_with_samplers() {
    let mut room = Room::triangle();
    room.primitive()["material"] = json!(0);
    // One blue pixel, sRGB 128.
    let bytes = png(1, 1, &[[0, 0, 128, 64]]);
    let hex: String = bytes.iter().map(|b| format!("%{b:02x}")).collect();
    room.json["images"] = json!([{"uri": format!("data:image/png,{hex}")}]);
    room.json["samplers"] = json!([{"wrapS": 33071}]);
    room.json["textures"] = json!([{"source": 0, "sampler": 0}]);
    room.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let (document, geometry) = room.load().unwrap();
    let texture = document.raw_materials()[0]
        .base_color_texture
        .as_ref()
        .unwrap();
    assert_eq!(texture.wrap, [Wrap::Clamp, Wrap::Repeat]);
    let [r, g, b, a] = texture.sample(&geometry.images, [0.3, 0.7]);
    assert_eq!((r, g, a), (0.0, 0.0, 64.0 / 255.0));
    assert!((b - 0.2159).abs() < 1e-3);
    assert_eq!(document.source.image_bytes(0).unwrap(), bytes);
}

#[test]
fn a_missing_texture_is_grey_and_a_warning() {
    for image in [
        json!({"uri": "none.png"}),
        json!({"uri": "../x.png"}),
        json!({}),
        json!({"uri": "http://h/x.png"}),
    ] {
        let mut room = Room::triangle();
        room.primitive()["material"] = json!(0);
        room.json["images"] = json!([image]);
        room.json["textures"] = json!([{"source": 0}]);
        room.json["materials"] =
            json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
        let (_, geometry) = room.load().unwrap();
        assert_eq!(geometry.images[0].pixels, [[0.5, 0.5, 0.5, 1.0]]);
        let said = |w: &String| w.contains("image 0") && w.contains("grey");
        assert!(
            geometry.warnings.iter().any(said),
            "{:?}",
            geometry.warnings
        );
    }
}

#[test]
fn lights_and_cameras_stand_where_their_nodes_do() {
    let mut room = Room::empty();
    room.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point"}, {"type": "spot", "name": "s", "color": [1, 0.5, 0], "intensity": 7, "range": 3},
        {"type": "directional", "extras": {"name": "cie/A"}}, {"type": "area"}]}});
    let light = |index: usize| json!({"KHR_lights_punctual": {"light": index}});
    room.json["nodes"] = json!([{"children": [1, 2, 3, 4], "translation": [1, 2, 3]},
        {"name": "lamp", "extensions": light(0)}, {"extensions": light(1), "camera": 0},
        {"extensions": light(2), "camera": 1}, {"extensions": light(3), "camera": 2}]);
    room.json["cameras"] = json!([
        {"type": "perspective", "name": "eye", "perspective": {"yfov": 0.8, "znear": 0.1, "aspectRatio": 1.5}},
        {"type": "orthographic", "orthographic": {"xmag": 4, "ymag": 2, "znear": 0, "zfar": 9}},
        {"type": "perspective", "perspective": {"yfov": 7}}]);
    let (document, geometry) = room.load().unwrap();
    let [point, spot, sun] = document.raw_lights() else {
        panic!("three lights")
    };
    assert_eq!(
        (point.kind, point.name.as_str(), point.node),
        (RawLightKind::Point, "lamp", 1)
    );
    assert_eq!(
        (point.color, point.intensity, point.range),
        ([1.0; 3], 1.0, None)
    );
    assert_eq!(
        (spot.color, spot.intensity, spot.range),
        ([1.0, 0.5, 0.0], 7.0, Some(3.0))
    );
    assert_eq!((spot.inner, spot.outer), (0.0, std::f32::consts::FRAC_PI_4));
    assert_eq!(
        spot.to_world.transform_point3(DVec3::ZERO),
        DVec3::new(1.0, 2.0, 3.0)
    );
    assert_eq!(
        (sun.kind, sun.extras.is_some()),
        (RawLightKind::Directional, true)
    );
    let [eye, plan] = geometry.cameras.as_slice() else {
        panic!("two cameras")
    };
    assert_eq!(
        (eye.name.as_str(), eye.projection, eye.aspect),
        ("eye", Projection::Perspective(0.8), Some(1.5))
    );
    assert_eq!(
        (plan.projection, plan.aspect),
        (Projection::Orthographic(2.0), Some(2.0))
    );
    assert_eq!(geometry.warnings.len(), 2, "{:?}", geometry.warnings);
}

#[test]
fn what_is_left_out_is_said_with_a_count() {
    let mut room = Room::triangle();
    let flat = room.vectors(&[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]);
    let sliver = room.vectors(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-6, 0.0]]);
    let zero = room.vectors(&[[0.0; 3]; 3]);
    let primitives = &mut room.json["meshes"][0]["primitives"];
    push(primitives, json!({"attributes": {"POSITION": flat}}));
    push(
        primitives,
        json!({"attributes": {"POSITION": sliver, "NORMAL": zero}, "targets": [{}]}),
    );
    push(
        primitives,
        json!({"attributes": {"POSITION": flat}, "mode": 0}),
    );
    push(
        primitives,
        json!({"attributes": {"POSITION": flat}, "mode": 3}),
    );
    room.json["nodes"][0]["skin"] = json!(0);
    let (_, geometry) = room.load().unwrap();
    let kept: Vec<usize> = geometry.surfaces.iter().map(|s| s.primitive).collect();
    assert_eq!(kept, [0, 2]);
    assert_eq!(geometry.surfaces[1].normals.as_ref().unwrap()[0], Vec3::Z);
    for said in [
        "1 triangles have no area",
        "2 primitives are points or lines",
        "1 primitives have morph",
        "1 nodes have a skin",
        "3 normals have no direction",
    ] {
        assert!(
            geometry.warnings.iter().any(|w| w.starts_with(said)),
            "{said}: {:?}",
            geometry.warnings
        );
    }
}

#[test]
fn extensions_are_refused_or_noted_by_name() {
    let mut room = Room::triangle();
    room.json["extensionsUsed"] = json!([
        "KHR_materials_clearcoat",
        "ACME_glow",
        "KHR_lights_punctual"
    ]);
    room.json["extensionsRequired"] = json!(["KHR_materials_clearcoat"]);
    let (document, geometry) = room.load().unwrap();
    assert_eq!(
        document.unsupported,
        ["ACME_glow", "KHR_materials_clearcoat"]
    );
    assert_eq!(geometry.warnings.len(), 1);
    room.json["extensionsRequired"] = json!(["KHR_texture_basisu", "ACME_glow"]);
    let text = room.load().unwrap_err().to_string();
    assert!(text.contains("ACME_glow, KHR_texture_basisu"), "{text}");
}

#[cfg(feature = "draco")]
#[test]
fn draco_packed_cube() {
    use common::F32;
    let mut room = Room::triangle();
    // A cube of edge 2 around the origin, 24 vertices with normals and coordinates, packed by draco-gltf 0.7.
    let packed = room.view(include_bytes!("corpus/cube.drc"));
    let mut declare = |kind: &str, component: u32, count: usize| {
        push(
            &mut room.json["accessors"],
            json!({"componentType": component, "type": kind, "count": count}),
        )
    };
    let (position, normal) = (declare("VEC3", F32, 24), declare("VEC3", F32, 24));
    let (coordinates, indices) = (declare("VEC2", F32, 24), declare("SCALAR", U16, 36));
    *room.primitive() = json!({"attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": coordinates},
        "indices": indices, "extensions": {"KHR_draco_mesh_compression": {"bufferView": packed,
        "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}}}});
    room.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    let (_, geometry) = room.load().unwrap();
    let surface = &geometry.surfaces[0];
    assert_eq!((surface.triangles.len(), surface.texcoords.len()), (12, 1));
    let normals = surface.normals.as_ref().unwrap();
    for &triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|i| surface.positions[i as usize]);
        let area = (b - a).cross(c - a);
        assert!((area.length() - 4.0).abs() < 1e-2);
        assert!((area.normalize().as_vec3() - normals[triangle[0] as usize]).length() < 1e-2);
        // Outwards.
        assert!(area.dot(a + b + c) > 0.0);
    }
}

#[cfg(feature = "meshopt")]
#[test]
fn meshopt_packed_vertices_and_indices() {
    use common::F32;
    let corners: Vec<[f32; 3]> = (0..8)
        .map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|b| b as f32))
        .collect();
    let triangles: [u32; 36] = [
        0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6,
        1, 3, 5, 3, 7, 5,
    ];
    let mut room = Room::triangle();
    room.json["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
    room.json["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    let mut packed = |bytes: &[u8],
                      kind: &str,
                      component: u32,
                      count: usize,
                      stride: usize,
                      mode: &str,
                      filter: &str| {
        let accessor = room.accessor(bytes, component, kind, count);
        let view = room.json["accessors"][accessor]["bufferView"]
            .as_u64()
            .unwrap() as usize;
        let mut inner = room.json["bufferViews"][view].clone();
        inner["byteStride"] = json!(stride);
        inner["count"] = json!(count);
        inner["mode"] = json!(mode);
        inner["filter"] = json!(filter);
        // The outer view stands for plain bytes that are not there.
        room.json["bufferViews"][view] = json!({"buffer": 1, "byteLength": count * stride,
            "extensions": {"EXT_meshopt_compression": inner}});
        accessor
    };
    let vertices = meshopt::encode_vertex_buffer(&corners).unwrap();
    let position = packed(&vertices, "VEC3", F32, 8, 12, "ATTRIBUTES", "NONE");
    let list = meshopt::encode_index_buffer(&triangles, 8).unwrap();
    let indices = packed(&list, "SCALAR", U16, 36, 2, "TRIANGLES", "NONE");
    let up: [[i8; 4]; 8] = [meshopt::encode_filter_oct::<i8>(&[[0.0, 0.6, 0.8, 0.0]], 8)[0]; 8];
    let filtered = meshopt::encode_vertex_buffer(&up).unwrap();
    let normals = packed(&filtered, "VEC3", 5120, 8, 4, "ATTRIBUTES", "OCTAHEDRAL");
    room.json["accessors"][normals]["normalized"] = json!(true);
    *room.primitive() =
        json!({"attributes": {"POSITION": position, "NORMAL": normals}, "indices": indices});
    push(
        &mut room.json["buffers"],
        json!({"byteLength": 1000, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}),
    );
    let (_, geometry) = room.load().unwrap();
    let surface = &geometry.surfaces[0];
    let plain: Vec<DVec3> = corners.iter().map(|&c| Vec3::from(c).as_dvec3()).collect();
    assert_eq!(surface.positions, plain);
    let volume = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| surface.positions[i as usize]);
        a.dot(b.cross(c)) / 6.0
    };
    assert!((surface.triangles.iter().map(volume).sum::<f64>() - 1.0).abs() < 1e-12);
    let normal = surface.normals.as_ref().unwrap()[5];
    assert!(
        (normal - Vec3::new(0.0, 0.6, 0.8)).length() < 0.02,
        "{normal}"
    );
}

#[test]
fn the_source_keeps_everything() {
    let mut room = Room::triangle();
    room.json["extras"] = json!({"kept": [1, 2]});
    room.json["ACME"] = json!(null);
    let (document, _) = room.load().unwrap();
    assert_eq!(document.source.json, room.json);
    assert_eq!(document.source.buffers.len(), 1);
    assert!(document.source.buffers[0].starts_with(&room.bin));
}

#[test]
fn files_beside_the_document() {
    let dir = tempfile::tempdir().unwrap();
    let mut room = Room::triangle();
    room.json["buffers"][0]["uri"] = json!("a%20b.bin");
    std::fs::write(dir.path().join("a b.bin"), &room.bin).unwrap();
    let path = dir.path().join("room.gltf");
    std::fs::write(&path, room.json.to_string()).unwrap();
    let document = Document::open(&path).unwrap();
    assert_eq!(document.load_geometry().check().unwrap().surfaces.len(), 1);
    assert!(matches!(
        Document::open(dir.path().join("none.glb")),
        Err(haarlight::Error::Io { .. })
    ));
    assert!(
        Document::open(dir.path())
            .unwrap_err()
            .to_string()
            .contains("not a regular file")
    );
}

#[test]
fn packed_geometry_without_its_decoder_is_refused_by_name() {
    for (name, built_in) in [
        ("KHR_draco_mesh_compression", cfg!(feature = "draco")),
        ("EXT_meshopt_compression", cfg!(feature = "meshopt")),
    ] {
        let mut room = Room::triangle();
        room.json["extensionsRequired"] = json!([name]);
        match room.load() {
            Ok(_) => assert!(built_in),
            Err(e) => assert!(!built_in && e.to_string().contains(name), "{e}"),
        }
    }
}

#[test]
fn specular_glossiness_materials_give_their_diffuse_colour() {
    let mut room = Room::triangle();
    room.primitive()["material"] = json!(0);
    room.json["extensionsRequired"] = json!(["KHR_materials_pbrSpecularGlossiness"]);
    room.json["materials"] = json!([{"extensions": {"KHR_materials_pbrSpecularGlossiness":
        {"diffuseFactor": [0.5, 0.25, 0.125, 1]}}}]);
    let (document, _) = room.load().unwrap();
    let material = &document.raw_materials()[0];
    assert_eq!(
        (material.base_color_factor, material.metallic),
        ([0.5, 0.25, 0.125, 1.0], 0.0)
    );
}
