//! What the two sides of diffuse sheets show of each other's light.
//!
//! One number per lane tells how bright light is on an opaque surface: its irradiance. A side of a sheet has radiosity
//! `rho E + tau E'`, E' behind. So that it looks like any other surface to later steps, its light is given as the irradiance that
//! the sheet's whole reflectance and transmittance, s, would turn into that radiosity: `(rho / s) E + (tau / s) E'`, lane by lane.

use super::rows::Rows;

/// The shares of both irradiances in the light of a side, for the leaves of sheets.
#[derive(Debug, Clone, Default)]
pub struct Through {
    /// Positions among the leaves of a side and of the side behind it, ascending.
    pairs: Vec<[u32; 2]>,
    /// `rho / s` of each pair; 1 where s is 0.
    own: Rows,
    /// `tau / s`.
    across: Rows,
    /// Irradiance of the side itself, by pair, in the last solution.
    pub(crate) met: Rows,
}

impl Through {
    /// For pairs of leaves: reflectance and transmittance of their sides, and the reflectance by which their light is
    /// shown.
    pub(crate) fn new(pairs: Vec<[u32; 2]>, [rho, tau, shown]: [&Rows; 3]) -> Self {
        let (mut own, mut across) = (rho.clone(), tau.clone());
        for k in 0..pairs.len() {
            let lanes = own.row_mut(k).iter_mut().zip(across.row_mut(k));
            for ((own, across), &shown) in lanes.zip(shown.row(k)) {
                (*own, *across) = match shown > 0.0 {
                    true => (*own / shown, *across / shown),
                    false => (1.0, 0.0),
                };
            }
        }
        Self {
            pairs,
            own,
            across,
            met: Rows::default(),
        }
    }

    /// Are there sheets?
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// The shares of a leaf's own irradiance and of that behind it in its light as shown, by its position among the leaves; none
    /// where it is no sheet.
    pub fn shares(&self, place: u32) -> Option<[&[f32]; 2]> {
        let k = self.pairs.binary_search_by_key(&place, |pair| pair[0]);
        k.ok().map(|k| [self.own.row(k), self.across.row(k)])
    }

    /// Irradiance by leaf, for sheets as shown; that of their sides is kept.
    pub(crate) fn shown(&mut self, mut irradiance: Rows) -> Rows {
        self.met = Rows::zero(self.pairs.len(), irradiance.width());
        for (k, [place, _]) in self.pairs.iter().enumerate() {
            (self.met.row_mut(k)).copy_from_slice(irradiance.row(*place as usize));
        }
        for (k, [place, behind]) in self.pairs.iter().enumerate() {
            let shares = [self.own.row(k), self.across.row(k)];
            mixed(
                shares,
                irradiance.row_mut(*place as usize),
                self.met_by(*behind),
            );
        }
        irradiance
    }

    /// Irradiance of a side itself, by its position among the leaves.
    fn met_by(&self, place: u32) -> &[f32] {
        let k = self.pairs.binary_search_by_key(&place, |pair| pair[0]);
        self.met.row(k.expect("both sides of a sheet are paired"))
    }

    /// Of each side its position among the leaves, `bright` of its own irradiance, and the share of its light as shown that comes from behind.
    pub(crate) fn sides(&self, bright: impl Fn(&[f32]) -> f32) -> Vec<(u32, [f32; 2])> {
        let part = |share: &[f32], met: &[f32]| {
            let lanes: Vec<f32> = share.iter().zip(met).map(|(s, e)| s * e).collect();
            bright(&lanes)
        };
        let side = |(k, &[place, behind]): (usize, &[u32; 2])| {
            let met = self.met.row(k);
            let own = part(self.own.row(k), met);
            let across = part(self.across.row(k), self.met_by(behind));
            let share = across / (own + across).max(f32::MIN_POSITIVE);
            (place, [bright(met), share])
        };
        self.pairs.iter().enumerate().map(side).collect()
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        let rows = [&self.own, &self.across, &self.met];
        8 * self.pairs.len() + rows.map(Rows::bytes).iter().sum::<usize>()
    }
}

/// Turns the irradiance of a side into that by which it is shown, given the irradiance behind.
pub(crate) fn mixed([own, across]: [&[f32]; 2], light: &mut [f32], behind: &[f32]) {
    let shares = own.iter().zip(across);
    for ((light, behind), (own, across)) in light.iter_mut().zip(behind).zip(shares) {
        *light = own * *light + across * behind;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times s, the light as shown is the side's radiosity; a side without radiosity keeps its own light.
    #[test]
    fn what_is_shown_times_the_whole_is_what_leaves() {
        let rows = |values: [[f32; 4]; 2]| {
            let mut rows = Rows::zero(2, 4);
            for (k, row) in values.iter().enumerate() {
                rows.row_mut(k).copy_from_slice(row);
            }
            rows
        };
        let (rho, tau) = (
            [[0.5, 0.0, 0.2, 0.0], [0.3, 0.0, 0.2, 0.0]],
            [0.25, 0.4, 0.0, 0.0],
        );
        let whole = [0.75, 0.4, 0.2, 0.0];
        let mut through = Through::new(
            vec![[0, 1], [1, 0]],
            [&rows(rho), &rows([tau; 2]), &rows([whole; 2])],
        );
        let light = [[1.0, 2.0, 3.0, 4.0], [10.0, 20.0, 30.0, 40.0]];
        let shown = through.shown(rows(light));
        for k in 0..2 {
            for l in 0..3 {
                let sent = rho[k][l] * light[k][l] + tau[l] * light[1 - k][l];
                assert!((whole[l] * shown.row(k)[l] - sent).abs() < 1e-5);
            }
            assert_eq!(shown.row(k)[3], light[k][3]);
        }
        assert!(through.shares(1).is_some() && through.shares(2).is_none());
    }
}
