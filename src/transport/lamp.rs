//! Emitting elements and bright patches at a point: how much of them is seen.
//!
//! A lamp near a point is divided into parts none of which is near; each has its exact factor (contour integral), and rays
//! go to parts in proportion to this. The number of rays is fixed beforehand: stopping where the first few agree overlooks
//! thin things, and lost 4 to 8 % of the light of lamps behind louvres.

use super::gatherer::{Gatherer, Memory, RadiosityPart, SourceElement};
use super::receiver::{Gathered, Receiver};
use super::slope::SeenPatch;
use crate::geometry::sampling::{hash, sequence02, triangle_weights};
use crate::geometry::{Segment, lambert_triangles_x8, quarters};
use crate::hierarchy::{NONE, quarter};
use crate::light::{Passage, Tint, lightness_sensitivity};
use crate::link::open_weight;
use glam::DVec3;
use std::f64::consts::PI;

/// A part is near a point that is closer to its middle than this many of its radii: beyond, the kernel differs by less
/// than a factor of 4 over the part, and weights compensate.
const NEAR: f64 = 2.0;
/// Parts of a lamp at the most.
const PARTS: usize = 64;
/// How often one part is divided for a single ray: 4^3 is [`PARTS`].
const DIVISIONS: usize = 3;
/// Rays to all lamps, or all bright patches, together, at the least.
const LEAST_RAYS: usize = 8;
/// Rays from each of the many points that represent a leaf. With 4 a furnished room's leaves stay so noisy that a
/// further round is needed; with 8 that happens in one room of three, and no time is saved.
const LEAF_RAYS: usize = 16;
/// What all bright patches together may err by chance, in tolerances. With 4, 2 and 1 half of 2,500 points of the file are off by more than .455, .425, .419 dE00 in a
/// garage and .401, .397, .386 in a living room (grey, `--error 1`), from 42, 65, 94 and 15, 28, 51 such rays a look; with rays for each patch by itself,
/// 440 and 73 a look, by .437 and .368, and the garage took 54 CPU seconds for 43 to 46.
const BRIGHT_PATCHES: f64 = 1.0;
/// `n` rays to openings err by about this much `n^(-3/4)` of what may come through these: by .76, .71, .58, .50, .34 with 16, 64, 256, 1024, 4096 rays at
/// half of the leaves of a room behind glass, by 1.1, 1.1, 1.4, 1.0, 1.1 at those of one behind curtains.
const OPENING_NOISE: f64 = 1.0;

/// A triangle and its factor for a point.
type Part = ([DVec3; 3], f64);

/// State of the rays to a lamp: the parts of its face, and which of its faces the last ray went to.
#[derive(Default)]
struct RayProgress {
    parts: Vec<Part>,
    face: (usize, f64),
}

/// The kernel of a differential area at the end of `way`, per area; 0 if the area is turned away.
fn kernel(to: &Receiver, normal: DVec3, way: DVec3) -> f64 {
    let (here, there) = (to.normal.dot(way), -normal.dot(way));
    if here > 0.0 && there > 0.0 {
        here * there / (PI * way.length_squared().powi(2))
    } else {
        0.0
    }
}

/// Divides a lamp's triangle of exact factor `whole` until no part is near or there are [`PARTS`]; their factors sum to
/// `whole`.
pub(super) fn parts_of(to: &Receiver, corners: [DVec3; 3], whole: f64) -> Vec<Part> {
    let mut parts = vec![(corners, whole)];
    let mut next = 0;
    while next < parts.len() && parts.len() + 3 <= PARTS {
        let (corners, _) = parts[next];
        if is_far(to, corners) {
            next += 1;
            continue;
        }
        // Divided parts go to the end, so that the largest are divided first.
        parts.remove(next);
        let four = quartered(to, corners).into_iter();
        parts.extend(four.filter(|part| part.1 > 0.0));
    }
    parts
}

/// One of the parts into which a lamp's triangle of exact factor `whole` would be divided, chosen by their factors: what one ray needs. The rest
/// of `u` after the choice can be used again.
pub(super) fn one_part(to: &Receiver, corners: [DVec3; 3], whole: f64, u: &mut f64) -> Part {
    part_by(to, (corners, whole), |quarters| {
        let (part, rest) = chosen(quarters, *u)?;
        *u = rest;
        Some(part)
    })
}

/// The part that [`one_part`] would choose with a point in it, given by barycentric weights.
pub(super) fn part_around(
    to: &Receiver,
    corners: [DVec3; 3],
    whole: f64,
    mut weights: [f64; 3],
) -> Part {
    part_by(to, (corners, whole), |quarters| {
        Some(quarters[quarter(&mut weights) as usize])
    })
}

/// A part of a part that is not near, of its quarters those that `choose` takes.
fn part_by(
    to: &Receiver,
    mut part: Part,
    mut choose: impl FnMut(&[Part; 4]) -> Option<Part>,
) -> Part {
    for _ in 0..DIVISIONS {
        if is_far(to, part.0) {
            break;
        }
        match choose(&quartered(to, part.0)) {
            Some(one) if one.1 > 0.0 => part = one,
            _ => break,
        }
    }
    part
}

/// The quarters of a triangle with their factors for a point.
fn quartered(to: &Receiver, corners: [DVec3; 3]) -> [Part; 4] {
    let four = quarters(corners);
    let factors = lambert_triangles_x8(to.point, to.normal, four.into_iter());
    std::array::from_fn(|k| (four[k], factors[k]))
}

/// The part that `u` chooses by their factors, and the rest of `u`, within 0 to 1 again; none of no parts.
fn chosen(parts: &[Part], u: f64) -> Option<(Part, f64)> {
    let all: f64 = parts.iter().map(|part| part.1).sum();
    let mut left = u * all;
    let last = parts.len().checked_sub(1)?;
    let mut k = 0;
    while k < last && left >= parts[k].1 {
        left -= parts[k].1;
        k += 1;
    }
    Some((parts[k], (left / parts[k].1).clamp(0.0, 1.0)))
}

/// Is a triangle far from a point, by [`NEAR`]?
fn is_far(to: &Receiver, corners: [DVec3; 3]) -> bool {
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    let radius = corners.map(|c| c.distance_squared(middle));
    let radius = radius.into_iter().fold(0.0, f64::max);
    middle.distance_squared(to.point) >= NEAR * NEAR * radius
}

/// A point of one of the parts, chosen by their factors, with the weight that lets the kernel there represent all parts: 1 in
/// the mean. The rest of `u` after the choice of a part chooses the point.
pub(super) fn point_of(
    to: &Receiver,
    normal: DVec3,
    parts: &[Part],
    [u, v]: [f64; 2],
) -> Option<(DVec3, f64)> {
    let (part, u) = chosen(parts, u)?;
    let [a, b, c] = part.0;
    let w = triangle_weights([u, v]);
    let point = a * w[0] + b * w[1] + c * w[2];
    Some((point, weight_at(to, normal, &part, point)))
}

/// The kernel at a point of a part, over its mean: what a point there counts that stands for the whole part.
pub(super) fn weight_at(to: &Receiver, normal: DVec3, part: &Part, point: DVec3) -> f64 {
    let ([a, b, c], factor) = *part;
    let area = 0.5 * (b - a).cross(c - a).length();
    kernel(to, normal, point - to.point) * area / factor
}

impl Gatherer<'_> {
    /// Adds the lamps, or the bright patches, that were held back: their unblocked light, times the share that a number of rays finds
    /// open. Each ray goes to one chosen by its unblocked light, so that many lamps, or a lamp of many faces, need no more rays than
    /// one.
    pub(super) fn sources_together(
        &self,
        to: &Receiver,
        which: RadiosityPart,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        let sources = std::mem::take(&mut memory.sources);
        let all: f64 = sources.iter().map(|source| source.carries).sum();
        if all > 0.0 {
            let noise = match which {
                RadiosityPart::Emitted => self.allowed_noise.lamps,
                _ => BRIGHT_PATCHES,
            };
            let count = self.rays_to_sources(to, all, noise);
            let owners = self.aim(to, &sources, (all, count), memory);
            self.blocked(&memory.segments, &mut memory.blocked);
            memory.rays += memory.segments.len() as u64;
            let total: f64 = memory.weights.iter().sum();
            let open = open_weight(&memory.weights, &memory.blocked);
            let visible = if total > 0.0 { open / total } else { 0.0 };
            let mut seen = vec![visible; sources.len()];
            if self.light.apart {
                self.look_at_each(to, &sources, &owners, &mut seen, memory);
            } else if visible > 0.0 && visible < 1.0 {
                seen.fill(0.0);
                let rays = owners.iter().zip(&memory.weights).zip(&memory.blocked);
                for ((&source, weight), _) in rays.filter(|(_, blocked)| !**blocked) {
                    seen[source] += weight / total * all / sources[source].carries;
                }
            }
            let tints = self.tints(&owners, sources.len(), memory);
            let left = all * self.left_by(tints.last());
            memory.noise +=
                left * left * visible * (1.0 - visible) / (owners.len().max(1) as f64).powf(1.5);
            let each = sources.iter().zip(&seen).enumerate();
            for (k, (source, &seen)) in each.filter(|(_, (_, seen))| **seen > 0.0) {
                let tint = tints.get(k).or(tints.last());
                self.see(
                    to,
                    source.id,
                    source.factor,
                    SeenPatch::of(seen),
                    tint,
                    which,
                    out,
                );
            }
        }
        memory.sources = sources;
        memory.sources.clear();
        memory.faces.clear();
    }

    /// The visible share of each lamp, by its own rays. If brightness has one meaning, a lamp without a ray is faint beside the others, and
    /// those represent it. Not so if it has two, visible light and excitation: a lamp behind a wall, faint beside one of ultraviolet light,
    /// doubled the visible light in a booth. Such lamps get a ray each, whatever the others found: with rays only where all other lamps were
    /// open, these could only darken, and a furnace was dark by .4 %.
    fn look_at_each(
        &self,
        to: &Receiver,
        lamps: &[SourceElement],
        owners: &[usize],
        seen: &mut [f64],
        memory: &mut Memory,
    ) {
        let mut own = vec![[0.0; 2]; lamps.len()];
        let rays = owners.iter().zip(&memory.weights).zip(&memory.blocked);
        for ((&lamp, weight), &blocked) in rays {
            own[lamp][0] += f64::from(u8::from(!blocked)) * weight;
            own[lamp][1] += weight;
        }
        for ((k, lamp), [open, all]) in lamps.iter().enumerate().zip(own) {
            if all > 0.0 {
                seen[k] = open / all;
                continue;
            }
            let sample = sequence02(k as u32, hash(to.seed ^ 2, u64::from(lamp.id)));
            if let Some((segment, _)) =
                self.ray_to(to, lamp, sample, &mut RayProgress::default(), memory)
            {
                memory.rays += 1;
                let hidden = self.sight.blocks_one(&segment);
                seen[k] = if hidden { 0.0 } else { 1.0 };
            }
        }
    }

    /// What panes leave of each lamp's light, by the rays that reached the lamp, and last of all lamps' light together, which
    /// represents lamps without such rays. Empty in a room without panes.
    pub(super) fn tints(&self, owners: &[usize], lamps: usize, memory: &Memory) -> Vec<Passage> {
        if self.is_plain() {
            return Vec::new();
        }
        let mut sums = vec![Tint::default(); lamps + 1];
        let rays = memory.segments.iter().zip(&memory.weights);
        for (((segment, &weight), _), &lamp) in (rays.zip(&memory.blocked))
            .zip(owners)
            .filter(|((_, blocked), _)| !**blocked)
        {
            let passage = self.through(segment);
            for k in [lamp, lamps] {
                sums[k].add(passage.as_ref(), weight);
            }
        }
        let mut means: Vec<Option<Passage>> = sums.into_iter().map(Tint::mean).collect();
        let whole = means.pop().flatten().unwrap_or_else(Passage::free);
        let each = means.into_iter();
        let each = each.map(|mean| mean.unwrap_or_else(|| whole.clone()));
        each.chain([whole.clone()]).collect()
    }

    /// Share of brightness that a passage leaves.
    pub(super) fn left_by(&self, passage: Option<&Passage>) -> f64 {
        passage.map_or(1.0, |passage| self.filters.brightness(&passage.filter))
    }

    /// How many rays are worth while to lamps that would bring `all`, share of white.
    pub(super) fn rays_to_lamps(&self, to: &Receiver, all: f64) -> usize {
        self.rays_to_sources(to, all, self.allowed_noise.lamps)
    }

    /// How many rays are worth while to openings through which so much would come, share of white.
    pub(super) fn rays_to_openings(&self, to: &Receiver, all: f64) -> usize {
        let noise = self.allowed_noise.lamps;
        self.rays_enough(to, all, (OPENING_NOISE, noise), usize::MAX)
    }

    /// How many rays are worth while to lamps or patches that would bring `all`, share of white, and may err by so many tolerances.
    fn rays_to_sources(&self, to: &Receiver, all: f64, noise: f64) -> usize {
        // Stratified rays err by about 0.5 n^(-3/4) where a boundary crosses.
        self.rays_enough(to, all, (0.5, noise), self.allowed_noise.most_rays)
    }

    /// The number of rays, so many at the most, by which `all`, share of white, errs by so many tolerances, if `n` of them err by `one` n^(-3/4) of it.
    /// Where many points represent a leaf, their number compensates.
    fn rays_enough(&self, to: &Receiver, all: f64, (one, noise): (f64, f64), most: usize) -> usize {
        if !self.shafts {
            return LEAF_RAYS;
        }
        let wanted = one * all / (noise * self.tolerance_at(to, all));
        (wanted.powf(4.0 / 3.0).ceil() as usize).clamp(LEAST_RAYS, most)
    }

    /// What may be misplaced at a point: errors in the dark are more visible. `known`: its brightness, if no leaf tells.
    pub(super) fn tolerance_at(&self, to: &Receiver, known: f64) -> f64 {
        let leaf = to
            .leaf
            .and_then(|leaf| self.light.arrival.get(leaf as usize));
        let here = leaf.map_or(known, |&arrival| f64::from(arrival));
        self.tolerance / lightness_sensitivity(here)
    }

    /// Aims `count` rays at lamps or patches that would bring `all`, and stores them with their weights in the memory; returns the one that
    /// each goes to.
    fn aim(
        &self,
        to: &Receiver,
        sources: &[SourceElement],
        (all, count): (f64, usize),
        memory: &mut Memory,
    ) -> Vec<usize> {
        let turn = hash(to.seed, u64::from(sources[0].id));
        let mut samples: Vec<[f64; 2]> = (0..count as u32).map(|k| sequence02(k, turn)).collect();
        samples.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut samples = samples.into_iter().peekable();
        memory.segments.clear();
        memory.weights.clear();
        let (mut owners, mut before) = (Vec::with_capacity(count), 0.0);
        for (k, source) in sources.iter().enumerate() {
            let upto = match k + 1 == sources.len() {
                true => f64::INFINITY,
                false => before + source.carries,
            };
            let mut aim = RayProgress::default();
            while let Some([u, v]) = samples.next_if(|sample| sample[0] * all < upto) {
                // The rest of the number after the choice of a source chooses the point.
                let u = ((u * all - before) / source.carries).clamp(0.0, 1.0);
                if let Some((segment, weight)) = self.ray_to(to, source, [u, v], &mut aim, memory) {
                    memory.weights.push(weight);
                    memory.segments.push(segment);
                    owners.push(k);
                }
            }
            before += source.carries;
        }
        owners
    }

    /// A ray to a point of a lamp or patch, and its weight; none where the chosen point sends nothing. The numbers of one aim
    /// ascend.
    fn ray_to(
        &self,
        to: &Receiver,
        source: &SourceElement,
        [mut u, v]: [f64; 2],
        aim: &mut RayProgress,
        memory: &Memory,
    ) -> Option<(Segment, f64)> {
        let (mut id, mut chance) = (source.id, 1.0);
        if source.fixture != NONE {
            (id, chance, u) = self.face_of(source, u, &mut aim.face, memory);
            aim.parts.clear();
        }
        let node = self.tree.node(id);
        let element = self.tree.element(node)?;
        if aim.parts.is_empty() {
            aim.parts = parts_of(to, element.corners, source.factor * chance);
        }
        let (point, weight) = point_of(to, node.normal, &aim.parts, [u, v])?;
        let planes = [to.plane, self.tree.face_plane[element.face as usize]];
        (weight > 0.0).then(|| (Segment::new(to.point, point, planes), weight))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;
    use crate::light::brightness;
    use crate::transport::AllowedNoise;
    use crate::transport::tests::{baked, middle};

    fn to() -> Receiver {
        Receiver {
            point: DVec3::ZERO,
            normal: DVec3::Z,
            plane: 0,
            leaf: None,
            seed: 0,
        }
    }

    /// A random triangle that faces the origin, at about the given height above it.
    fn triangle(random: &mut Pcg, height: f64) -> [DVec3; 3] {
        let corners = [0; 3].map(|_| {
            let [x, y] = [0; 2].map(|_| 2.0 * random.f64() - 1.0);
            DVec3::new(x, y, height * (1.0 + random.f64()))
        });
        let [a, b, c] = corners;
        if (b - a).cross(c - a).dot(a) < 0.0 {
            corners
        } else {
            [a, c, b]
        }
    }

    fn factor(to: &Receiver, corners: [DVec3; 3]) -> f64 {
        lambert_triangles_x8(to.point, to.normal, [corners].into_iter())[0]
    }

    #[test]
    fn the_parts_of_a_lamp_make_up_the_whole() {
        let mut random = Pcg::new(1);
        for height in [0.01, 0.1, 1.0, 10.0] {
            for _ in 0..100 {
                let corners = triangle(&mut random, height);
                let whole = factor(&to(), corners);
                let parts = parts_of(&to(), corners, whole);
                let sum: f64 = parts.iter().map(|part| part.1).sum();
                assert!((sum - whole).abs() <= 1e-9 + 1e-6 * whole, "{sum} {whole}");
                assert!(parts.len() <= PARTS);
            }
        }
    }

    /// Weights are 1 in the mean, and nowhere far from 1 unless the parts ran out.
    #[test]
    fn points_of_a_lamp_stand_for_its_factor() {
        const SAMPLES: u32 = 4096;
        let mut random = Pcg::new(2);
        for height in [0.3, 1.0, 10.0] {
            for _ in 0..20 {
                let corners = triangle(&mut random, height);
                let [a, b, c] = corners;
                let normal = (b - a).cross(c - a).normalize();
                let parts = parts_of(&to(), corners, factor(&to(), corners));
                let weights = (0..SAMPLES)
                    .map(|k| point_of(&to(), normal, &parts, sequence02(k, 5)).unwrap().1);
                let mean = weights.sum::<f64>() / f64::from(SAMPLES);
                assert!((mean - 1.0).abs() < 5e-3, "{height}: {mean}");
                let whole = factor(&to(), corners);
                let alone = |k| {
                    let [mut u, v] = sequence02(k, 5);
                    let part = one_part(&to(), corners, whole, &mut u);
                    point_of(&to(), normal, &[part], [u, v]).unwrap().1
                };
                let mean = (0..SAMPLES).map(alone).sum::<f64>() / f64::from(SAMPLES);
                assert!((mean - 1.0).abs() < 5e-3, "{height}, one part: {mean}");
            }
        }
    }

    /// The less lamps may err by chance, the less their light differs from seed to seed.
    #[test]
    fn lamps_err_by_less_where_they_may() {
        const SEEDS: u64 = 16;
        let bake = baked("furnished.glb", 2);
        bake.room.with_sight(|sight| {
            let mut memory = Memory::default();
            let mut rms = |lamps: f64| {
                let usual = bake.gatherer(sight);
                let gatherer = Gatherer {
                    allowed_noise: AllowedNoise {
                        lamps,
                        most_rays: 1024,
                        ..usual.allowed_noise
                    },
                    ..usual
                };
                let mut light = |to: &Receiver, seed: u64| {
                    let direct = gatherer.direct(&Receiver { seed, ..*to }, &mut memory);
                    let width = bake.light().width();
                    let xyz = bake.lanes().tristimulus(&direct[..width]);
                    brightness(xyz, bake.light().white)
                };
                let (mut sum, mut places) = (0.0, 0.0);
                for leaf in bake.tree().leaves().step_by(17) {
                    let to = middle(bake.tree(), leaf);
                    let lights: Vec<f64> = (0..SEEDS).map(|seed| light(&to, seed)).collect();
                    let mean = lights.iter().sum::<f64>() / SEEDS as f64;
                    let square = lights.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
                    let tolerance = gatherer.tolerance_at(&to, mean);
                    sum += square / (SEEDS - 1) as f64 / tolerance.powi(2);
                    places += 1.0;
                }
                (sum / places).sqrt()
            };
            let [few, many] = [4.0, 1.0].map(&mut rms);
            assert!(few > 0.1 && many < 0.6 * few, "{few} {many}");
        });
    }
}
