//! All reflections of a light by the chart: 24 primary, 24^2 secondary, 24^3 tertiary (paper 4.1).
//!
//! Every list is the product of the controlled list of the level before; the exact colour comes from the 64 bands.

use super::colour_chart::{ColourChart, UnitLight};
use crate::color::{de_luv, de2000, tristimulus};
use crate::spectrum::{CmfTree, DyadicTree, Interval, List, Operation, Path, Spectrum};

/// Names of the three levels.
pub const LEVELS: [&str; 3] = ["primary", "secondary", "tertiary"];

/// One reflection.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct WalkStep {
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
pub struct WalkStart<'a, I> {
    chart: &'a ColourChart,
    light: &'a UnitLight,
    source: DyadicTree<I>,
    materials: Vec<DyadicTree<I>>,
}

impl<'a, I: Interval> WalkStart<'a, I> {
    /// Builds the trees (pre-processing, 3.1.2).
    pub fn new(chart: &'a ColourChart, light: &'a UnitLight) -> Self {
        let materials = chart
            .reflectances
            .iter()
            .map(|r| DyadicTree::new(r, &chart.cmf))
            .collect();
        Self {
            chart,
            light,
            source: DyadicTree::new(&light.power, &chart.cmf),
            materials,
        }
    }

    /// The light's tree.
    pub fn source(&self) -> &DyadicTree<I> {
        &self.source
    }

    /// The patches' trees.
    pub fn materials(&self) -> &[DyadicTree<I>] {
        &self.materials
    }
}

/// How much of the 24 + 24^2 + 24^3 products a walk visits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Only so many levels, in 1..=3, and of the third level one in `stride` products, spread evenly over the chart.
    Part {
        /// Levels.
        levels: usize,
        /// One in so many tertiary products.
        stride: usize,
    },
    /// Everything.
    Whole,
}

/// Calls `step` with every product: the list on the cut of the level before, the path that leads to it, the exact bands.
/// What `step` makes of the list is what the next level starts from.
pub fn walk<I: Interval>(
    start: &WalkStart<'_, I>,
    list: &List<I>,
    extent: Extent,
    mut step: impl FnMut(&mut List<I>, &Path<'_, I>, &Spectrum),
) {
    let (depth, stride) = match extent {
        Extent::Part { levels, stride } => (levels, stride),
        Extent::Whole => (3, 1),
    };
    let cmf = &start.chart.cmf;
    let (mut first, mut second, mut third) = (List::black(), List::black(), List::black());
    let mut visit =
        |from: &List<I>, to: &mut List<I>, reflections: &[&DyadicTree<I>], exact: &Spectrum| {
            from.reflect(reflections[reflections.len() - 1], cmf, to);
            step(
                to,
                &Path {
                    source: &start.source,
                    reflections,
                },
                exact,
            );
        };
    for (i, a) in start.materials.iter().enumerate() {
        let once = times(&start.light.power, a.spectrum());
        visit(list, &mut first, &[a], &once);
        for (j, b) in start.materials.iter().enumerate().filter(|_| depth > 1) {
            let twice = times(&once, b.spectrum());
            visit(&first, &mut second, &[a, b], &twice);
            for (_, c) in start
                .materials
                .iter()
                .enumerate()
                .filter(|(k, _)| depth > 2 && (i + j + k) % stride == 0)
            {
                visit(
                    &second,
                    &mut third,
                    &[a, b, c],
                    &times(&twice, c.spectrum()),
                );
            }
        }
    }
}

impl WalkStep {
    /// Measures a list against the exact bands.
    pub fn new<I: Interval>(
        list: &List<I>,
        operation: Operation,
        exact: &Spectrum,
        light: &UnitLight,
        cmf: &CmfTree,
    ) -> Self {
        let (reference, ours, corrected) = (
            tristimulus(exact, cmf.weights()),
            list.xyz(cmf),
            list.corrected_xyz(cmf),
        );
        Self {
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
}

/// Samples of a whole walk, level by level; `step` controls the list and says what it did.
pub fn sample<I: Interval>(
    start: &WalkStart<'_, I>,
    list: &List<I>,
    mut step: impl FnMut(&mut List<I>, &Path<'_, I>) -> Operation,
) -> [Vec<WalkStep>; 3] {
    let mut samples = [const { Vec::new() }; 3];
    walk(start, list, Extent::Whole, |list, path, exact| {
        let operation = step(list, path);
        samples[path.reflections.len() - 1].push(WalkStep::new(
            list,
            operation,
            exact,
            start.light,
            &start.chart.cmf,
        ));
    });
    samples
}

fn times(a: &Spectrum, b: &Spectrum) -> Spectrum {
    std::array::from_fn(|band| a[band] * b[band])
}
