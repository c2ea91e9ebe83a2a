//! The file itself: a GLB container (glTF 2.0, section 4.4) or plain JSON, told apart by the first bytes.
//!
//! Every length is compared with what the file holds before anything is done with it.

use crate::error::{Error, Result};
use serde_json::Value;

/// `glTF` as a little-endian number.
const MAGIC: &[u8] = b"glTF";
/// Chunk types of the standard.
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;
/// What a user can do about a damaged file.
const AGAIN: &str = "export or copy the file again";

/// The JSON of a document and the binary chunk, if the file has one.
#[derive(Debug)]
pub(crate) struct Container<'a> {
    /// The whole JSON.
    pub(crate) json: Value,
    /// The GLB's binary chunk, with its padding.
    pub(crate) bin: Option<&'a [u8]>,
    /// The file ends before its header says so, or goes on after it.
    pub(crate) warnings: Vec<String>,
}

/// Reads the container in `bytes`; `file` is for messages.
pub(crate) fn parse<'a>(file: &str, bytes: &'a [u8]) -> Result<Container<'a>> {
    if bytes.is_empty() {
        return Err(Error::input(file, "the file is empty", AGAIN));
    }
    if bytes.starts_with(MAGIC) {
        return glb(file, bytes);
    }
    if let Some(kind) = foreign(bytes) {
        let what = format!("this is {kind}, not glTF");
        return Err(Error::input(file, what, "give a .glb or .gltf file"));
    }
    Ok(Container {
        json: json(file, bytes)?,
        bin: None,
        warnings: Vec::new(),
    })
}

fn glb<'a>(file: &str, bytes: &'a [u8]) -> Result<Container<'a>> {
    let bad = |what: String| Error::input(file, what, AGAIN);
    let (Some(version), Some(length)) = (u32_at(bytes, 4), u32_at(bytes, 8)) else {
        return Err(bad("the GLB header is cut off".into()));
    };
    if version != 2 {
        let what = format!("GLB version {version}; only version 2 is read");
        return Err(Error::input(file, what, "export as glTF 2.0"));
    }
    if length > bytes.len() {
        let what = format!(
            "the GLB header claims {length} bytes, the file has {}",
            bytes.len()
        );
        return Err(bad(what));
    }
    let mut warnings = Vec::new();
    if length < bytes.len() {
        let more = bytes.len() - length;
        warnings.push(format!("{more} bytes after the end of the GLB are ignored"));
    }
    let mut rest = bytes
        .get(12..length)
        .ok_or_else(|| bad(format!("the GLB header claims a length of {length} bytes")))?;
    let (mut text, mut bin, mut chunk) = (None, None, 0);
    while !rest.is_empty() {
        let (Some(size), Some(kind)) = (u32_at(rest, 0), u32_at(rest, 4)) else {
            return Err(bad(format!("the header of GLB chunk {chunk} is cut off")));
        };
        let body = rest
            .get(8..)
            .and_then(|body| body.get(..size))
            .ok_or_else(|| {
                bad(format!(
                    "GLB chunk {chunk} claims {size} bytes, but {} are left",
                    rest.len() - 8
                ))
            })?;
        match (chunk, kind) {
            (0, k) if k == JSON as usize => text = Some(body),
            (1, k) if k == BIN as usize => bin = Some(body),
            (0, _) => return Err(bad("the first GLB chunk is not JSON".into())),
            // The standard asks clients to ignore chunks they do not know.
            _ => {}
        }
        // `body` was taken from this very range.
        rest = &rest[8 + size..];
        chunk += 1;
    }
    let text = text.ok_or_else(|| bad("the GLB has no JSON chunk".into()))?;
    Ok(Container {
        json: json(file, text)?,
        bin,
        warnings,
    })
}

fn json(file: &str, bytes: &[u8]) -> Result<Value> {
    // A byte order mark is against the standard, and common.
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    // Some writers pad the chunk with zeros instead of spaces.
    let end = bytes.iter().rposition(|&b| b != 0).map_or(0, |at| at + 1);
    let value: Value = serde_json::from_slice(&bytes[..end])
        .map_err(|e| Error::input(file, format!("the JSON cannot be read: {e}"), AGAIN))?;
    if !value.is_object() {
        return Err(Error::input(file, "the JSON is not an object", AGAIN));
    }
    Ok(value)
}

/// Files that are given by mistake, by their first bytes.
fn foreign(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], &str); 7] = [
        (b"PK\x03\x04", "a zip archive"),
        (b"\x1F\x8B", "a gzip file"),
        (b"\x89PNG", "a PNG image"),
        (b"\xFF\xD8\xFF", "a JPEG image"),
        (b"BLENDER", "a Blender file"),
        (b"Kaydara FBX", "an FBX file"),
        (b"<?xml", "an XML file"),
    ];
    let found = kinds.iter().find(|(magic, _)| bytes.starts_with(magic));
    found.map(|(_, kind)| *kind)
}

/// The little-endian number at `at`.
fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    let number = u32::from_le_bytes(four.try_into().ok()?);
    usize::try_from(number).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(kind: u32, body: &[u8]) -> Vec<u8> {
        let size = u32::try_from(body.len()).unwrap();
        [&size.to_le_bytes(), &kind.to_le_bytes(), body].concat()
    }

    fn file(chunks: &[Vec<u8>]) -> Vec<u8> {
        let body = chunks.concat();
        let length = u32::try_from(12 + body.len()).unwrap();
        [
            MAGIC,
            &2u32.to_le_bytes(),
            &length.to_le_bytes(),
            body.as_slice(),
        ]
        .concat()
    }

    fn what(bytes: &[u8]) -> String {
        parse("f.glb", bytes).unwrap_err().to_string()
    }

    #[test]
    fn reads_both_chunks_and_skips_unknown_ones() {
        let good = file(&[
            chunk(JSON, br#"{"a":1}  "#),
            chunk(BIN, &[1, 2, 3, 4]),
            chunk(7, &[9; 8]),
        ]);
        let container = parse("f.glb", &good).unwrap();
        assert_eq!(container.json["a"], 1);
        assert_eq!(container.bin, Some(&[1, 2, 3, 4][..]));
        let longer = [good.as_slice(), &[0; 3]].concat();
        assert_eq!(parse("f.glb", &longer).unwrap().warnings.len(), 1);
        assert!(parse("f.gltf", b"\xEF\xBB\xBF {}").unwrap().bin.is_none());
    }

    #[test]
    fn every_truncation_is_an_error() {
        let good = file(&[chunk(JSON, b"{}  "), chunk(BIN, &[0; 8])]);
        for end in 0..good.len() {
            assert!(parse("f.glb", &good[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn lengths_are_not_believed() {
        let good = file(&[chunk(JSON, b"{}  "), chunk(BIN, &[0; 8])]);
        let with = |at: usize, number: u32| {
            let mut bytes = good.clone();
            bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
            bytes
        };
        assert!(what(&with(4, 1)).contains("version 1"));
        assert!(what(&with(8, u32::MAX)).contains("claims 4294967295 bytes"));
        assert!(what(&with(8, 3)).contains("length of 3"));
        assert!(what(&with(12, u32::MAX)).contains("chunk 0 claims"));
        assert!(what(&with(16, 5)).contains("not JSON"));
        assert!(what(&with(24, 9)).contains("chunk 1 claims 9 bytes, but 8 are left"));
    }

    #[test]
    fn other_files_are_named() {
        assert!(what(b"PK\x03\x04....").contains("zip"));
        assert!(what(b"").contains("empty"));
        assert!(what(b"hello").contains("JSON cannot be read"));
        assert!(what(b"[1]").contains("not an object"));
        let deep = [vec![b'['; 100_000]].concat();
        assert!(what(&deep).contains("recursion"));
    }
}
