//! Sensors: where they are, and what they read.

use super::desk::{Desk, lit, object, says, turned};
use crate::common::built::faces;
use glam::dvec3;
use serde_json::Value;

const POINTS: &str = "x,y,z,nx,ny,nz
2,0.8,2.5,0,1,0
1,0.25,1,0,1,0
2,0,2.5,0,1,0
2,0,2.5,0,-1,0
9,9,9,0,1,0
1,0.5,1,0,1,0
";

#[test]
fn points_inside_solids_and_outside_the_room_say_so() {
    let mut room = lit();
    let block = faces(dvec3(0.5, 0.0, 0.5), dvec3(1.5, 0.5, 1.5));
    object(&mut room, "Block", &turned(block), 0);
    let desk = Desk::with(&room);
    desk.put("p.csv", POINTS.as_bytes());
    let probe = ["probe", "room.glb", "--points", "p.csv", "--error", "4"];
    let (said, csv) = desk.run(&probe, 0);
    let mut lines = csv.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let (lux, y, place) = (column("lux"), column("E_Y"), column("place"));
    let rows: Vec<Vec<&str>> = lines.map(|l| l.split(',').collect()).collect();
    let places: Vec<&str> = rows.iter().map(|r| r[place]).collect();
    // In the air, in the block, on the floor, the floor's sensor upside down, far away, on the block.
    assert_eq!(
        places,
        ["room", "inside", "room", "outside", "outside", "room"]
    );
    assert!(rows.iter().all(|r| r[lux] == r[y]));
    let light: Vec<f64> = rows.iter().map(|r| r[lux].parse().unwrap()).collect();
    assert!(light[0] > 50.0 && light[1] == 0.0, "{light:?}");
    says(
        &said,
        &["1 of 6 points lie inside", "2 of 6 points lie outside"],
    );

    let (_, json) = desk.run(&[&probe[..], &["--json"]].concat(), 0);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["places"][1], "inside");
    assert_eq!(json["columns"][lux], "lux");
    assert!(json["rows"][0][lux].is_f64());
}
