//! A cabinet of three booths to look at white paper in: under D65, under illuminant A without ultraviolet, and under an ultraviolet lamp.
//! In each lie a sheet with an optical brightener and one without, a ball of fluorescent orange and one of ordinary orange.
//!
//! The spectra of dyes are model curves, bell-shaped, after what is published of their kind: brighteners take light of about 300 to 430 nm
//! and give it out between 400 and 500, most at 435 to 440 (Siegrist and others, "Optical brighteners", Ullmann's Encyclopedia of
//! Industrial Chemistry, 2012); daylight fluorescent orange takes blue and green light and gives it out around 600 nm. So is the ultraviolet
//! lamp, a band at 368 nm as that of a "black light" tube, with a trace of visible light.

use super::glb::{Glb, Mesh};
use super::shapes::{block, sphere};
use glam::{DVec3, dvec3};
use serde_json::{Value, json};

/// A booth inside, and the boards between them.
const WIDE: f64 = 0.7;
const HIGH: f64 = 0.6;
const DEEP: f64 = 0.55;
const BOARD: f64 = 0.02;
/// Names of the booths' lamps.
const LAMPS: [&str; 3] = ["daylight", "incandescent", "ultraviolet"];

/// Three booths side by side, open to +Z.
pub(crate) fn room() -> Glb {
    let mut glb = Glb::default();
    let grey = glb.paint("booth", [0.4; 3]);
    let outside = glb.paint("cabinet", [0.12, 0.12, 0.13]);
    let paper = glb.paint("brightened paper", [0.8; 3]);
    let plain = glb.paint("plain paper", [0.8; 3]);
    let bright = glb.paint("fluorescent orange", [0.85, 0.2, 0.02]);
    let paint = glb.paint("orange", [0.85, 0.2, 0.02]);
    for (k, name) in LAMPS.into_iter().enumerate() {
        let x = (k as f64 - 1.0) * (WIDE + BOARD) - 0.5 * WIDE;
        let lamp = glb.lamp(name, [0.6; 3], [1.0; 3], 1.0);
        booth(&mut glb, name, x, grey, lamp);
        let mut card = |name: &str, from: f64, paint: usize| {
            let mut mesh = Mesh::default();
            let [a, b] = [from, from + 0.21].map(|d| dvec3(x + d, 0.0, 0.0));
            let (low, high) = (dvec3(0.0, 0.002, 0.27), dvec3(0.0, 0.14, 0.015));
            mesh.quad([a + low, b + low, b + high, a + high], dvec3(x, 1.0, 1.0));
            glb.draw(&format!("{name}, {}", LAMPS[k]), &[(&mesh, paint)]);
        };
        card("brightened", 0.1, paper);
        card("plain", 0.39, plain);
        for (at, paint) in [(0.2, bright), (0.5, paint)] {
            let ball = sphere([x + at, 0.062, 0.4], 0.06, 12);
            glb.draw("ball", &[(&ball, paint)]);
        }
    }
    let whole = 1.5 * WIDE + 2.0 * BOARD;
    let mut shell = block([-whole, -BOARD, -BOARD], [whole, HIGH + BOARD, DEEP]);
    // Its front is open.
    let (positions, triangles) = (&shell.positions, &mut shell.triangles);
    triangles.retain(|t| t.iter().any(|&v| positions[v as usize].z < DEEP));
    glb.draw("cabinet", &[(&shell, outside)]);
    let eye = dvec3(0.0, 0.5, 2.35);
    glb.camera("front", eye, dvec3(0.0, 0.27, 0.2), 0.51, 2.25);
    let x = -(WIDE + BOARD);
    glb.camera(
        "daylight",
        dvec3(x, 0.42, 1.15),
        dvec3(x, 0.14, 0.2),
        0.6,
        4.0 / 3.0,
    );
    glb
}

/// The five sides of a booth, with a lamp in its ceiling.
fn booth(glb: &mut Glb, name: &str, x: f64, grey: usize, lamp: usize) {
    let at = |u: f64, v: f64, w: f64| dvec3(x + u * WIDE, v * HIGH, w * DEEP);
    let middle = at(0.5, 0.5, 0.5);
    let mut walls = Mesh::default();
    let mut wall = |corners: [DVec3; 4]| walls.quad(corners, middle);
    wall([
        at(0., 0., 0.),
        at(1., 0., 0.),
        at(1., 0., 1.),
        at(0., 0., 1.),
    ]);
    wall([
        at(0., 0., 0.),
        at(1., 0., 0.),
        at(1., 1., 0.),
        at(0., 1., 0.),
    ]);
    wall([
        at(0., 0., 0.),
        at(0., 0., 1.),
        at(0., 1., 1.),
        at(0., 1., 0.),
    ]);
    wall([
        at(1., 0., 0.),
        at(1., 0., 1.),
        at(1., 1., 1.),
        at(1., 1., 0.),
    ]);
    // The ceiling around the lamp.
    let (near, far) = ([0.2, 0.8], [0.3, 0.7]);
    let [a, b] = near;
    let [c, d] = far;
    wall([at(0., 1., 0.), at(a, 1., 0.), at(a, 1., 1.), at(0., 1., 1.)]);
    wall([at(b, 1., 0.), at(1., 1., 0.), at(1., 1., 1.), at(b, 1., 1.)]);
    wall([at(a, 1., 0.), at(b, 1., 0.), at(b, 1., c), at(a, 1., c)]);
    wall([at(a, 1., d), at(b, 1., d), at(b, 1., 1.), at(a, 1., 1.)]);
    let mut panel = Mesh::default();
    panel.quad(
        [at(a, 1., c), at(b, 1., c), at(b, 1., d), at(a, 1., d)],
        middle,
    );
    glb.draw(&format!("booth, {name}"), &[(&walls, grey)]);
    glb.draw(&format!("lamp, {name}"), &[(&panel, lamp)]);
}

/// Rows of a CSV: a bell of this height, middle and standard deviation, nm, wider by `skew` above its middle.
fn bell(height: f64, middle: f64, wide: f64, skew: f64) -> String {
    rows(|nm| {
        let side = if nm > middle { skew * wide } else { wide };
        height * (-0.5 * ((nm - middle) / side).powi(2)).exp()
    })
}

/// Rows of a CSV from 300 to 780 nm.
fn rows(value: impl Fn(f64) -> f64) -> String {
    let row = |k: u32| {
        let nm = f64::from(300 + 10 * k);
        format!("{nm},{:.4}", value(nm))
    };
    (0..=48).map(row).collect::<Vec<String>>().join("\n")
}

/// Illuminant A: Planck's law at 2856 K (CIE 015:2018, 4.1), without what a filter keeps back below 420 nm.
fn incandescent() -> String {
    rows(|nm| {
        let planck = |nm: f64| nm.powi(-5) / ((1.4388e7 / (2856.0 * nm)).exp() - 1.0);
        let passes = ((nm - 410.0) / 20.0).clamp(0.0, 1.0);
        passes * planck(nm) / planck(560.0)
    })
}

/// Papers without and with a brightener, both absorbing as titanium dioxide and what lignin is left do below 420 nm; lamps and dyes.
pub(crate) fn spectra() -> Value {
    let paper = "300,0.08\n340,0.1\n370,0.2\n400,0.55\n430,0.76\n480,0.82\n560,0.85\n780,0.87";
    let orange = "300,0.04\n480,0.03\n530,0.06\n560,0.2\n580,0.5\n600,0.75\n640,0.84\n780,0.86";
    let dyed = "300,0.04\n480,0.03\n530,0.03\n560,0.1\n580,0.3\n600,0.6\n640,0.8\n780,0.86";
    let ultraviolet = rows(|nm| {
        let band = (-0.5 * ((nm - 368.0) / 8.0).powi(2)).exp();
        band + if nm >= 400.0 { 2e-4 } else { 0.0 }
    });
    json!({
        "materials": {
            "daylight": {"reflectance": {"csv": "300,0.6\n780,0.6"}, "emission": {"name": "cie/D65", "luminance_cd_m2": 800}},
            "incandescent": {"reflectance": {"csv": "300,0.6\n780,0.6"}, "emission": {"csv": incandescent(), "luminance_cd_m2": 800}},
            "ultraviolet": {"reflectance": {"csv": "300,0.6\n780,0.6"}, "emission": {"csv": ultraviolet, "luminance_cd_m2": 40}},
            "plain paper": {"reflectance": {"csv": paper}},
            "brightened paper": {
                "reflectance": {"csv": paper},
                "fluorescence": {
                    "excitation": {"csv": bell(0.7, 370.0, 25.0, 1.0)},
                    "emission": {"csv": bell(1.0, 437.0, 16.0, 1.9)},
                    "yield": 0.8,
                },
            },
            "orange": {"reflectance": {"csv": orange}},
            "fluorescent orange": {
                "reflectance": {"csv": dyed},
                "fluorescence": {
                    "excitation": {"csv": bell(0.9, 530.0, 60.0, 0.4)},
                    "emission": {"csv": bell(1.0, 600.0, 14.0, 2.0)},
                    "yield": 0.85,
                },
            },
        },
    })
}
