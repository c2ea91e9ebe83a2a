//! The `haarlight` command: parse, run, exit code.

use clap::Parser;
use haarlight::cli::{Cli, guarded, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    // Ends the program by itself: 0 after --help, 2 after a mistake on the command line.
    let cli = Cli::parse();
    ExitCode::from(guarded(|| run(&cli)))
}
