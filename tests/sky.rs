//! Light of sky and sun: CIE 171:2006, cases 5.9, 5.11 and 5.12, and closed forms.

use crate::common::built;
use crate::common::daylit;

use built::{Room, sun};
use daylit::{
    LUX, bake, cie, facade, given_up, glanced, glanced_in_grey, past_the_horizon, points,
    points_beside, roof, room, row, through, traced, wish,
};
use glam::{DMat4, DVec3, dvec3};
use haarlight::color::{KM, Observer};
use haarlight::output::Exposure;
use haarlight::output::picture::{Format, Picture};
use haarlight::scene::sky::{
    Distribution, SkyBrightness, SkyType, SkyWish, SunPlace, SunWish, direction,
};
use haarlight::scene::{Camera, LightKind, Projection, Scene};
use std::f64::consts::PI;

/// Greatest error of a point.
const POINT: f64 = 5e-3;
/// Paths from a point.
const PATHS: usize = 65_536;
/// Figures of the report at A, C, G, J, N (CIE 171:2006 through published validations).
const TABLES: [(u8, f64, [f64; 5]); 8] = [
    (1, 1.0, [0.46, 2.34, 2.33, 4.29, 2.33]),
    (5, 1.0, [1.04, 2.59, 1.95, 3.37, 1.95]),
    (12, 1.0, [1.74, 4.55, 5.72, 3.97, 0.96]),
    (16, 1.0, [0.56, 2.32, 2.29, 4.29, 2.29]),
    (1, 4.0, [37.84, 26.85, 31.87, 43.35, 31.87]),
    (5, 4.0, [46.74, 28.05, 26.80, 35.58, 26.80]),
    (12, 4.0, [66.34, 44.25, 42.33, 40.85, 16.79]),
    (16, 4.0, [39.28, 26.79, 31.36, 42.76, 31.36]),
];

/// Lux at the points under an opening by quadrature.
fn quadrature(kind: u8, opening: f64) -> Vec<f64> {
    let sky = Distribution::new(kind, direction(60.0, 0.0));
    let at = |place| LUX * through(|d| sky.radiance(d), 0.0, roof(opening), place);
    points().into_iter().map(at).collect()
}

/// The points of a room, every panel of which is cut into `cuts` x `cuts` squares, against quadrature and the report.
fn check(kind: u8, opening: f64, cuts: usize, seed: u64, truth: &[f64]) {
    let bake = glanced_in_grey(room(0.0, opening, cuts), &wish(kind), seed);
    let lux: Vec<f64> = bake.probe(&points()).iter().map(|p| p.xyz[1]).collect();
    let (mut worst, mut squares) = (0.0_f64, 0.0);
    for (k, (got, want)) in lux.iter().zip(truth).enumerate() {
        let off = got / want - 1.0;
        (worst, squares) = (worst.max(off.abs()), squares + off * off);
        println!("type {kind}, {opening} m, point {k}: {got:.4} for {want:.4}");
    }
    let rms = (squares / lux.len() as f64).sqrt();
    let way = if cuts == 1 { "" } else { ", by rays" };
    row("5.9", &format!("type {kind}, {opening} m{way}"), worst, rms);
    // Exactly, or by rays, that of a large opening with some noise.
    let each = match (cuts, opening > 1.0) {
        (1, _) => 1e-3,
        (_, false) => POINT,
        (_, true) => 1.5 * POINT,
    };
    assert!(
        worst <= each && rms <= 0.5 * each,
        "type {kind}, {opening} m, seed {seed}: {worst}, {rms}"
    );
    if let Some((_, _, table)) = TABLES.iter().find(|t| (t.0, t.1) == (kind, opening)) {
        for (place, want) in [0, 2, 6, 9, 13].into_iter().zip(table) {
            // A of the report's 4 x 4 wall is wrong near the opening (see the closed form of type 5).
            let wrong = opening == 4.0 && place == 0;
            // Printed to two digits, or one unit beside.
            let near = (POINT * want).max(0.015);
            assert!(
                wrong || (lux[place] - want).abs() <= near,
                "{place}: {} {want}",
                lux[place]
            );
        }
    }
}

#[test]
fn cie_171_case_5_9() {
    for kind in 1..=16 {
        for opening in [1.0, 4.0] {
            check(kind, opening, 1, 0, &quadrature(kind, opening));
        }
    }
}

/// The wall under the whole open roof, by the closed form of a rectangle seen from a perpendicular element.
#[test]
fn cie_171_case_5_9_closed_form() {
    let bake = glanced(room(0.0, 4.0, 1), &wish(5));
    let wall = [45.12, 35.90, 27.99, 21.64, 16.72, 12.97];
    for (got, want) in bake.probe(&points()).iter().zip(wall) {
        println!("wall: {} for {want}", got.xyz[1]);
        assert!(
            (got.xyz[1] / want - 1.0).abs() <= 1e-3,
            "{} {want}",
            got.xyz[1]
        );
    }
}

/// All light that comes in through the roof lands somewhere, also where the first round is given up; exactly and by rays.
#[test]
fn a_round_that_is_given_up_leaves_the_light_of_the_sky() {
    for (kind, opening, cuts) in [(5, 4.0, 1), (1, 1.0, 1), (5, 4.0, 8), (12, 1.0, 8)] {
        let bake = given_up(room(0.0, opening, cuts), &wish(kind));
        let area = 4.0 * 12.0 + 2.0 * 16.0 - opening * opening;
        let (got, want) = (bake.mean_irradiance()[1], LUX * opening * opening / area);
        println!("type {kind}, {opening} m, {cuts}: {got} for {want}");
        assert!((got / want - 1.0).abs() < 0.03, "{got} for {want}");
    }
}

/// The same rooms of many triangles, where rays do what polygons do above: as right through a small opening as through a large
/// one.
#[test]
fn rays_through_an_opening_agree_with_polygons() {
    for (kind, opening) in [(1, 1.0), (12, 1.0), (12, 4.0), (5, 0.2)] {
        let truth = quadrature(kind, opening);
        for seed in 0..3 {
            check(kind, opening, 6, seed, &truth);
        }
    }
}

/// 5.11: a window in a wall, and a wall that is a window, show sky above the horizon and ground below it.
#[test]
fn ground_below_the_horizon_lights_a_ceiling() {
    for (kind, whole) in (1..=16).flat_map(|kind| [(kind, false), (kind, true)]) {
        let (mut worst, mut squares) = (0.0_f64, 0.0);
        let mut room = Room::new();
        let window = facade(&mut room, whole);
        let bake = glanced_in_grey(room, &wish(kind), 0);
        let sky = Distribution::new(kind, direction(60.0, 0.0));
        let seen = |d: DVec3| if d.y > 0.0 { sky.radiance(d) } else { 0.3 / PI };
        let places = points_beside();
        for (probed, place) in bake.probe(&places).iter().zip(&places) {
            let got = probed.xyz[1];
            let want = LUX * past_the_horizon(seen, window, *place);
            println!("type {kind}, {place:?}: {got:.4} for {want:.4}");
            let off = got / want - 1.0;
            (worst, squares) = (worst.max(off.abs()), squares + off * off);
        }
        let rms = (squares / places.len() as f64).sqrt();
        let size = if whole { "4 x 3 m" } else { "2 x 1 m" };
        row("5.11", &format!("type {kind}, {size}"), worst, rms);
        assert!(worst <= 2e-3, "type {kind}, {size}: {worst}");
    }
}

/// An even sky over an open floor: E = pi L everywhere, and half of it on a wall that stands alone, with half of the ground's.
#[test]
fn an_even_sky_gives_open_ground_pi_l() {
    let mut room = Room::new();
    let paint = room.paint(0.5);
    room.quad(DVec3::ZERO, DVec3::Z * 5.0, DVec3::X * 5.0, paint);
    let wish = SkyWish {
        brightness: Some(SkyBrightness::Luminance(1000.0)),
        ..wish(5)
    };
    let bake = glanced(room, &wish);
    let at = dvec3(2.0, 0.0, 1.3);
    let lux = bake.probe(&[(at, DVec3::Y)])[0].xyz[1];
    println!("open ground: {lux} for {}", 1000.0 * PI);
    assert!((lux / (1000.0 * PI) - 1.0).abs() < 1e-5, "{lux}");
}

/// The sun through an opening in the roof: a patch on the floor has its lux and its colour, the shade has neither.
#[test]
fn the_sun_lights_a_patch_of_the_floor() {
    let place = SunPlace::Angles {
        elevation: 60.0,
        azimuth: 90.0,
    };
    let wish = SkyWish {
        sun: SunWish {
            place: Some(place),
            illuminance: Some(80_000.0),
            kelvin: Some(5000.0),
        },
        brightness: Some(SkyBrightness::Illuminance(0.0)),
        ..wish(12)
    };
    for cuts in [1, 6] {
        let bake = glanced(room(0.0, 1.0, cuts), &wish);
        // From the middle of the opening down along its rays, to the west.
        let x = 2.0 - 3.0 / 60.0_f64.to_radians().tan();
        let at = |x: f64| (cie(x, 2.0, 0.0), DVec3::Y);
        let probed = bake.probe(&[at(x), at(x + 0.9), at(x + 0.4)]);
        let want = 80_000.0 * 60.0_f64.to_radians().sin();
        for lit in [&probed[0], &probed[2]] {
            println!("in the sun: {} for {want}", lit.xyz[1]);
            assert!((lit.xyz[1] / want - 1.0).abs() < 1e-3, "{:?}", lit.xyz);
        }
        assert!(probed[1].xyz[1] < 1e-3 * want, "{:?}", probed[1].xyz);
        // Chromaticity of daylight at 5000 K (CIE 015, D50: x .3457, y .3585).
        let [x, y, z] = probed[0].xyz;
        let all = x + y + z;
        assert!((x / all - 0.3457).abs() < 1e-3 && (y / all - 0.3585).abs() < 1e-3);
    }
}

/// Beside its patch the sun's light fades as its disc of .53 degrees goes behind the edge: the share of a disc beyond a chord, so many radii
/// from its middle. The mean over the edge, as a point looks by few rays.
#[test]
fn the_edge_of_a_sun_patch_is_as_wide_as_its_disc() {
    let wish = SkyWish {
        sun: sun([60.0, 90.0], 80_000.0),
        brightness: Some(SkyBrightness::Illuminance(0.0)),
        ..wish(12)
    };
    let bake = glanced(room(0.0, 1.0, 1), &wish);
    let open = 80_000.0 * 60.0_f64.to_radians().sin();
    for radii in [-1.1, -0.8, -0.4, 0.0, 0.4, 0.8, 1.1_f64] {
        // From here the eastern edge of the opening stands so much higher than the sun's middle.
        let x = 2.5 - 3.0 / (60.0 + 0.265 * radii).to_radians().tan();
        let along = (0..64).map(|k| (cie(x, 1.55 + 0.9 * f64::from(k) / 63.0, 0.0), DVec3::Y));
        let probed = bake.probe(&along.collect::<Vec<_>>());
        let mean = probed.iter().map(|p| p.xyz[1]).sum::<f64>() / 64.0 / open;
        let t = radii.clamp(-1.0, 1.0);
        let want = (t.acos() - t * (1.0 - t * t).sqrt()) / PI;
        println!("{radii} radii: {mean:.4} for {want:.4}");
        assert!((mean - want).abs() < 0.02, "{radii}: {mean} {want}");
    }
}

#[test]
fn a_clear_sky_asks_where_the_sun_stands() {
    let asked = |wish: SkyWish| {
        let error = room(0.5, 1.0, 1).scene().under(&wish).unwrap_err();
        error.to_string()
    };
    let clear = SkyWish {
        kind: Some(SkyType(12)),
        ..SkyWish::default()
    };
    assert!(asked(clear.clone()).contains("where the sun stands"));
    let below = SunPlace::Angles {
        elevation: -3.0,
        azimuth: 0.0,
    };
    let sun = SunWish {
        place: Some(below),
        ..SunWish::default()
    };
    assert!(
        asked(SkyWish {
            sun: sun.clone(),
            ..clear
        })
        .contains("3.0 deg below the horizon")
    );
    assert!(
        asked(SkyWish {
            sun,
            ..SkyWish::default()
        })
        .contains("what the sky is like")
    );
    let red = SunWish {
        kelvin: Some(3000.0),
        ..SunWish::default()
    };
    let nowhere = SkyWish {
        kind: Some(SkyType(1)),
        sun: red,
        ..SkyWish::default()
    };
    assert!(asked(nowhere).contains("not where it stands"));
}

/// Below 4000 K a sun is a blackbody: x .4770, y .4137 at 2500 K. Parallel light of the file stays, which is said.
#[test]
fn a_low_sun_is_a_blackbody_and_no_second_one_unless_it_is_said() {
    let under = |light: SunPlace, kelvin: Option<f64>| {
        let mut room = room(0.5, 1.0, 1);
        room.punctual(LightKind::Directional, DVec3::ZERO, DVec3::NEG_Y, 100.0);
        let mut wish = wish(1);
        wish.sun = SunWish {
            place: Some(light),
            illuminance: Some(100.0),
            kelvin,
        };
        room.scene().under(&wish).unwrap()
    };
    let low = SunPlace::Angles {
        elevation: 2.0,
        azimuth: 0.0,
    };
    let scene = under(low, Some(2500.0));
    let said = scene.warnings.join("\n");
    assert!(
        said.contains("\"sun\": \"light 0\"") && said.contains("two suns"),
        "{said}"
    );
    let sun = scene
        .lights
        .iter()
        .find(|l| l.kind == LightKind::Sun)
        .unwrap();
    let spectrum = &scene.spectra[sun.light];
    assert_eq!(spectrum.name, "blackbody/2500");
    let weights = Observer::cie1931().weights(&scene.grid);
    let sum = |w: &[f64]| -> f64 { spectrum.power.iter().zip(w).map(|(p, w)| p * w).sum() };
    let [x, y, z] = weights.each_ref().map(|w| sum(w));
    let all = x + y + z;
    assert!(
        (x / all - 0.4770).abs() < 5e-4 && (y / all - 0.4137).abs() < 5e-4,
        "{}",
        x / all
    );
    let named = under(SunPlace::Light("light 0".into()), None);
    assert!(!named.warnings.join("").contains("two suns"));
}

/// Under a sky of which no sun is said parallel light of the file shines on, and it is said how to put it out; asked for, it is out.
#[test]
fn parallel_light_shines_on_unless_there_is_to_be_no_sun() {
    let under = |place: Option<SunPlace>| {
        let mut room = room(0.5, 1.0, 1);
        room.punctual(LightKind::Directional, DVec3::ZERO, DVec3::NEG_Y, 100.0);
        let mut wish = wish(1);
        wish.sun = SunWish {
            place,
            ..SunWish::default()
        };
        room.scene().under(&wish).unwrap()
    };
    let is_parallel = |scene: &Scene| scene.lights.iter().any(|l| l.kind.is_parallel());
    let scene = under(None);
    let said = scene.warnings.join("\n");
    assert!(is_parallel(&scene), "{said}");
    assert!(
        said.contains("('light 0') shines on under this sky") && said.contains("--sun none"),
        "{said}"
    );
    let scene = under(Some(SunPlace::Nowhere));
    assert!(!is_parallel(&scene) && scene.warnings.is_empty());
    assert!(scene.sky.is_some());
}

/// Skylight that surfaces pass on, beside paths: summed over the points, so that their noise is .3 %.
#[test]
fn reflected_skylight_agrees_with_paths() {
    // Cut into more triangles the room is the same: its paths are traced once.
    let mut found = None;
    for cuts in [1, 6] {
        let bake = bake(room(0.5, 1.0, cuts), &wish(12));
        let got: f64 = bake.probe(&points()).iter().map(|p| p.xyz[1]).sum();
        let scene = bake.scene();
        let weights = Observer::cie1931().weights(&scene.grid)[1].map(|y| KM * y);
        let answers = found.get_or_insert_with(|| traced(&bake, points(), PATHS));
        let truth: f64 = answers.iter().map(|answer| answer.linear(&weights).0).sum();
        println!("{cuts}: {got:.3} for {truth:.3}");
        assert!((got / truth - 1.0).abs() < 0.01, "{cuts}: {got} {truth}");
    }
}

/// A picture shows the sky where no surface is: at the middle of each pixel the luminance of the formula, and below it the ground.
#[test]
fn pictures_show_the_sky() {
    let scene = room(0.0, 1.0, 1).scene().under(&wish(12)).unwrap();
    let sky = Distribution::new(12, direction(60.0, 0.0));
    let camera = Camera {
        name: "out".to_owned(),
        to_world: DMat4::IDENTITY,
        projection: Projection::Perspective(1.2),
        aspect: None,
    };
    let format = Format {
        width: 16,
        height: 12,
        grid: 2,
    };
    let look = Exposure::auto(&scene, &[]);
    let picture = Picture::draw(&scene, &[], &camera, &look, format).unwrap();
    for (k, pixel) in picture.pixels.iter().enumerate() {
        let across = |k: usize| (2.0 * k as f64 + 1.0 - 16.0) / 12.0 * 0.6_f64.tan();
        let up = (12.0 - 2.0 * (k / 16) as f64 - 1.0) / 12.0 * 0.6_f64.tan();
        let along = dvec3(across(k % 16), up, -1.0).normalize();
        let got = f64::from(pixel.xyz[1]);
        let want = match along.y > 0.0 {
            true => LUX * sky.radiance(along),
            false => LUX * 0.3 / PI,
        };
        assert!((got / want - 1.0).abs() < 1e-5, "{along}: {got} for {want}");
        assert_eq!(pixel.coverage, 0.0);
    }
    let dark = Picture::draw(&room(0.0, 1.0, 1).scene(), &[], &camera, &look, format).unwrap();
    assert!(
        dark.pixels
            .iter()
            .all(|p| p.xyz == [0.0; 3] && p.shown[0] > 0.0)
    );
}

/// Table 1 of ISO 15469 by its groups (Darula and Kittler 2002, CIE general sky standard defining luminance distributions): a and b of the
/// six gradations, c, d and e of the six indicatrices, and which of them make the fifteen types.
const GRADATIONS: [[f64; 2]; 6] = [
    [4.0, -0.70],
    [1.1, -0.80],
    [0.0, -1.00],
    [-1.0, -0.55],
    [-1.0, -0.32],
    [-1.0, -0.15],
];
const INDICATRICES: [[f64; 3]; 6] = [
    [0.0, -1.0, 0.00],
    [2.0, -1.5, 0.15],
    [5.0, -2.5, 0.30],
    [10.0, -3.0, 0.45],
    [16.0, -3.0, 0.30],
    [24.0, -2.8, 0.15],
];
const MADE_OF: [[usize; 2]; 15] = [
    [1, 1],
    [1, 2],
    [2, 1],
    [2, 2],
    [3, 1],
    [3, 2],
    [3, 3],
    [3, 4],
    [4, 2],
    [4, 3],
    [4, 4],
    [5, 4],
    [5, 5],
    [6, 5],
    [6, 6],
];

/// Every type by the standard's formula, worked out here: by angles from the zenith and around it, the sun over +X.
#[test]
fn skies_are_those_of_the_standard() {
    const N: usize = 500;
    for (k, [gradation, indicatrix]) in MADE_OF.into_iter().enumerate() {
        let [a, b] = GRADATIONS[gradation - 1];
        let [c, d, e] = INDICATRICES[indicatrix - 1];
        for height in [10.0, 35.0, 60.0_f64] {
            let sun = (90.0 - height).to_radians();
            let luminance = |z: f64, around: f64| {
                let cosine = sun.cos() * z.cos() + sun.sin() * z.sin() * around.cos();
                let chi = cosine.clamp(-1.0, 1.0).acos();
                let scattered = 1.0 + c * ((d * chi).exp() - (0.5 * d * PI).exp());
                (1.0 + a * (b / z.cos()).exp()) * (scattered + e * chi.cos().powi(2))
            };
            // Illuminance of open ground: midpoints in both angles, half around.
            let mut level = 0.0;
            for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
                let z = 0.5 * PI * (i as f64 + 0.5) / N as f64;
                let around = PI * (j as f64 + 0.5) / N as f64;
                level += z.sin() * z.cos() * luminance(z, around);
            }
            level *= PI * PI / (N * N) as f64;
            let sky = Distribution::new(k as u8 + 1, direction(height, 90.0));
            for (up, around) in [
                (90.0, 0.0),
                (60.0, 0.0),
                (45.0, 180.0),
                (20.0, 77.0),
                (5.0, 140.0),
            ] {
                let want = luminance((90.0_f64 - up).to_radians(), f64::to_radians(around)) / level;
                let got = sky.radiance(direction(up, 90.0 + around));
                assert!(
                    (got / want - 1.0).abs() < 1e-4,
                    "type {}, sun at {height}, {up} {around}: {got} {want}",
                    k + 1
                );
            }
        }
    }
    // The zenith of the overcast sky beside its horizon: 1 + 4 exp(-.7).
    let overcast = Distribution::new(1, DVec3::Y);
    let steep = overcast.zenith() / overcast.radiance(direction(0.01, 0.0));
    assert!((steep - 2.986_341).abs() < 1e-5, "{steep}");
}
