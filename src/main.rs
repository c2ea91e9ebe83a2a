//! The `haarlight` command: parse, run, exit code.

use clap::Parser;
use haarlight::cli::{Cli, guarded, run};
use haarlight::team::Job;
use std::process::ExitCode;

fn main() -> ExitCode {
    // Ends the program by itself: 0 after --help, 2 after a mistake on the command line.
    let mut cli = Cli::parse();
    let mut job = Job::default();
    let joined = guarded(job.team(), || {
        job = Job::join()?;
        Ok(0)
    });
    if joined != 0 {
        return ExitCode::from(joined);
    }
    cli.common.team = job.team();
    let code = guarded(job.team(), || run(&cli));
    ExitCode::from(job.end(code))
}
