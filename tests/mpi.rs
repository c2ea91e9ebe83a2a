//! Bakes over ranks of MPI: the same file for any number of them, a checkpoint for another number, an end for all when one dies.
//!
//! `cargo test --release --features mpi --test mpi`; without the feature nothing is compiled, and where there is no Open MPI each test says that it was
//! left out.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The machine may have fewer cores than there are ranks.
fn mpirun(ranks: usize) -> Option<Command> {
    let mut command = launcher(ranks)?;
    command.arg(env!("CARGO_BIN_EXE_haarlight"));
    Some(command)
}

/// The same before the program is named.
fn launcher(ranks: usize) -> Option<Command> {
    let found = Command::new("mpirun").arg("--version").output();
    if !found.is_ok_and(|out| String::from_utf8_lossy(&out.stdout).contains("Open MPI")) {
        eprintln!("SKIPPED: bakes over ranks (no Open MPI)");
        return None;
    }
    let mut command = Command::new("mpirun");
    command
        .args(["--oversubscribe", "--allow-run-as-root"])
        .args(["--bind-to", "none", "-n"])
        .arg(ranks.to_string());
    Some(command)
}

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name)
}

fn bake(command: &mut Command, room: &str, output: &Path, more: &[&str]) -> Output {
    command
        .args(["bake", "--threads", "1", "--error", "2"])
        .arg(scene(room))
        .arg("-o")
        .arg(output)
        .args(more)
        .output()
        .unwrap()
}

/// Succeeded, or stopped before the error was reached.
fn ended_well(out: &Output) {
    let text = String::from_utf8_lossy(&out.stderr);
    assert!(matches!(out.status.code(), Some(0 | 1)), "{text}");
}

fn rounds(log: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(log).unwrap();
    let records = text.lines().map(|line| serde_json::from_str(line).unwrap());
    records.filter(|r: &Value| r["record"] == "round").collect()
}

/// A large room by rays, one with panes, one by links, one with a sky and light in maps.
#[test]
fn the_file_is_the_same_for_any_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let all = &[1, 2, 4, 7][..];
    for (room, ranks, more) in [
        ("furnished.glb", all, &[][..]),
        ("cornell.glb", all, &[]),
        ("glazed.glb", &[2], &["--vertices", "2000"]),
        (
            "daylit.glb",
            &[3],
            &["--light", "maps", "--texels", "20000"],
        ),
    ] {
        let alone = folder.path().join(format!("alone-{room}"));
        ended_well(&bake(
            &mut Command::new(env!("CARGO_BIN_EXE_haarlight")),
            room,
            &alone,
            more,
        ));
        let expected = std::fs::read(&alone).unwrap();
        for &ranks in ranks {
            let Some(mut command) = mpirun(ranks) else {
                return;
            };
            let output = folder.path().join(format!("{ranks}-{room}"));
            let out = bake(&mut command, room, &output, more);
            ended_well(&out);
            let same = std::fs::read(&output).unwrap() == expected;
            assert!(same, "{room}: {ranks} ranks");
            // One of them speaks.
            let text = String::from_utf8_lossy(&out.stderr);
            assert_eq!(text.matches("round 1:").count(), 1, "{text}");
        }
    }
}

/// Rows are shared out: what the first rank holds of them is half of all.
#[test]
fn memory_for_rows_falls_with_the_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = Vec::new();
    for ranks in [1, 2, 4] {
        let Some(mut command) = mpirun(ranks) else {
            return;
        };
        let log = folder.path().join(format!("{ranks}.jsonl"));
        let more = ["--log", log.to_str().unwrap()];
        let output = folder.path().join("out.glb");
        ended_well(&bake(&mut command, "furnished.glb", &output, &more));
        bytes.push(rounds(&log).last().unwrap()["row_bytes"].as_f64().unwrap());
    }
    for (k, ranks) in [(1, 2.0), (2, 4.0)] {
        let share = bytes[0] / bytes[k] / ranks;
        assert!((0.9..1.1).contains(&share), "{bytes:?}");
    }
}

/// Stopped after rounds on three ranks, a bake goes on with two, or alone, to the bytes of one that was never stopped.
#[test]
fn a_checkpoint_goes_on_with_another_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let Some(mut three) = mpirun(3) else {
        return;
    };
    let state = path("state");
    let kept = ["--checkpoint", state.to_str().unwrap()];
    // Out of time after the first round.
    let more = [kept[0], kept[1], "--time", "0.001"];
    let out = bake(&mut three, "furnished.glb", &path("cut-short.glb"), &more);
    assert_eq!(out.status.code(), Some(1));
    let stopped = std::fs::read(&state).unwrap();
    let mut whole = Command::new(env!("CARGO_BIN_EXE_haarlight"));
    ended_well(&bake(&mut whole, "furnished.glb", &path("whole.glb"), &[]));
    let expected = std::fs::read(path("whole.glb")).unwrap();
    for ranks in [1, 2] {
        std::fs::write(&state, &stopped).unwrap();
        let Some(mut command) = mpirun(ranks) else {
            return;
        };
        let out = bake(&mut command, "furnished.glb", &path("resumed.glb"), &kept);
        ended_well(&out);
        assert!(String::from_utf8_lossy(&out.stderr).contains("going on after round 1"));
        let resumed = std::fs::read(path("resumed.glb")).unwrap();
        assert!(resumed == expected, "{ranks} ranks");
    }
}

/// The children of a process that run this program.
fn ranks_of(parent: u32) -> Vec<u32> {
    let threads = std::fs::read_dir(format!("/proc/{parent}/task"));
    let lists = (threads.into_iter().flatten().flatten())
        .filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
    let ids = lists.flat_map(|list| {
        let ids = list.split_whitespace().filter_map(|id| id.parse().ok());
        ids.collect::<Vec<u32>>()
    });
    ids.filter(|id| {
        let name = std::fs::read_to_string(format!("/proc/{id}/comm"));
        name.is_ok_and(|name| name.trim() == "haarlight")
    })
    .collect()
}

/// A rank is killed in the middle of a bake: mpirun says so and ends, and the old file is still there, whole.
#[test]
fn a_rank_that_dies_ends_the_job_and_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.glb");
    std::fs::write(&output, b"old").unwrap();
    let Some(mut command) = mpirun(2) else {
        return;
    };
    let job = command
        .args(["bake", "--threads", "1", "--error", "0.05"])
        .arg(scene("furnished.glb"))
        .arg("-o")
        .arg(&output)
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let started = Instant::now();
    let ranks = loop {
        let ranks = ranks_of(job.id());
        if ranks.len() == 2 && started.elapsed() > Duration::from_secs(3) {
            break ranks;
        }
        assert!(started.elapsed() < Duration::from_secs(60), "{ranks:?}");
        std::thread::sleep(Duration::from_millis(50));
    };
    let killed = Command::new("kill")
        .args(["-KILL", &ranks[1].to_string()])
        .status();
    assert!(killed.unwrap().success());
    let out = job.wait_with_output().unwrap();
    assert!(!matches!(out.status.code(), Some(0 | 1)));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    let said = text + &String::from_utf8_lossy(&out.stdout);
    assert!(said.contains("signal 9"), "{said}");
    assert_eq!(std::fs::read(&output).unwrap(), b"old");
}

/// What is wrong with the room is said once, and the job has its exit code; so does a file that only the first rank cannot write.
#[test]
fn a_fault_is_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut command) = mpirun(3) else {
        return;
    };
    let out = bake(
        &mut command,
        "no-such-room.glb",
        &folder.path().join("a.glb"),
        &[],
    );
    let text = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(2), "{text}");
    assert_eq!(
        text.matches("name a file that can be read").count(),
        1,
        "{text}"
    );

    let Some(mut command) = mpirun(2) else {
        return;
    };
    let log = folder.path().join("missing").join("log.jsonl");
    let more = ["--log", log.to_str().unwrap()];
    let out = bake(
        &mut command,
        "convex.glb",
        &folder.path().join("b.glb"),
        &more,
    );
    let text = String::from_utf8_lossy(&out.stderr);
    assert!(matches!(out.status.code(), Some(2 | 3)), "{text}");
    assert_eq!(text.matches("haarlight: ").count(), 1, "{text}");
    assert!(!folder.path().join("b.glb").exists());
}

/// `srun --mpi=pmix` does not say how many ranks there are before MPI is started.
#[test]
fn a_launcher_need_not_tell_the_size() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut command) = launcher(2) else {
        return;
    };
    command
        .args(["env", "-u", "OMPI_COMM_WORLD_SIZE"])
        .arg(env!("CARGO_BIN_EXE_haarlight"));
    let out = bake(
        &mut command,
        "convex.glb",
        &folder.path().join("a.glb"),
        &[],
    );
    ended_well(&out);
    let text = String::from_utf8_lossy(&out.stderr);
    assert_eq!(text.matches("round 1:").count(), 1, "{text}");
}

/// Commands that one rank does by itself say so.
#[test]
fn other_commands_are_refused() {
    let Some(mut command) = mpirun(2) else {
        return;
    };
    let out = command
        .arg("inspect")
        .arg(scene("convex.glb"))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(2), "{text}");
    assert!(text.contains("start it without mpirun"), "{text}");
}

/// The many-rooms recipe of the README: a job a room, exit codes and a log each, with GNU parallel.
#[test]
fn many_rooms_by_gnu_parallel() {
    let folder = tempfile::tempdir().unwrap();
    let found = Command::new("parallel").arg("--version").output();
    if !found.is_ok_and(|out| String::from_utf8_lossy(&out.stdout).contains("GNU parallel")) {
        eprintln!("SKIPPED: many rooms (no GNU parallel)");
        return;
    }
    for room in ["convex.glb", "furnace.glb"] {
        std::fs::copy(scene(room), folder.path().join(room)).unwrap();
    }
    std::fs::write(folder.path().join("broken.glb"), b"no room").unwrap();
    let out = Command::new("parallel")
        .current_dir(folder.path())
        .args(["--jobs", "2", "--joblog", "jobs.tsv"])
        .arg(format!(
            "{} bake {{}} --error 2 --threads 1 --log {{.}}.jsonl 2> {{.}}.log",
            env!("CARGO_BIN_EXE_haarlight")
        ))
        .args([":::", "convex.glb", "furnace.glb", "broken.glb"])
        .output()
        .unwrap();
    // As many as failed.
    assert_eq!(
        out.status.code(),
        Some(1),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let jobs = std::fs::read_to_string(folder.path().join("jobs.tsv")).unwrap();
    let mut codes: Vec<(String, String)> = (jobs.lines().skip(1))
        .map(|line| {
            let fields: Vec<&str> = line.split('\t').collect();
            let room = fields[8].split(' ').nth(2).unwrap();
            (room.to_owned(), fields[6].to_owned())
        })
        .collect();
    codes.sort();
    let expected = [
        ("broken.glb", "2"),
        ("convex.glb", "0"),
        ("furnace.glb", "0"),
    ];
    assert_eq!(codes, expected.map(|(a, b)| (a.to_owned(), b.to_owned())));
    for room in ["convex", "furnace"] {
        assert!(folder.path().join(format!("{room}.baked.glb")).exists());
        assert!(!rounds(&folder.path().join(format!("{room}.jsonl"))).is_empty());
    }
    let told = std::fs::read_to_string(folder.path().join("broken.log")).unwrap();
    assert!(told.contains("broken.glb"), "{told}");
}
