//! The sky of a room: what comes from each direction.
//!
//! Its light is a sum of up to three spectra, each spread over the dome in its own way: daylight of one or several colours, those that
//! stand for a spectral sky, or red, green and blue of a map. Above the horizon a part is brought to an irradiance of 1 of open level ground, below it to the same of a plane that looks
//! down; how much of each there is, and of which spectrum, lamps of the kinds [`LightKind::Sky`](crate::scene::LightKind::Sky) and
//! [`LightKind::Ground`](crate::scene::LightKind::Ground) say.

use super::cie::{Distribution, STEPS, level};
use super::map::Map;
use super::mixture::Spectral;
use super::parts::{PARTS, PLACES};
use crate::data::Spectrum;
use glam::DVec3;
use std::f64::consts::PI;
use std::sync::Arc;

/// Radius of the sun's disc, radians: .53 degrees across.
pub const SUN_RADIUS: f64 = 0.5 * 0.53 * std::f64::consts::PI / 180.0;

/// How light is spread over the dome.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Dome {
    /// By ISO 15469.
    Cie(Tinted),
    /// By Hosek and Wilkie.
    Spectral(Arc<Spectral>),
    /// By a picture of all directions.
    Map(Arc<Map>),
}

/// A sky of ISO 15469 with a colour at the zenith, one at the horizon and one about the sun, in this order.
#[derive(Debug, Clone, Copy)]
pub struct Tinted {
    luminance: Distribution,
    /// Have horizon and sun colours of their own?
    own: [bool; 2],
    /// Irradiance of open level ground by each part, together 1.
    levels: [f64; PARTS],
}

impl Tinted {
    /// A sky in which the horizon and what is about the sun may have colours of their own.
    pub(super) fn new(luminance: Distribution, own: [bool; 2]) -> Self {
        let mut tinted = Self {
            luminance,
            own,
            levels: [1.0; PARTS],
        };
        tinted.levels = match own {
            [false, false] => [1.0, 0.0, 0.0],
            _ => level(STEPS, |d| {
                tinted.shares(d).map(|share| share * luminance.radiance(d))
            }),
        };
        tinted
    }

    /// How luminance is spread.
    pub fn luminance(&self) -> &Distribution {
        &self.luminance
    }

    /// Irradiance of open level ground by each part, together 1.
    pub(super) fn levels(&self) -> [f64; PARTS] {
        self.levels
    }

    /// Shares of the parts in the luminance of a direction.
    fn shares(&self, direction: DVec3) -> [f64; PARTS] {
        let of = |own: bool, share: f64| if own { share } else { 0.0 };
        let sun = of(self.own[1], self.luminance.toward_sun(direction));
        let horizon = of(self.own[0], self.luminance.toward_horizon(direction));
        [(1.0 - horizon) * (1.0 - sun), horizon * (1.0 - sun), sun]
    }

    /// Radiance of each part, of which open level ground has an irradiance of 1.
    #[inline]
    fn radiance(&self, direction: DVec3) -> [f64; PARTS] {
        let radiance = self.luminance.radiance(direction);
        if self.own == [false, false] {
            return [radiance, 0.0, 0.0];
        }
        let shares = self.shares(direction);
        std::array::from_fn(|k| match self.levels[k] > 0.0 {
            true => radiance * shares[k] / self.levels[k],
            false => 0.0,
        })
    }
}

/// The sky of a room.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Sky {
    /// How its light is spread.
    pub dome: Dome,
    /// In words, for plans and logs.
    pub said: String,
    /// The same of the sun; none where no direct light of it is asked for.
    pub sun_said: Option<String>,
    /// Is the sun a light of the file?
    pub sun_of_file: bool,
    /// Does a map say what is below the horizon? Else it is open ground, alike in all directions.
    pub(super) below: bool,
    /// Brightness of each part, about: irradiances, together 1.
    pub(super) bright: [f64; PLACES],
}

/// What is seen of a sky in one direction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeenSky {
    /// Place of the first of the parts seen, and the radiance of each, as of [`Sky::radiance`].
    pub(crate) first: usize,
    pub(crate) radiance: [f64; PARTS],
    /// How much of that [`Sky::spot`] finds, a share.
    pub(crate) excess: f64,
    /// About how bright the rest is, as a radiance under a whole irradiance of 1.
    pub(crate) plain: f64,
    /// Density, by solid angle, with which [`Sky::spot`] finds the direction.
    pub(crate) density: f64,
}

impl Sky {
    /// Radiance of each part from a direction, and the place of the first of them: 0 from above the horizon, [`PARTS`] from below.
    #[inline]
    pub fn radiance(&self, direction: DVec3) -> (usize, [f64; PARTS]) {
        let up = direction.y > 0.0;
        let first = if up { 0 } else { PARTS };
        let radiance = match &self.dome {
            Dome::Cie(sky) if up => sky.radiance(direction),
            Dome::Spectral(sky) if up => sky.radiance(direction),
            Dome::Map(map) if up || self.below => map.radiance(direction),
            _ => [1.0 / PI, 0.0, 0.0],
        };
        (first, radiance)
    }

    /// Radiance of one part from a direction, by its place; none where it is not seen there.
    pub(crate) fn part(&self, place: Option<usize>, direction: DVec3) -> Option<f64> {
        let (first, radiance) = self.radiance(direction);
        radiance.get(place?.checked_sub(first)?).copied()
    }

    /// What comes from a direction by the formula itself, W/(m2 sr nm), where the parts only stand for it.
    pub(crate) fn exact(&self, direction: DVec3) -> Option<Spectrum> {
        match &self.dome {
            Dome::Spectral(sky) if direction.y > 0.0 => Some(sky.exact(direction)),
            _ => None,
        }
    }

    /// Is what lies below the horizon open ground, alike in all directions?
    pub(crate) fn has_even_ground(&self) -> bool {
        !self.below
    }

    /// What is seen of it in a direction.
    pub(crate) fn look(&self, direction: DVec3) -> SeenSky {
        let up = direction.y > 0.0;
        let texel = match &self.dome {
            Dome::Map(map) => Some((map, map.texel(direction))),
            Dome::Cie(_) | Dome::Spectral(_) => None,
        };
        // Spots may reach below the horizon, where open ground hides what the map shows.
        let shown = texel.filter(|_| up || self.below);
        let radiance = match shown {
            Some((map, texel)) => map.radiance_of(texel, up),
            None => self.radiance(direction).1,
        };
        let excess = shown.map_or(0.0, |(map, texel)| map.excess_share(texel));
        SeenSky {
            first: if up { 0 } else { PARTS },
            radiance,
            excess,
            plain: self.brightness(up, radiance) * (1.0 - excess),
            density: texel.map_or(0.0, |(map, texel)| map.spot_density(texel)),
        }
    }

    /// How bright these radiances of the parts above the horizon, or of those below, are, about.
    pub(crate) fn brightness(&self, up: bool, radiance: [f64; PARTS]) -> f64 {
        let first = if up { 0 } else { PARTS };
        let bright = self.bright[first..].iter().zip(radiance);
        bright.map(|(bright, radiance)| bright * radiance).sum()
    }

    /// Is each half as bright in all directions?
    pub(crate) fn is_even(&self) -> bool {
        match &self.dome {
            Dome::Cie(sky) => sky.luminance.is_even() && sky.own == [false, false],
            Dome::Spectral(_) => false,
            Dome::Map(map) => map.is_even(),
        }
    }

    /// Does it change so slowly, but for where the sun stands, that parts of it can be cut until each is even?
    pub(crate) fn is_smooth(&self) -> bool {
        !matches!(self.dome, Dome::Map(_)) || self.is_even()
    }

    /// Where it comes to a point: toward the sun; none where it does not follow that.
    pub(crate) fn peak(&self) -> Option<DVec3> {
        match &self.dome {
            Dome::Cie(sky) => {
                let sky = sky.luminance();
                Distribution::follows_sun(sky.kind()).then(|| sky.sun())
            }
            Dome::Spectral(sky) => Some(sky.sun()),
            Dome::Map(_) => None,
        }
    }

    /// Has it spots that are best looked for?
    pub(crate) fn has_spots(&self) -> bool {
        matches!(&self.dome, Dome::Map(map) if map.has_spots())
    }

    /// A direction toward what is brighter than the mean of a map, by how much it is; none where nothing is.
    pub(crate) fn spot(&self, sample: [f64; 2]) -> Option<DVec3> {
        match &self.dome {
            Dome::Map(map) => map.spot(sample),
            Dome::Cie(_) | Dome::Spectral(_) => None,
        }
    }

    /// Density, by solid angle, with which [`spot`](Self::spot) finds a direction.
    pub(crate) fn spot_density(&self, direction: DVec3) -> f64 {
        match &self.dome {
            Dome::Map(map) => map.spot_density(map.texel(direction)),
            Dome::Cie(_) | Dome::Spectral(_) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::map::Wanted;
    use super::super::picture::SkyPicture;
    use super::*;
    use crate::geometry::sampling::sequence02;

    /// The middle one of three rows is the brightest, and the horizon cuts it.
    #[test]
    fn spots_below_the_horizon_have_their_density() {
        let texels = (0..18).map(|k| [if k / 6 == 1 { 9.0 } else { 1.0 }; 3]);
        let picture = SkyPicture::shrunk(6, 3, texels.collect());
        let wanted = Wanted {
            sun: false,
            below: false,
        };
        let (map, _) = Map::new(picture, [0.2, 0.7, 0.1], 0.0, wanted);
        let sky = Sky {
            dome: Dome::Map(Arc::new(map)),
            said: String::new(),
            sun_said: None,
            sun_of_file: false,
            below: false,
            bright: [1.0 / PLACES as f64; PLACES],
        };
        let mut below = 0;
        for k in 0..64 {
            let d = sky.spot(sequence02(k, 3)).unwrap();
            let seen = sky.look(d);
            assert!(seen.density > 0.0 && seen.density == sky.spot_density(d));
            if d.y <= 0.0 {
                below += 1;
                assert_eq!((seen.excess, seen.radiance), (0.0, sky.radiance(d).1));
            }
        }
        assert!(below > 16, "{below}");
    }
}
