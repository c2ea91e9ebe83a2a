//! What do the steps of an adaptive spectrum cost? Light D65 and the ColorChecker on the paper's grid.
//! `haarlight paper` sets the same steps against a dense spectrum.

use divan::{Bencher, black_box};
use haarlight::color::luv_jacobian;
use haarlight::spectrum::study::{ColourChart, Reflectances, UnitLight};
use haarlight::spectrum::{
    Bounded, Control, DyadicTree, Estimate, Interval, List, Metric, Moment, Partition, Path,
    coarsen, control, represent,
};

fn main() {
    divan::main();
}

fn chart() -> (ColourChart, UnitLight) {
    let chart = ColourChart::new(Reflectances::Babelcolor);
    let light = chart.light("D65");
    (chart, light)
}

/// Pre-processing of one reflectance (3.1.2).
#[divan::bench(types = [Estimate, Bounded])]
fn tree<I: Interval>(bencher: Bencher) {
    let (chart, _) = chart();
    bencher.bench(|| DyadicTree::<I>::new(black_box(&chart.reflectances[0]), &chart.cmf));
}

/// Representation of the light (3.1.3).
#[divan::bench]
fn source(bencher: Bencher) {
    let (chart, light) = chart();
    let tree = DyadicTree::<Estimate>::new(&light.power, &chart.cmf);
    bencher.bench(|| {
        represent(
            black_box(&tree),
            &chart.cmf,
            &Metric::Xyz,
            Control::PAPER.eps_max,
        )
    });
}

/// Product of two 8-interval spectra with errors (3.2).
#[divan::bench(types = [Estimate, Moment, Bounded])]
fn product_of_8_intervals<I: Interval>(bencher: Bencher) {
    let (chart, light) = chart();
    let list = List::new(
        &DyadicTree::<I>::new(&light.power, &chart.cmf),
        Partition::uniform(3),
    );
    let material = DyadicTree::new(&chart.reflectances[0], &chart.cmf);
    let mut out = List::black();
    bencher.bench_local(|| {
        black_box(&list).reflect(black_box(&material), &chart.cmf, black_box(&mut out))
    });
}

/// Control of one primary reflection, the paper's way and the perceptual way.
#[divan::bench(args = ["paper", "perceptual"])]
fn control_of_a_product(bencher: Bencher, mode: &str) {
    let (chart, light) = chart();
    let source = DyadicTree::<Moment>::new(&light.power, &chart.cmf);
    let material = DyadicTree::new(&chart.reflectances[5], &chart.cmf);
    let (mut product, mut list) = (List::black(), List::black());
    List::new(&source, Partition::uniform(4)).reflect(&material, &chart.cmf, &mut product);
    bencher.bench_local(|| {
        list.copy_from(black_box(&product));
        let path = Path {
            source: &source,
            reflections: &[&material],
        };
        if mode == "paper" {
            control(&mut list, &path, &chart.cmf, &Metric::Xyz, &Control::PAPER)
        } else {
            let metric = Metric::Luv(luv_jacobian(list.corrected_xyz(&chart.cmf), light.white));
            control(&mut list, &path, &chart.cmf, &metric, &Control::within(1.0))
        }
    });
}

/// Compression of what a patch holds on 16 intervals to dE*uv 0.5.
#[divan::bench]
fn coarsen_16_values(bencher: Bencher) {
    let (chart, light) = chart();
    let values = chart
        .cmf
        .weighted_average(&chart.reflectances[5], Partition::uniform(4));
    let mut list = List::<Moment>::black();
    bencher.bench_local(|| {
        list.set(Partition::uniform(4), black_box(&values));
        let metric = Metric::Luv(luv_jacobian(list.xyz(&chart.cmf), light.white));
        coarsen(&mut list, &chart.cmf, &metric, &Control::within(0.5))
    });
}

/// Change of 8 intervals to XYZ (3.3).
#[divan::bench]
fn xyz_of_8_intervals(bencher: Bencher) {
    let (chart, light) = chart();
    let list = List::new(
        &DyadicTree::<Estimate>::new(&light.power, &chart.cmf),
        Partition::uniform(3),
    );
    bencher.bench_local(|| black_box(&list).xyz(&chart.cmf));
}

/// Sum of two lists on different cuts.
#[divan::bench(types = [Moment, Bounded])]
fn sum_on_different_cuts<I: Interval>(bencher: Bencher) {
    let (chart, light) = chart();
    let tree = DyadicTree::<I>::new(&light.power, &chart.cmf);
    let (coarse, fine) = (
        List::new(&tree, Partition::uniform(2)),
        List::new(&tree, Partition::uniform(3)),
    );
    let mut sum = List::black();
    bencher.bench_local(|| {
        sum.copy_from(black_box(&coarse));
        sum.add_scaled(0.5, black_box(&fine), &chart.cmf);
    });
}
