//! A plain reference: every patch sees every patch, all leaves, one direct solve a leaf. Slow and right.
//!
//! `B_i = E_i + rho_i (P_i + sum_j F_ij B_j)` (Goral, Torrance, Greenberg and Battaile 1984), P the irradiance from
//! punctual lights, W/m2/nm. `F_ij` is the mean over points of patch i of the exact point-to-polygon factor (Lambert
//! 1760) times the share of rays to j that nothing blocks. `A_i F_ij` and `A_j F_ji` are made equal by their mean; rows are
//! not balanced, [`Reference::row_sums`] tells what they miss. Solved by LU for every distinct set of reflectances.
//!
//! What fluoresces adds the 64 x 64 Donaldson matrix of its material times its irradiance, found in rounds; each loses energy.
//! It knows no panes and no mirrors: what they keep of a ray is no factor between patches. It shares triangles, Lambert's formula and the ray index with the solver: no hierarchy, no links, no lanes, no
//! iteration. Memory grows with the square of the patches, time with the cube: a few thousand at the most.

use crate::geometry::sampling::{cosine_direction, hash, sequence02, triangle_weights};
use crate::geometry::{NO_PLANE, RayIndex, Segment, lambert_polygon, quarters};
use crate::hierarchy::{Mesh, stratified};
use crate::scene::effects::{Kind, Plan};
use crate::scene::{LightKind, PunctualLight, Scene};
use crate::spectrum::{LEAVES, Leaves};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Points of a triangle of a lamp with a profile: where a shadow's edge crosses it they are off by about .3 %.
const SHINING_POINTS: u32 = 1024;
/// What is fluoresced has settled when no leaf changes by more than this share of the brightest.
const SETTLED: f64 = 1e-12;
/// Rays for the sky of a point: .1 % of open ground's.
const DOME_RAYS: u32 = 1024;

/// Radon's rule of degree 5 on a triangle (1948; Abramowitz and Stegun 1964, 25.4.63): weight, and weights of corners.
fn radon() -> [(f64, [f64; 3]); 7] {
    let root = 15.0_f64.sqrt();
    let corner = |w: f64, a: f64| {
        let b = 1.0 - 2.0 * a;
        [(w, [b, a, a]), (w, [a, b, a]), (w, [a, a, b])]
    };
    let near = corner((155.0 - root) / 1200.0, (6.0 - root) / 21.0);
    let far = corner((155.0 + root) / 1200.0, (6.0 + root) / 21.0);
    [
        (9.0 / 40.0, [1.0 / 3.0; 3]),
        near[0],
        near[1],
        near[2],
        far[0],
        far[1],
        far[2],
    ]
}

/// A flat triangular patch, one side.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Corners, counter-clockwise from the front; recentred as in [`Mesh`].
    pub corners: [DVec3; 3],
    /// Unit normal of the front.
    pub normal: DVec3,
    /// Plane id of its triangle.
    pub plane: u32,
    /// Area.
    pub area: f64,
    /// Albedo.
    pub reflectance: Leaves,
    /// Exitance, W/m2/nm.
    pub exitance: Leaves,
    /// Irradiance from punctual lights, W/m2/nm.
    pub punctual: Leaves,
    /// Its material.
    pub material: usize,
}

/// The patches of a room and who sees whom.
#[derive(Debug)]
pub struct Reference {
    /// The patches: every side of every triangle of the scene, quartered alike.
    pub patches: Vec<Patch>,
    /// `F_ij`: share of the light leaving i that reaches j.
    pub factors: DMatrix<f64>,
    /// For each material the Donaldson matrix of what it fluoresces, row by row: exitance on a leaf by irradiance on another.
    pub donaldson: Vec<Option<Vec<Leaves>>>,
}

/// What leaves and meets the patches, W/m2/nm, in order of the patches.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Radiosity: emitted and reflected.
    pub radiosity: Vec<Leaves>,
    /// Irradiance.
    pub irradiance: Vec<Leaves>,
}

/// What blocks the way in a room.
struct Ways {
    rays: RayIndex,
    /// False: nothing can block.
    blocks: bool,
    /// Rays between a point and a polygon.
    count: usize,
}

impl Ways {
    /// Factor from a point to the visible part of a patch.
    fn factor(&self, point: DVec3, normal: DVec3, plane: u32, to: &Patch) -> f64 {
        if plane == to.plane || to.normal.dot(point - to.corners[0]) <= 0.0 {
            return 0.0;
        }
        let open = lambert_polygon(point, normal, &to.corners);
        if open <= 0.0 || !self.blocks {
            return open;
        }
        let (mut seen, mut total) = (0.0, 0.0);
        for k in 0..self.count {
            let w = stratified(k, self.count, [0.5, 0.5]);
            let q = to.corners[0] * w[0] + to.corners[1] * w[1] + to.corners[2] * w[2];
            let d = q - point;
            let (c1, c2, r2) = (normal.dot(d), -to.normal.dot(d), d.length_squared());
            if c1 <= 0.0 || c2 <= 0.0 {
                continue;
            }
            let weight = c1 * c2 / (r2 * r2);
            total += weight;
            if !self.blocked(point, q, [plane, to.plane]) {
                seen += weight;
            }
        }
        if total > 0.0 {
            open * seen / total
        } else {
            open
        }
    }

    fn blocked(&self, from: DVec3, to: DVec3, planes: [u32; 2]) -> bool {
        self.blocks && self.rays.occluded(&Segment::new(from, to, planes))
    }
}

impl Reference {
    /// Quarters every triangle of `scene` `depth` times and works out all factors, with `rays` rays from a point to a
    /// patch where something could block. Textures, vertex colours and holes are not looked at.
    pub fn new(scene: &Scene, depth: u32, rays: usize) -> Self {
        let mesh = Mesh::new(scene);
        let ways = ways(scene, &mesh, rays);
        let mut patches = patches(scene, &mesh, depth);
        let lit: Vec<Leaves> = patches
            .par_iter()
            .map(|p| punctual(scene, &mesh, &ways, p))
            .collect();
        for (patch, lit) in patches.iter_mut().zip(lit) {
            patch.punctual = lit;
        }
        let n = patches.len();
        let rule = radon();
        let rows: Vec<Vec<f64>> = patches
            .par_iter()
            .enumerate()
            .map(|(i, from)| {
                let mut row = vec![0.0; n];
                for (j, to) in patches.iter().enumerate() {
                    if i != j && from.plane != to.plane {
                        row[j] = rule
                            .iter()
                            .map(|&(w, at)| {
                                w * ways.factor(point(from, at), from.normal, from.plane, to)
                            })
                            .sum();
                    }
                }
                row
            })
            .collect();
        let factors = DMatrix::from_fn(n, n, |i, j| {
            let (a, b) = (patches[i].area, patches[j].area);
            0.5 * (rows[i][j] + rows[j][i] * b / a)
        });
        let width = scene.grid.width();
        let donaldson = scene.materials.iter().map(|m| {
            let fluorescence = m.fluorescence.as_ref()?;
            Some(fluorescence.matrix(&scene.spectra, width))
        });
        Self {
            donaldson: donaldson.collect(),
            patches,
            factors,
        }
    }

    /// Sum of every patch's factors: 1 in a closed room, but for the rule's error.
    pub fn row_sums(&self) -> Vec<f64> {
        self.factors.row_iter().map(|row| row.sum()).collect()
    }

    /// Solves all leaves; where surfaces fluoresce as often as it takes until what they give out stays as it is.
    pub fn solve(&self) -> Solution {
        let mut glow = vec![[0.0; LEAVES]; self.patches.len()];
        loop {
            let solution = self.solve_with(&glow);
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

    /// What the patches fluoresce under an irradiance.
    fn fluoresced(&self, irradiance: &[Leaves]) -> Vec<Leaves> {
        let all = self.patches.iter().zip(irradiance);
        let each = all.map(|(patch, light)| match &self.donaldson[patch.material] {
            Some(matrix) => std::array::from_fn(|l| {
                let row = matrix[l].iter().zip(light);
                row.map(|(m, x)| m * x).sum()
            }),
            None => [0.0; LEAVES],
        });
        each.collect()
    }

    /// Solves all leaves, given what the patches fluoresce.
    fn solve_with(&self, glow: &[Leaves]) -> Solution {
        let n = self.patches.len();
        let mut radiosity = vec![[0.0; LEAVES]; n];
        let mut solved = [false; LEAVES];
        for leaf in 0..LEAVES {
            if solved[leaf] {
                continue;
            }
            let rho: Vec<f64> = self.patches.iter().map(|p| p.reflectance[leaf]).collect();
            let alike: Vec<usize> = (leaf..LEAVES)
                .filter(|&l| {
                    self.patches
                        .iter()
                        .zip(&rho)
                        .all(|(p, r)| p.reflectance[l] == *r)
                })
                .collect();
            let right = DMatrix::from_fn(n, alike.len(), |i, k| {
                let (patch, leaf) = (&self.patches[i], alike[k]);
                patch.exitance[leaf] + glow[i][leaf] + rho[i] * patch.punctual[leaf]
            });
            let answer = solve(&self.factors, &rho, right);
            for (k, &l) in alike.iter().enumerate() {
                solved[l] = true;
                for (i, row) in radiosity.iter_mut().enumerate() {
                    row[l] = answer[(i, k)];
                }
            }
        }
        let sources = DMatrix::from_fn(n, LEAVES, |i, l| radiosity[i][l]);
        let received = &self.factors * sources;
        let irradiance = (0..n)
            .map(|i| std::array::from_fn(|l| received[(i, l)] + self.patches[i].punctual[l]))
            .collect();
        Solution {
            radiosity,
            irradiance,
        }
    }

    /// Irradiance at points of surfaces (world space, unit normals) from a solution, each patch as an exact polygon with
    /// `rays` rays to it: an order better than the patch means.
    pub fn gather(
        &self,
        scene: &Scene,
        solution: &Solution,
        points: &[(DVec3, DVec3)],
        rays: usize,
    ) -> Vec<Leaves> {
        let mesh = Mesh::new(scene);
        let ways = ways(scene, &mesh, rays);
        points
            .par_iter()
            .map(|&(at, normal)| {
                let at = at - mesh.centre;
                let plane = plane_at(&mesh, &self.patches, at, normal);
                let mut sum = [0.0; LEAVES];
                for (patch, radiosity) in self.patches.iter().zip(&solution.radiosity) {
                    let f = ways.factor(at, normal, plane, patch);
                    if f > 0.0 {
                        add(&mut sum, radiosity, f);
                    }
                }
                add(
                    &mut sum,
                    &punctual_at(scene, &mesh, &ways, at, normal, plane),
                    1.0,
                );
                sum
            })
            .collect()
    }
}

/// Radiosities of `B = right + diag(rho) F B`, a column a right-hand side; by LU with partial pivots.
///
/// # Panics
/// If the matrix is singular: a closed room of albedo 1.
pub fn solve(factors: &DMatrix<f64>, rho: &[f64], right: DMatrix<f64>) -> DMatrix<f64> {
    let n = rho.len();
    let system = DMatrix::from_fn(n, n, |i, j| {
        f64::from(u8::from(i == j)) - rho[i] * factors[(i, j)]
    });
    system
        .lu()
        .solve(&right)
        .expect("albedos below 1 leave no row that is not dominated by its diagonal")
}

/// The same for one right-hand side.
pub fn solve_one(factors: &DMatrix<f64>, rho: &[f64], emission: &[f64]) -> DVector<f64> {
    let right = DMatrix::from_column_slice(emission.len(), 1, emission);
    solve(factors, rho, right).column(0).into_owned()
}

fn ways(scene: &Scene, mesh: &Mesh, count: usize) -> Ways {
    let positions: Vec<glam::Vec3> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
    let solid = vec![false; mesh.triangles.len()];
    Ways {
        rays: RayIndex::build(&positions, &mesh.triangles, &mesh.plane, &solid),
        blocks: Plan::of(scene).runs(Kind::Occlusion),
        count,
    }
}

fn add(sum: &mut Leaves, x: &Leaves, weight: f64) {
    for (s, x) in sum.iter_mut().zip(x) {
        *s += weight * x;
    }
}

fn point(patch: &Patch, w: [f64; 3]) -> DVec3 {
    patch.corners[0] * w[0] + patch.corners[1] * w[1] + patch.corners[2] * w[2]
}

/// All sides of all triangles, quartered.
fn patches(scene: &Scene, mesh: &Mesh, depth: u32) -> Vec<Patch> {
    let mut out = Vec::new();
    for &face in &mesh.faces {
        let triangle = face.triangle as usize;
        let material = &scene.materials[mesh.material[triangle] as usize];
        let exitance = material.even_emission().map_or([0.0; LEAVES], |e| {
            let power = &scene.spectra[e.light].power;
            std::array::from_fn(|l| PI * power[l] * e.shape[l])
        });
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
            reflectance: material.reflectance,
            exitance,
            punctual: [0.0; LEAVES],
            material: mesh.material[triangle] as usize,
        }));
    }
    out
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

/// Mean irradiance of a patch from punctual lights.
fn punctual(scene: &Scene, mesh: &Mesh, ways: &Ways, patch: &Patch) -> Leaves {
    let mut sum = [0.0; LEAVES];
    for (w, at) in radon() {
        add(
            &mut sum,
            &punctual_at(
                scene,
                mesh,
                ways,
                point(patch, at),
                patch.normal,
                patch.plane,
            ),
            w,
        );
    }
    sum
}

/// Irradiance at a point from punctual lights: `I cos / r^2`.
fn punctual_at(
    scene: &Scene,
    mesh: &Mesh,
    ways: &Ways,
    at: DVec3,
    normal: DVec3,
    plane: u32,
) -> Leaves {
    let mut sum = [0.0; LEAVES];
    for light in &scene.lights {
        let (toward, end) = match light.kind {
            LightKind::Sky(_) | LightKind::Ground(_) => {
                let factor = dome_at(scene, mesh, ways, at, normal, plane, light.kind.place());
                let power = &scene.spectra[light.light].power;
                for l in 0..LEAVES {
                    sum[l] += factor * power[l] * light.shape[l];
                }
                continue;
            }
            LightKind::Surface => {
                let power = &scene.spectra[light.light].power;
                let factor = shining_at(light, mesh, ways, at, normal, plane);
                for l in 0..LEAVES {
                    sum[l] += factor * power[l] * light.shape[l];
                }
                continue;
            }
            LightKind::Directional | LightKind::Sun => (
                -light.direction,
                at - light.direction * (4.0 * mesh.half_size),
            ),
            LightKind::Point | LightKind::Spot { .. } | LightKind::Profile => {
                let end = light.position - mesh.centre;
                ((end - at).normalize_or_zero(), end)
            }
        };
        let spread = match light.kind {
            LightKind::Directional | LightKind::Sun => 1.0,
            LightKind::Point | LightKind::Sky(_) | LightKind::Ground(_) | LightKind::Surface => {
                1.0 / end.distance_squared(at)
            }
            LightKind::Profile => {
                let spread = light.luminaire.as_ref();
                spread.map_or(0.0, |l| l.per_lumen(-toward)) / end.distance_squared(at)
            }
            LightKind::Spot { inner, outer } => {
                let (cos, i, o) = (-light.direction.dot(toward), inner.cos(), outer.cos());
                ((cos - o) / (i - o).max(1e-3)).clamp(0.0, 1.0).powi(2) / end.distance_squared(at)
            }
        };
        let factor = normal.dot(toward) * spread;
        if factor > 0.0 && factor.is_finite() && !ways.blocked(at, end, [plane, NO_PLANE]) {
            let power = &scene.spectra[light.light].power;
            for l in 0..LEAVES {
                sum[l] += factor * power[l] * light.shape[l];
            }
        }
    }
    sum
}

/// What turns the flux of a lamp with an extent into irradiance: many points, a ray to each.
fn shining_at(
    light: &PunctualLight,
    mesh: &Mesh,
    ways: &Ways,
    at: DVec3,
    normal: DVec3,
    plane: u32,
) -> f64 {
    let Some(luminaire) = &light.luminaire else {
        return 0.0;
    };
    let mut sum = 0.0;
    for (k, &[a, b, c]) in luminaire.triangles().iter().enumerate() {
        let cross = (b - a).cross(c - a);
        let own = cross.normalize_or_zero();
        let shift = hash(k as u64, 0);
        for n in 0..SHINING_POINTS {
            let w = triangle_weights(sequence02(n, shift));
            let from = a * w[0] + b * w[1] + c * w[2] + light.position - mesh.centre;
            let (way, r2) = ((from - at).normalize_or_zero(), from.distance_squared(at));
            let sent = luminaire.per_area(-way, own) * normal.dot(way).max(0.0) / r2;
            let before = from + own * (1e-5 * mesh.half_size);
            if sent > 0.0 && !ways.blocked(at, before, [plane, NO_PLANE]) {
                sum += sent * 0.5 * cross.length() / f64::from(SHINING_POINTS);
            }
        }
    }
    sum
}

/// Irradiance of a point by a sky that gives open level ground 1, or by ground that sends out 1: the mean over many directions.
fn dome_at(
    scene: &Scene,
    mesh: &Mesh,
    ways: &Ways,
    at: DVec3,
    normal: DVec3,
    plane: u32,
    place: Option<usize>,
) -> f64 {
    let Some(sky) = &scene.sky else { return 0.0 };
    let brings = |k: u32| {
        let d = cosine_direction(normal, sequence02(k, 0));
        let Some(radiance) = sky.part(place, d) else {
            return 0.0;
        };
        let end = at + d * (4.0 * mesh.half_size);
        if ways.blocked(at, end, [plane, NO_PLANE]) {
            0.0
        } else {
            PI * radiance
        }
    };
    (0..DOME_RAYS).map(brings).sum::<f64>() / f64::from(DOME_RAYS)
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
