//! What side files and extras say of a material.

use super::luminaires::ProfileWish;
use crate::data::Leaves;

/// A spectrum on the grid, and where it came from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sampled {
    /// `cie/F2` or the CSV's path as written.
    pub(crate) from: String,
    /// Band means.
    pub(crate) leaves: Leaves,
    /// Values of a CSV carry a unit; those of the registry are relative.
    pub(crate) is_csv: bool,
}

/// What is known of a material.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct MaterialSpectra {
    /// Reflectance, unit 1.
    pub(crate) reflectance: Option<Sampled>,
    /// Emission and its luminance, cd/m2, if given.
    pub(crate) emission: Option<(Sampled, Option<f64>)>,
    /// How the emission is spread, if not evenly.
    pub(crate) profile: Option<ProfileWish>,
    /// Transmittance of a pane at normal incidence, unit 1.
    pub(crate) transmittance: Option<Sampled>,
}

impl MaterialSpectra {
    /// These spectra, and where they say nothing the others.
    pub(crate) fn or(self, other: Self) -> Self {
        Self {
            reflectance: self.reflectance.or(other.reflectance),
            emission: self.emission.or(other.emission),
            profile: self.profile.or(other.profile),
            transmittance: self.transmittance.or(other.transmittance),
        }
    }
}
