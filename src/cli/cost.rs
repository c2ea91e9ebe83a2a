//! `haarlight cost ROOM`: what accuracy costs on this room, measured.
//!
//! Writes `cost.csv`, `cost.md` and the plots that it shows into a folder, and prints the table and the choice.
//! `--json` prints one object instead: `{"version": 1, "choice": {...}, "runs": [...], "held": [...], "balance": [...]}`
//! with the fields of `cost::Run`, `cost::HeldRun` and `cost::KnobComparison`.

use super::options::{Common, Reading, positive};
use super::results::print;
use super::rooms::load;
use super::talk::Talk;
use crate::cost::{Knob, Sweep, choose, plots, tables};
use crate::error::{Error, Problem, Result};
use crate::solve::Representation;
use crate::store::file;
use serde_json::json;
use std::path::PathBuf;

/// Version of the JSON form.
const VERSION: u32 = 1;

/// Arguments of `cost`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  haarlight cost room.glb                          sweeps, and writes room.cost/cost.md with its plots
  haarlight cost room.glb --errors 1,0.5 --representations adaptive,uniform:12,rgb --points 100")]
#[non_exhaustive]
pub struct CostArgs {
    /// The room, .glb or .gltf.
    pub room: PathBuf,
    /// Folder for table and plots [default: ROOM's name with .cost, beside it].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// What to read.
    #[command(flatten)]
    pub reading: Reading,
    /// Errors to ask for, mean CIEDE2000.
    #[arg(long, value_name = "DE,...", value_delimiter = ',', default_values_t = [4.0, 2.0, 1.0, 0.5, 0.25], value_parser = positive)]
    pub errors: Vec<f64>,
    /// Ways to carry spectra.
    #[arg(
        long,
        value_name = "HOW,...",
        value_delimiter = ',',
        default_value = "adaptive,guaranteed,paper,uniform:16,characteristic:8,dense,rgb"
    )]
    pub representations: Vec<Representation>,
    /// Random points at which errors are measured.
    #[arg(long, value_name = "N", default_value_t = 300)]
    pub points: usize,
    /// How often each bake is run; the fastest counts.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub repeats: usize,
    /// Mean CIEDE2000 that the choice has to meet.
    #[arg(long, value_name = "DE", default_value_t = 0.5, value_parser = positive)]
    pub goal: f64,
    /// Try fixed pairs of geometric and spectral tolerance as well.
    #[arg(long)]
    pub knob: bool,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Sweeps and writes; the exit code.
///
/// # Errors
/// Problems of the room; a folder or file that cannot be written.
pub fn run(args: &CostArgs, common: &Common) -> Result<u8> {
    let talk = Talk::new(common.quiet);
    let folder = args
        .output
        .clone()
        .unwrap_or_else(|| args.room.with_extension("cost"));
    let scene = load(&args.room, &args.reading, |_| {
        let is_file = folder.exists() && !folder.is_dir();
        let problem = || {
            Problem::new(
                format!("-o {}", folder.display()),
                "is a file",
                "name a folder",
            )
        };
        is_file.then(problem).into_iter().collect()
    })?;
    scene.warnings.iter().for_each(|w| talk.warn(w));
    std::fs::create_dir_all(&folder).map_err(|problem| Error::io(&folder, problem))?;

    let sweep = Sweep {
        errors: args.errors.clone(),
        representations: args.representations.clone(),
        points: args.points.max(2),
        repeats: args.repeats,
        knob: if args.knob {
            Knob::Tried
        } else {
            Knob::LeftOut
        },
        seed: common.seed,
    };
    let study = sweep.run(&scene, &|done, of, next| {
        talk.progress(next, done, of);
    });
    talk.clear();

    let room = args
        .room
        .file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let choice = choose(&study, args.goal);
    let machine = format!(
        "{} thread(s){}.",
        rayon::current_num_threads(),
        processor().map_or(String::new(), |name| format!(" of {name}"))
    );
    let mut files = vec![
        ("cost.csv", tables::csv(&study)),
        (
            "cost.md",
            tables::markdown(&study, &choice, &room, &machine),
        ),
    ];
    let pictures = plots::all(&study, &room);
    files.extend(plots::NAMES.iter().map(|(name, _)| *name).zip(pictures));
    for (name, text) in files {
        file::write_atomic(&folder.join(name), Some(&args.room), |w| {
            w.write_all(text.as_bytes())
        })?;
    }
    if args.json {
        let all = json!({
            "version": VERSION,
            "choice": { "run": choice.run, "why": choice.why },
            "runs": study.runs,
            "held": study.held,
            "balance": study.balance,
        });
        print(&format!("{all}\n"))?;
    } else {
        let mut text = tables::runs(&study.runs).terminal();
        if !study.balance.is_empty() {
            text += &format!("\n{}", tables::balance(&study).terminal());
        }
        print(&format!("{text}\n{}", tables::choice(&choice)))?;
        talk.say(&format!("written: {}", folder.join("cost.md").display()));
    }
    Ok(0)
}

/// Name of the processor, where the system tells.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("model name"))?;
    Some(line.split(':').nth(1)?.trim().to_owned())
}
