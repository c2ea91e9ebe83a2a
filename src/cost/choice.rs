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
    let mut why = Vec::new();
    let run = match (cheapest(Some(true)), cheapest(None)) {
        (Some(known), Some(any)) if known.cpu_s <= WORTH_KNOWING * any.cpu_s => Some(known),
        (_, Some(any)) => Some(any),
        (_, None) => None,
    };
    let Some(run) = run else {
        let best = study
            .runs
            .iter()
            .min_by(|a, b| a.de2000.value.total_cmp(&b.de2000.value));
        if let Some(best) = best {
            why.push(format!(
                "No bake came within dE00 {goal}; the most accurate is off by {:.2}.",
                best.de2000.value
            ));
        }
        return Choice {
            run: best.cloned(),
            why,
        };
    };
    why.push(format!(
        "It is off by dE00 {:.2} on average (measured at {} points), within the goal of {goal}, for {:.2} CPU s.",
        run.de2000.value, study.points, run.cpu_s
    ));
    // The cheapest run within the goal of every other way.
    let mut others: Vec<(Representation, Option<&Run>)> = Vec::new();
    for r in &study.runs {
        if r.representation == run.representation {
            continue;
        }
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
    for (name, best) in others {
        why.push(match best {
            Some(best) => {
                let unknown = match best.estimate_spectrum {
                    Some(_) => "",
                    None => ", and does not know what its spectra cost",
                };
                format!(
                    "{name} takes {:.2} times as long (asked for {}){unknown}.",
                    best.cpu_s / run.cpu_s,
                    best.asked
                )
            }
            None => {
                let least = study
                    .runs
                    .iter()
                    .filter(|r| r.representation == name)
                    .map(|r| r.de2000.value)
                    .fold(f64::INFINITY, f64::min);
                format!("{name} does not come within the goal: dE00 {least:.2} at best.")
            }
        });
    }
    Choice {
        run: Some(run.clone()),
        why,
    }
}
