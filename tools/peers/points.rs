//! The side of haarlight in the comparison with other programs: irradiance at points, with the CPU time it took.
//!
//! `points ROOM COUNT scene OUT.json` writes the room as other programs need it (triangles, spectra on the bands), COUNT
//! points on it, and the audit's irradiance there.
//! `points ROOM COUNT run ERROR` bakes the room round by round and prints a line of JSON after each round: CPU seconds
//! from an empty machine (loading excepted) to the irradiance at all points, and that irradiance (tristimulus).
//! Points lie on surfaces that do not shine, evenly by area, from a fixed seed.

use anyhow::{Context, Result};
use glam::DVec3;
use haarlight::audit::Audit;
use haarlight::color::{KM, Observer};
use haarlight::geometry::RayIndex;
use haarlight::geometry::sampling::{Pcg, on_triangle};
use haarlight::hierarchy::Mesh;
use haarlight::scene::{Options, Scene, Sides};
use haarlight::solve::{Bake, Settings};
use serde_json::json;

/// Paths of the audit from each point; it only checks the other program's reference.
const PATHS: usize = 16_384;
/// Seed of the points.
const SEED: u64 = 7;
/// Elements and CPU seconds beyond which no further round is begun.
const MOST: (usize, f64) = (60_000, 10.0);

/// CPU seconds of all threads so far (Linux: nanoseconds a thread spent running).
fn cpu_seconds() -> Result<f64> {
    let mut sum = 0.0;
    for task in std::fs::read_dir("/proc/self/task")? {
        let text = std::fs::read_to_string(task?.path().join("schedstat"))?;
        let first = text.split_whitespace().next().context("empty schedstat")?;
        sum += 1e-9 * first.parse::<f64>()?;
    }
    Ok(sum)
}

/// A place on a front: point in world space, normal, triangle.
type Place = (DVec3, DVec3, usize);

fn places(scene: &Scene, mesh: &Mesh, count: usize) -> Vec<Place> {
    let mut upto = Vec::new();
    let mut total = 0.0;
    for (triangle, &material) in mesh.material.iter().enumerate() {
        if scene.materials[material as usize].emission.is_none() {
            total += mesh.area[triangle];
            upto.push((total, triangle));
        }
    }
    let mut random = Pcg::new(SEED);
    (0..count)
        .map(|_| {
            let wanted = random.f64() * total;
            let at = upto.partition_point(|&(sum, _)| sum <= wanted);
            let triangle = upto[at.min(upto.len() - 1)].1;
            let corners = mesh.triangles[triangle].map(|v| mesh.positions[v as usize]);
            let point = on_triangle(&corners, [random.f64(), random.f64()]);
            (point + mesh.centre, mesh.normal[triangle], triangle)
        })
        .collect()
}

/// The room for another program.
fn export(scene: &Scene, count: usize) -> Result<serde_json::Value> {
    let mesh = Mesh::new(scene);
    let places = places(scene, &mesh, count);
    let materials: Vec<_> = scene
        .materials
        .iter()
        .map(|m| {
            let emission = m.emission.as_ref().map(|e| {
                let power = &scene.spectra[e.light].power;
                e.shape
                    .iter()
                    .zip(power)
                    .map(|(s, p)| s * p)
                    .collect::<Vec<f64>>()
            });
            json!({ "name": m.name, "reflectance": m.reflectance.to_vec(), "emission": emission,
                "two_sided": m.sides == Sides::Both, "textured": m.paint.is_some() })
        })
        .collect();
    // W/m2/nm on a band to lx.
    let weights = Observer::cie1931()
        .weights(&scene.grid)
        .map(|w| w.map(|x| KM * x));
    let positions: Vec<glam::Vec3> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
    let rays = RayIndex::build(
        &positions,
        &mesh.triangles,
        &mesh.plane,
        &vec![false; mesh.triangles.len()],
    );
    let starts: Vec<_> = places
        .iter()
        .map(|&(p, n, t)| (p - mesh.centre, n, mesh.plane[t]))
        .collect();
    let audit: Vec<[f64; 3]> = Audit::new(scene, &mesh, &rays)
        .irradiance(&starts, &vec![PATHS; starts.len()], SEED)
        .iter()
        .map(|answer| [0, 1, 2].map(|c| answer.linear(&weights[c]).0))
        .collect();
    Ok(json!({
        "start_nm": scene.grid.start(), "width_nm": scene.grid.width(),
        "weights": weights.iter().map(|w| w.to_vec()).collect::<Vec<_>>(),
        "materials": materials,
        "positions": mesh.positions.iter().map(|p| (*p + mesh.centre).to_array()).collect::<Vec<_>>(),
        "triangles": mesh.triangles, "material": mesh.material,
        "points": places.iter().map(|(p, ..)| p.to_array()).collect::<Vec<_>>(),
        "normals": places.iter().map(|(_, n, _)| n.to_array()).collect::<Vec<_>>(),
        "point_material": places.iter().map(|&(.., t)| mesh.material[t]).collect::<Vec<_>>(),
        "audit_xyz": audit,
    }))
}

/// Bakes and reports after each round.
fn run(scene: Scene, count: usize, error: f64) -> Result<()> {
    let points: Vec<(DVec3, DVec3)> = places(&scene, &Mesh::new(&scene), count)
        .into_iter()
        .map(|(p, n, _)| (p, n))
        .collect();
    let start = cpu_seconds()?;
    let mut bake = Bake::new(
        scene,
        Settings {
            error,
            ..Settings::default()
        },
    );
    let mut gathers = 0.0;
    for round in 0..12 {
        bake.step();
        let before = cpu_seconds()?;
        let xyz: Vec<[f64; 3]> = bake.probe(&points).iter().map(|p| p.xyz).collect();
        let now = cpu_seconds()?;
        // Gathers of earlier rounds were only for this report.
        let cpu = now - start - gathers;
        gathers += now - before;
        let elements = bake.rounds()[round].elements;
        let line = json!({ "error": error, "round": round, "cpu_s": cpu, "gather_s": now - before,
            "elements": elements, "white": bake.light().white, "xyz": xyz });
        println!("{line}");
        if elements > MOST.0 || cpu > MOST.1 || bake.verdict().is_some() {
            break;
        }
    }
    Ok(())
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [room, count, what, last] = words.as_slice() else {
        anyhow::bail!("usage: points ROOM COUNT scene OUT.json | points ROOM COUNT run ERROR");
    };
    let scene = Scene::load(room, &Options::default())?;
    let count = count.parse()?;
    match what.as_str() {
        "scene" => std::fs::write(last, export(&scene, count)?.to_string())?,
        _ => run(scene, count, last.parse()?)?,
    }
    Ok(())
}
