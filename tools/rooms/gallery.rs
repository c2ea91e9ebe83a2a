//! A gallery under lamps as they are sold: spots and wall washers by LM-63, a pendant panel by EULUMDAT. The files are of our own
//! figures, none of a maker's.

use super::glb::{Glb, Mesh};
use super::shapes::block;
use glam::{DVec3, dvec3};
use serde_json::{Value, json};
use std::fmt::Write;

const SIZE: [f64; 3] = [7.0, 3.2, 5.0];

/// 7 x 5 m, 3.2 m high: pictures on the far wall, a bench, a panel of 1.2 x .3 m that hangs over it.
pub(crate) fn room() -> Glb {
    let mut glb = Glb::default();
    let walls = glb.paint("walls", [0.82, 0.81, 0.78]);
    let ceiling = glb.paint("ceiling", [0.85; 3]);
    let floor = glb.paint("floor", [0.33, 0.25, 0.17]);
    let [w, h, d] = SIZE;
    let corner = |x: f64, y: f64, z: f64| dvec3(x * w, y * h, z * d);
    let side = |corners: [[f64; 3]; 4], toward: DVec3| {
        let mut mesh = Mesh::default();
        mesh.quad(corners.map(|[x, y, z]| corner(x, y, z)), toward);
        mesh.uvs.clear();
        mesh
    };
    let (o, i) = (0.0, 1.0);
    let sides = [
        (
            side([[o, o, o], [i, o, o], [i, o, i], [o, o, i]], DVec3::Y),
            floor,
        ),
        (
            side([[o, i, o], [i, i, o], [i, i, i], [o, i, i]], DVec3::NEG_Y),
            ceiling,
        ),
        (
            side([[o, o, o], [i, o, o], [i, i, o], [o, i, o]], DVec3::Z),
            walls,
        ),
        (
            side([[o, o, i], [i, o, i], [i, i, i], [o, i, i]], DVec3::NEG_Z),
            walls,
        ),
        (
            side([[o, o, o], [o, o, i], [o, i, i], [o, i, o]], DVec3::X),
            walls,
        ),
        (
            side([[i, o, o], [i, o, i], [i, i, i], [i, i, o]], DVec3::NEG_X),
            walls,
        ),
    ];
    let parts: Vec<(&Mesh, usize)> = sides.iter().map(|(mesh, paint)| (mesh, *paint)).collect();
    glb.draw("room", &parts);
    let colors = [[0.55, 0.1, 0.08], [0.1, 0.22, 0.5], [0.75, 0.55, 0.1]];
    for (k, color) in colors.into_iter().enumerate() {
        let paint = glb.paint(&format!("picture {}", k + 1), color);
        let x = 1.1 + 1.9 * k as f64;
        let mut mesh = block([x, 1.0, 0.0], [x + 1.0, 2.0, 0.03]);
        // Its back lies on the wall, and would look out of the room.
        let (positions, triangles) = (&mesh.positions, &mut mesh.triangles);
        triangles.retain(|t| t.iter().any(|&v| positions[v as usize].z > 0.0));
        mesh.uvs.clear();
        glb.draw(&format!("picture {}", k + 1), &[(&mesh, paint)]);
    }
    let wood = glb.paint("bench", [0.45, 0.3, 0.16]);
    let mut bench = block([2.6, 0.4, 2.6], [4.4, 0.46, 3.1]);
    for x in [2.7, 4.2] {
        bench.append(&block([x, 0.0, 2.65], [x + 0.1, 0.4, 3.05]));
    }
    bench.uvs.clear();
    glb.draw("bench", &[(&bench, wood)]);
    let opal = glb.paint("panel", [0.8; 3]);
    let mut panel = Mesh::default();
    let at = |x: f64, z: f64| dvec3(x, 2.4, z);
    panel.quad(
        [at(2.9, 2.7), at(4.1, 2.7), at(4.1, 3.0), at(2.9, 3.0)],
        DVec3::NEG_Y,
    );
    panel.uvs.clear();
    glb.draw("panel", &[(&panel, opal)]);
    lights(&mut glb);
    glb.camera(
        "door",
        dvec3(5.9, 1.6, 4.6),
        dvec3(2.9, 1.35, 0.6),
        1.05,
        4.0 / 3.0,
    );
    glb
}

/// Three spots on the pictures, two washers on the wall to the left.
fn lights(glb: &mut Glb) {
    for k in 0..3 {
        let x = 1.6 + 1.9 * f64::from(k);
        let spot = json!({"name": "spot", "type": "spot", "intensity": 100.0});
        glb.light(spot, dvec3(x, 3.1, 1.7), dvec3(x, 1.5, 0.03));
    }
    for z in [1.8, 3.2] {
        let washer = json!({"name": "washer", "type": "point", "intensity": 100.0});
        glb.light(washer, dvec3(0.8, 3.1, z), dvec3(0.8, 0.0, z + 1e-6));
    }
}

/// Which lamp has which file and spectrum.
pub(crate) fn spectra() -> Value {
    json!({
        "lights": {
            "spot": {"profile": "gallery-spot.ies", "name": "cie/LED-B2"},
            "washer": {"profile": "gallery-washer.ies", "name": "cie/LED-B3", "multiplier": 0.8, "turn_deg": 90},
        },
        "materials": {
            "panel": {"emission": {"profile": "gallery-panel.ldt", "name": "cie/LED-B3", "turn_deg": 90}},
        },
    })
}

/// The files of the lamps: name and text.
pub(crate) fn lamps() -> [(&'static str, String); 3] {
    [
        ("gallery-spot.ies", spot()),
        ("gallery-washer.ies", washer()),
        ("gallery-panel.ldt", panel()),
    ]
}

fn steps(to: u32, step: u32) -> Vec<f64> {
    (0..=to / step).map(|k| f64::from(k * step)).collect()
}

/// An LM-63 file; figures to one decimal.
fn ies(
    name: &str,
    opening: &str,
    rows: &[f64],
    planes: &[f64],
    candela: impl Fn(f64, f64) -> f64,
) -> String {
    let mut text = format!(
        "IES:LM-63-2019\n[TEST] own figures\n[TESTLAB] none\n[ISSUEDATE] 22-NOV-2026\n[MANUFAC] none\n[LUMINAIRE] {name}\n\
         TILT=NONE\n1 -1 1 {} {} 1 2 {opening}\n1 1.00001 12\n",
        rows.len(),
        planes.len()
    );
    let mut line = |numbers: &mut dyn Iterator<Item = f64>| {
        let words: Vec<String> = numbers.map(|x| format!("{x:.1}")).collect();
        let _ = writeln!(text, "{}", words.join(" "));
    };
    line(&mut rows.iter().copied());
    line(&mut planes.iter().copied());
    for plane in planes {
        line(&mut rows.iter().map(|row| candela(*row, *plane)));
    }
    text
}

/// A narrow beam with a ring about it, alike all around.
fn spot() -> String {
    let candela = |g: f64, _: f64| {
        let beam = 2400.0 * (-(g / 11.0).powi(2)).exp();
        let ring = 160.0 * (-((g - 32.0) / 7.0).powi(2)).exp();
        beam + ring
    };
    ies(
        "Narrow spot with a ring",
        "0.05 0.05 0",
        &steps(90, 2),
        &[0.0],
        candela,
    )
}

/// Light to one side, alike on both sides of C0-C180.
fn washer() -> String {
    let candela = |g: f64, c: f64| {
        let side = 0.5 + 0.5 * c.to_radians().cos();
        let peak = 900.0 * (-((g - 38.0) / 22.0).powi(2)).exp();
        side * side * peak + 120.0 * g.to_radians().cos().max(0.0)
    };
    ies(
        "Wall washer",
        "0.1 0.1 0",
        &steps(90, 5),
        &steps(180, 15),
        candela,
    )
}

/// A panel with a batwing across, cd for 1000 lm of 3600 lm, symmetry 4.
fn panel() -> String {
    let rows = steps(90, 5);
    let planes: Vec<f64> = (0..24).map(|k| 15.0 * f64::from(k)).collect();
    let mut lines: Vec<String> = vec![
        "none".into(),
        "2".into(),
        "4".into(),
        "24".into(),
        "15".into(),
    ];
    lines.extend([rows.len().to_string(), "5".into()]);
    lines.extend(
        [
            "own figures",
            "Pendant panel",
            "1",
            "panel.ldt",
            "22-11-2026",
        ]
        .map(String::from),
    );
    lines.extend(["1220", "320", "40", "1200", "300", "0", "0", "0", "0"].map(String::from));
    lines.extend(
        [
            "100", "0", "1", "0", "1", "-1", "LED", "3600", "4000", "80", "30",
        ]
        .map(String::from),
    );
    lines.extend([""; 10].map(|_| "0".to_owned()));
    lines.extend(planes.iter().map(f64::to_string));
    lines.extend(rows.iter().map(f64::to_string));
    for plane in &planes[..=6] {
        let across = plane.to_radians().cos().powi(2);
        lines.extend(rows.iter().map(|g| {
            let lambert = g.to_radians().cos().max(0.0);
            let wing = across * (-((g - 42.0) / 18.0).powi(2)).exp();
            format!("{:.1}", 250.0 * lambert + 160.0 * wing * lambert)
        }));
    }
    lines.join("\n") + "\n"
}
