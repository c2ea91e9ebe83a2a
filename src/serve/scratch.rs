//! A folder for what the system's memory of files holds for a while, readable by its owner only, and gone in the end.

use crate::error::{Error, Result};
use std::fs;
use std::path::PathBuf;

/// The folder; it is made when it is first needed.
#[derive(Debug, Clone)]
pub(super) struct ScratchFolder(PathBuf);

impl ScratchFolder {
    /// A name that nobody else uses; `mark` is part of it.
    pub(super) fn new(mark: &str) -> Self {
        let name = format!("haarlight-{}-{mark}", std::process::id());
        Self(std::env::temp_dir().join(name))
    }

    /// Runs `work` on the path of a file. Where the system allows it the file and the folder are gone afterwards, though what
    /// was opened can be read on.
    pub(super) fn with<T>(&self, work: impl FnOnce(&std::path::Path) -> Result<T>) -> Result<T> {
        let mut builder = fs::DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        match builder.create(&self.0) {
            Err(problem) if problem.kind() != std::io::ErrorKind::AlreadyExists => {
                return Err(Error::io(&self.0, problem));
            }
            _ => {}
        }
        let done = work(&self.0.join("rows"));
        self.remove();
        done
    }

    /// Takes the folder away, with all that is in it.
    pub(super) fn remove(&self) {
        // It may not be there; and nothing more can be done where it cannot be removed.
        let _ = fs::remove_dir_all(&self.0);
    }
}
