//! How the leaves reflect: lane by lane, or by a matrix a paint where lanes reflect into each other.

use super::mixed::Mixed;
use super::{conjugate, linear};
use crate::light::Rows;
use crate::light::lanes::Lanes;

/// What turns irradiance of the leaves into radiosity.
pub(super) struct Reflection {
    /// Reflectance by leaf.
    pub(super) rows: Rows,
    /// Greatest reflectance of each lane.
    pub(super) greatest: Vec<f32>,
    /// Matrices of the paints, where lanes are no bands.
    pub(super) mixed: Option<Mixed>,
}

impl Reflection {
    /// What is reflected of an irradiance.
    pub(super) fn of<const L: usize>(&self, irradiance: &Rows) -> Rows {
        match &self.mixed {
            Some(mixed) => mixed.reflect::<L>(irradiance),
            None => conjugate::product::<L>(irradiance, &self.rows),
        }
    }

    /// Scales what arrives so that no energy goes missing: by the [`linear::amplitude`] of both sums, lane by lane.
    pub(super) fn scale<const L: usize>(
        &self,
        lanes: &Lanes,
        irradiance: &mut Rows,
        [over, without]: [[f64; L]; 2],
    ) {
        if self.mixed.is_some() {
            // Lanes are no bands: it is each of the 64 leaves that keeps its energy.
            let leaves_of = |sum: [f64; L]| lanes.leaves(&sum.map(|x| x as f32));
            let (over, without) = (leaves_of(over), leaves_of(without));
            let scale = std::array::from_fn(|k| linear::amplitude(over[k], without[k]));
            let whole = vec![0; irradiance.len()];
            *irradiance = Mixed::new(&[scale], whole, lanes, L).reflect::<L>(irradiance);
        } else {
            let scale: [f32; L] =
                std::array::from_fn(|l| linear::amplitude(over[l], without[l]) as f32);
            for row in irradiance.all_mut::<L>() {
                *row = std::array::from_fn(|l| row[l] * scale[l]);
            }
        }
    }

    /// The albedo of every leaf and lane under the light of the solution. Where lanes reflect into each other that is what
    /// came back of what came in.
    pub(super) fn albedo<const L: usize>(mut self, reflected: &Rows, irradiance: &Rows) -> Rows {
        if self.mixed.is_some() {
            let rows = self.rows.all_mut::<L>().iter_mut();
            for ((rho, r), h) in rows.zip(reflected.all::<L>()).zip(irradiance.all::<L>()) {
                *rho = std::array::from_fn(|l| if h[l] == 0.0 { 0.0 } else { r[l] / h[l] });
            }
        }
        self.rows
    }
}
