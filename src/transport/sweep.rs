//! Light at a point in cluttered rooms: lamps from the root, bright patches by links, all else by rays.

use super::gatherer::{Gatherer, Linked, Memory, RadiosityPart};
use super::hemisphere::{BEAM, Hemisphere};
use super::receiver::{Gathered, Receiver};
use super::via::Arrived;
use crate::geometry::Hit;
use crate::geometry::sampling::tangents;
use crate::hierarchy::NONE;
use crate::light::{Passage, Place, accumulate};
use crate::link::{POLYGONS, pattern};
use glam::{DVec3, Vec3};

/// What bright patches that bring less than a tolerance each may err by together if they are left to rays, in tolerances of a point; by a bound that is about three times
/// what those of a gallery lit by coves were measured to err by. While all of them were left to rays, chance at its points grew with the fineness of its links, from .48
/// dE00 in the third round to .79 and .94 in the fourth (two seeds), of 3 million links, and `--error 1` was not reached. With 32 and 16 the light of that round is stated
/// to be off by .67 and .48, with another seed by .81 and .52. With 16 a garage takes 1.16 to 1.3 times the CPU time; with 32 what is stated between vertices (another seed) is
/// .63 for .69 there, .62 for .66 in a home theatre, .63 for .64 in a living room and .37 for .42 in a sunlit room, in 1.09 to 1.25 times the time.
const LEFT_TO_RAYS: f64 = 16.0;

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
        self.bright(to, share, memory, out);
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

    /// Adds the reflected light of patches of which a ray, a `share` of the hemisphere, would bring more than a ray may, by links. Those that bring little are left
    /// to rays, as far as they may err together, see [`LEFT_TO_RAYS`].
    fn bright(&self, to: &Receiver, share: f64, memory: &mut Memory, out: &mut Gathered) {
        let allowed = self.tolerance_at(to, 1.0);
        let most = self.allowed_noise.glare * allowed / share;
        let (mut small, mut variance) = (std::mem::take(&mut memory.small), 0.0);
        small.clear();
        memory.open.extend(self.links(to));
        while let Some(linked) = memory.open.pop() {
            let k = linked.0 as usize;
            let brightest = f64::from(self.light.brightest[k]);
            // Most links are not that bright, and their patches need not be loaded.
            if brightest <= most {
                continue;
            }
            let node = self.tree.node(linked.0);
            if !self.can_see(to, node) {
                continue;
            }
            let factor = self.bound(to, node);
            if factor * brightest < self.tolerance {
                let by_rays =
                    share * factor * f64::from(self.light.bright_reflected[k]) * brightest;
                variance += by_rays;
                small.push((linked, by_rays));
            } else {
                self.take(linked, most, memory);
            }
        }
        let left = (LEFT_TO_RAYS * allowed).powi(2);
        if variance > left {
            small.sort_by(|a, b| b.1.total_cmp(&a.1));
            let mut small = small.iter();
            while variance > left
                && let Some(&(linked, by_rays)) = small.next()
            {
                self.take(linked, most, memory);
                variance -= by_rays;
            }
            while let Some(linked) = memory.open.pop() {
                if f64::from(self.light.brightest[linked.0 as usize]) > most {
                    self.take(linked, most, memory);
                }
            }
        }
        memory.small = small;
        self.patches(to, RadiosityPart::Reflected, memory, out);
    }

    /// Takes a patch by its link if it is brighter than `most` as a whole; else its children are open.
    fn take(&self, (id, occlusion, v): Linked, most: f64, memory: &mut Memory) {
        let node = self.tree.node(id);
        let even = f64::from(self.light.bright_reflected[id as usize]) > most;
        if node.faces.1 <= POLYGONS && even || !self.has_parts(node) {
            memory.taken[id as usize] = memory.epoch;
            memory.any_taken = true;
            memory.stack.push((id, occlusion, v));
        } else {
            (memory.open).extend(node.child_range().map(|c| (c, occlusion, v)));
        }
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
                        // A ray may bring .02 of white.
                        let share =
                            gatherer.allowed_noise.glare * gatherer.tolerance_at(to, 1.0) / 0.02;
                        let to = Receiver { seed, ..*to };
                        gatherer.bright(&to, share, &mut memory, &mut out);
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

    /// However many links there are, and however little each of them carries.
    #[test]
    fn small_bright_patches_left_to_rays_err_by_no_more_than_they_may_together() {
        fn is_taken(tree: &Tree, id: u32, memory: &Memory) -> bool {
            memory.taken[id as usize] == memory.epoch
                || (tree.node(id).child_range()).any(|child| is_taken(tree, child, memory))
        }
        let bake = baked("furnished.glb", 2);
        let tree = bake.tree();
        let (mut small, mut taken) = (0, 0);
        bake.room.with_sight(|sight| {
            let gatherer = bake.gatherer(sight);
            let share = 1.0 / 4.0;
            let mut memory = Memory::default();
            for leaf in tree.leaves().step_by(37) {
                let to = middle(tree, leaf);
                memory.begin(tree.nodes.len());
                gatherer.bright(&to, share, &mut memory, &mut Gathered::dark());
                let left =
                    (memory.small.iter()).filter(|(linked, _)| !is_taken(tree, linked.0, &memory));
                let (count, variance) =
                    left.fold((0, 0.0), |(n, sum), (_, by_rays)| (n + 1, sum + by_rays));
                let allowed = LEFT_TO_RAYS * gatherer.tolerance_at(&to, 1.0);
                assert!(
                    variance <= allowed * allowed * (1.0 + 1e-9),
                    "{leaf}: {variance}"
                );
                small += memory.small.len();
                taken += memory.small.len() - count;
            }
        });
        assert!(taken > small / 100 && taken < small, "{taken} of {small}");
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
