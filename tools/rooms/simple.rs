//! Rooms of cells: two rooms with a doorway, a corridor, a furnace; and a convex empty room.

use super::cells::Cells;
use super::glb::{Glb, Mesh};
use glam::{DVec3, dvec3};
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// Luminance of the furnace's own emission, cd/m2.
const FURNACE_LUMINANCE: f64 = 10.0;

/// Is the point in the box between two corners?
pub(crate) fn within(p: DVec3, low: [f64; 3], high: [f64; 3]) -> bool {
    (0..3).all(|a| p[a] > low[a] && p[a] < high[a])
}

/// Is this a face that looks down?
pub(crate) fn down(normal: DVec3) -> bool {
    normal.y < -0.5
}

/// Draws the faces of a grid, one primitive for each paint.
pub(crate) fn draw(glb: &mut Glb, name: &str, cells: &Cells, uvs: &[usize]) {
    let mut meshes = cells.meshes();
    for (paint, mesh) in &mut meshes {
        if !uvs.contains(paint) {
            mesh.uvs.clear();
        }
    }
    let parts: Vec<(&Mesh, usize)> = meshes.iter().map(|(paint, mesh)| (mesh, *paint)).collect();
    glb.draw(name, &parts);
}

/// Two rooms, 4.0 x 3.6 m and 3.2 x 3.6 m, 2.6 m high, joined by a doorway of 0.9 x 2.1 m in a wall of 0.12 m.
pub(crate) fn two_rooms() -> Glb {
    let mut glb = Glb::default();
    let walls_a = glb.paint("walls A", [0.58, 0.58, 0.58]);
    let walls_b = glb.paint("walls B", [0.59, 0.51, 0.42]);
    let ceiling = glb.paint("ceiling", [0.88, 0.88, 0.86]);
    let floor = glb.paint("floor", [0.17, 0.08, 0.05]);
    let blue = glb.paint("accent A", [0.11, 0.2, 0.34]);
    let red = glb.paint("accent B", [0.54, 0.1, 0.12]);
    let green = glb.paint("plinth A", [0.1, 0.15, 0.05]);
    let yellow = glb.paint("plinth B", [0.8, 0.57, 0.01]);
    let frame = glb.paint("door frame", [0.36, 0.36, 0.36]);
    let tubes = glb.lamp("tubes", [0.8; 3], [1.0, 1.0, 0.95], 6000.0);
    let bulb = glb.lamp("bulb", [0.8; 3], [1.0, 0.7, 0.35], 12_000.0);

    let (height, wall, far) = (2.6, [4.0, 4.12], 7.32);
    let cells = Cells {
        cuts: [
            &[
                0.0, 0.5, 1.0, 1.4, 2.6, wall[0], wall[1], 5.5, 5.9, 6.4, 6.8, far,
            ],
            &[0.0, 0.6, 0.9, 2.1, height],
            &[0.0, 0.5, 0.9, 1.5, 1.9, 2.3, 3.2, 3.6],
        ],
        hollow: &|p| {
            let door = within(p, [wall[0], 0.0, 2.3], [wall[1], 2.1, 3.2]);
            let room = p.x < wall[0] || p.x > wall[1];
            let plinths = within(p, [0.5, 0.0, 0.5], [1.0, 0.9, 0.9])
                || within(p, [6.4, 0.0, 1.5], [6.8, 0.6, 1.9]);
            (room || door) && !plinths
        },
        paint: &|p, n| {
            let in_a = p.x < (wall[0] + wall[1]) / 2.0;
            if p.x > wall[0] + 1e-6 && p.x < wall[1] - 1e-6 {
                return if n.y > 0.5 { floor } else { frame };
            }
            if p.y == 0.0 {
                floor
            } else if p.y == height && within(p, [1.4, 0.0, 1.5], [2.6, 3.0, 2.3]) {
                tubes
            } else if p.y == height && within(p, [5.5, 0.0, 1.5], [5.9, 3.0, 1.9]) {
                bulb
            } else if p.y == height {
                ceiling
            } else if p.x == 0.0 {
                blue
            } else if p.x == far {
                red
            } else if within(p, [0.4, 0.0, 0.4], [1.1, 1.0, 1.0]) {
                green
            } else if within(p, [6.3, 0.0, 1.4], [6.9, 1.0, 2.0]) {
                yellow
            } else if in_a {
                walls_a
            } else {
                walls_b
            }
        },
    };
    draw(&mut glb, "rooms", &cells, &[]);
    glb.camera(
        "room A",
        dvec3(0.4, 1.6, 3.3),
        dvec3(4.0, 1.1, 1.6),
        1.05,
        4.0 / 3.0,
    );
    glb.camera(
        "room B",
        dvec3(7.1, 1.6, 3.3),
        dvec3(4.2, 1.1, 1.6),
        1.05,
        4.0 / 3.0,
    );
    glb
}

/// The side file of the two rooms: ColorChecker paints, F11 tubes and an incandescent bulb.
pub(crate) fn two_rooms_spectra() -> Value {
    let patch = |name: &str| json!({"reflectance": {"name": format!("macbeth/{name}")}});
    json!({
        "materials": {
            "walls A": patch("neutral_8"),
            "walls B": patch("light_skin"),
            "ceiling": patch("white"),
            "floor": patch("dark_skin"),
            "accent A": patch("blue_sky"),
            "accent B": patch("moderate_red"),
            "plinth A": patch("foliage"),
            "plinth B": patch("yellow"),
            "door frame": patch("neutral_6.5"),
            "tubes": {"emission": {"name": "cie/F11", "luminance_cd_m2": 6000.0}},
            "bulb": {"emission": {"name": "cie/A", "luminance_cd_m2": 9000.0}},
        }
    })
}

/// An L of two arms, 10 m and 8 m long, 2 m wide and 2.7 m high, with one lamp at the far end of the first arm.
pub(crate) fn corridor() -> Glb {
    let mut glb = Glb::default();
    let walls = glb.paint("walls", [0.7, 0.7, 0.68]);
    let floor = glb.paint("floor", [0.3, 0.28, 0.25]);
    let ceiling = glb.paint("ceiling", [0.85, 0.85, 0.85]);
    let orange = glb.paint("end", [0.8, 0.3, 0.05]);
    let lamp = glb.lamp("lamp", [0.8; 3], [1.0; 3], 5000.0);
    let (height, length, depth) = (2.7, 10.0, 8.0);
    let cells = Cells {
        cuts: [
            &[0.0, 0.5, 1.5, 8.0, length],
            &[0.0, height],
            &[0.0, 0.8, 1.2, 2.0, depth],
        ],
        hollow: &|p| p.z < 2.0 || p.x > 8.0,
        paint: &|p, n| {
            if down(n) && within(p, [0.5, 0.0, 0.8], [1.5, 3.0, 1.2]) {
                lamp
            } else if down(n) {
                ceiling
            } else if n.y > 0.5 {
                floor
            } else if p.z == depth {
                orange
            } else {
                walls
            }
        },
    };
    draw(&mut glb, "corridor", &cells, &[]);
    glb.camera(
        "lamp end",
        dvec3(0.4, 1.6, 1.0),
        dvec3(9.0, 1.2, 1.2),
        1.0,
        4.0 / 3.0,
    );
    glb.camera(
        "dark end",
        dvec3(9.0, 1.6, 7.6),
        dvec3(9.0, 1.2, 1.0),
        1.0,
        4.0 / 3.0,
    );
    glb
}

/// A closed box, 3 x 2.5 x 4 m, of albedo 0.95, every wall emitting alike: the radiosity is 20 times the emission.
pub(crate) fn furnace() -> Glb {
    let mut glb = Glb::default();
    let wall = glb.lamp("wall", [0.95; 3], [1.0; 3], FURNACE_LUMINANCE);
    let cells = Cells {
        cuts: [&[0.0, 3.0], &[0.0, 2.5], &[0.0, 4.0]],
        hollow: &|_| true,
        paint: &|_, _| wall,
    };
    draw(&mut glb, "furnace", &cells, &[]);
    glb.camera(
        "inside",
        dvec3(0.3, 1.4, 0.3),
        dvec3(2.0, 1.1, 3.0),
        1.1,
        4.0 / 3.0,
    );
    glb
}

/// A convex empty room on an octagon of 2.5 m radius, 2.8 m high, with a lamp in the middle of its ceiling.
pub(crate) fn convex() -> Glb {
    let mut glb = Glb::default();
    let floor = glb.paint("floor", [0.35, 0.25, 0.18]);
    let ceiling = glb.paint("ceiling", [0.85, 0.85, 0.85]);
    let walls = [
        glb.paint("wall 1", [0.75, 0.75, 0.7]),
        glb.paint("wall 2", [0.65, 0.12, 0.1]),
        glb.paint("wall 3", [0.75, 0.75, 0.7]),
        glb.paint("wall 4", [0.12, 0.2, 0.6]),
    ];
    let lamp = glb.lamp("lamp", [0.8; 3], [1.0, 0.95, 0.9], 4000.0);
    let (radius, height, middle) = (2.5, 2.8, dvec3(0.0, 1.4, 0.0));
    let ring = |radius: f64, y: f64| {
        std::array::from_fn::<_, 8, _>(|i| {
            let (sin, cos) = (TAU * i as f64 / 8.0).sin_cos();
            dvec3(radius * cos, y, radius * sin)
        })
    };
    let (low, high, hole) = (ring(radius, 0.0), ring(radius, height), ring(0.6, height));
    let mut ground = Mesh::default();
    let mut top = Mesh::default();
    let mut panel = Mesh::default();
    let mut sides: [Mesh; 4] = Default::default();
    for i in 0..8 {
        let j = (i + 1) % 8;
        sides[i % 4].quad([low[i], low[j], high[j], high[i]], middle);
        top.quad([high[i], high[j], hole[j], hole[i]], middle);
    }
    // Octagons as a strip of quads: (0, 1, 2, 7), (7, 2, 3, 6), (6, 3, 4, 5).
    for [a, b, c, d] in [[0, 1, 2, 7], [7, 2, 3, 6], [6, 3, 4, 5]] {
        ground.quad([low[a], low[b], low[c], low[d]], middle);
        panel.quad([hole[a], hole[b], hole[c], hole[d]], middle);
    }
    glb.draw("floor", &[(&ground, floor)]);
    glb.draw("ceiling", &[(&top, ceiling)]);
    glb.draw("lamp", &[(&panel, lamp)]);
    let parts: Vec<(&Mesh, usize)> = sides.iter().zip(walls).collect();
    glb.draw("walls", &parts);
    glb.camera(
        "inside",
        dvec3(-2.0, 1.5, -0.6),
        dvec3(1.5, 1.2, 0.4),
        1.2,
        4.0 / 3.0,
    );
    glb
}
