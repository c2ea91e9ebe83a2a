//! What is kept of a finished bake, and the same room under other lamps and paints.

mod probe;
mod relight;
mod relit;

pub use relight::{Relighter, Relit, RelitRecord};
