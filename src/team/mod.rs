//! Several processes (ranks) that bake one room together: who works out what, and how all of them learn it.
//!
//! | file | what |
//! |---|---|
//! | `ranks` | shares of receivers, and the exchange of what was found at them |
//! | `packed` | results as bytes |
//! | `exchange` | the one message that ranks send |
//! | `interrupt` | work that is given up |
//! | `job` | joining and leaving the job of an MPI launcher (cargo feature `mpi`) |
//!
//! Scene, hierarchy and light are on every rank; the rows of a receiver (what its rays met) only on the one that owns it. A sum never
//! crosses receivers before it is exchanged, and whatever is decided is decided from what all ranks hold: so every rank comes
//! to the same decisions, and the file is the same byte by byte for any number of ranks. A rank that is alone exchanges
//! nothing.

mod exchange;
mod interrupt;
mod job;
mod packed;
mod ranks;

pub use interrupt::{Asked, Interrupt, Interrupted, NEVER};
pub use job::Job;
pub use packed::Packed;
pub use ranks::Team;
