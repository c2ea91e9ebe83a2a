//! The `haarlight` command.

use clap::Parser;
use haarlight::cli::paper;
use std::process::ExitCode;

#[derive(Parser)]
#[command(version, about)]
enum Command {
    /// The paper's tables, measured beside printed.
    Paper(paper::PaperArgs),
}

fn main() -> ExitCode {
    let Command::Paper(args) = Command::parse();
    match paper::run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("haarlight: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
