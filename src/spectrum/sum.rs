//! Sums of lists, because radiosity adds: B = E + rho sum_j F_j B_j.
//!
//! On a common cut values, errors, radii and spreads add with the factors. On different cuts the sum lies on their union;
//! an interval that the union halves keeps its value and its error as a whole, and what is not known of the halves widens
//! their radii, but not that of the whole. A sum is then compressed by [`super::coarsen`] under an error limit.

use super::interval::Interval;
use super::list::{List, add};
use super::partition::Partition;
use super::tree::CmfTree;

impl<I: Interval> List<I> {
    /// Halves intervals until the cut is as fine as `partition`.
    pub fn refine_to(&mut self, partition: Partition, cmf: &CmfTree) {
        let goal = self.partition().union(partition);
        while self.partition() != goal {
            // The first missing start lies inside some interval; halving that one brings it nearer.
            let missing = (goal.bits() & !self.partition().bits()).trailing_zeros();
            let before = self.partition().bits() & ((1 << missing) - 1);
            let first = 63 - before.leading_zeros() as usize;
            self.halve(first, cmf);
        }
    }

    /// Adds `factor` (finite, not negative) times another list; the cut becomes the union of both.
    pub fn add_scaled(&mut self, factor: f64, other: &Self, cmf: &CmfTree) {
        self.refine_to(other.partition(), cmf);
        let radius = add(self.radius(), other.radius().map(|r| factor * r));
        if other.partition() == self.partition() {
            self.accumulate(factor, other);
        } else {
            let mut finer = Self::black();
            finer.copy_from(other);
            finer.refine_to(self.partition(), cmf);
            self.accumulate(factor, &finer);
        }
        self.set_radius(radius);
    }

    /// Adds records on equal cuts.
    fn accumulate(&mut self, factor: f64, other: &Self) {
        let room = self.reset(other.partition());
        for (mine, theirs) in room.iter_mut().zip(other.intervals()) {
            *mine = mine.plus(factor, theirs);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::bound::tests::holds;
    use crate::spectrum::partition::tests::any_cut;
    use crate::spectrum::testing::{cmf, patch};
    use crate::spectrum::{
        Bounded, Control, DyadicTree, Estimate, Metric, Moment, Spectrum, coarsen,
    };
    use proptest::prelude::*;

    fn spectra() -> impl Strategy<Value = Vec<(Spectrum, Spectrum, Partition, f64)>> {
        prop::collection::vec((patch(), patch(), any_cut(), 0.0..1.0f64), 1..6)
    }

    /// Factors times products of two spectra, each on its own cut, and the exact sum.
    fn add_up<I: Interval>(terms: &[(Spectrum, Spectrum, Partition, f64)]) -> (List<I>, Spectrum) {
        let cmf = cmf();
        let (mut sum, mut exact) = (List::black(), [0.0; 64]);
        let mut term = List::black();
        for (s, r, cut, factor) in terms {
            List::new(&DyadicTree::<I>::new(s, &cmf), *cut).reflect(
                &DyadicTree::new(r, &cmf),
                &cmf,
                &mut term,
            );
            sum.add_scaled(*factor, &term, &cmf);
            exact = std::array::from_fn(|k| exact[k] + factor * s[k] * r[k]);
        }
        (sum, exact)
    }

    proptest! {
        #[test]
        fn the_bound_of_a_sum_holds(terms in spectra(), more in patch(), limit in 0.01..10.0f64) {
            let cmf = cmf();
            let (mut sum, exact) = add_up::<Bounded>(&terms);
            prop_assert_eq!(holds(&sum, &exact, &cmf), Ok(()));
            // Also after a further product, where the halves count one by one.
            let mut product = List::black();
            sum.reflect(&DyadicTree::new(&more, &cmf), &cmf, &mut product);
            let reflected = std::array::from_fn(|k| exact[k] * more[k]);
            prop_assert_eq!(holds(&product, &reflected, &cmf), Ok(()));
            // And after compression, which keeps the limit wherever the sum itself was within it.
            let before = Metric::Xyz.size(sum.error(), sum.radius());
            let count = sum.partition().count();
            coarsen(&mut sum, &cmf, &Metric::Xyz, &Control::within(limit));
            prop_assert_eq!(holds(&sum, &exact, &cmf), Ok(()));
            prop_assert!(Metric::Xyz.size(sum.error(), sum.radius()) <= before.max(limit) + 1e-12);
            prop_assert!(sum.partition().count() <= count);
        }

        #[test]
        fn values_on_a_common_cut_add(terms in spectra(), cut in any_cut()) {
            let same: Vec<_> = terms.iter().map(|t| (t.0, [1.0; 64], cut, t.3)).collect();
            let (sum, exact) = add_up::<Estimate>(&same);
            let fine = cut.union(Partition::ROOT);
            prop_assert_eq!(sum.partition(), fine);
            let direct = List::new(&DyadicTree::<Estimate>::new(&exact, &cmf()), fine);
            for (ours, theirs) in sum.intervals().iter().zip(direct.intervals()) {
                prop_assert!((ours.value - theirs.value).abs() < 1e-12);
                prop_assert!((0..3).all(|a| (ours.error[a] - theirs.error[a]).abs() < 1e-11));
            }
        }

        #[test]
        fn halving_keeps_the_error_of_the_whole(s in patch(), coarse in any_cut(), fine in any_cut()) {
            let cmf = cmf();
            let mut list = List::new(&DyadicTree::<Moment>::new(&s, &cmf), coarse);
            let (error, xyz) = (list.error(), list.xyz(&cmf));
            list.refine_to(fine, &cmf);
            prop_assert_eq!(list.partition(), coarse.union(fine));
            for a in 0..3 {
                prop_assert!((list.error()[a] - error[a]).abs() < 1e-12 && (list.xyz(&cmf)[a] - xyz[a]).abs() < 1e-12);
            }
        }
    }
}
