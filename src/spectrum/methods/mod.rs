//! The other methods of the paper's section 2, behind one trait, so that all can be measured on the same work.
//!
//! | method | section | source | numbers a spectrum | product |
//! |---|---|---|---|---|
//! | [`sampling`] | 2.1.1 | weighted ordinates | n | n |
//! | [`bands`] | 2.1.1 | the same with band means | n | n |
//! | [`gauss_xyz`], [`gauss_ac1c2`], [`gauss_shared`] | 2.1.2 | Wallis 1975, Meyer 1988 | n | n |
//! | [`segments`] | 2.1.3 | Deville et al. 1994 | n | n |
//! | [`Cubics`] | 2.2.1 | Raso and Fournier 1991 | 4 a piece | 10 a piece |
//! | [`Characteristic`] | 2.2.2 | Peercy 1993 | m | m^2 |
//!
//! Where a method can take the light into its weights it does: it then represents reflectances only, and lines in the
//! light cost it nothing.

mod characteristic;
mod cubics;
mod gauss;
mod pointwise;
mod sampling;
mod segments;

pub use characteristic::{Characteristic, basis};
pub use cubics::Cubics;
pub use gauss::{gauss_ac1c2, gauss_shared, gauss_xyz};
pub use pointwise::Pointwise;
pub use sampling::{bands, sampling};
pub use segments::segments;

use super::Spectrum;
use crate::color::Xyz;

/// A way to hold spectra under one light as a few numbers.
pub trait Method {
    /// Name in tables.
    fn name(&self) -> &'static str;

    /// Numbers that hold a spectrum.
    fn terms(&self) -> usize;

    /// The light itself.
    fn light(&self) -> Vec<f64>;

    /// A reflectance, ready for [`Method::reflect`].
    fn material(&self, reflectance: &Spectrum) -> Vec<f64>;

    /// `out` becomes the spectrum after reflection; both have [`Method::terms`] numbers. Does not allocate.
    fn reflect(&self, spectrum: &[f64], material: &[f64], out: &mut [f64]);

    /// Tristimulus values.
    fn xyz(&self, spectrum: &[f64]) -> Xyz;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::de_luv;
    use crate::spectrum::study::{ColourChart, Reflectances};

    fn all(chart: &ColourChart, light: &Spectrum, n: usize) -> Vec<Box<dyn Method>> {
        let cmf = &chart.cmf;
        let mut all: Vec<Box<dyn Method>> = vec![
            Box::new(sampling(cmf, light, n)),
            Box::new(bands(cmf, light, n)),
            Box::new(gauss_xyz(cmf, light, n)),
            Box::new(gauss_ac1c2(cmf, light, n)),
            Box::new(gauss_shared(cmf, light, n)),
            Box::new(segments(cmf, light, n)),
            Box::new(Characteristic::new(cmf, light, &chart.reflectances, n)),
        ];
        all.extend(Cubics::new(cmf, light, n).map(|m| Box::new(m) as Box<dyn Method>));
        all
    }

    #[test]
    fn every_method_keeps_the_white() {
        let chart = ColourChart::new(Reflectances::Babelcolor);
        for light in chart.lights() {
            for n in [4, 6, 8, 10, 12, 16] {
                for method in all(&chart, &light.power, n) {
                    assert_eq!(method.light().len(), method.terms(), "{}", method.name());
                    assert!(
                        (method.xyz(&method.light())[1] - 1.0).abs() < 0.02,
                        "{} {n} {}: {:?}",
                        method.name(),
                        light.name,
                        method.xyz(&method.light())
                    );
                }
            }
        }
    }

    #[test]
    fn errors_of_a_smooth_reflectance_fall_with_the_number_of_terms() {
        let chart = ColourChart::new(Reflectances::Babelcolor);
        let light = chart.light("D65");
        let exact = crate::color::tristimulus(
            &std::array::from_fn(|k| light.power[k] * chart.reflectances[0][k]),
            chart.cmf.weights(),
        );
        for (few, many) in all(&chart, &light.power, 4)
            .iter()
            .zip(all(&chart, &light.power, 16))
        {
            let error = |method: &dyn Method| {
                let mut out = vec![0.0; method.terms()];
                method.reflect(
                    &method.light(),
                    &method.material(&chart.reflectances[0]),
                    &mut out,
                );
                de_luv(exact, method.xyz(&out), light.white)
            };
            let (few, many_error) = (error(few.as_ref()), error(many.as_ref()));
            assert!(
                many_error < 0.5 * few && many_error < 4.0,
                "{}: {few} {many_error}",
                many.name()
            );
        }
    }

    #[test]
    fn sixty_four_samples_are_the_reference() {
        let chart = ColourChart::new(Reflectances::Ohta);
        for light in chart.lights() {
            for method in [
                sampling(&chart.cmf, &light.power, 64),
                bands(&chart.cmf, &light.power, 64),
            ] {
                for r in &chart.reflectances {
                    let mut out = vec![0.0; 64];
                    method.reflect(&method.light(), &method.material(r), &mut out);
                    let exact = crate::color::tristimulus(
                        &std::array::from_fn(|k| light.power[k] * r[k]),
                        chart.cmf.weights(),
                    );
                    assert!((0..3).all(|a| (method.xyz(&out)[a] - exact[a]).abs() < 1e-12));
                }
            }
        }
    }
}
