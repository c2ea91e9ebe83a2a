//! The sun in a map: taken out of the picture, so that it shines as a sun does, with edges of its own and no part in daylight factors.
//!
//! It is the brightest place, if that is small and far brighter than what is around it. What it has more than the ring around it is
//! its light; the picture keeps the brightness of the ring there. As a lamp it is a disc of .53 degrees, however blurred the picture
//! has it.

use super::map::{Disc, Map};
use super::parts::PARTS;
use glam::DVec3;
use std::f64::consts::PI;

/// The sun is within this angle, and the ring around it as wide again: pictures blur it to a degree or two, radians.
const RADIUS: f64 = 1.5 * PI / 180.0;
/// A place is the sun from so many times the luminance of the ring on. The sun has 1e5 times that of the sky around it; in pictures
/// that cut it off there is less, and what is no brighter than this throws no shadow that needs an edge.
const CONTRAST: f64 = 100.0;
/// And if it brings open ground this share of all its light.
const SHARE: f64 = 0.1;
/// Texels across from which the ring has some: a texel is a degree.
const WIDTH: usize = 360;

impl Map {
    /// Takes the sun out, if it is there.
    pub(super) fn take_sun(&mut self) -> Option<Disc> {
        if self.width < WIDTH {
            return None;
        }
        let upper = self.height / 2 * self.width;
        let brighter = |&a: &usize, &b: &usize| self.bright(a).total_cmp(&self.bright(b));
        let brightest = (0..upper).max_by(brighter)?;
        let middle = self.middle(brightest);
        let reach = (2.0 * RADIUS / PI * self.height as f64).ceil() as usize;
        let row = brightest / self.width;
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(self.height);
        let near = rows.start * self.width..rows.end * self.width;
        let (mut inside, mut ring, mut around) = (Vec::new(), [0.0; PARTS], 0.0);
        for k in near {
            let angle = self.middle(k).dot(middle).clamp(-1.0, 1.0).acos();
            let solid = self.solid_angle(k / self.width);
            if angle <= RADIUS {
                inside.push(k);
            } else if angle <= 2.0 * RADIUS {
                ring = std::array::from_fn(|c| ring[c] + solid * f64::from(self.texels[k][c]));
                around += solid;
            }
        }
        let base = ring.map(|sum| sum / around);
        let of_ring = self.luminous(base);
        if self.bright(brightest) <= CONTRAST * of_ring {
            return None;
        }
        let (mut across, mut toward) = ([0.0; PARTS], DVec3::ZERO);
        for &k in &inside {
            let solid = self.solid_angle(k / self.width);
            let more: [f64; PARTS] =
                std::array::from_fn(|c| solid * (f64::from(self.texels[k][c]) - base[c]).max(0.0));
            let bright = self.luminous(more);
            toward += bright * self.middle(k);
            across = std::array::from_fn(|c| across[c] + more[c]);
        }
        let all = self.luminous(self.level(0));
        // Its length is the luminous irradiance across the rays, but for the width of the disc.
        if toward.y <= SHARE * all {
            return None;
        }
        for k in inside {
            let texel = &mut self.texels[k];
            *texel = std::array::from_fn(|c| texel[c].min(base[c] as f32));
        }
        Some(Disc {
            toward: toward.normalize(),
            across,
        })
    }
}
