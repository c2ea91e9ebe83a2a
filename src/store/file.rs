//! Files appear whole or not at all: written under a temporary name in the same folder, synced, then renamed.
//!
//! A crash or a full disk leaves the old file (or none) in place. It does not lock against a second writer of the same
//! path; the last one to finish wins. Devices and pipes stay what they are: they are written to as they stand. Links are
//! followed, and stay.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Bytes gathered before they go to the system.
const BUFFER: usize = 1 << 20;

/// Writes `path` through `fill`. Nothing is left behind when `fill` or the system fails.
///
/// `input` is the room that was read, if any: it is never overwritten.
///
/// ```
/// use std::io::Write;
/// let folder = std::env::temp_dir().join(format!("haarlight-doc-{}", std::process::id()));
/// std::fs::create_dir_all(&folder)?;
/// let path = folder.join("a.txt");
/// haarlight::store::file::write_atomic(&path, None, |w| w.write_all(b"light"))?;
/// assert_eq!(std::fs::read(&path)?, b"light");
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// `path` is the input room, its folder is missing or not writable, or `fill` fails.
pub fn write_atomic(
    path: &Path,
    input: Option<&Path>,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<()> {
    if input.is_some_and(|input| same_file(path, input)) {
        return Err(Error::input(
            path.display().to_string(),
            "the output would overwrite the room that was read",
            "give another name with -o",
        ));
    }
    // A file renamed to /dev/null would take the place of the device, one renamed to a link that of the link.
    if fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
        let device = fs::OpenOptions::new().write(true).open(path);
        let written = device.and_then(|device| filled(device, fill));
        return written
            .map(drop)
            .map_err(|problem| Error::io(path, problem));
    }
    let path = &fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let temporary = temporary_name(path)?;
    let written = File::create_new(&temporary)
        .and_then(|file| filled(file, fill)?.sync_all())
        .and_then(|()| fs::rename(&temporary, path));
    if let Err(problem) = written {
        // The first problem is the one to report; the file may not even exist.
        let _ = fs::remove_file(&temporary);
        return Err(Error::io(path, problem));
    }
    Ok(())
}

/// `file` with all that `fill` writes.
fn filled(
    file: File,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> std::io::Result<File> {
    let mut out = BufWriter::with_capacity(BUFFER, file);
    fill(&mut out)?;
    Ok(out.into_inner()?)
}

/// `.NAME.PID.tmp` beside the target: a rename inside one folder is atomic, across file systems it is not.
fn temporary_name(path: &Path) -> Result<PathBuf> {
    let Some(name) = path.file_name() else {
        return Err(Error::input(
            path.display().to_string(),
            "this is not the name of a file",
            "name a file",
        ));
    };
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.tmp", std::process::id()));
    let temporary = path.with_file_name(hidden);
    // Left over from a killed process of the same number; nobody else uses this name.
    let _ = fs::remove_file(&temporary);
    Ok(temporary)
}

/// Do two paths name one file? Links are followed; a path that does not exist equals nothing.
fn same_file(a: &Path, b: &Path) -> bool {
    matches!((fs::canonicalize(a), fs::canonicalize(b)), (Ok(a), Ok(b)) if a == b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_a_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        fs::write(&path, b"old").unwrap();
        write_atomic(&path, None, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// As root, a file renamed to /dev/null would replace it for the whole machine.
    #[test]
    #[cfg(unix)]
    fn pipes_and_links_stay_what_they_are() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let made = std::process::Command::new("mkfifo")
            .arg(at("pipe"))
            .status();
        assert!(made.unwrap().success());
        let reader = std::thread::spawn({
            let pipe = at("pipe");
            move || fs::read(pipe).unwrap()
        });
        write_atomic(&at("pipe"), None, |w| w.write_all(b"light")).unwrap();
        // First, as the reader of a pipe that was replaced may wait for ever.
        let pipe = fs::metadata(at("pipe")).unwrap();
        assert!(pipe.file_type().is_fifo());
        assert_eq!(reader.join().unwrap(), b"light");

        fs::write(at("file"), b"old").unwrap();
        symlink(at("file"), at("link")).unwrap();
        write_atomic(&at("link"), None, |w| w.write_all(b"new")).unwrap();
        assert!(fs::symlink_metadata(at("link")).unwrap().is_symlink());
        assert_eq!(fs::read(at("file")).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn a_failure_keeps_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        fs::write(&path, b"old").unwrap();
        let result = write_atomic(&path, None, |w| {
            w.write_all(b"half")?;
            Err(std::io::Error::other("disk full"))
        });
        assert!(result.unwrap_err().to_string().contains("disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn the_input_is_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let room = folder.path().join("room.glb");
        fs::write(&room, b"room").unwrap();
        let roundabout = folder.path().join(".").join("room.glb");
        assert!(write_atomic(&roundabout, Some(&room), |w| w.write_all(b"x")).is_err());
        assert_eq!(fs::read(&room).unwrap(), b"room");
    }

    #[test]
    fn a_missing_folder_is_an_error_that_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("no").join("out.bin");
        let message = write_atomic(&path, None, |_| Ok(()))
            .unwrap_err()
            .to_string();
        assert!(message.contains("out.bin"), "{message}");
    }
}
