//! How wrong a bake is, *measured*: its light against the path tracer's at random points of its surfaces.
//!
//! The path tracer's own noise must not count as error of the bake. With observed difference o and standard error s of a
//! point's answer, `E[o^2] = d^2 + s^2`; the figures are made of `sqrt(max(0, o^2 - s^2))`, and a root mean square of
//! `sqrt(max(0, mean(o^2 - s^2)))`, which is unbiased. Intervals are of 95 %: means by the spread over the points, order
//! statistics by moving every point by 2 s. Where d is far below s the mean of those roots is 0.4 s, not 0; the lower end
//! of its interval is lowered by as much. Points that something solid covers are left out and counted.
//!
//! Colour differences are CIEDE2000 of a white surface's light under the bake's adaptation white.

use super::path::{Answer, Audit};
use crate::color::{KM, Observer, de2000};
use crate::gather::point::Receiver;
use crate::geometry::sampling::{Pcg, triangle_weights};
use crate::solve::Bake;
use crate::spectrum::Leaves;
use glam::DVec3;
use serde::Serialize;

/// Paths of a point that tell how many more it takes.
const PILOT: usize = 512;
/// The audit's standard error at a point is brought to this share of the asked-for colour difference.
const NOISE_SHARE: f64 = 0.25;
/// Illuminances below this share of the white's count as this: the relative error of darkness means nothing.
const DARK: f64 = 1e-4;
/// What noise alone shows as, share of its standard error: the mean of `sqrt(max(0, z^2 - 1))` over a normal z.
const NOISE_SHOWS: f64 = 0.4;
/// Estimates and errors below this share of the asked-for one are not told apart.
const NEGLIGIBLE: f64 = 0.02;
/// Two-sided normal quantile of 95 %.
const NORMAL_95: f64 = 1.96;
/// An estimate is honest between these multiples of the measured error.
pub const HONEST: [f64; 2] = [0.7, 3.0];

/// A measured figure with its interval of 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Measured {
    /// Best figure.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Mean, 95th percentile and greatest of a measured error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: Measured,
    /// Root of the mean square.
    pub rms: Measured,
    /// Value that 95 % of the points do not exceed.
    pub p95: Measured,
    /// Greatest.
    pub max: Measured,
}

/// Was the solver's estimate honest?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Honesty {
    /// Between [`HONEST`] times the measured error, as far as its interval tells.
    Honest,
    /// Too low: the bake is worse than it says.
    TooLow,
    /// Too high: the bake is better than it says.
    TooHigh,
    /// There is no estimate yet.
    NoEstimate,
}

/// The outcome of an audit.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Always `audit`.
    pub record: &'static str,
    /// Points that were compared.
    pub points: usize,
    /// Random points that something solid covers: left out.
    pub covered: usize,
    /// Paths traced.
    pub paths: u64,
    /// Seed of points and paths.
    pub seed: u64,
    /// CIEDE2000.
    pub de2000: Spread,
    /// Relative error of illuminance, without sign.
    pub relative: Spread,
    /// Mean relative error of illuminance, with sign: bake less truth.
    pub bias: Measured,
    /// Mean standard error of the audit itself, CIEDE2000: what the figures cannot see below.
    pub noise_de2000: f64,
    /// The solver's own estimate of the mean CIEDE2000.
    pub estimate_de2000: Option<f64>,
    /// The judgement on it.
    pub honesty: Honesty,
    /// What was seen at each point.
    #[serde(skip)]
    pub seen: Vec<Seen>,
}

/// One point of an audit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// World space.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Tristimulus irradiance by the bake, lx for Y.
    pub baked: [f64; 3],
    /// The same by the path tracer.
    pub traced: [f64; 3],
    /// CIEDE2000 between the two, noise included, and the standard error of the path tracer in it.
    pub de2000: [f64; 2],
    /// Relative illuminance error with sign, and its standard error.
    pub relative: [f64; 2],
}

impl Report {
    /// Compares a bake with the path tracer at `points` random points, by area; `most_paths` paths a point at the most.
    /// The same numbers for the same seed at any number of threads.
    pub fn new(bake: &Bake, points: usize, most_paths: usize, seed: u64) -> Self {
        let goal = NOISE_SHARE * bake.settings().error;
        Truth::new(bake, points, goal, most_paths, seed).report(bake)
    }

    fn of(
        seen: Vec<Seen>,
        covered: usize,
        paths: u64,
        seed: u64,
        estimate: Option<f64>,
        negligible: f64,
    ) -> Self {
        let colour: Vec<[f64; 2]> = seen.iter().map(|s| s.de2000).collect();
        let relative: Vec<[f64; 2]> = seen.iter().map(|s| s.relative).collect();
        let de2000 = spread(&colour);
        let honesty = match estimate {
            None => Honesty::NoEstimate,
            Some(e) if e.max(negligible) < HONEST[0] * de2000.mean.low => Honesty::TooLow,
            Some(e) if e > HONEST[1] * de2000.mean.high.max(negligible) => Honesty::TooHigh,
            Some(_) => Honesty::Honest,
        };
        Self {
            record: "audit",
            points: seen.len(),
            covered,
            paths,
            seed,
            de2000,
            relative: spread(&relative),
            bias: mean_of(&relative.iter().map(|r| r[0]).collect::<Vec<_>>()),
            noise_de2000: colour.iter().map(|c| c[1]).sum::<f64>() / colour.len().max(1) as f64,
            estimate_de2000: estimate,
            honesty,
            seen,
        }
    }
}

/// What the path tracer says at points of a room: traced once, compared with any number of bakes of the same room.
#[derive(Debug, Clone)]
pub struct Truth {
    places: Vec<Place>,
    answers: Vec<Answer>,
    covered: usize,
    paths: u64,
    seed: u64,
}

/// A random point of a face.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Number of the face in the hierarchy, and weights of its corners.
    entry: u32,
    weights: [f64; 3],
    seed: u64,
}

impl Truth {
    /// Traces at `points` random points of the room of a bake, by area, until the standard error of each is about `goal`
    /// (CIEDE2000 under the bake's white); `most_paths` paths a point at the most.
    pub fn new(bake: &Bake, points: usize, goal: f64, most_paths: usize, seed: u64) -> Self {
        let (places, covered) = places(bake, points, seed);
        let audit = Audit::new(bake.scene(), bake.mesh(), bake.rays());
        let sites: Vec<(DVec3, DVec3, u32)> = places
            .iter()
            .map(|place| {
                let r = place.receiver(bake);
                (r.point, r.normal, r.plane)
            })
            .collect();
        let weights = weights(bake);
        let white = bake.light().white;
        let pilot = audit.irradiance(
            &sites,
            &vec![PILOT.min(most_paths); sites.len()],
            seed ^ 0x9110,
        );
        // The pilot only decides on numbers of paths: using it in the answer too would prefer lucky points.
        let wanted: Vec<usize> = pilot
            .iter()
            .map(|answer| {
                let noise = noise(answer, &weights, white) / goal;
                ((PILOT as f64 * noise * noise) as usize).clamp(PILOT, most_paths.max(1))
            })
            .collect();
        let answers = audit.irradiance(&sites, &wanted, seed);
        let paths = (PILOT.min(most_paths) * sites.len()) as u64
            + wanted.iter().map(|&n| n as u64).sum::<u64>();
        Self {
            places,
            answers,
            covered,
            paths,
            seed,
        }
    }

    /// Mean tristimulus irradiance over the points, lx for Y.
    pub fn mean(&self, bake: &Bake) -> [f64; 3] {
        let weights = weights(bake);
        let n = self.answers.len().max(1) as f64;
        self.answers.iter().fold([0.0; 3], |sum, answer| {
            let xyz = tristimulus(&answer.mean, &weights);
            std::array::from_fn(|c| sum[c] + xyz[c] / n)
        })
    }

    /// The points in the hierarchy of a bake of the same room.
    pub fn receivers(&self, bake: &Bake) -> Vec<Receiver> {
        self.places.iter().map(|p| p.receiver(bake)).collect()
    }

    /// Compares a bake of the same room.
    pub fn report(&self, bake: &Bake) -> Report {
        let receivers = self.receivers(bake);
        let gathered = bake.gather(&receivers);
        let (weights, white) = (weights(bake), bake.light().white);
        let seen: Vec<Seen> = receivers
            .iter()
            .zip(&gathered)
            .zip(&self.answers)
            .map(|((r, g), answer)| {
                let baked = bake.lanes().tristimulus(&g.irradiance);
                let traced = tristimulus(&answer.mean, &weights);
                let (y, s) = answer.linear(&weights[1]);
                let scale = y.max(DARK * white[1]).max(f64::MIN_POSITIVE);
                Seen {
                    point: r.point + bake.mesh().centre,
                    normal: r.normal,
                    baked,
                    traced,
                    de2000: [de2000(baked, traced, white), noise(answer, &weights, white)],
                    relative: [(baked[1] - y) / scale, s / scale],
                }
            })
            .collect();
        let estimate = bake
            .rounds()
            .last()
            .and_then(|r| r.error.total_de2000.value);
        Report::of(
            seen,
            self.covered,
            self.paths,
            self.seed,
            estimate,
            NEGLIGIBLE * bake.settings().error,
        )
    }
}

impl Place {
    fn receiver(&self, bake: &Bake) -> Receiver {
        let tree = bake.tree();
        let entry = self.entry as usize;
        let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
        Receiver {
            point: element.at(self.weights),
            normal: tree.face_normal[entry],
            plane: tree.face_plane[entry],
            leaf: Some(tree.leaf_at(self.entry, self.weights)),
            seed: self.seed,
        }
    }
}

/// Lumens a watt of the leaves, by tristimulus value.
fn weights(bake: &Bake) -> [Leaves; 3] {
    Observer::cie1931()
        .weights(&bake.scene().grid)
        .map(|w| w.map(|x| KM * x))
}

/// Random points by area, one stratum each, those that are not covered; and how many are.
fn places(bake: &Bake, points: usize, seed: u64) -> (Vec<Place>, usize) {
    let tree = bake.tree();
    let mut rng = Pcg::new(seed ^ 0x00a0_d177);
    let mut all = Vec::with_capacity(points);
    if let Some(root) = tree.nodes.first() {
        for k in 0..points {
            let target = (k as f64 + rng.f64()) / points as f64 * root.area;
            let entry = (tree.face_area.partition_point(|&a| a <= target).max(1) - 1)
                .min(tree.faces.len() - 1);
            all.push(Place {
                entry: entry as u32,
                weights: triangle_weights([rng.f64(), rng.f64()]),
                seed: crate::geometry::sampling::hash(seed, k as u64),
            });
        }
    }
    let receivers: Vec<Receiver> = all.iter().map(|p| p.receiver(bake)).collect();
    let covered = bake.covered(&receivers);
    let count = covered.iter().filter(|c| **c).count();
    let bare = all.into_iter().zip(&covered).filter(|(_, c)| !**c);
    (bare.map(|(p, _)| p).collect(), count)
}

fn tristimulus(leaves: &Leaves, weights: &[Leaves; 3]) -> [f64; 3] {
    weights
        .each_ref()
        .map(|w| leaves.iter().zip(w).map(|(x, w)| x * w).sum())
}

/// Standard error of an answer as a colour difference: the differences of its batches from their mean.
fn noise(answer: &Answer, weights: &[Leaves; 3], white: [f64; 3]) -> f64 {
    let mean = tristimulus(&answer.mean, weights);
    let n = answer.batches.len() as f64;
    let squares: f64 = answer
        .batches
        .iter()
        .map(|b| de2000(tristimulus(b, weights), mean, white).powi(2))
        .sum();
    (squares / (n * (n - 1.0).max(1.0))).sqrt()
}

/// Figures of errors `[observed, standard error]`.
fn spread(errors: &[[f64; 2]]) -> Spread {
    let value: Vec<f64> = errors
        .iter()
        .map(|[o, s]| (o * o - s * s).max(0.0).sqrt())
        .collect();
    let at = |shift: f64| -> Vec<f64> {
        errors
            .iter()
            .map(|[o, s]| (o.abs() + shift * s).max(0.0))
            .collect()
    };
    let noise = errors.iter().map(|[_, s]| s).sum::<f64>() / errors.len().max(1) as f64;
    let order = |share: f64| Measured {
        value: percentile(value.clone(), share),
        low: percentile(at(-2.0), share),
        high: percentile(at(2.0), share),
    };
    let squares = mean_of(
        &errors
            .iter()
            .map(|[o, s]| o * o - s * s)
            .collect::<Vec<_>>(),
    );
    let root = |x: f64| x.max(0.0).sqrt();
    Spread {
        mean: mean_of(&value).lowered(NOISE_SHOWS * noise),
        rms: Measured {
            value: root(squares.value),
            low: root(squares.low),
            high: root(squares.high),
        },
        p95: order(0.95),
        max: order(1.0),
    }
}

impl Measured {
    /// The same with its lower end lowered, to 0 at the most.
    fn lowered(self, by: f64) -> Self {
        Self {
            low: (self.low - by).max(0.0),
            ..self
        }
    }
}

fn mean_of(x: &[f64]) -> Measured {
    let n = x.len().max(1) as f64;
    let value = x.iter().sum::<f64>() / n;
    let variance = x.iter().map(|x| (x - value).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let half = NORMAL_95 * (variance / n).sqrt();
    Measured {
        value,
        low: value - half,
        high: value + half,
    }
}

/// The value that a share of the values does not exceed; 0 of none.
fn percentile(mut x: Vec<f64>, share: f64) -> f64 {
    x.sort_by(f64::total_cmp);
    let rank = (share * x.len() as f64).ceil() as usize;
    x.get(rank.clamp(1, x.len().max(1)) - 1)
        .copied()
        .unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_not_counted_as_error() {
        // True errors of 0 and of 0.5 seen through noise of standard deviation 0.2.
        let mut rng = Pcg::new(7);
        let mut normal = move || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
        for truth in [0.0, 0.5] {
            let errors: Vec<[f64; 2]> = (0..4000).map(|_| [truth + 0.2 * normal(), 0.2]).collect();
            let s = spread(&errors);
            assert!((s.rms.value - truth).abs() < 0.03, "{truth}: {s:?}");
            assert!(s.rms.low <= truth && truth <= s.rms.high, "{truth}: {s:?}");
            let naive = (errors.iter().map(|e| e[0] * e[0]).sum::<f64>() / 4000.0).sqrt();
            assert!(naive > truth + 0.03);
        }
    }

    #[test]
    fn order_statistics() {
        assert_eq!(percentile((1..=100).map(f64::from).collect(), 0.95), 95.0);
        assert_eq!(percentile(vec![3.0, 1.0, 2.0], 1.0), 3.0);
        assert_eq!(percentile(vec![], 0.95), 0.0);
    }
}
