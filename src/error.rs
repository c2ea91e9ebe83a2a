//! The one error of the crate: what went wrong, where, and what to do next.

use std::fmt;

/// One thing that is wrong with the input.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
#[non_exhaustive]
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

    /// The file that the place begins with; none where the problem lies in an option or an argument.
    pub fn file(&self) -> Option<&str> {
        let file = self.place.split(": ").next()?;
        let is_option = file.starts_with('-') || file.is_empty();
        (!is_option && std::path::Path::new(file).extension().is_some()).then_some(file)
    }

    /// The thing of a kind (`node`, `mesh`, `primitive`, `material`, `light` ...) that the place names, by index, name or both.
    ///
    /// ```
    /// use haarlight::Problem;
    /// let problem = Problem::new("room.glb: node 4 'Chair', mesh 1 'seat'", "has no POSITION", "export it again");
    /// assert_eq!(problem.file(), Some("room.glb"));
    /// assert_eq!(problem.named("node"), Some((Some(4), Some("Chair"))));
    /// assert_eq!(problem.named("material"), None);
    /// ```
    pub fn named(&self, kind: &str) -> Option<(Option<usize>, Option<&str>)> {
        let marked = format!("{kind} ");
        let starts = self.place.match_indices(&marked);
        let mut tails = starts
            .filter(|(at, _)| *at == 0 || self.place[..*at].ends_with(' '))
            .map(|(at, _)| &self.place[at + marked.len()..]);
        tails.find_map(|tail| {
            let digits = tail.len() - tail.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            let index = tail[..digits].parse().ok();
            let name = tail[digits..].trim_start().strip_prefix('\'').map(quoted);
            (index.is_some() || name.is_some()).then_some((index, name))
        })
    }
}

/// The text up to the quote that closes it; one inside a name is followed by more of the name.
fn quoted(text: &str) -> &str {
    let closes = |at: usize| matches!(text[at + 1..].chars().next(), None | Some(',' | ':'));
    let end = text
        .match_indices('\'')
        .map(|(at, _)| at)
        .find(|&at| closes(at));
    &text[..end.unwrap_or(text.len())]
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; {}", self.place, self.what, self.next)
    }
}

/// Everything that can stop a bake.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_name_files_and_things() {
        let named = |place: &str, kind: &str| {
            let problem = Problem::new(place, "is bad", "mend it");
            let (index, name) = problem.named(kind)?;
            Some((index, name.map(str::to_owned)))
        };
        let text = |name: &str| Some(name.to_owned());
        let place = "room.glb: material 'Bob's wall: north', reflectance";
        assert_eq!(
            named(place, "material"),
            Some((None, text("Bob's wall: north")))
        );
        assert_eq!(named(place, "node"), None);
        let place = "a/b.gltf: node 4, light 'Spot'";
        assert_eq!(named(place, "node"), Some((Some(4), None)));
        assert_eq!(named(place, "light"), Some((None, text("Spot"))));
        assert_eq!(named("node 3 'x'", "node"), Some((Some(3), text("x"))));
        let file = |place: &str| Problem::new(place, "", "").file().map(str::to_owned);
        assert_eq!(file("a/b.gltf: node 4"), text("a/b.gltf"));
        assert_eq!(file("-o x.glb"), None);
        assert_eq!(file("node 4"), None);
    }
}
