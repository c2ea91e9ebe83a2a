//! A spectrum as a list of intervals (paper 3.1.1): what a ray or a patch carries.
//!
//! The list is a cut of the range and, packed in order of wavelength, one record for each interval. It has room for all
//! 64, so no operation allocates.

use super::interval::{Cmf, Interval, Representative};
use super::partition::Partition;
use super::tree::{CmfTree, DyadicTree, node};
use crate::data::{BANDS, Spectrum};

/// A piecewise constant spectrum with its errors.
#[derive(Debug, Clone)]
pub struct List<I> {
    partition: Partition,
    intervals: [I; BANDS],
    /// Radius of the error of the whole: the sum over the intervals, or less where an interval was halved blindly.
    radius: Cmf,
}

impl<I: Interval> List<I> {
    /// The spectrum of a tree on a cut.
    pub fn new(tree: &DyadicTree<I>, partition: Partition) -> Self {
        let mut list = Self::black();
        list.partition = partition;
        for (slot, (first, len)) in list.intervals.iter_mut().zip(partition.iter()) {
            *slot = *tree.node(node(first, len));
        }
        list.settle();
        list
    }

    /// A spectrum that is exactly constant on each interval; `values` holds at least as many as the cut has intervals.
    ///
    /// # Panics
    /// If there are too few values.
    pub fn from_values(partition: Partition, values: &[f64]) -> Self {
        let mut list = Self::black();
        list.set(partition, values);
        list
    }

    /// Writes values known to be exact over the list, see [`List::from_values`].
    ///
    /// # Panics
    /// If there are too few values.
    pub fn set(&mut self, partition: Partition, values: &[f64]) {
        self.partition = partition;
        for (slot, &value) in self.intervals.iter_mut().zip(&values[..partition.count()]) {
            *slot = I::constant(value);
        }
        self.radius = [0.0; 3];
    }

    /// Writes known records over the list.
    pub(super) fn load(&mut self, partition: Partition, records: &[I]) {
        self.reset(partition).copy_from_slice(records);
        self.settle();
    }

    /// Nothing, as one interval.
    pub fn black() -> Self {
        Self {
            partition: Partition::ROOT,
            intervals: [I::default(); BANDS],
            radius: [0.0; 3],
        }
    }

    /// The cut.
    #[inline]
    pub fn partition(&self) -> Partition {
        self.partition
    }

    /// Its intervals, in order of wavelength.
    #[inline]
    pub fn intervals(&self) -> &[I] {
        &self.intervals[..self.partition.count()]
    }

    /// Room for the records of a cut, to be filled by the caller.
    pub(super) fn reset(&mut self, partition: Partition) -> &mut [I] {
        self.partition = partition;
        &mut self.intervals[..partition.count()]
    }

    /// Sum of the estimated errors: what the tristimulus values of the list lack.
    #[inline]
    pub fn error(&self) -> Cmf {
        self.intervals()
            .iter()
            .fold([0.0; 3], |sum, i| add(sum, i.error()))
    }

    /// How far the error of the whole may lie from [`List::error`], for each tristimulus value; zero where that is not known.
    #[inline]
    pub fn radius(&self) -> Cmf {
        self.radius
    }

    /// After the records were written: the radius of the whole is the sum over the intervals.
    #[inline]
    pub(super) fn settle(&mut self) {
        self.radius = self
            .intervals()
            .iter()
            .fold([0.0; 3], |sum, i| add(sum, i.radius()));
    }

    /// Sets the radius of the whole to one that is known to be less than the sum.
    pub(super) fn set_radius(&mut self, radius: Cmf) {
        self.radius = radius;
    }

    /// Tristimulus values with the estimated error added back: as near to the truth as the list can tell, within
    /// [`List::radius`]. The list carries the errors anyway, so this costs a sum.
    ///
    /// The paper controls the error of [`List::xyz`] and gives that out. On its own tests these values are on average 3
    /// (primary) to 6 (tertiary) times nearer to the truth.
    #[inline]
    pub fn corrected_xyz(&self, cmf: &CmfTree) -> Cmf {
        add(self.xyz(cmf), self.error())
    }

    /// Change to tristimulus values (3.3): A = sum of value times A_a.
    #[inline]
    pub fn xyz(&self, cmf: &CmfTree) -> Cmf {
        let mut sum = [0.0; 3];
        for (interval, (first, len)) in self.intervals().iter().zip(self.partition.iter()) {
            let weights = cmf.node(node(first, len));
            for a in 0..3 {
                sum[a] += interval.value() * weights[a];
            }
        }
        sum
    }

    /// The list on the 64 bands.
    pub fn spectrum(&self) -> Spectrum {
        let mut spectrum = [0.0; BANDS];
        for (interval, (first, len)) in self.intervals().iter().zip(self.partition.iter()) {
            spectrum[first..first + len].fill(interval.value());
        }
        spectrum
    }

    /// Replaces the interval at `first` by two; nothing happens to one of a single band.
    pub fn split(&mut self, first: usize, halves: [I; 2]) {
        let Some(finer) = self.partition.split(first) else {
            return;
        };
        let (rank, count) = (self.partition.rank(first), self.partition.count());
        self.intervals.copy_within(rank + 1..count, rank + 2);
        self.intervals[rank..rank + 2].copy_from_slice(&halves);
        self.partition = finer;
        self.settle();
    }

    /// Halves the interval at `first` without knowledge of more than its record: values and the error of the whole stay.
    pub fn halve(&mut self, first: usize, cmf: &CmfTree) {
        if self.partition.split(first).is_none() {
            return;
        }
        let (rank, n) = (
            self.partition.rank(first),
            node(first, self.partition.len_at(first)),
        );
        let whole = self.intervals[rank];
        let radius = self.radius;
        self.split(
            first,
            [2 * n, 2 * n + 1].map(|child| whole.half(cmf.node(n), cmf.node(child))),
        );
        self.radius = radius;
    }

    /// Makes the sibling pair whose left half starts at `first` one interval; false if there is no such pair.
    #[inline]
    pub fn merge(&mut self, first: usize, cmf: &CmfTree, rule: Representative) -> bool {
        let Some(coarser) = self
            .partition
            .merge(first)
            .filter(|coarser| coarser.starts(first))
        else {
            return false;
        };
        let (rank, count) = (self.partition.rank(first), self.partition.count());
        let n = node(first, self.partition.len_at(first));
        let share = cmf.share(n / 2, rule);
        let (left, right) = (self.intervals[rank], self.intervals[rank + 1]);
        self.intervals[rank] = I::merged(&left, &right, [cmf.node(n), cmf.node(n + 1)], share);
        // A loop, as a call to move some records costs more than the records do.
        for i in rank + 2..count {
            self.intervals[i - 1] = self.intervals[i];
        }
        self.partition = coarser;
        true
    }

    /// Checks what must hold of every list.
    ///
    /// # Errors
    /// What is wrong.
    pub fn validate(&self) -> Result<(), String> {
        if !Partition::is_valid(self.partition.bits()) {
            return Err(format!("cut {:x} is not dyadic", self.partition.bits()));
        }
        for (rank, interval) in self.intervals().iter().enumerate() {
            let finite =
                interval.value().is_finite() && interval.error().iter().all(|e| e.is_finite());
            if !finite || !interval.radius().iter().all(|r| *r >= 0.0) {
                return Err(format!("interval {rank}: {interval:?}"));
            }
        }
        Ok(())
    }
}

impl<I: Interval> List<I> {
    /// Copies the cut and the records in use: cheaper than `clone`, which copies the room of all 64.
    #[inline]
    pub fn copy_from(&mut self, other: &Self) {
        let count = other.partition.count();
        self.partition = other.partition;
        self.radius = other.radius;
        self.intervals[..count].copy_from_slice(&other.intervals[..count]);
    }
}

#[inline]
pub(super) fn add(a: Cmf, b: Cmf) -> Cmf {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
