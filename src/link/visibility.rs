//! Is the way between two patches clear? Exactly where the shaft between them is empty, by rays elsewhere.

use crate::geometry::{Patch, RayIndex, Segment, Shaft, ShaftContents};
use crate::hierarchy::{Node, Sample, Tree};

/// More blockers than this in a shaft are not listed: rays then ask the whole index.
const LISTED: usize = 32;

/// Tells whether a point of a masked triangle is solid: triangle, then barycentrics of its second and third corner.
pub type Opaque<'a> = dyn Fn(u32, f32, f32) -> bool + Sync + 'a;

/// What can block light.
pub struct Sight<'a> {
    /// All triangles.
    pub rays: &'a RayIndex,
    /// Holes of alpha-masked triangles; none where the room has none.
    pub opaque: Option<&'a Opaque<'a>>,
    /// False where nothing can block (a convex room): then no ray is cast and no shaft is built.
    pub occlusion: bool,
}

/// What is known of the way between two patches.
#[derive(Debug, Clone, PartialEq)]
pub enum View {
    /// Nothing blocks.
    Clear,
    /// Only these triangles can.
    Listed(Vec<u32>),
    /// Too many to list.
    Crowded,
}

impl Sight<'_> {
    /// Looks into the shaft between two patches. `parents` is what is known of a pair that holds this one.
    pub fn view(&self, tree: &Tree, a: &Node, b: &Node, parents: &View) -> View {
        let candidates = match parents {
            View::Clear => return View::Clear,
            View::Listed(list) => Some(list.as_slice()),
            View::Crowded => None,
        };
        if !self.occlusion {
            return View::Clear;
        }
        let shaft = Shaft::between(&patch(tree, a), &patch(tree, b));
        match self.rays.blockers(&shaft, candidates, LISTED) {
            ShaftContents::None => View::Clear,
            ShaftContents::Some(list) => View::Listed(list.to_vec()),
            ShaftContents::Many => View::Crowded,
        }
    }

    /// For each segment: is it blocked?
    pub fn blocked(&self, segments: &[Segment], view: &View, out: &mut Vec<bool>) {
        out.clear();
        match (view, self.opaque) {
            (View::Clear, _) => out.resize(segments.len(), false),
            (_, Some(opaque)) => out.extend(segments.iter().map(|s| self.rays.occluded_with(s, &opaque))),
            (View::Listed(list), None) => self.rays.occluded_by(list, segments, out),
            (View::Crowded, None) => self.rays.occluded_many(segments, out),
        }
    }
}

/// The segment between two sample points.
pub(super) fn segment(s: &Sample, t: &Sample) -> Segment {
    Segment { from: s.point.as_vec3(), to: t.point.as_vec3(), planes: [s.plane, t.plane] }
}

/// A node as the end of a shaft.
fn patch(tree: &Tree, node: &Node) -> Patch {
    match tree.element(node) {
        Some(e) => Patch::triangle(e.corners, tree.face_normal[e.face as usize], tree.face_plane[e.face as usize]),
        None if node.flat => {
            Patch::flat_box(node.low, node.high, node.normal, tree.face_plane[node.faces.0 as usize])
        }
        None => Patch::bounds(node.low, node.high),
    }
}
