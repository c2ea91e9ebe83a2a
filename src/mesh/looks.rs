//! Looks at light: each place with its normal is gathered once, whichever triangles ask for it.

use crate::gather::{MOSTLY, Vertex};
use crate::geometry::Segment;
use crate::geometry::sampling::hash;
use crate::solve::effort::typical;
use crate::solve::{Bake, Effort, GatherQuality};
use crate::transport::{Gathered, Receiver};
use glam::DVec3;
use std::collections::HashMap;

/// Places closer than this share of the room's half diagonal are the same.
const SAME_PLACE: f64 = 1e-7;
/// Normals that differ by less than this in each component are the same.
const SAME_NORMAL: f64 = 1e-4;
/// A place below a black back that is darker than this share of the white counts as inside the thing that the back
/// belongs to.
pub(crate) const DIM: f64 = 0.05;
/// Distinguishes the rays of looks from those of others.
const SEED: u64 = 0x006c_6f6f_6b73;
/// Places gathered at a time, so that progress shows and an interrupt is noticed: a look takes up to a millisecond in a dungeon of many
/// lamps, and with eight times as many the gather went on for 12 to 20 s after Ctrl-C on two busy cores.
const PART: usize = 2048;

/// The light at a place.
#[derive(Debug)]
pub(crate) struct PlaceLight {
    /// Irradiance by lane.
    pub(crate) row: Box<[f32; 64]>,
    /// Tristimulus irradiance.
    pub(crate) xyz: [f64; 3],
    /// Where the light comes from, if kept.
    pub(crate) trace: Option<Box<[u8]>>,
}

/// Place and normal, rounded; space; is the light of its leaf taken as it is? And the material of a diffuse sheet, whose light is
/// shown with what passes it, or of a fluorescent surface, on which exciting light also counts.
type LookKey = ([i64; 6], (u32, bool), bool, Option<u32>);

/// All looks so far.
pub(crate) struct Looks<'a> {
    bake: &'a Bake,
    quality: GatherQuality,
    /// The area that is worth the usual effort.
    typical: f64,
    /// Is it time to end?
    late: &'a (dyn Fn() -> bool + Sync),
    /// Is everything looked at nevertheless?
    pub(crate) patient: bool,
    /// Is the light of the leaves used as it is?
    pub(crate) believing: bool,
    /// Is direct light of lamps left out?
    pub(crate) indirect: bool,
    spaces: Vec<(u32, bool)>,
    /// Looks at a place: one for each side of what stands there.
    known: HashMap<LookKey, Vec<u32>>,
    places: Vec<(Receiver, bool)>,
    /// The area that each look stands for, as far as it was known before the look; 0 where it is not known.
    areas: Vec<f64>,
    /// None: something solid covers the place, or lies right upon it.
    seen: Vec<Option<PlaceLight>>,
    pub(crate) rays: u64,
}

impl<'a> Looks<'a> {
    pub(crate) fn new(
        bake: &'a Bake,
        spaces: Vec<(u32, bool)>,
        quality: GatherQuality,
        late: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        let leaves = bake.light().leaves.iter();
        Self {
            bake,
            quality,
            typical: typical(leaves.map(|&leaf| bake.tree().node(leaf).counted)),
            late,
            patient: false,
            believing: false,
            indirect: false,
            spaces,
            known: HashMap::new(),
            places: Vec::new(),
            areas: Vec::new(),
            seen: Vec::new(),
            rays: 0,
        }
    }

    /// Asks for a look at a vertex and returns its number. The look is done by [`Looks::complete`].
    pub(crate) fn want(&mut self, vertex: &Vertex, surface: usize, back: bool) -> u32 {
        let to = self.bake.receiver(vertex, surface, back);
        self.ask(vertex, to)
    }

    /// [`Looks::want`] for a texel of a light map, which is moved only at edges.
    pub(crate) fn want_texel(&mut self, vertex: &Vertex, surface: usize, back: bool) -> u32 {
        let to = self.bake.texel(vertex, surface, back);
        self.ask(vertex, to)
    }

    fn ask(&mut self, vertex: &Vertex, to: Receiver) -> u32 {
        let mesh = self.bake.mesh();
        let place =
            self.bake.place_of(vertex) / (SAME_PLACE * mesh.half_size.max(f64::MIN_POSITIVE));
        let round = |x: DVec3| x.to_array().map(|x| x.round() as i64);
        let ([x, y, z], [i, j, k]) = (round(place), round(to.normal / SAME_NORMAL));
        let space = self.spaces.get(vertex.entry as usize);
        let (space, believing) = (space.copied().unwrap_or_default(), self.believing);
        let material = mesh.material[vertex.triangle as usize];
        let of = &self.bake.scene().materials[material as usize];
        let apart = of.sheet.is_some() || of.fluorescence.is_some();
        let own = apart.then_some(material);
        let key = ([x, y, z, i, j, k], space, believing, own);
        let of_place = self.known.entry(key).or_default();
        let places = &mut self.places;
        let joined = |look: &&u32| !parted(self.bake, &places[**look as usize].0, &to);
        if let Some(look) = of_place.iter().find(joined) {
            return *look;
        }
        let look = places.len() as u32;
        // Looks have rays of their own, so that they err independently. In pictures on the way, which have few rays, and where what they differ by is not evened
        // out, neighbours err alike.
        let seed = match self.quality {
            GatherQuality::Preview => to.seed,
            _ => hash(u64::from(look), SEED ^ self.bake.settings().seed),
        };
        places.push((Receiver { seed, ..to }, believing));
        self.areas.push(0.0);
        of_place.push(look);
        look
    }

    fn seen_as(&self, to: &Receiver, row: [f32; 64], trace: Option<Box<[u8]>>) -> PlaceLight {
        let lanes = self.bake.lanes();
        let mut xyz = lanes.tristimulus(&row);
        if lanes.excites().is_some() && self.fluoresces(to) {
            let excited = lanes.excited(&row);
            xyz = std::array::from_fn(|c| xyz[c] + excited[c]);
        }
        PlaceLight {
            xyz,
            row: Box::new(row),
            trace,
        }
    }

    /// Does a place lie on a fluorescent surface?
    fn fluoresces(&self, to: &Receiver) -> bool {
        let (tree, mesh) = (self.bake.tree(), self.bake.mesh());
        to.leaf.is_some_and(|leaf| {
            let triangle = tree.face_of(leaf).triangle as usize;
            let material = &self.bake.scene().materials[mesh.material[triangle] as usize];
            material.fluorescence.is_some()
        })
    }

    /// Asks for another look at a vertex, with its own pattern of rays, in any case; returns the number of the look.
    pub(crate) fn again(&mut self, vertex: &Vertex, surface: usize, back: bool, seed: u64) -> u32 {
        let to = self.bake.receiver(vertex, surface, back);
        self.once(Receiver { seed, ..to })
    }

    /// [`Looks::again`] for a place of a light map.
    pub(crate) fn texel_again(
        &mut self,
        vertex: &Vertex,
        surface: usize,
        back: bool,
        seed: u64,
    ) -> u32 {
        let to = self.bake.texel(vertex, surface, back);
        self.once(Receiver { seed, ..to })
    }

    fn once(&mut self, to: Receiver) -> u32 {
        self.places.push((to, false));
        self.areas.push(0.0);
        self.places.len() as u32 - 1
    }

    /// The space of each entry, and whether something covers it.
    pub(crate) fn spaces(&self) -> &[(u32, bool)] {
        &self.spaces
    }

    pub(crate) fn is_late(&self) -> bool {
        (self.late)()
    }

    /// The light that a look found.
    pub(crate) fn at(&self, look: u32) -> Option<&PlaceLight> {
        self.seen[look as usize].as_ref()
    }

    /// Number of looks.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// Does all looks asked for, leaf by leaf, as those of a leaf ask for the same patches. `progress` is told (done, of) in places of this
    /// call.
    pub(crate) fn complete(&mut self, progress: &dyn Fn(usize, usize)) {
        let mut wanted: Vec<usize> = (self.seen.len()..self.places.len()).collect();
        wanted.sort_by_key(|&k| self.places[k].0.leaf);
        self.seen.resize_with(self.places.len(), || None);
        for (part, some) in wanted.chunks(PART).enumerate() {
            progress(part * PART, wanted.len());
            let late = self.is_late() && !self.patient;
            let (believed, open): (Vec<usize>, Vec<usize>) =
                some.iter().partition(|&&k| late || self.places[k].1);
            for k in believed {
                self.seen[k] = self.told(&self.places[k].0);
            }
            for effort in self.efforts(&open) {
                let alike = open.iter().copied();
                self.gather(
                    alike.filter(|&k| self.effort(k) == effort).collect(),
                    effort,
                );
            }
        }
        progress(wanted.len(), wanted.len());
    }

    /// Variance of a look by chance, a multiple of the usual one.
    pub(crate) fn variance(&self, look: u32) -> f64 {
        self.effort(look as usize).noise().powi(2)
    }

    /// A look that is not done yet stands for this area, too.
    pub(crate) fn stand_for(&mut self, look: u32, area: f64) {
        if look as usize >= self.seen.len() {
            self.areas[look as usize] += area.max(f64::MIN_POSITIVE);
        }
    }

    /// What a look is worth.
    fn effort(&self, look: usize) -> Effort {
        Effort::worth(self.areas[look], self.typical)
    }

    /// All efforts among some looks.
    fn efforts(&self, looks: &[usize]) -> Vec<Effort> {
        let mut efforts: Vec<Effort> = looks.iter().map(|&k| self.effort(k)).collect();
        efforts.sort_unstable();
        efforts.dedup();
        efforts
    }

    /// Gathers at some places.
    fn gather(&mut self, mut places: Vec<usize>, effort: Effort) {
        let receivers = |places: &[usize]| -> Vec<Receiver> {
            places.iter().map(|&k| self.places[k].0).collect()
        };
        let mut pressed = self.bake.pressed(&receivers(&places)).into_iter();
        places.retain(|_| pressed.next() == Some(false));
        let quality = match self.quality {
            GatherQuality::Vertex(_) => GatherQuality::Vertex(effort),
            quality => quality,
        };
        let gathered = self.bake.gather_shown(&receivers(&places), quality);
        let dark =
            |g: &Gathered| g.backs <= MOSTLY && g.seen < 1e-3 && g.direct.iter().all(|&x| x == 0.0);
        let in_doubt = places.iter().zip(&gathered).filter(|(_, g)| dark(g));
        let in_doubt: Vec<usize> = in_doubt.map(|(&k, _)| k).collect();
        let mut covered = self.bake.covered(&receivers(&in_doubt)).into_iter();
        for (k, gathered) in places.into_iter().zip(gathered) {
            self.rays += gathered.rays;
            let covered = dark(&gathered) && covered.next() == Some(true);
            let hidden = covered || gathered.backs > MOSTLY;
            let to = &self.places[k].0;
            let seen = self.seen_as(to, gathered.irradiance, gathered.packed);
            let shown = !hidden && !self.is_inside(to, &seen);
            self.seen[k] = shown.then(|| match self.indirect {
                true => self.seen_as(to, less(gathered.irradiance, &gathered.direct), seen.trace),
                false => seen,
            });
        }
    }

    /// Does a place lie inside something whose back is black from there? Then it is dark, and a black back is above it.
    fn is_inside(&self, to: &Receiver, seen: &PlaceLight) -> bool {
        seen.xyz[1] < DIM * self.bake.light().white[1] && self.bake.meets_back(to, to.normal)
    }

    /// The light of a leaf.
    fn told(&self, to: &Receiver) -> Option<PlaceLight> {
        let light = self.bake.light();
        let known = light
            .irradiance
            .row(light.leaves.binary_search(&to.leaf?).ok()?);
        let mut row = [0.0; 64];
        row[..known.len()].copy_from_slice(known);
        Some(self.seen_as(to, row, None))
    }
}

/// Does something stand between two points of a plane, each a little inside of its own triangle, at whose common corner a wall may begin? The
/// ways between them run as far above the plane as the points are apart.
fn parted(bake: &Bake, one: &Receiver, other: &Receiver) -> bool {
    let lift = (one.point - other.point).length() * one.normal;
    let planes = [one.plane, other.plane];
    let way = Segment::new(one.point + lift, other.point + lift, planes);
    lift != DVec3::ZERO && bake.rays().occluded(&way)
}

/// Irradiance without the direct light of lamps. Not below 0: both are sums of the same numbers, rounded differently.
fn less(mut all: [f32; 64], direct: &[f32; 64]) -> [f32; 64] {
    for (all, direct) in all.iter_mut().zip(direct) {
        *all = (*all - direct).max(0.0);
    }
    all
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::color::seen_difference;
    use crate::transport::tests::baked;
    use std::collections::HashSet;

    /// How far the light of looks, as they saw it and with these factors, is from that of closer looks at the same places: mean squares of the colour
    /// difference at some 2,000 of them.
    pub(crate) fn off(looks: &Looks, factor: impl Fn(u32) -> f64) -> [f64; 2] {
        let step = looks.len() / 2000 + 1;
        let some = (0..looks.len() as u32).step_by(step);
        let some: Vec<u32> = some.filter(|&look| looks.at(look).is_some()).collect();
        let places: Vec<Receiver> = some.iter().map(|&k| looks.places[k as usize].0).collect();
        let mut sums = [0.0; 2];
        for (&look, closer) in some.iter().zip(looks.bake.gather(&places)) {
            let truth = looks.bake.lanes().tristimulus(&closer.irradiance);
            let own = looks.at(look).unwrap().xyz;
            let other = own.map(|x| factor(look) * x);
            for (sum, light) in sums.iter_mut().zip([own, other]) {
                let off = seen_difference(light, truth, looks.bake.light().white);
                *sum += off * off / some.len() as f64;
            }
        }
        sums
    }

    /// But for those of a picture on the way.
    #[test]
    fn looks_have_rays_of_their_own_and_are_worth_what_they_stand_for() {
        let bake = baked("cornell.glb", 1);
        let seeds = |quality| {
            let mut growth = bake.growth(quality, &|| false);
            growth.begin(&|_, _| {});
            let looks = &growth.looks;
            let seeds = looks.places.iter().map(|(to, _)| to.seed);
            let efforts = (0..looks.len()).map(|look| looks.effort(look).samples());
            (seeds.collect::<Vec<_>>(), efforts.collect::<Vec<_>>())
        };
        let (seen, efforts) = seeds(GatherQuality::Vertex(Effort::default()));
        let apart: HashSet<u64> = seen.iter().copied().collect();
        assert_eq!(apart.len(), seen.len());
        // The walls are large, the lamp is small.
        let most = efforts.iter().copied().fold(0.0, f64::max);
        let least = efforts.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(most > least, "{most} {least}");
        let (shared, _) = seeds(GatherQuality::Preview);
        assert!(shared.iter().all(|seed| *seed == 0));
    }

    /// At the foot of a block the floor on one side is not that on the other.
    #[test]
    fn a_block_parts_the_places_at_its_foot() {
        let bake = baked("cornell.glb", 1);
        let mesh = bake.mesh();
        let floor = (mesh.positions.iter()).fold(f64::INFINITY, |y, p| y.min(p.y));
        let of_floor = |t: &usize| mesh.normal[*t].y.abs() > 0.99;
        let of_floor = |t: &usize| of_floor(t) && mesh.at(*t, [1.0, 0.0, 0.0]).y < floor + 1e-9;
        let plane = mesh.plane[(0..mesh.triangles.len()).find(of_floor).unwrap()];
        let at = |point: DVec3| Receiver {
            point,
            normal: DVec3::Y,
            plane,
            leaf: None,
            seed: 0,
        };
        let mut blocks = 0;
        for t in 0..mesh.triangles.len() {
            let corners = mesh.triangles[t].map(|p| mesh.positions[p as usize]);
            let low: Vec<DVec3> = corners.into_iter().filter(|c| c.y < floor + 1e-9).collect();
            // The walls' edges are straight; the blocks stand askew.
            let askew = mesh.normal[t].x.abs().max(mesh.normal[t].z.abs()) < 0.99;
            if let (&[a, b], true) = (low.as_slice(), askew && mesh.normal[t].y.abs() < 0.1) {
                let (middle, step) = (0.5 * (a + b), 1e-3 * mesh.half_size * mesh.normal[t]);
                let place = |k: f64| at(middle + k * step);
                assert!(parted(bake, &place(1.0), &place(-1.0)));
                assert!(!parted(bake, &place(1.0), &place(2.0)));
                blocks += 1;
            }
        }
        assert_eq!(blocks, 8);
    }
}
