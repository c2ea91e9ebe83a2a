//! Panes and mirrors between leaves that look for themselves: which of them rays pass, and what remains of each lane.
//!
//! Rays are kept from round to round and lanes are not, so a ray keeps the panes and mirrors it passes. Angles and thicknesses are
//! rounded:
//! a room has few panes and mirrors, and thousands of rays then share one filter.

use crate::light::passed::{self, Passed};
use crate::light::{Filters, Rows, padded};
use crate::store::Broken;
use crate::store::codec::Read;
use std::collections::{BTreeMap, BTreeSet};

/// The panes and mirrors that the rays of leaves pass.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tints {
    /// For each ray the filter that it passes, counted from 1; 0: none. Empty in a room without panes and mirrors.
    of: Vec<u32>,
    /// The filters that rays pass.
    known: BTreeMap<Passed, u32>,
    /// Transmittance of each filter, by lane.
    rows: Rows,
}

impl Tints {
    /// Does no ray pass anything?
    pub(super) fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// Adds `count` rays of one more leaf: `passed` lists those that pass anything, in order.
    pub(super) fn extend(&mut self, count: usize, passed: Vec<(u32, Passed)>) {
        let first = self.of.len();
        self.of.resize(first + count, 0);
        for (ray, passed) in passed {
            let next = self.known.len() as u32 + 1;
            self.of[first + ray as usize] = *self.known.entry(passed).or_insert(next);
        }
    }

    /// Number of filters that rays pass.
    pub(super) fn filters(&self) -> usize {
        self.known.len()
    }

    /// Forgets all but the first `rays` rays and `filters` filters.
    pub(super) fn shrink(&mut self, rays: usize, filters: usize) {
        self.of.truncate(rays);
        self.known.retain(|_, number| *number as usize <= filters);
    }

    /// The number of the filter of a ray, counted from 1; 0: none.
    pub(super) fn of(&self, ray: usize) -> u32 {
        self.of[ray]
    }

    /// All filters that rays pass, encoded for [`all_of`].
    pub(super) fn numbers(&self) -> Vec<u64> {
        listed(self.known.keys())
    }

    /// For each filter here, in order of its number, its number in a list of all, counted from 1.
    pub(super) fn places_in(&self, all: &BTreeSet<Passed>) -> Vec<u32> {
        let place: BTreeMap<&Passed, u32> = all.iter().zip(1..).collect();
        let mut places = vec![0; self.known.len()];
        for (passed, &number) in &self.known {
            places[number as usize - 1] = place[passed];
        }
        places
    }

    /// Rays that pass filters of a list of all, by number.
    ///
    /// # Errors
    /// [`Broken`]: the list has no such number.
    pub(super) fn known(all: BTreeSet<Passed>, of: Vec<u32>) -> Read<Self> {
        if of.iter().any(|&number| number as usize > all.len()) {
            return Err(Broken::new("has rays that pass nothing known"));
        }
        Ok(Self {
            of,
            known: all.into_iter().zip(1..).collect(),
            rows: Rows::default(),
        })
    }

    /// Works out the filters on the present lanes.
    pub(super) fn on(&mut self, filters: &Filters) {
        if self.is_empty() {
            return;
        }
        self.rows = Rows::zero(self.known.len(), padded(filters.len()));
        for (passed, &number) in &self.known {
            let filter = filters.of(passed);
            let row = self.rows.row_mut(number as usize - 1);
            row.copy_from_slice(&filter[..row.len()]);
        }
    }

    /// Transmittance of a ray's filter on each lane; none if the ray passes none.
    pub(super) fn row<const L: usize>(&self, ray: usize) -> Option<&[f32; L]> {
        let number = self.of.get(ray)?.checked_sub(1)?;
        self.rows.all::<L>().get(number as usize)
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        4 * self.of.len() + self.rows.bytes()
    }
}

/// Filters encoded as numbers: how many panes and mirrors, and each of them.
pub(super) fn listed<'a>(all: impl Iterator<Item = &'a Passed>) -> Vec<u64> {
    let one = |passed: &'a Passed| {
        let count = passed.len() as u64;
        std::iter::once(count).chain(passed::numbers(passed))
    };
    all.flat_map(one).collect()
}

/// Decodes [`listed`] filters, if light of this room can pass them.
///
/// # Errors
/// [`Broken`]: light cannot pass them, or the numbers mean nothing.
pub(super) fn all_of(mut numbers: &[u64], filters: &Filters) -> Read<BTreeSet<Passed>> {
    let broken = || Broken::new("has rays that pass what is not there");
    let mut all = BTreeSet::new();
    while let Some((&count, rest)) = numbers.split_first() {
        let count = usize::try_from(count).ok().and_then(|n| n.checked_mul(4));
        let (one, rest) = count
            .and_then(|n| rest.split_at_checked(n))
            .ok_or_else(broken)?;
        let passed = passed::from_numbers(one)?;
        if !filters.knows(&passed) {
            return Err(broken());
        }
        all.insert(passed);
        numbers = rest;
    }
    Ok(all)
}
