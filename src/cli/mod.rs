//! The commands, one a file.
//!
//! | file | what |
//! |---|---|
//! | `command` | the command line as a whole, exit codes |
//! | `options` | options that commands share |
//! | `bake`, `relight`, `inspect`, `probe`, `spectra`, `cost`, `serve`, `paper` | the commands |
//! | `bake_args`, `baking` | what a bake is asked for, and its steps |
//! | `rooms` | reading and preparing rooms |
//! | `log` | the log of a bake, field by field |
//! | `report` | the page of a bake |
//! | `snapshots` | pictures of the rounds |
//! | `parting` | layers of lamps and probes of a bake |
//! | `maps` | light maps of a bake, and what may be asked of them |
//! | `metrics` | figures of lighting practice for `probe` and for the log |
//! | `glare` | glare at viewpoints, the same |
//! | `pictures` | plan and spectra of a room for `inspect` |
//! | `points` | the CSV of points for `probe` |
//! | `stop` | Ctrl-C and `--time` |
//! | `paths` | checks on output files |
//! | `results` | what goes to stdout |
//! | `talk` | lines and bars on stderr |
//! | `fault` | panics become exit code 3 |

pub mod bake;
mod bake_args;
mod baking;
mod command;
#[cfg(feature = "paper")]
pub mod cost;
mod fault;
mod glare;
pub mod inspect;
pub mod log;
pub mod maps;
mod metrics;
pub mod options;
#[cfg(feature = "paper")]
pub mod paper;
mod parting;
mod paths;
mod pictures;
pub mod points;
pub mod probe;
pub mod relight;
mod report;
mod results;
mod rooms;
pub mod serve;
mod sky;
mod snapshots;
pub mod spectra;
pub mod stop;
mod summary;
pub mod talk;

pub use command::{Cli, Command, run};
pub use fault::guarded;
