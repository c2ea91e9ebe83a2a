//! Repeatable samples: a small random generator, a (0,2)-sequence, points on triangles, directions in a hemisphere.
//!
//! The generator is PCG-XSH-RR 64/32 (O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms
//! for Random Number Generation", HMC-CS-2014-0905). The sequence is the first two dimensions of Sobol's (van der Corput
//! and Sobol, as in Kollig and Keller, "Efficient Multidimensional Sampling", Eurographics 2002): any 2^k points that start at a
//! multiple of 2^k have one point in every elementary interval of area 2^-k. Scrambling (`scramble`, from
//! [`hash`]) gives every pair of elements its own set and keeps that property.

use glam::DVec3;

/// PCG-XSH-RR 64/32.
#[derive(Clone, Debug)]
pub struct Pcg {
    state: u64,
    increment: u64,
}

/// The multiplier of the generator (Knuth's MMIX).
const PCG_MULTIPLIER: u64 = 6_364_136_223_846_793_005;

/// 2^-32: turns 32 bits into a number in [0,1).
const TWO_POW_MINUS_32: f64 = 1.0 / 4_294_967_296.0;

impl Pcg {
    /// The generator for a seed; different seeds give unrelated streams.
    pub fn new(seed: u64) -> Self {
        let mut pcg = Self {
            state: 0,
            increment: hash(seed, 0x5bd1) << 1 | 1,
        };
        pcg.u32();
        pcg.state = pcg.state.wrapping_add(seed);
        pcg.u32();
        pcg
    }

    /// Next 32 random bits.
    pub fn u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old
            .wrapping_mul(PCG_MULTIPLIER)
            .wrapping_add(self.increment);
        let mixed = (((old >> 18) ^ old) >> 27) as u32;
        mixed.rotate_right((old >> 59) as u32)
    }

    /// Uniform in [0,1), 24 bits.
    pub fn f32(&mut self) -> f32 {
        (self.u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in [0,1), 53 bits.
    pub fn f64(&mut self) -> f64 {
        let high = u64::from(self.u32() >> 5);
        let low = u64::from(self.u32() >> 6);
        (high << 26 | low) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Uniform in `0..n`, by multiplication (bias below n/2^32); 0 for an empty range.
    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.u32()) * u64::from(n)) >> 32) as u32
    }
}

/// Mixes two numbers into 64 well-spread bits (the finaliser of SplitMix64, Steele et al. 2014).
pub fn hash(a: u64, b: u64) -> u64 {
    let mut z = a
        .wrapping_add(b.wrapping_mul(0x9e37_79b9_7f4a_7c15))
        .wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Point `k` of the (0,2)-sequence in [0,1)^2, as it is with a `scramble` of 0. Else both coordinates are scrambled (Owen 1995), and the sequence has
/// an order of its own: points of one `k` by two scrambles are independent. In one order for all, where a path went told where it went next.
pub fn sequence02(k: u32, scramble: u64) -> [f64; 2] {
    let [x, y] = match scramble {
        0 => [k, pascal(k)],
        _ => {
            let k = shuffled(k.reverse_bits(), hash(scramble, 0) as u32).reverse_bits();
            let [x, y] = [(scramble >> 32) as u32, scramble as u32];
            [shuffled(k, x), shuffled(pascal(k), y)]
        }
    };
    // Half a step inwards, so that no point lies on an edge of what it is mapped to.
    [x, y].map(|x| (f64::from(x.reverse_bits()) + 0.5) * TWO_POW_MINUS_32)
}

/// A permutation in which every bit depends on lower ones alone (Laine and Karras, "Stratified Sampling for Stochastic Transparency", 2011; with these
/// factors Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020). Of the digits of a coordinate, last one first, it is Owen's; of those
/// of an index, last one first, it keeps aligned blocks of 2^k together.
fn shuffled(reversed: u32, seed: u32) -> u32 {
    let mut x = reversed.wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x
}

/// Bits times Pascal's triangle modulo 2, the generator matrix of Sobol's second dimension, which is the fivefold Kronecker product of
/// ((1, 1), (0, 1)).
fn pascal(mut k: u32) -> u32 {
    let halves = [
        0x5555_5555,
        0x3333_3333,
        0x0f0f_0f0f,
        0x00ff_00ff,
        0x0000_ffff,
    ];
    for (step, half) in halves.into_iter().enumerate() {
        k ^= (k >> (1 << step)) & half;
    }
    k
}

/// Area-preserving map from the unit square to barycentric weights, after Heitz, "A Low-Distortion Map Between Triangle and
/// Square", 2019.
pub fn triangle_weights([mut x, mut y]: [f64; 2]) -> [f64; 3] {
    if y > x {
        x *= 0.5;
        y -= x;
    } else {
        y *= 0.5;
        x -= y;
    }
    [x, y, 1.0 - x - y]
}

/// The point of a triangle for a point of the unit square; equal areas to equal areas.
pub fn on_triangle(triangle: &[DVec3; 3], square: [f64; 2]) -> DVec3 {
    let [a, b, c] = triangle_weights(square);
    triangle[0] * a + triangle[1] * b + triangle[2] * c
}

/// Direction about `normal` (unit length) with density cos/pi, for a point of the unit square.
pub fn cosine_direction(normal: DVec3, [x, y]: [f64; 2]) -> DVec3 {
    let (sin, cos) = (std::f64::consts::TAU * x).sin_cos();
    let radius = y.sqrt();
    let [tangent, bitangent] = tangents(normal);
    tangent * (radius * cos) + bitangent * (radius * sin) + normal * (1.0 - y).max(0.0).sqrt()
}

/// Direction at an angle of this `cosine` to the unit vector `axis`; `turn` in [0,1) goes once around it.
pub fn around(axis: DVec3, cosine: f64, turn: f64) -> DVec3 {
    let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
    let [tangent, bitangent] = tangents(axis);
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    (tangent * cos + bitangent * sin) * sine + axis * cosine
}

/// Direction uniform over the sphere, for a point of the unit square.
pub fn sphere_direction([x, y]: [f64; 2]) -> DVec3 {
    let z = 1.0 - 2.0 * y;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * x).sin_cos();
    DVec3::new(radius * cos, radius * sin, z)
}

/// Two unit vectors that make a right-handed frame with the unit vector `normal` (Duff et al., "Building an Orthonormal Basis,
/// Revisited", JCGT 6(1), 2017).
pub fn tangents(normal: DVec3) -> [DVec3; 2] {
    let sign = 1.0f64.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    [
        DVec3::new(
            1.0 + sign * normal.x * normal.x * a,
            sign * b,
            -sign * normal.x,
        ),
        DVec3::new(b, sign + normal.y * normal.y * a, -normal.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pcg_is_the_published_generator() {
        // The demo of the reference C code: seed 42, stream 54.
        let mut pcg = Pcg {
            state: 0,
            increment: 54 << 1 | 1,
        };
        pcg.u32();
        pcg.state = pcg.state.wrapping_add(42);
        pcg.u32();
        let first: Vec<_> = (0..6).map(|_| pcg.u32()).collect();
        assert_eq!(
            first,
            [
                0xa15c_02b7,
                0x7b47_f409,
                0xba1d_3330,
                0x83d2_f293,
                0xbfa4_784b,
                0xcbed_606e
            ]
        );
    }

    /// By direction numbers: v_0 = 2^31, v_{i+1} = v_i ^ (v_i >> 1).
    #[test]
    fn the_second_dimension_is_that_of_sobol() {
        for k in (0..2000).chain([1 << 20, u32::MAX, 0xdead_beef]) {
            let (mut y, mut direction) = (0, 1u32 << 31);
            for bit in 0..32 {
                if k >> bit & 1 == 1 {
                    y ^= direction;
                }
                direction ^= direction >> 1;
            }
            assert_eq!(pascal(k).reverse_bits(), y, "{k}");
        }
    }

    /// Pairs of points of one index by two scrambles fill all four dimensions.
    #[test]
    fn scrambles_are_independent_of_each_other() {
        let n = 1 << 14;
        for (a, b) in [(1, 2), (hash(1, 2), hash(1, 3)), (7, !7)] {
            let mut seen = vec![0; 256];
            for k in 0..n {
                let cell = |x: [f64; 2]| (x[0] * 4.0) as usize * 4 + (x[1] * 4.0) as usize;
                seen[cell(sequence02(k, a)) * 16 + cell(sequence02(k, b))] += 1;
            }
            let mean = f64::from(n) / 256.0;
            let chi: f64 = seen
                .iter()
                .map(|&n| (f64::from(n) - mean).powi(2) / mean)
                .sum();
            // 255 degrees of freedom: 400 is beyond six standard deviations.
            assert!(chi < 400.0, "{a} {b}: {chi}");
        }
    }

    /// Means of smooth functions err by N^-1.5; points that are only shifted stand at the same place of all their intervals, and err by N^-1.
    #[test]
    fn points_stand_at_random_places_of_their_intervals() {
        let (n, trials) = (1024, 64);
        let off = |trial: u64| {
            let points = (0..n).map(|k| sequence02(k, hash(trial, 9)));
            let sum = points.fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
            sum.map(|sum| (sum / f64::from(n) - 0.5).powi(2))
        };
        let all = (0..trials).map(off);
        let sum = all.fold([0.0; 2], |sum, off| [sum[0] + off[0], sum[1] + off[1]]);
        for sum in sum {
            let rms = (sum / trials as f64).sqrt();
            // A point at random in each of N intervals: N^-1.5 / sqrt(12). Shifted by the same, N^-1 / sqrt(12).
            let want = f64::from(n).powf(-1.5) / 12.0_f64.sqrt();
            assert!((0.5 * want..2.0 * want).contains(&rms), "{rms} for {want}");
        }
    }

    #[test]
    fn every_elementary_interval_has_one_point() {
        for scramble in [0, hash(3, 4)] {
            for log in 0..=8u32 {
                for start in [0, 5 << log] {
                    for columns in 0..=log {
                        let mut seen = vec![0; 1 << log];
                        for k in start..start + (1 << log) {
                            let [x, y] = sequence02(k, scramble);
                            let column = (x * f64::from(1u32 << columns)) as usize;
                            let row = (y * f64::from(1u32 << (log - columns))) as usize;
                            seen[row << columns | column] += 1;
                        }
                        assert!(seen.iter().all(|&n| n == 1), "log {log} columns {columns}");
                    }
                }
            }
        }
    }

    #[test]
    fn triangle_map_keeps_areas_and_stays_inside() {
        // The mean of x^2 over the triangle (0,0) (1,0) (0,1) is 1/6, of xy 1/12.
        let triangle = [DVec3::X, DVec3::Y, DVec3::ZERO];
        let n = 4096;
        let mut moments = [0.0; 3];
        for k in 0..n {
            let p = on_triangle(&triangle, sequence02(k, 0));
            assert!(p.x > 0.0 && p.y > 0.0 && p.x + p.y < 1.0);
            moments[0] += p.x / f64::from(n);
            moments[1] += p.x * p.x / f64::from(n);
            moments[2] += p.x * p.y / f64::from(n);
        }
        for (moment, exact) in moments.into_iter().zip([1.0 / 3.0, 1.0 / 6.0, 1.0 / 12.0]) {
            assert!((moment - exact).abs() < 1e-3, "{moment} {exact}");
        }
    }

    #[test]
    fn cosine_directions_have_mean_cosine_two_thirds() {
        for normal in [DVec3::Z, -DVec3::Z, DVec3::new(0.6, -0.48, 0.64)] {
            let [t, b] = tangents(normal);
            assert!((t.cross(b) - normal).length() < 1e-12);
            let n = 4096;
            let mut sum = 0.0;
            for k in 0..n {
                let d = cosine_direction(normal, sequence02(k, 0));
                assert!((d.length() - 1.0).abs() < 1e-12 && d.dot(normal) >= 0.0);
                sum += d.dot(normal) / f64::from(n);
            }
            assert!((sum - 2.0 / 3.0).abs() < 1e-3);
        }
    }
}
