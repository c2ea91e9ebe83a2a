//! Stand-in for the colour module, for this branch alone.

mod display;

pub use display::{LinearSrgb, decode, encode, encode_byte};

/// Tristimulus values.
pub type Xyz = [f64; 3];
