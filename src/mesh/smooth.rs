//! Evens out what looks differ by chance.
//!
//! Every look has rays of its own, so that neighbours err independently: less of that is left in what is drawn between them, and neighbours tell of each other. Where
//! triangles meet in an edge, straight light is right in one with the plane through the other. Light is looked for that is near to what was seen,
//! in standard errors, and nearly straight across edges, in standard errors of what that takes together; an edge over which light bends by more than
//! chance makes it bend has no say (robust weights of Geman and McClure 1987, found anew in every turn). The colours of a look stay, only its brightness changes.

use super::cells::Cell;
use super::grow::MeshGrowth;
use crate::light::lightness_sensitivity;
use glam::DVec3;
use std::collections::HashMap;

/// Lightness changes by so many CIE units when a brightness near that of white changes by all of it: the derivative of `116 h^(1/3)`.
const LIGHTNESS: f64 = 116.0 / 3.0;
/// Weight of an edge beside that of a look. With none, 4, 16 and 64 files at `--error 1` are off by .76, .72 and .71 dE00 in a garage (seed 0), .77, .71 with 16 and .74 with 64
/// (seed 1), by .347, .339 with 16 and .339 with 64 in a sunlit room.
const STRAIGHT: f64 = 16.0;
/// Triangles of which these normals are further apart lie on an edge of the room.
const FLAT: f64 = 0.99;
/// How often the weights of edges are found anew, and steps of conjugate gradients in between.
const TURNS: usize = 3;
const STEPS: usize = 24;
/// Or until the square of what is left is this part of the first.
const FOUND: f64 = 1e-6;
/// No look is moved by more than this factor: where it is as dark as its error, nothing is known of its colour.
const MOST: f64 = 2.0;

/// Four looks, and what their light sums to where it is straight across an edge: 0. Divided by the standard error of that sum.
struct Hinge {
    looks: [u32; 4],
    weights: [f64; 4],
}

impl Hinge {
    /// By how many standard errors light bends.
    fn bend(&self, light: &[f64]) -> f64 {
        let of = self.looks.iter().zip(self.weights);
        of.map(|(&look, w)| w * light[look as usize]).sum()
    }
}

impl MeshGrowth<'_> {
    /// Illuminance of every look, lx, without most of what chance makes of it.
    pub(super) fn smoothed(&self) -> Vec<f64> {
        let seen = |look: u32| self.looks.at(look).map_or(0.0, |seen| seen.xyz[1]);
        let own: Vec<f64> = (0..self.looks.len() as u32).map(seen).collect();
        if self.noise <= 0.0 {
            return own;
        }
        let white = self.white[1];
        let error = |(look, own): (u32, &f64)| {
            let usual =
                self.noise.sqrt() * white / (LIGHTNESS * lightness_sensitivity(own / white));
            usual * self.looks.variance(look).sqrt()
        };
        let errors: Vec<f64> = (0..).zip(&own).map(error).collect();
        let hinges = self.hinges(&errors);
        let light = nearly_straight(&hinges, &own, &errors).into_iter();
        let moved = light
            .zip(own)
            .map(|(light, own)| light.clamp(own / MOST, own * MOST));
        moved.collect()
    }

    /// The edges at which two triangles of a plane meet, all of whose corners are seen, and over which no shadow ends.
    fn hinges(&self, errors: &[f64]) -> Vec<Hinge> {
        let mut first: HashMap<(u32, u32), (usize, usize)> = HashMap::new();
        let mut hinges = Vec::new();
        for (k, cell) in self.cells.all.iter().enumerate() {
            for e in 0..3 {
                let edge = cell.edges[e];
                if self.cells.edges[edge as usize].sharp != 0 {
                    continue;
                }
                match first.remove(&(cell.sheet, edge)) {
                    None => {
                        first.insert((cell.sheet, edge), (k, e));
                    }
                    Some(other) => hinges.extend(self.hinge(other, (k, e), errors)),
                }
            }
        }
        hinges
    }

    /// Two triangles and the edges of them that are one.
    fn hinge(&self, one: (usize, usize), other: (usize, usize), errors: &[f64]) -> Option<Hinge> {
        let [one, other] = [one, other].map(|(k, e)| (&self.cells.all[k], e));
        let look = |cell: &Cell, c: usize| {
            let look = self.look(cell.sheet as usize, cell.corners[c].vertex)?;
            (self.looks.at(look)?.xyz[1] > 0.0).then_some(look)
        };
        let at = |cell: &Cell, c: usize| self.cells.points[cell.corners[c].point as usize];
        let [a, b, c] = [0, 1, 2].map(|k| (one.1 + k) % 3);
        let d = (other.1 + 2) % 3;
        let looks = [
            look(one.0, a)?,
            look(one.0, b)?,
            look(one.0, c)?,
            look(other.0, d)?,
        ];
        // The same looks on both sides, or light ends there.
        let ends = [look(other.0, other.1)?, look(other.0, (other.1 + 1) % 3)?];
        if !(ends.contains(&looks[0]) && ends.contains(&looks[1])) {
            return None;
        }
        let corners = [at(one.0, a), at(one.0, b), at(one.0, c)];
        let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).normalize_or_zero();
        let up = normal(corners);
        let of_other = normal([0, 1, 2].map(|k| at(other.0, k)));
        if up.dot(of_other) < FLAT {
            return None;
        }
        let [p, q, r] = corners.map(|corner| corner - at(other.0, d));
        let parts = [q.cross(r).dot(up), r.cross(p).dot(up), p.cross(q).dot(up)];
        let whole: f64 = parts.iter().sum();
        let weights = [parts[0] / whole, parts[1] / whole, parts[2] / whole, -1.0];
        let square = |(&look, w): (&u32, &f64)| (w * errors[look as usize]).powi(2);
        let error = looks.iter().zip(&weights).map(square).sum::<f64>().sqrt();
        let weights = weights.map(|w| w / error);
        weights
            .iter()
            .all(|w| w.is_finite())
            .then_some(Hinge { looks, weights })
    }
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
    use crate::solve::{Effort, GatherQuality};
    use crate::transport::tests::baked;

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

    /// In the triangles of a room, whatever their shapes.
    #[test]
    fn straight_light_bends_over_no_hinge() {
        let bake = baked("cornell.glb", 1);
        let mut growth = bake.growth(GatherQuality::Vertex(Effort::default()), &|| false);
        growth.begin(&|_, _| {});
        let mut light = vec![0.0; growth.looks.len()];
        for cell in &growth.cells.all {
            for corner in cell.corners {
                let look = growth.look(cell.sheet as usize, corner.vertex);
                let at = growth.cells.points[corner.point as usize];
                light[look.unwrap() as usize] = 5.0 + at.dot(DVec3::new(3.0, -2.0, 7.0));
            }
        }
        let hinges = growth.hinges(&vec![1.0; light.len()]);
        assert!(hinges.len() > 10, "{}", hinges.len());
        let far = light.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        for hinge in hinges {
            assert!(hinge.bend(&light).abs() < 1e-6 * far);
            let square: f64 = hinge.weights.iter().map(|w| w * w).sum();
            assert!((square - 1.0).abs() < 1e-9);
        }
    }

    /// Where nothing is known of its neighbours, a look is believed.
    #[test]
    fn without_hinges_light_is_what_was_seen() {
        let seen = [3.0, 0.0, 7.0];
        assert_eq!(nearly_straight(&[], &seen, &[1.0, 0.0, 2.0]), seen);
    }
}
