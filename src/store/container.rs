//! The file around what is kept: magic, kind, version, program, body, checksum.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `\x89haarlt\n`: no text file begins so, and a transfer as text breaks it |
//! | 4 | kind: `ckpt` (checkpoint) or `rows` (cache for relighting) |
//! | 4 | version of the kind, u32 |
//! | .. | body, see [`Encoder`] |
//! | 16 each | start and length of what stands aside, in order: it is read when it is asked for |
//! | 8 | how many of these there are |
//! | 8 | XXH64 of everything before but what stands aside, which has checksums of its own |
//!
//! All numbers are little-endian. A file that is cut short, garbled, of another kind or version is refused with a
//! [`Problem`](crate::Problem) that says what to do.

use super::codec::{Broken, Decoder, Encoder, Plain, Read};
use crate::error::{Error, Result};
use crate::store::file;
use std::fs::File;
use std::io::{self, Read as _, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;
use xxhash_rust::xxh64::{Xxh64, xxh64};

const MAGIC: [u8; 8] = *b"\x89haarlt\n";
const HEADER: usize = 16;
/// Number of asides, and checksum.
const FOOTER: usize = 16;
/// Start and length of an aside.
const PLACE: usize = 16;

/// What a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// The state of a bake between two rounds.
    Checkpoint,
    /// What relighting needs.
    Cache,
}

impl FileKind {
    fn tag(self) -> [u8; 4] {
        match self {
            Self::Checkpoint => *b"ckpt",
            Self::Cache => *b"rows",
        }
    }

    /// Raised whenever the body changes its meaning.
    fn version(self) -> u32 {
        match self {
            Self::Checkpoint => 13,
            Self::Cache => 14,
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
    kind: FileKind,
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

/// Makes the body of a file that another rank writes, as others may need this one's part of it.
///
/// # Errors
/// Those of `body`.
pub fn unwritten(path: &Path, body: impl FnOnce(&mut Encoder) -> io::Result<()>) -> Result<()> {
    body(&mut Encoder::new(&mut io::sink())).map_err(|problem| Error::io(path, problem))
}

/// What is wrong with a header, if anything is.
fn check(header: &[u8], kind: FileKind) -> Read<()> {
    let name = kind.name();
    if !header.starts_with(&MAGIC) {
        return Err(Broken::new(format!("is no {name} of this program")));
    }
    let mut rest = Decoder::new(&header[MAGIC.len()..]);
    if rest.raw(4).map_err(|_| short(kind))? != kind.tag() {
        return Err(Broken::new(format!("holds something else than a {name}")));
    }
    let version: u32 = rest.get().map_err(|_| short(kind))?;
    if version != kind.version() {
        return Err(Broken::new(format!(
            "is a {name} of version {version}, this program knows version {}",
            kind.version()
        )));
    }
    Ok(())
}

fn short(kind: FileKind) -> Broken {
    Broken::new(format!("is a {} cut short or damaged", kind.name()))
}

/// What a file holds.
struct Opened {
    file: File,
    /// All but what stands aside, from the header to the number of asides.
    bytes: Vec<u8>,
    asides: Vec<[u64; 2]>,
}

/// Reads all but what stands aside.
fn open(path: &Path, kind: FileKind) -> io::Result<Read<Opened>> {
    let mut file = File::open(path)?;
    let size = file.metadata()?.len();
    let mut bytes = Vec::new();
    (&file).take(HEADER as u64).read_to_end(&mut bytes)?;
    if let Err(broken) = check(&bytes, kind) {
        return Ok(Err(broken));
    }
    // The end, as many bytes from the last as asked for.
    let last = |count: u64| -> io::Result<Option<Vec<u8>>> {
        let mut last = Vec::new();
        let Some(start) = size.checked_sub(count).filter(|&at| at >= HEADER as u64) else {
            return Ok(None);
        };
        (&file).seek(SeekFrom::Start(start))?;
        (&file).take(count).read_to_end(&mut last)?;
        Ok((last.len() as u64 == count).then_some(last))
    };
    let Some(footer) = last(FOOTER as u64)? else {
        return Ok(Err(short(kind)));
    };
    let [count, sum] = Plain::load(&footer);
    let places = u64::checked_mul(count, PLACE as u64).and_then(|n| n.checked_add(FOOTER as u64));
    let Some(places) = places.filter(|&n| n <= size) else {
        return Ok(Err(short(kind)));
    };
    let Some(last) = last(places)? else {
        return Ok(Err(short(kind)));
    };
    let end = size - places;
    let asides: Vec<[u64; 2]> = last[..last.len() - FOOTER]
        .chunks_exact(PLACE)
        .map(Plain::load)
        .collect();
    let mut at = HEADER as u64;
    for &[start, length] in &asides {
        let after = start
            .checked_add(length)
            .filter(|&after| start >= at && after <= end);
        let Some(after) = after else {
            return Ok(Err(short(kind)));
        };
        file.seek(SeekFrom::Start(at))?;
        (&file).take(start - at).read_to_end(&mut bytes)?;
        at = after;
    }
    file.seek(SeekFrom::Start(at))?;
    (&file).take(end - at).read_to_end(&mut bytes)?;
    let body = bytes.len();
    bytes.extend(&last[..last.len() - size_of::<u64>()]);
    if xxh64(&bytes, 0) != sum {
        return Ok(Err(short(kind)));
    }
    bytes.truncate(body);
    Ok(Ok(Opened {
        file,
        bytes,
        asides,
    }))
}

/// The checksum that should stand at the end of a file of these bytes, as far as they are one.
pub fn checksum(bytes: &[u8]) -> u64 {
    let front = &bytes[..bytes.len().saturating_sub(size_of::<u64>())];
    let mut sum = Xxh64::new(0);
    let mut at = 0;
    if let Some((before, count)) = front.split_last_chunk::<8>() {
        let count = usize::try_from(u64::from_le_bytes(*count)).unwrap_or(usize::MAX);
        let places = before.len().saturating_sub(count.saturating_mul(PLACE));
        for place in before[places..].chunks_exact(PLACE) {
            let [start, length] = <[u64; 2]>::load(place).map(|x| x as usize);
            sum.update(front.get(at..start).unwrap_or(&[]));
            at = start.saturating_add(length).min(front.len());
        }
    }
    sum.update(&front[at..]);
    sum.digest()
}

/// Reads a file through `decode`, which must use all of it.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Input`] for a file that is foreign, of another kind or version, cut
/// short or garbled, and for what `decode` finds.
pub fn read<T>(
    path: &Path,
    kind: FileKind,
    decode: impl FnOnce(&mut Decoder) -> Read<T>,
) -> Result<T> {
    let opened = open(path, kind).map_err(|problem| Error::io(path, problem))?;
    let decoded = opened.and_then(
        |Opened {
             file,
             bytes,
             asides,
         }| {
            let mut body = Decoder::new(&bytes[HEADER..]).beside(Arc::new(file), asides);
            let decoded = decode(&mut body)?;
            body.end()?;
            Ok(decoded)
        },
    );
    decoded.map_err(|Broken(what)| Error::input(path.display().to_string(), what, kind.next()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn file(list: &[u32]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let size = write(&path, FileKind::Cache, |out| out.put_all(list)).unwrap();
        assert_eq!(size, std::fs::metadata(&path).unwrap().len());
        (folder, path)
    }

    #[test]
    fn what_is_written_is_read_back() {
        let (_folder, path) = file(&[1, 2, 3]);
        let list = read(&path, FileKind::Cache, |from| from.get_all::<u32>()).unwrap();
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
        assert!(refused(&path, FileKind::Checkpoint).contains("something else than a checkpoint"));
        let part = read(&path, FileKind::Cache, |_| Ok(())).unwrap_err();
        assert!(part.to_string().contains("after its end"), "{part}");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[12] = 99;
        std::fs::write(&path, &bytes).unwrap();
        assert!(refused(&path, FileKind::Cache).contains("version 99"));
        std::fs::write(&path, b"").unwrap();
        assert!(refused(&path, FileKind::Cache).contains("no cache"));
        let text = refused(&folder.path().join("nowhere"), FileKind::Cache);
        assert!(text.contains("nowhere"), "{text}");
    }

    proptest! {
        /// Any change, cut or addition is found.
        #[test]
        fn damage_is_found(list in prop::collection::vec(any::<u32>(), 0..40), at in any::<usize>(), with in 1_u8.., cut in any::<usize>(), more in 1_usize..9) {
            let (_folder, path) = file(&list);
            let whole = std::fs::read(&path).unwrap();
            prop_assert_eq!(&checksum(&whole).to_le_bytes()[..], &whole[whole.len() - 8..]);
            let taken = |bytes: &[u8]| {
                std::fs::write(&path, bytes).unwrap();
                read(&path, FileKind::Cache, |from| from.get_all::<u32>()).is_ok()
            };
            prop_assert!(taken(&whole));
            let mut garbled = whole.clone();
            garbled[at % whole.len()] ^= with;
            prop_assert!(!taken(&garbled));
            prop_assert!(!taken(&whole[..cut % whole.len()]));
            garbled.clone_from(&whole);
            garbled.resize(whole.len() + more, 0);
            prop_assert!(!taken(&garbled));
        }
    }
}
