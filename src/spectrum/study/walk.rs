//! All reflections of a light by the chart: 24 primary, 24^2 secondary, 24^3 tertiary (paper 4.1).
//!
//! Every list is the product of the controlled list of the level before; the exact colour comes from the 64 leaves.

use super::chart::{Chart, Light};
use crate::color::{de_luv, de2000, tristimulus};
use crate::spectrum::{CmfTree, Interval, Leaves, List, Operation, Path, Tree};

/// Names of the three levels.
pub const LEVELS: [&str; 3] = ["primary", "secondary", "tertiary"];

/// One reflection.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Intervals after control.
    pub intervals: usize,
    /// What control did.
    pub operation: Operation,
    /// True error: length in XYZ, source Y = 1.
    pub xyz_error: f64,
    /// True error, dE*uv under the light's white.
    pub luv_error: f64,
    /// True error, CIEDE2000.
    pub de2000: f64,
    /// dE*uv that is left when the estimated error is added back.
    pub corrected_luv: f64,
    /// CIEDE2000 of the same.
    pub corrected_de2000: f64,
}

/// What a walk starts from: a light, its tree, its list, and the trees of the patches.
#[derive(Debug, Clone)]
pub struct Start<'a, I> {
    chart: &'a Chart,
    light: &'a Light,
    source: Tree<I>,
    materials: Vec<Tree<I>>,
}

impl<'a, I: Interval> Start<'a, I> {
    /// Builds the trees (pre-processing, 3.1.2).
    pub fn new(chart: &'a Chart, light: &'a Light) -> Self {
        let materials = chart
            .reflectances
            .iter()
            .map(|r| Tree::new(r, &chart.cmf))
            .collect();
        Self {
            chart,
            light,
            source: Tree::new(&light.power, &chart.cmf),
            materials,
        }
    }

    /// The light's tree.
    pub fn source(&self) -> &Tree<I> {
        &self.source
    }

    /// The patches' trees.
    pub fn materials(&self) -> &[Tree<I>] {
        &self.materials
    }
}

/// Runs `step` on every product of the first `depth` levels (in 1..=3) and measures the outcome.
///
/// `step` gets the product on the cut of the level before and the path that leads to it.
pub fn walk<I: Interval>(
    start: &Start<'_, I>,
    list: &List<I>,
    depth: usize,
    mut step: impl FnMut(&mut List<I>, &Path<'_, I>) -> Operation,
) -> [Vec<Sample>; 3] {
    let cmf = &start.chart.cmf;
    let mut samples = [const { Vec::new() }; 3];
    let mut lists = [List::black(), List::black(), List::black()];
    let mut visit = |lists: &mut [List<I>; 3], reflections: &[&Tree<I>], exact: &Leaves| {
        let level = reflections.len() - 1;
        let mut product = List::black();
        let from = if level == 0 { list } else { &lists[level - 1] };
        from.reflect(reflections[level], cmf, &mut product);
        let operation = step(
            &mut product,
            &Path {
                source: &start.source,
                reflections,
            },
        );
        samples[level].push(measure(&product, operation, exact, start.light, cmf));
        lists[level].copy_from(&product);
    };
    for a in &start.materials {
        let first = times(&start.light.power, a.leaves());
        visit(&mut lists, &[a], &first);
        for b in start.materials.iter().filter(|_| depth > 1) {
            let second = times(&first, b.leaves());
            visit(&mut lists, &[a, b], &second);
            for c in start.materials.iter().filter(|_| depth > 2) {
                visit(&mut lists, &[a, b, c], &times(&second, c.leaves()));
            }
        }
    }
    samples
}

fn measure<I: Interval>(
    list: &List<I>,
    operation: Operation,
    exact: &Leaves,
    light: &Light,
    cmf: &CmfTree,
) -> Sample {
    let (reference, ours, corrected) = (
        tristimulus(exact, cmf.leaves()),
        list.xyz(cmf),
        list.corrected_xyz(cmf),
    );
    Sample {
        intervals: list.partition().count(),
        operation,
        xyz_error: (0..3)
            .map(|a| (reference[a] - ours[a]).powi(2))
            .sum::<f64>()
            .sqrt(),
        luv_error: de_luv(reference, ours, light.white),
        de2000: de2000(reference, ours, light.white),
        corrected_luv: de_luv(reference, corrected, light.white),
        corrected_de2000: de2000(reference, corrected, light.white),
    }
}

fn times(a: &Leaves, b: &Leaves) -> Leaves {
    std::array::from_fn(|leaf| a[leaf] * b[leaf])
}
