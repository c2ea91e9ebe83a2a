//! Sums over rows, lane by lane: in parallel, and in the same order whatever the number of threads.

use crate::light::Rows;
use rayon::prelude::*;

/// Rows a partial sum covers.
pub(super) const CHUNK: usize = 1024;

/// Adds up sums of parts, in their order.
pub(super) fn added<const L: usize, const N: usize>(
    parts: impl IndexedParallelIterator<Item = [[f64; L]; N]>,
) -> [[f64; L]; N] {
    let mut sums = [[0.0; L]; N];
    for part in parts.collect::<Vec<_>>() {
        for (sum, x) in sums.as_flattened_mut().iter_mut().zip(part.as_flattened()) {
            *sum += x;
        }
    }
    sums
}

/// Inner products.
pub(super) fn dot<const L: usize>(x: &Rows, y: &Rows) -> [f64; L] {
    let parts = chunks::<L>(x).zip(chunks::<L>(y)).map(|(x, y)| {
        let mut sum = [0.0; L];
        for (x, y) in x.iter().zip(y) {
            add_products(&mut sum, x, y);
        }
        [sum]
    });
    let [sums] = added(parts);
    sums
}

/// Inner products, rows times areas.
pub(super) fn dot_by_area<const L: usize>(areas: &[f64], x: &Rows, y: &Rows) -> [f64; L] {
    let rows = chunks::<L>(x).zip(chunks::<L>(y));
    let parts = rows.zip(areas.par_chunks(CHUNK)).map(|((x, y), areas)| {
        let mut sum = [0.0; L];
        for ((x, y), area) in x.iter().zip(y).zip(areas) {
            for l in 0..L {
                sum[l] += area * f64::from(x[l]) * f64::from(y[l]);
            }
        }
        [sum]
    });
    let [sums] = added(parts);
    sums
}

/// Rows part by part.
pub(super) fn chunks<const L: usize>(
    rows: &Rows,
) -> impl IndexedParallelIterator<Item = &[[f32; L]]> {
    rows.all::<L>().par_chunks(CHUNK)
}

/// `sum += x y`, on slices: for arrays, whose length it knows, the compiler writes scalar code.
#[inline(never)]
pub(super) fn add_products(sum: &mut [f64], x: &[f32], y: &[f32]) {
    for ((s, x), y) in sum.iter_mut().zip(x).zip(y) {
        *s += f64::from(*x) * f64::from(*y);
    }
}
