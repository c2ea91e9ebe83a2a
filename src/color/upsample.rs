//! A reflectance for a linear sRGB colour.
//!
//! `R(t) = S(c0 t^2 + c1 t + c2)`, `S(x) = 1/2 + x / (2 sqrt(1 + x^2))`, t in [-1, 1] over the grid. After W. Jakob and
//! J. Hanika, "A Low-Dimensional Function Space for Efficient Spectral Upsampling", Computer Graphics Forum 38(2), 2019.
//! R is smooth and lies in [0, 1]. The three coefficients are solved for each colour so that R under D65, seen by the
//! 1931 observer on this very grid, has the colour again; (1, 1, 1) is D65 itself. Greys are exactly flat.
//!
//! For many colours (the texels of a texture) spectra are interpolated between solved ones instead. A colour is linear
//! in its spectrum, so that the interpolated spectrum has exactly the interpolated colour, whatever the table's step;
//! interpolated coefficients would not.

use super::display::LinearSrgb;
use super::{Observer, Xyz, lab};
use crate::data::{BANDS, Grid, Spectrum};
use crate::data::{Outside, named};
use std::sync::OnceLock;

/// Steps of the table along each of r, g, b. Measured over 20 000 random colours, largest dE00 between table and solved
/// spectrum under A / F2 / F11 (under D65 it is 0): 16 steps .97 / .70 / .93, 20 steps .55 / .37 / .50, 24 steps
/// .32 / .20 / .28. With 24 the table is 4 MB and takes 45 ms on two cores; a look-up takes 0.2 us, a solve 5 us.
const STEPS: usize = 24;

/// Levenberg-Marquardt: at most this many steps; a colour takes 5 to 40, the brightest saturated ones most.
const MAX_STEPS: usize = 200;

/// The solver stops when the residual is below this, CIE 1976 L*a*b* units: far below what is asked for (0.5).
const TOLERANCE: f64 = 1e-7;

/// Largest size of a coefficient's argument: S is within 1e-9 of its limit there, and squares stay far from overflow.
const FLAT_LIMIT: f64 = 1e4;

/// Colours darker than this are a scaled spectrum of this brightness: the colour stays exact (it is linear in R), and
/// the coefficients, which grow without end toward black, stay where the solver is at ease.
const DARKEST: f64 = 1.0 / 1024.0;

/// Turns linear sRGB colours into reflectances on a grid.
#[derive(Debug)]
pub struct Upsampler {
    /// weights[a][band]: what reflectance 1 in the band adds to X, Y, Z under D65; Y of white is 1.
    weights: [Spectrum; 3],
    /// XYZ of D65 on the grid.
    white: Xyz,
    srgb: LinearSrgb,
    /// First band that the observer sees: what a colour says of shorter waves is that they are reflected like it.
    first: usize,
    table: OnceLock<Vec<[f32; BANDS]>>,
}

impl Upsampler {
    /// For the colours of a grid, under D65 and the 1931 observer.
    pub fn new(grid: &Grid) -> Self {
        let d65 = named("cie/D65").expect("D65 is built in").table;
        let power = grid.means(&d65, Outside::Hold);
        let mut weights = Observer::cie1931().weights(grid);
        let total: f64 = power.iter().zip(&weights[1]).map(|(s, y)| s * y).sum();
        for row in &mut weights {
            row.iter_mut()
                .zip(&power)
                .for_each(|(w, s)| *w *= s / total);
        }
        let white = weights.map(|row| row.iter().sum());
        Self {
            weights,
            white,
            srgb: LinearSrgb::with_white(white),
            first: (0..BANDS)
                .find(|&k| weights.iter().any(|row| row[k] > 0.0))
                .unwrap_or(0),
            table: OnceLock::new(),
        }
    }

    /// The linear sRGB colour of a reflectance under D65; the inverse of [`Self::reflectance`].
    pub fn rgb(&self, reflectance: &Spectrum) -> [f64; 3] {
        self.srgb.from_xyz(self.xyz(reflectance))
    }

    /// Tristimulus values of a reflectance under D65; Y of white is 1.
    pub fn xyz(&self, reflectance: &Spectrum) -> Xyz {
        self.weights
            .each_ref()
            .map(|row| row.iter().zip(reflectance).map(|(w, r)| w * r).sum())
    }

    /// D65 on the grid, Y = 1.
    pub fn white(&self) -> Xyz {
        self.white
    }

    /// Y of a linear colour, (1, 1, 1) has 1.
    pub fn luminance(&self, rgb: [f64; 3]) -> f64 {
        self.srgb.luminance(rgb)
    }

    /// The reflectance of a linear colour, solved for it. Components outside of [0, 1] are brought in, NaN is 0.
    ///
    /// ```
    /// use haarlight::{color::Upsampler, spectrum::Grid};
    /// let upsampler = Upsampler::new(&Grid::default());
    /// let brick = upsampler.reflectance([0.45, 0.12, 0.08]);
    /// assert!(brick.iter().all(|r| (0.0..=1.0).contains(r)));
    /// let back = upsampler.rgb(&brick);
    /// assert!((back[0] - 0.45).abs() < 1e-4 && (back[1] - 0.12).abs() < 1e-4);
    /// assert_eq!(upsampler.reflectance([1.0, 1.0, 1.0]), [1.0; 64]);
    /// ```
    pub fn reflectance(&self, rgb: [f32; 3]) -> Spectrum {
        self.solve(inside(rgb))
    }

    /// The same from a table, for colours by the thousand; greys stay exactly flat. The table is made at the first call.
    pub fn reflectance_fast(&self, rgb: [f32; 3]) -> Spectrum {
        let rgb = inside(rgb);
        if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
            return [rgb[0]; BANDS];
        }
        let table = self.table();
        // Cell and place in the cell along each axis; rounding to a neighbouring cell puts the place on its edge.
        let mut cell = [0; 3];
        let mut place = [0.0; 3];
        for a in 0..3 {
            cell[a] = (((rgb[a] as f32).cbrt().asin()
                * (std::f32::consts::FRAC_2_PI * STEPS as f32)) as usize)
                .min(STEPS - 1);
            let (low, high) = (node(cell[a]), node(cell[a] + 1));
            place[a] = ((rgb[a] - low) / (high - low)).clamp(0.0, 1.0);
        }
        // Of the six tetrahedra about the cell's grey diagonal, the one that holds the place: from the cell's low corner
        // along the axis of the greatest place, then the next, then the last. A grey lies on the diagonal itself.
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| place[b].total_cmp(&place[a]));
        let [p, q, r] = axes.map(|a| place[a]);
        let shares = [1.0 - p, p - q, q - r, r];
        let mut corner = index(cell);
        let mut corners = [corner; 4];
        for (slot, axis) in corners[1..].iter_mut().zip(axes) {
            corner += STRIDES[axis];
            *slot = corner;
        }
        let [a, b, c, d] = corners.map(|i| &table[i]);
        let [wa, wb, wc, wd] = shares;
        std::array::from_fn(|band| {
            wa * f64::from(a[band])
                + wb * f64::from(b[band])
                + wc * f64::from(c[band])
                + wd * f64::from(d[band])
        })
    }

    /// The table, which is made at the first call.
    pub(crate) fn table(&self) -> &[[f32; BANDS]] {
        self.table.get_or_init(|| self.make_table())
    }

    fn make_table(&self) -> Vec<[f32; BANDS]> {
        use rayon::prelude::*;
        (0..(STEPS + 1).pow(3))
            .into_par_iter()
            .map(|i| {
                let rgb = STRIDES.map(|stride| node(i / stride % (STEPS + 1)));
                self.solve(rgb).map(|r| r as f32)
            })
            .collect()
    }

    /// `rgb` in [0, 1].
    fn solve(&self, rgb: [f64; 3]) -> Spectrum {
        if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
            return [rgb[0]; BANDS];
        }
        let brightest = rgb.iter().fold(0.0f64, |m, &c| m.max(c));
        if brightest < DARKEST {
            let scale = brightest / DARKEST;
            let brighter = self.evaluate(&self.coefficients(rgb.map(|c| c / scale)));
            return brighter.map(|r| r * scale);
        }
        self.evaluate(&self.coefficients(rgb))
    }

    /// The spectrum of coefficients, held below what the observer sees.
    fn evaluate(&self, c: &[f64; 3]) -> Spectrum {
        let mut spectrum = evaluate(c);
        let held = spectrum[self.first];
        spectrum[..self.first].fill(held);
        spectrum
    }

    /// Levenberg-Marquardt on the three L*a*b* residuals, from the grey of the same luminance.
    fn coefficients(&self, rgb: [f64; 3]) -> [f64; 3] {
        let target = lab(self.srgb.to_xyz(rgb), self.white);
        let grey = self.luminance(rgb).clamp(1e-6, 1.0 - 1e-6);
        let mut best = [0.0, 0.0, (grey - 0.5) / (grey * (1.0 - grey)).sqrt()];
        let (mut residual, mut jacobian) = self.residual(&best, &target);
        let mut damping = 1e-3;
        for _ in 0..MAX_STEPS {
            let size = norm2(&residual);
            if size < TOLERANCE * TOLERANCE {
                break;
            }
            let Some(step) = damped_step(&jacobian, &residual, damping) else {
                break;
            };
            let next: [f64; 3] =
                std::array::from_fn(|i| (best[i] - step[i]).clamp(-FLAT_LIMIT, FLAT_LIMIT));
            let (new_residual, new_jacobian) = self.residual(&next, &target);
            if norm2(&new_residual) < size {
                (best, residual, jacobian) = (next, new_residual, new_jacobian);
                damping = (damping * 0.2).max(1e-12);
            } else {
                damping *= 5.0;
                if damping > 1e12 {
                    break;
                }
            }
        }
        best
    }

    /// L*a*b* minus the target, and its derivatives by the coefficients.
    fn residual(&self, c: &[f64; 3], target: &[f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
        let mut xyz = [0.0; 3];
        let mut slopes = [[0.0; 3]; 3];
        for band in 0..BANDS {
            let t = place(band);
            let x = (c[0] * t + c[1]) * t + c[2];
            let root = 1.0 / (1.0 + x * x).sqrt();
            let value = 0.5 + 0.5 * x * root;
            let slope = 0.5 * root * root * root;
            for a in 0..3 {
                let w = self.weights[a][band];
                xyz[a] += w * value;
                let ws = w * slope;
                slopes[a][0] += ws * t * t;
                slopes[a][1] += ws * t;
                slopes[a][2] += ws;
            }
        }
        let now = lab(xyz, self.white);
        let residual = std::array::from_fn(|i| now[i] - target[i]);
        // d f(v)/dv of CIE 1976 L*a*b*: cube root above (6/29)^3, linear below.
        let curve: [f64; 3] = std::array::from_fn(|a| {
            const KNEE: f64 = 216.0 / 24389.0;
            const LINEAR: f64 = 841.0 / 108.0;
            let v = xyz[a] / self.white[a];
            let slope = if v > KNEE {
                1.0 / (3.0 * (v * v).cbrt())
            } else {
                LINEAR
            };
            slope / self.white[a]
        });
        let jacobian = [
            std::array::from_fn(|i| 116.0 * curve[1] * slopes[1][i]),
            std::array::from_fn(|i| 500.0 * (curve[0] * slopes[0][i] - curve[1] * slopes[1][i])),
            std::array::from_fn(|i| 200.0 * (curve[1] * slopes[1][i] - curve[2] * slopes[2][i])),
        ];
        (residual, jacobian)
    }
}

/// Table strides of r, g, b.
const STRIDES: [usize; 3] = [1, STEPS + 1, (STEPS + 1) * (STEPS + 1)];

fn index(cell: [usize; 3]) -> usize {
    (0..3).map(|a| cell[a] * STRIDES[a]).sum()
}

/// Linear value of a node, sin^3: close together in the dark, where the eye is finer, and at the bright end, where the
/// spectra change fastest with the colour.
fn node(i: usize) -> f64 {
    (std::f64::consts::FRAC_PI_2 * i as f64 / STEPS as f64)
        .sin()
        .powi(3)
}

/// The middle of a band on [-1, 1].
fn place(band: usize) -> f64 {
    (2 * band + 1) as f64 / BANDS as f64 - 1.0
}

fn evaluate(c: &[f64; 3]) -> Spectrum {
    std::array::from_fn(|band| {
        let t = place(band);
        let x = (c[0] * t + c[1]) * t + c[2];
        // Rounding can leave the interval by one bit.
        (0.5 + 0.5 * x / (1.0 + x * x).sqrt()).clamp(0.0, 1.0)
    })
}

fn inside(rgb: [f32; 3]) -> [f64; 3] {
    rgb.map(|c| if c > 0.0 { f64::from(c.min(1.0)) } else { 0.0 })
}

fn norm2(v: &[f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum()
}

/// Solves `(J'J + damping diag(J'J)) step = J' residual` by Cramer's rule; none where the matrix is singular.
fn damped_step(jacobian: &[[f64; 3]; 3], residual: &[f64; 3], damping: f64) -> Option<[f64; 3]> {
    let mut normal = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for (row, r) in jacobian.iter().zip(residual) {
        for i in 0..3 {
            right[i] += row[i] * r;
            for j in 0..3 {
                normal[i][j] += row[i] * row[j];
            }
        }
    }
    // Scaled to a unit diagonal first, so that the determinant can be judged.
    let scale: [f64; 3] = std::array::from_fn(|i| normal[i][i].sqrt());
    if scale.iter().any(|s| *s <= f64::MIN_POSITIVE) {
        return None;
    }
    let m = glam::DMat3::from_cols_array_2d(&std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            normal[i][j] / (scale[i] * scale[j]) + if i == j { damping } else { 0.0 }
        })
    }));
    let b = glam::DVec3::from_array(std::array::from_fn(|i| right[i] / scale[i]));
    let step = m.inverse() * b;
    step.is_finite()
        .then(|| std::array::from_fn(|i| step[i] / scale[i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{de2000, tristimulus};
    use proptest::prelude::*;

    fn difference(upsampler: &Upsampler, rgb: [f32; 3], reflectance: &Spectrum) -> f64 {
        let asked = upsampler.srgb.to_xyz(rgb.map(f64::from));
        de2000(asked, upsampler.xyz(reflectance), upsampler.white)
    }

    /// The lattice holds black, white, all corners, edges and faces of the sRGB cube; finer toward the dark.
    #[test]
    fn round_trip_over_the_whole_gamut() {
        for grid in [
            Grid::default(),
            Grid::paper(),
            Grid::new(360.0, 830.0),
            Grid::new(300.0, 780.0),
        ] {
            let upsampler = Upsampler::new(&grid);
            let n = 12;
            let level = |i: usize| (i as f32 / n as f32).powi(2);
            let mut worst = (0.0, [0.0; 3]);
            for i in 0..=n {
                for j in 0..=n {
                    for k in 0..=n {
                        let rgb = [level(i), level(j), level(k)];
                        let reflectance = upsampler.reflectance(rgb);
                        assert!(
                            reflectance.iter().all(|r| (0.0..=1.0).contains(r)),
                            "{rgb:?}"
                        );
                        let d = difference(&upsampler, rgb, &reflectance);
                        if d > worst.0 {
                            worst = (d, rgb);
                        }
                    }
                }
            }
            assert!(worst.0 < 0.5, "{grid:?}: dE00 {} at {:?}", worst.0, worst.1);
        }
    }

    #[test]
    fn greys_are_exactly_flat() {
        let upsampler = Upsampler::new(&Grid::default());
        for grey in [0.0, 1e-6, 0.18, 0.5, 0.95, 1.0f32] {
            assert_eq!(upsampler.reflectance([grey; 3]), [f64::from(grey); BANDS]);
            assert_eq!(
                upsampler.reflectance_fast([grey; 3]),
                [f64::from(grey); BANDS]
            );
        }
    }

    #[test]
    fn colours_outside_are_brought_in() {
        let upsampler = Upsampler::new(&Grid::default());
        assert_eq!(upsampler.reflectance([2.0, 5.0, 1.5]), [1.0; BANDS]);
        assert_eq!(upsampler.reflectance([f32::NAN, -1.0, 0.0]), [0.0; BANDS]);
        assert_eq!(
            upsampler.reflectance_fast([f32::NAN, -1.0, 0.0]),
            [0.0; BANDS]
        );
    }

    /// Within the gamut, neighbours differ by no more than their colours do: no jump to another branch of solutions.
    #[test]
    fn spectra_change_smoothly_with_colour() {
        let upsampler = Upsampler::new(&Grid::default());
        for path in [
            [[0.6, 0.5, 0.1], [0.1, 0.3, 0.7]],
            [[0.5, 0.5, 0.5], [0.8, 0.1, 0.1]],
        ] {
            let mut before: Option<Spectrum> = None;
            for i in 0..=200 {
                let s = i as f32 / 200.0;
                let now = upsampler.reflectance(std::array::from_fn(|a| {
                    path[0][a] * (1.0 - s) + path[1][a] * s
                }));
                if let Some(before) = before {
                    let jump = now
                        .iter()
                        .zip(&before)
                        .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
                    assert!(jump < 0.03, "{jump} at {s}");
                }
                before = Some(now);
            }
        }
    }

    /// The weights of another lamp, Y of white is 1.
    fn under(lamp: &str) -> ([Spectrum; 3], Xyz) {
        let grid = Grid::default();
        let power = grid.means(&named(lamp).unwrap().table, Outside::Hold);
        let mut weights = Observer::cie1931().weights(&grid);
        let total: f64 = power.iter().zip(&weights[1]).map(|(s, y)| s * y).sum();
        for row in &mut weights {
            row.iter_mut()
                .zip(&power)
                .for_each(|(w, s)| *w *= s / total);
        }
        (weights, weights.map(|row| row.iter().sum()))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]
        #[test]
        fn exact_and_fast_paths_agree(rgb in [0.0..1.0f32, 0.0..1.0f32, 0.0..1.0f32]) {
            static UPSAMPLER: OnceLock<Upsampler> = OnceLock::new();
            let upsampler = UPSAMPLER.get_or_init(|| Upsampler::new(&Grid::default()));
            let exact = upsampler.reflectance(rgb);
            let fast = upsampler.reflectance_fast(rgb);
            prop_assert!(difference(upsampler, rgb, &exact) < 0.5);
            prop_assert!(difference(upsampler, rgb, &fast) < 0.5);
            prop_assert!(fast.iter().all(|r| (0.0..=1.0).contains(r)));
            let d = de2000(upsampler.xyz(&exact), upsampler.xyz(&fast), upsampler.white);
            prop_assert!(d < 0.5, "dE00 {}", d);
            // Not only the same colour under D65 but nearly the same spectrum: other lamps cannot tell them apart.
            for lamp in ["cie/A", "cie/F2", "cie/F11"] {
                let (weights, white) = under(lamp);
                let [a, b] = [&exact, &fast].map(|r| tristimulus(r, &weights));
                let d = de2000(a, b, white);
                prop_assert!(d < 0.5, "dE00 {} under {}", d, lamp);
            }
        }
    }
}
