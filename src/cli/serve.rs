//! `haarlight serve ROOM`: the light of a room in a browser, while it is worked out.
//!
//! The address goes to stdout, with the token that all requests need. Ctrl-C ends the program; nothing is left behind but
//! files that were saved.

use super::options::{Common, Reading, Showing, Storing, positive};
use super::paths;
use super::results::print;
use super::rooms::load;
use super::stop::KILLED;
use super::talk::Talk;
use crate::error::{Error, Problem, Result};
use crate::serve::{ServeOptions, Server};
use crate::solve::{Representation, Settings};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `serve`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  haarlight serve room.glb                       opens the browser
  haarlight serve room.glb --no-open --port 8017 prints the address only; Ctrl-C ends it")]
#[non_exhaustive]
pub struct ServeArgs {
    /// The room, .glb or .gltf.
    pub room: PathBuf,
    /// What \"Save\" writes [default: ROOM's name with .baked.glb, beside it].
    #[arg(short, long, value_name = "OUT.glb")]
    pub output: Option<PathBuf>,
    /// Port of 127.0.0.1 [default: one that is free].
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub port: u16,
    /// Only print the address.
    #[arg(long)]
    pub no_open: bool,
    /// What to read.
    #[command(flatten)]
    pub reading: Reading,
    /// Mean colour difference (CIEDE2000) at which to stop.
    #[arg(long, value_name = "DE", default_value_t = 0.5, value_parser = positive)]
    pub error: f64,
    /// How it is shown.
    #[command(flatten)]
    pub showing: Showing,
    /// How it is stored.
    #[command(flatten)]
    pub storing: Storing,
    /// How spectra are carried, see `bake`.
    #[arg(long, value_name = "HOW", default_value_t, hide_short_help = true)]
    pub spectrum: Representation,
}

/// Serves; the exit code.
///
/// # Errors
/// As [`bake`](super::bake::run); a port that cannot be had.
pub fn run(args: &ServeArgs, common: &Common) -> Result<u8> {
    let talk = Talk::new(common.quiet);
    let output = args
        .output
        .clone()
        .unwrap_or_else(|| args.room.with_extension("baked.glb"));
    talk.phase("reading");
    let scene = load(&args.room, &args.reading, |parts| {
        problems(args, &output, parts)
    })?;
    scene.warnings.iter().for_each(|w| talk.warn(w));
    let server = Server::open(args.port, args.error)?;
    let (end, twice) = (server.end(), AtomicBool::new(false));
    ctrlc::set_handler(move || {
        if twice.swap(true, Ordering::SeqCst) {
            std::process::exit(KILLED.into());
        }
        end();
    })
    .map_err(|problem| Error::Internal(format!("Ctrl-C: {problem}")))?;
    let wishes = ServeOptions {
        settings: Settings {
            error: args.error,
            representation: args.spectrum,
            seed: common.seed,
            ..Settings::default()
        },
        options: args.reading.options(),
        output,
        brightness: args.showing.exposure,
        balance: args.showing.white_balance,
        writing: args.storing.writing(),
    };
    talk.clear();
    print(&(server.address() + "\n"))?;
    talk.say("Ctrl-C ends it");
    let ticket = server.ticket();
    if !args.no_open && !opened(&ticket) {
        talk.say("no browser could be opened: open the address above");
    }
    server.run(scene, wishes)?;
    Ok(0)
}

/// Opens an address in the user's browser, as far as can be told.
fn opened(address: &str) -> bool {
    let (program, first): (&str, &[&str]) = if cfg!(windows) {
        ("cmd", &["/C", "start", ""])
    } else if cfg!(target_os = "macos") {
        ("open", &[])
    } else {
        ("xdg-open", &[])
    };
    let mut command = Command::new(program);
    let command = command.args(first).arg(address);
    let silent = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    silent.spawn().is_ok()
}

/// What is wrong with the file that is to be written.
fn problems(args: &ServeArgs, output: &Path, parts: &[PathBuf]) -> Vec<Problem> {
    let beside = args.room.with_extension("spectra.json");
    let spectra = args.reading.spectra.as_deref().unwrap_or(&beside);
    let mut inputs = vec![args.room.as_path(), spectra];
    inputs.extend(parts.iter().map(PathBuf::as_path));
    let mut problems = paths::problems(&[("-o", output)], &inputs);
    problems.extend(paths::not_glb(output, "baked"));
    problems
}
