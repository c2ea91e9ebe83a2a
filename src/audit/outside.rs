//! What paths bring from sky and ground: where they leave the room, straight through small openings and straight from bright spots of a
//! map, weighted against each other by the balance heuristic (Veach and Guibas 1995).

use super::path::{Audit, PathVertex};
use crate::geometry::openings::{BEAM, OpeningDistribution, Openings, RayStart, Wall};
use crate::geometry::sampling::on_triangle;
use crate::geometry::{NO_PLANE, Segment};
use crate::hierarchy::Face;
use crate::scene::sky::Sky;
use crate::spectrum::{BANDS, Spectrum};
use glam::DVec3;
use std::f64::consts::PI;

/// Openings that more of the rays all over the hemisphere leave by than this need no rays of their own: the tracer has one of
/// each at every point that a path comes by.
const SMALL: f64 = 0.02;

/// Paths that look through openings from about the same place.
const PATHS: f64 = 1e3;

impl Audit<'_> {
    /// The openings of a room with a sky, where they are small.
    pub(super) fn small_openings(&self) -> Option<Openings> {
        self.scene.sky.as_ref()?;
        let mesh = self.mesh;
        let mut area = 0.0;
        let upto = |face: &Face| {
            area += mesh.area[face.triangle as usize];
            area
        };
        let upto: Vec<f64> = mesh.faces.iter().map(upto).collect();
        let start = |share: f64, square: [f64; 2]| {
            let k = upto.partition_point(|&upto| upto <= share * area);
            let face = *mesh.faces.get(k)?;
            Some(RayStart {
                point: on_triangle(&mesh.corners(face), square),
                normal: mesh.face_normal(face),
                plane: mesh.plane[face.triangle as usize],
            })
        };
        let meet = |start: &RayStart, ways: &[DVec3; BEAM]| {
            ways.map(|way| {
                let hit = self.closest(start.point, way, start.plane)?;
                Some(Wall {
                    distance: f64::from(hit.t),
                    normal: mesh.normal[hit.triangle as usize],
                })
            })
        };
        let found = Openings::find(&mesh.positions, start, meet, 0xa0d);
        (found.share() < SMALL && !found.is_empty()).then_some(found)
    }

    /// What each opening may bring to a point; none where they are found by chance.
    pub(super) fn openings_from(&self, at: &PathVertex) -> Option<OpeningDistribution> {
        let (sky, openings) = (self.scene.sky.as_ref()?, self.openings.as_ref()?);
        let mut choice = OpeningDistribution::default();
        openings.weigh(
            PATHS,
            (at.point, at.normal),
            |d| sky.look(d).plain,
            &mut choice,
        );
        Some(choice)
    }

    /// Density, by solid angle, of a direction that one path of each kind takes.
    fn density(
        &self,
        sky: &Sky,
        at: &PathVertex,
        choice: Option<&OpeningDistribution>,
        direction: DVec3,
    ) -> f64 {
        let cosine = at.normal.dot(direction);
        let through = match (&self.openings, choice) {
            (Some(openings), Some(choice)) => openings.density(choice, at.point, direction),
            _ => 0.0,
        };
        cosine / PI + sky.spot_density(direction) + through
    }

    /// What a path that leaves the room brings from there, in a direction chosen by the cosine, or turned by so many mirrors: these are
    /// not looked for otherwise.
    pub(super) fn outside(
        &self,
        (at, choice): (&PathVertex, Option<&OpeningDistribution>),
        (direction, mirrors): (DVec3, usize),
        throughput: &Spectrum,
        sum: &mut Spectrum,
    ) {
        let Some(sky) = &self.scene.sky else { return };
        if mirrors > 0 {
            self.far(sky, direction, PI, throughput, sum);
            return;
        }
        let cosine = at.normal.dot(direction).max(0.0);
        if cosine > 0.0 {
            let density = self.density(sky, at, choice, direction);
            self.far(sky, direction, cosine / density, throughput, sum);
        }
    }

    /// Light straight through a small opening, and straight from a bright spot of a map.
    pub(super) fn aimed_outside(
        &self,
        (at, choice): (&PathVertex, Option<&OpeningDistribution>),
        square: [f64; 2],
        throughput: &Spectrum,
        sum: &mut Spectrum,
    ) {
        let Some(sky) = &self.scene.sky else { return };
        let openings = self.openings.as_ref().zip(choice);
        let target = openings.and_then(|(openings, choice)| openings.choose(choice, square));
        let through = target.map(|target| (target - at.point).normalize_or_zero());
        for direction in through.into_iter().chain(sky.spot(square)) {
            self.straight(sky, (at, choice), direction, throughput, sum);
        }
    }

    fn straight(
        &self,
        sky: &Sky,
        (at, choice): (&PathVertex, Option<&OpeningDistribution>),
        direction: DVec3,
        throughput: &Spectrum,
        sum: &mut Spectrum,
    ) {
        let cosine = at.normal.dot(direction);
        let end = at.point + direction * (4.0 * self.mesh.half_size);
        let way = Segment::new(at.point, end, [at.plane, NO_PLANE]);
        if cosine <= 0.0 || self.blocked(&way) {
            return;
        }
        let density = self.density(sky, at, choice, direction);
        let mut throughput = *throughput;
        self.filter(&mut throughput, at.point, end);
        self.far(sky, direction, cosine / density, &throughput, sum);
    }

    /// Adds a weight times what comes from a direction outside.
    fn far(
        &self,
        sky: &Sky,
        direction: DVec3,
        weight: f64,
        throughput: &Spectrum,
        sum: &mut Spectrum,
    ) {
        // Not by the parts that the bake knows: what these leave out is an error, too.
        if let Some(radiance) = sky.exact(direction) {
            for l in 0..BANDS {
                sum[l] += throughput[l] * weight * radiance[l];
            }
            return;
        }
        for light in &self.scene.lights {
            let Some(radiance) = sky.part(light.kind.place(), direction) else {
                continue;
            };
            let power = &self.scene.spectra[light.light].power;
            for l in 0..BANDS {
                sum[l] += throughput[l] * weight * radiance * power[l] * light.shape[l];
            }
        }
    }
}
