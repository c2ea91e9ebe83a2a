//! The text of a file of photometric data, read line by line or number by number; each with its line for messages.

use super::Fault;

/// Longest piece of a file that a message repeats.
const SHOWN: usize = 24;
/// Ctrl-Z, with which files of MS-DOS end.
const END: char = '\u{1a}';

/// UTF-8 as a rule; what is not is taken for Latin-1, in which older files are written.
pub(super) fn decoded(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.trim_start_matches('\u{feff}').to_owned(),
        Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
    }
}

/// A file being read.
pub(super) struct Lines<'a> {
    lines: Vec<&'a str>,
    /// The next line, from 0.
    at: usize,
    /// What is left of the line before, while numbers are read.
    rest: &'a str,
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        // Old Macintosh files end their lines with a carriage return alone.
        let lines: Vec<&str> = match text.contains('\n') {
            true => text.lines().collect(),
            false => text.split('\r').collect(),
        };
        Self {
            lines,
            at: 0,
            rest: "",
        }
    }

    /// The line that was read last, from 1.
    pub(super) fn line(&self) -> usize {
        self.at.max(1)
    }

    /// The next whole line, without blanks at its ends.
    pub(super) fn next_line(&mut self, what: &str) -> Result<&'a str, Fault> {
        self.rest = "";
        let line = self.lines.get(self.at).ok_or_else(|| self.ended(what))?;
        self.at += 1;
        Ok(line.trim())
    }

    /// The next number, whatever line it stands on; blanks and commas are between numbers.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, Fault> {
        match self.word() {
            Some(word) => self.parsed(word, what),
            None => Err(self.ended(what)),
        }
    }

    /// What stands between two blanks or commas next, whatever line it stands on.
    fn word(&mut self) -> Option<&'a str> {
        let between = |c: char| c.is_whitespace() || c == ',' || c == END;
        loop {
            self.rest = self.rest.trim_start_matches(between);
            if !self.rest.is_empty() {
                break;
            }
            self.rest = self.lines.get(self.at)?;
            self.at += 1;
        }
        let end = self.rest.find(between).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        Some(word)
    }

    /// The table is read: a number that still follows belongs to a table of another size. Words are a remark.
    pub(super) fn end(&mut self, next: &str) -> Result<(), Fault> {
        match self.word() {
            Some(word) if word.parse::<f64>().is_ok() => {
                let short: String = word.chars().take(SHOWN).collect();
                Err(self.fault(format!("'{short}' follows on the last intensity"), next))
            }
            _ => Ok(()),
        }
    }

    /// The next line as one number, with a point or a comma before its decimals; what follows a blank is a remark.
    pub(super) fn line_number(&mut self, what: &str) -> Result<f64, Fault> {
        let line = self.next_line(what)?;
        let ends = |c: char| c.is_whitespace() || c == END;
        let word = line.split(ends).next().unwrap_or("");
        self.parsed(&word.replace(',', "."), what)
    }

    /// A number of so many things from 0 to `most`.
    pub(super) fn count(&self, number: f64, most: usize, what: &str) -> Result<usize, Fault> {
        if number.fract() == 0.0 && (0.0..=most as f64).contains(&number) {
            // Exact: a whole number in range.
            return Ok(number as usize);
        }
        let what = format!("{what} is {number}, not a whole number from 0 to {most}");
        Err(self.fault(what, "mend the number"))
    }

    /// `count` numbers.
    pub(super) fn list(&mut self, count: usize, what: &str) -> Result<Vec<f64>, Fault> {
        // No memory is set aside beforehand: a count may be a lie.
        (0..count).map(|_| self.number(what)).collect()
    }

    /// The same, one a line.
    pub(super) fn column(&mut self, count: usize, what: &str) -> Result<Vec<f64>, Fault> {
        (0..count).map(|_| self.line_number(what)).collect()
    }

    /// A fault of the line that was read last.
    pub(super) fn fault(&self, what: impl Into<String>, next: impl Into<String>) -> Fault {
        Fault {
            line: self.line(),
            what: what.into(),
            next: next.into(),
        }
    }

    fn parsed(&self, word: &str, what: &str) -> Result<f64, Fault> {
        let number = word.parse::<f64>().ok().filter(|x| x.is_finite());
        number.ok_or_else(|| {
            let short: String = word.chars().take(SHOWN).collect();
            self.fault(
                format!("'{short}' stands where {what} should be"),
                "write a number there",
            )
        })
    }

    fn ended(&self, what: &str) -> Fault {
        self.fault(
            format!("the file ends before {what}"),
            "get the whole file from the lamp's maker",
        )
    }
}
