//! A furnished living room, 6 x 5 x 2.7 m: windows (sky panels), lamps, textures, a mirrored and an instanced node.
//!
//! Furniture is of boxes, rounded boxes and bodies of revolution, whose number of steps grows with the triangles asked
//! for: 1 000 to 500 000 and beyond.

use super::cells::Cells;
use super::glb::{Glb, Mesh, matt};
use super::shapes::{block, lathe, picture, rounded, sphere, tube};
use super::simple::{down, draw, within};
use super::textures;
use glam::{DMat4, dvec3};
use serde_json::json;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI, TAU};

/// Detail beyond which no room is made: some 2 000 000 triangles.
const MOST_DETAIL: usize = 64;

/// The room whose triangles come nearest to `triangles`.
pub(crate) fn room(triangles: usize) -> Glb {
    let mut before: Option<Glb> = None;
    for detail in 0..=MOST_DETAIL {
        let glb = at_detail(detail);
        if glb.triangles() >= triangles || detail == MOST_DETAIL {
            return match before {
                Some(less)
                    if triangles - less.triangles() < glb.triangles().abs_diff(triangles) =>
                {
                    less
                }
                _ => glb,
            };
        }
        before = Some(glb);
    }
    unreachable!("the loop returns at the greatest detail")
}

fn at_detail(detail: usize) -> Glb {
    let mut glb = Glb::default();
    shell(&mut glb);
    dining(&mut glb, detail);
    seating(&mut glb, detail);
    shelf(&mut glb, detail);
    wall(&mut glb);
    plant(&mut glb, detail);
    glb.camera(
        "window side",
        dvec3(5.6, 1.6, 0.4),
        dvec3(2.4, 0.8, 4.2),
        1.2,
        4.0 / 3.0,
    );
    glb.camera(
        "sofa side",
        dvec3(0.5, 1.5, 4.6),
        dvec3(4.2, 0.9, 0.6),
        1.1,
        4.0 / 3.0,
    );
    glb
}

/// Steps about an axis.
fn around(detail: usize) -> usize {
    8 + 4 * detail
}

fn textured(glb: &mut Glb, name: &str, texture: usize, scale: f64) -> usize {
    let mut base = matt([1.0; 3]);
    base["baseColorTexture"] = json!({"index": texture});
    if scale != 1.0 {
        glb.uses("KHR_texture_transform");
        base["baseColorTexture"]["extensions"] =
            json!({"KHR_texture_transform": {"scale": [scale, scale]}});
    }
    glb.material(json!({"name": name, "pbrMetallicRoughness": base}))
}

fn shell(glb: &mut Glb) {
    let plaster = glb.paint("plaster", [0.72, 0.7, 0.64]);
    let ceiling = glb.paint("ceiling", [0.86; 3]);
    let frame = glb.paint("window frame", [0.8, 0.8, 0.78]);
    let door = glb.paint("door", [0.3, 0.16, 0.08]);
    let wood = glb.texture("planks", &textures::planks());
    let floor = textured(glb, "floor", wood, 0.5);
    let sky = glb.lamp("sky", [0.0; 3], [0.62, 0.8, 1.0], 3000.0);
    let panel = glb.lamp("panel", [0.8; 3], [1.0, 0.95, 0.88], 2500.0);
    let (height, width, depth) = (2.7, 6.0, 5.0);
    let windows = [
        ([0.8, 0.9, -0.2], [2.3, 2.2, 0.0]),
        ([3.6, 0.9, -0.2], [5.1, 2.2, 0.0]),
    ];
    let niche = ([6.0, 0.0, 3.6], [6.05, 2.05, 4.5]);
    let cells = Cells {
        cuts: [
            &[0.0, 0.8, 1.6, 2.3, 2.8, 3.6, 5.1, width, 6.05],
            &[0.0, 0.9, 2.05, 2.2, height],
            &[-0.2, 0.0, 2.2, 2.8, 3.6, 4.5, depth],
        ],
        hollow: &|p| {
            let open = windows
                .iter()
                .chain([&niche])
                .any(|(low, high)| within(p, *low, *high));
            open || within(p, [0.0; 3], [width, height, depth])
        },
        paint: &|p, n| {
            if p.z == -0.2 {
                sky
            } else if p.z < 0.0 {
                frame
            } else if p.x == 6.05 {
                door
            } else if p.x > width && n.y == 0.0 {
                frame
            } else if n.y > 0.5 {
                floor
            } else if down(n) && within(p, [1.6, 2.0, 2.2], [2.8, 3.0, 2.8]) {
                panel
            } else if down(n) && p.y == height {
                ceiling
            } else {
                plaster
            }
        },
    };
    draw(glb, "room", &cells, &[floor]);
}

/// Table, four chairs (one mesh, instanced), a pendant lamp, a vase and fruit.
fn dining(glb: &mut Glb, detail: usize) {
    let oak = glb.paint("oak", [0.42, 0.27, 0.14]);
    let cloth = glb.paint("seat", [0.12, 0.25, 0.3]);
    let steps = around(detail);
    let mut table = rounded([3.55, 0.71, 1.1], [5.15, 0.75, 2.0], 0.012, detail);
    for (x, z) in [(3.65, 1.2), (5.05, 1.2), (3.65, 1.9), (5.05, 1.9)] {
        table.append(&tube([x, 0.0, z], 0.03, 0.71, steps));
    }
    glb.draw("table", &[(&table, oak)]);

    let mut frame = Mesh::default();
    for (x, z, top) in [
        (-0.2, -0.2, 0.88),
        (0.2, -0.2, 0.88),
        (-0.2, 0.2, 0.43),
        (0.2, 0.2, 0.43),
    ] {
        frame.append(&tube([x, 0.0, z], 0.018, top, steps / 2));
    }
    let mut pads = rounded([-0.22, 0.43, -0.18], [0.22, 0.47, 0.22], 0.018, detail);
    pads.append(&rounded(
        [-0.21, 0.6, -0.24],
        [0.21, 0.9, -0.215],
        0.012,
        detail,
    ));
    let chair = glb.mesh("chair", &[(&frame, oak), (&pads, cloth)]);
    let seats = [
        (dvec3(3.95, 0.0, 0.85), 0.0),
        (dvec3(4.75, 0.0, 0.85), 0.1),
        (dvec3(3.95, 0.0, 2.25), PI),
        (dvec3(4.75, 0.0, 2.3), PI - 0.25),
    ];
    glb.instances("chairs", chair, &seats);

    let bulb = glb.lamp("bulb", [0.8; 3], [1.0, 0.72, 0.42], 8000.0);
    let brass = glb.material(json!({
        "name": "brass",
        "pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.45, 0.2, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.6},
    }));
    glb.draw(
        "pendant",
        &[(&sphere([4.35, 1.75, 1.55], 0.07, steps), bulb)],
    );
    let mut rod = tube([4.35, 1.82, 1.55], 0.008, 0.86, steps / 2);
    rod.append(&lathe(
        [4.35, 2.68, 1.55],
        &[[0.0, 0.0], [0.05, 0.001], [0.05, 0.02]],
        steps,
    ));
    glb.draw("rod", &[(&rod, brass)]);

    let glaze = glb.paint("glaze", [0.08, 0.16, 0.45]);
    let turns = 6 + 3 * detail;
    let belly: Vec<[f64; 2]> = (0..=turns)
        .map(|i| {
            let t = i as f64 / turns as f64;
            [0.045 + 0.04 * (PI * (0.1 + 1.1 * t)).sin(), 0.26 * t]
        })
        .collect();
    let foot = [[0.0, 0.0], [belly[0][0], 0.0]];
    let vase = lathe(
        [4.1, 0.751, 1.5],
        &[&foot[..], &belly[1..], &[[0.0, 0.26]]].concat(),
        steps,
    );
    glb.draw("vase", &[(&vase, glaze)]);
    let orange = glb.paint("orange", [0.75, 0.3, 0.03]);
    let mut fruit = sphere([4.55, 0.791, 1.42], 0.04, steps);
    fruit.append(&sphere([4.64, 0.791, 1.47], 0.04, steps));
    glb.draw("fruit", &[(&fruit, orange)]);
}

/// Sofa, two armchairs (one the mirror image of the other), rug, floor lamp.
fn seating(glb: &mut Glb, detail: usize) {
    let blue = glb.paint("sofa cloth", [0.14, 0.2, 0.38]);
    let red = glb.paint("armchair cloth", [0.5, 0.1, 0.07]);
    let weave = glb.texture("check", &textures::check());
    let rug = textured(glb, "rug", weave, 2.0);
    glb.draw("sofa", &[(&couch(2.0, 2, detail), blue)]);
    let mesh = glb.mesh("armchair", &[(&couch(0.9, 1, detail), red)]);
    let mut lopsided = rounded([0.02, 0.47, -0.08], [0.27, 0.74, 0.0], 0.05, detail);
    lopsided = lopsided.moved(DMat4::from_rotation_x(-0.2));
    let cushion = glb.mesh("cushion", &[(&lopsided, blue)]);
    let turn = |angle: f64| [0.0, (angle / 2.0).sin(), 0.0, (angle / 2.0).cos()];
    for (name, x, mirror) in [("armchair", 0.75, 1.0), ("armchair mirrored", 3.65, -1.0)] {
        let parts = [glb.place("seat", mesh), glb.place("cushion", cushion)];
        glb.node(json!({
            "name": name,
            "children": parts,
            "translation": [x, 0.0, 2.95],
            "rotation": turn(FRAC_PI_2 * mirror),
            "scale": [mirror, 1.0, 1.0],
        }));
    }
    let flat = picture([
        [1.2, 0.012, 2.5],
        [3.2, 0.012, 2.5],
        [3.2, 0.012, 3.9],
        [1.2, 0.012, 3.9],
    ]);
    glb.draw("rug", &[(&flat, rug)]);

    let steps = around(detail);
    let steel = glb.paint("lamp stand", [0.25, 0.25, 0.26]);
    let shade = glb.material(json!({
        "name": "lamp shade", "doubleSided": true, "pbrMetallicRoughness": matt([0.8, 0.74, 0.6]),
    }));
    let at = [3.9, 0.0, 4.6];
    let mut stand = rounded([3.78, 0.0, 4.48], [4.02, 0.02, 4.72], 0.008, detail);
    stand.append(&tube([at[0], 0.02, at[2]], 0.012, 1.4, steps / 2));
    glb.draw("lamp stand", &[(&stand, steel)]);
    let cone = lathe([at[0], 1.35, at[2]], &[[0.2, 0.0], [0.15, 0.3]], steps);
    glb.draw("lamp shade", &[(&cone, shade)]);
    let light = json!({"name": "floor lamp", "type": "point", "color": [1.0, 0.75, 0.5], "intensity": 55.0});
    glb.light(light, dvec3(at[0], 1.5, at[2]), dvec3(at[0], 0.0, at[2]));
}

/// Seat, back, arms and cushions over `width` metres, around the origin, looking along +z;
/// one of two seats stands at the wall z = 5 and looks along -z.
fn couch(width: f64, seats: usize, detail: usize) -> Mesh {
    let half = width / 2.0;
    let mut couch = rounded([-half, 0.08, -0.4], [half, 0.3, 0.4], 0.04, detail);
    couch.append(&rounded(
        [-half, 0.31, -0.44],
        [half, 0.8, -0.24],
        0.07,
        detail,
    ));
    for side in [-1.0, 1.0] {
        let (a, b) = (side * half, side * (half - 0.16));
        couch.append(&rounded(
            [a.min(b), 0.31, -0.23],
            [a.max(b), 0.58, 0.4],
            0.06,
            detail,
        ));
    }
    let room = (width - 0.34) / seats as f64;
    for i in 0..seats {
        let x = -half + 0.17 + room * i as f64;
        couch.append(&rounded(
            [x + 0.005, 0.31, -0.23],
            [x + room - 0.005, 0.44, 0.38],
            0.05,
            detail,
        ));
    }
    for (x, z) in [
        (-half + 0.08, -0.3),
        (half - 0.08, -0.3),
        (-half + 0.08, 0.3),
        (half - 0.08, 0.3),
    ] {
        couch.append(&tube([x, 0.0, z], 0.02, 0.08, 4 + 2 * detail));
    }
    match seats {
        2 => {
            couch.moved(DMat4::from_translation(dvec3(2.2, 0.0, 4.5)) * DMat4::from_rotation_y(PI))
        }
        _ => couch,
    }
}

/// A shelf with books whose colours are vertex colours.
fn shelf(glb: &mut Glb, detail: usize) {
    let board = glb.paint("shelf", [0.62, 0.55, 0.45]);
    let paper = glb.paint("books", [1.0; 3]);
    let mut boards = Mesh::default();
    for x in [5.6, 5.0] {
        boards.append(&block([x - 0.02, 0.0, 4.7], [x, 1.9, 4.98]));
    }
    for i in 0..5 {
        let y = 0.08 + 0.42 * f64::from(i);
        boards.append(&block([5.0, y, 4.7], [5.58, y + 0.02, 4.98]));
    }
    glb.draw("shelf", &[(&boards, board)]);
    let mut books = Mesh::default();
    for row in 0..4 {
        for i in 0..5 {
            let n = f64::from(row * 5 + i);
            let (x, y) = (5.02 + 0.105 * f64::from(i), 0.1005 + 0.42 * f64::from(row));
            let tall = 0.24 + 0.06 * (n * 2.4).sin();
            let book = rounded(
                [x, y, 4.74],
                [x + 0.03 + 0.02 * (n * 1.7).cos(), y + tall, 4.93],
                0.006,
                detail / 4,
            );
            let hue = |shift: f64| 0.3 + 0.25 * (n * 1.3 + shift).sin();
            books.append(&book.coloured([hue(0.0), hue(TAU / 3.0), hue(2.0 * TAU / 3.0)]));
        }
    }
    glb.draw("books", &[(&books, paper)]);
}

/// A lit picture and a screen on the walls x = 0 and x = 6.
fn wall(glb: &mut Glb) {
    let frame = glb.paint("picture frame", [0.05, 0.04, 0.03]);
    let image = glb.texture("landscape", &textures::landscape());
    let canvas = textured(glb, "picture", image, 1.0);
    glb.draw(
        "picture frame",
        &[(&block([0.002, 1.2, 1.0], [0.03, 1.8, 1.8]), frame)],
    );
    let face = picture([
        [0.032, 1.77, 1.77],
        [0.032, 1.77, 1.03],
        [0.032, 1.23, 1.03],
        [0.032, 1.23, 1.77],
    ]);
    glb.draw("picture", &[(&face, canvas)]);
    let spot = json!({
        "name": "picture spot", "type": "spot", "color": [1.0, 0.85, 0.7], "intensity": 350.0,
        "spot": {"innerConeAngle": FRAC_PI_6 / 2.0, "outerConeAngle": FRAC_PI_6},
    });
    glb.light(spot, dvec3(1.1, 2.6, 1.4), dvec3(0.03, 1.5, 1.4));

    let shown = glb.texture("screen", &textures::screen());
    glb.uses("KHR_materials_emissive_strength");
    let screen = glb.material(json!({
        "name": "screen",
        "pbrMetallicRoughness": matt([0.02; 3]),
        "emissiveFactor": [1.0, 1.0, 1.0],
        "emissiveTexture": {"index": shown},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 250.0}},
    }));
    glb.draw(
        "screen case",
        &[(&block([5.95, 0.7, 2.4], [5.998, 1.4, 3.4]), frame)],
    );
    let lit = picture([
        [5.948, 1.38, 2.42],
        [5.948, 1.38, 3.38],
        [5.948, 0.72, 3.38],
        [5.948, 0.72, 2.42],
    ]);
    glb.draw("screen", &[(&lit, screen)]);
}

/// A pot with leaves cut out by an alpha mask.
fn plant(glb: &mut Glb, detail: usize) {
    let clay = glb.paint("clay", [0.45, 0.2, 0.12]);
    let soil = glb.paint("soil", [0.05, 0.035, 0.025]);
    let image = glb.texture("leaf", &textures::leaf());
    let mut base = matt([1.0; 3]);
    base["baseColorTexture"] = json!({"index": image});
    let leaf = glb.material(json!({
        "name": "leaf", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.5, "pbrMetallicRoughness": base,
    }));
    let steps = around(detail);
    let at = [0.4, 0.0, 0.4];
    let pot = lathe(at, &[[0.11, 0.0], [0.16, 0.3]], steps);
    let earth = lathe(at, &[[0.16, 0.3], [0.0, 0.301]], steps);
    glb.draw("pot", &[(&pot, clay), (&earth, soil)]);
    let mut leaves = Mesh::default();
    for i in 0..7 {
        let turn = TAU * f64::from(i) / 7.0;
        let lean = 0.35 + 0.15 * f64::from(i % 3);
        let flat = picture([
            [-0.1, 0.8, 0.0],
            [0.1, 0.8, 0.0],
            [0.1, 0.0, 0.0],
            [-0.1, 0.0, 0.0],
        ]);
        let place = DMat4::from_translation(dvec3(at[0], 0.28, at[2]))
            * DMat4::from_rotation_y(turn)
            * DMat4::from_rotation_x(lean);
        leaves.append(&flat.moved(place));
    }
    glb.draw("leaves", &[(&leaves, leaf)]);
}
