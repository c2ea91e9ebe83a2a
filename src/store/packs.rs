//! Many short pieces of bytes, in blocks that stay in the file until they are asked for: 4 bytes a piece beside its own,
//! and a checksum (8 bytes) a block. What is read once a relighting need not fill the memory.

use super::codec::{Aside, Broken, Decoder, Encoder, Read};
use rayon::prelude::*;
use std::io;
use xxhash_rust::xxh64::{Xxh64, xxh64};

/// The length of a piece that is not there.
const MISSING: u32 = u32::MAX;

/// Pieces that may be missing.
#[derive(Debug)]
pub struct Packs {
    lengths: Vec<u32>,
    blocks: Vec<BlockEntry>,
    bytes: Aside,
}

/// Where the pieces of a block stand, and the checksum of their bytes.
#[derive(Debug)]
struct BlockEntry {
    start: u64,
    length: usize,
    sum: u64,
}

impl Packs {
    /// Pieces of a block.
    pub const BLOCK: usize = 256;

    /// Writes pieces down.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn encode(pieces: &[Option<&[u8]>], out: &mut Encoder) -> io::Result<()> {
        let length = |piece: &Option<&[u8]>| piece.map_or(MISSING, |p| p.len() as u32);
        out.put_list(pieces.len(), pieces.iter().map(length))?;
        let mut sums = Vec::with_capacity(pieces.len().div_ceil(Self::BLOCK));
        out.aside(|out| {
            for block in pieces.chunks(Self::BLOCK) {
                let mut sum = Xxh64::new(0);
                for piece in block.iter().flatten() {
                    sum.update(piece);
                    out.write_all(piece)?;
                }
                sums.push(sum.digest());
            }
            Ok(pieces.iter().flatten().map(|p| p.len() as u64).sum())
        })?;
        out.put_all(&sums)
    }

    /// Finds them again.
    ///
    /// # Errors
    /// [`Broken`]: there are fewer bytes than pieces need, or more.
    pub fn decode(from: &mut Decoder) -> Read<Self> {
        let lengths: Vec<u32> = from.get_all()?;
        let bytes = from.get_aside()?;
        let sums: Vec<u64> = from.get_exactly(lengths.len().div_ceil(Self::BLOCK))?;
        let mut blocks = Vec::with_capacity(sums.len());
        let mut end = 0;
        for (lengths, sum) in lengths.chunks(Self::BLOCK).zip(sums) {
            let there = lengths.iter().filter(|&&length| length != MISSING);
            let length: u64 = there.map(|&length| u64::from(length)).sum();
            blocks.push(BlockEntry {
                start: end,
                length: length as usize,
                sum,
            });
            end += length;
        }
        if end != bytes.len() {
            return Err(Broken::new("has pieces that do not fit"));
        }
        Ok(Self {
            lengths,
            blocks,
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

    /// The pieces of a block in order; `buffer` holds their bytes.
    ///
    /// # Errors
    /// [`Broken`]: the file changed or is damaged, or cannot be read.
    fn block<'b>(
        &self,
        k: usize,
        buffer: &'b mut Vec<u8>,
    ) -> Read<impl Iterator<Item = Option<&'b [u8]>>> {
        let BlockEntry { start, length, sum } = self.blocks[k];
        buffer.resize(length, 0);
        self.bytes.read(start, buffer)?;
        if xxh64(buffer, 0) != sum {
            return Err(Broken::new("is cut short or damaged"));
        }
        let first = k * Self::BLOCK;
        let lengths = &self.lengths[first..(first + Self::BLOCK).min(self.lengths.len())];
        let mut rest: &'b [u8] = buffer;
        Ok(lengths.iter().map(move |&length| {
            (length != MISSING).then(|| {
                let (piece, after) = rest.split_at(length as usize);
                rest = after;
                piece
            })
        }))
    }

    /// Turns every piece into one entry of `out`, which must be as long, in parallel: `each` gets the piece and its entry.
    ///
    /// # Errors
    /// As [`Packs::decode`], or what `each` finds.
    pub fn for_each<T: Send>(
        &self,
        out: &mut [T],
        each: impl Fn(Option<&[u8]>, &mut T) -> Read<()> + Sync,
    ) -> Read<()> {
        out.par_chunks_mut(Self::BLOCK)
            .enumerate()
            .take(self.blocks.len())
            .try_for_each_init(Vec::new, |buffer, (k, out)| {
                let mut pieces = self.block(k, buffer)?;
                out.iter_mut()
                    .try_for_each(|out| each(pieces.next().flatten(), out))
            })
    }

    /// All pieces, copied.
    ///
    /// # Errors
    /// As [`Packs::for_each`].
    pub fn to_vec(&self) -> Read<Vec<Option<Box<[u8]>>>> {
        let mut all = vec![None; self.len()];
        self.for_each(&mut all, |piece, out| {
            *out = piece.map(Box::from);
            Ok(())
        })?;
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{FileKind, container};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pieces_come_back(
            pieces in prop::collection::vec(prop::option::of(prop::collection::vec(any::<u8>(), 0..9)), 0..600),
            at in any::<prop::sample::Index>(),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a");
            let all: Vec<Option<&[u8]>> = pieces.iter().map(Option::as_deref).collect();
            container::write(&path, FileKind::Cache, |out| {
                out.put(1_u8)?;
                Packs::encode(&all, out)?;
                out.put(2_u8)
            })
            .unwrap();
            let read = |path| container::read(path, FileKind::Cache, |from| {
                assert_eq!(from.get::<u8>()?, 1);
                let packs = Packs::decode(from)?;
                assert_eq!(from.get::<u8>()?, 2);
                assert_eq!(packs.len(), all.len());
                packs.to_vec()
            });
            let back = read(&path).unwrap();
            for (back, piece) in back.iter().zip(&all) {
                prop_assert_eq!(back.as_deref(), *piece);
            }
            // A byte of a piece that changed is found when it is read.
            let mut bytes = std::fs::read(&path).unwrap();
            let at = at.index(bytes.len());
            bytes[at] ^= 4;
            std::fs::write(&path, &bytes).unwrap();
            prop_assert!(read(&path).is_err());
        }
    }
}
