//! Interval lists of many patches, as they are kept (paper 3.1.1): of every patch the mask of a dyadic cut for each light, and one
//! value for each interval.
//!
//! The light of a patch is held constant on each interval of a cut of its own, which is as coarse as the working partition or
//! coarser (see `solve/lists.rs`). Expanded, it is a row that gathers stream through; written down, it is the list alone. Lanes
//! stand light after light in order of wavelength, so one mask over lanes says the cuts of all lights.

use super::lanes::{Lane, Lanes};
use super::rows::{Rows, padded};
use crate::spectrum::{LEAVES, Partition};
use crate::store::codec::Read;
use crate::store::{Broken, Decoder, Encoder};
use std::collections::HashMap;
use std::io;

/// Where two halves of a dyadic interval meet, in lanes.
#[derive(Debug, Clone, Copy)]
struct Joint {
    first: usize,
    middle: usize,
    /// All lanes of both halves, as a mask.
    inside: u64,
}

/// The joints of the working partition, the smallest intervals first. Lanes that are no dyadic intervals have none.
#[derive(Debug, Clone)]
pub struct Joints {
    joints: Vec<Joint>,
    lanes: usize,
}

impl Joints {
    /// Those of some lanes.
    pub fn new(lanes: &Lanes) -> Self {
        let all = lanes.lanes();
        let mut joints = Vec::new();
        for half in (0..6).map(|level| 1 << level) {
            let starts_pair =
                |lane: &Lane| lane.first.is_multiple_of(2 * half) && lane.count <= half;
            for (first, lane) in all.iter().enumerate().filter(|(_, l)| starts_pair(l)) {
                let own = all[first..].iter().take_while(|l| {
                    l.light == lane.light && (lane.first..lane.first + 2 * half).contains(&l.first)
                });
                let own: Vec<&Lane> = own.collect();
                let whole = own.iter().map(|l| l.count).sum::<usize>() == 2 * half;
                let middle = own.iter().position(|l| l.first == lane.first + half);
                if let (true, Some(middle)) = (whole, middle) {
                    joints.push(Joint {
                        first,
                        middle: first + middle,
                        inside: below(own.len()) << first,
                    });
                }
            }
        }
        Self {
            joints,
            lanes: lanes.len(),
        }
    }

    /// The list of a row: bit k set where an interval starts at lane k. Nothing of the row is lost.
    pub fn mask(&self, row: &[f32]) -> u64 {
        let mut mask = below(self.lanes);
        for joint in &self.joints {
            let halves = 1 << joint.first | 1 << joint.middle;
            let equal = row[joint.first].to_bits() == row[joint.middle].to_bits();
            if equal && mask & joint.inside == halves {
                mask &= !(1 << joint.middle);
            }
        }
        mask
    }
}

/// So many bits, from the lowest on.
fn below(count: usize) -> u64 {
    match count {
        0 => 0,
        n => u64::MAX >> (LEAVES - n),
    }
}

/// The cut of each light that a mask over lanes stands for, with the values of a row; nothing of lanes that belong to no light.
pub(crate) fn cuts_of(lanes: &[Lane], mask: u64, row: &[f32]) -> Vec<(Partition, Vec<f64>)> {
    let mut lights: Vec<(u64, Vec<f64>)> = Vec::new();
    for (k, lane) in lanes.iter().enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
        let Some(light) = lane.light else { continue };
        lights.resize_with(lights.len().max(light + 1), Default::default);
        let (bits, values) = &mut lights[light];
        *bits |= 1 << lane.first;
        values.push(f64::from(row[k]));
    }
    let cut = |(bits, values)| Some((Partition::new(bits)?, values));
    lights.into_iter().filter_map(cut).collect()
}

/// The lists of many patches.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lists {
    lanes: usize,
    /// The different masks; few, as patches of one paint are alike.
    masks: Vec<u64>,
    /// Which of them each patch has.
    of: Vec<u32>,
    /// Patch after patch.
    values: Vec<f32>,
}

impl Lists {
    /// The lists of rows; nothing of them is lost.
    pub fn new<'a>(lanes: &Lanes, rows: impl Iterator<Item = &'a [f32]>) -> Self {
        let joints = Joints::new(lanes);
        let mut this = Self {
            lanes: lanes.len(),
            ..Self::default()
        };
        let mut known = HashMap::new();
        for row in rows {
            let mask = joints.mask(row);
            let next = this.masks.len() as u32;
            let place = *known.entry(mask).or_insert(next);
            if place == next {
                this.masks.push(mask);
            }
            this.of.push(place);
            let starts = row.iter().enumerate().take(lanes.len());
            let starts = starts.filter(|(k, _)| mask >> k & 1 == 1);
            this.values.extend(starts.map(|(_, x)| *x));
        }
        this
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.of.len()
    }

    /// No patches?
    pub fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// Intervals of all patches together.
    pub fn intervals(&self) -> usize {
        self.values.len()
    }

    /// Expanded: one row a patch.
    pub fn rows(&self) -> Rows {
        let mut rows = Rows::zero(self.of.len(), padded(self.lanes));
        let mut values = self.values.iter();
        for (k, &mask) in self.of.iter().enumerate() {
            let (mask, mut value) = (self.masks[mask as usize], 0.0);
            for (lane, x) in rows.row_mut(k).iter_mut().enumerate().take(self.lanes) {
                if mask >> lane & 1 == 1 {
                    value = values.next().copied().unwrap_or(0.0);
                }
                *x = value;
            }
        }
        rows
    }

    /// Bytes held, and written but for their lengths.
    pub fn bytes(&self) -> usize {
        8 * self.masks.len() + 4 * (self.of.len() + self.values.len())
    }

    /// Writes them down.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn encode(&self, out: &mut Encoder) -> io::Result<()> {
        out.put_all(&self.masks)?;
        out.put_all(&self.of)?;
        out.put_all(&self.values)
    }

    /// Reads those of `patches`, on so many lanes.
    ///
    /// # Errors
    /// [`Broken`]: they are others, or none.
    pub fn decode(patches: usize, lanes: usize, from: &mut Decoder) -> Read<Self> {
        let this = Self {
            lanes,
            masks: from.get_all()?,
            of: from.get_exactly(patches)?,
            values: from.get_all()?,
        };
        let possible = |&mask: &u64| mask & !below(lanes) == 0 && mask & 1 == below(lanes) & 1;
        let mask = |&of: &u32| this.masks.get(of as usize);
        let counts = this
            .of
            .iter()
            .map(|of| Some(mask(of)?.count_ones() as usize));
        let count: Option<usize> = counts.sum();
        if this.masks.iter().all(possible) && count == Some(this.values.len()) {
            Ok(this)
        } else {
            Err(Broken::new("has lists that do not fit"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Observer;
    use crate::scene::LightSpectrum;
    use crate::spectrum::Grid;
    use crate::spectrum::testing::any_cut;
    use proptest::prelude::*;

    proptest! {
        /// Rows that are constant on coarser cuts than the lanes come back to the bit, from no more values than these have.
        #[test]
        fn rows_come_back(
            cuts in prop::collection::vec((any_cut(), any_cut()), 1..3),
            seeds in prop::collection::vec(any::<u32>(), 1..20),
        ) {
            let spectra: Vec<LightSpectrum> = (cuts.iter())
                .map(|_| LightSpectrum { name: String::new(), power: [1.0; LEAVES] })
                .collect();
            let fine: Vec<Partition> = cuts.iter().map(|(cut, _)| *cut).collect();
            let lanes = Lanes::ratio(&spectra, &fine, &Observer::cie1931().weights(&Grid::default()));
            let mut rows = Rows::zero(seeds.len(), padded(lanes.len()));
            let mut most = 0;
            for (k, seed) in seeds.iter().enumerate() {
                for (l, lane) in lanes.lanes().iter().enumerate() {
                    // Without light of its own a lane is the 64 leaves' and keeps all.
                    let own = lane.light.map_or(Partition::LEAVES, |light| {
                        let (fine, other) = cuts[light];
                        fine.intersection(other)
                    });
                    let starts = own.bits() & below(lane.first + 1);
                    most += usize::from(own.starts(lane.first));
                    let start = 63 - starts.leading_zeros();
                    rows.row_mut(k)[l] = (seed % 1000 + start) as f32 * 0.1;
                }
            }
            let lists = Lists::new(&lanes, (0..seeds.len()).map(|k| rows.row(k)));
            prop_assert!(lists.rows() == rows);
            prop_assert!(lists.intervals() <= most, "{} {most}", lists.intervals());
            let mut bytes = Vec::new();
            let mut out = Encoder::new(&mut bytes);
            lists.encode(&mut out).unwrap();
            out.finish().unwrap();
            let back = Lists::decode(seeds.len(), lanes.len(), &mut Decoder::new(&bytes)).unwrap();
            prop_assert_eq!(&back, &lists);
            prop_assert!(Lists::decode(seeds.len() + 1, lanes.len(), &mut Decoder::new(&bytes)).is_err());
        }
    }
}
