//! What the rays of a leaf that looks for itself find.

use super::{ALONE, End, Pairs};
use crate::geometry::Hit;
use crate::geometry::sampling::{hash, sequence02, tangents};
use crate::hierarchy::{NONE, Tree};
use crate::link::Sight;
use crate::solve::tinted::{self, Passed, passed};
use crate::transport::hemisphere::{BEAM, Hemisphere};
use glam::Vec3;

/// What the rays of a leaf found.
#[derive(Default)]
pub(super) struct Found {
    /// Where they ended.
    pub(super) ends: Vec<End>,
    /// What those pass that pass panes or meet mirrors.
    pub(super) passed: Vec<(u32, Passed)>,
    /// Those that went by mirrors in which lamps have no image.
    pub(super) lamps: Vec<u32>,
}

/// Casts the rays of a leaf: a turned pattern of directions, two from each of points all over it.
pub(super) fn look_from(
    tree: &Tree,
    leaf: u32,
    sight: &Sight,
    pattern: &Hemisphere,
    seed: u64,
) -> Found {
    let node = tree.node(leaf);
    let element = &tree.elements[node.element as usize];
    let plane = tree.face_plane[element.face as usize];
    let pairs = Pairs::new(leaf, pattern.len(), seed);
    let turn = hash(seed ^ 1, u64::from(leaf));
    let (sin, cos) = (std::f64::consts::TAU * sequence02(0, turn)[0]).sin_cos();
    let [x, y] = tangents(node.normal);
    let [x, y] = [x * cos + y * sin, y * cos - x * sin];
    let mut found = Found {
        ends: Vec::with_capacity(pattern.len()),
        ..Found::default()
    };
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
        found.ends.extend(hits.iter().map(|hit| {
            let Some(hit) = hit else { return End::NOWHERE };
            let [u, v] = hit.uv.map(|x| (x * 65536.0).clamp(0.0, 65535.0) as u16);
            let at = if hit.from_behind { [v, u] } else { [u, v] };
            match tree.met(hit) {
                NONE => End::NOWHERE,
                entry => End { entry, at },
            }
        }));
    }
    let fronts = found.ends.iter().map(|end| end.entry != NONE);
    let fronts: Vec<bool> = fronts.collect();
    for (k, end) in found.ends.iter_mut().enumerate() {
        if fronts[k] && !fronts[pairs.fellow(k)] {
            end.entry |= ALONE;
        }
    }
    found
}

impl Found {
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
                tinted::met(glazing.as_ref(), &mirrored.route)
            }
            (None, Some(glazing)) => passed(glazing, from, from + first.t * way),
            _ => return,
        };
        if !passed.is_empty() {
            self.passed.push((ray, passed));
        }
    }
}
