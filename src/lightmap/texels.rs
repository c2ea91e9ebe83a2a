//! The texels of a chart: what was looked at as it is, the rest interpolated in its cell, what is off the chart filled up.

use super::cells::{ChartCell, DEPTH, Lattice, bilinear};
use glam::DVec2;
use std::collections::{BTreeMap, HashMap, VecDeque};

/// A texel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Texel {
    /// Tristimulus irradiance, lm/m2 (Y: lx).
    pub irradiance: [f32; 3],
    /// What times the paint's texture and vertex colour is the radiosity, as at vertices: linear sRGB, lm/m2.
    pub light: [f32; 3],
}

impl Texel {
    /// The mean of some.
    pub(super) fn mean(some: &[Self]) -> Self {
        let weight = 1.0 / some.len() as f64;
        Self::mix(&some.iter().map(|t| (weight, *t)).collect::<Vec<_>>())
    }

    /// Sum of weights times texels.
    pub(super) fn mix(parts: &[(f64, Self)]) -> Self {
        let sum = |get: fn(&Self) -> [f32; 3], c: usize| {
            parts
                .iter()
                .map(|(w, t)| w * f64::from(get(t)[c]))
                .sum::<f64>() as f32
        };
        Self {
            irradiance: [0, 1, 2].map(|c| sum(|t| t.irradiance, c)),
            light: [0, 1, 2].map(|c| sum(|t| t.light, c)),
        }
    }
}

/// Texels of a chart without margins.
#[derive(Debug, Clone, Default)]
pub(super) struct ChartTexels {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) texels: Vec<Texel>,
}

/// A texel by its chart and place in the lattice.
pub(super) type TexelKey = (u32, [u32; 2]);

/// Light at corners of cells; none where something covers the place.
pub(super) type Corners<T> = BTreeMap<[u32; 2], Option<T>>;

/// Gives covered corners the mean of the other corners of their cells, ring by ring; how many there were. What no light
/// surrounds stays dark.
pub(super) fn lend<T: Copy + Default>(
    corners: &mut Corners<T>,
    cells: &[&ChartCell],
    mean: impl Fn(&[T]) -> T,
) -> usize {
    let dark = corners.values().filter(|t| t.is_none()).count();
    if dark == 0 {
        return 0;
    }
    loop {
        let mut lent: BTreeMap<[u32; 2], Vec<T>> = BTreeMap::new();
        for cell in cells {
            let points = cell.corners();
            let known: Vec<T> = points.iter().filter_map(|p| *corners.get(p)?).collect();
            let lacking = points
                .iter()
                .filter(|p| corners.get(*p).is_some_and(Option::is_none));
            for point in lacking {
                lent.entry(*point).or_default().extend(&known);
            }
        }
        lent.retain(|_, known| !known.is_empty());
        if lent.is_empty() {
            corners
                .values_mut()
                .for_each(|t| *t = Some(t.unwrap_or_default()));
            return dark;
        }
        for (point, known) in lent {
            corners.insert(point, Some(mean(&known)));
        }
    }
}

/// The texels of a chart from the corners of its cells, all of which are known.
pub(super) fn patch(
    lattice: &Lattice,
    cells: &[&ChartCell],
    corners: &Corners<Texel>,
) -> ChartTexels {
    let [width, height] = lattice.texels([0, 0]);
    if lattice.single {
        let known = corners.values().next().copied().flatten();
        return ChartTexels {
            width,
            height,
            texels: vec![known.unwrap_or_default()],
        };
    }
    let mut texels: Vec<Option<Texel>> = vec![None; width * height];
    // Finer cells know better what lies on an edge with a coarser one.
    let mut order: Vec<&&ChartCell> = cells.iter().collect();
    order.sort_by_key(|c| (c.level[0] + c.level[1], c.low));
    let step = lattice
        .finest
        .map(|level| 1_u32 << (DEPTH - u32::from(level)));
    for cell in order {
        let [a, b, c, d] = cell
            .corners()
            .map(|p| corners.get(&p).copied().flatten().unwrap_or_default());
        let span = cell.span();
        let [nx, ny] = [0, 1].map(|k| span[k] / step[k]);
        let [x0, y0] = [0, 1].map(|k| (cell.low[k] / step[k]) as usize);
        for y in 0..=ny {
            for x in 0..=nx {
                let share = DVec2::new(f64::from(x) / f64::from(nx), f64::from(y) / f64::from(ny));
                let [wa, wb, wc, wd] = bilinear(share);
                let texel = Texel::mix(&[(wa, a), (wb, b), (wc, c), (wd, d)]);
                texels[(y0 + y as usize) * width + x0 + x as usize] = Some(texel);
            }
        }
    }
    // Corners of finer cells that lie on an edge of theirs are texels of their own.
    for (point, texel) in corners {
        if [0, 1].iter().all(|&k| point[k] % step[k] == 0) {
            let [x, y] = [0, 1].map(|k| (point[k] / step[k]) as usize);
            texels[y * width + x] = *texel;
        }
    }
    ChartTexels {
        width,
        height,
        texels: filled(texels, width, height),
    }
}

/// Fills what is empty with the nearest texels, ring by ring: means of the neighbours in the ring before.
fn filled(mut texels: Vec<Option<Texel>>, width: usize, height: usize) -> Vec<Texel> {
    let near = |k: usize| {
        let (x, y) = ((k % width) as isize, (k / width) as isize);
        let around = [
            (-1, 0),
            (1, 0),
            (0, -1),
            (0, 1),
            (-1, -1),
            (1, -1),
            (-1, 1),
            (1, 1),
        ];
        around.into_iter().filter_map(move |(dx, dy)| {
            let (x, y) = (x + dx, y + dy);
            let inside = x >= 0 && y >= 0 && x < width as isize && y < height as isize;
            inside.then_some(y as usize * width + x as usize)
        })
    };
    let mut queue: VecDeque<(usize, u32)> = VecDeque::new();
    let mut ring: HashMap<usize, u32> = HashMap::new();
    for k in (0..texels.len()).filter(|&k| texels[k].is_none()) {
        if near(k).any(|n| texels[n].is_some()) {
            queue.push_back((k, 1));
            ring.insert(k, 1);
        }
    }
    while let Some((k, of)) = queue.pop_front() {
        // Texels of the same ring do not count, so that the order does not.
        let known: Vec<Texel> = near(k)
            .filter(|n| ring.get(n).is_none_or(|r| *r < of))
            .filter_map(|n| texels[n])
            .collect();
        texels[k] = Some(Texel::mean(&known));
        for n in near(k).filter(|&n| texels[n].is_none()) {
            if let std::collections::hash_map::Entry::Vacant(entry) = ring.entry(n) {
                entry.insert(of + 1);
                queue.push_back((n, of + 1));
            }
        }
    }
    texels.into_iter().map(Option::unwrap_or_default).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texel(x: f32) -> Texel {
        Texel {
            irradiance: [x; 3],
            light: [x; 3],
        }
    }

    #[test]
    fn empty_texels_get_the_nearest_light() {
        let mut texels = vec![None; 15];
        texels[5] = Some(texel(1.0));
        texels[9] = Some(texel(3.0));
        let filled = filled(texels, 5, 3);
        assert_eq!(filled[0], texel(1.0));
        assert_eq!(filled[4], texel(3.0));
        assert_eq!(filled[7], texel(2.0));
    }
}
