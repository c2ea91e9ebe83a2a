//! Lists of many patches, packed: each takes as many records as it has intervals.

use super::interval::Interval;
use super::list::List;
use super::partition::Partition;

/// A list for each patch. A patch without light takes no records.
#[derive(Debug, Clone)]
pub struct ListTable<I> {
    /// Where each patch's records start, and on which cut they lie; none: no light.
    at: Vec<Option<(usize, Partition)>>,
    records: Vec<I>,
}

impl<I: Interval> ListTable<I> {
    /// A table of patches without light.
    pub fn dark(patches: usize) -> Self {
        Self {
            at: vec![None; patches],
            records: Vec::new(),
        }
    }

    /// One table after the other.
    pub fn joined(tables: impl IntoIterator<Item = Self>) -> Self {
        let mut all = Self::dark(0);
        for table in tables {
            let before = all.records.len();
            let moved = table.at.into_iter();
            all.at
                .extend(moved.map(|at| at.map(|(first, cut)| (before + first, cut))));
            all.records.extend(table.records);
        }
        all
    }

    /// Gives a patch a list. Not for a patch that has one: its records would stay.
    pub fn set(&mut self, patch: usize, list: &List<I>) {
        if list.intervals().iter().any(|i| i.value() != 0.0) {
            self.at[patch] = Some((self.records.len(), list.partition()));
            self.records.extend_from_slice(list.intervals());
        }
    }

    /// Copies the list of a patch into `list`; false if it has no light.
    pub fn get(&self, patch: usize, list: &mut List<I>) -> bool {
        let Some((first, cut)) = self.at[patch] else {
            return false;
        };
        list.load(cut, &self.records[first..first + cut.count()]);
        true
    }

    /// Patches with light, and all their intervals.
    pub fn counts(&self) -> [usize; 2] {
        [self.at.iter().flatten().count(), self.records.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{Moment, SpectralList};

    #[test]
    fn a_table_gives_back_what_was_put_in() {
        let mut table = ListTable::<Moment>::dark(3);
        let long = SpectralList::from_values(Partition::uniform(2), &[1.0, 2.0, 3.0, 4.0]);
        let short = SpectralList::from_values(Partition::ROOT, &[5.0]);
        table.set(2, &long);
        table.set(0, &short);
        table.set(1, &SpectralList::black());
        let mut list = SpectralList::black();
        assert!(!table.get(1, &mut list));
        assert!(table.get(2, &mut list));
        assert_eq!(list.spectrum(), long.spectrum());
        assert!(table.get(0, &mut list));
        assert_eq!(list.spectrum(), short.spectrum());
        assert_eq!(table.counts(), [2, 5]);
        let twice = ListTable::joined([table.clone(), table]);
        assert!(!twice.get(4, &mut list) && twice.get(5, &mut list));
        assert_eq!(list.spectrum(), long.spectrum());
        assert_eq!(twice.counts(), [4, 10]);
    }
}
