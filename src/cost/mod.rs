//! What accuracy costs: bakes of one room over a range of errors and ways to carry spectra, with *measured* error.
//!
//! | file | what |
//! |---|---|
//! | `clock` | CPU time of the process |
//! | `run` | one bake: what it cost and how wrong it is |
//! | `sweep` | all bakes of a room against one reference |
//! | `held` | the same links with other lanes: what spectra alone do |
//! | `knob` | is the automatic balance of geometry and spectrum a good one? |
//! | `choice` | which setting to take, and why |
//! | `tables`, `plots` | CSV, Markdown, SVG |

mod choice;
pub mod clock;
mod held;
mod knob;
pub mod plots;
mod run;
mod sweep;
pub mod tables;

pub use choice::{Choice, choose};
pub use held::{HeldRun, held};
pub use knob::{KnobComparison, Pair, balance, pairs};
pub use run::{Run, Task};
pub use sweep::{Knob, Study, Sweep};
