//! How a lamp's light is spread over directions, as its maker measured it.
//!
//! | file | what |
//! |---|---|
//! | `table` | [`Profile`]: intensities over two angles, looked up, integrated, unfolded by symmetry |
//! | `file` | a file of either kind |
//! | `numbers` | text of a file, number by number, with its lines |
//! | `lm63` | IES LM-63 (`.ies`) |
//! | `eulumdat` | EULUMDAT (`.ldt`) |

mod eulumdat;
mod fault;
mod file;
mod lm63;
mod numbers;
mod table;

pub use fault::Fault;
pub use table::{Angles, Profile, Symmetry};

#[cfg(test)]
mod tests;
