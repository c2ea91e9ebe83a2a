//! Collects what is wrong with a room, so that everything is reported together.

use crate::error::Problem;
use std::collections::BTreeMap;

/// How many problems (and how many warnings) are listed one by one; the rest is counted.
/// A broken file of a million nodes must not become a message of a million lines.
const MAX_LISTED: usize = 50;

/// What becomes of keys and names that nobody knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unknown {
    /// A problem: the file is ours, and they are misspelled.
    Refuse,
    /// A warning, for files that are to be read all the same.
    Warn,
    /// They are somebody else's.
    Ignore,
}

/// Problems and warnings of one file.
#[derive(Debug, Clone)]
pub(crate) struct Check {
    file: String,
    problems: Vec<Problem>,
    more_problems: usize,
    warnings: Vec<String>,
    more_warnings: usize,
}

impl Check {
    /// Nothing wrong yet; `file` opens the place of every problem.
    pub(crate) fn new(file: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            problems: Vec::new(),
            more_problems: 0,
            warnings: Vec::new(),
            more_warnings: 0,
        }
    }

    /// Something that the room cannot be used with.
    pub(crate) fn problem(
        &mut self,
        place: &str,
        what: impl Into<String>,
        next: impl Into<String>,
    ) {
        let problem = Problem::new(self.at(place), what, next);
        if self.problems.contains(&problem) {
            return;
        }
        if self.problems.len() < MAX_LISTED {
            self.problems.push(problem);
        } else {
            self.more_problems += 1;
        }
    }

    /// Something that the user should know.
    pub(crate) fn warn(&mut self, warning: impl Into<String>) {
        let warning = warning.into();
        if self.warnings.contains(&warning) {
            return;
        }
        if self.warnings.len() < MAX_LISTED {
            self.warnings.push(warning);
        } else {
            self.more_warnings += 1;
        }
    }

    /// Something that nobody knows.
    pub(crate) fn stranger(&mut self, unknown: Unknown, place: &str, what: String, next: String) {
        match unknown {
            Unknown::Refuse => self.problem(place, what, next),
            Unknown::Warn => self.warn(format!("{place}: {what}; {next}")),
            Unknown::Ignore => {}
        }
    }

    /// Is anything wrong?
    pub(crate) fn has_problems(&self) -> bool {
        !self.problems.is_empty()
    }

    /// Is the list of problems full? Then there is no point in looking for more.
    pub(crate) fn is_full(&self) -> bool {
        self.problems.len() >= MAX_LISTED
    }

    /// Problems and warnings, each list closed by a count of what it left out.
    pub(crate) fn into_parts(mut self) -> (Vec<Problem>, Vec<String>) {
        if self.more_problems > 0 {
            let what = format!("{} more problems at least", self.more_problems);
            let place = self.file.clone();
            self.problems.push(Problem::new(
                place,
                what,
                "mend the ones above and try again",
            ));
        }
        if self.more_warnings > 0 {
            self.warnings
                .push(format!("{} more warnings", self.more_warnings));
        }
        (self.problems, self.warnings)
    }

    fn at(&self, place: &str) -> String {
        if place.is_empty() {
            self.file.clone()
        } else {
            format!("{}: {place}", self.file)
        }
    }
}

/// At most eight names, the others counted.
pub(crate) fn listed(names: &[String]) -> String {
    const SHOWN: usize = 8;
    let shown = names[..names.len().min(SHOWN)].join(", ");
    match names.len() {
        n if n > SHOWN => format!("{shown} and {} more", n - SHOWN),
        _ => shown,
    }
}

/// What is counted over the whole document and said once.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    counts: BTreeMap<&'static str, (usize, String)>,
}

impl Tally {
    pub(crate) fn count(&mut self, what: &'static str, how_many: usize, first: &str) {
        if how_many > 0 {
            let entry = self
                .counts
                .entry(what)
                .or_insert_with(|| (0, first.to_owned()));
            entry.0 += how_many;
        }
    }

    pub(crate) fn report(&self, check: &mut Check) {
        for (what, (count, first)) in &self.counts {
            check.warn(format!("{count} {what} (first: {first})"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_bounded_and_says_what_it_left_out() {
        let mut check = Check::new("room.glb");
        for i in 0..MAX_LISTED + 7 {
            check.problem(&format!("node {i}"), "is bad", "mend it");
            check.warn(format!("warning {i}"));
            check.warn(format!("warning {i}"));
        }
        let (problems, warnings) = check.into_parts();
        assert_eq!(problems.len(), MAX_LISTED + 1);
        assert_eq!(problems[0].place, "room.glb: node 0");
        assert!(problems[MAX_LISTED].what.starts_with("7 more"));
        // A repeated warning past the limit cannot be told from a new one and is counted again.
        assert_eq!(warnings[MAX_LISTED], "14 more warnings");
    }
}
