//! Rooms that break radiosity solvers. In all of them: the solver ends, no figure is NaN or negative, light that is given
//! out is accounted for.

use crate::common::built;

use built::{Room, glanced};
use glam::{DVec3, dvec3};
use haarlight::data::{Outside, Table};
use haarlight::scene::{LightKind, Scene};
use haarlight::solve::{Bake, Settings, Verdict};
use haarlight::spectrum::{
    BANDS, CmfTree, Control, DyadicTree, Estimate, Grid, List, Metric, Partition, Path, control,
};

/// Bakes with default settings and checks what must hold of any room.
fn baked(scene: Scene) -> Bake {
    let bake = built::baked(scene);
    sound(&bake);
    bake
}

/// No NaN, nothing negative, flux accounted for after every round.
fn sound(bake: &Bake) {
    let light = bake.light();
    for rows in [&light.irradiance, &light.reflected, &light.emitted] {
        let greatest = (0..rows.len())
            .flat_map(|k| rows.row(k))
            .fold(0.0_f32, |m, x| m.max(*x));
        for k in 0..rows.len() {
            for x in rows.row(k) {
                // Conjugate gradients may leave rounding below zero.
                assert!(
                    x.is_finite() && *x >= -1e-5 * greatest,
                    "row {k}: {x} of {greatest}"
                );
            }
        }
    }
    for round in bake.rounds() {
        let flux = round.flux;
        for x in [
            flux.emitted_lm,
            flux.received_lm,
            flux.absorbed_lm,
            flux.escaped_lm,
            flux.worst_band,
        ] {
            assert!(x.is_finite(), "{flux:?}");
        }
        assert!(flux.worst_band < 5e-3, "{flux:?}");
        let error = &round.error;
        for figure in [error.total_de2000, error.total_relative, error.convergence] {
            assert!(
                figure.value.is_none_or(|x| x.is_finite() && x >= 0.0),
                "{error:?}"
            );
        }
    }
    bake.tree().validate().unwrap();
}

fn lux(bake: &Bake, point: DVec3, normal: DVec3) -> f64 {
    let y = bake.probe(&[(point, normal)])[0].xyz[1];
    assert!(y.is_finite() && y >= 0.0, "{y} at {point}");
    y
}

fn near(got: f64, want: f64, tolerance: f64) {
    assert!(
        (got / want - 1.0).abs() <= tolerance,
        "{got} should be {want}, off by {:e}",
        got / want - 1.0
    );
}

/// A box room of one paint with a lamp in the ceiling.
fn lamp_room(size: DVec3, rho: f64) -> Scene {
    let mut room = Room::new();
    let (wall, lamp) = (room.paint(rho), room.lamp(rho, 1000.0));
    room.hollow(DVec3::ZERO, size, [wall, wall, wall, lamp, wall, wall]);
    room.scene()
}

/// Mean H of a closed room of one albedo is Phi / (A (1 - rho)), whatever the shape: to 1e-4, in a few iterations.
#[test]
fn albedo_near_one() {
    let size = dvec3(4.0, 3.0, 5.0);
    let area = 2.0 * (12.0 + 15.0 + 20.0);
    for rho in [0.95, 0.99, 0.999] {
        let bake = baked(lamp_room(size, rho));
        let flux = bake.rounds().last().unwrap().flux.received_lm;
        near(flux, 20_000.0, 1e-3);
        near(bake.mean_irradiance()[1], flux / area / (1.0 - rho), 1e-4);
        for round in bake.rounds() {
            assert!(round.iterations < 24, "{} iterations", round.iterations);
        }
    }
}

/// 40 x 2 x 3 m at .99: several slow modes.
#[test]
fn long_white_corridor() {
    let mut room = Room::new();
    let (wall, lamp) = (room.paint(0.99), room.lamp(0.5, 1000.0));
    room.hollow(
        DVec3::ZERO,
        dvec3(40.0, 3.0, 2.0),
        [lamp, wall, wall, wall, wall, wall],
    );
    let mut bake = Bake::new(room.scene(), Settings::default());
    for _ in 0..5 {
        bake.step();
    }
    sound(&bake);
    let last = bake.rounds().last().unwrap();
    // Plain sweeps would take a thousand.
    assert!(last.iterations < 60, "{}", last.iterations);
    near(last.flux.absorbed_lm, 6000.0, 3e-3);
    let (bright, dark) = (
        lux(&bake, dvec3(1.0, 0.0, 1.0), DVec3::Y),
        lux(&bake, dvec3(39.0, 0.0, 1.0), DVec3::Y),
    );
    assert!(bright > dark && dark > 0.0, "{bright} {dark}");
    // With default settings it comes to an end in seconds, too.
    bake.run();
    sound(&bake);
}

/// Albedo 1 and above in a file is taken as .999 and said.
#[test]
fn albedo_of_one_in_the_file() {
    let text = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "materials": [{"name": "snow", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36,
        "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAAAAAAIA/"}]}"#;
    let document = haarlight::scene::document::Document::from_bytes(
        std::path::Path::new("room.gltf"),
        text.as_bytes(),
    )
    .unwrap();
    let scene = Scene::from_document(document, &Default::default()).unwrap();
    assert!(scene.materials[0].reflectance.iter().all(|r| *r <= 0.999));
    assert!(
        scene.warnings.iter().any(|w| w.contains("snow")),
        "{:?}",
        scene.warnings
    );
    baked(scene);
    // A closed room at the clamp: the exact answer all the same.
    let bake = baked(lamp_room(DVec3::splat(2.0), 1.5));
    near(
        bake.mean_irradiance()[1],
        1000.0 * 4.0 / 24.0 / (1.0 - 0.999),
        2e-3,
    );
}

/// Plates 1e-6 apart: B between them as between infinite plates.
#[test]
fn surfaces_a_micrometre_apart() {
    let mut room = Room::new();
    let (lower, upper) = (room.lamp(0.5, 1000.0), room.paint(0.5));
    room.quad(DVec3::ZERO, DVec3::Z, DVec3::X, lower);
    room.quad(dvec3(0.0, 1e-6, 0.0), DVec3::X, DVec3::Z, upper);
    let bake = baked(room.scene());
    near(
        lux(&bake, dvec3(0.4, 1e-6, 0.3), DVec3::NEG_Y),
        1000.0 / 0.75,
        1e-2,
    );
}

/// A box that stands on the floor (coplanar faces), beside it one that is put down twice, and two that run into each other.
#[test]
fn touching_doubled_and_interpenetrating_boxes() {
    let mut room = Room::new();
    let (wall, lamp, box_) = (room.paint(0.6), room.lamp(0.6, 1000.0), room.paint(0.4));
    room.hollow(
        DVec3::ZERO,
        dvec3(4.0, 3.0, 4.0),
        [wall, wall, wall, lamp, wall, wall],
    );
    room.block(dvec3(0.5, 0.0, 0.5), dvec3(1.2, 0.8, 1.2), box_);
    for _ in 0..2 {
        room.block(dvec3(2.5, 0.0, 0.5), dvec3(3.2, 0.8, 1.2), box_);
    }
    room.block(dvec3(0.5, 0.0, 2.0), dvec3(2.0, 1.0, 3.0), box_);
    room.block(dvec3(1.5, 0.4, 2.5), dvec3(2.5, 1.6, 3.5), box_);
    // Flush with the wall.
    room.block(dvec3(3.0, 0.0, 2.0), dvec3(4.0, 1.0, 3.0), box_);
    let bake = baked(room.scene());
    near(
        bake.rounds().last().unwrap().flux.received_lm,
        16_000.0,
        1e-2,
    );
    // The doubled box is lit as the single one, by symmetry.
    let (one, two) = (
        lux(&bake, dvec3(0.85, 0.8, 0.85), DVec3::Y),
        lux(&bake, dvec3(2.85, 0.8, 0.85), DVec3::Y),
    );
    near(one, two, 0.15);
    // Under the boxes it is dark: no light in the floor below them reaches the baked mesh as NaN.
    let output = bake.baked(&|_, _| {});
    for v in output.surfaces.iter().flat_map(|s| &s.vertices) {
        assert!(
            v.irradiance
                .iter()
                .chain(&v.radiosity)
                .chain(&v.light)
                .all(|x| x.is_finite())
        );
    }
}

/// Triangles of aspect 1e6, of no area, and with all corners in one place, in the middle of a room.
#[test]
fn slivers_and_points() {
    let mut room = Room::new();
    let (wall, lamp) = (room.paint(0.6), room.lamp(0.6, 1000.0));
    room.hollow(
        DVec3::ZERO,
        dvec3(4.0, 3.0, 4.0),
        [wall, wall, wall, lamp, wall, wall],
    );
    let o = dvec3(2.0, 1.0, 2.0);
    room.polygon(&[o, o + DVec3::X, o + dvec3(0.5, 0.0, -1e-6)], wall);
    room.polygon(
        &[
            o + DVec3::Y,
            o + dvec3(1.0, 1.0, 0.0),
            o + dvec3(0.5, 1.0, 0.0),
        ],
        wall,
    );
    room.polygon(&[o, o, o], wall);
    room.polygon(&[o, o, o + DVec3::X], lamp);
    let bake = baked(room.scene());
    near(bake.mean_irradiance()[1], 16_000.0 / 80.0 / 0.4, 1e-2);
}

/// A room of fans: walls cut into slivers from one corner.
#[test]
fn walls_of_slivers() {
    let mut room = Room::new();
    let (wall, lamp) = (room.paint(0.5), room.lamp(0.5, 1000.0));
    room.hollow(
        DVec3::ZERO,
        dvec3(1000.0, 1e-3, 1000.0),
        [wall, wall, wall, lamp, wall, wall],
    );
    let bake = baked(room.scene());
    near(
        lux(&bake, dvec3(400.0, 0.0, 300.0), DVec3::Y),
        1000.0 / 0.5 * 2.0 / 3.0,
        1e-2,
    );
}

/// The same room near the origin, at 1e6 with details of 1e-3, at 1e-4 m and at 1e5 m: the same light.
#[test]
fn huge_coordinates_and_odd_scales() {
    let light = |shift: DVec3, scale: f64| {
        let mut room = Room::new();
        let (wall, lamp) = (room.paint(0.6), room.lamp(0.6, 1000.0));
        let at = |x: f64, y: f64, z: f64| shift + scale * dvec3(x, y, z);
        room.hollow(
            at(0.0, 0.0, 0.0),
            at(4.0, 3.0, 4.0),
            [wall, wall, wall, lamp, wall, wall],
        );
        room.block(at(1.0, 0.5, 1.0), at(1.001, 1.5, 2.0), wall);
        let bake = baked(room.scene());
        [
            lux(&bake, at(0.0, 1.0, 1.5), DVec3::X),
            lux(&bake, at(2.0, 0.0, 2.0), DVec3::Y),
            lux(&bake, at(1.0, 1.0, 1.5), DVec3::NEG_X),
        ]
    };
    let plain = light(DVec3::ZERO, 1.0);
    for (shift, scale) in [
        (dvec3(1e6, -1e6, 1e6), 1.0),
        (DVec3::ZERO, 1e-4 / 4.0),
        (DVec3::ZERO, 1e5 / 4.0),
        (dvec3(5e4, 0.0, 0.0), 1e-2),
    ] {
        for (a, b) in light(shift, scale).into_iter().zip(plain) {
            near(a, b, 2e-2);
        }
    }
}

/// 1 mm of 1e9 cd/m2 beside 1 m2 of 1 cd/m2, in a black room: both exact.
#[test]
fn tiny_bright_lamp_beside_a_large_dim_one() {
    use haarlight::geometry::lambert_polygon;
    let mut room = Room::new();
    let (wall, dim, bright) = (
        room.paint(0.0),
        room.lamp(0.0, std::f64::consts::PI),
        room.lamp(0.0, 1e9 * std::f64::consts::PI),
    );
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 4.0), [wall; 6]);
    let square = |x: f64, z: f64, s: f64| {
        [
            dvec3(x, 2.99, z),
            dvec3(x + s, 2.99, z),
            dvec3(x + s, 2.99, z + s),
            dvec3(x, 2.99, z + s),
        ]
    };
    let (a, b) = (square(2.5, 2.5, 1.0), square(1.0, 1.0, 1e-3));
    room.polygon(&a, dim);
    room.polygon(&b, bright);
    let bake = baked(room.scene());
    for point in [
        dvec3(1.0, 0.0, 1.0),
        dvec3(3.0, 0.0, 3.0),
        dvec3(0.2, 0.0, 3.7),
    ] {
        let want = std::f64::consts::PI
            * (lambert_polygon(point, DVec3::Y, &a) + 1e9 * lambert_polygon(point, DVec3::Y, &b));
        near(lux(&bake, point, DVec3::Y), want, 5e-3);
    }
}

/// One band only, at every place, among them both ends: a line on a band edge ends up in one band or the next, whole.
#[test]
fn line_spectra() {
    let mut room = Room::new();
    let reflectance: [f64; BANDS] = std::array::from_fn(|l| 0.2 + 0.6 * (l % 2) as f64);
    let lines: Vec<usize> = [5, 16, 31, 32, 47, 48]
        .iter()
        .map(|&band| {
            let mut power = [0.0; BANDS];
            power[band] = 1.0;
            room.spectrum(&format!("line {band}"), power)
        })
        .collect();
    let faces: [usize; 6] = std::array::from_fn(|k| {
        let paint = room.spectral_paint(reflectance);
        room.glow(paint, lines[k], 1000.0);
        paint
    });
    room.hollow(DVec3::ZERO, DVec3::splat(3.0), faces);
    let scene = room.scene();
    let want: f64 = [5, 16, 31, 32, 47, 48]
        .iter()
        .map(|&band| 1000.0 / 6.0 / (1.0 - reflectance[band]))
        .sum();
    let bake = baked(scene);
    near(bake.mean_irradiance()[1], want, 2e-3);
}

/// A line on the very edge of a band, a tenth of a nanometre wide: none of it is lost, at either end of the grid neither.
#[test]
fn lines_on_band_edges() {
    let grid = Grid::default();
    for leaf in [0, 1, 16, 32, 63, 64] {
        let edge = grid.start() + leaf as f64 * grid.width();
        let table =
            Table::new(vec![edge - 0.05, edge, edge + 0.05], vec![0.0, 1000.0, 0.0]).unwrap();
        let means = grid.means(&table, Outside::Zero);
        let energy: f64 = means.iter().map(|x| x * grid.width()).sum();
        // At an end half of the line lies outside.
        let inside = if leaf % 64 == 0 { 0.5 } else { 1.0 };
        near(energy, 50.0 * inside, 1e-12);
        let lit: Vec<usize> = (0..BANDS).filter(|&l| means[l] > 0.0).collect();
        let wanted: Vec<usize> = (0..BANDS).filter(|&l| l + 1 == leaf || l == leaf).collect();
        assert_eq!(lit, wanted, "edge {leaf}");
        // The room gets all of it, whatever lanes the solver chooses.
        let mut room = Room::new();
        let line = room.spectrum("line", means);
        let wall = room.spectral_paint(std::array::from_fn(|l| 0.3 + 0.3 * (l % 2) as f64));
        let lamp = room.paint(0.5);
        room.glow(lamp, line, 1000.0);
        room.hollow(
            DVec3::ZERO,
            dvec3(4.0, 3.0, 4.0),
            [wall, wall, wall, lamp, wall, wall],
        );
        let bake = baked(room.scene());
        near(
            bake.rounds().last().unwrap().flux.absorbed_lm,
            16_000.0,
            1e-3,
        );
    }
}

/// A lower limit at or above the upper one, limits of nothing, and none that are numbers: the loop of the spectra ends.
#[test]
fn spectral_limits_that_exclude_each_other() {
    let cmf = CmfTree::new(haarlight::color::Observer::cie1931().weights(&Grid::default()));
    let light: [f64; BANDS] = std::array::from_fn(|l| 1.0 + (l as f64 * 0.7).sin());
    let paint: [f64; BANDS] = std::array::from_fn(|l| 0.5 + 0.4 * (l as f64 * 0.3).cos());
    let (light, paint) = (
        DyadicTree::<Estimate>::new(&light, &cmf),
        DyadicTree::<Estimate>::new(&paint, &cmf),
    );
    for settings in [Control::PAPER, Control::within(1.0)] {
        for [eps_min, eps_max] in [
            [1e-3, 1e-3],
            [1.0, 1e-6],
            [1e300, 0.0],
            [0.0, 0.0],
            [f64::INFINITY, f64::NEG_INFINITY],
            [f64::NAN, f64::NAN],
            [-1.0, -2.0],
        ] {
            let path = Path {
                source: &light,
                reflections: &[&paint, &paint],
            };
            let mut list = List::new(&light, Partition::uniform(3));
            for _ in 0..2 {
                let mut out = List::black();
                list.reflect(&paint, &cmf, &mut out);
                list = out;
            }
            let settings = Control {
                eps_min,
                eps_max,
                ..settings
            };
            control(&mut list, &path, &cmf, &Metric::Xyz, &settings);
            assert_eq!(list.validate(), Ok(()), "{eps_min} {eps_max}");
            assert!(list.xyz(&cmf).iter().all(|x| x.is_finite() && *x > 0.0));
        }
    }
}

/// Light of one band in the deep blue, beside a lamp that does not have it.
#[test]
fn nearly_monochromatic_light() {
    let mut room = Room::new();
    let mut power = [0.0; BANDS];
    power[10] = 1.0;
    power[11] = 1e-9;
    let line = room.spectrum("line", power);
    let red = room.spectral_paint(std::array::from_fn(|l| {
        0.05 + 0.9 * f64::from(u8::from(l > 32))
    }));
    let lamp = room.paint(0.5);
    room.glow(lamp, line, 100.0);
    room.hollow(
        DVec3::ZERO,
        dvec3(4.0, 3.0, 4.0),
        [red, red, red, lamp, red, red],
    );
    let bake = baked(room.scene());
    near(bake.rounds().last().unwrap().flux.absorbed_lm, 1600.0, 3e-3);
}

/// An error of nothing, below what any limit allows, and none at all: it ends and does not claim to be there.
#[test]
fn unreachable_errors() {
    for error in [1e-9, 0.0, -1.0, f64::NAN] {
        let mut room = Room::new();
        let (wall, lamp) = (room.paint(0.5), room.lamp(0.5, 1000.0));
        room.hollow(
            DVec3::ZERO,
            dvec3(4.0, 3.0, 4.0),
            [wall, lamp, wall, wall, wall, wall],
        );
        let mut bake = Bake::new(
            room.scene(),
            Settings {
                error,
                rounds: 3,
                ..Settings::default()
            },
        );
        let verdict = bake.run();
        assert!(
            matches!(verdict, Verdict::OutOfRounds | Verdict::Exhausted),
            "{error}: {verdict:?}"
        );
        sound(&bake);
    }
}

/// A lamp behind a wall with a slit of 1 cm: the strip that sees the lamp is lit, exactly; the rest by reflection only.
#[test]
fn light_through_a_narrow_gap() {
    let mut room = Room::new();
    let (black, lamp) = (room.paint(0.0), room.lamp(0.0, 1000.0));
    room.two_sided(black);
    room.hollow(
        DVec3::ZERO,
        dvec3(4.0, 2.0, 2.0),
        [lamp, black, black, black, black, black],
    );
    // The wall at x = 2, a slit from z = 0.995 to 1.005 over its whole height.
    room.quad(
        dvec3(2.0, 0.0, 0.0),
        2.0 * DVec3::Y,
        0.995 * DVec3::Z,
        black,
    );
    room.quad(
        dvec3(2.0, 0.0, 1.005),
        2.0 * DVec3::Y,
        0.995 * DVec3::Z,
        black,
    );
    let bake = baked(room.scene());
    for z in [1.0, 0.7, 1.6] {
        // What is seen of the lamp through the slit from (4, 1, z).
        let through = |edge: f64| (2.0 * edge - z).clamp(0.0, 2.0);
        let (a, b) = (through(0.995), through(1.005));
        let seen = [
            dvec3(0.0, 0.0, a),
            dvec3(0.0, 2.0, a),
            dvec3(0.0, 2.0, b),
            dvec3(0.0, 0.0, b),
        ];
        let point = dvec3(4.0, 1.0, z);
        let want = 1000.0 * haarlight::geometry::lambert_polygon(point, DVec3::NEG_X, &seen);
        near(lux(&bake, point, DVec3::NEG_X), want, 1e-2);
    }
}

/// Nothing at all on the far side of x = `border(z)`: no leaf, no point, no vertex.
fn dark_beyond(bake: &Bake, border: impl Fn(f64) -> f64) {
    let mut leaves = 0;
    for (k, &leaf) in bake.light().leaves.iter().enumerate() {
        let at = bake.tree().node(leaf).centre + bake.mesh().centre;
        if at.x > border(at.z) + 1e-3 {
            let row = bake.light().irradiance.row(k);
            assert!(row.iter().all(|&x| x == 0.0), "{row:?} at {at}");
            leaves += 1;
        }
    }
    assert!(leaves > 5);
    for (point, normal) in [
        (dvec3(4.0, 1.0, 1.0), DVec3::NEG_X),
        (dvec3(3.0, 0.0, 3.0), DVec3::Y),
        (dvec3(2.75, 3.0, 1.0), DVec3::NEG_Y),
        (dvec3(3.2, 1.5, 2.0), DVec3::NEG_X),
    ] {
        assert_eq!(lux(bake, point, normal), 0.0, "{point}");
    }
}

/// A room that runs on behind a wall from `parts`, with light on one side of it only.
fn parted_room(parts: impl Fn(&mut Room, usize)) -> Bake {
    let mut room = Room::new();
    let (wall, lamp, sheet) = (room.paint(0.8), room.lamp(0.5, 1e5), room.paint(0.8));
    room.hollow(
        DVec3::ZERO,
        dvec3(4.0, 3.0, 4.0),
        [lamp, wall, wall, wall, wall, wall],
    );
    parts(&mut room, sheet);
    let bake = baked(room.scene());
    assert!(lux(&bake, dvec3(1.0, 0.0, 1.0), DVec3::Y) > 1e4);
    bake
}

/// A sheet across a room, lamp on one side: the other side is exactly dark.
#[test]
fn thin_wall_with_a_bright_and_a_dark_side() {
    let bake = parted_room(|room, sheet| {
        room.two_sided(sheet);
        room.quad(dvec3(2.0, 0.0, 0.0), 3.0 * DVec3::Y, 4.0 * DVec3::Z, sheet);
    });
    assert!(lux(&bake, dvec3(2.0, 1.0, 1.0), DVec3::NEG_X) > 1e4);
    assert_eq!(lux(&bake, dvec3(2.0, 1.0, 1.0), DVec3::X), 0.0);
    dark_beyond(&bake, |_| 2.0);
}

/// The same askew, so that no halving of any wall ever meets it.
#[test]
fn thin_wall_askew() {
    let bake = parted_room(|room, sheet| {
        room.two_sided(sheet);
        let across = dvec3(0.37, 0.0, 4.0);
        room.quad(dvec3(1.93, 0.0, 0.0), 3.0 * DVec3::Y, across, sheet);
    });
    dark_beyond(&bake, |z| 1.93 + 0.37 * z / 4.0);
}

/// Two one-sided faces in one plane, and two that are a hand apart: what runs on below them is cut as well.
#[test]
fn wall_of_two_faces() {
    for thickness in [0.0, 1e-3, 0.1] {
        let bake = parted_room(|room, sheet| {
            let (u, v) = (3.0 * DVec3::Y, 4.0 * DVec3::Z);
            room.quad(dvec3(2.1, 0.0, 0.0), v, u, sheet);
            room.quad(dvec3(2.1 + thickness, 0.0, 0.0), u, v, sheet);
        });
        dark_beyond(&bake, |_| 2.1 + thickness);
    }
}

/// A closed room without light: black, at once, and no figure divided by nothing.
#[test]
fn a_closed_room_without_light() {
    let mut room = Room::new();
    let wall = room.paint(0.9);
    room.hollow(DVec3::ZERO, dvec3(4.0, 3.0, 4.0), [wall; 6]);
    let mut bake = Bake::new(room.scene(), Settings::default());
    assert_eq!(bake.run(), Verdict::Reached);
    sound(&bake);
    assert_eq!(lux(&bake, dvec3(2.0, 0.0, 2.0), DVec3::Y), 0.0);
    let output = bake.baked(&|_, _| {});
    assert!(
        output
            .surfaces
            .iter()
            .flat_map(|s| &s.vertices)
            .all(|v| v.irradiance == [0.0; 3] && v.light == [0.0; 3])
    );
}

/// One triangle in the open, lit by the sun and by itself; and no triangle at all.
#[test]
fn one_triangle_and_none() {
    let mut room = Room::new();
    let lamp = room.lamp(0.5, 10.0);
    room.polygon(&[DVec3::ZERO, DVec3::Z, DVec3::X], lamp);
    room.punctual(
        LightKind::Directional,
        DVec3::ZERO,
        dvec3(0.0, -1.0, 0.0),
        50_000.0,
    );
    let bake = baked(room.scene());
    near(lux(&bake, dvec3(0.25, 0.0, 0.25), DVec3::Y), 50_000.0, 1e-5);
    let mut empty = Bake::new(Room::new().scene(), Settings::default());
    empty.run();
    sound(&empty);
    assert!(empty.baked(&|_, _| {}).surfaces.is_empty());
    let mut nothing_but_light = Room::new();
    nothing_but_light.point(DVec3::ZERO, 100.0);
    let mut bake = Bake::new(nothing_but_light.scene(), Settings::default());
    bake.run();
    sound(&bake);
}

/// 10 000 point lights of 1 lm in a plane below the ceiling.
fn point_lights() -> Scene {
    let mut room = Room::new();
    let wall = room.paint(0.5);
    room.hollow(DVec3::ZERO, dvec3(10.0, 3.0, 10.0), [wall; 6]);
    for k in 0..10_000 {
        room.point(point_light(k), 1.0);
    }
    room.scene()
}

fn point_light(k: u32) -> DVec3 {
    dvec3(
        0.05 + 0.1 * f64::from(k % 100),
        2.5,
        0.05 + 0.1 * f64::from(k / 100),
    )
}

#[test]
fn ten_thousand_point_lights() {
    let bake = baked(point_lights());
    let point = dvec3(5.0, 0.0, 5.0);
    let direct: f64 = (0..10_000)
        .map(|k| {
            let d = point_light(k) - point;
            d.y / d.length().powi(3) / (4.0 * std::f64::consts::PI)
        })
        .sum();
    let seen = lux(&bake, point, DVec3::Y);
    // The mean of all light is twice the mean of the direct light; the floor gets about as much more as it has.
    assert!(seen > direct && seen < 3.0 * direct, "{seen} {direct}");
    let flux = bake.rounds().last().unwrap().flux;
    near(flux.received_lm, 10_000.0, 1e-2);
}

/// 10 000 glowing squares of 2 cm, 10 cm below the ceiling of a black room, and where they are.
fn glowing_squares() -> (Scene, Vec<[DVec3; 4]>) {
    let mut room = Room::new();
    let (wall, lamp) = (room.paint(0.0), room.lamp(0.0, 1000.0));
    room.hollow(DVec3::ZERO, dvec3(10.0, 3.0, 10.0), [wall; 6]);
    let (u, v) = (0.02 * DVec3::X, 0.02 * DVec3::Z);
    let mut squares = Vec::new();
    for k in 0..10_000 {
        let corner = dvec3(
            0.04 + 0.1 * f64::from(k % 100),
            2.9,
            0.04 + 0.1 * f64::from(k / 100),
        );
        room.quad(corner, u, v, lamp);
        squares.push([corner, corner + u, corner + u + v, corner + v]);
    }
    (room.scene(), squares)
}

#[test]
fn ten_thousand_glowing_squares() {
    let (scene, squares) = glowing_squares();
    // Nothing is reflected: what further rounds add is finer leaves.
    let bake = glanced(scene);
    for (point, normal) in [
        (dvec3(5.03, 0.0, 5.01), DVec3::Y),
        (dvec3(0.5, 0.0, 0.5), DVec3::Y),
        (dvec3(0.0, 2.5, 5.0), DVec3::X),
    ] {
        let want: f64 = squares
            .iter()
            .map(|q| 1000.0 * haarlight::geometry::lambert_polygon(point, normal, q))
            .sum();
        near(lux(&bake, point, normal), want, 2e-3);
    }
    assert_eq!(lux(&bake, dvec3(0.0, 2.95, 5.0), DVec3::X), 0.0);
    // The strip of wall above them is dark: leaves that it crosses must not count it as lit.
    let flux = bake.rounds().last().unwrap().flux;
    near(flux.received_lm, 4000.0, 1e-2);
}

/// Rounds after the end change nothing but get finer: no cycle of refining and merging, elements never fewer.
#[test]
fn no_cycle_of_refining() {
    let mut bake = Bake::new(
        lamp_room(dvec3(4.0, 3.0, 5.0), 0.7),
        Settings {
            error: 0.0,
            rounds: 5,
            ..Settings::default()
        },
    );
    bake.run();
    sound(&bake);
    for pair in bake.rounds().windows(2) {
        assert!(pair[1].elements >= pair[0].elements);
        assert!(pair[1].threshold < pair[0].threshold);
    }
}

/// A small lamp in a white ceiling over a floor, both of many faces: each face of the floor is so small that it may err, but
/// not all alike.
#[test]
fn direct_light_of_many_small_faces() {
    let mut room = Room::new();
    let (white, lamp) = (room.paint(0.9), room.lamp(0.9, 1000.0));
    for i in 0..60 {
        for k in 0..60 {
            let at = dvec3(f64::from(i) / 60.0, 0.0, f64::from(k) / 60.0);
            room.quad(at, DVec3::Z / 60.0, DVec3::X / 60.0, white);
        }
    }
    for i in 0..8 {
        for k in 0..8 {
            let at = dvec3(f64::from(i) / 8.0, 1.0, f64::from(k) / 8.0);
            let material = if (i, k) == (1, 2) { lamp } else { white };
            room.quad(at, DVec3::X / 8.0, DVec3::Z / 8.0, material);
        }
    }
    let bake = baked(room.scene());
    // The share of the lamp's light that meets the floor: exact from a point of the lamp, 16 by 16 points.
    let floor = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)].map(|(x, z)| dvec3(x, 0.0, z));
    let share: f64 = (0..256)
        .map(|k| {
            let at = |k: usize| (k as f64 + 0.5) / 128.0;
            let point = dvec3(0.125 + at(k % 16), 1.0, 0.25 + at(k / 16));
            haarlight::geometry::lambert_polygon(point, DVec3::NEG_Y, &floor) / 256.0
        })
        .sum();
    let flux = bake.rounds().last().unwrap().flux;
    let found = flux.received_lm / flux.emitted_lm;
    assert!((found / share - 1.0).abs() < 5e-3, "{found} {share}");
}
