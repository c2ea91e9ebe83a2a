//! When to stop early: Ctrl-C, and the time given.
//!
//! The first Ctrl-C asks for an end with everything written: a round that is not done is taken back. Instead of the first a bake has the
//! light that rays from the lamps tell; what only asks for light waits for it. A room of which even that is not known in time leaves no file.
//! The second Ctrl-C ends the program at once with code 130 (128 + SIGINT), which may leave hidden temporary
//! files. Where time runs out in a round that was expected to fit, it is taken back as well. The gather that follows the rounds
//! ends in time, too: what it did not come to shows the solved light as it is. Several ranks end after the round that they are in.

use super::talk::{Talk, tell};
use crate::error::{Error, Result};
use crate::solve::{Bake, Round, Verdict};
use crate::team::{Asked, Interrupt, Team};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// What a Ctrl-C exits with that leaves no file: the second, and one while the room is prepared.
pub(super) const KILLED: u8 = 130;

/// Share of the time given after which no round may end: the gather takes as long as the rounds, as a rule.
const ROUNDS: f64 = 0.45;
/// Share of the time given at which a round that took longer than was expected is taken back: the gather can do with what is left,
/// and a round that is all but done is worth more than the light between vertices.
const ROUND_ENDS: f64 = 0.6;
/// The same for the first, without which there is no solution; earlier where the file takes more than the rest, see [`UNPREPARED`].
const FIRST_ENDS: f64 = 0.75;
/// Share of the time given by which the gather ends: measuring what came of it and writing take the rest.
const GATHER: f64 = 0.85;
/// After Ctrl-C the gather may look for so many seconds or this share of the time before, whichever is more. What is left of 5 s or 10 %
/// goes to what has to be done besides: edges, a measurement, the file; in a restaurant of 186,000 vertices 4 s on two busy cores.
const AFTER: (f64, f64) = (1.5, 0.04);
/// So many seconds after Ctrl-C, or this share of the time before, a file should be there at the latest.
const END: (f64, f64) = (5.0, 0.1);
/// What has to be done once a room is prepared takes so many times as long as all before: 1.0 in a canteen of 260,000 triangles, 1.1 in a
/// restaurant of 104,000, 1.3 in a dungeon of 70,000, on two busy cores.
const UNPREPARED: f64 = 1.1;

/// What may end a bake before its error is reached.
#[derive(Debug, Clone)]
pub struct Stop {
    started: Instant,
    /// Seconds from the start.
    time: Option<f64>,
    /// Milliseconds from the start to Ctrl-C, and one; 0: there was none.
    interrupted: Arc<AtomicU64>,
    /// Of several ranks the first says when it is time.
    team: Team,
    /// May the first round be given up?
    any_time: bool,
}

impl Stop {
    /// The clock starts now.
    pub fn new(time: Option<f64>) -> Self {
        Self {
            started: Instant::now(),
            time,
            interrupted: Arc::default(),
            team: Team::default(),
            any_time: false,
        }
    }

    /// The same where the first round may be given up, too.
    pub fn at_any_time(self) -> Self {
        Self {
            any_time: true,
            ..self
        }
    }

    /// The same for all ranks of a team; to be asked by all of them alike.
    pub fn of_all(self, team: Team) -> Self {
        Self { team, ..self }
    }

    /// Listens to Ctrl-C. To be called once in a process.
    ///
    /// # Errors
    /// The system refuses the handler.
    pub fn listen(&self) -> Result<()> {
        let stop = self.clone();
        ctrlc::set_handler(move || {
            if stop.interrupted_s().is_some() {
                std::process::exit(KILLED.into());
            }
            stop.interrupt();
            if stop.team.is_first() {
                tell("\nending with what is solved; Ctrl-C again ends at once");
            }
        })
        .map_err(|problem| Error::Internal(format!("Ctrl-C: {problem}")))
    }

    /// Asks for an end with the last whole round, as the first Ctrl-C does; from any thread, on any clone.
    pub fn interrupt(&self) {
        // Half a thousand million years of milliseconds fit.
        let now = self.started.elapsed().as_millis() as u64 + 1;
        // The first one counts.
        let _ = (self.interrupted).compare_exchange(0, now, Ordering::SeqCst, Ordering::SeqCst);
    }

    /// Seconds since the start.
    pub fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Seconds from the start to Ctrl-C.
    fn interrupted_s(&self) -> Option<f64> {
        let at = self.interrupted.load(Ordering::SeqCst).checked_sub(1)?;
        Some(1e-3 * at as f64)
    }

    /// Must the gather end? `ahead`: seconds that are needed after it.
    pub fn is_late(&self, ahead: f64) -> bool {
        let now = self.elapsed_s();
        let late =
            self.time.is_some_and(|time| now > GATHER * time - ahead) || self.is_past(AFTER, 0.0);
        self.team.first_says(late)
    }

    /// Is Ctrl-C so many seconds and this share of the time before ago, or will it be in `ahead` seconds?
    fn is_past(&self, (least, share): (f64, f64), ahead: f64) -> bool {
        let over = |at: f64| self.elapsed_s() + ahead > at + (share * at).max(least);
        self.interrupted_s().is_some_and(over)
    }

    /// Ends the looking over of a room as soon as Ctrl-C comes. Ranks would have to end it at the very same place.
    pub(super) fn survey(&self) -> Interrupt {
        let stop = self.clone();
        Interrupt::by(Arc::new(move || {
            stop.team.is_alone() && stop.interrupted_s().is_some()
        }))
    }

    /// Ends the preparing of a room after Ctrl-C where a file would come too late: before it is known where the light of lamps goes
    /// there is nothing to write.
    pub(super) fn preparing(&self) -> Asked {
        let stop = self.clone();
        Arc::new(move || stop.team.is_alone() && stop.is_past(END, UNPREPARED * stop.elapsed_s()))
    }

    /// Why nothing more should be done, if there is a reason.
    pub fn reason(&self) -> Option<Verdict> {
        match self.team.first_says(self.interrupted_s().is_some()) {
            true => Some(Verdict::Interrupted),
            false => self.time.map(|_| Verdict::OutOfTime),
        }
    }

    /// Should a bake that has done rounds do no further one?
    fn late(&self, rounds: &[Round]) -> Option<Verdict> {
        (!rounds.is_empty()).then(|| self.verdict(rounds)).flatten()
    }

    /// Should no further round begin?
    fn verdict(&self, rounds: &[Round]) -> Option<Verdict> {
        if self.team.first_says(self.interrupted_s().is_some()) {
            return Some(Verdict::Interrupted);
        }
        let next = rounds.last().map_or(0.0, |r| r.next_round_s);
        let late = self
            .time
            .is_some_and(|time| self.elapsed_s() + next > ROUNDS * time);
        (self.team.first_says(late)).then_some(Verdict::OutOfTime)
    }

    /// Is it time for a round to end that is not done, so many `seconds` after the start?
    fn ends_round(&self, seconds: f64) -> bool {
        self.interrupted_s().is_some() || self.elapsed_s() > seconds
    }

    /// Seconds from the start at which a round has to be taken back, if it begins now.
    fn round_end_s(&self, is_first: bool) -> f64 {
        let time = self.time.unwrap_or(f64::INFINITY);
        match is_first {
            true => (FIRST_ENDS * time).min(time - UNPREPARED * self.elapsed_s()),
            false => ROUND_ENDS * time,
        }
    }

    /// Steps a bake to its end; `each` is told of every round, with how many seconds it is expected to take from there to the end, as
    /// `ahead` says. Rounds are taken back where they would take too long, see [`Bake::taken_back_s`].
    ///
    /// # Errors
    /// What `each` returns.
    pub fn run(
        &self,
        bake: &mut Bake,
        talk: &Talk,
        ahead: impl Fn(&Bake, &Round) -> Option<f64>,
        mut each: impl FnMut(&Bake, &Round, Option<f64>) -> Result<()>,
    ) -> Result<Verdict> {
        if let Some(verdict) = bake.verdict().or_else(|| self.late(bake.rounds())) {
            return Ok(verdict);
        }
        let mut left = String::new();
        loop {
            let number = bake.rounds().len() + 1;
            talk.phase(&format!("round {number}{left}"));
            let Some(round) = self.step(bake) else {
                let seconds = bake.taken_back_s().unwrap_or(0.0);
                talk.say(&format!("round {number}: taken back after {seconds:.1} s"));
                return Ok(self.reason().unwrap_or(Verdict::Interrupted));
            };
            let seconds = self.bounded(ahead(bake, &round));
            left = seconds.map_or(String::new(), |s| format!("; about {s:.0} s to go"));
            talk.say(&format!("{}{left}", line(&round)));
            each(bake, &round, seconds)?;
            // A reached error counts even when the time is up.
            if let Some(verdict) = bake.verdict().or_else(|| self.verdict(bake.rounds())) {
                return Ok(verdict);
            }
        }
    }

    /// A round; none if it was given up.
    fn step(&self, bake: &mut Bake) -> Option<Round> {
        let is_first = bake.rounds().is_empty();
        if is_first && !self.any_time {
            return Some(bake.step().clone());
        }
        let (stop, end_s) = (self.clone(), self.round_end_s(is_first));
        bake.step_unless(Arc::new(move || stop.ends_round(end_s)))
            .cloned()
    }

    /// Seconds that are left: no more than those given.
    fn bounded(&self, seconds: Option<f64>) -> Option<f64> {
        let given = self.time.map(|time| (time - self.elapsed_s()).max(0.0));
        match (seconds, given) {
            (Some(seconds), Some(given)) => Some(seconds.min(given)),
            (seconds, given) => seconds.or(given),
        }
    }
}

/// A round in one line.
fn line(round: &Round) -> String {
    let error = match round.error.total_de2000.value {
        Some(error) => format!("dE00 {error:.2} (estimate)"),
        None => "no estimate yet".into(),
    };
    format!(
        "round {}: {error}, {} elements, {} links, {} intervals, {:.1} s",
        round.round, round.elements, round.links, round.intervals_working, round.round_s
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn an_interrupt_goes_before_the_time() {
        let stop = Stop::new(Some(1e-9));
        assert_eq!(stop.verdict(&[]), Some(Verdict::OutOfTime));
        stop.interrupt();
        assert_eq!(stop.verdict(&[]), Some(Verdict::Interrupted));
        assert_eq!(Stop::new(None).verdict(&[]), None);
    }

    /// A bake that began so many seconds ago and was interrupted so many after.
    fn interrupted(ago: u64, at: u64) -> Stop {
        Stop {
            started: Instant::now() - Duration::from_secs(ago),
            interrupted: Arc::new(AtomicU64::new(1000 * at + 1)),
            ..Stop::new(None)
        }
    }

    #[test]
    fn preparing_ends_later_than_a_survey() {
        let never = Stop::new(None);
        assert!(!never.survey().is_raised() && !never.preparing()());
        // One second has passed and two are ahead.
        let early = interrupted(2, 1);
        assert!(early.survey().is_raised() && !early.preparing()());
        // Ten are ahead.
        assert!(interrupted(10, 9).preparing()());
    }

    #[test]
    fn a_round_ends_for_either() {
        let ends = |stop: &Stop| stop.ends_round(stop.round_end_s(false));
        assert!(ends(&Stop::new(Some(1e-9))));
        let stop = Stop::new(Some(1e9));
        assert!(!ends(&stop) && !ends(&Stop::new(None)));
        stop.interrupt();
        assert!(ends(&stop));
    }

    #[test]
    fn a_first_round_leaves_time_for_the_file() {
        // Four seconds have passed, and the file takes a little more than that.
        let stop = |time| Stop {
            started: Instant::now() - Duration::from_secs(4),
            ..Stop::new(Some(time))
        };
        let end_s = stop(10.0).round_end_s(true);
        assert!(end_s > 5.0 && end_s < 6.0, "{end_s}");
        assert_eq!(stop(100.0).round_end_s(true), 75.0);
        assert_eq!(stop(100.0).round_end_s(false), 60.0);
    }
}
