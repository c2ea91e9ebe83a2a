//! The sky over a room and the sun in it.
//!
//! | file | what |
//! |---|---|
//! | `cie` | how luminance lies over the dome: ISO 15469 |
//! | `hosek`, `mixture` | radiance over the dome by wavelength: Hosek and Wilkie; the three spectra that stand for it |
//! | `picture`, `map`, `disc` | a picture of all directions in its place, and the sun in it |
//! | `parts` | of how many spectra |
//! | `dome` | all of these: what comes from each direction |
//! | `sun` | where the sun stands |
//! | `wish` | what a side file or a command line says of sky and sun |
//! | `light` | what the sky shines with |
//! | `lamps` | the lamps that this makes: sky, ground below the horizon, sun |
//! | `alone` | the room under its sky alone |
//!
//! Up is +Y, as glTF has it; north is -Z, so that east is +X, unless `north_deg` says otherwise. Azimuths run clockwise seen
//! from above: from north over east.
//!
//! The sky stands in [`Scene::lights`](super::Scene::lights) like other lamps, of kinds that say how its light arrives: one lamp for each
//! of up to three spectra that its light is a sum of. Its shape there is the illuminance of open level ground in lux; [`Sky`] says how
//! that is spread over the dome. Rays that leave the room downwards meet open ground, lit by sky and sun and reflecting alike in
//! all directions and wavelengths, or what a map shows there.

mod alone;
mod cie;
mod disc;
mod dome;
mod hosek;
mod lamps;
mod light;
mod map;
mod mixture;
mod parts;
mod picture;
mod sun;
mod under;
mod wish;

pub use cie::Distribution;
pub use dome::{Dome, SUN_RADIUS, Sky, Tinted};
pub use hosek::Hosek;
pub(super) use lamps::LIT_GROUND;
pub(crate) use lamps::join;
pub use map::Map;
pub use mixture::Spectral;
pub use parts::{PARTS, PLACES};
pub use sun::{Hours, direction};
pub use wish::{BRIGHT, KELVIN, SUN_KELVIN, TURN};
pub use wish::{SkyBrightness, SkyName, SkyType, SkyWish, SunPlace, SunWish};
