//! The working partition: what each lane of a row stands for.
//!
//! Each light spectrum S(lambda) of the room is kept exactly; a lane holds the *ratio* radiosity / S on one interval of
//! that light's dyadic cut. Reflectances are averaged by the paper's eq. 3 with `S abar` in place of `abar`, so that a
//! grey room needs one lane a light, whatever its lines, and a first reflection keeps its tristimulus values.
//! Where all lights together would need more than 64 lanes, the rows hold the 64 leaves themselves.
//!
//! Units: ratio lanes are numbers that multiply S (W/m2/nm of radiosity per unit of `LightSpectrum::power`);
//! leaf lanes are W/m2/nm.

use crate::color::KM;
use crate::scene::LightSpectrum;
use crate::spectrum::{LEAVES, Leaves, Partition};

/// One lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lane {
    /// Which light's ratio; none: absolute.
    pub light: Option<usize>,
    /// First leaf of the interval.
    pub first: usize,
    /// Leaves in the interval.
    pub count: usize,
}

/// The lanes of all rows.
#[derive(Debug, Clone)]
pub struct Lanes {
    lanes: Vec<Lane>,
    /// Tristimulus value of a lane at 1: `Km integral of S abar`, or of `abar` alone.
    xyz: Vec<[f64; 3]>,
    power: Vec<Leaves>,
    weights: [Leaves; 3],
}

impl Lanes {
    /// One cut a light; falls back to [`Lanes::dense`] beyond 64 lanes. `weights` are the integrals of the colour
    /// matching functions over the leaves, nm.
    pub fn ratio(spectra: &[LightSpectrum], cuts: &[Partition], weights: &[Leaves; 3]) -> Self {
        debug_assert_eq!(spectra.len(), cuts.len());
        if cuts.iter().map(|c| c.count()).sum::<usize>() > LEAVES {
            return Self::dense(spectra, weights);
        }
        let lanes = cuts.iter().enumerate().flat_map(|(light, cut)| {
            cut.iter().map(move |(first, count)| Lane {
                light: Some(light),
                first,
                count,
            })
        });
        Self::with(lanes.collect(), spectra, weights)
    }

    /// The ratio to one light on every leaf; other lights are left out.
    pub fn only(spectra: &[LightSpectrum], light: usize, weights: &[Leaves; 3]) -> Self {
        let lanes = (0..LEAVES).map(|first| Lane {
            light: Some(light),
            first,
            count: 1,
        });
        Self::with(lanes.collect(), spectra, weights)
    }

    /// The 64 leaves, all lights together.
    pub fn dense(spectra: &[LightSpectrum], weights: &[Leaves; 3]) -> Self {
        let lanes = (0..LEAVES).map(|first| Lane {
            light: None,
            first,
            count: 1,
        });
        Self::with(lanes.collect(), spectra, weights)
    }

    /// These lanes.
    pub(super) fn with(lanes: Vec<Lane>, spectra: &[LightSpectrum], weights: &[Leaves; 3]) -> Self {
        let power: Vec<Leaves> = spectra.iter().map(|s| s.power).collect();
        let xyz = lanes
            .iter()
            .map(|lane| {
                let leaves = lane.first..lane.first + lane.count;
                weights.map(|w| {
                    KM * leaves
                        .clone()
                        .map(|k| w[k] * lane.light.map_or(1.0, |l| power[l][k]))
                        .sum::<f64>()
                })
            })
            .collect();
        Self {
            lanes,
            xyz,
            power,
            weights: *weights,
        }
    }

    /// Number of lanes in use.
    pub fn len(&self) -> usize {
        self.lanes.len()
    }

    /// No lane at all (a room without light)?
    pub fn is_empty(&self) -> bool {
        self.lanes.is_empty()
    }

    /// The lanes.
    pub fn lanes(&self) -> &[Lane] {
        &self.lanes
    }

    /// Tristimulus value of each lane at 1 (lm/m2 for radiosity).
    pub fn xyz(&self) -> &[[f64; 3]] {
        &self.xyz
    }

    /// What each lane holds of a smooth factor (a reflectance, a lamp's shape): eq. 3 under the lane's light.
    pub fn averages(&self, f: &Leaves, out: &mut [f32]) {
        for (out, lane) in out.iter_mut().zip(&self.lanes) {
            *out = self.average(f, lane) as f32;
        }
    }

    fn average(&self, f: &Leaves, lane: &Lane) -> f64 {
        let leaves = lane.first..lane.first + lane.count;
        let Some(light) = lane.light else {
            return f[lane.first];
        };
        let first = f[lane.first];
        // Exactly flat stays exactly flat: a grey room must not pick up rounding.
        if leaves.clone().all(|k| f[k] == first) {
            return first;
        }
        let (mut over, mut under) = (0.0, 0.0);
        for w in &self.weights {
            let (mut whole, mut part) = (0.0, 0.0);
            for k in leaves.clone() {
                let weight = w[k] * self.power[light][k];
                whole += weight;
                part += weight * f[k];
            }
            over += whole * part;
            under += whole * whole;
        }
        if under > 0.0 {
            over / under
        } else {
            leaves.map(|k| f[k]).sum::<f64>() / lane.count as f64
        }
    }

    /// Adds an emission of `light` with a shape (see [`crate::scene::Emission`]).
    pub fn add_emission(&self, light: usize, shape: &Leaves, scale: f64, out: &mut [f32]) {
        for (out, lane) in out.iter_mut().zip(&self.lanes) {
            match lane.light {
                Some(l) if l == light => *out += (scale * self.average(shape, lane)) as f32,
                Some(_) => {}
                None => *out += (scale * self.power[light][lane.first] * shape[lane.first]) as f32,
            }
        }
    }

    /// Tristimulus values of a row.
    pub fn tristimulus(&self, row: &[f32]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (x, w) in row.iter().zip(&self.xyz) {
            for (s, w) in sum.iter_mut().zip(w) {
                *s += f64::from(*x) * w;
            }
        }
        sum
    }

    /// Tristimulus values of a row after one more reflection, with the reflectance at full resolution.
    pub fn reflected(&self, reflectance: &Leaves) -> Vec<[f64; 3]> {
        self.lanes
            .iter()
            .map(|lane| {
                let leaves = lane.first..lane.first + lane.count;
                self.weights.map(|w| {
                    KM * leaves
                        .clone()
                        .map(|k| {
                            reflectance[k] * w[k] * lane.light.map_or(1.0, |l| self.power[l][k])
                        })
                        .sum::<f64>()
                })
            })
            .collect()
    }

    /// The 64 leaf values of a row, W/m2/nm.
    pub fn leaves(&self, row: &[f32]) -> Leaves {
        let mut out = [0.0; LEAVES];
        for (x, lane) in row.iter().zip(&self.lanes) {
            for (k, out) in out.iter_mut().enumerate().skip(lane.first).take(lane.count) {
                *out += f64::from(*x) * lane.light.map_or(1.0, |l| self.power[l][k]);
            }
        }
        out
    }
}
