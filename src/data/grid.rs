//! The 64 bands that every spectrum is held on (paper 2.1.1).
//!
//! Two ways to bring a table onto the bands: the exact band means of the piecewise linear table, and the paper's
//! convention, the value at the left edge of the band (380, 385, ... 695 nm). Units: nm.

use super::{Outside, Table};

/// Number of bands: 2^6, the finest level of every spectral tree.
pub const BANDS: usize = 64;

/// One value for each band.
pub type Spectrum = [f64; BANDS];

/// Where the bands lie on the wavelength axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Left edge of the first band, nm.
    start: f64,
    /// Width of a band, nm.
    width: f64,
}

impl Grid {
    /// Bands over `start..end` nm.
    pub fn new(start: f64, end: f64) -> Self {
        Self {
            start,
            width: (end - start) / BANDS as f64,
        }
    }

    /// The paper's range: 380 to 700 nm, 5 nm a band.
    pub fn paper() -> Self {
        Self::new(380.0, 700.0)
    }

    /// Left edge of the first band, nm.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Right edge of the last band, nm.
    pub fn end(&self) -> f64 {
        self.left(BANDS)
    }

    /// Left edge of a band, nm; `left(64)` is the end of the range.
    pub fn left(&self, band: usize) -> f64 {
        self.start + self.width * band as f64
    }

    /// Middle of a band, nm.
    pub fn middle(&self, band: usize) -> f64 {
        self.start + self.width * (band as f64 + 0.5)
    }

    /// Width of a band, nm.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// The band that holds a wavelength; the end of the range belongs to the last band.
    pub fn band_of(&self, nm: f64) -> Option<usize> {
        if !(self.start..=self.end()).contains(&nm) {
            return None;
        }
        // Not negative as nm >= start; 64 only at the very end.
        Some((((nm - self.start) / self.width) as usize).min(BANDS - 1))
    }

    /// Mean of the table over each band, exact for the piecewise linear table.
    ///
    /// ```
    /// use haarlight::{data::{Outside, Table}, spectrum::Grid};
    /// let ramp = Table::parse_csv("380,0\n700,320").unwrap();
    /// let means = Grid::paper().means(&ramp, Outside::Zero);
    /// assert_eq!(means[0], 2.5);
    /// assert_eq!(Grid::paper().left_edges(&ramp, Outside::Zero)[1], 5.0);
    /// ```
    pub fn means(&self, table: &Table, outside: Outside) -> Spectrum {
        std::array::from_fn(|band| {
            table.integral(self.left(band), self.left(band + 1), outside) / self.width
        })
    }

    /// Value of the table at the left edge of each band: the convention behind the paper's Table 1.
    pub fn left_edges(&self, table: &Table, outside: Outside) -> Spectrum {
        std::array::from_fn(|band| table.at(self.left(band), outside))
    }
}

impl Default for Grid {
    /// 380 to 780 nm, 6.25 nm a band.
    fn default() -> Self {
        Self::new(380.0, 780.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_tile_the_range() {
        for grid in [Grid::paper(), Grid::default(), Grid::new(360.0, 830.0)] {
            assert_eq!(grid.band_of(grid.start()), Some(0));
            assert_eq!(grid.band_of(grid.end()), Some(63));
            assert_eq!(grid.band_of(grid.end() + 0.1), None);
            assert_eq!(grid.band_of(f64::NAN), None);
            for band in 0..BANDS {
                assert_eq!(grid.band_of(grid.middle(band)), Some(band));
            }
        }
    }

    #[test]
    fn means_keep_the_integral() {
        let table = crate::data::named("cie/F11").unwrap().table;
        let grid = Grid::default();
        let sum: f64 = grid.means(&table, Outside::Zero).iter().sum();
        assert!((sum * grid.width() - table.integral(380.0, 780.0, Outside::Zero)).abs() < 1e-9);
    }
}
