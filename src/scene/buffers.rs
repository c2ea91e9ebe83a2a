//! The bytes of a document: buffers and the views on them (glTF 2.0, section 3.6.1), packed views unpacked.
//!
//! A view is compared with the bytes that are there, whatever its buffer claims.

use crate::scene::check::Check;
use crate::scene::compression;
use crate::scene::json::{self, Item};
use gltf::json::buffer::View;
use gltf::json::validation::USize64;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Bytes that all packed views of a document may unpack to.
const MAX_UNPACKED: usize = 1 << 30;
const AGAIN: &str = "export the file again";

/// A stretch of bytes that a buffer view names.
#[derive(Debug, Clone)]
pub(crate) struct Span {
    data: Arc<[u8]>,
    start: usize,
    end: usize,
    /// `byteStride`, if given.
    pub(crate) stride: Option<usize>,
}

impl Span {
    /// The bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        // Both ends were checked when the span was made.
        &self.data[self.start..self.end]
    }
}

/// The buffers of a document, some of which may be missing (that was reported where it was found).
#[derive(Debug, Clone)]
pub(crate) struct Buffers {
    /// In order of the JSON's `buffers`; empty where `sound` is false.
    pub(crate) bytes: Vec<Arc<[u8]>>,
    /// Are the bytes there?
    pub(crate) sound: Vec<bool>,
}

impl Buffers {
    /// Buffers that are all there.
    pub(crate) fn sound(bytes: Vec<Arc<[u8]>>) -> Self {
        let sound = vec![true; bytes.len()];
        Self { bytes, sound }
    }

    /// Bytes of all buffers together.
    pub(crate) fn total(&self) -> usize {
        self.bytes.iter().map(|bytes| bytes.len()).sum()
    }
}

/// A number of bytes or elements; what no machine has is too many everywhere.
pub(crate) fn size(number: USize64) -> usize {
    usize::try_from(number.0).unwrap_or(usize::MAX)
}

/// What EXT_meshopt_compression says besides where its bytes are.
#[derive(Debug, Deserialize)]
struct MeshoptView {
    #[serde(default)]
    count: usize,
    #[serde(default)]
    mode: String,
    filter: Option<String>,
}

/// The buffer views of one document; remembers what it unpacked.
#[derive(Debug)]
pub(crate) struct Views<'a> {
    json: &'a Value,
    buffers: &'a Buffers,
    unpacked: BTreeMap<usize, Option<Span>>,
    room: usize,
}

impl<'a> Views<'a> {
    pub(crate) fn new(json: &'a Value, buffers: &'a Buffers) -> Self {
        Self {
            json,
            buffers,
            unpacked: BTreeMap::new(),
            room: MAX_UNPACKED,
        }
    }

    /// The bytes of buffer view `index`, used at `place`.
    pub(crate) fn view(&mut self, index: usize, place: &str, check: &mut Check) -> Option<Span> {
        if let Some(known) = self.unpacked.get(&index) {
            return known.clone();
        }
        let mut item = json::referred(self.json, "bufferViews", "bufferView", index, place, check)?;
        item.place = format!("{place}, {}", item.place);
        for name in compression::MESHOPT {
            let Some(mut packed) = item.extended(name, check) else {
                continue;
            };
            packed.place = format!("{}, {name}", item.place);
            let span = self.unpack(&packed, check);
            self.unpacked.insert(index, span.clone());
            return span;
        }
        let span = self.stretch(&item, check)?;
        match span.stride {
            Some(0) => {
                check.problem(&item.place, "has a byteStride of 0", AGAIN);
                None
            }
            _ => Some(span),
        }
    }

    /// The stretch of a buffer that `buffer`, `byteOffset` and `byteLength` of an item name.
    fn stretch(&self, item: &Item<'_>, check: &mut Check) -> Option<Span> {
        let view = item.read::<View>(check)?;
        let buffer = view.buffer.value();
        let Some(data) = self.buffers.bytes.get(buffer) else {
            let what = format!("refers to buffer {buffer}, which the document does not have");
            check.problem(&item.place, what, AGAIN);
            return None;
        };
        if !self.buffers.sound[buffer] {
            return None;
        }
        let start = size(view.byte_offset.unwrap_or_default());
        let length = size(view.byte_length);
        let end = start.checked_add(length).filter(|&end| end <= data.len());
        let Some(end) = end else {
            let what = format!(
                "reaches from byte {start} over {length} bytes, but buffer {buffer} has {}",
                data.len()
            );
            check.problem(&item.place, what, AGAIN);
            return None;
        };
        Some(Span {
            data: Arc::clone(data),
            start,
            end,
            stride: view.byte_stride.map(|stride| stride.0),
        })
    }

    fn unpack(&mut self, packed: &Item<'_>, check: &mut Check) -> Option<Span> {
        let source = self.stretch(packed, check)?;
        let stride = source.stride.unwrap_or(0);
        let MeshoptView {
            count,
            mode,
            filter,
        } = packed.read(check)?;
        let filter = filter.as_deref().unwrap_or("NONE");
        match compression::unpack_meshopt(source.bytes(), stride, count, &mode, filter) {
            Ok(bytes) if bytes.len() > self.room => {
                let what = format!("the packed views hold more than {MAX_UNPACKED} bytes");
                check.problem("", what, "split or simplify the room");
                None
            }
            Ok(bytes) => {
                self.room -= bytes.len();
                Some(Span {
                    start: 0,
                    end: bytes.len(),
                    data: bytes.into(),
                    stride: Some(stride),
                })
            }
            Err(what) => {
                check.problem(&packed.place, what, "export without this compression");
                None
            }
        }
    }
}
