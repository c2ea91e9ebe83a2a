//! Chromatic adaptation: where a colour seen under one white lies under another.
//!
//! Linearised Bradford transform (Lam 1985, as in ICC.1:2010 annex E): von Kries scaling in a sharpened cone space.
//! It moves chromaticities only; it does not model incomplete adaptation.

use super::Xyz;

/// Bradford cone response matrix (ICC.1:2010, annex E.3).
const BRADFORD: [[f64; 3]; 3] = [
    [0.8951, 0.2664, -0.1614],
    [-0.7502, 1.7135, 0.0367],
    [0.0389, -0.0685, 1.0296],
];

/// The matrix that takes XYZ seen under the white `from` to XYZ seen under the white `to`.
///
/// ```
/// use haarlight::color::{bradford, multiply};
/// let (a, d65) = ([109.85, 100.0, 35.585], [95.047, 100.0, 108.883]);
/// let moved = multiply(&bradford(a, d65), a);
/// assert!(moved.iter().zip(d65).all(|(m, w)| (m - w).abs() < 1e-9));
/// ```
pub fn bradford(from: Xyz, to: Xyz) -> [[f64; 3]; 3] {
    let cone = nalgebra::Matrix3::from_fn(|r, c| BRADFORD[r][c]);
    let back = cone
        .try_inverse()
        .expect("the Bradford matrix has an inverse");
    let (source, target) = (multiply(&BRADFORD, from), multiply(&BRADFORD, to));
    let scale = nalgebra::Matrix3::from_fn(|r, c| if r == c { target[r] / source[r] } else { 0.0 });
    let whole = back * scale * cone;
    std::array::from_fn(|r| std::array::from_fn(|c| whole[(r, c)]))
}

/// Matrix times column.
pub fn multiply(matrix: &[[f64; 3]; 3], xyz: Xyz) -> Xyz {
    std::array::from_fn(|r| (0..3).map(|c| matrix[r][c] * xyz[c]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn d65_to_d50_is_the_icc_matrix() {
        // The widely published Bradford matrix for D65 -> D50 (Lindbloom, four decimals).
        let published = [
            [1.0478, 0.0229, -0.0501],
            [0.0295, 0.9905, -0.0170],
            [-0.0092, 0.0150, 0.7521],
        ];
        let ours = bradford([0.950_47, 1.0, 1.088_83], [0.964_22, 1.0, 0.825_21]);
        for r in 0..3 {
            for c in 0..3 {
                assert!((ours[r][c] - published[r][c]).abs() < 1e-4, "{ours:?}");
            }
        }
    }
}
