//! The exchange of light between two patches: `A_a F_ab = integral over a and b of V cos_a cos_b / (pi r^2)`.
//!
//! One end is sampled by points; towards the other end the point-to-polygon factor is exact (Lambert 1760) where that
//! end is a face or a few of them. Two large clusters are points on both sides. Nothing is clamped: Lambert's formula
//! lies in [0, 1] however near the polygon is.

use super::contour::exchange;
use super::visibility::{PIECES, Visibility, segment};
use super::{Link, LinkContext, Occlusion};
use crate::geometry::lanes::{Points8, lambert_x8, lanes_of};
use crate::geometry::{Clipper, Segment, Shadow, nearest_point};
use crate::hierarchy::{Node, Outline, Sample, Tree};
use glam::DVec3;
use std::f64::consts::PI;

/// Up to this many faces a cluster is a set of polygons; beyond, a set of sample points.
pub(crate) const POLYGONS: u32 = 4;
/// Points that stand for a larger cluster.
const CLUSTER_POINTS: usize = 8;
/// Beyond this gap one point is enough: 1/r^2 changes by less than 2 % over the smaller end, and evenly.
const FAR: f64 = 8.0;
/// Below this gap points would err by more than 1 %: contour integrals are used.
const NEAR: f64 = 2.5;
/// Points that look past a short list of blockers.
const POINTS: usize = 6;
/// The greatest variation that a link is given.
const MOST_VARIATION: f64 = 4.0;
/// A visible share below this is rounding.
const SLIVER: f64 = 1e-9;
/// Rays of a pair. Their number does not depend on their results: stopping when the first agree would make hidden pairs
/// too dark and open ones too bright.
const RAYS: usize = 8;

/// Reused memory of one thread, and a count of its rays.
#[derive(Debug, Default)]
pub struct Scratch {
    pub(crate) a: Vec<Sample>,
    pub(crate) b: Vec<Sample>,
    pub(crate) segments: Vec<Segment>,
    pub(crate) weights: Vec<f64>,
    pub(crate) factors: Vec<f64>,
    outlines: Vec<Outline>,
    clipper: Clipper,
    pub(crate) blocked: Vec<bool>,
    /// Rays cast.
    pub rays: u64,
}

/// Can any light pass from a front of `a` to a front of `b`, as far as planes and normal cones tell?
/// Never false for a pair that exchanges light.
pub fn facing(tree: &Tree, a: &Node, b: &Node) -> bool {
    in_front(tree, a, b) && in_front(tree, b, a)
}

/// Is any of `b` in front of any face of `a`?
fn in_front(tree: &Tree, a: &Node, b: &Node) -> bool {
    if a.flat {
        let origin = tree.elements[tree.node(tree.face_node[a.faces.0 as usize]).element as usize]
            .corners[0];
        // Points nearer than rounding count as on the plane: light to them is nil.
        let least = 1e-12 * (origin.length() + b.centre.length());
        let above = |p: DVec3| a.normal.dot(p - origin) > least;
        if b.faces.1 <= POLYGONS {
            return polygons(tree, b).any(|(corners, _)| corners.into_iter().any(above));
        }
        let reach = (0.5 * (b.high - b.low)).dot(a.normal.abs()).min(b.radius);
        return a.normal.dot(b.centre - origin) + reach > least;
    }
    a.may_face(b.centre - a.centre, a.radius + b.radius)
}

/// The faces of a node as polygons with their normals.
pub(crate) fn polygons<'a>(
    tree: &'a Tree,
    node: &Node,
) -> impl Iterator<Item = ([DVec3; 3], usize)> + use<'a> {
    let element = tree.element(node).copied();
    let (first, count) = (node.faces.0 as usize, node.faces.1 as usize);
    (first..first + count).map(move |entry| {
        let corners = element.map_or_else(
            || tree.elements[tree.node(tree.face_node[entry]).element as usize].corners,
            |e| e.corners,
        );
        (corners, entry)
    })
}

/// Is a point, on a plane of its own, in front of a face?
pub(crate) fn in_front_of(
    tree: &Tree,
    corners: &[DVec3; 3],
    entry: usize,
    point: DVec3,
    plane: u32,
) -> bool {
    tree.face_plane[entry] != plane && tree.face_normal[entry].dot(point - corners[0]) > 0.0
}

/// Unoccluded factors from points to a patch, each in [0, 1]: the share of the light leaving a small surface at the point
/// that would reach the patch. `others` holds sample points of the patch if it is a large cluster.
pub fn point_factors(
    tree: &Tree,
    points: &[Sample],
    node: &Node,
    others: &[Sample],
    out: &mut Vec<f64>,
) {
    out.clear();
    if node.faces.1 > POLYGONS {
        out.extend(points.iter().map(|s| {
            let sum: f64 = others.iter().map(|t| point_to_point(s, t) * t.area).sum();
            sum.min(1.0)
        }));
        return;
    }
    out.resize(points.len(), 0.0);
    for (points, sums) in points.chunks(8).zip(out.chunks_mut(8)) {
        let points = EightPoints::new(points);
        for (corners, entry) in polygons(tree, node) {
            points.add_factors(tree, &corners, entry, sums);
        }
    }
}

/// Up to eight points, also as lanes.
struct EightPoints<'a> {
    points: &'a [Sample],
    at: Points8,
    normals: Points8,
}

impl<'a> EightPoints<'a> {
    fn new(points: &'a [Sample]) -> Self {
        Self {
            points,
            at: lanes_of(points.iter().map(|s| s.point)),
            normals: lanes_of(points.iter().map(|s| s.normal)),
        }
    }

    /// Adds the factors to a face, except of points that are behind it or in its plane.
    fn add_factors(&self, tree: &Tree, corners: &[DVec3; 3], entry: usize, sums: &mut [f64]) {
        let sees = |s: &Sample| in_front_of(tree, corners, entry, s.point, s.plane);
        if !self.points.iter().any(sees) {
            return;
        }
        let factors = lambert_x8(&self.at, &self.normals, corners);
        for ((s, sum), f) in self.points.iter().zip(sums).zip(factors) {
            if sees(s) {
                *sum += f;
            }
        }
    }
}

/// `cos cos / max(pi r^2, area)` towards a random sample that stands for `area`: without bias at a distance, at most 1/area near
/// by.
fn point_to_point(s: &Sample, t: &Sample) -> f64 {
    let d = t.point - s.point;
    let r2 = d.length_squared();
    if r2 == 0.0 {
        return 0.0;
    }
    let (c1, c2) = (s.normal.dot(d), -t.normal.dot(d));
    if c1 <= 0.0 || c2 <= 0.0 {
        0.0
    } else {
        c1 * c2 / (r2 * (PI * r2).max(t.area))
    }
}

/// Distance of two nodes' centres in sums of their radii.
fn gap(a: &Node, b: &Node) -> f64 {
    a.centre.distance(b.centre) / (a.radius + b.radius)
}

/// Is a node a set of polygons, and not a cluster represented by points?
fn simple(node: &Node) -> bool {
    node.faces.1 <= POLYGONS
}

/// Two patches as the kernel sees them: one is sampled, and towards the other the factor is exact if it is simple.
#[derive(Debug, Clone, Copy)]
struct Ends<'a> {
    sampled: u32,
    other: u32,
    s: &'a Node,
    t: &'a Node,
    /// Distance of the centres in sums of the radii.
    gap: f64,
    shift: [f64; 2],
}

impl<'a> Ends<'a> {
    /// Samples the smaller end and takes the larger as the polygon: the factor varies less over a small patch.
    fn of(room: &'a LinkContext, a: u32, b: u32) -> Self {
        let (na, nb) = (room.tree.node(a), room.tree.node(b));
        let a_sampled = match (simple(na), simple(nb)) {
            (true, false) => false,
            (false, true) => true,
            _ => na.area <= nb.area,
        };
        let (sampled, other) = if a_sampled { (a, b) } else { (b, a) };
        let (s, t) = (room.tree.node(sampled), room.tree.node(other));
        Self {
            sampled,
            other,
            s,
            t,
            gap: gap(s, t),
            shift: pattern(room.seed, a, b),
        }
    }

    /// Points on the sampled end.
    fn points(&self) -> usize {
        match simple(self.s) {
            false if self.gap > NEAR => CLUSTER_POINTS,
            false => 2 * CLUSTER_POINTS,
            true if self.gap > FAR => 1,
            true => 3,
        }
    }

    /// Are contour integrals used in place of points?
    fn are_polygons(&self) -> bool {
        simple(self.s) && simple(self.t)
    }

    /// Unoccluded exchange, and its relative variation; none where no points face each other.
    #[inline]
    fn unoccluded(&self, tree: &Tree, scratch: &mut Scratch) -> Option<(f64, f64)> {
        let count = self.points();
        tree.samples(self.sampled, count, self.shift, &mut scratch.a);
        if simple(self.t) {
            scratch.b.clear();
        } else {
            tree.samples(self.other, CLUSTER_POINTS, self.shift, &mut scratch.b);
        }
        let (mut open, mut least, mut most) = (0.0, f64::INFINITY, 0.0_f64);
        point_factors(tree, &scratch.a, self.t, &scratch.b, &mut scratch.factors);
        for (p, &f) in scratch.a.iter().zip(&scratch.factors) {
            open += f * p.area;
            least = least.min(f);
            most = most.max(f);
        }
        let near = self.gap < NEAR;
        if self.are_polygons() && (near || open <= 0.0) {
            let found = std::mem::replace(&mut open, contours(tree, self.s, self.t));
            most = most.max(unseen(count, open - found, self.s.area));
        }
        if open <= 0.0 {
            return None;
        }
        // One point tells nothing about variation; the variation of 1/r^2 over the patch's own size does.
        let variation = if count == 1 {
            let distance = self.s.centre.distance(self.t.centre);
            2.0 * (self.s.radius / distance.max(self.s.radius + f64::MIN_POSITIVE))
        } else {
            (0.5 * (most - least) / (open / self.s.area)).min(MOST_VARIATION)
        };
        // Points of the smaller end tell nothing about a larger one that is lit only here and there: a lamp close below a
        // ceiling.
        if self.are_polygons() && near {
            let mean = open / self.t.area;
            let over = variation_over(tree, self.other, self.s, mean, self.shift, scratch);
            return Some((open, variation.max(over)));
        }
        Some((open, variation))
    }

    /// The visible share, and the view between the ends.
    #[inline]
    fn visible(
        &self,
        room: &LinkContext,
        parents: &Visibility,
        scratch: &mut Scratch,
    ) -> (f64, Visibility) {
        let (sight, tree, shift) = (room.sight, room.tree, self.shift);
        let (s, t) = (self.sampled, self.other);
        let view = || sight.view(tree, self.s, self.t, parents);
        // In cluttered rooms a look into the shaft costs as much as many rays. It is worth while where it starts from a
        // list, or where rays suggest that it may come out clear.
        let (view, rays) = if *parents == Visibility::Crowded && !sight.small() && sight.occlusion {
            let rays = sampled_visibility(room, s, t, shift, &Visibility::Crowded, scratch);
            let view = if rays == 1.0 {
                view()
            } else {
                Visibility::Crowded
            };
            (view, Some(rays))
        } else {
            (view(), None)
        };
        let share = match (&view, rays) {
            (Visibility::Clear, _) => 1.0,
            // Where a plane cuts one end, perhaps none of its points lies in front of the other end; then the other end
            // is sampled.
            (Visibility::Listed(list), _) if simple(self.t) => {
                clipped_visibility(room, s, t, shift, list, scratch)
                    .or_else(|| {
                        if simple(self.s) {
                            clipped_visibility(room, t, s, shift, list, scratch)
                        } else {
                            None
                        }
                    })
                    .unwrap_or_else(|| sampled_visibility(room, s, t, shift, &view, scratch))
            }
            (_, Some(rays)) => rays,
            _ => sampled_visibility(room, s, t, shift, &view, scratch),
        };
        (share, view)
    }
}

/// What two patches may exchange without any of the points that represent a cluster noticing: all that a part can exchange whose size is
/// one point's share. With a lower figure for two interleaved sets of sheets, a link that found next to nothing between them was good
/// enough, and the gap between a lamp and its ceiling had no light but the lamp's own.
pub(super) fn unmet(a: &Node, b: &Node) -> f64 {
    if simple(a) && simple(b) {
        return 0.0;
    }
    // Neither sends more to the other than falls into the cone around it.
    let distance = a.centre.distance(b.centre);
    let most = |from: &Node, to: &Node| {
        let sine = to.radius / (distance - from.radius).max(to.radius);
        from.area * (sine * sine)
    };
    most(a, b).min(most(b, a)) / (2 * CLUSTER_POINTS) as f64
}

/// Works out the link between two patches and the view between them; none if they exchange nothing. `parents` is the
/// view of a pair that contains this one.
pub fn evaluate(
    room: &LinkContext,
    a: u32,
    b: u32,
    parents: &Visibility,
    scratch: &mut Scratch,
) -> Option<(Link, Visibility)> {
    let ends = Ends::of(room, a, b);
    let Some((open, variation)) = ends.unoccluded(room.tree, scratch) else {
        if ends.are_polygons() {
            return None;
        }
        // No two sample points of these clusters face each other; other points may.
        let link = Link {
            a,
            b,
            exchange: 0.0,
            open_exchange: 0.0,
            variation: 0.0,
            occlusion: Occlusion::Crowded,
        };
        return Some((link, Visibility::Crowded));
    };
    let (visible, view) = ends.visible(room, parents, scratch);
    let link = Link {
        a,
        b,
        exchange: (open * visible) as f32,
        open_exchange: open as f32,
        variation: variation as f32,
        occlusion: if view == Visibility::Clear {
            Occlusion::Clear
        } else {
            Occlusion::Crowded
        },
    };
    Some((link, view))
}

/// Relative variation over node `on` of the factor towards node `to`, of known mean, both of a few faces: from the point
/// nearest to the other end and from points chosen independently of it.
fn variation_over(
    tree: &Tree,
    on: u32,
    to: &Node,
    mean: f64,
    shift: [f64; 2],
    scratch: &mut Scratch,
) -> f64 {
    const COUNT: usize = 3;
    let samples = &mut scratch.b;
    tree.samples(on, COUNT, shift, samples);
    let nearest = polygons(tree, tree.node(on))
        .map(|(corners, entry)| (nearest_point(&corners, to.centre), entry))
        .min_by(|(p, _), (q, _)| {
            let distance = |x: &DVec3| x.distance_squared(to.centre);
            distance(p).total_cmp(&distance(q))
        });
    samples.extend(nearest.map(|(point, entry)| Sample {
        point,
        normal: tree.face_normal[entry],
        plane: tree.face_plane[entry],
        area: 0.0,
    }));
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    point_factors(tree, samples, to, &[], &mut scratch.factors);
    for &f in &scratch.factors {
        least = least.min(f);
        most = most.max(f);
    }
    let found = scratch.factors[..COUNT].iter().sum::<f64>() / COUNT as f64;
    most = most.max(unseen(COUNT, mean - found, 1.0));
    (0.5 * (most - least) / mean).min(MOST_VARIATION)
}

/// How bright a part must be that all `count` points of a patch missed, if it holds the light that they are short of: a larger part would
/// have been met by more of them. Without this the gap between a lamp and a ceiling had no light but the lamp's own.
fn unseen(count: usize, missing: f64, area: f64) -> f64 {
    count as f64 * missing / area
}

/// Unoccluded exchange of two small sets of faces.
fn contours(tree: &Tree, a: &Node, b: &Node) -> f64 {
    let mut sum = 0.0;
    for (one, i) in polygons(tree, a) {
        for (two, k) in polygons(tree, b) {
            if tree.face_plane[i] != tree.face_plane[k] {
                sum += exchange(&one, &two);
            }
        }
    }
    sum
}

/// Visible share by points on one end, each of which sees exactly the unblocked part of the polygons of the other. None
/// if that takes too many pieces, or if no point is in front of the other end.
fn clipped_visibility(
    room: &LinkContext,
    s: u32,
    t: u32,
    shift: [f64; 2],
    list: &[u32],
    scratch: &mut Scratch,
) -> Option<f64> {
    let tree = room.tree;
    tree.samples(s, POINTS, shift, &mut scratch.a);
    let points = EightPoints::new(&scratch.a);
    let (mut seen, mut total) = (0.0, 0.0);
    for (corners, entry) in polygons(tree, tree.node(t)) {
        let mut open = [0.0; POINTS];
        points.add_factors(tree, &corners, entry, &mut open);
        let plane = tree.face_plane[entry];
        let mut known = None;
        for (p, &open) in scratch.a.iter().zip(&open) {
            if open <= 0.0 {
                continue;
            }
            if known.replace(p.plane) != Some(p.plane) {
                let blockers = room.sight.blockers(list, [p.plane, plane])?;
                scratch.outlines.clear();
                scratch
                    .outlines
                    .extend(blockers.map(|b| room.sight.mesh.outline(b)));
            }
            scratch.clipper.begin(p.point, &corners);
            for outline in &scratch.outlines {
                let shadow = Shadow::new(p.point, outline.as_ref());
                if !scratch.clipper.clip(&shadow, PIECES) {
                    return None;
                }
            }
            total += open;
            seen += scratch.clipper.factor(p.normal, open);
        }
    }
    // Rounding leaves slivers of polygons seen edge-on: hidden patches must be exactly dark.
    let share = if seen < SLIVER * total {
        0.0
    } else {
        seen / total
    };
    (total > 0.0).then(|| share.min(1.0))
}

/// Visible share by rays between points of both ends, each weighted by the light it would carry.
fn sampled_visibility(
    room: &LinkContext,
    s: u32,
    t: u32,
    shift: [f64; 2],
    view: &Visibility,
    scratch: &mut Scratch,
) -> f64 {
    let (u, v) = (
        shift,
        [shift[1], (shift[0] + 0.618_033_988_749_894_9).fract()],
    );
    room.tree.samples(s, RAYS, u, &mut scratch.a);
    room.tree.samples(t, RAYS, v, &mut scratch.b);
    scratch.segments.clear();
    scratch.weights.clear();
    for (k, p) in scratch.a.iter().enumerate() {
        // Pair the points of both patterns crosswise, so that neighbours on one end are not neighbours on the other.
        let q = &scratch.b[(k * 5 + 3) % RAYS];
        let weight = point_to_point(p, q);
        if weight > 0.0 {
            scratch.segments.push(segment(p, q));
            scratch.weights.push(weight);
        }
    }
    room.sight
        .blocked(&scratch.segments, view, &mut scratch.blocked);
    scratch.rays += scratch.segments.len() as u64;
    let total: f64 = scratch.weights.iter().sum();
    let seen = open_weight(&scratch.weights, &scratch.blocked);
    // No ray runs from front to front: the pair meets at the horizon and exchanges next to nothing. Taking it as open
    // would let light through walls.
    if total > 0.0 { seen / total } else { 0.0 }
}

/// Sum of the weights of unblocked rays.
pub(crate) fn open_weight(weights: &[f64], blocked: &[bool]) -> f64 {
    let pairs = weights.iter().zip(blocked);
    pairs
        .filter(|(_, blocked)| !**blocked)
        .map(|(w, _)| w)
        .sum()
}

/// A pair of numbers in [0, 1) that depends on the pair only.
pub(crate) fn pattern(seed: u64, a: u32, b: u32) -> [f64; 2] {
    let mut x = seed ^ (u64::from(a) << 32 | u64::from(b));
    // The finaliser of splitmix64 (Steele, Lea and Flood 2014).
    let mut next = || {
        x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = x;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) >> 11
    };
    [next() as f64, next() as f64].map(|v| v / (1_u64 << 53) as f64)
}
