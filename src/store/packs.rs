//! Many short pieces of bytes in one: their ends, and all bytes after each other. 4 bytes a piece beside its own.

use super::codec::{Broken, Decoder, Encoder, Piece, Read};
use std::io;

/// The length of a piece that is not there.
const MISSING: u32 = u32::MAX;

/// Pieces that may be missing.
#[derive(Debug, Clone)]
pub struct Packs {
    /// Where each begins.
    starts: Vec<usize>,
    lengths: Vec<u32>,
    bytes: Piece,
}

impl Packs {
    /// Writes pieces down.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn encode<'a>(
        pieces: impl Iterator<Item = Option<&'a [u8]>> + Clone,
        out: &mut Encoder,
    ) -> io::Result<()> {
        let lengths = |piece: Option<&[u8]>| piece.map_or(MISSING, |p| p.len() as u32);
        let all: Vec<u32> = pieces.clone().map(lengths).collect();
        out.put_all(&all)?;
        out.put(
            pieces
                .clone()
                .flatten()
                .map(|p| p.len() as u64)
                .sum::<u64>(),
        )?;
        for piece in pieces.flatten() {
            out.raw(piece)?;
        }
        Ok(())
    }

    /// Reads them back.
    ///
    /// # Errors
    /// [`Broken`]: there are fewer bytes than pieces need, or more.
    pub fn decode(from: &mut Decoder) -> Read<Self> {
        let lengths: Vec<u32> = from.get_all()?;
        let bytes = from.get_piece()?;
        let mut starts = Vec::with_capacity(lengths.len());
        let mut end = 0;
        for &length in &lengths {
            starts.push(end);
            end += if length == MISSING {
                0
            } else {
                length as usize
            };
        }
        if end != bytes.bytes().len() {
            return Err(Broken::new("has pieces that do not fit"));
        }
        Ok(Self {
            starts,
            lengths,
            bytes,
        })
    }

    /// Number of pieces.
    pub fn len(&self) -> usize {
        self.lengths.len()
    }

    /// No pieces?
    pub fn is_empty(&self) -> bool {
        self.lengths.is_empty()
    }

    /// A piece, if it is there.
    pub fn get(&self, k: usize) -> Option<&[u8]> {
        let (start, length) = (self.starts[k], self.lengths[k]);
        (length != MISSING).then(|| &self.bytes.bytes()[start..start + length as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pieces_come_back(pieces in prop::collection::vec(prop::option::of(prop::collection::vec(any::<u8>(), 0..9)), 0..20)) {
            let mut bytes = Vec::new();
            let all = pieces.iter().map(Option::as_deref);
            Packs::encode(all, &mut Encoder::new(&mut bytes)).unwrap();
            let packs = Packs::decode(&mut Decoder::new(&bytes)).unwrap();
            prop_assert_eq!(packs.len(), pieces.len());
            for (k, piece) in pieces.iter().enumerate() {
                prop_assert_eq!(packs.get(k), piece.as_deref());
            }
            bytes.pop();
            prop_assert!(pieces.iter().all(Option::is_none) || Packs::decode(&mut Decoder::new(&bytes)).is_err());
        }
    }
}
