//! The file around what is kept: magic, kind, version, program, body, checksum.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `\x89haarlt\n`: no text file begins so, and a transfer as text breaks it |
//! | 4 | kind: `ckpt` (checkpoint) or `rows` (cache for relighting) |
//! | 4 | version of the kind, u32 |
//! | .. | body, see [`Encoder`] |
//! | 8 | XXH64 of everything before |
//!
//! All numbers are little-endian. A file that is cut short, garbled, of another kind or version is refused with a
//! [`Problem`](crate::Problem) that says what to do.

use super::codec::{Broken, Decoder, Encoder, Read};
use super::hash;
use crate::error::{Error, Result};
use crate::output::file;
use std::io;
use std::path::Path;
use std::sync::Arc;

const MAGIC: [u8; 8] = *b"\x89haarlt\n";
const HEADER: usize = 16;
const CHECKSUM: usize = 8;

/// What a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The state of a bake between two rounds.
    Checkpoint,
    /// What relighting needs.
    Cache,
}

impl Kind {
    fn tag(self) -> [u8; 4] {
        match self {
            Self::Checkpoint => *b"ckpt",
            Self::Cache => *b"rows",
        }
    }

    /// Raised whenever the body changes its meaning.
    fn version(self) -> u32 {
        match self {
            Self::Checkpoint | Self::Cache => 1,
        }
    }

    /// In messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Checkpoint => "checkpoint",
            Self::Cache => "cache",
        }
    }

    /// The way out of a file that cannot be used.
    pub fn next(self) -> &'static str {
        match self {
            Self::Checkpoint => "name another file or remove this one, and the bake starts afresh",
            Self::Cache => "bake the room again with --cache",
        }
    }
}

/// Writes a file in one go; its size in bytes.
///
/// # Errors
/// As [`file::write_atomic`].
pub fn write(
    path: &Path,
    kind: Kind,
    body: impl FnOnce(&mut Encoder) -> io::Result<()>,
) -> Result<u64> {
    let mut size = 0;
    file::write_atomic(path, None, |out| {
        let mut encoder = Encoder::new(out);
        encoder.raw(&MAGIC)?;
        encoder.raw(&kind.tag())?;
        encoder.put(kind.version())?;
        body(&mut encoder)?;
        size = encoder.finish()?;
        Ok(())
    })?;
    Ok(size)
}

/// The body of a file's bytes.
///
/// # Errors
/// [`Broken`]: foreign, of another kind or version, cut short or garbled.
pub fn body(bytes: &[u8], kind: Kind) -> Read<Decoder<'_>> {
    let name = kind.name();
    if !bytes.starts_with(&MAGIC) {
        return Err(Broken::new(format!("is no {name} of this program")));
    }
    if bytes.len() < HEADER + CHECKSUM {
        return Err(Broken::new(format!("is a {name} cut short")));
    }
    let (front, sum) = bytes.split_at(bytes.len() - CHECKSUM);
    let mut header = Decoder::new(front);
    header.raw(MAGIC.len())?;
    if header.raw(4)? != kind.tag() {
        return Err(Broken::new(format!("holds something else than a {name}")));
    }
    let version: u32 = header.get()?;
    if version != kind.version() {
        return Err(Broken::new(format!(
            "is a {name} of version {version}, this program knows version {}",
            kind.version()
        )));
    }
    if hash::of(front).to_le_bytes() != sum {
        return Err(Broken::new(format!("is a {name} cut short or damaged")));
    }
    Ok(header)
}

/// Reads a file through `decode`, which must use all of it.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Input`] for what [`body`] or `decode` finds.
pub fn read<T>(path: &Path, kind: Kind, decode: impl FnOnce(&mut Decoder) -> Read<T>) -> Result<T> {
    let bytes = std::fs::read(path).map_err(|problem| Error::io(path, problem))?;
    let bytes = Arc::new(bytes);
    let decoded = body(&bytes, kind).and_then(|body| {
        let mut body = body.owned_by(&bytes);
        let decoded = decode(&mut body)?;
        body.end()?;
        Ok(decoded)
    });
    decoded.map_err(|Broken(what)| Error::input(path.display().to_string(), what, kind.next()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn file(list: &[u32]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let size = write(&path, Kind::Cache, |out| out.put_all(list)).unwrap();
        assert_eq!(size, std::fs::metadata(&path).unwrap().len());
        (folder, path)
    }

    #[test]
    fn what_is_written_is_read_back() {
        let (_folder, path) = file(&[1, 2, 3]);
        let list = read(&path, Kind::Cache, |from| from.get_all::<u32>()).unwrap();
        assert_eq!(list, [1, 2, 3]);
    }

    #[test]
    fn other_files_are_refused_with_a_way_out() {
        let (folder, path) = file(&[1]);
        let refused = |path: &Path, kind| {
            let error = read(path, kind, |from| from.get_all::<u32>()).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            error.to_string()
        };
        assert!(refused(&path, Kind::Checkpoint).contains("something else than a checkpoint"));
        let part = read(&path, Kind::Cache, |_| Ok(())).unwrap_err();
        assert!(part.to_string().contains("after its end"), "{part}");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[12] = 9;
        std::fs::write(&path, &bytes).unwrap();
        assert!(refused(&path, Kind::Cache).contains("version 9"));
        std::fs::write(&path, b"").unwrap();
        assert!(refused(&path, Kind::Cache).contains("no cache"));
        let text = refused(&folder.path().join("nowhere"), Kind::Cache);
        assert!(text.contains("nowhere"), "{text}");
    }

    proptest! {
        /// Any change, cut or addition is found.
        #[test]
        fn damage_is_found(list in prop::collection::vec(any::<u32>(), 0..40), at in any::<usize>(), with in 1_u8.., cut in any::<usize>(), more in 1_usize..9) {
            let mut whole = Vec::new();
            let mut out = Encoder::new(&mut whole);
            out.raw(&MAGIC).unwrap();
            out.raw(&Kind::Cache.tag()).unwrap();
            out.put(Kind::Cache.version()).unwrap();
            out.put_all(&list).unwrap();
            out.finish().unwrap();
            prop_assert!(body(&whole, Kind::Cache).is_ok());
            let mut garbled = whole.clone();
            garbled[at % whole.len()] ^= with;
            prop_assert!(body(&garbled, Kind::Cache).is_err());
            prop_assert!(body(&whole[..cut % whole.len()], Kind::Cache).is_err());
            whole.resize(whole.len() + more, 0);
            prop_assert!(body(&whole, Kind::Cache).is_err());
        }
    }
}
