//! Broken and hostile files: each has its expected outcome, and none may panic, hang or take memory beyond what the file
//! truly holds.
//!
//! `tests/corpus` holds the files and `expected.tsv` what must be said of each; both are written from the list below by
//! `cargo test --release --test bad_input -- --ignored write_the_corpus`.

mod cases;
#[expect(dead_code, reason = "rooms of other tests are built there, too")]
#[path = "../common/mod.rs"]
mod common;

use cases::Outcome::{self, Refused, Warned};
use cases::{cases, nested, textured};
use common::{F32, Room, U8, load, png, push};
use haarlight::Error;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus")
}

fn judge(name: &str, bytes: &[u8], outcome: Outcome) {
    match (load(bytes), outcome) {
        (Err(Error::Input(problems)), Refused(part)) => {
            let texts: Vec<String> = problems.iter().map(ToString::to_string).collect();
            assert!(texts.iter().any(|t| t.contains(part)), "{name}: {texts:#?}");
            assert!(
                texts.iter().all(|t| t.contains("room.glb: ")),
                "{name}: {texts:#?}"
            );
            assert_eq!(Error::Input(problems).exit_code(), 2);
        }
        (Ok((_, geometry)), Warned(part)) => {
            let warnings = geometry.warnings;
            assert!(
                warnings.iter().any(|w| w.contains(part)),
                "{name}: {warnings:#?}"
            );
        }
        (Ok(_), _) => panic!("{name}: loads, wanted {outcome:?}"),
        (Err(e), _) => panic!("{name}: {e}, wanted {outcome:?}"),
    }
}

#[test]
fn every_case_comes_to_its_outcome() {
    for (name, bytes, outcome) in cases() {
        // Without the decoder the plain accessors of the same primitive are read, and they are sound.
        if cfg!(feature = "draco") || name != "draco_broken" {
            judge(name, &bytes, outcome);
        }
    }
}

fn expected(outcome: Outcome) -> String {
    match outcome {
        Refused(part) => format!("refused\t{part}"),
        Warned(part) => format!("warned\t{part}"),
    }
}

/// The committed files are those of the list, so that other tools can be pointed at them.
#[test]
fn the_corpus_is_the_list() {
    let table = std::fs::read_to_string(corpus().join("expected.tsv")).unwrap();
    let mut rows = table.lines().filter(|line| !line.starts_with('#'));
    for (name, bytes, outcome) in cases() {
        let file = std::fs::read(corpus().join(format!("{name}.glb"))).unwrap();
        assert_eq!(file, bytes, "{name}");
        assert_eq!(
            rows.next().unwrap(),
            format!("{name}.glb\t{}", expected(outcome))
        );
    }
    assert_eq!(rows.next(), None);
}

#[test]
#[ignore = "writes the files it is about"]
fn write_the_corpus() {
    let mut table = String::from("# file\toutcome\tpart of the message\n");
    for (name, bytes, outcome) in cases() {
        std::fs::write(corpus().join(format!("{name}.glb")), bytes).unwrap();
        table.push_str(&format!("{name}.glb\t{}\n", expected(outcome)));
    }
    std::fs::write(corpus().join("expected.tsv"), table).unwrap();
}

#[test]
fn all_problems_are_reported_together() {
    let mut room = Room::triangle();
    room.json["nodes"] = json!([{"children": [1, 2, 3]}, {"mesh": 0}, {"mesh": 8}, {"camera": 5}]);
    room.json["accessors"][0]["componentType"] = json!(1);
    room.json["materials"] = json!([{"alphaMode": "GLASS"}]);
    push(
        &mut room.json["buffers"],
        json!({"byteLength": 4, "uri": "none.bin"}),
    );
    let Err(Error::Input(problems)) = room.load().map(|_| ()) else {
        panic!("refused")
    };
    let texts: Vec<String> = problems.iter().map(ToString::to_string).collect();
    for part in [
        "buffer 1",
        "material 0: has the alphaMode 'GLASS'",
        "mesh 8",
        "componentType",
        "camera 5",
    ] {
        assert!(texts.iter().any(|t| t.contains(part)), "{part}: {texts:#?}");
    }
    assert_eq!(texts.len(), 5);
}

#[test]
fn ten_thousand_nested_nodes_load() {
    let (document, geometry) = load(&nested(10_000, json!({"mesh": 0}))).unwrap();
    assert_eq!(
        (
            document.source.json["nodes"].as_array().unwrap().len(),
            geometry.surfaces.len()
        ),
        (10_000, 1)
    );
}

/// A room with a bit of everything.
fn everything() -> Room {
    let mut room = Room::triangle();
    let normals = room.vectors(&[[0.0, 0.0, 1.0]; 3]);
    let coordinates = room.vectors(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    let colors = room.accessor(&[255; 12], U8, "VEC4", 3);
    let shift = room.vectors(&[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    let image = room.view(&png(2, 2, &[[9, 99, 200, 255]; 4]));
    let sparse = room.view(&[1; 16]);
    room.json["accessors"][colors]["normalized"] = json!(true);
    room.json["accessors"][coordinates]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": sparse, "componentType": U8}, "values": {"bufferView": sparse, "byteOffset": 4}});
    textured(&mut room, json!({"bufferView": image}));
    room.json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    let attributes = &mut room.primitive()["attributes"];
    attributes["NORMAL"] = json!(normals);
    attributes["TEXCOORD_0"] = json!(coordinates);
    attributes["COLOR_0"] = json!(colors);
    room.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing", "KHR_lights_punctual"]);
    room.json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {}}]}});
    room.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]);
    room.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": shift}}});
    room.json["nodes"][0]["children"] = json!([1]);
    push(
        &mut room.json["nodes"],
        json!({"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}),
    );
    if cfg!(feature = "meshopt") {
        packed_by_meshopt(&mut room);
    }
    if cfg!(feature = "draco") {
        packed_by_draco(&mut room);
    }
    room
}

#[cfg(feature = "meshopt")]
fn packed_by_meshopt(room: &mut Room) {
    let corners: Vec<[f32; 3]> = (0..40).map(|i| [i as f32, (i % 7) as f32, 0.0]).collect();
    let bytes = meshopt::encode_vertex_buffer(&corners).unwrap();
    let accessor = room.accessor(&bytes, F32, "VEC3", 40);
    let view = room.json["accessors"][accessor]["bufferView"].as_u64();
    let view = &mut room.json["bufferViews"][view.unwrap() as usize];
    let mut inner = view.clone();
    inner["byteStride"] = json!(12);
    inner["count"] = json!(40);
    inner["mode"] = json!("ATTRIBUTES");
    *view =
        json!({"buffer": 0, "byteLength": 480, "extensions": {"EXT_meshopt_compression": inner}});
    push(
        &mut room.json["meshes"][0]["primitives"],
        json!({"attributes": {"POSITION": accessor}, "mode": 5}),
    );
}

#[cfg(not(feature = "meshopt"))]
fn packed_by_meshopt(_room: &mut Room) {}

fn packed_by_draco(room: &mut Room) {
    let view = room.view(include_bytes!("../corpus/cube.drc"));
    let accessors = &mut room.json["accessors"];
    let position = push(
        accessors,
        json!({"componentType": F32, "type": "VEC3", "count": 24}),
    );
    let indices = push(
        accessors,
        json!({"componentType": U8, "type": "SCALAR", "count": 36}),
    );
    push(
        &mut room.json["meshes"][0]["primitives"],
        json!({"attributes": {"POSITION": position}, "indices": indices,
        "extensions": {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}}}),
    );
}

/// Whatever the bytes are: it loads, or it is an input problem, and what loads is sound.
fn survives(bytes: &[u8]) {
    match load(bytes) {
        Err(Error::Input(problems)) => assert!(!problems.is_empty()),
        Err(other) => panic!("{other}"),
        Ok((document, geometry)) => {
            for surface in &geometry.surfaces {
                let count = surface.positions.len();
                assert!(
                    surface
                        .triangles
                        .iter()
                        .flatten()
                        .all(|&i| (i as usize) < count)
                );
                assert!(surface.positions.iter().all(|p| p.is_finite()));
                assert!(
                    surface
                        .normals
                        .iter()
                        .flatten()
                        .all(|n| (n.length() - 1.0).abs() < 1e-3)
                );
                assert!(surface.texcoords.iter().all(|t| t.len() == count));
                let material = &document.raw_materials()[surface.material];
                if let Some(texture) = &material.base_color_texture {
                    let uv = &surface.texcoords[texture.texcoord];
                    let value = texture.average(&geometry.images, [uv[0], uv[1], uv[2]]);
                    assert!(value.iter().all(|x| x.is_finite()));
                }
            }
        }
    }
}

#[test]
fn a_room_with_everything_loads() {
    let (document, geometry) = everything().load().unwrap();
    let packed = usize::from(cfg!(feature = "meshopt")) + usize::from(cfg!(feature = "draco"));
    assert_eq!(geometry.surfaces.len(), 2 * (1 + packed));
    assert_eq!(
        (
            document.raw_lights().len(),
            geometry.cameras.len(),
            geometry.images.len()
        ),
        (1, 1, 1)
    );
    survives(&everything().glb());
}

/// The most memory this process has had, in bytes; none where the system does not say.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024)
}

/// Files of a few kilobytes; the decoders' own tables and the test harness are the rest.
const MOST_MEMORY: u64 = 512 << 20;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn flipped_bytes_are_survived(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let mut bytes = everything().glb();
        for (at, value) in flips {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        survives(&bytes);
        prop_assert!(peak_memory().is_none_or(|most| most < MOST_MEMORY));
    }

    #[test]
    fn flipped_bytes_of_the_binary_chunk_are_survived(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let mut room = everything();
        for (at, value) in flips {
            let at = at.index(room.bin.len());
            room.bin[at] = value;
        }
        survives(&room.glb());
        prop_assert!(peak_memory().is_none_or(|most| most < MOST_MEMORY));
    }

    #[test]
    fn truncated_files_are_survived(at in any::<prop::sample::Index>()) {
        let bytes = everything().glb();
        survives(&bytes[..at.index(bytes.len())]);
    }

    /// Any number of the JSON may be any other number (or no number at all).
    #[test]
    fn changed_numbers_are_survived(
        which in any::<prop::sample::Index>(),
        value in prop_oneof![
            Just(json!(-1)), Just(json!(u64::MAX)), Just(json!(1u64 << 40)), Just(json!(0)), Just(json!(1.5)),
            Just(json!("x")), Just(json!(null)), Just(json!([])), Just(json!({})), (0u64..20).prop_map(|n| json!(n)),
            (0u64..1 << 26).prop_map(|n| json!(n)),
        ],
    ) {
        let mut room = everything();
        let count = numbers(&mut room.json, &mut { usize::MAX }, &value);
        let mut target = which.index(count);
        numbers(&mut room.json, &mut target, &value);
        survives(&room.glb());
        prop_assert!(peak_memory().is_none_or(|most| most < MOST_MEMORY));
    }
}

/// Replaces number `target` (counted down in place) of a JSON value; returns how many numbers were passed.
fn numbers(json: &mut Value, target: &mut usize, value: &Value) -> usize {
    match json {
        Value::Number(_) => {
            if *target == 0 {
                *json = value.clone();
            }
            *target = target.wrapping_sub(1);
            1
        }
        Value::Array(list) => list.iter_mut().map(|v| numbers(v, target, value)).sum(),
        Value::Object(map) => map.values_mut().map(|v| numbers(v, target, value)).sum(),
        _ => 0,
    }
}
