//! Gauss quadrature (paper 2.1.2): the integral of f w is sum H_i f(x_i), exact for polynomials f as far as n points can be.
//!
//! The weight is the light times a matching function (Wallis 1975), in XYZ or in the opponent space AC1C2 (Meyer 1988).
//! C1 and C2 change sign, so their nodes are those of |w|, and their weights are interpolatory for w itself.

use super::pointwise::{Pointwise, value_at};
use crate::spectrum::{BANDS, CmfTree, Spectrum};
use nalgebra::{DMatrix, Matrix3, SymmetricEigen};

/// XYZ to AC1C2 (Meyer 1988, "Wavelength selection for synthetic image generation").
const AC1C2: [[f64; 3]; 3] = [
    [-0.0177, 1.0090, 0.0073],
    [-1.5370, 1.0821, 0.3209],
    [0.1946, -0.2045, 0.5264],
];

/// n nodes (at least 3) shared out over X, Y and Z; X, which has two humps, gets the first of a rest.
pub fn gauss_xyz(cmf: &CmfTree, light: &Spectrum, n: usize) -> Pointwise {
    let counts = [n.div_ceil(3), (n + 1) / 3, n / 3];
    build(
        "Gauss XYZ",
        cmf,
        light,
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        counts,
    )
}

/// n nodes (at least 4): half for A, a quarter for C1, the rest for C2, as in Meyer's 2 + 1 + 1.
pub fn gauss_ac1c2(cmf: &CmfTree, light: &Spectrum, n: usize) -> Pointwise {
    let (a, c1) = (n / 2, n.div_ceil(4));
    build("Gauss AC1C2", cmf, light, AC1C2, [a, c1, n - a - c1])
}

/// n nodes shared by X, Y and Z: those of light times (x_bar + y_bar + z_bar), with interpolatory weights for each of the
/// three. Not in the publications; the errors of X, Y and Z then go together, which colour differences reward.
pub fn gauss_shared(cmf: &CmfTree, light: &Spectrum, n: usize) -> Pointwise {
    let functions: [Spectrum; 3] = cmf
        .weights()
        .each_ref()
        .map(|a| std::array::from_fn(|band| light[band] * a[band]));
    let whole: Spectrum = std::array::from_fn(|band| functions.iter().map(|f| f[band]).sum());
    let (nodes, weights) = rule(&whole, &functions, n);
    let light = vec![1.0; nodes.len()];
    let weights = (0..nodes.len())
        .map(|i| std::array::from_fn(|a| weights[a][i]))
        .collect();
    Pointwise::new(
        "Gauss shared",
        nodes.into_iter().map(value_at).collect(),
        weights,
        light,
    )
}

/// `space` takes XYZ to the space of the quadrature.
fn build(
    name: &'static str,
    cmf: &CmfTree,
    light: &Spectrum,
    space: [[f64; 3]; 3],
    counts: [usize; 3],
) -> Pointwise {
    let back = Matrix3::from_fn(|r, c| space[r][c])
        .try_inverse()
        .expect("both spaces are bases");
    let (mut means, mut weights) = (Vec::new(), Vec::new());
    for (row, &count) in counts.iter().enumerate() {
        let weight = std::array::from_fn(|band| {
            light[band]
                * (0..3)
                    .map(|a| space[row][a] * cmf.weights()[a][band])
                    .sum::<f64>()
        });
        let (nodes, [h]) = rule(&weight, &[weight], count);
        for (node, h) in nodes.into_iter().zip(h) {
            means.push(value_at(node));
            weights.push(std::array::from_fn(|a| back[(a, row)] * h));
        }
    }
    let light = vec![1.0; means.len()];
    Pointwise::new(name, means, weights, light)
}

/// Nodes (positions in bands) of the weight |w|, and for each of `targets` the weights of the nodes for the sum over the
/// bands of f times the target.
///
/// Stieltjes' procedure gives the recurrence of the polynomials that are orthonormal under |w|; the eigenvalues of its
/// Jacobi matrix are the nodes (Golub and Welsch 1969).
fn rule<const N: usize>(
    w: &Spectrum,
    targets: &[Spectrum; N],
    count: usize,
) -> (Vec<f64>, [Vec<f64>; N]) {
    let total: f64 = w.iter().map(|w| w.abs()).sum();
    // Fewer nodes than asked for if the weight lives on fewer bands.
    let count = count.min(w.iter().filter(|w| **w != 0.0).count());
    let x = |band: usize| band as f64 / BANDS as f64;
    let mut jacobi = DMatrix::zeros(count, count);
    let mut polynomials: Vec<Spectrum> = vec![[1.0 / total.sqrt(); BANDS]];
    let inner = |p: &Spectrum, q: &Spectrum, power: i32| {
        (0..BANDS)
            .map(|k| p[k] * q[k] * w[k].abs() * x(k).powi(power))
            .sum::<f64>()
    };
    for j in 0..count {
        let p = polynomials[j];
        jacobi[(j, j)] = inner(&p, &p, 1);
        let mut next: Spectrum = std::array::from_fn(|k| x(k) * p[k]);
        // Against all that came before, not the last two alone: rounding would spoil the orthogonality.
        for q in &polynomials {
            let along = inner(q, &next, 0);
            next = std::array::from_fn(|k| next[k] - along * q[k]);
        }
        let norm = inner(&next, &next, 0).sqrt();
        if j + 1 < count {
            jacobi[(j, j + 1)] = norm;
            jacobi[(j + 1, j)] = norm;
            polynomials.push(next.map(|v| v / norm));
        }
    }
    let eigen = SymmetricEigen::new(jacobi);
    let nodes = eigen.eigenvalues.iter().map(|x| x * BANDS as f64).collect();
    let weights = targets.each_ref().map(|target| {
        let moments: Vec<f64> = polynomials
            .iter()
            .map(|p| (0..BANDS).map(|k| p[k] * target[k]).sum())
            .collect();
        // Components of an eigenvector are the polynomials at the node times the root of its weight under |w|.
        let weight = |i: usize| {
            let vector = eigen.eigenvectors.column(i);
            vector[0]
                * total.sqrt()
                * moments
                    .iter()
                    .zip(vector.iter())
                    .map(|(m, v)| m * v)
                    .sum::<f64>()
        };
        (0..count).map(weight).collect()
    });
    (nodes, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn n_nodes_are_exact_for_polynomials_of_degree_2n_minus_1() {
        let w: Spectrum = std::array::from_fn(|k| 1.0 + (k as f64 / 9.0).sin());
        for n in 1..=5 {
            let (nodes, [weights]) = rule(&w, &[w], n);
            for degree in 0..2 * n as i32 {
                let f = |x: f64| (x / 64.0).powi(degree);
                let exact: f64 = (0..BANDS).map(|k| w[k] * f(k as f64)).sum();
                let ours: f64 = nodes.iter().zip(&weights).map(|(x, h)| h * f(*x)).sum();
                assert!((ours - exact).abs() < 1e-10 * exact, "{n} {degree}");
            }
        }
    }

    #[test]
    fn a_weight_that_changes_sign_is_exact_to_degree_n_minus_1() {
        let w: Spectrum = std::array::from_fn(|k| (k as f64 / 9.0).sin());
        for n in 1..=5 {
            let (nodes, [weights]) = rule(&w, &[w], n);
            for degree in 0..n as i32 {
                let f = |x: f64| (x / 64.0).powi(degree);
                let exact: f64 = (0..BANDS).map(|k| w[k] * f(k as f64)).sum();
                assert!(
                    (nodes
                        .iter()
                        .zip(&weights)
                        .map(|(x, h)| h * f(*x))
                        .sum::<f64>()
                        - exact)
                        .abs()
                        < 1e-10
                );
            }
        }
    }
}
