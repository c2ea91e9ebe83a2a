//! Evens out what looks differ by chance.
//!
//! Every look has rays of its own, so that neighbours err independently: less of that is left in what is drawn between them, and neighbours tell of each other. Where
//! looks meet in a [`Hinge`] (two triangles of a mesh that share an edge, three places of a map in a row), light is straight unless it bends there. Light is looked for
//! that is near to what was seen, in standard errors, and nearly straight over hinges, in standard errors of what that takes together; a hinge over which light bends by
//! more than chance makes it bend has no say (robust weights of Geman and McClure 1987, found anew in every turn). The colours of a look stay, only its brightness changes.

use super::looks::Looks;
use crate::light::lightness_sensitivity;

/// Lightness changes by so many CIE units when a brightness near that of white changes by all of it: the derivative of `116 h^(1/3)`.
const LIGHTNESS: f64 = 116.0 / 3.0;
/// Weight of a hinge beside that of a look. With none, 4 and 16 files at `--error 1` are off by .76, .71 and .69 dE00 in a garage and by 1.01, .99 and 1.00 in a
/// living room; between the vertices of a furnished room light is off by .350, .355 and .399. What a look errs by differs from place to place: half of the looks err by
/// two fifths of what all do in the mean square, and with 16 their light was drawn too straight (vertices of the furnished room .42 off for .28, with 4 .30).
const STRAIGHT: f64 = 4.0;
/// How often the weights of hinges are found anew, and steps of conjugate gradients in between.
const TURNS: usize = 3;
const STEPS: usize = 24;
/// Or until the square of what is left is this part of the first.
const FOUND: f64 = 1e-6;
/// No look is moved by more than this factor: where it is as dark as its error, nothing is known of its colour.
const MOST: f64 = 2.0;

/// Four looks, and what their light sums to where it is straight: 0. Divided by the standard error of that sum.
pub(crate) struct Hinge {
    looks: [u32; 4],
    weights: [f64; 4],
}

impl Hinge {
    /// Looks whose light sums to 0 with these weights where it is straight; `errors`: the standard errors of all looks. None where the weights or errors are those
    /// of places that lie upon each other.
    pub(crate) fn new(looks: [u32; 4], weights: [f64; 4], errors: &[f64]) -> Option<Self> {
        let square = |(&look, w): (&u32, &f64)| (w * errors[look as usize]).powi(2);
        let error = looks.iter().zip(&weights).map(square).sum::<f64>().sqrt();
        let weights = weights.map(|w| w / error);
        let is_whole = weights.iter().all(|w| w.is_finite());
        is_whole.then_some(Self { looks, weights })
    }

    /// By how many standard errors light bends.
    pub(crate) fn bend(&self, light: &[f64]) -> f64 {
        let of = self.looks.iter().zip(self.weights);
        of.map(|(&look, w)| w * light[look as usize]).sum()
    }
}

/// Illuminance of every look, lx, without most of what chance makes of it. `noise`: variance of a look of the usual effort, by chance; `white`: luminous exitance
/// of white; `hinges` are found for the standard errors of all looks.
pub(crate) fn evened(
    looks: &Looks,
    (noise, white): (f64, f64),
    hinges: impl FnOnce(&[f64]) -> Vec<Hinge>,
) -> Vec<f64> {
    let seen = |look: u32| looks.at(look).map_or(0.0, |seen| seen.xyz[1]);
    let own: Vec<f64> = (0..looks.len() as u32).map(seen).collect();
    if noise <= 0.0 {
        return own;
    }
    let error = |(look, own): (u32, &f64)| {
        let usual = noise.sqrt() * white / (LIGHTNESS * lightness_sensitivity(own / white));
        usual * looks.variance(look).sqrt()
    };
    let errors: Vec<f64> = (0..).zip(&own).map(error).collect();
    let light = nearly_straight(&hinges(&errors), &own, &errors).into_iter();
    let moved = light
        .zip(own)
        .map(|(light, own)| light.clamp(own / MOST, own * MOST));
    moved.collect()
}

/// Light near to what was seen, with these standard errors, and straight over hinges.
fn nearly_straight(hinges: &[Hinge], seen: &[f64], errors: &[f64]) -> Vec<f64> {
    let mut light = seen.to_vec();
    for _ in 0..TURNS {
        let trust = |hinge: &Hinge| STRAIGHT / (1.0 + hinge.bend(&light).powi(2)).powi(2);
        let trusts: Vec<f64> = hinges.iter().map(trust).collect();
        conjugate_gradients(hinges, &trusts, seen, errors, &mut light);
    }
    light
}

/// Brings light to the least of `sum ((light - seen) / error)^2 + sum trust bend^2`, or near to it.
fn conjugate_gradients(
    hinges: &[Hinge],
    trusts: &[f64],
    seen: &[f64],
    errors: &[f64],
    light: &mut [f64],
) {
    let n = seen.len();
    let mut out = vec![0.0; n];
    let mut scale: Vec<f64> = errors
        .iter()
        .map(|e| if *e > 0.0 { 1.0 / (e * e) } else { 1.0 })
        .collect();
    let weights = scale.clone();
    let times = |x: &[f64], out: &mut [f64]| {
        for ((out, x), weight) in out.iter_mut().zip(x).zip(&weights) {
            *out = weight * x;
        }
        for (hinge, trust) in hinges.iter().zip(trusts) {
            let bend = trust * hinge.bend(x);
            for (&look, w) in hinge.looks.iter().zip(hinge.weights) {
                out[look as usize] += w * bend;
            }
        }
    };
    for (hinge, trust) in hinges.iter().zip(trusts) {
        for (&look, w) in hinge.looks.iter().zip(hinge.weights) {
            scale[look as usize] += trust * w * w;
        }
    }
    times(light, &mut out);
    let mut left: Vec<f64> = (0..n).map(|k| weights[k] * seen[k] - out[k]).collect();
    let mut ahead: Vec<f64> = left.iter().zip(&scale).map(|(r, s)| r / s).collect();
    let mut size: f64 = left.iter().zip(&ahead).map(|(r, z)| r * z).sum();
    let enough = FOUND * size;
    for _ in 0..STEPS {
        if size <= enough {
            break;
        }
        times(&ahead, &mut out);
        let step = size / ahead.iter().zip(&out).map(|(d, a)| d * a).sum::<f64>();
        for k in 0..n {
            light[k] += step * ahead[k];
            left[k] -= step * out[k];
        }
        let next: f64 = left.iter().zip(&scale).map(|(r, s)| r * r / s).sum();
        for k in 0..n {
            ahead[k] = left[k] / scale[k] + next / size * ahead[k];
        }
        size = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;

    const SIDE: u32 = 32;

    /// Three looks in a row, over a square of looks whose standard error is 1.
    fn rows_and_columns() -> Vec<Hinge> {
        let mut hinges = Vec::new();
        for (step, across) in [(1, SIDE), (SIDE, 1)] {
            for k in (0..SIDE).flat_map(|i| (1..SIDE - 1).map(move |j| i * across + j * step)) {
                let weights = [1.0, -1.0, -1.0, 1.0].map(|w| w / 6.0_f64.sqrt());
                hinges.push(Hinge {
                    looks: [k - step, k, k, k + step],
                    weights,
                });
            }
        }
        hinges
    }

    fn off(light: &[f64], truth: &[f64]) -> f64 {
        let square: f64 = light.iter().zip(truth).map(|(a, b)| (a - b).powi(2)).sum();
        (square / light.len() as f64).sqrt()
    }

    /// Half of a plane of light, and a shadow that ends within a step.
    #[test]
    fn chance_is_evened_out_and_edges_stay() {
        let mut rng = Pcg::new(3);
        let mut chance = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
        let place = |k: u32| (f64::from(k % SIDE), f64::from(k / SIDE));
        let all = 0..SIDE * SIDE;
        let slope = |k| 100.0 + 0.7 * place(k).0 - 0.3 * place(k).1;
        let shadow = |k| slope(k) - if k % SIDE < SIDE / 2 { 20.0 } else { 0.0 };
        let (even, edge): (Vec<f64>, Vec<f64>) = all.map(|k| (slope(k), shadow(k))).unzip();
        let hinges = rows_and_columns();
        for truth in [even, edge] {
            let seen: Vec<f64> = truth.iter().map(|x| x + chance()).collect();
            let light = nearly_straight(&hinges, &seen, &vec![1.0; truth.len()]);
            assert!((off(&seen, &truth) - 1.0).abs() < 0.1);
            assert!(off(&light, &truth) < 0.5, "{}", off(&light, &truth));
        }
    }

    #[test]
    fn a_hinge_bends_by_standard_errors() {
        let errors = [2.0, 1.0, 3.0, 0.5];
        let hinge = Hinge::new([0, 1, 2, 3], [0.5, 0.75, -0.25, -1.0], &errors).unwrap();
        let square: f64 = (0..4).map(|k| (hinge.weights[k] * errors[k]).powi(2)).sum();
        assert!((square - 1.0).abs() < 1e-12, "{square}");
        assert!(Hinge::new([0; 4], [0.0; 4], &errors).is_none());
        assert!(Hinge::new([0; 4], [f64::NAN; 4], &errors).is_none());
    }

    /// Where nothing is known of its neighbours, a look is believed.
    #[test]
    fn without_hinges_light_is_what_was_seen() {
        let seen = [3.0, 0.0, 7.0];
        assert_eq!(nearly_straight(&[], &seen, &[1.0, 0.0, 2.0]), seen);
    }
}
