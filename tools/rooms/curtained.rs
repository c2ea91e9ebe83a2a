//! A room on a dull day behind a curtain that is half drawn, with a paper shade around a bulb and an opal ball around a lamp.

use super::cells::Cells;
use super::glb::{Glb, Mesh, matt};
use super::shapes::{block, lathe, sphere, tube};
use super::simple::within;
use glam::{DVec3, dvec3};
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

/// Steps across the curtain, and around the shade and the ball.
const FOLDED: usize = 48;
const AROUND: usize = 24;

/// 4.4 x 3.6 m, 2.6 m high; a window of 2 x 1.4 m in the wall at +Z, open to the sky of the side file.
pub(crate) fn room() -> Glb {
    let mut glb = Glb::default();
    shell(&mut glb);
    let cloth = sheet(
        &mut glb,
        "curtain",
        [0.62, 0.55, 0.42],
        0.45,
        [0.8, 0.66, 0.42],
    );
    glb.draw("curtain", &[(&curtain(), cloth)]);
    table(&mut glb);
    let opal = sheet(&mut glb, "opal glass", [0.9; 3], 0.5, [0.92, 0.92, 0.9]);
    let ball = sphere([3.2, 1.95, 1.3], 0.2, 16);
    glb.draw("ball", &[(&ball, opal)]);
    let dark = glb.paint("cord", [0.05; 3]);
    glb.draw("cord", &[(&tube([3.2, 2.15, 1.3], 0.006, 0.45, 6), dark)]);
    let lamp = json!({"name": "in the ball", "type": "point", "intensity": 25.0, "color": [1.0, 0.86, 0.68]});
    glb.light(lamp, dvec3(3.2, 1.95, 1.3), dvec3(3.2, 0.0, 1.3 + 1e-6));
    let picture = glb.paint("picture", [0.12, 0.2, 0.36]);
    let mut frame = block([4.37, 1.1, 0.7], [4.4, 1.9, 1.9]);
    let (positions, triangles) = (&frame.positions, &mut frame.triangles);
    // Its back lies on the wall.
    triangles.retain(|t| t.iter().any(|&v| positions[v as usize].x < 4.4));
    glb.draw("picture", &[(&frame, picture)]);
    let eye = dvec3(0.35, 1.55, 0.35);
    glb.camera("door", eye, dvec3(3.0, 1.05, 3.0), 1.15, 4.0 / 3.0);
    let near = dvec3(2.35, 1.35, 1.55);
    glb.camera("lamp", near, dvec3(3.75, 0.95, 2.9), 0.75, 4.0 / 3.0);
    glb
}

/// Walls, and a reveal of 25 cm around the window.
fn shell(glb: &mut Glb) {
    let walls = glb.paint("walls", [0.72, 0.71, 0.68]);
    let ceiling = glb.paint("ceiling", [0.84; 3]);
    let floor = glb.paint("floor", [0.3, 0.19, 0.11]);
    let reveal = glb.paint("window reveal", [0.8; 3]);
    // What closes the window in the grid is not drawn.
    let nothing = usize::MAX;
    let [width, height, depth] = [4.4, 2.6, 3.6];
    let cells = Cells {
        cuts: [
            &[0.0, 1.1, 3.1, width],
            &[0.0, 0.8, 2.2, height],
            &[0.0, depth, depth + 0.25],
        ],
        hollow: &|p| p.z < depth || within(p, [1.1, 0.8, depth], [3.1, 2.2, depth + 0.25]),
        paint: &|p, _| match () {
            () if p.z > depth + 0.24 => nothing,
            () if p.z > depth => reveal,
            () if p.y == 0.0 => floor,
            () if p.y == height => ceiling,
            () => walls,
        },
    };
    let mut meshes = cells.meshes();
    meshes.remove(&nothing);
    meshes.values_mut().for_each(|mesh| mesh.uvs.clear());
    let parts: Vec<(&Mesh, usize)> = meshes.iter().map(|(paint, mesh)| (mesh, *paint)).collect();
    glb.draw("room", &parts);
}

/// A material that lets a share of the light through, of a colour.
fn sheet(glb: &mut Glb, name: &str, color: [f64; 3], share: f64, through: [f64; 3]) -> usize {
    const SHEET: &str = "KHR_materials_diffuse_transmission";
    glb.uses(SHEET);
    glb.material(json!({
        "name": name,
        "pbrMetallicRoughness": matt(color),
        "extensions": {SHEET: {
            "diffuseTransmissionFactor": share,
            "diffuseTransmissionColorFactor": through,
        }},
    }))
}

/// In folds before the left part of the window, one-sided as the file has it.
fn curtain() -> Mesh {
    let mut mesh = Mesh::default();
    let (from, to) = (0.95, 2.35);
    for k in 0..=FOLDED {
        let s = k as f64 / FOLDED as f64;
        let (x, turn) = (from + (to - from) * s, 8.0 * TAU * s);
        let z = 3.47 + 0.045 * turn.sin();
        let slope = 0.045 * 8.0 * TAU / (to - from) * turn.cos();
        for y in [0.03, 2.4] {
            mesh.positions.push(dvec3(x, y, z));
            mesh.normals.push(dvec3(slope, 0.0, -1.0).normalize());
        }
        if k > 0 {
            let a = 2 * k as u32 - 2;
            mesh.triangles
                .extend([[a, a + 1, a + 3], [a, a + 3, a + 2]]);
        }
    }
    mesh
}

/// A chest with a lamp on it: a bulb of 300 lm in a cone of paper, open above and below.
fn table(glb: &mut Glb) {
    let wood = glb.paint("chest", [0.42, 0.27, 0.15]);
    let mut chest = block([3.4, 0.0, 2.4], [4.2, 0.62, 3.3]);
    let (positions, triangles) = (&chest.positions, &mut chest.triangles);
    // Nobody sees what it stands on.
    triangles.retain(|t| t.iter().any(|&v| positions[v as usize].y > 0.0));
    glb.draw("chest", &[(&chest, wood)]);
    let at = [3.8, 0.62, 2.85];
    let brass = glb.paint("lamp foot", [0.5, 0.38, 0.16]);
    let foot = lathe(
        at,
        &[
            [0.09, 0.0],
            [0.085, 0.02],
            [0.015, 0.04],
            [0.012, 0.3],
            [0.0, 0.3],
        ],
        AROUND,
    );
    glb.draw("lamp foot", &[(&foot, brass)]);
    let bulb: DVec3 = DVec3::from_array(at) + dvec3(0.0, 0.345, 0.0);
    let radius = 0.04;
    let nits = 400.0 / (PI * 4.0 * PI * radius * radius);
    let glow = glb.lamp("bulb", [0.6; 3], [1.0, 0.78, 0.5], nits);
    let globe = sphere(bulb.to_array(), radius, 12);
    glb.draw("bulb", &[(&globe, glow)]);
    let paper = sheet(glb, "paper", [0.88, 0.85, 0.78], 0.55, [0.93, 0.84, 0.66]);
    let shade = lathe(
        [at[0], at[1] + 0.24, at[2]],
        &[[0.19, 0.0], [0.12, 0.25]],
        AROUND,
    );
    glb.draw("shade", &[(&shade, paper)]);
}

/// A dull sky; paper by spectra, lighter inside than outside.
pub(crate) fn spectra() -> Value {
    json!({
        "materials": {
            "paper": {
                "reflectance": {"csv": "380,0.30\n450,0.42\n550,0.48\n700,0.50"},
                "back_reflectance": {"csv": "380,0.36\n450,0.50\n700,0.54"},
                "transmission": {"csv": "380,0.12\n450,0.26\n550,0.36\n650,0.41\n700,0.42"},
            },
        },
        "sky": {"type": "overcast", "illuminance_lx": 4000, "cct_k": 7500},
    })
}
