//! Where the light goes: closedness, a first guess of brightness, and the flux balance
//! `emitted = absorbed + escaped` (any geometry, any wavelength).

use crate::geometry::RayIndex;
use crate::geometry::sampling::{Pcg, cosine_direction, sequence02, triangle_weights};
use crate::hierarchy::{Mesh, NONE, Tree};
use crate::light::Rows;
use crate::light::lanes::Lanes;
use crate::link::Sight;
use crate::scene::{PunctualLight, Scene};
use crate::spectrum::Spectrum;
use glam::DVec3;

/// Rays that test whether a room is closed.
const ESCAPE_RAYS: usize = 8192;
/// Rays that tell whether a point is covered.
const COVER_RAYS: u32 = 4;

/// Can light leave the room, or be lost on a black back?
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Closed {
    /// No ray of thousands did.
    Yes,
    /// Some did.
    No,
}

/// Shares of the luminous flux of all lamps, by rays from them (estimates, to about 0.1 %). Their sum is 1, or 0 where nothing
/// shines. Directional lights have no flux and are left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Sent {
    /// Luminous flux of all lamps, lm.
    pub lamps_lm: f64,
    /// To the fronts of surfaces.
    pub to_fronts: f64,
    /// To black backs of one-sided surfaces.
    pub to_backs: f64,
    /// Out of the room.
    pub outside: f64,
    /// Kept back by panes on the way: what they absorb, and what they reflect, which is left out.
    #[serde(default)]
    pub in_panes: f64,
}

/// Casts rays from the fronts of all faces: the room is closed if every ray meets the front of something. The second
/// answer leaves out points that something solid covers, such as the floor below a box.
pub(super) fn closedness(
    mesh: &Mesh,
    tree: &Tree,
    rays: &RayIndex,
    sight: &Sight,
    seed: u64,
) -> [Closed; 2] {
    let Some(root) = tree.nodes.first() else {
        return [Closed::No; 2];
    };
    if sight.opaque.is_some() {
        // Light leaves through holes.
        return [Closed::No; 2];
    }
    let mut all = Closed::Yes;
    let mut rng = Pcg::new(seed ^ 0x00c1_05ed);
    for _ in 0..ESCAPE_RAYS {
        let target = rng.f64() * root.area;
        let entry = tree.entry_at(target);
        let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
        let from = element.at(triangle_weights([rng.f64(), rng.f64()]));
        let direction = cosine_direction(tree.face_normal[entry], [rng.f64(), rng.f64()]);
        let (normal, plane) = (tree.face_normal[entry], tree.face_plane[entry]);
        match meets(mesh, tree, rays, from, direction, plane) {
            Meets::Front => {}
            Meets::Back if covered(mesh, tree, rays, from, normal, plane, seed) => all = Closed::No,
            Meets::Back | Meets::Nothing => return [Closed::No; 2],
        }
    }
    [all, Closed::Yes]
}

/// What a ray from a surface meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Meets {
    Front,
    /// The black back of a one-sided surface: the ray started inside something solid.
    Back,
    Nothing,
}

pub(super) fn meets(
    mesh: &Mesh,
    tree: &Tree,
    rays: &RayIndex,
    from: DVec3,
    direction: DVec3,
    plane: u32,
) -> Meets {
    let reach = (4.0 * mesh.reach) as f32;
    match rays.closest(from.as_vec3(), direction.as_vec3(), reach, plane) {
        None => Meets::Nothing,
        Some(hit) if hit.from_behind && tree.entry[hit.triangle as usize][1] == NONE => Meets::Back,
        Some(_) => Meets::Front,
    }
}

/// Is a point of a surface covered by something solid that stands on it or ends there? Then it sees only backs.
pub(super) fn covered(
    mesh: &Mesh,
    tree: &Tree,
    rays: &RayIndex,
    point: DVec3,
    normal: DVec3,
    plane: u32,
    seed: u64,
) -> bool {
    (0..COVER_RAYS).all(|k| {
        meets(
            mesh,
            tree,
            rays,
            point,
            cosine_direction(normal, sequence02(k, seed)),
            plane,
        ) == Meets::Back
    })
}

/// What is known before the first solution.
pub(crate) struct Guess {
    /// Irradiance of the adaptation white: twice the mean irradiance.
    pub white: [f64; 3],
    /// Brightness of every node, share of white.
    pub bright: Vec<f32>,
}

/// Rough share of a room's faces that sees the sky, before anything is known of its openings.
const DOME: f64 = 0.05;

/// Light spread evenly over all faces: `H = flux / (A (1 - mean albedo))`.
pub(crate) fn guess(scene: &Scene, mesh: &Mesh, tree: &Tree, weights: &[Spectrum; 3]) -> Guess {
    let lanes = Lanes::dense(&scene.spectra, weights);
    let glow: Vec<[f64; 3]> = (scene.materials.iter())
        .map(|m| lanes.exitance(m.even_emission()))
        .collect();
    let whole: f64 = weights[1].iter().sum();
    let albedo: Vec<f64> = scene
        .materials
        .iter()
        .map(|m| {
            let luminous = |spectrum: &Spectrum| -> f64 {
                spectrum.iter().zip(&weights[1]).map(|(r, w)| r * w).sum()
            };
            let through = m.sheet.as_ref().map_or(0.0, |s| luminous(&s.transmittance));
            (luminous(&m.reflectance) + through) / whole
        })
        .collect();
    let material = |k: usize| mesh.material[tree.faces[k].triangle as usize] as usize;
    let area = |k: usize| mesh.area[tree.faces[k].triangle as usize];
    let counted = |k: usize| tree.node(tree.face_node[k]).counted;
    let (mut flux, mut total, mut mean) = ([0.0; 3], 0.0, 0.0);
    for k in 0..tree.faces.len() {
        let (m, a) = (material(k), area(k));
        flux = std::array::from_fn(|c| flux[c] + a * glow[m][c]);
        total += counted(k);
        mean += counted(k) * albedo[m];
    }
    for light in &scene.lights {
        let solid = super::punctual::solid_angle(light.kind);
        let solid = solid.unwrap_or(total * if light.kind.is_dome() { DOME } else { 0.25 });
        let xyz = lanes.emission(light.light, &light.shape, 1.0);
        flux = std::array::from_fn(|c| flux[c] + solid * xyz[c]);
    }
    // Open rooms lose light: the mean albedo is capped before more is known, so that the guess stays finite.
    let mean = if total > 0.0 {
        (mean / total).min(0.9)
    } else {
        0.0
    };
    let white = flux.map(|f| {
        if total > 0.0 {
            2.0 * f / (total * (1.0 - mean))
        } else {
            0.0
        }
    });
    let mut bright = vec![0.0_f32; tree.nodes.len()];
    for k in (0..tree.nodes.len()).rev() {
        let node = &tree.nodes[k];
        bright[k] = if node.is_leaf() {
            let m = material(node.faces.0 as usize);
            (0.5 * albedo[m] * (node.counted / node.area)) as f32
        } else {
            node.child_range()
                .map(|c| f64::from(bright[c as usize]) * tree.node(c).area)
                .sum::<f64>() as f32
                / node.area as f32
        };
    }
    Guess { white, bright }
}

/// A closed room's direct light is off by the quadrature over leaves only; beyond this share something else is wrong
/// (a lamp inside something solid), and nothing is scaled.
const GREATEST_LOSS: f64 = 0.1;

/// Scales direct light on the leaves of a closed room, lane by lane, so that the fronts receive exactly what the lamps
/// emit: for lamps, what balancing is for rows of links.
pub(super) fn conserve(
    first: &mut Rows,
    emission: &Rows,
    lamps: &[(PunctualLight, Vec<f32>)],
    areas: &[f64],
    leaves: &[u32],
) {
    let width = first.width();
    let (mut given, mut received) = (vec![0.0; width], vec![0.0; width]);
    for (light, row) in lamps {
        let Some(solid) = super::punctual::solid_angle(light.kind) else {
            // How much parallel light enters is unknown.
            return;
        };
        for (given, intensity) in given.iter_mut().zip(row) {
            *given += solid * f64::from(*intensity);
        }
    }
    for (k, &leaf) in leaves.iter().enumerate() {
        let area = areas[leaf as usize];
        for l in 0..width {
            given[l] += area * f64::from(emission.row(k)[l]);
            received[l] += area * f64::from(first.row(k)[l]);
        }
    }
    let scale: Vec<f32> = given
        .iter()
        .zip(&received)
        .map(|(given, received)| {
            let ratio = given / received;
            if (ratio - 1.0).abs() < GREATEST_LOSS {
                ratio as f32
            } else {
                1.0
            }
        })
        .collect();
    for k in 0..leaves.len() {
        for (x, s) in first.row_mut(k).iter_mut().zip(&scale) {
            *x *= s;
        }
    }
}

/// Flux balance of a solution. `emitted = absorbed + escaped` must hold for every band.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FluxBalance {
    /// Luminous flux emitted evenly by surfaces, lm (lamps with a profile are among `sent`). Light of a sky, of the sun and
    /// of parallel lights counts from where it is received: what does not enter the room is in no sum.
    pub emitted_lm: f64,
    /// Luminous flux that fronts receive straight from lamps of any kind, lm.
    pub received_lm: f64,
    /// Luminous flux that fronts emit by fluorescence, lm; they absorb the light that excites it like any other.
    #[serde(default)]
    pub fluoresced_lm: f64,
    /// Luminous flux absorbed by fronts, lm.
    pub absorbed_lm: f64,
    /// Luminous flux that left the room or met a black back, lm: from row sums below 1.
    pub escaped_lm: f64,
    /// Worst relative difference of received (with fluorescence) and absorbed + escaped over all bands that carry light: what the solve
    /// itself lost. Emitted and received differ by direct light that leaves the room.
    pub worst_band: f64,
    /// Where the light of lamps goes first, by rays from the lamps.
    #[serde(default)]
    pub sent: Sent,
    /// What light was multiplied by.
    #[serde(default)]
    pub scaled: Scaled,
}

/// Adds fluxes (emitted, received, absorbed, escaped, fluoresced), each as a density on an area.
fn add(sums: &mut [f64; 5], area: f64, densities: [f64; 5]) {
    for (sum, density) in sums.iter_mut().zip(densities) {
        *sum += area * density;
    }
}

impl FluxBalance {
    /// The balance of fluxes by lane (emitted, received, absorbed, escaped, fluoresced).
    fn of(fluxes: &[[f64; 5]], lanes: &Lanes) -> Self {
        let lit = fluxes.iter().filter(|sums| sums[1] + sums[4] > 0.0);
        let lumens = |k: usize| {
            let by_lane = fluxes.iter().zip(lanes.xyz());
            by_lane.map(|(sums, xyz)| sums[k] * xyz[1]).sum()
        };
        Self {
            emitted_lm: lumens(0),
            received_lm: lumens(1),
            absorbed_lm: lumens(2),
            escaped_lm: lumens(3),
            fluoresced_lm: lumens(4),
            worst_band: lit
                .map(|[_, received, absorbed, escaped, fluoresced]| {
                    ((absorbed + escaped) / (received + fluoresced) - 1.0).abs()
                })
                .fold(0.0, f64::max),
            ..Self::default()
        }
    }
}

/// By what the light of leaves was multiplied so that none is lost: luminous flux after over before. 1 changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Scaled {
    /// Direct light in sealed rooms of few triangles.
    pub direct: f64,
    /// Reflected light in rooms of few triangles, in the last pass over the links.
    pub reflected: f64,
}

impl Default for Scaled {
    fn default() -> Self {
        Self {
            direct: 1.0,
            reflected: 1.0,
        }
    }
}

/// Luminous flux of rows by leaf.
pub(super) fn lumens(areas: &[f64], lanes: &Lanes, leaves: &[u32], rows: &Rows) -> f64 {
    let each = leaves.iter().enumerate();
    each.map(|(k, &leaf)| areas[leaf as usize] * lanes.tristimulus(rows.row(k))[1])
        .sum()
}

/// `after / before`; 1 where nothing was before.
pub(super) fn ratio(after: f64, before: f64) -> f64 {
    if before > 0.0 { after / before } else { 1.0 }
}

/// Sums the flux of a solution in f64: rows by leaf, the balanced `row_sums` by node.
pub(super) fn flux(
    areas: &[f64],
    lanes: &Lanes,
    leaves: &[u32],
    rows: &FluxRows,
    row_sums: &[f64],
) -> FluxBalance {
    let mut fluxes = vec![[0.0; 5]; lanes.len()];
    for (k, &leaf) in leaves.iter().enumerate() {
        let area = areas[leaf as usize];
        for (l, sums) in fluxes.iter_mut().enumerate() {
            let get = |r: &Rows| f64::from(r.row(k)[l]);
            let (e, r, h, f, rho) = (
                get(rows.emission),
                get(rows.reflected),
                get(rows.irradiance),
                get(rows.first),
                get(rows.reflectance),
            );
            let given = rows.fluoresced.map_or(0.0, get);
            let out = (r + given) * (1.0 - row_sums[leaf as usize]);
            add(sums, area, [e, f, (1.0 - rho) * h, out, given]);
        }
    }
    FluxBalance::of(&fluxes, lanes)
}

/// What the leaves receive as wholes, however much of them others see.
pub(crate) struct Whole<'a> {
    /// Irradiance by reflected light, by leaf.
    pub(super) indirect: &'a Rows,
    /// Direct light of a whole leaf, as a multiple of that on the part that others see.
    pub(super) direct: &'a dyn Fn(u32) -> f64,
    /// Area of a whole leaf.
    pub(super) area: &'a dyn Fn(u32) -> f64,
    /// Is a leaf a mirror? Of light that falls on a mirror only the part that it absorbs counts, by its mean over angles: the rest is
    /// received where it is reflected to.
    pub(super) mirror: &'a dyn Fn(u32) -> bool,
}

/// The flux where leaves look for themselves: nothing is scaled, and the defect is the difference of what the rays of
/// leaves find and what leaves send. `areas` are those that others see: all that they send meets fronts.
pub(super) fn flux_by_rays(
    areas: &[f64],
    lanes: &Lanes,
    leaves: &[u32],
    rows: &FluxRows,
    whole: &Whole,
) -> FluxBalance {
    let mut fluxes = vec![[0.0; 5]; lanes.len()];
    for (k, &leaf) in leaves.iter().enumerate() {
        let (area, seen) = ((whole.area)(leaf), areas[leaf as usize]);
        let (more, mirror) = ((whole.direct)(leaf), (whole.mirror)(leaf));
        for (l, sums) in fluxes.iter_mut().enumerate() {
            let get = |r: &Rows| f64::from(r.row(k)[l]);
            let (rho, first) = (get(rows.reflectance), more * get(rows.first));
            let all = first + get(whole.indirect);
            if mirror {
                let kept = 1.0 - rho;
                add(sums, area, [0.0, kept * first, kept * all, 0.0, 0.0]);
                continue;
            }
            let out = rho * all - seen / area * get(rows.reflected);
            let given = seen / area * rows.fluoresced.map_or(0.0, get);
            let absorbed = (1.0 - rho) * all;
            add(
                sums,
                area,
                [get(rows.emission), first, absorbed, out, given],
            );
        }
    }
    FluxBalance::of(&fluxes, lanes)
}

/// Rows by leaf from which the flux is summed.
pub(crate) struct FluxRows<'a> {
    pub(super) emission: &'a Rows,
    pub(super) reflected: &'a Rows,
    pub(super) irradiance: &'a Rows,
    pub(super) first: &'a Rows,
    /// None where nothing fluoresces.
    pub(super) fluoresced: Option<&'a Rows>,
    pub(super) reflectance: &'a Rows,
}
