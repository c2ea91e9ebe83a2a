//! From spectra to what an eye sees: observer, tristimulus values, adaptation, colour differences.

mod adaptation;
mod alphaopic;
mod appearance;
mod bands;
mod correlated;
mod difference;
mod display;
mod fidelity;
mod glare;
mod measures;
mod observer;
mod primaries;
mod rendering;
mod tolerance;
mod tristimulus;
mod uniformity;
mod upsample;

pub use adaptation::{bradford, multiply};
pub use alphaopic::{AlphaOpic, RECEPTORS};
pub use bands::Bands;
pub use correlated::{Correlated, GREATEST_DUV, KNOWN_KELVIN, Locus, uv_1960};
pub(crate) use difference::seen_difference;
pub use difference::{de_luv, de2000, lab, luv, luv_jacobian};
pub use display::{LinearSrgb, decode, encode, encode_byte};
pub use fidelity::{EvaluationColours, Fidelity};
pub use glare::{Bright, glare_range, position_index, unified_glare_rating};
pub use measures::{LightMeasures, MEASURES, Meter, NAMES, Undefined};
pub use observer::{KM, Observer};
pub use primaries::primaries;
pub use rendering::{GREATEST_DISTANCE, Rendering, TestColours};
pub use tolerance::{Range, Stated};
pub use tristimulus::{normalization, tristimulus};
pub use uniformity::Uniformity;
pub use upsample::Upsampler;

/// Tristimulus values X, Y, Z; their unit is the caller's (relative, cd/m2, lx).
pub type Xyz = [f64; 3];
