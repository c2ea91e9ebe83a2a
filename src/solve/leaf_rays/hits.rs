//! What the rays of a leaf that looks for itself find.

use crate::geometry::Hit;
use crate::geometry::sampling::{hash, sequence02, tangents, triangle_weights};
use crate::hierarchy::{NONE, Tree};
use crate::light::close_by;
use crate::light::passed::{self, Passed, Steps};
use crate::link::Sight;
use crate::transport::hemisphere::{BEAM, Hemisphere};
use glam::Vec3;

/// Flag of a face or leaf met by a ray whose fellow (the other ray from its point) met no front.
pub(super) const ALONE: u32 = 1 << 31;
/// Flag of a face or leaf met by a ray whose fellow met a front close by.
pub(super) const BESIDE: u32 = 1 << 30;
/// The face or leaf without flags.
pub(super) const MET: u32 = BESIDE - 1;

/// Where a ray ended.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayEnd {
    /// Entry of the face, maybe with the flag [`ALONE`] or [`BESIDE`]; [`NONE`]: the ray left the room or met a black back.
    pub(super) entry: u32,
    /// Weights of the second and third corner, in 1/65536.
    pub(super) at: [u16; 2],
}

impl RayEnd {
    const NOWHERE: Self = Self {
        entry: NONE,
        at: [0; 2],
    };
}

/// What the rays of a leaf found.
#[derive(Default)]
pub(super) struct LeafHits {
    /// Where the rays ended.
    pub(super) ends: Vec<RayEnd>,
    /// The rays that pass panes or meet mirrors, with those panes and mirrors.
    pub(super) passed: Vec<(u32, Passed)>,
    /// The rays that went by mirrors in which lamps have no image.
    pub(super) lamps: Vec<u32>,
}

/// Casts the rays of a leaf: a rotated pattern of directions, two of them from each of points all over the leaf.
pub(super) fn look_from(
    tree: &Tree,
    leaf: u32,
    sight: &Sight,
    pattern: &Hemisphere,
    seed: u64,
) -> LeafHits {
    let node = tree.node(leaf);
    let element = &tree.elements[node.element as usize];
    let plane = tree.face_plane[element.face as usize];
    let pairs = RayPairs::new(leaf, pattern.len(), seed);
    let turn = hash(seed ^ 1, u64::from(leaf));
    let (sin, cos) = (std::f64::consts::TAU * sequence02(0, turn)[0]).sin_cos();
    let [x, y] = tangents(node.normal);
    let [x, y] = [x * cos + y * sin, y * cos - x * sin];
    let mut found = LeafHits {
        ends: Vec::with_capacity(pattern.len()),
        ..LeafHits::default()
    };
    let near = close_by(node.area);
    let mut is_near = Vec::with_capacity(pattern.len());
    let mut hits = [None; BEAM];
    let (mut from, mut directions) = ([Vec3::ZERO; BEAM], [Vec3::ZERO; BEAM]);
    for beam in pattern.beams() {
        for (k, d) in beam.iter().enumerate() {
            directions[k] = (x * d.x + y * d.y + node.normal * d.z).as_vec3();
            from[k] = element.at(pairs.start(found.ends.len() + k)).as_vec3();
        }
        sight.meet(&from, &directions, plane, &mut hits);
        if sight.panes.is_some() || sight.mirrors.is_some() {
            for (k, hit) in hits.iter_mut().enumerate() {
                found.go_on(sight, [from[k], directions[k]], k, hit);
            }
        }
        is_near.extend(hits.iter().map(|hit| hit.is_some_and(|hit| hit.t < near)));
        found.ends.extend(hits.iter().map(|hit| {
            let Some(hit) = hit else {
                return RayEnd::NOWHERE;
            };
            let [u, v] = hit.uv.map(|x| (x * 65536.0).clamp(0.0, 65535.0) as u16);
            let at = if hit.from_behind { [v, u] } else { [u, v] };
            match tree.met(hit) {
                NONE => RayEnd::NOWHERE,
                entry => RayEnd { entry, at },
            }
        }));
    }
    let fronts = found.ends.iter().map(|end| end.entry != NONE);
    let fronts: Vec<bool> = fronts.collect();
    for (k, end) in found.ends.iter_mut().enumerate() {
        let fellow = pairs.fellow(k);
        if fronts[k] && !fronts[fellow] {
            end.entry |= ALONE;
        } else if fronts[k] && is_near[fellow] {
            end.entry |= BESIDE;
        }
    }
    found
}

impl LeafHits {
    /// Notes what the `k`-th ray of the next beam passes, and where it ends if mirrors send it on.
    fn go_on(&mut self, sight: &Sight, [from, way]: [Vec3; 2], k: usize, hit: &mut Option<Hit>) {
        let ray = (self.ends.len() + k) as u32;
        let Some(first) = *hit else { return };
        let passed = match (sight.mirrored(from, way, &first), &sight.panes) {
            (Some(mirrored), glazing) => {
                *hit = mirrored.hit;
                if mirrored.image.is_none() {
                    self.lamps.push(ray);
                }
                passed::met(glazing.as_ref(), &mirrored.route, Steps::Coarse)
            }
            (None, Some(glazing)) => {
                passed::passed(glazing, from, from + first.t * way, Steps::Coarse)
            }
            _ => return,
        };
        if !passed.is_empty() {
            self.passed.push((ray, passed));
        }
    }
}

/// Which two rays of a leaf start from the same point: k and `k ^ mask`. The mask differs from leaf to leaf, so that the
/// two directions are unrelated.
pub(super) struct RayPairs {
    mask: usize,
    shift: u64,
}

impl RayPairs {
    /// The pairs of `count` rays, a power of two.
    pub(super) fn new(leaf: u32, count: usize, seed: u64) -> Self {
        let shift = hash(seed, u64::from(leaf));
        let others = (count as u64).saturating_sub(1).max(1);
        Self {
            mask: 1 + (hash(seed ^ 2, u64::from(leaf)) % others) as usize,
            shift,
        }
    }

    pub(super) fn fellow(&self, k: usize) -> usize {
        k ^ self.mask
    }

    /// The index of the point that ray `k` starts from: 0 to half the number of rays.
    pub(super) fn pair(&self, k: usize) -> usize {
        let top = 1 << self.mask.ilog2();
        let first = if k & top == 0 { k } else { self.fellow(k) };
        // Drops the bit that is 0 in the first of every pair.
        first & (top - 1) | first >> 1 & !(top - 1)
    }

    /// Weights of the point of the leaf that ray `k` starts from.
    pub(super) fn start(&self, k: usize) -> [f64; 3] {
        start(self.pair(k), self.shift)
    }
}

/// Weights of the `k`-th point of a leaf.
pub(super) fn start(k: usize, shift: u64) -> [f64; 3] {
    triangle_weights(sequence02(k as u32, shift))
}
