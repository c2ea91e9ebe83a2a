//! Where the light goes: closedness, a first guess of brightness, and the flux balance
//! `emitted = absorbed + escaped` (any geometry, any wavelength).

use crate::geometry::{Pcg, RayIndex, cosine_direction};
use crate::hierarchy::{Mesh, Tree, barycentric};
use crate::link::{Closed, Sight};
use crate::scene::Scene;
use crate::spectrum::Leaves;

/// Rays that test whether a room is closed.
const ESCAPE_RAYS: usize = 8192;

/// Casts rays from the fronts of all faces: the room is closed if every one meets the front of something.
pub fn closedness(mesh: &Mesh, tree: &Tree, rays: &RayIndex, sight: &Sight, seed: u64) -> Closed {
    let Some(root) = tree.nodes.first() else { return Closed::No };
    if sight.opaque.is_some() {
        // Holes lead somewhere else; rows are then only kept from exceeding 1.
        return Closed::No;
    }
    let mut rng = Pcg::new(seed ^ 0x00c1_05ed);
    let reach = (4.0 * mesh.half_size) as f32;
    for _ in 0..ESCAPE_RAYS {
        let target = rng.f64() * root.area;
        let entry = (tree.face_area.partition_point(|&a| a <= target).max(1) - 1).min(tree.faces.len() - 1);
        let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
        let from = element.at(barycentric([rng.f64(), rng.f64()]));
        let direction = cosine_direction(tree.face_normal[entry], [rng.f64(), rng.f64()]);
        match rays.closest(from.as_vec3(), direction.as_vec3(), reach, tree.face_plane[entry]) {
            None => return Closed::No,
            Some(hit) if hit.behind && tree.entry[hit.triangle as usize][1] == crate::hierarchy::NONE => return Closed::No,
            Some(_) => {}
        }
    }
    Closed::Yes
}

/// What is known before the first solution.
pub struct Guess {
    /// Irradiance of the adaptation white: twice the mean irradiance.
    pub white: [f64; 3],
    /// Brightness of every node, share of white.
    pub bright: Vec<f32>,
}

/// Light spread evenly over all faces: `H = flux / (A (1 - mean albedo))`.
pub fn guess(scene: &Scene, mesh: &Mesh, tree: &Tree, weights: &[Leaves; 3]) -> Guess {
    let lanes = super::lanes::Lanes::dense(&scene.spectra, weights);
    let mut row = [0.0_f32; 64];
    let glow: Vec<[f64; 3]> = scene
        .materials
        .iter()
        .map(|m| {
            row.fill(0.0);
            if let Some(e) = &m.emission {
                lanes.add_emission(e.light, &e.shape, std::f64::consts::PI, &mut row);
            }
            lanes.tristimulus(&row)
        })
        .collect();
    let whole: f64 = weights[1].iter().sum();
    let albedo: Vec<f64> = scene
        .materials
        .iter()
        .map(|m| m.reflectance.iter().zip(&weights[1]).map(|(r, w)| r * w).sum::<f64>() / whole)
        .collect();
    let material = |k: usize| mesh.material[tree.faces[k].triangle as usize] as usize;
    let area = |k: usize| mesh.area[tree.faces[k].triangle as usize];
    let (mut flux, mut total, mut mean) = ([0.0; 3], 0.0, 0.0);
    for k in 0..tree.faces.len() {
        let (m, a) = (material(k), area(k));
        flux = std::array::from_fn(|c| flux[c] + a * glow[m][c]);
        total += a;
        mean += a * albedo[m];
    }
    for light in &scene.lights {
        row.fill(0.0);
        lanes.add_emission(light.light, &light.shape, 1.0, &mut row);
        let solid = super::punctual::solid_angle(light.kind).unwrap_or(0.25 * total);
        let xyz = lanes.tristimulus(&row);
        flux = std::array::from_fn(|c| flux[c] + solid * xyz[c]);
    }
    // Open rooms lose light: half counts as lost before more is known, so that the guess stays finite.
    let mean = if total > 0.0 { (mean / total).min(0.9) } else { 0.0 };
    let white = flux.map(|f| if total > 0.0 { 2.0 * f / (total * (1.0 - mean)) } else { 0.0 });
    let mut bright = vec![0.0_f32; tree.nodes.len()];
    for k in (0..tree.nodes.len()).rev() {
        let node = &tree.nodes[k];
        bright[k] = if node.is_leaf() {
            let m = material(node.faces.0 as usize);
            (super::light::brightness(glow[m], white) + 0.5 * albedo[m]) as f32
        } else {
            node.child_range().map(|c| f64::from(bright[c as usize]) * tree.node(c).area).sum::<f64>() as f32 / node.area as f32
        };
    }
    Guess { white, bright }
}

/// Flux balance of a solution. `emitted = absorbed + escaped` must hold for every band.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Balance {
    /// Luminous flux given out by surfaces and received from punctual lights, lm.
    pub emitted_lm: f64,
    /// Luminous flux absorbed by fronts, lm.
    pub absorbed_lm: f64,
    /// Luminous flux that left the room or met a black back, lm: by row sums below 1.
    pub escaped_lm: f64,
    /// Worst relative difference of emitted and absorbed + escaped over all bands that carry light.
    pub worst_band: f64,
}

/// Sums the flux of a solution in f64: rows by leaf, `sums` the balanced row sums by node, `punctual` the irradiance
/// from punctual lights by leaf.
pub(super) fn flux(tree: &Tree, lanes: &super::lanes::Lanes, leaves: &[u32], rows: &FluxRows, sums: &[f64]) -> Balance {
    let n = lanes.len();
    let (mut emitted, mut absorbed, mut escaped) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for (k, &leaf) in leaves.iter().enumerate() {
        let area = tree.node(leaf).area;
        for l in 0..n {
            let get = |r: &super::Rows| f64::from(r.row(k)[l]);
            let (e, r, h, p, rho) = (get(rows.emission), get(rows.reflected), get(rows.irradiance), get(rows.punctual), get(rows.reflectance));
            emitted[l] += area * (e + p);
            absorbed[l] += area * (1.0 - rho) * h;
            escaped[l] += area * (e + r) * (1.0 - sums[leaf as usize]);
        }
    }
    let worst = (0..n)
        .filter(|&l| emitted[l] > 0.0)
        .map(|l| ((absorbed[l] + escaped[l]) / emitted[l] - 1.0).abs())
        .fold(0.0, f64::max);
    let lumens = |x: &[f64]| x.iter().zip(lanes.xyz()).map(|(x, w)| x * w[1]).sum();
    Balance { emitted_lm: lumens(&emitted), absorbed_lm: lumens(&absorbed), escaped_lm: lumens(&escaped), worst_band: worst }
}

/// Rows by leaf that the flux is summed from.
pub(super) struct FluxRows<'a> {
    pub(super) emission: &'a super::Rows,
    pub(super) reflected: &'a super::Rows,
    pub(super) irradiance: &'a super::Rows,
    pub(super) punctual: &'a super::Rows,
    pub(super) reflectance: &'a super::Rows,
}
