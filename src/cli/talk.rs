//! What is said on stderr while a command works: lines, and a bar or spinner where stderr is a terminal.
//!
//! Nothing here changes what is computed; `--quiet` silences all of it, but warnings are counted, and logs have them. Where
//! nobody listens any more (a closed pipe) the work goes on.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::Cell;
use std::io::{IsTerminal, Write};
use std::time::Duration;

/// How often a spinner turns.
const TICK: Duration = Duration::from_millis(120);

/// The voice of a command.
#[derive(Debug)]
pub struct Talk {
    quiet: bool,
    bar: ProgressBar,
    warned: Cell<usize>,
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
        Self {
            quiet,
            bar,
            warned: Cell::new(0),
        }
    }

    /// A line.
    pub fn say(&self, line: &str) {
        if !self.quiet {
            self.bar.suspend(|| tell(line));
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
        let bar = self.watch();
        bar.set_prefix(name.to_owned());
        bar.set_message("");
    }

    /// The spinner, to be handed to whoever knows the phases.
    pub fn watch(&self) -> ProgressBar {
        if !self.bar.is_hidden() {
            // The templates are constants: they parse.
            if let Ok(style) = ProgressStyle::with_template("{spinner} {prefix} {msg} {elapsed}") {
                self.bar.set_style(style);
            }
            self.bar.enable_steady_tick(TICK);
        }
        self.bar.clone()
    }

    /// `done` of `of` things of the phase `name` are done.
    pub fn progress(&self, name: &str, done: usize, of: usize) {
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
    }
}

impl Drop for Talk {
    fn drop(&mut self) {
        self.clear();
    }
}
