//! `haarlight paper`: the tables of Rougeron and Péroche 1997, measured beside printed, and what lies beyond them.
//!
//! Results go to stdout. `--json` gives one object with `table1` (by light), `table2`, `control`, `bounds`, `methods`, `cuts`, `covariances`;
//! field by field it is documented on the row types of [`crate::spectrum::study`]. Shares are in percent.

use crate::spectrum::study::table1::{Column, PRINTED, ROWS, mean_differences};
use crate::spectrum::study::{
    ColourChart, LEVELS, Reflectances, UnitLight, bounds, compare, covariance, cuts, modes, table2,
};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write as _;

/// The paper's tables, measured beside printed.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct PaperArgs {
    /// One JSON object instead of tables.
    #[arg(long)]
    json: bool,
    /// Which measured chart stands in for the paper's, which is not published.
    #[arg(long, value_enum, default_value_t)]
    reflectances: Reflectances,
}

/// Everything that is measured.
struct Results {
    columns: [Column; 3],
    control: Vec<modes::ModesRow>,
    bounds: Vec<bounds::BoundsRow>,
    methods: Vec<compare::ComparisonRow>,
    table2: Vec<table2::Stage>,
    cuts: Vec<cuts::CutsRow>,
    covariances: Vec<covariance::CovarianceRow>,
}

/// Runs the tests and prints them.
///
/// # Errors
/// If stdout cannot be written.
pub fn run(args: &PaperArgs) -> crate::Result<()> {
    let results = measure(args.reflectances);
    let text = if args.json {
        format!("{:#}\n", to_json(&results))
    } else {
        to_text(&results)
    };
    std::io::stdout()
        .write_all(text.as_bytes())
        .map_err(|source| crate::Error::io("stdout".as_ref(), source))
}

fn measure(source: Reflectances) -> Results {
    let chart = ColourChart::new(source);
    let lights = chart.lights();
    let white = chart.light("D65").white;
    let mut control: Vec<_> = lights
        .iter()
        .flat_map(|light| modes::measure(&chart, light, light.name))
        .collect();
    // Several lights in one scene are seen under one white.
    for light in lights.iter().filter(|light| light.white != white) {
        control.extend(modes::measure(
            &chart,
            &UnitLight {
                white,
                ..light.clone()
            },
            &format!("{} under D65", light.name),
        ));
    }
    Results {
        columns: lights
            .each_ref()
            .map(|light| Column::measure(&chart, light)),
        control,
        bounds: lights
            .iter()
            .flat_map(|light| bounds::measure(&chart, light))
            .collect(),
        methods: lights
            .iter()
            .flat_map(|light| compare::measure(&chart, light))
            .collect(),
        table2: table2::measure(&chart),
        cuts: lights
            .iter()
            .flat_map(|light| cuts::measure(&chart, light))
            .collect(),
        covariances: lights
            .iter()
            .flat_map(|light| covariance::measure(&chart, light))
            .collect(),
    }
}

fn to_json(results: &Results) -> Value {
    let [c, d65, f2] = &results.columns;
    json!({
        "table1": { "C": c, "D65": d65, "F2": f2 },
        "table2": { "printed_ms": printed_table2(), "stages": results.table2 },
        "control": results.control,
        "bounds": results.bounds,
        "methods": results.methods,
        "cuts": results.cuts,
        "covariances": results.covariances,
    })
}

fn to_text(results: &Results) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = table1(&mut text, &results.columns);
    let _ = timings(&mut text, &results.table2);
    let _ = control(&mut text, &results.control);
    let _ = bound(&mut text, &results.bounds);
    let _ = methods(&mut text, &results.methods);
    let _ = greedy(&mut text, &results.cuts);
    let _ = covariances(&mut text, &results.covariances);
    text
}

fn table1(text: &mut String, columns: &[Column; 3]) -> std::fmt::Result {
    writeln!(text, "Table 1: measured (printed)\n")?;
    writeln!(text, "{:22}{:>18}{:>18}{:>18}", "", "C", "D65", "F2")?;
    let source = |column: &Column| {
        [
            column.source.intervals as f64,
            column.source.xyz_error,
            column.source.luv_error,
        ]
    };
    for (row, name) in ["S: intervals", "S: XYZ error", "S: Luv error"]
        .into_iter()
        .enumerate()
    {
        let digits = [0, 4, 2][row];
        write!(text, "{name:22}")?;
        for (ours, printed) in columns.iter().zip(&PRINTED) {
            write!(
                text,
                "{:>18}",
                format!(
                    "{:.digits$} ({:.digits$})",
                    source(ours)[row],
                    source(printed)[row]
                )
            )?;
        }
        writeln!(text)?;
    }
    for (level, name) in LEVELS.into_iter().enumerate() {
        writeln!(text, "{name}")?;
        for (row, name) in ROWS.into_iter().enumerate() {
            let unit = if row < 5 { "" } else { " %" };
            write!(text, "  {:20}", format!("{name}{unit}"))?;
            for (ours, printed) in columns.iter().zip(&PRINTED) {
                write!(
                    text,
                    "{:>18}",
                    format!(
                        "{:.2} ({:.2})",
                        ours.levels()[level].rows()[row],
                        printed.levels()[level].rows()[row]
                    )
                )?;
            }
            writeln!(text)?;
        }
    }
    let differences = ROWS
        .iter()
        .zip(mean_differences(columns))
        .map(|(name, d)| format!("{name} {d:.2}"));
    writeln!(
        text,
        "\nMean |measured - printed| over lights and levels: {}\n",
        differences.collect::<Vec<_>>().join(", ")
    )
}

fn control(text: &mut String, rows: &[modes::ModesRow]) -> std::fmt::Result {
    writeln!(
        text,
        "What controls the error (dE as mean / 95th percentile / max; corrected: estimated error added back)\n"
    )?;
    writeln!(
        text,
        "{:13}{:25}{:10}{:>7}{:>10}{:>9}{:>22}{:>22}{:>22}{:>22}",
        "light",
        "control",
        "level",
        "limit",
        "intervals",
        "> eps %",
        "dE*uv",
        "dE00",
        "corrected dE*uv",
        "corrected dE00"
    )?;
    let summary =
        |s: &modes::DifferenceSummary| format!("{:.2} / {:.2} / {:.2}", s.mean, s.p95, s.max);
    for r in rows {
        write!(
            text,
            "{:13}{:25}{:10}{:>7.3}{:>10.2}{:>9.2}",
            r.light, r.mode, r.level, r.limit, r.intervals_mean, r.above_eps_max
        )?;
        for s in [&r.luv, &r.de2000, &r.corrected_luv, &r.corrected_de2000] {
            write!(text, "{:>22}", summary(s))?;
        }
        writeln!(text)?;
    }
    writeln!(text)
}

fn bound(text: &mut String, rows: &[bounds::BoundsRow]) -> std::fmt::Result {
    writeln!(
        text,
        "Bound of the neglected term (control by the bound, the paper's eps; looseness: bound / true error of the estimator)\n"
    )?;
    writeln!(
        text,
        "{:7}{:10}{:>9}{:>11}{:>9}{:>9}{:>13}{:>9}",
        "light", "level", "products", "violations", "median", "95th", "mean error", "> eps %"
    )?;
    for r in rows {
        writeln!(
            text,
            "{:7}{:10}{:>9}{:>11}{:>9.2}{:>9.2}{:>13.6}{:>9.2}",
            r.light,
            r.level,
            r.products,
            r.violations,
            r.looseness_median,
            r.looseness_p95,
            r.estimator_error_mean,
            r.above_eps_max
        )?;
    }
    writeln!(text)
}

fn printed_table2() -> Value {
    let rows = table2::PRINTED_MS.iter().map(|(name, reference, adaptive)| json!({ "stage": name, "reference": reference, "adaptive": adaptive }));
    rows.collect()
}

fn timings(text: &mut String, stages: &[table2::Stage]) -> std::fmt::Result {
    writeln!(text, "Table 2: printed, ms for 13 824 products\n")?;
    for (name, reference, adaptive) in table2::PRINTED_MS {
        writeln!(text, "  {name:20}{reference:>10}{adaptive:>10}")?;
    }
    writeln!(
        text,
        "\nTable 2 today, ns a product (dense: 64 f32 in wide vectors; ratio above 1: adaptive is faster)\n"
    )?;
    writeln!(
        text,
        "  {:42}{:>10}{:>10}{:>8}",
        "", "adaptive", "dense", "ratio"
    )?;
    let number = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.2}"));
    for s in stages {
        writeln!(
            text,
            "  {:42}{:>10.2}{:>10}{:>8}",
            s.stage,
            s.adaptive_ns,
            number(s.dense_ns),
            number(s.ratio)
        )?;
    }
    writeln!(text)
}

/// Means over the lights of dE*uv: mean (max) of each level.
fn methods(text: &mut String, rows: &[compare::ComparisonRow]) -> std::fmt::Result {
    writeln!(
        text,
        "Methods at equal numbers of terms: dE*uv mean (max) of tertiary reflections, mean (max) over the lights\n"
    )?;
    write!(text, "{:28}", "")?;
    for n in compare::TERMS {
        write!(text, "{:>17}", format!("n = {n}"))?;
    }
    writeln!(text, "{:>12}{:>9}", "product ns", "XYZ ns")?;
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        if !names.contains(&row.method) {
            names.push(row.method);
        }
    }
    for name in names {
        write!(text, "{name:28}")?;
        let mut time = None;
        for n in compare::TERMS {
            let same: Vec<&compare::ComparisonRow> = rows
                .iter()
                .filter(|r| r.method == name && r.terms == n)
                .collect();
            let mean = same.iter().map(|r| r.luv_mean[2]).sum::<f64>() / same.len() as f64;
            let max = same.iter().map(|r| r.luv_max[2]).fold(0.0, f64::max);
            write!(
                text,
                "{:>17}",
                if same.is_empty() {
                    "-".to_owned()
                } else {
                    format!("{mean:.2} ({max:.2})")
                }
            )?;
            time = same
                .iter()
                .filter_map(|r| r.product_ns.zip(r.xyz_ns))
                .reduce(|a, b| (a.0.min(b.0), a.1.min(b.1)))
                .or(time);
        }
        match time {
            Some((product, xyz)) => writeln!(text, "{product:>12.1}{xyz:>9.1}")?,
            None => writeln!(text, "{:>12}{:>9}", "-", "-")?,
        }
    }
    writeln!(
        text,
        "\nTimes are those of n = 16. Adaptive lists: see Table 2; each of their terms comes with three errors."
    )
}

fn greedy(text: &mut String, rows: &[cuts::CutsRow]) -> std::fmt::Result {
    writeln!(
        text,
        "\nGreedy cuts against the best known (secondary reflections, mean dE*uv, no correction)\n"
    )?;
    writeln!(
        text,
        "{:7}{:>10}{:>10}{:>10}{:>10}",
        "light", "intervals", "halving", "merging", "best"
    )?;
    for r in rows {
        writeln!(
            text,
            "{:7}{:>10}{:>10.3}{:>10.3}{:>10.3}",
            r.light, r.intervals, r.split, r.merge, r.best
        )?;
    }
    Ok(())
}

fn covariances(text: &mut String, rows: &[covariance::CovarianceRow]) -> std::fmt::Result {
    writeln!(
        text,
        "\nRatio lists, error added back: means alone, and with the covariances of all pairs of reflectances (dE*uv)\n"
    )?;
    writeln!(
        text,
        "{:7}{:10}{:>10}{:>22}{:>22}",
        "light", "level", "intervals", "means", "covariances"
    )?;
    let summary =
        |s: &modes::DifferenceSummary| format!("{:.3} / {:.3} / {:.3}", s.mean, s.p95, s.max);
    for r in rows {
        writeln!(
            text,
            "{:7}{:10}{:>10.2}{:>22}{:>22}",
            r.light,
            r.level,
            r.intervals_mean,
            summary(&r.means),
            summary(&r.covariances)
        )?;
    }
    Ok(())
}
