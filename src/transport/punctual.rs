//! Lights without extent, the sun, and lamps with a profile, in turn.

use super::gatherer::{Gatherer, Memory};
use super::luminaire;
use super::receiver::{Gathered, Receiver};
use crate::geometry::sampling::sequence02;
use crate::geometry::{NO_PLANE, Segment};
use crate::light::{Passage, accumulate};
use crate::scene::{LightKind, PunctualLight};
use glam::DVec3;

impl Gatherer<'_> {
    /// Adds the light of punctual lights, one ray each.
    pub(super) fn punctual(&self, to: &Receiver, memory: &mut Memory, out: &mut Gathered) {
        for (k, (lamp, row)) in self.lamps.iter().enumerate() {
            let (factor, passage) = match lamp.kind {
                LightKind::Surface => {
                    let bright = self.light.bright_lamps.get(k).copied().unwrap_or(0.0);
                    self.of_surface(to, lamp, f64::from(bright), memory)
                }
                _ => self.of_light(to, lamp, memory),
            };
            if factor <= 0.0 {
                continue;
            }
            if let Some(trace) = &mut out.trace {
                trace.lamp(k, factor as f32, passage.as_ref());
            }
            let filter = passage.as_ref().map(|passage| &passage.filter);
            accumulate(&mut out.irradiance, factor as f32, row, filter);
            accumulate(&mut out.direct, factor as f32, row, filter);
        }
    }

    /// Factor from the intensity of a light without extent, or of the sun, to irradiance, past blockers, and what panes
    /// leave of the light.
    fn of_light(
        &self,
        to: &Receiver,
        lamp: &PunctualLight,
        memory: &mut Memory,
    ) -> (f64, Option<Passage>) {
        let Some((factor, end)) = punctual_factor(lamp, to, self.far()) else {
            return (0.0, None);
        };
        if self.is_behind(to, end) {
            return (0.0, None);
        }
        let way = Segment::new(to.point, end, [to.plane, NO_PLANE]);
        let seen = match lamp.kind {
            LightKind::Sun => self.sun_seen(to, lamp, memory),
            _ if self.sight.occlusion => {
                memory.rays += 1;
                f64::from(u8::from(!self.blocks_one(&way)))
            }
            _ => 1.0,
        };
        match seen > 0.0 {
            true => (factor * seen, self.through(&way)),
            false => (0.0, None),
        }
    }

    /// Does a shading normal face a place that lies behind the face itself? Rays ignore the face's own plane, and in a vault of few
    /// faces nothing else blocks the sun.
    fn is_behind(&self, to: &Receiver, place: DVec3) -> bool {
        let Some(leaf) = to.leaf.filter(|_| self.via.is_none()) else {
            return false;
        };
        let element = self.tree.element(self.tree.node(leaf));
        element.is_some_and(|element| {
            let flat = self.tree.face_normal[element.face as usize];
            flat.dot(place - to.point) <= 0.0
        })
    }
}

/// Unblocked factor from a punctual light's intensity (for measured lamps, flux) to irradiance at a receiver, and the end of the
/// ray to the light: for a lamp with an extent, one of its points. None for sky and ground, whose light comes from everywhere.
pub fn punctual_factor(
    lamp: &PunctualLight,
    to: &Receiver,
    half_size: f64,
) -> Option<(f64, DVec3)> {
    if lamp.kind.is_dome() {
        return None;
    }
    if lamp.kind.is_parallel() {
        let cosine = -to.normal.dot(lamp.direction);
        return (cosine > 0.0).then(|| (cosine, to.point - lamp.direction * (4.0 * half_size)));
    }
    if lamp.kind == LightKind::Surface {
        return luminaire::whole(lamp, to, half_size, sequence02(0, to.seed));
    }
    let d = lamp.position - to.point;
    let r2 = d.length_squared();
    let cosine = to.normal.dot(d) / r2.sqrt();
    if !(cosine > 0.0 && r2 > 0.0) {
        return None;
    }
    let spot = match lamp.kind {
        LightKind::Profile => {
            let luminaire = lamp.luminaire.as_ref();
            luminaire.map_or(0.0, |l| l.per_lumen(-d / r2.sqrt()))
        }
        kind => kind.fall_off(-lamp.direction.dot(d) / r2.sqrt()),
    };
    (spot > 0.0).then(|| (spot * cosine / r2, lamp.position))
}
