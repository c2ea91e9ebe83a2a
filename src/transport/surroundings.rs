//! Light from outside: sky, and ground below the horizon.
//!
//! In rooms of few triangles it is exact (`clipped_sky`). Elsewhere, and under a map, it is found by rays over the hemisphere, towards
//! the [`Openings`] and towards bright spots of a map, combined by the power heuristic (Veach and Guibas 1995): with the balance
//! heuristic the few rays of the hemisphere that find a small opening added 2 % of noise to the light known from rays towards it. A ray
//! serves all parts of the sky.

use super::clipped_sky::{SkyIrradiance, SkyReceiver};
use super::obstacles::Obstacles;
use super::receiver::Receiver;
use crate::geometry::openings::{BEAM, OpeningDistribution, Openings, RayStart, Wall};
use crate::geometry::sampling::{cosine_direction, hash, sequence02, triangle_weights};
use crate::geometry::{NO_PLANE, Segment};
use crate::hierarchy::{Mesh, Tree};
use crate::light::{Passage, Tint};
use crate::link::{Sight, Visibility};
use crate::scene::sky::{PARTS, PLACES, Sky};
use crate::team::Interrupt;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

/// Rays over the hemisphere, and towards spots if any: from a random point of a leaf, from a point of a quadrature rule, from a point for its own sake,
/// and from one whose rays over the hemisphere are known.
const RAYS: [[usize; 2]; 4] = [[16, 16], [64, 64], [512, 1024], [0, 256]];
/// Rays to the openings from the first three. With 1024 for a point's own sake, points are off by up to 1.1 % below a clear sky (CIE 171 5.9, twelve
/// trials; .20 in root mean square) and by up to 1.2 % beside a wall of glass (four; .39), with 2048 by .46 (.10) and .60 (.17), in the same time (all
/// with scrambled points).
const OPENING_RAYS: [usize; 3] = [16, 64, 2048];
/// Rays to the openings from a mirror image, of which there may be many, at the least.
const LEAST_MIRRORED: usize = 64;

/// Directions that find the transmittance of panes where all else is exact, in the same order.
const TINTED: [usize; 4] = [16, 64, 512, 512];

/// What is outside a room.
#[derive(Debug, Clone)]
pub(crate) struct Surroundings {
    pub(crate) sky: Sky,
    pub(crate) openings: Openings,
}

/// Memory and results of a look outside.
#[derive(Debug, Default)]
pub(crate) struct SkyScratch {
    found: SkyIrradiance,
    choice: OpeningDistribution,
    /// The point, the normal and the number of rays for which the openings are weighed in `choice`.
    weighed: Option<((DVec3, DVec3), usize)>,
    segments: Vec<Segment>,
    open: Vec<(Search, DVec3)>,
    blocked: Vec<bool>,
    /// Rays cast.
    pub(crate) rays: u64,
    /// Variance of the factors.
    pub(super) noise: [f64; PLACES],
    /// Mean filters of the parts of sky and ground where light comes through panes; none where it does not.
    pub(super) tints: [Option<Passage>; PLACES],
}

impl SkyScratch {
    /// Finds which segments are blocked.
    fn block(&mut self, (sight, by): (&Sight, Option<&dyn Obstacles>)) {
        match by {
            Some(by) => by.block(&self.segments, &mut self.blocked),
            None => sight.blocked(&self.segments, &Visibility::Crowded, &mut self.blocked),
        }
        self.rays += self.segments.len() as u64;
    }
}

/// Distance beyond which everything lies outside the room.
fn reach((sight, by): (&Sight, Option<&dyn Obstacles>)) -> f64 {
    by.map_or(4.0 * sight.mesh.half_size, |by| by.reach())
}

/// How a direction was found.
#[derive(Debug, Clone, Copy)]
enum Search {
    Hemisphere,
    Openings,
    Spots,
}

/// How a point looks outside.
#[derive(Debug, Clone, Copy)]
pub(super) enum SkySampling<'a> {
    /// By the rays of this row of [`RAYS`].
    Rays(usize),
    /// These directions, of this many over the hemisphere, lead out of the room.
    Known(&'a [DVec3], usize),
    /// `Known` for a mirror image: there may be many.
    Mirrored(&'a [DVec3], usize),
    /// `Known` for one of many points, for which few rays to the openings are enough.
    Glanced(&'a [DVec3], usize),
    /// As if nothing stood in the way.
    Unshadowed,
}

impl SkySampling<'_> {
    /// Rays to the openings at the least and at the most; `known`: from a point whose rays over the hemisphere are known.
    pub(super) fn opening_rays(self, known: [usize; 2]) -> [usize; 2] {
        match self {
            SkySampling::Known(..) => known,
            SkySampling::Mirrored(..) => [LEAST_MIRRORED, known[1]],
            _ => [OPENING_RAYS[self.kind()]; 2],
        }
    }

    /// The row of [`RAYS`].
    fn kind(self) -> usize {
        match self {
            SkySampling::Rays(kind) => kind,
            SkySampling::Glanced(..) | SkySampling::Unshadowed => 0,
            SkySampling::Known(..) | SkySampling::Mirrored(..) => 3,
        }
    }
}

/// How the openings are looked at from a point.
#[derive(Clone, Copy)]
pub(super) struct OpeningRays<'a> {
    /// Rays at the least and at the most, see [`SkySampling::opening_rays`].
    pub(super) range: [usize; 2],
    /// How many are worth while where the openings bring so much light, as an irradiance where all light from outside on open ground is 1.
    pub(super) enough: &'a dyn Fn(f64) -> usize,
    /// Where it is weighed what they bring: of the many points of a leaf, at its middle, once for all.
    pub(super) weighed_at: DVec3,
}

/// The places where rays from the surfaces of a room leave it, and the number of rays cast. Once it is interrupted no ray leaves any more, so
/// that it ends.
pub(crate) fn find_openings(
    mesh: &Mesh,
    tree: &Tree,
    (sight, interrupt): (&Sight, &Interrupt),
    seed: u64,
) -> (Openings, u64) {
    let cast = AtomicU64::new(0);
    let area = tree.nodes.first().map_or(0.0, |root| root.area);
    let start = |share: f64, square: [f64; 2]| {
        tree.nodes.first()?;
        let entry = tree.entry_at(share * area);
        let element = &tree.elements[tree.node(tree.face_node[entry]).element as usize];
        Some(RayStart {
            point: element.at(triangle_weights(square)),
            normal: tree.face_normal[entry],
            plane: tree.face_plane[entry],
        })
    };
    let meet = |start: &RayStart, ways: &[DVec3; BEAM]| {
        if interrupt.is_raised() {
            return [Some(Wall {
                distance: 0.0,
                normal: start.normal,
            }); BEAM];
        }
        let mut hits = [None; BEAM];
        let (from, ways) = (start.point.as_vec3(), ways.map(|d| d.as_vec3()));
        sight.meet(&[from; BEAM], &ways, start.plane, &mut hits);
        cast.fetch_add(BEAM as u64, Ordering::Relaxed);
        hits.map(|hit| {
            hit.map(|hit| Wall {
                distance: f64::from(hit.t),
                normal: mesh.normal[hit.triangle as usize],
            })
        })
    };
    let openings = Openings::find(&mesh.positions, start, meet, seed);
    (openings, cast.into_inner())
}

impl Surroundings {
    /// Irradiance of a point by each part of the sky, where open level ground has 1, and by the ground, where a plane that faces
    /// down has 1.
    pub(super) fn seen(
        &self,
        (sight, by): (&Sight, Option<&dyn Obstacles>),
        to: &Receiver,
        (sampling, openings): (SkySampling, OpeningRays),
        look: &mut SkyScratch,
    ) -> [f64; PLACES] {
        (look.noise, look.tints) = ([0.0; PLACES], Default::default());
        if let SkySampling::Unshadowed = sampling {
            return self.unshadowed(to);
        }
        // Many points represent a leaf that looks for itself: for them rays are enough.
        let one_of_many = sight.panes.is_some() && sampling.kind() == 0;
        if Self::is_exact(&self.sky, sight) && !one_of_many {
            let looker = SkyReceiver {
                sky: &self.sky,
                sight,
                by: by.filter(|by| by.change_light()),
                to,
            };
            looker.look(TINTED[sampling.kind()], &mut look.found);
            look.rays += look.found.rays;
            look.tints = std::mem::take(&mut look.found.tints);
            look.found.seen
        } else {
            self.by_rays((sight, by), to, (sampling, openings), look)
        }
    }

    /// A rough [`Self::seen`] with nothing in the way: by the middles of the openings, and by some directions towards
    /// spots.
    fn unshadowed(&self, to: &Receiver) -> [f64; PLACES] {
        let mut seen = self.openings.most(to.point, to.normal, |d| {
            let mut each = [0.0; PLACES];
            let seen = self.sky.look(d);
            for (each, radiance) in each[seen.first..].iter_mut().zip(seen.radiance) {
                *each = PI * radiance * (1.0 - seen.excess);
            }
            each
        });
        let count = RAYS[0][1] as u32;
        let spots = (0..count).filter_map(|k| self.sky.spot(sequence02(k, to.seed)));
        for d in spots {
            let spot = self.sky.look(d);
            let density = f64::from(count) * spot.density;
            let weight = to.normal.dot(d).max(0.0) * spot.excess / density;
            for (seen, radiance) in seen[spot.first..].iter_mut().zip(spot.radiance) {
                *seen += weight * radiance;
            }
        }
        if self.sky.has_even_ground() {
            seen[PARTS..].iter_mut().for_each(|s| *s = s.min(1.0));
        }
        seen
    }

    /// Is a sky seen exactly in this room, without openings?
    pub(crate) fn is_exact(sky: &Sky, sight: &Sight) -> bool {
        sky.is_smooth() && sight.small() && sight.opaque.is_none() && sight.mirrors.is_none()
    }

    /// [`Self::seen`] from one of many points.
    pub(crate) fn lightly(
        &self,
        sight: &Sight,
        to: &Receiver,
        look: &mut SkyScratch,
    ) -> [f64; PLACES] {
        let sampling = SkySampling::Rays(0);
        let openings = OpeningRays {
            range: sampling.opening_rays([0; 2]),
            enough: &|_| 0,
            weighed_at: to.point,
        };
        self.seen((sight, None), to, (sampling, openings), look)
    }

    /// By rays over the hemisphere, to the openings and to spots.
    pub(super) fn by_rays(
        &self,
        (sight, by): (&Sight, Option<&dyn Obstacles>),
        to: &Receiver,
        (sampling, openings): (SkySampling, OpeningRays),
        look: &mut SkyScratch,
    ) -> [f64; PLACES] {
        let [wide, spots] = RAYS[sampling.kind()];
        let wide = match sampling {
            SkySampling::Known(open, of)
            | SkySampling::Mirrored(open, of)
            | SkySampling::Glanced(open, of) => {
                look.open.clear();
                look.open
                    .extend(open.iter().map(|&d| (Search::Hemisphere, d)));
                of
            }
            _ => {
                self.look_around(sight, to, wide, look);
                wide
            }
        };
        let narrow = self.look_through_openings((sight, by), to, openings, look);
        let spots = if self.sky.has_spots() { spots } else { 0 };
        self.look_at_spots((sight, by), to, spots, look);
        let counts = [wide, narrow, spots].map(|count| count as f64);
        self.combine((sight, by), to, counts, look)
    }

    /// Casts rays to bright spots of a map: adds the directions that lead outside.
    fn look_at_spots(
        &self,
        (sight, by): (&Sight, Option<&dyn Obstacles>),
        to: &Receiver,
        count: usize,
        look: &mut SkyScratch,
    ) {
        let turn = hash(to.seed, 0x5c3);
        let ahead: Vec<DVec3> = (0..count as u32)
            .filter_map(|k| self.sky.spot(sequence02(k, turn)))
            .filter(|d| to.normal.dot(*d) > 0.0)
            .collect();
        self.cast((sight, by), to, (Search::Spots, &ahead), look);
    }

    /// Casts rays to the openings: adds the directions that lead outside. Returns their number.
    fn look_through_openings(
        &self,
        (sight, by): (&Sight, Option<&dyn Obstacles>),
        to: &Receiver,
        openings: OpeningRays,
        look: &mut SkyScratch,
    ) -> usize {
        let plain = |d: DVec3| self.sky.look(d).plain;
        let [least, most] = openings.range;
        let (from, rays) = ((openings.weighed_at, to.normal), least as f64);
        if look.weighed != Some((from, least)) {
            self.openings.weigh(rays, from, plain, &mut look.choice);
            look.weighed = Some((from, least));
        }
        let count = (openings.enough)(PI * look.choice.total()).clamp(least, most);
        let turn = hash(to.seed, 0x5c1);
        let toward = |k| {
            let at = self.openings.choose(&look.choice, sequence02(k, turn))?;
            Some((at - to.point).normalize_or_zero())
        };
        let ahead: Vec<DVec3> = (0..count as u32)
            .filter_map(toward)
            .filter(|d| to.normal.dot(*d) > 0.0)
            .collect();
        self.cast((sight, by), to, (Search::Openings, &ahead), look);
        count
    }

    /// Adds those of some directions that lead outside: something may stand beyond an opening, too.
    fn cast(
        &self,
        (sight, by): (&Sight, Option<&dyn Obstacles>),
        to: &Receiver,
        (search, ahead): (Search, &[DVec3]),
        look: &mut SkyScratch,
    ) {
        let far = reach((sight, by));
        let way = |d: &DVec3| Segment::new(to.point, to.point + *d * far, [to.plane, NO_PLANE]);
        look.segments.clear();
        look.segments.extend(ahead.iter().map(way));
        look.block((sight, by));
        let ways = ahead.iter().zip(&look.blocked);
        let free = ways.filter(|(_, blocked)| !**blocked);
        look.open.extend(free.map(|(&d, _)| (search, d)));
    }

    /// Irradiance by the open directions, by the power heuristic, given the number of rays of each search.
    fn combine(
        &self,
        (sight, by): (&Sight, Option<&dyn Obstacles>),
        to: &Receiver,
        counts: [f64; 3],
        look: &mut SkyScratch,
    ) -> [f64; PLACES] {
        let [mut seen, mut squares, mut sum] = [[0.0; PLACES]; 3];
        let mut tints: [Tint; PLACES] = Default::default();
        let far = reach((sight, by));
        for &(search, d) in &look.open {
            let cosine = to.normal.dot(d);
            if cosine <= 0.0 {
                continue;
            }
            let outside = self.sky.look(d);
            let densities = [
                counts[0] * cosine / PI,
                counts[1] * self.openings.density(&look.choice, to.point, d),
                counts[2] * outside.density,
            ];
            let squared: f64 = densities.iter().map(|d| d * d).sum();
            let own = densities[search as usize];
            let passage = by.filter(|by| by.change_light()).map(|by| {
                let way = Segment::new(to.point, to.point + d * far, [NO_PLANE; 2]);
                by.leave(&way)
            });
            for (place, radiance) in (outside.first..).zip(outside.radiance) {
                let brings = radiance * cosine * own / squared;
                seen[place] += brings;
                let mut left = brings;
                if let (Some((passage, bright)), true) = (&passage, brings > 0.0) {
                    left *= bright;
                    tints[place].add(passage.as_ref(), brings);
                }
                // Light of open ground is as even as that of a lamp.
                if outside.first == 0 || !self.sky.has_even_ground() {
                    squares[place] += left * left;
                    sum[place] += left;
                }
            }
        }
        let rays: f64 = counts.iter().sum();
        look.noise = std::array::from_fn(|k| (squares[k] - sum[k] * sum[k] / rays).max(0.0));
        look.tints = tints.map(Tint::mean);
        seen
    }

    /// Casts rays over the hemisphere: keeps the directions that lead outside.
    fn look_around(&self, sight: &Sight, to: &Receiver, count: usize, look: &mut SkyScratch) {
        const TOGETHER: usize = 16;
        look.open.clear();
        let shift = hash(to.seed, 0x5c2);
        for first in (0..count).step_by(TOGETHER) {
            let directions: [DVec3; TOGETHER] = std::array::from_fn(|k| {
                cosine_direction(to.normal, sequence02((first + k) as u32, shift))
            });
            let mut hits = [None; TOGETHER];
            let from = [to.point.as_vec3(); TOGETHER];
            let ways: [Vec3; TOGETHER] = directions.map(|d| d.as_vec3());
            sight.meet(&from, &ways, to.plane, &mut hits);
            let open = directions.iter().zip(hits).filter(|(_, hit)| hit.is_none());
            look.open
                .extend(open.map(|(d, _)| (Search::Hemisphere, *d)));
        }
        look.rays += count as u64;
    }
}
