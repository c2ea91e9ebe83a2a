//! From spectra to what an eye sees: observer, tristimulus values, adaptation, colour differences.

mod adaptation;
mod difference;
mod display;
mod observer;
mod tristimulus;
mod upsample;

pub use adaptation::{bradford, multiply};
pub use difference::{de_luv, de2000, lab, luv, luv_jacobian};
pub use display::{LinearSrgb, decode, encode, encode_byte};
pub use observer::{KM, Observer};
pub use tristimulus::{normalization, tristimulus};
pub use upsample::Upsampler;

/// Tristimulus values X, Y, Z; their unit is the caller's (relative, cd/m2, lx).
pub type Xyz = [f64; 3];
