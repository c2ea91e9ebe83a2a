//! The part of a trace that came through panes or by way of mirrors, grouped by what light passed, so that each filter is worked
//! out once.
//!
//! A group holds: how many of the numbers for what is passed are as in the group before, how many follow, and these
//! (see [`passed::numbers`]); then its entries, each `8 id + kind` and the weight. A ray takes about 12 bytes.

use super::bytes::{TraceReader, broken, number};
use crate::light::passed::{self, Passed};
use crate::light::{Filter, Filters, Light};
use crate::scene::PunctualLight;
use crate::store::codec::Read;
use std::collections::HashMap;
use std::sync::{Arc, PoisonError, RwLock};

/// Panes and mirrors on one way at the most; only a room made to do so has more.
const MOST_PASSED: u64 = 4096;

/// The kind of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum EntryKind {
    /// A ray that met a leaf.
    Hit,
    /// A ray that met a leaf of a mirror, one mirror too many.
    Mirror,
    /// A patch: its reflected and emitted light.
    Patch,
    /// The reflected light of a patch.
    Slope,
    /// The emission of a patch.
    Emitted,
    /// A punctual light.
    Lamp,
}

impl EntryKind {
    const ALL: [Self; 6] = [
        Self::Hit,
        Self::Mirror,
        Self::Patch,
        Self::Slope,
        Self::Emitted,
        Self::Lamp,
    ];
}

/// One source of light.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    pub(super) kind: EntryKind,
    pub(super) id: u32,
    pub(super) weight: f32,
}

/// Entries of light that passed something, with what it passed.
#[derive(Debug, Clone, Default)]
pub(super) struct TintedEntries {
    entries: Vec<(Passed, Entry)>,
}

impl TintedEntries {
    /// Adds an entry whose light passed panes or mirrors.
    pub(super) fn add(&mut self, passed: &Passed, entry: Entry) {
        self.entries.push((passed.clone(), entry));
    }

    /// Adds `weight` times the entries of another point.
    pub(super) fn absorb(&mut self, other: &Self, weight: f32) {
        let times = |(passed, entry): &(Passed, Entry)| {
            let weight = weight * entry.weight;
            (passed.clone(), Entry { weight, ..*entry })
        };
        self.entries.extend(other.entries.iter().map(times));
    }

    /// Multiplies all weights by `factor`.
    pub(super) fn times(&mut self, factor: f32) {
        self.entries.iter_mut().for_each(|e| e.1.weight *= factor);
    }

    /// Packs the entries; appends nothing where nothing was passed.
    pub(super) fn pack(mut self, out: &mut Vec<u8>) {
        if self.entries.is_empty() {
            return;
        }
        let order = |a: &(Passed, Entry), b: &(Passed, Entry)| {
            let rest = |entry: &Entry| (entry.kind, entry.id);
            a.0.cmp(&b.0).then_with(|| rest(&a.1).cmp(&rest(&b.1)))
        };
        // Stable, so that sums do not depend on the sort.
        self.entries.sort_by(order);
        self.entries.dedup_by(|next, kept| {
            let same = order(next, kept).is_eq();
            if same {
                kept.1.weight += next.1.weight;
            }
            same
        });
        let groups = || self.entries.chunk_by(|a, b| a.0 == b.0);
        number(groups().count() as u64, out);
        let mut before: Vec<u64> = Vec::new();
        for group in groups() {
            let own: Vec<u64> = passed::numbers(&group[0].0).collect();
            let same = before.iter().zip(&own).take_while(|(a, b)| a == b).count();
            number(same as u64, out);
            number((own.len() - same) as u64, out);
            own[same..].iter().for_each(|&n| number(n, out));
            number(group.len() as u64, out);
            for (_, entry) in group {
                number(u64::from(entry.id) << 3 | entry.kind as u64, out);
                out.extend(entry.weight.to_le_bytes());
            }
            before = own;
        }
    }
}

/// Filters of panes and mirrors, by the numbers of what is passed: each is worked out when first needed.
pub(crate) struct Stains<'a> {
    filters: &'a Filters,
    known: RwLock<HashMap<Box<[u64]>, Arc<Filter>>>,
}

impl<'a> Stains<'a> {
    /// Filters on the lanes of `filters`.
    pub(crate) fn new(filters: &'a Filters) -> Self {
        let known = RwLock::default();
        Self { filters, known }
    }

    fn get(&self, numbers: &[u64]) -> Read<Arc<Filter>> {
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(filter) = known.get(numbers) {
            return Ok(filter.clone());
        }
        drop(known);
        let passed = passed::from_numbers(numbers)?;
        if !self.filters.knows(&passed) {
            return Err(broken());
        }
        let filter = Arc::new(self.filters.of(&passed));
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        known.insert(numbers.into(), filter.clone());
        Ok(filter)
    }
}

/// State of reading the groups after the untinted part of a trace.
struct Groups {
    left: u64,
    numbers: Vec<u64>,
}

impl Groups {
    fn begin(from: &mut TraceReader) -> Read<Self> {
        let left = match from.rest.is_empty() {
            true => 0,
            false => from.number()?,
        };
        let numbers = Vec::new();
        Ok(Self { left, numbers })
    }

    /// Reads the numbers of the next group and returns how many entries it has; none after the last.
    fn next(&mut self, from: &mut TraceReader) -> Read<Option<u64>> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        let (same, more) = (from.number()?, from.number()?);
        if same > self.numbers.len() as u64 || more > MOST_PASSED {
            return Err(broken());
        }
        self.numbers.truncate(same as usize);
        for _ in 0..more {
            self.numbers.push(from.number()?);
        }
        from.number().map(Some)
    }
}

fn entry(from: &mut TraceReader) -> Read<Entry> {
    let word = from.number()?;
    let id = u32::try_from(word >> 3).map_err(|_| broken())?;
    let kind = *EntryKind::ALL.get((word & 7) as usize).ok_or_else(broken)?;
    let weight = from.float()?;
    Ok(Entry { kind, id, weight })
}

/// Calls `each` with all entries.
pub(super) fn entries(from: &mut TraceReader, mut each: impl FnMut(Entry) -> Read<()>) -> Read<()> {
    let mut groups = Groups::begin(from)?;
    while let Some(count) = groups.next(from)? {
        for _ in 0..count {
            each(entry(from)?)?;
        }
    }
    Ok(())
}

/// The light of a trace, being summed.
pub(super) struct TraceSums<const L: usize> {
    /// Reflected light of patches, before it is scaled.
    pub(super) bounced: [f32; L],
    /// Light straight from lamps.
    pub(super) straight: [f32; L],
    /// Reflected light of the leaves that rays met, by number of rays.
    pub(super) met: [f32; L],
}

/// Adds the light of all entries.
pub(super) fn replay<const L: usize>(
    from: &mut TraceReader,
    light: &Light,
    lamps: &[(PunctualLight, Vec<f32>)],
    stains: &Stains,
    sums: &mut TraceSums<L>,
) -> Read<()> {
    let (reflected, emitted) = (light.reflected.all::<L>(), light.emitted.all::<L>());
    let mirrors = light.mirrors.all::<L>();
    let dark = reflected.is_empty();
    let mut groups = Groups::begin(from)?;
    while let Some(count) = groups.next(from)? {
        let filter = stains.get(&groups.numbers)?;
        for _ in 0..count {
            let Entry { kind, id, weight } = entry(from)?;
            let k = id as usize;
            let end = if kind == EntryKind::Lamp {
                lamps.len()
            } else {
                emitted.len()
            };
            if k >= end {
                return Err(broken());
            }
            let add = |sum: &mut [f32; L], row: &[f32]| {
                for ((x, r), t) in sum.iter_mut().zip(row).zip(&*filter) {
                    *x += weight * r * t;
                }
            };
            match kind {
                EntryKind::Lamp => add(&mut sums.straight, &lamps[k].1),
                EntryKind::Emitted | EntryKind::Patch if light.bright_emitted[k] > 0.0 => {
                    add(&mut sums.straight, &emitted[k]);
                }
                _ => {}
            }
            match kind {
                _ if dark => {}
                EntryKind::Patch | EntryKind::Slope => add(&mut sums.bounced, &reflected[k]),
                EntryKind::Hit => add(&mut sums.met, &reflected[k]),
                EntryKind::Mirror => add(&mut sums.met, mirrors.get(k).ok_or_else(broken)?),
                _ => {}
            }
        }
    }
    Ok(())
}
