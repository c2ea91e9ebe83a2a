//! The study as CSV and Markdown.

use super::choice::Choice;
use super::run::{PHASES, Run};
use super::sweep::Study;
use crate::report::{Align, TextTable};

/// Version of the CSV's columns.
pub const CSV_VERSION: u32 = 1;
/// All runs, one a line: times in s, errors in CIEDE2000 (spectra: CIELUV), memory in bytes.
pub fn csv(study: &Study) -> String {
    let titles = [
        "version",
        "kind",
        "representation",
        "asked_de2000",
        "asked_spectrum_de_luv",
        "cpu_s",
        "wall_s",
        "de2000_mean",
        "de2000_low",
        "de2000_high",
        "de2000_p95",
        "relative_rms",
        "estimate_de2000",
        "estimate_spectrum_de_luv",
        "rounds",
        "elements",
        "links",
        "vertices",
        "rays",
        "intervals",
        "memory_bytes",
    ];
    let phases = PHASES.map(|p| format!("{p}_s"));
    let all = titles.map(String::from).into_iter().chain(phases);
    let mut table = TextTable::new(all.map(|t| (t, Align::Right)));
    let option = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x}"));
    let fixed = study.balance.iter().filter_map(|b| b.best.as_ref());
    let kinds = study
        .runs
        .iter()
        .map(|r| ("bake", r))
        .chain(fixed.map(|r| ("fixed", r)));
    for (kind, r) in kinds {
        let cells = [
            CSV_VERSION.to_string(),
            kind.into(),
            r.representation.to_string(),
            r.asked.to_string(),
            option(r.asked_spectrum),
            format!("{:.4}", r.cpu_s),
            format!("{:.4}", r.wall_s),
            format!("{:.5}", r.de2000.value),
            format!("{:.5}", r.de2000.low),
            format!("{:.5}", r.de2000.high),
            format!("{:.5}", r.de2000_p95),
            format!("{:.6}", r.relative_rms),
            option(r.estimate),
            option(r.estimate_spectrum),
            r.rounds.to_string(),
            r.elements.to_string(),
            r.links.to_string(),
            r.vertices.to_string(),
            r.rays.to_string(),
            r.intervals.to_string(),
            r.memory.to_string(),
        ];
        let times = PHASES.map(|p| format!("{:.5}", r.phase(p)));
        table.row(cells.into_iter().chain(times));
    }
    table.csv()
}

/// The bakes as a table for people.
pub fn runs(runs: &[Run]) -> TextTable {
    use Align::{Left, Right};
    let mut table = TextTable::new([
        ("spectra", Left),
        ("asked", Right),
        ("measured", Right),
        ("95 %", Right),
        ("E rms %", Right),
        ("CPU s", Right),
        ("rounds s", Right),
        ("wall s", Right),
        ("intervals", Right),
        ("links", Right),
        ("MB", Right),
    ]);
    for r in runs {
        table.row([
            r.representation.to_string(),
            r.asked.to_string(),
            format!("{:.3}", r.de2000.value),
            format!("{:.2}", r.de2000_p95),
            format!("{:.2}", 100.0 * r.relative_rms),
            format!("{:.3}", r.cpu_s),
            format!("{:.3}", r.cpu_s - r.phase("prepare") - r.phase("vertices")),
            format!("{:.3}", r.wall_s),
            r.intervals.to_string(),
            r.links.to_string(),
            format!("{:.2}", 1e-6 * r.memory as f64),
        ]);
    }
    table
}

/// The solutions on held links.
pub fn held(study: &Study) -> TextTable {
    use Align::{Left, Right};
    let mut table = TextTable::new([
        ("spectra", Left),
        ("asked", Right),
        ("lanes", Right),
        ("dE00", Right),
        ("greatest", Right),
        ("dE*uv", Right),
        ("believed dE*uv", Right),
        ("ms", Right),
    ]);
    for r in &study.held {
        table.row([
            r.representation.to_string(),
            if r.asked > 0.0 {
                r.asked.to_string()
            } else {
                String::new()
            },
            match r.lanes.fract() {
                0.0 => r.lanes.to_string(),
                _ => format!("{:.1}", r.lanes),
            },
            format!("{:.4}", r.de2000),
            format!("{:.3}", r.greatest),
            format!("{:.4}", r.de_luv),
            r.believed.map_or(String::new(), |b| format!("{b:.4}")),
            format!("{:.1}", 1e3 * r.seconds),
        ]);
    }
    table
}

/// The automatic balance beside the best fixed pairs.
pub fn balance(study: &Study) -> TextTable {
    use Align::Right;
    let mut table = TextTable::new([
        ("--error", Right),
        ("measured", Right),
        ("CPU s", Right),
        ("best pair: geometry", Right),
        ("spectrum dE*uv", Right),
        ("measured", Right),
        ("CPU s", Right),
        ("ratio", Right),
    ]);
    for b in &study.balance {
        let best = b.best.as_ref();
        let of = |f: &dyn Fn(&Run) -> String| best.map_or("none".into(), f);
        table.row([
            b.automatic.asked.to_string(),
            format!("{:.3}", b.automatic.de2000.value),
            format!("{:.3}", b.automatic.cpu_s),
            of(&|r| r.asked.to_string()),
            of(&|r| format!("{:.3}", r.asked_spectrum.unwrap_or(0.0))),
            of(&|r| format!("{:.3}", r.de2000.value)),
            of(&|r| format!("{:.3}", r.cpu_s)),
            format!("{:.2}", b.ratio),
        ]);
    }
    table
}

/// The choice in a paragraph.
pub fn choice(choice: &Choice) -> String {
    let Some(run) = &choice.run else {
        return "Nothing was tried.\n".into();
    };
    format!(
        "Choice: `--error {}`, spectra {}. {}\n",
        run.asked,
        run.representation,
        choice.why.join(" ")
    )
}

/// Everything for people to read, with the plots beside it.
pub fn markdown(study: &Study, chosen: &Choice, room: &str, machine: &str) -> String {
    let plots: String = super::plots::NAMES
        .iter()
        .map(|(file, what)| format!("![{what}]({file})\n\n"))
        .collect();
    let knob = if study.balance.is_empty() {
        String::new()
    } else {
        format!(
            "## One knob\n\nThe automatic balance beside the fastest fixed pair of tolerances that is measured to be as \
             accurate (within 2 %). A ratio of 1 means that no pair was faster.\n\n{}\n",
            balance(study).markdown()
        )
    };
    format!(
        "# What accuracy costs: {room}\n\n\
         Errors are mean CIEDE2000 of a white surface's light at {} random points, measured against a path tracer in 64 \
         bands, under one adaptation white. CPU seconds of all threads, from the room as read to the light at the \
         vertices; `rounds s` leaves out preparation and vertices. {machine}\n\n{}\n{plots}\
         ## All bakes\n\n{}\n\
         ## Spectra alone\n\nThe same {} elements and {} links solved again with other lanes; differences of the elements' \
         irradiance from that on 64 bands. `believed` is the program's own figure: an estimate, under guaranteed control \
         a bound.\n\n{}\n{knob}",
        study.points,
        choice(chosen),
        runs(&study.runs).markdown(),
        study.held_on[0],
        study.held_on[1],
        held(study).markdown(),
    )
}
