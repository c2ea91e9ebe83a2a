//! The command line as a whole.

use super::options::Common;
use super::{bake, inspect, probe, relight, serve, spectra};
#[cfg(feature = "paper")]
use super::{cost, paper};
use crate::error::{Error, Result};

const EXAMPLES: &str = "\
Examples:
  haarlight bake room.glb                          writes room.baked.glb, exit code 0 once dE00 <= 0.5
  haarlight bake room.glb --error 1 --time 60 --snapshots pictures --log bake.jsonl
  haarlight report room.glb                        bakes too, and writes room.report.html to look at it
  haarlight serve room.glb                         shows the light in a browser as it comes, with lamps to turn
  haarlight inspect room.glb                       what is in the room, and what would be simulated
  haarlight probe room.glb --points desk.csv       lux at points (columns x,y,z,nx,ny,nz)
  haarlight spectra cie/F                          names that a room's .spectra.json may use

Exit codes: 0 done, 1 stopped before the asked-for error was reached, 2 bad input, 3 a fault of the program, 130 ended by
Ctrl-C without a file.
Results go to stdout or files, talk to stderr.";

/// Bakes light into glTF rooms in full spectrum, and says how wrong it still is.
#[derive(Debug, clap::Parser)]
#[command(name = "haarlight", version, after_help = EXAMPLES)]
#[non_exhaustive]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Options of all commands.
    #[command(flatten)]
    pub common: Common,
}

/// The commands.
#[derive(Debug, clap::Subcommand)]
#[non_exhaustive]
pub enum Command {
    /// Write the room back with its light baked in.
    Bake(bake::BakeArgs),
    /// Bake, and write a page beside the room that shows the light, how wrong it is, and what it took. Takes the options of
    /// `bake`: the same as `bake --report`.
    Report(bake::BakeArgs),
    /// Show the room in a browser while its light is worked out; turn its lamps, change its paints.
    Serve(serve::ServeArgs),
    /// Write the room back under other lamps and paints, from what a bake kept.
    Relight(relight::RelightArgs),
    /// Print what the program sees in a room. Nothing is solved.
    Inspect(inspect::InspectArgs),
    /// Irradiance at given points and normals: lux sensors.
    Probe(probe::ProbeArgs),
    /// List the spectra that rooms may name.
    Spectra(spectra::SpectraArgs),
    #[cfg(feature = "paper")]
    /// What accuracy costs on a room: measured error against time.
    Cost(cost::CostArgs),
    #[cfg(feature = "paper")]
    /// The paper's tables, measured beside printed.
    Paper(paper::PaperArgs),
}

/// Does what was asked for; the exit code.
///
/// # Errors
/// Bad input, files that cannot be read or written, faults of our own.
pub fn run(cli: &Cli) -> Result<u8> {
    if let Some(threads) = cli.common.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global()
            .map_err(|problem| Error::Internal(format!("threads: {problem}")))?;
    }
    let by_ranks = matches!(cli.command, Command::Bake(_) | Command::Report(_));
    if !by_ranks && !cli.common.team.is_alone() {
        return Err(Error::input(
            format!("{} ranks", cli.common.team.ranks()),
            "were started for a command that one does by itself: `bake` and `report` are spread over ranks",
            "start it without mpirun",
        ));
    }
    match &cli.command {
        Command::Bake(args) => bake::run(args, &cli.common),
        Command::Report(args) => bake::run(&args.clone().with_report(), &cli.common),
        Command::Serve(args) => serve::run(args, &cli.common),
        Command::Relight(args) => relight::run(args, &cli.common),
        Command::Inspect(args) => inspect::run(args, &mut std::io::stdout()).map(|()| 0),
        Command::Probe(args) => probe::run(args, &cli.common),
        Command::Spectra(args) => spectra::run(args).map(|()| 0),
        #[cfg(feature = "paper")]
        Command::Cost(args) => cost::run(args, &cli.common),
        #[cfg(feature = "paper")]
        Command::Paper(args) => paper::run(args).map(|()| 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }
}
