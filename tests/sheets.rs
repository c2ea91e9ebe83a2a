//! Diffuse sheets: what meets one side leaves both.

use crate::common;
use crate::common::built;

use built::{Room, baked_to, baked_within, close, faces, run, sphere};
use glam::{DVec3, dvec3};
use haarlight::audit::{PathReference, Report};
use haarlight::keep::Relighter;
use haarlight::scene::effects::EffectKind;
use haarlight::scene::{LightKind, Options, Scene, Sides};
use haarlight::solve::{Bake, Settings};
use haarlight::spectrum::{BANDS, Spectrum};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// Asked for less than the default: closed forms are held to half a per cent.
const ERROR: f64 = 0.2;

/// The same at all wavelengths.
fn even(x: f64) -> Spectrum {
    [x; BANDS]
}

/// Mean lux at points.
fn mean_lux(bake: &Bake, points: &[(DVec3, DVec3)]) -> f64 {
    let all = bake.probe(points).iter().map(|p| p.xyz[1]).sum::<f64>();
    all / points.len() as f64
}

fn lux(bake: &Bake, point: DVec3, normal: DVec3) -> f64 {
    bake.probe(&[(point, normal)])[0].xyz[1]
}

/// Many small triangles far away that see nothing of a room: leaves and points then look for themselves.
fn crowd(room: &mut Room) {
    let black = room.paint(0.0);
    let (corners, triangles) = sphere(dvec3(0.0, -50.0, 0.0), 0.2, 2);
    room.mesh(corners, triangles, black);
}

/// Three plates one above the other, very near: a lamp looking down, a sheet, a floor. Between plates without end every one sees
/// nothing but the next, `B1 = e + r1 Bf`, `Bf = rf B1 + t B2`, `Bb = rb B2 + t B1`, `B2 = r2 Bb`.
#[test]
fn two_slabs_exchange_light_through_a_sheet() {
    let (e, r1, r2) = (100.0, 0.4, 0.6);
    for (rf, rb, t) in [(0.5, 0.3, 0.2), (0.1, 0.0, 0.8), (0.0, 0.7, 0.25)] {
        let mut room = Room::new();
        let lamp = room.lamp(r1, e);
        let sheet = room.sheet(even(rf), even(rb), even(t));
        let floor = room.paint(r2);
        let (size, gap) = (100.0, 0.1);
        let (x, z) = (DVec3::X * size, DVec3::Z * size);
        room.quad(dvec3(0.0, 2.0 * gap, 0.0), x, z, lamp);
        room.quad(dvec3(0.0, gap, 0.0), z, x, sheet);
        room.quad(DVec3::ZERO, z, x, floor);
        let bake = baked_to(ERROR, room.scene());
        // B2 = r2 (rb B2 + t B1), so B2 = q B1.
        let q = r2 * t / (1.0 - r2 * rb);
        let b1 = e / (1.0 - r1 * (rf + t * q));
        let at = |height: f64| dvec3(0.47 * size, height, 0.52 * size);
        close(lux(&bake, at(0.0), DVec3::Y), q / r2 * b1, 0.005, "floor");
        close(lux(&bake, at(gap), DVec3::Y), b1, 0.005, "front");
        close(lux(&bake, at(gap), DVec3::NEG_Y), q * b1, 0.005, "back");
        close(
            lux(&bake, at(2.0 * gap), DVec3::NEG_Y),
            (rf + t * q) * b1,
            0.005,
            "lamp",
        );
    }
}

/// Two black boxes with a sheet between, which shows on one side what a lit disk on the floor of the other sends it; points are close before it. In
/// the first round too, when the sheet is two leaves, they find the light of the places that they see.
#[test]
fn points_close_to_a_sheet_see_what_passes_there() {
    let (through, rho, intensity, side) = (0.6, 0.9, 1000.0, 3.0);
    let (lamp, outer) = (dvec3(1.5, 1.5, -1.2), 0.6_f64);
    let mut room = Room::new();
    let black = room.paint(0.0);
    let floor = room.paint(rho);
    let sheet = room.sheet(even(0.0), even(0.0), even(through));
    let behind = [black, black, floor, black, black, sheet];
    room.hollow(dvec3(0.0, 0.0, -side), dvec3(side, side, 0.0), behind);
    let before = faces(DVec3::ZERO, dvec3(side, side, 1.0));
    for (k, corners) in before.iter().enumerate() {
        // Where the sheet is.
        if k != 4 {
            room.polygon(corners, black);
        }
    }
    crowd(&mut room);
    let inner = outer - 1e-3;
    let spot = LightKind::Spot { inner, outer };
    room.punctual(spot, lamp, DVec3::NEG_Y, intensity);
    // So little may be missed that many paths are followed.
    let settings = Settings {
        error: 0.1,
        rounds: 1,
        ..Settings::default()
    };
    let bake = run(room.scene(), settings);
    let middles = |n: usize| {
        let at = move |k: usize| (k as f64 + 0.5) / n as f64;
        (0..n * n).map(move |k| [at(k % n), at(k / n)])
    };
    // What small squares of the floor send, and what these bring to small squares of the sheet.
    let reach = lamp.y * outer.tan();
    let lit: Vec<(DVec3, f64)> = middles(80)
        .map(|[u, v]| 2.0 * reach * dvec3(u - 0.5, 0.0, v - 0.5))
        .filter(|x| x.length() < reach)
        .map(|x| {
            let e = intensity * lamp.y / x.length().hypot(lamp.y).powi(3);
            let area = (2.0 * reach / 80.0).powi(2);
            (dvec3(lamp.x, 0.0, lamp.z) + x, rho * e / PI * area)
        })
        .collect();
    let shown: Vec<(DVec3, f64)> = middles(100)
        .map(|[u, v]| {
            let x = side * dvec3(u, v, 0.0);
            let by = |&(from, sent): &(DVec3, f64)| {
                let way = x - from;
                sent * way.y * way.z / way.length_squared().powi(2)
            };
            let area = (side / 100.0).powi(2);
            (x, through / PI * area * lit.iter().map(by).sum::<f64>())
        })
        .collect();
    let brought = |point: DVec3| {
        let by = |&(from, sent): &(DVec3, f64)| {
            let way = point - from;
            sent * (way.z / way.length_squared()).powi(2)
        };
        shown.iter().map(by).sum::<f64>()
    };
    for height in [0.3, 0.9, 1.5, 2.1, 2.7] {
        let points = [0.7, 1.1, 1.4, 1.9, 2.2].map(|x| dvec3(x, height, 0.06));
        let want = points.map(brought).iter().sum::<f64>() / points.len() as f64;
        let seen = mean_lux(&bake, &points.map(|point| (point, DVec3::NEG_Z)));
        close(seen, want, 0.1, "before the sheet");
    }
}

/// A lamp in the middle of a ball of paper in the middle of a hollow ball: all is even, and the two cavities exchange light through
/// the paper.
#[test]
fn a_ball_of_paper_around_a_lamp() {
    // By polygons; by rays, of which those of all walls together find the ball to about 1 %.
    ball_of_paper(1, 5e-3);
    ball_of_paper(2, 0.02);
}

fn ball_of_paper(depth: u32, tolerance: f64) {
    let (flux, wall, front, back, through) = (1000.0, 0.5, 0.4, 0.3, 0.45);
    let mut room = Room::new();
    let paper = room.sheet(even(front), even(back), even(through));
    let paint = room.paint(wall);
    let (corners, triangles) = sphere(DVec3::ZERO, 0.6, depth);
    room.mesh(corners, triangles, paper);
    let (corners, mut triangles) = sphere(DVec3::ZERO, 1.0, depth);
    triangles.iter_mut().for_each(|t| t.swap(1, 2));
    room.mesh(corners, triangles, paint);
    room.point(DVec3::ZERO, flux);
    let bake = baked_to(ERROR, room.scene());
    let area = |surface: u32| -> f64 {
        let all = bake.mesh().origin.iter().zip(&bake.mesh().area);
        all.filter(|(from, _)| from.0 == surface)
            .map(|(_, a)| a)
            .sum()
    };
    let (paper, walls) = (area(0), area(1));
    // Inside: h = flux / A + rho_back h + tau k; outside: k = wall x; on the wall: x = s (front k + tau h) + (1 - s) wall x.
    let s = paper / walls;
    let first = flux / paper;
    let solve = |h: f64| {
        // k from h: k / wall = s front k + s tau h + (1 - s) k.
        s * through * h / (1.0 / wall - s * front - (1.0 - s))
    };
    let k = solve(1.0);
    let h = first / (1.0 - back - through * k);
    let k = k * h;
    let mean = |surface: u32, back: bool| {
        let light = bake.light();
        let (mut sum, mut all) = (0.0, 0.0);
        for (row, &leaf) in light.leaves.iter().enumerate() {
            let node = bake.tree().node(leaf);
            let face = bake.tree().faces[node.faces.0 as usize];
            if bake.mesh().origin[face.triangle as usize].0 == surface && face.back == back {
                sum += node.area * bake.lanes().tristimulus(light.irradiance.row(row))[1];
                all += node.area;
            }
        }
        sum / all
    };
    // Sides of the paper are shown by front + through, the greater of both.
    let shown = front + through;
    close(
        mean(0, true),
        (back * h + through * k) / shown,
        tolerance,
        "inside",
    );
    close(
        mean(0, false),
        (front * k + through * h) / shown,
        tolerance,
        "outside",
    );
    close(mean(1, false), k / wall, tolerance, "wall");
}

/// Parallel light on a black sheet: below it is a Lambertian lamp of exitance tau E. By polygons and by rays.
#[test]
fn a_black_sheet_sends_out_what_passes() {
    let (lux_above, through) = (2000.0, 0.95);
    for crowded in [false, true] {
        let mut room = Room::new();
        let sheet = room.sheet(even(0.0), even(0.0), even(through));
        let black = room.paint(0.0);
        room.quad(dvec3(-0.5, 1.0, -0.5), DVec3::Z, DVec3::X, sheet);
        room.quad(
            dvec3(-2.0, 0.0, -2.0),
            DVec3::Z * 4.0,
            DVec3::X * 4.0,
            black,
        );
        room.punctual(LightKind::Directional, DVec3::ZERO, DVec3::NEG_Y, lux_above);
        if crowded {
            crowd(&mut room);
        }
        let bake = baked_to(ERROR, room.scene());
        // Point to a parallel rectangle over its corner (Howell, B-3).
        let corner = |a: f64, b: f64| {
            let (x, y) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
            (a / x * (b / x).atan() + b / y * (a / y).atan()) / (2.0 * PI)
        };
        let wanted = |x: f64, z: f64| {
            let sides = [[0.5 - x, 0.5 + x], [0.5 - z, 0.5 + z]];
            let factor: f64 = sides[0]
                .iter()
                .flat_map(|a| sides[1].map(|b| corner(*a, b)))
                .sum();
            through * lux_above * factor
        };
        if crowded {
            // Each point looks with rays of its own: their noise is less in the mean.
            let at = |k: usize| -0.4 + 0.1 * k as f64;
            let places: Vec<(f64, f64)> = (0..81).map(|k| (at(k % 9), at(k / 9))).collect();
            let want: f64 = places.iter().map(|&(x, z)| wanted(x, z)).sum();
            let points: Vec<_> = (places.iter())
                .map(|&(x, z)| (dvec3(x, 0.0, z), DVec3::Y))
                .collect();
            let mean = mean_lux(&bake, &points);
            close(mean, want / 81.0, 5e-3, "below the sheet, by rays");
            continue;
        }
        for (x, z) in [(0.0, 0.0), (0.25, -0.1), (-0.4, 0.3)] {
            let got = lux(&bake, dvec3(x, 0.0, z), DVec3::Y);
            close(got, wanted(x, z), 1e-3, "below the sheet");
        }
    }
}

/// A box that a sheet divides, with a lamp in one half: all that the lamp gives out is absorbed, also where nearly nothing is.
fn divided(front: f64, back: f64, through: f64, wall: f64, crowded: bool) -> Scene {
    let mut room = Room::new();
    let paint = room.paint(wall);
    let sheet = room.sheet(even(front), even(back), even(through));
    for (from, to) in [(0.0, 1.5), (1.5, 3.0)] {
        let faces = built::faces(dvec3(from, 0.0, 0.0), dvec3(to, 2.5, 3.0));
        let ends = [from == 0.0, to == 3.0, true, true, true, true];
        for (corners, _) in faces.iter().zip(ends).filter(|(_, there)| *there) {
            room.polygon(corners, paint);
        }
    }
    let [y, z] = [DVec3::Y * 2.5, DVec3::Z * 3.0];
    // Its front looks at the lamp.
    room.quad(DVec3::X * 1.5, z, y, sheet);
    room.point(dvec3(0.6, 1.3, 1.4), 1000.0);
    if crowded {
        let (corners, triangles) = sphere(dvec3(0.6, 0.5, 2.3), 0.1, 2);
        room.mesh(corners, triangles, paint);
    }
    room.scene()
}

#[test]
fn what_is_given_out_is_absorbed() {
    for (front, back, through, wall) in [
        (0.5, 0.5, 0.3, 0.6),
        (0.2, 0.4, 0.55, 0.5),
        (0.59, 0.59, 0.4, 0.99),
        (0.1, 0.1, 0.89, 0.7),
    ] {
        for crowded in [false, true] {
            // Once to the end: further rounds lose nothing either.
            let rounds = if through == 0.3 { 12 } else { 2 };
            let settings = Settings {
                rounds,
                ..Settings::default()
            };
            let bake = run(divided(front, back, through, wall, crowded), settings);
            let flux = bake.rounds().last().unwrap().flux;
            let what = format!("{front} {back} {through} {wall} {crowded}");
            let tolerance = if crowded { 0.02 } else { 1e-3 };
            close(flux.received_lm, 1000.0, tolerance, &what);
            close(flux.absorbed_lm, flux.received_lm, tolerance, &what);
            assert!(
                flux.escaped_lm.abs() < 1000.0 * tolerance,
                "{what}: {flux:?}"
            );
        }
    }
}

/// Walls of albedo r that emit e, and a sheet that emits as much more as it absorbs more: light is `e / (1 - r)` everywhere.
#[test]
fn a_furnace_with_a_sheet_is_even() {
    let (r, e) = (0.7, 100.0);
    let want = e / (1.0 - r);
    for (front, through) in [(0.3, 0.4), (0.0, 0.9), (0.69, 0.3)] {
        for crowded in [false, true] {
            let mut room = Room::new();
            let wall = room.lamp(r, e);
            room.hollow(DVec3::ZERO, dvec3(3.0, 2.5, 3.0), [wall; 6]);
            let sheet = room.sheet(even(front), even(front), even(through));
            room.glow(sheet, 0, want * (1.0 - front - through));
            room.quad(dvec3(1.5, 0.5, 0.5), DVec3::Z * 2.0, DVec3::Y * 1.5, sheet);
            if crowded {
                let (corners, triangles) = sphere(dvec3(0.6, 1.0, 1.5), 0.3, 2);
                room.mesh(corners, triangles, wall);
            }
            // Even light is as right in the second round as in the last.
            let settings = Settings {
                error: ERROR,
                rounds: 2,
                ..Settings::default()
            };
            let bake = run(room.scene(), settings);
            // Rows of rays sum to 1, but the light of lamps has noise: it is less in the mean of points.
            let mut all = Vec::new();
            for k in 0..16 {
                let (x, z) = (0.35 + 0.77 * f64::from(k % 4), 0.3 + 0.8 * f64::from(k / 4));
                all.push((dvec3(x, 0.0, z), DVec3::Y));
                let on_sheet = dvec3(1.5, 0.6 + 0.08 * f64::from(k), 0.7 + 0.1 * f64::from(k));
                all.extend([DVec3::X, DVec3::NEG_X].map(|n| (on_sheet, n)));
            }
            close(mean_lux(&bake, &all), want, 3e-3, "furnace");
            if !crowded {
                for (point, normal) in all {
                    close(lux(&bake, point, normal), want, 5e-3, "furnace, a point");
                }
            }
        }
    }
}

/// Vertices of a sheet show what leaves their side: `rho E + tau E'`.
#[test]
fn vertices_show_both_lights() {
    let (front, back, through) = (0.35, 0.2, 0.45);
    let bake = baked_to(ERROR, divided(front, back, through, 0.6, false));
    let sheet = bake.scene().surfaces.len() - 1;
    let baked = bake.baked(&|_, _| {});
    let mut seen = [0; 2];
    for side in baked.surfaces.iter().filter(|s| s.surface == sheet) {
        for vertex in side.vertices.iter().step_by(7) {
            let surface = &bake.scene().surfaces[sheet];
            let corners = surface.triangles[vertex.triangle as usize];
            let place: DVec3 = (0..3)
                .map(|k| surface.positions[corners[k] as usize] * vertex.weights[k])
                .sum();
            let middle = dvec3(1.5, 1.25, 1.5);
            if (place - middle).abs().max_element() > 1.2 {
                continue;
            }
            let [left, right] = [DVec3::NEG_X, DVec3::X].map(|n| lux(&bake, place, n));
            let want = match side.back {
                false => front * left + through * right,
                true => back * right + through * left,
            };
            close(f64::from(vertex.radiosity[1]), want, 0.02, "vertex");
            seen[usize::from(side.back)] += 1;
        }
    }
    assert!(seen.iter().all(|n| *n > 1), "{seen:?}");
}

/// The plan says why it runs.
#[test]
fn the_plan_names_the_material() {
    let bake = Bake::new(divided(0.5, 0.5, 0.3, 0.6, false), Settings::default());
    assert!(bake.plan().runs(EffectKind::Sheets));
    let text = bake.plan().to_string();
    let line = "material 'material 1' lets diffuse light through";
    assert!(text.contains(line), "{text}");
}

/// A room of one triangle with this material and side file, read from files.
fn read(material: &Value, side: &Value) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    let mut file = common::Room::triangle();
    file.json["extensionsUsed"] = json!(["KHR_materials_diffuse_transmission"]);
    file.json["materials"] = json!([material]);
    file.primitive()["material"] = json!(0);
    let path = folder.path().join("room.glb");
    std::fs::write(&path, file.glb()).unwrap();
    std::fs::write(folder.path().join("room.spectra.json"), side.to_string()).unwrap();
    Scene::load(&path, &Options::default()).map_err(|error| error.to_string())
}

/// A curtain of glTF's own words.
fn curtain(base: [f64; 3], factor: Value, color: Value) -> Value {
    json!({
        "name": "curtain",
        "pbrMetallicRoughness": {"baseColorFactor": [base[0], base[1], base[2], 1.0], "metallicFactor": 0.0},
        "extensions": {"KHR_materials_diffuse_transmission": {
            "diffuseTransmissionFactor": factor,
            "diffuseTransmissionColorFactor": color,
        }},
    })
}

/// The same that is in part a metal.
fn metallic(share: f64) -> Value {
    let mut material = curtain([0.6; 3], json!(0.5), json!([0.5, 0.5, 0.5]));
    material["pbrMetallicRoughness"]["metallicFactor"] = json!(share);
    material
}

/// A metal reflects its base colour and lets nothing through: of a material that is a quarter metal three quarters pass, and what does
/// not pass is reflected. What a side file measures is as it was measured.
#[test]
fn metals_let_nothing_through() {
    let scene = read(&metallic(0.25), &json!({})).unwrap();
    let (material, strength) = (&scene.materials[0], 0.5 * 0.75);
    let sheet = material.sheet.as_ref().unwrap();
    for (rho, tau) in material.reflectance.iter().zip(&sheet.transmittance) {
        close(*rho, (1.0 - strength) * 0.6, 1e-6, "reflected");
        close(*tau, strength * 0.5, 1e-6, "let through");
    }
    let measured = json!({"materials": {"curtain": {"transmission": 0.3}}});
    let scene = read(&metallic(1.0), &measured).unwrap();
    let sheet = scene.materials[0].sheet.as_ref().unwrap();
    close(sheet.transmittance[0], 0.3, 1e-12, "measured");
}

/// `(1 - f) b` is reflected, `f c` passes, and the sheet has two sides whatever the file says.
#[test]
fn what_gltf_says_of_a_sheet() {
    let material = curtain([0.6; 3], json!(0.25), json!([0.8, 0.8, 0.8]));
    let scene = read(&material, &json!({})).unwrap();
    let curtain = &scene.materials[0];
    let sheet = curtain.sheet.as_ref().unwrap();
    for k in 0..BANDS {
        close(curtain.reflectance[k], 0.45, 1e-6, "reflected");
        close(sheet.transmittance[k], 0.2, 1e-6, "passes");
    }
    assert_eq!(curtain.sides, Sides::Both);
    assert_eq!(scene.warnings, Vec::<String>::new());
    // White on white keeps a thousandth.
    let white = read(
        &self::curtain([1.0; 3], json!(0.5), json!([1, 1, 1])),
        &json!({}),
    )
    .unwrap();
    let sheet = white.materials[0].sheet.as_ref().unwrap();
    let sum = white.materials[0].reflectance[20] + sheet.transmittance[20];
    assert!((0.99..=0.999_000_1).contains(&sum), "{sum}");
    // Nothing passes: no sheet.
    let none = self::curtain([0.6; 3], json!(0.0), json!([1, 1, 1]));
    let scene = read(&none, &json!({})).unwrap();
    assert!(scene.materials[0].sheet.is_none() && scene.materials[0].sides == Sides::Front);
    assert_eq!(scene.materials[0].reflectance, [f64::from(0.6_f32); BANDS]);
}

/// A side file takes the place of what glTF says; both sides may reflect by spectra of their own.
#[test]
fn what_a_side_file_says_of_a_sheet() {
    let material = curtain([0.6; 3], json!(0.25), json!([1.0, 0.5, 0.5]));
    let side = json!({"materials": {"curtain": {
        "transmission": {"csv": "380,0.1\n780,0.3"},
        "reflectance": {"csv": "380,0.4\n780,0.4"},
        "back_reflectance": {"csv": "380,0.6\n780,0.6"},
    }}});
    let scene = read(&material, &side).unwrap();
    let curtain = &scene.materials[0];
    let sheet = curtain.sheet.as_ref().unwrap();
    close(curtain.reflectance[10], 0.4, 1e-6, "front");
    close(sheet.back.unwrap()[10], 0.6, 1e-6, "back");
    close(sheet.transmittance[0], 0.1015, 0.01, "passes");
    assert!(sheet.transmittance[63] > 0.29);
    let plain = json!({"materials": {"curtain": {"transmission": 0.3}}});
    let scene = read(&json!({"name": "curtain"}), &plain);
    assert!(
        scene.is_err_and(|e| e.contains("come to")),
        "a white base colour"
    );
}

/// Whatever is wrong is told with the file, the material and, where more leaves than comes, the wavelengths.
#[test]
fn wrong_sheets_are_refused_by_name() {
    let grey = curtain([0.6; 3], json!(0.25), json!([1, 1, 1]));
    let with = |entry: Value| json!({"materials": {"curtain": entry}});
    for (material, side, wanted) in [
        (
            &grey,
            with(json!({"transmission": {"csv": "500,0.1\n600,0.7\n780,0.7"}})),
            vec![
                "room.glb",
                "material 'curtain'",
                "its front",
                "come to",
                "nm",
                "below 1",
            ],
        ),
        (
            &grey,
            with(json!({"transmission": 0.5, "back_reflectance": {"csv": "400,0.7\n700,0.7"}})),
            vec!["its back", "come to 1.200 between 380 and 780 nm"],
        ),
        (
            &grey,
            with(json!({"transmission": 1.5})),
            vec!["transmission: '1.5' goes beyond 0 to 1"],
        ),
        (
            &json!({"name": "curtain"}),
            with(json!({"back_reflectance": {"name": "macbeth/white"}})),
            vec!["material 'curtain'", "back_reflectance", "no sheet"],
        ),
        (
            &grey,
            with(json!({"transmission": 0.5, "transmittance": 0.5})),
            vec!["a pane lets light through and does nothing else"],
        ),
        (
            &curtain([0.6; 3], json!("much"), json!([1, 1, 1])),
            json!({}),
            vec!["diffuseTransmissionFactor"],
        ),
        (
            &curtain([0.6; 3], json!(0.3), json!([1, 1])),
            json!({}),
            vec!["diffuseTransmissionColorFactor"],
        ),
        (
            &metallic(1.0),
            json!({}),
            vec![
                "material 'curtain'",
                "is a metal and lets light through",
                "set its metallicFactor to 0",
            ],
        ),
    ] {
        let text = read(material, &side).expect_err("is refused");
        for part in wanted {
            assert!(text.contains(part), "{part}\n-- in --\n{text}");
        }
    }
}

/// What a path tracer finds on both sides of sheets, with colours, in the room of `scenes`.
#[test]
fn the_path_tracer_agrees() {
    let bake = curtained(0.7);
    let reference = PathReference::new(&bake, 150, 1 << 14, 3);
    let written = bake.baked(&|_, _| {});
    for report in [
        Report::against(&bake, &reference),
        Report::of_file(&bake, &written, &reference),
    ] {
        println!(
            "dE00 {:?}, bias {:?}, noise {:.3}, estimate {:?}",
            report.de2000.mean, report.bias, report.noise_de2000, report.estimate_de2000
        );
        assert!(report.de2000.mean.value < 0.6, "{:?}", report.de2000);
        assert!(report.bias.value.abs() < 0.01, "{:?}", report.bias);
    }
}

fn curtained(error: f64) -> Bake {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/curtained.glb");
    let scene = Scene::load(path, &Options::default()).unwrap();
    baked_to(error, scene)
}

/// Relit without a change, a room is what it was; a checkpoint goes on to the same bytes.
#[test]
fn what_is_kept_knows_sheets() {
    let room = || {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/curtained.glb");
        Scene::load(path, &Options::default()).unwrap()
    };
    let settings = Settings {
        error: 4.0,
        rounds: 3,
        ..Settings::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let [cache, checkpoint] = ["cache", "checkpoint"].map(|name| folder.path().join(name));
    let mut bake = Bake::new(room(), settings.clone());
    bake.keep();
    bake.step();
    bake.step();
    bake.save(&checkpoint).unwrap();
    bake.step();
    let mut resumed = Bake::new(room(), settings.clone());
    resumed.keep();
    resumed.resume(&checkpoint).unwrap();
    resumed.step();
    let [baked, again] = [&bake, &resumed].map(|bake| baked_within(4000, bake));
    for (one, two) in baked.surfaces.iter().zip(&again.surfaces) {
        assert_eq!(one.vertices, two.vertices);
    }
    bake.write_cache(&baked, &cache, u64::MAX).unwrap();
    // At half the brightness of all lamps everything is half as bright.
    let mut dimmed = room();
    let lamps = haarlight::scene::facts::Facts::of(&dimmed).lights;
    for lamp in lamps {
        dimmed.dim(&lamp.name, 0.5).unwrap();
    }
    let mut relighter = Relighter::open(&cache, dimmed).unwrap();
    let relit = relighter.relight().unwrap().baked;
    let (mut gap, mut whole, mut on_sheets) = (0.0, 0.0, 0);
    for (one, two) in baked.surfaces.iter().zip(&relit.surfaces) {
        let material = bake.scene().surfaces[one.surface].material;
        if bake.scene().materials[material].sheet.is_none() {
            continue;
        }
        for (one, two) in one.vertices.iter().zip(&two.vertices) {
            gap += f64::from((0.5 * one.radiosity[1] - two.radiosity[1]).abs());
            whole += f64::from(two.radiosity[1]);
            on_sheets += 1;
        }
    }
    println!("off by {:.1e} of what is relit", gap / whole);
    assert!(
        on_sheets > 100 && gap < 2e-3 * whole,
        "{on_sheets} {gap} {whole}"
    );
}

/// A panel flush in an opaque ceiling, lit from above alone: what both have in common, edge and plane, has light of its own on each. The room
/// is kept and relit as it was, and no sheet any more it is refused by name.
#[test]
fn a_flush_panel_leaves_the_ceiling_its_own_light() {
    let room = |through: f64| {
        let mut room = Room::new();
        let paint = room.paint(0.5);
        let panel = match through > 0.0 {
            true => room.sheet(even(0.3), even(0.3), even(through)),
            false => room.paint(0.3),
        };
        room.two_sided(paint);
        room.two_sided(panel);
        let z = 2.0 * DVec3::Z;
        room.quad(DVec3::ZERO, z, 4.0 * DVec3::X, paint);
        room.quad(dvec3(0.0, 2.0, 0.0), 2.0 * DVec3::X, z, paint);
        room.quad(dvec3(2.0, 2.0, 0.0), 2.0 * DVec3::X, z, panel);
        room.point(dvec3(3.0, 3.0, 1.0), 1000.0);
        room.scene()
    };
    let settings = Settings {
        error: 1.0,
        ..Settings::default()
    };
    let mut bake = Bake::new(room(0.6), settings);
    bake.keep();
    bake.run();
    let baked = bake.baked(&|_, _| {});
    // Of the ceiling's lower side.
    let ceiling = baked
        .surfaces
        .iter()
        .find(|s| s.surface == 1 && !s.back)
        .unwrap();
    let lit: Vec<f64> = (ceiling.vertices.iter())
        .map(|v| f64::from(v.irradiance[1]))
        .collect();
    let at = |x: f64| (dvec3(x, 2.0, 1.0), DVec3::NEG_Y);
    let [far, near] = [0.2, 1.9].map(|x| mean_lux(&bake, &[at(x)]));
    // The panel shows more than ten times as much, for the lamp is behind it.
    let most = 1.5 * far.max(near);
    assert!(lit.iter().all(|&e| e < most), "{lit:?} {far} {near}");
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    bake.write_cache(&baked, &cache, u64::MAX).unwrap();
    let relit = Relighter::open(&cache, room(0.6))
        .unwrap()
        .relight()
        .unwrap();
    for (one, two) in baked.surfaces.iter().zip(&relit.baked.surfaces) {
        for (one, two) in one.vertices.iter().zip(&two.vertices) {
            let (one, two) = (f64::from(one.radiosity[1]), f64::from(two.radiosity[1]));
            assert!((one - two).abs() < 1e-3 * one.max(1.0), "{one} {two}");
        }
    }
    let refused = Relighter::open(&cache, room(0.0))
        .err()
        .unwrap()
        .to_string();
    assert!(refused.contains("another shape"), "{refused}");
}
