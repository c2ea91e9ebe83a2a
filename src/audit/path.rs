//! Irradiance at a point by path tracing, all bands along one path (Lambertian surfaces scatter all wavelengths alike).
//!
//! `H = pi * mean of L_i` over cosine-distributed directions; lamps are also sampled by area, and both ways are combined
//! by the balance heuristic (Veach and Guibas 1995). Paths end by Russian roulette, so no bounce is cut off.
//! Figures are *measured*: each comes with the standard error of independent batches.

use super::fluorescence::{PathTally, goes_on, greatest};
use crate::color::Upsampler;
use crate::geometry::RayIndex;
use crate::geometry::openings::Openings;
use crate::geometry::sampling::{Pcg, around, cosine_direction, hash, on_triangle, sequence02};
use crate::geometry::{NO_PLANE, Segment};
use crate::hierarchy::{Face, Mesh, Mirrors, Panes};
use crate::scene::sheet::SheetMeans;
use crate::scene::sky::SUN_RADIUS;
use crate::scene::{Alpha, LightKind, Material, PunctualLight, Scene, Sides, Texture};
use crate::spectrum::{BANDS, Spectrum};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Independent batches a point; their spread gives the standard error.
pub const BATCHES: usize = 16;
/// Bounces after which roulette decides.
const SURE_BOUNCES: usize = 3;

/// The estimator.
pub struct Audit<'a> {
    pub(super) scene: &'a Scene,
    pub(super) mesh: &'a Mesh,
    pub(super) rays: &'a RayIndex,
    upsampler: Upsampler,
    /// Faces that emit, and the running sum of what they are chosen by.
    lamps: Vec<(Face, f64)>,
    total: f64,
    /// What faces of each material are chosen by, per area: their power.
    powers: Vec<f64>,
    pub(super) masked: bool,
    pub(super) panes: Option<Panes>,
    pub(super) mirrors: Option<Mirrors>,
    /// Where the sky is seen by few rays.
    pub(super) openings: Option<Openings>,
    /// By material; none of what is no sheet.
    sheets: Vec<Option<SheetMeans>>,
}

/// Irradiance at a point: mean and standard error per band, W/m2/nm, and the batch means for anything derived.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Answer {
    /// Mean.
    pub mean: Spectrum,
    /// Means of the batches.
    pub batches: Vec<Spectrum>,
}

impl Answer {
    /// Mean and standard error of a linear function of the bands.
    pub fn linear(&self, weights: &Spectrum) -> (f64, f64) {
        let dot = |x: &Spectrum| x.iter().zip(weights).map(|(x, w)| x * w).sum::<f64>();
        let mean = dot(&self.mean);
        let n = self.batches.len() as f64;
        let variance = self
            .batches
            .iter()
            .map(|b| (dot(b) - mean).powi(2))
            .sum::<f64>()
            / (n - 1.0).max(1.0);
        (mean, (variance / n).sqrt())
    }
}

/// A place that light scatters at.
pub(super) struct PathVertex {
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
    pub(super) plane: u32,
}

/// By which image a point looks, where it is itself, and how many times its own size the room is that way.
#[derive(Clone, Copy)]
pub(super) struct ByImage<'a> {
    pub(super) image: u32,
    pub(super) at: &'a PathVertex,
    pub(super) size: f64,
}

/// Does a path go on? If so it stands for those that end, too.
pub(super) fn survives(throughput: &mut Spectrum, rng: &mut Pcg) -> bool {
    // Exactly what is left: a smaller chance would let weights grow without bound where albedos are near 1. Paths end, as no albedo
    // exceeds 0.999.
    let chance = greatest(throughput).min(1.0);
    if rng.f64() >= chance {
        return false;
    }
    throughput.iter_mut().for_each(|t| *t /= chance);
    true
}

impl<'a> Audit<'a> {
    /// Prepares the lamps of a room.
    pub fn new(scene: &'a Scene, mesh: &'a Mesh, rays: &'a RayIndex) -> Self {
        let power = |material: &Material| {
            material.even_emission().map_or(0.0, |e| {
                let bands = e.shape.iter().zip(&scene.spectra[e.light].power);
                bands.map(|(shape, power)| shape * power).sum()
            })
        };
        let powers: Vec<f64> = scene.materials.iter().map(power).collect();
        let mut lamps = Vec::new();
        let mut total = 0.0;
        for &face in &mesh.faces {
            let triangle = face.triangle as usize;
            let power = powers[mesh.material[triangle] as usize];
            if power > 0.0 {
                total += power * mesh.area[triangle];
                lamps.push((face, total));
            }
        }
        let masked = scene
            .materials
            .iter()
            .any(|m| matches!(m.alpha, Alpha::Mask { .. }));
        let upsampler = Upsampler::new(&scene.grid);
        let sheets = scene.materials.iter();
        let mut audit = Self {
            scene,
            mesh,
            rays,
            openings: None,
            sheets: sheets
                .map(|m| m.sheet_means(&scene.images, &upsampler))
                .collect(),
            upsampler,
            lamps,
            total,
            powers,
            masked,
            panes: Panes::new(scene, mesh.centre),
            mirrors: Mirrors::new(scene, mesh),
        };
        audit.openings = audit.small_openings();
        audit
    }

    /// Irradiance at points (recentred) with unit normals; `planes` hold the plane id of the face a point lies on, or
    /// [`NO_PLANE`]; `paths` how many paths each point gets. Points and batches have random streams of their own, so that
    /// the answer does not depend on the number of threads.
    pub fn irradiance(
        &self,
        points: &[(DVec3, DVec3, u32)],
        paths: &[usize],
        seed: u64,
    ) -> Vec<Answer> {
        points
            .par_iter()
            .zip(paths)
            .enumerate()
            .map(|(k, (&(point, normal, plane), paths))| {
                let each = paths.div_ceil(BATCHES).max(1);
                let start = PathVertex {
                    point,
                    normal,
                    plane,
                };
                let batches: Vec<Spectrum> = (0..BATCHES)
                    .map(|batch| {
                        let mut rng = Pcg::new(hash(hash(seed, k as u64), batch as u64));
                        let (shift_a, shift_b) = (rng_u64(&mut rng), rng_u64(&mut rng));
                        let mut sum = [0.0; BANDS];
                        for path in 0..each {
                            let first = [
                                sequence02(path as u32, shift_a),
                                sequence02(path as u32, shift_b),
                            ];
                            self.path(&start, first, &mut rng, &mut sum);
                        }
                        sum.map(|x| x / each as f64)
                    })
                    .collect();
                let mut mean = [0.0; BANDS];
                for b in &batches {
                    for (m, x) in mean.iter_mut().zip(b) {
                        *m += x / BATCHES as f64;
                    }
                }
                Answer { mean, batches }
            })
            .collect()
    }

    /// Adds one path's irradiance.
    fn path(&self, start: &PathVertex, first: [[f64; 2]; 2], rng: &mut Pcg, sum: &mut Spectrum) {
        let mut tally = PathTally::new(sum);
        self.walk(start, first, rng, &mut tally);
        tally.settle();
    }

    fn walk(&self, start: &PathVertex, first: [[f64; 2]; 2], rng: &mut Pcg, tally: &mut PathTally) {
        let mut throughput = [1.0; BANDS];
        let mut at = PathVertex { ..*start };
        let (mut toward_lamp, mut toward_any) = (first[0], first[1]);
        for bounce in 0.. {
            let sum = &mut tally.found;
            self.lamp_sample(&at, toward_lamp, rng, &throughput, sum);
            self.punctual(&at, None, toward_lamp, rng, &throughput, sum);
            self.punctual_in_mirrors(&at, toward_lamp, rng, &throughput, sum);
            let openings = self.openings_from(&at);
            self.aimed_outside((&at, openings.as_ref()), toward_lamp, &throughput, sum);
            let mut direction = cosine_direction(at.normal, toward_any);
            let (hit, mirrors) = self.met(&at, &mut direction, &mut throughput, rng);
            let Some(hit) = hit else {
                let from = (&at, openings.as_ref());
                self.outside(from, (direction, mirrors), &throughput, sum);
                return;
            };
            let triangle = hit.triangle as usize;
            let material = &self.scene.materials[self.mesh.material[triangle] as usize];
            let surface = self.mesh.origin[triangle].0 as usize;
            if hit.from_behind && self.scene.sides(surface) == Sides::Front {
                return;
            }
            let normal = if hit.from_behind {
                -self.mesh.normal[triangle]
            } else {
                self.mesh.normal[triangle]
            };
            let weights = [1.0 - hit.uv[0] - hit.uv[1], hit.uv[0], hit.uv[1]];
            let corners = self.mesh.triangles[triangle].map(|v| self.mesh.positions[v as usize]);
            let point = corners[0] * f64::from(weights[0])
                + corners[1] * f64::from(weights[1])
                + corners[2] * f64::from(weights[2]);
            if let Some(radiance) = self.radiance(triangle, weights) {
                let d = point - at.point;
                let r2 = d.length_squared();
                let by_direction = at.normal.dot(direction).max(0.0) / PI;
                let cosine = -normal.dot(d) / r2.sqrt();
                let by_area = self.chance(triangle) * r2 / cosine.max(1e-300);
                // No path straight to the lamp is one by mirrors.
                let share = match mirrors {
                    0 => by_direction / (by_direction + by_area),
                    _ => 1.0,
                };
                for l in 0..BANDS {
                    tally.found[l] += throughput[l] * PI * radiance[l] * share;
                }
            }
            let (albedo, normal) = match &material.sheet {
                Some(_) => {
                    let sides = self.both_sides(triangle, weights, hit.from_behind);
                    let (albedo, passes) = one_side(sides, &throughput, rng);
                    (albedo, if passes { -normal } else { normal })
                }
                None => (self.albedo(triangle, weights), normal),
            };
            goes_on(self.scene, material, albedo, &mut throughput, rng, tally);
            if greatest(&throughput) <= 0.0 {
                return;
            }
            if bounce >= SURE_BOUNCES && !survives(&mut throughput, rng) {
                return;
            }
            at = PathVertex {
                point,
                normal,
                plane: self.mesh.plane[triangle],
            };
            toward_lamp = [rng.f64(), rng.f64()];
            toward_any = [rng.f64(), rng.f64()];
        }
    }

    /// Density per area with which a lamp's triangle is chosen.
    fn chance(&self, triangle: usize) -> f64 {
        let power = self.powers[self.mesh.material[triangle] as usize];
        if self.total > 0.0 {
            power / self.total
        } else {
            0.0
        }
    }

    /// Light straight from a point on a lamp.
    fn lamp_sample(
        &self,
        at: &PathVertex,
        square: [f64; 2],
        rng: &mut Pcg,
        throughput: &Spectrum,
        sum: &mut Spectrum,
    ) {
        if self.lamps.is_empty() {
            return;
        }
        let target = rng.f64() * self.total;
        let index = self
            .lamps
            .partition_point(|&(_, upto)| upto <= target)
            .min(self.lamps.len() - 1);
        let face = self.lamps[index].0;
        let corners = self.mesh.corners(face);
        let q = on_triangle(&corners, square);
        let d = q - at.point;
        let r2 = d.length_squared();
        let r = r2.sqrt();
        let (c1, c2) = (
            at.normal.dot(d) / r,
            -self.mesh.face_normal(face).dot(d) / r,
        );
        let triangle = face.triangle as usize;
        if !(c1 > 0.0 && c2 > 0.0) || self.mesh.plane[triangle] == at.plane {
            return;
        }
        let segment = Segment {
            from: at.point.as_vec3(),
            to: q.as_vec3(),
            planes: [at.plane, self.mesh.plane[triangle]],
        };
        if self.blocked(&segment) {
            return;
        }
        let [a, b, c] = self.mesh.triangles[triangle].map(|v| self.mesh.positions[v as usize]);
        let n = (b - a).cross(c - a);
        let wb = (q - a).cross(c - a).dot(n) / n.length_squared();
        let wc = (b - a).cross(q - a).dot(n) / n.length_squared();
        let Some(radiance) =
            self.radiance(triangle, [(1.0 - wb - wc) as f32, wb as f32, wc as f32])
        else {
            return;
        };
        // A two-sided lamp is in the list once for each side: the density of a point is that of its own side.
        let by_area = self.chance(triangle) * r2 / c2;
        let by_direction = c1 / PI;
        let factor = c1 / (by_area + by_direction);
        let mut throughput = *throughput;
        self.filter(&mut throughput, at.point, q);
        for l in 0..BANDS {
            sum[l] += throughput[l] * radiance[l] * factor;
        }
    }

    /// Light of lights without extent, as from a point straight, or as it looks by an image.
    pub(super) fn punctual(
        &self,
        at: &PathVertex,
        by: Option<ByImage>,
        square: [f64; 2],
        rng: &mut Pcg,
        throughput: &Spectrum,
        sum: &mut Spectrum,
    ) {
        let size = by.map_or(1.0, |by| by.size);
        for light in &self.scene.lights {
            if light.kind.is_dome() {
                continue;
            }
            let position = light.position - self.mesh.centre;
            let (factor, end) = if light.kind.is_parallel() {
                // A place on the sun's disc.
                let toward = match light.kind {
                    LightKind::Sun => around(
                        -light.direction,
                        1.0 - square[1] * (1.0 - SUN_RADIUS.cos()),
                        square[0],
                    ),
                    _ => -light.direction,
                };
                (
                    at.normal.dot(toward),
                    at.point + toward * (4.0 * self.mesh.half_size * size),
                )
            } else if light.kind == LightKind::Surface {
                self.shining(light, at, square, rng)
            } else {
                let d = position - at.point;
                let r2 = d.length_squared();
                let spot = match light.kind {
                    LightKind::Spot { inner, outer } => {
                        let along = -light.direction.dot(d) / r2.sqrt();
                        ((along - outer.cos()) / (inner.cos() - outer.cos()).max(1e-12))
                            .clamp(0.0, 1.0)
                            .powi(2)
                    }
                    LightKind::Profile => {
                        let luminaire = light.luminaire.as_ref();
                        luminaire.map_or(0.0, |l| l.per_lumen(-d / r2.sqrt()))
                    }
                    _ => 1.0,
                };
                (spot * at.normal.dot(d) / (r2 * r2.sqrt()), position)
            };
            if factor.is_nan() || factor <= 0.0 {
                continue;
            }
            let segment = Segment {
                from: at.point.as_vec3(),
                to: end.as_vec3(),
                planes: [at.plane, NO_PLANE],
            };
            let Some(throughput) = self.arriving(by, &segment, throughput) else {
                continue;
            };
            let power = &self.scene.spectra[light.light].power;
            for l in 0..BANDS {
                sum[l] += throughput[l] * factor * power[l] * light.shape[l];
            }
        }
    }

    /// A random point of a lamp with an extent, by area: what turns its flux into irradiance, and the point.
    fn shining(
        &self,
        light: &PunctualLight,
        at: &PathVertex,
        square: [f64; 2],
        rng: &mut Pcg,
    ) -> (f64, DVec3) {
        let nothing = (0.0, at.point);
        let Some(luminaire) = &light.luminaire else {
            return nothing;
        };
        let area = |[a, b, c]: &[DVec3; 3]| 0.5 * (*b - *a).cross(*c - *a).length();
        let mut left = rng.f64() * luminaire.area();
        let chosen = luminaire.triangles().iter().find(|t| {
            left -= area(t);
            left < 0.0
        });
        let Some(triangle) = chosen.or(luminaire.triangles().last()) else {
            return nothing;
        };
        let [a, b, c] = *triangle;
        let own = (b - a).cross(c - a).normalize_or_zero();
        let from = on_triangle(triangle, square) + light.position - self.mesh.centre;
        let d = from - at.point;
        let (r2, way) = (d.length_squared(), d.normalize_or_zero());
        let sent = luminaire.per_area(-way, own) * luminaire.area();
        let end = from + own * (1e-5 * self.mesh.half_size);
        (sent * at.normal.dot(way) / r2, end)
    }

    /// Emitted radiance at a point of a triangle, W/m2/sr/nm.
    fn radiance(&self, triangle: usize, weights: [f32; 3]) -> Option<Spectrum> {
        let e = self.scene.materials[self.mesh.material[triangle] as usize].even_emission()?;
        let weights = self.mesh.on_origin_f32(triangle, weights);
        let power = &self.scene.spectra[e.light].power;
        let shape = match &e.texture {
            Some(texture) => {
                let texel = self.texel(texture, triangle, weights);
                let color = std::array::from_fn(|k| e.color[k] * texel[k]);
                self.upsampler.reflectance_fast(color).map(|x| x * e.scale)
            }
            None => e.shape,
        };
        Some(std::array::from_fn(|l| power[l] * shape[l]))
    }

    fn albedo(&self, triangle: usize, weights: [f32; 3]) -> Spectrum {
        let material = &self.scene.materials[self.mesh.material[triangle] as usize];
        match self.color(material, triangle, weights) {
            Some(color) => material.bounded(self.upsampler.reflectance_fast(color)),
            None => material.reflectance,
        }
    }

    /// What one side of a sheet reflects, and what it lets through.
    fn both_sides(&self, triangle: usize, weights: [f32; 3], back: bool) -> [Spectrum; 2] {
        let material = &self.scene.materials[self.mesh.material[triangle] as usize];
        let Some(sheet) = &material.sheet else {
            return [self.albedo(triangle, weights), [0.0; BANDS]];
        };
        let color = self.color(material, triangle, weights);
        let weights = self.mesh.on_origin_f32(triangle, weights);
        let weave = sheet.weave(|texture| self.texel(texture, triangle, weights));
        material.scatters(sheet, color, weave, back, &self.upsampler)
    }

    /// The shares of the light that meets a side of a sheet, and of that behind it, in what it is shown by: without the pattern of its
    /// paint, which viewers add. None of what is no sheet.
    pub(super) fn shares(
        &self,
        triangle: usize,
        weights: [f32; 3],
        back: bool,
    ) -> Option<[Spectrum; 2]> {
        let number = self.mesh.material[triangle] as usize;
        let material = &self.scene.materials[number];
        let (sheet, means) = (material.sheet.as_ref()?, self.sheets[number].as_ref()?);
        let weights = self.mesh.on_origin_f32(triangle, weights);
        let weave = sheet.weave(|texture| self.texel(texture, triangle, weights));
        let [own, across] = material.scatters(sheet, means.color, weave, back, &self.upsampler);
        let share = |of: Spectrum, none: f64| -> Spectrum {
            std::array::from_fn(|k| match means.shown[k] > 0.0 {
                true => of[k] / means.shown[k],
                false => none,
            })
        };
        Some([share(own, 1.0), share(across, 0.0)])
    }

    /// The painted base colour at a point of a triangle; none where nothing paints it.
    fn color(&self, material: &Material, triangle: usize, weights: [f32; 3]) -> Option<[f32; 3]> {
        let surface = &self.scene.surfaces[self.mesh.origin[triangle].0 as usize];
        let colors = surface.colors.as_ref().filter(|_| material.vertex_paint);
        if material.paint.is_none() && colors.is_none() {
            return None;
        }
        let weights = self.mesh.on_origin_f32(triangle, weights);
        let mut color = material.base_color;
        if let Some(texture) = &material.paint {
            let texel = self.texel(texture, triangle, weights);
            color = std::array::from_fn(|k| color[k] * texel[k]);
        }
        if let Some(colors) = colors {
            let corners = surface.triangles[self.mesh.origin[triangle].1 as usize];
            for (c, x) in color.iter_mut().enumerate() {
                *x *= (0..3)
                    .map(|k| colors[corners[k] as usize][c] * weights[k])
                    .sum::<f32>();
            }
        }
        Some(color)
    }

    fn texel(&self, texture: &Texture, triangle: usize, weights: [f32; 3]) -> [f32; 4] {
        let (surface, local) = self.mesh.origin[triangle];
        let surface = &self.scene.surfaces[surface as usize];
        let Some(uvs) = surface.texcoords.get(texture.texcoord) else {
            return [1.0; 4];
        };
        let corners = surface.triangles[local as usize];
        let uv = std::array::from_fn(|c| {
            (0..3)
                .map(|k| uvs[corners[k] as usize][c] * weights[k])
                .sum()
        });
        texture.sample(&self.scene.images, uv)
    }
}

/// Which of two ways light goes on, and by what it is multiplied: by chance, each as often as it may carry on the most of what is left,
/// so that weights do not grow.
fn one_side(sides: [Spectrum; 2], throughput: &Spectrum, rng: &mut Pcg) -> (Spectrum, bool) {
    let [reflected, through] = sides
        .each_ref()
        .map(|side| greatest(&std::array::from_fn(|l| side[l] * throughput[l])));
    if reflected + through <= 0.0 {
        return ([0.0; BANDS], false);
    }
    let chance = through / (reflected + through);
    let passes = rng.f64() < chance;
    let [reflected, through] = sides;
    match passes {
        true => (through.map(|x| x / chance), true),
        false => (reflected.map(|x| x / (1.0 - chance)), false),
    }
}

fn rng_u64(rng: &mut Pcg) -> u64 {
    u64::from(rng.u32()) << 32 | u64::from(rng.u32())
}
