//! The Cornell box.
//!
//! Coordinates: Cornell University Program of Computer Graphics, "The Cornell Box", page of the measured data (in
//! millimetres, here in metres: the box is 0.55 m wide). Right-handed, +Y up as published. The lamp fills the hole of the
//! ceiling, so that no two surfaces lie on each other. The blocks have no bottoms, as published.
//! The measured spectra of walls and lamp come from the side file; the RGB colours are for viewers that know no spectra.

use super::glb::{Glb, Mesh};
use glam::DVec3;
use serde_json::{Value, json};

/// Luminance of the lamp, cd/m2: our choice (the published radiance is relative); some 1000 lx on the floor.
pub(crate) const LUMINANCE: f64 = 10_000.0;

/// Metres per published unit.
const MM: f64 = 0.001;

/// Linear sRGB of the measured walls and lamp under D65 (the lamp under equal scaling), rounded to what a viewer needs.
const WHITE: [f64; 3] = [0.73, 0.74, 0.68];
const RED: [f64; 3] = [0.55, 0.05, 0.04];
const GREEN: [f64; 3] = [0.12, 0.42, 0.14];
const LAMP: [f64; 3] = [1.0, 0.6, 0.23];

/// What stands where the published box is open.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Front {
    /// Nothing, as published.
    Open,
    /// A white wall in the plane z = 0.
    Wall,
}

/// The box.
pub(crate) fn room(front: Front) -> Glb {
    let mut glb = Glb::default();
    let white = glb.paint("white", WHITE);
    let red = glb.paint("red", RED);
    let green = glb.paint("green", GREEN);
    // The published lamp reflects 0.78 at all wavelengths.
    let luminance = 0.2126 * LAMP[0] + 0.7152 * LAMP[1] + 0.0722 * LAMP[2];
    let lamp = glb.lamp("light", [0.78; 3], LAMP, LUMINANCE / luminance);

    let inside = mm([278.0, 274.4, 279.6]);
    let face = |corners: [[f64; 3]; 4]| {
        let mut mesh = Mesh::default();
        mesh.quad(corners.map(mm), inside);
        mesh
    };
    let floor = face([
        [552.8, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 559.2],
        [549.6, 0.0, 559.2],
    ]);
    let back = face([
        [549.6, 0.0, 559.2],
        [0.0, 0.0, 559.2],
        [0.0, 548.8, 559.2],
        [556.0, 548.8, 559.2],
    ]);
    let right = face([
        [0.0, 0.0, 559.2],
        [0.0, 0.0, 0.0],
        [0.0, 548.8, 0.0],
        [0.0, 548.8, 559.2],
    ]);
    let left = face([
        [552.8, 0.0, 0.0],
        [549.6, 0.0, 559.2],
        [556.0, 548.8, 559.2],
        [556.0, 548.8, 0.0],
    ]);
    let outer = [
        [556.0, 548.8, 0.0],
        [556.0, 548.8, 559.2],
        [0.0, 548.8, 559.2],
        [0.0, 548.8, 0.0],
    ];
    let hole = [
        [343.0, 548.8, 227.0],
        [343.0, 548.8, 332.0],
        [213.0, 548.8, 332.0],
        [213.0, 548.8, 227.0],
    ];
    let mut ceiling = Mesh::default();
    for i in 0..4 {
        let j = (i + 1) % 4;
        ceiling.quad([outer[i], outer[j], hole[j], hole[i]].map(mm), inside);
    }
    glb.draw("floor", &[(&floor, white)]);
    glb.draw("ceiling", &[(&ceiling, white)]);
    glb.draw("back wall", &[(&back, white)]);
    glb.draw("right wall", &[(&right, green)]);
    glb.draw("left wall", &[(&left, red)]);
    if front == Front::Wall {
        let wall = face([
            [552.8, 0.0, 0.0],
            [556.0, 548.8, 0.0],
            [0.0, 548.8, 0.0],
            [0.0, 0.0, 0.0],
        ]);
        glb.draw("front wall", &[(&wall, white)]);
    }
    glb.draw("lamp", &[(&face(hole), lamp)]);
    let short = block(
        [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]],
        165.0,
    );
    let tall = block(
        [
            [423.0, 247.0],
            [265.0, 296.0],
            [314.0, 456.0],
            [472.0, 406.0],
        ],
        330.0,
    );
    glb.draw("short block", &[(&short, white)]);
    glb.draw("tall block", &[(&tall, white)]);

    // Published: at (278, 273, -800), looking along +z, focal length 35 mm, film 25 mm square.
    let yfov = 2.0 * (0.025 / 2.0 / 0.035_f64).atan();
    glb.camera(
        "cornell",
        mm([278.0, 273.0, -800.0]),
        mm([278.0, 273.0, 0.0]),
        yfov,
        1.0,
    );
    if front == Front::Wall {
        glb.camera(
            "inside",
            mm([278.0, 273.0, 20.0]),
            mm([278.0, 240.0, 500.0]),
            1.2,
            1.0,
        );
    }
    glb
}

/// The side file: measured walls, lamp of the given spectrum.
pub(crate) fn spectra(light: &str) -> Value {
    json!({
        "materials": {
            "white": {"reflectance": {"name": "cornell/white"}},
            "red": {"reflectance": {"name": "cornell/red"}},
            "green": {"reflectance": {"name": "cornell/green"}},
            "light": {"emission": {"name": light, "luminance_cd_m2": LUMINANCE}},
        }
    })
}

/// A block over four corners (x, z) of the floor: top and sides.
fn block(base: [[f64; 2]; 4], height: f64) -> Mesh {
    let centre = base.iter().fold(DVec3::ZERO, |sum, [x, z]| {
        sum + mm([*x, height / 2.0, *z]) / 4.0
    });
    let mut mesh = Mesh::default();
    let mut face = |corners: [[f64; 3]; 4]| {
        let corners = corners.map(mm);
        let middle = corners.iter().sum::<DVec3>() / 4.0;
        mesh.quad(corners, 2.0 * middle - centre);
    };
    face(base.map(|[x, z]| [x, height, z]));
    for i in 0..4 {
        let ([ax, az], [bx, bz]) = (base[i], base[(i + 1) % 4]);
        face([
            [ax, 0.0, az],
            [ax, height, az],
            [bx, height, bz],
            [bx, 0.0, bz],
        ]);
    }
    mesh
}

fn mm(p: [f64; 3]) -> DVec3 {
    DVec3::from_array(p) * MM
}
