//! Is the way between two patches clear? Exact where the shaft between them is empty, by rays elsewhere.

use crate::geometry::{Hit, RayIndex, Segment, Shaft, ShaftContents, ShaftEnd};
use crate::hierarchy::{Blocker, Glazing, Mesh, Mirrors, Node, Sample, Tree};
use glam::{DVec3, Vec3};

/// More blockers than this in a shaft are not listed: rays then ask the whole index.
const LISTED: usize = 24;
/// A room of at most this many triangles is small: a shaft costs no more than a handful of rays.
const SMALL: usize = 256;
/// Pieces into which blockers may cut a polygon before rays take over.
pub(crate) const PIECES: usize = 48;

/// Tells whether a point of a masked triangle is solid: triangle, then barycentrics of its second and third corner.
pub type Opaque<'a> = dyn Fn(u32, f32, f32) -> bool + Sync + 'a;

/// What can block light.
pub struct Sight<'a> {
    /// All triangles.
    pub rays: &'a RayIndex,
    /// Holes of alpha-masked triangles; none where the room has none.
    pub opaque: Option<&'a Opaque<'a>>,
    /// Where the triangles are.
    pub mesh: &'a Mesh,
    /// The panes, through which light passes; none where the room has none.
    pub panes: Option<Glazing<'a>>,
    /// The mirrors, which send light on in one direction; none where the room has none. They also block.
    pub mirrors: Option<&'a Mirrors>,
    /// False where nothing can block (a convex room): then no ray is cast and no shaft is built.
    pub occlusion: bool,
}

/// What is known of the way between two patches.
#[derive(Debug, Clone, PartialEq)]
pub enum Visibility {
    /// Nothing blocks.
    Clear,
    /// Only these triangles can.
    Listed(Vec<u32>),
    /// Too many to list.
    Crowded,
}

/// Has a room so few triangles that links with exact clipping serve it best?
pub(crate) fn is_small(mesh: &Mesh) -> bool {
    mesh.triangles.len() <= SMALL
}

impl Sight<'_> {
    /// Are there so few triangles that a look into any shaft is cheap?
    pub fn small(&self) -> bool {
        is_small(self.mesh)
    }

    /// Looks into the shaft between two patches. `parents` is the view of a pair that contains this one.
    pub fn view(&self, tree: &Tree, a: &Node, b: &Node, parents: &Visibility) -> Visibility {
        let candidates = match parents {
            Visibility::Clear => return Visibility::Clear,
            Visibility::Listed(list) => Some(list.as_slice()),
            Visibility::Crowded => None,
        };
        if !self.occlusion {
            return Visibility::Clear;
        }
        let shaft = Shaft::between(&patch(tree, a), &patch(tree, b));
        match self.rays.blockers(&shaft, candidates, LISTED) {
            ShaftContents::Clear => Visibility::Clear,
            ShaftContents::Few(list) => Visibility::Listed(list),
            ShaftContents::Many => Visibility::Crowded,
        }
    }

    /// Those of the listed triangles that can block between faces of two planes: triangles in these planes cannot. None
    /// where some triangles have holes.
    pub fn blockers(
        &self,
        list: &[u32],
        planes: [u32; 2],
    ) -> Option<impl Iterator<Item = Blocker>> {
        let plane = |b: &Blocker| self.mesh.plane[b.triangle as usize];
        let blockers = self.mesh.blockers(list);
        (self.opaque.is_none()).then(|| blockers.filter(move |b| !planes.contains(&plane(b))))
    }

    /// What may block between a point and a polygon.
    pub fn view_from(
        &self,
        at: DVec3,
        normal: DVec3,
        polygon: &[DVec3; 3],
        planes: [u32; 2],
    ) -> Visibility {
        let point = ShaftEnd::Point {
            at,
            normal,
            plane: planes[0],
        };
        let shaft = Shaft::between(
            &point,
            &ShaftEnd::Triangle {
                corners: *polygon,
                plane: planes[1],
            },
        );
        match self.rays.blockers(&shaft, None, LISTED) {
            ShaftContents::Clear => Visibility::Clear,
            ShaftContents::Few(list) => Visibility::Listed(list),
            ShaftContents::Many => Visibility::Crowded,
        }
    }

    /// What up to sixteen rays meet first; triangles of `plane` are ignored.
    pub fn meet(&self, from: &[Vec3], directions: &[Vec3], plane: u32, out: &mut [Option<Hit>]) {
        match self.opaque {
            Some(opaque) => self
                .rays
                .closest_many_with(from, directions, plane, out, &opaque),
            None => self
                .rays
                .closest_many_with(from, directions, plane, out, &|_, _, _| true),
        }
    }

    /// What one ray meets first; triangles of `plane` are ignored.
    pub fn meet_one(&self, from: Vec3, direction: Vec3, plane: u32) -> Option<Hit> {
        match self.opaque {
            Some(opaque) => self
                .rays
                .closest_with(from, direction, f32::MAX, plane, &opaque),
            None => self.rays.closest(from, direction, f32::MAX, plane),
        }
    }

    /// Is one segment blocked?
    pub fn blocks_one(&self, segment: &Segment) -> bool {
        self.occlusion
            && match self.opaque {
                Some(opaque) => self.rays.occluded_with(segment, &opaque),
                None => self.rays.occluded(segment),
            }
    }

    /// For each segment: is it blocked?
    pub fn blocked(&self, segments: &[Segment], view: &Visibility, out: &mut Vec<bool>) {
        out.clear();
        out.resize(segments.len(), false);
        match (view, self.opaque) {
            (Visibility::Clear, _) => {}
            (Visibility::Listed(list), Some(opaque)) => {
                self.rays.occluded_by(list, segments, out, &opaque)
            }
            (Visibility::Listed(list), None) => {
                self.rays.occluded_by(list, segments, out, &|_, _, _| true)
            }
            (Visibility::Crowded, Some(opaque)) => {
                self.rays.occluded_many_with(segments, out, &opaque)
            }
            (Visibility::Crowded, None) => self.rays.occluded_many(segments, out),
        }
    }
}

/// The segment between two sample points.
pub(super) fn segment(s: &Sample, t: &Sample) -> Segment {
    Segment::new(s.point, t.point, [s.plane, t.plane])
}

/// A node as the end of a shaft.
fn patch(tree: &Tree, node: &Node) -> ShaftEnd {
    match tree.element(node) {
        Some(e) => ShaftEnd::Triangle {
            corners: e.corners,
            plane: tree.face_plane[e.face as usize],
        },
        None => ShaftEnd::Box {
            low: node.low,
            high: node.high,
        },
    }
}
