//! Irradiance at a point: every link of the element that holds it (or the whole room), evaluated anew for that point.
//!
//! `H(p) = sum over patches F(p -> b) V(p, b) B_b`, with exact polygon factors. A patch whose light varies is entered
//! (its children take its place) while that could misplace more than the tolerance; a lamp is entered until it is even.
//! Ways that a link proved clear cost no ray; others get rays in number with what they carry.

use super::hemisphere::Hemisphere;
use super::trace::Trace;
use crate::geometry::{Hit, Segment, lambert_polygon};
use crate::hierarchy::{Element, NONE, Node, Sample, Tree};
use crate::link::{Sight, View, Way, blockers_of, pattern, point_factor};
use crate::scene::{LightKind, PunctualLight};
use crate::solve::light::Light;
use glam::DVec3;

/// Rays to a patch at least, and at the most.
const RAYS: [usize; 2] = [4, 32];
/// Points that stand for a far cluster: one that carries little, and one that carries much.
const CLUSTER_POINTS: [usize; 2] = [4, 8];
/// Nearer than this many of its radii a cluster is entered, and a patch is not even.
pub(super) const CLOSE: f64 = 1.5;
/// Faces of a cluster that are treated as polygons.
pub(super) const POLYGONS: u32 = 4;
/// A clear patch may misplace this share of the tolerance: what many of them misplace goes the same way (the middle of a wall
/// is brighter than its edges, and nearer), and to enter one costs no ray. With 1 the light in a white cube is .7 % low.
const CLEAR_SHARE: f64 = 0.05;
/// How many rays a link's visibility counts for.
const PRIOR: f64 = 4.0;
/// How often a lamp's triangle is quartered where its shadow boundary crosses it.
const LAMP_DEPTH: u32 = 6;
/// A lamp gets more than plain rays if it carries this many tolerances.
const SHAFT_WORTH: f64 = 4.0;

/// Where light is received.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// The point, recentred.
    pub point: DVec3,
    /// Unit normal for the cosine.
    pub normal: DVec3,
    /// Plane of the face that the point lies on; `u32::MAX` for a point in the air.
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
    samples: Vec<Sample>,
    segments: Vec<Segment>,
    weights: Vec<f64>,
    blocked: Vec<bool>,
    /// What the rays of a point met.
    pub(super) met: Vec<(u32, Hit)>,
    /// Of which close by.
    pub(super) near: Vec<(u32, Hit)>,
    /// Rays cast.
    pub rays: u64,
    /// Where the direct light of the last point comes from, where that is kept.
    pub(crate) trace: Option<Trace>,
}

impl Memory {
    /// Another point: nothing is taken yet.
    pub(super) fn begin(&mut self, nodes: usize) {
        self.open.clear();
        self.stack.clear();
        self.epoch = self.epoch.wrapping_add(1);
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
    /// What one patch may misplace, share of the white's irradiance.
    pub tolerance: f64,
    /// Must the visible factors sum to 1? Then indirect light is divided by their sum.
    pub closed: bool,
    /// Directions for indirect light where rays find patches sooner than links do; none: by links.
    pub hemisphere: Option<&'a Hemisphere>,
    /// Is it kept where light comes from?
    pub(crate) keep: bool,
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
        self.lamps_of(to, memory, &mut out);
        self.punctual(to, memory, &mut out);
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

    /// Gathers what patches emit.
    pub(super) fn lamps_of(&self, to: &Receiver, memory: &mut Memory, out: &mut Gathered) {
        let lit = |id: u32| self.light.bright_emitted[id as usize] > 0.0;
        memory.stack.clear();
        memory
            .stack
            .extend(self.links(to).filter(|&(id, ..)| lit(id)));
        while let Some(linked) = memory.stack.pop() {
            if lit(linked.0) {
                self.visit(to, linked, Of::Emitted, memory, out);
            }
        }
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
        while let Some(linked) = memory.stack.pop() {
            self.visit(to, linked, Of::All, memory, &mut out);
        }
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
        out.rays = memory.rays - before;
        out
    }

    /// Greatest factor that a patch could have, by its projected area.
    pub(super) fn bound(&self, to: &Receiver, node: &Node) -> f64 {
        let gap = ((node.centre - to.point).length() - node.radius).max(0.0);
        node.area / (std::f64::consts::PI * gap * gap + node.area)
    }

    /// Adds a patch, or puts its children in its place.
    pub(super) fn visit(
        &self,
        to: &Receiver,
        (id, way, v): Linked,
        of: Of,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        let node = self.tree.node(id);
        let clear = way == Way::Clear || !self.sight.occlusion;
        if !self.can_see(to, node) {
            return;
        }
        let k = id as usize;
        let mut reflected = f64::from(self.light.bright_reflected[k]);
        let mut emitted = f64::from(self.light.bright_emitted[k]);
        match of {
            Of::All => {}
            Of::Reflected => emitted = 0.0,
            Of::Emitted => reflected = 0.0,
        }
        let spread = f64::from(self.light.spread[k]);
        let distance = (node.centre - to.point).length();
        if node.faces.1 > POLYGONS {
            let factor = self.bound(to, node);
            let near = distance < CLOSE * node.radius;
            // Points find a cluster's light to about a third of its spread, and where lamps are in it, of its light.
            if near || factor * (0.3 * spread + emitted) > self.tolerance {
                memory.stack.extend(node.child_range().map(|c| (c, way, v)));
                return;
            }
            let count = CLUSTER_POINTS[usize::from(factor * reflected > self.tolerance)];
            if let Some((factor, visible)) = self.cluster(to, id, count, clear, memory) {
                self.add(id, factor, visible, of, out);
            }
            return;
        }
        let sample = Sample {
            point: to.point,
            normal: to.normal,
            plane: to.plane,
            area: 1.0,
        };
        let factor = point_factor(self.tree, &sample, node, &[]);
        if factor <= 0.0 {
            return;
        }
        let (size, limit) = if clear {
            let size = (node.radius / distance.max(1e-300)).min(1.0);
            (size, CLEAR_SHARE * self.tolerance)
        } else {
            (1.0, self.tolerance)
        };
        if self.has_parts(node) && (node.element == NONE || factor * spread * size > limit) {
            memory.stack.extend(node.child_range().map(|c| (c, way, v)));
            return;
        }
        let visible = if clear {
            1.0
        } else {
            self.visible(
                to,
                id,
                way,
                v,
                factor,
                factor * (reflected + emitted),
                emitted > 0.0,
                memory,
            )
        };
        self.add(id, factor, visible, of, out);
        if of != Of::Emitted {
            self.slope(to, id, factor, visible, CLEAR_SHARE * self.tolerance, out);
        }
    }

    /// Are the children of a node known to the solution? Elements split after it are not.
    pub(super) fn has_parts(&self, node: &Node) -> bool {
        !node.is_leaf() && (node.child as usize) < self.light.bright_emitted.len()
    }

    /// Adds a patch with a factor and its visible share.
    fn add(&self, id: u32, factor: f64, visible: f64, of: Of, out: &mut Gathered) {
        let seen = (factor * visible) as f32;
        let k = id as usize;
        let width = self.light.width();
        if of != Of::Emitted {
            out.seen += factor * visible;
            let row = self.light.reflected.row(k);
            for (x, r) in out.irradiance[..width].iter_mut().zip(row) {
                *x += seen * r;
            }
        }
        if of != Of::Reflected && self.light.bright_emitted[k] > 0.0 {
            let row = self.light.emitted.row(k);
            for (x, e) in out.direct[..width].iter_mut().zip(row) {
                *x += seen * e;
            }
        }
        if let Some(trace) = &mut out.trace {
            match of {
                Of::All => trace.patch(id, seen),
                Of::Reflected => trace.slope(id, seen),
                Of::Emitted => {
                    trace.patch(id, seen);
                    trace.slope(id, -seen);
                }
            }
        }
    }

    /// Could any of the patch be in front of the receiver, and the receiver in front of any of the patch?
    pub(super) fn can_see(&self, to: &Receiver, node: &Node) -> bool {
        let from = node.centre - to.point;
        let reach = (0.5 * (node.high - node.low))
            .dot(to.normal.abs())
            .min(node.radius);
        if to.normal.dot(from) + reach <= 0.0 {
            return false;
        }
        if node.flat {
            let entry = node.faces.0 as usize;
            return self.tree.face_plane[entry] != to.plane
                && -node.normal.dot(from) + (0.5 * (node.high - node.low)).dot(node.normal.abs())
                    > 0.0;
        }
        let distance = from.length();
        if distance <= node.radius || node.cone <= 0.0 {
            return true;
        }
        let angle =
            node.normal.angle_between(-from) - (node.radius / distance).asin() - node.cone.acos();
        angle < 0.5 * std::f64::consts::PI
    }

    /// Factor and visible share of a far cluster by points, each with its own ray.
    fn cluster(
        &self,
        to: &Receiver,
        id: u32,
        count: usize,
        clear: bool,
        memory: &mut Memory,
    ) -> Option<(f64, f64)> {
        let shift = pattern(to.seed, id, 1);
        self.tree.samples(id, count, shift, &mut memory.samples);
        memory.segments.clear();
        memory.weights.clear();
        for s in &memory.samples {
            let d = s.point - to.point;
            let r2 = d.length_squared();
            let (c1, c2) = (to.normal.dot(d), -s.normal.dot(d));
            if c1 > 0.0 && c2 > 0.0 && s.plane != to.plane {
                // Random points of a cluster that is far: without bias, and never near enough to blow up.
                memory
                    .weights
                    .push(c1 * c2 / (std::f64::consts::PI * r2 * r2) * s.area);
                memory.segments.push(Segment {
                    from: to.point.as_vec3(),
                    to: s.point.as_vec3(),
                    planes: [to.plane, s.plane],
                });
            }
        }
        let factor: f64 = memory.weights.iter().sum();
        if factor <= 0.0 {
            return None;
        }
        let mut visible = 1.0;
        if !clear {
            self.sight
                .blocked(&memory.segments, &View::Crowded, &mut memory.blocked);
            memory.rays += memory.segments.len() as u64;
            let open = memory
                .weights
                .iter()
                .zip(&memory.blocked)
                .filter(|(_, b)| !**b)
                .map(|(w, _)| w);
            visible = open.sum::<f64>() / factor;
        }
        Some((factor, visible))
    }

    /// Visible share of a polygon patch. `carries` is what it would bring unblocked, share of white.
    #[expect(clippy::too_many_arguments, reason = "one caller")]
    fn visible(
        &self,
        to: &Receiver,
        id: u32,
        way: Way,
        known: f32,
        factor: f64,
        carries: f64,
        lamp: bool,
        memory: &mut Memory,
    ) -> f64 {
        let node = self.tree.node(id);
        let Some(element) = self.tree.element(node) else {
            return 1.0;
        };
        let plane = self.tree.face_plane[element.face as usize];
        if let Way::Listed { .. } = way {
            let list = blockers_of(&self.light.neighbours.blockers, way);
            if let Some(seen) = self.sight.visible_factor(
                to.point,
                to.normal,
                &element.corners,
                [to.plane, plane],
                list,
            ) {
                return (seen / factor).min(1.0);
            }
        }
        // A lamp that matters is worth a look into the shaft: few blockers give an exact answer.
        if lamp && carries > SHAFT_WORTH * self.tolerance {
            match self
                .sight
                .view_from(to.point, to.normal, &element.corners, [to.plane, plane])
            {
                View::Clear => return 1.0,
                View::Listed(list) => {
                    if let Some(seen) = self.sight.visible_factor(
                        to.point,
                        to.normal,
                        &element.corners,
                        [to.plane, plane],
                        &list,
                    ) {
                        return (seen / factor).min(1.0);
                    }
                }
                View::Crowded => {}
            }
        }
        if lamp && carries > SHAFT_WORTH * self.tolerance {
            return self.lamp_visible(to, element, plane, carries, memory);
        }
        // Stratified rays err by about 0.5 n^(-3/4) where a boundary crosses.
        let wanted = (0.5 * carries / self.tolerance).powf(4.0 / 3.0).ceil() as usize;
        let count = wanted.clamp(RAYS[0], RAYS[1]);
        let shift = pattern(to.seed, id, 2);
        let normal = node.normal;
        memory.segments.clear();
        memory.weights.clear();
        for k in 0..count {
            let p = element.at(crate::hierarchy::stratified(k, RAYS[1], shift));
            let d = p - to.point;
            let r2 = d.length_squared();
            let (c1, c2) = (to.normal.dot(d), -normal.dot(d));
            if c1 > 0.0 && c2 > 0.0 && r2 > 0.0 {
                memory.weights.push(c1 * c2 / (r2 * r2));
                memory.segments.push(Segment {
                    from: to.point.as_vec3(),
                    to: p.as_vec3(),
                    planes: [to.plane, plane],
                });
            }
        }
        self.sight
            .blocked(&memory.segments, &View::Crowded, &mut memory.blocked);
        memory.rays += memory.segments.len() as u64;
        let total: f64 = memory.weights.iter().sum();
        let seen: f64 = memory
            .weights
            .iter()
            .zip(&memory.blocked)
            .filter(|(_, b)| !**b)
            .map(|(w, _)| w)
            .sum();
        // Where no ray gets through, nothing does: what other parts of the element see must not leak in.
        if seen <= 0.0 {
            return 0.0;
        }
        // What the link's own rays found over the whole patch counts as some more rays: it halves the noise, and what it
        // blurs is bounded by the size of the receiving element. A lamp's shadow is not blurred.
        let prior = if lamp || to.leaf.is_none() || self.hemisphere.is_some() {
            0.0
        } else {
            PRIOR
        };
        (seen / total * count as f64 + prior * f64::from(known)) / (count as f64 + prior)
    }

    /// Visible share of a lamp's triangle: quartered where rays disagree, until a quarter carries less than the tolerance.
    fn lamp_visible(
        &self,
        to: &Receiver,
        element: &Element,
        plane: u32,
        carries: f64,
        memory: &mut Memory,
    ) -> f64 {
        let mut seen = 0.0;
        let mut total = 0.0;
        let mut open = vec![(element.corners, 0_u32)];
        while let Some((corners, depth)) = open.pop() {
            let factor = lambert_polygon(to.point, to.normal, &corners);
            if factor <= 0.0 {
                continue;
            }
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            memory.segments.clear();
            // Corners drawn a little inwards: a ray along the very edge says nothing about the inside.
            for p in [
                middle,
                corners[0].lerp(middle, 0.15),
                corners[1].lerp(middle, 0.15),
                corners[2].lerp(middle, 0.15),
            ] {
                memory.segments.push(Segment {
                    from: to.point.as_vec3(),
                    to: p.as_vec3(),
                    planes: [to.plane, plane],
                });
            }
            self.sight
                .blocked(&memory.segments, &View::Crowded, &mut memory.blocked);
            memory.rays += 4;
            let blocked = memory.blocked.iter().filter(|b| **b).count();
            let share = carries * 0.25_f64.powi(depth as i32);
            let mixed = blocked != 0 && blocked != 4;
            if depth < LAMP_DEPTH
                && ((mixed && share > self.tolerance) || share > 64.0 * self.tolerance)
            {
                let [a, b, c] = corners;
                let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
                open.extend(
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]].map(|t| (t, depth + 1)),
                );
                continue;
            }
            total += factor;
            seen += factor * (4 - blocked) as f64 / 4.0;
        }
        if total > 0.0 { seen / total } else { 0.0 }
    }

    /// Light of punctual lights, one ray each.
    pub(super) fn punctual(&self, to: &Receiver, memory: &mut Memory, out: &mut Gathered) {
        for (k, (lamp, row)) in self.lamps.iter().enumerate() {
            let (factor, end) = match punctual_factor(lamp, to, self.light.half_size) {
                Some(x) => x,
                None => continue,
            };
            if self.sight.occlusion {
                memory.segments.clear();
                memory.segments.push(Segment {
                    from: to.point.as_vec3(),
                    to: end.as_vec3(),
                    planes: [to.plane, u32::MAX],
                });
                self.sight
                    .blocked(&memory.segments, &View::Crowded, &mut memory.blocked);
                memory.rays += 1;
                if memory.blocked[0] {
                    continue;
                }
            }
            if let Some(trace) = &mut out.trace {
                trace.lamp(k, factor as f32);
            }
            for ((x, d), r) in out.irradiance.iter_mut().zip(&mut out.direct).zip(row) {
                *x += factor as f32 * r;
                *d += factor as f32 * r;
            }
        }
    }
}

/// What turns a punctual light's intensity into irradiance at a receiver, and where the ray to it ends.
pub fn punctual_factor(
    lamp: &PunctualLight,
    to: &Receiver,
    half_size: f64,
) -> Option<(f64, DVec3)> {
    if lamp.kind == LightKind::Directional {
        let cosine = -to.normal.dot(lamp.direction);
        return (cosine > 0.0).then(|| (cosine, to.point - lamp.direction * (4.0 * half_size)));
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
        _ => 1.0,
    };
    (spot > 0.0).then(|| (spot * cosine / r2, lamp.position))
}
