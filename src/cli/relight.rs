//! `haarlight relight ROOM`: the room under other lamps and paints, from what `bake --cache` kept; no ray is cast.
//!
//! `--json` prints one object:
//!
//! | field | unit | what |
//! |---|---|---|
//! | `record`, `version` | | `relit`; version of the log's format |
//! | `changed` | | did lamps or paints change since the bake? |
//! | `intervals_working`, `iterations` | | wavelength intervals of the working partition; operator applications of the solve |
//! | `error_de2000` | dE00 | estimate: see [`RelitRecord`] |
//! | `flux` | lm | as in the log of a bake, see [`log`](super::log) |
//! | `lanes_s`, `direct_s`, `solve_s`, `gather_s` | s | choice of intervals, direct light of the leaves, solve, light of the vertices |
//! | `load_s`, `open_s`, `write_s`, `total_s` | s | reading the room, the cache, writing, all together |
//! | `glb`, `vertices`, `triangles`, `exposure`, `white` | | as in the verdict of a bake |

use super::options::{Common, Reading, Showing, Storing};
use super::paths;
use super::paths::text;
use super::results::print;
use super::rooms::{load, write_npz};
use super::talk::Talk;
use crate::error::{Error, Problem, Result};
use crate::keep::{Relighter, RelitRecord};
use crate::output::{Exposure, baked_glb, camera};
use crate::solve::record::LOG_VERSION;
use crate::store::file;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `relight`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  haarlight bake room.glb --cache
  haarlight relight room.glb                     after lamps, spectra or paints of room.glb were changed
  haarlight relight room.glb --spectra evening.spectra.json -o evening.glb")]
#[non_exhaustive]
pub struct RelightArgs {
    /// The room, of the same shape as when it was baked.
    pub room: PathBuf,
    /// What the bake kept [default: ROOM's name with .cache, beside it].
    #[arg(long, value_name = "FILE")]
    pub cache: Option<PathBuf>,
    /// The relit room [default: ROOM's name with .baked.glb, beside it].
    #[arg(short, long, value_name = "OUT.glb")]
    pub output: Option<PathBuf>,
    /// What to read.
    #[command(flatten)]
    pub reading: Reading,
    /// How it is shown.
    #[command(flatten)]
    pub showing: Showing,
    /// How it is stored.
    #[command(flatten)]
    pub storing: Storing,
    /// Positions, normals and spectra of all vertices for NumPy.
    #[arg(long, value_name = "FILE")]
    pub npz: Option<PathBuf>,
    /// Print what it took as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Line<'a> {
    #[serde(flatten)]
    record: &'a RelitRecord,
    version: u32,
    /// The relit room.
    glb: String,
    vertices: usize,
    triangles: usize,
    exposure: Exposure,
    /// Tristimulus irradiance of the adaptation white, lm/m2.
    white: [f64; 3],
    /// Seconds: reading the room, the cache, writing, and all together.
    load_s: f64,
    open_s: f64,
    write_s: f64,
    total_s: f64,
}

/// Relights; the exit code.
///
/// # Errors
/// As [`bake`](super::bake::run); a cache that is none, is damaged, or belongs to a room of another shape.
pub fn run(args: &RelightArgs, common: &Common) -> Result<u8> {
    let started = Instant::now();
    let talk = Talk::new(common.quiet);
    let cache = args
        .cache
        .clone()
        .unwrap_or_else(|| paths::cache_of(&args.room));
    let output = args
        .output
        .clone()
        .unwrap_or_else(|| args.room.with_extension("baked.glb"));
    talk.phase("reading");
    let scene = load(&args.room, &args.reading, |parts| {
        problems(args, &output, &cache, parts)
    })?;
    scene.warnings.iter().for_each(|w| talk.warn(w));
    let load_s = started.elapsed().as_secs_f64();
    let clock = Instant::now();
    talk.phase("opening the cache");
    let mut room = Relighter::open(&cache, scene)?;
    let open_s = clock.elapsed().as_secs_f64();
    talk.phase("relighting");
    let relit = room.relight()?;
    let clock = Instant::now();
    talk.phase("writing");
    let (bake, baked) = (room.bake(), &relit.baked);
    let cameras = camera::cameras(bake.scene());
    let exposure = args.showing.of(bake.scene(), &baked.surfaces, &cameras);
    let glb = baked_glb(
        bake.scene(),
        &baked.surfaces,
        &exposure,
        args.storing.writing(),
    )?;
    glb.warnings.iter().for_each(|w| talk.warn(w));
    file::write_atomic(&output, Some(&args.room), |w| w.write_all(&glb.bytes))?;
    if let Some(path) = &args.npz {
        write_npz(path, &args.room, bake, baked)?;
    }
    let line = Line {
        record: &relit.record,
        version: LOG_VERSION,
        glb: text(&output),
        vertices: glb.vertices,
        triangles: glb.triangles,
        exposure,
        white: bake.light().white,
        load_s,
        open_s,
        write_s: clock.elapsed().as_secs_f64(),
        total_s: started.elapsed().as_secs_f64(),
    };
    talk.clear();
    talk.say(&summary(&line));
    talk.count_warnings();
    if args.json {
        let line = serde_json::to_string(&line)
            .map_err(|problem| Error::Internal(format!("relit: {problem}")))?;
        print(&(line + "\n"))?;
    }
    Ok(0)
}

fn summary(line: &Line) -> String {
    let r = line.record;
    let error = r
        .error_de2000
        .value
        .map_or("not known".into(), |e| format!("{e:.3} (estimate)"));
    let changed = if r.changed {
        "other lamps or paints"
    } else {
        "nothing changed"
    };
    format!(
        "relit, {changed}: dE00 {error}, {} vertices, {} intervals, {} iterations\n\
         {:.2} s: load {:.2}, open {:.2}, lanes {:.2}, direct {:.2}, solve {:.2}, gather {:.2}, write {:.2}\n\
         written: {}",
        line.vertices,
        r.intervals_working,
        r.iterations,
        line.total_s,
        line.load_s,
        line.open_s,
        r.lanes_s,
        r.direct_s,
        r.solve_s,
        r.gather_s,
        line.write_s,
        line.glb
    )
}

/// What is wrong with the output files.
fn problems(args: &RelightArgs, output: &Path, cache: &Path, parts: &[PathBuf]) -> Vec<Problem> {
    let mut outputs = vec![("-o", output)];
    outputs.extend(args.npz.as_deref().map(|path| ("--npz", path)));
    let beside = args.room.with_extension("spectra.json");
    let spectra = args.reading.spectra.as_deref().unwrap_or(&beside);
    let mut inputs = vec![args.room.as_path(), spectra, cache];
    inputs.extend(parts.iter().map(PathBuf::as_path));
    let mut problems = paths::problems(&outputs, &inputs);
    problems.extend(paths::not_glb(output, "relit"));
    if !cache.is_file() {
        problems.push(Problem::new(
            cache.display().to_string(),
            "there is no cache",
            "bake the room with --cache, and name the file with --cache",
        ));
    }
    problems
}
