//! Colour differences: CIE 1976 L*u*v* and L*a*b* and their Euclidean distance, CIEDE2000, and the Jacobian of
//! XYZ -> L*u*v* that turns a tristimulus error into a colour difference.
//!
//! CIE 015:2004, section 8; CIEDE2000 as in Sharma, Wu, Dalal 2005. The adaptation white is always an argument.
//! Differences are in units of dE: about 1 is just visible side by side.

use super::Xyz;

/// (6/29)^3: below this share of the white, L* is linear in Y (CIE 015:2004, 8.2.1).
const LINEAR_BELOW: f64 = 216.0 / 24_389.0;
/// Slope of L* against Y/Yn there, (29/3)^3.
const KAPPA: f64 = 24_389.0 / 27.0;
/// 25^7, of the chroma terms of CIEDE2000.
const CHROMA_7: f64 = 6_103_515_625.0;

/// L*, u*, v* of a colour under an adaptation white (its Y > 0). Black is [0, 0, 0].
pub fn luv(xyz: Xyz, white: Xyz) -> [f64; 3] {
    let lightness = 116.0 * cube_root(xyz[1] / white[1]) - 16.0;
    let [u, v] = uv(xyz).unwrap_or([0.0; 2]);
    let [un, vn] = uv(white).unwrap_or([0.0; 2]);
    if uv(xyz).is_none() {
        return [lightness, 0.0, 0.0];
    }
    [
        lightness,
        13.0 * lightness * (u - un),
        13.0 * lightness * (v - vn),
    ]
}

/// L*, a*, b* of a colour under an adaptation white (all > 0).
pub fn lab(xyz: Xyz, white: Xyz) -> [f64; 3] {
    let [x, y, z] = std::array::from_fn(|i| cube_root(xyz[i] / white[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// dE*uv of two colours under one white.
///
/// ```
/// let white = [95.047, 100.0, 108.883];
/// assert_eq!(haarlight::color::de_luv(white, white, white), 0.0);
/// // Greys differ in lightness alone.
/// let grey = white.map(|v| 0.5 * v);
/// let expected = 100.0 - (116.0 * 0.5f64.cbrt() - 16.0);
/// assert!((haarlight::color::de_luv(white, grey, white) - expected).abs() < 1e-12);
/// ```
pub fn de_luv(a: Xyz, b: Xyz, white: Xyz) -> f64 {
    let (a, b) = (luv(a, white), luv(b, white));
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// CIEDE2000 of two colours under one white, with k_L = k_C = k_H = 1.
pub fn de2000(a: Xyz, b: Xyz, white: Xyz) -> f64 {
    de2000_lab(lab(a, white), lab(b, white))
}

/// CIEDE2000 of two lights under a white that may be black, as before any light or without a lamp: nothing differs then.
pub(crate) fn seen_difference(a: Xyz, b: Xyz, white: Xyz) -> f64 {
    match a == b || white[1] <= 0.0 {
        true => 0.0,
        false => de2000(a, b, white),
    }
}

/// The Jacobian d(L*, u*, v*) / d(X, Y, Z): rows L*, u*, v*.
///
/// To first order a tristimulus error e is a colour difference of |J e|. At black, where u' and v' have no value, only
/// the row of L* is not zero.
pub fn luv_jacobian(xyz: Xyz, white: Xyz) -> [[f64; 3]; 3] {
    let ratio = xyz[1] / white[1];
    let root = cube_root(ratio);
    let lightness = 116.0 * root - 16.0;
    let slope = if ratio > LINEAR_BELOW {
        116.0 / 3.0 * root / ratio
    } else {
        KAPPA
    } / white[1];
    let [Some([u, v]), Some([un, vn])] = [uv(xyz), uv(white)] else {
        return [[0.0, slope, 0.0], [0.0; 3], [0.0; 3]];
    };
    let d = xyz[0] + 15.0 * xyz[1] + 3.0 * xyz[2];
    // u' = 4X/d, v' = 9Y/d with d = X + 15Y + 3Z.
    let du = [(4.0 - u) / d, -15.0 * u / d, -3.0 * u / d];
    let dv = [-v / d, (9.0 - 15.0 * v) / d, -3.0 * v / d];
    let dl = [0.0, slope, 0.0];
    let row = |chroma: f64, dc: [f64; 3]| {
        std::array::from_fn(|i| 13.0 * (dl[i] * chroma + lightness * dc[i]))
    };
    [dl, row(u - un, du), row(v - vn, dv)]
}

/// The function of L* and Lab: cube root, with its linear part near black (and below: small negative rounding is harmless).
fn cube_root(ratio: f64) -> f64 {
    if ratio > LINEAR_BELOW {
        ratio.cbrt()
    } else {
        (KAPPA * ratio + 16.0) / 116.0
    }
}

/// u', v'; none for black.
fn uv(xyz: Xyz) -> Option<[f64; 2]> {
    let d = xyz[0] + 15.0 * xyz[1] + 3.0 * xyz[2];
    (d > 0.0).then(|| [4.0 * xyz[0] / d, 9.0 * xyz[1] / d])
}

/// CIEDE2000 between two L*a*b* colours.
fn de2000_lab(one: [f64; 3], two: [f64; 3]) -> f64 {
    let chroma = |c: [f64; 3]| c[1].hypot(c[2]);
    let seventh = |mean: f64| (mean.powi(7) / (mean.powi(7) + CHROMA_7)).sqrt();
    let g = 1.5 - 0.5 * seventh(0.5 * (chroma(one) + chroma(two)));
    let stretched = |c: [f64; 3]| {
        let a = g * c[1];
        let hue = if a == 0.0 && c[2] == 0.0 {
            0.0
        } else {
            c[2].atan2(a).to_degrees().rem_euclid(360.0)
        };
        (a.hypot(c[2]), hue)
    };
    let ((c1, h1), (c2, h2)) = (stretched(one), stretched(two));
    let grey = c1 * c2 == 0.0;
    let dh = match h2 - h1 {
        _ if grey => 0.0,
        d if d > 180.0 => d - 360.0,
        d if d < -180.0 => d + 360.0,
        d => d,
    };
    let mean_hue = match h1 + h2 {
        sum if grey => sum,
        sum if (h1 - h2).abs() <= 180.0 => 0.5 * sum,
        sum if sum < 360.0 => 0.5 * (sum + 360.0),
        sum => 0.5 * (sum - 360.0),
    };
    let (mean_l, mean_c) = (0.5 * (one[0] + two[0]), 0.5 * (c1 + c2));
    let cosine = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cosine(mean_hue - 30.0)
        + 0.24 * cosine(2.0 * mean_hue)
        + 0.32 * cosine(3.0 * mean_hue + 6.0)
        - 0.20 * cosine(4.0 * mean_hue - 63.0);
    let l50 = (mean_l - 50.0).powi(2);
    let dl = (two[0] - one[0]) / (1.0 + 0.015 * l50 / (20.0 + l50).sqrt());
    let dc = (c2 - c1) / (1.0 + 0.045 * mean_c);
    let dh = 2.0 * (c1 * c2).sqrt() * (0.5 * dh).to_radians().sin() / (1.0 + 0.015 * mean_c * t);
    let rotation = -2.0
        * seventh(mean_c)
        * (60.0 * (-((mean_hue - 275.0) / 25.0).powi(2)).exp())
            .to_radians()
            .sin();
    (dl * dl + dc * dc + dh * dh + rotation * dc * dh)
        .max(0.0)
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const D65: Xyz = [95.047, 100.0, 108.883];

    #[test]
    fn ciede2000_of_the_published_pairs() {
        // Sharma, Wu, Dalal 2005, table 1: the pairs that test hue wrap-around, greys and the rotation term.
        let pairs = [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 3.1571, -77.2803], [50.0, 0.0, -82.7485], 2.8615),
            ([50.0, 2.8361, -74.0200], [50.0, 0.0, -82.7485], 3.4412),
            ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0000),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, 2.4900, -0.0010], [50.0, -2.4900, 0.0009], 7.1792),
            ([50.0, 2.4900, -0.0010], [50.0, -2.4900, 0.0011], 7.2195),
            ([50.0, -0.0010, 2.4900], [50.0, 0.0009, -2.4900], 4.8045),
            ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([50.0, 2.5, 0.0], [56.0, -27.0, -3.0], 31.9030),
            (
                [60.2574, -34.0099, 36.2677],
                [60.4626, -34.1751, 39.4387],
                1.2644,
            ),
            (
                [22.7233, 20.0904, -46.6940],
                [23.0331, 14.9730, -42.5619],
                2.0373,
            ),
            (
                [90.8027, -2.0831, 1.4410],
                [91.1528, -1.6435, 0.0447],
                1.4441,
            ),
            (
                [6.7747, -0.2908, -2.4247],
                [5.8714, -0.0985, -2.2286],
                0.6377,
            ),
            (
                [2.0776, 0.0795, -1.1350],
                [0.9033, -0.0636, -0.5514],
                0.9082,
            ),
        ];
        for (a, b, expected) in pairs {
            assert!(
                (de2000_lab(a, b) - expected).abs() < 5.1e-5,
                "{a:?} {b:?}: {}",
                de2000_lab(a, b)
            );
            assert!((de2000_lab(b, a) - expected).abs() < 5.1e-5);
        }
    }

    #[test]
    fn white_is_100_and_black_is_0() {
        assert_eq!(luv(D65, D65), [100.0, 0.0, 0.0]);
        assert_eq!(luv([0.0; 3], D65), [0.0, 0.0, 0.0]);
        assert_eq!(lab(D65, D65), [100.0, 0.0, 0.0]);
        let jacobian = luv_jacobian([0.0; 3], D65);
        assert_eq!(jacobian[0], [0.0, KAPPA / 100.0, 0.0]);
        assert_eq!(jacobian[1], [0.0; 3]);
    }

    #[test]
    fn agrees_with_palette() {
        use palette::{FromColor, Luv, Xyz as PaletteXyz, white_point::D65 as White};
        let white = [0.95047, 1.0, 1.08883];
        for xyz in [
            [0.2, 0.3, 0.1],
            [0.5, 0.4, 0.05],
            [0.02, 0.01, 0.2],
            [0.001, 0.002, 0.003],
        ] {
            let theirs = Luv::<White, f64>::from_color(PaletteXyz::<White, f64>::new(
                xyz[0], xyz[1], xyz[2],
            ));
            let ours = luv(xyz, white);
            for (a, b) in ours.iter().zip([theirs.l, theirs.u, theirs.v]) {
                assert!((a - b).abs() < 1e-6, "{xyz:?}: {ours:?} {theirs:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn jacobian_is_the_derivative(xyz in prop::array::uniform3(0.5..100.0f64), axis in 0usize..3) {
            let h = 1e-5;
            let (mut up, mut down) = (xyz, xyz);
            up[axis] += h;
            down[axis] -= h;
            let (up, down, jacobian) = (luv(up, D65), luv(down, D65), luv_jacobian(xyz, D65));
            // The two branches of L* meet with equal slope, so a step across is still first order.
            for row in 0..3 {
                let slope = (up[row] - down[row]) / (2.0 * h);
                prop_assert!((slope - jacobian[row][axis]).abs() < 1e-4 * (1.0 + slope.abs()), "{slope} {}", jacobian[row][axis]);
            }
        }
    }
}
