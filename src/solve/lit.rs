//! What counts of a room, found by paths of light from its lamps.
//!
//! Every path goes on from surface to surface whatever their reflectance, so that black walls count and bright ones do not count twice.
//! Light from outside lands on everything outside, and next to nothing of it in the room: where there is a sky, a sun or other parallel
//! light, all surfaces are lit. What counts of them is what can be looked at, see `views`.

use super::Bake;
use super::room::Room;
use crate::geometry::sampling::{Pcg, cosine_direction, hash};
use crate::hierarchy::{Counted, Frame, LandingPoint, NONE, Tree};
use crate::link::Sight;
use rayon::prelude::*;

/// Paths that tell whether anything is dark at all (a few milliseconds), and those that tell what is dark. With 1024 of the first a garage whose walls have outsides, 57 of
/// 257 m2, was lit throughout; with 65,536 of the others 193 m2 of it are lit for 199 with 32,768, and
/// 262 for 274 of a home theatre's 331.
const PATHS: [u32; 2] = [4096, 32_768];
/// Surfaces that a path meets: in closed rooms nearly all light has been everywhere by then.
const BOUNCES: usize = 5;
/// The part that counts gets a frame of its own if its half size is between these shares of the file's: single precision places things
/// that reach 10^5 half sizes of a room only to within 1 % of one, and where they cross the room is chance.
const SMALLER: [f64; 2] = [1e-5, 0.5];

/// The surfaces that errors of a bake are averaged over.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Averages {
    /// In words.
    pub over: &'static str,
    /// Area that counts, m2: where little light lands it counts in part.
    pub counted_m2: f64,
    /// All area, m2.
    pub area_m2: f64,
}

impl Bake {
    /// What errors are averaged over.
    pub fn averages(&self) -> Averages {
        let tree = self.tree();
        Averages {
            over: match self.room.is_lit_from_outside() {
                true => "all surfaces that can be looked at, by area, as light comes from outside",
                false => {
                    "surfaces that light of the lamps reaches and that can be looked at, by area"
                }
            },
            counted_m2: tree.counted(),
            area_m2: tree.nodes.first().map_or(0.0, |root| root.area),
        }
    }
}

impl Room {
    fn is_lit_from_outside(&self) -> bool {
        let mut lights = self.scene.lights.iter();
        lights.any(|light| light.kind.is_parallel() || light.kind.is_dome())
    }

    /// Which part of a hierarchy counts: what of the light reaches, and of that what anybody can look at.
    pub(super) fn count(&self, tree: &mut Tree) -> Counted {
        if tree.nodes.is_empty() {
            return Counted::default();
        }
        let lit = match self.is_lit_from_outside() {
            true => Counted::default(),
            false => self.lit(tree),
        };
        self.viewed(tree, lit)
    }

    /// Which part of a hierarchy light of the lamps reaches.
    fn lit(&self, tree: &mut Tree) -> Counted {
        let grown = tree.grown();
        let mut counted = Counted::default();
        for paths in PATHS {
            let landings = self.with_sight(|sight| self.landings(tree, sight, paths));
            tree.shrink(&grown);
            counted = tree.count(landings);
            if counted == Counted::default() {
                break;
            }
        }
        tree.shrink(&grown);
        counted
    }

    /// The frame of the part that counts, if most of the file lies outside it.
    pub(super) fn frame_of(&self, tree: &Tree) -> Option<Frame> {
        let [low, high] = tree.counted_box()?;
        let frame = Frame::of(low + self.mesh.centre, high + self.mesh.centre);
        let size = frame.half_size / self.mesh.half_size;
        (SMALLER[0] < size && size < SMALLER[1]).then_some(frame)
    }

    /// Where light of the lamps lands: paths are shared among lamps by flux.
    fn landings(&self, tree: &Tree, sight: &Sight, paths: u32) -> Vec<LandingPoint> {
        let lamps = self.sending(tree, &self.dense_lanes());
        let sums: Vec<f64> = (lamps.iter())
            .scan(0.0, |sum, lamp| {
                *sum += lamp.0[1];
                Some(*sum)
            })
            .collect();
        let Some(all) = sums.last() else {
            return Vec::new();
        };
        let path = |k: u32| {
            let target = (f64::from(k) + 0.5) / f64::from(paths) * all;
            let lamp = sums.partition_point(|&sum| sum <= target);
            let lamp = lamps[lamp.min(lamps.len() - 1)].1;
            let (mut from, mut direction, mut plane, _) = lamp.ray(self, tree, k);
            let mut random = Pcg::new(hash(29, u64::from(k)));
            let mut landed = Vec::with_capacity(BOUNCES);
            for _ in 0..BOUNCES {
                let hit = sight.meet_one(from.as_vec3(), direction.as_vec3(), plane);
                let Some(hit) = hit.filter(|hit| tree.met(hit) != NONE) else {
                    break;
                };
                let entry = tree.met(&hit);
                let [v, w] = hit.uv.map(f64::from);
                let [v, w] = if hit.from_behind { [w, v] } else { [v, w] };
                landed.push((entry, [1.0 - v - w, v, w]));
                let mut normal = tree.face_normal[entry as usize];
                // A sheet passes half of the paths to its other side.
                if tree.behind(tree.face_node[entry as usize]) != NONE && random.f64() < 0.5 {
                    normal = -normal;
                }
                from += direction * f64::from(hit.t);
                direction = cosine_direction(normal, [random.f64(), random.f64()]);
                plane = tree.face_plane[entry as usize];
            }
            landed
        };
        let landed: Vec<Vec<LandingPoint>> = (0..paths).into_par_iter().map(path).collect();
        landed.concat()
    }
}
