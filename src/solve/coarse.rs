//! A model of the room in a few hundred patches, to decide on wavelengths.
//!
//! The spectral error varies far less from place to place than light does, so the working partition is chosen on a frontier
//! of the hierarchy: the real links, summed between the patches of the frontier (Galerkin), with mean reflectances. There a
//! solution on all 64 bands is affordable; what a partition loses is *measured* on the model and is an
//! *estimate* for the room.

use super::operator::Operator;
use super::reflection::{Reflection, Sheets};
use super::solver::System;
use crate::hierarchy::{NONE, Node, Tree};
use crate::light::Through;
use crate::light::lanes::Lanes;
use crate::light::rows::{Rows, padded};
use crate::link::{Link, LinkRows, Occlusion, balance};
use crate::scene::LightSpectrum;
use crate::spectrum::{BANDS, Spectrum};
use crate::team::NEVER;
use std::collections::BTreeMap;

/// Patches of the model at the most (fits the child count of its root).
pub(super) const PATCHES: usize = 192;
/// Relative error to which the model is solved: far below what is asked of wavelengths.
const TOLERANCE: f64 = 1e-4;

/// The model.
pub(crate) struct Coarse {
    pub(super) tree: Tree,
    pub(super) links: LinkRows,
    pub(super) leaves: Vec<u32>,
    /// Balance of the rows, by node.
    pub(super) factor: Vec<f32>,
    pub(super) areas: Vec<f64>,
    /// Reflectance of each patch.
    pub(super) reflectance: Vec<Spectrum>,
    /// Exitance and direct punctual irradiance of each patch, light by light, as shapes on the bands.
    pub(super) emission: Vec<Vec<Spectrum>>,
    pub(super) punctual: Vec<Vec<Spectrum>>,
    /// What passes sheets: a patch, the patch behind it, and the transmittance from that to the patch.
    pub(super) through: Vec<([u32; 2], Spectrum)>,
    /// Excitation of each patch by fluorescent light; none for the lights of lamps.
    excitation: Vec<Option<Vec<Spectrum>>>,
}

/// Spectra of the real leaves, to be averaged: reflectance, and for each light exitance and punctual irradiance shapes.
pub(crate) trait Dense {
    /// Reflectance of a leaf node.
    fn reflectance(&self, leaf: u32) -> Spectrum;
    /// Exitance shape of a leaf node under a light; none if it emits nothing of that light.
    fn emission(&self, leaf: u32, light: usize) -> Option<Spectrum>;
    /// Irradiance shape of a leaf node by the punctual lights of one spectrum; none if there are none.
    fn punctual(&self, leaf: u32, light: usize) -> Option<Spectrum>;
    /// Transmittance to a leaf node from the one behind it; none where it is no sheet.
    fn through(&self, leaf: u32) -> Option<Spectrum>;
    /// Excitation of a light by fluorescence at a leaf node; none if nothing excites it there.
    fn excitation(&self, leaf: u32, light: usize) -> Option<Spectrum>;
}

impl Coarse {
    /// Sums links and sources over a frontier of `tree`, into a limited number of patches. Rows are balanced to `target`, what those of each
    /// leaf must sum to.
    #[expect(clippy::too_many_arguments, reason = "one caller")]
    pub(crate) fn new(
        tree: &Tree,
        links: &[Link],
        target: &[f32],
        areas: &[f64],
        leaves: &[u32],
        dense: &dyn Dense,
        lights: usize,
        patches: usize,
    ) -> Self {
        let group = frontier(tree, patches);
        let patches = group.iter().filter(|&&g| g != NONE);
        let count = patches.map(|&g| g as usize + 1).max().unwrap_or(0);
        let [mut area, mut counted, mut met] = [(); 3].map(|()| vec![0.0; count]);
        let mut reflectance = vec![[0.0; BANDS]; count];
        let mut emission = vec![vec![[0.0; BANDS]; count]; lights];
        let mut punctual = emission.clone();
        let mut through: BTreeMap<[u32; 2], Spectrum> = BTreeMap::new();
        let mut excitation: Vec<Option<Vec<Spectrum>>> = vec![None; lights];
        for &leaf in leaves {
            let (g, a) = (group[leaf as usize] as usize, areas[leaf as usize]);
            area[g] += a;
            met[g] += a * f64::from(target[leaf as usize]);
            counted[g] += a * (tree.node(leaf).counted / tree.node(leaf).area);
            add(&mut reflectance[g], &dense.reflectance(leaf), a);
            if let Some(passes) = dense.through(leaf) {
                let pair = [leaf, tree.behind(leaf)].map(|k| group[k as usize]);
                add(through.entry(pair).or_insert([0.0; BANDS]), &passes, a);
            }
            for light in 0..lights {
                if let Some(e) = dense.emission(leaf, light) {
                    add(&mut emission[light][g], &e, a);
                }
                if let Some(p) = dense.punctual(leaf, light) {
                    add(&mut punctual[light][g], &p, a);
                }
                if let Some(x) = dense.excitation(leaf, light) {
                    let all = &mut excitation[light];
                    add(
                        &mut all.get_or_insert_with(|| vec![[0.0; BANDS]; count])[g],
                        &x,
                        a,
                    );
                }
            }
        }
        for (g, a) in area.iter().enumerate() {
            let all = std::iter::once(&mut reflectance)
                .chain(&mut emission)
                .chain(&mut punctual)
                .chain(excitation.iter_mut().flatten());
            for row in all.map(|rows| &mut rows[g]) {
                for x in row.iter_mut() {
                    *x /= a;
                }
            }
        }
        for (pair, passes) in &mut through {
            *passes = passes.map(|x| x / area[pair[0] as usize]);
        }
        let matrix = exchanges(tree, links, areas, &group, count);
        let links = LinkRows::new(count + 1, &pairs(&matrix, count));
        let tree = flat_tree(&area, &counted);
        let areas: Vec<f64> = tree.nodes.iter().map(|node| node.area).collect();
        Self {
            factor: balanced(&tree, &links, &areas, &met),
            tree,
            links,
            leaves: (1..=count as u32).collect(),
            areas,
            reflectance,
            emission,
            punctual,
            through: through.into_iter().collect(),
            excitation,
        }
    }

    /// Adds the fluorescence that the light of lamps excites: enough to choose wavelengths by, as fluorescence itself excites little.
    /// `width` of a band, nm.
    pub(super) fn add_fluorescence(
        &mut self,
        spectra: &[LightSpectrum],
        weights: &[Spectrum; 3],
        width: f64,
    ) {
        let mut brought = vec![[0.0; BANDS]; self.leaves.len()];
        for light in (0..spectra.len()).filter(|&k| self.excitation[k].is_none()) {
            let lanes = Lanes::only(spectra, light, weights);
            let rows = self.irradiance(&lanes);
            for (k, sum) in brought.iter_mut().enumerate() {
                add(sum, &lanes.spectrum(rows.row(k)), 1.0);
            }
        }
        for (light, excitation) in self.excitation.iter().enumerate() {
            for (k, excitation) in excitation.iter().flatten().enumerate() {
                let taken = excitation.iter().zip(&brought[k]);
                let power = taken.map(|(g, e)| g * e).sum::<f64>() * width;
                self.emission[light][k] = [power; BANDS];
            }
        }
    }

    /// Puts all light behind a filter.
    pub(super) fn behind(&mut self, filter: &Spectrum) {
        for row in self.emission.iter_mut().chain(&mut self.punctual).flatten() {
            *row = std::array::from_fn(|k| row[k] * filter[k]);
        }
    }

    /// Merges lights: `of` has for each its number among the `count` merged ones.
    pub(super) fn join(&mut self, of: &[usize], count: usize) {
        for lights in [&mut self.emission, &mut self.punctual] {
            let patches = lights.first().map_or(0, Vec::len);
            let mut joined = vec![vec![[0.0; BANDS]; patches]; count];
            for (light, &to) in lights.iter().zip(of) {
                for (sum, shape) in joined[to].iter_mut().zip(light) {
                    add(sum, shape, 1.0);
                }
            }
            *lights = joined;
        }
        // Layers have copies of a fluorescent light, one each and all excited alike: one of them stands for all.
        let mut joined = vec![None; count];
        for (excitation, &to) in self.excitation.iter().zip(of) {
            joined[to] = joined[to].take().or_else(|| excitation.clone());
        }
        self.excitation = joined;
    }

    /// Irradiance of the model's patches on some lanes.
    pub(super) fn irradiance(&self, lanes: &Lanes) -> Rows {
        match padded(lanes.len()) {
            4 => self.solve::<4>(lanes),
            8 => self.solve::<8>(lanes),
            16 => self.solve::<16>(lanes),
            32 => self.solve::<32>(lanes),
            _ => self.solve::<64>(lanes),
        }
    }

    fn solve<const L: usize>(&self, lanes: &Lanes) -> Rows {
        let count = self.leaves.len();
        let (mut rho, mut e, mut p) = (
            Rows::zero(count, L),
            Rows::zero(count, L),
            Rows::zero(count, L),
        );
        let mut greatest = vec![0.0_f32; L];
        for k in 0..count {
            lanes.averages(&self.reflectance[k], rho.row_mut(k));
            for (light, shapes) in self.emission.iter().enumerate() {
                lanes.add_emission(light, &shapes[k], 1.0, e.row_mut(k));
            }
            for (light, shapes) in self.punctual.iter().enumerate() {
                lanes.add_emission(light, &shapes[k], 1.0, p.row_mut(k));
            }
            for (g, r) in greatest.iter_mut().zip(rho.row(k)) {
                *g = g.max(*r);
            }
        }
        let operator = Operator::new(
            &self.tree,
            &self.links,
            &self.leaves,
            &self.areas,
            &self.factor,
        );
        let mut first = operator.received::<L>(&e);
        for k in 0..count {
            for (x, p) in first.row_mut(k).iter_mut().zip(p.row(k)) {
                *x += p;
            }
        }
        let system = System {
            reflection: &self.reflection::<L>(lanes, rho, greatest),
            areas: (self.leaves.iter())
                .map(|&k| self.areas[k as usize])
                .collect(),
            receive: &|radiosity| operator.received::<L>(radiosity),
            interrupt: &NEVER,
        };
        let mut reflected = Rows::zero(count, L);
        let (_, mut more) = system.solve::<L>(&first, &mut reflected, TOLERANCE);
        for k in 0..count {
            for (x, f) in more.row_mut(k).iter_mut().zip(first.row(k)) {
                *x += f;
            }
        }
        more
    }

    /// How the patches reflect, and what passes sheets.
    fn reflection<const L: usize>(
        &self,
        lanes: &Lanes,
        rows: Rows,
        mut greatest: Vec<f32>,
    ) -> Reflection {
        if self.through.is_empty() {
            return Reflection {
                rows,
                greatest,
                mixed: None,
                sheets: None,
            };
        }
        let mut through = Rows::zero(self.through.len(), L);
        let mut passing = vec![[0.0_f32; L]; self.leaves.len()];
        for (k, ([patch, _], passes)) in self.through.iter().enumerate() {
            lanes.averages(passes, through.row_mut(k));
            let sum = passing[*patch as usize].iter_mut();
            sum.zip(through.row(k)).for_each(|(s, t)| *s += t);
        }
        for (k, passing) in passing.iter().enumerate() {
            let both = rows.row(k).iter().zip(passing);
            for (g, (r, t)) in greatest.iter_mut().zip(both) {
                *g = g.max(r + t);
            }
        }
        Reflection {
            rows,
            greatest,
            mixed: None,
            sheets: Some(Sheets {
                pairs: self.through.iter().map(|(pair, _)| *pair).collect(),
                through,
                shown: Through::default(),
            }),
        }
    }
}

fn add(sum: &mut Spectrum, x: &Spectrum, weight: f64) {
    for (s, x) in sum.iter_mut().zip(x) {
        *s += weight * x;
    }
}

/// Which patch of the model each node lies in; [`NONE`] for nodes above the frontier. The node whose counted area is greatest
/// is opened first.
pub(super) fn frontier(tree: &Tree, patches: usize) -> Vec<u32> {
    let mut open = std::collections::BinaryHeap::new();
    let key = |id: u32| (ordered(tree.node(id).counted), std::cmp::Reverse(id));
    open.push((key(0), 0_u32));
    let mut count = 1;
    let mut on_frontier = vec![false; tree.nodes.len()];
    while let Some((_, id)) = open.pop() {
        let node = tree.node(id);
        if node.is_leaf() || count + node.child_range().len() - 1 > patches {
            on_frontier[id as usize] = true;
            continue;
        }
        count += node.child_range().len() - 1;
        for child in node.child_range() {
            open.push((key(child), child));
        }
    }
    let mut group = vec![NONE; tree.nodes.len()];
    let mut next = 0;
    for id in 0..tree.nodes.len() {
        if on_frontier[id] {
            group[id] = next;
            next += 1;
        } else if id > 0 {
            group[id] = group[tree.nodes[id].parent as usize];
        }
    }
    group
}

/// Orders positive areas.
fn ordered(area: f64) -> u64 {
    area.to_bits()
}

/// Exchange between the patches of the model, as in the rows of the real leaves: the exchange of a link with a node above the
/// frontier is shared among the patches below it by area.
fn exchanges(tree: &Tree, links: &[Link], areas: &[f64], group: &[u32], count: usize) -> Vec<f64> {
    // For each node above the frontier the patches that a link to it reaches, with their weights.
    let mut above: Vec<Vec<(u32, f64)>> = vec![Vec::new(); tree.nodes.len()];
    for (k, node) in tree.nodes.iter().enumerate().rev() {
        if node.is_leaf() {
            continue;
        }
        let children = || node.child_range().map(|c| c as usize);
        let share = |c: usize| areas[c] / areas[k];
        if group[k] == NONE {
            let mut reached = Vec::new();
            for c in children() {
                match group[c] {
                    NONE => reached.extend(above[c].iter().map(|&(g, w)| (g, w * share(c)))),
                    g => reached.push((g, share(c))),
                }
            }
            above[k] = reached;
        }
    }
    let mut matrix = vec![0.0; count * count];
    for link in links.iter().filter(|l| l.exchange > 0.0) {
        let [(a, own_a), (b, own_b)] = [link.a, link.b]
            .map(|k| k as usize)
            .map(|k| (k, [(group[k], 1.0)]));
        let reached_a: &[_] = if group[a] == NONE { &above[a] } else { &own_a };
        let reached_b: &[_] = if group[b] == NONE { &above[b] } else { &own_b };
        for &(ga, wa) in reached_a {
            for &(gb, wb) in reached_b {
                let g = f64::from(link.exchange) * wa * wb;
                matrix[ga as usize * count + gb as usize] += g;
                matrix[gb as usize * count + ga as usize] += g;
            }
        }
    }
    matrix
}

/// Factors of the root and the patches of a model by which rows sum to what they must: `met` is the area of each patch times that.
fn balanced(tree: &Tree, links: &LinkRows, areas: &[f64], met: &[f64]) -> Vec<f32> {
    let of_patches = met.iter().zip(&areas[1..]);
    let target: Vec<f32> = std::iter::once(1.0)
        .chain(of_patches.map(|(met, area)| (met / area) as f32))
        .collect();
    balance(tree, links, areas, &target).factor
}

/// The exchanges of a model as links.
fn pairs(matrix: &[f64], count: usize) -> Vec<Link> {
    let mut pairs = Vec::new();
    for a in 0..count {
        for b in a..count {
            let g = matrix[a * count + b];
            if g > 0.0 {
                // A patch of the model may light itself: its row would hold such a link twice, so half is stored.
                let g = if a == b { 0.5 * g } else { g };
                pairs.push(Link {
                    a: a as u32 + 1,
                    b: b as u32 + 1,
                    exchange: g as f32,
                    open_exchange: g as f32,
                    variation: 0.0,
                    occlusion: Occlusion::Clear,
                });
            }
        }
    }
    pairs
}

/// A root with one child per patch.
fn flat_tree(areas: &[f64], counted: &[f64]) -> Tree {
    let mut nodes = vec![Node {
        child: 1,
        children: areas.len() as u8,
        counted: counted.iter().sum(),
        ..Node::bare(NONE, areas.iter().sum())
    }];
    nodes.extend(areas.iter().zip(counted).map(|(&area, &counted)| Node {
        counted,
        ..Node::bare(0, area)
    }));
    Tree {
        nodes,
        ..Tree::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;
    use crate::link::row_sums;

    /// Nothing is reflected or emitted.
    struct Black;

    impl Dense for Black {
        fn reflectance(&self, _: u32) -> Spectrum {
            [0.0; BANDS]
        }
        fn emission(&self, _: u32, _: usize) -> Option<Spectrum> {
            None
        }
        fn punctual(&self, _: u32, _: usize) -> Option<Spectrum> {
            None
        }
        fn through(&self, _: u32) -> Option<Spectrum> {
            None
        }
        fn excitation(&self, _: u32, _: usize) -> Option<Spectrum> {
            None
        }
    }

    /// A patch of the model receives, where all have radiosity 1, the mean of what its leaves receive, whatever covers them; once balanced, the
    /// mean of what they must.
    #[test]
    fn rows_of_the_model_are_those_of_the_leaves() {
        let mut rng = Pcg::new(3);
        let mut tree = flat_tree(&[1.0; 4], &[1.0; 4]);
        for parent in 1..=16 {
            let first = tree.nodes.len() as u32;
            let node = &mut tree.nodes[parent];
            (node.child, node.children) = (first, 4);
            let area = 0.25 * node.area;
            let parts = (0..4).map(|_| Node::bare(parent as u32, area));
            tree.nodes.extend(parts);
        }
        let nodes = tree.nodes.len();
        let leaves: Vec<u32> = tree.leaves().collect();
        let mut areas: Vec<f64> = tree.nodes.iter().map(|n| n.area).collect();
        for &leaf in &leaves {
            areas[leaf as usize] *= if rng.f64() < 0.3 { 1e-3 } else { 1.0 };
        }
        for k in (0..nodes).rev().filter(|&k| !tree.nodes[k].is_leaf()) {
            let children = tree.nodes[k].child_range();
            areas[k] = children.map(|c| areas[c as usize]).sum();
        }
        let target: Vec<f32> = (0..nodes).map(|_| 0.5 + 0.5 * rng.f64() as f32).collect();
        let mut node = || (rng.f64() * (nodes - 1) as f64) as u32 + 1;
        let links: Vec<Link> = (0..400)
            .map(|_| Link {
                a: node(),
                b: node(),
                exchange: 0.01,
                open_exchange: 0.01,
                variation: 0.0,
                occlusion: Occlusion::Clear,
            })
            .filter(|l| l.a != l.b)
            .collect();
        let sums = row_sums(
            &tree,
            &LinkRows::new(nodes, &links),
            &areas,
            &vec![1.0; nodes],
        );
        let group = frontier(&tree, 11);
        let count = 1 + *group.iter().filter(|&&g| g != NONE).max().unwrap() as usize;
        assert!(count > 8, "{count}");
        let matrix = exchanges(&tree, &links, &areas, &group, count);
        let flux = |g: usize, of: &dyn Fn(usize) -> f64| -> f64 {
            let own = leaves.iter().map(|&leaf| leaf as usize);
            let own = own.filter(|&leaf| group[leaf] as usize == g);
            own.map(|leaf| areas[leaf] * of(leaf)).sum()
        };
        for (g, row) in matrix.chunks(count).enumerate() {
            let (model, flux): (f64, f64) = (row.iter().sum(), flux(g, &|leaf| sums[leaf]));
            assert!((model - flux).abs() < 1e-6 * flux, "{g}: {model} {flux}");
        }
        let model = Coarse::new(&tree, &links, &target, &areas, &leaves, &Black, 0, 11);
        let factor: Vec<f64> = model.factor.iter().map(|&f| f.into()).collect();
        let sums = row_sums(&model.tree, &model.links, &model.areas, &factor);
        for g in 0..count {
            let must = flux(g, &|leaf| f64::from(target[leaf]));
            let got = model.areas[g + 1] * sums[g + 1];
            assert!((got - must).abs() < 1e-4 * must, "{g}: {got} {must}");
        }
    }
}
