//! Shares of receivers, and the exchange of what was found at them.
//!
//! Receiver `k` of a list, or leaf `k` of the hierarchy, belongs to rank `k mod N`. Neighbours cost alike, so ranks get the same work
//! without anyone keeping count, and who owns a leaf follows from its number alone: it does not change when others are split, and a checkpoint
//! need not say.

use super::exchange;
use super::interrupt::{Interrupt, Interrupted};
use super::packed::Packed;
use crate::store::Decoder;
use crate::store::codec::Read;
use rayon::prelude::*;

/// A rank among those that bake a room together; by default it is alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Team {
    rank: usize,
    ranks: usize,
}

impl Default for Team {
    fn default() -> Self {
        Self { rank: 0, ranks: 1 }
    }
}

impl Team {
    /// This rank of so many. Only a job knows.
    #[cfg(any(test, feature = "mpi"))]
    pub(super) fn new(rank: usize, ranks: usize) -> Self {
        Self { rank, ranks }
    }

    /// Number of this rank, from 0.
    pub fn rank(self) -> usize {
        self.rank
    }

    /// How many ranks there are.
    pub fn ranks(self) -> usize {
        self.ranks
    }

    /// Is there no other rank?
    pub fn is_alone(self) -> bool {
        self.ranks == 1
    }

    /// Is this the rank that writes and speaks?
    pub fn is_first(self) -> bool {
        self.rank == 0
    }

    /// Does receiver `k` belong to this rank?
    pub fn owns(self, k: usize) -> bool {
        k % self.ranks == self.rank
    }

    /// Results of `f` for all items, in order: each rank works out its own. `memory` is what one thread works with.
    ///
    /// To be called by all ranks alike, as everything below.
    pub fn map<T: Sync, R: Packed + Send, M>(
        self,
        items: &[T],
        memory: impl Fn() -> M + Sync + Send,
        f: impl Fn(&mut M, &T) -> R + Sync + Send,
    ) -> Vec<R> {
        if self.is_alone() {
            return items.par_iter().map_init(memory, f).collect();
        }
        let own: Vec<&T> = items.iter().skip(self.rank).step_by(self.ranks).collect();
        let found = own
            .par_iter()
            .map_init(memory, |memory, item| f(memory, item));
        self.merge(0..items.len(), found.collect())
    }

    /// The same, given up where that is asked for. Ranks that are not alone go on: one that gave up would leave the others waiting.
    ///
    /// # Errors
    /// It was given up.
    pub fn map_unless<T: Sync, R: Packed + Send, M>(
        self,
        interrupt: &Interrupt,
        items: &[T],
        memory: impl Fn() -> M + Sync + Send,
        f: impl Fn(&mut M, &T) -> R + Sync + Send,
    ) -> Result<Vec<R>, Interrupted> {
        if !self.is_alone() {
            return Ok(self.map(items, memory, f));
        }
        let one = |memory: &mut M, item| interrupt.check().map(|()| f(memory, item));
        items.par_iter().map_init(memory, one).collect()
    }

    /// What was found at receivers, in the order of their numbers `keys`, from what this rank found at its own, in order.
    ///
    /// # Panics
    /// Another rank found something else than this one asks for: a fault of ours.
    pub fn merge<R: Packed>(self, keys: impl Iterator<Item = usize>, own: Vec<R>) -> Vec<R> {
        if self.is_alone() {
            return own;
        }
        let mut bytes = Vec::new();
        own.iter().for_each(|x| x.pack(&mut bytes));
        drop(own);
        let found = exchange::all_gather(self.ranks, &bytes);
        let mut parts: Vec<Decoder> = found.iter().map(|part| Decoder::new(part)).collect();
        let merged: Read<Vec<R>> = keys
            .map(|k| R::unpack(&mut parts[k % self.ranks]))
            .collect();
        let ended = parts.iter().all(|part| part.end().is_ok());
        match merged {
            Ok(merged) if ended => merged,
            _ => panic!("the ranks of this job have come apart"),
        }
    }

    /// Rows of all receivers, from this rank's own, in order; `keys` are the receivers' numbers.
    ///
    /// # Panics
    /// As [`Team::merge`].
    pub fn merge_rows<const L: usize>(self, keys: &[u32], own: &[[f32; L]], out: &mut [[f32; L]]) {
        let found = exchange::all_gather(self.ranks, bytemuck::cast_slice(own.as_flattened()));
        let mut parts: Vec<_> = found.iter().map(|part| part.as_chunks::<4>().0).collect();
        for (row, &k) in out.iter_mut().zip(keys) {
            let part = &mut parts[k as usize % self.ranks];
            let (first, rest) = part
                .split_at_checked(L)
                .expect("the ranks of this job have come apart");
            for (x, bytes) in row.iter_mut().zip(first) {
                *x = f32::from_ne_bytes(*bytes);
            }
            *part = rest;
        }
    }

    /// Numbers that any rank named, ascending; each is named by one.
    pub fn union(self, own: Vec<u32>) -> Vec<u32> {
        if self.is_alone() {
            return own;
        }
        let found = exchange::all_gather(self.ranks, bytemuck::cast_slice(&own));
        let parts = found.iter().flat_map(|part| part.as_chunks::<4>().0);
        let mut all: Vec<u32> = parts.map(|bytes| u32::from_ne_bytes(*bytes)).collect();
        all.sort_unstable();
        all
    }

    /// What the first rank says, where clocks or files may tell ranks different things.
    pub fn first_says(self, own: bool) -> bool {
        match self.is_alone() {
            true => own,
            false => exchange::all_gather(self.ranks, &[u8::from(own)])[0] == [1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_receiver_belongs_to_one_rank() {
        for ranks in 1..9 {
            let teams: Vec<Team> = (0..ranks).map(|rank| Team::new(rank, ranks)).collect();
            for k in 0..100 {
                assert_eq!(teams.iter().filter(|team| team.owns(k)).count(), 1);
            }
        }
    }

    #[test]
    fn a_rank_that_is_alone_does_all() {
        let team = Team::default();
        assert!(team.is_first() && team.owns(3));
        assert_eq!(team.map(&[1_u32, 2, 3], || (), |(), x| 2 * x), [2, 4, 6]);
        assert_eq!(team.union(vec![2, 5]), [2, 5]);
        assert_eq!([false, true].map(|own| team.first_says(own)), [false, true]);
    }
}
