//! The study as pictures (SVG).

use super::run::{PHASES, Run};
use super::sweep::Study;
use crate::report::{Bars, LineChart, Scale, Series};
use crate::solve::Representation;

/// File names and what they show, in the order of the page.
pub const NAMES: [(&str, &str); 4] = [
    ("error-time.svg", "error against time"),
    ("phases.svg", "where the time goes"),
    ("intervals.svg", "what spectra alone do"),
    ("memory.svg", "memory against error"),
];

/// Errors below this are rounding: a logarithmic axis does not show them.
const ROUNDING: f64 = 2e-4;

/// All pictures in order of [`NAMES`].
pub fn all(study: &Study, room: &str) -> [String; 4] {
    [
        error_time(study, room),
        phases(study, room),
        intervals(study, room),
        memory(study, room),
    ]
}

/// Names for people.
fn name(r: Representation) -> String {
    match r {
        Representation::Adaptive => "adaptive (default)".into(),
        Representation::Guaranteed => "adaptive, guaranteed".into(),
        Representation::Paper => "the paper's control".into(),
        Representation::Lists => "lists".into(),
        Representation::Uniform(n) => format!("{n} uniform intervals"),
        Representation::Characteristic(n) => format!("{n} characteristic vectors"),
        Representation::Dense => "64 bands".into(),
        Representation::Rgb => "linear sRGB".into(),
    }
}

/// One line a representation.
fn lines(runs: &[Run], point: impl Fn(&Run) -> [f64; 2]) -> Vec<Series> {
    let mut all: Vec<(Representation, Series)> = Vec::new();
    for run in runs {
        match all.iter_mut().find(|(r, _)| *r == run.representation) {
            Some((_, series)) => series.points.push(point(run)),
            None => all.push((
                run.representation,
                Series {
                    name: name(run.representation),
                    points: vec![point(run)],
                },
            )),
        }
    }
    all.into_iter().map(|(_, series)| series).collect()
}

fn error_time(study: &Study, room: &str) -> String {
    LineChart {
        title: format!("{room}: measured error against time"),
        x: "CPU time of a whole bake, s".into(),
        y: "mean CIEDE2000 at random points".into(),
        x_scale: Scale::Log,
        y_scale: Scale::Log,
        series: lines(&study.runs, |r| [r.cpu_s, r.de2000.value]),
    }
    .to_svg()
}

fn memory(study: &Study, room: &str) -> String {
    LineChart {
        title: format!("{room}: memory against measured error"),
        x: "hierarchy, links and rows, MB".into(),
        y: "mean CIEDE2000 at random points".into(),
        x_scale: Scale::Log,
        y_scale: Scale::Log,
        series: lines(&study.runs, |r| [1e-6 * r.memory as f64, r.de2000.value]),
    }
    .to_svg()
}

/// The adaptive bakes of all errors, then the others at the error in the middle.
fn phases(study: &Study, room: &str) -> String {
    let adaptive = |r: &&Run| r.representation == Representation::Adaptive;
    let mut errors: Vec<f64> = study.runs.iter().map(|r| r.asked).collect();
    errors.sort_by(f64::total_cmp);
    errors.dedup();
    let middle = errors.get(errors.len().saturating_sub(1) / 2).copied();
    let others = study
        .runs
        .iter()
        .filter(|r| !adaptive(r) && Some(r.asked) == middle);
    let bars = study
        .runs
        .iter()
        .filter(adaptive)
        .chain(others)
        .map(|r| {
            let label = format!("{}, {}", name(r.representation), r.asked);
            (label, PHASES.map(|p| r.phase(p)).to_vec())
        })
        .collect();
    Bars {
        title: format!("{room}: where the time goes, by error asked for"),
        unit: "CPU time, s".into(),
        parts: PHASES.map(String::from).to_vec(),
        bars,
    }
    .to_svg()
}

/// Is it of a kind?
type Is = fn(Representation) -> bool;

/// Geometry held: numbers that hold a spectrum against what that does to colours.
fn intervals(study: &Study, room: &str) -> String {
    let kinds: [(&str, Is); 7] = [
        ("adaptive (default)", |r| r == Representation::Adaptive),
        ("adaptive, guaranteed", |r| r == Representation::Guaranteed),
        ("the paper's control", |r| r == Representation::Paper),
        ("lists", |r| r == Representation::Lists),
        ("uniform intervals", |r| {
            matches!(r, Representation::Uniform(_))
        }),
        ("characteristic vectors", |r| {
            matches!(r, Representation::Characteristic(_))
        }),
        ("linear sRGB", |r| r == Representation::Rgb),
    ];
    let series = kinds
        .into_iter()
        .map(|(name, is)| {
            let mut points: Vec<[f64; 2]> = study
                .held
                .iter()
                .filter(|h| is(h.representation) && h.de2000 > ROUNDING)
                .map(|h| [h.lanes, h.de2000])
                .collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(b[1].total_cmp(&a[1])));
            points.dedup();
            Series {
                name: name.into(),
                points,
            }
        })
        .collect();
    LineChart {
        title: format!("{room}: spectra alone, on the same links"),
        x: "numbers a patch holds".into(),
        y: "mean CIEDE2000 from 64 bands".into(),
        x_scale: Scale::Log,
        y_scale: Scale::Log,
        series,
    }
    .to_svg()
}
