//! Moves vertices off their own light, so that the light drawn between them is right on average.
//!
//! Straight lines between points of a curve lie on one side of the curve: with vertices on the light itself rooms were drawn .5 to 1.5 %
//! too dark at `--error 1`, as light is highest where it bends most. Where it bends evenly over a triangle, lines miss on average a third
//! of what they miss in the middles of its three edges together (the rule of edge middles, exact to the second degree), and these were
//! looked at. Every vertex is moved by the mean of that over the triangles around it, by area; those at [rims](super::rims) otherwise.

use super::grow::MeshGrowth;

/// Where lines miss more than this share of the light at the darkest corner of a triangle, they miss the edge of a shadow and not a curve, and no
/// vertex is moved: beside sun patches dark corners got up to twice their light, and streaks ran from them. With .1, .25 and .5 the error between
/// vertices is .250, .226 and .227 in two rooms, .292, .292 and .291 in cornell, .229, .233 and .233 in daylit, and the same in convex and gallery.
const MOST: f64 = 0.25;

impl MeshGrowth<'_> {
    /// Factor of the light of each look where it belongs to a vertex. The same for all vertices of a look, so that there is no seam;
    /// only a factor, so that the light of each lamp keeps its share and can be changed afterwards.
    pub(super) fn fitted(&self) -> Vec<f32> {
        let mut missed = vec![[0.0; 2]; self.looks.len()];
        let mut at_rim = vec![[0.0; 2]; self.looks.len()];
        let rims = self.rims();
        for (number, cell) in self.cells.all.iter().enumerate() {
            let sheet = cell.sheet as usize;
            let seen = |vertex: u32| {
                let look = self.look(sheet, vertex)?;
                Some((look as usize, self.looks.at(look)?.xyz[1]))
            };
            let corners = cell.corners.map(|c| seen(c.vertex));
            let middle = |k: usize| {
                let [a, b] = [corners[k]?, corners[(k + 1) % 3]?];
                let known = self.cells.known_middle(cell, k).and_then(seen);
                match known {
                    Some((_, middle)) => Some(middle - 0.5 * (a.1 + b.1)),
                    None => cell.doubt.missed[k].map(f64::from),
                }
            };
            for [a, b, e] in self.rim_edges(&rims, number) {
                let middle = self.cells.known_middle(cell, e).and_then(seen);
                if let (Some((look, own)), Some((_, other)), Some((_, middle))) =
                    (corners[a], corners[b], middle)
                {
                    at_rim[look][0] += cell.area * Self::lacks([own, other, middle]);
                    at_rim[look][1] += cell.area;
                }
            }
            let known: Vec<f64> = (0..3).filter_map(middle).collect();
            let lux = corners.into_iter().flatten().map(|(_, lux)| lux);
            let most = MOST * lux.fold(f64::INFINITY, f64::min);
            let mean = match known.iter().all(|missed| missed.abs() <= most) {
                true => known.iter().sum::<f64>() / known.len().max(1) as f64,
                false => 0.0,
            };
            for (look, _) in corners.into_iter().flatten() {
                missed[look][0] += cell.area * mean;
                missed[look][1] += cell.area;
            }
        }
        let factor = |(look, within): (usize, [f64; 2])| {
            let [missed, area] = match at_rim[look][0] > 0.0 {
                true => at_rim[look],
                false => within,
            };
            let own = self.looks.at(look as u32).map_or(0.0, |seen| seen.xyz[1]);
            match missed != 0.0 && own > 0.0 && area > 0.0 {
                true => (1.0 + missed / (area * own)) as f32,
                false => 1.0,
            }
        };
        missed.into_iter().enumerate().map(factor).collect()
    }
}
