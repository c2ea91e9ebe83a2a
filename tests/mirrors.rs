//! Mirrors: what is seen in them, as from where it would be looked without them.

use crate::common::built;

use built::{Room, baked, close, glanced, run};
use glam::{DVec3, dvec3};
use haarlight::audit::Audit;
use haarlight::color::{KM, Observer};
use haarlight::geometry::{NO_PLANE, lambert_polygon};
use haarlight::scene::effects::EffectKind;
use haarlight::scene::mirror::Mirror;
use haarlight::scene::sky::{SkyBrightness, SkyType, SkyWish};
use haarlight::scene::{LightKind, Options, Scene};
use haarlight::solve::{Bake, Representation, Settings};
use haarlight::spectrum::{BANDS, Spectrum};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::Path;
use std::process::Command;

/// As good as perfect.
const BRIGHT: f64 = 0.999;

/// A metal that reflects long wavelengths.
fn copper() -> Spectrum {
    std::array::from_fn(|k| 0.45 + 0.5 / (1.0 + (-(k as f64 - 32.0) / 3.0).exp()))
}

fn spectra(bake: &Bake, points: &[(DVec3, DVec3)]) -> Vec<Spectrum> {
    bake.probe(points).iter().map(|p| p.spectrum).collect()
}

fn lux(bake: &Bake, points: &[(DVec3, DVec3)]) -> Vec<f64> {
    bake.probe(points).iter().map(|p| p.xyz[1]).collect()
}

/// A black floor of 4 m x 4 m, and an upright mirror of 3 m height over its edge x = 0.
fn beside(mirror: Spectrum) -> Room {
    let mut room = Room::new();
    let black = room.paint(0.0);
    room.quad(DVec3::ZERO, DVec3::Z * 4.0, DVec3::X * 4.0, black);
    let mirror = room.mirror(mirror);
    room.quad(DVec3::ZERO, DVec3::Y * 3.0, DVec3::Z * 4.0, mirror);
    room
}

/// Places of the floor, and its normal.
fn floor() -> Vec<(DVec3, DVec3)> {
    [(0.05, 2.0), (0.4, 1.7), (1.0, 2.0), (2.5, 3.0)]
        .map(|(x, z)| (dvec3(x, 0.0, z), DVec3::Y))
        .to_vec()
}

/// Irradiance by a point light of 1 cd.
fn of_point(lamp: DVec3, (point, normal): (DVec3, DVec3)) -> f64 {
    let d = lamp - point;
    normal.dot(d) / d.length().powi(3)
}

/// Cosine at a mirror across x of what comes from a place to a point.
fn at_x(lamp: DVec3, point: DVec3) -> f64 {
    let d = lamp - point;
    d.x.abs() / d.length()
}

#[test]
fn a_lamp_beside_a_mirror_shines_twice() {
    for reflectance in [BRIGHT, 0.6] {
        let mut room = beside([reflectance; BANDS]);
        let lamp = dvec3(0.8, 1.5, 2.0);
        room.point(lamp, 4.0 * PI * 100.0);
        let bake = glanced(room.scene());
        assert!(bake.plan().runs(EffectKind::Mirrors));
        let image = dvec3(-0.8, 1.5, 2.0);
        for (got, place) in lux(&bake, &floor()).into_iter().zip(floor()) {
            let share = Mirror::reflects(reflectance, at_x(image, place.0));
            let want = 100.0 * (of_point(lamp, place) + share * of_point(image, place));
            close(got, want, 1e-4, "lux");
        }
    }
}

/// A panel that faces the floor, and the sun.
#[test]
fn panels_and_the_sun_shine_twice() {
    let mut room = beside([BRIGHT; BANDS]);
    let panel = room.lamp(0.0, 1000.0);
    let corners = |x: [f64; 2]| {
        let [low, high] = x;
        [[low, 1.8], [high, 1.8], [high, 2.2], [low, 2.2]].map(|[x, z]| dvec3(x, 1.5, z))
    };
    room.polygon(&corners([0.6, 1.0]), panel);
    let bake = glanced(room.scene());
    for (got, (point, normal)) in lux(&bake, &floor()).into_iter().zip(floor()) {
        let seen = |x| lambert_polygon(point, normal, &corners(x)).abs();
        let want = 1000.0 * (seen([0.6, 1.0]) + BRIGHT * seen([-1.0, -0.6]));
        close(got, want, 5e-3, "lux by a panel");
    }
    let mut room = beside([BRIGHT; BANDS]);
    let toward = dvec3(0.5, 1.0, 0.2).normalize();
    room.punctual(LightKind::Directional, DVec3::ONE, -toward, 500.0);
    for (k, got) in lux(&glanced(room.scene()), &floor())
        .into_iter()
        .enumerate()
    {
        // The last lies where the light over the top of the mirror goes.
        let times = if k == 3 { 1.0 } else { 1.0 + BRIGHT };
        close(got, 500.0 * toward.y * times, 1e-4, "lux by the sun");
    }
}

/// In a corner of two mirrors a lamp has three images.
#[test]
fn two_mirrors_at_a_right_angle_make_three_lamps() {
    let mut room = beside([BRIGHT; BANDS]);
    let other = room.mirror([0.7; BANDS]);
    room.quad(DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 3.0, other);
    let lamp = dvec3(0.8, 1.5, 1.2);
    room.point(lamp, 4.0 * PI * 100.0);
    let bake = glanced(room.scene());
    let places = [(0.3, 0.4), (1.0, 1.0), (2.0, 0.7)].map(|(x, z)| (dvec3(x, 0.0, z), DVec3::Y));
    for (got, place) in lux(&bake, &places).into_iter().zip(places) {
        let at = |x: f64, z: f64| lamp * dvec3(x, 1.0, z);
        let z_share = |image: DVec3| {
            let d = image - place.0;
            Mirror::reflects(0.7, d.z.abs() / d.length())
        };
        let mut want = of_point(lamp, place) + BRIGHT * of_point(at(-1.0, 1.0), place);
        for x in [1.0, -1.0] {
            let image = at(x, -1.0);
            let share = z_share(image) * if x < 0.0 { BRIGHT } else { 1.0 };
            want += share * of_point(image, place);
        }
        close(got, 100.0 * want, 1e-3, "lux");
    }
}

/// Two mirrors at 45 degrees, one above the other, and a black wall that hides what they show.
fn periscope(reflectance: Spectrum) -> Room {
    let mut room = Room::new();
    let mirror = room.mirror(reflectance);
    let black = room.paint(0.0);
    room.two_sided(black);
    let z = DVec3::Z;
    let (up, down) = (dvec3(1.0, 1.0, 0.0) * 0.4, dvec3(-1.0, -1.0, 0.0) * 0.4);
    // The lower looks to -x and up, the upper to +x and down.
    room.polygon(
        &[down - 0.5 * z, down + 0.5 * z, up + 0.5 * z, up - 0.5 * z],
        mirror,
    );
    let high = DVec3::Y * 2.0;
    room.polygon(
        &[down - 0.5 * z, up - 0.5 * z, up + 0.5 * z, down + 0.5 * z].map(|p| p + high),
        mirror,
    );
    room.quad(
        dvec3(0.5, -0.5, -2.0),
        DVec3::Y * 2.0,
        DVec3::Z * 4.0,
        black,
    );
    room.quad(
        dvec3(-2.0, -0.5, -2.0),
        DVec3::X * 2.5,
        DVec3::Z * 4.0,
        black,
    );
    room
}

#[test]
fn a_periscope_shows_a_lamp() {
    let mut room = periscope([0.8; BANDS]);
    let panel = room.lamp(0.0, 1000.0);
    let corners = [[-0.1, -0.1], [-0.1, 0.1], [0.1, 0.1], [0.1, -0.1]];
    room.polygon(&corners.map(|[y, z]| dvec3(2.0, 2.0 + y, z)), panel);
    let bake = glanced(room.scene());
    for (y, z) in [(0.0, 0.0), (0.05, -0.1)] {
        let eye = dvec3(-1.0, y, z);
        let got = lux(&bake, &[(eye, DVec3::X)])[0];
        // Straight ahead, two metres further away: 45 degrees at both mirrors.
        let unfolded = corners.map(|[y, z]| dvec3(4.0, y, z));
        let share = Mirror::reflects(0.8, 0.5_f64.sqrt()).powi(2);
        let want = 1000.0 * share * lambert_polygon(eye, DVec3::X, &unfolded).abs();
        close(got, want, 5e-3, "lux");
        assert_eq!(lux(&bake, &[(eye, DVec3::NEG_X)])[0], 0.0);
    }
}

/// The overcast sky of one cd/m2 beside a mirror as large as a house front: all of the hemisphere is sky.
#[test]
fn the_sky_is_seen_in_mirrors() {
    let mut room = Room::new();
    let black = room.paint(0.0);
    room.quad(DVec3::ZERO, DVec3::Z * 4.0, DVec3::X * 4.0, black);
    let mirror = room.mirror([BRIGHT; BANDS]);
    room.quad(
        dvec3(0.0, 0.0, -20.0),
        DVec3::Y * 20.0,
        DVec3::Z * 44.0,
        mirror,
    );
    let wish = SkyWish {
        kind: Some(SkyType(5)),
        brightness: Some(SkyBrightness::Illuminance(100.0)),
        ground: Some(0.0),
        ..SkyWish::default()
    };
    let bake = glanced(room.scene().under(&wish).unwrap());
    for got in lux(&bake, &floor()) {
        close(got, 100.0, 5e-3, "lux by the sky");
    }
}

/// Sky at the end of a periscope: a window of known form factor.
#[test]
fn a_periscope_shows_the_sky() {
    let mut room = Room::new();
    let mirror = room.mirror([BRIGHT; BANDS]);
    let black = room.paint(0.0);
    // A closed box below an open shaft; the mirror in it turns the look up the shaft.
    let corner = |x: f64, y: f64, z: f64| dvec3(x, y, z);
    let sides = built::faces(corner(-1.0, 0.0, 0.0), corner(0.0, 1.0, 1.0));
    // The second, towards the shaft, is open.
    for (_, side) in sides.iter().enumerate().filter(|(k, _)| *k != 1) {
        room.polygon(side, black);
    }
    room.polygon(
        &[
            corner(0.0, 0.0, 0.0),
            corner(0.0, 0.0, 1.0),
            corner(1.0, 1.0, 1.0),
            corner(1.0, 1.0, 0.0),
        ],
        mirror,
    );
    for (from, u) in [
        (corner(0.0, 0.0, 0.0), [DVec3::X, DVec3::Y * 2.0]),
        (corner(1.0, 0.0, 1.0), [DVec3::NEG_X, DVec3::Y * 2.0]),
        (corner(1.0, 1.0, 0.0), [DVec3::Z, DVec3::Y]),
        (corner(0.0, 1.0, 1.0), [DVec3::NEG_Z, DVec3::Y]),
    ] {
        room.quad(from, u[0], u[1], black);
    }
    let wish = SkyWish {
        kind: Some(SkyType(5)),
        brightness: Some(SkyBrightness::Illuminance(100.0)),
        ground: Some(0.0),
        ..SkyWish::default()
    };
    let bake = glanced(room.scene().under(&wish).unwrap());
    let points = [(0.5, 0.5), (0.3, 0.6)].map(|(y, z)| (corner(-0.9, y, z), DVec3::X));
    for (got, (point, normal)) in lux(&bake, &points).into_iter().zip(points) {
        // Unfolded: the shaft goes on straight, its mouth at x = 2, the floor of the shaft what was its side.
        let mouth =
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| corner(2.0, y, z));
        let want = 100.0 * BRIGHT * lambert_polygon(point, normal, &mouth).abs();
        println!("{got:.4} for {want:.4}");
        close(got, want, 1e-2, "lux by the sky");
    }
}

/// Light by way of a tinted mirror has the spectrum of both, angle by angle.
#[test]
fn a_lamp_in_a_tinted_mirror_is_tinted() {
    let mut room = beside(copper());
    let lamp = dvec3(0.8, 1.5, 2.0);
    room.point(lamp, 4.0 * PI * 100.0);
    let power = room.power(0);
    let exact = Settings {
        representation: Representation::Dense,
        rounds: 1,
        ..Settings::default()
    };
    let bake = run(room.scene(), exact);
    let image = dvec3(-0.8, 1.5, 2.0);
    for (got, place) in spectra(&bake, &floor()).into_iter().zip(floor()) {
        for (k, normal) in copper().into_iter().enumerate() {
            let share = Mirror::reflects(normal, at_x(image, place.0));
            let want = of_point(lamp, place) + share * of_point(image, place);
            close(got[k], 100.0 * power[k] * want, 1e-4, "band");
        }
    }
}

/// Lux at points by a path tracer, with its standard errors.
fn traced(bake: &Bake, points: &[(DVec3, DVec3)], paths: usize) -> Vec<(f64, f64)> {
    let places: Vec<_> = (points.iter())
        .map(|&(p, n)| (p - bake.mesh().centre, n, NO_PLANE))
        .collect();
    let audit = Audit::new(bake.scene(), bake.mesh(), bake.rays());
    let luminous = Observer::cie1931().weights(&bake.scene().grid)[1].map(|w| KM * w);
    let answers = audit.irradiance(&places, &vec![paths; places.len()], 3);
    answers.iter().map(|a| a.linear(&luminous)).collect()
}

/// Points as a path tracer has them: within a share and three standard errors.
fn agrees(bake: &Bake, points: &[(DVec3, DVec3)], paths: usize, slack: f64) {
    let places: Vec<_> = (points.iter())
        .map(|&(p, n)| (p - bake.mesh().centre, n, NO_PLANE))
        .collect();
    let audit = Audit::new(bake.scene(), bake.mesh(), bake.rays());
    let answers = audit.irradiance(&places, &vec![paths; places.len()], 3);
    let weights = Observer::cie1931().weights(&bake.scene().grid);
    for (probed, answer) in bake.probe(points).iter().zip(answers) {
        for (c, weights) in weights.iter().enumerate() {
            let (truth, error) = answer.linear(&weights.map(|w| KM * w));
            let got = probed.xyz[c];
            println!("{c}: {got:.3} for {truth:.3} +- {error:.3}");
            assert!(
                (got - truth).abs() < 3.0 * error + slack * truth,
                "{got} {truth} {error}"
            );
        }
    }
}

/// A room of 4 m x 3 m x 4 m with a mirror before one wall.
fn furnished(mirror: Spectrum, rho: f64) -> Room {
    let mut room = Room::new();
    let paint = room.paint(rho);
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 4.0), [paint; 6]);
    let red = room.spectral_paint(std::array::from_fn(|k| if k > 34 { 0.7 } else { 0.1 }));
    room.block(dvec3(2.6, 0.0, 1.0), dvec3(3.4, 1.0, 2.0), red);
    let mirror = room.mirror(mirror);
    room.quad(
        dvec3(0.05, 0.4, 0.6),
        DVec3::Y * 2.0,
        DVec3::Z * 2.8,
        mirror,
    );
    room
}

fn upwards(places: &[(f64, f64)]) -> Vec<(DVec3, DVec3)> {
    let at = |&(x, z): &(f64, f64)| (dvec3(x, 0.0, z), DVec3::Y);
    places.iter().map(at).collect()
}

#[test]
fn the_path_tracer_agrees() {
    let places = upwards(&[(0.5, 2.0), (1.5, 1.0), (2.2, 3.2)]);
    let mut room = furnished([0.9; BANDS], 0.6);
    room.point(dvec3(1.2, 2.2, 2.4), 1000.0);
    agrees(&baked(room.scene()), &places, 1 << 15, 0.01);
    let mut room = furnished(copper(), 0.6);
    let panel = room.lamp(0.2, 2000.0);
    room.quad(dvec3(1.0, 2.99, 1.6), DVec3::X * 0.6, DVec3::Z * 0.6, panel);
    agrees(&baked(room.scene()), &places, 1 << 16, 0.01);
}

/// A ball that mirrors: lamps are found in it by rays alone. One point is noisy, the mean of many is not.
#[test]
fn a_ball_agrees_within_its_noise() {
    let mut room = Room::new();
    let paint = room.paint(0.5);
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 4.0), [paint; 6]);
    let mirror = room.mirror([0.9; BANDS]);
    let (corners, triangles) = built::sphere(dvec3(2.0, 0.8, 2.0), 0.6, 3);
    room.mesh(corners, triangles, mirror);
    let panel = room.lamp(0.2, 2000.0);
    room.quad(dvec3(0.6, 2.99, 0.6), DVec3::X * 1.6, DVec3::Z * 1.6, panel);
    let settings = Settings {
        error: 1.0,
        rounds: 3,
        ..Settings::default()
    };
    let bake = run(room.scene(), settings);
    let at = |k: i32| (0.5 + 0.6 * f64::from(k % 6), 0.5 + 0.6 * f64::from(k / 6));
    let places: Vec<(f64, f64)> = (0..36).map(at).collect();
    let points = upwards(&places);
    let ratios: Vec<f64> = (lux(&bake, &points)
        .iter()
        .zip(traced(&bake, &points, 1 << 13)))
    .map(|(got, (truth, _))| got / truth - 1.0)
    .collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    let square = ratios.iter().map(|r| r * r).sum::<f64>() / ratios.len() as f64;
    println!("mean {mean:+.4}, rms {:.4}", square.sqrt());
    assert!(mean.abs() < 0.01 && square.sqrt() < 0.04, "{mean} {square}");
}

/// One mirror that keeps next to nothing, seen once on any way: all that the lamp gives reaches the walls.
#[test]
fn no_light_is_lost_or_made() {
    for rho in [0.0, 0.5] {
        let mut room = Room::new();
        let paint = room.paint(rho);
        let mirror = room.mirror([BRIGHT; BANDS]);
        let walls = [mirror, paint, paint, paint, paint, paint];
        room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 4.0), walls);
        room.point(dvec3(1.7, 1.6, 2.2), 1000.0);
        let settings = Settings {
            rounds: 2,
            ..Settings::default()
        };
        let flux = run(room.scene(), settings).rounds()[1].flux;
        println!("{rho}: {flux:?}");
        close(flux.received_lm, 1000.0, 0.01, "received");
        close(flux.absorbed_lm, 1000.0, 0.01, "absorbed");
    }
}

/// Five mirrors and a black floor: mirrors in mirrors, four deep.
/// After one round: of further ones no figure moves by more than .15 %, where 2 % and the noise of paths are allowed.
#[test]
fn a_box_of_mirrors_agrees() {
    let mut room = Room::new();
    let black = room.paint(0.0);
    let mirror = room.mirror([0.5; BANDS]);
    let walls = [mirror, mirror, black, mirror, mirror, mirror];
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 4.0), walls);
    let panel = room.lamp(0.0, 1000.0);
    room.block(dvec3(1.5, 1.4, 2.0), dvec3(1.9, 1.6, 2.4), panel);
    let up = upwards(&[(1.0, 1.0), (2.0, 2.0), (3.5, 0.4)]);
    agrees(&glanced(room.scene()), &up, 1 << 14, 0.02);
}

/// The same bytes at any number of threads.
#[test]
fn threads_change_nothing() {
    let at = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut room = furnished(copper(), 0.6);
            let panel = room.lamp(0.2, 2000.0);
            room.quad(dvec3(1.0, 2.99, 1.6), DVec3::X * 0.6, DVec3::Z * 0.6, panel);
            let (corners, triangles) = built::sphere(dvec3(2.0, 0.8, 3.2), 0.4, 1);
            let ball = room.mirror([0.8; BANDS]);
            room.mesh(corners, triangles, ball);
            let settings = Settings {
                error: 2.0,
                rounds: 2,
                ..Settings::default()
            };
            let bake = run(room.scene(), settings);
            let probed = bake.probe(&floor());
            let bits = |x: &f64| x.to_bits();
            let probed: Vec<u64> = probed
                .iter()
                .flat_map(|p| p.spectrum.iter().map(bits))
                .collect();
            let light = bake.light();
            let rows = (0..light.irradiance.len()).flat_map(|k| light.irradiance.row(k).to_vec());
            (probed, rows.map(f32::to_bits).collect::<Vec<_>>())
        })
    };
    assert!(at(1) == at(4));
}

fn mirrored() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/mirrored.glb"))
}

/// Names of the materials that mirror where so much is said of the room.
fn mirrors_where(said: Value) -> Vec<String> {
    let options = Options {
        said: Some(said),
        ..Options::default()
    };
    let scene = Scene::load(mirrored(), &options).unwrap();
    let mirrors = scene.materials.iter().filter(|m| m.mirror.is_some());
    mirrors.map(|m| m.name.clone()).collect()
}

#[test]
fn smooth_metals_mirror_and_the_side_file_has_the_last_word() {
    assert_eq!(
        mirrors_where(json!({})),
        ["silver", "chrome", "bronze mirror"]
    );
    let said =
        |wish: bool| json!({"materials": {"silver": {"mirror": wish}, "walls": {"mirror": wish}}});
    assert_eq!(mirrors_where(said(false)), ["chrome", "bronze mirror"]);
    let all = ["walls", "silver", "chrome", "bronze mirror"];
    assert_eq!(mirrors_where(said(true)), all);
    let wrong = Options {
        said: Some(json!({"materials": {"silver": {"mirror": "yes"}}})),
        ..Options::default()
    };
    let text = Scene::load(mirrored(), &wrong).unwrap_err().to_string();
    assert!(
        text.contains("material 'silver'") && text.contains("mirror is \"yes\""),
        "{text}"
    );
}

/// Why mirrors run is said, and checkpoints and caches know them.
#[test]
fn the_program_says_why_and_refuses_what_it_cannot_keep() {
    let haarlight = |arguments: &[&str]| {
        let done = Command::new(env!("CARGO_BIN_EXE_haarlight"))
            .args(arguments)
            .output();
        let done = done.unwrap();
        let text = [done.stdout, done.stderr].concat();
        (
            done.status.code(),
            String::from_utf8_lossy(&text).into_owned(),
        )
    };
    let room = mirrored().to_str().unwrap();
    let (_, text) = haarlight(&["inspect", room]);
    for said in [
        "'bronze mirror' (side file: 0.6",
        "roughness 0.050",
        "mirrors",
    ] {
        assert!(text.contains(said), "{said}\n-- in --\n{text}");
    }
    let folder = tempfile::tempdir().unwrap();
    let named = |name: &str| folder.path().join(name).display().to_string();
    // What is kept knows mirrors.
    let [cache, checkpoint] = ["cache", "checkpoint"].map(|k| format!("--{k}={}", named(k)));
    let out = named("out.glb");
    let bake = ["bake", room, "-o", &out, "--error=9", &cache, &checkpoint];
    let (code, text) = haarlight(&bake);
    assert!(matches!(code, Some(0 | 1)), "{code:?}: {text}");
    let (code, text) = haarlight(&["relight", room, &cache, "-o", &named("relit.glb")]);
    assert_eq!(code, Some(0), "{text}");
}
