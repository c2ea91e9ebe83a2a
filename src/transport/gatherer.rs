//! What gathering looks at, and the memory of one thread that does.

use super::hemisphere::Hemisphere;
use super::outside::{Look, Outside};
use super::receiver::Gathered;
use super::shadows::Shadows;
use super::trace::Trace;
use super::via::{Arrived, Via};
use crate::geometry::{Clipper, Hit, Segment};
use crate::hierarchy::{Sample, Tree};
use crate::light::passed::Steps;
use crate::light::{Filters, Glass, Light, Passage};
use crate::link::{Sight, Way};
use crate::scene::PunctualLight;
use glam::DVec3;

/// Nearer than this many of its radii a cluster is entered, and a patch is not even.
pub(super) const CLOSE: f64 = 1.5;

/// A patch that a point is linked to: its node, what may stand between, what the link found visible.
pub(super) type Linked = (u32, Way, f32);

/// What light of patches is gathered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    All,
    Reflected,
    Emitted,
}

/// An element of a lamp whose visible share rays must find: its exact factor, and what it would bring unblocked, share of
/// white.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lamp {
    pub(super) id: u32,
    /// The cluster of elements that shine like this one and stand together, see [`Fixtures`](crate::light::Fixtures); [`NONE`] where
    /// it is by itself.
    pub(super) fixture: u32,
    /// Where the factors of that cluster's faces begin in the memory.
    pub(super) faces: usize,
    pub(super) factor: f64,
    pub(super) carries: f64,
}

/// Reused memory of one thread and its ray count.
#[derive(Debug, Default)]
pub struct Memory {
    pub(super) stack: Vec<Linked>,
    pub(super) open: Vec<Linked>,
    /// Epoch in which each node was last gathered as a patch: rays that end on it bring nothing more.
    pub(super) taken: Vec<u32>,
    pub(super) epoch: u32,
    /// Was any in this epoch?
    pub(super) any_taken: bool,
    pub(super) samples: Vec<Sample>,
    pub(super) segments: Vec<Segment>,
    pub(super) weights: Vec<f64>,
    pub(super) blocked: Vec<bool>,
    pub(super) clipper: Clipper,
    pub(super) shadows: Shadows,
    /// What the rays of a point met.
    pub(super) met: Vec<(u32, Hit)>,
    /// What panes leave of what these bring, in order; empty in a room without.
    pub(super) tints: Vec<Option<Box<Passage>>>,
    /// Of which close by.
    pub(super) near: Vec<(u32, Hit)>,
    /// Lamps that are put off until all of them are known.
    pub(super) lamps: Vec<Lamp>,
    /// Factors of the faces of lamps of many, one lamp after the other.
    pub(super) faces: Vec<f64>,
    /// Which path each segment to a lamp belongs to, and what it brings.
    pub(super) to_lamps: Vec<(usize, f64)>,
    /// What the rays of a point met by way of mirrors.
    pub(super) mirrored: Vec<Arrived>,
    /// What a look outside takes.
    pub(super) look: Look,
    /// Directions in which the rays of a point leave the room.
    pub(super) escaped: Vec<DVec3>,
    /// Rays cast.
    pub rays: u64,
    /// Variance of brightness by the rays to the lamps of the last point.
    pub(crate) noise: f64,
    /// Where the direct light of the last point comes from, where that is kept.
    pub(crate) trace: Option<Trace>,
}

impl Memory {
    /// Another point: nothing is taken yet.
    pub(super) fn begin(&mut self, nodes: usize) {
        self.open.clear();
        self.stack.clear();
        self.epoch = self.epoch.wrapping_add(1);
        self.any_taken = false;
        if self.taken.len() != nodes || self.epoch == 0 {
            self.taken = vec![0; nodes];
            self.epoch = 1;
        }
    }
}

/// Everything a gather looks at.
pub struct Gatherer<'a> {
    /// Patches.
    pub tree: &'a Tree,
    /// The solution.
    pub light: &'a Light,
    /// What blocks.
    pub sight: &'a Sight<'a>,
    /// Punctual lights with their rows of radiant intensity (or normal irradiance), recentred.
    pub lamps: &'a [(PunctualLight, Vec<f32>)],
    /// What is outside; none where no light comes from there.
    pub(crate) sky: Option<&'a Outside>,
    /// What light passes through on its way; none where the room has no panes.
    pub(crate) glass: Option<Glass<'a>>,
    /// What mirrors leave of light.
    pub(crate) filters: &'a Filters,
    /// By which mirrors it is looked from a receiver that is where the true one would look from; none: straight.
    pub(crate) via: Option<Via>,
    /// What one patch may misplace, share of the white's irradiance.
    pub tolerance: f64,
    /// Must the visible factors sum to 1? Then indirect light is divided by their sum.
    pub closed: bool,
    /// Directions for indirect light where rays find patches sooner than links do; none: by links.
    pub hemisphere: Option<&'a Hemisphere>,
    /// Are shafts to lamps that matter looked into? Where many points stand for a leaf, rays do.
    pub(crate) shafts: bool,
    /// Is it kept where light comes from?
    pub(crate) keep: bool,
    /// Points of whose rays more than this share meet black backs lie within something and are not gathered.
    pub(crate) most_backs: f64,
}

impl Gatherer<'_> {
    /// Nothing yet; its trace where that is kept.
    pub(super) fn start(&self) -> Gathered {
        Gathered {
            trace: self.keep.then(Trace::new),
            ..Gathered::dark()
        }
    }

    /// Does nothing change light on its way but what blocks it? Then it is clipped exactly.
    pub(super) fn is_plain(&self) -> bool {
        self.glass.is_none() && self.via.is_none()
    }

    /// What panes and mirrors leave of light on a free segment; none where all passes.
    pub(super) fn through(&self, segment: &Segment) -> Option<Passage> {
        match self.via {
            Some(via) => self.by_way_of(via, segment),
            None => (self.glass?).through(segment.from, segment.to, self.steps()),
        }
    }

    /// How what light passes is kept, if it is: of many points that stand for a leaf less finely.
    pub(super) fn steps(&self) -> Option<Steps> {
        match (self.keep, self.shafts) {
            (false, _) => None,
            (true, true) => Some(Steps::Fine),
            (true, false) => Some(Steps::Coarse),
        }
    }

    /// How bright light is that has passed a segment, as a share.
    pub(super) fn dimmed(&self, segment: &Segment) -> f64 {
        self.left_by(self.through(segment).as_ref())
    }
}
