//! Moves vertices off their own light, so that the light drawn between them is right on average.
//!
//! Straight lines between points of a curve lie on one side of the curve: with vertices on the light itself rooms were drawn .5 to 1.5 %
//! too dark at `--error 1`, as light is highest where it bends most. Where it bends evenly over a triangle, lines miss on average a third
//! of what they miss in the middles of its three edges together (the rule of edge middles, exact to the second degree), and these were
//! looked at. Every vertex is moved by the mean of that over the triangles around it, by area; those at [rims](super::rims) otherwise.

use super::grow::MeshGrowth;
use super::rims::lacks;
use std::collections::HashMap;

/// Where lines miss more than this share of the light at the darkest corner of a triangle, they miss the edge of a shadow and not a curve, and no
/// vertex is moved: beside sun patches dark corners got up to twice their light, and streaks ran from them. With .1, .25 and .5 the error between
/// vertices is .250, .226 and .227 in two rooms, .292, .292 and .291 in cornell, .229, .233 and .233 in daylit, and the same in convex and gallery.
const MOST: f64 = 0.25;

impl MeshGrowth<'_> {
    /// For each look the one that vertices of it take their light from, nearly always itself, and a factor of that light. The same for all
    /// vertices of a look, so that there is no seam; only a factor, so that the light of each lamp keeps its share and can be changed
    /// afterwards.
    pub(super) fn fitted(&self) -> Vec<(u32, f32)> {
        let mut missed = vec![[0.0; 2]; self.looks.len()];
        let mut beyond: HashMap<u32, Vec<(u32, f64)>> = HashMap::new();
        let rims = self.rims();
        let light = self.smoothed();
        for cell in &self.cells.all {
            let sheet = cell.sheet as usize;
            let seen = |vertex: u32| {
                let look = self.look(sheet, vertex)?;
                self.looks.at(look).map(|_| (look, light[look as usize]))
            };
            let corners = cell.corners.map(|c| seen(c.vertex));
            let looked = |k: usize| self.cells.known_middle(cell, k).and_then(seen);
            let middle = |k: usize| {
                let [a, b] = [corners[k]?, corners[(k + 1) % 3]?];
                match looked(k) {
                    Some((_, middle)) => Some(middle - 0.5 * (a.1 + b.1)),
                    None => cell.doubt.missed[k].map(f64::from),
                }
            };
            let known: Vec<f64> = (0..3).filter_map(middle).collect();
            let lux = corners.into_iter().flatten().map(|(_, lux)| lux);
            let most = MOST * lux.fold(f64::INFINITY, f64::min);
            let mean = match known.iter().all(|missed| missed.abs() <= most) {
                true => known.iter().sum::<f64>() / known.len().max(1) as f64,
                false => 0.0,
            };
            for k in 0..3 {
                let edges = self.rim_edges(&rims, cell, k);
                let (Some(own), false) = (corners[k], edges.as_ref().is_some_and(Vec::is_empty))
                else {
                    continue;
                };
                let mut moved = mean;
                if let Some(edges) = edges {
                    let ends = edges.iter().map(|&[e, b]| Some((corners[b]?, looked(e)?)));
                    let known: Vec<_> = ends.flatten().collect();
                    beyond
                        .entry(own.0)
                        .or_default()
                        .extend(known.iter().map(|ends| ends.1));
                    let lacks = known.iter().map(|(b, m)| lacks([own.1, b.1, m.1]));
                    moved = moved.max(lacks.sum::<f64>() / edges.len() as f64);
                }
                let [sum, area] = &mut missed[own.0 as usize];
                (*sum, *area) = (*sum + cell.area * moved, *area + cell.area);
            }
        }
        let fitted = |(look, [missed, area]): (u32, [f64; 2])| {
            let own = self.looks.at(look).map_or(0.0, |seen| seen.xyz[1]);
            if own <= 0.0 || area <= 0.0 {
                return (look, 1.0);
            }
            let fit = (light[look as usize] + missed / area).max(0.0);
            let off = |(_, lux): &(u32, f64)| (lux - fit).abs();
            let all = beyond.get(&look).into_iter().flatten().copied();
            let best = all
                .filter(|(_, lux)| *lux > 0.0)
                .chain([(look, own)])
                .min_by(|a, b| off(a).total_cmp(&off(b)));
            best.map_or((look, 1.0), |(from, lux)| (from, (fit / lux) as f32))
        };
        (0..).zip(missed).map(fitted).collect()
    }
}
