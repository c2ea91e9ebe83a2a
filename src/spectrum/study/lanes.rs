//! Spectra as vectors of f32, for measuring what a product and a change to XYZ cost at best: dense (64 bands, four vectors
//! of 16) and on a given cut (8 or 16 lanes, zeros in the spare ones). Both run the same code.

use std::ops::{Add, Mul};
use wide::{f32x8, f32x16};

/// A vector of f32.
pub(super) trait SimdVector: Copy + Add<Output = Self> + Mul<Output = Self> {
    /// Number of lanes.
    const WIDTH: usize;

    /// From as many values.
    fn load(values: &[f32]) -> Self;

    /// Sum of the lanes.
    fn sum(self) -> f32;

    /// `self * b + c`, rounded once where the machine can.
    fn mul_add(self, b: Self, c: Self) -> Self;
}

macro_rules! lane {
    ($vector:ty, $width:expr) => {
        impl SimdVector for $vector {
            const WIDTH: usize = $width;

            #[inline]
            fn load(values: &[f32]) -> Self {
                let mut all = [0.0; $width];
                all[..values.len()].copy_from_slice(values);
                Self::from(all)
            }

            #[inline]
            fn sum(self) -> f32 {
                self.reduce_add()
            }

            #[inline]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self::mul_add(self, b, c)
            }
        }
    };
}
lane!(f32x8, 8);
lane!(f32x16, 16);

/// A spectrum in N vectors.
pub(super) type VectorRow<V, const N: usize> = [V; N];

/// Up to `N * V::WIDTH` values as vectors; the rest is zero.
pub(super) fn row<V: SimdVector, const N: usize>(values: &[f32]) -> VectorRow<V, N> {
    std::array::from_fn(|i| {
        V::load(&values[(i * V::WIDTH).min(values.len())..((i + 1) * V::WIDTH).min(values.len())])
    })
}

/// A spectrum after each of several materials.
#[inline]
pub(super) fn products<V: SimdVector, const N: usize>(
    s: &VectorRow<V, N>,
    materials: &[VectorRow<V, N>],
    out: &mut [VectorRow<V, N>],
) {
    for (out, r) in out.iter_mut().zip(materials) {
        *out = std::array::from_fn(|i| s[i] * r[i]);
    }
}

/// Tristimulus values of several spectra.
#[inline]
pub(super) fn tristimulus<V: SimdVector, const N: usize>(
    spectra: &[VectorRow<V, N>],
    weights: &[VectorRow<V, N>; 3],
    out: &mut [[f32; 3]],
) {
    for (out, s) in out.iter_mut().zip(spectra) {
        *out = weights.each_ref().map(|w| {
            let mut sum = s[0] * w[0];
            for i in 1..N {
                sum = s[i].mul_add(w[i], sum);
            }
            sum.sum()
        });
    }
}

/// Several spectra side by side: for each band or interval, the values of all of them in M vectors. Sums over intervals
/// then need no sum over lanes.
pub(super) type Columns<V, const M: usize> = Vec<[V; M]>;

/// A spectrum after each of several materials.
#[inline]
pub(super) fn column_products<V: SimdVector, const M: usize>(
    s: &[V],
    materials: &[[V; M]],
    out: &mut [[V; M]],
) {
    for ((out, s), r) in out.iter_mut().zip(s).zip(materials) {
        *out = r.map(|r| *s * r);
    }
}

/// Tristimulus values of several spectra.
#[inline]
pub(super) fn column_tristimulus<V: SimdVector, const M: usize>(
    spectra: &[[V; M]],
    weights: &[[V; 3]],
) -> [[V; M]; 3] {
    let zero = V::load(&[]);
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

    #[test]
    fn spare_lanes_do_not_count() {
        let s: VectorRow<f32x8, 1> = row(&[1.0, 2.0, 3.0]);
        let mut out = [s];
        products(&s, &[row(&[0.5, 0.5, 2.0])], &mut out);
        let mut xyz = [[0.0; 3]];
        tristimulus(
            &out,
            &[row(&[1.0; 3]), row(&[0.0, 1.0]), row(&[0.0, 0.0, 2.0])],
            &mut xyz,
        );
        assert_eq!(xyz, [[7.5, 1.0, 12.0]]);
    }

    #[test]
    fn columns_agree_with_rows() {
        let (s, r) = ([1.0f32, 2.0, 3.0], [0.5f32, 0.25, 2.0]);
        let splat = |v: f32| f32x8::load(&[v; 8]);
        let mut out = vec![[splat(0.0)]; 3];
        column_products(&s.map(splat), &r.map(|r| [splat(r)]), &mut out);
        let sums = column_tristimulus(&out, &[[splat(1.0), splat(0.0), splat(2.0)]; 3]);
        assert_eq!(sums.map(|[v]| v.sum() / 8.0), [7.0, 0.0, 14.0]);
    }

    #[test]
    fn dense_rows_hold_64_values() {
        let values: Vec<f32> = (0..64).map(|v| v as f32).collect();
        let s: VectorRow<f32x16, 4> = row(&values);
        let mut xyz = [[0.0; 3]];
        let ones = row(&[1.0; 64]);
        tristimulus(&[s], &[ones, ones, ones], &mut xyz);
        assert_eq!(xyz[0], [2016.0; 3]);
    }
}
