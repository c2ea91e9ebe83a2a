//! Light of an RGB picture as a sum of three spectra.
//!
//! A pixel (r, g, b) of linear sRGB stands for the light `D65 (r R + g G + b B)`, where R, G, B are nonnegative, add up to 1 in every band and
//! have, under D65 and the 1931 observer, the colours of the primaries. So white is D65, every pixel has its colour exactly, and the
//! light of a whole picture is three spectra times three pictures. Of all such functions these are the smoothest: the least sum of squared
//! differences of neighbouring bands, after I. Mallett and C. Yuksel, "Spectral Primary Decomposition for Rendering with sRGB
//! Reflectance", EGSR 2019, here solved for the grid at hand by the alternating direction method of multipliers (Boyd et al. 2011,
//! section 5.2).

use super::Upsampler;
use crate::data::{BANDS, Spectrum};
use nalgebra::{DMatrix, DVector};

/// Penalty of the method. On the grids 380..780, 360..830, 400..700 and 380..700 1 takes 430 to 1100 steps, .1 takes 1700 to 3200.
const PENALTY: f64 = 1.0;
/// Steps at the most, and the distance between both of the method's solutions at which it ends.
const STEPS: usize = 5000;
const NEAR: f64 = 1e-10;
/// Values of three functions.
const UNKNOWNS: usize = 3 * BANDS;
/// What they have to meet: the sum in each band, and the colours of two; the third then has its own.
const DEMANDS: usize = BANDS + 6;

/// Shares of D65 in each band that stand for red, green and blue: nonnegative, together 1.
///
/// ```
/// use haarlight::{color::{Upsampler, primaries}, spectrum::Grid};
/// let upsampler = Upsampler::new(&Grid::default());
/// let [red, ..] = primaries(&upsampler);
/// let [r, g, b] = upsampler.rgb(&red);
/// assert!((r - 1.0).abs() < 1e-6 && g.abs() < 1e-6 && b.abs() < 1e-6);
/// ```
pub fn primaries(upsampler: &Upsampler) -> [Spectrum; 3] {
    let (demands, wanted) = demands(upsampler);
    let size = UNKNOWNS + DEMANDS;
    let mut system = DMatrix::zeros(size, size);
    for (k, row) in (0..UNKNOWNS).map(|k| (k, k % BANDS)) {
        // Squared differences of neighbours: 1 -2 1, with the ends free.
        system[(k, k)] = PENALTY + f64::from(u8::from(row > 0) + u8::from(row + 1 < BANDS));
        if row > 0 {
            (system[(k, k - 1)], system[(k - 1, k)]) = (-1.0, -1.0);
        }
    }
    for (i, j) in (0..DEMANDS).flat_map(|i| (0..UNKNOWNS).map(move |j| (i, j))) {
        system[(UNKNOWNS + i, j)] = demands[(i, j)];
        system[(j, UNKNOWNS + i)] = demands[(i, j)];
    }
    let inverse = system
        .try_inverse()
        .expect("neighbours and demands leave nothing undecided");
    let mut positive = DVector::from_element(UNKNOWNS, 1.0 / 3.0);
    let mut price = DVector::zeros(UNKNOWNS);
    for _ in 0..STEPS {
        let mut right = DVector::zeros(size);
        right
            .rows_mut(0, UNKNOWNS)
            .copy_from(&(PENALTY * (&positive - &price)));
        right.rows_mut(UNKNOWNS, DEMANDS).copy_from(&wanted);
        let fair = inverse.rows(0, UNKNOWNS) * right;
        price += &fair;
        positive = price.map(|x| x.max(0.0));
        price -= &positive;
        if (&fair - &positive).amax() < NEAR {
            break;
        }
    }
    std::array::from_fn(|k| std::array::from_fn(|l| positive[k * BANDS + l]))
}

/// Rows and right sides of what the functions have to meet.
fn demands(upsampler: &Upsampler) -> (DMatrix<f64>, DVector<f64>) {
    let (mut rows, mut wanted) = (DMatrix::zeros(DEMANDS, UNKNOWNS), DVector::zeros(DEMANDS));
    for band in 0..BANDS {
        wanted[band] = 1.0;
        let mut single = [0.0; BANDS];
        single[band] = 1.0;
        let colour = upsampler.rgb(&single);
        for primary in 0..3 {
            rows[(band, primary * BANDS + band)] = 1.0;
        }
        for (primary, channel) in (0..2).flat_map(|p| (0..3).map(move |c| (p, c))) {
            let row = BANDS + 3 * primary + channel;
            rows[(row, primary * BANDS + band)] = colour[channel];
            wanted[row] = f64::from(u8::from(primary == channel));
        }
    }
    (rows, wanted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Grid;

    #[test]
    fn primaries_share_out_white_and_keep_their_colours() {
        for grid in [Grid::default(), Grid::paper(), Grid::new(360.0, 830.0)] {
            let upsampler = Upsampler::new(&grid);
            let found = primaries(&upsampler);
            for band in 0..BANDS {
                let sum: f64 = found.iter().map(|p| p[band]).sum();
                assert!((sum - 1.0).abs() < 1e-8, "{band}: {sum}");
                assert!(found.iter().all(|p| p[band] >= 0.0));
            }
            for (k, primary) in found.iter().enumerate() {
                for (c, value) in upsampler.rgb(primary).into_iter().enumerate() {
                    let want = f64::from(u8::from(c == k));
                    assert!((value - want).abs() < 1e-7, "{k}, {c}: {value}");
                }
            }
        }
    }
}
