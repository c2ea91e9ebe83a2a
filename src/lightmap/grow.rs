//! Texels where a bilinear look-up is not what looking there shows.
//!
//! As the mesh of vertices grows: every cell has a mean square of the colour difference between both, times its area its share
//! of the error: first as the solved light lets it expect, then as seen in the middles of its edges and inside. The cells that are
//! worth most (`worth`) are looked at or, where that is done, split along the axes that bend. A chart has as many texels as its finest cell
//! asks for; what the looks of a coarse cell say of the texels in it is interpolated, so smooth parts of a chart with a shadow
//! on it cost bytes but no rays.

use super::cells::{ChartCell, ChartCellError, Lattice, bilinear, first};
use super::charts::Chart;
use super::maps::{MARGIN, margin};
use super::sampler::{LatticeSample, Sampler};
use super::texels::{Corners, TexelKey, lend};
use crate::color::seen_difference;
use crate::mesh::hints::counting;
use crate::mesh::turns::{BY_CHANCE, GrowthOutcome, RANGE};
use crate::solve::Bake;
use glam::DVec2;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Cells are no longer than this share of the room's half diagonal at the beginning, so that what no leaf tells of is found.
const LONGEST: f64 = 0.125;
/// Charts smaller than this share of the room's half diagonal are one texel, until that proves wrong.
const TINY: f64 = 0.02;
/// What remains of the mean square of an axis when it is halved: 1/16 for smooth light, 1/2 for an edge.
const SHRINK: f64 = 0.125;

/// What the solved light says at a place of a chart.
#[derive(Debug, Clone, Copy)]
struct ChartHint {
    area: f64,
    /// Share of it that counts.
    counts: f64,
    /// What of it others see.
    open: f64,
    light: [f64; 3],
}

/// What may be spent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    /// Looks at light.
    pub(super) looks: usize,
    /// Texels of all charts, their margins included.
    pub(super) texels: usize,
    /// Texels along an axis of a page.
    pub(super) page: usize,
}

/// Charts with texels that grow.
pub(super) struct LightmapGrowth<'a> {
    pub(super) charts: Vec<Chart>,
    pub(super) lattices: Vec<Lattice>,
    pub(super) cells: Vec<ChartCell>,
    pub(super) sampler: Sampler<'a>,
    pub(super) budget: Budget,
    hints: Vec<Vec<ChartHint>>,
    hints_at: Vec<Vec<DVec2>>,
    /// Light lent to covered corners of cells.
    lent: HashMap<TexelKey, [f64; 3]>,
    pub(super) white: [f64; 3],
    /// Mean square of a cell until something is known of it.
    pub(super) unknown: f64,
    /// Variance of a look of the usual effort, by chance.
    pub(super) noise: f64,
    /// What the light of looks is multiplied by where it is shown, so that what they differ by through chance is evened out.
    pub(super) factors: Vec<f32>,
}

impl<'a> LightmapGrowth<'a> {
    pub(super) fn new(
        bake: &Bake,
        charts: Vec<Chart>,
        sampler: Sampler<'a>,
        budget: Budget,
    ) -> Self {
        let half = bake.mesh().half_size;
        let most = budget.page.saturating_sub(2 * MARGIN);
        let mut growth = Self {
            lattices: Vec::with_capacity(charts.len()),
            cells: Vec::new(),
            sampler,
            budget,
            hints: Vec::new(),
            hints_at: Vec::new(),
            lent: HashMap::new(),
            white: bake.light().white,
            unknown: 0.0,
            noise: 0.0,
            factors: Vec::new(),
            charts: Vec::new(),
        };
        for (k, chart) in charts.iter().enumerate() {
            let (hints, at) = told_by(bake, chart);
            // A single look at what nobody sees, unless that proves wrong.
            let is_hidden = !hints.is_empty() && hints.iter().all(|h| h.open <= 0.0);
            let tiny = if is_hidden {
                f64::INFINITY
            } else {
                TINY * half
            };
            let lattice = Lattice::new(chart.size, LONGEST * half, tiny, most);
            let cells = first(k as u32, chart, &lattice, &at);
            growth.cells.extend(counted(cells, &hints));
            growth.lattices.push(lattice);
            growth.hints.push(hints);
            growth.hints_at.push(at);
        }
        growth.charts = charts;
        growth
    }

    pub(super) fn difference(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        seen_difference(a, b, self.white)
    }

    fn want(&mut self, cell: usize, point: [u32; 2]) -> LatticeSample {
        let (cell, chart) = (&self.cells[cell], self.cells[cell].chart);
        let (k, area) = (chart as usize, cell.per_look());
        self.sampler
            .want((chart, &self.charts[k]), &self.lattices[k], point, area)
    }

    /// Variance of the light drawn at a place of a cell, by chance, in variances of a look of the usual effort.
    pub(super) fn variance(&self, cell: &ChartCell, share: DVec2) -> f64 {
        let lattice = &self.lattices[cell.chart as usize];
        let weights = match lattice.single {
            true => [1.0, 0.0, 0.0, 0.0],
            false => bilinear(share),
        };
        let corner = |(point, w): ([u32; 2], f64)| {
            let sample = self.sampler.known(cell.chart, lattice, point);
            w * w * sample.map_or(0.0, |sample| self.sampler.looks.variance(sample.look))
        };
        cell.corners().into_iter().zip(weights).map(corner).sum()
    }

    /// What was seen at a corner of a cell.
    fn seen_at(&self, cell: &ChartCell, corner: [u32; 2]) -> Option<[f64; 3]> {
        let lattice = &self.lattices[cell.chart as usize];
        let sample = self.sampler.known(cell.chart, lattice, corner)?;
        self.sampler.seen(sample)
    }

    /// Light at the corners of a cell; what is covered has what is lent to it, as in the map.
    fn light(&self, cell: &ChartCell) -> [[f64; 3]; 4] {
        cell.corners().map(|corner| {
            let lent = || self.lent.get(&(cell.chart, corner)).copied();
            let seen = self.seen_at(cell, corner);
            seen.or_else(lent).unwrap_or_default()
        })
    }

    /// Is a corner of a cell seen?
    fn is_bare(&self, cell: &ChartCell) -> bool {
        let mut corners = cell.corners().into_iter();
        corners.any(|corner| self.seen_at(cell, corner).is_some())
    }

    /// Can anybody see anything of a cell?
    pub(super) fn is_seen(&self, cell: &ChartCell) -> bool {
        let hints = &self.hints[cell.chart as usize];
        self.is_bare(cell) || cell.hints.iter().any(|&h| hints[h as usize].open > 0.0)
    }

    /// Lends covered corners of the charts of some cells the light of their neighbours.
    fn lend(&mut self, fresh: &[usize]) {
        let touched: BTreeSet<u32> = fresh.iter().map(|&k| self.cells[k].chart).collect();
        let mut cells: BTreeMap<u32, Vec<&ChartCell>> = BTreeMap::new();
        for cell in self.cells.iter().filter(|c| touched.contains(&c.chart)) {
            cells.entry(cell.chart).or_default().push(cell);
        }
        let lent: Vec<(TexelKey, [f64; 3])> = cells
            .par_iter()
            .flat_map_iter(|(&chart, cells)| {
                let corners = cells.iter().flat_map(|cell| {
                    let seen = |corner| (corner, self.seen_at(cell, corner));
                    cell.corners().map(seen)
                });
                let mut corners: Corners<[f64; 3]> = corners.collect();
                let covered: Vec<[u32; 2]> = (corners.iter())
                    .filter_map(|(at, seen)| seen.is_none().then_some(*at))
                    .collect();
                lend(&mut corners, cells, |some| {
                    [0, 1, 2].map(|c| some.iter().map(|x| x[c]).sum::<f64>() / some.len() as f64)
                });
                let lent = move |at| ((chart, at), corners[&at].unwrap_or_default());
                covered.into_iter().map(lent)
            })
            .collect();
        self.lent.extend(lent);
    }

    /// Counted area of all cells of which anybody can see anything: what the error is a mean over.
    pub(super) fn seen_area(&self) -> f64 {
        let seen = self.cells.iter().filter(|c| self.is_seen(c));
        seen.map(ChartCell::counted).sum()
    }

    /// Mean square of what the solved light differs by, as far as others see it, and its worst place.
    fn told(&self, cell: &ChartCell, light: &[[f64; 3]; 4]) -> (f64, Option<(DVec2, f64)>) {
        let k = cell.chart as usize;
        let (mut sum, mut area, mut worst) = (0.0, 0.0, None::<(DVec2, f64)>);
        for &h in &cell.hints {
            let (hint, at) = (&self.hints[k][h as usize], self.hints_at[k][h as usize]);
            let drawn = mix(light, cell.share(&self.lattices[k], at));
            let d = self.difference(drawn, hint.light);
            sum += hint.area * hint.open * d * d;
            area += hint.area;
            if hint.open > 0.0 && worst.is_none_or(|(_, most)| d > most) {
                worst = Some((at, d));
            }
        }
        (if area > 0.0 { sum / area } else { 0.0 }, worst)
    }

    /// Looks at the corners of cells, and what the solved light lets expect in them.
    fn expect(&mut self, fresh: &[usize], beginning: bool, progress: &dyn Fn(usize, usize)) {
        for &k in fresh {
            for corner in self.cells[k].corners() {
                self.want(k, corner);
            }
        }
        self.sampler.looks.complete(progress);
        self.lend(fresh);
        let expected: Vec<f64> = fresh
            .par_iter()
            .map(|&k| {
                let cell = &self.cells[k];
                if !self.is_seen(cell) {
                    return 0.0;
                }
                let light = self.light(cell);
                let told = self.told(cell, &light).0;
                if beginning {
                    let range = (1..4).map(|c| self.difference(light[0], light[c]));
                    let range = RANGE * range.fold(0.0, f64::max);
                    return told.max(range * range).max(self.unknown);
                }
                cell.doubt.square.max(told * cell.doubt.trust.powi(2))
            })
            .collect();
        for (&k, square) in fresh.iter().zip(expected) {
            let doubt = &mut self.cells[k].doubt;
            doubt.square = square;
            if beginning {
                doubt.trust = 1.0;
            }
        }
    }

    /// The first looks.
    pub(super) fn begin(&mut self, progress: &dyn Fn(usize, usize)) {
        let all: Vec<usize> = (0..self.cells.len()).collect();
        self.expect(&all, true, progress);
    }

    /// Sum of all shares.
    pub(super) fn sum(&self) -> f64 {
        self.cells.iter().map(share).sum()
    }

    /// Texels of all charts with their margins.
    pub(super) fn texels(&self) -> usize {
        self.lattices.iter().map(|l| taken(l, [0, 0])).sum()
    }

    /// Grows until the sum of all shares is at most `goal`.
    pub(super) fn grow(&mut self, goal: f64, progress: &dyn Fn(usize, usize)) -> GrowthOutcome {
        loop {
            let excess = self.sum() - goal;
            if excess <= 0.0 {
                return GrowthOutcome::Reached;
            }
            if self.sampler.looks.is_late() {
                return GrowthOutcome::Late;
            }
            if self.sampler.looks.len() >= self.budget.looks {
                return GrowthOutcome::Most;
            }
            let picked = self.pick(excess);
            if picked.is_empty() {
                return GrowthOutcome::Smallest;
            }
            let is_tested = |&k: &usize| self.cells[k].doubt.tested;
            let (tested, untested): (Vec<usize>, Vec<usize>) =
                picked.into_iter().partition(is_tested);
            self.test(&untested, progress);
            self.split(tested, progress);
        }
    }

    fn split(&mut self, tested: Vec<usize>, progress: &dyn Fn(usize, usize)) {
        let mut fresh = Vec::new();
        for k in tested {
            let children = self.children(k);
            let mut children = children.into_iter();
            let Some(first) = children.next() else {
                // Nothing of the chart lies in it but for rounding.
                self.cells[k].doubt.square = 0.0;
                continue;
            };
            self.cells[k] = first;
            fresh.push(k);
            for child in children {
                fresh.push(self.cells.len());
                self.cells.push(child);
            }
        }
        self.expect(&fresh, false, progress);
    }

    /// What a tested cell becomes.
    fn children(&mut self, k: usize) -> Vec<ChartCell> {
        let number = self.cells[k].chart as usize;
        let (chart, hints) = (&self.charts[number], &self.hints_at[number]);
        let lattice = &mut self.lattices[number];
        let doubt = self.cells[k].doubt;
        let heir = |cell: ChartCell, square: f64| ChartCell {
            doubt: ChartCellError {
                square,
                trust: doubt.trust,
                ..ChartCellError::default()
            },
            ..cell
        };
        if lattice.single {
            *lattice = lattice.opened();
            let cells = first(number as u32, chart, lattice, hints);
            return counted(cells, &self.hints[number])
                .into_iter()
                .map(|c| heir(c, SHRINK * doubt.square))
                .collect();
        }
        // Another cell may have taken the room since this one was picked.
        let Some(axes) = self.axes(&self.cells[k]) else {
            return vec![self.cells[k].clone()];
        };
        let more = self.more(&self.cells[k], axes);
        let lattice = &mut self.lattices[number];
        lattice.finest = [0, 1].map(|axis| lattice.finest[axis] + more[axis]);
        let squares = doubt.bent.map(|bent| bent * bent + f64::MIN_POSITIVE);
        let kept = [0, 1].map(|axis| if axes[axis] { SHRINK } else { 1.0 });
        let left = (squares[0] * kept[0] + squares[1] * kept[1]) / (squares[0] + squares[1]);
        let cells = self.cells[k].split(chart, lattice, hints, axes);
        counted(cells, &self.hints[number])
            .into_iter()
            .map(|c| heir(c, left * doubt.square))
            .collect()
    }

    /// Looks at light in the middles of edges and inside.
    fn test(&mut self, cells: &[usize], progress: &dyn Fn(usize, usize)) {
        let mut asked = Vec::with_capacity(cells.len());
        for &k in cells {
            let number = self.cells[k].chart as usize;
            let lattice = self.lattices[number];
            let chart = &self.charts[number];
            if lattice.single {
                // Corners of the rectangle, or what of the chart is nearest to them.
                let places = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
                let area = self.cells[k].per_look();
                let places = places.map(|at| DVec2::from(at) * chart.size);
                let samples = places.map(|at| self.sampler.want_at(chart, at, area));
                asked.push((samples.to_vec(), None, 0.0));
                continue;
            }
            let middles = [[1, 0], [1, 2], [0, 1], [2, 1], [1, 1]];
            let middles = middles.map(|halves| self.want(k, self.cells[k].point(halves)));
            let light = self.light(&self.cells[k]);
            let (told, worst) = self.told(&self.cells[k], &light);
            let cell = &self.cells[k];
            let is_inside = |sample: &LatticeSample| within(cell.share(&lattice, sample.at));
            let few = middles.iter().filter(|s| is_inside(s)).count() < 2;
            let (chart, lattice) = (&self.charts[number], &self.lattices[number]);
            let inside = match worst.filter(|(_, d)| cell.hints.len() > 1 && *d > 0.0) {
                Some((at, most)) => Some((at, most)),
                None if few => Some((self.cells[k].clone().clip(chart, lattice), 0.0)),
                None => None,
            };
            let area = cell.per_look();
            let inside = inside.map(|(at, most)| (self.sampler.want_at(chart, at, area), most));
            asked.push((middles.to_vec(), inside, told));
        }
        self.sampler.looks.complete(progress);
        for (&k, (middles, inside, told)) in cells.iter().zip(asked) {
            self.cells[k].doubt = self.judged(&self.cells[k], &middles, inside, told);
        }
    }

    /// What is known of a cell now, from looks in it.
    fn judged(
        &self,
        cell: &ChartCell,
        middles: &[LatticeSample],
        inside: Option<(LatticeSample, f64)>,
        told: f64,
    ) -> ChartCellError {
        let lattice = &self.lattices[cell.chart as usize];
        let hidden = |sample: &LatticeSample| self.sampler.seen(sample).is_none();
        if !self.is_bare(cell) && middles.iter().all(hidden) {
            // It lies below something.
            return ChartCellError {
                tested: true,
                ..ChartCellError::default()
            };
        }
        let light = self.light(cell);
        let off = |sample: &LatticeSample| {
            let share = cell.share(lattice, sample.at);
            if !within(share) {
                return None;
            }
            let off = self.difference(mix(&light, share), self.sampler.seen(sample)?);
            // What chance alone may do is no bend.
            let own = self.sampler.looks.variance(sample.look);
            let chance = self.noise * (own + self.variance(cell, share));
            Some((off * off - BY_CHANCE * chance).max(0.0).sqrt())
        };
        let seen: Vec<Option<f64>> = middles.iter().map(off).collect();
        let count = seen.iter().flatten().count();
        let mean = seen.iter().flatten().map(|d| d * d).sum::<f64>() / count.max(1) as f64;
        let worst = |some: &[Option<f64>]| some.iter().flatten().copied().fold(0.0, f64::max);
        let bent = match seen.len() {
            5 => [worst(&seen[..2]), worst(&seen[2..4])],
            _ => [worst(&seen); 2],
        };
        let extra = inside.as_ref().and_then(|(sample, _)| off(sample));
        let before = cell.doubt.trust;
        let (square, trust) = match (inside, extra) {
            (Some((_, most)), Some(extra)) if most > 0.0 => {
                let trust = (extra / most).min(1.0);
                (mean.max(trust * trust * told), trust)
            }
            (_, Some(extra)) => (
                (mean * count as f64 + extra * extra) / (count as f64 + 1.0),
                before,
            ),
            (_, None) if count == 0 => (cell.doubt.square, before),
            (_, None) => (mean, before),
        };
        let inside = seen
            .get(4)
            .copied()
            .flatten()
            .into_iter()
            .chain(extra)
            .fold(0.0, f64::max);
        ChartCellError {
            square,
            tested: true,
            bent,
            inside: inside.max(if count == 0 { square.sqrt() } else { 0.0 }),
            trust,
        }
    }
}

/// Light and leaves of the hierarchy in a chart.
fn told_by(bake: &Bake, chart: &Chart) -> (Vec<ChartHint>, Vec<DVec2>) {
    let (tree, light) = (bake.tree(), bake.light());
    let (mut hints, mut places) = (Vec::new(), Vec::new());
    for (k, facet) in chart.facets.iter().enumerate() {
        if facet.entry == crate::hierarchy::NONE {
            continue;
        }
        let face = tree.face_node[facet.entry as usize];
        let area = bake.mesh().area[facet.triangle as usize];
        crate::mesh::hints::leaves(tree, face, chart.back, area, |leaf, [v, w], area| {
            let known = light.leaves.binary_search(&leaf).ok();
            if let Some(place) = known.filter(|place| *place < light.irradiance.len()) {
                hints.push(ChartHint {
                    area,
                    counts: tree.node(leaf).counted / tree.node(leaf).area,
                    open: bake.openness(leaf),
                    light: bake.lanes().tristimulus(light.irradiance.row(place)),
                });
                places.push(chart.at(k as u32, [1.0 - v - w, v, w]));
            }
        });
    }
    (hints, places)
}

/// What a cell adds to the mean square, times the area of all.
pub(super) fn share(cell: &ChartCell) -> f64 {
    cell.counted() * cell.doubt.square
}

/// Finds how much of cells counts, by the hints in them; a cell without hints counts like what it is part of.
fn counted(mut cells: Vec<ChartCell>, hints: &[ChartHint]) -> Vec<ChartCell> {
    for cell in &mut cells {
        let within = cell.hints.iter().map(|&h| &hints[h as usize]);
        cell.counts = counting(within.map(|h| [h.area, h.counts])).unwrap_or(cell.counts);
    }
    cells
}

/// Is a place in the cell, but for rounding?
fn within(share: DVec2) -> bool {
    share.cmpge(DVec2::splat(-1e-9)).all() && share.cmple(DVec2::splat(1.0 + 1e-9)).all()
}

/// Texels that a chart takes on a page.
pub(super) fn taken(lattice: &Lattice, more: [u8; 2]) -> usize {
    let [w, h] = lattice.texels(more);
    let margin = margin(lattice);
    (w + 2 * margin) * (h + 2 * margin)
}

/// Light between four corners.
pub(super) fn mix(light: &[[f64; 3]; 4], share: DVec2) -> [f64; 3] {
    let weights = bilinear(share);
    [0, 1, 2].map(|c| (0..4).map(|k| light[k][c] * weights[k]).sum())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::lightmap::charts::charts;
    use crate::lightmap::unwrap::Conformal;
    use crate::mesh::looks::Looks;
    use crate::solve::{Effort, GatherQuality};
    use crate::transport::tests::baked;

    pub(in crate::lightmap) fn begun(bake: &Bake) -> LightmapGrowth<'_> {
        let mut growth = not_begun(bake);
        growth.begin(&|_, _| {});
        growth
    }

    /// The same before anything is looked at.
    pub(in crate::lightmap) fn not_begun(bake: &Bake) -> LightmapGrowth<'_> {
        let spaces = bake.spaces();
        let all = charts(bake.scene(), bake.mesh(), bake.tree(), &spaces, &Conformal);
        let looks = Looks::new(
            bake,
            spaces,
            GatherQuality::Vertex(Effort::default()),
            &|| false,
        );
        let budget = Budget {
            looks: 100_000,
            texels: 100_000,
            page: 1024,
        };
        LightmapGrowth::new(bake, all, Sampler::new(looks), budget)
    }

    /// Below a wall a floor is lent light of both sides. Cells that took only their own side's for it believed that they were right, and light
    /// leaked 60 cm out of a garage.
    #[test]
    fn cells_know_what_the_map_draws_at_covered_corners() {
        let bake = baked("furnished.glb", 1);
        let growth = begun(bake);
        let placed = bake.placed(&growth, &Vec::new(), None).0;
        let mut apart = 0;
        for cell in growth.cells.iter().filter(|c| growth.is_bare(c)) {
            let lattice = &growth.lattices[cell.chart as usize];
            let own = cell.corners().map(|corner| growth.seen_at(cell, corner));
            let brightest = own.iter().flatten().map(|x| x[1]).fold(0.0, f64::max);
            for (k, corner) in cell.corners().into_iter().enumerate() {
                let at = lattice.at(corner);
                let drawn = f64::from(placed.look_up(cell.chart as usize, at).irradiance[1]);
                let believed = growth.light(cell)[k][1];
                assert!(
                    (drawn - believed).abs() <= 1e-4 * drawn.max(believed),
                    "{drawn} {believed}"
                );
                apart += usize::from(own[k].is_none() && drawn > 1.5 * brightest);
            }
        }
        assert!(apart > 0);
    }
}
