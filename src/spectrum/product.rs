//! Reflection of a list by a material (paper 3.2), and the list of successive reflections from which it is refined.
//!
//! On each interval of the cut the values multiply; the errors follow the rule of the interval type.

use super::interval::Interval;
use super::list::List;
use super::tree::{CmfTree, DyadicTree, node};

/// A light and the materials that it met: the product of their bands is the exact spectrum.
#[derive(Debug, Clone, Copy)]
pub struct Path<'a, I> {
    /// The light.
    pub source: &'a DyadicTree<I>,
    /// The materials in the order met.
    pub reflections: &'a [&'a DyadicTree<I>],
}

impl<I: Interval> Path<'_, I> {
    /// The spectrum of the path on one node, by a product for each reflection.
    #[inline]
    pub fn node(&self, n: usize, cmf: &CmfTree) -> I {
        self.reflections
            .iter()
            .fold(*self.source.node(n), |s, r| s.times(r.node(n), cmf.node(n)))
    }

    /// Both children of a node that is no leaf.
    #[inline]
    pub fn children(&self, n: usize, cmf: &CmfTree) -> [I; 2] {
        [self.node(2 * n, cmf), self.node(2 * n + 1, cmf)]
    }

    /// The exact spectrum on the 64 bands.
    pub fn spectrum(&self) -> super::Spectrum {
        let product = |band: usize| {
            self.reflections
                .iter()
                .fold(self.source.spectrum()[band], |s, r| s * r.spectrum()[band])
        };
        std::array::from_fn(product)
    }
}

impl<I: Interval> List<I> {
    /// `out` becomes this list after reflection by a material, on the same cut.
    #[inline]
    pub fn reflect(&self, reflectance: &DyadicTree<I>, cmf: &CmfTree, out: &mut Self) {
        let room = out.reset(self.partition());
        for ((slot, s), (first, len)) in room
            .iter_mut()
            .zip(self.intervals())
            .zip(self.partition().iter())
        {
            let n = node(first, len);
            *slot = s.times(reflectance.node(n), cmf.node(n));
        }
        out.settle();
    }
}
