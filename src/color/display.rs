//! Tristimulus values to and from linear sRGB, and the sRGB curve.
//!
//! `XYZ = M rgb`, where the columns of M are the primaries of IEC 61966-2-1:1999 (chromaticities of ITU-R BT.709), scaled
//! so that (1, 1, 1) is the white. Y of the white is 1: a caller with cd/m2 divides by an exposure first.
//! Colours outside of the gamut come out below 0 or above 1; nothing is clipped here.

use super::Xyz;

/// Chromaticities x, y of red, green and blue (IEC 61966-2-1:1999, table 1).
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];

/// Chromaticity of the white, D65 as rounded there.
const WHITE: [f64; 2] = [0.3127, 0.3290];

/// The curve of IEC 61966-2-1:1999: linear below the knee, a power above.
const KNEE: f64 = 0.003_130_8;
const SLOPE: f64 = 12.92;
const OFFSET: f64 = 0.055;
const GAMMA: f64 = 2.4;

/// A linear RGB space with sRGB's primaries.
///
/// ```
/// use haarlight::color::LinearSrgb;
/// let srgb = LinearSrgb::standard();
/// let [x, y, z] = srgb.to_xyz([1.0, 0.0, 0.0]);
/// assert!((x - 0.4124).abs() < 1e-4 && (y - 0.2126).abs() < 1e-4 && (z - 0.0193).abs() < 1e-4);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LinearSrgb {
    to_xyz: [[f64; 3]; 3],
    from_xyz: [[f64; 3]; 3],
}

impl LinearSrgb {
    /// sRGB with its own white.
    pub fn standard() -> Self {
        let [x, y] = WHITE;
        Self::with_white([x / y, 1.0, (1.0 - x - y) / y])
    }

    /// sRGB's primaries, scaled so that (1, 1, 1) is exactly this white: D65 as integrated on a grid, for example.
    /// The white has Y = 1 and lies inside of the triangle of the primaries.
    pub fn with_white(white: Xyz) -> Self {
        let columns = PRIMARIES.map(|[x, y]| [x / y, 1.0, (1.0 - x - y) / y]);
        let unscaled: [[f64; 3]; 3] =
            std::array::from_fn(|row| std::array::from_fn(|col| columns[col][row]));
        let scale = multiply(&invert(&unscaled), white);
        let to_xyz: [[f64; 3]; 3] =
            std::array::from_fn(|row| std::array::from_fn(|col| unscaled[row][col] * scale[col]));
        Self {
            to_xyz,
            from_xyz: invert(&to_xyz),
        }
    }

    /// XYZ of a linear colour.
    pub fn to_xyz(&self, rgb: [f64; 3]) -> Xyz {
        multiply(&self.to_xyz, rgb)
    }

    /// The linear colour of XYZ; components may lie outside of [0, 1].
    pub fn from_xyz(&self, xyz: Xyz) -> [f64; 3] {
        multiply(&self.from_xyz, xyz)
    }

    /// Y of a linear colour: its luminance if (1, 1, 1) has luminance 1.
    pub fn luminance(&self, rgb: [f64; 3]) -> f64 {
        self.to_xyz(rgb)[1]
    }
}

/// The sRGB value, in [0, 1], of a linear one; values outside of [0, 1] (and NaN) are brought in.
///
/// ```
/// use haarlight::color::{decode, encode};
/// assert!((encode(0.5) - 0.735_357).abs() < 1e-6);
/// assert!((decode(encode(0.2)) - 0.2).abs() < 1e-12);
/// assert_eq!(encode(7.0), 1.0);
/// ```
pub fn encode(linear: f64) -> f64 {
    let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    if linear <= KNEE {
        SLOPE * linear
    } else {
        // The published (1 + a) v - a, written so that 1 stays exactly 1.
        let root = linear.powf(1.0 / GAMMA);
        root + OFFSET * (root - 1.0)
    }
}

/// The linear value of an sRGB one in [0, 1].
pub fn decode(encoded: f64) -> f64 {
    if encoded <= SLOPE * KNEE {
        encoded / SLOPE
    } else {
        ((encoded + OFFSET) / (1.0 + OFFSET)).powf(GAMMA)
    }
}

/// The sRGB byte of a linear value, rounded.
pub fn encode_byte(linear: f64) -> u8 {
    // In [0, 255] by the range of `encode`.
    (encode(linear) * 255.0).round() as u8
}

fn multiply(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Inverse by cofactors.
fn invert(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, c: usize| {
        let (a, b, d, e) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[a][d] * m[b][e] - m[a][e] * m[b][d]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    std::array::from_fn(|row| std::array::from_fn(|col| minor(col, row) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The matrix printed in IEC 61966-2-1:1999 (four digits).
    #[test]
    fn matrix_is_the_printed_one() {
        let printed = [
            [0.4124, 0.3576, 0.1805],
            [0.2126, 0.7152, 0.0722],
            [0.0193, 0.1192, 0.9505],
        ];
        let ours = LinearSrgb::standard().to_xyz;
        for (row, expected) in ours.iter().zip(printed) {
            for (value, expected) in row.iter().zip(expected) {
                assert!((value - expected).abs() < 6e-5, "{value} {expected}");
            }
        }
    }

    #[test]
    fn white_is_exact() {
        let white = [0.9501, 1.0, 1.0885];
        let rgb = LinearSrgb::with_white(white).from_xyz(white);
        assert!(rgb.iter().all(|c| (c - 1.0).abs() < 1e-14), "{rgb:?}");
    }

    /// palette 0.7, an independent implementation, takes D65 as (0.95047, 1, 1.08883); x, y = 0.3127, 0.3290 is
    /// (0.95046, 1, 1.08906), hence the tolerance.
    #[test]
    fn agrees_with_palette() {
        use palette::{FromColor, LinSrgb, Srgb, Xyz};
        let srgb = LinearSrgb::standard();
        for rgb in [[0.2, 0.5, 0.7], [1.0, 0.0, 0.3], [0.001, 0.002, 0.9]] {
            let [r, g, b] = rgb;
            let theirs = Xyz::from_color(LinSrgb::new(r, g, b));
            let ours = srgb.to_xyz(rgb);
            for (a, b) in ours.into_iter().zip([theirs.x, theirs.y, theirs.z]) {
                assert!((a - b).abs() < 3e-4, "{a} {b}");
            }
            let encoded: Srgb<f64> = Srgb::from_linear(LinSrgb::new(r, g, b));
            for (linear, theirs) in rgb
                .into_iter()
                .zip([encoded.red, encoded.green, encoded.blue])
            {
                assert!((encode(linear) - theirs).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn bytes() {
        assert_eq!(
            [0.0, 1.0, f64::NAN, -1.0, 2.0].map(encode_byte),
            [0, 255, 0, 0, 255]
        );
        assert_eq!(encode_byte(0.215_861), 128);
    }

    proptest! {
        #[test]
        fn there_and_back(rgb in [0.0..1.0f64, 0.0..1.0, 0.0..1.0]) {
            let srgb = LinearSrgb::standard();
            let back = srgb.from_xyz(srgb.to_xyz(rgb));
            for (a, b) in rgb.into_iter().zip(back) {
                prop_assert!((a - b).abs() < 1e-13);
                prop_assert!((decode(encode(a)) - a).abs() < 1e-7);
            }
        }
    }
}
