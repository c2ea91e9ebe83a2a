//! How long it will still take: the cost curve so far, extrapolated.
//!
//! From round to round the error is multiplied by about the same q < 1 and the time by about the same g > 1, so that the
//! error falls as a power of the time. Both are taken from the last two rounds that tell them; before, from what rooms
//! usually do. `rounds = log(asked / error) / log q`, `seconds = sum over them of last round * g^k`. An *estimate*: the
//! error is one itself, and its fall wavers by tens of per cent from round to round.

/// Growth of the time of a round that is expected after the first: links become about four times as many, leaves two.
const GROWTH: f64 = 2.5;
/// Growth that is believed at the most; less than none is not believed.
const GREATEST_GROWTH: f64 = 5.0;
/// What the error of a round is multiplied by in the next, before that is known (Cornell box .4, two rooms .6,
/// furnished room .7).
const FALL: f64 = 0.6;
/// The fastest and the slowest fall that is believed: beyond, the last two rounds were luck, or refining is over.
const FALLS: [f64; 2] = [0.3, 0.95];
/// Rounds that are looked ahead at the most.
const AHEAD: usize = 12;

/// A look ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forecast {
    /// Rounds to the asked-for error.
    pub rounds: usize,
    /// Seconds for them.
    pub seconds: f64,
}

/// Expected seconds of the next round, from those of the rounds so far.
pub fn next_round(seconds: &[f64]) -> f64 {
    seconds.last().map_or(0.0, |last| last * growth(seconds))
}

fn growth(seconds: &[f64]) -> f64 {
    match seconds {
        [.., before, last] => (last / before.max(1e-9)).clamp(1.0, GREATEST_GROWTH),
        _ => GROWTH,
    }
}

/// Looks ahead from the seconds and errors of the rounds so far; none if the error is not known or no longer falls.
pub fn forecast(rounds: &[(f64, Option<f64>)], asked: f64) -> Option<Forecast> {
    let seconds: Vec<f64> = rounds.iter().map(|r| r.0).collect();
    let (&last, error) = (seconds.last()?, rounds.last()?.1?);
    if error <= asked {
        return Some(Forecast {
            rounds: 0,
            seconds: 0.0,
        });
    }
    let before = rounds.len().checked_sub(2).and_then(|k| rounds[k].1);
    let fall = before.map_or(FALL, |before| (error / before).max(FALLS[0]));
    if !(fall <= FALLS[1] && asked > 0.0) {
        return None;
    }
    let wanted = ((asked / error).ln() / fall.ln()).ceil();
    let wanted = (wanted <= AHEAD as f64).then_some(wanted as usize)?;
    let growth = growth(&seconds);
    let seconds = (1..=wanted).map(|k| last * growth.powi(k as i32)).sum();
    Some(Forecast {
        rounds: wanted,
        seconds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_round_is_expected_to_grow_as_the_last_did() {
        assert_eq!(next_round(&[]), 0.0);
        assert_eq!(next_round(&[2.0]), 5.0);
        assert_eq!(next_round(&[1.0, 3.0]), 9.0);
        assert_eq!(next_round(&[3.0, 1.0]), 1.0);
    }

    /// A power law is continued exactly: error 8, 4, 2, 1 at rounds of 1, 3, 9, 27 s.
    #[test]
    fn a_power_law_is_continued() {
        let so_far = [(1.0, None), (3.0, Some(8.0)), (9.0, Some(4.0))];
        let ahead = |asked| forecast(&so_far, asked);
        let told = |rounds, seconds| Some(Forecast { rounds, seconds });
        assert_eq!(ahead(4.0), told(0, 0.0));
        assert_eq!(ahead(2.0), told(1, 27.0));
        assert_eq!(ahead(1.5), told(2, 27.0 + 81.0));
        assert_eq!(ahead(1.0), told(2, 27.0 + 81.0));
        // Six further halvings.
        assert_eq!(ahead(0.0625).unwrap().rounds, 6);
    }

    #[test]
    fn what_is_not_known_is_not_told() {
        assert_eq!(forecast(&[], 1.0), None);
        assert_eq!(forecast(&[(1.0, None)], 1.0), None);
        // One error: the usual fall, and the growth of the rounds.
        let one = forecast(&[(1.0, None), (2.0, Some(1.5))], 1.0).unwrap();
        assert_eq!((one.rounds, one.seconds), (1, 4.0));
        // Rising, level, or never enough.
        for now in [2.1, 2.0, 1.95] {
            assert_eq!(forecast(&[(1.0, Some(2.0)), (2.0, Some(now))], 1.0), None);
        }
        assert_eq!(forecast(&[(1.0, Some(2.0)), (2.0, Some(1.8))], 1e-6), None);
        assert_eq!(
            forecast(&[(1.0, Some(2.0)), (2.0, Some(f64::NAN))], 1.0),
            None
        );
    }
}
