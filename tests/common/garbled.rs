//! Files of the project's own format in which some bytes are others.

use haarlight::store::container;
use proptest::prelude::*;
use proptest::sample::Index;

/// Bytes of the checksum at the end.
const SIGNATURE: usize = 8;

/// A few places, and what stands there: so many of the bytes.
pub(crate) fn changes() -> impl Strategy<Value = Vec<(Index, [u8; 8], usize)>> {
    prop::collection::vec((any::<Index>(), any::<[u8; 8]>(), 1_usize..9), 1..4)
}

/// A file with changes and without its checksum, cut somewhere if that is said. `early`: changes are where the lengths of the first lists are.
pub(crate) fn garbled(
    file: &[u8],
    changes: Vec<(Index, [u8; 8], usize)>,
    early: bool,
    cut: Option<Index>,
) -> Vec<u8> {
    let mut bytes = file[..file.len() - SIGNATURE].to_vec();
    for (at, with, count) in changes {
        let at = at.index(if early { 4096 } else { bytes.len() });
        for (byte, x) in bytes.iter_mut().skip(at).zip(&with[..count]) {
            *byte = *x;
        }
    }
    if let Some(cut) = cut {
        bytes.truncate(cut.index(bytes.len()));
    }
    bytes
}

/// Adds the right checksum.
pub(crate) fn sign(bytes: &mut Vec<u8>) {
    bytes.extend([0; SIGNATURE]);
    let sum = container::checksum(bytes);
    bytes.truncate(bytes.len() - SIGNATURE);
    bytes.extend(sum.to_le_bytes());
}
