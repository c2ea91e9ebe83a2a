//! How a lamp's light is spread over directions, as its maker measured it.
//!
//! | file | what |
//! |---|---|
//! | `table` | [`Profile`]: intensities over two angles, looked up, integrated, unfolded by symmetry |
//! | `numbers` | text of a file, number by number, with its lines |
//! | `lm63` | IES LM-63 (`.ies`) |
//! | `eulumdat` | EULUMDAT (`.ldt`) |

mod eulumdat;
mod lm63;
mod numbers;
mod table;

pub use table::{Angles, Profile, Symmetry};

/// What is wrong with a file of photometric data, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Line of the file, from 1.
    pub line: usize,
    /// What is wrong there.
    pub what: String,
    /// What to do about it.
    pub next: String,
}

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

#[cfg(test)]
mod tests;
