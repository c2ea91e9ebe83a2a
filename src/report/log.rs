//! JSON lines: one record a line, written out at once, so that a running bake can be followed (`tail -f`) and a stopped
//! one leaves all it knew.
//!
//! So the log is the one file that is not put in place whole; a reader takes lines that end in a line feed.

use crate::error::{Error, Result};
use serde::Serialize;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// A log under way.
#[derive(Debug)]
pub struct Log<W: Write> {
    out: W,
    place: String,
}

impl Log<File> {
    /// Starts a log, over an old one of the same name.
    ///
    /// # Errors
    /// The file cannot be made.
    pub fn create(path: &Path) -> Result<Self> {
        let out = File::create(path).map_err(|problem| Error::io(path, problem))?;
        Ok(Self {
            out,
            place: path.display().to_string(),
        })
    }
}

impl<W: Write> Log<W> {
    /// Logs to a writer; `place` names it in messages.
    pub fn new(out: W, place: impl Into<String>) -> Self {
        Self {
            out,
            place: place.into(),
        }
    }

    /// Adds a record as one line and hands it to the system.
    ///
    /// Numbers that are not finite become `null`, as JSON has no others.
    ///
    /// # Errors
    /// The record does not serialise (internal fault), or the disk is full.
    pub fn write(&mut self, record: &impl Serialize) -> Result<()> {
        let mut line = serde_json::to_vec(record)
            .map_err(|problem| Error::Internal(format!("log: {problem}")))?;
        line.push(b'\n');
        let written = self.out.write_all(&line).and_then(|()| self.out.flush());
        written.map_err(|source| Error::Io {
            path: self.place.clone(),
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_line_is_on_disk_as_soon_as_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bake.log");
        std::fs::write(&path, "old\n").unwrap();
        let mut log = Log::create(&path).unwrap();
        log.write(&json!({ "round": 1, "text": "two\nlines" }))
            .unwrap();
        assert_eq!(
            std::fs::read_to_string(&path).unwrap(),
            "{\"round\":1,\"text\":\"two\\nlines\"}\n"
        );
        log.write(&json!({ "round": 2, "error": f64::NAN }))
            .unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<serde_json::Value> = text
            .lines()
            .map(|l| serde_json::from_str(l).unwrap())
            .collect();
        assert_eq!(lines[1], json!({ "round": 2, "error": null }));
    }

    #[test]
    fn a_full_disk_is_an_error_that_names_the_log() {
        let mut nothing: [u8; 0] = [];
        let message = Log::new(&mut nothing[..], "bake.log")
            .write(&1)
            .unwrap_err()
            .to_string();
        assert!(message.contains("bake.log"), "{message}");
    }
}
