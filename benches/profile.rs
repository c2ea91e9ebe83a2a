//! Where does the time of a bake go, and does it grow gently with the room? The Cornell box, the two rooms, and the
//! furnished room with 1 k to 500 k triangles, all at one error: seconds (wall, all threads) by phase, then for each
//! triangle, and what a link and an element take in memory.
//!
//! `cargo bench --bench profile [-- test | MOST]`, MOST the triangles of the largest room (500000). All of it takes about a
//! quarter of an hour.

use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

const SIZES: [usize; 5] = [1_000, 10_000, 50_000, 260_000, 500_000];
/// Colour difference asked of every room.
const ERROR: f64 = 1.0;
/// Phases of a round in order, as the log names them, and the light of the vertices.
const PHASES: [&str; 6] = [
    "links", "spectrum", "direct", "balance", "solve", "estimate",
];

/// Bakes a room and prints a line; seconds of the bake and triangles.
fn line(name: &str, path: &Path) -> Option<(f64, usize)> {
    let start = Instant::now();
    let scene = Scene::load(path, &Options::default()).expect("a room of our own");
    let read = start.elapsed().as_secs_f64();
    let settings = Settings {
        error: ERROR,
        ..Settings::default()
    };
    let mut bake = Bake::new(scene, settings);
    let built = start.elapsed().as_secs_f64();
    bake.run();
    let rounds = Instant::now();
    let baked = bake.baked(&|_, _| {});
    let gather = rounds.elapsed().as_secs_f64();
    let all = start.elapsed().as_secs_f64() - read;
    let triangles = bake.mesh().triangles.len();
    let vertices: usize = baked.surfaces.iter().map(|s| s.vertices.len()).sum();
    let phases = PHASES.map(|phase| {
        let seconds = |r: &haarlight::solve::Round| r.phases_s.get(phase)?.as_f64();
        bake.rounds().iter().filter_map(seconds).sum::<f64>()
    });
    let last = bake.rounds().last()?;
    println!(
        "{name:<14} {triangles:>9} {vertices:>9} {:>7} {:>6.2} {:>8.2} {} {gather:>8.2} {all:>8.2} {:>8.1} {:>6.0} {:>6.0}",
        bake.rounds().len(),
        last.error.total_de2000.value.unwrap_or(f64::NAN),
        built - read,
        phases.map(|s| format!("{s:>8.2}")).join(" "),
        1e6 * all / triangles as f64,
        last.bytes_per_link,
        last.bytes_per_element,
    );
    Some((all, triangles))
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let short = arguments.iter().any(|a| a == "--test" || a == "test");
    let most = arguments.iter().find_map(|a| a.parse().ok());
    let most = if short {
        1_000
    } else {
        most.unwrap_or(500_000)
    };
    println!(
        "room           triangles  vertices  rounds   dE00   built  {} vertices      all us/tri. B/link B/elem.",
        PHASES.map(|p| format!("{p:>8}")).join(" ")
    );
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    for name in ["cornell", "two-rooms"] {
        line(name, &scenes.join(format!("{name}.glb")));
    }
    let folder = tempfile::tempdir().expect("a folder");
    let mut each = Vec::new();
    for size in SIZES.into_iter().filter(|&s| s <= most) {
        let made = Command::new(env!("CARGO"))
            .args(["run", "--release", "--quiet", "--example", "rooms", "--"])
            .arg(folder.path())
            .args(["--only", "furnished", "--triangles", &size.to_string()])
            .output()
            .expect("the generator of rooms");
        assert!(made.status.success(), "{made:?}");
        let path: PathBuf = folder.path().join("furnished.glb");
        each.extend(line("furnished", &path));
    }
    let per = |(seconds, triangles): (f64, usize)| seconds / triangles as f64;
    let least = each.iter().map(|&e| per(e)).fold(f64::INFINITY, f64::min);
    if let (Some(&first), Some(&last)) = (each.first(), each.last()) {
        println!(
            "time a triangle: the largest room {:.2} times the smallest, {:.2} times the best",
            per(last) / per(first),
            per(last) / least
        );
    }
}
