//! Spectra as vectors of f32, for measuring what a product and a change to XYZ cost at best: dense (64 bands, four vectors
//! of 16) and on a given cut (8 or 16 lanes, zeros in the spare ones). Both run the same code.

use fearless_simd::prelude::*;

/// A vector of f32.
pub(super) trait SimdVector<S: Simd>: SimdFloat<S, Element = f32> {}
impl<S: Simd, V: SimdFloat<S, Element = f32>> SimdVector<S> for V {}

/// A spectrum in N vectors.
pub(super) type VectorRow<V, const N: usize> = [V; N];

/// Up to `N * V::LEN` values as vectors; the rest is zero.
#[inline(always)]
pub(super) fn row<S: Simd, V: SimdVector<S>, const N: usize>(
    simd: S,
    values: &[f32],
) -> VectorRow<V, N> {
    std::array::from_fn(|i| {
        V::from_fn(simd, |k| values.get(i * V::LEN + k).copied().unwrap_or(0.0))
    })
}

/// A spectrum after each of several materials.
#[inline(always)]
pub(super) fn products<S: Simd, V: SimdVector<S>, const N: usize>(
    s: &VectorRow<V, N>,
    materials: &[VectorRow<V, N>],
    out: &mut [VectorRow<V, N>],
) {
    for (out, r) in out.iter_mut().zip(materials) {
        for i in 0..N {
            out[i] = s[i] * r[i];
        }
    }
}

/// Tristimulus values of several spectra.
#[inline(always)]
pub(super) fn tristimulus<S: Simd, V: SimdVector<S>, const N: usize>(
    spectra: &[VectorRow<V, N>],
    weights: &[VectorRow<V, N>; 3],
    out: &mut [[f32; 3]],
) {
    for (out, s) in out.iter_mut().zip(spectra) {
        for (out, w) in out.iter_mut().zip(weights) {
            let mut sum = s[0] * w[0];
            for i in 1..N {
                sum = s[i].mul_add(w[i], sum);
            }
            *out = sum.reduce_sum();
        }
    }
}

/// Several spectra side by side: for each band or interval, the values of all of them in M vectors. Sums over intervals
/// then need no sum over lanes.
pub(super) type Columns<V, const M: usize> = Vec<[V; M]>;

/// A spectrum after each of several materials.
#[inline(always)]
pub(super) fn column_products<S: Simd, V: SimdVector<S>, const M: usize>(
    s: &[V],
    materials: &[[V; M]],
    out: &mut [[V; M]],
) {
    for ((out, s), r) in out.iter_mut().zip(s).zip(materials) {
        for m in 0..M {
            out[m] = *s * r[m];
        }
    }
}

/// Tristimulus values of several spectra.
#[inline(always)]
pub(super) fn column_tristimulus<S: Simd, V: SimdVector<S>, const M: usize>(
    simd: S,
    spectra: &[[V; M]],
    weights: &[[V; 3]],
) -> [[V; M]; 3] {
    let zero = V::splat(simd, 0.0);
    let mut sums = [[zero; M]; 3];
    for (s, w) in spectra.iter().zip(weights) {
        for a in 0..3 {
            for m in 0..M {
                sums[a][m] = s[m].mul_add(w[a], sums[a][m]);
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch, f32x8, f32x16};

    #[test]
    fn spare_lanes_do_not_count() {
        dispatch!(Level::new(), simd => {
            let s: VectorRow<f32x8<_>, 1> = row(simd, &[1.0, 2.0, 3.0]);
            let mut out = [s];
            products(&s, &[row(simd, &[0.5, 0.5, 2.0])], &mut out);
            let mut xyz = [[0.0; 3]];
            let weights = [
                row(simd, &[1.0; 3]),
                row(simd, &[0.0, 1.0]),
                row(simd, &[0.0, 0.0, 2.0]),
            ];
            tristimulus(&out, &weights, &mut xyz);
            assert_eq!(xyz, [[7.5, 1.0, 12.0]]);
        });
    }

    #[test]
    fn columns_agree_with_rows() {
        let (s, r) = ([1.0f32, 2.0, 3.0], [0.5f32, 0.25, 2.0]);
        dispatch!(Level::new(), simd => {
            let splat = |v: f32| f32x8::splat(simd, v);
            let mut out = vec![[splat(0.0)]; 3];
            column_products(&s.map(splat), &r.map(|r| [splat(r)]), &mut out);
            let weights = [[splat(1.0), splat(0.0), splat(2.0)]; 3];
            let sums = column_tristimulus(simd, &out, &weights);
            assert_eq!(sums.map(|[v]| v.reduce_sum() / 8.0), [7.0, 0.0, 14.0]);
        });
    }

    #[test]
    fn dense_rows_hold_64_values() {
        let values: Vec<f32> = (0..64).map(|v| v as f32).collect();
        dispatch!(Level::new(), simd => {
            let s: VectorRow<f32x16<_>, 4> = row(simd, &values);
            let mut xyz = [[0.0; 3]];
            let ones = row(simd, &[1.0; 64]);
            tristimulus(&[s], &[ones, ones, ones], &mut xyz);
            assert_eq!(xyz[0], [2016.0; 3]);
        });
    }
}
