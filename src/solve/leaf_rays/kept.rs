//! How leaves look out, written to a file and read back.
//!
//! A file holds the rays of all leaves in the order of their numbers, whichever ranks have them: so a bake can go on with any number
//! of ranks.

use super::LeafRays;
use super::hits::{MET, RayEnd};
use crate::hierarchy::{NONE, Tree};
use crate::light::passed::Passed;
use crate::light::{Filters, Tilts};
use crate::solve::tinted::{self, Tints};
use crate::store::codec::{Plain, Read};
use crate::store::{Broken, Decoder, Encoder};
use crate::team::Team;
use std::collections::BTreeSet;

/// Nodes whose rays ranks exchange at a time: some ten MB.
const TOGETHER: usize = 1 << 16;
/// Flag, beside what a ray passes, of rays that bring the emission of their ends.
const LAMP: u32 = 1 << 31;

impl LeafRays {
    /// Writes the rays: where the rays end, or only the leaves that they met, which is less and enough as
    /// long as no leaf is split. In a room with panes or mirrors (then there are `filters`) also what the rays pass.
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
            self.encode_rays(out, |k| self.ends[k].entry)?;
            self.encode_rays(out, |k| self.ends[k].at)?;
        } else {
            self.encode_rays(out, |k| self.met[k])?;
            self.encode_rays(out, |k| self.places[k])?;
        }
        out.put_all(&self.tilts.0)?;
        match filters {
            Some(filters) => self.encode_passed(filters, out),
            None => Ok(()),
        }
    }

    /// Writes each distinct sequence of panes and mirrors that rays of any rank pass, once, and for each ray its
    /// number.
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

    /// Reads back what [`LeafRays::encode_passed`] wrote.
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

    /// Writes a list of `of` each ray.
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

    /// Reads back what this rank needs, for the hierarchy of which it was written.
    pub(in crate::solve) fn decode(
        tree: &Tree,
        team: Team,
        whole: bool,
        filters: Option<&Filters>,
        from: &mut Decoder,
    ) -> Read<Self> {
        let nodes = tree.nodes.len();
        let mut leaf_rays = Self {
            team,
            target: from.get_exactly(nodes)?,
            bare: from.get_exactly(nodes)?,
            certain: from.get_list::<u8>()?.map(|c| c == 1).collect(),
            ..Self::default()
        };
        if !(leaf_rays.certain.is_empty() || leaf_rays.certain.len() == nodes) {
            return Err(Broken::new("has patches that do not fit"));
        }
        let counts: Vec<u32> = from.get_all()?;
        if !(counts.is_empty() || counts.len() == nodes) {
            return Err(Broken::new("has rays in parts that do not fit"));
        }
        if whole {
            let entries = leaf_rays.own::<u32>(&counts, from)?;
            let places = leaf_rays.own::<[u16; 2]>(&counts, from)?;
            let ends = entries.into_iter().zip(places);
            leaf_rays.ends = ends.map(|(entry, at)| RayEnd { entry, at }).collect();
            let faces = tree.faces.len();
            let there = |e: &RayEnd| e.entry == NONE || ((e.entry & MET) as usize) < faces;
            if !leaf_rays.ends.iter().all(there) {
                return Err(Broken::new("has rays that end nowhere"));
            }
        } else {
            leaf_rays.met = leaf_rays.own(&counts, from)?;
            leaf_rays.places = leaf_rays.own(&counts, from)?;
            let there = |&k: &u32| k == NONE || ((k & MET) as usize) < nodes;
            if !leaf_rays.met.iter().all(there) {
                return Err(Broken::new("has rays that end nowhere"));
            }
        }
        let tilts = Tilts(from.get_all()?);
        if !(tilts.0.is_empty() || tilts.0.len() == nodes) {
            return Err(Broken::new("has tilts that do not fit"));
        }
        if let Some(filters) = filters {
            leaf_rays.decode_passed(&counts, filters, from)?;
        }
        let mut held = 0;
        leaf_rays.range = (counts.iter().enumerate())
            .map(|(node, &count)| {
                if !team.owns(node) {
                    return (NONE, count);
                }
                let first = held;
                held += count;
                (first, count)
            })
            .collect();
        if whole {
            leaf_rays.find(tree, 0);
        }
        leaf_rays.tilt_by(tilts);
        Ok(leaf_rays)
    }

    /// Reads a list with an item for each ray; keeps the items of the rays of this rank's leaves.
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
        // The index of a leaf's first ray is a u32.
        match u32::try_from(own.len()) {
            Ok(_) => Ok(own),
            Err(_) => Err(Broken::new("has more rays than one rank can hold")),
        }
    }
}
