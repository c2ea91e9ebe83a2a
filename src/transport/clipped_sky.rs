//! Sky and ground at a point of a room of few triangles, exactly.
//!
//! All directions are covered by eight triangles, far away, less the shadows of blockers; the rest is divided until the sky is even over
//! each part, whose factor is exact. Panes cast no shadows: their transmittance is a mean over directions among these parts.

use super::obstacles::Obstacles;
use super::receiver::Receiver;
use crate::geometry::sampling::{sequence02, triangle_weights};
use crate::geometry::{
    Clipper, NO_PLANE, Segment, Shadow, Shaft, ShaftContents, ShaftEnd, lambert_edges_x8, quarters,
};
use crate::light::{Passage, Tint};
use crate::link::Sight;
use crate::scene::sky::{PARTS, PLACES, Sky};
use glam::DVec3;
use std::f64::consts::PI;

/// Distance of the far triangles in half sizes of the room: all of it lies before their planes.
const FAR: f64 = 8.0;
/// Blockers of a far triangle at the most, and pieces it may fall into, before it is divided.
const LISTED: usize = 64;
const PIECES: usize = 64;
/// How often a far triangle is divided before rays decide: to 3 degrees.
const SPLITS: u32 = 5;
/// Rays into a far triangle that is divided no further.
const LAST_RAYS: u32 = 16;
/// A part is even if two means of the sky over it differ by less than this share. With .005 points of CIE 171 5.9 are off by .1
/// %.
const EVEN: f64 = 0.005;
/// Its corners must also be less than this far apart, cosine: 25 degrees.
const NARROW: f64 = 0.9;
/// And they must be no further apart than they are from the sun, where the sky has a peak: by chance two means across the peak may be
/// alike. Without this a point of CIE 171 5.9 under the sky of type 13 was .53 % dark.
const BESIDE_SUN: f64 = 1.0;
/// How often a part is divided for the sake of the sky, which changes within a degree about the sun.
const DEPTH: u32 = 6;

/// Memory of a look outside, and what it found.
#[derive(Debug, Default)]
pub(super) struct SkyIrradiance {
    clipper: Clipper,
    /// Irradiance by each part of the sky, where open level ground has 1, and by the ground.
    pub(super) seen: [f64; PLACES],
    /// Mean transmittance of panes for each part; none where nothing changes light.
    pub(super) tints: [Option<Passage>; PLACES],
    /// Rays cast.
    pub(super) rays: u64,
    parts: Vec<Part>,
}

/// A point that looks outside.
pub(super) struct SkyReceiver<'a> {
    pub(super) sky: &'a Sky,
    pub(super) sight: &'a Sight<'a>,
    /// What changes light on its way; none where nothing does.
    pub(super) by: Option<&'a dyn Obstacles>,
    pub(super) to: &'a Receiver,
}

impl SkyReceiver<'_> {
    /// Looks outside; `samples` directions find the transmittance of panes.
    pub(super) fn look(&self, samples: usize, found: &mut SkyIrradiance) {
        (found.seen, found.tints, found.rays) = ([0.0; PLACES], Default::default(), 0);
        found.parts.clear();
        let far = FAR * self.sight.mesh.half_size;
        for octant in 0..8_u32 {
            let sign = |bit: u32| if octant >> bit & 1 == 1 { -far } else { far };
            let [x, y, z] = [DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2)];
            if [x, y, z].iter().all(|d| d.dot(self.to.normal) <= 0.0) {
                continue;
            }
            // The fronts of the far triangles face inwards.
            let corners = if octant.count_ones() % 2 == 0 {
                [x, z, y]
            } else {
                [x, y, z]
            };
            let cell = SkyTriangle {
                corners: corners.map(|d| self.to.point + d),
                up: y.y > 0.0,
                splits: SPLITS,
            };
            self.cell(&cell, None, found);
        }
        if let Some(by) = self.by {
            found.tints = self.tinted(by, samples, &found.parts);
        }
    }

    /// Adds the visible part of a far triangle; its blockers are only known to be among the candidates.
    fn cell(&self, cell: &SkyTriangle, candidates: Option<&[u32]>, found: &mut SkyIrradiance) {
        let (sight, to) = (self.sight, self.to);
        let point = ShaftEnd::Point {
            at: to.point,
            normal: to.normal,
            plane: to.plane,
        };
        let far = ShaftEnd::Triangle {
            corners: cell.corners,
            plane: NO_PLANE,
        };
        let shaft = Shaft::between(&point, &far);
        let list = match sight.rays.blockers(&shaft, candidates, LISTED) {
            ShaftContents::Clear => Some(Vec::new()),
            ShaftContents::Few(list) => Some(list),
            ShaftContents::Many => None,
        };
        if list
            .as_ref()
            .is_some_and(|list| self.clip(cell, list, found))
        {
            return;
        }
        if cell.splits > 0 {
            for corners in quarters(cell.corners) {
                let part = SkyTriangle {
                    corners,
                    splits: cell.splits - 1,
                    ..*cell
                };
                self.cell(&part, list.as_deref().or(candidates), found);
            }
            return;
        }
        let [a, b, c] = cell.corners;
        let open = (0..LAST_RAYS).filter(|&k| {
            let w = triangle_weights(sequence02(k, to.seed));
            let end = a * w[0] + b * w[1] + c * w[2];
            !sight
                .rays
                .occluded(&Segment::new(to.point, end, [to.plane, NO_PLANE]))
        });
        let share = open.count() as f64 / f64::from(LAST_RAYS);
        found.rays += u64::from(LAST_RAYS);
        if share > 0.0 {
            let corners = cell.corners.map(|c| c - to.point);
            self.add((cell.up, share), &corners, found);
        }
    }

    /// Adds the part of a far triangle that is visible past these blockers; false, and nothing is added, if it falls into too
    /// many pieces.
    fn clip(&self, cell: &SkyTriangle, blockers: &[u32], found: &mut SkyIrradiance) -> bool {
        let (sight, to) = (self.sight, self.to);
        let mut clipper = std::mem::take(&mut found.clipper);
        clipper.begin(to.point, &cell.corners);
        let blockers = sight.blockers(blockers, [to.plane, NO_PLANE]);
        let fits = blockers.into_iter().flatten().all(|blocker| {
            let outline = sight.mesh.outline(blocker);
            clipper.clip(&Shadow::new(to.point, outline.as_ref()), PIECES)
        });
        if fits {
            let whole = lambert_edges_x8(to.point, to.normal, &cell.corners);
            if clipper.factor(to.normal, whole) > 0.0 {
                for piece in clipper.visible() {
                    self.add((cell.up, 1.0), piece, found);
                }
            }
        }
        found.clipper = clipper;
        fits
    }

    /// Adds a polygon of directions (of any length) above or below the horizon, of which a share is free.
    fn add(&self, (up, share): (bool, f64), polygon: &[DVec3], found: &mut SkyIrradiance) {
        if self.by.is_none() && (!up || self.sky.is_even()) {
            let factor = share * lambert_edges_x8(DVec3::ZERO, self.to.normal, polygon);
            return found.add(up, [factor; PARTS]);
        }
        let first = polygon[0].normalize();
        for two in polygon[1..].windows(2) {
            let corners = [first, two[0].normalize(), two[1].normalize()];
            let radiance = corners.map(|d| self.half(up, d));
            self.triangle((up, share), corners, radiance, DEPTH, found);
        }
    }

    /// Radiance of the parts of the sky from an upward direction, or of the parts of the ground from a downward one; level directions may be
    /// either.
    fn half(&self, up: bool, direction: DVec3) -> [f64; PARTS] {
        let y = match up {
            true => direction.y.max(f64::MIN_POSITIVE),
            false => direction.y.min(0.0),
        };
        self.sky.radiance(DVec3 { y, ..direction }).1
    }

    /// Adds the irradiance by a triangle with known radiance at its corners.
    fn triangle(
        &self,
        (up, share): (bool, f64),
        corners: [DVec3; 3],
        radiance: [[f64; PARTS]; 3],
        depth: u32,
        found: &mut SkyIrradiance,
    ) {
        let ([a, b, c], normal) = (corners, self.to.normal);
        if corners.iter().all(|d| d.dot(normal) <= 0.0) {
            return;
        }
        let middles = [a + b, b + c, c + a].map(|d| d.normalize());
        let halfway = middles.map(|d| self.half(up, d));
        let mean = |[x, y, z]: [[f64; PARTS]; 3]| -> [f64; PARTS] {
            std::array::from_fn(|k| (x[k] + y[k] + z[k]) / 3.0)
        };
        // One rule exact for quadratic variation, and one exact for linear.
        let (fine, coarse) = (mean(halfway), mean(radiance));
        let apart = std::array::from_fn(|k| (fine[k] - coarse[k]).abs());
        let bright = |radiance| self.sky.brightness(up, radiance);
        let is_even = bright(apart) <= EVEN * bright(fine);
        let cosine = a.dot(b).min(b.dot(c)).min(c.dot(a));
        // 1 less the cosine is proportional to the square of the distance.
        let is_beside = self.sky.peak().is_some_and(|sun| {
            let nearest = corners.map(|d| d.dot(sun)).into_iter().fold(-1.0, f64::max);
            1.0 - cosine > BESIDE_SUN * (1.0 - nearest)
        });
        if depth == 0 || (cosine > NARROW && is_even && !is_beside) {
            let factor = share * lambert_edges_x8(DVec3::ZERO, normal, &corners);
            // A sky that is brighter where its light is steeper brings more than its mean does: points of a floor far from a window were 1.2
            // % dark under a sky of type 1. Products of two linear functions are exact.
            let steep = middles.map(|d| d.dot(normal).max(0.0));
            let all: f64 = steep.iter().sum();
            let mean = |k: usize| match all > 0.0 {
                true => (0..3).map(|i| steep[i] * halfway[i][k]).sum::<f64>() / all,
                false => fine[k],
            };
            let brings = std::array::from_fn(|k| PI * mean(k) * factor);
            found.add(up, brings);
            if self.by.is_some() {
                found.parts.push(Part {
                    corners,
                    up,
                    brings,
                });
            }
            return;
        }
        let ([ab, bc, ca], [u, v, w]) = (middles, halfway);
        let [x, y, z] = radiance;
        [
            ([a, ab, ca], [x, u, w]),
            ([ab, b, bc], [u, y, v]),
            ([ca, bc, c], [w, v, z]),
            ([ab, bc, ca], halfway),
        ]
        .into_iter()
        .for_each(|(part, radiance)| self.triangle((up, share), part, radiance, depth - 1, found));
    }

    /// Mean transmittance of panes for each part of the sky and of the ground: each even free part is sampled separately, at the centroids
    /// of triangles in proportion to its irradiance. Point A of CIE 171 5.10, close below a roof of glass along which all its light comes
    /// in, is off by .8 % with 256 random directions, by .4 % with as many centroids, and by half of that with twice as many.
    fn tinted(
        &self,
        by: &dyn Obstacles,
        samples: usize,
        parts: &[Part],
    ) -> [Option<Passage>; PLACES] {
        let (mut tints, mut all): ([Tint; PLACES], Tint) = Default::default();
        let bright = |part: &Part| self.sky.brightness(part.up, part.brings);
        let total: f64 = parts.iter().map(bright).sum();
        let mut asked = Vec::new();
        for part in parts.iter().filter(|part| bright(part) > 0.0) {
            let rows = (samples as f64 * bright(part) / total).sqrt().ceil() as usize;
            asked.clear();
            asked.extend(middles(rows).map(|at| self.asked(by, part, at)));
            let weights: f64 = asked.iter().map(|(_, weight)| weight).sum();
            let first = if part.up { 0 } else { PARTS };
            for (passage, weight) in asked.iter().filter(|(_, weight)| *weight > 0.0) {
                for (tint, brings) in tints[first..].iter_mut().zip(part.brings) {
                    tint.add(passage.as_ref(), brings * weight / weights);
                    all.add(passage.as_ref(), brings * weight / weights);
                }
            }
        }
        // A part so narrow that no direction fell into it is taken to pass as the rest does.
        let all = all.mean();
        tints.map(|tint| tint.mean().or_else(|| all.clone()))
    }

    /// Transmittance of panes in one direction of a part, and the weight of that direction.
    fn asked(&self, by: &dyn Obstacles, part: &Part, [u, v]: [f64; 2]) -> (Option<Passage>, f64) {
        let [a, b, c] = part.corners;
        let at = a * u + b * v + c * (1.0 - u - v);
        let direction = at.normalize();
        let end = self.to.point + direction * by.reach();
        let (passage, _) = by.leave(&Segment::new(self.to.point, end, [NO_PLANE; 2]));
        // The triangle is divided by area: a solid angle falls with the third power of its distance.
        (
            passage,
            self.to.normal.dot(direction).max(0.0) / at.length().powi(3),
        )
    }
}

/// Centroids of the equal triangles into which a triangle falls, `rows` along a side, as its first two barycentric coordinates.
fn middles(rows: usize) -> impl Iterator<Item = [f64; 2]> {
    let place = move |i: usize, j: usize, third: f64| {
        [i, j].map(|k| (k as f64 + third / 3.0) / rows as f64)
    };
    (0..rows).flat_map(move |i| {
        let upright = (0..rows - i).map(move |j| place(i, j, 1.0));
        upright.chain((0..rows - i - 1).map(move |j| place(i, j, 2.0)))
    })
}

impl SkyIrradiance {
    /// Adds irradiance by the parts of one half.
    fn add(&mut self, up: bool, brings: [f64; PARTS]) {
        let first = if up { 0 } else { PARTS };
        for (seen, brings) in self.seen[first..].iter_mut().zip(brings) {
            *seen += brings;
        }
    }
}

/// A far triangle.
struct SkyTriangle {
    corners: [DVec3; 3],
    /// Is the triangle above the horizon?
    up: bool,
    /// How often the triangle may still be divided.
    splits: u32,
}

/// A triangle of directions over which sky or ground is even.
#[derive(Debug)]
struct Part {
    corners: [DVec3; 3],
    /// Is the triangle above the horizon?
    up: bool,
    /// Irradiance by each part of the sky, or of the ground.
    brings: [f64; PARTS],
}

#[cfg(test)]
mod tests {
    use super::super::gatherer::Memory;
    use super::super::surroundings::{OpeningRays, SkySampling};
    use super::*;
    use crate::transport::tests::{baked, middle};

    #[test]
    fn middles_are_those_of_equal_triangles() {
        for rows in 1..6 {
            let all: Vec<[f64; 2]> = middles(rows).collect();
            assert_eq!(all.len(), rows * rows);
            // Exact for linear functions, and to 1 / rows^2 for others: the mean of u^2 over a triangle is 1 / 6.
            let mean = |f: &dyn Fn([f64; 2]) -> f64| {
                all.iter().map(|&at| f(at)).sum::<f64>() / all.len() as f64
            };
            assert!((mean(&|[u, _]| u) - 1.0 / 3.0).abs() < 1e-12);
            assert!((mean(&|[_, v]| v) - 1.0 / 3.0).abs() < 1e-12);
            let off = (mean(&|[u, _]| u * u) - 1.0 / 6.0).abs();
            assert!(off < 0.06 / (rows * rows) as f64, "{rows}: {off}");
        }
    }

    /// The plain way is by rays: it finds the same factors, and the same transmittances of three kinds of panes.
    #[test]
    fn rays_find_the_same_sky_behind_panes() {
        let bake = baked("glazed.glb", 1);
        let [mut clipped, mut cast] = [[[0.0; 4]; 2]; 2];
        bake.room.with_sight(|sight| {
            let gatherer = bake.gatherer(sight);
            let (outside, tree) = (gatherer.sky.unwrap(), bake.tree());
            let mut look = Memory::default().look;
            for leaf in tree.leaves() {
                let to = middle(tree, leaf);
                let ways = (sight, Some(&gatherer as &dyn Obstacles));
                let area = tree.node(leaf).area;
                let sampling = SkySampling::Rays(2);
                let openings = OpeningRays {
                    range: sampling.opening_rays([0; 2]),
                    enough: &|_| 0,
                    weighed_at: to.point,
                };
                let many = (sampling, openings);
                let seen = outside.seen(ways, &to, many, &mut look);
                add(&mut clipped, area, seen, &look.tints);
                let seen = outside.by_rays(ways, &to, many, &mut look);
                add(&mut cast, area, seen, &look.tints);
            }
        });
        for (a, b) in clipped.as_flattened().iter().zip(cast.as_flattened()) {
            assert!(*b > 0.0 && (a - b).abs() < 0.01 * b, "{clipped:?} {cast:?}");
        }
    }

    /// Adds what is seen above and below the horizon, and what panes leave of that in three lanes.
    fn add(
        sums: &mut [[f64; 4]; 2],
        area: f64,
        seen: [f64; PLACES],
        tints: &[Option<Passage>; PLACES],
    ) {
        for (sum, first) in sums.iter_mut().zip([0, PARTS]) {
            for place in first..first + PARTS {
                let share = area * seen[place];
                sum[0] += share;
                for (sum, lane) in sum[1..].iter_mut().zip([5, 30, 50]) {
                    *sum += share
                        * tints[place]
                            .as_ref()
                            .map_or(1.0, |tint| f64::from(tint.filter[lane]));
                }
            }
        }
    }
}
