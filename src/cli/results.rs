//! Results on stdout.

use crate::error::{Error, Result};
use std::io::{ErrorKind, Write};

/// Writes a result to stdout.
pub(super) fn print(text: &str) -> Result<()> {
    put(&mut std::io::stdout().lock(), text)
}

/// Writes a result. A reader that has had enough (`| head`) is no error.
pub(super) fn put(out: &mut impl Write, text: &str) -> Result<()> {
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(problem) if problem.kind() != ErrorKind::BrokenPipe => {
            Err(Error::io("standard output".as_ref(), problem))
        }
        _ => Ok(()),
    }
}
