//! What several files need of vectors beyond `fearless_simd`: how they lie in memory, and functions of f64.
//!
//! Code with vectors is generic over the instructions, `S: Simd`, and chosen by `dispatch!` where a query begins. All of it down to there is
//! `#[inline(always)]`: a function of its own would be compiled for the oldest processor, and call one for each operation. So would a closure
//! with vectors that is given to an iterator; loops take their place. Rounding differs only where a processor lacks fused multiply-add.

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, f64x8, u32x8, u64x8};
use glam::DVec3;
use std::f32::consts::LOG2_E;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

/// Eight numbers, aligned as the vector of them.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Octet(pub(crate) [f32; 8]);

impl Octet {
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S) -> f32x8<S> {
        f32x8::load_array_ref(simd, &self.0)
    }
}

/// The same point in all lanes.
#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, point: DVec3) -> [f64x8<S>; 3] {
    [
        f64x8::splat(simd, point.x),
        f64x8::splat(simd, point.y),
        f64x8::splat(simd, point.z),
    ]
}

/// Sum of the lanes, always in the same order.
#[inline(always)]
pub(crate) fn sum<S: Simd>(x: f64x8<S>) -> f64 {
    let [a, b, c, d, e, f, g, h] = x.to_array();
    ((a + c) + (b + d)) + ((e + g) + (f + h))
}

/// Zero in the lanes that the mask leaves out.
#[inline(always)]
pub(crate) fn only<S: Simd>(mask: <f64x8<S> as SimdBase<S>>::Mask, x: f64x8<S>) -> f64x8<S> {
    mask.select(x, f64x8::splat(x.simd, 0.0))
}

/// Natural logarithm of positive normal numbers: the rational function of Cephes (`log.c`), ln 2 in two parts from fdlibm.
#[inline(always)]
pub(crate) fn ln<S: Simd>(x: f64x8<S>) -> f64x8<S> {
    const P: [f64; 6] = [
        7.708_387_337_558_854,
        17.936_867_850_781_983,
        14.498_922_534_161_093,
        4.705_791_198_788_817,
        0.497_494_994_976_747,
        0.000_101_875_663_804_580_93,
    ];
    const Q: [f64; 5] = [
        23.125_162_012_676_533,
        71.154_475_061_856_39,
        82.987_526_691_277_67,
        45.227_914_583_753_225,
        11.287_358_718_916_746,
    ];
    const LN_2: [u64; 2] = [0x3fe6_2e42_fee0_0000, 0x3dea_39ef_3579_3c76];
    const TWO_52: f64 = 4_503_599_627_370_496.0;
    let simd = x.simd;
    let c = |x: f64| f64x8::splat(simd, x);
    let bits = |x: u64| u64x8::splat(simd, x);
    let all: u64x8<S> = x.to_bits();
    // x = fraction 2^exponent, the fraction from sqrt(1/2) to sqrt 2.
    let half = f64x8::from_bits((all & bits(0x000f_ffff_ffff_ffff)) | bits(0x3fe0_0000_0000_0000));
    let exponent = f64x8::from_bits((all >> 52) | bits(TWO_52.to_bits())) - (TWO_52 + 1023.0);
    let above = half.simd_gt(SQRT_2 * 0.5);
    let exponent = above.select(exponent + 1.0, exponent);
    let x = above.select(half, half + half) - 1.0;
    let x2 = x * x;
    let x4 = x2 * x2;
    let upper = c(P[5]).mul_add(x, c(P[4]));
    let p = c(P[3])
        .mul_add(x, c(P[2]))
        .mul_add(x2, upper.mul_add(x4, c(P[1]).mul_add(x, c(P[0]))));
    let lower = x4.mul_add(c(Q[4]) + x, x.mul_add(c(Q[1]), c(Q[0])));
    let q = x2.mul_add(x.mul_add(c(Q[3]), c(Q[2])), lower);
    let [high, low] = LN_2.map(|bits| c(f64::from_bits(bits)));
    let rest = exponent.mul_add(low, x2 * x * p / q);
    exponent.mul_add(high, rest + x2.mul_add(c(-0.5), x))
}

/// e^x of numbers up to 88; 0 below -87. The polynomial and ln 2 in two parts are those of Cephes (`expf.c`).
#[inline(always)]
pub(crate) fn exp<S: Simd>(x: f32x8<S>) -> f32x8<S> {
    const P: [f32; 6] = [
        0.5,
        1.666_666_5e-1,
        4.166_579_6e-2,
        8.333_452e-3,
        1.398_2e-3,
        1.987_569_1e-4,
    ];
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    /// Added to a number it leaves a whole one in the last bits.
    const WHOLE: f32 = 12_582_912.0;
    let simd = x.simd;
    let c = |x: f32| f32x8::splat(simd, x);
    let is_some = x.simd_ge(c(-87.0));
    let x = x.max(c(-87.0));
    let shifted = x.mul_add(c(LOG2_E), c(WHOLE));
    let bits: u32x8<S> = shifted.to_bits();
    let power = f32x8::from_bits((bits + u32x8::splat(simd, 127)) << 23);
    let whole = shifted - c(WHOLE);
    let r = whole.mul_add(c(-LN_2[1]), whole.mul_add(c(-LN_2[0]), x));
    let mut p = c(P[5]);
    for k in (0..5).rev() {
        p = p.mul_add(r, c(P[k]));
    }
    is_some.select(p.mul_add(r * r, r + 1.0) * power, c(0.0))
}

/// Arc tangent: the rational function of Cephes (`atan.c`).
#[inline(always)]
pub(crate) fn atan<S: Simd>(x: f64x8<S>) -> f64x8<S> {
    const P: [f64; 5] = [
        -64.850_219_049_420_25,
        -122.886_668_449_013_61,
        -75.008_557_923_147_05,
        -16.157_537_187_333_652,
        -0.875_060_860_003_190_4,
    ];
    const Q: [f64; 5] = [
        194.550_657_148_261_4,
        485.390_399_635_913_7,
        432.881_060_491_290_27,
        165.027_009_831_698_85,
        24.858_464_901_423_062,
    ];
    /// What f64 lacks of half a right angle, twice.
    const MORE: f64 = 6.123_233_995_736_766e-17;
    let simd = x.simd;
    let c = |x: f64| f64x8::splat(simd, x);
    let t = x.abs();
    let (big, small) = (t.simd_gt(SQRT_2 + 1.0), t.simd_lt(0.66));
    // t, (t - 1)/(t + 1) or -1/t.
    let above = big.select(c(-1.0), t - 1.0);
    let below = big.select(t, t + 1.0);
    let z = small.select(t, above) / small.select(c(1.0), below);
    let base = small.select(c(0.0), big.select(c(FRAC_PI_2), c(FRAC_PI_4)));
    let more = small.select(c(0.0), big.select(c(MORE), c(0.5 * MORE)));
    let z2 = z * z;
    let (z4, z8) = (z2 * z2, z2 * z2 * (z2 * z2));
    let p = c(P[3])
        .mul_add(z2, c(P[2]))
        .mul_add(z4, c(P[1]).mul_add(z2, c(P[0])))
        + c(P[4]) * z8;
    let lower = z8.mul_add(c(Q[4]) + z2, z2.mul_add(c(Q[1]), c(Q[0])));
    let q = z4.mul_add(z2.mul_add(c(Q[3]), c(Q[2])), lower);
    let angle = (p / q).mul_add(z * z2, z) + (base + more);
    angle.copysign(x)
}

/// What this processor can do, best first.
#[cfg(test)]
pub(crate) fn levels() -> Vec<fearless_simd::Level> {
    use fearless_simd::Level;
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let others = [
        best.as_avx2().map(|s| s.level()),
        best.as_sse4_2().map(|s| s.level()),
        best.as_sse2().map(|s| s.level()),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let others = [Some(Level::baseline())];
    std::iter::once(best)
        .chain(others.into_iter().flatten())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::dispatch;

    /// Greatest relative error in units of f64's.
    fn error(got: f64, want: f64) -> f64 {
        if want == 0.0 {
            return got.abs() / f64::EPSILON;
        }
        (got / want - 1.0).abs() / f64::EPSILON
    }

    #[test]
    fn functions_are_those_of_f64() {
        for level in levels() {
            let (mut of_ln, mut of_atan) = (0.0_f64, 0.0_f64);
            for k in 0..100_000 {
                // From 1e-300 to 1e300, and dense from 0.1 to 10.
                let spread = if k % 2 == 0 { 300.0 } else { 1.0 };
                let x: [f64; 8] = std::array::from_fn(|lane| {
                    10f64.powf(spread * (f64::from(8 * k + lane as i32) / 400_000.0 - 1.0))
                });
                let [a, b] = dispatch!(level, simd => {
                    let x = f64x8::simd_from(simd, x);
                    [ln(x).to_array(), atan(-x).to_array()]
                });
                for lane in 0..8 {
                    of_ln = of_ln.max(error(a[lane], x[lane].ln()));
                    of_atan = of_atan.max(error(b[lane], -x[lane].atan()));
                }
            }
            assert!(of_ln < 2.0 && of_atan < 2.0, "{of_ln} {of_atan}");
        }
    }

    #[test]
    fn powers_of_e_are_those_of_f64() {
        for level in levels() {
            let mut worst = 0.0_f64;
            for k in 0..10_000 {
                let x: [f32; 8] =
                    std::array::from_fn(|lane| 88.0 - (8 * k + lane) as f32 * 2.1875e-3);
                let got = dispatch!(level, simd => exp(f32x8::simd_from(simd, x)).to_array());
                for (x, got) in x.into_iter().zip(got) {
                    worst = worst.max((f64::from(got) / f64::from(x).exp() - 1.0).abs());
                }
            }
            assert!(worst < 2.0 * f64::from(f32::EPSILON), "{worst}");
            let ends = [
                0.0,
                -0.0,
                -87.5,
                f32::NEG_INFINITY,
                f32::MIN,
                1.0,
                -1.0,
                2.0,
            ];
            let got = dispatch!(level, simd => exp(f32x8::simd_from(simd, ends)).to_array());
            assert_eq!(got[..2], [1.0; 2]);
            assert_eq!(got[2..5], [0.0; 3]);
        }
    }

    #[test]
    fn ends_of_the_range() {
        for level in levels() {
            let x = [1.0, f64::MIN_POSITIVE, f64::MAX, 0.5, 2.0, 0.0, -0.0, 1e-30];
            let x2 = [
                f64::INFINITY,
                f64::NEG_INFINITY,
                f64::NAN,
                1.0,
                0.0,
                -0.0,
                2.0,
                3.0,
            ];
            let (logs, angles) = dispatch!(level, simd => (
                ln(f64x8::simd_from(simd, x)).to_array(),
                atan(f64x8::simd_from(simd, x2)).to_array(),
            ));
            assert_eq!(logs[0], 0.0);
            assert!(error(logs[1], f64::MIN_POSITIVE.ln()) < 1.0);
            assert!(error(logs[2], f64::MAX.ln()) < 1.0);
            assert_eq!(angles[0], FRAC_PI_2);
            assert_eq!(angles[1], -FRAC_PI_2);
            assert!(angles[2].is_nan());
            assert_eq!(angles[4].to_bits(), 0);
            assert_eq!(angles[5], 0.0);
        }
    }

    #[test]
    fn sums_are_the_same_at_all_levels() {
        let x = [0.1, 0.7, 1e-9, 3.0, 1e5, -0.3, 0.123, 7.0];
        let sums: Vec<f64> = levels()
            .into_iter()
            .map(|level| dispatch!(level, simd => sum(f64x8::simd_from(simd, x))))
            .collect();
        assert!(sums.iter().all(|&s| s == sums[0]));
    }
}
