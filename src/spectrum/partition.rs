//! A dyadic cut of the wavelength range (paper 3.1.1): the intervals on which a spectrum is held constant.
//!
//! Every interval is [i 2^(6-j), (i+1) 2^(6-j)) in bands, for a level j in 0..=6, so the whole cut fits one `u64`:
//! bit k is set where an interval starts at band k. The union of two cuts (intervals of either, whichever is finer)
//! is OR, the number of intervals is a popcount.

/// A dyadic cut; bit k set means that an interval starts at band k.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Partition(u64);

impl Partition {
    /// One interval over everything.
    pub const ROOT: Self = Self(1);
    /// 64 intervals of one band.
    pub const BANDS: Self = Self(u64::MAX);

    /// A cut from its bits; none if an interval would not be dyadic.
    ///
    /// ```
    /// use haarlight::spectrum::Partition;
    /// assert!(Partition::new(1 | 1 << 32).is_some());
    /// assert!(Partition::new(1 | 1 << 16).is_none()); // 16..64 is no dyadic interval
    /// ```
    pub fn new(bits: u64) -> Option<Self> {
        Self::is_valid(bits).then_some(Self(bits))
    }

    /// Is every interval of these bits dyadic?
    pub fn is_valid(bits: u64) -> bool {
        bits & 1 == 1
            && Self(bits)
                .iter()
                .all(|(first, len)| len.is_power_of_two() && first % len == 0)
    }

    /// The coarsest cut whose intervals start at all the given bands; bits that are no dyadic cut are completed.
    pub fn covering(bits: u64) -> Self {
        let mut all = Self::ROOT.0;
        // An interval that starts at k of level j has a sibling: every ancestor of band k is split, down to where
        // k is the start of a right child.
        for k in (1..64).filter(|k| bits >> k & 1 == 1) {
            let mut len = 64;
            while k % len != 0 {
                let start = k / len * len;
                all |= 1 << start | 1 << (start + len / 2);
                len /= 2;
            }
        }
        Self(all)
    }

    /// Two to the `level` equal intervals; `level` in 0..=6, greater levels count as 6.
    pub fn uniform(level: u32) -> Self {
        let len = 64usize >> level.min(6);
        Self((0..64).step_by(len).fold(0, |bits, k| bits | 1 << k))
    }

    /// The bits.
    #[inline]
    pub fn bits(self) -> u64 {
        self.0
    }

    /// Number of intervals, in 1..=64.
    #[inline]
    pub fn count(self) -> usize {
        self.0.count_ones() as usize
    }

    /// The coarsest cut that is as fine as both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The finest cut that is as coarse as both.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Does every interval of `self` lie inside one interval of `other`?
    pub fn refines(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Does an interval start at this band (in 0..64)?
    #[inline]
    pub fn starts(self, band: usize) -> bool {
        self.0 >> band & 1 == 1
    }

    /// Index of the interval that starts at `band`, which must be the start of one.
    #[inline]
    pub fn rank(self, band: usize) -> usize {
        (self.0 & ((1 << band) - 1)).count_ones() as usize
    }

    /// Number of bands of the interval that starts at `band`.
    #[inline]
    pub fn len_at(self, band: usize) -> usize {
        // `>> 1` first: a shift by 64 would overflow for the last band.
        let after = self.0 >> band >> 1;
        (after.trailing_zeros() as usize + 1).min(64 - band)
    }

    /// Intervals as (first band, number of bands), in order of wavelength.
    #[inline]
    pub fn iter(self) -> Intervals {
        Intervals(self.0)
    }

    /// The cut with the interval at `band` halved; none if it is one band or no interval starts there.
    #[inline]
    pub fn split(self, band: usize) -> Option<Self> {
        if band >= 64 || !self.starts(band) {
            return None;
        }
        let half = self.len_at(band) / 2;
        (half > 0).then(|| Self(self.0 | 1 << (band + half)))
    }

    /// The start of the interval that forms, with the one at `band`, the whole of their parent; none if there is no such
    /// interval in the cut (the sibling is split further, or the cut is the root).
    #[inline]
    pub fn sibling(self, band: usize) -> Option<usize> {
        if band >= 64 || !self.starts(band) {
            return None;
        }
        let len = self.len_at(band);
        if len == 64 {
            return None;
        }
        let sibling = band ^ len;
        (self.starts(sibling) && self.len_at(sibling) == len).then_some(sibling)
    }

    /// The cut with the interval at `band` and its sibling made one; none if the sibling is not in the cut.
    #[inline]
    pub fn merge(self, band: usize) -> Option<Self> {
        let sibling = self.sibling(band)?;
        Some(Self(self.0 & !(1 << band.max(sibling))))
    }

    /// Starts of the left halves of all sibling pairs in the cut, as bits.
    #[inline]
    pub fn pairs(self) -> u64 {
        (0..6).fold(0, |all, height| all | self.pairs_of(height))
    }

    /// The pairs whose halves have 2^height bands, height in 0..6.
    #[inline]
    pub(super) fn pairs_of(self, height: u32) -> u64 {
        let (bits, len) = (self.0, 1u32 << height);
        // A start at k + len means that the parent over 2 len bands is halved.
        let halved = bits & bits >> len & PARENTS[height as usize];
        // An interval that is split has a start at its middle.
        let middle = len / 2;
        if middle == 0 {
            halved
        } else {
            halved & !(bits >> middle) & !(bits >> (len + middle))
        }
    }
}

/// Multiples of 2, 4, ... 64 as bits: where the parents of intervals of 1, 2, ... 32 bands start.
const PARENTS: [u64; 6] = [
    0x5555_5555_5555_5555,
    0x1111_1111_1111_1111,
    0x0101_0101_0101_0101,
    0x0001_0001_0001_0001,
    0x0000_0001_0000_0001,
    1,
];

impl From<Partition> for u64 {
    fn from(cut: Partition) -> Self {
        cut.0
    }
}

impl TryFrom<u64> for Partition {
    type Error = u64;

    fn try_from(bits: u64) -> Result<Self, u64> {
        Self::new(bits).ok_or(bits)
    }
}

/// Intervals of a [`Partition`] as (first band, number of bands).
#[derive(Debug, Clone)]
pub struct Intervals(u64);

impl Iterator for Intervals {
    type Item = (usize, usize);

    #[inline]
    fn next(&mut self) -> Option<(usize, usize)> {
        if self.0 == 0 {
            return None;
        }
        let first = self.0.trailing_zeros() as usize;
        self.0 &= self.0 - 1;
        // With no further bit trailing_zeros is 64, the end of the range.
        Some((first, self.0.trailing_zeros() as usize - first))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let count = self.0.count_ones() as usize;
        (count, Some(count))
    }
}

impl ExactSizeIterator for Intervals {}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Any dyadic cut.
    pub(crate) fn any_cut() -> impl Strategy<Value = Partition> {
        any::<[u64; 3]>().prop_map(|[a, b, c]| Partition::covering(a & b & c))
    }

    #[test]
    fn uniform_cuts() {
        assert_eq!(Partition::uniform(0), Partition::ROOT);
        assert_eq!(Partition::uniform(6), Partition::BANDS);
        assert_eq!(
            Partition::uniform(3)
                .iter()
                .map(|i| i.1)
                .collect::<Vec<_>>(),
            vec![8; 8]
        );
        assert_eq!(Partition::BANDS.iter().last(), Some((63, 1)));
        assert_eq!(Partition::BANDS.len_at(63), 1);
        assert_eq!(Partition::BANDS.split(63), None);
        assert_eq!(Partition::ROOT.merge(0), None);
        assert!(!Partition::is_valid(0));
    }

    proptest! {
        #[test]
        fn every_operation_keeps_the_cut_dyadic(a in any_cut(), b in any_cut(), band in 0usize..64) {
            for cut in [a, a.union(b), a.intersection(b)] {
                prop_assert!(Partition::is_valid(cut.bits()), "{:x}", cut.bits());
            }
            prop_assert!(a.union(b).refines(a) && a.refines(a.intersection(b)));
            prop_assert_eq!(a.iter().map(|(_, len)| len).sum::<usize>(), 64);
            prop_assert_eq!(a.iter().len(), a.count());
            for (rank, (first, len)) in a.iter().enumerate() {
                prop_assert_eq!(a.rank(first), rank);
                prop_assert_eq!(a.len_at(first), len);
            }
            if let Some(finer) = a.split(band) {
                prop_assert!(Partition::is_valid(finer.bits()));
                prop_assert_eq!(finer.merge(band), Some(a));
                prop_assert_eq!(finer.sibling(band), Some(band + a.len_at(band) / 2));
                prop_assert!(finer.pairs() >> band & 1 == 1);
            }
            for k in 0..64 {
                let is_left = a.sibling(k).is_some_and(|sibling| sibling > k);
                prop_assert_eq!(a.pairs() >> k & 1 == 1, is_left);
                if is_left {
                    prop_assert!(Partition::is_valid(a.merge(k).unwrap().bits()));
                }
            }
            prop_assert_eq!(Partition::covering(a.bits()), a);
        }
    }
}
