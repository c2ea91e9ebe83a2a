//! Paths by way of mirrors: each goes on in one direction until it meets something else, however often; lights without extent, which no
//! path meets, are looked for in their images.

use super::path::{Audit, ByImage, PathVertex, survives};
use crate::geometry::sampling::Pcg;
use crate::geometry::{Hit, NO_PLANE, Segment};
use crate::hierarchy::Route;
use crate::scene::mirror::Mirror;
use crate::spectrum::Spectrum;
use glam::DVec3;

/// Mirrors after which roulette decides.
const SURE: usize = 8;

impl Audit<'_> {
    /// What a ray meets at last, and how often mirrors sent it on.
    pub(super) fn met(
        &self,
        at: &PathVertex,
        direction: &mut DVec3,
        throughput: &mut Spectrum,
        rng: &mut Pcg,
    ) -> (Option<Hit>, usize) {
        let (mut from, mut plane) = (at.point, at.plane);
        for count in 0.. {
            let hit = self.closest(from, *direction, plane);
            let reach = hit.map_or(4.0 * self.mesh.reach, |hit| f64::from(hit.t));
            self.filter(throughput, from, from + *direction * reach);
            let mirror = hit.filter(|hit| self.mirrors.as_ref().is_some_and(|m| m.is_mirror(hit)));
            let Some(on) = mirror else {
                return (hit, count);
            };
            let triangle = on.triangle as usize;
            let along = self.mesh.normal[triangle].dot(*direction);
            self.reflected(self.mesh.material[triangle], along.abs(), throughput);
            if count >= SURE && !survives(throughput, rng) {
                *throughput = [0.0; crate::spectrum::BANDS];
                return (None, count);
            }
            let [v, w] = on.uv.map(f64::from);
            from = self.mesh.at(triangle, [1.0 - v - w, v, w]);
            plane = self.mesh.plane[triangle];
            let turned = *direction - 2.0 * along * self.mesh.normal[triangle];
            *direction = turned.normalize_or_zero();
        }
        (None, 0)
    }

    fn reflected(&self, material: u32, cosine: f64, throughput: &mut Spectrum) {
        if let Some(mirror) = &self.scene.materials[material as usize].mirror {
            for (t, normal) in throughput.iter_mut().zip(&mirror.reflectance) {
                *t *= Mirror::reflects(*normal, cosine);
            }
        }
    }

    /// Lights without extent, seen in each image.
    pub(super) fn punctual_in_mirrors(
        &self,
        at: &PathVertex,
        square: [f64; 2],
        rng: &mut Pcg,
        throughput: &Spectrum,
        sum: &mut Spectrum,
    ) {
        let Some(mirrors) = &self.mirrors else { return };
        for image in mirrors.seen_from(at.point, at.normal) {
            let known = &mirrors.images()[image as usize];
            let from = PathVertex {
                point: known.point(at.point),
                normal: known.direction(at.normal),
                plane: NO_PLANE,
            };
            let by = ByImage {
                image,
                at,
                size: (1 + known.depth()) as f64,
            };
            self.punctual(&from, Some(by), square, rng, throughput, sum);
        }
    }

    /// What is left of light on a segment, straight or by an image; none where something blocks it.
    pub(super) fn arriving(
        &self,
        by: Option<ByImage>,
        segment: &Segment,
        throughput: &Spectrum,
    ) -> Option<Spectrum> {
        let (from, to) = (segment.from.as_dvec3(), segment.to.as_dvec3());
        let mut left = *throughput;
        let Some(by) = by else {
            let open = !self.blocked(segment);
            return open.then(|| {
                self.filter(&mut left, from, to);
                left
            });
        };
        let mirrors = self.mirrors.as_ref()?;
        let route: Route = mirrors.route(by.image, by.at.point, to)?;
        let mut plane = by.at.plane;
        let points = route.points();
        for (k, ends) in points.windows(2).enumerate() {
            self.filter(&mut left, ends[0], ends[1]);
            let Some(&(material, cosine)) = route.bounces().get(k) else {
                let last = Segment::new(ends[0], ends[1], [plane, segment.planes[1]]);
                return (!self.blocked(&last)).then_some(left);
            };
            let way = (ends[1] - ends[0]).normalize_or_zero();
            let hit = self.closest(ends[0], way, plane)?;
            if !mirrors.is_next(by.image, k, &hit) {
                return None;
            }
            plane = self.mesh.plane[hit.triangle as usize];
            self.reflected(material, f64::from(cosine), &mut left);
        }
        None
    }
}
