//! A file of photometric data, of whichever kind.

use super::{Fault, Profile, eulumdat, lm63, numbers};

impl Profile {
    /// A profile from the bytes of a file, LM-63 or EULUMDAT, told apart by content.
    ///
    /// # Errors
    /// The first [`Fault`] of the file.
    pub fn parse(bytes: &[u8]) -> Result<Self, Fault> {
        let text = numbers::decoded(bytes);
        if lm63::is_lm63(&text) {
            lm63::parse(&text)
        } else {
            eulumdat::parse(&text)
        }
    }
}
