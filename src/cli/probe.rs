//! `haarlight probe ROOM --points POINTS.csv`: irradiance at points, by the same gather as the bake's.
//!
//! The CSV out has a line a point, in the order of the points:
//! `x,y,z,nx,ny,nz,E_X,E_Y,E_Z` (unit normal; tristimulus irradiance with Km = 683 lm/W), with `--bands` also `E_380 ...`,
//! one column for each of the 64 bands by its left edge in nm, W/m2/nm, from a solution on all bands; then `lux`, which
//! is `E_Y` under the name that people look for, and `place`: `room`, `inside` something solid or `outside` the room (see
//! [`places`]). `--json` prints one object instead: `{"version": 1, "verdict": ..., "rounds": n, "error_de2000": figure,
//! "columns": [names], "rows": [[numbers]], "places": [texts]}`; the columns have all but `place`.
//!
//! `--metrics` puts further columns after `place`, and `"metrics"` into the JSON: see `metrics.rs`. `--ugr` puts `"ugr"` there,
//! and lines after the CSV where there is no JSON: see `glare.rs`.

use super::glare::{self, Viewpoint};
use super::log::exit_code;
use super::metrics::Metrics;
use super::options::{Common, Reading, Solving};
use super::paths;
use super::points::{COLUMNS, Point, Points};
use super::results::print;
use super::rooms::{load, prepare};
use super::stop::Stop;
use super::talk::Talk;
use crate::error::{Error, Problem, Result};
use crate::gather::{Glare, Probed};
use crate::solve::{Bake, Representation, Round, Verdict};
use crate::spectrum::{BANDS, Grid};
use crate::store::file;
use crate::survey::{PointLocation, places};
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
    #[arg(long, value_name = "POINTS.csv", required_unless_present = "ugr")]
    pub points: Option<PathBuf>,
    /// The CSV to write [default: stdout].
    #[arg(short, long, value_name = "OUT.csv")]
    pub output: Option<PathBuf>,
    /// Irradiance on the 64 bands as well.
    #[arg(long)]
    pub bands: bool,
    /// Colour temperature, rendering, fidelity and alpha-opic daylight as well, each with its range; solves on all bands. Where
    /// there is a sky also the daylight factor, for which the room is solved once more under the sky alone.
    #[arg(long)]
    pub metrics: bool,
    /// Unified glare rating (CIE 117) for an eye and the way it looks, a line each on stdout; may be said several times.
    #[arg(long, value_name = "X,Y,Z,DX,DY,DZ", allow_hyphen_values = true)]
    pub ugr: Vec<Viewpoint>,
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
    let mut read = args.points.as_deref().map(read_points).unwrap_or_default();
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
    let verdict = stop.run(&mut bake, &talk, rounds_ahead, |_, _, _| Ok(()))?;
    talk.phase("probing");
    let scale = bake.scene().changes.scale;
    let points: Vec<Point> = (read.points.iter())
        .map(|&(place, normal)| (scale * place, normal))
        .collect();
    let found = ProbeResults::at(args, (common, &talk, &stop), &bake, &points)?;
    talk.clear();
    found.tell(&talk);

    let columns = columns(args.bands, &bake.scene().grid);
    let lines = read.points.iter().zip(&found.probed);
    let rows: Vec<Vec<f64>> = lines.map(|(p, light)| row(p, light, args.bands)).collect();
    let csv = || table(&columns, &rows, &found.places, found.metrics.as_ref());
    if let Some(path) = &args.output {
        file::write_atomic(path, Some(&args.room), |w| w.write_all(csv().as_bytes()))?;
    }
    if args.json {
        let mut all = json!({
            "version": VERSION,
            "verdict": found.worse(verdict),
            "rounds": bake.rounds().len(),
            "error_de2000": bake.rounds().last().map(|r| r.error.total_de2000),
            "columns": columns,
            "rows": rows,
            "places": found.places.iter().map(|p| p.name()).collect::<Vec<_>>(),
        });
        if let Some(metrics) = &found.metrics {
            all["metrics"] = metrics.json();
        }
        if !args.ugr.is_empty() {
            let views = args.ugr.iter().zip(&found.views);
            let entries = views.map(|(view, seen)| glare::entry(view, seen, found.relative));
            all["ugr"] = entries.collect();
        }
        print(&format!("{all}\n"))?;
    } else {
        if args.output.is_none() && args.points.is_some() {
            print(&csv())?;
        }
        for (view, seen) in args.ugr.iter().zip(&found.views) {
            print(&format!("{}\n", glare::line(view, seen, found.relative)))?;
        }
    }
    Ok(exit_code(found.worse(verdict)))
}

/// What was found.
struct ProbeResults {
    probed: Vec<Probed>,
    places: Vec<PointLocation>,
    metrics: Option<Metrics>,
    /// Of the viewpoints.
    views: Vec<Glare>,
    /// Relative error of the light, an estimate.
    relative: Option<f64>,
    /// How the solve under the sky alone ended, where there was one.
    daylight: Option<Verdict>,
}

impl ProbeResults {
    /// Looks at points and from viewpoints.
    fn at(
        args: &ProbeArgs,
        (common, talk, stop): (&Common, &Talk, &Stop),
        bake: &Bake,
        points: &[Point],
    ) -> Result<Self> {
        let probed = bake.probe(points);
        let places = places(bake.scene(), points);
        let (metrics, daylight) = match args.metrics && !points.is_empty() {
            true => measured(args, (common, talk, stop), bake, points, (&probed, &places))
                .map(|(metrics, verdict)| (Some(metrics), verdict))?,
            false => (None, None),
        };
        let scale = bake.scene().changes.scale;
        let views = args.ugr.iter();
        let last = bake.rounds().last();
        Ok(Self {
            probed,
            places,
            metrics,
            views: views
                .map(|view| bake.glare(scale * view.eye, view.direction))
                .collect(),
            relative: last.and_then(|round| round.error.total_relative.value),
            daylight,
        })
    }

    /// The worse of how both solves ended.
    fn worse(&self, verdict: Verdict) -> Verdict {
        let other = self
            .daylight
            .filter(|other| exit_code(*other) > exit_code(verdict));
        other.unwrap_or(verdict)
    }

    /// Says what is to be said on stderr.
    fn tell(&self, talk: &Talk) {
        warn_of(&self.places, talk);
        if let Some(line) = self.metrics.as_ref().and_then(Metrics::line) {
            talk.say(&line);
        }
    }
}

/// The figures of all points, with the daylight factor where there is a sky.
fn measured(
    args: &ProbeArgs,
    (common, talk, stop): (&Common, &Talk, &Stop),
    bake: &Bake,
    points: &[Point],
    (probed, places): (&[Probed], &[PointLocation]),
) -> Result<(Metrics, Option<Verdict>)> {
    let scene = bake.scene();
    let metrics = Metrics::new(&scene.grid, probed, places, bake.rounds().last());
    let Some(outside) = scene.sky_illuminance().filter(|&lux| lux > 0.0) else {
        return Ok((metrics, None));
    };
    let relative = |bake: &Bake| bake.rounds().last()?.error.total_relative.value;
    let factors = |probed: &[Probed]| -> Vec<f64> {
        probed
            .iter()
            .map(|light| 100.0 * light.xyz[1] / outside)
            .collect()
    };
    Ok(match scene.under_sky_alone() {
        None => (metrics.with_daylight(factors(probed), relative(bake)), None),
        Some(alone) => {
            talk.phase("daylight");
            let adaptive = Representation::Adaptive;
            let mut under_sky = prepare(alone, &args.solving, common, adaptive, talk);
            let verdict = stop.run(&mut under_sky, talk, rounds_ahead, |_, _, _| Ok(()))?;
            let probed = under_sky.probe(points);
            let metrics = metrics.with_daylight(factors(&probed), relative(&under_sky));
            (metrics, Some(verdict))
        }
    })
}

/// Seconds that further rounds are expected to take.
fn rounds_ahead(_: &Bake, round: &Round) -> Option<f64> {
    round.remaining_s
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
fn warn_of(places: &[PointLocation], talk: &Talk) {
    for place in [PointLocation::Inside, PointLocation::Outside] {
        let count = places.iter().filter(|p| **p == place).count();
        if count > 0 {
            let where_it_is = match place {
                PointLocation::Inside => "inside something solid",
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
    let mut inputs = vec![args.room.as_path()];
    inputs.extend(args.points.as_deref());
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
        columns.extend((0..BANDS).map(|band| format!("E_{}", grid.left(band))));
    }
    columns.push("lux".into());
    columns
}

/// The CSV.
fn table(
    columns: &[String],
    rows: &[Vec<f64>],
    places: &[PointLocation],
    metrics: Option<&Metrics>,
) -> String {
    let mut header = columns.to_vec();
    header.push("place".into());
    header.extend(metrics.iter().flat_map(|metrics| metrics.columns()));
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
        row.extend(light.spectrum);
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
