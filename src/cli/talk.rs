//! What is said on stderr while a command works: lines, and a bar or spinner where stderr is a terminal. Where it is none,
//! a line tells what is being done whenever nothing else was said for some seconds.
//!
//! Nothing here changes what is computed; `--quiet` silences all of it, but warnings are counted, and logs have them. Where
//! nobody listens any more (a closed pipe) the work goes on.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::Cell;
use std::io::{IsTerminal, Write};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How often a spinner turns.
const TICK: Duration = Duration::from_millis(120);

/// Silence after which a line is said where there is no terminal.
const SILENCE: Duration = Duration::from_secs(5);

/// The voice of a command.
#[derive(Debug)]
pub struct Talk {
    quiet: bool,
    bar: ProgressBar,
    warned: Cell<usize>,
    work: Work,
    /// Tells of the work where there is no terminal, until the sender goes.
    teller: Option<(Sender<()>, JoinHandle<()>)>,
}

/// What is being done, and when something was last said.
#[derive(Debug, Clone)]
struct Work(Arc<Mutex<(String, Instant)>>);

impl Work {
    fn begins(&self, name: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).0 = name;
    }

    fn said(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).1 = Instant::now();
    }

    /// What to say, if nothing was for a while.
    fn line(&self) -> Option<String> {
        let mut work = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if work.1.elapsed() < SILENCE || work.0.is_empty() {
            return None;
        }
        work.1 = Instant::now();
        Some(work.0.clone())
    }

    fn tell_of(self) -> (Sender<()>, JoinHandle<()>) {
        let (alive, gone) = channel();
        let started = Instant::now();
        let teller = std::thread::spawn(move || {
            while gone.recv_timeout(SILENCE / 5) == Err(RecvTimeoutError::Timeout) {
                if let Some(line) = self.line() {
                    tell(&format!(
                        "  {line} ({:.0} s)",
                        started.elapsed().as_secs_f64()
                    ));
                }
            }
        });
        (alive, teller)
    }
}

/// Says which part of a phase begins.
#[derive(Debug, Clone)]
pub struct PhaseParts {
    bar: ProgressBar,
    work: Work,
}

impl PhaseParts {
    /// A part begins.
    pub fn begins(&self, phase: &str, part: &'static str) {
        self.bar.set_message(part);
        self.work.begins(format!("{phase}: {part}"));
    }
}

/// A line on stderr; that nobody reads it is no fault.
pub(super) fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

impl Talk {
    /// Lines unless `quiet`; bars only on a terminal.
    pub fn new(quiet: bool) -> Self {
        let bar = if quiet || !std::io::stderr().is_terminal() {
            ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden())
        } else {
            ProgressBar::no_length()
        };
        let work = Work(Arc::new(Mutex::new((String::new(), Instant::now()))));
        let mute = !quiet && bar.is_hidden();
        Self {
            quiet,
            bar,
            warned: Cell::new(0),
            teller: mute.then(|| work.clone().tell_of()),
            work,
        }
    }

    /// A line.
    pub fn say(&self, line: &str) {
        if !self.quiet {
            self.bar.suspend(|| tell(line));
            self.work.said();
        }
    }

    /// A line that begins with `warning:`.
    pub fn warn(&self, line: &str) {
        self.warned.set(self.warned.get() + 1);
        self.say(&format!("warning: {line}"));
    }

    /// How many warnings there were, said or not.
    pub fn warned(&self) -> usize {
        self.warned.get()
    }

    /// Ends a summary with the count of warnings, if there were any: they may have scrolled away.
    pub fn count_warnings(&self) {
        match self.warned() {
            0 => {}
            1 => self.say("1 warning, above"),
            n => self.say(&format!("{n} warnings, above")),
        }
    }

    /// A phase of unknown length begins.
    pub fn phase(&self, name: &str) {
        self.work.begins(name.to_owned());
        self.spin();
        self.bar.set_prefix(name.to_owned());
        self.bar.set_message("");
    }

    /// For whoever knows the parts of phases.
    pub fn parts(&self) -> PhaseParts {
        self.spin();
        PhaseParts {
            bar: self.bar.clone(),
            work: self.work.clone(),
        }
    }

    fn spin(&self) {
        if !self.bar.is_hidden() {
            // The templates are constants: they parse.
            if let Ok(style) = ProgressStyle::with_template("{spinner} {prefix} {msg} {elapsed}") {
                self.bar.set_style(style);
            }
            self.bar.enable_steady_tick(TICK);
        }
    }

    /// `done` of `of` things of the phase `name` are done.
    pub fn progress(&self, name: &str, done: usize, of: usize) {
        self.work.begins(format!("{name}: {done} of {of}"));
        if self.bar.is_hidden() {
            return;
        }
        if done == 0
            && let Ok(style) =
                ProgressStyle::with_template("  {msg} [{bar:30}] {pos} of {len} {elapsed}")
        {
            self.bar.set_style(style);
            self.bar.set_message(name.to_owned());
        }
        self.bar.set_length(of as u64);
        self.bar.set_position(done as u64);
    }

    /// The bar goes.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
        self.work.begins(String::new());
    }
}

impl Drop for Talk {
    fn drop(&mut self) {
        self.clear();
        if let Some((alive, teller)) = self.teller.take() {
            drop(alive);
            // It only waits and writes.
            let _ = teller.join();
        }
    }
}
