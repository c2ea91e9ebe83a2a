//! Test rooms of CIE 171:2006.
//!
//! The report's axes are x, y along the floor and z up; here a point (x, y, z) of the report stands at (x, z, -y).

use super::cells::Cells;
use super::glb::{Glb, Mesh};
use super::simple::{down, draw, within};
use glam::{DVec3, dvec3};
use serde_json::json;
use std::f64::consts::PI;

/// Flux of the isotropic sources, lm.
const FLUX: f64 = 10_000.0;

/// Exitance of the uniformly lit surfaces of 5.6 and 5.7, lm/m2: the product E_hz rho (E_v rho) of the report.
const EXITANCE: f64 = 1000.0;

const BLACK: [f64; 3] = [0.0; 3];

/// A point of the report.
fn cie(x: f64, y: f64, z: f64) -> DVec3 {
    dvec3(x, z, -y)
}

fn isotropic(glb: &mut Glb, at: DVec3) {
    let light = json!({"name": "isotropic", "type": "point", "intensity": FLUX / (4.0 * PI)});
    glb.light(light, at, at - DVec3::Y);
}

fn view(glb: &mut Glb, eye: DVec3, target: DVec3) {
    glb.camera("view", eye, target, 1.2, 4.0 / 3.0);
}

/// A closed room of the report's 4 x 4 x 3 m with the paints that `paint` picks by the point's own axes.
fn closed(
    glb: &mut Glb,
    cuts: [&[f64]; 3],
    hollow: &dyn Fn(DVec3) -> bool,
    paint: &dyn Fn(DVec3, DVec3) -> usize,
) {
    let cells = Cells {
        cuts,
        hollow,
        paint,
    };
    draw(glb, "room", &cells, &[]);
}

/// 5.2: a floor under a Lambertian source of 1000 cd at 3 m; glTF has no such light, so it is a square of 1 cm.
pub(crate) fn case_5_2() -> Glb {
    const SIDE: f64 = 0.01;
    let mut glb = floor_5_2();
    let lamp = glb.lamp("source", BLACK, [1.0; 3], 1000.0 / (SIDE * SIDE));
    let mut mesh = Mesh::default();
    let h = SIDE / 2.0;
    mesh.quad(
        [
            cie(-h, -h, 3.0),
            cie(h, -h, 3.0),
            cie(h, h, 3.0),
            cie(-h, h, 3.0),
        ],
        DVec3::ZERO,
    );
    glb.draw("source", &[(&mesh, lamp)]);
    glb
}

/// 5.2 with an isotropic source of 10 000 lm.
pub(crate) fn case_5_2_isotropic() -> Glb {
    let mut glb = floor_5_2();
    isotropic(&mut glb, cie(0.0, 0.0, 3.0));
    glb
}

fn floor_5_2() -> Glb {
    let mut glb = Glb::default();
    let black = glb.paint("floor", BLACK);
    let mut floor = Mesh::default();
    floor.quad(
        [
            cie(-2.0, -2.0, 0.0),
            cie(2.0, -2.0, 0.0),
            cie(2.0, 2.0, 0.0),
            cie(-2.0, 2.0, 0.0),
        ],
        DVec3::Y,
    );
    glb.draw("floor", &[(&floor, black)]);
    view(&mut glb, cie(-1.8, -1.8, 2.2), DVec3::ZERO);
    glb
}

/// 5.3: a black room, 1 x 1 m of 1000 cd/m2 in the middle of the ceiling.
pub(crate) fn case_5_3() -> Glb {
    let mut glb = Glb::default();
    let black = glb.paint("walls", BLACK);
    let lamp = glb.lamp("source", BLACK, [1.0; 3], 1000.0);
    let cuts: [&[f64]; 3] = [&[0.0, 1.5, 2.5, 4.0], &[0.0, 3.0], &[-4.0, -2.5, -1.5, 0.0]];
    closed(&mut glb, cuts, &|_| true, &|p, n| {
        if down(n) && within(p, [1.5, 0.0, -2.5], [2.5, 4.0, -1.5]) {
            lamp
        } else {
            black
        }
    });
    view(&mut glb, cie(0.3, 0.3, 1.6), cie(2.5, 3.0, 1.2));
    glb
}

/// 5.4: a black room, an isotropic source of 10 000 lm in its middle: the walls receive 10 000 lm.
pub(crate) fn case_5_4() -> Glb {
    let mut glb = Glb::default();
    let black = glb.paint("walls", BLACK);
    closed(
        &mut glb,
        [&[0.0, 4.0], &[0.0, 3.0], &[-4.0, 0.0]],
        &|_| true,
        &|_, _| black,
    );
    isotropic(&mut glb, cie(2.0, 2.0, 1.5));
    view(&mut glb, cie(0.3, 0.3, 1.6), cie(2.5, 3.0, 1.2));
    glb
}

/// 5.6, second scenario: the whole floor lit uniformly, all else black. The lit floor is an emitter of equal exitance.
pub(crate) fn case_5_6() -> Glb {
    let mut glb = Glb::default();
    let black = glb.paint("walls", BLACK);
    let lit = glb.lamp("lit", BLACK, [1.0; 3], EXITANCE / PI);
    closed(
        &mut glb,
        [&[0.0, 4.0], &[0.0, 3.0], &[-4.0, 0.0]],
        &|_| true,
        &|_, n| {
            if n.y > 0.5 { lit } else { black }
        },
    );
    view(&mut glb, cie(0.3, 0.3, 1.6), cie(2.5, 3.0, 1.2));
    glb
}

/// 5.7: the wall at y = 4 lit uniformly, a black box 1 m high before it, all else black.
pub(crate) fn case_5_7() -> Glb {
    let mut glb = Glb::default();
    let black = glb.paint("walls", BLACK);
    let lit = glb.lamp("lit", BLACK, [1.0; 3], EXITANCE / PI);
    closed(
        &mut glb,
        [&[0.0, 4.0], &[0.0, 1.0, 3.0], &[-4.0, -2.7, -2.5, 0.0]],
        &|p| !within(p, [0.0, 0.0, -2.7], [4.0, 1.0, -2.5]),
        &|p, _| if p.z == -4.0 { lit } else { black },
    );
    view(&mut glb, cie(0.3, 0.3, 1.6), cie(2.5, 4.0, 1.2));
    glb
}

/// 5.8: a cube of 4 m and albedo `rho`, an isotropic source of 10 000 lm in its middle.
pub(crate) fn case_5_8(rho: f64) -> Glb {
    let mut glb = Glb::default();
    let wall = glb.paint("walls", [rho; 3]);
    closed(
        &mut glb,
        [&[0.0, 4.0], &[0.0, 4.0], &[-4.0, 0.0]],
        &|_| true,
        &|_, _| wall,
    );
    isotropic(&mut glb, cie(2.0, 2.0, 2.0));
    view(&mut glb, cie(0.3, 0.3, 1.6), cie(3.0, 3.0, 1.5));
    glb
}
