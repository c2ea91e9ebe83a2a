//! Seams between charts over which light runs on: both sides are brought together.
//!
//! At places along every common edge the two look-ups should agree. With c the weights of the texels on both sides (those of the
//! other side negative), g the difference that is there and d the changes of texels, the sum over all places of
//! `(c . d + g)^2 + STAY |d|^2` is least where `(C^T C + STAY) d = -C^T g`, solved by conjugate gradients.

use super::charts::Chart;
use super::maps::PlacedCharts;
use super::texels::Texel;
use crate::gather::Vertex;
use crate::solve::Bake;
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, HashMap};

/// What staying as it is counts for, beside a place on a seam: a step of 1 is left at a hundredth.
const STAY: f64 = 0.01;
/// Places along an edge: so many for each texel, up to the most.
const PLACES: f64 = 2.0;
const MOST: f64 = 256.0;
/// Cosine of the angle between shading normals up to which light runs on: 1 degree.
const ALIKE: f64 = 0.99985;
/// Iterations at the most; a chain of texels along an edge is even after a few.
const ITERATIONS: usize = 64;
/// The residual's share at which it is done.
const DONE: f64 = 1e-4;
/// Numbers in a texel.
const WIDTH: usize = 6;

/// One side of an edge: chart, and the ends in its plane.
#[derive(Debug, Clone, Copy)]
struct Side {
    chart: usize,
    ends: [DVec2; 2],
    normals: [DVec3; 2],
    space: (u32, bool),
}

/// A place on a seam: texels (number among those that may change) with weights.
type Row = Vec<(usize, f64)>;
type TexelLight = [f64; WIDTH];

/// Texels that lie at seams.
#[derive(Default)]
struct Unknowns {
    known: HashMap<(usize, usize), usize>,
    texels: Vec<(usize, usize)>,
}

impl Unknowns {
    fn number(&mut self, chart: usize, texel: usize) -> usize {
        *self.known.entry((chart, texel)).or_insert_with(|| {
            self.texels.push((chart, texel));
            self.texels.len() - 1
        })
    }

    /// Adds the texels of a look-up.
    fn look_up(
        &mut self,
        placed: &PlacedCharts,
        chart: usize,
        at: DVec2,
        sign: f64,
        row: &mut Row,
    ) {
        let patch = &placed.patches[chart];
        let step = placed.step(chart, at);
        for (texel, weight) in patch.corners(step) {
            if weight > 0.0 {
                row.push((self.number(chart, texel), sign * weight));
            }
        }
    }
}

/// Brings the texels on both sides of seams together; how many places on seams there are.
pub(super) fn close(
    bake: &Bake,
    charts: &[Chart],
    spaces: &[(u32, bool)],
    placed: &mut PlacedCharts,
) -> usize {
    let (mut unknowns, mut rows) = (Unknowns::default(), Vec::new());
    for sides in edges(bake, charts, spaces).into_values() {
        for (k, a) in sides.iter().enumerate() {
            for b in &sides[k + 1..] {
                let same = a.chart == b.chart && a.ends == b.ends;
                let alike = (0..2).all(|end| a.normals[end].dot(b.normals[end]) > ALIKE);
                if same || !alike || a.space != b.space {
                    continue;
                }
                let texels = |s: &Side| {
                    placed
                        .step(s.chart, s.ends[0])
                        .distance(placed.step(s.chart, s.ends[1]))
                };
                let count = (PLACES * texels(a).max(texels(b))).ceil().clamp(1.0, MOST);
                for place in 0..count as usize {
                    let along = (place as f64 + 0.5) / count;
                    let mut row = Row::new();
                    for (side, sign) in [(a, 1.0), (b, -1.0)] {
                        let at = side.ends[0].lerp(side.ends[1], along);
                        unknowns.look_up(placed, side.chart, at, sign, &mut row);
                    }
                    rows.push(row);
                }
            }
        }
    }
    let before: Vec<TexelLight> = (unknowns.texels.iter())
        .map(|&(chart, texel)| flat(&placed.patches[chart].texels[texel]))
        .collect();
    let changes = solve(&rows, &before);
    for ((chart, texel), (before, change)) in unknowns
        .texels
        .into_iter()
        .zip(before.into_iter().zip(changes))
    {
        let light: TexelLight =
            std::array::from_fn(|c| (before[c] + change[c]).max(before[c].min(0.0)));
        placed.patches[chart].texels[texel] = Texel {
            irradiance: [light[0], light[1], light[2]].map(|x| x as f32),
            light: [light[3], light[4], light[5]].map(|x| x as f32),
        };
    }
    rows.len()
}

fn flat(texel: &Texel) -> TexelLight {
    let [x, y, z] = texel.irradiance.map(f64::from);
    let [r, g, b] = texel.light.map(f64::from);
    [x, y, z, r, g, b]
}

/// Sides of every edge that more than one triangle has, in different places of the plane.
fn edges(bake: &Bake, charts: &[Chart], spaces: &[(u32, bool)]) -> BTreeMap<[u32; 2], Vec<Side>> {
    let mut all: BTreeMap<[u32; 2], Vec<Side>> = BTreeMap::new();
    for (number, chart) in charts.iter().enumerate() {
        let normal = |v: &Vertex| bake.texel(v, chart.surface, chart.back).normal;
        for (facet, flat) in chart.facets.iter().zip(&chart.flat) {
            for k in 0..3 {
                let mut ends = [k, (k + 1) % 3].map(|k| {
                    let corner = facet.corners[k] as usize;
                    (
                        chart.points[corner].0,
                        flat[k],
                        normal(&chart.corner(facet, k)),
                    )
                });
                ends.sort_by_key(|end| end.0);
                let space = spaces
                    .get(facet.entry as usize)
                    .copied()
                    .unwrap_or_default();
                let side = Side {
                    chart: number,
                    ends: ends.map(|e| e.1),
                    normals: ends.map(|e| e.2),
                    space,
                };
                all.entry(ends.map(|e| e.0)).or_default().push(side);
            }
        }
    }
    all.retain(|_, sides| {
        let first = (sides[0].chart, sides[0].ends);
        sides.iter().any(|s| (s.chart, s.ends) != first)
    });
    all
}

/// Changes of texels that close the seams.
fn solve(rows: &[Row], before: &[TexelLight]) -> Vec<TexelLight> {
    let zero = [0.0; WIDTH];
    let product = |x: &[TexelLight]| {
        let mut out: Vec<TexelLight> = x.iter().map(|x| x.map(|x| STAY * x)).collect();
        for row in rows {
            let there = dot(row, x);
            for &(k, w) in row {
                (0..WIDTH).for_each(|c| out[k][c] += w * there[c]);
            }
        }
        out
    };
    let mut residual = vec![zero; before.len()];
    for row in rows {
        let gap = dot(row, before);
        for &(k, w) in row {
            (0..WIDTH).for_each(|c| residual[k][c] -= w * gap[c]);
        }
    }
    let squares = |x: &[TexelLight], y: &[TexelLight]| -> TexelLight {
        std::array::from_fn(|c| x.iter().zip(y).map(|(x, y)| x[c] * y[c]).sum())
    };
    let mut found = vec![zero; before.len()];
    let mut direction = residual.clone();
    let first = squares(&residual, &residual);
    let mut square = first;
    for _ in 0..ITERATIONS {
        if (0..WIDTH).all(|c| square[c] <= DONE * DONE * first[c]) {
            break;
        }
        let ahead = product(&direction);
        let bend = squares(&direction, &ahead);
        let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
        for k in 0..found.len() {
            for c in 0..WIDTH {
                let step = ratio(square[c], bend[c]);
                found[k][c] += step * direction[k][c];
                residual[k][c] -= step * ahead[k][c];
            }
        }
        let next = squares(&residual, &residual);
        for (direction, residual) in direction.iter_mut().zip(&residual) {
            *direction =
                std::array::from_fn(|c| residual[c] + ratio(next[c], square[c]) * direction[c]);
        }
        square = next;
    }
    found
}

fn dot(row: &Row, x: &[TexelLight]) -> TexelLight {
    let mut sum = [0.0; WIDTH];
    for &(k, w) in row {
        (0..WIDTH).for_each(|c| sum[c] += w * x[k][c]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_shared_by_both_sides() {
        let row: Row = vec![(0, 1.0), (1, -1.0)];
        let changes = solve(&[row], &[[1.0; WIDTH], [3.0; WIDTH]]);
        for (a, b) in changes[0].iter().zip(changes[1]) {
            assert!((a - 1.0).abs() < 0.01 && (b + 1.0).abs() < 0.01, "{a} {b}");
        }
    }
}
