//! How much of a room anybody can look at.
//!
//! Light gets into the gap behind a cupboard and into a closed drawer, and no eye does: there is no room for one. A surface counts in full from where a part of
//! what it faces is about as far away as things in the room are from each other; in proportion where less is. Of a garage's 257 m2 light reaches 199, and
//! 173 count; of a home theatre's 332 274 and 222, of a living room's 230 all and 208. In gaps light is hardest to find: in the garage a twentieth of all looks had
//! three quarters of the variance of them all.

use super::direct::receiver;
use super::room::Room;
use crate::geometry::sampling::{cosine_direction, hash, sequence02, triangle_weights};
use crate::hierarchy::{Counted, NONE, Tree, median};
use crate::link::Sight;
use glam::Vec3;
use rayon::prelude::*;

/// Afar is this share of the way that rays go from surface to surface, half of them further. With 1/16 and 1/4 a garage has 1 % more and 2 % less area where
/// paths come from afar and go on afar, a home theatre 2 % more and less.
const AFAR: f64 = 1.0 / 8.0;
/// Where this share of the rays goes afar, area counts in full. At `--error 1` a garage, a living room and a home theatre have 52,140, 45,414 and 56,857 vertices where all counts
/// that light reaches, 44,280, 40,485 and 53,776 so (in .77, .90 and .92 times the CPU time), and with 1/4 43,616, 38,977 and 53,171.
const SEEN: f64 = 1.0 / 8.0;
/// Rays from a point.
const RAYS: usize = 16;
/// Points of a leaf: as many as the room has this many times the area, from one to the most.
const POINTS: f64 = 4096.0;
const MOST_POINTS: f64 = 128.0;
/// A leaf is split for its hidden part only if that is more than this share of the room. With .01 light on a wall above the panels before its lower part, which then
/// counted in part, bent by .076 where .05 is seen in a finer mesh.
const WORTH: f64 = 0.0025;
/// Where less than this share of the room is hidden all of it counts: means would hardly change. It is .01 of a sunlit room, .02 of a curtained one, .026 of the Cornell box (below
/// its blocks), .04 to .14 of a canteen, a flat, a gallery, a living room, a restaurant and a dungeon.
const MUCH: f64 = 1.0 / 32.0;

/// How far rays go from a leaf: endless where they meet nothing, 0 where they meet a black back.
type Ways = Vec<[f32; RAYS]>;

impl Room {
    /// Which part of a hierarchy counts, given which part of it light reaches: what is seen of that. The hierarchy is that before any split.
    pub(super) fn viewed(&self, tree: &mut Tree, lit: Counted) -> Counted {
        let grown = tree.grown();
        tree.weigh(&lit);
        let all = tree.counted();
        let (mut splits, mut shares) = (lit.splits.clone(), Vec::new());
        let mut afar = None;
        loop {
            shares.resize(tree.nodes.len(), f32::NAN);
            let open: Vec<u32> = tree
                .leaves()
                .filter(|&k| shares[k as usize].is_nan())
                .collect();
            if open.is_empty() {
                break;
            }
            let ways: Vec<Ways> = self.with_sight(|sight| {
                let found = open
                    .par_iter()
                    .map(|&leaf| ways_from(tree, sight, leaf, all));
                found.collect()
            });
            let afar = *afar.get_or_insert_with(|| afar_in(tree, &open, &ways));
            for (leaf, ways) in open.into_iter().zip(ways) {
                let (share, node) = (share_seen(&ways, afar), tree.node(leaf));
                if node.is_leaf() && node.counted * (1.0 - share) > WORTH * all && share > 0.0 {
                    tree.subdivide(leaf);
                    splits.push(leaf);
                }
                let of_it = match tree.node(leaf) {
                    node if node.area > 0.0 => node.counted / node.area,
                    _ => 1.0,
                };
                shares[leaf as usize] = (share * of_it) as f32;
            }
        }
        let leaves = tree
            .leaves()
            .map(|k| (shares[k as usize], tree.node(k).area));
        let seen: f64 = leaves.map(|(share, area)| f64::from(share) * area).sum();
        let shares = tree.leaves().map(|k| shares[k as usize]).collect();
        tree.shrink(&grown);
        match all - seen < MUCH * all {
            true => lit,
            false => Counted { splits, shares },
        }
    }
}

/// Follows rays from points of a leaf of a room in which so much area counts.
fn ways_from(tree: &Tree, sight: &Sight, leaf: u32, all: f64) -> Ways {
    let counted = tree.node(leaf).counted;
    let points = (POINTS * counted / all.max(f64::MIN_POSITIVE)).ceil();
    let points = points.min(MOST_POINTS) as u32;
    let from_point = |k: u32| {
        let at = triangle_weights(sequence02(k, hash(u64::from(leaf), 0)));
        let to = receiver(tree, leaf, at, 0);
        let shift = hash(u64::from(leaf), u64::from(k) + 1);
        let directions: [Vec3; RAYS] = std::array::from_fn(|n| {
            cosine_direction(to.normal, sequence02(n as u32, shift)).as_vec3()
        });
        let mut hits = [None; RAYS];
        sight.meet(
            &[to.point.as_vec3(); RAYS],
            &directions,
            to.plane,
            &mut hits,
        );
        hits.map(|hit| match hit {
            Some(hit) if tree.met(&hit) == NONE => 0.0,
            Some(hit) => hit.t,
            None => f32::INFINITY,
        })
    };
    (0..points).map(from_point).collect()
}

/// What is afar in a room, by one way from each point of its leaves.
fn afar_in(tree: &Tree, leaves: &[u32], ways: &[Ways]) -> f64 {
    let each = leaves.iter().zip(ways).flat_map(|(&leaf, ways)| {
        let weight = tree.node(leaf).counted / ways.len() as f64;
        ways.iter().map(move |ways| (f64::from(ways[0]), weight))
    });
    let each = each.filter(|(way, _)| *way > 0.0 && way.is_finite());
    median(each).map_or(0.0, |way| AFAR * way)
}

/// The share of a leaf that counts. All of what has no area that counts.
fn share_seen(ways: &Ways, afar: f64) -> f64 {
    let far = |way: &&f32| f64::from(**way) >= afar && **way > 0.0;
    let far = ways.iter().flatten().filter(far).count();
    match ways.is_empty() {
        true => 1.0,
        false => (far as f64 / (SEEN * (RAYS * ways.len()) as f64)).min(1.0),
    }
}
