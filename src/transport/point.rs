//! Irradiance at a point: every link of the element that contains it (or the whole room), evaluated anew for that
//! point.
//!
//! `H(p) = sum over patches F(p -> b) V(p, b) B_b` plus the irradiance by punctual lights.

use super::gatherer::{Gatherer, Linked, Memory, RadiosityPart};
use super::receiver::{Gathered, Receiver};
use crate::hierarchy::NONE;
use crate::link::Occlusion;

impl Gatherer<'_> {
    /// Gathers the direct light of lamps.
    pub fn direct(&self, to: &Receiver, memory: &mut Memory) -> [f32; 64] {
        let mut out = self.start();
        memory.noise = 0.0;
        self.lamps_of(to, memory, &mut out);
        self.punctual(to, memory, &mut out);
        self.outside(to, None, false, memory, &mut out);
        if self.sight.mirrors.is_some() {
            self.lamps_in_mirrors(to, memory, &mut out);
            let of = self.glance(to, memory);
            self.lights_in_mirrors(to, of, memory, &mut out);
        }
        memory.trace = out.trace;
        out.direct
    }

    /// Links of the receiver's leaf and of its ancestors; without a leaf, the whole room.
    pub(super) fn links(&self, to: &Receiver) -> impl Iterator<Item = Linked> {
        let parent = |&id: &u32| Some(self.tree.node(id).parent).filter(|&p| p != NONE);
        let room = to.leaf.is_none() && !self.tree.nodes.is_empty();
        std::iter::successors(to.leaf, parent)
            .flat_map(|id| self.light.neighbours.row(id).iter().copied())
            .chain(room.then_some((0, Occlusion::Crowded, 0.5)))
    }

    /// Gathers emission of patches. Where links tell little about blockers, lamps are searched from the root: a lamp is then
    /// one element, however many of its patches the receiver is linked to.
    pub(super) fn lamps_of(&self, to: &Receiver, memory: &mut Memory, out: &mut Gathered) {
        memory.stack.clear();
        if self.hemisphere.is_some() {
            let root = self.light.lit.first().filter(|&&id| id != NONE);
            memory
                .stack
                .extend(root.map(|&id| (id, Occlusion::Crowded, 0.5)));
        } else {
            let lit = |id: u32| self.light.bright_emitted[id as usize] > 0.0;
            memory
                .stack
                .extend(self.links(to).filter(|&(id, ..)| lit(id)));
        }
        self.patches(to, RadiosityPart::Emitted, memory, out);
    }

    /// Gathers at a point.
    pub fn at(&self, to: &Receiver, memory: &mut Memory) -> Gathered {
        let before = memory.rays;
        let mut out = self.start();
        if let Some(hemisphere) = self.hemisphere {
            self.sweep(to, hemisphere, memory, &mut out);
            out.rays = memory.rays - before;
            return out;
        }
        memory.stack.clear();
        memory.stack.extend(self.links(to));
        self.patches(to, RadiosityPart::All, memory, &mut out);
        if self.closed && out.seen > 0.5 {
            let scale = (1.0 / out.seen) as f32;
            for x in &mut out.irradiance {
                *x *= scale;
            }
            if let Some(trace) = &mut out.trace {
                trace.scale(scale);
            }
        }
        for (x, d) in out.irradiance.iter_mut().zip(&out.direct) {
            *x += d;
        }
        self.punctual(to, memory, &mut out);
        self.outside(to, None, true, memory, &mut out);
        out.rays = memory.rays - before;
        out
    }
}
