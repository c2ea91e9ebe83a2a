//! Ambient cubes as a 3-D texture, KTX 2.0, in the layout of Bevy's irradiance volumes: see the module above.

use super::Probes;
use crate::output::maps::{Precision, ktx2};

/// The texture's bytes: R16G16B16A16_SFLOAT, alpha 1.
pub fn to_volume(probes: &Probes) -> Vec<u8> {
    let [nx, ny, nz] = probes.counts;
    let mut texels = Vec::with_capacity(6 * probes.cube.len());
    for p in 0..3 * nz {
        for t in 0..2 * ny {
            // The slab of an axis, its positive side first.
            let side = 2 * (p / nz) + t / ny;
            let row = nx * (t % ny + ny * (p % nz));
            let texel = |cube: &Vec<f32>| std::array::from_fn(|c| cube[3 * side + c]);
            texels.extend(probes.cube[row..row + nx].iter().map(texel));
        }
    }
    ktx2([nx, 2 * ny, 3 * nz], &texels, Precision::Half)
}
