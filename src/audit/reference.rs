//! The path tracer's answer at random points of a room, to which any number of bakes of that room can be held.
//!
//! Points lie on all faces, one in each of N strata of equal area, as far as it counts (see `hierarchy/counted.rs`); those that something solid covers or lies right upon are
//! left out and counted. A pilot of few paths tells how many each point takes; it decides on numbers only, as using it in the answer
//! would prefer lucky points. Figures are tristimulus irradiance, lm/m2; Y is lux.

use super::path::{Answer, Audit, BATCHES};
use crate::color::{KM, Observer, de2000};
use crate::geometry::sampling::{Pcg, cosine_direction, hash, sequence02};
use crate::hierarchy::Face;
use crate::mesh::looks::DIM;
use crate::solve::Bake;
use crate::spectrum::Spectrum;
use crate::transport::{MOSTLY, Receiver};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;

/// Paths of a point that tell how many more it takes.
const PILOT: usize = 512;
/// The standard error at a point is brought to this share of the colour difference that the bake is asked for.
const NOISE_SHARE: f64 = 0.25;
/// Directions that tell whether a point lies inside of something.
const LOOKS: u32 = 64;

/// A point of a face.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct FacePoint {
    /// The face.
    pub face: Face,
    /// Barycentric weights of the corners of the face.
    pub weights: [f64; 3],
    /// The point, world space.
    pub point: DVec3,
    /// Unit normal of the face.
    pub normal: DVec3,
}

/// What the path tracer says at points of a room.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct PathReference {
    /// The points.
    pub points: Vec<FacePoint>,
    /// Irradiance at each point, lm/m2.
    pub truth: Vec<[f64; 3]>,
    /// The same by independent batches, of which `truth` is the mean.
    pub batches: Vec<[[f64; 3]; BATCHES]>,
    /// Which points lie inside of something, so that nobody sees what is drawn there: black backs are most of what they look at, or they
    /// are dark and such a back is right above them. Files take their vertices there for covered by the same rules.
    pub(super) inside: Vec<bool>,
    /// What points of diffuse sheets show, with the light behind them, see [`Through`](crate::light::Through): number of the point and
    /// what its batches come to. Empty without sheets.
    pub(super) shown: Vec<(usize, [[f64; 3]; BATCHES])>,
    /// Random points that were left out, as something solid covers them.
    pub covered: usize,
    /// Paths traced, the pilot's too.
    pub paths: u64,
    /// Seed of points and paths.
    pub seed: u64,
}

impl PathReference {
    /// Traces at `points` random points by the area that counts, at most `most_paths` paths a point (and a pilot): as many as bring the
    /// standard error to a quarter of the error that `bake` is asked for. Of the bake only the room, its triangles and
    /// its rays are used, whatever rounds it has done. The same numbers for the same seed at any number of threads.
    pub fn new(bake: &Bake, points: usize, most_paths: usize, seed: u64) -> Self {
        let (places, covered) = places(bake, points, seed);
        let audit = Audit::new(bake.scene(), bake.mesh(), bake.rays());
        let mesh = bake.mesh();
        let starts: Vec<(DVec3, DVec3, u32)> = places
            .iter()
            .map(|p| {
                let plane = mesh.plane[p.face.triangle as usize];
                (p.point - mesh.centre, p.normal, plane)
            })
            .collect();
        let weights = Observer::cie1931()
            .weights(&bake.scene().grid)
            .map(|w| w.map(|x| KM * x));
        let tristimulus = |answers: &[Answer]| -> Vec<[[f64; 3]; BATCHES]> {
            answers.iter().map(|a| tristimulus(a, &weights)).collect()
        };
        let trace = |paths: &[usize], seed: u64| audit.irradiance(&starts, paths, seed);
        let few = vec![PILOT.min(most_paths); starts.len()];
        let pilot = tristimulus(&trace(&few, seed ^ 0x9110));
        let white = bake.settings().white.unwrap_or_else(|| {
            let n = pilot.len().max(1) as f64;
            let all = pilot.iter().map(mean);
            all.fold([0.0; 3], |w, x| [0, 1, 2].map(|c| w[c] + 2.0 * x[c] / n))
        });
        let goal = NOISE_SHARE * bake.settings().error;
        let wanted: Vec<usize> = pilot
            .iter()
            .map(|batches| {
                let noise = noise(batches, white) / goal;
                ((PILOT as f64 * noise * noise) as usize)
                    .max(PILOT)
                    .min(most_paths.max(1))
            })
            .collect();
        let answers = trace(&wanted, seed);
        let batches = tristimulus(&answers);
        let (on_sheets, shown) = shown(&audit, &places, &starts, &wanted, (answers, seed));
        let shown = on_sheets.into_iter().zip(tristimulus(&shown)).collect();
        let truth: Vec<[f64; 3]> = batches.iter().map(mean).collect();
        Self {
            shown,
            inside: inside(bake, &places, &truth, DIM * white[1]),
            truth,
            points: places,
            batches,
            covered,
            paths: few.iter().chain(&wanted).map(|&n| n as u64).sum(),
            seed,
        }
    }

    /// The same with what diffuse sheets show of both their sides, as files hold it.
    pub(super) fn as_shown(&self) -> Cow<'_, Self> {
        if self.shown.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut other = self.clone();
        for (k, batches) in &self.shown {
            other.truth[*k] = mean(batches);
            other.batches[*k] = *batches;
        }
        Cow::Owned(other)
    }

    /// Where a bake of the same room receives light at the points.
    pub(super) fn receivers(&self, bake: &Bake) -> Vec<Receiver> {
        let all = self.points.iter().enumerate();
        all.map(|(k, place)| receiver(bake, place, hash(self.seed, k as u64)))
            .collect()
    }

    /// Standard error of point `k` as a colour difference (CIEDE2000 under a white).
    pub fn noise_de2000(&self, k: usize, white: [f64; 3]) -> f64 {
        noise(&self.batches[k], white)
    }

    /// Half the interval of 95 % of the illuminance at point `k`, lx: Student's t of 15 degrees of freedom.
    pub fn interval(&self, k: usize) -> f64 {
        2.131 * self.standard_error(k)
    }

    /// Standard error of the illuminance at point `k`, lx.
    pub(super) fn standard_error(&self, k: usize) -> f64 {
        let n = BATCHES as f64;
        let squares = self.batches[k]
            .iter()
            .map(|b| (b[1] - self.truth[k][1]).powi(2));
        (squares.sum::<f64>() / (n * (n - 1.0))).sqrt()
    }
}

/// Which points lie on diffuse sheets, and what they show: what meets them, and with as many paths again what meets their other side.
fn shown(
    audit: &Audit,
    places: &[FacePoint],
    starts: &[(DVec3, DVec3, u32)],
    paths: &[usize],
    (answers, seed): (Vec<Answer>, u64),
) -> (Vec<usize>, Vec<Answer>) {
    let shares = |place: &FacePoint| {
        let [a, b, c] = place.weights.map(|w| w as f32);
        let weights = if place.face.back {
            [a, c, b]
        } else {
            [a, b, c]
        };
        audit.shares(place.face.triangle as usize, weights, place.face.back)
    };
    let (on, shares): (Vec<usize>, Vec<[Spectrum; 2]>) = (places.iter().enumerate())
        .filter_map(|(k, place)| Some((k, shares(place)?)))
        .unzip();
    let behind: Vec<(DVec3, DVec3, u32)> = (on.iter())
        .map(|&k| (starts[k].0, -starts[k].1, starts[k].2))
        .collect();
    let paths: Vec<usize> = on.iter().map(|&k| paths[k]).collect();
    let behind = audit.irradiance(&behind, &paths, seed ^ 0xbe41);
    let shown = on.iter().zip(&shares).zip(behind);
    let shown = shown.map(|((&k, [own, across]), behind)| {
        let mix =
            |x: &Spectrum, y: &Spectrum| std::array::from_fn(|l| own[l] * x[l] + across[l] * y[l]);
        let batches = answers[k].batches.iter().zip(&behind.batches);
        Answer {
            mean: mix(&answers[k].mean, &behind.mean),
            batches: batches.map(|(x, y)| mix(x, y)).collect(),
        }
    });
    let shown = shown.collect();
    (on, shown)
}

/// Random points by the area that counts, one stratum each, those that are not covered; and how many are.
fn places(bake: &Bake, points: usize, seed: u64) -> (Vec<FacePoint>, usize) {
    let tree = bake.tree();
    let mut rng = Pcg::new(seed ^ 0x00a0_d177);
    let mut all = Vec::with_capacity(points);
    if !tree.nodes.is_empty() {
        for k in 0..points {
            let share = (k as f64 + rng.f64()) / points as f64;
            let (entry, weights) = tree.random(share, [rng.f64(), rng.f64()]);
            let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
            all.push(FacePoint {
                face: tree.faces[entry],
                weights,
                point: element.at(weights) + bake.mesh().centre,
                normal: tree.face_normal[entry],
            });
        }
    }
    let receivers: Vec<Receiver> = all.iter().map(|place| receiver(bake, place, 0)).collect();
    let mut covered = bake.covered(&receivers).into_iter();
    let mut pressed = bake.pressed(&receivers).into_iter();
    let before = all.len();
    all.retain(|_| [covered.next(), pressed.next()] == [Some(false); 2]);
    let count = before - all.len();
    (all, count)
}

/// Which points lie inside of something: see [`PathReference::inside`]. Darker than `dim`, lx, is dark.
fn inside(bake: &Bake, places: &[FacePoint], truth: &[[f64; 3]], dim: f64) -> Vec<bool> {
    let one = |(place, truth): (&FacePoint, &[f64; 3])| {
        let to = receiver(bake, place, 0);
        let way = |k: u32| cosine_direction(to.normal, sequence02(k, 0));
        let backs = (0..LOOKS).filter(|&k| bake.meets_back(&to, way(k)));
        backs.count() as f64 > MOSTLY * f64::from(LOOKS)
            || (truth[1] < dim && bake.meets_back(&to, to.normal))
    };
    places.par_iter().zip(truth).map(one).collect()
}

fn receiver(bake: &Bake, place: &FacePoint, seed: u64) -> Receiver {
    let (tree, triangle) = (bake.tree(), place.face.triangle as usize);
    let entry = tree.entry[triangle][usize::from(place.face.back)];
    Receiver {
        point: place.point - bake.mesh().centre,
        normal: place.normal,
        plane: bake.mesh().plane[triangle],
        leaf: Some(tree.leaf_at(entry, place.weights)),
        seed,
    }
}

/// Irradiance of the batches of an answer.
fn tristimulus(answer: &Answer, weights: &[Spectrum; 3]) -> [[f64; 3]; BATCHES] {
    let xyz = |spectrum: &Spectrum| {
        weights
            .each_ref()
            .map(|w| spectrum.iter().zip(w).map(|(x, w)| x * w).sum())
    };
    std::array::from_fn(|b| xyz(&answer.batches[b]))
}

fn mean(batches: &[[f64; 3]; BATCHES]) -> [f64; 3] {
    [0, 1, 2].map(|c| batches.iter().map(|b| b[c]).sum::<f64>() / BATCHES as f64)
}

/// Standard error of an answer as a colour difference: the differences of its batches from their mean.
fn noise(batches: &[[f64; 3]; BATCHES], white: [f64; 3]) -> f64 {
    let (mean, n) = (mean(batches), BATCHES as f64);
    let squares = batches.iter().map(|&b| de2000(b, mean, white).powi(2));
    (squares.sum::<f64>() / (n * (n - 1.0))).sqrt()
}
