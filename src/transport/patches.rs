//! The light of patches at a point: each with its exact polygon factor, or by its children, and its visible share.
//!
//! A patch whose light varies is entered (its children take its place) while that could misplace more than the tolerance;
//! a lamp is entered until it is even. Ways that a link proved clear cost no ray; others get rays in proportion to their
//! light.

use super::gatherer::{CLOSE, Gatherer, Linked, Memory, RadiosityPart, SourceElement};
use super::lamp::{parts_of, point_of};
use super::receiver::{Gathered, Receiver};
use super::slope::SeenPatch;
use crate::geometry::sampling::{hash, sequence02};
use crate::geometry::{Segment, lambert_triangles_x8};
use crate::hierarchy::{Element, NONE, Node};
use crate::light::{Passage, Tint, accumulate};
use crate::link::{
    Occlusion, PIECES, POLYGONS, Visibility, blockers_of, in_front_of, open_weight, pattern,
    polygons,
};
use glam::DVec3;

/// Rays to a patch: the least, and the most.
const RAYS: [usize; 2] = [4, 32];
/// Points that represent a far cluster: one that carries little, and one that carries much.
const CLUSTER_POINTS: [usize; 2] = [4, 8];
/// Share of the tolerance that a clear patch may misplace before its children are entered or its slope is added: the errors of many patches
/// have the same sign (the middle of a wall is brighter than its edges, and nearer), and entering a patch costs no ray. At `--error 1` the
/// light of the convex room is off by .29 % (root mean square); with .25 by .33, with 1 by .84, with .01 by .34.
const CLEAR_SHARE: f64 = 0.05;
/// The share for a patch that is partly hidden, nobody knows where: entering it costs rays. With 1, .5, .2, .1 and .05 light at `--error 1` is
/// off by 1.7, 1.6, 1.3, 1.2, 1.2 % in the Cornell box, by 5.0, 4.2, 3.2, 2.3, 1.8 in Bevy's, and by 7.8, 6.9, 6.0, 5.6, 5.4 in the corridor, in
/// 1, .97, 1.01, 1.05, 1.12 times the time.
const PARTLY_SHARE: f64 = 0.2;
/// Number of rays that a link's visibility counts as.
const PRIOR: f64 = 4.0;
/// A shaft to a lamp is looked into if the lamp carries this many tolerances.
const SHAFT_WORTH: f64 = 4.0;

impl Gatherer<'_> {
    /// Bound of a patch's factor, from its projected area.
    pub(super) fn bound(&self, to: &Receiver, node: &Node) -> f64 {
        let gap = ((node.centre - to.point).length() - node.radius).max(0.0);
        node.area / (std::f64::consts::PI * gap * gap + node.area)
    }

    /// Adds the patches on the stack, or replaces them by their children. Factors are worked out for eight faces at once.
    pub(super) fn patches(
        &self,
        to: &Receiver,
        which: RadiosityPart,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        loop {
            let mut open = [((NONE, Occlusion::Clear, 0.0), 0.0); 8];
            let mut held = 0;
            let mut faces = [([DVec3::ZERO; 3], 0); 8];
            let mut count = 0;
            while let Some(&linked) = memory.stack.last() {
                let node = self.tree.node(linked.0);
                let plain = node.faces.1 <= POLYGONS;
                if plain && count + node.faces.1 as usize > faces.len() {
                    break;
                }
                memory.stack.pop();
                if which == RadiosityPart::Emitted
                    && self.light.bright_emitted[linked.0 as usize] <= 0.0
                    || !self.can_see(to, node)
                {
                    continue;
                }
                if !plain {
                    self.cluster(to, linked, which, memory, out);
                    continue;
                }
                let before = count;
                for (corners, entry) in polygons(self.tree, node) {
                    if in_front_of(self.tree, &corners, entry, to.point, to.plane) {
                        faces[count] = (corners, held);
                        count += 1;
                    }
                }
                if count > before {
                    open[held].0 = linked;
                    held += 1;
                }
            }
            if held == 0 {
                self.sources_together(to, which, memory, out);
                self.lamps_by_chance(to, memory, out);
                return;
            }
            let faces = &faces[..count];
            let triangles = faces.iter().map(|face| face.0);
            let factors = lambert_triangles_x8(to.point, to.normal, triangles);
            for ((_, owner), factor) in faces.iter().zip(factors) {
                open[*owner].1 += factor;
            }
            for &(linked, factor) in &open[..held] {
                if factor > 0.0 {
                    self.patch(to, linked, factor, which, memory, out);
                }
            }
        }
    }

    /// Reflected and emitted brightness of a node, as far as gathered, as shares of white.
    fn brightness(&self, id: u32, which: RadiosityPart) -> (f64, f64) {
        let reflected = f64::from(self.light.bright_reflected[id as usize]);
        let emitted = f64::from(self.light.bright_emitted[id as usize]);
        match which {
            RadiosityPart::All => (reflected, emitted),
            RadiosityPart::Reflected => (reflected, 0.0),
            RadiosityPart::Emitted => (0.0, emitted),
        }
    }

    /// Adds a cluster of many faces if it is far, else replaces it by its children.
    fn cluster(
        &self,
        to: &Receiver,
        (id, occlusion, v): Linked,
        which: RadiosityPart,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        if which == RadiosityPart::Emitted && self.is_fixture(to, id) {
            self.put_off(to, id, memory);
            return;
        }
        let node = self.tree.node(id);
        let (reflected, emitted) = self.brightness(id, which);
        let deviation = f64::from(self.light.deviation[id as usize]);
        let factor = self.bound(to, node);
        let near = (node.centre - to.point).length() < CLOSE * node.radius;
        // Points find a cluster's light to about a third of its spread; with lamps in the cluster, only to the whole of
        // their light.
        if near || factor * (0.3 * deviation + emitted) > self.tolerance {
            let part = |c: u32| match which {
                RadiosityPart::Emitted => self.light.lit[c as usize],
                _ => c,
            };
            let parts = node.child_range().map(part).filter(|&c| c != NONE);
            memory.stack.extend(parts.map(|c| (c, occlusion, v)));
            return;
        }
        if which == RadiosityPart::Emitted {
            memory.far.push((id, factor * emitted));
            return;
        }
        let count = CLUSTER_POINTS[usize::from(factor * reflected > self.tolerance)];
        let clear = self.is_clear(occlusion);
        if let Some((factor, visible)) = self.sampled(to, id, count, clear, memory) {
            let tint = self.tint(memory);
            self.add(id, factor, visible, tint.as_ref(), which, out);
        }
    }

    /// Adds a patch of a few faces, or replaces it by its children.
    fn patch(
        &self,
        to: &Receiver,
        (id, occlusion, v): Linked,
        factor: f64,
        which: RadiosityPart,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        let node = self.tree.node(id);
        let clear = self.is_clear(occlusion);
        let (size, limit) = if clear {
            let distance = (node.centre - to.point).length();
            let size = (node.radius / distance.max(1e-300)).min(1.0);
            (size, CLEAR_SHARE * self.tolerance)
        } else {
            (1.0, PARTLY_SHARE * self.tolerance)
        };
        let deviation = match which {
            RadiosityPart::Emitted => self.uneven(node),
            _ => f64::from(self.light.deviation[id as usize]),
        };
        if self.has_parts(node) && (node.element == NONE || factor * deviation * size > limit) {
            memory
                .stack
                .extend(node.child_range().map(|c| (c, occlusion, v)));
            return;
        }
        let (reflected, emitted) = self.brightness(id, which);
        let carries = factor * (reflected + emitted);
        if clear {
            self.see(to, id, factor, SeenPatch::of(1.0), None, which, out);
        } else if let Some((share, clipped)) = self.visible(
            to,
            (id, occlusion, v),
            factor,
            carries,
            emitted > 0.0,
            memory,
        ) {
            let tint = self.tint(memory);
            let parts = Some(&memory.clipper).filter(|_| clipped && share < 1.0);
            self.see(
                to,
                id,
                factor,
                SeenPatch { share, parts },
                tint.as_ref(),
                which,
                out,
            );
        }
    }

    /// Is a way free? One that links proved clear may lead through a pane.
    fn is_clear(&self, occlusion: Occlusion) -> bool {
        self.is_plain() && (occlusion == Occlusion::Clear || !self.sight.occlusion)
    }

    /// What panes leave of the light of the last rays, where these are not blocked; none where no pane is passed.
    pub(super) fn tint(&self, memory: &Memory) -> Option<Passage> {
        if self.is_plain() {
            return None;
        }
        let (mut tint, mut any) = (Tint::default(), false);
        let rays = memory.segments.iter().zip(&memory.weights);
        for ((segment, &weight), _) in (rays.zip(&memory.blocked)).filter(|(_, b)| !**b) {
            let passage = self.through(segment);
            any |= passage.is_some();
            tint.add(passage.as_ref(), weight);
        }
        tint.mean().filter(|_| any)
    }

    /// Adds a patch of a few faces with its visible share, and what a filter leaves of its light.
    #[expect(clippy::too_many_arguments, reason = "each is a different thing")]
    pub(super) fn see(
        &self,
        to: &Receiver,
        id: u32,
        factor: f64,
        seen: SeenPatch,
        tint: Option<&Passage>,
        which: RadiosityPart,
        out: &mut Gathered,
    ) {
        self.add(id, factor, seen.share, tint, which, out);
        // Behind panes leaves count as even: in rooms with panes, patches are gathered this way only if they glare.
        if which != RadiosityPart::Emitted && tint.is_none() {
            self.slope(to, id, factor, seen, CLEAR_SHARE * self.tolerance, out);
        }
    }

    /// Difference in emission between the children of a node: 0 unless a texture varies the emission.
    fn uneven(&self, node: &Node) -> f64 {
        if !self.has_parts(node) {
            return 0.0;
        }
        let parts = node
            .child_range()
            .map(|c| self.light.bright_emitted[c as usize]);
        let (least, most) = parts.fold((f32::MAX, 0.0_f32), |(l, m), x| (l.min(x), m.max(x)));
        // Means of equal numbers differ by rounding.
        if most - least > 1e-5 * most {
            f64::from(most - least)
        } else {
            0.0
        }
    }

    /// Are the children of a node known to the solution? Elements split after it are not.
    pub(super) fn has_parts(&self, node: &Node) -> bool {
        !node.is_leaf() && (node.child as usize) < self.light.bright_emitted.len()
    }

    /// Adds a patch with a factor and its visible share.
    fn add(
        &self,
        id: u32,
        factor: f64,
        visible: f64,
        tint: Option<&Passage>,
        which: RadiosityPart,
        out: &mut Gathered,
    ) {
        let seen = (factor * visible) as f32;
        let k = id as usize;
        let width = self.light.width();
        let filter = tint.map(|passage| &passage.filter);
        if which != RadiosityPart::Emitted {
            out.seen += factor * visible;
            let row = self.light.reflected.row(k);
            accumulate(&mut out.irradiance[..width], seen, row, filter);
        }
        if which != RadiosityPart::Reflected && self.light.bright_emitted[k] > 0.0 {
            let row = self.light.emitted.row(k);
            accumulate(&mut out.direct[..width], seen, row, filter);
        }
        if let Some(trace) = &mut out.trace {
            match which {
                RadiosityPart::All => trace.patch(id, seen, tint),
                RadiosityPart::Reflected => trace.slope(id, seen, tint),
                RadiosityPart::Emitted => trace.emitted(id, seen, tint),
            }
        }
    }

    /// Adds what a patch emits, times a factor.
    pub(super) fn add_emitted(
        &self,
        id: u32,
        factor: f64,
        tint: Option<&Passage>,
        out: &mut Gathered,
    ) {
        self.add(id, factor, 1.0, tint, RadiosityPart::Emitted, out);
    }

    /// Could any part of the patch be in front of the receiver, and the receiver in front of any part of the patch?
    pub(super) fn can_see(&self, to: &Receiver, node: &Node) -> bool {
        let from = node.centre - to.point;
        let reach = (0.5 * (node.high - node.low))
            .dot(to.normal.abs())
            .min(node.radius);
        if to.normal.dot(from) + reach <= 0.0 || !self.may_show(node.centre, node.radius) {
            return false;
        }
        if node.flat {
            let entry = node.faces.0 as usize;
            return self.tree.face_plane[entry] != to.plane
                && -node.normal.dot(from) + (0.5 * (node.high - node.low)).dot(node.normal.abs())
                    > 0.0;
        }
        node.may_face(-from, node.radius)
    }

    /// Factor and visible share of a far cluster by points, each with its own ray.
    fn sampled(
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
                // Random points of a far cluster: without bias, and never so near that their weights blow up.
                memory
                    .weights
                    .push(c1 * c2 / (std::f64::consts::PI * r2 * r2) * s.area);
                memory
                    .segments
                    .push(Segment::new(to.point, s.point, [to.plane, s.plane]));
            }
        }
        let factor: f64 = memory.weights.iter().sum();
        if factor <= 0.0 {
            return None;
        }
        let mut visible = 1.0;
        memory.blocked.clear();
        if !clear {
            self.sight
                .blocked(&memory.segments, &Visibility::Crowded, &mut memory.blocked);
            memory.rays += memory.segments.len() as u64;
            visible = open_weight(&memory.weights, &memory.blocked) / factor;
        }
        Some((factor, visible))
    }

    /// Visible share of a polygon patch, and whether it was clipped, so that the clipper has its parts; none yet for a lamp, or a bright patch
    /// in a cluttered room, that is left to rays, see `sources_together`. `carries` is the unblocked irradiance, share of white. Exact
    /// clipping cannot apply filters: behind panes rays decide.
    fn visible(
        &self,
        to: &Receiver,
        (id, occlusion, known): Linked,
        factor: f64,
        carries: f64,
        lamp: bool,
        memory: &mut Memory,
    ) -> Option<(f64, bool)> {
        let node = self.tree.node(id);
        let Some(element) = self.tree.element(node) else {
            return Some((1.0, false));
        };
        let plane = self.tree.face_plane[element.face as usize];
        let planes = [to.plane, plane];
        let clips = self.is_plain();
        if clips && let Occlusion::Listed { .. } = occlusion {
            let list = blockers_of(&self.light.neighbours.blockers, occlusion);
            if let Some(seen) = self.past(list, planes, to, element, factor, memory) {
                return Some(((seen / factor).min(1.0), true));
            }
        }
        // A lamp that matters is worth a look into the shaft: few blockers give an exact answer.
        if lamp && self.shafts && clips && carries > SHAFT_WORTH * self.tolerance {
            match self
                .sight
                .view_from(to.point, to.normal, &element.corners, planes)
            {
                Visibility::Clear => return Some((1.0, false)),
                Visibility::Listed(list) => {
                    if let Some(seen) = self.past(&list, planes, to, element, factor, memory) {
                        return Some(((seen / factor).min(1.0), true));
                    }
                }
                Visibility::Crowded => {}
            }
        }
        if lamp || self.hemisphere.is_some() {
            memory.sources.push(SourceElement {
                id,
                fixture: NONE,
                faces: 0,
                factor,
                carries,
            });
            return None;
        }
        let share = self.visible_by_rays(
            to,
            (id, known),
            (element, planes),
            [factor, carries],
            memory,
        );
        Some((share, false))
    }

    /// Visible share of an element of a factor by rays; `known`: what its link found.
    fn visible_by_rays(
        &self,
        to: &Receiver,
        (id, known): (u32, f32),
        (element, planes): (&Element, [u32; 2]),
        [factor, carries]: [f64; 2],
        memory: &mut Memory,
    ) -> f64 {
        // Stratified rays err by about 0.5 n^(-3/4) where a boundary crosses.
        let wanted = (0.5 * carries / self.tolerance).powf(4.0 / 3.0).ceil() as usize;
        let count = wanted.clamp(RAYS[0], RAYS[1]);
        let turn = hash(to.seed, u64::from(id));
        let normal = self.tree.node(id).normal;
        memory.segments.clear();
        memory.weights.clear();
        // Rays to points chosen evenly over the area made a furnished room's bright patches dark by .3 %: near parts weigh more and are hidden less,
        // and the share of few such rays is not without bias.
        let parts = parts_of(to, element.corners, factor);
        for k in 0..count as u32 {
            if let Some((p, weight)) = point_of(to, normal, &parts, sequence02(k, turn))
                && weight > 0.0
            {
                memory.weights.push(weight);
                memory.segments.push(Segment::new(to.point, p, planes));
            }
        }
        self.sight
            .blocked(&memory.segments, &Visibility::Crowded, &mut memory.blocked);
        memory.rays += memory.segments.len() as u64;
        let total: f64 = memory.weights.iter().sum();
        let seen = open_weight(&memory.weights, &memory.blocked);
        // Where no ray gets through, nothing does: light of other parts of the element must not leak in.
        if seen <= 0.0 {
            return 0.0;
        }
        // The link's own rays over the whole patch count as some more rays: this halves the noise, and the blur is
        // bounded by the size of the receiving element.
        let prior = if to.leaf.is_none() { 0.0 } else { PRIOR };
        (seen / total * count as f64 + prior * f64::from(known)) / (count as f64 + prior)
    }

    /// Exact factor of the part visible past the listed triangles; `whole` is the factor of the whole patch. None where there
    /// are too many pieces or a blocker has holes.
    fn past(
        &self,
        list: &[u32],
        planes: [u32; 2],
        to: &Receiver,
        element: &Element,
        whole: f64,
        memory: &mut Memory,
    ) -> Option<f64> {
        memory.clipper.begin(to.point, &element.corners);
        for blocker in self.sight.blockers(list, planes)? {
            let outline = || self.sight.mesh.outline(blocker);
            let shadow = memory.shadows.of(to.point, blocker, outline);
            if !memory.clipper.clip(shadow, PIECES) {
                return None;
            }
        }
        Some(memory.clipper.factor(to.normal, whole))
    }
}
