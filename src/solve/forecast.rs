//! When a bake ends and how long it still takes: an extrapolation of the rounds so far.
//!
//! From round to round the time is multiplied by g, the links by l and the error by q. Early rounds add little to the triangles of the
//! room; later ones approach the law that the thresholds follow: `g' = sqrt(g 3)`, `l' = sqrt(l 4)`. Where rays bring noise the error
//! falls less and less, `1 - q' = (1 - q) / 2`. So rounds are added until one of them would end the bake. An *estimate*: the error is
//! itself one, and its fall varies by tens of per cent from round to round.

use super::record::Verdict;

/// What the growth of the time of rounds, and of links, tends to. In a living room of 22,000 triangles rounds 3 to 6 took 1.4, 2.2, 2.6 and 3.0 times as long
/// as those before, and made 1.6, 2.8, 3.3 and 3.5 times the links; in a home theater of 15,000, 1.3 and 2.1 times as long, 1.4 and 2.1 times the links.
const GROWTH: f64 = 3.0;
const LINKS: f64 = 4.0;
/// The greatest growth that is believed; the least is 1.
const GREATEST_GROWTH: f64 = 5.0;
/// The fastest fall that is believed: a faster one was luck.
const FASTEST: f64 = 0.3;
/// Rounds to look ahead, at the most.
const AHEAD: usize = 12;

/// Fewer rounds suffice for a preview: if an error of at least `PREVIEW` is asked for and the estimate is `EARLY` times
/// smaller.
const PREVIEW: f64 = 2.0;
const EARLY: f64 = 4.0;
/// Least rounds before an estimate is believed: one distance between rounds may be small by chance, or because the second found
/// nothing to refine yet.
const LEAST_ROUNDS: usize = 3;
/// A round that leaves this share of the error of the one before has stalled, if there are many links already. If the error rose
/// much, the round has not: it found light that earlier rounds overlooked, as in the gap above a lamp.
const STALLED: f64 = 0.9;
const WORTH_STALLING: usize = 100_000;
/// The most links that a next round may make, at four times those of the last: about 200 MB.
const MOST_LINKS: usize = 4_000_000;

/// A round as far as the end of a bake depends on it.
#[derive(Debug, Clone, Copy)]
pub struct Past {
    /// Seconds that the round took.
    pub seconds: f64,
    /// Estimated error, CIEDE2000, if known.
    pub error: Option<f64>,
    /// Links.
    pub links: usize,
}

/// How errors fall.
#[derive(Debug, Clone, Copy)]
pub struct Fall {
    /// Share of the second round's error that the third leaves.
    first: f64,
    /// What remains of `1 - q` a round later.
    slower: f64,
}

/// Where leaves look by rays, whose noise remains. `first`: .13 in a sunlit room, .34 in a restaurant, .36 in a garage, .43 in a canteen, .45 in a
/// living room, .62 in a furnished room. `slower`: .44, .55 and .22 in the living room, .52 in a home theater.
pub const BY_RAYS: Fall = Fall {
    first: 0.4,
    slower: 0.5,
};
/// Where light goes along links. `first`: .1 to .4 in Cornell boxes.
pub const BY_LINKS: Fall = Fall {
    first: 0.3,
    slower: 1.0,
};

/// What is asked of the light of a bake.
#[derive(Debug, Clone, Copy)]
pub struct Goal {
    /// Error, CIEDE2000.
    pub error: f64,
    /// Rounds at the most.
    pub rounds: usize,
    /// How the error of the bake falls.
    pub fall: Fall,
}

impl Goal {
    /// How a bake ends with these rounds; none: another round may help.
    pub fn verdict(&self, past: &[Past]) -> Option<Verdict> {
        let (last, before) = (past.last()?, past.iter().rev().nth(1));
        // Four times the links for next to nothing: the rest is the noise of visibility in the gather.
        let fall = before.and_then(|before| Some(last.error? / before.error?));
        // An error that was lower before is no such rest: finer leaves have found light that coarse ones did not know of.
        let errors = past.iter().filter_map(|round| round.error);
        let is_lowest = last
            .error
            .is_some_and(|last| errors.fold(last, f64::min) > STALLED * last);
        let stalled = fall.is_some_and(|fall| (STALLED..1.0 / STALLED).contains(&fall))
            && is_lowest
            && last.links > WORTH_STALLING;
        let exhausted = (has_many(past) || stalled).then_some(Verdict::Exhausted);
        self.done(past).or(exhausted)
    }

    /// Is the error or the number of rounds reached?
    fn done(&self, past: &[Past]) -> Option<Verdict> {
        let asked = self.error;
        let settled =
            |e: f64| past.len() >= LEAST_ROUNDS || (asked >= PREVIEW && EARLY * e <= asked);
        if past.last()?.error.is_some_and(|e| e <= asked && settled(e)) {
            return Some(Verdict::Reached);
        }
        (past.len() >= self.rounds).then_some(Verdict::OutOfRounds)
    }

    /// Extrapolates the rounds so far; none if the error is unknown, or no end is in sight. Whether rounds stall before links
    /// become too many cannot be foreseen (a living room did, a garage did not): the geometric mean of both times is taken.
    pub fn forecast(&self, past: &[Past]) -> Option<Forecast> {
        past.last()?.error?;
        let mut all = past.to_vec();
        let mut until = |ended: &dyn Fn(&[Past]) -> bool| {
            while !ended(&all) {
                if all.len() == past.len() + AHEAD {
                    return None;
                }
                all.push(next(&all, self.fall)?);
            }
            let ahead = &all[past.len()..];
            Some((
                ahead.len(),
                ahead.iter().map(|round| round.seconds).sum::<f64>(),
            ))
        };
        let (rounds, early) = until(&|all| self.verdict(all).is_some())?;
        let (_, late) = match rounds {
            0 => (0, early),
            _ => until(&|all| self.done(all).is_some() || has_many(all))?,
        };
        Some(Forecast {
            rounds,
            seconds: (early * late).sqrt(),
        })
    }
}

/// Would a further round make too many links?
fn has_many(past: &[Past]) -> bool {
    past.last().is_some_and(|last| 4 * last.links > MOST_LINKS)
}

/// An extrapolation of the rounds so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forecast {
    /// Rounds until the bake ends.
    pub rounds: usize,
    /// Seconds of these rounds.
    pub seconds: f64,
}

/// Expected seconds of the next round.
pub fn next_round(past: &[Past]) -> f64 {
    next(past, BY_LINKS).map_or(0.0, |round| round.seconds)
}

/// The next round, as expected.
fn next(past: &[Past], law: Fall) -> Option<Past> {
    let (last, before) = (past.last()?, past.iter().rev().nth(1));
    // The second round takes .4 to .8 times as long as the first, which looks at all leaves, in rooms of furniture; twice as long in small
    // ones.
    let grown = |limit: f64, of: &dyn Fn(&Past) -> f64| {
        let growth = before.map(|before| of(last) / of(before).max(1e-9));
        of(last) * growth.map_or(1.0, |g| (g.clamp(1.0, GREATEST_GROWTH) * limit).sqrt())
    };
    let known = before.and_then(|before| Some(last.error? / before.error?));
    // An error that rises was underestimated before: how it falls is unknown.
    let fall = known.filter(|fall| *fall < 1.0).map_or(law.first, |fall| {
        1.0 - law.slower * (1.0 - fall.max(FASTEST))
    });
    Some(Past {
        seconds: grown(GROWTH, &|round| round.seconds),
        error: last.error.map(|error| fall * error),
        // The cast is exact enough: there are fewer links than memory holds.
        links: grown(LINKS, &|round| round.links as f64) as usize,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn past(rounds: &[(f64, f64, usize)]) -> Vec<Past> {
        let one = |&(seconds, error, links): &(f64, f64, usize)| Past {
            seconds,
            error: Some(error).filter(|e| !e.is_nan()),
            links,
        };
        rounds.iter().map(one).collect()
    }

    const GOAL: Goal = Goal {
        error: 0.4,
        rounds: 32,
        fall: BY_RAYS,
    };

    #[test]
    fn rounds_grow_towards_the_law_of_their_thresholds() {
        assert_eq!(next_round(&[]), 0.0);
        assert_eq!(next_round(&past(&[(2.0, f64::NAN, 0)])), 2.0);
        assert_eq!(next_round(&past(&[(1.0, 1.0, 0), (3.0, 1.0, 0)])), 9.0);
        let faster = next_round(&past(&[(3.0, 1.0, 0), (1.0, 1.0, 0)]));
        assert!((faster - 3_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn two_rounds_do_for_a_preview_alone() {
        let two = past(&[(1.0, f64::NAN, 1), (1.0, 0.4, 1)]);
        assert_eq!(GOAL.verdict(&two), None);
        let preview = Goal { error: 2.0, ..GOAL };
        assert_eq!(preview.verdict(&two), Some(Verdict::Reached));
        let three = past(&[(1.0, f64::NAN, 1), (1.0, 0.5, 1), (1.0, 0.39, 1)]);
        assert_eq!(GOAL.verdict(&three), Some(Verdict::Reached));
    }

    /// A home theater and a living room as baked: the forecast, and the time then taken.
    #[test]
    fn rooms_take_about_what_was_told() {
        let theater = [
            (1.44, f64::NAN, 3042),
            (1.07, 0.683, 3567),
            (1.37, 0.462, 5117),
            (2.93, 0.384, 10996),
        ];
        let living = [
            (1.49, f64::NAN, 8099),
            (1.25, 1.517, 9641),
            (1.81, 0.819, 15389),
            (4.01, 0.652, 42655),
            (10.47, 0.579, 140_316),
            (30.97, 0.565, 486_305),
        ];
        for room in [&theater[..], &living] {
            for k in 2..room.len() {
                let told = GOAL.forecast(&past(&room[..k])).unwrap().seconds;
                let took: f64 = room[k..].iter().map(|round| round.0).sum();
                assert!((0.4..2.1).contains(&(told / took)), "{k}: {told} of {took}");
            }
            let over = GOAL.forecast(&past(room)).unwrap();
            assert_eq!((over.rounds, over.seconds), (0, 0.0));
        }
    }

    #[test]
    fn what_is_not_known_is_not_told() {
        assert_eq!(GOAL.forecast(&[]), None);
        assert_eq!(GOAL.forecast(&past(&[(1.0, f64::NAN, 9)])), None);
        // Too far off; after an error that rose, the usual fall is expected.
        let few = past(&[(1.0, 2.0, 0), (2.0, 1.9, 0)]);
        let far = Goal {
            error: 1e-6,
            ..GOAL
        };
        assert_eq!(far.forecast(&few), None);
        let rising = past(&[(1.0, 0.5, 1), (2.0, 1.2, 1)]);
        assert_eq!(GOAL.forecast(&rising).unwrap().rounds, 2);
        let by_links = Goal {
            fall: BY_LINKS,
            ..GOAL
        };
        assert_eq!(by_links.forecast(&rising).unwrap().rounds, 1);
    }
}
