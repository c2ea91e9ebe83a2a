//! What is kept between runs: one container, and what makes it safe to trust.
//!
//! | file | what |
//! |---|---|
//! | `file` | a file is whole or not there |
//! | `codec` | numbers and lists as bytes, and back without trust |
//! | `packs` | many short pieces, read when they are asked for |
//! | `container` | magic, kind, version, what stands aside, checksum |
//! | `fingerprint` | what a room is made of, part by part, as hashes |

pub mod codec;
pub mod container;
pub mod file;
pub mod fingerprint;
pub mod packs;

pub use codec::{Broken, Decoder, Encoder};
pub use container::{FileKind, read, write};
pub use fingerprint::Fingerprint;
pub use packs::Packs;
