//! Change to tristimulus values (paper 3.3, eq. 1): A = k * sum over the bands of S a_bar.
//!
//! The factor k is the caller's: 683 lm/W for absolute values, 1 / sum(S y_bar) for a source that counts as 1.

use super::Xyz;
use crate::data::{BANDS, Spectrum};

/// `sum spectrum * weights` for X, Y, Z, without a factor.
pub fn tristimulus(spectrum: &Spectrum, weights: &[Spectrum; 3]) -> Xyz {
    weights
        .each_ref()
        .map(|w| (0..BANDS).map(|band| spectrum[band] * w[band]).sum())
}

/// The paper's K = 1 / sum(S y_bar), with which the source has Y = 1; 0 for a source without visible light.
pub fn normalization(source: &Spectrum, weights: &[Spectrum; 3]) -> f64 {
    let y = tristimulus(source, weights)[1];
    if y > 0.0 { 1.0 / y } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Observer;
    use crate::data::Grid;
    use crate::data::{Outside, named};

    #[test]
    fn k_of_d65_is_the_published_one() {
        // 100 / K for D65 scaled to 100 at 560 nm: 10566.864 (as in public spectral renderers, 360-830 nm).
        let grid = Grid::new(360.0, 830.0);
        let d65 = grid.means(&named("cie/D65").unwrap().table, Outside::Zero);
        let k = normalization(&d65, &Observer::cie1931().weights(&grid));
        assert!((1.0 / k / 10_566.864 - 1.0).abs() < 1e-4, "{}", 1.0 / k);
    }

    #[test]
    fn a_source_counts_as_one() {
        let grid = Grid::paper();
        let weights = Observer::cie1931().samples(&grid);
        for name in ["cie/C", "cie/D65", "cie/F2"] {
            let source = grid.left_edges(&named(name).unwrap().table, Outside::Zero);
            let k = normalization(&source, &weights);
            assert!((k * tristimulus(&source, &weights)[1] - 1.0).abs() < 1e-15);
        }
        assert_eq!(normalization(&[0.0; BANDS], &weights), 0.0);
    }
}
