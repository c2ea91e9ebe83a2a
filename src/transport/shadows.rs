//! The shadows that blockers cast from a point, kept as long as the point stays: many patches lie past the same few
//! blockers.

use crate::geometry::Shadow;
use crate::hierarchy::Blocker;
use glam::DVec3;

/// Binary logarithm of the number of shadows kept: 90 kB.
const BITS: u32 = 9;

/// Shadows by blocker; of blockers that share a place, the last.
#[derive(Debug, Default)]
pub(super) struct Shadows {
    point: DVec3,
    /// Counts points.
    epoch: u32,
    places: Vec<Option<(u32, Blocker, Shadow)>>,
}

impl Shadows {
    /// The shadow of a blocker from a point.
    pub(super) fn of<Outline: AsRef<[DVec3]>>(
        &mut self,
        point: DVec3,
        blocker: Blocker,
        outline: impl FnOnce() -> Outline,
    ) -> &Shadow {
        if self.places.is_empty() || self.epoch == u32::MAX {
            self.places = vec![None; 1 << BITS];
            self.epoch = 0;
        }
        if point != self.point || self.epoch == 0 {
            self.point = point;
            self.epoch += 1;
        }
        // Knuth's multiplicative hash: neighbours in the room get different places.
        let key = blocker.triangle << 1 | u32::from(blocker.together);
        let place = &mut self.places[(key.wrapping_mul(0x9e37_79b1) >> (32 - BITS)) as usize];
        let known = matches!(place, Some((epoch, b, _)) if (*epoch, *b) == (self.epoch, blocker));
        if !known {
            *place = None;
        }
        let fresh = || (self.epoch, blocker, Shadow::new(point, outline().as_ref()));
        &place.get_or_insert_with(fresh).2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Pcg;

    /// Also when the point changes and when blockers share a place.
    #[test]
    fn a_kept_shadow_is_that_of_its_blocker_and_point() {
        let mut random = Pcg::new(1);
        let mut shadows = Shadows::default();
        let outlines: Vec<[DVec3; 3]> = (0..1_000)
            .map(|_| [0; 3].map(|_| DVec3::new(random.f64(), random.f64(), random.f64())))
            .collect();
        let mut point = DVec3::ZERO;
        for round in 0..20_000 {
            if round % 900 == 899 {
                point = DVec3::new(random.f64(), random.f64(), random.f64());
            }
            let blocker = Blocker {
                triangle: (random.f64() * 1_000.0) as u32,
                together: false,
            };
            let outline = outlines[blocker.triangle as usize];
            let fresh = Shadow::new(point, &outline);
            assert_eq!(*shadows.of(point, blocker, || outline), fresh);
        }
    }
}
