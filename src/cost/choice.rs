//! Which setting to take, and why.
//!
//! Of the bakes that are measured to be within the goal, the cheapest in CPU time. One that knows what its lanes cost is
//! taken before one that does not (uniform intervals, a basis, sRGB: fine on this room, unknown on the next) unless it
//! costs more than [`WORTH_KNOWING`] times as much.

use super::run::Run;
use super::sweep::Study;
use crate::solve::Representation;

/// What it may cost to know the spectral error.
const WORTH_KNOWING: f64 = 1.15;

/// The choice.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Choice {
    /// The run that is taken; none if the sweep was empty.
    pub run: Option<Run>,
    /// Why, in sentences.
    pub why: Vec<String>,
}

/// Chooses for a goal, mean CIEDE2000.
pub fn choose(study: &Study, goal: f64) -> Choice {
    let cheapest = |knows: Option<bool>| {
        study
            .runs
            .iter()
            .filter(|r| r.de2000.value <= goal)
            .filter(|r| knows.is_none_or(|k| k == r.estimate_spectrum.is_some()))
            .min_by(|a, b| a.cpu_s.total_cmp(&b.cpu_s))
    };
    let run = match (cheapest(Some(true)), cheapest(None)) {
        (Some(known), Some(any)) if known.cpu_s <= WORTH_KNOWING * any.cpu_s => known,
        (_, Some(any)) => any,
        (_, None) => return most_accurate(study, goal),
    };
    let mut why = vec![format!(
        "It is off by dE00 {:.2} on average (measured at {} points), within the goal of {goal}, for {:.2} CPU s.",
        run.de2000.value, study.points, run.cpu_s
    )];
    let others = others(study, goal, run.representation);
    why.extend(others.iter().map(|(name, best)| match best {
        Some(best) => slower(best, run),
        None => beyond(study, *name),
    }));
    Choice {
        run: Some(run.clone()),
        why,
    }
}

/// The choice where no bake came within the goal.
fn most_accurate(study: &Study, goal: f64) -> Choice {
    let runs = study.runs.iter();
    let best = runs.min_by(|a, b| a.de2000.value.total_cmp(&b.de2000.value));
    let why = best.map(|best| {
        format!(
            "No bake came within dE00 {goal}; the most accurate is off by {:.2}.",
            best.de2000.value
        )
    });
    Choice {
        run: best.cloned(),
        why: why.into_iter().collect(),
    }
}

/// Every other way to carry spectra, with its cheapest run within the goal.
fn others(study: &Study, goal: f64, taken: Representation) -> Vec<(Representation, Option<&Run>)> {
    let mut others: Vec<(Representation, Option<&Run>)> = Vec::new();
    for r in study.runs.iter().filter(|r| r.representation != taken) {
        let within = (r.de2000.value <= goal).then_some(r);
        match others
            .iter_mut()
            .find(|(name, _)| *name == r.representation)
        {
            Some((_, best)) => {
                if let Some(r) = within
                    && best.is_none_or(|b| r.cpu_s < b.cpu_s)
                {
                    *best = Some(r);
                }
            }
            None => others.push((r.representation, within)),
        }
    }
    others
}

/// What speaks against another way that comes within the goal.
fn slower(other: &Run, taken: &Run) -> String {
    let unknown = match other.estimate_spectrum {
        Some(_) => "",
        None => ", and does not know what its spectra cost",
    };
    format!(
        "{} takes {:.2} times as long (asked for {}){unknown}.",
        other.representation,
        other.cpu_s / taken.cpu_s,
        other.asked
    )
}

/// What speaks against one that does not.
fn beyond(study: &Study, name: Representation) -> String {
    let runs = study.runs.iter().filter(|r| r.representation == name);
    let least = runs.map(|r| r.de2000.value).fold(f64::INFINITY, f64::min);
    format!("{name} does not come within the goal: dE00 {least:.2} at best.")
}
