//! `haarlight probe ROOM --points POINTS.csv`: irradiance at points, by the same gather as the bake's.
//!
//! The CSV out has a line a point, in the order of the points:
//! `x,y,z,nx,ny,nz,E_X,E_Y,E_Z` (unit normal; tristimulus irradiance with Km = 683 lm/W), with `--bands` also `E_380 ...`,
//! one column for each of the 64 leaves by its left edge in nm, W/m2/nm, from a solution on all leaves; then `lux`, which
//! is `E_Y` under the name that people look for, and `place`: `room`, `inside` something solid or `outside` the room (see
//! [`places`]). `--json` prints one object instead: `{"version": 1, "verdict": ..., "rounds": n, "error_de2000": figure,
//! "columns": [names], "rows": [[numbers]], "places": [texts]}`; the columns have all but `place`.
//!
//! `--metrics` puts further columns after `place`, and `"metrics"` into the JSON: see `metrics.rs`.

use super::bake::{load, prepare};
use super::log::exit_code;
use super::metrics::Metrics;
use super::options::{Common, Reading, Solving};
use super::paths;
use super::points::{COLUMNS, Point, Points};
use super::results::print;
use super::stop::Stop;
use super::talk::Talk;
use crate::error::{Error, Problem, Result};
use crate::gather::Probed;
use crate::solve::Representation;
use crate::spectrum::{Grid, LEAVES};
use crate::store::file;
use crate::survey::{Place, places};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Version of the JSON form.
const VERSION: u32 = 1;

/// Arguments of `probe`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Example:
  printf 'x,y,z,nx,ny,nz\\n0.2,0.1,-0.2,0,1,0\\n' > points.csv
  haarlight probe room.glb --points points.csv --bands -o light.csv")]
#[non_exhaustive]
pub struct ProbeArgs {
    /// The room, .glb or .gltf.
    pub room: PathBuf,
    /// CSV with columns x,y,z,nx,ny,nz in glTF space.
    #[arg(long, value_name = "POINTS.csv")]
    pub points: PathBuf,
    /// The CSV to write [default: stdout].
    #[arg(short, long, value_name = "OUT.csv")]
    pub output: Option<PathBuf>,
    /// Irradiance on the 64 leaves as well.
    #[arg(long)]
    pub bands: bool,
    /// Colour temperature, rendering, fidelity and alpha-opic daylight as well, each with its range; solves on all leaves.
    #[arg(long)]
    pub metrics: bool,
    /// What to read.
    #[command(flatten)]
    pub reading: Reading,
    /// When to stop.
    #[command(flatten)]
    pub solving: Solving,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Solves and probes; the exit code.
///
/// # Errors
/// Problems of the room and of the points, together; an output that cannot be written.
pub fn run(args: &ProbeArgs, common: &Common) -> Result<u8> {
    let stop = Stop::new(args.solving.time);
    stop.listen()?;
    let talk = Talk::new(common.quiet);
    let mut read = read_points(&args.points);
    let wrong = std::mem::take(&mut read.problems);
    let scene = load(&args.room, &args.reading, |parts| {
        problems(args, parts, wrong)
    })?;
    scene.warnings.iter().for_each(|w| talk.warn(w));
    if !read.ignored.is_empty() {
        talk.warn(&format!(
            "columns of the points that are not read: {}",
            read.ignored.join(", ")
        ));
    }
    let representation = if args.bands || args.metrics {
        Representation::Dense
    } else {
        Representation::Adaptive
    };
    let mut bake = prepare(scene, &args.solving, common, representation, &talk);
    let verdict = stop.run(&mut bake, &talk, |_, _| Ok(()))?;
    talk.phase("probing");
    let scale = bake.scene().changes.scale;
    let points: Vec<Point> = (read.points.iter())
        .map(|&(place, normal)| (scale * place, normal))
        .collect();
    let probed = bake.probe(&points);
    let places = places(bake.scene(), &points);
    let metrics = (args.metrics)
        .then(|| Metrics::new(&bake.scene().grid, &probed, &places, bake.rounds().last()));
    talk.clear();
    warn_of(&places, &talk);
    if let Some(line) = metrics.as_ref().and_then(Metrics::line) {
        talk.say(&line);
    }

    let columns = columns(args.bands, &bake.scene().grid);
    let rows: Vec<Vec<f64>> = read
        .points
        .iter()
        .zip(&probed)
        .map(|(p, light)| row(p, light, args.bands))
        .collect();
    let csv = || table(&columns, &rows, &places, metrics.as_ref());
    if let Some(path) = &args.output {
        file::write_atomic(path, Some(&args.room), |w| w.write_all(csv().as_bytes()))?;
    }
    if args.json {
        let error = bake.rounds().last().map(|r| r.error.total_de2000);
        let mut all = json!({
            "version": VERSION,
            "verdict": verdict,
            "rounds": bake.rounds().len(),
            "error_de2000": error,
            "columns": columns,
            "rows": rows,
            "places": places.iter().map(|p| p.name()).collect::<Vec<_>>(),
        });
        if let Some(metrics) = &metrics {
            all["metrics"] = metrics.json();
        }
        print(&format!("{all}\n"))?;
    } else if args.output.is_none() {
        print(&csv())?;
    }
    Ok(exit_code(verdict))
}

/// The points; a file that cannot be read is a problem like those in it.
fn read_points(path: &Path) -> Points {
    match Points::open(path) {
        Ok(read) => read,
        Err(Error::Input(problems)) => Points {
            problems,
            ..Points::default()
        },
        Err(problem) => Points {
            problems: vec![Problem::new(
                "--points",
                problem.to_string(),
                "name a file that can be read",
            )],
            ..Points::default()
        },
    }
}

/// Says how many points are not in the room.
fn warn_of(places: &[Place], talk: &Talk) {
    for place in [Place::Inside, Place::Outside] {
        let count = places.iter().filter(|p| **p == place).count();
        if count > 0 {
            let where_it_is = match place {
                Place::Inside => "inside something solid",
                _ => "outside the room",
            };
            talk.warn(&format!(
                "{count} of {} points lie {where_it_is}: see the column 'place'",
                places.len()
            ));
        }
    }
}

/// Problems of the points and the output.
fn problems(args: &ProbeArgs, parts: &[PathBuf], mut problems: Vec<Problem>) -> Vec<Problem> {
    let outputs: Vec<_> = args
        .output
        .as_deref()
        .map(|path| ("-o", path))
        .into_iter()
        .collect();
    let beside = args.room.with_extension("spectra.json");
    let mut inputs = vec![args.room.as_path(), &args.points];
    inputs.push(args.reading.spectra.as_deref().unwrap_or(&beside));
    inputs.extend(parts.iter().map(PathBuf::as_path));
    problems.extend(paths::problems(&outputs, &inputs));
    problems
}

fn columns(bands: bool, grid: &Grid) -> Vec<String> {
    let mut columns: Vec<String> = COLUMNS
        .into_iter()
        .chain(["E_X", "E_Y", "E_Z"])
        .map(String::from)
        .collect();
    if bands {
        columns.extend((0..LEAVES).map(|leaf| format!("E_{}", grid.left(leaf))));
    }
    columns.push("lux".into());
    columns
}

/// The CSV.
fn table(
    columns: &[String],
    rows: &[Vec<f64>],
    places: &[Place],
    metrics: Option<&Metrics>,
) -> String {
    let mut header = columns.to_vec();
    header.push("place".into());
    if metrics.is_some() {
        header.extend(Metrics::columns());
    }
    let lines = rows
        .iter()
        .zip(places)
        .enumerate()
        .map(|(k, (row, place))| {
            let mut cells: Vec<String> = row.iter().map(f64::to_string).collect();
            cells.push(place.name().into());
            cells.extend(metrics.iter().flat_map(|metrics| metrics.cells(k)));
            cells.join(",") + "\n"
        });
    std::iter::once(header.join(",") + "\n")
        .chain(lines)
        .collect()
}

fn row((point, normal): &Point, light: &Probed, bands: bool) -> Vec<f64> {
    let mut row = [point.to_array(), normal.to_array(), light.xyz].concat();
    if bands {
        row.extend(light.leaves);
    }
    row.push(light.xyz[1]);
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_named_by_their_left_edge() {
        let names = columns(true, &Grid::default());
        assert_eq!(names.len(), 9 + 64 + 1);
        assert_eq!(names[9..11], ["E_380", "E_386.25"]);
        assert_eq!(columns(true, &Grid::paper())[72], "E_695");
        assert_eq!(
            columns(false, &Grid::default()).join(","),
            "x,y,z,nx,ny,nz,E_X,E_Y,E_Z,lux"
        );
    }
}
