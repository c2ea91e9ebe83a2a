//! The light at points of surfaces as shown: on diffuse sheets, including the light that passes from behind.

use crate::hierarchy::NONE;
use crate::light::mixed;
use crate::solve::{Bake, GatherQuality};
use crate::transport::{Gathered, Receiver, trace};

impl Bake {
    /// Gathers at points of surfaces, in order; for points of diffuse sheets also behind these, see [`Through`](crate::light::Through).
    pub(crate) fn gather_shown(
        &self,
        receivers: &[Receiver],
        quality: GatherQuality,
    ) -> Vec<Gathered> {
        let mut gathered = self.gather_with(receivers, quality);
        let behind: Vec<(usize, u32, Receiver)> = (receivers.iter().enumerate())
            .filter_map(|(k, to)| self.behind(to).map(|(place, other)| (k, place, other)))
            .collect();
        if behind.is_empty() {
            return gathered;
        }
        let others: Vec<Receiver> = behind.iter().map(|&(.., other)| other).collect();
        for ((k, place, _), other) in behind.iter().zip(self.gather_with(&others, quality)) {
            let Some(shares) = self.light().through.shares(*place) else {
                continue;
            };
            let shown = &mut gathered[*k];
            mixed(shares, &mut shown.irradiance, &other.irradiance);
            // Direct light stays that of the side itself: an engine that keeps its lamps lights a side only from that
            // side.
            mixed(shares, &mut shown.direct, &[0.0; 64]);
            shown.rays += other.rays;
            if let (Some(own), Some(other)) = (&shown.packed, &other.packed) {
                shown.packed = Some(trace::joined(own, other));
            }
        }
        gathered
    }

    /// For a point on a sheet: the position of its leaf among the leaves of the solution, and the point behind.
    fn behind(&self, to: &Receiver) -> Option<(u32, Receiver)> {
        let leaf = to.leaf?;
        let place = self.place_on_sheet(leaf)?;
        Some((place, to.turned(self.tree().behind(leaf))))
    }

    /// The position of a leaf among the leaves of the solution, if the leaf belongs to a sheet.
    pub(crate) fn place_on_sheet(&self, leaf: u32) -> Option<u32> {
        let light = self.light();
        if light.through.is_empty() || self.tree().behind(leaf) == NONE {
            return None;
        }
        light.leaves.binary_search(&leaf).ok().map(|k| k as u32)
    }
}
