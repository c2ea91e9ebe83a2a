//! A dressing room: a silver mirror beside a lamp, a leaning bronze mirror that throws a spot's light on the wall across, a chrome ball.

use super::glb::{Glb, Mesh, matt};
use super::shapes::{block, sphere};
use glam::{DVec3, dvec3};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// 3.6 x 3 m, 2.5 m high.
const SIZE: [f64; 3] = [3.6, 2.5, 3.0];

pub(crate) fn room() -> Glb {
    let mut glb = Glb::default();
    shell(&mut glb);
    let wood = glb.paint("chest", [0.42, 0.27, 0.15]);
    let mut chest = block([1.0, 0.0, 0.03], [2.6, 0.8, 0.53]);
    // Nobody sees what it stands on.
    open(&mut chest, |p| p.y > 0.0);
    glb.draw("chest", &[(&chest, wood)]);
    let silver = metal(&mut glb, "silver", [0.95, 0.94, 0.91], 0.0);
    // A plate, its back on the wall.
    let mut plate = block([1.1, 1.0, 0.0], [2.5, 1.9, 0.02]);
    let mut rim = plate.clone();
    open(&mut plate, |p| p.z > 0.0);
    let front = |p: &[DVec3]| p.iter().all(|p| p.z > 0.0);
    part(&mut plate, front);
    part(&mut rim, |p| !front(p) && p.iter().any(|p| p.z > 0.0));
    let dark = glb.paint("frame", [0.05, 0.045, 0.04]);
    glb.draw("mirror", &[(&plate, silver), (&rim, dark)]);
    let radius = 0.06;
    let nits = 500.0 / (PI * 4.0 * PI * radius * radius);
    let glow = glb.lamp("bulb", [0.7; 3], [1.0, 0.82, 0.58], nits);
    glb.draw("bulb", &[(&sphere([1.3, 1.02, 0.22], radius, 16), glow)]);
    let brass = glb.paint("foot", [0.5, 0.38, 0.16]);
    let mut foot = block([1.27, 0.8, 0.19], [1.33, 0.96, 0.25]);
    open(&mut foot, |p| p.y > 0.8);
    glb.draw("foot", &[(&foot, brass)]);
    let chrome = metal(&mut glb, "chrome", [0.55, 0.56, 0.56], 0.05);
    glb.draw("ball", &[(&sphere([2.2, 0.92, 0.25], 0.12, 24), chrome)]);
    leaning(&mut glb);
    let eye = dvec3(0.3, 1.5, 2.7);
    glb.camera("door", eye, dvec3(2.4, 0.9, 0.4), 1.1, 4.0 / 3.0);
    // The leaning mirror and what it throws on the wall.
    let eye = dvec3(3.3, 1.9, 0.35);
    glb.camera("across", eye, dvec3(1.4, 0.7, 2.5), 1.3, 4.0 / 3.0);
    glb
}

/// Walls, floor and ceiling, one quad each.
fn shell(glb: &mut Glb) {
    let walls = glb.paint("walls", [0.7, 0.69, 0.66]);
    let ceiling = glb.paint("ceiling", [0.84; 3]);
    let floor = glb.paint("floor", [0.28, 0.2, 0.13]);
    let middle = 0.5 * DVec3::from_array(SIZE);
    let corner = |x: usize, y: usize, z: usize| {
        let at = [x, y, z];
        DVec3::from_array(std::array::from_fn(|a| SIZE[a] * at[a] as f64))
    };
    let side = |corners: [[usize; 3]; 4]| {
        let mut mesh = Mesh::default();
        mesh.quad(corners.map(|[x, y, z]| corner(x, y, z)), middle);
        mesh
    };
    let sides = [
        side([[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]]),
        side([[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]]),
        side([[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]]),
        side([[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1]]),
    ];
    let mut upright = Mesh::default();
    sides.iter().for_each(|mesh| upright.append(mesh));
    let ground = side([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]]);
    let above = side([[0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]]);
    let parts = [(&upright, walls), (&ground, floor), (&above, ceiling)];
    glb.draw("room", &parts);
}

/// A mirror that leans on the wall at +X, a spot over it that shines into it, and a frame behind.
fn leaning(glb: &mut Glb) {
    let bronze = glb.material(json!({
        "name": "bronze mirror",
        "pbrMetallicRoughness": matt([0.8, 0.5, 0.3]),
    }));
    let (low, high) = (dvec3(3.1, 0.02, 1.5), dvec3(3.5, 1.5, 1.5));
    let across = DVec3::Z * 0.8;
    let mut mesh = Mesh::default();
    mesh.quad(
        [low, low + across, high + across, high],
        dvec3(0.0, 2.0, 1.9),
    );
    glb.draw("leaning mirror", &[(&mesh, bronze)]);
    let back = glb.paint("board", [0.25, 0.18, 0.12]);
    let off = dvec3(0.015, -0.005, 0.0);
    let front = [low, low + across, high + across, high];
    let middle = 0.5 * (low + high + across);
    let mut mesh = Mesh::default();
    mesh.quad(front.map(|p| p + off), middle + 9.0 * off);
    for k in 0..4 {
        let [a, b] = [front[k], front[(k + 1) % 4]];
        let outside = 5.0 * (0.5 * (a + b) - middle) + middle;
        mesh.quad([a, b, b + off, a + off], outside);
    }
    glb.draw("board", &[(&mesh, back)]);
    let spot = json!({
        "name": "spot", "type": "spot", "intensity": 700.0, "color": [1.0, 0.9, 0.75],
        "spot": {"innerConeAngle": 0.14, "outerConeAngle": 0.2},
    });
    glb.light(
        spot,
        dvec3(1.4, 2.4, 1.9),
        0.5 * (low + high) + 0.5 * across,
    );
}

/// A metal of a colour and a roughness.
fn metal(glb: &mut Glb, name: &str, [r, g, b]: [f64; 3], roughness: f64) -> usize {
    glb.material(json!({
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [r, g, b, 1.0],
            "metallicFactor": 1.0,
            "roughnessFactor": roughness,
        },
    }))
}

/// Leaves the triangles any corner of which fits: what stands on something is not seen from below.
fn open(mesh: &mut Mesh, fits: impl Fn(DVec3) -> bool) {
    part(mesh, |corners| corners.iter().any(|p| fits(*p)));
}

/// Leaves the triangles that fit.
fn part(mesh: &mut Mesh, fits: impl Fn(&[DVec3]) -> bool) {
    let positions = &mesh.positions;
    let corners = |t: &[u32; 3]| t.map(|v| positions[v as usize]);
    mesh.triangles.retain(|t| fits(&corners(t)));
}

/// The bronze mirror by its spectrum (a model: a step towards long wavelengths).
pub(crate) fn spectra() -> Value {
    json!({
        "materials": {
            "bronze mirror": {
                "reflectance": {"csv": "380,0.38\n450,0.42\n520,0.55\n580,0.78\n650,0.86\n780,0.88"},
                "mirror": true,
            },
        },
    })
}
