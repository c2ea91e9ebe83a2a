//! What light passes on its way: the panes that it crosses and the mirrors that it meets, with angles and thicknesses rounded.
//!
//! Lanes change, and spectra of panes may be changed; what a ray passes does not. So this is what leaves keep from round to round and
//! caches hold, and its filter on the present lanes is worked out anew ([`Filters::of`](super::Filters::of)).

use crate::hierarchy::{Crossing, Glazing, Route};
use crate::store::Broken;
use crate::store::codec::Read;
use glam::Vec3;

/// Cosines of incidence and values of textures are stored as multiples of one over this.
const FINE: i32 = 2048;
/// Steps of thickness per doubling: 2 % of what is absorbed.
const OCTAVE: f32 = 32.0;
/// Doublings of thickness, in either direction, beyond which a file is damaged.
const MOST_DOUBLINGS: i32 = 256;

/// How finely cosines and values of textures are distinguished: each is put in the middle of its step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Steps {
    /// 128 steps, for means over many rays: transmittance bends by less than 1e-3 over a step, except in the last 2 degrees before
    /// grazing.
    Coarse,
    /// 1024 steps, for points: a lamp may light a whole floor at one angle. Transmittance is then off by 5e-4 at the most where its
    /// slope against the cosine is 1.
    Fine,
}

impl Steps {
    fn count(self) -> i32 {
        match self {
            Self::Coarse => 128,
            Self::Fine => 1024,
        }
    }

    /// The middle of the step that holds `x`, in parts of [`FINE`].
    fn middle(self, x: f32) -> i32 {
        let (steps, wide) = (self.count(), FINE / self.count());
        ((x * steps as f32) as i32).clamp(0, steps - 1) * wide + wide / 2
    }
}

/// What light passes: material, thickness, value of the texture and cosine of incidence of each pane; for a mirror only the first and the
/// last. Sorted, so that the order on the way does not matter.
pub(crate) type Passed = Vec<[i32; 4]>;

/// What light on a segment passes.
pub(crate) fn passed(glazing: &Glazing, from: Vec3, to: Vec3, steps: Steps) -> Passed {
    let crossings = glazing.crossings(from, to);
    let mut passed: Passed = crossings.iter().map(|c| rounded(c, steps)).collect();
    passed.sort_unstable();
    passed
}

/// What light passes and meets on a route by mirrors.
pub(crate) fn met(glazing: Option<&Glazing>, route: &Route, steps: Steps) -> Passed {
    let mirror = |&(material, cosine): &(u32, f32)| {
        let crossing = Crossing {
            material,
            cosine,
            thickness: 0.0,
            texel: 1.0,
        };
        rounded(&crossing, steps)
    };
    let mut all: Passed = route.bounces().iter().map(mirror).collect();
    if let Some(glazing) = glazing {
        for ends in route.points().windows(2) {
            let [from, to] = [ends[0], ends[1]].map(|p| p.as_vec3());
            all.extend(passed(glazing, from, to, steps));
        }
    }
    all.sort_unstable();
    all
}

fn rounded(crossing: &Crossing, steps: Steps) -> [i32; 4] {
    let thickness = match crossing.thickness > 0.0 {
        true => (OCTAVE * crossing.thickness.log2()).round() as i32,
        false => i32::MIN,
    };
    // A plain pane has the value 1, exactly.
    let texel = match crossing.texel >= 1.0 {
        true => FINE,
        false => steps.middle(crossing.texel),
    };
    let cosine = steps.middle(crossing.cosine);
    [crossing.material as i32, thickness, texel, cosine]
}

pub(super) fn crossing([material, thickness, texel, cosine]: [i32; 4]) -> Crossing {
    let share = |k: i32| k as f32 / FINE as f32;
    Crossing {
        material: material as u32,
        cosine: share(cosine),
        thickness: match thickness {
            i32::MIN => 0.0,
            k => (k as f32 / OCTAVE).exp2(),
        },
        texel: share(texel),
    }
}

/// Can light pass this, if `changes_light` tells which materials are panes or mirrors?
pub(super) fn is_possible(passed: &[[i32; 4]], changes_light: impl Fn(u32) -> bool) -> bool {
    let most = OCTAVE as i32 * MOST_DOUBLINGS;
    passed.iter().all(|&[material, thickness, texel, cosine]| {
        u32::try_from(material).is_ok_and(&changes_light)
            && (thickness == i32::MIN || (-most..=most).contains(&thickness))
            && [texel, cosine].iter().all(|k| (0..=FINE).contains(k))
    })
}

/// What is passed, encoded as distinct lists of numbers from 0 up, which [`from_numbers`] decodes.
pub(crate) fn numbers(passed: &[[i32; 4]]) -> impl Iterator<Item = u64> {
    passed.iter().flatten().map(|&k| match k {
        // No thickness.
        i32::MIN => 0,
        k => (i64::from(k) << 1 ^ i64::from(k) >> 63) as u64 + 1,
    })
}

/// Decodes [`numbers`].
///
/// # Errors
/// [`Broken`]: the numbers mean nothing.
pub(crate) fn from_numbers(numbers: &[u64]) -> Read<Passed> {
    let (all, rest) = numbers.as_chunks::<4>();
    let number = |n: u64| match n.checked_sub(1) {
        None => Some(i32::MIN),
        Some(n) => i32::try_from((n >> 1) as i64 ^ -((n & 1) as i64)).ok(),
    };
    let passed = all.iter().map(|four| {
        let [a, b, c, d] = four.map(number);
        Some([a?, b?, c?, d?])
    });
    let passed: Option<Passed> = passed.collect();
    passed
        .filter(|_| rest.is_empty())
        .ok_or_else(|| Broken::new("has a way through panes that does not read"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_passed_comes_back(all in prop::collection::vec(any::<[i32; 4]>(), 0..5)) {
            let numbers: Vec<u64> = numbers(&all).collect();
            prop_assert_eq!(from_numbers(&numbers), Ok(all));
        }

        /// Rounding keeps within its steps: cosine and texture within half a step, thickness within a 64th of a
        /// doubling.
        #[test]
        fn rounding_is_as_fine_as_it_says(
            cosine in 0.0_f32..1.0,
            texel in 0.0_f32..1.2,
            thickness in 1e-6_f32..1e3,
            fine in any::<bool>(),
        ) {
            let steps = if fine { Steps::Fine } else { Steps::Coarse };
            let of = Crossing { material: 3, cosine, thickness, texel };
            let back = crossing(rounded(&of, steps));
            let half = 0.5001 / steps.count() as f32;
            prop_assert!((back.cosine - cosine).abs() <= half);
            prop_assert!((back.texel - texel.min(1.0)).abs() <= half);
            prop_assert!((back.thickness / thickness).log2().abs() <= 0.501 / OCTAVE);
        }
    }
}
