//! The table at the end of a bake: what each round cost and how wrong it left the room.

use super::log::{LayerRecord, VerdictRecord};
use crate::audit::{Honesty, Report};
use crate::gather::Interpolation;
use crate::report::{Align, TextTable};
use crate::solve::{Round, Verdict};
use serde_json::Value;

/// Rounds as a table.
pub(super) fn rounds(rounds: &[Round]) -> String {
    use Align::Right;
    let titles = [
        "round",
        "dE00",
        "geometry",
        "spectrum",
        "solve",
        "elements",
        "links",
        "intervals",
        "rays",
        "s",
    ];
    let mut table = TextTable::new(titles.map(|title| (title, Right)));
    let error = |value: Option<f64>| value.map_or("-".into(), |v| format!("{v:.3}"));
    for r in rounds {
        table.row([
            r.round.to_string(),
            error(r.error.total_de2000.value),
            error(r.error.geometry_de_luv.value),
            error(r.error.spectrum_de_luv.value),
            error(r.error.convergence_de_luv.value),
            r.elements.to_string(),
            r.links.to_string(),
            r.intervals_working.to_string(),
            r.rays.to_string(),
            format!("{:.2}", r.round_s),
        ]);
    }
    format!(
        "{}(dE00: mean CIEDE2000, all sources; by source: dE*uv; estimates)",
        table.terminal()
    )
}

/// The verdict in a few lines.
pub(super) fn verdict(v: &VerdictRecord, audit: Option<&Report>) -> String {
    let error = v
        .error_de2000
        .value
        .map_or("not known".into(), |e| format!("{e:.3}"));
    let end = match v.verdict {
        Verdict::Reached => "reached",
        Verdict::OutOfTime => "not reached: out of time",
        Verdict::Interrupted => "not reached: interrupted",
        Verdict::OutOfRounds => "not reached: no more rounds allowed",
        Verdict::Exhausted => "not reached: nothing left to refine",
    };
    let mut lines = vec![
        format!(
            "estimated error of the file: dE00 {error}, asked for {}: {end}",
            v.asked_de2000
        ),
        format!(
            "{} vertices ({} covered, {} beyond white), {} triangles; {:.0} rays/s, {:.0} links/s",
            v.vertices, v.covered, v.clipped, v.triangles, v.rays_per_s, v.links_per_s
        ),
        format!(
            "{:.2} s: load {:.2}, prepare {:.2}, solve {:.2}, snapshots {:.2}, gather {:.2}, audit {:.2}, write {:.2}",
            v.seconds.total,
            v.seconds.load,
            v.seconds.prepare,
            v.seconds.solve,
            v.seconds.snapshots,
            v.seconds.gather,
            v.seconds.audit,
            v.seconds.write
        ),
    ];
    if let Some(seconds) = v.taken_back_s {
        lines.push(format!(
            "of which {seconds:.2} in round {}, which was not done in time and was taken back",
            v.rounds + 1
        ));
    }
    if let Some(i) = &v.interpolation {
        lines.push(between_vertices(i));
    }
    if !v.layers.is_empty() {
        let one = |l: &LayerRecord| {
            let mean = l.interpolation_de2000.value.unwrap_or(0.0);
            format!("{} {mean:.3}", l.name)
        };
        let all: Vec<String> = v.layers.iter().map(one).collect();
        lines.push(format!(
            "of which by layer, each alone: {} (mean)",
            all.join(", ")
        ));
    }
    if v.capped > 0 {
        lines.push(format!(
            "{} triangles wanted to be finer than is allowed",
            v.capped
        ));
    }
    if let Some(audit) = audit {
        lines.push(measured(audit));
    }
    lines.extend(working_plane(&v.metrics["working_plane"]));
    lines.extend(glare(&v.metrics["ugr"][0]));
    lines.push(format!("written: {}", v.outputs.glb));
    lines.join("\n")
}

/// The error that vertices cause by the light between them.
fn between_vertices(i: &Interpolation) -> String {
    let excess = match (i.is_met(), i.capped) {
        (true, _) => String::new(),
        _ if i.mean <= i.allowed => format!(
            " (light bends by {:.3}, more than {:.3})",
            i.bends, i.may_bend
        ),
        (false, Some(most)) => format!(
            " (more than {:.3}, with the {most} vertices allowed)",
            i.allowed
        ),
        (false, None) => format!(" (more than {:.3})", i.allowed),
    };
    format!(
        "of which between vertices, measured at {} points: mean {:.3}, 95 % below {:.2}{excess}",
        i.points, i.mean, i.p95
    )
}

/// A figure of the metrics with its range.
fn figure(figure: &Value, digits: usize) -> Option<String> {
    let value = figure["value"].as_f64()?;
    let range = figure["low"]
        .as_f64()
        .map(|low| match figure["high"].as_f64() {
            Some(high) => format!(" ({low:.digits$} to {high:.digits$})"),
            None => format!(" ({low:.digits$} or more)"),
        });
    Some(format!("{value:.digits$}{}", range.unwrap_or_default()))
}

/// Light on the working plane, where it was looked for.
fn working_plane(plane: &Value) -> Option<String> {
    let mean = figure(&plane["mean_lux"], 0)?;
    let mut line = format!(
        "on a plane {:.2} m above the floor, at {} points: mean {mean} lx",
        plane["height_m"].as_f64()?,
        plane["points"]
    );
    if let Some(even) = figure(&plane["min_over_mean"], 2) {
        line += &format!(", min/mean {even}");
    }
    let daylight = &plane["DF_percent"];
    match (figure(&daylight["mean"], 2), daylight["reason"].as_str()) {
        (Some(factor), _) => line += &format!(", daylight factor {factor} %"),
        (None, Some(reason)) => line += &format!(", daylight factor: {reason}"),
        (None, None) => {}
    }
    Some(line + "; ranges are estimates")
}

/// Glare at the first camera, where it was looked for.
fn glare(view: &Value) -> Option<String> {
    let camera = view["camera"].as_str()?;
    let rating = figure(&view["rating"], 1);
    let reason = view["rating"]["reason"].as_str().unwrap_or("not known");
    Some(match rating {
        Some(rating) => format!("UGR from camera '{camera}': {rating}"),
        None => format!("UGR from camera '{camera}': none, {reason}"),
    })
}

/// The error as the audit measured it, and what that makes of the estimate.
fn measured(audit: &Report) -> String {
    let honest = match audit.honesty {
        Honesty::Honest => "the estimate was honest",
        Honesty::TooLow => "the estimate was TOO LOW",
        Honesty::TooHigh => "the estimate was too high",
        Honesty::NoEstimate => "there was no estimate",
    };
    let (de, bias) = (&audit.de2000, audit.bias);
    let worst = audit.worst.first().map_or(String::new(), |point| {
        let [x, y, z] = point.at;
        format!(
            " at {x:.2},{y:.2},{z:.2} ({:.3} lx for {:.3})",
            point.baked_lux, point.traced_lux
        )
    });
    format!(
        "measured error at {} points: dE00 mean {:.3} ({:.3} .. {:.3}), 95 % below {:.2}, max {:.2}{worst}; illuminance {:+.2} % ({:.2} .. {:.2}); {honest}",
        audit.points,
        de.mean.value,
        de.mean.low,
        de.mean.high,
        de.p95.value,
        de.max.value,
        100.0 * bias.value,
        100.0 * bias.low,
        100.0 * bias.high
    )
}
