//! How leaves look out: what their rows must sum to, how much of their area looks out at all, and, in cluttered rooms,
//! what they see.
//!
//! In such rooms most links are partly hidden, and a link spreads what it finds out with a few rays over all the leaves
//! below its ends: dark corners get light that belongs elsewhere. So the leaves look for themselves, by rays with density
//! cos / pi from points of a leaf. The rays of a leaf stay the same from round to round; the leaves that they meet are
//! looked up anew.
//!
//! A leaf counts as far as others see it. Of a floor that a cupboard stands on, only the part beside the cupboard sends
//! light to anyone, and of a part that looks half into the open, every other ray does. With the openness o(x), the share
//! of the rays from x that meet fronts, the light of a leaf is the mean weighted by it, `H = int o(x) H(x) dx / int o(x)
//! dx`, and `A = int o(x) dx` its area. Both follow from the rays themselves: two start from each point, in directions
//! chosen independently, and each counts if the other met a front. All light that leaves of these areas send to fronts is
//! received by leaves: nothing need be scaled.

mod hits;
mod kept;
mod tilt;

use super::flux::Closed;
use super::tinted::Tints;
use crate::geometry::sampling::{cosine_direction, hash, sequence02};
use crate::hierarchy::{NONE, Tree, place_below};
use crate::light::rows::Rows;
use crate::light::{Place, Tilts, place};
use crate::link::Sight;
use crate::team::{Interrupt, Interrupted, Team};
use crate::transport::hemisphere::{BEAM, Hemisphere};
use glam::{DVec3, Vec3};
use hits::{ALONE, LeafHits, MET, RayEnd, RayPairs, look_from, start};
use rayon::prelude::*;

/// Rays that tell how much of a leaf's light meets fronts: for a leaf of mean area, the least, and the most.
const LEAF_RAYS: [usize; 3] = [64, 32, 1024];
/// A patch of which this many rays all met fronts is taken to be closed in.
const CERTAIN: usize = 1024;
/// Rays of a leaf that looks for itself: share of a point's for a leaf of mean area, and the least.
const LOOKING: (f64, usize) = (0.25, BEAM);
/// Least share of a leaf's area that counts as not covered.
const LEAST_BARE: f64 = 1e-3;
/// Leaves that a task looks at; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 64;
/// Rays that tell whether a point is covered.
const COVER_RAYS: usize = 4;
/// The rays of the leaves of a hierarchy, and what they tell of how the leaves look out.
#[derive(Debug, Clone, Default)]
pub(crate) struct LeafRays {
    /// For each node that is a leaf: share of its light that meets fronts. NaN elsewhere.
    pub target: Vec<f32>,
    /// For each node that is a leaf: share of its area that takes part. NaN elsewhere. Where leaves look for themselves this
    /// is the mean openness, else the share that nothing solid covers.
    pub bare: Vec<f32>,
    /// For each node: is it as good as certain that all its light meets fronts?
    certain: Vec<bool>,
    /// The ranks among which the rows of leaves are shared out: rays of other ranks' leaves are not here.
    pub(super) team: Team,
    /// Where the rays of this rank's leaves ended, leaf after leaf.
    ends: Vec<RayEnd>,
    /// Which panes those rays pass, and which mirrors they meet.
    pub(super) tints: Tints,
    /// Rays by mirrors in which lamps have no image, ascending: these also bring the emission of their ends.
    lamps: Vec<u32>,
    /// First end of each node's rays ([`NONE`] if they are another rank's), and how many there are.
    range: Vec<(u32, u32)>,
    /// The leaf of the present hierarchy at each end, maybe with flags (see `hits`); [`NONE`] where no front was met.
    met: Vec<u32>,
    /// Where on that leaf it lies.
    places: Vec<Place>,
    /// How bright that leaf is there, as a share of its mean.
    bright: Vec<f32>,
    /// How the light of leaves is tilted, see [`tilt`].
    pub(super) tilts: Tilts,
}

/// How much was known when it was taken down: nodes, rays, rays by mirrors, and the filters that rays pass.
pub(super) struct LeafRaysSize {
    nodes: usize,
    ends: usize,
    lamps: usize,
    filters: usize,
}

impl LeafRays {
    /// Takes all leaves for uncovered, and all their light to meet fronts, without looking.
    pub(super) fn open(&mut self, tree: &Tree) {
        self.bare = vec![1.0; tree.nodes.len()];
        self.target = vec![1.0; tree.nodes.len()];
    }

    /// Rays of which nothing is known yet, of the ranks of a team.
    pub(super) fn of_team(team: Team) -> Self {
        Self {
            team,
            ..Self::default()
        }
    }

    /// Casts rays out of new leaves. A leaf below one of which very many rays all met fronts casts none. Returns the
    /// rays cast.
    pub(super) fn extend(
        &mut self,
        tree: &Tree,
        sight: &Sight,
        closed: Closed,
        seed: u64,
        interrupt: &Interrupt,
    ) -> Result<u64, Interrupted> {
        let old = self.target.len();
        self.target.resize(tree.nodes.len(), f32::NAN);
        self.bare.resize(tree.nodes.len(), f32::NAN);
        if closed == Closed::Yes {
            self.target[old..].fill(1.0);
            self.bare[old..].fill(1.0);
            return Ok(0);
        }
        self.certain.resize(tree.nodes.len(), false);
        let mut open = Vec::new();
        for k in 0..tree.nodes.len() {
            let node = &tree.nodes[k];
            if !node.is_leaf() || !self.target[k].is_nan() {
                continue;
            }
            if node.parent != NONE && self.certain[node.parent as usize] {
                (self.target[k], self.bare[k], self.certain[k]) = (1.0, 1.0, true);
            } else {
                open.push(k);
            }
        }
        let mean = mean_area(tree);
        let escape = |&k: &usize| {
            let wanted = LEAF_RAYS[0] as f64 * (tree.nodes[k].counted / mean);
            let wanted = (wanted as usize).clamp(LEAF_RAYS[1], LEAF_RAYS[2]);
            escape_from(tree, k, sight, wanted.next_multiple_of(BEAM), seed)
        };
        let found: Result<Vec<Vec<[usize; 3]>>, _> = open
            .par_chunks(CHUNK)
            .map(|chunk| {
                interrupt
                    .check()
                    .map(|()| chunk.iter().map(escape).collect())
            })
            .collect();
        let mut cast = 0;
        for (k, [count, misses, covered]) in open.into_iter().zip(found?.into_iter().flatten()) {
            let bare = count - covered;
            self.bare[k] = bare as f32 / count as f32;
            self.target[k] = (bare - misses) as f32 / bare.max(1) as f32;
            self.certain[k] = misses + covered == 0 && count >= CERTAIN;
            cast += count as u64;
        }
        Ok(cast)
    }

    /// Lets new leaves look for themselves, each rank its own, and looks up where all rays end in the present hierarchy.
    /// Returns the rays cast by all ranks.
    pub(super) fn look(
        &mut self,
        tree: &Tree,
        sight: &Sight,
        hemisphere: &Hemisphere,
        seed: u64,
        interrupt: &Interrupt,
    ) -> Result<u64, Interrupted> {
        if self.range.len() == tree.nodes.len() {
            // A hierarchy only grows: with as many nodes it is the same one.
            return Ok(0);
        }
        let cast = self.cast(
            tree,
            sight,
            hemisphere,
            LOOKING.0,
            (seed, interrupt),
            |_| true,
        )?;
        self.find(tree, 0);
        Ok(cast)
    }

    /// Lets the new leaves that `is_wanted` names look for themselves, each rank its own, one of mean area by this `share` of the rays of a
    /// hemisphere. Returns the rays cast by all ranks.
    pub(super) fn cast(
        &mut self,
        tree: &Tree,
        sight: &Sight,
        hemisphere: &Hemisphere,
        share: f64,
        (seed, interrupt): (u64, &Interrupt),
        is_wanted: impl Fn(u32) -> bool,
    ) -> Result<u64, Interrupted> {
        self.target.resize(tree.nodes.len(), f32::NAN);
        self.bare.resize(tree.nodes.len(), f32::NAN);
        self.range.resize(tree.nodes.len(), (0, 0));
        let new: Vec<u32> = (0..tree.nodes.len() as u32)
            .filter(|&k| tree.node(k).is_leaf() && self.range[k as usize].1 == 0)
            .filter(|&k| is_wanted(k))
            .collect();
        let mean = mean_area(tree);
        let patterns: Vec<Hemisphere> = (0..)
            .map(|k| LOOKING.1 << k)
            .take_while(|&n| n <= hemisphere.len())
            .map(Hemisphere::new)
            .collect();
        let usual = share * hemisphere.len() as f64 / mean;
        let team = self.team;
        let own = new.iter().copied().filter(|&k| team.owns(k as usize));
        let own: Vec<u32> = own.collect();
        let parts: Result<Vec<Vec<LeafHits>>, _> = own
            .par_chunks(CHUNK)
            .map(|chunk| {
                interrupt.check()?;
                let each = |&leaf: &u32| {
                    let wanted = usual * tree.node(leaf).counted;
                    let pattern = patterns
                        .iter()
                        .find(|p| p.len() as f64 >= wanted)
                        .unwrap_or(hemisphere);
                    look_from(tree, leaf, sight, pattern, seed)
                };
                Ok(chunk.iter().map(each).collect())
            })
            .collect();
        let parts = parts?;
        let counts = |found: &LeafHits| {
            let fronts = found.ends.iter().filter(|end| end.entry != NONE).count();
            [fronts as u32, found.ends.len() as u32]
        };
        let counts: Vec<[u32; 2]> = parts.iter().flatten().map(counts).collect();
        let counts = team.merge(new.iter().map(|&k| k as usize), counts);
        let mut cast = 0;
        for (&leaf, [fronts, count]) in new.iter().zip(counts) {
            let k = leaf as usize;
            self.bare[k] = fronts as f32 / count as f32;
            self.target[k] = 1.0;
            self.range[k] = (NONE, count);
            cast += u64::from(count);
        }
        for (found, &leaf) in parts.into_iter().flatten().zip(&own) {
            let first = self.ends.len() as u32;
            self.range[leaf as usize].0 = first;
            if sight.panes.is_some() || sight.mirrors.is_some() {
                self.tints.extend(found.ends.len(), found.passed);
            }
            self.lamps.extend(found.lamps.iter().map(|ray| first + ray));
            self.ends.extend(found.ends);
        }
        Ok(cast)
    }

    /// Number of rays whose ends were looked up.
    pub(super) fn found(&self) -> usize {
        self.met.len()
    }

    /// Looks up which leaf lies at each end, from a ray on; a leaf found before is kept unless it was split.
    pub(super) fn find(&mut self, tree: &Tree, first: usize) {
        // Nodes lie far apart in memory, and the look-up needs only their children.
        let children: Vec<u32> = tree.nodes.iter().map(|node| node.child).collect();
        let stands = |met: u32| children[(met & MET) as usize] == NONE;
        let leaf_at = |end: &RayEnd| {
            let [v, w] = end.at.map(|x| f64::from(x) / 65536.0);
            let face = tree.face_node[(end.entry & MET) as usize];
            let (leaf, weights) = place_below(face, [1.0 - v - w, v, w], |k| children[k as usize]);
            (leaf | end.entry & !MET, place(weights))
        };
        let known = self.met.len();
        self.met.resize(self.ends.len(), NONE);
        self.places.resize(self.ends.len(), Place::default());
        self.bright.resize(self.ends.len(), 1.0);
        let found = (&mut self.met, &mut self.places, &mut self.bright);
        let rays = found.into_par_iter().zip(&self.ends).enumerate();
        rays.skip(first)
            .for_each(|(k, ((met, place, bright), end))| {
                if end.entry != NONE && !(k < known && stands(*met)) {
                    (*met, *place) = leaf_at(end);
                    *bright = self.tilts.at(*met & MET, *place);
                }
            });
    }

    /// Takes over how the light of leaves is tilted.
    pub(super) fn tilt_by(&mut self, tilts: Tilts) {
        self.tilts = tilts;
        let ends = (&self.met, &self.places).into_par_iter();
        let bright = ends.map(|(&met, &place)| self.tilts.at(met & MET, place));
        bright.collect_into_vec(&mut self.bright);
    }

    /// How much is known, for [`LeafRays::shrink`].
    pub(super) fn grown(&self) -> LeafRaysSize {
        LeafRaysSize {
            nodes: self.target.len(),
            ends: self.ends.len(),
            lamps: self.lamps.len(),
            filters: self.tints.filters(),
        }
    }

    /// Forgets the leaves that came since `to`, and which leaf lies at each end.
    pub(super) fn shrink(&mut self, to: &LeafRaysSize) {
        self.target.truncate(to.nodes);
        self.bare.truncate(to.nodes);
        self.certain.truncate(to.nodes);
        self.range.truncate(to.nodes);
        self.ends.truncate(to.ends);
        self.lamps.truncate(to.lamps);
        self.tints.shrink(to.ends, to.filters);
        self.met.clear();
    }

    /// Have leaves looked for themselves?
    pub(crate) fn looks(&self) -> bool {
        !self.range.is_empty()
    }

    /// Irradiance of each leaf by what its rays met, `nodes` being the radiosity of every patch: by leaf.
    pub(super) fn irradiance<const L: usize>(&self, leaves: &[u32], nodes: &Rows, out: &mut Rows) {
        // The flag is the highest bit, and set in [`NONE`] as well.
        let weight = |ray: usize, met| (met & ALONE == 0).then(|| self.bright[ray]);
        let share = |leaf| 1.0 / self.met(leaf).1;
        self.means::<L>(leaves, nodes, out, share, weight);
    }

    /// Irradiance of each leaf, by leaf, from lamps in mirrors that only rays find; `emitted` is the exitance of every patch. None
    /// where there are no such rays.
    pub(super) fn lamps_in_mirrors<const L: usize>(
        &self,
        leaves: &[u32],
        emitted: &Rows,
    ) -> Option<Rows> {
        if self.team.is_alone() && self.lamps.is_empty() {
            return None;
        }
        let weight = |ray: usize, met| {
            let own = met & ALONE == 0 && self.lamps.binary_search(&(ray as u32)).is_ok();
            own.then_some(1.0)
        };
        let share = |leaf| 1.0 / self.met(leaf).1;
        let mut out = Rows::zero(leaves.len(), L);
        self.means::<L>(leaves, emitted, &mut out, share, weight);
        Some(out)
    }

    /// Irradiance of each leaf as a whole, however much of it others see: by leaf, for the record of fluxes.
    pub(super) fn irradiance_of_whole<const L: usize>(
        &self,
        leaves: &[u32],
        nodes: &Rows,
        out: &mut Rows,
    ) {
        let weight = |ray: usize, met| (met != NONE).then(|| self.bright[ray]);
        let share = |leaf| 1.0 / self.ends_of(leaf).len().max(1) as f32;
        self.means::<L>(leaves, nodes, out, share, weight);
    }

    /// Sums, for each leaf, over the patches its rays met, by `weight` of a ray and what it met if these count, times `share`.
    fn means<const L: usize>(
        &self,
        leaves: &[u32],
        nodes: &Rows,
        out: &mut Rows,
        share: impl Fn(u32) -> f32 + Sync,
        weight: impl Fn(usize, u32) -> Option<f32> + Sync,
    ) {
        let nodes = nodes.all::<L>();
        let row = |leaf: u32| {
            let share = share(leaf);
            self.sum::<L>(leaf, nodes, &weight).map(|x| x * share)
        };
        let out = out.all_mut::<L>();
        if self.team.is_alone() {
            out.par_chunks_mut(CHUNK)
                .zip(leaves.par_chunks(CHUNK))
                .for_each(|(out, leaves)| {
                    for (out, &leaf) in out.iter_mut().zip(leaves) {
                        *out = row(leaf);
                    }
                });
            return;
        }
        let own = leaves.iter().filter(|&&k| self.team.owns(k as usize));
        let own: Vec<u32> = own.copied().collect();
        let rows: Vec<[f32; L]> = own.par_iter().map(|&leaf| row(leaf)).collect();
        self.team.merge_rows(leaves, &rows, out);
    }

    /// The sum over the patches that the rays of one of this rank's leaves met, by `weight`.
    fn sum<const L: usize>(
        &self,
        leaf: u32,
        nodes: &[[f32; L]],
        weight: impl Fn(usize, u32) -> Option<f32>,
    ) -> [f32; L] {
        let first = self.range[leaf as usize].0 as usize;
        let mut sum = [0.0_f32; L];
        for (ray, &met) in (first..).zip(self.ends_of(leaf)) {
            let Some(weight) = weight(ray, met) else {
                continue;
            };
            let row = &nodes[(met & MET) as usize];
            match self.tints.row::<L>(ray) {
                None => (sum.iter_mut().zip(row)).for_each(|(s, x)| *s += weight * x),
                Some(tint) => {
                    for ((s, x), t) in sum.iter_mut().zip(row).zip(tint) {
                        *s += weight * x * t;
                    }
                }
            }
        }
        sum
    }

    /// The patches met by those rays of a leaf that count, how bright each is where it was met, as a share of its mean, and the divisor of
    /// the sum over them for the leaf's irradiance.
    pub(super) fn met(&self, leaf: u32) -> (impl Iterator<Item = (u32, f32)>, f32) {
        let met = self.ends_of(leaf);
        let fronts = (self.bare[leaf as usize] * met.len() as f32).round();
        let first = self.range[leaf as usize].0 as usize;
        // The flag is the highest bit, and set in [`NONE`] as well.
        let counted = (first..).zip(met).filter(|(_, met)| **met & ALONE == 0);
        let tilted = counted.map(|(ray, met)| (met & MET, self.bright[ray]));
        (tilted, fronts.max(1.0))
    }

    fn ends_of(&self, leaf: u32) -> &[u32] {
        let (start, count) = self.range[leaf as usize];
        &self.met[start as usize..(start + count) as usize]
    }

    /// How much reflected light varies over a leaf: the standard deviation between its four quarters beyond the noise
    /// of their rays; `bright` is the brightness of every patch.
    pub(super) fn variation(&self, leaf: u32, bright: &[f32], seed: u64) -> f64 {
        let (first, count) = self.range[leaf as usize];
        let pairs = RayPairs::new(leaf, count as usize, seed);
        let mut sums = [[0.0_f64; 3]; 4];
        for k in 0..count as usize {
            // Points that see no fronts tell nothing.
            if self.met[first as usize + pairs.fellow(k)] == NONE {
                continue;
            }
            let b = match self.met[first as usize + k] {
                NONE => 0.0,
                met => f64::from(bright[(met & MET) as usize]),
            };
            let quarter = (pairs.start(k).iter()).position(|&w| w >= 0.5);
            let quarter = quarter.unwrap_or(3);
            let sum = &mut sums[quarter];
            *sum = [sum[0] + 1.0, sum[1] + b, sum[2] + b * b];
        }
        let (mut n, mut mean, mut square, mut noise) = (0.0, 0.0, 0.0, 0.0);
        for [count, sum, squares] in sums.into_iter().filter(|s| s[0] >= 2.0) {
            let m = sum / count;
            n += 1.0;
            mean += m;
            square += m * m;
            noise += (squares / count - m * m).max(0.0) / (count - 1.0);
        }
        if n < 2.0 {
            return 0.0;
        }
        let between = (square - mean * mean / n) / (n - 1.0);
        (between - noise / n).max(0.0).sqrt()
    }

    /// Bytes of the rows of this rank's leaves.
    pub(crate) fn row_bytes(&self) -> usize {
        self.tints.bytes() + (size_of::<RayEnd>() + size_of::<Place>() + 8) * self.ends.len()
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.row_bytes()
            + 8 * (self.range.len() + self.target.len())
            + size_of_val(self.tilts.0.as_slice())
    }

    /// The area of every node that takes part; never quite zero, as it is divided by.
    pub(super) fn areas(&self, tree: &Tree) -> Vec<f64> {
        let mut areas: Vec<f64> = tree.nodes.iter().map(|n| n.area).collect();
        for k in (0..areas.len()).rev() {
            let node = &tree.nodes[k];
            areas[k] = if node.is_leaf() {
                node.area * f64::from(self.bare[k]).max(LEAST_BARE)
            } else {
                node.child_range().map(|c| areas[c as usize]).sum()
            };
        }
        areas
    }
}

/// Mean counted area of the leaves.
fn mean_area(tree: &Tree) -> f64 {
    tree.counted() / tree.leaves().count().max(1) as f64
}

/// Casts `count` rays out of a leaf. Returns how many were cast, how many missed all fronts, and how many started where
/// something covers the leaf.
fn escape_from(tree: &Tree, leaf: usize, sight: &Sight, count: usize, seed: u64) -> [usize; 3] {
    let node = &tree.nodes[leaf];
    let element = &tree.elements[node.element as usize];
    let plane = tree.face_plane[element.face as usize];
    let (at, to) = (hash(seed, leaf as u64), hash(seed ^ 1, leaf as u64));
    let (mut misses, mut covered) = (0, 0);
    let mut hits = [None; BEAM];
    let (mut from, mut directions) = ([Vec3::ZERO; BEAM], [Vec3::ZERO; BEAM]);
    for beam in (0..count).step_by(BEAM) {
        for k in 0..BEAM {
            from[k] = element.at(start(beam + k, at)).as_vec3();
            let u = sequence02((beam + k) as u32, to);
            directions[k] = cosine_direction(node.normal, u).as_vec3();
        }
        sight.meet(&from, &directions, plane, &mut hits);
        for (hit, from) in hits.iter().zip(from) {
            match hit {
                Some(hit) if tree.met(hit) != NONE => {}
                Some(_) if is_covered(tree, sight, from, node.normal, plane) => covered += 1,
                _ => misses += 1,
            }
        }
    }
    [count, misses, covered]
}

/// Does a point see nothing but black backs? Then something solid stands on the point, or holds it.
fn is_covered(tree: &Tree, sight: &Sight, from: Vec3, normal: DVec3, plane: u32) -> bool {
    let mut hits = [None; COVER_RAYS];
    let directions: [Vec3; COVER_RAYS] =
        std::array::from_fn(|k| cosine_direction(normal, sequence02(k as u32, 0)).as_vec3());
    sight.meet(&[from; COVER_RAYS], &directions, plane, &mut hits);
    hits.iter()
        .all(|hit| hit.is_some_and(|hit| tree.met(&hit) == NONE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_of_a_leaf_start_in_pairs() {
        for (leaf, count) in (0..200).flat_map(|leaf| [(leaf, 16), (leaf, 64), (leaf, 256)]) {
            let pairs = RayPairs::new(leaf, count, 7);
            let mut rays = vec![Vec::new(); count / 2];
            for k in 0..count {
                rays[pairs.pair(k)].push(k);
            }
            for two in rays {
                assert!(matches!(two[..], [a, b] if pairs.fellow(a) == b && a != b));
            }
        }
    }

    /// Three points of a leaf, one covered and one half open: their light is weighted by openness.
    #[test]
    fn a_leaf_is_what_others_see_of_it() {
        let mut nodes = Rows::zero(3, 4);
        nodes.row_mut(1).fill(6.0);
        nodes.row_mut(2).fill(2.0);
        // Pairs of rays: both meet fronts; one does; none does.
        let leaf_rays = LeafRays {
            target: vec![1.0],
            bare: vec![0.5],
            range: vec![(0, 6)],
            met: vec![1, 2, 1 | ALONE, NONE, NONE, NONE],
            bright: vec![1.0; 6],
            ..LeafRays::default()
        };
        let (mut seen, mut whole) = (Rows::zero(1, 4), Rows::zero(1, 4));
        leaf_rays.irradiance::<4>(&[0], &nodes, &mut seen);
        leaf_rays.irradiance_of_whole::<4>(&[0], &nodes, &mut whole);
        // Openness 1, 1/2 and 0; irradiance (6 + 2) / 2, (6 + 0) / 2 and 0. Of the second point no pair counts.
        let near = |row: &[f32], want: f32| row.iter().all(|x| (x - want).abs() < 1e-6);
        assert!(near(seen.row(0), 8.0 / 3.0) && near(whole.row(0), 14.0 / 6.0));
    }

    /// Two rays end at corners of a leaf of radiosity 4, one on a leaf that is even.
    #[test]
    fn rays_bring_the_light_of_a_tilted_leaf_at_their_places() {
        let mut nodes = Rows::zero(3, 4);
        nodes.row_mut(1).fill(4.0);
        nodes.row_mut(2).fill(2.0);
        let mut leaf_rays = LeafRays {
            bare: vec![1.0],
            range: vec![(0, 4)],
            met: vec![1, 1, 2, NONE],
            places: vec![[0, 0], [255, 0], [0, 0], [0, 0]],
            ..LeafRays::default()
        };
        leaf_rays.tilt_by(Tilts(vec![[0.0; 3], [0.5, -0.25, -0.25], [0.0; 3]]));
        let (mut seen, mut whole) = (Rows::zero(1, 4), Rows::zero(1, 4));
        leaf_rays.irradiance::<4>(&[0], &nodes, &mut seen);
        leaf_rays.irradiance_of_whole::<4>(&[0], &nodes, &mut whole);
        let met: Vec<(u32, f32)> = leaf_rays.met(0).0.collect();
        assert_eq!(met, [(1, 1.5), (1, 0.75), (2, 1.0)]);
        assert_eq!([seen.row(0), whole.row(0)], [[11.0 / 4.0; 4]; 2]);
    }
}
