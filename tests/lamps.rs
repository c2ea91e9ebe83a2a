//! Lamps as they are sold: what a profile on a light, on a node or on a surface brings, against closed forms and quadrature.

use crate::common;
use crate::common::built::glanced;

use common::Room;
use glam::{DVec3, dvec3};
use haarlight::audit::Audit;
use haarlight::color::{KM, Observer};
use haarlight::geometry::NO_PLANE;
use haarlight::geometry::lambert_polygon;
use haarlight::keep::Relighter;
use haarlight::scene::effects::{EffectKind, Plan};
use haarlight::scene::facts::Facts;
use haarlight::scene::{Options, Scene};
use haarlight::solve::{Bake, Settings, reference::Reference};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::Path;

/// Greatest error of a point, as in the rooms of CIE 171.
const POINT: f64 = 5e-3;
/// Looks down: -Z of the node is -Y of the world; C0 is +X, C90 is -Z.
const DOWN: [f64; 4] = [
    -std::f64::consts::FRAC_1_SQRT_2,
    0.0,
    0.0,
    std::f64::consts::FRAC_1_SQRT_2,
];

/// cd of a lamp without symmetry, at gamma and C in degrees.
fn lopsided(gamma: f64, c: f64) -> f64 {
    let (g, c) = (gamma.to_radians(), c.to_radians());
    if gamma > 90.0 {
        return 0.0;
    }
    800.0 * g.cos() * (1.0 + 0.5 * g.sin() * c.cos() + 0.3 * g.sin() * c.sin())
}

/// An LM-63 file with a step of angles.
fn ies(step: f64, candela: impl Fn(f64, f64) -> f64) -> String {
    let list = |to: f64| -> Vec<f64> {
        (0..=(to / step) as u32)
            .map(|k| step * f64::from(k))
            .collect()
    };
    let (vertical, horizontal) = (list(90.0), list(360.0));
    let words = |numbers: &mut dyn Iterator<Item = f64>| -> String {
        numbers.map(|x| format!("{x:.6} ")).collect()
    };
    let mut text = format!(
        "IES:LM-63-2019\n[LUMINAIRE] Lopsided\nTILT=NONE\n1 -1 1 {} {} 1 2 0 0 0 1 1 10\n",
        vertical.len(),
        horizontal.len()
    );
    text += &words(&mut vertical.iter().copied());
    text += "\n";
    text += &words(&mut horizontal.iter().copied());
    for h in horizontal {
        text += "\n";
        text += &words(&mut vertical.iter().map(|v| candela(*v, h)));
    }
    text
}

/// A EULUMDAT file of a lamp of 2000 lm of which 80 % leave the luminaire, cd/klm by the cosine below it: 1600 lm.
fn eulumdat() -> String {
    let steps: Vec<f64> = (0..=18).map(|k| 5.0 * f64::from(k)).collect();
    let planes: Vec<f64> = (0..24).map(|k| 15.0 * f64::from(k)).collect();
    let mut lines: Vec<String> = [
        "none", "1", "1", "24", "15", "19", "5", "-", "Disc", "-", "-", "-", "100", "0", "50",
        "90", "0", "0", "0", "0", "0", "100", "80", "1", "0", "1", "2", "LED", "2000", "4000",
        "80", "20",
    ]
    .map(String::from)
    .into();
    lines.extend(vec!["0".to_owned(); 10]);
    lines.extend(planes.iter().chain(&steps).map(f64::to_string));
    let candela = |gamma: f64| 800.0 / PI * gamma.to_radians().cos();
    lines.extend(steps.iter().map(|gamma| format!("{:.4}", candela(*gamma))));
    lines.join("\n")
}

/// A corner, both edges from there, and the material.
type Quad = ([f32; 3], [f32; 3], [f32; 3], usize);

/// Quads as surfaces of a file: corner, two sides (the front is where their product points), material.
fn quads(room: &mut Room, quads: &[Quad]) {
    let mut nodes = Vec::new();
    room.json["meshes"] = json!([]);
    for (k, (o, u, v, material)) in quads.iter().enumerate() {
        let at = |s: f32, t: f32| std::array::from_fn(|i| o[i] + s * u[i] + t * v[i]);
        let corners: [[f32; 3]; 4] = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        let position = room.vectors(&corners);
        let indices = room.accessor(&[0, 1, 2, 0, 2, 3], common::U8, "SCALAR", 6);
        let primitive =
            json!({"attributes": {"POSITION": position}, "indices": indices, "material": material});
        common::push(&mut room.json["meshes"], json!({"primitives": [primitive]}));
        nodes.push(json!({"name": format!("quad {k}"), "mesh": k}));
    }
    room.json["nodes"] = json!(nodes);
}

fn material(name: &str, grey: f64) -> Value {
    json!({"name": name, "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [grey, grey, grey, 1]}})
}

/// A black floor of 12 m, its middle at the origin.
fn floor() -> Room {
    let mut room = Room::empty();
    room.json["materials"] = json!([material("floor", 0.0), material("panel", 0.0)]);
    quads(
        &mut room,
        &[([-6.0, 0.0, -6.0], [0.0, 0.0, 12.0], [12.0, 0.0, 0.0], 0)],
    );
    room
}

fn node(room: &mut Room, node: Value) {
    let index = common::push(&mut room.json["nodes"], node);
    let nodes: Vec<usize> = (0..=index).collect();
    room.json["scenes"][0]["nodes"] = json!(nodes);
}

/// A light of the file called "lamp", 2.5 m above the floor.
fn with_light(mut room: Room, light: Value) -> Room {
    room.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    room.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    let carried = json!({"KHR_lights_punctual": {"light": 0}});
    node(
        &mut room,
        json!({"translation": [0, 2.5, 0], "rotation": DOWN, "extensions": carried}),
    );
    room
}

/// Loads a room with files beside it.
fn loaded(room: &Room, files: &[(&str, &str)]) -> haarlight::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let path = folder.path().join("room.glb");
    std::fs::write(&path, room.glb()).unwrap();
    Scene::load(&path, &Options::default())
}

fn side(value: &Value) -> String {
    value.to_string()
}

fn point_light() -> Room {
    with_light(
        floor(),
        json!({"name": "lamp", "type": "point", "intensity": 5}),
    )
}

fn profiled(multiplier: f64) -> Scene {
    let wish = json!({"lights": {"lamp": {"profile": "lamp.ies", "multiplier": multiplier}}});
    loaded(
        &point_light(),
        &[
            ("lamp.ies", &ies(5.0, lopsided)),
            ("room.spectra.json", &side(&wish)),
        ],
    )
    .unwrap()
}

fn lux(bake: &Bake, at: DVec3) -> f64 {
    bake.probe(&[(at, DVec3::Y)])[0].xyz[1]
}

/// Where the floor is seen from `height` at angles of the file.
fn below(height: f64, gamma: f64, c: f64) -> DVec3 {
    let (r, c) = (height * gamma.to_radians().tan(), c.to_radians());
    dvec3(r * c.cos(), 0.0, -r * c.sin())
}

/// `E = I cos^3 / h^2`, whoever says that the light has the profile.
#[test]
fn a_profile_lights_the_floor_by_its_closed_form() {
    let by_side_file = profiled(1.0);
    let mut by_node = floor();
    let bytes = ies(5.0, lopsided);
    let view = by_node.view(bytes.as_bytes());
    by_node.json["extensionsUsed"] = json!(["EXT_lights_ies"]);
    by_node.json["extensionsRequired"] = json!(["EXT_lights_ies"]);
    by_node.json["extensions"] = json!({"EXT_lights_ies": {"lights": [
        {"name": "lamp", "bufferView": view, "mimeType": "application/x-ies-lm-63"}]}});
    let carried = json!({"EXT_lights_ies": {"light": 0}});
    node(
        &mut by_node,
        json!({"translation": [0, 2.5, 0], "rotation": DOWN, "scale": [3, 3, 3], "extensions": carried}),
    );
    let by_uri = |room: &Room| {
        let mut room = room.clone();
        room.json["extensions"]["EXT_lights_ies"]["lights"][0] = json!({"uri": "lamp.ies"});
        loaded(&room, &[("lamp.ies", &bytes)]).unwrap()
    };
    let scenes = [
        by_side_file,
        loaded(&by_node, &[]).unwrap(),
        by_uri(&by_node),
    ];
    for scene in scenes {
        assert_eq!(scene.warnings, Vec::<String>::new());
        let bake = glanced(scene);
        for gamma in [0.0, 5.0, 20.0, 45.0, 60.0, 65.0] {
            for c in [0.0, 30.0, 90.0, 180.0, 240.0, 315.0] {
                let want = lopsided(gamma, c) * gamma.to_radians().cos().powi(3) / 2.5_f64.powi(2);
                let found = lux(&bake, below(2.5, gamma, c));
                println!("{gamma} {c}: {found} for {want}");
                assert!(
                    (found / want - 1.0).abs() < 1e-4,
                    "{gamma} {c}: {found} {want}"
                );
            }
        }
    }
}

#[test]
fn a_lamp_is_named_with_its_profile_and_lumens() {
    let scene = profiled(0.5);
    let facts = Facts::of(&scene);
    let lamp = &facts.lights[0];
    let profile = lamp.profile.as_ref().unwrap();
    assert_eq!(
        (lamp.kind, profile.luminaire.as_str()),
        ("measured", "Lopsided")
    );
    // int 800 cos (1 + ...) over the hemisphere: the odd parts vanish.
    assert!((profile.flux_lm / (800.0 * PI) - 1.0).abs() < 3e-3);
    assert!((lamp.flux_lm.unwrap() / (0.5 * profile.flux_lm) - 1.0).abs() < 1e-9);
    let plan = Plan::of(&scene);
    assert!(plan.runs(EffectKind::MeasuredLamps) && !plan.runs(EffectKind::PointLights));
    let text = plan.to_string();
    let lumens = lamp.flux_lm.unwrap();
    let said = format!("'lamp' as 'Lopsided', {lumens:.0} lm");
    assert!(text.contains(&said), "{said}: {text}");
    let plain = Plan::of(&loaded(&point_light(), &[]).unwrap());
    assert!(!plain.runs(EffectKind::MeasuredLamps));
}

/// A black room around the lamp receives the lumens of the file, wherever it hangs and from whatever it shines.
#[test]
fn flux_closes_with_the_lumens_of_the_file() {
    let files = [("lamp.ies", 800.0 * PI), ("lamp.ldt", 1600.0)];
    for (panel, (file, lumens)) in files.into_iter().flat_map(|f| [(false, f), (true, f)]) {
        let mut room = Room::empty();
        room.json["materials"] = json!([material("walls", 0.0), material("panel", 0.0)]);
        let mut all: Vec<_> = [
            ([0.0, 0.0, 0.0], [0.0, 0.0, 3.0], [4.0, 0.0, 0.0]),
            ([0.0, 2.5, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 3.0]),
            ([0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.5, 0.0]),
            ([0.0, 0.0, 3.0], [0.0, 2.5, 0.0], [4.0, 0.0, 0.0]),
            ([0.0, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 3.0]),
            ([4.0, 0.0, 0.0], [0.0, 0.0, 3.0], [0.0, 2.5, 0.0]),
        ]
        .map(|(o, u, v)| (o, u, v, 0))
        .into();
        if panel {
            all.push(([1.5, 2.2, 1.2], [1.2, 0.0, 0.0], [0.0, 0.0, 0.3], 1));
        }
        quads(&mut room, &all);
        let nodes: Vec<usize> = (0..all.len()).collect();
        room.json["scenes"][0]["nodes"] = json!(nodes);
        let wish = match panel {
            true => {
                json!({"materials": {"panel": {"emission": {"profile": file, "name": "cie/A"}}}})
            }
            false => {
                room.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
                room.json["extensions"] =
                    json!({"KHR_lights_punctual": {"lights": [{"name": "lamp", "type": "spot"}]}});
                let carried = json!({"KHR_lights_punctual": {"light": 0}});
                node(
                    &mut room,
                    json!({"translation": [1, 2, 1.2], "rotation": DOWN, "extensions": carried}),
                );
                json!({"lights": {"lamp": {"profile": file, "name": "cie/A"}}})
            }
        };
        let files = [
            ("lamp.ies", &*ies(5.0, lopsided)),
            ("lamp.ldt", &*eulumdat()),
            ("room.spectra.json", &*side(&wish)),
        ];
        let scene = loaded(&room, &files).unwrap();
        let lamp = &Facts::of(&scene).lights[0];
        let want = lamp.profile.as_ref().unwrap().flux_lm;
        assert!((lamp.flux_lm.unwrap() / want - 1.0).abs() < 1e-9);
        let bake = glanced(scene);
        let flux = bake.rounds().last().unwrap().flux;
        assert!((flux.sent.lamps_lm / want - 1.0).abs() < 1e-6, "{flux:?}");
        assert!(
            (flux.received_lm / want - 1.0).abs() < POINT,
            "{panel} {flux:?}"
        );
        let off = flux.received_lm / lumens - 1.0;
        println!("{file}, {panel}: {} for {lumens}", flux.received_lm);
        assert!(off.abs() < POINT, "{file} {panel}: {off}");
        let sent = flux.sent;
        assert!((sent.to_fronts + sent.to_backs + sent.outside - 1.0).abs() < 1e-9);
    }
}

/// A panel of 1.2 m by .6 m, its front down, over the floor.
fn panel_room(height: f32, wish: &Value, more: &[Quad]) -> Scene {
    let mut room = floor();
    let mut all = vec![
        ([-6.0, 0.0, -6.0], [0.0, 0.0, 12.0], [12.0, 0.0, 0.0], 0),
        ([-0.6, height, -0.3], [1.2, 0.0, 0.0], [0.0, 0.0, 0.6], 1),
    ];
    all.extend(more);
    quads(&mut room, &all);
    let nodes: Vec<usize> = (0..all.len()).collect();
    room.json["scenes"][0]["nodes"] = json!(nodes);
    let wish = json!({"materials": {"panel": {"emission": wish}}});
    let lambert = ies(1.0, |g, _| {
        if g < 90.0 {
            500.0 * g.to_radians().cos()
        } else {
            0.0
        }
    });
    loaded(
        &room,
        &[
            ("lamp.ies", &ies(5.0, lopsided)),
            ("lambert.ies", &lambert),
            ("room.spectra.json", &side(&wish)),
        ],
    )
    .unwrap()
}

/// Intensity of the file between its angles, by its definition.
fn bilinear(d: DVec3) -> f64 {
    let gamma = (-d.y).clamp(-1.0, 1.0).acos().to_degrees();
    let c = (-d.z).atan2(d.x).to_degrees().rem_euclid(360.0);
    let (g0, c0) = ((gamma / 5.0).floor(), (c / 5.0).floor());
    let (s, t) = (gamma / 5.0 - g0, c / 5.0 - c0);
    let at = |g: f64, c: f64| lopsided((5.0 * g).min(90.0), 5.0 * c);
    if gamma > 90.0 {
        return 0.0;
    }
    (1.0 - t) * ((1.0 - s) * at(g0, c0) + s * at(g0 + 1.0, c0))
        + t * ((1.0 - s) * at(g0, c0 + 1.0) + s * at(g0 + 1.0, c0 + 1.0))
}

/// Near and far: the surface's area with the profile's directions, by plain quadrature.
#[test]
fn a_panel_shines_from_its_area() {
    for height in [0.4_f64, 2.5, 40.0] {
        let scene = panel_room(
            height as f32,
            &json!({"profile": "lamp.ies", "name": "cie/D65"}),
            &[],
        );
        let bake = glanced(scene);
        for at in [
            [0.0, 0.0],
            [0.5, 0.2],
            [-1.0, 0.7],
            [2.0, -3.0],
            [-5.0, 5.0],
        ] {
            let at = dvec3(at[0], 0.0, at[1]);
            let n = 400;
            let mut want = 0.0;
            for i in 0..n {
                for k in 0..n {
                    let [s, t] = [i, k].map(|x| (f64::from(x) + 0.5) / f64::from(n));
                    let from = dvec3(-0.6 + 1.2 * s, f64::from(height as f32), -0.3 + 0.6 * t);
                    let way = at - from;
                    let (r2, d) = (way.length_squared(), way.normalize());
                    want += bilinear(d) * -d.y / r2 / f64::from(n * n);
                }
            }
            let found = lux(&bake, at);
            println!("{height} {at}: {found} for {want}");
            assert!(
                (found / want - 1.0).abs() < 2e-3,
                "{height} {at}: {found} {want}"
            );
        }
    }
}

/// With the profile of a Lambertian lamp a surface is the emissive surface that it would be without.
#[test]
fn a_lambertian_profile_changes_nothing() {
    // 500 cd make 500 pi lm; a luminance of 500 / .72 m2.
    let block = [
        ([-0.4, 0.8, -0.4], [0.0, 0.0, 0.8], [0.8, 0.0, 0.0], 0),
        ([-0.4, 0.8, -0.4], [0.8, 0.0, 0.0], [0.0, 0.0, 0.8], 0),
    ];
    let with = json!({"profile": "lambert.ies", "name": "cie/F11"});
    let without = json!({"name": "cie/F11", "luminance_cd_m2": 500.0 / 0.72});
    let [a, b] = [with, without].map(|wish| glanced(panel_room(2.0, &wish, &block)));
    for at in [
        [0.0, 0.0],
        [0.3, 0.3],
        [0.7, 0.0],
        [-1.0, 0.4],
        [1.6, -1.1],
        [4.0, 4.0],
    ] {
        let [a, b] = [&a, &b].map(|bake| lux(bake, dvec3(at[0], 0.0, at[1])));
        assert!((a - b).abs() < 0.02 * b + 0.5, "{at:?}: {a} {b}");
    }
    // Where nothing is in between, to the last per mille.
    let [a, b] = [&a, &b].map(|bake| lux(bake, dvec3(3.0, 0.0, 2.0)));
    assert!((a / b - 1.0).abs() < 2e-3, "{a} {b}");
}

/// Right below the panel and beside its edge, where its parts are far from small: the closed form of a Lambertian rectangle.
#[test]
fn a_panel_is_right_close_by() {
    let wish = json!({"profile": "lambert.ies", "name": "cie/D65"});
    let bake = glanced(panel_room(2.0, &wish, &[]));
    let corners = [[-0.6, -0.3], [0.6, -0.3], [0.6, 0.3], [-0.6, 0.3]];
    let panel = corners.map(|[x, z]| dvec3(x, 2.0, z));
    for below in [0.1, 0.03, 0.01, 2e-3] {
        for (at, normal) in [
            (dvec3(0.1, 2.0 - below, 0.05), DVec3::Y),
            (dvec3(0.6 - below, 2.0 - below, 0.0), DVec3::Y),
            (dvec3(-0.6, 2.0 - below, 0.1), DVec3::X),
        ] {
            let want = PI * 500.0 / 0.72 * lambert_polygon(at, normal, &panel);
            let found = bake.probe(&[(at, normal)])[0].xyz[1];
            println!("{below} {at} {normal}: {found} for {want}");
            assert!(
                (found / want - 1.0).abs() < 0.01,
                "{below} {at} {normal}: {found} {want}"
            );
        }
    }
}

/// `--scale` moves what shines, and changes no lumens.
#[test]
fn a_scaled_panel_is_shown_as_bright_as_it_is() {
    let wish = json!({"profile": "lambert.ies", "name": "cie/D65"});
    let scene = panel_room(2.0, &wish, &[]);
    let flux = |scene: &Scene| Facts::of(scene).lights[0].flux_lm.unwrap();
    let before = flux(&scene);
    let after = flux(&scene.scaled(0.01));
    assert!((after / before - 1.0).abs() < 1e-6, "{before} {after}");
}

/// The audit and the dense reference follow profiles by themselves.
#[test]
fn audit_and_reference_agree() {
    let block = [
        ([0.2, 0.8, -0.4], [0.0, 0.0, 0.8], [0.8, 0.0, 0.0], 0),
        ([0.2, 0.8, -0.4], [0.8, 0.0, 0.0], [0.0, 0.0, 0.8], 0),
    ];
    let scenes = [
        profiled(1.0),
        panel_room(
            2.0,
            &json!({"profile": "lamp.ies", "name": "cie/A", "turn_deg": 30}),
            &block,
        ),
    ];
    let y = Observer::cie1931().weights(&haarlight::spectrum::Grid::default())[1];
    for scene in scenes {
        let reference = Reference::new(&scene, 2, 1).unwrap();
        let solution = reference.solve();
        let places = [[0.0, 0.0], [0.4, 0.1], [1.2, 0.3], [-1.5, 1.0]];
        let points: Vec<_> = places.map(|[x, z]| (dvec3(x, 0.0, z), DVec3::Y)).into();
        let dense = reference.gather(&scene, &solution, &points, 1);
        let bake = glanced(scene);
        let centre = bake.mesh().centre;
        let audit = Audit::new(bake.scene(), bake.mesh(), bake.rays());
        let starts: Vec<_> = points
            .iter()
            .map(|(p, n)| (*p - centre, *n, NO_PLANE))
            .collect();
        let answers = audit.irradiance(&starts, &[65_536; 4], 7);
        for (k, (point, _)) in points.iter().enumerate() {
            let found = lux(&bake, *point);
            let dot = |bands: &[f64; 64]| (0..64).map(|l| KM * bands[l] * y[l]).sum::<f64>();
            let (mean, error) = answers[k].linear(&y.map(|y| KM * y));
            assert!(
                (found - mean).abs() < 4.0 * error + 0.01 * mean + 1e-3,
                "{point}: {found} {mean} {error}"
            );
            assert!(
                (found - dot(&dense[k])).abs() < 0.02 * found + 0.5,
                "{point}: {found} {}",
                dot(&dense[k])
            );
        }
    }
}

/// Another multiplier and spectrum relight; another profile is refused with a word.
#[test]
fn a_measured_lamp_can_be_relit() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    let mut bake = Bake::new(
        profiled(1.0),
        Settings {
            error: 2.0,
            ..Settings::default()
        },
    );
    bake.keep();
    bake.run();
    let first = bake.baked(&|_, _| {});
    bake.write_cache(&first, &cache, u64::MAX).unwrap();
    let mut relighter = Relighter::open(&cache, profiled(0.25)).unwrap();
    let relit = relighter.relight().unwrap();
    let pairs = first.surfaces[0]
        .vertices
        .iter()
        .zip(&relit.baked.surfaces[0].vertices);
    for (a, b) in pairs {
        let (a, b) = (a.irradiance[1], b.irradiance[1]);
        assert!((b - 0.25 * a).abs() <= 1e-3 * a + 1e-6, "{a} {b}");
    }
    let wish = json!({"lights": {"lamp": {"profile": "lamp.ies"}}});
    let other = ies(5.0, |g, c| 2.0 * lopsided(g, c) + g.min(80.0));
    let files = [("lamp.ies", &*other), ("room.spectra.json", &*side(&wish))];
    let refused = Relighter::open(&cache, loaded(&point_light(), &files).unwrap());
    let message = refused.err().unwrap().to_string();
    assert!(
        message.contains("place or profile of light 'lamp' changed"),
        "{message}"
    );
}

#[test]
fn what_is_wrong_with_a_profile_is_said_with_its_line() {
    let good = ies(5.0, lopsided);
    let try_one = |wish: Value, file: &str| {
        let wish = json!({"lights": {"lamp": wish}});
        let files = [("lamp.ies", file), ("room.spectra.json", &*side(&wish))];
        loaded(&point_light(), &files).unwrap_err().to_string()
    };
    for (wish, file, text) in [
        (
            json!({"profile": "lamp.ies"}),
            good.replace(" 1 2 0 0", " 9 2 0 0"),
            "'lamp.ies', line 4",
        ),
        (json!({"profile": "none.ies"}), good.clone(), "none.ies"),
        (
            json!({"profile": 7}),
            good.clone(),
            "not the name of a file",
        ),
        (
            json!({"profile": "lamp.ies", "multiplier": -1}),
            good.clone(),
            "multiplier is -1",
        ),
        (
            json!({"name": "cie/A", "flux_lm": 5}),
            good.clone(),
            "goes with a profile",
        ),
        (
            json!({"profil": "lamp.ies"}),
            good.clone(),
            "nearest names are profile",
        ),
    ] {
        let said = try_one(wish, &file);
        assert!(said.contains(text), "{text}\n-- in --\n{said}");
    }
    let sun = with_light(floor(), json!({"name": "lamp", "type": "directional"}));
    let wish = json!({"lights": {"lamp": {"profile": "lamp.ies"}}});
    let said = loaded(
        &sun,
        &[("lamp.ies", &good), ("room.spectra.json", &side(&wish))],
    );
    assert!(said.unwrap_err().to_string().contains("parallel light"));
}

/// A lamp and a dye on no surface make no light spectrum.
#[test]
fn what_no_surface_shows_gives_no_light() {
    let mut room = point_light();
    common::push(&mut room.json["materials"], material("dye", 0.5));
    let csv = |name: &str| json!({"csv": name});
    let dye = json!({"excitation": csv("taken.csv"), "emission": csv("given.csv"), "yield": 0.9});
    let lamp = json!({"name": "cie/F2", "luminance_cd_m2": 100});
    let wish = json!({"materials": {"panel": {"emission": lamp}, "dye": {"fluorescence": dye}}});
    let files = [
        ("taken.csv", "400,0.5\n450,0.5\n"),
        ("given.csv", "500,1\n600,1\n"),
        ("room.spectra.json", &side(&wish)),
    ];
    let scene = loaded(&room, &files).unwrap();
    assert_eq!(scene.spectra.len(), 1);
    assert!(!Plan::of(&scene).runs(EffectKind::LightSpectra));
}

/// The rooms of this project load as they did: nothing measured, nothing of it in the plan.
#[test]
fn rooms_without_a_profile_have_none() {
    let scene = Scene::load(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/convex.glb"),
        &Options::default(),
    )
    .unwrap();
    assert!(scene.lights.iter().all(|light| light.luminaire.is_none()));
    assert!(
        scene
            .materials
            .iter()
            .all(|m| m.emission.is_none() || m.even_emission().is_some())
    );
}

#[test]
fn what_is_wrong_with_a_profile_in_the_file_is_said() {
    let said = |profiles: Value, carried: Value| {
        let mut room = floor();
        room.json["extensionsUsed"] = json!(["EXT_lights_ies"]);
        room.json["extensions"] = json!({"EXT_lights_ies": {"lights": profiles}});
        node(
            &mut room,
            json!({"name": "n", "extensions": {"EXT_lights_ies": carried}}),
        );
        let loaded = loaded(&room, &[("lamp.ies", "IESNA91\nTILT=NONE\n1 x")]);
        loaded.unwrap_err().to_string()
    };
    for (profiles, carried, text) in [
        (json!([]), json!({"light": 3}), "refers to profile 3"),
        (
            json!([{}]),
            json!({"light": 0}),
            "neither a URI nor a bufferView",
        ),
        (
            json!([{"bufferView": 99}]),
            json!({"light": 0}),
            "bufferView 99",
        ),
        (
            json!([{"uri": "gone.ies"}]),
            json!({"light": 0}),
            "gone.ies",
        ),
        (
            json!([{"uri": "lamp.ies"}]),
            json!({"light": 0}),
            "line 3: 'x' stands where",
        ),
        (json!([7]), json!({"light": 0}), "profile 0"),
        (json!([{}]), json!({}), "does not say which light"),
        (
            json!([{"uri": "lamp.ies"}]),
            json!({"light": 0, "multiplier": -2}),
            "negative multiplier",
        ),
    ] {
        let said = said(profiles, carried);
        assert!(said.contains(text), "{text}\n-- in --\n{said}");
    }
}
