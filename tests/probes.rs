//! Light in the air: the same as `probe` finds, and what spherical harmonics of known light are.

use crate::common::built;

use built::{Room, estimate, run};
use glam::{DVec3, dvec3};
use haarlight::color::de2000;
use haarlight::gather::Air;
use haarlight::output::Exposure;
use haarlight::output::probes::{MOST_PROBES, ProbeGrid, Probes, to_volume};
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings};
use haarlight::survey::PointLocation;
use serde_json::Value;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

const SIDES: [DVec3; 6] = [
    DVec3::X,
    DVec3::NEG_X,
    DVec3::Y,
    DVec3::NEG_Y,
    DVec3::Z,
    DVec3::NEG_Z,
];

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn loaded(name: &str) -> Scene {
    Scene::load(scenes().join(name), &Options::default()).unwrap()
}

fn solved(scene: Scene, error: f64, rounds: usize) -> Bake {
    let settings = Settings {
        error,
        rounds,
        ..Settings::default()
    };
    run(scene, settings)
}

/// Grids of a room by links, one by rays and one in daylight.
#[test]
fn a_probe_is_what_probe_finds() {
    for (name, spacing, error, rounds) in [
        ("convex.glb", 1.0, 1.0, 4),
        ("furnished.glb", 1.6, 3.0, 2),
        ("daylit.glb", 1.5, 3.0, 2),
    ] {
        let bake = solved(loaded(name), error, rounds);
        let points = ProbeGrid::of(bake.scene(), spacing).unwrap().points();
        let air = bake.air(&points);
        let here = || {
            points
                .iter()
                .zip(&air)
                .filter(|(_, a)| a.place == PointLocation::Room)
        };
        assert!(here().count() >= 4, "{name}");
        // Alone, a point has the same pattern of rays.
        for (point, air) in here().take(4) {
            for (k, side) in SIDES.into_iter().enumerate() {
                assert_eq!(
                    bake.probe(&[(*point, side)])[0].xyz,
                    air.light.cube[k],
                    "{name}"
                );
            }
        }
        // In a list every point has its own; then they differ by less than what is stated for either.
        let asked: Vec<(DVec3, DVec3)> = here()
            .flat_map(|(p, _)| SIDES.map(|side| (*p, side)))
            .collect();
        let white = bake.light().white;
        let probed = bake.probe(&asked);
        let cubes = here().flat_map(|(_, a)| a.light.cube);
        let off: f64 = probed
            .iter()
            .zip(cubes)
            .map(|(p, c)| de2000(p.xyz, c, white))
            .sum();
        let stated = estimate(&bake);
        let mean = off / asked.len() as f64;
        assert!(mean <= stated, "{name}: {mean} and {stated} are stated");
    }
}

fn at(bake: &Bake, point: DVec3) -> Air {
    bake.air(&[point]).remove(0)
}

/// In a furnace all light is the constant.
#[test]
fn a_furnace_has_no_direction() {
    let bake = solved(loaded("furnace.glb"), 0.5, 4);
    let centre = bake.mesh().centre;
    for offset in [DVec3::ZERO, dvec3(0.3, -0.2, 0.1) * bake.mesh().half_size] {
        let air = at(&bake, centre + offset);
        let constant = air.light.sh[0][1];
        assert!(constant > 0.0);
        for c in &air.light.sh[1..] {
            assert!(c[1].abs() < 0.01 * constant, "{c:?} beside {constant}");
        }
        assert!(air.truncation < 0.01, "{}", air.truncation);
    }
}

/// Close below a luminous ceiling in a black room: radiance L = exitance / pi from half of all directions.
#[test]
fn a_ceiling_is_a_half_space() {
    let (mut room, exitance) = (Room::new(), 314.159);
    let black = room.paint(0.0);
    let lamp = room.lamp(0.0, exitance);
    let mut sides = [black; 6];
    sides[3] = lamp;
    room.hollow(DVec3::ZERO, dvec3(20.0, 4.0, 20.0), sides);
    let bake = solved(room.scene(), 0.5, 4);
    let air = at(&bake, dvec3(10.0, 3.95, 10.0));
    let radiance = exitance / PI;
    let slope = 0.5 * (3.0 * PI).sqrt();
    for (k, c) in air.light.sh.iter().enumerate() {
        // Half of all solid angle, but for a rim of half a degree below the horizon.
        let expected = radiance * [PI.sqrt(), slope].get(k).copied().unwrap_or(0.0);
        assert!(
            (c[1] - expected).abs() < 0.02 * radiance,
            "{k}: {} {expected}",
            c[1]
        );
    }
    assert!((air.light.cube[2][1] - exitance).abs() < 0.01 * exitance);
    assert!(air.light.cube[3][1] < 0.01 * exitance);
    assert!((air.light.cube[0][1] - 0.5 * exitance).abs() < 0.02 * exitance);
}

/// A hall with a block: probes in it are marked, and have their neighbours' light.
static HALL: LazyLock<Bake> = LazyLock::new(|| {
    let mut room = Room::new();
    let (white, lamp) = (room.paint(0.6), room.lamp(0.2, 2000.0));
    room.hollow(DVec3::ZERO, dvec3(6.0, 3.0, 4.0), [white; 6]);
    room.block(dvec3(2.0, 0.0, 1.0), dvec3(4.0, 2.0, 3.0), white);
    room.quad(
        dvec3(1.0, 2.9, 1.0),
        dvec3(1.0, 0.0, 0.0),
        dvec3(0.0, 0.0, 1.0),
        lamp,
    );
    solved(room.scene(), 2.0, 4)
});

#[test]
fn probes_in_solids_are_marked_and_lent_light() {
    let bake = &*HALL;
    let grid = ProbeGrid::within([DVec3::ZERO, dvec3(6.0, 3.0, 4.0)], 0.5).unwrap();
    assert_eq!(grid.counts, [12, 6, 8]);
    assert_eq!(grid.points()[1], dvec3(0.75, 0.25, 0.25));
    let points = grid.points();
    let air = bake.air(&points);
    for (point, air) in points.iter().zip(&air) {
        let inside =
            point.x > 2.0 && point.x < 4.0 && point.y < 2.0 && point.z > 1.0 && point.z < 3.0;
        assert_eq!(air.place == PointLocation::Inside, inside, "{point}");
    }
    let probes = unscaled(bake, &grid, air);
    assert_eq!(
        probes.places.iter().filter(|p| **p == "inside").count(),
        4 * 4 * 4
    );
    assert!(
        probes.cube.iter().all(|cube| cube[7] > 0.0),
        "a probe is dark"
    );
    assert!(
        probes.truncation.mean > 0.0 && probes.truncation.max < 0.5,
        "{:?}",
        probes.truncation
    );
    // Outside of the walls.
    let out = bake.air(&[dvec3(-1.0, 1.0, 1.0)]);
    assert_eq!(out[0].place, PointLocation::Outside);
}

/// A half float.
fn half(bytes: [u8; 2]) -> f64 {
    let bits = u16::from_le_bytes(bytes);
    let (sign, exponent, part) = (
        bits >> 15,
        i32::from(bits >> 10 & 31),
        f64::from(bits & 1023),
    );
    let size = match exponent {
        0 => part / 1024.0 * 2.0_f64.powi(-14),
        e => (1.0 + part / 1024.0) * 2.0_f64.powi(e - 15),
    };
    if sign == 1 { -size } else { size }
}

/// Texel (x, y + n, z + m) of the texture is the side that Bevy's shader looks up there: +X, -X (n = 0, Ny), with m = Nz for Y and
/// 2 Nz for Z.
#[test]
fn the_texture_has_bevys_layout() {
    let bake = &*HALL;
    let grid = ProbeGrid::within([DVec3::ZERO, dvec3(6.0, 3.0, 4.0)], 2.0).unwrap();
    let air = bake.air(&grid.points());
    let probes = unscaled(bake, &grid, air);
    let bytes = to_volume(&probes);
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let [nx, ny, nz] = probes.counts;
    assert_eq!([nx, ny, nz], [3, 2, 2]);
    // Width, height, depth; then where the level begins.
    assert_eq!([word(20), word(24), word(28)], [nx, 2 * ny, 3 * nz]);
    let (start, length) = (word(80), word(88));
    assert_eq!(
        (length, start + length),
        (8 * 6 * nx * ny * nz, bytes.len())
    );
    for k in 0..nx * ny * nz {
        let [x, y, z] = [k % nx, k / nx % ny, k / (nx * ny)];
        for side in 0..6 {
            let (axis, negative) = (side / 2, side % 2);
            let texel = x + nx * (y + negative * ny + 2 * ny * (z + axis * nz));
            for c in 0..3 {
                let at = start + 8 * texel + 2 * c;
                let got = half(bytes[at..at + 2].try_into().unwrap());
                let want = f64::from(probes.cube[k][3 * side + c]);
                assert!(
                    (got - want).abs() <= 1e-3 * want.abs(),
                    "{k} {side}: {got} {want}"
                );
            }
        }
    }
}

#[test]
fn grids_are_bounded() {
    let box_ = [DVec3::ZERO, dvec3(8.0, 4.0, 2.0)];
    let grid = ProbeGrid::within(box_, 0.13).unwrap();
    assert!(
        grid.step().max_element() <= 0.13 && grid.counts.iter().product::<usize>() <= MOST_PROBES
    );
    let problem = ProbeGrid::within(box_, 0.01).unwrap_err().to_string();
    assert!(problem.contains("800 x 400 x 200"), "{problem}");
    // A floor alone takes one layer.
    assert_eq!(
        ProbeGrid::within([DVec3::ZERO, dvec3(2.0, 0.0, 2.0)], 1.0)
            .unwrap()
            .counts,
        [2, 1, 2]
    );
    // What light reaches, not what is far away in the file.
    let bake = solved(loaded("convex.glb"), 4.0, 4);
    let grid = ProbeGrid::of(bake.scene(), 0.5).unwrap();
    let (centre, half) = (bake.mesh().centre, bake.mesh().half_size);
    assert!((grid.low + 0.5 * grid.size - centre).length() < 0.05 * half);
}

/// The command's file, read back: the irradiance of a probe is the lux that `probe` prints for the place.
#[test]
fn the_file_says_what_probe_prints() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let room = scenes().join("two-rooms.glb");
    let run = |args: &[&str]| {
        let done = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .args(args)
            .output()
            .unwrap();
        assert!(
            done.status.code().unwrap() < 2,
            "{}",
            String::from_utf8_lossy(&done.stderr)
        );
        String::from_utf8(done.stdout).unwrap()
    };
    let room = room.to_str().unwrap();
    run(&[
        "bake",
        room,
        "-o",
        &path("r.glb"),
        "--error",
        "8",
        "--probes",
        "1",
    ]);
    let json: Value =
        serde_json::from_slice(&std::fs::read(path("r.probes.json")).unwrap()).unwrap();
    assert!(folder.path().join(json["ktx2"].as_str().unwrap()).exists());
    let number = |v: &Value| v.as_f64().unwrap();
    let counts: Vec<usize> = (0..3)
        .map(|k| number(&json["counts"][k]) as usize)
        .collect();
    assert_eq!(
        json["sh"].as_array().unwrap().len(),
        counts.iter().product::<usize>()
    );
    let places = json["places"].as_array().unwrap();
    let k = places.iter().position(|p| p == "room").unwrap();
    let at = [
        k % counts[0],
        k / counts[0] % counts[1],
        k / (counts[0] * counts[1]),
    ];
    let at =
        [0, 1, 2].map(|c| number(&json["origin"][c]) + at[c] as f64 * number(&json["step"][c]));
    let line = format!("x,y,z,nx,ny,nz\n{},{},{},1,0,0\n", at[0], at[1], at[2]);
    std::fs::write(path("p.csv"), line).unwrap();
    let printed = run(&[
        "probe",
        room,
        "--points",
        &path("p.csv"),
        "--error",
        "8",
        "--json",
    ]);
    let printed: Value = serde_json::from_str(&printed).unwrap();
    let printed = number(printed["rows"][0].as_array().unwrap().last().unwrap());
    // What it prints of one side is what it would print of the others.
    let bake = solved(loaded("two-rooms.glb"), 8.0, 12);
    let found = SIDES.map(|side| bake.probe(&[(DVec3::from_array(at), side)])[0].xyz[1]);
    let near = |a: f64, b: f64| (a - b).abs() < 1e-3 * b.max(1.0);
    assert!(near(printed, found[0]), "{printed} {found:?}");
    for (side, lux) in found.into_iter().enumerate() {
        let rgb = [0, 1, 2].map(|c| number(&json["cube"][k][3 * side + c]));
        let own = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        let own = own * number(&json["lux_per_unit"]);
        assert!(near(own, lux), "{side}: {own} {lux}");
    }
}

/// Probes as they are written at an exposure of 1.
fn unscaled(bake: &Bake, grid: &ProbeGrid, air: Vec<Air>) -> Probes {
    let exposure = Exposure::new(1.0);
    Probes::new(bake.scene(), grid, air, &exposure, None, "k".into())
}
