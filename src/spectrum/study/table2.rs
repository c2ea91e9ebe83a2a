//! Table 2 (paper 4.2): time of the 13 824 tertiary products and their change to XYZ, dense and adaptive, today.
//!
//! Light D65, lists of the paper's control. Each of the 576 secondary spectra meets the 24 materials in one block, whose
//! results stay in the first-level cache, for both sides. The dense side is 64 f32 in four vectors of 16. Least of
//! several rounds, in ns a product. No thread.
//!
//! AMD EPYC with AVX-512, November 2026, busy machine (least of 15 rounds), ns a product:
//!
//! | stage | adaptive | dense | ratio |
//! |---|---|---|---|
//! | product on a given partition | 0.30 | 2.5 | 8.4 |
//! | change to XYZ, one by one / 24 side by side | 1.6 / 0.4 | 3.7 / 3.0 | 2.3 / 7.7 |
//! | product with errors, from the trees | 7.0 | 2.5 | 0.4 |
//! | control overhead, paper | 54 to 66 | - | - |
//! | total with control: paper / perceptual / bound | 70 / 250 / 2000 | 6.2 | 0.1 or less |
//!
//! So what the paper measured in 1997 (total 1.3 times faster) does not hold any more: 64 products cost less than one
//! mispredicted branch or two. An adaptive spectrum pays where the cut is at hand: on rows that share it, in memory, and in
//! every pass after the one that chose it.

use super::colour_chart::{ColourChart, UnitLight};
use super::lanes::{
    Columns, SimdVector, VectorRow, column_products, column_tristimulus, products, row, tristimulus,
};
use super::walk::{Extent, WalkStart, walk};
use crate::spectrum::{
    BANDS, Bounded, CmfTree, Control, DyadicTree, Estimate, Interval, List, Metric, Moment,
    Partition, Path, Spectrum, control, represent,
};
use fearless_simd::{Level, dispatch, f32x8, f32x16, prelude::*};
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Rounds of which the fastest counts.
const ROUNDS: usize = 15;

/// One row: ns a product.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Stage {
    /// What is timed.
    pub stage: &'static str,
    /// Adaptive side, ns.
    pub adaptive_ns: f64,
    /// Dense side, ns; none where it has nothing to do.
    pub dense_ns: Option<f64>,
    /// Dense over adaptive: above 1 the adaptive side is faster.
    pub ratio: Option<f64>,
}

/// The table as printed, for all 13 824 products, ms: name, reference, adaptive.
pub const PRINTED_MS: [(&str, f64, f64); 4] = [
    ("pre-processing", 0.0, 30.0),
    ("product", 580.0, 590.0),
    ("change to XYZ", 240.0, 30.0),
    ("total", 820.0, 620.0),
];

/// The 576 secondary spectra, on both sides.
struct Work<'a, I> {
    start: WalkStart<'a, I>,
    chart: &'a ColourChart,
    light: &'a UnitLight,
    /// Lists after control, and the two materials of each.
    lists: Vec<(List<I>, [usize; 2])>,
    dense: Vec<Spectrum>,
}

impl<'a, I: Interval> Work<'a, I> {
    fn new(chart: &'a ColourChart, light: &'a UnitLight) -> Self {
        let start = WalkStart::<I>::new(chart, light);
        let list = represent(
            start.source(),
            &chart.cmf,
            &Metric::Xyz,
            Control::PAPER.eps_max,
        );
        let (mut lists, mut dense) = (Vec::new(), Vec::new());
        walk(
            &start,
            &list,
            Extent::Part {
                levels: 2,
                stride: 1,
            },
            |list, path, exact| {
                control(list, path, &chart.cmf, &Metric::Xyz, &Control::PAPER);
                if path.reflections.len() == 2 {
                    let count = chart.reflectances.len();
                    lists.push((list.clone(), [lists.len() / count, lists.len() % count]));
                    dense.push(*exact);
                }
            },
        );
        Self {
            start,
            chart,
            light,
            lists,
            dense,
        }
    }

    fn products(&self) -> f64 {
        (self.lists.len() * self.chart.reflectances.len()) as f64
    }

    /// Least time of a pass over all products, ns a product.
    fn time(&self, mut pass: impl FnMut()) -> f64 {
        let mut least = f64::INFINITY;
        for _ in 0..ROUNDS {
            let begin = Instant::now();
            pass();
            least = least.min(begin.elapsed().as_secs_f64());
        }
        least * 1e9 / self.products()
    }

    /// Products alone, and products with XYZ, of spectra that are already vectors.
    fn vectors<S: Simd, V: SimdVector<S>, const N: usize>(
        &self,
        simd: S,
        blocks: &[RowCase<V, N>],
    ) -> [f64; 2] {
        let mut out = vec![blocks[0].spectrum; self.chart.reflectances.len()];
        let mut xyz = vec![[0.0; 3]; out.len()];
        let alone = self.time(|| {
            simd.vectorize(
                #[inline(always)]
                || {
                    for block in blocks {
                        products(&block.spectrum, &block.materials, &mut out);
                        black_box(&mut out);
                    }
                },
            );
        });
        let both = self.time(|| {
            simd.vectorize(
                #[inline(always)]
                || {
                    for block in blocks {
                        products(&block.spectrum, &block.materials, &mut out);
                        tristimulus(black_box(&out), &block.weights, &mut xyz);
                        black_box(&mut xyz);
                    }
                },
            );
        });
        [alone, both].map(|ns| ns * self.lists.len() as f64 / blocks.len() as f64)
    }

    /// The same with the 24 products of a block side by side.
    fn columns<S: Simd>(&self, simd: S, blocks: &[ColumnCase<S>]) -> [f64; 2] {
        let mut out = [[f32x8::splat(simd, 0.0); SIDE]; BANDS];
        let alone = self.time(|| {
            simd.vectorize(
                #[inline(always)]
                || {
                    for block in blocks {
                        let out = &mut out[..block.spectrum.len()];
                        column_products(&block.spectrum, &block.materials, out);
                        black_box(out);
                    }
                },
            );
        });
        let both = self.time(|| {
            simd.vectorize(
                #[inline(always)]
                || {
                    for block in blocks {
                        let out = &mut out[..block.spectrum.len()];
                        column_products(&block.spectrum, &block.materials, out);
                        let out = black_box(out);
                        black_box(column_tristimulus(simd, out, &block.weights));
                    }
                },
            );
        });
        [alone, both]
    }

    /// All lists as columns.
    fn sides<S: Simd>(&self, simd: S) -> Vec<ColumnCase<S>> {
        let cmf = &self.chart.cmf;
        let side = |(list, _): &(List<I>, _)| {
            let nodes: Vec<usize> = list
                .partition()
                .iter()
                .map(|(first, len)| crate::spectrum::node(first, len))
                .collect();
            let values: Vec<f64> = list.intervals().iter().map(|i| i.value()).collect();
            let materials = nodes
                .iter()
                .map(|&n| {
                    self.start
                        .materials()
                        .iter()
                        .map(|r| r.node(n).value())
                        .collect()
                })
                .collect();
            ColumnCase::new(
                simd,
                &values,
                materials,
                nodes.iter().map(|&n| *cmf.node(n)).collect(),
            )
        };
        self.lists.iter().map(side).collect()
    }

    fn dense_sides<S: Simd>(&self, simd: S) -> Vec<ColumnCase<S>> {
        let cmf = self.chart.cmf.weights();
        let side = |s: &Spectrum| {
            let materials = (0..BANDS)
                .map(|k| self.chart.reflectances.iter().map(|r| r[k]).collect())
                .collect();
            ColumnCase::new(
                simd,
                s,
                materials,
                (0..BANDS)
                    .map(|k| [cmf[0][k], cmf[1][k], cmf[2][k]])
                    .collect(),
            )
        };
        self.dense.iter().map(side).collect()
    }

    /// The lists of at most `most` and more than `least` intervals, as vectors of their values.
    fn blocks<S: Simd, V: SimdVector<S>, const N: usize>(
        &self,
        simd: S,
        least: usize,
        most: usize,
    ) -> Vec<RowCase<V, N>> {
        let fits = self
            .lists
            .iter()
            .filter(|(list, _)| (least + 1..=most).contains(&list.partition().count()));
        fits.map(|(list, _)| {
            let values: Vec<f32> = list.intervals().iter().map(|i| i.value() as f32).collect();
            let cut = list.partition();
            RowCase {
                spectrum: row(simd, &values),
                materials: self
                    .start
                    .materials()
                    .iter()
                    .map(|r| on_cut(simd, r, cut))
                    .collect(),
                weights: std::array::from_fn(|a| weights_on(simd, cut, &self.chart.cmf, a)),
            }
        })
        .collect()
    }

    fn dense_blocks<S: Simd>(&self, simd: S) -> Vec<RowCase<f32x16<S>, 4>> {
        let narrow = |spectrum: &Spectrum| row(simd, &spectrum.map(|v| v as f32));
        let materials: Vec<_> = self.chart.reflectances.iter().map(narrow).collect();
        let weights = self.chart.cmf.weights().each_ref().map(narrow);
        self.dense
            .iter()
            .map(|s| RowCase {
                spectrum: narrow(s),
                materials: materials.clone(),
                weights,
            })
            .collect()
    }

    /// Products of whole lists, with errors, from the trees; then `finish` on each.
    fn lists(&self, mut finish: impl FnMut(&mut List<I>, &Path<'_, I>)) -> f64 {
        let (cmf, materials) = (&self.chart.cmf, self.start.materials());
        let mut out = List::black();
        self.time(|| {
            for (list, [i, j]) in &self.lists {
                for material in materials {
                    list.reflect(material, cmf, &mut out);
                    finish(
                        &mut out,
                        &Path {
                            source: self.start.source(),
                            reflections: &[&materials[*i], &materials[*j], material],
                        },
                    );
                    black_box(&mut out);
                }
            }
        })
    }
}

/// Vectors that hold the 24 materials side by side.
const SIDE: usize = 3;

/// A spectrum and all that it meets, on its cut, with the materials side by side.
struct ColumnCase<S: Simd> {
    spectrum: Vec<f32x8<S>>,
    materials: Columns<f32x8<S>, SIDE>,
    weights: Vec<[f32x8<S>; 3]>,
}

impl<S: Simd> ColumnCase<S> {
    fn new(simd: S, values: &[f64], materials: Vec<Vec<f64>>, weights: Vec<[f64; 3]>) -> Self {
        let splat = |v: f64| f32x8::splat(simd, v as f32);
        let lanes = |all: &Vec<f64>| row(simd, &all.iter().map(|v| *v as f32).collect::<Vec<_>>());
        Self {
            spectrum: values.iter().copied().map(splat).collect(),
            materials: materials.iter().map(lanes).collect(),
            weights: weights.into_iter().map(|w| w.map(splat)).collect(),
        }
    }
}

/// A spectrum and all that it meets, on its cut.
struct RowCase<V, const N: usize> {
    spectrum: VectorRow<V, N>,
    materials: Vec<VectorRow<V, N>>,
    weights: [VectorRow<V, N>; 3],
}

fn on_cut<S: Simd, I: Interval, V: SimdVector<S>, const N: usize>(
    simd: S,
    tree: &DyadicTree<I>,
    cut: Partition,
) -> VectorRow<V, N> {
    let list = List::new(tree, cut);
    let values: Vec<f32> = list.intervals().iter().map(|i| i.value() as f32).collect();
    row(simd, &values)
}

fn weights_on<S: Simd, V: SimdVector<S>, const N: usize>(
    simd: S,
    cut: Partition,
    cmf: &CmfTree,
    a: usize,
) -> VectorRow<V, N> {
    let values: Vec<f32> = cut
        .iter()
        .map(|(first, len)| cmf.node(crate::spectrum::node(first, len))[a] as f32)
        .collect();
    row(simd, &values)
}

/// A row of the table.
fn stage(stage: &'static str, adaptive_ns: f64, dense_ns: Option<f64>) -> Stage {
    Stage {
        stage,
        adaptive_ns,
        dense_ns,
        ratio: dense_ns.map(|dense| dense / adaptive_ns),
    }
}

/// Times everything.
pub fn measure(chart: &ColourChart) -> Vec<Stage> {
    let light = chart.light("D65");
    let paper = Work::<Estimate>::new(chart, &light);
    let preparation = paper.time(|| {
        black_box(WalkStart::<Estimate>::new(black_box(chart), &light));
        black_box(CmfTree::new(*black_box(chart.cmf.weights())));
    });
    let (dense, given) = dispatch!(Level::new(), simd => {
        let dense = paper.vectors(simd, &paper.dense_blocks(simd));
        (dense, paper.on_given_partitions(simd, dense))
    });
    let mut stages = vec![stage("pre-processing", preparation, None)];
    stages.extend(given);
    stages.extend(paper.with_control(dense));
    let total = Some(dense[1]);
    let estimated = perceptual::<Moment>(chart, &light);
    let bounded = perceptual::<Bounded>(chart, &light);
    stages.push(stage("total with control (perceptual)", estimated, total));
    stages.push(stage(
        "total with control (perceptual bound)",
        bounded,
        total,
    ));
    stages
}

impl<I: Interval> Work<'_, I> {
    /// Products and XYZ of vectors whose cut is at hand, beside those of `dense`: products alone, and both.
    fn on_given_partitions<S: Simd>(&self, simd: S, dense: [f64; 2]) -> [Stage; 5] {
        // Lists of up to 8 intervals run in 8 lanes, longer ones in 16; the mean is over all lists.
        let (short, long) = (
            self.blocks::<S, f32x8<S>, 1>(simd, 0, 8),
            self.blocks::<S, f32x16<S>, 1>(simd, 8, 16),
        );
        let share = |blocks: usize| blocks as f64 / (short.len() + long.len()) as f64;
        let (a, b) = (
            self.vectors(simd, &short),
            if long.is_empty() {
                [0.0; 2]
            } else {
                self.vectors(simd, &long)
            },
        );
        let mixed = |k: usize| a[k] * share(short.len()) + b[k] * share(long.len());
        let columns = self.columns(simd, &self.sides(simd));
        let dense_columns = self.columns(simd, &self.dense_sides(simd));
        [
            stage("product on a given partition", mixed(0), Some(dense[0])),
            stage(
                "change to XYZ",
                mixed(1) - mixed(0),
                Some(dense[1] - dense[0]),
            ),
            stage(
                "product and XYZ on a given partition",
                mixed(1),
                Some(dense[1]),
            ),
            stage(
                "product, 24 side by side",
                columns[0],
                Some(dense_columns[0]),
            ),
            stage(
                "change to XYZ, 24 side by side",
                columns[1] - columns[0],
                Some(dense_columns[1] - dense_columns[0]),
            ),
        ]
    }

    /// Products from the trees, with errors, the paper's control and XYZ.
    fn with_control(&self, dense: [f64; 2]) -> [Stage; 4] {
        let cmf = &self.chart.cmf;
        let with_errors = self.lists(|_, _| ());
        let controlled = self.lists(|list, path| {
            control(list, path, cmf, &Metric::Xyz, &Control::PAPER);
        });
        let whole = self.lists(|list, path| {
            control(list, path, cmf, &Metric::Xyz, &Control::PAPER);
            black_box(list.xyz(cmf));
        });
        [
            stage(
                "product with errors, from the trees",
                with_errors,
                Some(dense[0]),
            ),
            stage("control overhead (paper)", controlled - with_errors, None),
            stage(
                "change to XYZ of a list",
                whole - controlled,
                Some(dense[1] - dense[0]),
            ),
            stage("total with control (paper)", whole, Some(dense[1])),
        ]
    }
}

/// Product, perceptual control within dE*uv 1 and corrected XYZ.
fn perceptual<I: Interval>(chart: &ColourChart, light: &UnitLight) -> f64 {
    let work = Work::<I>::new(chart, light);
    work.lists(|list, path| {
        let colour = list.corrected_xyz(&chart.cmf);
        let metric = Metric::Luv(crate::color::luv_jacobian(colour, work.light.white));
        control(list, path, &chart.cmf, &metric, &Control::within(1.0));
        black_box(list.corrected_xyz(&chart.cmf));
    })
}
