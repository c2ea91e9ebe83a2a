//! Lamps chosen at random: some that stand for all of far clusters, and one that stands for all of a room.

use super::gatherer::{Gatherer, Memory};
use super::lamp::{one_part, part_around, point_of, weight_at};
use super::luminaire;
use super::punctual::punctual_factor;
use super::receiver::{Gathered, Receiver};
use super::sweep::weights_on_face;
use crate::geometry::sampling::{hash, sequence02};
use crate::geometry::{Hit, NO_PLANE, Segment, lambert_triangles_x8};
use crate::hierarchy::NONE;
use crate::scene::LightKind;
use glam::DVec3;

/// Rays to far lamps, for as much of their light as may be misplaced at a point. No cluster brings more than that may be in a bright place. With 1, 4
/// and 16 at `--error 1` a gallery lit by coves has errors between vertices of .95, .91 and .90 (root mean square) and takes 22, 22 and 26 CPU seconds, a living
/// room 1.48, 1.28 and 1.46, and 40, 39 and 41.
const CHOSEN: f64 = 4.0;

/// A chosen lamp, the segment to it, and the factor from its exitance to irradiance by all lamps that it represents.
struct Chosen {
    element: u32,
    factor: f64,
    segment: Segment,
}

/// The cluster at a place on the line of what all of them carry, what it carries, and how far along it the place is, 0 to 1.
fn chosen_cluster(clusters: &[(u32, f64)], mut at: f64) -> (u32, f64, f64) {
    let mut k = 0;
    while k + 1 < clusters.len() && at >= clusters[k].1 {
        at -= clusters[k].1;
        k += 1;
    }
    let (id, carries) = clusters[k];
    (id, carries, (at / carries).clamp(0.0, 1.0 - f64::EPSILON))
}

impl Gatherer<'_> {
    /// Adds the light of far clusters of emitting elements, by some of the elements chosen at random: as many rays as all clusters
    /// together are worth.
    pub(super) fn lamps_by_chance(&self, to: &Receiver, memory: &mut Memory, out: &mut Gathered) {
        let far = std::mem::take(&mut memory.far);
        let all: f64 = far.iter().map(|cluster| cluster.1).sum();
        if all > 0.0 {
            let turn = hash(to.seed ^ 1, u64::from(far[0].0));
            let count = (CHOSEN * all / self.tolerance_at(to, 1.0)).ceil();
            let mut sums = [0.0; 2];
            for k in 0..count as u32 {
                let [u, v] = sequence02(k, turn);
                let (id, carries, u) = chosen_cluster(&far, u * all);
                let Some(chosen) = self.one_emitter(to, id, [u, v]) else {
                    continue;
                };
                memory.rays += 1;
                if self.blocks_one(&chosen.segment) {
                    continue;
                }
                let tint = self.through(&chosen.segment);
                let factor = chosen.factor * all / carries;
                let emitted = f64::from(self.light.bright_emitted[chosen.element as usize]);
                let bright = factor * emitted * self.left_by(tint.as_ref());
                sums = [sums[0] + bright, sums[1] + bright * bright];
                self.add_emitted(chosen.element, factor / count, tint.as_ref(), out);
            }
            let [mean, square] = sums.map(|sum| sum / count);
            memory.noise += (square - mean * mean).max(0.0) / count;
        }
        memory.far = far;
        memory.far.clear();
    }

    /// Brightness of the direct light at a point, from one punctual light and one emitting element, each chosen with about
    /// its share of the light as probability, provided nothing blocks the segments. An element that is not seen in a mirror counts only for what
    /// rays of [`share_of_met`](Self::share_of_met) leave: both together are without bias.
    pub(super) fn one_lamp(&self, to: &Receiver, [u, v]: [f64; 2]) -> [Option<(f64, Segment)>; 2] {
        let punctual = self.one_punctual(to, [u, v]).map(|(bright, end)| {
            let segment = Segment::new(to.point, end, [to.plane, NO_PLANE]);
            (bright, segment)
        });
        let room = self.light.lit.first().copied().unwrap_or(NONE);
        let emitter = self.one_emitter(to, room, [u, v]);
        let emitter = emitter.map(|chosen| {
            let emitted = f64::from(self.light.bright_emitted[chosen.element as usize]);
            let share = match self.via {
                None => 1.0 / (1.0 + chosen.factor),
                Some(_) => 1.0,
            };
            (share * chosen.factor * emitted, chosen.segment)
        });
        [punctual, emitter]
    }

    /// Chooses a punctual light: the brightness of all of them, and the end of the ray.
    fn one_punctual(&self, to: &Receiver, [u, v]: [f64; 2]) -> Option<(f64, DVec3)> {
        let far = self.one_direction(to, [u, v]);
        let lamps = self.lamps.iter().zip(&self.light.bright_lamps);
        let each: Vec<(f64, DVec3)> = lamps
            .filter_map(|((lamp, _), &bright)| {
                let (factor, end) = match (lamp.kind, lamp.kind.place().zip(far)) {
                    (_, Some((place, (d, factors)))) => {
                        (factors[place], to.point + d * self.distance())
                    }
                    (LightKind::Surface, _) => {
                        // The choice of a lamp must be independent of the choice of its point.
                        let turn = hash(u.to_bits() ^ v.to_bits().rotate_left(32), 0x73);
                        let at = sequence02(1, turn);
                        luminaire::whole(lamp, to, self.light.half_size, at)?
                    }
                    _ => punctual_factor(lamp, to, self.far())?,
                };
                Some((factor * f64::from(bright), end))
            })
            .collect();
        let all: f64 = each.iter().map(|(bright, _)| bright).sum();
        let mut left = v * all;
        let (_, end) = each.into_iter().find(|&(bright, _)| {
            left -= bright;
            left < 0.0
        })?;
        Some((all, end))
    }

    /// Chooses a point of an emitting element below a node; [`NONE`] stands for no node.
    fn one_emitter(&self, to: &Receiver, below: u32, [mut u, v]: [f64; 2]) -> Option<Chosen> {
        let (id, chance) = self.emitting_element(to, below, &mut u)?;
        let node = self.tree.node(id);
        let element = self.tree.element(node)?;
        let factors = lambert_triangles_x8(to.point, to.normal, [element.corners].into_iter());
        let factor = factors[0];
        let plane = self.tree.face_plane[element.face as usize];
        if factor <= 0.0 || plane == to.plane {
            return None;
        }
        let part = one_part(to, element.corners, factor, &mut u);
        let (point, weight) = point_of(to, node.normal, &[part], [u, v])?;
        (weight > 0.0).then(|| Chosen {
            element: id,
            factor: factor * weight / chance,
            segment: Segment::new(to.point, point, [to.plane, plane]),
        })
    }

    /// Chooses an emitting element below a node, and returns its probability; `u` can be used again. The choice descends
    /// the hierarchy (Conty Estevez and Kulla 2018).
    fn emitting_element(&self, to: &Receiver, below: u32, u: &mut f64) -> Option<(u32, f64)> {
        let fork = |id: u32| self.light.lit[id as usize];
        let mut id = Some(below).filter(|&id| id != NONE).map(fork)?;
        let mut chance = 1.0;
        if self.worth(to, id) <= 0.0 {
            return None;
        }
        // An element emits evenly, whatever its children.
        while self.tree.node(id).element == NONE {
            let worths = self.worths(to, id);
            let all: f64 = worths.iter().sum();
            let mut left = *u * all;
            let mut chosen = None;
            let children = self.tree.node(id).child_range().map(fork);
            for (child, worth) in children.zip(worths).filter(|c| c.1 > 0.0) {
                chosen = Some((child, worth, (left / worth).min(1.0 - f64::EPSILON)));
                if left < worth {
                    break;
                }
                left -= worth;
            }
            let (child, worth, rest) = chosen?;
            (id, *u, chance) = (child, rest, chance * worth / all);
        }
        Some((id, chance))
    }

    /// The share of a lamp's light that a ray of [`cosine_direction`](crate::geometry::sampling::cosine_direction) brings which met it, where lamps
    /// are chosen as well: the balance heuristic (Veach and Guibas 1995). What the choice brings weighs `1 / (1 + factor)`.
    pub(super) fn share_of_met(&self, to: &Receiver, hit: &Hit) -> f64 {
        let entry = self.tree.met(hit) as usize;
        let id = self.tree.face_node[entry];
        let node = self.tree.node(id);
        let Some(element) = self.tree.element(node) else {
            return 1.0;
        };
        let factors = lambert_triangles_x8(to.point, to.normal, [element.corners].into_iter());
        let chance = self.chance(to, id);
        if factors[0] <= 0.0 || chance <= 0.0 {
            return 1.0;
        }
        let weights = weights_on_face(hit);
        let part = part_around(to, element.corners, factors[0], weights);
        let point = element.at(weights);
        let factor = factors[0] * weight_at(to, node.normal, &part, point) / chance;
        factor / (1.0 + factor)
    }

    /// The probability with which [`emitting_element`](Self::emitting_element) chooses an element of all.
    fn chance(&self, to: &Receiver, element: u32) -> f64 {
        let (mut chance, mut chosen) = (1.0, element);
        let mut id = self.tree.node(element).parent;
        while id != NONE {
            if self.light.lit[id as usize] == id {
                let all: f64 = self.worths(to, id).iter().sum();
                if all <= 0.0 {
                    return 0.0;
                }
                chance *= self.worth(to, chosen) / all;
                chosen = id;
            }
            id = self.tree.node(id).parent;
        }
        chance
    }

    /// What the children of a node are worth; no node has more than four.
    fn worths(&self, to: &Receiver, id: u32) -> [f64; 4] {
        let mut worths = [0.0; 4];
        let children = self.tree.node(id).child_range();
        for (child, worth) in children.zip(&mut worths) {
            *worth = self.worth(to, self.light.lit[child as usize]);
        }
        worths
    }

    /// Roughly the light that a node brings; 0 for [`NONE`].
    fn worth(&self, to: &Receiver, id: u32) -> f64 {
        if id == NONE {
            return 0.0;
        }
        let node = self.tree.node(id);
        let emitted = f64::from(self.light.bright_emitted[id as usize]);
        if !self.can_see(to, node) {
            return 0.0;
        }
        let distance = (node.centre - to.point).length_squared();
        emitted * node.area / distance.max(node.radius * node.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::cosine_direction;
    use crate::light::brightness;
    use crate::transport::tests::{baked, middle};

    /// What the lamp brings that a ray meets, where lamps are chosen as well.
    fn light_met(gatherer: &Gatherer, to: &Receiver, k: u32) -> f64 {
        let way = cosine_direction(to.normal, sequence02(k, 1));
        let (start, ahead) = (to.point.as_vec3(), way.as_vec3());
        let hit = gatherer.sight.meet_one(start, ahead, to.plane);
        let met = hit.and_then(|hit| Some((gatherer.met(&hit)?, hit)));
        met.map_or(0.0, |(leaf, hit)| {
            let emitted = f64::from(gatherer.light.bright_emitted[leaf as usize]);
            gatherer.share_of_met(to, &hit) * emitted
        })
    }

    /// Lamps of which some stand for all, against all of them.
    #[test]
    fn far_lamps_by_chance_are_all_lamps_on_the_mean() {
        const SEEDS: u64 = 256;
        let bake = baked("furnished.glb", 1);
        let (mut off, mut sums) = (0.0, [0.0; 2]);
        bake.room.with_sight(|sight| {
            let exact = Gatherer {
                tolerance: 1e-6,
                ..bake.gatherer(sight)
            };
            let chance = Gatherer {
                tolerance: 1.0,
                ..bake.gatherer(sight)
            };
            let mut memory = Memory::default();
            let mut bright = |gatherer: &Gatherer, to: &Receiver| {
                let row = gatherer.direct(to, &mut memory);
                brightness(bake.lanes().tristimulus(&row), bake.light().white)
            };
            for leaf in bake.tree().leaves().step_by(97) {
                let to = |seed| Receiver {
                    seed,
                    ..middle(bake.tree(), leaf)
                };
                let want = bright(&exact, &to(0));
                let all: f64 = (0..SEEDS).map(|seed| bright(&chance, &to(seed))).sum();
                let mean = all / SEEDS as f64;
                off += (mean - want).abs();
                sums = [sums[0] + mean, sums[1] + want];
            }
        });
        assert!(sums[1] > 1.0 && off < 0.05 * sums[1], "{off} of {sums:?}");
        assert!((sums[0] / sums[1] - 1.0).abs() < 5e-3, "{sums:?}");
    }

    /// A lamp chosen and one met, against the exact sum over all lamps.
    #[test]
    fn one_lamp_by_chance_is_all_lamps_on_the_mean() {
        const SAMPLES: u32 = 1024;
        let bake = baked("furnished.glb", 1);
        assert!(!bake.lamps().is_empty());
        let (mut off, mut all) = (0.0, 0.0);
        bake.room.with_sight(|sight| {
            // So many rays that they have no noise.
            let gatherer = Gatherer {
                tolerance: 1e-6,
                ..bake.gatherer(sight)
            };
            let mut memory = Memory::default();
            let tree = bake.tree();
            for leaf in tree.leaves().step_by(97) {
                let to = Receiver {
                    seed: 0,
                    ..middle(tree, leaf)
                };
                let row = gatherer.direct(&to, &mut memory);
                let want = brightness(bake.lanes().tristimulus(&row), bake.light().white);
                let one = |k| {
                    gatherer
                        .one_lamp(&to, sequence02(k, 0))
                        .into_iter()
                        .flatten()
                };
                let open = (0..SAMPLES)
                    .flat_map(one)
                    .filter(|(_, segment)| !sight.blocks_one(segment));
                let chosen: f64 = open.map(|(bright, _)| bright).sum();
                let met: f64 = (0..SAMPLES).map(|k| light_met(&gatherer, &to, k)).sum();
                let mean = (chosen + met) / f64::from(SAMPLES);
                off += (mean - want).abs();
                all += want;
            }
        });
        assert!(all > 1.0 && off < 0.02 * all, "{off} of {all}");
    }

    /// In a corner of a room all of whose walls glow no sample exceeds what a wall gives: choices alone brought up to 320 times that,
    /// too seldom to be found by a vertex, which was dark.
    #[test]
    fn lamps_all_around_have_no_rare_light() {
        const SAMPLES: u32 = 1024;
        let bake = baked("furnace.glb", 1);
        let (tree, light) = (bake.tree(), bake.light());
        bake.room.with_sight(|sight| {
            let gatherer = bake.gatherer(sight);
            for leaf in tree.leaves().step_by(3) {
                let element = tree.element(tree.node(leaf)).unwrap();
                let emitted = f64::from(light.bright_emitted[leaf as usize]);
                let to = Receiver {
                    point: element.at([0.98, 0.01, 0.01]),
                    ..middle(tree, leaf)
                };
                let mut sum = 0.0;
                for k in 0..SAMPLES {
                    let lamps = gatherer.one_lamp(&to, sequence02(k, 0));
                    let chosen: f64 = lamps.into_iter().flatten().map(|lamp| lamp.0).sum();
                    let met = light_met(&gatherer, &to, k);
                    assert!(chosen.max(met) < emitted * (1.0 + 1e-6), "{chosen} {met}");
                    sum += chosen + met;
                }
                let mean = sum / f64::from(SAMPLES);
                assert!((mean / emitted - 1.0).abs() < 0.03, "{mean} of {emitted}");
            }
        });
    }
}
