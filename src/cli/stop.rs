//! When to stop early: Ctrl-C, and the time given.
//!
//! The first Ctrl-C asks for an end after the current round, with everything written; the second ends the program at
//! once with code 130 (128 + SIGINT), which may leave hidden temporary files.

use super::talk::Talk;
use crate::error::{Error, Result};
use crate::solve::{Bake, Round, Verdict};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What the second Ctrl-C exits with.
const KILLED: i32 = 130;
/// Growth of the time of a round that is expected after the first; later it is measured.
const GROWTH: f64 = 2.5;

/// What may end a bake before its error is reached.
#[derive(Debug, Clone)]
pub struct Stop {
    started: Instant,
    /// Seconds from the start.
    time: Option<f64>,
    interrupted: Arc<AtomicBool>,
}

impl Stop {
    /// The clock starts now.
    pub fn new(time: Option<f64>) -> Self {
        Self {
            started: Instant::now(),
            time,
            interrupted: Arc::default(),
        }
    }

    /// Listens to Ctrl-C. To be called once in a process.
    ///
    /// # Errors
    /// The system refuses the handler.
    pub fn listen(&self) -> Result<()> {
        let interrupted = Arc::clone(&self.interrupted);
        ctrlc::set_handler(move || {
            if interrupted.swap(true, Ordering::SeqCst) {
                std::process::exit(KILLED);
            }
            eprintln!("\nending after this round; Ctrl-C again ends at once");
        })
        .map_err(|problem| Error::Internal(format!("Ctrl-C: {problem}")))
    }

    /// Seconds since the start.
    pub fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Should a bake that has done rounds do no further one?
    fn late(&self, rounds: &[Round]) -> Option<Verdict> {
        (!rounds.is_empty()).then(|| self.verdict(rounds)).flatten()
    }

    /// Should no further round begin?
    fn verdict(&self, rounds: &[Round]) -> Option<Verdict> {
        if self.interrupted.load(Ordering::SeqCst) {
            return Some(Verdict::Interrupted);
        }
        let seconds: Vec<f64> = rounds.iter().map(|r| r.round_s).collect();
        let late = self
            .time
            .is_some_and(|time| self.elapsed_s() + next_round(&seconds) > time);
        late.then_some(Verdict::OutOfTime)
    }

    /// Steps a bake to its end; `each` is told of every round. The first round is always done, so that there is a whole
    /// solution; a bake that was resumed has one.
    ///
    /// # Errors
    /// What `each` returns.
    pub fn run(
        &self,
        bake: &mut Bake,
        talk: &Talk,
        mut each: impl FnMut(&Bake, &Round) -> Result<()>,
    ) -> Result<Verdict> {
        if let Some(verdict) = bake.verdict().or_else(|| self.late(bake.rounds())) {
            return Ok(verdict);
        }
        loop {
            let number = bake.rounds().len() + 1;
            talk.phase(&format!("round {number}"));
            let round = bake.step().clone();
            talk.say(&line(&round));
            each(bake, &round)?;
            // A reached error counts even when the time is up.
            if let Some(verdict) = bake.verdict().or_else(|| self.verdict(bake.rounds())) {
                return Ok(verdict);
            }
        }
    }
}

/// Expected seconds of the next round.
fn next_round(seconds: &[f64]) -> f64 {
    match seconds {
        [] => 0.0,
        [only] => only * GROWTH,
        // A round that was faster than the one before tells nothing about the next.
        [.., before, last] => last * (last / before.max(1e-9)).clamp(1.0, 2.0 * GROWTH),
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

    #[test]
    fn the_next_round_is_expected_to_grow_as_the_last_did() {
        assert_eq!(next_round(&[]), 0.0);
        assert_eq!(next_round(&[2.0]), 5.0);
        assert_eq!(next_round(&[1.0, 3.0]), 9.0);
        assert_eq!(next_round(&[3.0, 1.0]), 1.0);
    }

    #[test]
    fn an_interrupt_goes_before_the_time() {
        let stop = Stop::new(Some(1e-9));
        assert_eq!(stop.verdict(&[]), Some(Verdict::OutOfTime));
        stop.interrupted.store(true, Ordering::SeqCst);
        assert_eq!(stop.verdict(&[]), Some(Verdict::Interrupted));
        assert_eq!(Stop::new(None).verdict(&[]), None);
    }
}
