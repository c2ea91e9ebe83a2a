//! Opens baked rooms with Bevy's own loaders and reckons on what they read as Bevy's shaders do:
//!
//!     cd tools/bevy && HAARLIGHT=../../target/release/haarlight cargo run -- ROOM.baked.glb... [-- OPTIONS OF THE BAKE]
//!
//! Nothing is drawn, so that no renderer has to be compiled (minutes as it is). What lies beside a file is read, too:
//! `ROOM.baked.maps.json` with its pages, `ROOM.baked.probes.json`. Where `ROOM.glb` and the program are there (`HAARLIGHT`),
//! light is compared with `haarlight probe`, else with the files alone. The exit code is 1 where anything differs.

mod file;
mod load;
mod maps;
mod probes;
mod vertices;

use file::Glb;
use load::Assets;
use serde_json::Value;
use std::path::Path;
use std::process::ExitCode;

/// What is found of the files of a room: each check by name, whether it holds, and its figures.
#[derive(Default)]
struct Findings {
    bad: bool,
}

impl Findings {
    fn say(&mut self, what: &str, good: bool, text: &str) {
        println!("{}: {what}: {text}", if good { "ok" } else { "BAD" });
        self.bad |= !good;
    }
}

/// Mean and greatest difference of numbers, as a share of the mean of the second.
fn apart(found: &[[f64; 3]], wanted: &[[f64; 3]]) -> (f64, f64) {
    let numbers = || wanted.iter().flatten();
    let mean = numbers().sum::<f64>() / numbers().count() as f64;
    let off = found.iter().flatten().zip(numbers());
    let off: Vec<f64> = off.map(|(a, b)| (a - b).abs() / mean).collect();
    let most = off.iter().copied().fold(0.0, f64::max);
    (off.iter().sum::<f64>() / off.len() as f64, most)
}

fn check(room: &Path, options: &[String], findings: &mut Findings) {
    let file = Glb::read(room);
    let mut assets = Assets::of(room.parent().unwrap_or(Path::new(".")));
    let beside = |ending: &str| -> Option<Value> {
        let bytes = std::fs::read(room.with_extension(ending)).ok()?;
        Some(serde_json::from_slice(&bytes).expect("an index that was written here"))
    };
    match beside("maps.json") {
        Some(index) => maps::check(&file, &index, &mut assets, options, findings),
        None => vertices::check(&file, &mut assets, findings),
    }
    if let Some(index) = beside("probes.json") {
        probes::check(&file, &index, &mut assets, options, findings);
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let end = arguments.iter().position(|a| a == "--");
    let (rooms, rest) = arguments.split_at(end.unwrap_or(arguments.len()));
    let mut findings = Findings::default();
    for room in rooms {
        println!("{room}");
        check(Path::new(room), rest.get(1..).unwrap_or(&[]), &mut findings);
    }
    ExitCode::from(u8::from(findings.bad || rooms.is_empty()))
}
