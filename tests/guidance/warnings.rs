//! Warnings are not lost when nobody listens, and nobody listening is no fault.

use super::desk::{Desk, lit, says};
use serde_json::{Value, json};
use std::io::Read;
use std::process::Stdio;

#[test]
fn warnings_are_logged_and_counted_when_quiet() {
    let mut room = lit();
    // Two warnings: a metal, and an extension that is not read.
    room.json["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = json!(1.0);
    room.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength", "ACME_shine"]);
    let desk = Desk::with(&room);
    says(&desk.bake(&[]), &["metallic", "ACME_shine", "2 warnings"]);

    let args = [
        "bake",
        "room.glb",
        "--error",
        "4",
        "-q",
        "--log",
        "log.jsonl",
        "--json",
    ];
    let (said, printed) = desk.run(&args, 0);
    assert_eq!(said, "");
    let records = desk.records("log.jsonl");
    let plan = records[0]["warnings"].to_string();
    says(&plan, &["metallic", "ACME_shine"]);
    let verdict: Value = serde_json::from_str(&printed).unwrap();
    for record in [&verdict, records.last().unwrap()] {
        assert_eq!(record["warning_count"], 2);
    }
}

/// Runs the program with one stream that is closed at once, and the other read; its exit code.
fn closed(desk: &Desk, args: &[&str], stdout: bool) -> Option<i32> {
    let mut command = desk.command(args);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut rest = Vec::new();
    if stdout {
        drop(child.stdout.take());
        child.stderr.take().unwrap().read_to_end(&mut rest).unwrap();
    } else {
        drop(child.stderr.take());
        child.stdout.take().unwrap().read_to_end(&mut rest).unwrap();
    }
    let said = String::from_utf8_lossy(&rest).into_owned();
    assert!(!said.contains("pipe") && !said.contains("fault"), "{said}");
    child.wait().unwrap().code()
}

#[test]
fn broken_pipes_end_quietly() {
    let desk = Desk::with(&lit());
    desk.put("p.csv", b"x,y,z,nx,ny,nz\n2,1,2,0,1,0\n");
    let probe = ["probe", "room.glb", "--points", "p.csv", "--error", "4"];
    let bake = ["bake", "room.glb", "--error", "4", "--json"];
    for args in [
        &["inspect", "room.glb"][..],
        &["inspect", "room.glb", "--json"],
        &["spectra"],
        &["--help"],
        &probe,
        &bake,
    ] {
        assert_eq!(closed(&desk, args, true), Some(0), "{args:?}");
    }
    // Nobody reads what is said: the work is done all the same, and a fault keeps its code.
    assert_eq!(closed(&desk, &bake, false), Some(0));
    assert!(desk.at("room.baked.glb").exists());
    assert_eq!(closed(&desk, &["bake", "none.glb"], false), Some(2));
}
