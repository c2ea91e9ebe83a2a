//! Where the bytes of a document may come from: files inside the document's own folder, and data URIs (RFC 2397).
//!
//! A room from a stranger must not read other files of the user. So a URI is a relative path without `..`, links that
//! lead out of the folder are refused, and so is everything that is not a regular file (a device or a pipe may never end).
//! Nothing is ever fetched from a network.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The longest piece of a refused URI that a message repeats.
const SHOWN: usize = 80;

/// Where the bytes of a URI are.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum UriTarget {
    /// In the URI itself; decoded.
    Here(Vec<u8>),
    /// In a file of the document's folder; two URIs of one file give the same path.
    File(PathBuf),
}

/// Follows a URI, or says in one sentence why not.
pub(crate) fn locate(folder: &Path, uri: &str) -> Result<UriTarget, String> {
    if has_prefix(uri, "data:") {
        return data(uri)
            .map(UriTarget::Here)
            .map_err(|e| format!("the data URI {e}"));
    }
    resolve(folder, uri).map(UriTarget::File)
}

/// The bytes behind a URI, or one sentence on why not.
pub(crate) fn read(folder: &Path, uri: &str) -> Result<Vec<u8>, String> {
    match locate(folder, uri)? {
        UriTarget::Here(bytes) => Ok(bytes),
        UriTarget::File(path) => read_file(&path).map_err(|e| format!("'{}' {e}", shown(uri))),
    }
}

/// The whole of a regular file, no more than it holds when it is opened.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, String> {
    // Ask before opening: to open a pipe without a writer waits for ever.
    let kind = std::fs::metadata(path).map_err(|e| format!("cannot be read ({e})"))?;
    if !kind.is_file() {
        return Err("is not a regular file".into());
    }
    let file = File::open(path).map_err(|e| format!("cannot be read ({e})"))?;
    let size = kind.len();
    let mut bytes = Vec::new();
    let capacity = usize::try_from(size).map_err(|_| "is too large for this machine")?;
    bytes
        .try_reserve_exact(capacity)
        .map_err(|_| format!("does not fit into memory ({size} bytes)"))?;
    file.take(size)
        .read_to_end(&mut bytes)
        .map_err(|e| format!("cannot be read ({e})"))?;
    Ok(bytes)
}

/// The file that a relative URI names, made sure to lie inside `folder`.
fn resolve(folder: &Path, uri: &str) -> Result<PathBuf, String> {
    let refuse = |why: &str| Err(format!("the URI '{}' {why}", shown(uri)));
    if uri.is_empty() {
        return Err("the URI is empty".into());
    }
    if let Some(scheme) = scheme(uri) {
        return refuse(&format!(
            "has the scheme '{}:', but only files beside the document and data URIs are read",
            shown(scheme)
        ));
    }
    let Some(decoded) = percent_decode(uri).and_then(|bytes| String::from_utf8(bytes).ok()) else {
        return refuse("is not valid percent-encoded UTF-8");
    };
    if decoded.contains('\0') || decoded.contains('\\') {
        return refuse("contains a character that no path of glTF may have");
    }
    if decoded.starts_with('/') || scheme(&decoded).is_some() || Path::new(&decoded).is_absolute() {
        return refuse("is absolute, but only files beside the document are read");
    }
    if decoded.split('/').any(|part| part == "..") {
        return refuse("climbs out of the document's folder with '..'");
    }
    let folder = folder
        .canonicalize()
        .map_err(|e| format!("the document's folder cannot be read ({e})"))?;
    let path = folder.join(&decoded);
    let real = match path.canonicalize() {
        Ok(real) => real,
        Err(e) => return refuse(&format!("cannot be read ({e})")),
    };
    if !real.starts_with(&folder) {
        return refuse("is a link that leads out of the document's folder");
    }
    Ok(real)
}

/// The scheme of a URI, if it has one (RFC 3986, section 3.1).
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut letters = scheme.chars();
    let first = letters.next()?;
    let rest = letters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    (first.is_ascii_alphabetic() && rest).then_some(scheme)
}

fn percent_decode(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len());
    let mut bytes = text.bytes();
    while let Some(byte) = bytes.next() {
        if byte == b'%' {
            let high = char::from(bytes.next()?).to_digit(16)?;
            let low = char::from(bytes.next()?).to_digit(16)?;
            // Two hexadecimal digits are below 256.
            out.push((high * 16 + low) as u8);
        } else {
            out.push(byte);
        }
    }
    Some(out)
}

fn data(uri: &str) -> Result<Vec<u8>, String> {
    let body = &uri["data:".len()..];
    let (head, body) = body.split_once(',').ok_or("has no comma")?;
    // The first part is the media type, which the bytes themselves tell better.
    let mut flags = head.split(';').skip(1);
    if flags.any(|flag| flag.eq_ignore_ascii_case("base64")) {
        base64(body).ok_or_else(|| "is not valid base64".into())
    } else {
        percent_decode(body).ok_or_else(|| "is not validly percent-encoded".into())
    }
}

/// Base64 (RFC 4648, section 4; the URL alphabet of section 5 is understood too); padding may be missing.
fn base64(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_end_matches('=');
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut bits, mut held) = (0u32, 0u32);
    for byte in text.bytes() {
        let six = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        bits = (bits << 6) | u32::from(six);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
            bits &= (1 << held) - 1;
        }
    }
    // One left-over letter (6 bits) cannot come from whole bytes.
    (held < 6).then_some(out)
}

fn has_prefix(text: &str, prefix: &str) -> bool {
    text.get(..prefix.len())
        .is_some_and(|head| head.eq_ignore_ascii_case(prefix))
}

fn shown(uri: &str) -> String {
    let mut text: String = uri.chars().take(SHOWN).collect();
    if text.len() < uri.len() {
        text.push_str("...");
    }
    text
}

/// The folder that a file lies in.
pub(super) fn folder_of(file: &Path) -> PathBuf {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(folder: &Path, uri: &str) -> String {
        read(folder, uri).unwrap_err()
    }

    #[test]
    fn files_of_the_folder_are_read() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("tex")).unwrap();
        std::fs::write(dir.path().join("tex/a b%.bin"), b"xyz").unwrap();
        assert_eq!(read(dir.path(), "tex/a%20b%25.bin").unwrap(), b"xyz");
        let place = |uri: &str| locate(dir.path(), uri).unwrap();
        assert_eq!(place("./tex//a b%25.bin"), place("tex/a%20b%25.bin"));
    }

    #[test]
    fn what_is_not_in_the_folder_is_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let inside = dir.path().join("inside");
        std::fs::create_dir(&inside).unwrap();
        std::fs::write(dir.path().join("secret"), b"s").unwrap();
        for uri in [
            "../secret",
            "a/../../secret",
            "%2e%2e/secret",
            "..%2fsecret",
        ] {
            let reason = reason(&inside, uri);
            assert!(reason.contains("'..'") && reason.contains(uri), "{reason}");
        }
        for uri in ["/etc/passwd", "%2Fetc/passwd", "//host/share"] {
            assert!(reason(&inside, uri).contains("absolute"), "{uri}");
        }
        for uri in [
            "http://host/a.bin",
            "file:///etc/passwd",
            "FILE:a.bin",
            "ftp:x",
        ] {
            assert!(reason(&inside, uri).contains("scheme"), "{uri}");
        }
        assert!(reason(&inside, "..\\secret").contains("character"));
        assert!(reason(&inside, "a%00b").contains("character"));
        assert!(reason(&inside, "a%zz").contains("percent"));
        assert!(reason(&inside, "").contains("empty"));
        assert!(reason(&inside, "missing.bin").contains("cannot be read"));
        assert!(reason(&inside, ".").contains("not a regular file"));
    }

    #[cfg(unix)]
    #[test]
    fn links_out_of_the_folder_and_special_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let inside = dir.path().join("inside");
        std::fs::create_dir(&inside).unwrap();
        std::fs::write(dir.path().join("secret"), b"s").unwrap();
        std::fs::write(inside.join("own"), b"o").unwrap();
        let link =
            |from: &str, to: &Path| std::os::unix::fs::symlink(to, inside.join(from)).unwrap();
        link("out", &dir.path().join("secret"));
        link("zero", Path::new("/dev/zero"));
        link("in", &inside.join("own"));
        assert!(reason(&inside, "out").contains("leads out"));
        assert!(reason(&inside, "zero").contains("leads out"));
        assert_eq!(read(&inside, "in").unwrap(), b"o");
        assert!(
            read_file(Path::new("/dev/zero"))
                .unwrap_err()
                .contains("regular")
        );
        let pipe = inside.join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        if made.is_ok_and(|status| status.success()) {
            assert!(reason(&inside, "pipe").contains("not a regular file"));
        }
    }

    #[test]
    fn data_uris() {
        let folder = Path::new(".");
        // Test vectors of RFC 4648, section 10.
        for (coded, plain) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE", "fooba"),
            ("Zm9vYmFy", "foobar"),
        ] {
            let uri = format!("data:image/png;base64,{coded}");
            assert_eq!(read(folder, &uri).unwrap(), plain.as_bytes());
        }
        assert_eq!(read(folder, "DATA:,a%20b").unwrap(), b"a b");
        assert!(reason(folder, "data:;base64,Z").contains("base64"));
        assert!(reason(folder, "data:;base64,Z!!!").contains("base64"));
        assert!(reason(folder, "data:nothing").contains("comma"));
    }
}
