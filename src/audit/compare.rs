//! The error of a bake, *measured*: what the solution says at random points beside the Monte Carlo answer.
//!
//! Points lie on all faces, one in each of N strata of equal area. Both answers are tristimulus irradiance; their
//! difference is CIEDE2000 under the bake's adaptation white. The Monte Carlo answer has noise of its own: half the
//! difference of two halves of its batches estimates it, and the corrected mean leaves it out,
//! `corrected = sqrt(mean^2 - noise^2)`. Paths are added until the noise is small beside the error.

use super::path::{Answer, Audit};
use crate::color::{KM, Observer, de2000};
use crate::gather::point::Receiver;
use crate::geometry::sampling::{Pcg, triangle_weights};
use crate::solve::Bake;
use crate::spectrum::Leaves;
use serde::Serialize;

/// Paths a point in the first pass, the factor of the next, and the most.
const PATHS: [usize; 3] = [2048, 4, 32_768];
/// Paths are added until the noise is below this share of the measured error ...
const QUIET: f64 = 0.35;
/// ... or below this share of the error that the bake was asked for.
const SMALL: f64 = 0.1;
/// Standard errors in a 95 % confidence interval (normal distribution).
const SIGMAS: f64 = 1.96;
/// Illuminance below this share of the white's does not blow relative errors up.
const FLOOR: f64 = 0.01;

/// A mean with its 95 % confidence interval over the points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// Ends of the interval.
    pub ci95: [f64; 2],
}

impl Mean {
    fn of(values: &[f64]) -> Self {
        let n = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let half = SIGMAS * (variance / n).sqrt();
        Self {
            mean,
            ci95: [mean - half, mean + half],
        }
    }
}

/// Colour differences over the points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Mean and interval, Monte Carlo noise included.
    #[serde(flatten)]
    pub mean: Mean,
    /// Mean colour difference that the noise alone makes.
    pub noise: f64,
    /// Mean without the noise.
    pub corrected: f64,
    /// 95th percentile, noise included.
    pub p95: f64,
    /// Greatest, noise included.
    pub max: f64,
}

/// What an audit found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Comparison {
    /// Random points.
    pub points: usize,
    /// Paths a point.
    pub paths: usize,
    /// Colour difference of irradiance.
    pub de2000: Spread,
    /// Difference of illuminance over the mean illuminance: is the room too bright or too dark as a whole?
    pub bias: Mean,
    /// Relative difference of illuminance point by point, (bake - audit) / audit; the divisor is 1 % of the white's at
    /// least.
    pub relative: Mean,
    /// Root mean square of the same, noise included.
    pub relative_rms: f64,
}

/// Measures the error of the last round at `points` random points. The same seed gives the same points and paths.
///
/// ```
/// use haarlight::{audit, scene::{Options, Scene}, solve::{Bake, Settings}};
/// let room = Scene::load("scenes/convex.glb", &Options::default())?;
/// let mut bake = Bake::new(room, Settings { error: 1.0, ..Settings::default() });
/// bake.run();
/// let measured = audit::compare(&bake, 16, 1);
/// assert!(measured.de2000.corrected < 3.0);
/// # Ok::<(), haarlight::Error>(())
/// ```
pub fn compare(bake: &Bake, points: usize, seed: u64) -> Comparison {
    let receivers = random_points(bake, points, seed);
    let places: Vec<_> = receivers
        .iter()
        .map(|r| (r.point, r.normal, r.plane))
        .collect();
    let solved: Vec<[f64; 3]> = bake
        .gather(&receivers)
        .iter()
        .map(|g| bake.lanes().tristimulus(&g.irradiance))
        .collect();
    let audit = Audit::new(bake.scene(), bake.mesh(), bake.rays());
    let weights = Observer::cie1931().weights(&bake.scene().grid);
    let white = bake.light().white;
    let mut paths = PATHS[0];
    loop {
        let answers = audit.irradiance(&places, &vec![paths; places.len()], seed);
        let found = judge(&solved, &answers, &weights, white, paths);
        let spread = found.de2000;
        if paths >= PATHS[2]
            || spread.noise <= (QUIET * spread.corrected).max(SMALL * bake.settings().error)
        {
            return found;
        }
        paths *= PATHS[1];
    }
}

/// One point in each of `count` strata of equal area.
fn random_points(bake: &Bake, count: usize, seed: u64) -> Vec<Receiver> {
    let tree = bake.tree();
    let Some(root) = tree.nodes.first() else {
        return Vec::new();
    };
    let mut rng = Pcg::new(seed ^ 0xaa0d_17ed);
    (0..count)
        .map(|k| {
            let target = (k as f64 + rng.f64()) / count as f64 * root.area;
            let entry = (tree.face_area.partition_point(|&a| a <= target).max(1) - 1)
                .min(tree.faces.len() - 1);
            let weights = triangle_weights([rng.f64(), rng.f64()]);
            // The element of the whole face.
            let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
            Receiver {
                point: element.at(weights),
                normal: tree.face_normal[entry],
                plane: tree.face_plane[entry],
                leaf: Some(tree.leaf_at(entry as u32, weights)),
                seed: seed << 32 | k as u64,
            }
        })
        .collect()
}

/// Tristimulus irradiance of leaves in W/m2/nm.
fn tristimulus(leaves: &Leaves, weights: &[Leaves; 3]) -> [f64; 3] {
    weights.map(|w| KM * leaves.iter().zip(&w).map(|(x, w)| x * w).sum::<f64>())
}

fn judge(
    solved: &[[f64; 3]],
    answers: &[Answer],
    weights: &[Leaves; 3],
    white: [f64; 3],
    paths: usize,
) -> Comparison {
    let mut differences = Vec::new();
    let (mut relative, mut absolute) = (Vec::new(), Vec::new());
    let (mut noise, mut total) = (0.0, 0.0);
    for (ours, answer) in solved.iter().zip(answers) {
        let truth = tristimulus(&answer.mean, weights);
        differences.push(de2000(*ours, truth, white));
        absolute.push(ours[1] - truth[1]);
        total += truth[1];
        relative.push((ours[1] - truth[1]) / truth[1].max(FLOOR * white[1]));
        let half = |batches: &[Leaves]| {
            let mean: Leaves = std::array::from_fn(|k| {
                batches.iter().map(|b| b[k]).sum::<f64>() / batches.len() as f64
            });
            tristimulus(&mean, weights)
        };
        let (first, second) = answer.batches.split_at(answer.batches.len() / 2);
        noise += 0.5 * de2000(half(first), half(second), white);
    }
    let n = solved.len().max(1) as f64;
    let noise = noise / n;
    let mean = Mean::of(&differences);
    differences.sort_by(f64::total_cmp);
    let at = |share: f64| {
        differences
            .get(((n - 1.0) * share).ceil() as usize)
            .copied()
            .unwrap_or(0.0)
    };
    Comparison {
        points: solved.len(),
        paths,
        de2000: Spread {
            mean,
            noise,
            corrected: (mean.mean * mean.mean - noise * noise).max(0.0).sqrt(),
            p95: at(0.95),
            max: at(1.0),
        },
        bias: Mean::of(
            &absolute
                .iter()
                .map(|d| if total > 0.0 { d * n / total } else { 0.0 })
                .collect::<Vec<_>>(),
        ),
        relative: Mean::of(&relative),
        relative_rms: (relative.iter().map(|r| r * r).sum::<f64>() / n).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{Grid, LEAVES};

    #[test]
    fn a_known_error_is_measured() {
        let weights = Observer::cie1931().weights(&Grid::default());
        let flat: Leaves = [0.01; LEAVES];
        let truth = tristimulus(&flat, &weights);
        let white = truth.map(|x| 2.0 * x);
        let answer = Answer {
            mean: flat,
            batches: vec![flat; 16],
        };
        // Twenty points, one of which is 10 % too bright.
        let mut solved = vec![truth; 20];
        solved[7] = truth.map(|x| 1.1 * x);
        let found = judge(&solved, &vec![answer; 20], &weights, white, 64);
        let wrong = de2000(solved[7], truth, white);
        assert!(wrong > 2.0 && wrong < 5.0, "{wrong}");
        assert_eq!(
            (found.points, found.paths, found.de2000.max),
            (20, 64, wrong)
        );
        assert!((found.de2000.mean.mean - wrong / 20.0).abs() < 1e-12);
        assert_eq!(found.de2000.noise, 0.0);
        assert!((found.relative.mean - 0.005).abs() < 1e-12);
        assert!((found.bias.mean - 0.005).abs() < 1e-12);
        assert!((found.relative_rms - 0.1 / 20f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn noise_of_the_audit_is_taken_out() {
        let weights = Observer::cie1931().weights(&Grid::default());
        let leaves = |x: f64| -> Leaves { [0.01 * x; LEAVES] };
        let truth = tristimulus(&leaves(1.0), &weights);
        let white = truth.map(|x| 2.0 * x);
        // The halves lie 4 % apart: the mean is uncertain by 2 %. We are 5 % off.
        let batches = [vec![leaves(1.02); 8], vec![leaves(0.98); 8]].concat();
        let answers = vec![
            Answer {
                mean: leaves(1.0),
                batches
            };
            50
        ];
        let solved = vec![truth.map(|x| 1.05 * x); 50];
        let spread = judge(&solved, &answers, &weights, white, 64).de2000;
        let ratio = spread.noise / spread.mean.mean;
        assert!((ratio - 0.4).abs() < 0.02, "{ratio}");
        assert!((spread.corrected / spread.mean.mean - 0.84f64.sqrt()).abs() < 0.02);
    }
}
