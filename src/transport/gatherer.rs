//! What a gather works with, and the memory of one thread.

use super::hemisphere::Hemisphere;
use super::receiver::Gathered;
use super::shadows::Shadows;
use super::surroundings::{SkyScratch, Surroundings};
use super::trace::Trace;
use super::via::{Arrived, Via};
use crate::geometry::{Clipper, Hit, Segment};
use crate::hierarchy::{Sample, Tree};
use crate::light::passed::Steps;
use crate::light::{Filters, Glass, Light, Passage};
use crate::link::{Occlusion, Sight};
use crate::scene::PunctualLight;
use glam::DVec3;

/// A cluster nearer than this many of its radii is entered, and a patch as near is not even.
pub(super) const CLOSE: f64 = 1.5;

/// A patch that a point is linked to: its node, what may stand between, and the visible share that the link found.
pub(super) type Linked = (u32, Occlusion, f32);

/// Which light of patches is gathered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RadiosityPart {
    All,
    Reflected,
    Emitted,
}

/// An element of a lamp, or a bright patch, whose visible share is found by rays that it shares with others: its exact factor, and the
/// irradiance it would bring unblocked, share of white.
#[derive(Debug, Clone, Copy)]
pub(super) struct SourceElement {
    pub(super) id: u32,
    /// The cluster of elements that emit alike and lie together, see [`Fixtures`](crate::light::Fixtures); [`NONE`] for a single
    /// element.
    pub(super) fixture: u32,
    /// Where the factors of that cluster's faces start in the memory.
    pub(super) faces: usize,
    pub(super) factor: f64,
    pub(super) carries: f64,
}

/// How much light may err by chance at a point, in tolerances, and what is spent on that at the most.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AllowedNoise {
    /// The light of all lamps together.
    pub(crate) lamps: f64,
    /// Rays to all lamps, or all bright patches, together.
    pub(crate) most_rays: usize,
    /// The light that one ray of the hemisphere brings: brighter patches are gathered by their links.
    pub(crate) glare: f64,
    /// Rays to the openings to a sky, at the least and at the most.
    pub(crate) opening_rays: [usize; 2],
    /// What is met close by, see `transport::nearby`.
    pub(crate) nearby: f64,
    /// Paths from there, at the least and at the most.
    pub(crate) paths: [usize; 2],
}

impl AllowedNoise {
    /// With so many times the samples.
    pub(crate) fn by(self, samples: f64) -> Self {
        let times = |n: usize| ((n as f64 * samples) as usize).max(1);
        let [least, most] = self.paths;
        Self {
            most_rays: times(self.most_rays),
            paths: [least, times(most).max(least)],
            ..self
        }
    }
}

/// Reused memory of one thread and its ray count.
#[derive(Debug, Default)]
pub struct Memory {
    pub(super) stack: Vec<Linked>,
    pub(super) open: Vec<Linked>,
    /// Epoch in which each node was last gathered as a patch: rays that end on it bring nothing more.
    pub(super) taken: Vec<u32>,
    pub(super) epoch: u32,
    /// Was any node so gathered in this epoch?
    pub(super) any_taken: bool,
    pub(super) samples: Vec<Sample>,
    pub(super) segments: Vec<Segment>,
    pub(super) weights: Vec<f64>,
    pub(super) blocked: Vec<bool>,
    pub(super) clipper: Clipper,
    pub(super) shadows: Shadows,
    /// What the rays of a point met.
    pub(super) met: Vec<(u32, Hit)>,
    /// How bright their leaves are there, as a share of their mean.
    pub(super) tilts: Vec<f32>,
    /// What panes leave of the light of these hits, in order; empty in a room without panes.
    pub(super) tints: Vec<Option<Box<Passage>>>,
    /// The hits close by.
    pub(super) near: Vec<(u32, Hit)>,
    /// Lamps or bright patches held back until all of them are known.
    pub(super) sources: Vec<SourceElement>,
    /// Far clusters of lamps, and what each brings at the most, share of white.
    pub(super) far: Vec<(u32, f64)>,
    /// Factors of the faces of lamps with many faces, lamp after lamp.
    pub(super) faces: Vec<f64>,
    /// The path that each segment to a lamp belongs to, and what the lamp brings.
    pub(super) to_lamps: Vec<(usize, f64)>,
    /// What the rays of a point met by way of mirrors.
    pub(super) mirrored: Vec<Arrived>,
    /// Memory of a look outside.
    pub(super) look: SkyScratch,
    /// Directions in which the rays of a point leave the room.
    pub(super) escaped: Vec<DVec3>,
    /// Rays cast.
    pub rays: u64,
    /// Variance of brightness by the rays to the lamps of the last point.
    pub(crate) noise: f64,
    /// Where the direct light of the last point comes from, if kept.
    pub(crate) trace: Option<Trace>,
}

impl Memory {
    /// Starts on another point: no node is gathered yet.
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

/// Everything that a gather works with.
pub struct Gatherer<'a> {
    /// The patches.
    pub tree: &'a Tree,
    /// The solution.
    pub light: &'a Light,
    /// What blocks rays.
    pub sight: &'a Sight<'a>,
    /// Punctual lights with their rows of radiant intensity (or normal irradiance), recentred.
    pub lamps: &'a [(PunctualLight, Vec<f32>)],
    /// What is outside; none where no light comes from outside.
    pub(crate) sky: Option<&'a Surroundings>,
    /// The panes, through which light passes; none where the room has none.
    pub(crate) glass: Option<Glass<'a>>,
    /// What mirrors leave of light.
    pub(crate) filters: &'a Filters,
    /// The mirrors by which light comes: the receiver is then the image of the true one. None: light comes straight.
    pub(crate) via: Option<Via>,
    /// What one patch may misplace, share of the white's irradiance.
    pub tolerance: f64,
    /// What light may err by chance.
    pub(crate) allowed_noise: AllowedNoise,
    /// Must the visible factors sum to 1? Then indirect light is divided by their sum.
    pub closed: bool,
    /// The directions of rays for indirect light, where rays find patches sooner than links do; none: by links.
    pub hemisphere: Option<&'a Hemisphere>,
    /// Are shafts to lamps that matter looked into? Where many points represent a leaf, rays are used.
    pub(crate) shafts: bool,
    /// Is the origin of light recorded?
    pub(crate) keep: bool,
    /// Points of whose rays more than this share meet black backs lie inside something and are not gathered.
    pub(crate) most_backs: f64,
}

impl Gatherer<'_> {
    /// No light yet; with a trace if that is kept.
    pub(super) fn start(&self) -> Gathered {
        Gathered {
            trace: self.keep.then(Trace::new),
            ..Gathered::dark()
        }
    }

    /// Do only blockers affect light on its way? Then it is clipped exactly.
    pub(super) fn is_plain(&self) -> bool {
        self.glass.is_none() && self.via.is_none()
    }

    /// What panes and mirrors leave of light on a free segment; none: all.
    pub(super) fn through(&self, segment: &Segment) -> Option<Passage> {
        self.passage(segment, self.steps())
    }

    /// The same, recorded by these steps if any.
    pub(super) fn passage(&self, segment: &Segment, steps: Option<Steps>) -> Option<Passage> {
        match self.via {
            Some(via) => self.by_way_of(via, segment, steps),
            None => (self.glass?).through(segment.from, segment.to, steps),
        }
    }

    /// How finely the panes that light passes are recorded, if they are: coarser where many points represent a leaf.
    pub(super) fn steps(&self) -> Option<Steps> {
        match (self.keep, self.shafts) {
            (false, _) => None,
            (true, true) => Some(Steps::Fine),
            (true, false) => Some(Steps::Coarse),
        }
    }

    /// Share of brightness that is left of light on a segment.
    pub(super) fn dimmed(&self, segment: &Segment) -> f64 {
        self.left_by(self.through(segment).as_ref())
    }
}
