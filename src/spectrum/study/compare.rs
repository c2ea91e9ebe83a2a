//! The methods of section 2 and the adaptive list on the same work, at equal numbers of terms.

use super::colour_chart::{ColourChart, UnitLight};
use super::modes::{adaptive_at_count, percentile};
use crate::color::{Xyz, de_luv, tristimulus};
use crate::spectrum::Spectrum;
use crate::spectrum::methods::{
    Characteristic, Cubics, Method, bands, gauss_ac1c2, gauss_shared, gauss_xyz, sampling, segments,
};
use serde::Serialize;
use std::time::Instant;

/// Numbers of terms that are compared.
pub const TERMS: [usize; 6] = [4, 6, 8, 10, 12, 16];

/// One light, method and number of terms.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ComparisonRow {
    /// Name of the light.
    pub light: &'static str,
    /// Name of the method.
    pub method: &'static str,
    /// Numbers a spectrum; for adaptive lists the average number of intervals.
    pub terms: usize,
    /// Mean dE*uv of the primary, secondary and tertiary reflections.
    pub luv_mean: [f64; 3],
    /// 95th percentile.
    pub luv_p95: [f64; 3],
    /// Greatest.
    pub luv_max: [f64; 3],
    /// Time of a tertiary product, ns; adaptive lists: see the other table.
    pub product_ns: Option<f64>,
    /// Time of a change to XYZ, ns.
    pub xyz_ns: Option<f64>,
}

/// Exact colours of all reflections of a light, level by level, in the order of the walk.
struct Exact([Vec<Xyz>; 3]);

impl Exact {
    fn new(chart: &ColourChart, light: &UnitLight) -> Self {
        let times =
            |a: &Spectrum, b: &Spectrum| -> Spectrum { std::array::from_fn(|k| a[k] * b[k]) };
        let mut levels = [vec![light.power], Vec::new(), Vec::new(), Vec::new()];
        for level in 0..3 {
            levels[level + 1] = levels[level]
                .iter()
                .flat_map(|s| chart.reflectances.iter().map(move |r| times(s, r)))
                .collect();
        }
        let [_, a, b, c] = levels;
        Self([a, b, c].map(|all| {
            all.iter()
                .map(|s| tristimulus(s, chart.cmf.weights()))
                .collect()
        }))
    }
}

/// Compares everything under one light.
pub fn measure(chart: &ColourChart, light: &UnitLight) -> Vec<ComparisonRow> {
    let exact = Exact::new(chart, light);
    let mut rows = Vec::new();
    for n in TERMS {
        let (cmf, power) = (&chart.cmf, &light.power);
        let mut all: Vec<Box<dyn Method>> = vec![
            Box::new(sampling(cmf, power, n)),
            Box::new(bands(cmf, power, n)),
            Box::new(gauss_xyz(cmf, power, n)),
            Box::new(gauss_ac1c2(cmf, power, n)),
            Box::new(gauss_shared(cmf, power, n)),
            Box::new(segments(cmf, power, n)),
            Box::new(Characteristic::new(cmf, power, &chart.reflectances, n)),
        ];
        all.extend(Cubics::new(cmf, power, n).map(|cubics| Box::new(cubics) as Box<dyn Method>));
        rows.extend(
            all.iter()
                .map(|method| fixed(method.as_ref(), chart, light, &exact, n)),
        );
        for (name, samples) in adaptive_at_count(chart, light, n) {
            let figures = samples.map(figures);
            rows.push(ComparisonRow::new(light, name, n, figures, None));
        }
    }
    rows
}

impl ComparisonRow {
    fn new(
        light: &UnitLight,
        method: &'static str,
        terms: usize,
        levels: [[f64; 3]; 3],
        ns: Option<[f64; 2]>,
    ) -> Self {
        let [luv_mean, luv_p95, luv_max] =
            std::array::from_fn(|figure| levels.map(|level| level[figure]));
        Self {
            light: light.name,
            method,
            terms,
            luv_mean,
            luv_p95,
            luv_max,
            product_ns: ns.map(|t| t[0]),
            xyz_ns: ns.map(|t| t[1]),
        }
    }
}

/// Mean, 95th percentile, maximum.
fn figures(mut values: Vec<f64>) -> [f64; 3] {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    [
        mean,
        percentile(&mut values, 95.0),
        percentile(&mut values, 100.0),
    ]
}

fn fixed(
    method: &dyn Method,
    chart: &ColourChart,
    light: &UnitLight,
    exact: &Exact,
    n: usize,
) -> ComparisonRow {
    let materials: Vec<Vec<f64>> = chart
        .reflectances
        .iter()
        .map(|r| method.material(r))
        .collect();
    let terms = method.terms();
    let mut spectra = method.light();
    let mut time = [0.0; 2];
    let levels = std::array::from_fn(|level| {
        let count = exact.0[level].len();
        let mut next = vec![0.0; count * terms];
        let begin = Instant::now();
        for (block, s) in next
            .chunks_exact_mut(materials.len() * terms)
            .zip(spectra.chunks_exact(terms))
        {
            for (out, r) in block.chunks_exact_mut(terms).zip(&materials) {
                method.reflect(s, r, out);
            }
        }
        let middle = Instant::now();
        let colours: Vec<Xyz> = next.chunks_exact(terms).map(|s| method.xyz(s)).collect();
        time = [
            (middle - begin).as_secs_f64(),
            middle.elapsed().as_secs_f64(),
        ]
        .map(|t| t * 1e9 / count as f64);
        spectra = std::mem::take(&mut next);
        figures(
            colours
                .iter()
                .zip(&exact.0[level])
                .map(|(ours, exact)| de_luv(*exact, *ours, light.white))
                .collect(),
        )
    });
    ComparisonRow::new(light, method.name(), n, levels, Some(time))
}
