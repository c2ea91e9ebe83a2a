//! Rays that mirrors send on.

use super::visibility::Sight;
use crate::geometry::{Hit, Segment};
use crate::hierarchy::{BOUNCES, Route};
use glam::{DVec3, Vec3};

/// The path of a ray that mirrors sent on.
#[derive(Debug, Clone, Copy)]
pub struct Mirrored {
    /// The mirrors on the path, its start and its end.
    pub route: Route,
    /// What the ray met at last, at its distance along the path; a mirror only if there were too many. None: it left the room.
    pub hit: Option<Hit>,
    /// Unit direction after the last mirror.
    pub direction: DVec3,
    /// The mirror image that the ray went by; none where things have none.
    pub image: Option<u32>,
}

impl Sight<'_> {
    /// Follows a ray that met something; none if that is not a mirror.
    pub fn mirrored(&self, from: Vec3, direction: Vec3, hit: &Hit) -> Option<Mirrored> {
        let mirrors = self.mirrors.filter(|mirrors| mirrors.is_mirror(hit))?;
        let mut route = Route::new(from.as_dvec3());
        let mut way = direction.as_dvec3().normalize_or_zero();
        let length = direction.length();
        let (mut last, mut travelled) = (*hit, hit.t * length);
        let mut met = Vec::with_capacity(BOUNCES);
        loop {
            let triangle = last.triangle as usize;
            let [v, w] = last.uv.map(f64::from);
            let at = self.mesh.at(triangle, [1.0 - v - w, v, w]);
            let normal = self.mesh.normal[triangle];
            let along = normal.dot(way);
            route.bounce(at, self.mesh.material[triangle], along.abs());
            met.push(last);
            way = (way - 2.0 * along * normal).normalize_or_zero();
            let plane = self.mesh.plane[triangle];
            let next = self.meet_one(at.as_vec3(), way.as_vec3(), plane);
            let ended = |hit: &Hit| !(route.goes_on() && mirrors.is_mirror(hit));
            let reach = next.map_or(4.0 * self.mesh.reach, |hit| f64::from(hit.t));
            travelled += reach as f32;
            if next.as_ref().is_none_or(ended) {
                route.end(at + way * reach);
                return Some(Mirrored {
                    route,
                    hit: next.map(|hit| Hit {
                        t: travelled / length.max(f32::MIN_POSITIVE),
                        ..hit
                    }),
                    direction: way,
                    image: mirrors.image_of(&met),
                });
            }
            last = next?;
        }
    }

    /// Is the path by an image's mirrors free, from a point on a plane to the end of a segment? The segment itself starts at the
    /// point's mirror image.
    pub fn is_open(&self, image: u32, (point, mut plane): (DVec3, u32), segment: &Segment) -> bool {
        let Some(mirrors) = self.mirrors else {
            return false;
        };
        let Some(route) = mirrors.route(image, point, segment.to.as_dvec3()) else {
            return false;
        };
        let points = route.points();
        let mirrored = points.len() - 2;
        for (k, ends) in points.windows(2).enumerate() {
            if k == mirrored {
                let way = Segment::new(ends[0], ends[1], [plane, segment.planes[1]]);
                return !self.blocks_one(&way);
            }
            let way = (ends[1] - ends[0]).normalize_or_zero();
            let hit = self.meet_one(ends[0].as_vec3(), way.as_vec3(), plane);
            match hit.filter(|hit| mirrors.is_next(image, k, hit)) {
                Some(hit) => plane = self.mesh.plane[hit.triangle as usize],
                None => return false,
            }
        }
        false
    }
}
