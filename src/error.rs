//! The one error of the crate: what went wrong, where, and what to do next.

use std::fmt;

/// One thing that is wrong with the input.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Problem {
    /// Where: file, then node, mesh, primitive or material by index and name, e.g. `room.glb: mesh 3 'chair', primitive 0`.
    pub place: String,
    /// What is wrong, one sentence without a full stop.
    pub what: String,
    /// What the user can do about it, one sentence without a full stop.
    pub next: String,
}

impl Problem {
    /// A problem at a place, with the way out.
    pub fn new(place: impl Into<String>, what: impl Into<String>, next: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            what: what.into(),
            next: next.into(),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; {}", self.place, self.what, self.next)
    }
}

/// Everything that can stop a bake.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The input cannot be used; every problem found is listed (exit code 2).
    #[error("{}", list(.0))]
    Input(Vec<Problem>),
    /// A file could not be read or written (exit code 2).
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// A fault of this program (exit code 3).
    #[error("internal fault: {0}; please report it with the room")]
    Internal(String),
}

impl Error {
    /// One input problem.
    pub fn input(
        place: impl Into<String>,
        what: impl Into<String>,
        next: impl Into<String>,
    ) -> Self {
        Self::Input(vec![Problem::new(place, what, next)])
    }

    /// A failed read or write of `path`.
    pub fn io(path: &std::path::Path, source: std::io::Error) -> Self {
        Self::Io {
            path: path.display().to_string(),
            source,
        }
    }

    /// The exit code of the command for this error.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) | Self::Io { .. } => 2,
            Self::Internal(_) => 3,
        }
    }
}

/// The result of anything that can fail here.
pub type Result<T> = std::result::Result<T, Error>;

fn list(problems: &[Problem]) -> String {
    match problems {
        [one] => one.to_string(),
        many => {
            let lines: Vec<String> = many.iter().map(|p| format!("  - {p}")).collect();
            format!("{} problems:\n{}", many.len(), lines.join("\n"))
        }
    }
}
