//! What paths bring from sky and ground: where they leave the room, and straight from bright spots of a map, weighted against each other
//! by the balance heuristic (Veach and Guibas 1995).

use super::path::{Audit, Vertex};
use crate::geometry::{NO_PLANE, Segment};
use crate::scene::sky::Sky;
use crate::spectrum::{LEAVES, Leaves};
use glam::DVec3;
use std::f64::consts::PI;

impl Audit<'_> {
    /// What a path that leaves the room brings from there, in a direction chosen by the cosine, or turned by so many mirrors: these are
    /// not looked for otherwise.
    pub(super) fn outside(
        &self,
        at: &Vertex,
        (direction, mirrors): (DVec3, usize),
        throughput: &Leaves,
        sum: &mut Leaves,
    ) {
        let Some(sky) = &self.scene.sky else { return };
        if mirrors > 0 {
            self.far(sky, direction, PI, throughput, sum);
            return;
        }
        let cosine = at.normal.dot(direction).max(0.0);
        if cosine > 0.0 {
            let density = cosine / PI + sky.spot_density(direction);
            self.far(sky, direction, cosine / density, throughput, sum);
        }
    }

    /// Light straight from a bright spot of a map.
    pub(super) fn spot(
        &self,
        at: &Vertex,
        square: [f64; 2],
        throughput: &Leaves,
        sum: &mut Leaves,
    ) {
        let Some((sky, direction)) = self
            .scene
            .sky
            .as_ref()
            .and_then(|s| Some((s, s.spot(square)?)))
        else {
            return;
        };
        let cosine = at.normal.dot(direction);
        let end = at.point + direction * (4.0 * self.mesh.half_size);
        let way = Segment::new(at.point, end, [at.plane, NO_PLANE]);
        if cosine <= 0.0 || self.blocked(&way) {
            return;
        }
        let density = cosine / PI + sky.spot_density(direction);
        let throughput = self.filtered(throughput, at.point, end);
        self.far(sky, direction, cosine / density, &throughput, sum);
    }

    /// Adds a weight times what comes from a direction outside.
    fn far(&self, sky: &Sky, direction: DVec3, weight: f64, throughput: &Leaves, sum: &mut Leaves) {
        // Not by the parts that the bake knows: what these leave out is an error, too.
        if let Some(radiance) = sky.exact(direction) {
            for l in 0..LEAVES {
                sum[l] += throughput[l] * weight * radiance[l];
            }
            return;
        }
        for light in &self.scene.lights {
            let Some(radiance) = sky.part(light.kind.place(), direction) else {
                continue;
            };
            let power = &self.scene.spectra[light.light].power;
            for l in 0..LEAVES {
                sum[l] += throughput[l] * weight * radiance * power[l] * light.shape[l];
            }
        }
    }
}
