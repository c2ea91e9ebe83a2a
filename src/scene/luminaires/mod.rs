//! Lamps that shine as their maker measured them: a [profile](super::profile) on a light of the file, on a node, or on an emissive surface.
//!
//! | file | what |
//! |---|---|
//! | `mounted` | [`Luminaire`]: which way a profile looks, and what of it a surface sends out |
//! | `wish` | what side files and extras say of profiles |
//! | `extension` | EXT_lights_ies |
//! | `surfaces` | a light for each surface that shines by a profile |
//!
//! A lamp with a profile is one of [`Scene::lights`](super::Scene::lights): its `shape` is its flux (W/nm, of luminous size
//! the lumens), its intensity that times [`Luminaire::per_lumen`]. So nothing that deals with amounts of light need know
//! how it is spread.
//!
//! How bright: the file of the profile says it, not glTF's candela; `"multiplier"` dims it, `"flux_lm"` takes the place of
//! its lumens. Which way: nadir is -Z of a light's node, C0 is +X, C90 is +Y (EXT_lights_ies and KHR_lights_punctual).
//! On a surface nadir is the mean of its normals, and C0 the +X of its node as far as it lies across that; closed
//! bodies, which have no mean normal, hang: their nadir is the node's -Y, and C0 its +X. `"turn_deg"` turns about nadir.

mod extension;
mod mounted;
mod surfaces;
mod wish;

pub(super) use extension::{IesNode, ies_node, profiles};
pub use mounted::Luminaire;
pub(super) use mounted::tilt_share;
pub(super) use surfaces::{add, remount};
pub(super) use wish::{
    LampWish, OF_EMISSION, ProfileWish, is_ours, read, read_profile, says_spectrum,
};

#[cfg(test)]
mod tests;
