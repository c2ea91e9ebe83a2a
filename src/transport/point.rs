//! Irradiance at a point: every link of the element that holds it (or the whole room), evaluated anew for that point.
//!
//! `H(p) = sum over patches F(p -> b) V(p, b) B_b` and what punctual lights bring.

use super::hemisphere::Hemisphere;
use super::lamp::Lamp;
use super::luminaire;
use super::shadows::Shadows;
use super::sky::{Look, Outside};
use super::trace::Trace;
use crate::geometry::sampling::sequence02;
use crate::geometry::{Clipper, Hit, NO_PLANE, Segment};
use crate::hierarchy::{NONE, Sample, Tree};
use crate::light::{Filter, Glass, Light};
use crate::link::{Sight, Way};
use crate::scene::{LightKind, PunctualLight};
use glam::DVec3;

/// Nearer than this many of its radii a cluster is entered, and a patch is not even.
pub(super) const CLOSE: f64 = 1.5;

/// A vertex that sees more black backs than this, share of its rays, lies inside something.
pub const MOSTLY: f64 = 0.75;

/// Where light is received.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// The point, recentred.
    pub point: DVec3,
    /// Unit normal for the cosine.
    pub normal: DVec3,
    /// Plane of the face that the point lies on; [`NO_PLANE`] for a point in the air.
    pub plane: u32,
    /// Leaf of the hierarchy whose links are used; none: the whole room is searched.
    pub leaf: Option<u32>,
    /// Distinguishes sampling patterns.
    pub seed: u64,
}

/// Light at a point.
#[derive(Debug, Clone)]
pub struct Gathered {
    /// Irradiance by lane.
    pub irradiance: [f32; 64],
    /// Of which straight from lamps.
    pub direct: [f32; 64],
    /// Sum of visible factors: 1 in a closed room.
    pub seen: f64,
    /// Share of the rays over the hemisphere that met a black back; 0 where light is gathered by links.
    pub backs: f64,
    /// Visibility rays cast for this point.
    pub rays: u64,
    /// Where it comes from, where that is kept; at last packed.
    pub(crate) trace: Option<Trace>,
    pub(crate) packed: Option<Box<[u8]>>,
}

impl Gathered {
    /// No light, nothing seen.
    pub(crate) fn dark() -> Self {
        Self {
            irradiance: [0.0; 64],
            direct: [0.0; 64],
            seen: 0.0,
            backs: 0.0,
            rays: 0,
            trace: None,
            packed: None,
        }
    }

    /// Packs the trace.
    pub(crate) fn pack(mut self) -> Self {
        self.packed = self.trace.take().map(Trace::pack);
        self
    }
}

/// A patch that a point is linked to: its node, what may stand between, what the link found visible.
pub(super) type Linked = (u32, Way, f32);

/// What light of patches is gathered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    All,
    Reflected,
    Emitted,
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
    pub(super) tints: Vec<Option<Box<Filter>>>,
    /// Of which close by.
    pub(super) near: Vec<(u32, Hit)>,
    /// Lamps that are put off until all of them are known.
    pub(super) lamps: Vec<Lamp>,
    /// Which path each segment to a lamp belongs to, and what it brings.
    pub(super) to_lamps: Vec<(usize, f64)>,
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
    fn start(&self) -> Gathered {
        Gathered {
            trace: self.keep.then(Trace::new),
            ..Gathered::dark()
        }
    }

    /// Gathers what comes straight from lamps.
    pub fn direct(&self, to: &Receiver, memory: &mut Memory) -> [f32; 64] {
        let mut out = self.start();
        memory.noise = 0.0;
        self.lamps_of(to, memory, &mut out);
        self.punctual(to, memory, &mut out);
        self.outside(to, None, false, memory, &mut out);
        memory.trace = out.trace;
        out.direct
    }

    /// Links of the receiver's leaf and of what holds it; without a leaf, the whole room.
    pub(super) fn links(&self, to: &Receiver) -> impl Iterator<Item = Linked> {
        let parent = |&id: &u32| Some(self.tree.node(id).parent).filter(|&p| p != NONE);
        let room = to.leaf.is_none() && !self.tree.nodes.is_empty();
        std::iter::successors(to.leaf, parent)
            .flat_map(|id| self.light.neighbours.row(id).iter().copied())
            .chain(room.then_some((0, Way::Crowded, 0.5)))
    }

    /// Gathers what patches emit. Where links say little about what stands between, lamps are looked for from the root: a lamp
    /// is one element then, however many patches of it the receiver is linked to.
    pub(super) fn lamps_of(&self, to: &Receiver, memory: &mut Memory, out: &mut Gathered) {
        memory.stack.clear();
        if self.hemisphere.is_some() {
            let root = self.light.lit.first().filter(|&&id| id != NONE);
            memory.stack.extend(root.map(|&id| (id, Way::Crowded, 0.5)));
        } else {
            let lit = |id: u32| self.light.bright_emitted[id as usize] > 0.0;
            memory
                .stack
                .extend(self.links(to).filter(|&(id, ..)| lit(id)));
        }
        self.patches(to, Of::Emitted, memory, out);
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
        self.patches(to, Of::All, memory, &mut out);
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

    /// Light of punctual lights, one ray each.
    pub(super) fn punctual(&self, to: &Receiver, memory: &mut Memory, out: &mut Gathered) {
        for (k, (lamp, row)) in self.lamps.iter().enumerate() {
            let (factor, filter) = match lamp.kind {
                LightKind::Surface => {
                    let bright = self.light.bright_lamps.get(k).copied().unwrap_or(0.0);
                    self.of_surface(to, lamp, f64::from(bright), memory)
                }
                _ => self.of_light(to, lamp, memory),
            };
            if factor <= 0.0 {
                continue;
            }
            if let Some(trace) = &mut out.trace {
                trace.lamp(k, factor as f32);
            }
            for (l, r) in row.iter().enumerate() {
                let more = factor as f32 * r * filter.map_or(1.0, |filter| filter[l]);
                out.irradiance[l] += more;
                out.direct[l] += more;
            }
        }
    }

    /// What turns the intensity of a light without extent, or of the sun, into irradiance, past what is in between, and what
    /// panes leave of it.
    fn of_light(
        &self,
        to: &Receiver,
        lamp: &PunctualLight,
        memory: &mut Memory,
    ) -> (f64, Option<Filter>) {
        let Some((factor, end)) = punctual_factor(lamp, to, self.light.half_size) else {
            return (0.0, None);
        };
        let way = Segment::new(to.point, end, [to.plane, NO_PLANE]);
        let seen = match lamp.kind {
            LightKind::Sun => self.sun_seen(to, lamp, memory),
            _ if self.sight.occlusion => {
                memory.rays += 1;
                f64::from(u8::from(!self.sight.blocks_one(&way)))
            }
            _ => 1.0,
        };
        match seen > 0.0 {
            true => (factor * seen, self.through(&way)),
            false => (0.0, None),
        }
    }

    /// What panes leave of light on a segment; none where all passes.
    pub(super) fn through(&self, segment: &Segment) -> Option<Filter> {
        self.glass?.through(segment.from, segment.to)
    }

    /// How bright light is that has passed a segment, as a share.
    pub(super) fn dimmed(&self, segment: &Segment) -> f64 {
        let glass = self.glass.as_ref();
        glass.map_or(1.0, |glass| glass.brightness(segment.from, segment.to))
    }
}

/// What turns a punctual light's intensity (of measured lamps, flux) into irradiance at a receiver where nothing is in between, and
/// where the ray to it ends: of a lamp with an extent, at one of its points. None for sky and ground, which shine from everywhere.
pub fn punctual_factor(
    lamp: &PunctualLight,
    to: &Receiver,
    half_size: f64,
) -> Option<(f64, DVec3)> {
    if lamp.kind.is_dome() {
        return None;
    }
    if lamp.kind.is_parallel() {
        let cosine = -to.normal.dot(lamp.direction);
        return (cosine > 0.0).then(|| (cosine, to.point - lamp.direction * (4.0 * half_size)));
    }
    if lamp.kind == LightKind::Surface {
        return luminaire::whole(lamp, to, half_size, sequence02(0, to.seed));
    }
    let d = lamp.position - to.point;
    let r2 = d.length_squared();
    let cosine = to.normal.dot(d) / r2.sqrt();
    if !(cosine > 0.0 && r2 > 0.0) {
        return None;
    }
    let spot = match lamp.kind {
        LightKind::Spot { inner, outer } => {
            // The fall-off that KHR_lights_punctual gives: smooth between the cosines of both angles.
            let along = -lamp.direction.dot(d) / r2.sqrt();
            let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-3);
            ((along - outer.cos()) * scale).clamp(0.0, 1.0).powi(2)
        }
        LightKind::Profile => {
            let spread = lamp.luminaire.as_ref();
            spread.map_or(0.0, |l| l.per_lumen(-d / r2.sqrt()))
        }
        _ => 1.0,
    };
    (spot > 0.0).then(|| (spot * cosine / r2, lamp.position))
}
