//! Light by way of mirrors.
//!
//! Rays over the hemisphere that meet mirrors go on, and bring the light of what they meet at last, tinted. Besides, lamps, sun and
//! openings are gathered in each image, from the point's mirror image ([`MirrorImage::point`](crate::hierarchy::MirrorImage::point)): with the
//! factors that they have for any point, except for what blocks them. So rays bring emission only where things have no image.

use super::gatherer::{Gatherer, Memory};
use super::receiver::{Gathered, Receiver};
use super::via::{Arrived, PathEnd, Via};
use crate::geometry::sampling::{cosine_direction, hash, sequence02};
use crate::geometry::{Hit, Segment};
use crate::hierarchy::Route;
use crate::light::passed::Steps;
use crate::light::{Passage, accumulate};
use crate::link::Visibility;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Rays that look for the sky in mirrors, from one of many points.
const RAYS: usize = 16;

impl Gatherer<'_> {
    /// For each segment: is it blocked, straight or by way of mirrors?
    pub(super) fn blocked(&self, segments: &[Segment], out: &mut Vec<bool>) {
        let Some(via) = self.via else {
            return self.sight.blocked(segments, &Visibility::Crowded, out);
        };
        out.clear();
        out.extend(segments.iter().map(|s| !self.is_open(via, s)));
    }

    /// Is one segment blocked?
    pub(super) fn blocks_one(&self, segment: &Segment) -> bool {
        match self.via {
            Some(via) => !self.is_open(via, segment),
            None => self.sight.blocks_one(segment),
        }
    }

    fn is_open(&self, via: Via, segment: &Segment) -> bool {
        let from = (via.point, via.plane);
        self.sight.is_open(via.image, from, segment)
    }

    /// Could any part of a sphere be seen, straight or by way of mirrors?
    pub(super) fn may_show(&self, centre: DVec3, radius: f64) -> bool {
        let (Some(via), Some(mirrors)) = (self.via, self.sight.mirrors) else {
            return true;
        };
        mirrors.may_show(via.image, via.point, (centre, radius))
    }

    /// What is left of light on a segment by way of mirrors.
    pub(super) fn by_way_of(
        &self,
        via: Via,
        segment: &Segment,
        steps: Option<Steps>,
    ) -> Option<Passage> {
        let mirrors = self.sight.mirrors?;
        let route = mirrors.route(via.image, via.point, segment.to.as_dvec3())?;
        Some(self.along(&route, steps))
    }

    /// What mirrors on a route and panes between them leave of light.
    pub(super) fn along(&self, route: &Route, steps: Option<Steps>) -> Passage {
        let glazing = self.glass.map(|glass| glass.glazing);
        self.filters.along(glazing, route, steps)
    }

    /// Distance beyond which everything lies outside the room, straight or by way of mirrors.
    pub(super) fn distance(&self) -> f64 {
        4.0 * self.far()
    }

    /// Half the size of the room, including the images by way of which it is seen.
    pub(super) fn far(&self) -> f64 {
        let depth = match (self.via, self.sight.mirrors) {
            (Some(via), Some(mirrors)) => mirrors.images()[via.image as usize].depth(),
            _ => 0,
        };
        self.light.half_size * (1 + depth) as f64
    }

    /// Gathers in each mirror, and in mirrors in mirrors, in which a receiver may see something.
    fn in_each(&self, to: &Receiver, mut look: impl FnMut(&Gatherer, &Receiver, u32)) {
        let Some(mirrors) = self.sight.mirrors else {
            return;
        };
        for image in mirrors.seen_from(to.point, to.normal) {
            self.in_image(to, image, &mut look);
        }
    }

    fn in_image(
        &self,
        to: &Receiver,
        image: u32,
        look: &mut impl FnMut(&Gatherer, &Receiver, u32),
    ) {
        let Some(mirrors) = self.sight.mirrors else {
            return;
        };
        let known = &mirrors.images()[image as usize];
        let from = Receiver {
            point: known.point(to.point),
            normal: known.direction(to.normal),
            // Surfaces in the image's plane may well be visible.
            plane: crate::geometry::NO_PLANE,
            leaf: to.leaf,
            seed: hash(to.seed, u64::from(image)),
        };
        let gatherer = Gatherer {
            via: Some(Via {
                image,
                point: to.point,
                plane: to.plane,
            }),
            ..*self
        };
        look(&gatherer, &from, image);
    }

    /// Brightness of the direct light at a point by one lamp in one image, both chosen at random.
    pub(super) fn one_in_mirrors(&self, to: &Receiver, [u, v]: [f64; 2]) -> f64 {
        let Some(mirrors) = self.sight.mirrors else {
            return 0.0;
        };
        let images: Vec<u32> = mirrors.seen_from(to.point, to.normal).collect();
        let share = u * images.len() as f64;
        let Some(&image) = images.get(share as usize) else {
            return 0.0;
        };
        let mut sum = 0.0;
        self.in_image(to, image, &mut |gatherer, from, _| {
            let lamps = gatherer.one_lamp(from, [share.fract(), v]);
            for (bright, segment) in lamps.into_iter().flatten() {
                if !gatherer.blocks_one(&segment) {
                    sum += bright * gatherer.dimmed(&segment);
                }
            }
        });
        sum * images.len() as f64
    }

    /// Emitting surfaces in mirrors.
    pub(super) fn lamps_in_mirrors(&self, to: &Receiver, memory: &mut Memory, out: &mut Gathered) {
        self.in_each(to, |gatherer, from, _| gatherer.lamps_of(from, memory, out));
    }

    /// Lights without extent and those with a profile, sky and ground in mirrors. `of`: number of rays over the hemisphere from
    /// which the memory holds those that met mirrors.
    pub(super) fn lights_in_mirrors(
        &self,
        to: &Receiver,
        of: usize,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        let Some(mirrors) = self.sight.mirrors else {
            return;
        };
        let mirrored = std::mem::take(&mut memory.mirrored);
        let seen: Vec<u32> = mirrors.seen_from(to.point, to.normal).collect();
        self.in_each(to, |gatherer, from, image| {
            gatherer.punctual(from, memory, out);
            if gatherer.sky.is_some() {
                let own = |a: &&Arrived| a.image == Some(image);
                let open = mirrored.iter().filter(own).filter_map(Arrived::outside);
                let open: Vec<DVec3> = open.collect();
                gatherer.outside_in_mirrors(from, (&open, of), memory, out);
            }
        });
        let share = 1.0 / of.max(1) as f64;
        let other = |a: &&Arrived| a.image.is_none_or(|image| !seen.contains(&image));
        for arrived in mirrored.iter().filter(other) {
            if let Some(direction) = arrived.outside() {
                self.escapes(direction, share, &arrived.passage, out);
            }
        }
        memory.mirrored = mirrored;
    }

    /// Adds light from outside in one direction.
    fn escapes(&self, direction: DVec3, share: f64, passage: &Passage, out: &mut Gathered) {
        let Some(outside) = self.sky else { return };
        for (k, (lamp, row)) in self.lamps.iter().enumerate() {
            let Some(radiance) = outside.sky.part(lamp.kind.place(), direction) else {
                continue;
            };
            let factor = (share * PI * radiance) as f32;
            if let Some(trace) = &mut out.trace {
                trace.lamp(k, factor, Some(passage));
            }
            accumulate(&mut out.irradiance, factor, row, Some(&passage.filter));
            accumulate(&mut out.direct, factor, row, Some(&passage.filter));
        }
    }

    /// Follows a ray that met a mirror; false if it did not meet one.
    pub(super) fn follow(
        &self,
        from: Vec3,
        direction: Vec3,
        hit: &Hit,
        mirrored: &mut Vec<Arrived>,
    ) -> bool {
        let Some(way) = self.sight.mirrored(from, direction, hit) else {
            return false;
        };
        let end = match way.hit {
            None => Some(PathEnd::Outside(way.direction)),
            Some(hit) => self.met(&hit).map(|leaf| match self.is_mirror(&hit) {
                true => PathEnd::Mirror(leaf),
                false => PathEnd::Leaf(leaf),
            }),
        };
        if let Some(end) = end {
            mirrored.push(Arrived {
                end,
                image: way.image,
                passage: Box::new(self.along(&way.route, self.steps())),
            });
        }
        true
    }

    fn is_mirror(&self, hit: &Hit) -> bool {
        self.sight.mirrors.is_some_and(|m| m.is_mirror(hit))
    }

    /// Looks for the sky in mirrors by a few rays; returns their number.
    pub(super) fn glance(&self, to: &Receiver, memory: &mut Memory) -> usize {
        memory.mirrored.clear();
        if self.sight.mirrors.is_none() || self.sky.is_none() {
            return 0;
        }
        let shift = hash(to.seed, 0x91a);
        let directions: [Vec3; RAYS] = std::array::from_fn(|k| {
            cosine_direction(to.normal, sequence02(k as u32, shift)).as_vec3()
        });
        let mut hits = [None; RAYS];
        let from = [to.point.as_vec3(); RAYS];
        self.sight.meet(&from, &directions, to.plane, &mut hits);
        memory.rays += RAYS as u64;
        for (hit, direction) in hits.iter().zip(directions) {
            let way = hit.and_then(|hit| self.sight.mirrored(from[0], direction, &hit));
            if let Some(way) = way.filter(|way| way.hit.is_none()) {
                memory.mirrored.push(Arrived {
                    end: PathEnd::Outside(way.direction),
                    image: way.image,
                    passage: Box::new(self.along(&way.route, self.steps())),
                });
            }
        }
        RAYS
    }

    /// Adds the light of what rays of a `share` each met by way of mirrors, including emission where lamps have no
    /// image.
    pub(super) fn patches_in_mirrors(&self, share: f32, memory: &Memory, out: &mut Gathered) {
        let width = self.light.width();
        for arrived in &memory.mirrored {
            let passage = &*arrived.passage;
            let filter = Some(&passage.filter);
            let (leaf, row) = match arrived.end {
                PathEnd::Leaf(leaf) => (leaf, self.light.reflected.row(leaf as usize)),
                PathEnd::Mirror(leaf) => (leaf, self.light.mirrors.row(leaf as usize)),
                PathEnd::Outside(_) => continue,
            };
            out.seen += f64::from(share);
            accumulate(&mut out.irradiance[..width], share, row, filter);
            if let Some(trace) = &mut out.trace {
                match arrived.end {
                    PathEnd::Mirror(_) => trace.mirror(leaf, share, passage),
                    _ => trace.hit(leaf, share, 1.0, Some(passage)),
                }
            }
            if arrived.image.is_none() && self.light.bright_emitted[leaf as usize] > 0.0 {
                let row = self.light.emitted.row(leaf as usize);
                if let Some(trace) = &mut out.trace {
                    trace.emitted(leaf, share, Some(passage));
                }
                accumulate(&mut out.irradiance[..width], share, row, filter);
                accumulate(&mut out.direct[..width], share, row, filter);
            }
        }
    }
}
