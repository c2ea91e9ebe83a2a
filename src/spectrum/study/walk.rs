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
}

/// Runs `step` on every product and measures the outcome; one list of samples for each level.
///
/// `step` gets the product on the cut of the level before and the path that leads to it.
pub fn walk<I: Interval>(
    chart: &Chart,
    light: &Light,
    source: &List<I>,
    mut step: impl FnMut(&mut List<I>, &Path<'_, I>) -> Operation,
) -> [Vec<Sample>; 3] {
    let cmf = &chart.cmf;
    let tree = Tree::new(&light.power, cmf);
    let materials: Vec<Tree<I>> = chart
        .reflectances
        .iter()
        .map(|r| Tree::new(r, cmf))
        .collect();
    let mut samples = [const { Vec::new() }; 3];
    let mut lists = [source.clone(), source.clone(), source.clone()];
    let mut visit =
        |level: usize, lists: &mut [List<I>; 3], reflections: &[&Tree<I>], exact: &Leaves| {
            let mut list = List::black();
            let from = if level == 0 {
                source
            } else {
                &lists[level - 1]
            };
            from.reflect(reflections[level], cmf, &mut list);
            let operation = step(
                &mut list,
                &Path {
                    source: &tree,
                    reflections,
                },
            );
            samples[level].push(measure(&list, operation, exact, light, cmf));
            lists[level].copy_from(&list);
        };
    for a in &materials {
        let first = times(&light.power, a.leaves());
        visit(0, &mut lists, &[a], &first);
        for b in &materials {
            let second = times(&first, b.leaves());
            visit(1, &mut lists, &[a, b], &second);
            for c in &materials {
                visit(2, &mut lists, &[a, b, c], &times(&second, c.leaves()));
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
    let (reference, ours) = (tristimulus(exact, cmf.leaves()), list.xyz(cmf));
    Sample {
        intervals: list.partition().count(),
        operation,
        xyz_error: (0..3)
            .map(|a| (reference[a] - ours[a]).powi(2))
            .sum::<f64>()
            .sqrt(),
        luv_error: de_luv(reference, ours, light.white),
        de2000: de2000(reference, ours, light.white),
    }
}

fn times(a: &Leaves, b: &Leaves) -> Leaves {
    std::array::from_fn(|leaf| a[leaf] * b[leaf])
}
