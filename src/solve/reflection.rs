//! How the leaves reflect: lane by lane, or by a matrix per paint where lanes reflect into each other; and what passes
//! sheets.

use super::linear;
use super::mixed::Mixed;
use crate::light::lanes::Lanes;
use crate::light::{Rows, Through};

/// What turns irradiance of the leaves into radiosity.
pub(super) struct Reflection {
    /// Reflectance by leaf.
    pub(super) rows: Rows,
    /// Greatest reflectance of each lane.
    pub(super) greatest: Vec<f32>,
    /// Matrices of the paints, where lanes are not bands.
    pub(super) mixed: Option<Mixed>,
    /// What passes sheets; none where lanes are not bands.
    pub(super) sheets: Option<Sheets>,
}

/// Transmittance of the leaves of diffuse sheets.
#[derive(Debug, Clone)]
pub(crate) struct Sheets {
    /// Positions among the leaves of a side and of the side behind it, ascending.
    pub pairs: Vec<[u32; 2]>,
    /// Transmittance of each pair.
    pub through: Rows,
    /// How the light of these sheets is shown.
    pub shown: Through,
}

impl Reflection {
    /// The greatest share of irradiance that leaves a leaf, by lane.
    pub(super) fn greatest<const L: usize>(&self) -> [f64; L] {
        match &self.mixed {
            Some(mixed) => [mixed.greatest; L],
            None => std::array::from_fn(|l| self.greatest.get(l).map_or(0.0, |&s| f64::from(s))),
        }
    }

    /// What is reflected of an irradiance.
    pub(super) fn of<const L: usize>(&self, irradiance: &Rows) -> Rows {
        let mut sent = match &self.mixed {
            Some(mixed) => mixed.reflect::<L>(irradiance),
            None => product::<L>(irradiance, &self.rows),
        };
        if let Some(sheets) = &self.sheets {
            let met = irradiance.all::<L>();
            let passes = sheets.pairs.iter().zip(sheets.through.all::<L>());
            for ([place, behind], through) in passes {
                let row = &mut sent.all_mut::<L>()[*place as usize];
                let met = &met[*behind as usize];
                *row = std::array::from_fn(|l| row[l] + through[l] * met[l]);
            }
        }
        sent
    }

    /// Scales irradiance so that no energy is lost: by the [`linear::amplitude`] of both sums, lane by lane.
    pub(super) fn scale<const L: usize>(
        &self,
        lanes: &Lanes,
        irradiance: &mut Rows,
        [over, without]: [[f64; L]; 2],
    ) {
        if self.mixed.is_some() {
            // Where lanes are not bands, energy is kept on each of the 64 bands.
            let spectrum_of = |sum: [f64; L]| lanes.spectrum(&sum.map(|x| x as f32));
            let (over, without) = (spectrum_of(over), spectrum_of(without));
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

    /// The albedo of every leaf and lane under the light of the solution: of the light that meets a sheet, the share that leaves it
    /// on either side. Where lanes reflect into each other it is reflected over received light.
    pub(super) fn albedo<const L: usize>(mut self, reflected: &Rows, irradiance: &Rows) -> Rows {
        if self.mixed.is_some() {
            let rows = self.rows.all_mut::<L>().iter_mut();
            for ((rho, r), h) in rows.zip(reflected.all::<L>()).zip(irradiance.all::<L>()) {
                *rho = std::array::from_fn(|l| if h[l] == 0.0 { 0.0 } else { r[l] / h[l] });
            }
        }
        if let Some(sheets) = &self.sheets {
            for ([place, _], through) in sheets.pairs.iter().zip(sheets.through.all::<L>()) {
                let rho = &mut self.rows.all_mut::<L>()[*place as usize];
                *rho = std::array::from_fn(|l| rho[l] + through[l]);
            }
        }
        self.rows
    }
}

/// `x y`, element by element.
fn product<const L: usize>(x: &Rows, y: &Rows) -> Rows {
    let mut out = x.clone();
    for (x, y) in out.all_mut::<L>().iter_mut().zip(y.all::<L>()) {
        *x = std::array::from_fn(|l| x[l] * y[l]);
    }
    out
}
