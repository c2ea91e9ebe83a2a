//! What rays meet close by: the mean light of a leaf tells little about a point of it that lies in the gap behind a
//! cupboard, or inside something that another thing stands in, when the rest of the leaf lies in the open.
//!
//! There the point that a ray met gathers for itself: its reflected light is that of the leaf, times how much more or less
//! light reaches the point than the whole leaf,
//!
//! `B(p) = B (D(p) + B(q)) / H`
//!
//! with H the leaf's irradiance, B its reflected radiosity, D(p) the direct light of one lamp chosen at random or met by the next ray, and q the
//! point where that ray ends, which may be close by again (a path, as in Kajiya 1986). Of a diffuse sheet's light a share comes from behind: so
//! many paths go on from its other side. Only brightness follows the path: colours stay those of the leaf.
//! A path ends by chance once little of the light at its end gets back. After eight steps that took the light of leaves instead, a slit of 2 cm between
//! two sheets of a garage had up to ten times its light. As that fell by a third or more in every round, a bake at the default took three rounds
//! more for it, 100 s of 230.
//!
//! The number of paths follows from how much light leaves have there. To stop as soon as paths agree made such places dark: what is rare and bright
//! comes late.

use super::gatherer::{Gatherer, Memory};
use super::receiver::Receiver;
use crate::geometry::Hit;
use crate::geometry::sampling::{cosine_direction, hash, sequence02};
use crate::hierarchy::NONE;
use crate::link::Visibility;

/// A point of whose rays more than this share meet black backs lies inside something: then everything is close by.
const WITHIN: f64 = 1.0 / 16.0;
/// A path goes on for sure while this share of the light at its end gets back to where it began. Where less does it goes on by chance, and those that do
/// bring this share (Russian roulette, Arvo and Kirk 1990). With 1/32 files at `--error 1` are off by as much (a sunlit room and a living room, grey, two seeds), but a
/// garage of bright paints takes 1.25 times the CPU time; with 1 four rooms are off by 3 to 10 % more (two seeds), in .88 to 1 times the time.
const SURE: f64 = 0.5;
/// Steps of a path at the most.
const STEPS: u64 = 64;
/// Rays that meet something close by and are followed in a turn.
const FOLLOWED: usize = 64;

/// The light reflected at a point close by, by one path.
struct LightPath {
    /// Index of the path's sample.
    sample: u32,
    /// The point that the path has reached, while it goes on.
    end: Option<Receiver>,
    /// Share of the light there that gets back to the start, times what the path weighs.
    through: f64,
    /// What the path weighs.
    weight: f64,
    /// Light that got back to the start.
    sum: f64,
    /// Reflected brightness of the leaf at the start, times what the path weighs.
    leaf: f64,
}

impl LightPath {
    /// Ends the path by chance, where little light gets back from where it is.
    fn toss(&mut self, tosses: u64) {
        let sure = SURE * self.weight;
        if self.end.is_some() && self.through < sure {
            match sequence02(self.sample, tosses)[0] * sure < self.through {
                true => self.through = sure,
                false => self.end = None,
            }
        }
    }
}

impl Gatherer<'_> {
    /// Is a hit so near that its leaf tells little about it? `backs`: share of the rays that met black backs.
    pub(super) fn is_near(&self, leaf: u32, hit: &Hit, backs: f64) -> bool {
        let near = self.light.descent.near(leaf);
        hit.t < near || backs > WITHIN && near > 0.0
    }

    /// Reflected light of all points that rays, each of a `share` of the hemisphere, met close by, as a share of that of their leaves: by as many
    /// paths as make the standard error what it may be if light differs from path to path by as much as leaves have.
    pub(super) fn nearby(
        &self,
        hits: &[(u32, Hit)],
        to: &Receiver,
        (share, backs): (f64, f64),
        memory: &mut Memory,
    ) -> f64 {
        let bright = |hit: &(u32, Hit)| f64::from(self.light.bright_reflected[hit.0 as usize]);
        let light: Vec<f64> = hits.iter().map(bright).collect();
        let all: f64 = light.iter().sum();
        let carries = share * all;
        let worth = carries / (self.allowed_noise.nearby * self.tolerance_at(to, carries));
        let [least, most] = self.allowed_noise.paths;
        let paths = ((worth * worth).ceil() as usize).clamp(least, most);
        let count = paths.min(FOLLOWED).min(hits.len());
        let mut pairs = Vec::new();
        for turn in 0..paths.div_ceil(FOLLOWED) as u32 {
            // Other hits in every turn, as far as there are others.
            let some = chosen(&light, all, count, sequence02(turn, 0)[0]);
            let some = some.map(|(k, weight)| (hits[k], weight, weight * light[k]));
            self.paths_back(some, (to.seed, turn), backs, memory, &mut pairs);
        }
        believed(&pairs)
    }

    /// Follows some of the rays that met something close by, each with its weight and with the light of its leaf times that. Light that comes back, and that of the
    /// leaves, is added to the `pairs`.
    fn paths_back(
        &self,
        hits: impl Iterator<Item = ((u32, Hit), f64, f64)>,
        (seed, turn): (u64, u32),
        backs: f64,
        memory: &mut Memory,
        pairs: &mut Vec<[f64; 2]>,
    ) {
        let path = |(sample, ((leaf, hit), weight, bright))| {
            let mut path = LightPath {
                sample,
                end: None,
                through: weight,
                weight,
                sum: 0.0,
                leaf: bright,
            };
            self.set_out(&mut path, leaf, &hit, hash(!seed, 0));
            path
        };
        let mut paths: Vec<LightPath> = (turn * FOLLOWED as u32..).zip(hits).map(path).collect();
        // All paths advance one step at a time: rays from neighbouring places go together.
        for step in 0..STEPS {
            let tosses = hash(!seed, STEPS + 1 + step);
            paths.iter_mut().for_each(|path| path.toss(tosses));
            if paths.iter().all(|path| path.end.is_none()) {
                break;
            }
            let samples = |dimension: u64| hash(seed, 2 * step + dimension);
            self.light_ends(&mut paths, samples(1), memory);
            let last = |leaf, hit: &Hit| step + 1 == STEPS || !self.is_near(leaf, hit, backs);
            let sides = hash(!seed, step + 1);
            self.go_on(&mut paths, last, [samples(0), sides], memory);
        }
        pairs.extend(paths.iter().map(|path| [path.sum, path.leaf]));
    }

    /// Adds the direct light at the ends of paths; ends those where no light arrives.
    fn light_ends(&self, paths: &mut [LightPath], samples: u64, memory: &mut Memory) {
        let mut to_lamps = std::mem::take(&mut memory.to_lamps);
        memory.segments.clear();
        to_lamps.clear();
        for (k, path) in paths.iter_mut().enumerate() {
            let Some(to) = path.end else {
                continue;
            };
            let sample = sequence02(path.sample, samples);
            let lamps = self.one_lamp(&to, sample);
            for (bright, segment) in lamps.into_iter().flatten() {
                memory.segments.push(segment);
                to_lamps.push((k, path.through * bright));
            }
            path.sum += path.through * self.one_in_mirrors(&to, sample);
        }
        self.sight
            .blocked(&memory.segments, &Visibility::Crowded, &mut memory.blocked);
        memory.rays += memory.segments.len() as u64;
        let ways = memory.segments.iter().zip(&memory.blocked);
        for (&(k, bright), (segment, blocked)) in to_lamps.iter().zip(ways) {
            if !blocked {
                paths[k].sum += bright * self.dimmed(segment);
            }
        }
        memory.to_lamps = to_lamps;
    }

    /// Takes paths to where their next rays end. Paths that meet nothing end; so do those for which that was the `last` step,
    /// on a leaf whose reflected light is taken.
    fn go_on(
        &self,
        paths: &mut [LightPath],
        last: impl Fn(u32, &Hit) -> bool,
        [samples, sides]: [u64; 2],
        memory: &mut Memory,
    ) {
        for path in paths {
            let Some(to) = path.end.take() else {
                continue;
            };
            let way = cosine_direction(to.normal, sequence02(path.sample, samples));
            // One by one: such rays have too little in common for packets.
            let (start, ahead) = (to.point.as_vec3(), way.as_vec3());
            let mut next = self.sight.meet_one(start, ahead, to.plane);
            memory.rays += 1;
            let mirrored = next.and_then(|hit| self.sight.mirrored(start, ahead, &hit));
            if let Some(mirrored) = &mirrored {
                path.through *= self.left_by(Some(&self.along(&mirrored.route, self.steps())));
                next = mirrored.hit;
            }
            let found = next.and_then(|hit| Some((self.met_at(&hit)?, hit)));
            let Some(((leaf, place), hit)) = found else {
                continue;
            };
            if let (Some(glass), None) = (&self.glass, &mirrored) {
                path.through *= glass.brightness(start, start + ahead * hit.t);
            }
            let emitted = f64::from(self.light.bright_emitted[leaf as usize]);
            if emitted > 0.0 {
                let share = match mirrored {
                    None => self.share_of_met(&to, &hit),
                    Some(mirrored) => f64::from(u8::from(mirrored.image.is_none())),
                };
                path.sum += path.through * share * emitted;
            }
            if last(leaf, &hit) {
                let bright =
                    self.light.tilts.at(leaf, place) * self.light.bright_reflected[leaf as usize];
                path.sum += path.through * f64::from(bright);
            } else {
                self.set_out(path, leaf, &hit, sides);
            }
        }
    }

    /// A path goes on from a point that a ray met: of a sheet, from the side that its light comes from. It ends where no light arrives.
    fn set_out(&self, path: &mut LightPath, leaf: u32, hit: &Hit, sides: u64) {
        let mut to = self.receiver(leaf, hit);
        let mut arrival = self.light.arrival[leaf as usize];
        let behind = self.tree.behind(leaf);
        if let Some(&[own, across]) = self.light.sides.get(leaf as usize)
            && behind != NONE
        {
            arrival = own;
            if sequence02(path.sample, sides)[0] < f64::from(across) {
                to = to.turned(behind);
                arrival = self.light.sides[behind as usize][0];
            }
        }
        if arrival > 0.0 {
            path.through *= f64::from(self.light.bright_reflected[leaf as usize] / arrival);
            path.end = Some(to);
        }
    }

    /// The point that a ray met.
    fn receiver(&self, leaf: u32, hit: &Hit) -> Receiver {
        let [v, w] = hit.uv.map(f64::from);
        let entry = self.tree.met(hit) as usize;
        Receiver {
            point: (self.sight.mesh).at(hit.triangle as usize, [1.0 - v - w, v, w]),
            normal: self.tree.face_normal[entry],
            plane: self.tree.face_plane[entry],
            leaf: Some(leaf),
            seed: 0,
        }
    }
}

/// Some of what is close by, half of them evenly and half by their light, and what each then weighs: if all were chosen evenly, a few dark ones could stand for bright
/// ones with a path that meets a lamp. All of them, once, where that many are asked for. `all`: their light together.
fn chosen(light: &[f64], all: f64, count: usize, first: f64) -> impl Iterator<Item = (usize, f64)> {
    let mean = all / light.len() as f64;
    let part = move |k: usize| match count < light.len() && mean > 0.0 {
        true => 0.5 * (light[k] / mean + 1.0),
        false => 1.0,
    };
    let (mut k, mut upto) = (0, 0.0);
    (0..count).map(move |n| {
        let at = (n as f64 + first) / count as f64 * light.len() as f64;
        while upto + part(k) <= at && k + 1 < light.len() {
            upto += part(k);
            k += 1;
        }
        (k, 1.0 / part(k))
    })
}

/// Sum of the first numbers of all pairs as a share of the second, as far as it exceeds its noise (Stein's positive
/// part).
fn believed(pairs: &[[f64; 2]]) -> f64 {
    let leaves: f64 = pairs.iter().map(|p| p[1]).sum();
    if leaves <= 0.0 {
        return 1.0;
    }
    let ratio = pairs.iter().map(|p| p[0]).sum::<f64>() / leaves;
    let square = |p: &[f64; 2]| (p[0] - ratio * p[1]).powi(2);
    let noise = pairs.iter().map(square).sum::<f64>() / (leaves * leaves);
    let excess = ratio - 1.0;
    if excess * excess > noise {
        1.0 + excess - noise / excess
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::NO_PLANE;
    use crate::solve::{Effort, GatherQuality};
    use crate::transport::MOSTLY;
    use crate::transport::gatherer::AllowedNoise;
    use crate::transport::receiver::Gathered;
    use crate::transport::tests::{baked, middle};
    use glam::DVec3;

    /// With the rest alike, a vertex follows fewer.
    #[test]
    fn points_follow_more_paths_than_vertices() {
        let bake = baked("furnished.glb", 2);
        let leaves = bake.tree().leaves().step_by(17);
        let places: Vec<Receiver> = leaves.map(|leaf| middle(bake.tree(), leaf)).collect();
        bake.room.with_sight(|sight| {
            let points = GatherQuality::Full.allowed_noise();
            let at = |quality: GatherQuality| -> Vec<Gathered> {
                let AllowedNoise { nearby, paths, .. } = quality.allowed_noise();
                let gatherer = Gatherer {
                    allowed_noise: AllowedNoise {
                        nearby,
                        paths,
                        ..points
                    },
                    ..bake.gatherer(sight)
                };
                let memory = &mut Memory::default();
                places.iter().map(|to| gatherer.at(to, memory)).collect()
            };
            let points = at(GatherQuality::Full);
            let vertices = at(GatherQuality::Vertex(Effort::default()));
            let (mut more, mut fewer) = (0, 0);
            // What lies inside something is not gathered at a vertex.
            for (point, vertex) in points.iter().zip(&vertices).filter(|p| p.1.backs <= MOSTLY) {
                more += usize::from(point.rays > vertex.rays);
                fewer += usize::from(point.rays < vertex.rays);
            }
            assert!(more > 40 && fewer == 0, "{more} {fewer}");
        });
    }

    /// As rays over the hemisphere do: twice the light of leaves that are twice as bright there, none of those that are black.
    #[test]
    fn paths_end_on_leaves_that_are_not_even() {
        let bake = baked("furnished.glb", 2);
        let ends: Vec<Receiver> = (bake.tree().leaves().step_by(17))
            .map(|leaf| middle(bake.tree(), leaf))
            .collect();
        let arrived = |tilt: f32| -> f64 {
            let mut light = bake.light().clone();
            light.tilts.0.fill([tilt; 3]);
            bake.room.with_sight(|sight| {
                let gatherer = Gatherer {
                    light: &light,
                    ..bake.gatherer(sight)
                };
                let path = |(sample, &end): (u32, &Receiver)| LightPath {
                    sample,
                    end: Some(end),
                    through: 1.0,
                    weight: 1.0,
                    sum: 0.0,
                    leaf: 0.0,
                };
                let mut paths: Vec<LightPath> = (0..).zip(&ends).map(path).collect();
                gatherer.go_on(&mut paths, |_, _| true, [1, 2], &mut Memory::default());
                paths.iter().map(|path| path.sum).sum()
            })
        };
        let [none, even, twice] = [-1.0, 0.0, 1.0].map(arrived);
        assert!(even > 1.5 * none, "{even} {none}");
        assert!((twice - none - 2.0 * (even - none)).abs() < 1e-6 * twice);
    }

    /// Bright ones more often, none never, and what all bring is right in the mean.
    #[test]
    fn some_of_what_is_close_by_stand_for_all() {
        let light: Vec<f64> = (0..100).map(|k| f64::from(u8::from(k % 10 == 0))).collect();
        let (mut sum, mut bright, mut least) = ([0.0; 2], 0, f64::INFINITY);
        for turn in 0..1000 {
            let mut all = 0.0;
            for (k, weight) in chosen(&light, 10.0, 8, sequence02(turn, 0)[0]) {
                sum = [sum[0] + weight, sum[1] + weight * light[k]];
                bright += usize::from(light[k] > 0.0);
                all += weight * light[k];
            }
            least = f64::min(least, all);
        }
        // Eight of a hundred, of which ten bring 1; 11 of 20 choices are bright.
        assert!((sum[0] / 8000.0 - 1.0).abs() < 0.01, "{sum:?}");
        assert!((sum[1] / 800.0 - 1.0).abs() < 0.01, "{sum:?}");
        assert!((4300..4500).contains(&bright), "{bright}");
        assert!(least > 0.4, "{least}");
        let all: Vec<_> = chosen(&light, 10.0, 100, 0.7).collect();
        assert_eq!(all, (0..100).map(|k| (k, 1.0)).collect::<Vec<_>>());
        assert!(chosen(&[0.0; 9], 0.0, 3, 0.5).all(|(_, weight)| weight == 1.0));
    }

    /// While much of the light gets back they go on as they are; of those that bring less some go on for all, which bring it in the mean.
    #[test]
    fn paths_that_end_by_chance_are_made_up_for() {
        let to = Receiver {
            point: DVec3::ZERO,
            normal: DVec3::Y,
            plane: NO_PLANE,
            leaf: None,
            seed: 0,
        };
        const PATHS: u32 = 4096;
        for (share, weight) in [(0.9, 2.0), (SURE, 2.0), (0.2, 1.0), (0.01, 3.0), (0.0, 1.0)] {
            let path = |sample| LightPath {
                sample,
                end: Some(to),
                through: share * weight,
                weight,
                sum: 0.0,
                leaf: 0.0,
            };
            let mut paths: Vec<LightPath> = (0..PATHS).map(path).collect();
            paths.iter_mut().for_each(|path| path.toss(11));
            let on = || paths.iter().filter(|path| path.end.is_some());
            let wanted = f64::min(share / SURE, 1.0) * f64::from(PATHS);
            assert!((on().count() as f64 - wanted).abs() <= 2.0, "{share}");
            let all: f64 = on().map(|path| path.through).sum();
            let of = weight * f64::from(PATHS);
            assert!((all / of - share).abs() < 1e-3, "{share}: {}", all / of);
        }
    }

    #[test]
    fn what_does_not_stand_out_of_its_noise_is_not_believed() {
        assert_eq!(believed(&[]), 1.0);
        assert_eq!(believed(&[[1.0, 0.0]]), 1.0);
        assert_eq!(believed(&[[1.0, 1.0]; 8]), 1.0);
        assert_eq!(believed(&[[0.0, 1.0]; 8]), 0.0);
        assert_eq!(believed(&[[0.1, 1.0], [2.1, 1.0]]), 1.0);
        let pairs: Vec<_> = (0..64).map(|k| [f64::from(k % 2), 1.0]).collect();
        let half = believed(&pairs);
        assert!(half > 0.5 && half < 0.51, "{half}");
    }
}
