//! What the unit tests of this module share.

use super::{CmfTree, Grid, Spectrum};
use crate::color::Observer;
use proptest::prelude::*;

/// The paper's colour matching functions.
pub(crate) fn cmf() -> CmfTree {
    CmfTree::new(Observer::cie1931().samples(&Grid::paper()))
}

/// Any reflectance, smooth or rough.
pub(crate) fn patch() -> impl Strategy<Value = Spectrum> {
    (prop::array::uniform32(0.0..1.0f64), 1usize..64)
        .prop_map(|(v, step)| std::array::from_fn(|k| v[(k * step / 63) % 32]))
}
