//! Sky, ground below the horizon and the sun's disc at a point.

use super::gatherer::{Gatherer, Memory};
use super::obstacles::Obstacles;
use super::receiver::{Gathered, Receiver};
use super::surroundings::SkySampling;
use crate::geometry::sampling::{around, cosine_direction, hash, sequence02};
use crate::geometry::{NO_PLANE, Segment};
use crate::light::{Passage, accumulate};
use crate::scene::PunctualLight;
use crate::scene::sky::{PLACES, SUN_RADIUS};
use glam::DVec3;
use std::f64::consts::PI;

/// Rays to the sun's disc: from a random point of a leaf, and from other points.
const SUN_RAYS: [u32; 2] = [4, 16];

impl Obstacles for Gatherer<'_> {
    fn block(&self, segments: &[Segment], out: &mut Vec<bool>) {
        self.blocked(segments, out);
    }

    fn change_light(&self) -> bool {
        !self.is_plain()
    }

    fn leave(&self, segment: &Segment) -> (Option<Passage>, f64) {
        let passage = self.through(segment);
        let bright = self.left_by(passage.as_ref());
        (passage, bright)
    }

    fn reach(&self) -> f64 {
        self.distance()
    }
}

impl Gatherer<'_> {
    /// Adds light from outside. `known`: the directions, and of how many over the hemisphere, that lead outside, if rays have
    /// told. `own`: is this a point for its own sake?
    pub(crate) fn outside(
        &self,
        to: &Receiver,
        known: Option<(&[DVec3], usize)>,
        own: bool,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        let sampling = match known {
            _ if self.hemisphere.is_some() && !self.sight.occlusion => SkySampling::Unshadowed,
            Some((open, of)) => SkySampling::Known(open, of),
            None if !self.shafts => SkySampling::Rays(0),
            None => SkySampling::Rays(if own { 2 } else { 1 }),
        };
        self.come_in(to, sampling, own, memory, out);
    }

    /// [`Self::outside`] in one of `images` images; `open`, of `of` directions over the hemisphere, lead out of the
    /// room.
    pub(super) fn outside_in_mirrors(
        &self,
        to: &Receiver,
        (open, of): (&[DVec3], usize),
        images: usize,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        let sampling = match self.shafts {
            true => SkySampling::Shared(open, of, images),
            false => SkySampling::Glanced(open, of),
        };
        self.come_in(to, sampling, true, memory, out);
    }

    /// Adds the light from outside that `way` finds.
    fn come_in(
        &self,
        to: &Receiver,
        sampling: SkySampling,
        own: bool,
        memory: &mut Memory,
        out: &mut Gathered,
    ) {
        let Some(outside) = self.sky else { return };
        // Points for their own sake share one pattern where links serve them: the remaining error is smooth.
        let seed = if self.hemisphere.is_some() || !own {
            to.seed
        } else {
            0
        };
        let to = &Receiver { seed, ..*to };
        let before = memory.look.rays;
        let seen = outside.seen((self.sight, Some(self)), to, sampling, &mut memory.look);
        memory.rays += memory.look.rays - before;
        let mut noise = 0.0;
        for (k, (lamp, row)) in self.lamps.iter().enumerate() {
            let Some(place) = lamp.kind.place().filter(|&place| seen[place] > 0.0) else {
                continue;
            };
            let factor = seen[place];
            let bright = self.light.bright_lamps.get(k).copied().unwrap_or(0.0);
            noise += memory.look.noise[place].sqrt() * f64::from(bright);
            let tint = memory.look.tints[place].as_ref();
            if let Some(trace) = &mut out.trace {
                trace.lamp(k, factor as f32, tint);
            }
            let filter = tint.map(|passage| &passage.filter);
            accumulate(&mut out.irradiance, factor as f32, row, filter);
            accumulate(&mut out.direct, factor as f32, row, filter);
        }
        // Parts are seen by the same rays, so that their errors add up.
        memory.noise += noise * noise;
    }

    /// Share of the sun's disc that a point sees.
    pub(super) fn sun_seen(&self, to: &Receiver, sun: &PunctualLight, memory: &mut Memory) -> f64 {
        if !self.sight.occlusion {
            return 1.0;
        }
        let count = SUN_RAYS[usize::from(self.shafts)];
        let (turn, least) = (hash(to.seed, 0x50), 1.0 - SUN_RADIUS.cos());
        memory.segments.clear();
        for k in 0..count {
            let [u, v] = sequence02(k, turn);
            let toward = around(-sun.direction, 1.0 - u * least, v);
            let end = to.point + toward * self.distance();
            memory
                .segments
                .push(Segment::new(to.point, end, [to.plane, NO_PLANE]));
        }
        self.blocked(&memory.segments, &mut memory.blocked);
        memory.rays += u64::from(count);
        let open = memory.blocked.iter().filter(|blocked| !**blocked);
        open.count() as f64 / f64::from(count)
    }

    /// One random direction of sky or ground, and the factors of the parts that it represents.
    pub(super) fn one_direction(
        &self,
        to: &Receiver,
        sample: [f64; 2],
    ) -> Option<(DVec3, [f64; PLACES])> {
        let outside = self.sky?;
        let seed = hash(sample[0].to_bits(), sample[1].to_bits());
        let sky = &outside.sky;
        // Under a map every second direction goes towards its spots.
        let spots = sky.has_spots();
        let square = sequence02(0, seed);
        let by_cosine = || cosine_direction(to.normal, square);
        let d = match spots && seed >> 63 == 1 {
            true => sky.spot(square)?,
            false => by_cosine(),
        };
        let cosine = to.normal.dot(d);
        if cosine <= 0.0 {
            return None;
        }
        let density = match spots {
            true => 0.5 * (cosine / PI + sky.spot_density(d)),
            false => cosine / PI,
        };
        let mut factors = [0.0; PLACES];
        let (first, radiance) = sky.radiance(d);
        for (factor, radiance) in factors[first..].iter_mut().zip(radiance) {
            *factor = radiance * cosine / density;
        }
        Some((d, factors))
    }
}
