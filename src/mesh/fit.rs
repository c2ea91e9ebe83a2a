//! Vertices moved off their own light, so that what is drawn between them is right in the mean.
//!
//! Lines between points of light that bends lie on one side of it: with vertices on the light itself rooms were drawn .5 to 1.5 %
//! too dark at `--error 1`, as light is highest where it bends most. Where it bends evenly over a triangle, what lines miss is in the mean
//! a third of what they miss in the middles of its three edges together (the rule of edge middles, exact to the second degree), and
//! those were looked at. Every vertex takes the mean of that over the triangles around it, by area.

use super::grow::Growth;

/// Where lines miss more than this share of the light at the darkest corner of a triangle, it is no curve but the edge of a shadow, and moves no
/// vertex: beside sun patches dark corners got to twice their light, and streaks ran from them. With .1, .25 and .5 the error between
/// vertices is .250, .226 and .227 in two rooms, .292, .292 and .291 in cornell, .229, .233 and .233 in daylit, and the same in convex and gallery.
const MOST: f64 = 0.25;

impl Growth<'_> {
    /// What the light of each look is to be multiplied by where it is a vertex. Alike for all vertices of a look, so that there is no
    /// seam; a factor alone, so that light of each lamp keeps its part and can be changed afterwards.
    pub(super) fn fitted(&self) -> Vec<f32> {
        let mut missed = vec![[0.0; 2]; self.looks.len()];
        for cell in &self.cells.all {
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
        let factor = |(look, [missed, area]): (usize, [f64; 2])| {
            let own = self.looks.at(look as u32).map_or(0.0, |seen| seen.xyz[1]);
            match missed != 0.0 && own > 0.0 && area > 0.0 {
                true => (1.0 + missed / (area * own)) as f32,
                false => 1.0,
            }
        };
        missed.into_iter().enumerate().map(factor).collect()
    }
}
