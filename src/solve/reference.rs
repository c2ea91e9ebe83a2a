//! A plain reference: every patch sees every patch, on all 64 bands, each solved directly.
//! Slow and right.
//!
//! `B_i = E_i + rho_i (P_i + sum_j F_ij B_j)` (Goral, Torrance, Greenberg and Battaile 1984), P the irradiance from
//! punctual lights, W/m2/nm. `F_ij` is the mean over points of patch i of the exact point-to-polygon factor (Lambert
//! 1760) times the share of rays to j that nothing blocks. `A_i F_ij` and `A_j F_ji` are made equal by their mean; rows are
//! not balanced, [`Reference::row_sums`] tells what they miss. Solved by LU for every distinct set of reflectances.
//!
//! What fluoresces adds the 64 x 64 Donaldson matrix of its material times its irradiance, found in rounds, each of which
//! loses energy.
//! A sheet has a patch on each side, and what meets one side leaves the other by the transmittance. Panes filter each ray of a factor by
//! incidence and band; where they are coloured every band has factors of its own, which takes 64 times the memory. Sky light comes from
//! 16,384 directions a point, from the sky's parts and not from its formula; the sun is parallel, without its disc. Rooms with mirrors are
//! refused.
//!
//! With the solver it shares triangles, Lambert's formula, the ray index and what a ray crosses of panes: no hierarchy, no links, no
//! lanes, no iteration. Memory grows with the square of the number of patches, time with the cube: a few thousand at the most.

mod lights;
mod patch;
mod visibility;

use crate::color::Upsampler;
use crate::error::{Error, Result};
use crate::geometry::{NO_PLANE, quarters};
use crate::hierarchy::Mesh;
use crate::scene::sheet::Weave;
use crate::scene::{Scene, short};
use crate::spectrum::{BANDS, Spectrum};
use glam::DVec3;
use lights::ReferenceLamps;
use nalgebra::{DMatrix, DVector, Dyn, LU};
pub use patch::Patch;
use patch::{PatchPoint, add, radon};
use rayon::prelude::*;
use std::f64::consts::PI;
use visibility::ReferenceVisibility;

/// Fluorescence has settled when it changes on no band by more than this share of the brightest.
const SETTLED: f64 = 1e-12;

/// The patches of a room and who sees whom.
#[derive(Debug)]
pub struct Reference {
    /// The patches: every side of every triangle of the scene, quartered equally often.
    pub patches: Vec<Patch>,
    /// `F_ij`: share of the light leaving i that reaches j, one matrix for all bands or one for each.
    factors: Vec<DMatrix<f64>>,
    /// For each material the Donaldson matrix of what it fluoresces, row by row: exitance on a band by irradiance on another.
    pub donaldson: Vec<Option<Vec<Spectrum>>>,
}

/// What leaves and meets the patches, W/m2/nm, in their order.
#[derive(Debug, Clone)]
pub struct ReferenceSolution {
    /// Radiosity: emitted and reflected.
    pub radiosity: Vec<Spectrum>,
    /// Irradiance.
    pub irradiance: Vec<Spectrum>,
}

impl Reference {
    /// Quarters every triangle of `scene` `depth` times and works out all factors, with `rays` rays from a point to a
    /// patch where something could block. Textures, vertex colours and holes are ignored.
    ///
    /// # Errors
    /// A room with mirrors.
    pub fn new(scene: &Scene, depth: u32, rays: usize) -> Result<Self> {
        let mirrors = scene.surfaces.iter().map(|s| &scene.materials[s.material]);
        if let Some(mirror) = mirrors.into_iter().find(|m| m.mirror.is_some()) {
            let what = format!(
                "'{}' is a mirror, which is no patch that sees patches",
                short(&mirror.name)
            );
            let next = "the path tracer follows mirrors: audit the room, or say \"mirror\": false";
            return Err(Error::input(scene.source.place(), what, next));
        }
        let mesh = Mesh::new(scene);
        let visibility = ReferenceVisibility::new(scene, &mesh, rays);
        let lamps = ReferenceLamps {
            scene,
            mesh: &mesh,
            visibility: &visibility,
        };
        let mut patches = patches(scene, &mesh, depth);
        let lit: Vec<Spectrum> = patches.par_iter().map(|p| lamps.on(p)).collect();
        for (patch, lit) in patches.iter_mut().zip(lit) {
            patch.punctual = lit;
        }
        let factors = factors(scene, &visibility, &patches);
        let width = scene.grid.width();
        let donaldson = scene.materials.iter().map(|m| {
            let fluorescence = m.fluorescence.as_ref()?;
            Some(fluorescence.matrix(&scene.spectra, width))
        });
        Ok(Self {
            donaldson: donaldson.collect(),
            patches,
            factors,
        })
    }

    /// `F_ij` on a band: share of the light leaving i that reaches j.
    pub fn factors(&self, band: usize) -> &DMatrix<f64> {
        &self.factors[band.min(self.factors.len() - 1)]
    }

    /// Sum of every patch's factors on the first band: 1 in a closed room without panes, but for the rule's error.
    pub fn row_sums(&self) -> Vec<f64> {
        self.factors(0).row_iter().map(|row| row.sum()).collect()
    }

    /// Solves all bands; where surfaces fluoresce, again until their fluorescence settles.
    pub fn solve(&self) -> ReferenceSolution {
        let mut glow = vec![[0.0; BANDS]; self.patches.len()];
        // Factored once: from round to round only right-hand sides change.
        let mut factored = vec![None; BANDS];
        loop {
            let solution = self.solve_with(&glow, &mut factored);
            let next = self.fluoresced(&solution.irradiance);
            let pairs = next.iter().flatten().zip(glow.iter().flatten());
            let moved = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let most = next.iter().flatten().copied().fold(0.0, f64::max);
            if moved <= SETTLED * most {
                return solution;
            }
            glow = next;
        }
    }

    /// Fluorescent exitance of the patches by their irradiance.
    fn fluoresced(&self, irradiance: &[Spectrum]) -> Vec<Spectrum> {
        let all = self.patches.iter().zip(irradiance);
        let each = all.map(|(patch, light)| match &self.donaldson[patch.material] {
            Some(matrix) => std::array::from_fn(|l| {
                let row = matrix[l].iter().zip(light);
                row.map(|(m, x)| m * x).sum()
            }),
            None => [0.0; BANDS],
        });
        each.collect()
    }

    /// Solves all bands, given the fluorescent exitance of the patches. `factored` holds the systems of bands that were solved before, where
    /// anything fluoresces: each takes as much memory as the factors.
    fn solve_with(
        &self,
        glow: &[Spectrum],
        factored: &mut [Option<Factored>],
    ) -> ReferenceSolution {
        let again = self.donaldson.iter().any(Option::is_some);
        let n = self.patches.len();
        let mut radiosity = vec![[0.0; BANDS]; n];
        let mut solved = [false; BANDS];
        for band in 0..BANDS {
            if solved[band] {
                continue;
            }
            let same = |l: usize| {
                let alike = |p: &Patch| {
                    p.reflectance[l] == p.reflectance[band]
                        && p.transmittance[l] == p.transmittance[band]
                };
                (l == band || self.factors.len() == 1) && self.patches.iter().all(alike)
            };
            let alike: Vec<usize> = (band..BANDS).filter(|&l| same(l)).collect();
            // What leaves a patch, of the light that meets it and its other side.
            let scattered = |i: usize, x: &dyn Fn(usize) -> f64| {
                let patch = &self.patches[i];
                let through = |b: usize| patch.transmittance[band] * x(b);
                patch.reflectance[band] * x(i) + patch.behind.map_or(0.0, through)
            };
            let right = DMatrix::from_fn(n, alike.len(), |i, k| {
                let (patch, band) = (&self.patches[i], alike[k]);
                let lit = scattered(i, &|i| self.patches[i].punctual[band]);
                patch.exitance[band] + glow[i][band] + lit
            });
            let factors = self.factors(band);
            let system = || {
                DMatrix::from_fn(n, n, |i, j| {
                    f64::from(u8::from(i == j)) - scattered(i, &|i| factors[(i, j)])
                })
            };
            let known = factored[band].take().unwrap_or_else(|| system().lu());
            let answer = solved_system(&known, &right);
            factored[band] = again.then_some(known);
            for (k, &l) in alike.iter().enumerate() {
                solved[l] = true;
                for (i, row) in radiosity.iter_mut().enumerate() {
                    row[l] = answer[(i, k)];
                }
            }
        }
        let mut irradiance: Vec<Spectrum> = self.patches.iter().map(|p| p.punctual).collect();
        // All bands at once, or one by one where each has its own factors.
        let at_once = BANDS / self.factors.len();
        for first in (0..BANDS).step_by(at_once) {
            let sources = DMatrix::from_fn(n, at_once, |i, k| radiosity[i][first + k]);
            let received = self.factors(first) * sources;
            for (i, row) in irradiance.iter_mut().enumerate() {
                (0..at_once).for_each(|k| row[first + k] += received[(i, k)]);
            }
        }
        ReferenceSolution {
            radiosity,
            irradiance,
        }
    }

    /// Irradiance at points of surfaces (world space, unit normals) from a solution, each patch as an exact polygon with
    /// `rays` rays to it: an order better than the mean over a patch.
    pub fn gather(
        &self,
        scene: &Scene,
        solution: &ReferenceSolution,
        points: &[(DVec3, DVec3)],
        rays: usize,
    ) -> Vec<Spectrum> {
        let mesh = Mesh::new(scene);
        let visibility = ReferenceVisibility::new(scene, &mesh, rays);
        let lamps = ReferenceLamps {
            scene,
            mesh: &mesh,
            visibility: &visibility,
        };
        points
            .par_iter()
            .map(|&(at, normal)| {
                let at = at - mesh.centre;
                let plane = plane_at(&mesh, &self.patches, at, normal);
                let place = PatchPoint { at, normal, plane };
                let mut sum = [0.0; BANDS];
                for (patch, radiosity) in self.patches.iter().zip(&solution.radiosity) {
                    match visibility.factor(place, patch) {
                        (f, None) => add(&mut sum, radiosity, f),
                        (f, Some(passes)) => {
                            let left = std::array::from_fn(|l| passes[l] * radiosity[l]);
                            add(&mut sum, &left, f);
                        }
                    }
                }
                add(&mut sum, &lamps.at(place), 1.0);
                sum
            })
            .collect()
    }
}

/// A system by its lower and upper triangle.
type Factored = LU<f64, Dyn, Dyn>;

/// Radiosities of `B = right + diag(rho) F B`, a column for each right-hand side; by LU with partial pivoting.
///
/// # Panics
/// If the matrix is singular: a closed room of albedo 1.
pub fn solve(factors: &DMatrix<f64>, rho: &[f64], right: DMatrix<f64>) -> DMatrix<f64> {
    let n = rho.len();
    let system = DMatrix::from_fn(n, n, |i, j| {
        f64::from(u8::from(i == j)) - rho[i] * factors[(i, j)]
    });
    solved_system(&system.lu(), &right)
}

fn solved_system(system: &Factored, right: &DMatrix<f64>) -> DMatrix<f64> {
    system
        .solve(right)
        .expect("albedos below 1 leave no row that is not dominated by its diagonal")
}

/// [`solve`] for one right-hand side.
pub fn solve_one(factors: &DMatrix<f64>, rho: &[f64], emission: &[f64]) -> DVector<f64> {
    let right = DMatrix::from_column_slice(emission.len(), 1, emission);
    solve(factors, rho, right).column(0).into_owned()
}

/// `F_ij`, made reciprocal by their means; one matrix for all bands, or one for each where a pane is coloured.
fn factors(
    scene: &Scene,
    visibility: &ReferenceVisibility<'_>,
    patches: &[Patch],
) -> Vec<DMatrix<f64>> {
    let tinted = |s: &crate::scene::Surface| {
        let pane = scene.materials[s.material].pane.as_ref();
        pane.is_some_and(|pane| !pane.is_neutral())
    };
    let sets = if scene.panes.iter().any(tinted) {
        BANDS
    } else {
        1
    };
    let (n, rule) = (patches.len(), radon());
    let row = |(i, from): (usize, &Patch)| {
        let mut row = vec![0.0; sets * n];
        for (j, to) in patches.iter().enumerate() {
            if i == j || from.plane == to.plane {
                continue;
            }
            let own = &mut row[sets * j..sets * (j + 1)];
            for (w, at) in rule {
                let (f, passes) = visibility.factor(from.place(at), to);
                for (k, x) in own.iter_mut().enumerate() {
                    *x += w * f * passes.as_ref().map_or(1.0, |passes| passes[k]);
                }
            }
        }
        row
    };
    let rows: Vec<Vec<f64>> = patches.par_iter().enumerate().map(row).collect();
    let mean = |k: usize, i: usize, j: usize| {
        let (a, b) = (patches[i].area, patches[j].area);
        0.5 * (rows[i][sets * j + k] + rows[j][sets * i + k] * b / a)
    };
    (0..sets)
        .map(|k| DMatrix::from_fn(n, n, |i, j| mean(k, i, j)))
        .collect()
}

/// All sides of all triangles, quartered.
fn patches(scene: &Scene, mesh: &Mesh, depth: u32) -> Vec<Patch> {
    let mut out: Vec<Patch> = Vec::new();
    let upsampler = Upsampler::new(&scene.grid);
    for &face in &mesh.faces {
        let triangle = face.triangle as usize;
        let material = &scene.materials[mesh.material[triangle] as usize];
        let exitance = material.even_emission().map_or([0.0; BANDS], |e| {
            let power = &scene.spectra[e.light].power;
            std::array::from_fn(|l| PI * power[l] * e.shape[l])
        });
        let [reflectance, transmittance] = match &material.sheet {
            Some(sheet) => material.scatters(sheet, None, Weave::PLAIN, face.back, &upsampler),
            None => [material.reflectance, [0.0; BANDS]],
        };
        let mut corners = vec![mesh.corners(face)];
        for _ in 0..depth {
            corners = corners.into_iter().flat_map(quarters).collect();
        }
        let area = mesh.area[triangle] / corners.len() as f64;
        out.extend(corners.into_iter().map(|corners| Patch {
            corners,
            normal: mesh.face_normal(face),
            plane: mesh.plane[triangle],
            area,
            reflectance,
            exitance,
            punctual: [0.0; BANDS],
            material: mesh.material[triangle] as usize,
            transmittance,
            behind: None,
        }));
    }
    pair_up(&mut out, scene);
    out
}

/// Links each patch of a sheet with the patch on its other side, whose middle coincides with its own.
fn pair_up(patches: &mut [Patch], scene: &Scene) {
    let middle = |p: &Patch| p.corners.iter().sum::<DVec3>() / 3.0;
    let is_sheet = |p: &Patch| scene.materials[p.material].sheet.is_some();
    let sheets: Vec<usize> = (0..patches.len())
        .filter(|&k| is_sheet(&patches[k]))
        .collect();
    for &k in &sheets {
        let own = &patches[k];
        let near = 1e-6 * own.area.sqrt();
        let is_behind = |&&other: &&usize| {
            let other = &patches[other];
            own.normal.dot(other.normal) < 0.0 && middle(own).distance(middle(other)) < near
        };
        patches[k].behind = sheets.iter().find(is_behind).copied();
    }
}

/// Plane id of the patch that holds a point; [`NO_PLANE`] in the air.
fn plane_at(mesh: &Mesh, patches: &[Patch], at: DVec3, normal: DVec3) -> u32 {
    let near = 1e-6 * mesh.half_size;
    let holds = |p: &&Patch| {
        let w = super::weights_of(at, p.corners[0], p.corners[1], p.corners[2]);
        p.normal.dot(normal) > 1.0 - 1e-6
            && p.normal.dot(at - p.corners[0]).abs() < near
            && w.iter().all(|&x| x >= -1e-9)
    };
    patches.iter().find(holds).map_or(NO_PLANE, |p| p.plane)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact for monomials up to degree 5: integral of x^a y^b over the unit triangle is a! b! / (a + b + 2)!.
    #[test]
    fn the_rule_is_of_degree_five() {
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        for a in 0..=5_u32 {
            for b in 0..=5 - a {
                let rule: f64 = radon()
                    .iter()
                    .map(|(w, at)| w * at[1].powi(a as i32) * at[2].powi(b as i32))
                    .sum();
                let exact = 2.0 * factorial(a) * factorial(b) / factorial(a + b + 2);
                assert!((rule - exact).abs() < 1e-14, "{a} {b}: {rule} {exact}");
            }
        }
    }

    /// Two patches that see each other with F = 0.2, one emitting 1: B1 = 1 / (1 - (rho F)^2).
    #[test]
    fn two_patches() {
        let factors = DMatrix::from_row_slice(2, 2, &[0.0, 0.2, 0.2, 0.0]);
        let b = solve_one(&factors, &[0.5, 0.5], &[1.0, 0.0]);
        assert!((b[0] - 1.0 / 0.99).abs() < 1e-15 && (b[1] - 0.1 / 0.99).abs() < 1e-15);
    }
}
