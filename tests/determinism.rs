//! The same bytes at any number of threads, across runs, and with or without progress.

use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use serde_json::Value;
use std::path::Path;

/// All that a bake hands out: the log without times, the light at every vertex to the last bit, probes.
fn everything(room: &str, threads: usize, talk: bool) -> (Vec<String>, Vec<u8>) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("scenes")
            .join(room);
        let scene = Scene::load(path, &Options::default()).unwrap();
        let settings = Settings {
            rounds: 2,
            error: 5.0,
            ..Settings::default()
        };
        let mut bake = Bake::new(scene, settings);
        let mut log = Vec::new();
        for _ in 0..2 {
            log.push(without_times(serde_json::to_value(bake.step()).unwrap()));
        }
        let told = std::sync::atomic::AtomicUsize::new(0);
        let baked = bake.baked(&|done, _| {
            if talk {
                told.fetch_add(done, std::sync::atomic::Ordering::Relaxed);
            }
        });
        let mut bytes = Vec::new();
        for surface in &baked.surfaces {
            for t in &surface.triangles {
                bytes.extend(t.iter().flat_map(|v| v.to_le_bytes()));
            }
            for v in &surface.vertices {
                bytes.extend(v.triangle.to_le_bytes());
                bytes.extend(v.weights.iter().flat_map(|w| w.to_le_bytes()));
                bytes.extend(
                    [v.irradiance, v.radiosity, v.light]
                        .iter()
                        .flatten()
                        .flat_map(|x| x.to_le_bytes()),
                );
            }
        }
        bytes.extend(
            baked
                .irradiance
                .iter()
                .flatten()
                .flatten()
                .flat_map(|x| x.to_le_bytes()),
        );
        for (corners, normal) in bake
            .mesh()
            .faces
            .iter()
            .map(|f| (bake.mesh().corners(*f), bake.mesh().face_normal(*f)))
        {
            let at = (corners[0] + corners[1] + corners[2]) / 3.0 + bake.mesh().centre;
            for probed in bake.probe(&[(at, normal)]) {
                bytes.extend(probed.spectrum.iter().flat_map(|x| x.to_le_bytes()));
            }
        }
        (log, bytes)
    })
}

/// A log line without what a clock wrote.
fn without_times(mut line: Value) -> String {
    let fields = line.as_object_mut().unwrap();
    let timed: Vec<String> = fields
        .keys()
        .filter(|k| k.ends_with("_s"))
        .cloned()
        .collect();
    assert!(timed.len() >= 3, "{timed:?}");
    for key in timed {
        fields.remove(&key);
    }
    line.to_string()
}

#[test]
fn one_two_and_eight_threads_give_the_same_bytes() {
    for room in ["cornell.glb", "two-rooms.glb"] {
        let (log, bytes) = everything(room, 1, false);
        assert!(bytes.len() > 10_000);
        for threads in [2, 8] {
            let other = everything(room, threads, false);
            assert_eq!(log, other.0, "{room}, {threads} threads");
            assert!(bytes == other.1, "{room}, {threads} threads: light differs");
        }
    }
}

#[test]
fn two_runs_give_the_same_bytes_with_progress_or_without() {
    let one = everything("cornell-f2.glb", 2, false);
    let two = everything("cornell-f2.glb", 2, true);
    assert_eq!(one.0, two.0);
    assert!(one.1 == two.1);
}

/// The seed is taken: another one gives other patterns, and nearly the same light.
#[test]
fn another_seed_gives_another_pattern() {
    let run = |seed: u64| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.glb");
        let scene = Scene::load(path, &Options::default()).unwrap();
        let mut bake = Bake::new(
            scene,
            Settings {
                seed,
                ..Settings::default()
            },
        );
        bake.run();
        bake.mean_irradiance()
    };
    let (a, b) = (run(1), run(2));
    assert_ne!(a, b);
    assert!((a[1] / b[1] - 1.0).abs() < 0.02, "{a:?} {b:?}");
}

/// What the program writes for a room: the baked room, its arrays, its pictures, and its log without what a clock wrote.
fn by_the_program(room: &str, options: &[&str]) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let source = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(room);
    let mut arguments = vec!["bake", source.to_str().unwrap()];
    arguments.extend([
        "-o",
        "out.glb",
        "--error",
        "4",
        // Pictures may take a tenth of that, however busy the machine is.
        "--time",
        "10000",
        "--npz",
        "out.npz",
        "--log",
        "log.jsonl",
        "--snapshots",
        "pictures",
        "--audit",
        "5",
    ]);
    arguments.extend(options);
    let out = std::process::Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .args(&arguments)
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{arguments:?}: {said}");
    assert_eq!(options.contains(&"-q"), said.is_empty(), "{said}");
    let mut files: Vec<_> = ["out.glb", "out.npz"]
        .iter()
        .map(|name| folder.path().join(name))
        .collect();
    let pictures = std::fs::read_dir(folder.path().join("pictures")).unwrap();
    files.extend(pictures.map(|e| e.unwrap().path()));
    files.sort();
    assert!(files.len() > 4, "{files:?}");
    let mut all: Vec<Vec<u8>> = files.iter().map(|f| std::fs::read(f).unwrap()).collect();
    let log = std::fs::read_to_string(folder.path().join("log.jsonl")).unwrap();
    all.extend(log.lines().map(|line| {
        let mut record: Value = serde_json::from_str(line).unwrap();
        untimed(&mut record);
        record.to_string().into_bytes()
    }));
    all
}

/// Removes what depends on the clock, and the number of threads.
fn untimed(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            fields.retain(|name, _| {
                !name.ends_with("_s")
                    && !name.ends_with("_per_s")
                    && name != "seconds"
                    && name != "threads"
            });
            fields.values_mut().for_each(untimed);
        }
        Value::Array(list) => list.iter_mut().for_each(untimed),
        _ => {}
    }
}

/// Through the program: 1, 2 and 8 threads, a second run, with and without progress on the terminal.
#[test]
fn the_program_writes_the_same_bytes() {
    let one = by_the_program("cornell.glb", &["--threads", "1"]);
    for options in [
        &["--threads", "2"][..],
        &["--threads", "8"],
        &["--threads", "1", "-q"],
    ] {
        let other = by_the_program("cornell.glb", options);
        assert_eq!(one.len(), other.len(), "{options:?}");
        for (k, (a, b)) in one.iter().zip(&other).enumerate() {
            assert!(a == b, "{options:?}: file or line {k} differs");
        }
    }
}
