//! Which triangles of a side of a surface may share a chart: those over whose common edges light runs on.
//!
//! Light runs on within a plane, and where both triangles have the same shading normals along their edge. It does not between
//! faces of different spaces (the floors of two rooms), nor between a face that something covers and one that is bare.

use crate::hierarchy::{Mesh, NONE, Tree};
use crate::scene::Surface;
use crate::scene::sets::{join, root};
use glam::DVec3;
use std::collections::{BTreeMap, HashMap};

/// Normals closer than this in each component are one.
const SAME_NORMAL: f32 = 1e-4;
/// Cosine of the angle over which nothing is smooth, whatever its shading normals say: 60 degrees.
const SMOOTH: f64 = 0.5;

/// Triangles of the mesh that may share a chart.
#[derive(Debug)]
pub(super) struct Region {
    pub(super) triangles: Vec<u32>,
    /// Do all lie in one plane?
    pub(super) flat: bool,
}

/// What regions are made from.
pub(super) struct RegionInput<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) tree: &'a Tree,
    /// Space of each entry of the hierarchy, and whether something covers it.
    pub(super) spaces: &'a [(u32, bool)],
    pub(super) surface: &'a Surface,
    /// Number of the surface.
    pub(super) number: usize,
    pub(super) back: bool,
}

impl RegionInput<'_> {
    /// Entry in the hierarchy.
    pub(super) fn entry(&self, triangle: u32) -> u32 {
        self.tree.entry[triangle as usize][usize::from(self.back)]
    }

    fn space(&self, triangle: u32) -> (u32, bool) {
        let entry = self.entry(triangle);
        // A face that takes no part is in no space.
        match entry {
            NONE => (NONE, true),
            entry => self.spaces.get(entry as usize).copied().unwrap_or_default(),
        }
    }

    /// Shading normal of a corner of a triangle; none: the surface has no normals, or the corner is a cut's.
    fn normal(&self, triangle: u32, point: u32) -> Option<DVec3> {
        let corners = self.mesh.triangles[triangle as usize];
        let k = corners.iter().position(|&p| p == point)?;
        let normals = self.surface.normals.as_ref()?;
        let corner = self.mesh.input_corner(triangle as usize, k)?;
        let (_, local) = self.mesh.origin[triangle as usize];
        let vertex = self.surface.triangles[local as usize][corner];
        Some(normals.get(vertex as usize)?.as_dvec3())
    }

    /// Does light run on over an edge?
    fn runs_on(&self, a: u32, b: u32, edge: [u32; 2]) -> bool {
        let mesh = self.mesh;
        let cosine = mesh.normal[a as usize].dot(mesh.normal[b as usize]);
        if self.space(a) != self.space(b) || cosine <= 0.0 {
            return false;
        }
        let alike = |point| match (self.normal(a, point), self.normal(b, point)) {
            (Some(m), Some(n)) => (m - n).abs().max_element() <= f64::from(SAME_NORMAL),
            _ => self.surface.normals.is_none(),
        };
        let flat = mesh.plane[a as usize] == mesh.plane[b as usize];
        let smooth = self.surface.normals.is_some() && cosine > SMOOTH;
        // Parts of one triangle are always alike, wherever it was cut.
        flat && mesh.origin[a as usize] == mesh.origin[b as usize]
            || (flat || smooth) && edge.into_iter().all(alike)
    }

    /// The regions of this side; triangles without area are left out.
    pub(super) fn regions(&self) -> Vec<Region> {
        let all = self.mesh.first_triangle[self.number]..self.mesh.first_triangle[self.number + 1];
        let first = all.start;
        let mut above: Vec<u32> = (0..all.len() as u32).collect();
        let mut along: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
        let real = |t: &u32| self.mesh.area[*t as usize] > 0.0;
        for t in all.clone().filter(real) {
            let [a, b, c] = self.mesh.triangles[t as usize];
            for edge in [[a, b], [b, c], [c, a]] {
                let edge = [edge[0].min(edge[1]), edge[0].max(edge[1])];
                let others = along.entry(edge).or_default();
                for &other in others.iter() {
                    if self.runs_on(t, other, edge) {
                        join(&mut above, t - first, other - first);
                    }
                }
                others.push(t);
            }
        }
        let mut regions: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for t in all.filter(real) {
            regions
                .entry(root(&mut above, t - first))
                .or_default()
                .push(t);
        }
        let region = |triangles: Vec<u32>| {
            let plane = |t: &u32| self.mesh.plane[*t as usize];
            let flat = triangles.iter().all(|t| plane(t) == plane(&triangles[0]));
            Region { triangles, flat }
        };
        regions.into_values().map(region).collect()
    }

    /// The parts of a region that lie in one plane each, connected or not.
    pub(super) fn planes(&self, region: &Region) -> Vec<Region> {
        let mut planes: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &t in &region.triangles {
            planes
                .entry(self.mesh.plane[t as usize])
                .or_default()
                .push(t);
        }
        let flat = |triangles| Region {
            triangles,
            flat: true,
        };
        planes.into_values().map(flat).collect()
    }
}
