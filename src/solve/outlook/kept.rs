//! How leaves look out, written down and read back.
//!
//! The rays of a leaf follow from its number, the seed and how many they are: a checkpoint holds no more of them, and they are cast
//! again. A cache, which is read where there is no ray index, holds the leaves that they met.
//!
//! A file holds the rays of all leaves in the order of their numbers, whichever ranks have them: so a bake goes on with any number of
//! ranks.

use super::CHUNK;
use super::Outlook;
use super::found::{ALONE, Found, look_from};
use crate::hierarchy::{NONE, Tree};
use crate::light::Filters;
use crate::light::passed::Passed;
use crate::link::Sight;
use crate::solve::tinted::{self, Tints};
use crate::store::codec::{Plain, Read};
use crate::store::{Broken, Decoder, Encoder};
use crate::team::Team;
use crate::transport::hemisphere::{BEAM, Hemisphere};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Nodes whose rays ranks send each other at a time: some ten MB.
const TOGETHER: usize = 1 << 16;
/// Flag, beside what a ray passes, of those that bring what their ends emit.
const LAMP: u32 = 1 << 31;

/// What rays are cast again with: what they meet, the most directions that a leaf looks in, and the seed.
type Eyes<'a> = (&'a Sight<'a>, &'a Hemisphere, u64);

impl Outlook {
    /// Writes it down: how many rays there are (`whole`), or the leaves that they met, which is enough as long as no leaf is
    /// split; then also, in a room with panes or mirrors (then there are `filters`), what the rays pass.
    pub(in crate::solve) fn encode(
        &self,
        whole: bool,
        filters: Option<&Filters>,
        out: &mut Encoder,
    ) -> std::io::Result<()> {
        out.put_all(&self.target)?;
        out.put_all(&self.bare)?;
        out.put_list(
            self.certain.len(),
            self.certain.iter().map(|&c| u8::from(c)),
        )?;
        out.put_list(self.range.len(), self.range.iter().map(|r| r.1))?;
        if whole {
            return Ok(());
        }
        self.encode_rays(out, |k| self.met[k])?;
        match filters {
            Some(filters) => self.encode_passed(filters, out),
            None => Ok(()),
        }
    }

    /// What the rays of all ranks pass, once, and the number of what each passes.
    fn encode_passed(&self, filters: &Filters, out: &mut Encoder) -> std::io::Result<()> {
        let own = vec![self.tints.numbers()];
        let mut all: BTreeSet<Passed> = BTreeSet::new();
        for of_rank in self.team.merge(0..self.team.ranks(), own) {
            let passed = tinted::all_of(&of_rank, filters);
            all.extend(passed.map_err(|Broken(what)| std::io::Error::other(what))?);
        }
        out.put_all(&tinted::listed(all.iter()))?;
        let places = self.tints.places_in(&all);
        self.encode_rays(out, |k| {
            let number = self.tints.of(k).checked_sub(1);
            let lamp = self.lamps.binary_search(&(k as u32)).is_ok();
            number.map_or(0, |number| places[number as usize]) | if lamp { LAMP } else { 0 }
        })
    }

    /// Reads it back.
    fn decode_passed(&mut self, counts: &[u32], filters: &Filters, from: &mut Decoder) -> Read<()> {
        let all = tinted::all_of(&from.get_all::<u64>()?, filters)?;
        let mut of = self.own::<u32>(counts, from)?;
        for (ray, number) in (0..).zip(&mut of) {
            if *number & LAMP != 0 {
                *number &= !LAMP;
                self.lamps.push(ray);
            }
        }
        self.tints = Tints::known(all, of)?;
        Ok(())
    }

    /// A list of what `of` says of each ray.
    fn encode_rays<T: Plain>(
        &self,
        out: &mut Encoder,
        of: impl Fn(usize) -> T,
    ) -> std::io::Result<()> {
        let count = self.range.iter().map(|r| r.1 as usize).sum();
        let of_node = |node: usize| -> Vec<T> {
            let (first, count) = self.range[node];
            let first = first as usize;
            (first..first + count as usize).map(&of).collect()
        };
        let blocks = (0..self.range.len()).step_by(TOGETHER);
        let rays = blocks.flat_map(|first| {
            let nodes = first..self.range.len().min(first + TOGETHER);
            let nodes = nodes.filter(|&node| self.range[node].1 > 0);
            let own = nodes.clone().filter(|&node| self.team.owns(node));
            self.team.merge(nodes, own.map(of_node).collect())
        });
        out.put_list(count, rays.flatten())
    }

    /// Reads back what this rank needs, for the hierarchy that it was made for; with `eyes`, what [`Outlook::encode`] wrote as a whole.
    pub(in crate::solve) fn decode(
        tree: &Tree,
        team: Team,
        eyes: Option<Eyes>,
        filters: Option<&Filters>,
        from: &mut Decoder,
    ) -> Read<Self> {
        let nodes = tree.nodes.len();
        let mut outlook = Self {
            team,
            target: from.get_exactly(nodes)?,
            bare: from.get_exactly(nodes)?,
            certain: from.get_list::<u8>()?.map(|c| c == 1).collect(),
            ..Self::default()
        };
        if !(outlook.certain.is_empty() || outlook.certain.len() == nodes) {
            return Err(Broken::new("has patches that do not fit"));
        }
        let counts: Vec<u32> = from.get_all()?;
        if !(counts.is_empty() || counts.len() == nodes) {
            return Err(Broken::new("has rays in parts that do not fit"));
        }
        if let Some(eyes) = eyes {
            outlook.look_again(tree, &counts, eyes)?;
        } else {
            outlook.met = outlook.own(&counts, from)?;
            let there = |&k: &u32| k == NONE || ((k & !ALONE) as usize) < nodes;
            if !outlook.met.iter().all(there) {
                return Err(Broken::new("has rays that end nowhere"));
            }
            if let Some(filters) = filters {
                outlook.decode_passed(&counts, filters, from)?;
            }
        }
        let mut held = 0;
        outlook.range = (counts.iter().enumerate())
            .map(|(node, &count)| {
                if !team.owns(node) {
                    return (NONE, count);
                }
                let first = held;
                held += count;
                (first, count)
            })
            .collect();
        if eyes.is_some() {
            outlook.find(tree);
        }
        Ok(outlook)
    }

    /// Casts the rays of this rank's leaves again, so many of each node.
    fn look_again(
        &mut self,
        tree: &Tree,
        counts: &[u32],
        (sight, hemisphere, seed): Eyes,
    ) -> Read<()> {
        let patterns: Vec<Hemisphere> = (0..)
            .map(|k| BEAM << k)
            .take_while(|&n| n <= hemisphere.len())
            .map(Hemisphere::new)
            .collect();
        let mut own = Vec::new();
        let mut rays = 0_usize;
        for (node, &count) in (0_u32..).zip(counts).filter(|(_, count)| **count > 0) {
            let pattern = patterns.iter().find(|p| p.len() == count as usize);
            match pattern.filter(|_| tree.node(node).element != NONE) {
                Some(pattern) if self.team.owns(node as usize) => {
                    rays += pattern.len();
                    own.push((node, pattern));
                }
                Some(_) => {}
                None => return Err(Broken::new("has rays in parts that do not fit")),
            }
        }
        // The first ray of a leaf is a u32.
        if u32::try_from(rays).is_err() {
            return Err(Broken::new("has more rays than one rank can hold"));
        }
        let look =
            |&(node, pattern): &(u32, &Hemisphere)| look_from(tree, node, sight, pattern, seed);
        let found: Vec<Vec<Found>> = own
            .par_chunks(CHUNK)
            .map(|chunk| chunk.iter().map(look).collect())
            .collect();
        let tinted = sight.panes.is_some() || sight.mirrors.is_some();
        self.ends.reserve(rays);
        for found in found.into_iter().flatten() {
            let first = self.ends.len() as u32;
            if tinted {
                self.tints.extend(found.ends.len(), found.passed);
            }
            self.lamps.extend(found.lamps.iter().map(|ray| first + ray));
            self.ends.extend(found.ends);
        }
        Ok(())
    }

    /// A list of something for each ray: what is said of the rays of this rank's leaves.
    fn own<T: Plain>(&self, counts: &[u32], from: &mut Decoder) -> Read<Vec<T>> {
        let mut all = from.get_list::<T>()?;
        let told: u64 = counts.iter().map(|&count| u64::from(count)).sum();
        if told != all.len() as u64 {
            return Err(Broken::new("has rays in parts that do not fit"));
        }
        let mut own = Vec::with_capacity(all.len() / self.team.ranks());
        for (node, &count) in counts.iter().enumerate() {
            let rays = all.by_ref().take(count as usize);
            if self.team.owns(node) {
                own.extend(rays);
            } else {
                rays.for_each(drop);
            }
        }
        // The first ray of a leaf is a u32.
        match u32::try_from(own.len()) {
            Ok(_) => Ok(own),
            Err(_) => Err(Broken::new("has more rays than one rank can hold")),
        }
    }
}
