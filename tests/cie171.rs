//! CIE 171:2006, cases 5.2 to 5.8, as rooms of our own: 0.5 % a point and 0.2 % on means, with default settings but for the
//! points of 5.8.
//!
//! Figures of 5.2 to 5.7 are recomputed from the closed forms; 5.7 is the corrected Table 19 (the printed one is known to be
//! wrong). A point (x, y, z) of the report, z up, stands at (x, z, -y) in the rooms.

use crate::common::built;

use built::Room;
use glam::{DVec3, dvec3};
use haarlight::scene::{Options, Scene};
use haarlight::solve::reference::{Reference, ReferenceSolution};
use haarlight::solve::{Bake, Representation, Settings};
use haarlight::spectrum::BANDS;
use nalgebra::DVector;
use std::path::Path;
use std::sync::LazyLock;

/// Greatest error of a point and of a mean.
const POINT: f64 = 5e-3;
const MEAN: f64 = 2e-3;

fn bake(case: &str) -> Bake {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(format!("cie171-{case}.glb"));
    let mut bake = Bake::new(
        Scene::load(path, &Options::default()).unwrap(),
        Settings::default(),
    );
    bake.run();
    bake
}

fn cie(x: f64, y: f64, z: f64) -> DVec3 {
    dvec3(x, z, -y)
}

/// Asserts lux at points of the report that look along `normal` of the report.
fn check(bake: &Bake, normal: DVec3, want: &[([f64; 3], f64)]) {
    let normal = cie(normal.x, normal.y, normal.z);
    let points: Vec<_> = want
        .iter()
        .map(|(p, _)| (cie(p[0], p[1], p[2]), normal))
        .collect();
    for (probed, (p, want)) in bake.probe(&points).iter().zip(want) {
        let got = probed.xyz[1];
        println!(
            "{p:?}: {got:.4} for {want:.4} ({:+.3} %)",
            100.0 * (got / want - 1.0)
        );
        assert!(
            (got - want).abs() <= POINT * want,
            "{p:?}: {got} should be {want}"
        );
    }
}

fn mean_is(got: f64, want: f64) {
    assert!(
        (got / want - 1.0).abs() <= MEAN,
        "{got} should be {want}, off by {:e}",
        got / want - 1.0
    );
}

const PLACES: [(f64, f64); 10] = [
    (0.0, 0.0),
    (0.5, 0.0),
    (1.0, 0.0),
    (1.5, 0.0),
    (0.5, 0.5),
    (1.0, 0.5),
    (1.5, 0.5),
    (1.0, 1.0),
    (1.5, 1.0),
    (1.5, 1.5),
];

fn on_floor(lux: [f64; 10]) -> Vec<([f64; 3], f64)> {
    PLACES
        .iter()
        .zip(lux)
        .map(|(&(x, y), e)| ([x, y, 0.0], e))
        .collect()
}

/// Points that look along a normal of the report, and their lux.
type Rows = (DVec3, Vec<([f64; 3], f64)>);

/// What the report asks of a case, in full.
fn rows(case: &str) -> Vec<Rows> {
    // Along the middle of the wall y = 0 by height, along the middle of floor or ceiling by depth.
    let wall = |scale: f64, rows: &[(f64, f64)]| -> Rows {
        let at = rows.iter().map(|&(z, e)| ([2.0, 0.0, z], scale * e));
        (DVec3::Y, at.collect())
    };
    let level = |z: f64, scale: f64, rows: &[(f64, f64)]| -> Rows {
        let at = rows.iter().map(|&(y, e)| ([2.0, y, z], scale * e));
        (if z > 0.0 { DVec3::NEG_Z } else { DVec3::Z }, at.collect())
    };
    match case {
        // E = I0 h^2 / d^4.
        "5.2" => {
            let lux = [
                111.111, 105.186, 90.000, 71.111, 99.723, 85.663, 68.053, 74.380, 59.975, 49.383,
            ];
            vec![(DVec3::Z, on_floor(lux))]
        }
        // E = I h / d^3.
        "5.2-isotropic" => {
            let lux = [
                88.419, 84.859, 75.494, 63.268, 81.532, 72.749, 61.216, 65.437, 55.681, 48.129,
            ];
            vec![(DVec3::Z, on_floor(lux))]
        }
        "5.3" => {
            let half = [
                (0.25, 61.424),
                (0.75, 79.255),
                (1.25, 95.667),
                (1.75, 105.778),
            ];
            let mirrored = half.map(|(y, e)| (4.0 - y, e));
            let heights = [
                (2.75, 32.677),
                (2.25, 75.194),
                (1.75, 81.323),
                (1.25, 69.061),
                (0.75, 53.404),
                (0.25, 40.002),
            ];
            vec![
                wall(1.0, &heights),
                level(0.0, 1.0, &half),
                level(0.0, 1.0, &mirrored),
            ]
        }
        "5.6" => {
            let heights = [
                (0.75, 35.901),
                (1.25, 27.992),
                (1.75, 21.639),
                (2.25, 16.716),
                (2.75, 12.967),
            ];
            let depths = [
                (0.25, 26.795),
                (0.75, 30.939),
                (1.25, 33.976),
                (1.75, 35.567),
            ];
            vec![wall(10.0, &heights), level(3.0, 10.0, &depths)]
        }
        "5.7" => {
            let heights = [
                (2.75, 16.071),
                (2.25, 16.330),
                (1.75, 15.399),
                (1.25, 13.322),
                (0.75, 10.317),
                (0.25, 7.079),
            ];
            let depths = [
                (0.25, 3.382),
                (0.75, 3.629),
                (1.25, 3.013),
                (1.75, 0.0),
                (2.25, 0.0),
            ];
            vec![wall(10.0, &heights), level(0.0, 10.0, &depths)]
        }
        _ => unreachable!("{case}"),
    }
}

/// Points of a case by the library.
fn points_of(case: &str) -> Bake {
    let bake = bake(case);
    for (normal, rows) in rows(case) {
        check(&bake, normal, &rows);
    }
    bake
}

#[test]
fn case_5_2_lambertian_source() {
    points_of("5.2");
}

#[test]
fn case_5_2_isotropic_source() {
    points_of("5.2-isotropic");
}

#[test]
fn case_5_3_area_source() {
    let bake = points_of("5.3");
    // 1000 pi lm leave the source.
    let absorbed = bake.rounds().last().unwrap().flux.absorbed_lm;
    mean_is(absorbed, 1000.0 * std::f64::consts::PI);
}

#[test]
fn case_5_4_flux_is_conserved() {
    let bake = bake("5.4");
    mean_is(bake.mean_irradiance()[1] * 80.0, 10_000.0);
}

#[test]
fn case_5_6_lit_floor() {
    let bake = points_of("5.6");
    mean_is(bake.rounds().last().unwrap().flux.absorbed_lm, 16_000.0);
}

#[test]
fn case_5_7_lit_wall_behind_a_box() {
    let bake = points_of("5.7");
    mean_is(bake.rounds().last().unwrap().flux.absorbed_lm, 12_000.0);
}

/// Runs the program; what it prints.
fn command(arguments: &[&str]) -> String {
    let out = std::process::Command::new(env!("CARGO_BIN_EXE_haarlight"))
        .args(arguments)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{arguments:?}: {said}");
    String::from_utf8(out.stdout).unwrap()
}

/// Path of a case's room.
fn room_of(case: &str) -> String {
    format!("{}/scenes/cie171-{case}.glb", env!("CARGO_MANIFEST_DIR"))
}

/// Lux at points of the rooms by `haarlight probe`.
fn probed(case: &str, points: &[(DVec3, DVec3)], options: &[&str]) -> Vec<f64> {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("points.csv");
    let mut text = String::from("x,y,z,nx,ny,nz\n");
    for (p, n) in points {
        text += &format!("{},{},{},{},{},{}\n", p.x, p.y, p.z, n.x, n.y, n.z);
    }
    std::fs::write(&csv, text).unwrap();
    let room = room_of(case);
    let mut arguments = vec!["probe", &room, "--points", csv.to_str().unwrap()];
    arguments.extend(options);
    let text = command(&arguments);
    let mut lines = text.lines();
    let mut names = lines.next().unwrap().split(',');
    let column = names.position(|name| name == "E_Y").unwrap();
    let lux: Vec<f64> = lines
        .map(|line| line.split(',').nth(column).unwrap().parse().unwrap())
        .collect();
    assert_eq!(lux.len(), points.len(), "{text}");
    lux
}

/// Every point of every case by the program.
#[test]
fn points_by_the_command() {
    for case in ["5.2", "5.2-isotropic", "5.3", "5.6", "5.7"] {
        let mut points = Vec::new();
        let mut want = Vec::new();
        for (normal, rows) in rows(case) {
            let normal = cie(normal.x, normal.y, normal.z);
            points.extend(rows.iter().map(|(p, _)| (cie(p[0], p[1], p[2]), normal)));
            want.extend(rows.iter().map(|(_, e)| *e));
        }
        for ((got, want), (p, _)) in probed(case, &points, &[]).iter().zip(&want).zip(&points) {
            assert!(
                (got - want).abs() <= POINT * want,
                "{case} {p}: {got} {want}"
            );
        }
    }
}

/// 5.4 and 5.8 by the program: the mean by the flux that its log tells of, 5.8 at points by `probe`.
#[test]
fn means_by_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (case, area, rho, mean) in [
        ("5.4", 80.0, 0.0, 125.0),
        ("5.8", 96.0, 0.5, 208.333),
        ("5.8-90", 96.0, 0.9, 1041.667),
    ] {
        let (log, out) = (path("log.jsonl"), path("out.glb"));
        command(&["bake", &room_of(case), "-o", &out, "--log", &log]);
        let text = std::fs::read_to_string(log).unwrap();
        let rounds = text.lines().filter(|line| line.contains("\"round\""));
        let last: serde_json::Value = rounds
            .map(|line| serde_json::from_str(line).unwrap())
            .rfind(|record: &serde_json::Value| record["record"] == "round")
            .unwrap();
        let absorbed = last["flux"]["absorbed_lm"].as_f64().unwrap();
        mean_is(absorbed / area / (1.0 - rho), mean);
    }
    let size = TRUTH.scene.spectra[0].power[30];
    for (case, rho) in [("5.8", 0.5), ("5.8-90", 0.9)] {
        // The rooms stand like the report's: its y is their -z.
        let points: Vec<(DVec3, DVec3)> = floor_points()
            .iter()
            .map(|(p, n)| (dvec3(p.x, p.y, -p.z), *n))
            .take(4)
            .collect();
        let got = probed(case, &points, &["--error", "0.05"]);
        for (got, want) in got.iter().zip(TRUTH.at(rho)) {
            let want = want[30] / size;
            assert!((got / want - 1.0).abs() < POINT, "{case}: {got} {want}");
        }
    }
}

/// A cube of 4 m, an isotropic source of 10 000 lm in its middle.
fn cube(paint: impl Fn(&mut Room) -> usize) -> Scene {
    let mut room = Room::new();
    let wall = paint(&mut room);
    room.hollow(DVec3::ZERO, DVec3::splat(4.0), [wall; 6]);
    room.point(DVec3::splat(2.0), 10_000.0);
    room.scene()
}

/// Area mean of the total illuminance, Phi / (96 (1 - rho)), and single points.
#[test]
fn case_5_8_for_all_albedos() {
    for rho in [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95] {
        let bake = built::baked(cube(|room| room.paint(rho)));
        let mean = bake.mean_irradiance()[1];
        println!(
            "rho {rho}: {:+.4} %",
            100.0 * (mean * (1.0 - rho) * 96.0 / 10_000.0 - 1.0)
        );
        mean_is(mean, 10_000.0 / 96.0 / (1.0 - rho));
        if [0.05, 0.3, 0.5, 0.8, 0.9, 0.95].contains(&rho) {
            let at = TRUTH.at(rho);
            let worst = worst_of_case_5_8(&bake, &[30], |_| at.clone());
            println!("rho {rho}: worst point {:+.3} %", 100.0 * worst);
            assert!(worst.abs() < POINT, "rho {rho}: {worst:e}");
        }
    }
}

#[test]
fn case_5_8_of_the_committed_rooms() {
    for (case, mean) in [("5.8", 208.333), ("5.8-90", 1041.667)] {
        mean_is(bake(case).mean_irradiance()[1], mean);
    }
}

/// Without reflection only the direct part is left: I / r^2 and I h / d^3.
#[test]
fn case_5_8_direct_part() {
    let mut bake = Bake::new(cube(|room| room.paint(0.0)), Settings::default());
    bake.run();
    let seen = bake.probe(&[
        (dvec3(2.0, 0.0, 2.0), DVec3::Y),
        (dvec3(0.0, 0.0, 0.0), DVec3::Y),
    ]);
    for (probed, want) in seen.iter().zip([198.944, 38.287]) {
        assert!(
            (probed.xyz[1] / want - 1.0).abs() < 1e-4,
            "{:?}",
            probed.xyz
        );
    }
}

/// Points of the floor: the middle, on the way to a corner, near an edge, anywhere, and 0.3 m from two walls, where each sees
/// the other at its brightest gradient.
fn floor_points() -> Vec<(DVec3, DVec3)> {
    [(2.0, 2.0), (1.0, 1.0), (0.5, 2.0), (3.6, 2.9), (0.3, 0.3)]
        .iter()
        .map(|&(x, z)| (dvec3(x, 0.0, z), DVec3::Y))
        .collect()
}

/// The report's E_ind is a mean; points have no closed form but their direct part. The plain reference stands in, with the
/// error of its patches, which falls with the square of their size, taken out (Richardson 1911).
struct TruthOfCase58 {
    scene: Scene,
    references: [Reference; 2],
}

static TRUTH: LazyLock<TruthOfCase58> = LazyLock::new(|| {
    let scene = cube(|room| room.paint(0.5));
    let references = [3, 4].map(|depth| Reference::new(&scene, depth, 1).unwrap());
    TruthOfCase58 { scene, references }
});

impl TruthOfCase58 {
    /// Irradiance at the points, W/m2/nm, if every band has its own albedo. Patches are of one size, so that their factors
    /// are symmetric and conjugate gradients find the radiosities.
    fn at(&self, rho: f64) -> Vec<[f64; BANDS]> {
        let [coarse, fine] = self.references.each_ref().map(|reference| {
            let first = DVector::from_iterator(
                reference.patches.len(),
                reference.patches.iter().map(|p| rho * p.punctual[30]),
            );
            let mut radiosity = first.clone();
            let apply = |x: &DVector<f64>| x - rho * (reference.factors(0) * x);
            let mut residual = &first - apply(&radiosity);
            let mut direction = residual.clone();
            while residual.norm() > 1e-9 * first.norm() {
                let applied = apply(&direction);
                let square = residual.norm_squared();
                let step = square / direction.dot(&applied);
                radiosity += step * &direction;
                residual -= step * applied;
                direction = &residual + residual.norm_squared() / square * direction;
            }
            // The light has equal energy: what holds for one band holds for all.
            let rows: Vec<[f64; BANDS]> = radiosity.iter().map(|&b| [b; BANDS]).collect();
            let solution = ReferenceSolution {
                irradiance: rows.clone(),
                radiosity: rows,
            };
            reference.gather(&self.scene, &solution, &floor_points(), 1)
        });
        let pairs = fine.iter().zip(&coarse);
        pairs
            .map(|(f, c)| std::array::from_fn(|l| f[l] + (f[l] - c[l]) / 3.0))
            .collect()
    }
}

/// Worst error at the points, at some bands; `truth` by band.
fn worst_of_case_5_8(
    bake: &Bake,
    bands: &[usize],
    truth: impl Fn(usize) -> Vec<[f64; BANDS]>,
) -> f64 {
    let probed = bake.probe(&floor_points());
    let off = bands.iter().flat_map(|&band| {
        let pairs = probed.iter().zip(truth(band));
        pairs
            .map(|(probed, truth)| probed.spectrum[band] / truth[band] - 1.0)
            .collect::<Vec<_>>()
    });
    off.fold(0.0, |w: f64, x| if x.abs() > w.abs() { x } else { w })
}

/// At single points, band by band.
#[test]
fn case_5_8_at_points_in_every_band() {
    let reflectance: [f64; BANDS] =
        std::array::from_fn(|l| 0.475 - 0.425 * (l as f64 / 63.0 * 9.0).cos());
    // Lanes for the eye merge bands: for each by itself there are rows of all 64.
    let settings = Settings {
        error: 0.25,
        representation: Representation::Dense,
        ..Settings::default()
    };
    let bake = built::run(cube(|room| room.spectral_paint(reflectance)), settings);
    let worst = worst_of_case_5_8(&bake, &[3, 20, 30, 41, 60], |band| {
        TRUTH.at(reflectance[band])
    });
    println!("spectral: worst point and band {:+.3} %", 100.0 * worst);
    assert!(worst.abs() < POINT, "{worst:e}");
}

/// Wavelength by wavelength: E(l) = Phi(l) / (96 (1 - rho(l))).
#[test]
fn case_5_8_in_every_band() {
    let reflectance: [f64; BANDS] =
        std::array::from_fn(|l| 0.475 - 0.425 * (l as f64 / 63.0 * 9.0).cos());
    let scene = cube(|room| room.spectral_paint(reflectance));
    let power = scene.spectra[0].power;
    for representation in [Representation::Dense, Representation::Adaptive] {
        let settings = Settings {
            representation,
            ..Settings::default()
        };
        let mut bake = Bake::new(cube(|room| room.spectral_paint(reflectance)), settings);
        bake.run();
        if representation == Representation::Dense {
            let (mut mean, mut area) = ([0.0; BANDS], 0.0);
            for (k, &leaf) in bake.light().leaves.iter().enumerate() {
                let a = bake.tree().node(leaf).area;
                let spectrum = bake.lanes().spectrum(bake.light().irradiance.row(k));
                for (m, x) in mean.iter_mut().zip(&spectrum) {
                    *m += a * x;
                }
                area += a;
            }
            for band in 0..BANDS {
                mean_is(
                    mean[band] / area,
                    10_000.0 * power[band] / 96.0 / (1.0 - reflectance[band]),
                );
            }
        }
        // Exact mean tristimulus values follow.
        let weights = haarlight::color::Observer::cie1931().weights(&bake.scene().grid);
        let mean = bake.mean_irradiance();
        for c in 0..3 {
            let want: f64 = (0..BANDS)
                .map(|l| {
                    haarlight::color::KM * weights[c][l] * power[l] * 10_000.0
                        / 96.0
                        / (1.0 - reflectance[l])
                })
                .sum();
            println!(
                "{representation:?} {c}: {:+.4} %",
                100.0 * (mean[c] / want - 1.0)
            );
            mean_is(mean[c], want);
        }
    }
}
