//! What blocks light between two points of the reference, and what panes on its way let through.

use super::patch::{Patch, PatchPoint, add};
use crate::geometry::{NO_PLANE, RayIndex, Segment, lambert_polygon};
use crate::hierarchy::{Glazing, Mesh, Panes, stratified};
use crate::scene::Scene;
use crate::scene::effects::{EffectKind, Plan};
use crate::spectrum::{BANDS, Spectrum};
use glam::DVec3;

/// What blocks and filters light between two points of a room.
pub(super) struct ReferenceVisibility<'a> {
    scene: &'a Scene,
    rays: RayIndex,
    /// False: nothing can block.
    blocks: bool,
    panes: Option<Panes>,
    /// Rays between a point and a polygon.
    count: usize,
}

impl<'a> ReferenceVisibility<'a> {
    pub(super) fn new(scene: &'a Scene, mesh: &Mesh, count: usize) -> Self {
        let positions: Vec<glam::Vec3> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
        let solid = vec![false; mesh.triangles.len()];
        Self {
            scene,
            rays: RayIndex::build(&positions, &mesh.triangles, &mesh.plane, &solid),
            // The walls of a convex room do not block each other, but they block the sky.
            blocks: Plan::of(scene).runs(EffectKind::Occlusion) || scene.sky.is_some(),
            panes: Panes::new(scene, mesh.centre),
            count,
        }
    }

    /// Form factor from a point to the visible part of a patch, and the transmittance of panes on the way; none: 1.
    pub(super) fn factor(&self, from: PatchPoint, to: &Patch) -> (f64, Option<Spectrum>) {
        let PatchPoint {
            at: point,
            normal,
            plane,
        } = from;
        if plane == to.plane || to.normal.dot(point - to.corners[0]) <= 0.0 {
            return (0.0, None);
        }
        let open = lambert_polygon(point, normal, &to.corners);
        if open <= 0.0 || !self.blocks {
            return (open, None);
        }
        let (mut seen, mut total) = (0.0, 0.0);
        let mut passed = self.panes.as_ref().map(|_| [0.0; BANDS]);
        for k in 0..self.count {
            let w = stratified(k, self.count, [0.5, 0.5]);
            let q = to.corners[0] * w[0] + to.corners[1] * w[1] + to.corners[2] * w[2];
            let d = q - point;
            let (c1, c2, r2) = (normal.dot(d), -to.normal.dot(d), d.length_squared());
            if c1 <= 0.0 || c2 <= 0.0 {
                continue;
            }
            let weight = c1 * c2 / (r2 * r2);
            total += weight;
            if !self.blocked(point, q, [plane, to.plane]) {
                seen += weight;
                if let Some(passed) = &mut passed {
                    add(passed, &self.passes(point, q), weight);
                }
            }
        }
        if total <= 0.0 {
            return (open, None);
        }
        let passed = passed.filter(|_| seen > 0.0);
        (open * seen / total, passed.map(|row| row.map(|x| x / seen)))
    }

    /// Adds `amount` of light from `end` to a point, less what panes absorb, unless something blocks it. Nothing in the point's plane does.
    pub(super) fn bring(&self, sum: &mut Spectrum, amount: f64, to: PatchPoint, end: DVec3) {
        if !self.blocked(to.at, end, [to.plane, NO_PLANE]) {
            match self.panes {
                Some(_) => add(sum, &self.passes(to.at, end), amount),
                None => sum.iter_mut().for_each(|s| *s += amount),
            }
        }
    }

    fn blocked(&self, from: DVec3, to: DVec3, planes: [u32; 2]) -> bool {
        self.blocks && self.rays.occluded(&Segment::new(from, to, planes))
    }

    /// Transmittance of the panes between two points.
    fn passes(&self, from: DVec3, to: DVec3) -> Spectrum {
        let mut left = [1.0; BANDS];
        let Some(panes) = &self.panes else {
            return left;
        };
        let glazing = Glazing {
            panes,
            scene: self.scene,
        };
        for crossing in glazing.crossings(from.as_vec3(), to.as_vec3()) {
            let material = &self.scene.materials[crossing.material as usize];
            if let Some(pane) = &material.pane {
                let [cosine, thickness, texel] =
                    [crossing.cosine, crossing.thickness, crossing.texel].map(f64::from);
                let passing = pane.passing(cosine, thickness, texel);
                for (x, inside) in left.iter_mut().zip(pane.spectrum()) {
                    *x *= passing(*inside);
                }
            }
        }
        left
    }
}
