//! What stands in the way of paths, and what panes leave of them.

use super::path::Audit;
use crate::geometry::{Hit, Segment};
use crate::hierarchy::{Glazing, alpha};
use crate::spectrum::Spectrum;
use glam::DVec3;

impl Audit<'_> {
    /// Takes from light what panes between two points keep of it, band by band.
    pub(super) fn filter(&self, light: &mut Spectrum, from: DVec3, to: DVec3) {
        let Some(panes) = &self.panes else { return };
        let scene = self.scene;
        let glazing = Glazing { panes, scene };
        for crossing in glazing.crossings(from.as_vec3(), to.as_vec3()) {
            let Some(pane) = &scene.materials[crossing.material as usize].pane else {
                continue;
            };
            let [cosine, thickness, texel] =
                [crossing.cosine, crossing.thickness, crossing.texel].map(f64::from);
            let passing = pane.passing(cosine, thickness, texel);
            for (x, spectrum) in light.iter_mut().zip(pane.spectrum()) {
                *x *= passing(*spectrum);
            }
        }
    }

    pub(super) fn closest(&self, from: DVec3, direction: DVec3, plane: u32) -> Option<Hit> {
        let reach = (4.0 * self.mesh.reach) as f32;
        if self.masked {
            let opaque = |t: u32, u: f32, v: f32| {
                !alpha::is_hole(self.scene, self.mesh, t, [1.0 - u - v, u, v])
            };
            return self.rays.closest_with(
                from.as_vec3(),
                direction.as_vec3(),
                reach,
                plane,
                &opaque,
            );
        }
        self.rays
            .closest(from.as_vec3(), direction.as_vec3(), reach, plane)
    }

    pub(super) fn blocked(&self, segment: &Segment) -> bool {
        if self.masked {
            let opaque = |t: u32, u: f32, v: f32| {
                !alpha::is_hole(self.scene, self.mesh, t, [1.0 - u - v, u, v])
            };
            return self.rays.occluded_with(segment, &opaque);
        }
        self.rays.occluded(segment)
    }
}
