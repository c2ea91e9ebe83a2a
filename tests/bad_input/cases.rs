//! The broken files, each made by changing one thing of a sound one.

use crate::common::{F32, Room, U8, container, png, push};
use serde_json::{Value, json};

/// What a file must come to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Outcome {
    /// An input problem whose text has this in it.
    Refused(&'static str),
    /// It loads, with a warning that has this in it.
    Warned(&'static str),
}
use Outcome::{Refused, Warned};

/// A triangle with one thing changed.
fn with(change: impl FnOnce(&mut Room)) -> Vec<u8> {
    let mut room = Room::triangle();
    change(&mut room);
    room.glb()
}

/// A triangle with one number of its bytes overwritten.
fn patched(at: usize, number: u32) -> Vec<u8> {
    let mut bytes = Room::triangle().glb();
    bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
    bytes
}

/// A triangle whose buffer is elsewhere.
fn buffer_at(uri: &str) -> Vec<u8> {
    with(|r| r.json["buffers"][0]["uri"] = json!(uri))
}

/// A triangle with its material's texture from this image.
fn image(image: Value) -> Vec<u8> {
    with(|r| textured(r, image))
}

pub(crate) fn textured(room: &mut Room, image: Value) {
    room.primitive()["material"] = json!(0);
    room.json["images"] = json!([image]);
    room.json["textures"] = json!([{"source": 0}]);
    room.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
}

/// A PNG of one pixel whose header says 16383 x 16383.
fn png_bomb() -> Vec<u8> {
    let mut bytes = png(1, 1, &[[0; 4]]);
    bytes[16..24].copy_from_slice(&[0, 0, 0x3F, 0xFF, 0, 0, 0x3F, 0xFF]);
    let mut crc = u32::MAX;
    for &byte in &bytes[12..29] {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xEDB8_8320 * (crc & 1));
        }
    }
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    bytes
}

/// Nodes one below the other, `last` below them all.
pub(crate) fn nested(count: usize, last: Value) -> Vec<u8> {
    with(|r| {
        let mut nodes: Vec<Value> = (1..count).map(|i| json!({"children": [i]})).collect();
        nodes.push(last);
        r.json["nodes"] = json!(nodes);
    })
}

/// Every case: name of its file, bytes, outcome.
pub(crate) fn cases() -> Vec<(&'static str, Vec<u8>, Outcome)> {
    let good = Room::triangle().glb();
    let json_size = u32::from_le_bytes([good[12], good[13], good[14], good[15]]) as usize;
    let huge = 1u64 << 40;
    vec![
        // The container.
        ("empty", Vec::new(), Refused("empty")),
        (
            "zip",
            b"PK\x03\x04\x14\0\0\0".to_vec(),
            Refused("zip archive"),
        ),
        ("cut_in_header", good[..10].to_vec(), Refused("cut off")),
        ("cut_in_json", good[..40].to_vec(), Refused("header claims")),
        (
            "cut_in_bin",
            good[..good.len() - 4].to_vec(),
            Refused("header claims"),
        ),
        (
            "length_too_long",
            patched(8, u32::MAX),
            Refused("4294967295 bytes"),
        ),
        (
            "length_too_short",
            patched(8, 40),
            Refused("chunk 0 claims"),
        ),
        (
            "json_chunk_too_long",
            patched(12, u32::MAX),
            Refused("chunk 0 claims"),
        ),
        (
            "bin_chunk_too_long",
            patched(20 + json_size, u32::MAX),
            Refused("chunk 1 claims"),
        ),
        ("version_1", patched(4, 1), Refused("version 1")),
        (
            "first_chunk_is_bin",
            container(&[(*b"BIN\0", &[0; 4])]),
            Refused("not JSON"),
        ),
        (
            "no_bin",
            container(&[(*b"JSON", &good[20..20 + json_size])]),
            Refused("no binary chunk"),
        ),
        (
            "not_json",
            container(&[(*b"JSON", b"{\"a\":")]),
            Refused("JSON cannot be read"),
        ),
        (
            "deep_json",
            container(&[(*b"JSON", &[b'['; 4096])]),
            Refused("recursion"),
        ),
        (
            "number_too_large",
            container(&[(*b"JSON", b"{\"a\":1e999}")]),
            Refused("out of range"),
        ),
        // The document.
        (
            "no_asset",
            with(|r| r.json["asset"] = json!({})),
            Refused("not glTF"),
        ),
        (
            "version_3",
            with(|r| r.json["asset"]["version"] = json!("3.0")),
            Refused("glTF 3.0"),
        ),
        (
            "requires_unknown",
            with(|r| r.json["extensionsRequired"] = json!(["ACME_x"])),
            Refused("ACME_x"),
        ),
        (
            "nodes_are_no_list",
            with(|r| r.json["nodes"] = json!({})),
            Refused("node 0"),
        ),
        (
            "node_is_no_object",
            with(|r| r.json["nodes"] = json!([7])),
            Refused("node 0"),
        ),
        (
            "no_such_scene",
            with(|r| r.json["scene"] = json!(4)),
            Refused("'scene'"),
        ),
        (
            "no_such_mesh",
            with(|r| r.json["nodes"][0]["mesh"] = json!(9)),
            Refused("node 0 'n': refers to mesh 9"),
        ),
        (
            "negative_mesh",
            with(|r| r.json["nodes"][0]["mesh"] = json!(-1)),
            Refused("'mesh' is not"),
        ),
        (
            "no_such_material",
            with(|r| r.primitive()["material"] = json!(3)),
            Refused("material 3"),
        ),
        // Hierarchy.
        (
            "own_child",
            with(|r| r.json["nodes"][0]["children"] = json!([0])),
            Refused("cycle"),
        ),
        (
            "cycle",
            nested(3, json!({"children": [1], "mesh": 0})),
            Refused("cycle"),
        ),
        (
            "two_parents",
            with(|r| {
                r.json["nodes"] = json!([{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}])
            }),
            Refused("second parent"),
        ),
        (
            "transform_overflows",
            with(
                |r| r.json["nodes"] = json!([{"scale": [1e300, 1, 1], "children": [1]}, {"scale": [1e300, 1, 1], "mesh": 0}]),
            ),
            Refused("node 1: has a transform"),
        ),
        // Files.
        (
            "path_climbs",
            buffer_at("../corpus/cube.drc"),
            Refused("'..'"),
        ),
        (
            "path_climbs_encoded",
            buffer_at("%2e%2e%2fcorpus/cube.drc"),
            Refused("'..'"),
        ),
        (
            "path_absolute",
            buffer_at("/etc/passwd"),
            Refused("absolute"),
        ),
        ("path_device", buffer_at("/dev/zero"), Refused("absolute")),
        (
            "path_file_scheme",
            buffer_at("file:///etc/passwd"),
            Refused("scheme 'file:'"),
        ),
        (
            "path_http",
            buffer_at("http://localhost/a.bin"),
            Refused("scheme 'http:'"),
        ),
        ("buffer_missing", buffer_at("none.bin"), Refused("none.bin")),
        ("buffer_is_folder", buffer_at("."), Refused("regular file")),
        (
            "buffer_shorter",
            with(|r| r.json["buffers"][0]["byteLength"] = json!(huge)),
            Refused("claims 1099511627776 bytes"),
        ),
        (
            "buffer_bad_base64",
            buffer_at("data:;base64,$$"),
            Refused("base64"),
        ),
        // Accessors.
        (
            "count_huge",
            with(|r| r.json["accessors"][0]["count"] = json!(huge)),
            Refused("vertices"),
        ),
        (
            "count_large",
            with(|r| r.json["accessors"][0]["count"] = json!(9_000_000)),
            Refused("accessor 0: needs"),
        ),
        (
            "count_huge_without_bytes",
            with(|r| {
                r.json["accessors"][0] =
                    json!({"componentType": F32, "type": "VEC3", "count": 16_000_000});
            }),
            Refused("no bytes"),
        ),
        (
            "count_overflows",
            with(|r| r.json["accessors"][1]["count"] = json!(u64::MAX)),
            Refused("corners"),
        ),
        (
            "offset_overflows",
            with(|r| r.json["accessors"][0]["byteOffset"] = json!(u64::MAX)),
            Refused("accessor 0"),
        ),
        (
            "view_beyond_buffer",
            with(|r| r.json["bufferViews"][0]["byteLength"] = json!(4000)),
            Refused("bufferView 0: reaches"),
        ),
        (
            "view_offset_overflows",
            with(|r| r.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX)),
            Refused("reaches"),
        ),
        (
            "stride_too_small",
            with(|r| r.json["bufferViews"][0]["byteStride"] = json!(4)),
            Refused("byteStride of 4"),
        ),
        (
            "stride_zero",
            with(|r| r.json["bufferViews"][0]["byteStride"] = json!(0)),
            Refused("byteStride of 0"),
        ),
        (
            "no_such_accessor",
            with(|r| r.primitive()["attributes"]["POSITION"] = json!(7)),
            Refused("accessor 7"),
        ),
        (
            "no_position",
            with(|r| r.primitive()["attributes"] = json!({})),
            Refused("no POSITION"),
        ),
        (
            "indices_short",
            with(|r| r.json["accessors"][1]["componentType"] = json!(5122)),
            Refused("unsigned"),
        ),
        (
            "indices_float",
            with(|r| {
                let i = r.vectors(&[[0.0], [1.0], [2.0]]);
                r.primitive()["indices"] = json!(i);
            }),
            Refused("unsigned"),
        ),
        (
            "index_out_of_range",
            with(|r| {
                let i = r.accessor(&[0, 1, 3], U8, "SCALAR", 3);
                r.primitive()["indices"] = json!(i);
            }),
            Refused("node 0 'n', mesh 0 'm', primitive 0, indices: index 2 is 3"),
        ),
        (
            "position_nan",
            with(|r| r.bin[12..16].copy_from_slice(&f32::NAN.to_le_bytes())),
            Refused("POSITION: has a position that is not finite, at vertex 1"),
        ),
        (
            "position_infinite",
            with(|r| r.bin[0..4].copy_from_slice(&f32::INFINITY.to_le_bytes())),
            Refused("not finite, at vertex 0"),
        ),
        (
            "normals_too_few",
            with(|r| {
                let n = r.vectors(&[[0.0, 0.0, 1.0]]);
                r.primitive()["attributes"]["NORMAL"] = json!(n);
            }),
            Refused("1 elements for 3"),
        ),
        (
            "mode_unknown",
            with(|r| r.primitive()["mode"] = json!(7)),
            Refused("mode 7"),
        ),
        (
            "sparse_out_of_range",
            with(|r| {
                let v = r.view(&[9; 16]);
                r.json["accessors"][0]["sparse"] = json!({"count": 1, "indices": {"bufferView": v, "componentType": U8}, "values": {"bufferView": v}});
            }),
            Refused("sparse: has an index beyond"),
        ),
        (
            "sparse_huge",
            with(
                |r| r.json["accessors"][0]["sparse"] = json!({"count": huge, "indices": {"bufferView": 0, "componentType": U8}, "values": {"bufferView": 0}}),
            ),
            Refused("sparse: lists"),
        ),
        (
            "instances_huge",
            with(|r| {
                r.json["accessors"][1]["count"] = json!(3);
                let t = push(
                    &mut r.json["accessors"],
                    json!({"componentType": F32, "type": "VEC3", "count": huge}),
                );
                r.json["nodes"][0]["extensions"] =
                    json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": t}}});
            }),
            Refused("instances counted"),
        ),
        (
            "meshopt_broken",
            with(|r| {
                let l = r.json["bufferViews"][0]["byteLength"].clone();
                r.json["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
                r.json["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {"buffer": 0, "byteLength": l, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"}});
            }),
            Refused("EXT_meshopt_compression"),
        ),
        (
            "meshopt_bomb",
            with(|r| {
                r.json["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
                r.json["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {"buffer": 0, "byteLength": 4, "byteStride": 256, "count": huge, "mode": "ATTRIBUTES"}});
            }),
            Refused("EXT_meshopt_compression"),
        ),
        (
            "draco_broken",
            with(|r| {
                r.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
                r.primitive()["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
            }),
            Refused("KHR_draco_mesh_compression: is not a sound"),
        ),
        // Paint.
        ("image_is_nothing", image(json!({})), Warned("image 0")),
        (
            "image_missing",
            image(json!({"uri": "none.png"})),
            Warned("none.png"),
        ),
        (
            "image_climbs",
            image(json!({"uri": "../../README.md"})),
            Warned("'..'"),
        ),
        (
            "image_http",
            image(json!({"uri": "https://localhost/a.png"})),
            Warned("scheme 'https:'"),
        ),
        (
            "image_is_no_image",
            image(json!({"uri": "data:image/png;base64,AAAA"})),
            Warned("neither PNG nor JPEG"),
        ),
        (
            "image_bomb",
            with(|r| {
                let v = r.view(&png_bomb());
                textured(r, json!({"bufferView": v}));
            }),
            Warned("claims 16383 x 16383 pixels"),
        ),
        (
            "image_view_missing",
            image(json!({"bufferView": 77})),
            Warned("bufferView 77"),
        ),
        (
            "no_such_image",
            with(|r| {
                textured(r, json!({}));
                r.json["textures"][0]["source"] = json!(5);
            }),
            Refused("image 5"),
        ),
        (
            "no_such_texture",
            with(|r| {
                textured(r, json!({}));
                r.json["textures"] = json!([]);
            }),
            Refused("texture 0"),
        ),
        (
            "texture_set_huge",
            with(|r| {
                textured(r, json!({}));
                r.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] =
                    json!(huge);
            }),
            Refused("TEXCOORD_"),
        ),
        (
            "points_only",
            with(|r| r.primitive()["mode"] = json!(0)),
            Warned("points or lines"),
        ),
        (
            "nested_10000",
            nested(10_000, json!({"mesh": 9})),
            Refused("node 9999: refers to mesh 9"),
        ),
    ]
}
