//! How many spectra the light of a sky is a sum of.

/// Spectra of a sky at the most.
pub const PARTS: usize = 3;
/// The same above the horizon and, after these, below it.
pub const PLACES: usize = 2 * PARTS;
