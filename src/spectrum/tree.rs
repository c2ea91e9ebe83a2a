//! The data base of the pre-processing step (paper 3.1.2): spectra and colour matching functions as binary trees.
//!
//! A tree has 127 nodes, level j in 0..=6 and index i in 0..2^j; node (j, i) covers the bands
//! [i 2^(6-j), (i+1) 2^(6-j)). It is stored as an array in heap order: (j, i) lies at 2^j + i.
//!
//! The average of eq. 3 is the value that makes the sum of the squares of the three errors of eq. 2 least.

use super::interval::{Cmf, Interval, Representative};
use super::partition::Partition;
use crate::data::{BANDS, Spectrum};

/// Nodes of a tree in heap order; index 0 is not used.
pub const NODES: usize = 2 * BANDS;

/// Heap index of the node over `len` bands from `first`.
#[inline]
pub fn node(first: usize, len: usize) -> usize {
    // `len` is a power of two and divides `first`, so the shift is an exact division.
    (BANDS + first) >> len.trailing_zeros()
}

/// First band and number of bands of a node.
pub fn span(node: usize) -> (usize, usize) {
    let level = node.ilog2();
    let len = BANDS >> level;
    ((node - (1 << level)) * len, len)
}

/// The colour matching functions on every node: A_a = integral of a_bar over the node, without K.
///
/// It also fixes how spectra are averaged (eq. 3). Under a light, see [`CmfTree::under`], it weighs by that light.
#[derive(Debug, Clone)]
pub struct CmfTree {
    weights: [Spectrum; 3],
    nodes: [Cmf; NODES],
    /// For each node with children: the left child's share in the value of both by eq. 3.
    shares: [f64; BANDS],
    /// For each node with children: what a difference of 1 between the children's values adds to the errors when they merge.
    gains: [Cmf; BANDS],
}

impl CmfTree {
    /// From the weights of the bands (finite, not negative), e.g. [`crate::color::Observer::weights`].
    pub fn new(weights: [Spectrum; 3]) -> Self {
        let mut nodes = [[0.0; 3]; NODES];
        for band in 0..BANDS {
            nodes[BANDS + band] = weights.each_ref().map(|a| a[band]);
        }
        for n in (1..BANDS).rev() {
            nodes[n] = std::array::from_fn(|a| nodes[2 * n][a] + nodes[2 * n + 1][a]);
        }
        let mut this = Self {
            weights,
            nodes,
            shares: [0.5; BANDS],
            gains: [[0.0; 3]; BANDS],
        };
        for n in 1..BANDS {
            this.shares[n] = this.projected_share(n);
            this.gains[n] = this.gain(n, this.shares[n]);
        }
        this
    }

    /// Least squares in the three tristimulus values, as in eq. 3; half where all weights are zero.
    fn projected_share(&self, n: usize) -> f64 {
        let (mut left, mut whole) = (0.0, 0.0);
        for a in 0..3 {
            left += self.nodes[n][a] * self.nodes[2 * n][a];
            whole += self.nodes[n][a] * self.nodes[n][a];
        }
        if whole > 0.0 { left / whole } else { 0.5 }
    }

    /// Change of the errors for a difference of 1, if the merged value takes `share` of the left one.
    #[inline]
    fn gain(&self, n: usize, share: f64) -> Cmf {
        std::array::from_fn(|a| {
            self.nodes[2 * n][a] * (1.0 - share) - self.nodes[2 * n + 1][a] * share
        })
    }

    /// The left child's share in the value of a node (in 1..64) that takes the place of its children.
    #[inline]
    pub fn share(&self, node: usize, rule: Representative) -> f64 {
        match rule {
            Representative::Mean => 0.5,
            Representative::Projection => self.shares[node],
        }
    }

    /// What a merge into `node` (in 1..64) adds to the three errors, for a left value that is 1 above the right one.
    #[inline]
    pub fn merge_gain(&self, node: usize, rule: Representative) -> Cmf {
        match rule {
            Representative::Mean => self.gain(node, 0.5),
            Representative::Projection => self.gains[node],
        }
    }

    /// The same with a light as further weight: power times a_bar.
    ///
    /// A spectrum B = S q is then held as its ratio q to the light S. Averages, errors and tristimulus values are those
    /// of B although only q, which is smooth even under line spectra, is cut into intervals.
    #[must_use]
    pub fn under(&self, power: &Spectrum) -> Self {
        Self::new(
            self.weights
                .each_ref()
                .map(|a| std::array::from_fn(|band| a[band] * power[band])),
        )
    }

    /// Weights of the bands.
    pub fn weights(&self) -> &[Spectrum; 3] {
        &self.weights
    }

    /// Sums over a node.
    #[inline]
    pub fn node(&self, node: usize) -> &Cmf {
        &self.nodes[node]
    }

    /// The value of `f` on a node by eq. 3; the plain mean where all weights are zero.
    pub fn average(&self, f: &Spectrum, node: usize) -> f64 {
        let (first, len) = span(node);
        let (mut above, mut below) = (0.0, 0.0);
        for a in 0..3 {
            let whole = self.nodes[node][a];
            above += whole
                * (first..first + len)
                    .map(|band| f[band] * self.weights[a][band])
                    .sum::<f64>();
            below += whole * whole;
        }
        if below > 0.0 {
            above / below
        } else {
            f[first..first + len].iter().sum::<f64>() / len as f64
        }
    }

    /// Values of `f` on the intervals of a cut by eq. 3, packed at the front of the result.
    ///
    /// ```
    /// use haarlight::{color::Observer, spectrum::{CmfTree, Grid, Partition}};
    /// let grid = Grid::default();
    /// let cmf = CmfTree::new(Observer::cie1931().weights(&grid));
    /// let constant = cmf.weighted_average(&[0.5; 64], Partition::uniform(2));
    /// assert!(constant[..4].iter().all(|v| (v - 0.5).abs() < 1e-15));
    /// ```
    pub fn weighted_average(&self, f: &Spectrum, partition: Partition) -> Spectrum {
        let mut values = [0.0; BANDS];
        for (value, (first, len)) in values.iter_mut().zip(partition.iter()) {
            *value = self.average(f, node(first, len));
        }
        values
    }
}

/// A spectrum as a binary tree: for each node the average and what the interval type keeps of its errors.
#[derive(Debug, Clone)]
pub struct DyadicTree<I> {
    spectrum: Spectrum,
    nodes: [I; NODES],
}

impl<I: Interval> DyadicTree<I> {
    /// From the bands (finite).
    pub fn new(f: &Spectrum, cmf: &CmfTree) -> Self {
        let mut nodes = [I::default(); NODES];
        for (n, slot) in nodes.iter_mut().enumerate().skip(1) {
            let (first, len) = span(n);
            let over = first..first + len;
            // The average of a band is the band itself, to the last bit: its errors are exactly 0.
            let average = if len == 1 {
                f[first]
            } else {
                cmf.average(f, n)
            };
            *slot = I::new(
                average,
                &f[over.clone()],
                cmf.weights.each_ref().map(|a| &a[over.clone()]),
            );
        }
        Self {
            spectrum: *f,
            nodes,
        }
    }

    /// The bands it was made from.
    pub fn spectrum(&self) -> &Spectrum {
        &self.spectrum
    }

    /// A node by heap index.
    #[inline]
    pub fn node(&self, node: usize) -> &I {
        &self.nodes[node]
    }

    /// Checks what must hold: bands are exact, and the errors of two children are their parent's up to the change of value.
    ///
    /// # Errors
    /// The first node that is wrong.
    pub fn validate(&self, cmf: &CmfTree) -> Result<(), String> {
        for n in 1..NODES {
            let (first, len) = span(n);
            let (value, error) = (self.nodes[n].value(), self.nodes[n].error());
            for a in 0..3 {
                let exact: f64 = (first..first + len)
                    .map(|band| (self.spectrum[band] - value) * cmf.weights[a][band])
                    .sum();
                let scale: f64 = (first..first + len)
                    .map(|band| self.spectrum[band].abs() * cmf.weights[a][band])
                    .sum();
                if (error[a] - exact).abs() > 1e-12 * scale || (len == 1 && error[a] != 0.0) {
                    return Err(format!(
                        "node {n}: error {a} is {}, should be {exact}",
                        error[a]
                    ));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Estimate;
    use crate::spectrum::testing::{cmf, patch};
    use proptest::prelude::*;

    #[test]
    fn heap_order() {
        for n in 1..NODES {
            let (first, len) = span(n);
            assert_eq!(node(first, len), n);
        }
        assert_eq!(span(1), (0, 64));
        assert_eq!(span(127), (63, 1));
    }

    #[test]
    fn without_weights_the_average_is_the_mean() {
        let blind = CmfTree::new([[0.0; BANDS]; 3]);
        let ramp = std::array::from_fn(|band| band as f64);
        assert_eq!(blind.average(&ramp, 1), 31.5);
        assert!(
            DyadicTree::<Estimate>::new(&ramp, &blind)
                .validate(&blind)
                .is_ok()
        );
    }

    proptest! {
        #[test]
        fn the_average_minimises_the_squared_errors(f in patch(), n in 1usize..NODES, step in -0.1..0.1f64) {
            let cmf = cmf();
            let tree = DyadicTree::<Estimate>::new(&f, &cmf);
            prop_assert_eq!(tree.validate(&cmf), Ok(()));
            let (first, len) = span(n);
            let squares = |value: f64| (0..3).map(|a| (first..first + len).map(|k| (f[k] - value) * cmf.weights()[a][k]).sum::<f64>().powi(2)).sum::<f64>();
            let average = tree.node(n).value;
            prop_assert!(squares(average) <= squares(average + step) + 1e-12);
        }

        #[test]
        fn under_a_light_the_ratio_has_the_errors_of_the_product(q in patch(), light in patch(), n in 1usize..NODES) {
            let cmf = cmf();
            let under = cmf.under(&light);
            let node = *DyadicTree::<Estimate>::new(&q, &under).node(n);
            let (first, len) = span(n);
            for a in 0..3 {
                let exact: f64 = (first..first + len).map(|k| light[k] * (q[k] - node.value) * cmf.weights()[a][k]).sum();
                prop_assert!((node.error[a] - exact).abs() < 1e-12);
            }
        }
    }
}
