//! How many samples a look takes: as many as the surface that it stands for is worth.
//!
//! What is asked for is a mean over surfaces. With n samples a look costs n and errs by `n^(-3/4)`, so for a given mean square over surfaces all looks
//! together cost least where n goes with the area that each stands for to the power 2/5. Half of the vertices of a furnished room lie on a
//! hundredth of its surface (garage .8 %, home theatre 1.2, living room 3.1): to the same error all of them together take a third of the samples.

/// The error of a look falls with this power of the number of its samples, see [`Hemisphere`](crate::transport::hemisphere::Hemisphere).
const POWER: f64 = 0.75;
/// The number of samples goes with this power of the area.
const SHARE: f64 = 1.0 / (1.0 + 2.0 * POWER);
/// Powers of two times the usual number at the least, and at the most. With an eighth in place of a quarter a garage
/// is as far off (`--error 1`, two seeds: .71 and .71 dE00 for .69 and .77), in the same time within what that varies by: much of a look is the walk to lamps.
const RANGE: [f64; 2] = [-2.0, 2.0];

/// How many samples a look takes, a power of two times the usual number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(crate) struct Effort(i8);

impl Effort {
    /// For a look that stands for this area where `typical` is that of the usual effort, see [`typical`].
    pub(crate) fn worth(area: f64, typical: f64) -> Self {
        if area <= 0.0 || typical <= 0.0 {
            return Self::default();
        }
        let power = SHARE * (area / typical).log2();
        Self(power.round().clamp(RANGE[0], RANGE[1]) as i8)
    }

    /// Samples, a multiple of the usual number.
    pub(crate) fn samples(self) -> f64 {
        f64::from(self.0).exp2()
    }

    /// Error by chance, a multiple of the usual one.
    pub(crate) fn noise(self) -> f64 {
        self.samples().powf(-POWER)
    }
}

/// The area that is worth the usual effort: then the mean square error over these areas is that of the usual effort for all.
pub(crate) fn typical(areas: impl Iterator<Item = f64>) -> f64 {
    let [sum, worth] = areas.fold([0.0; 2], |[sum, worth], area| {
        [sum + area, worth + area.powf(SHARE)]
    });
    match worth > 0.0 {
        true => (sum / worth).powf(1.0 / (1.0 - SHARE)),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tenth of the looks stands for nine tenths of the surface.
    #[test]
    fn the_mean_square_error_is_that_of_the_usual_effort_and_the_work_is_less() {
        let areas: Vec<f64> = (0..1000)
            .map(|k| if k % 10 == 0 { 81.0 } else { 1.0 })
            .collect();
        let typical = typical(areas.iter().copied());
        let efforts = || {
            areas
                .iter()
                .map(|&area| (area, Effort::worth(area, typical)))
        };
        let square = |(area, effort): (f64, Effort)| area * effort.noise().powi(2);
        let error: f64 = efforts().map(square).sum();
        let error = error / areas.iter().sum::<f64>();
        let work: f64 = efforts().map(|(_, effort)| effort.samples()).sum();
        assert!((error - 1.0).abs() < 0.2, "{error}");
        assert!(work < 0.5 * areas.len() as f64, "{work}");
    }

    #[test]
    fn what_has_no_area_has_the_usual_effort() {
        assert_eq!(Effort::worth(0.0, 1.0), Effort::default());
        assert_eq!(Effort::worth(1.0, 0.0), Effort::default());
        assert_eq!(typical(std::iter::empty()), 0.0);
        assert_eq!(Effort::worth(1e-300, 1.0).samples(), 0.25);
        assert_eq!(Effort::worth(1e300, 1.0).samples(), 4.0);
    }
}
