//! Light at a point in cluttered rooms: lamps from the root, bright patches by links, all else by rays.

use super::gatherer::{Gatherer, Memory, RadiosityPart};
use super::hemisphere::{BEAM, Hemisphere};
use super::receiver::{Gathered, Receiver};
use super::via::Arrived;
use crate::geometry::Hit;
use crate::geometry::sampling::tangents;
use crate::hierarchy::NONE;
use crate::light::{Passage, Place, accumulate};
use crate::link::{POLYGONS, pattern};
use glam::{DVec3, Vec3};

/// What a bright patch brings at the least, in tolerances, by a bound, or it is left to rays. Links get finer from round to round, and a patch falls into many that each bring
/// little: while those below 1 were left to rays, chance in a gallery lit by coves grew with them, and two seeds of four did not get to `--error 1`. With ¼ one of four takes
/// a fourth round, of three times the time; with ⅛ none does, and `--error .5` (one seed) takes 100 CPU seconds, where 304 were not enough with 1. Other rooms take 1.09
/// (a garage), 1.05, 1.14 (a living room) and 1.02 times the CPU time that they take with 1; see `docs/decisions.md`.
const WORTH_A_LINK: f64 = 1.0 / 8.0;

impl Gatherer<'_> {
    /// Gathers at a point.
    pub(super) fn sweep(
        &self,
        to: &Receiver,
        hemisphere: &Hemisphere,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        memory.begin(self.tree.nodes.len());
        let mut met = std::mem::take(&mut memory.met);
        met.clear();
        let share = 1.0 / hemisphere.len() as f64;
        let mut escaped = std::mem::take(&mut memory.escaped);
        let mut tints = std::mem::take(&mut memory.tints);
        let mut mirrored = std::mem::take(&mut memory.mirrored);
        let mut tilts = std::mem::take(&mut memory.tilts);
        let ends = (&mut met, &mut tilts, &mut mirrored);
        let backs = self.cast(to, hemisphere, ends, &mut tints, &mut escaped);
        out.backs = share * backs as f64;
        (memory.met, memory.tints, memory.escaped) = (met, tints, escaped);
        (memory.mirrored, memory.tilts) = (mirrored, tilts);
        memory.rays += hemisphere.len() as u64;
        if out.backs > self.most_backs {
            return;
        }
        self.lamps_of(to, memory, out);
        self.lamps_in_mirrors(to, memory, out);
        // No ray may carry more than this.
        let most = self.allowed_noise.glare * self.tolerance_at(to, 1.0);
        self.bright(to, most * hemisphere.len() as f64, memory, out);
        for (x, d) in out.irradiance.iter_mut().zip(&out.direct) {
            *x += d;
        }
        self.punctual(to, memory, out);
        self.look(to, share as f32, memory, out);
        if self.sight.mirrors.is_some() {
            self.patches_in_mirrors(share as f32, memory, out);
            self.lights_in_mirrors(to, hemisphere.len(), memory, out);
        }
        let escaped = std::mem::take(&mut memory.escaped);
        self.outside(to, Some((&escaped, hemisphere.len())), true, memory, out);
        memory.escaped = escaped;
    }

    /// Adds the reflected light of patches brighter than `most` that bring enough, see [`WORTH_A_LINK`], by links.
    fn bright(&self, to: &Receiver, most: f64, memory: &mut Memory, out: &mut Gathered) {
        memory.open.extend(self.links(to));
        while let Some((id, occlusion, v)) = memory.open.pop() {
            let k = id as usize;
            let brightest = f64::from(self.light.brightest[k]);
            // Most links are not that bright, and their patches need not be loaded.
            if brightest <= most {
                continue;
            }
            let node = self.tree.node(id);
            if !self.can_see(to, node)
                || self.bound(to, node) * brightest < WORTH_A_LINK * self.tolerance
            {
                continue;
            }
            let even = f64::from(self.light.bright_reflected[k]) > most;
            if node.faces.1 <= POLYGONS && even || !self.has_parts(node) {
                memory.taken[k] = memory.epoch;
                memory.any_taken = true;
                memory.stack.push((id, occlusion, v));
            } else {
                memory
                    .open
                    .extend(node.child_range().map(|c| (c, occlusion, v)));
            }
        }
        self.patches(to, RadiosityPart::Reflected, memory, out);
    }

    /// Adds the reflected light of all other patches, by the rays cast over the hemisphere, each of a `share`.
    fn look(&self, to: &Receiver, share: f32, memory: &mut Memory, out: &mut Gathered) {
        let met = std::mem::take(&mut memory.met);
        let width = self.light.width();
        let tints = std::mem::take(&mut memory.tints);
        let tint = |ray: usize| tints.get(ray).and_then(Option::as_deref);
        let mut add = |leaf: u32, share: f32, ray: usize| {
            let row = self.light.reflected.row(leaf as usize);
            let filter = tint(ray).map(|passage| &passage.filter);
            accumulate(&mut out.irradiance[..width], share, row, filter);
        };
        let (mut near, mut near_rays) = (std::mem::take(&mut memory.near), Vec::new());
        near.clear();
        for (ray, &(leaf, hit)) in met.iter().enumerate() {
            // Rays that end on a patch gathered by its link bring nothing more.
            let taken = |id: u32| memory.taken[id as usize] == memory.epoch;
            if memory.any_taken && self.light.descent.upwards(leaf).any(taken) {
                continue;
            }
            out.seen += f64::from(share);
            if self.is_near(leaf, &hit, out.backs) {
                near.push((leaf, hit));
                near_rays.push(ray);
                continue;
            }
            let tilt = memory.tilts[ray];
            add(leaf, share * tilt, ray);
            if let Some(trace) = &mut out.trace {
                trace.hit(leaf, share, tilt, tint(ray));
            }
        }
        let how = (f64::from(share), out.backs);
        let near_share = share * self.nearby(&near, to, how, memory) as f32;
        for (&(leaf, _), ray) in near.iter().zip(near_rays) {
            add(leaf, near_share, ray);
            if let Some(trace) = &mut out.trace {
                trace.slope(leaf, near_share, tint(ray));
            }
        }
        (memory.met, memory.near, memory.tints) = (met, near, tints);
    }

    /// Casts the rays of a point. Finds which leaves they meet, straight or by way of mirrors, in which directions they leave the room, and how many
    /// meet black backs.
    fn cast(
        &self,
        to: &Receiver,
        hemisphere: &Hemisphere,
        (met, tilts, mirrored): (&mut Vec<(u32, Hit)>, &mut Vec<f32>, &mut Vec<Arrived>),
        tints: &mut Vec<Option<Box<Passage>>>,
        escaped: &mut Vec<DVec3>,
    ) -> usize {
        escaped.clear();
        tints.clear();
        tilts.clear();
        mirrored.clear();
        // Another seed rotates the pattern.
        let (sin, cos) = (pattern(to.seed, 0, 0)[0] * std::f64::consts::TAU).sin_cos();
        let [x, y] = tangents(to.normal);
        let [x, y] = [x * cos + y * sin, y * cos - x * sin];
        let from = [to.point.as_vec3(); BEAM];
        let mut hits = [None; BEAM];
        let mut directions = [Vec3::ZERO; BEAM];
        let mut backs = 0;
        for beam in hemisphere.beams() {
            for (out, d) in directions.iter_mut().zip(beam) {
                *out = (x * d.x + y * d.y + to.normal * d.z).as_vec3();
            }
            self.sight.meet(&from, &directions, to.plane, &mut hits);
            for (hit, d) in hits.iter().zip(&directions) {
                let Some(hit) = hit else {
                    if self.sky.is_some() {
                        escaped.push(d.as_dvec3());
                    }
                    continue;
                };
                if self.follow(from[0], *d, hit, mirrored) {
                    continue;
                }
                match self.met_at(hit) {
                    Some((leaf, place)) => {
                        met.push((leaf, *hit));
                        tilts.push(self.light.tilts.at(leaf, place));
                        if let Some(glass) = &self.glass {
                            let end = from[0] + *d * hit.t;
                            let tint = glass.through(from[0], end, self.steps());
                            tints.push(tint.map(Box::new));
                        }
                    }
                    None => backs += 1,
                }
            }
        }
        backs
    }

    /// The smallest patch of the solution at a hit; none on a back without a face.
    pub(super) fn met(&self, hit: &Hit) -> Option<u32> {
        self.met_at(hit).map(|(leaf, _)| leaf)
    }

    /// The same, and where on the patch the hit lies.
    pub(super) fn met_at(&self, hit: &Hit) -> Option<(u32, Place)> {
        let entry = self.tree.met(hit);
        if entry == NONE {
            return None;
        }
        let weights = weights_on_face(hit);
        Some(self.light.descent.place_at(self.tree, entry, weights))
    }
}

/// Barycentric weights of a hit on the face that it met; a back has its corners the other way round.
pub(super) fn weights_on_face(hit: &Hit) -> [f64; 3] {
    let [u, v] = hit.uv.map(f64::from);
    let first = 1.0 - u - v;
    if hit.from_behind {
        [first, v, u]
    } else {
        [first, u, v]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lambert_triangles_x8;
    use crate::hierarchy::Tree;
    use crate::light::brightness;
    use crate::transport::tests::{baked, middle};

    /// Light of bright patches whose rays are shared, against rays to each patch by itself: the plain version, which rooms of links use.
    #[test]
    fn shared_rays_to_bright_patches_find_what_rays_to_each_find() {
        const SEEDS: u64 = 64;
        for room in ["furnished.glb", "two-rooms.glb"] {
            let bake = baked(room, 1);
            bake.room.with_sight(|sight| {
                let shared = Gatherer {
                    tolerance: 2e-4,
                    ..bake.gatherer(sight)
                };
                assert!(shared.hemisphere.is_some());
                let each = Gatherer {
                    tolerance: shared.tolerance,
                    hemisphere: None,
                    ..bake.gatherer(sight)
                };
                let mut memory = Memory::default();
                let mut mean = |gatherer: &Gatherer, to: &Receiver| {
                    let at = |seed: u64| {
                        memory.begin(bake.tree().nodes.len());
                        let mut out = Gathered::dark();
                        gatherer.bright(&Receiver { seed, ..*to }, 0.02, &mut memory, &mut out);
                        let xyz = bake.lanes().tristimulus(&out.irradiance);
                        brightness(xyz, bake.light().white)
                    };
                    (0..SEEDS).map(at).sum::<f64>() / SEEDS as f64
                };
                let (mut off, mut sums) = (0.0, [0.0; 2]);
                for leaf in bake.tree().leaves().step_by(29) {
                    let to = Receiver {
                        leaf: None,
                        ..middle(bake.tree(), leaf)
                    };
                    let [one, other] = [mean(&shared, &to), mean(&each, &to)];
                    off += (one - other).abs();
                    sums = [sums[0] + one, sums[1] + other];
                }
                assert!(
                    sums[1] > 0.1 && off < 0.01 * sums[1],
                    "{room}: {off} of {sums:?}"
                );
                assert!((sums[0] / sums[1] - 1.0).abs() < 2e-3, "{room}: {sums:?}");
            });
        }
    }

    /// No leaf that would bring an eighth of a tolerance is left to rays that would each bring more than a ray may.
    #[test]
    fn bright_patches_left_to_rays_are_worth_no_link() {
        fn leaves(tree: &Tree, id: u32, to: &mut Vec<u32>) {
            let children = tree.node(id).child_range();
            if children.is_empty() {
                to.push(id);
            }
            children.for_each(|child| leaves(tree, child, to));
        }
        let bake = baked("furnished.glb", 2);
        let (tree, light) = (bake.tree(), bake.light());
        let (mut left, mut taken) = (0, 0);
        bake.room.with_sight(|sight| {
            let gatherer = bake.gatherer(sight);
            let mut memory = Memory::default();
            for leaf in tree.leaves().step_by(37) {
                let to = middle(tree, leaf);
                // As if there were four rays.
                let most = 4.0 * gatherer.allowed_noise.glare * gatherer.tolerance_at(&to, 1.0);
                memory.begin(tree.nodes.len());
                gatherer.bright(&to, most, &mut memory, &mut Gathered::dark());
                let mut linked = Vec::new();
                for link in gatherer.links(&to) {
                    leaves(tree, link.0, &mut linked);
                }
                for from in linked {
                    let (node, bright) = (tree.node(from), light.bright_reflected[from as usize]);
                    if f64::from(bright) <= most || !gatherer.can_see(&to, node) {
                        continue;
                    }
                    let is_taken = |id: u32| memory.taken[id as usize] == memory.epoch;
                    if light.descent.upwards(from).any(is_taken) {
                        taken += 1;
                        continue;
                    }
                    let corners = tree.element(node).unwrap().corners;
                    let [factor, ..] =
                        lambert_triangles_x8(to.point, to.normal, [corners].into_iter());
                    let brings = factor * f64::from(bright);
                    assert!(
                        brings < gatherer.tolerance / 8.0,
                        "{leaf}, {from}: {brings}"
                    );
                    left += 1;
                }
            }
        });
        assert!(left > 100 && taken > 100, "{left} left, {taken} taken");
    }

    /// Light that rises evenly across the room, leaf after leaf: rays bring that of the places where they end.
    #[test]
    fn rays_bring_the_light_of_where_they_end() {
        let bake = baked("furnished.glb", 1);
        let (tree, mesh) = (bake.tree(), bake.mesh());
        let mut light = bake.light().clone();
        assert!(light.tilts.0.iter().flatten().any(|&tilt| tilt > 0.0));
        let rise = |p: DVec3| 2.0 + p.dot(DVec3::new(0.4, 0.9, -0.5)) / mesh.half_size;
        for leaf in tree.leaves() {
            let corners = tree.element(tree.node(leaf)).unwrap().corners.map(rise);
            let mean = corners.iter().sum::<f64>() / 3.0;
            light.reflected.row_mut(leaf as usize).fill(mean as f32);
            light.tilts.0[leaf as usize] = corners.map(|b| (b / mean - 1.0) as f32);
        }
        bake.room.with_sight(|sight| {
            let gatherer = Gatherer {
                light: &light,
                ..bake.gatherer(sight)
            };
            let hemisphere = gatherer.hemisphere.unwrap();
            let share = 1.0 / hemisphere.len() as f32;
            for leaf in tree.leaves().step_by(97) {
                let to = middle(tree, leaf);
                let mut memory = Memory::default();
                memory.begin(tree.nodes.len());
                let ends = (&mut memory.met, &mut memory.tilts, &mut Vec::new());
                gatherer.cast(&to, hemisphere, ends, &mut Vec::new(), &mut Vec::new());
                // What is close by is found by paths.
                let met = std::mem::take(&mut memory.met).into_iter();
                let tilted = met.zip(std::mem::take(&mut memory.tilts));
                let far = tilted.filter(|((leaf, hit), _)| !gatherer.is_near(*leaf, hit, 0.0));
                (memory.met, memory.tilts) = far.unzip();
                let at = |hit: &Hit| {
                    let face = tree.node(tree.face_node[tree.met(hit) as usize]);
                    rise(tree.element(face).unwrap().at(weights_on_face(hit)))
                };
                let wanted: f64 = memory.met.iter().map(|(_, hit)| at(hit)).sum();
                let mut out = Gathered::dark();
                gatherer.look(&to, share, &mut memory, &mut out);
                let off = f64::from(out.irradiance[0]) - f64::from(share) * wanted;
                assert!(off.abs() < 1e-3, "{leaf}: {off}");
            }
        });
    }

    /// With as many paths as the light is worth, against a single turn and a great many.
    #[test]
    fn light_of_what_lies_close_by_is_less_noisy_by_more_paths() {
        const SEEDS: u64 = 16;
        let bake = baked("furnished.glb", 2);
        bake.room.with_sight(|sight| {
            let with = |tolerance: f64| Gatherer {
                tolerance,
                ..bake.gatherer(sight)
            };
            let fine = with(bake.gatherer(sight).tolerance / 8.0);
            let (many, few) = (with(1e-9), with(f64::INFINITY));
            let mut fewest = with(f64::INFINITY);
            fewest.allowed_noise.paths[0] /= 8;
            let hemisphere = fine.hemisphere.unwrap();
            let share = 1.0 / hemisphere.len() as f64;
            let mut memory = Memory::default();
            let (mut places, mut off, mut rays) = (0, [0.0; 2], [0; 2]);
            for leaf in bake.tree().leaves().step_by(17) {
                let to = middle(bake.tree(), leaf);
                let mut met = Vec::new();
                let ends = (&mut met, &mut Vec::new(), &mut Vec::new());
                let backs = fine.cast(&to, hemisphere, ends, &mut Vec::new(), &mut Vec::new());
                let how = (share, share * backs as f64);
                met.retain(|(leaf, hit)| fine.is_near(*leaf, hit, how.1));
                if met.len() < 64 {
                    continue;
                }
                for (rays, gatherer) in rays.iter_mut().zip([&few, &fewest]) {
                    let before = memory.rays;
                    gatherer.nearby(&met, &to, how, &mut memory);
                    *rays += memory.rays - before;
                }
                let mut light = |gatherer: &Gatherer, seed: u64| {
                    gatherer.nearby(&met, &Receiver { seed, ..to }, how, &mut memory)
                };
                let mut all = |gatherer: &Gatherer, first: u64| -> Vec<f64> {
                    let seeds = first..first + SEEDS;
                    seeds.map(|seed| light(gatherer, seed)).collect()
                };
                let truth = all(&many, 0).iter().sum::<f64>() / SEEDS as f64;
                // Where leaves tell it themselves, few paths change nothing.
                if (truth - 1.0).abs() < 0.2 {
                    continue;
                }
                let bright =
                    |hit: &(u32, Hit)| f64::from(bake.light().bright_reflected[hit.0 as usize]);
                let carries = share * met.iter().map(bright).sum::<f64>();
                let visible = carries / fine.tolerance_at(&to, carries);
                for (off, gatherer) in off.iter_mut().zip([&fine, &few]) {
                    let lights = all(gatherer, SEEDS).into_iter();
                    let each = lights.map(|light| visible * (light - truth).abs());
                    *off += each.sum::<f64>() / SEEDS as f64;
                }
                places += 1;
            }
            assert!(places > 40 && off[0] < 0.6 * off[1], "{places} {off:?}");
            // Light that is worth nothing is followed by as few paths as is asked for at the least.
            assert!(rays[0] > 6 * rays[1], "{rays:?}");
        });
    }
}
